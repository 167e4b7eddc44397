//! The order in which a scan reads its rows: it decides the speed, and nothing of the answers.
//!
//! Which one is fastest differs between processors of one maker, and between short rows and long
//! ones. So rows beyond the cache are read in each order for a while, a slice after the other, and
//! each slice is timed. The work is that of the scan, which no slice is read for in vain. After
//! some 50 MB the fastest order is known, for the whole process.

use std::ops::Range;
use std::sync::atomic::{AtomicU8, AtomicU32, Ordering};
use std::time::Instant;

/// Bytes of rows that surely lie in a cache, beside other data: those are read in the usual order.
const CACHED: usize = 16 << 20;

/// Up to these sizes of maps the order is learned apart: the last cache of some processors holds
/// them.
const SIZES: [usize; 2] = [64 << 20, 256 << 20];

/// Bytes of a slice: long beside a question for the time, short beside a preemption.
const SLICE: usize = 1 << 19;

/// Slices of each order that are timed. Their lower quartile counts: the system takes time from
/// some of them, and a cache gives some.
const TIMED: usize = 15;

/// Orders of one type, at most.
const ORDERS: usize = 6;

/// How a scan reads rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Reading {
    /// Rows of floats that are read side by side: 1, 2 or 4.
    pub(super) rows: usize,
    /// Memory is prefetched this many bytes before it is read: by itself the CPU stops at the end
    /// of a page.
    pub(super) ahead: usize,
}

/// What is read.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    /// f32.
    Single,
    /// f16, and bytes that are compared as floats.
    Narrow,
    /// Bytes that are compared as such, a row at a time.
    Bytes,
}

impl Kind {
    /// The orders that are tried, the usual one first.
    fn orders(self) -> &'static [Reading] {
        const fn order(rows: usize, ahead: usize) -> Reading {
            Reading { rows, ahead }
        }
        const SINGLE: [Reading; 6] = [
            order(2, 2560),
            order(1, 0),
            order(1, 2560),
            order(1, 12_288),
            order(4, 512),
            order(4, 2560),
        ];
        const NARROW: [Reading; 5] =
            [order(1, 4096), order(1, 0), order(2, 2560), order(4, 512), order(4, 4096)];
        const BYTES: [Reading; 4] = [order(1, 2048), order(1, 0), order(1, 4096), order(1, 8192)];
        match self {
            Self::Single => &SINGLE,
            Self::Narrow => &NARROW,
            Self::Bytes => &BYTES,
        }
    }
}

/// Which order a scan takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Tuning {
    /// The usual one.
    Usual,
    /// The fastest of those that were tried, or one of those that are, for maps of this size: how
    /// many of [`SIZES`] they exceed.
    Learned(usize),
    /// The one with this number.
    #[cfg(test)]
    Nth(usize),
}

impl Tuning {
    /// All that are chosen from.
    #[cfg(test)]
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        (0..ORDERS).map(Self::Nth)
    }

    /// For a map of this many bytes of rows.
    pub(crate) fn of(bytes: usize) -> Self {
        if bytes <= CACHED {
            return Self::Usual;
        }
        Self::Learned(SIZES.iter().filter(|&&size| bytes > size).count())
    }

    /// Has `count` rows of `bytes` each read, some at a time.
    #[inline(always)]
    pub(super) fn read(
        self,
        kind: Kind,
        bytes: usize,
        count: usize,
        mut read: impl FnMut(Range<usize>, Reading),
    ) {
        let orders = kind.orders();
        let trial = match self {
            Self::Learned(size) => Trial::of(kind, size, bytes),
            Self::Usual => return read(0..count, orders[0]),
            #[cfg(test)]
            Self::Nth(order) => return read(0..count, orders[order % orders.len()]),
        };
        let mut done = 0;
        while done < count {
            match trial.next(orders.len()) {
                Slice::Known(order) => {
                    read(done..count, orders[order]);
                    done = count;
                }
                Slice::Timed { number, order } => {
                    let end = count.min(done + (SLICE / bytes.max(1)).next_multiple_of(4).max(4));
                    let start = Instant::now();
                    read(done..end, orders[order]);
                    trial.note(number, orders.len(), start.elapsed().as_nanos(), end - done);
                    done = end;
                }
            }
        }
    }
}

/// How the next rows are read.
enum Slice {
    /// All in this order.
    Known(usize),
    /// A slice in this order, timed.
    Timed { number: usize, order: usize },
}

