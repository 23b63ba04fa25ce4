//! Where the one asynchronous crate meets a synchronous program: everything else of it only waits here.

use std::future::Future;
use std::pin::pin;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use tokio::runtime::{Builder, Runtime};

use super::error::Fault;

/// How often a request to stop is looked for.
const LISTEN: Duration = Duration::from_millis(50);
/// Threads that serve connections; the work beside them (hashing, files) is done by those who wait.
const THREADS: usize = 2;

/// Runs requests to their end, for threads that wait for them.
#[derive(Debug)]
pub(super) struct Bridge {
    /// Set from outside to end the waiting.
    stop: Arc<AtomicBool>,
    /// None until something is asked for: who needs nothing from elsewhere starts no threads.
    runtime: Mutex<Option<Arc<Runtime>>>,
    requests: AtomicU64,
}

impl Bridge {
    pub(super) fn new(stop: &Arc<AtomicBool>) -> Self {
        Self { stop: Arc::clone(stop), runtime: Mutex::new(None), requests: AtomicU64::new(0) }
    }

    /// Returns how many requests there were, without those that were tried again.
    pub(super) fn requests(&self) -> u64 {
        self.requests.load(Ordering::Relaxed)
    }

    /// Makes a request and waits for it, but not longer than a limit, and not when it is not wanted any more.
    pub(super) fn ask<T>(
        &self,
        limit: Duration,
        request: impl Future<Output = object_store::Result<T>>,
    ) -> Result<T, Fault> {
        self.requests.fetch_add(1, Ordering::Relaxed);
        self.wait(limit, request)
    }

    /// Waits for what belongs to a request that was made already.
    pub(super) fn wait<T>(
        &self,
        limit: Duration,
        work: impl Future<Output = object_store::Result<T>>,
    ) -> Result<T, Fault> {
        let runtime = self.runtime()?;
        runtime.block_on(async {
            let (begun, mut work) = (Instant::now(), pin!(work));
            loop {
                // In this order: what is stopped already asks for nothing.
                if self.stop.load(Ordering::Relaxed) {
                    return Err(Fault::Interrupted);
                }
                match tokio::time::timeout(LISTEN, work.as_mut()).await {
                    Ok(done) => return done.map_err(Fault::from),
                    Err(_) if begun.elapsed() >= limit => return Err(Fault::timed_out(limit)),
                    Err(_) => {}
                }
            }
        })
    }

    /// Does something last, whether it is still wanted or not, but not for long.
    pub(super) fn part<T>(&self, limit: Duration, work: impl Future<Output = object_store::Result<T>>) {
        if let Ok(runtime) = self.runtime() {
            let _ = runtime.block_on(async { tokio::time::timeout(limit, work).await });
        }
    }

    fn runtime(&self) -> Result<Arc<Runtime>, Fault> {
        let mut runtime = self.runtime.lock().expect("nothing panics while it holds this lock");
        if let Some(runtime) = &*runtime {
            return Ok(Arc::clone(runtime));
        }
        let started = Builder::new_multi_thread().worker_threads(THREADS).thread_name("remote").enable_all().build();
        let started = Arc::new(started.map_err(|error| Fault::Away(format!("no thread could be started: {error}")))?);
        *runtime = Some(Arc::clone(&started));
        Ok(started)
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        let runtime = self.runtime.get_mut().ok().and_then(Option::take).and_then(Arc::into_inner);
        // What was given up may still hang: nobody waits for that.
        if let Some(runtime) = runtime {
            runtime.shutdown_background();
        }
    }
}
