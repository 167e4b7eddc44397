//! The belief before a move on a shard's line of places, from where it moves to its own.

use std::ops::Range;

use super::links::Links;
use super::predict::Step;
use super::said::{Numbers, counted};
use super::steps::{Steps, Tap, Way, arriving};
use super::update::{Before, add};
use crate::error::Error;
use crate::method::layout::Layout;
use crate::segments::Segments;

#[derive(Clone, Debug)]
pub(super) struct Line {
    layout: Layout,
    /// Row by row.
    pub(super) mass: Vec<f64>,
}

impl Line {
    pub(super) fn new(segments: &Segments, own: Range<usize>, reach: [usize; 2]) -> Self {
        let layout = Layout::new(segments, own, reach).with_junctions(segments);
        Self { layout, mass: Vec::new() }
    }

    /// How far the moves reach: before each place and after it.
    pub(super) fn reach(&self) -> [usize; 2] {
        self.layout.reach()
    }

    /// Fills the first `rows` rows of a line: with those of the own places, and with the belief of
    /// other shards, ranges of places in the order of the layout.
    ///
    /// # Errors
    /// [`Error::Shard`] unless it is there for all places.
    pub(super) fn fill(
        &self,
        line: &mut Vec<f64>,
        rows: usize,
        own: &[f64],
        foreign: &[(usize, Numbers)],
    ) -> Result<(), Error> {
        let (total, length) = (self.layout.total(), self.layout.own().len());
        line.resize(rows * total, 0.0);
        for row in 0..rows {
            let (line, own) = (&mut line[row * total..], &own[row * length..]);
            for (at, places) in self.layout.own_parts(0..length) {
                line[at..at + places.len()].copy_from_slice(&own[places]);
            }
        }
        let (mut foreign, mut taken) = (foreign.iter(), 0);
        for (range, at) in self.layout.foreign() {
            let mut start = range.start;
            while start < range.end {
                let Some((first, Numbers(numbers))) = foreign.next() else { break };
                let length = numbers.len() / rows;
                let fits = *first == start && (1..=range.end - start).contains(&length);
                if !fits || numbers.len() != rows * length {
                    break;
                }
                for (row, numbers) in numbers.chunks_exact(length).enumerate() {
                    let at = row * total + at + (start - range.start);
                    line[at..at + length].copy_from_slice(numbers);
                }
                start += length;
                taken += length;
            }
        }
        let expected: usize = self.layout.foreign().map(|(range, _)| range.len()).sum();
        counted("places of other shards", expected, taken)?;
        counted("more lists of places of other shards", 0, foreign.len())
    }
}

/// How many places before a place, and after it, a move comes from: at least those of all speeds and
/// of a known advance of about a place, so that it rarely changes.
pub(super) fn reach(steps: &Steps, step: Option<Step>) -> [usize; 2] {
    let [least, greatest] = steps.shifts();
    let shift = match step {
        Some(Step::Known { shift, .. }) => shift,
        Some(Step::Speeds { .. }) | None => 0,
    };
    let [before, after] = [greatest.max(3).max(shift + 2), least.min(-2).min(shift - 1)];
    [before.unsigned_abs(), after.unsigned_abs()]
}

/// It with the route's links; places count from the first own one.
#[derive(Clone, Copy)]
pub(super) struct OnLine<'a> {
    pub(super) line: &'a Line,
    pub(super) links: Option<&'a Links>,
}

impl OnLine<'_> {
    #[inline(always)]
    fn row(&self, row: usize) -> &[f64] {
        let total = self.line.layout.total();
        &self.line.mass[row * total..][..total]
    }
}

impl Before for OnLine<'_> {
    #[inline(always)]
    fn arriving(&self, row: usize, taps: &[Tap], factor: f64, start: usize, out: &mut [f64]) {
        let row = self.row(row);
        let way = Way { segments: self.line.layout.segments(), links: None };
        for (at, own) in self.line.layout.own_parts(start..start + out.len()) {
            arriving(row, taps, way, factor, at, &mut out[own.start - start..own.end - start]);
        }
        if let Some(links) = self.links {
            let layout = &self.line.layout;
            let belief = |place: usize| layout.anywhere(place).map_or(f64::NAN, |at| row[at]);
            links.arriving(belief, taps, factor, layout.own().start + start, out);
        }
    }

    #[inline(always)]
    fn staying(&self, row: usize, factor: f64, start: usize, out: &mut [f64]) {
        let row = self.row(row);
        for (at, own) in self.line.layout.own_parts(start..start + out.len()) {
            add(factor, &row[at..], &mut out[own.start - start..own.end - start]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two rows of places from some place on.
    fn belief(first: usize, count: usize) -> (usize, Numbers) {
        let rows = [0.0, 1000.0].into_iter();
        let numbers = rows.flat_map(|row| (first..first + count).map(move |at| row + at as f64));
        (first, Numbers(numbers.collect()))
    }

    #[test]
    fn a_line_takes_the_belief_in_all_places_beside_its_own_and_in_no_others() {
        let line = Line::new(&Segments::one(100), 40..60, [5, 4]);
        let (_, Numbers(own)) = belief(40, 20);
        let whole = [belief(35, 5), belief(60, 4)];
        let parts = [belief(35, 2), belief(37, 1), belief(38, 2), belief(60, 3), belief(63, 1)];
        for foreign in [&whole[..], &parts] {
            let mut filled = Vec::new();
            line.fill(&mut filled, 2, &own, foreign).unwrap();
            assert_eq!(filled, belief(35, 29).1.0);
        }
        let longer = |(first, Numbers(mut numbers)): (usize, Numbers)| {
            numbers.push(0.0);
            (first, Numbers(numbers))
        };
        for foreign in [
            &[][..],
            &[belief(35, 5)],
            &[belief(60, 4), belief(35, 5)],
            &[belief(34, 5), belief(60, 4)],
            &[belief(36, 5), belief(60, 4)],
            &[belief(35, 6), belief(60, 3)],
            &[belief(35, 4), belief(60, 5)],
            &[belief(35, 5), belief(60, 3)],
            &[belief(35, 5), belief(60, 0), belief(60, 4)],
            &[belief(35, 5), belief(60, 4), belief(64, 1)],
            &[longer(belief(35, 5)), belief(60, 4)],
        ] {
            let refused = line.fill(&mut Vec::new(), 2, &own, foreign);
            assert!(matches!(refused, Err(Error::Shard { .. })), "{foreign:?}");
        }
    }
}