/// The times of the orders, for rows of one type and about one length, in maps of about one size.
/// Threads share it without waiting for each other, so that a fork leaves nothing half done; a time
/// that is not there yet does not count.
struct Trial {
    begun: AtomicU32,
    /// Of a row of each slice, in ns / 16.
    times: [AtomicU32; ORDERS * TIMED],
    /// The fastest order, once it is known.
    best: AtomicU8,
}

impl Trial {
    const UNKNOWN: u8 = u8::MAX;
    /// Rows of up to 1 kB, 2 kB and so on, and more than 32 kB.
    const LENGTHS: usize = 7;

    const fn new() -> Self {
        Self {
            begun: AtomicU32::new(0),
            times: [const { AtomicU32::new(0) }; ORDERS * TIMED],
            best: AtomicU8::new(Self::UNKNOWN),
        }
    }

    /// That of rows of this many bytes.
    fn of(kind: Kind, size: usize, bytes: usize) -> &'static Self {
        static TRIALS: [[[Trial; Trial::LENGTHS]; SIZES.len() + 1]; 3] =
            [const { [const { [const { Trial::new() }; Trial::LENGTHS] }; SIZES.len() + 1] }; 3];
        let length =
            (bytes.div_ceil(1024).next_power_of_two().ilog2() as usize).min(Self::LENGTHS - 1);
        &TRIALS[kind as usize][size][length]
    }

    fn next(&self, orders: usize) -> Slice {
        let best = self.best.load(Ordering::Relaxed);
        if best != Self::UNKNOWN {
            return Slice::Known(usize::from(best));
        }
        let number = self.begun.fetch_add(1, Ordering::Relaxed) as usize;
        Slice::Timed { number, order: number % orders }
    }

    /// Keeps the time of a slice; after the last one, finds the fastest order.
    #[cold]
    fn note(&self, number: usize, orders: usize, nanoseconds: u128, rows: usize) {
        if let Some(kept) = self.times.get(number) {
            let time = (16 * nanoseconds).div_ceil(rows.max(1) as u128);
            kept.store(u32::try_from(time).unwrap_or(u32::MAX).max(1), Ordering::Relaxed);
        }
        if number + 1 >= orders * TIMED {
            let usual = |order: usize| {
                let of_order = self.times.iter().skip(order).step_by(orders).take(TIMED);
                let mut times = [u32::MAX; TIMED];
                for (time, kept) in times.iter_mut().zip(of_order) {
                    *time = kept.load(Ordering::Relaxed).wrapping_sub(1);
                }
                times.sort_unstable();
                times[TIMED / 4]
            };
            let best = (0..orders).min_by_key(|&order| usual(order)).unwrap_or(0);
            self.best.store(best as u8, Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fastest_order_is_known_after_each_was_timed() {
        let trial = Trial::new();
        for round in 0..TIMED {
            for order in 0..4 {
                let Slice::Timed { number, order: next } = trial.next(4) else { panic!("known") };
                assert_eq!(next, order);
                // The third is the fastest, but for slices that the system interrupts.
                let interrupted = if round % 3 == 0 { 50_000 } else { 0 };
                trial.note(number, 4, interrupted + [1000, 900, 600, 700][order], 10);
            }
        }
        assert!(matches!(trial.next(4), Slice::Known(2)));
    }

    #[test]
    fn every_row_is_read_once_while_orders_are_tried() {
        // Rows of a length that no other test has.
        let (bytes, mut seen) = (33 << 10, Vec::new());
        let mut orders = Vec::new();
        while Trial::of(Kind::Narrow, 0, bytes).best.load(Ordering::Relaxed) == Trial::UNKNOWN {
            let mut next = 0;
            Tuning::Learned(0).read(Kind::Narrow, bytes, 45, |rows, reading| {
                assert_eq!(rows.start, next);
                next = rows.end;
                orders.push(reading);
            });
            seen.push(next);
        }
        assert!(seen.iter().all(|&rows| rows == 45));
        assert!(Kind::Narrow.orders().iter().all(|order| orders.contains(order)));
        let mut calls = 0;
        Tuning::Learned(0).read(Kind::Narrow, bytes, 45, |rows, _| calls += rows.len());
        assert_eq!(calls, 45);
    }

    #[test]
    fn small_maps_are_read_in_the_usual_order() {
        assert_eq!(Tuning::of(CACHED), Tuning::Usual);
        assert_eq!(Tuning::of(CACHED + 1), Tuning::Learned(0));
        assert_eq!(SIZES.map(|size| Tuning::of(size + 1)), [1, 2].map(Tuning::Learned));
        Tuning::Usual.read(Kind::Single, 8, 3, |rows, reading| {
            assert_eq!((rows, reading), (0..3, Reading { rows: 2, ahead: 2560 }));
        });
    }
}
