//! The jobs and the results of one thread of a [`Pool`](super::Pool).

use std::mem;
use std::ops::Range;
use std::sync::{Condvar, Mutex, MutexGuard};

use super::Job;
use super::chunks::Chunks;
use crate::distance::Query;
use crate::dtype::Dtype;
use crate::map::Map;
use crate::numbers::{Values, View};

/// Hands a thread its jobs and takes its results. No lock is held for longer than a copy takes.
pub(super) struct Mailbox {
    pub(super) slot: Mutex<Slot>,
    wake: Condvar,
}

pub(super) struct Slot {
    command: Command,
    /// The frame that the job is of.
    generation: u64,
    job: JobBuffer,
    /// The chunks that this thread has scanned for this frame, and their results, each at its
    /// rows.
    pub(super) chunks: Vec<usize>,
    results: Vec<f32>,
}

#[derive(Clone, Copy, PartialEq)]
enum Command {
    Wait,
    Scan,
    Stop,
}

/// A copy of a job, in memory for each of its forms.
#[derive(Clone)]
struct JobBuffer {
    /// A query of the map's own type, and one of float32.
    numbers: [Values; 2],
    length: f64,
    codes: Vec<i16>,
    form: Form,
}

#[derive(Clone, Copy)]
enum Form {
    Numbers(usize),
    Codes,
}

impl Mailbox {
    pub(super) fn new(map: &Map, chunks: usize) -> Self {
        let slot = Slot {
            command: Command::Wait,
            generation: 0,
            job: JobBuffer::new(map),
            chunks: Vec::with_capacity(chunks),
            results: vec![0.0; map.rows()],
        };
        Self { slot: Mutex::new(slot), wake: Condvar::new() }
    }

    /// Wakes the thread for a job. A thread that holds the lock, because it is handing in a result
    /// just now, misses this frame: the caller does not wait for it.
    pub(super) fn post(&self, generation: u64, job: Job<'_>) {
        if let Ok(mut slot) = self.slot.try_lock() {
            slot.job.write(job);
            slot.chunks.clear();
            (slot.command, slot.generation) = (Command::Scan, generation);
            drop(slot);
            self.wake.notify_one();
        }
    }

    /// Copies the results of this frame into `out`, and marks their chunks in `done`.
    pub(super) fn collect(
        &self,
        generation: u64,
        shared: &Chunks,
        out: &mut [f32],
        done: &mut [bool],
    ) {
        let Ok(mut slot) = self.slot.try_lock() else { return };
        let Slot { generation: of, chunks, results, .. } = &mut *slot;
        if *of == generation {
            for chunk in chunks.drain(..) {
                let rows = shared.rows(chunk);
                out[rows.clone()].copy_from_slice(&results[rows]);
                done[chunk] = true;
            }
        }
    }

    /// The thread's loop. It ends with [`stop`](Self::stop), or if a thread panicked with the lock.
    pub(super) fn serve(&self, shared: &Chunks) {
        let mut job = JobBuffer::new(&shared.map);
        let mut results = vec![0.0; shared.map.rows()];
        while let Some(generation) = self.next_job(&mut job) {
            while let Some(chunk) = shared.take() {
                let rows = shared.rows(chunk);
                shared.scan(chunk, job.read(), &mut results);
                if !self.hand_in(generation, chunk, &results[rows.clone()], rows) {
                    break;
                }
            }
        }
    }

    /// Blocks until there is a job. Returns its frame, or `None` if the thread must stop.
    fn next_job(&self, job: &mut JobBuffer) -> Option<u64> {
        let mut slot = self.slot.lock().ok()?;
        loop {
            match slot.command {
                Command::Stop => return None,
                Command::Wait => slot = self.wake.wait(slot).ok()?,
                Command::Scan => {
                    slot.command = Command::Wait;
                    mem::swap(job, &mut slot.job);
                    return Some(slot.generation);
                }
            }
        }
    }

    /// Hands in a chunk's results. False if the frame is over. A thread that missed a post goes on
    /// with the frame before, among the chunks of the next: those of both need not fit.
    pub(super) fn hand_in(
        &self,
        generation: u64,
        chunk: usize,
        results: &[f32],
        rows: Range<usize>,
    ) -> bool {
        let Ok(mut slot) = self.slot.lock() else { return false };
        let fits = slot.chunks.len() < slot.chunks.capacity();
        let current = slot.generation == generation && fits;
        if current {
            slot.results[rows].copy_from_slice(results);
            slot.chunks.push(chunk);
        }
        current
    }

    pub(super) fn stop(&self) {
        let write = |mut slot: MutexGuard<'_, Slot>| slot.command = Command::Stop;
        self.slot.lock().map_or_else(|poisoned| write(poisoned.into_inner()), write);
        self.wake.notify_one();
    }
}

impl JobBuffer {
    fn new(map: &Map) -> Self {
        let numbers = [map.dtype(), Dtype::F32].map(|dtype| Values::zeros(dtype, map.dim()));
        let codes = map.codes().map_or(Vec::new(), |_| vec![0; map.dim()]);
        Self { numbers, length: 0.0, codes, form: Form::Numbers(0) }
    }

    fn write(&mut self, job: Job<'_>) {
        match job {
            Job::Distances(query) => {
                let chosen = usize::from(query.numbers.dtype() != self.numbers[0].dtype());
                match (query.numbers, &mut self.numbers[chosen]) {
                    (View::F32(query), Values::F32(numbers)) => numbers.copy_from_slice(query),
                    (View::F16(query), Values::F16(numbers)) => numbers.copy_from_slice(query),
                    (View::I8(query), Values::I8(numbers)) => numbers.copy_from_slice(query),
                    (View::U8(query), Values::U8(numbers)) => numbers.copy_from_slice(query),
                    _ => {}
                }
                (self.form, self.length) = (Form::Numbers(chosen), query.length);
            }
            Job::CodeProducts(codes) => {
                self.codes.copy_from_slice(codes);
                self.form = Form::Codes;
            }
        }
    }

    fn read(&self) -> Job<'_> {
        match self.form {
            Form::Numbers(chosen) => {
                Job::Distances(Query { numbers: self.numbers[chosen].view(), length: self.length })
            }
            Form::Codes => Job::CodeProducts(&self.codes),
        }
    }
}
