//! Threads that scan one map together, for a localizer whose map is larger than the processor's
//! cache.
//!
//! The threads are started once and sleep between frames. Each takes the next chunk of the map
//! until all are taken, and so does the caller. The caller never waits for another thread: it scans
//! those chunks itself that were taken and whose results have not come when all are taken. So a
//! thread that wakes late does less, and one that is delayed or dead does not hold a frame up. Rows
//! are independent of each other, so the results do not depend on the thread, to the last bit.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::{self, JoinHandle};
use std::{fmt, io, mem, process};

use super::Job;
use super::mailbox::Mailbox;
use crate::map::Map;

/// Bytes of rows for each thread that is started by default: two for 16 MB. Two threads against
/// one, whole pushes on a Xeon with 2 MB of cache for each core, AVX-512, medians: 1.0 times as
/// fast at 3.7 MB, 1.3 at 8 MB, 1.5 at 16 MB, 1.7 at 33 MB, 1.9 at 205 MB. On a machine whose cores
/// are all busy, waking others gains nothing and can cost the caller its turn, so small maps, which
/// are scanned within one turn, get no threads.
const BYTES_A_THREAD: usize = 8 << 20;
/// Bytes of rows in a chunk, a quarter of a block: far more than its handling costs, and far less
/// than a frame, because one chunk for each thread may be scanned twice.
const BYTES_A_CHUNK: usize = 1 << 18;

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

/// The map in chunks, and how many of them are taken.
pub(super) struct Chunks {
    pub(super) map: Arc<Map>,
    places_a_chunk: usize,
    next: AtomicUsize,
}

struct Worker {
    mailbox: Arc<Mailbox>,
    thread: JoinHandle<()>,
}

/// The number of threads that suits a map of this size: one for every `BYTES_A_THREAD`, up to the
/// number of cores.
pub(crate) fn threads_for(map: &Map) -> usize {
    let worth = map.places() * map.dim() * map.dtype().size() / BYTES_A_THREAD;
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
        // A small map has several chunks for each thread too.
        let small = map.places().div_ceil(threads.saturating_mul(16));
        let large = BYTES_A_CHUNK / (map.dim() * map.dtype().size());
        let places_a_chunk = small.min(large).max(1);
        let done = vec![false; map.places().div_ceil(places_a_chunk)];
        let shared =
            Arc::new(Chunks { map: Arc::clone(map), places_a_chunk, next: AtomicUsize::new(0) });
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

    /// Writes the results for all places into `out`, on all threads.
    pub(crate) fn scan(&mut self, job: Job<'_>, out: &mut [f32]) {
        if self.workers.is_empty() || self.is_forked() {
            return job.scan(&self.shared.map, 0..self.shared.map.places(), out);
        }
        let Self { shared, workers, generation, done, .. } = self;
        *generation += 1;
        done.fill(false);
        shared.next.store(0, Ordering::Relaxed);
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

impl Chunks {
    /// Takes the next chunk. (The locks of the mailboxes order all other accesses.)
    pub(super) fn take(&self) -> Option<usize> {
        let chunk = self.next.fetch_add(1, Ordering::Relaxed);
        (chunk < self.map.places().div_ceil(self.places_a_chunk)).then_some(chunk)
    }

    pub(super) fn places(&self, chunk: usize) -> Range<usize> {
        let start = chunk * self.places_a_chunk;
        start..self.map.places().min(start + self.places_a_chunk)
    }

    /// Writes the results for a chunk to its places in `out`.
    pub(super) fn scan(&self, chunk: usize, job: Job<'_>, out: &mut [f32]) {
        let places = self.places(chunk);
        job.scan(&self.map, places.clone(), &mut out[places]);
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
