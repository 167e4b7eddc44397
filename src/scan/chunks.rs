//! A map in chunks that threads take one by one.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::Job;
use crate::map::Map;

/// Bytes of rows in a chunk, a quarter of a block: far more than its handling costs, and far less
/// than a frame, because one chunk for each thread may be scanned twice.
const BYTES: usize = 1 << 18;

/// The map in chunks, and how many of them are taken.
pub(super) struct Chunks {
    pub(super) map: Arc<Map>,
    /// Rows of a chunk.
    size: usize,
    next: AtomicUsize,
}

impl Chunks {
    /// Chunks for `threads` threads: a small map has several for each thread too.
    pub(super) fn new(map: &Arc<Map>, threads: usize) -> Self {
        let small = map.rows().div_ceil(threads.saturating_mul(16));
        let large = BYTES / (map.dim() * map.dtype().size());
        Self { map: Arc::clone(map), size: small.min(large).max(1), next: AtomicUsize::new(0) }
    }

    pub(super) fn len(&self) -> usize {
        self.map.rows().div_ceil(self.size)
    }

    /// Makes all chunks free to be taken.
    pub(super) fn restart(&self) {
        self.next.store(0, Ordering::Relaxed);
    }

    /// Takes the next chunk. (The locks of the mailboxes order all other accesses.)
    pub(super) fn take(&self) -> Option<usize> {
        let chunk = self.next.fetch_add(1, Ordering::Relaxed);
        (chunk < self.len()).then_some(chunk)
    }

    pub(super) fn rows(&self, chunk: usize) -> Range<usize> {
        let start = chunk * self.size;
        start..self.map.rows().min(start + self.size)
    }

    /// Writes the results for a chunk to its rows in `out`.
    pub(super) fn scan(&self, chunk: usize, job: Job<'_>, out: &mut [f32]) {
        let rows = self.rows(chunk);
        job.scan(&self.map, rows.clone(), &mut out[rows]);
    }
}
