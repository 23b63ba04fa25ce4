//! Hears Ctrl-C, `kill` and the end of the terminal.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;

/// How often it is looked whether to stop.
const LISTEN: Duration = Duration::from_millis(50);
/// The exit code of a program that was interrupted.
const INTERRUPTED: i32 = 130;

/// Lets the first of these signals set a flag and the second one end the program.
///
/// A signal that the parent had ignored stays ignored: `nohup` does so with the hang-up, and a shell with Ctrl-C for what it
/// runs in the background.
pub(super) fn listen(stop: &Arc<AtomicBool>) {
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        if is_ignored(signal) {
            continue;
        }
        // In this order: the first signal must not find the flag that it sets itself. Without a handler the signal ends the
        // program at once, which the store survives as well.
        let _ = flag::register_conditional_shutdown(signal, INTERRUPTED, Arc::clone(stop))
            .and_then(|_| flag::register(signal, Arc::clone(stop)));
    }
}

/// Waits, unless a flag is set meanwhile; tells whether to go on.
pub(super) fn wait(time: Duration, stop: &AtomicBool) -> bool {
    let begun = Instant::now();
    while begun.elapsed() < time && !stop.load(Ordering::Relaxed) {
        std::thread::sleep(LISTEN.min(time));
    }
    !stop.load(Ordering::Relaxed)
}

/// Tells whether the program was started with a signal ignored; where the system does not say so, the hang-up is taken to be.
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").ok();
    let mask = status.as_deref().and_then(ignored);
    mask.map_or(signal == SIGHUP, |mask| mask >> (signal - 1) & 1 == 1)
}

/// Finds the mask of ignored signals in what Linux says of a process.
fn ignored(status: &str) -> Option<u64> {
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"))?;
    u64::from_str_radix(mask.trim(), 16).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mask_of_ignored_signals_is_read() {
        assert_eq!(
            ignored("Name:\tcat\nSigBlk:\t0000000000000000\nSigIgn:\t0000000000001001\nSigCgt:\t0\n"),
            Some(0x1001)
        );
        assert_eq!(ignored("Name:\tcat\n"), None);
        assert_eq!(ignored("SigIgn:\tnone\n"), None);
    }
}
