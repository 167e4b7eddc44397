//! Every way to the sums of the diagonals against the order of additions in the method, to the last
//! bit.

use std::ops::Range;

use proptest::prelude::*;
use proptest::sample::select;

use super::diagonal::Diagonal;
use super::order::diagonal_sum;
use super::ring::Ring;
use super::visit::Visit;
use crate::simd::{Compiled, Isa};

/// Numbers of every size and both signs: each order of additions gives other bits.
struct Wild(u64);

impl Wild {
    fn number(&mut self) -> f32 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let (share, power) = ((self.0 >> 40) as f32 / (1 << 24) as f32, (self.0 >> 8) % 61);
        (share - 0.3) * 10_f32.powi(power as i32 - 30)
    }

    fn numbers(&mut self, count: usize) -> Vec<f32> {
        (0..count).map(|_| self.number()).collect()
    }
}

/// The words of the method, with query numbers: the blocks of queries, and what is added to what.
/// `d[j]` is the distance of query `j` on the diagonal.
fn by_the_words(d: &[f32], query: usize, length: usize) -> f64 {
    let block = (length / 2).max(1);
    let (begin, oldest) = (query / block * block, query + 1 - length);
    let mut sum = in_order(d[begin..=query].iter());
    if length > 1 {
        let last = begin - block;
        sum += in_order(d[last..begin].iter());
        if oldest < last {
            sum += in_order(d[oldest..last].iter().rev());
        }
    }
    sum
}

fn in_order<'a>(mut d: impl Iterator<Item = &'a f32>) -> f64 {
    let first = f64::from(*d.next().unwrap());
    d.fold(first, |sum, &d| sum + f64::from(d))
}

/// The first query of a stream: a piece of a batch begins in the middle.
fn begin() -> impl Strategy<Value = u64> {
    prop_oneof![1 => Just(0), 1 => 0..500_u64, 1 => 0..1_u64 << 60]
}

fn cases() -> ProptestConfig {
    ProptestConfig { cases: 10_000, failure_persistence: None, ..ProptestConfig::default() }
}

/// The first of the least sums. It asks for those below the best so far, or, `now_and_then`, for
/// all of a block.
struct Found {
    sum: f64,
    place: usize,
    now_and_then: bool,
}

impl Visit<f64> for &mut Found {
    fn visit(&mut self, start: usize, sums: &mut [f64]) {
        for (at, &sum) in sums.iter().enumerate() {
            if sum < self.sum {
                (self.sum, self.place) = (sum, start + at);
            }
        }
    }

    fn to_beat(&self, places: Range<usize>) -> Option<f64> {
        (!self.now_and_then || places.start.is_multiple_of(3)).then_some(self.sum)
    }
}

struct Seek<'a> {
    seeker: &'a mut Diagonal,
    columns: &'a Ring,
    frame: u64,
    found: &'a mut Found,
}

impl Compiled for Seek<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        self.seeker.sums(self.columns, self.frame, self.found);
    }
}

proptest! {
    #![proptest_config(cases())]

    #[test]
    fn a_diagonals_sum_is_in_the_order_of_the_method(length in 1..=130_usize, later in 0..400_usize, seed: u64) {
        let query = length - 1 + later;
        let d = Wild(seed).numbers(query + 1);
        let got = diagonal_sum(query as u64, length, |age| f64::from(d[query - age]));
        prop_assert_eq!(got.to_bits(), by_the_words(&d, query, length).to_bits());
    }

    /// Streams that begin at any query, are reset and begin anew, on every instruction set.
    #[test]
    fn kept_sums_and_fresh_ones_are_the_diagonals_sums(
        length in prop_oneof![1 => 1..=12_usize, 1 => 1..=130_usize],
        more in prop_oneof![1 => 0..=3_usize, 1 => 0..=170_usize, 1 => 250..=300_usize],
        begins in [begin(), begin()],
        first in prop_oneof![2 => Just(0), 1 => 1..200_usize],
        speed in prop_oneof![3 => Just(1.0), 1 => select(vec![0.0, 0.5, 0.8, 1.25])],
        spare in 0..3_usize, isa: prop::sample::Index, seed: u64,
    ) {
        let places = (length + length / 4 + more).max(2);
        let isa = isa.get(&Isa::available().collect::<Vec<_>>()).to_owned();
        let mut wild = Wild(seed);
        let mut columns = Ring::new(length + spare, places).unwrap();
        let plain = Diagonal::new(speed, length, places).unwrap().forced(false, places);
        let mut ways = vec![plain.clone()];
        if speed == 1.0 && length > 1 {
            ways.push(plain.forced(true, places));
        }
        // The same, asked for the first of the least sums alone.
        let mut seekers = ways.clone();
        let mut column = wild.numbers(places);
        for (begin, queries) in begins.into_iter().zip([first, 2 * length + 3]) {
            columns.clear();
            for index in 0..queries {
                // The last column, elsewhere and with some new numbers: cheaper than a new one.
                column.rotate_right((1 + index % 3) % places);
                (0..places).step_by(1 + places / 8).for_each(|i| column[i] = wild.number());
                columns.advance().copy_from_slice(&column);
                let frame = begin + index as u64;
                for (way, seeker) in ways.iter_mut().zip(&mut seekers) {
                    let (back, first) = (way.back.clone(), way.first());
                    let mut got = Vec::new();
                    isa.run(|| way.sums(&columns, frame, |start: usize, sums: &mut [f64]| {
                        assert_eq!(start, first + got.len(), "places come in order");
                        got.extend_from_slice(sums);
                    }));
                    prop_assert_eq!(got.len(), if index + 1 < length { 0 } else { places - first });
                    let mut found = Found { sum: f64::INFINITY, place: 0, now_and_then: wild.0.is_multiple_of(3) };
                    isa.run(Seek { seeker, columns: &columns, frame, found: &mut found });
                    let least = got.iter().copied().fold(f64::INFINITY, f64::min);
                    let place = got.iter().position(|&sum| sum == least && least < f64::INFINITY);
                    prop_assert_eq!((found.sum, found.place), (least, place.map_or(0, |at| first + at)));
                    // All places now and then; else the ends, the edges of blocks and some others.
                    let all = index.is_multiple_of(16);
                    let looked_at = |at: usize| all || at.is_multiple_of(7) || at % 256 < 2 || at + 4 > got.len();
                    for (at, sum) in got.iter().enumerate().filter(|(at, _)| looked_at(*at)) {
                        let place = first + at;
                        let term = |age: usize| f64::from(columns.column(age)[place - back[age]]);
                        let expected = diagonal_sum(frame, length, term);
                        prop_assert_eq!(sum.to_bits(), expected.to_bits(), "place {} of query {}", place, frame);
                    }
                }
            }
        }
    }
}
