//! Reads files that somebody else may have put there: never waits for a writer, never reads without an end.

use std::fs::{self, File, FileType, OpenOptions};
use std::io::{self, Read};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;

/// Opens a regular file for reading; links are followed.
///
/// # Errors
/// If it cannot be opened, or if it is a folder, a pipe, a socket or a device. It does not wait for the writer of a pipe.
pub fn open_regular(path: &Path) -> io::Result<File> {
    // Opening a device may do something to it already.
    check_type(fs::metadata(path)?.file_type())?;
    // Somebody may put a pipe there meanwhile: opening that must not wait for a writer.
    let file = OpenOptions::new().read(true).custom_flags(libc::O_NONBLOCK).open(path)?;
    check_type(file.metadata()?.file_type())?;
    Ok(file)
}

/// Reads a regular file of at most so many bytes.
///
/// # Errors
/// As [`open_regular`], and if the file is larger, whatever size it says it has.
pub fn read_bounded(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let file = open_regular(path)?;
    let size = file.metadata()?.len();
    if size > limit {
        return Err(too_large(limit));
    }
    let mut bytes = Vec::with_capacity(usize::try_from(size).unwrap_or(0));
    // Some files, such as those in `/proc`, say that they are empty, and others grow.
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit { Err(too_large(limit)) } else { Ok(bytes) }
}

fn too_large(limit: u64) -> io::Error {
    let limit = if limit < 1 << 20 { format!("{limit} bytes") } else { format!("{} MiB", limit >> 20) };
    io::Error::new(io::ErrorKind::FileTooLarge, format!("it has more than {limit}, which is too large for such a file"))
}

fn check_type(kind: FileType) -> io::Result<()> {
    let (reason, what) = if kind.is_file() {
        return Ok(());
    } else if kind.is_dir() {
        (io::ErrorKind::IsADirectory, "a folder")
    } else if kind.is_fifo() {
        (io::ErrorKind::InvalidInput, "a pipe (FIFO)")
    } else if kind.is_socket() {
        (io::ErrorKind::InvalidInput, "a socket")
    } else {
        (io::ErrorKind::InvalidInput, "a device")
    };
    Err(io::Error::new(reason, format!("it is {what}, not a regular file")))
}

#[cfg(test)]
mod tests {
    use std::os::unix::net::UnixListener;
    use std::process::Command;

    use super::*;

    #[test]
    fn what_is_no_regular_file_is_refused_at_once() {
        let folder = tempfile::tempdir().expect("creates");
        let path = |name: &str| folder.path().join(name);
        let made = Command::new("mkfifo").arg(path("pipe")).status().expect("starts");
        assert!(made.success());
        std::os::unix::fs::symlink("pipe", path("link")).expect("links");
        let _socket = UnixListener::bind(path("socket")).expect("binds");
        let refused = |path: &Path, what: &str| {
            for error in [open_regular(path).map(drop), read_bounded(path, 1 << 30).map(drop)] {
                let error = error.expect_err("is no regular file");
                assert_eq!(error.to_string(), format!("it is {what}, not a regular file"));
            }
        };
        refused(folder.path(), "a folder");
        refused(&path("pipe"), "a pipe (FIFO)");
        refused(&path("link"), "a pipe (FIFO)");
        refused(&path("socket"), "a socket");
        refused(Path::new("/dev/zero"), "a device");
        let missing = read_bounded(&path("nowhere"), 1).expect_err("is not there");
        assert_eq!(missing.kind(), io::ErrorKind::NotFound);
    }

    #[test]
    fn more_than_the_limit_is_refused() {
        let file = tempfile::NamedTempFile::new().expect("creates");
        fs::write(file.path(), "12345").expect("writes");
        for limit in [5, 6, u64::MAX] {
            assert_eq!(read_bounded(file.path(), limit).expect("fits"), b"12345");
        }
        for limit in [0, 4] {
            let error = read_bounded(file.path(), limit).expect_err("is too large");
            assert_eq!(error.kind(), io::ErrorKind::FileTooLarge);
        }
        // A sparse file of a terabyte costs nothing to make and must cost nothing to refuse.
        file.as_file().set_len(1 << 40).expect("grows");
        let error = read_bounded(file.path(), 64 << 20).expect_err("is too large");
        assert!(error.to_string().contains("64 MiB"), "{error}");
    }

    #[test]
    fn a_file_that_says_it_is_empty_is_read_to_its_end() {
        let path = Path::new("/proc/self/status");
        if path.exists() {
            assert!(read_bounded(path, 1 << 20).expect("reads").starts_with(b"Name:"));
            assert_eq!(read_bounded(path, 10).expect_err("is larger").kind(), io::ErrorKind::FileTooLarge);
        }
    }
}
