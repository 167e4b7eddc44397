//! Where a helper finds its orders, and hands in what it has done.

use std::mem;
use std::ops::Range;
use std::sync::{Condvar, Mutex, MutexGuard};

use super::Work;
use crate::distance::{Dtype, Values, View};
use crate::map::Map;

/// Where a helper finds its orders and hands in its chunks. Nobody holds the lock for longer than a copy takes.
pub(super) struct Desk {
    pub(super) tray: Mutex<Tray>,
    bell: Condvar,
}

pub(super) struct Tray {
    order: Order,
    round: u64,
    query: Query,
    /// The chunks that this helper has done in this round, and their distances, each at its own place.
    chunks: Vec<usize>,
    distances: Vec<f32>,
}

#[derive(Clone, Copy, PartialEq)]
enum Order {
    Wait,
    Scan,
    Leave,
}

/// Memory for a query in the map's own type and for one in float32, and which of them it is.
#[derive(Clone)]
struct Query {
    forms: [Values; 2],
    chosen: usize,
}

impl Desk {
    /// For a helper with a map of so many chunks.
    pub(super) fn new(map: &Map, chunks: usize) -> Self {
        let tray = Tray {
            order: Order::Wait,
            round: 0,
            query: Query::space(map),
            chunks: Vec::with_capacity(chunks),
            distances: vec![0.0; map.places()],
        };
        Self { tray: Mutex::new(tray), bell: Condvar::new() }
    }

    /// Wakes the helper for a query, unless it is just handing something in: then it is late for this one.
    pub(super) fn order(&self, round: u64, query: View<'_>) {
        if let Ok(mut tray) = self.tray.try_lock() {
            tray.query.set(query);
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

    /// A helper's life: it ends with an order, or where a lock was left behind by a thread that died.
    pub(super) fn serve(&self, work: &Work) {
        let mut query = Query::space(&work.map);
        let mut distances = vec![0.0; work.map.places()];
        while let Some(round) = self.next_order(&mut query) {
            while let Some(chunk) = work.take() {
                // What fails here fails for the caller too, who can say so.
                if work.scan(chunk, query.view(), &mut distances).is_err()
                    || !self.hand_in(round, chunk, &distances[work.places(chunk)], work.places(chunk))
                {
                    break;
                }
            }
        }
    }

    /// Sleeps until there is something to do: which round it is for, and its query; nothing for going home.
    fn next_order(&self, query: &mut Query) -> Option<u64> {
        let mut tray = self.tray.lock().ok()?;
        loop {
            match tray.order {
                Order::Leave => return None,
                Order::Wait => tray = self.bell.wait(tray).ok()?,
                Order::Scan => {
                    tray.order = Order::Wait;
                    mem::swap(query, &mut tray.query);
                    return Some(tray.round);
                }
            }
        }
    }

    /// Whether the round is still on.
    pub(super) fn hand_in(&self, round: u64, chunk: usize, distances: &[f32], places: Range<usize>) -> bool {
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

impl Query {
    fn space(map: &Map) -> Self {
        Self { forms: [map.dtype(), Dtype::F32].map(|dtype| Values::zeros(dtype, map.dim())), chosen: 0 }
    }

    /// Copies a query that the map has not refused.
    fn set(&mut self, query: View<'_>) {
        self.chosen = usize::from(query.dtype() != self.forms[0].dtype());
        match (query, &mut self.forms[self.chosen]) {
            (View::F32(query), Values::F32(form)) => form.copy_from_slice(query),
            (View::F16(query), Values::F16(form)) => form.copy_from_slice(query),
            (View::I8(query), Values::I8(form)) => form.copy_from_slice(query),
            (View::U8(query), Values::U8(form)) => form.copy_from_slice(query),
            _ => {}
        }
    }

    fn view(&self) -> View<'_> {
        self.forms[self.chosen].view()
    }
}
