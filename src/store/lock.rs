//! Takes and awaits locks of files, and tells one that somebody has from one that cannot be had.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use super::error::stopped;

/// How soon, and at most how late, one who waits for a lock tries again.
const SOON: Duration = Duration::from_millis(1);
const LATE: Duration = Duration::from_millis(50);

/// Opens the file of a lock; makes it, and the folder it is in, where they are not there.
pub(super) fn open_lock(path: &Path) -> io::Result<File> {
    let open = || OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
    match (open(), path.parent()) {
        (Err(error), Some(folder)) if error.kind() == io::ErrorKind::NotFound => {
            fs::create_dir_all(folder)?;
            open()
        }
        (opened, _) => opened,
    }
}

/// Waits again if a signal ends the waiting.
pub(super) fn uninterrupted(mut wait: impl FnMut() -> io::Result<()>) -> io::Result<()> {
    loop {
        match wait() {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            done => return done,
        }
    }
}

/// Waits for a lock until it is there or the waiting is to end.
pub(super) fn wait(stop: &AtomicBool, attempt: impl Fn() -> Result<(), TryLockError>) -> io::Result<()> {
    if got(attempt())? {
        return Ok(());
    }
    let _span = tracing::info_span!("lock wait").entered();
    let mut pause = SOON;
    loop {
        if got(attempt())? {
            return Ok(());
        }
        if stop.load(Ordering::Relaxed) {
            return Err(stopped());
        }
        std::thread::sleep(pause);
        pause = (pause * 2).min(LATE);
    }
}

/// Takes the lock of an open file unless somebody has it; returns whether it did.
pub(super) fn try_lock(file: &File) -> io::Result<bool> {
    got(file.try_lock())
}

/// Tells a lock that somebody has from one that cannot be had, as on a file system without locks.
fn got(attempt: Result<(), TryLockError>) -> io::Result<bool> {
    match attempt {
        Ok(()) => Ok(true),
        Err(TryLockError::WouldBlock) => Ok(false),
        Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Interrupted => Ok(false),
        Err(TryLockError::Error(error)) => Err(error),
    }
}

/// Opens the file of a lock that is there. Some network file systems lock only what is open for writing; where nobody may
/// write, reading must do.
pub(super) fn open_existing(path: &Path) -> io::Result<File> {
    match OpenOptions::new().read(true).write(true).open(path) {
        Err(error) if matches!(error.kind(), io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem) => {
            File::open(path)
        }
        opened => opened,
    }
}

/// Tells whether a path still names an open file: whoever had the lock before may have removed it since it was opened.
pub(super) fn is_still(file: &File, path: &Path) -> bool {
    match (file.metadata(), fs::metadata(path)) {
        (Ok(open), Ok(named)) => (open.dev(), open.ino()) == (named.dev(), named.ino()),
        _ => false,
    }
}

/// Removes the file of a lock that nobody has; returns whether it did.
pub(super) fn remove_stale(path: &Path) -> bool {
    let Ok(file) = open_existing(path) else { return false };
    matches!(try_lock(&file), Ok(true)) && is_still(&file, path) && fs::remove_file(path).is_ok()
}

#[cfg(test)]
mod tests {
    use super::super::StoreError;
    use super::super::error::failed;
    use super::*;

    #[test]
    fn only_a_lock_that_somebody_has_counts_as_taken() {
        let check = |attempt, expected: Result<bool, io::ErrorKind>| {
            assert_eq!(got(attempt).map_err(|error| error.kind()), expected);
        };
        let error = |number| Err(TryLockError::Error(io::Error::from_raw_os_error(number)));
        check(Ok(()), Ok(true));
        check(Err(TryLockError::WouldBlock), Ok(false));
        check(error(libc::EINTR), Ok(false));
        for number in [libc::ENOLCK, libc::ENOSYS, libc::EBADF, libc::EIO] {
            check(error(number), Err(io::Error::from_raw_os_error(number).kind()));
        }
    }

    #[test]
    fn waiting_ends_when_it_is_to() {
        let stop = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| wait(&stop, || Err(TryLockError::WouldBlock)));
            std::thread::sleep(Duration::from_millis(20));
            assert!(!waiting.is_finished());
            stop.store(true, Ordering::Relaxed);
            let error = waiting.join().expect("does not panic").expect_err("was stopped");
            assert!(matches!(failed(Path::new(""), "lock", Path::new(""))(error), StoreError::Interrupted));
        });
    }
}
