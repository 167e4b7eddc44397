//! The distances to the rows of several traverses become one for each place (method 1.14).
//!
//! First come sums over the rows of each block of places: each traverse's shift and the mean follow
//! from them. Then each place takes its least row. Both can be done for some of the blocks alone.

use std::ops::Range;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::Map;
use super::blank::{SAME, between, blocks, sum_without, within};
use super::traverses::{Further, MOST, Traverses};

/// What several traverses say nothing of.
#[derive(Clone, Debug)]
pub(super) struct Quiet {
    /// The places all of whose rows show nothing.
    places: Arc<[usize]>,
    /// Of each further traverse the rows that are not compared with the first's row of their place,
    /// because one of the two shows nothing.
    unpaired: Vec<Vec<usize>>,
    /// Whether any row shows nothing.
    any: bool,
}

/// What the distances to the rows of some blocks come to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowSums {
    /// Over the first traverse's rows that show something.
    first: f64,
    /// Of each further traverse: over its pairs, the first's distance minus its own, and over its
    /// rows that show something.
    further: [(f64, f64); MOST],
    /// The least distance to a row that shows nothing.
    nearest: f32,
}

impl RowSums {
    pub(crate) const NONE: Self =
        Self { first: 0.0, further: [(0.0, 0.0); MOST], nearest: f32::INFINITY };

    /// With those of the blocks that follow.
    pub(crate) fn add(&mut self, more: &Self) {
        self.first += more.first;
        for (own, more) in self.further.iter_mut().zip(&more.further) {
            own.0 += more.0;
            own.1 += more.1;
        }
        self.nearest = self.nearest.min(more.nearest);
    }

    /// Its numbers, of a map with `further` further traverses.
    pub(crate) fn numbers(&self, further: usize) -> impl Iterator<Item = f64> {
        let pairs = self.further[..further].iter().flat_map(|&(pairs, shown)| [pairs, shown]);
        [self.first, f64::from(self.nearest)].into_iter().chain(pairs)
    }

    /// That of its numbers.
    pub(crate) fn of_numbers(numbers: &[f64]) -> Self {
        let mut sums = Self::NONE;
        let (first, further) = numbers.split_at(numbers.len().min(2));
        if let [first, nearest] = *first {
            (sums.first, sums.nearest) = (first, nearest as f32);
        }
        for (own, &[pairs, shown]) in sums.further.iter_mut().zip(further.as_chunks().0) {
            *own = (pairs, shown);
        }
        sums
    }
}

/// What is added to the distances of each further traverse, and the mean of those to all rows that
/// show something.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Means {
    /// Of each further traverse.
    shifts: Vec<f64>,
    mean: f64,
    /// Whether the query shows nothing, or a place again that shows nothing.
    nothing: bool,
}

/// [`Means`] without the shifts.
#[derive(Clone, Copy)]
struct Mean {
    mean: f64,
    nothing: bool,
}

impl Further {
    /// Its rows of some places.
    pub(crate) fn rows_of(&self, places: &Range<usize>) -> Range<usize> {
        let first = |from: usize| self.places.partition_point(|&place| (place as usize) < from);
        first(places.start)..first(places.end)
    }
}

impl Map {
    /// How many traverses it has after the first.
    pub(crate) fn further(&self) -> usize {
        self.route.traverses.further.len()
    }

    /// The rows of some places in a traverse, and which row of all its first one is.
    pub(crate) fn rows_of(&self, traverse: usize, places: &Range<usize>) -> (Range<usize>, usize) {
        let further = &self.route.traverses.further;
        let Some(index) = traverse.checked_sub(1) else { return (places.clone(), 0) };
        let before: usize = further[..index].iter().map(|traverse| traverse.places.len()).sum();
        (further[index].rows_of(places), self.places() + before)
    }

    /// Makes the column of places from the distances to all rows. What says nothing is taken out,
    /// as by [`quieten`](Self::quieten).
    pub(crate) fn fold(&self, nothing: bool, rows: &[f32], column: &mut [f32]) {
        let of = |traverse: usize, of_it: Range<usize>| {
            let (_, start) = self.rows_of(traverse, &(0..0));
            &rows[start + of_it.start..start + of_it.end]
        };
        let mut all = RowSums::NONE;
        for block in blocks(column.len()) {
            all.add(&self.row_sums(nothing, block, of));
        }
        let mean = self.mean(nothing, &all);
        self.fold_part(mean, |index| self.shift(index, &all), 0..column.len(), of, column);
    }

