//! Threads that scan one map together, for a localizer whose map is larger than the processor's
//! cache.
//!
//! The threads are started once and sleep between frames. A frame's rows are dealt out in chunks to
//! whoever comes for the next one, the caller too. The caller never waits for another thread: what
//! one has taken and not yet handed in when all is dealt out, the caller does itself. So a thread
//! that wakes late takes less, and one that is held up, or has died, is not missed. Rows are
//! independent of each other: the answer is the same to the last bit, whoever did what.

mod desk;
#[cfg(test)]
mod tests;

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::{self, JoinHandle};
use std::{fmt, io, mem, process};

use crate::distance::Query;
use crate::map::Map;
use desk::Desk;

/// Bytes of rows for which a thread is started unasked: two for 16 MB. Two threads against one,
/// whole pushes on a Xeon with 2 MB of cache a core, AVX-512, medians: 1.0 times as fast at 3.7 MB,
/// 1.3 at 8 MB, 1.5 at 16 MB, 1.7 at 33 MB, 1.9 at 205 MB. On a machine whose cores are all taken,
/// waking others gains nothing and can cost the caller its turn: small maps, which are scanned
/// within one, are left alone.
const BYTES_A_THREAD: usize = 8 << 20;
/// Bytes of rows in a chunk, where the map is large enough: far more than its handling costs, and
/// far less than a frame, for as much may be done twice.
const BYTES_A_CHUNK: usize = 1 << 18;

/// What a scan is for.
#[derive(Clone, Copy)]
pub(crate) enum Sought<'a> {
    /// The distances to a query.
    Distances(Query<'a>),
    /// The products of a query's codes with those of the map's screen.
    Products(&'a [i16]),
}

impl Sought<'_> {
    /// Writes what is sought of some places of a map into `out`.
    pub(crate) fn scan(self, map: &Map, places: Range<usize>, out: &mut [f32]) {
        match (self, map.screened()) {
            (Sought::Distances(query), _) => map.scan(query, places, out),
            (Sought::Products(codes), Some(screen)) => screen.scan(map.isa(), codes, places, out),
            // Nobody takes aim where there is no screen.
            (Sought::Products(_), None) => out.fill(f32::NAN),
        }
    }
}

/// The threads that help one localizer, and what they share.
pub(crate) struct Crew {
    /// Threads do not survive a fork: in a child, `process` is another's.
    process: u32,
    work: Arc<Work>,
    helpers: Vec<Helper>,
    /// Which frame this is: what is handed in for another is not looked at.
    round: u64,
    /// Which chunks have their distances in place.
    done: Vec<bool>,
}

/// What is to be scanned, and how far it is dealt out.
struct Work {
    map: Arc<Map>,
    places_a_chunk: usize,
    next: AtomicUsize,
}

struct Helper {
    desk: Arc<Desk>,
    thread: JoinHandle<()>,
}

/// As many threads as scan a map of this size well: one for every `BYTES_A_THREAD`, up to all
/// cores.
pub(crate) fn threads_for(map: &Map) -> usize {
    let worth = map.descriptors().bytes().len() / BYTES_A_THREAD;
    // The number of cores is asked of the system, which takes a while: only where it matters.
    if worth < 2 {
        1
    } else {
        thread::available_parallelism().map_or(1, |cores| worth.min(cores.get()))
    }
}

impl Crew {
    /// A crew of `threads`, the caller's own among them.
    ///
    /// # Errors
    /// Where the system starts no more threads.
    pub(crate) fn new(map: &Arc<Map>, threads: usize) -> io::Result<Self> {
        let mut crew = Self::alone(map, threads);
        for _ in 1..threads {
            crew.hire()?;
        }
        Ok(crew)
    }

    /// A crew of `threads`, or of as many as the system starts.
    pub(crate) fn at_most(map: &Arc<Map>, threads: usize) -> Self {
        let mut crew = Self::alone(map, threads);
        while crew.threads() < threads && crew.hire().is_ok() {}
        crew
    }

    /// The caller alone, with chunks for `threads`.
    fn alone(map: &Arc<Map>, threads: usize) -> Self {
        // A small map in several chunks a thread too.
        let small = map.places().div_ceil(threads.saturating_mul(16));
        let large = BYTES_A_CHUNK / (map.dim() * map.dtype().size());
        let places_a_chunk = small.min(large).max(1);
        let done = vec![false; map.places().div_ceil(places_a_chunk)];
        let work =
            Arc::new(Work { map: Arc::clone(map), places_a_chunk, next: AtomicUsize::new(0) });
        Self { process: process::id(), work, helpers: Vec::new(), round: 0, done }
    }

    fn hire(&mut self) -> io::Result<()> {
        let desk = Arc::new(Desk::new(&self.work.map, self.done.len()));
        let (work, own) = (Arc::clone(&self.work), Arc::clone(&desk));
        let thread =
            thread::Builder::new().name("surefix".to_owned()).spawn(move || own.serve(&work))?;
        self.helpers.push(Helper { desk, thread });
        Ok(())
    }

    /// How many threads scan, the caller's own among them.
    pub(crate) fn threads(&self) -> usize {
        1 + self.helpers.len()
    }

    /// Writes what is sought, for every place, into `out`, on all threads.
    pub(crate) fn scan(&mut self, sought: Sought<'_>, out: &mut [f32]) {
        if self.helpers.is_empty() || self.is_forked() {
            return sought.scan(&self.work.map, 0..self.work.map.places(), out);
        }
        let Self { work, helpers, round, done, .. } = self;
        *round += 1;
        done.fill(false);
        work.next.store(0, Ordering::Relaxed);
        for helper in &*helpers {
            helper.desk.order(*round, sought);
        }
        while let Some(chunk) = work.take() {
            work.scan(chunk, sought, out);
            done[chunk] = true;
        }
        loop {
            for helper in &*helpers {
                helper.desk.collect(*round, work, out, done);
            }
            let Some(missing) = done.iter().position(|done| !done) else { return };
            work.scan(missing, sought, out);
            done[missing] = true;
        }
    }

    fn is_forked(&self) -> bool {
        process::id() != self.process
    }
}

impl Work {
    /// The next chunk, for whoever asks first. (The order of all else between threads is the
    /// locks'.)
    fn take(&self) -> Option<usize> {
        let chunk = self.next.fetch_add(1, Ordering::Relaxed);
        (chunk < self.map.places().div_ceil(self.places_a_chunk)).then_some(chunk)
    }

    fn places(&self, chunk: usize) -> Range<usize> {
        let start = chunk * self.places_a_chunk;
        start..self.map.places().min(start + self.places_a_chunk)
    }

    /// Writes what is sought of a chunk's places to where it belongs in `out`.
    fn scan(&self, chunk: usize, sought: Sought<'_>, out: &mut [f32]) {
        let places = self.places(chunk);
        sought.scan(&self.map, places.clone(), &mut out[places]);
    }
}

/// A copy has threads of its own, as many as the system starts.
impl Clone for Crew {
    fn clone(&self) -> Self {
        Self::at_most(&self.work.map, self.threads())
    }
}

impl Drop for Crew {
    fn drop(&mut self) {
        let helpers = mem::take(&mut self.helpers);
        if self.is_forked() {
            // There is nobody to send home, and waiting for them would take for ever.
            mem::forget(helpers);
            return;
        }
        for helper in &helpers {
            helper.desk.leave();
        }
        for helper in helpers {
            // One that panicked has said so itself, and the caller did its share.
            drop(helper.thread.join());
        }
    }
}

impl fmt::Debug for Crew {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Crew").field("threads", &self.threads()).finish_non_exhaustive()
    }
}
