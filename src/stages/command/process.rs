//! Runs a program in a process group of its own, and ends all of it.

use std::fs::File;
use std::io;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// How long a program may take to end after it was asked to.
const GRACE: Duration = Duration::from_secs(5);
/// How often it is looked after, at first and at last.
const LOOKS: (Duration, Duration) = (Duration::from_micros(500), Duration::from_millis(20));

/// How a program ended.
#[derive(Debug)]
pub(super) struct Ended {
    pub status: ExitStatus,
    /// The most memory in bytes that it or one of its children held.
    pub memory: u64,
    pub why: Why,
}

/// Why it ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Why {
    Itself,
    Cancelled,
    TimedOut,
}

/// Runs a program to its end with its output in a file; it is stopped when `cancelled` says so or after so long.
///
/// Whatever it has started in its process group ends with it, and it ends with this process.
pub(super) fn run(
    command: &mut Command,
    log: File,
    timeout: Option<Duration>,
    cancelled: &dyn Fn() -> bool,
) -> io::Result<Ended> {
    let _span = tracing::info_span!("command", program = ?command.get_program()).entered();
    let parent = std::process::id();
    command.stdin(Stdio::null()).stdout(log.try_clone()?).stderr(log).process_group(0);
    // SAFETY: between fork and exec only calls are made that are safe in a signal handler.
    unsafe {
        command.pre_exec(move || end_with(parent));
    }
    let child = command.spawn()?;
    let group = Group(child.id().cast_signed());
    let (begun, mut look) = (Instant::now(), LOOKS.0);
    let mut why = Why::Itself;
    while !group.has_ended()? {
        why = match timeout {
            _ if cancelled() => Why::Cancelled,
            Some(timeout) if begun.elapsed() >= timeout => Why::TimedOut,
            _ => {
                std::thread::sleep(look);
                look = (look * 2).min(LOOKS.1);
                continue;
            }
        };
        group.stop()?;
    }
    // Its id is not free before it is waited for, so that the group is still its own.
    group.signal(libc::SIGKILL);
    let (status, memory) = group.wait()?;
    Ok(Ended { status, memory, why })
}

/// Lets a new process end when its parent does, which has this id.
fn end_with(parent: u32) -> io::Result<()> {
    #[cfg(target_os = "linux")]
    // SAFETY: both calls read and write nothing of this process's memory.
    unsafe {
        if libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL) != 0 {
            return Err(io::Error::last_os_error());
        }
        // It may have died before it was asked for.
        if libc::getppid().cast_unsigned() != parent {
            return Err(io::Error::from_raw_os_error(libc::ESRCH));
        }
    }
    let _ = parent;
    Ok(())
}

/// A process group by the id of its first process, which has not been waited for.
struct Group(libc::pid_t);

impl Group {
    /// Tells whether the first process has ended; it is not waited for.
    fn has_ended(&self) -> io::Result<bool> {
        let options = libc::WEXITED | libc::WNOHANG | libc::WNOWAIT;
        // SAFETY: all bytes of a `siginfo_t` may be zero.
        let mut about: libc::siginfo_t = unsafe { std::mem::zeroed() };
        // SAFETY: `about` outlives the call.
        let done = unsafe { libc::waitid(libc::P_PID, self.0.cast_unsigned(), &mut about, options) };
        match done {
            // SAFETY: the call has filled it in, or left the zeros.
            0 => Ok(unsafe { about.si_pid() } != 0),
            _ => match io::Error::last_os_error() {
                error if error.kind() == io::ErrorKind::Interrupted => Ok(false),
                error => Err(error),
            },
        }
    }

    /// Asks all of it to end, and makes it if it does not.
    fn stop(&self) -> io::Result<()> {
        self.signal(libc::SIGTERM);
        let asked = Instant::now();
        while !self.has_ended()? {
            if asked.elapsed() >= GRACE {
                self.signal(libc::SIGKILL);
            }
            std::thread::sleep(LOOKS.1);
        }
        Ok(())
    }

    fn signal(&self, signal: libc::c_int) {
        // SAFETY: the call reads and writes nothing of this process's memory. It fails if nobody is left, which is fine.
        unsafe { libc::killpg(self.0, signal) };
    }

    /// Waits for the first process; returns how it ended and the most memory that it or one of its children held.
    fn wait(&self) -> io::Result<(ExitStatus, u64)> {
        let mut status = 0;
        // SAFETY: all bytes of a `rusage` may be zero.
        let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
        loop {
            // SAFETY: `status` and `usage` outlive the call.
            if unsafe { libc::wait4(self.0, &mut status, 0, &mut usage) } == self.0 {
                let kibibytes = u64::try_from(usage.ru_maxrss).unwrap_or(0);
                return Ok((ExitStatus::from_raw(status), kibibytes * 1024));
            }
            let error = io::Error::last_os_error();
            if error.kind() != io::ErrorKind::Interrupted {
                return Err(error);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Seek};

    use super::*;

    fn shell(script: &str, timeout: Option<Duration>, cancelled: &dyn Fn() -> bool) -> (Ended, String) {
        let mut log = tempfile::tempfile().expect("makes");
        let mut command = Command::new("sh");
        let ended = run(command.args(["-c", script]), log.try_clone().expect("clones"), timeout, cancelled);
        log.rewind().expect("rewinds");
        let mut said = String::new();
        log.read_to_string(&mut said).expect("reads");
        (ended.expect("runs"), said)
    }

    #[test]
    fn a_program_runs_to_its_end() {
        let (ended, said) = shell("echo out; echo err >&2; exit 3", None, &|| false);
        assert_eq!((ended.status.code(), ended.why, said.as_str()), (Some(3), Why::Itself, "out\nerr\n"));
        assert!(ended.memory > 100 << 10, "{}", ended.memory);
    }

    #[test]
    fn whatever_it_started_ends_with_it() {
        let alive = |said: &str| {
            let state = std::fs::read_to_string(format!("/proc/{}/stat", said.trim()));
            // What was killed may wait for its new parent to take note.
            state.is_ok_and(|state| !state.contains(") Z "))
        };
        let ends_soon = |said: &str| {
            let begun = Instant::now();
            while alive(said) && begun.elapsed() < Duration::from_secs(20) {
                std::thread::sleep(Duration::from_millis(5));
            }
            assert!(!alive(said), "{said}");
        };
        let (ended, said) = shell("sleep 600 & echo $!", None, &|| false);
        assert_eq!(ended.why, Why::Itself);
        ends_soon(&said);
        let (ended, said) = shell("sleep 600 & echo $!; wait", Some(Duration::from_millis(300)), &|| false);
        assert_eq!((ended.why, ended.status.signal()), (Why::TimedOut, Some(libc::SIGTERM)));
        ends_soon(&said);
        let begun = Instant::now();
        let (ended, said) = shell("sleep 600 & echo $!; wait", None, &|| begun.elapsed().as_millis() > 300);
        assert_eq!(ended.why, Why::Cancelled);
        ends_soon(&said);
    }

    #[test]
    fn a_program_that_is_not_there_is_an_error() {
        let log = tempfile::tempfile().expect("makes");
        let error = run(&mut Command::new("no-such-program"), log, None, &|| false).expect_err("is not there");
        assert_eq!(error.kind(), io::ErrorKind::NotFound);
    }
}