    /// Adds up the rows of one block of places; `rows` gives the distances to some rows of a
    /// traverse.
    pub(crate) fn row_sums<'a>(
        &self,
        nothing: bool,
        places: Range<usize>,
        rows: impl Fn(usize, Range<usize>) -> &'a [f32],
    ) -> RowSums {
        let Quiet { unpaired, any, .. } = self.quiet();
        let mut all = RowSums::NONE;
        let first = rows(0, places.clone());
        // The mean is not needed if all show something.
        let told = nothing || *any;
        if told {
            let at = |row: usize| first[row - places.start];
            all.first = sum_without(places.clone(), self.silent(), |row| f64::from(at(row)));
            let silent = within(&places, self.blank_rows()).iter();
            all.nearest = silent.map(|&row| at(row)).fold(f32::INFINITY, f32::min);
        }
        let further = self.route.traverses.further.iter().zip(unpaired).zip(&mut all.further);
        for (index, ((traverse, unpaired), sums)) in further.enumerate() {
            let of_it = traverse.rows_of(&places);
            let own = rows(index + 1, of_it.clone());
            let at = |row: usize| own[row - of_it.start];
            sums.0 = sum_without(of_it.clone(), unpaired, |row| {
                let place = traverse.places[row] as usize;
                f64::from(first[place - places.start]) - f64::from(at(row))
            });
            if told {
                let silent = traverse.blank(&self.kind);
                sums.1 = sum_without(of_it.clone(), silent, |row| f64::from(at(row)));
                let silent = within(&of_it, silent).iter().map(|&row| at(row));
                all.nearest = silent.fold(all.nearest, f32::min);
            }
        }
        all
    }

    /// From the sums of all blocks, added in order.
    pub(crate) fn means(&self, nothing: bool, sums: &RowSums) -> Means {
        let Mean { mean, nothing } = self.mean(nothing, sums);
        let shifts = (0..self.further()).map(|index| self.shift(index, sums)).collect();
        Means { shifts, mean, nothing }
    }

    /// What is added to the distances of a further traverse.
    fn shift(&self, index: usize, sums: &RowSums) -> f64 {
        let rows = self.route.traverses.further[index].places.len();
        let paired = rows - self.quiet().unpaired[index].len();
        if paired == 0 { 0.0 } else { sums.further[index].0 / paired as f64 }
    }

    fn mean(&self, nothing: bool, sums: &RowSums) -> Mean {
        let (mut sum, mut count) = (sums.first, self.places() - self.silent().len());
        for (index, traverse) in self.route.traverses.further.iter().enumerate() {
            let showing = traverse.places.len() - traverse.blank(&self.kind).len();
            sum += sums.further[index].1 + showing as f64 * self.shift(index, sums);
            count += showing;
        }
        let mean = sum / count as f64;
        Mean { mean, nothing: nothing || f64::from(sums.nearest) <= SAME * mean }
    }

    /// Makes the column of some places, of one traverse or of several: as [`fold`](Self::fold) or
    /// [`quieten`](Self::quieten) would.
    pub(crate) fn settle<'a>(
        &self,
        means: &Means,
        places: Range<usize>,
        rows: impl Fn(usize, Range<usize>) -> &'a [f32],
        column: &mut [f32],
    ) {
        if means.mean.is_finite() || self.has_several() {
            let Means { ref shifts, mean, nothing } = *means;
            let mean = Mean { mean, nothing };
            let shift = |index: usize| shifts.get(index).copied().unwrap_or_default();
            return self.fold_part(mean, shift, places, rows, column);
        }
        column.copy_from_slice(rows(0, places));
    }

    /// Makes the column of some places.
    fn fold_part<'a>(
        &self,
        Mean { mean, nothing }: Mean,
        shift: impl Fn(usize) -> f64,
        places: Range<usize>,
        rows: impl Fn(usize, Range<usize>) -> &'a [f32],
        column: &mut [f32],
    ) {
        column.copy_from_slice(rows(0, places.clone()));
        // If the mean is no number, a distance is none, and is refused where it stands.
        let known = mean.is_finite();
        if nothing && known {
            return column.fill(mean as f32);
        }
        for &row in within(&places, self.silent()) {
            column[row - places.start] = f32::INFINITY;
        }
        for (index, traverse) in self.route.traverses.further.iter().enumerate() {
            let shift = shift(index);
            let of_it = traverse.rows_of(&places);
            let own = rows(index + 1, of_it.clone());
            for row in between(of_it.clone(), traverse.blank(&self.kind)).flatten() {
                let distance = (f64::from(own[row - of_it.start]) + shift) as f32;
                let least = &mut column[traverse.places[row] as usize - places.start];
                // A NaN stays, so that it is refused.
                if distance < *least || distance.is_nan() {
                    *least = distance;
                }
            }
        }
        if known {
            for &place in within(&places, self.blank_places()) {
                column[place - places.start] = mean as f32;
            }
        }
    }

    /// The rows of the first traverse that show nothing, unless all places do.
    fn silent(&self) -> &[usize] {
        if self.quiet().places.len() == self.places() { &[] } else { self.blank_rows() }
    }

    /// The places all of whose rows show nothing.
    pub(super) fn blank_places(&self) -> &[usize] {
        // Both are known from now on, so that a push need not find them.
        let first = self.blank_rows();
        if self.has_several() { &self.quiet().places } else { first }
    }

    fn quiet(&self) -> &Quiet {
        let Traverses { further, quiet, .. } = &self.route.traverses;
        quiet.get_or_init(|| {
            let mut silent = vec![false; self.places()];
            self.blank_rows().iter().for_each(|&row| silent[row] = true);
            let shown = silent.clone();
            let mut any = !self.blank_rows().is_empty();
            let unpaired = further.iter().map(|traverse| {
                let mut own = vec![false; traverse.places.len()];
                let blank = traverse.blank(&self.kind);
                any |= !blank.is_empty();
                for &row in blank {
                    own[row] = true;
                }
                for (&place, &blank) in traverse.places.iter().zip(&own) {
                    silent[place as usize] &= blank;
                }
                let of = |row: &usize| own[*row] || shown[traverse.places[*row] as usize];
                (0..own.len()).filter(of).collect()
            });
            let unpaired = unpaired.collect();
            let places = (0..silent.len()).filter(|&place| silent[place]).collect();
            Box::new(Quiet { places, unpaired, any })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance::Metric;
    use crate::random::SplitMix64;

    const PLACES: usize = 9000;
    const DIM: usize = 9;

    /// A map of some drives, in which some rows show nothing, and distances to all rows.
    fn map(drives: u64) -> (Map, Vec<f32>) {
        let mut random = SplitMix64(drives);
        let mut drive = |rows: usize| {
            let mut numbers: Vec<f32> = (0..rows * DIM).map(|_| random.share() + 0.1).collect();
            let dark = numbers.chunks_mut(DIM).step_by(37);
            dark.for_each(|row| row.fill(0.0));
            Map::from_descriptors(numbers, DIM, Metric::Euclidean).unwrap()
        };
        let mut map = drive(PLACES);
        for by in 1..drives {
            let rows = drive(PLACES / 4);
            let at = |row| Some((row * 2 + 5 * by as usize) % PLACES);
            let at: Vec<_> = (0..rows.places()).map(at).collect();
            map = map.add_traverse(&rows, &at, "").unwrap();
        }
        let distances = (0..map.rows()).map(|_| random.share()).collect();
        (map, distances)
    }

    #[test]
    fn blocks_alone_make_the_column_of_all() {
        for (drives, nothing) in [(1, false), (3, false), (3, true)] {
            let (map, distances) = map(drives);
            let mut column = vec![0.0; PLACES];
            map.fold(nothing, &distances, &mut column);
            assert!(nothing || map.blank().len() > 100 / drives as usize);
            let rows = |traverse: usize, of_it: Range<usize>| {
                let start = [0, PLACES, PLACES + PLACES / 4][traverse];
                &distances[start + of_it.start..start + of_it.end]
            };
            let alone: Vec<_> =
                blocks(PLACES).map(|block| map.row_sums(nothing, block, rows)).collect();
            let mut all = RowSums::NONE;
            for sums in &alone {
                all.add(sums);
            }
            let means = map.means(nothing, &all);
            let mut parts = vec![0.0; PLACES];
            for places in [0..100, 100..4096, 4096..PLACES] {
                map.settle(&means, places.clone(), rows, &mut parts[places]);
            }
            assert_eq!(parts, column);
        }
    }

    #[test]
    fn one_traverse_is_folded_as_it_is_quietened() {
        let (map, distances) = map(1);
        for nothing in [false, true] {
            for near in [1.0, 1e-4] {
                let mut distances = distances.clone();
                distances[37] *= near;
                let (mut folded, mut quiet) = (vec![0.0; PLACES], distances.clone());
                map.fold(nothing, &distances, &mut folded);
                map.quieten(nothing, &mut quiet);
                assert_eq!(folded, quiet);
            }
        }
    }
}
