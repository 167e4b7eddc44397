//! Where a helper finds its orders, and hands in what it has done.

use std::mem;
use std::ops::Range;
use std::sync::{Condvar, Mutex, MutexGuard};

use super::{Sought, Work};
use crate::distance::Query;
use crate::dtype::Dtype;
use crate::map::Map;
use crate::numbers::{Values, View};

/// Where a helper finds its orders and hands in its chunks. Nobody holds the lock for longer than a
/// copy takes.
pub(super) struct Desk {
    pub(super) tray: Mutex<Tray>,
    bell: Condvar,
}

pub(super) struct Tray {
    order: Order,
    round: u64,
    paper: Paper,
    /// The chunks that this helper has done in this round, and their distances, each at its own
    /// place.
    chunks: Vec<usize>,
    distances: Vec<f32>,
}

#[derive(Clone, Copy, PartialEq)]
enum Order {
    Wait,
    Scan,
    Leave,
}

/// Memory for what is sought in each of its forms, and which of them it is.
#[derive(Clone)]
struct Paper {
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

impl Desk {
    /// For a helper with a map of so many chunks.
    pub(super) fn new(map: &Map, chunks: usize) -> Self {
        let tray = Tray {
            order: Order::Wait,
            round: 0,
            paper: Paper::blank(map),
            chunks: Vec::with_capacity(chunks),
            distances: vec![0.0; map.places()],
        };
        Self { tray: Mutex::new(tray), bell: Condvar::new() }
    }

    /// Wakes the helper for a query, unless it is just handing something in: then it is late for
    /// this one.
    pub(super) fn order(&self, round: u64, sought: Sought<'_>) {
        if let Ok(mut tray) = self.tray.try_lock() {
            tray.paper.write(sought);
            tray.chunks.clear();
            (tray.order, tray.round) = (Order::Scan, round);
            drop(tray);
            self.bell.notify_one();
        }
    }

    /// Writes what the helper has handed in for this round into `out`, and says so in `done`.
    pub(super) fn collect(&self, round: u64, work: &Work, out: &mut [f32], done: &mut [bool]) {
        let Ok(mut tray) = self.tray.try_lock() else { return };
        let Tray { round: of, chunks, distances, .. } = &mut *tray;
        if *of == round {
            for chunk in chunks.drain(..) {
                let places = work.places(chunk);
                out[places.clone()].copy_from_slice(&distances[places]);
                done[chunk] = true;
            }
        }
    }

    /// A helper's life: it ends with an order, or where a lock was left behind by a thread that
    /// died.
    pub(super) fn serve(&self, work: &Work) {
        let mut paper = Paper::blank(&work.map);
        let mut distances = vec![0.0; work.map.places()];
        while let Some(round) = self.next_order(&mut paper) {
            while let Some(chunk) = work.take() {
                work.scan(chunk, paper.read(), &mut distances);
                if !self.hand_in(round, chunk, &distances[work.places(chunk)], work.places(chunk)) {
                    break;
                }
            }
        }
    }

    /// Sleeps until there is something to do: which round it is for, and what is sought; nothing
    /// for going home.
    fn next_order(&self, paper: &mut Paper) -> Option<u64> {
        let mut tray = self.tray.lock().ok()?;
        loop {
            match tray.order {
                Order::Leave => return None,
                Order::Wait => tray = self.bell.wait(tray).ok()?,
                Order::Scan => {
                    tray.order = Order::Wait;
                    mem::swap(paper, &mut tray.paper);
                    return Some(tray.round);
                }
            }
        }
    }

    /// Whether the round is still on.
    pub(super) fn hand_in(
        &self,
        round: u64,
        chunk: usize,
        distances: &[f32],
        places: Range<usize>,
    ) -> bool {
        let Ok(mut tray) = self.tray.lock() else { return false };
        let on = tray.round == round;
        if on {
            tray.distances[places].copy_from_slice(distances);
            tray.chunks.push(chunk);
        }
        on
    }

    pub(super) fn leave(&self) {
        let sign = |mut tray: MutexGuard<'_, Tray>| tray.order = Order::Leave;
        self.tray.lock().map_or_else(|dead| sign(dead.into_inner()), sign);
        self.bell.notify_one();
    }
}

impl Paper {
    fn blank(map: &Map) -> Self {
        let numbers = [map.dtype(), Dtype::F32].map(|dtype| Values::zeros(dtype, map.dim()));
        let codes = map.screened().map_or(Vec::new(), |_| vec![0; map.dim()]);
        Self { numbers, length: 0.0, codes, form: Form::Numbers(0) }
    }

    fn write(&mut self, sought: Sought<'_>) {
        match sought {
            Sought::Distances(query) => {
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
            Sought::Products(codes) => {
                self.codes.copy_from_slice(codes);
                self.form = Form::Codes;
            }
        }
    }

    fn read(&self) -> Sought<'_> {
        match self.form {
            Form::Numbers(chosen) => Sought::Distances(Query {
                numbers: self.numbers[chosen].view(),
                length: self.length,
            }),
            Form::Codes => Sought::Products(&self.codes),
        }
    }
}
