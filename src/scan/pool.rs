//! Threads that scan one map together, for a localizer whose map is larger than the processor's
//! cache.
//!
//! The threads are started once and sleep between frames. Each takes the next chunk of the map
//! until all are taken, and so does the caller. The caller never waits for another thread: it scans
//! those chunks itself that were taken and whose results have not come when all are taken. So a
//! thread that wakes late does less, and one that is delayed or dead does not hold a frame up. Rows
//! are independent of each other, so the results do not depend on the thread, to the last bit.

use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::{fmt, io, mem, process};

use super::Job;
use super::chunks::Chunks;
use super::mailbox::Mailbox;
use crate::map::Map;

/// Bytes of rows for each thread that is started by default: two for 16 MB. Two threads against
/// one, whole pushes on a Xeon with 2 MB of cache for each core, AVX-512, medians: 1.0 times as
/// fast at 3.7 MB, 1.3 at 8 MB, 1.5 at 16 MB, 1.7 at 33 MB, 1.9 at 205 MB. On a machine whose cores
/// are all busy, waking others gains nothing and can cost the caller its turn, so small maps, which
/// are scanned within one turn, get no threads.
const BYTES_A_THREAD: usize = 8 << 20;
/// The threads of one localizer, and the data that they share.
pub(crate) struct Pool {
    /// Threads do not survive a fork: in a child, `process` is the parent's.
    process: u32,
    shared: Arc<Chunks>,
    workers: Vec<Worker>,
    /// The number of this frame: results of other frames are ignored.
    generation: u64,
    /// The chunks whose results are in place.
    done: Vec<bool>,
}

struct Worker {
    mailbox: Arc<Mailbox>,
    thread: JoinHandle<()>,
}

/// The number of threads that suits a map of this size: one for every `BYTES_A_THREAD`, up to the
/// number of cores.
pub(crate) fn threads_for(map: &Map) -> usize {
    let worth = map.rows() * map.dim() * map.dtype().size() / BYTES_A_THREAD;
    // Asking the system for the number of cores takes a while, so small maps do not ask.
    if worth < 2 {
        1
    } else {
        thread::available_parallelism().map_or(1, |cores| worth.min(cores.get()))
    }
}

impl Pool {
    /// A pool of `threads`, including the caller's own.
    ///
    /// # Errors
    /// If the system does not start that many.
    pub(crate) fn new(map: &Arc<Map>, threads: usize) -> io::Result<Self> {
        let mut pool = Self::alone(map, threads);
        for _ in 1..threads {
            pool.spawn()?;
        }
        Ok(pool)
    }

    /// A pool of `threads`, or of the number that the system starts.
    pub(crate) fn at_most(map: &Arc<Map>, threads: usize) -> Self {
        let mut pool = Self::alone(map, threads);
        while pool.threads() < threads && pool.spawn().is_ok() {}
        pool
    }

    /// The caller alone, with chunks for `threads`.
    fn alone(map: &Arc<Map>, threads: usize) -> Self {
        let shared = Arc::new(Chunks::new(map, threads));
        let done = vec![false; shared.len()];
        Self { process: process::id(), shared, workers: Vec::new(), generation: 0, done }
    }

    fn spawn(&mut self) -> io::Result<()> {
        let mailbox = Arc::new(Mailbox::new(&self.shared.map, self.done.len()));
        let (shared, own) = (Arc::clone(&self.shared), Arc::clone(&mailbox));
        let thread =
            thread::Builder::new().name("surefix".to_owned()).spawn(move || own.serve(&shared))?;
        self.workers.push(Worker { mailbox, thread });
        Ok(())
    }

    /// The number of threads that scan, including the caller's own.
    pub(crate) fn threads(&self) -> usize {
        1 + self.workers.len()
    }

    /// Writes the results for all rows into `out`, on all threads.
    pub(crate) fn scan(&mut self, job: Job<'_>, out: &mut [f32]) {
        if self.workers.is_empty() || self.is_forked() {
            return job.scan(&self.shared.map, 0..self.shared.map.rows(), out);
        }
        let Self { shared, workers, generation, done, .. } = self;
        *generation += 1;
        done.fill(false);
        shared.restart();
        for worker in &*workers {
            worker.mailbox.post(*generation, job);
        }
        while let Some(chunk) = shared.take() {
            shared.scan(chunk, job, out);
            done[chunk] = true;
        }
        loop {
            for worker in &*workers {
                worker.mailbox.collect(*generation, shared, out, done);
            }
            let Some(missing) = done.iter().position(|done| !done) else { return };
            shared.scan(missing, job, out);
            done[missing] = true;
        }
    }

    fn is_forked(&self) -> bool {
        process::id() != self.process
    }
}

/// A copy has threads of its own, at most this number.
impl Clone for Pool {
    fn clone(&self) -> Self {
        Self::at_most(&self.shared.map, self.threads())
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        let workers = mem::take(&mut self.workers);
        if self.is_forked() {
            // Their threads are the parent's, and joining them would take for ever.
            mem::forget(workers);
            return;
        }
        for worker in &workers {
            worker.mailbox.stop();
        }
        for worker in workers {
            // A thread that panicked has printed its message, and the caller did its share.
            drop(worker.thread.join());
        }
    }
}

impl fmt::Debug for Pool {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Pool").field("threads", &self.threads()).finish_non_exhaustive()
    }
}

#[cfg(test)]
#[path = "pool_tests.rs"]
mod tests;
