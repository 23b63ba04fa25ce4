//! Asks again what did not answer.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::error::Fault;

/// How long is waited between two tries, at first and at most.
const FIRST: Duration = Duration::from_millis(500);
const LAST: Duration = Duration::from_secs(8);
/// How often a request to stop is looked for.
const LISTEN: Duration = Duration::from_millis(50);

/// How long one that does not answer is asked again.
#[derive(Debug)]
pub(super) struct Patience {
    longest: Duration,
    stop: Arc<AtomicBool>,
}

impl Patience {
    /// Asks once.
    pub(super) fn none(stop: &Arc<AtomicBool>) -> Self {
        Self { longest: Duration::ZERO, stop: Arc::clone(stop) }
    }

    pub(super) fn of(self, longest: Duration) -> Self {
        Self { longest, ..self }
    }

    /// Asks until there is an answer, or for too long, or nobody wants it any more.
    pub(super) fn with<T>(&self, ask: impl Fn() -> Result<T, Fault>) -> Result<T, Fault> {
        let (begun, mut wait) = (Instant::now(), FIRST);
        loop {
            match ask() {
                Err(Fault::Away(why)) if begun.elapsed() < self.longest => {
                    tracing::info!(%why, "the shared store does not answer");
                    self.pause(wait)?;
                    wait = (wait * 2).min(LAST);
                }
                answer => return answer,
            }
        }
    }

    fn pause(&self, wait: Duration) -> Result<(), Fault> {
        let begun = Instant::now();
        while begun.elapsed() < wait {
            if self.stop.load(Ordering::Relaxed) {
                return Err(Fault::Interrupted);
            }
            std::thread::sleep(LISTEN);
        }
        Ok(())
    }
}
