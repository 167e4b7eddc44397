//! Weighted sequence matching (method 1.4 and 1.5, Eqs. 4 to 6).

use std::ops::Range;

use super::consensus::Single;
use super::diagonal::Diagonal;
use super::extreme::first_better;
use super::order::diagonal_sum;
use super::ring::Ring;
use super::visit::Visit;
use crate::error::Error;
use crate::preallocated::Preallocated;

/// The best match of the last `L` queries together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sequence {
    /// The current query's place, from 0.
    pub place: usize,
    /// The mean of the weighted distances along the diagonal that ends there (Eq. 6).
    pub score: f32,
    /// How many trusted matches lie on that diagonal, from 0 to `L`.
    pub anchors: usize,
    /// The slope of that diagonal, in places a query.
    pub speed: f64,
}

/// The single match of a column and whether it was trusted: all that Eq. 4 needs to weight it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Anchor {
    pub(super) single: Single,
    pub(super) trusted: bool,
}

/// The anchors of the newest queries.
#[derive(Clone, Debug)]
pub(super) struct Anchors {
    ring: Vec<Anchor>,
    /// Where the newest lies.
    newest: usize,
}

impl Anchors {
    /// Room for those of `length` queries.
    pub(super) fn new(length: usize) -> Result<Self, Error> {
        let nothing = Anchor { single: Single { place: 0, distance: 0.0 }, trusted: false };
        let mut ring = Vec::new();
        ring.try_reserve_exact(length).map_err(|_| Error::Memory { places: 1, columns: length })?;
        ring.resize(length, nothing);
        Ok(Self { ring, newest: 0 })
    }

    pub(super) fn push(&mut self, anchor: Anchor) {
        self.newest = if self.newest + 1 == self.ring.len() { 0 } else { self.newest + 1 };
        self.ring[self.newest] = anchor;
    }

    /// That of `age` queries ago, below `length`.
    pub(super) fn get(&self, age: usize) -> Anchor {
        self.ring[self.turned(age)]
    }

    /// The age and the place of each trusted match, in any order; `length` queries must have been
    /// pushed.
    fn trusted(&self) -> impl Iterator<Item = (usize, usize)> {
        let trusted = self.ring.iter().enumerate().filter(|(_, anchor)| anchor.trusted);
        trusted.map(|(slot, anchor)| (self.turned(slot), anchor.single.place))
    }

    /// The slot of an age, and the age of a slot.
    fn turned(&self, slot: usize) -> usize {
        if slot > self.newest { self.newest + self.ring.len() - slot } else { self.newest - slot }
    }
}

/// Eq. 4: the trusted cell's distance, drawn towards the floor by `weight`.
fn weighted(distance: f32, weight: f64, floor: f64) -> f32 {
    let distance = f64::from(distance);
    (distance - weight * (distance - floor)) as f32
}

/// The window of the last queries as the search sees it.
#[derive(Clone, Copy)]
pub(super) struct Window<'a> {
    /// The newest query's number.
    pub(super) frame: u64,
    /// The newest columns, raw, at least as many as the window has once it is full.
    pub(super) columns: &'a Ring,
    pub(super) anchors: &'a Anchors,
    /// `w` of Eq. 4.
    pub(super) weight: f64,
    /// What trusted cells are drawn towards (Eq. 4).
    pub(super) floor: f64,
}

impl Window<'_> {
    /// Eqs. 4 and 6: the sum along the diagonal that ends in `place`, its trusted cells weighted.
    #[inline(always)]
    pub(super) fn weighted_sum(&self, place: usize, back: &[usize]) -> f64 {
        diagonal_sum(self.frame, back.len(), |age| {
            let (at, anchor) = (place - back[age], self.anchors.get(age));
            f64::from(if anchor.trusted && anchor.single.place == at {
                weighted(anchor.single.distance, self.weight, self.floor)
            } else {
                self.columns.column(age)[at]
            })
        })
    }

    /// The match of the diagonal that ends in `place` and has this sum.
    #[inline(always)]
    pub(super) fn sequence(&self, place: usize, sum: f64, diagonal: &Diagonal) -> Sequence {
        let Diagonal { speed, back, .. } = diagonal;
        // A sum of negative zeros is zero.
        let mean = (0.0 + sum) / back.len() as f64;
        Sequence { place, score: mean as f32, anchors: self.count(place, back), speed: *speed }
    }

    /// How many trusted cells lie on the diagonal that ends in `place`.
    #[inline(always)]
    fn count(&self, place: usize, back: &[usize]) -> usize {
        self.anchors.trusted().filter(|&(age, at)| at + back[age] == place).count()
    }
}

/// The search for the best diagonal of all slopes.
#[derive(Clone, Debug)]
pub(super) struct Search {
    pub(super) diagonals: Vec<Diagonal>,
    /// Room for the diagonals with trusted cells.
    pub(super) anchored: Preallocated<Vec<(usize, f64)>>,
}

impl Search {
    pub(super) fn new(speeds: &[f64], length: usize, places: usize) -> Result<Self, Error> {
        let mut diagonals: Vec<Diagonal> = Vec::with_capacity(speeds.len());
        for &speed in speeds {
            // Of equals the speed named first wins: a second one of the same name never does.
            if diagonals.iter().all(|named| named.speed != speed) {
                diagonals.push(Diagonal::new(speed, length, places)?);
            }
        }
        let mut anchored = Vec::new();
        anchored
            .try_reserve_exact(length)
            .map_err(|_| Error::Memory { places: 1, columns: length })?;
        Ok(Self { diagonals, anchored: Preallocated(anchored) })
    }

    /// Eqs. 4 to 6: the smallest mean of all diagonals of full windows; nothing before the first
    /// full window.
    #[inline(always)]
    pub(super) fn best(&mut self, window: Window<'_>) -> Option<Sequence> {
        let mut best: Option<(usize, f64, &Diagonal)> = None;
        for diagonal in &mut self.diagonals {
            let Some((place, sum)) = best_place(diagonal, window, &mut self.anchored) else {
                continue;
            };
            // The smallest sum; of equals the lowest place, then the speed named first.
            let wins =
                best.is_none_or(|(at, least, _)| sum < least || (sum == least && place < at));
            if wins {
                best = Some((place, sum, diagonal));
            }
        }
        best.map(|(place, sum, diagonal)| window.sequence(place, sum, diagonal))
    }

    /// Takes in the newest column without a search: a restored matcher goes through its columns
    /// again.
    pub(super) fn catch_up(&mut self, columns: &Ring, frame: u64) {
        for diagonal in &mut self.diagonals {
            diagonal.catch_up(columns, frame);
        }
    }
}

/// Eq. 6 for one slope: the first place where the sum is smallest, and that sum. The plain sums of
/// all diagonals are made together; the few diagonals with trusted cells have sums of their own,
/// with the weights of this query.
#[inline(always)]
fn best_place(
    diagonal: &mut Diagonal,
    window: Window<'_>,
    anchored: &mut Vec<(usize, f64)>,
) -> Option<(usize, f64)> {
    weigh_anchored(diagonal, window, anchored);
    let mut least = Least { anchored, place: diagonal.first(), sum: f64::INFINITY };
    diagonal.sums(window.columns, window.frame, &mut least);
    (window.columns.len() >= diagonal.back.len()).then_some((least.place, least.sum))
}

/// The smallest sum so far, and where it stands first.
struct Least<'a> {
    /// The diagonals with trusted cells that are still to come, each with its weighted sum.
    anchored: &'a [(usize, f64)],
    place: usize,
    sum: f64,
}

impl Visit<f64> for &mut Least<'_> {
    #[inline(always)]
    fn to_beat(&self, places: Range<usize>) -> Option<f64> {
        let anchored = self.anchored.first().is_some_and(|&(place, _)| place < places.end);
        (!anchored).then_some(self.sum)
    }

    #[inline(always)]
    fn visit(&mut self, start: usize, sums: &mut [f64]) {
        while let Some((&(place, sum), later)) = self.anchored.split_first()
            && place < start + sums.len()
        {
            sums[place - start] = sum;
            self.anchored = later;
        }
        if let Some((at, sum)) = first_better(sums, self.sum, |a, b| a < b) {
            (self.place, self.sum) = (start + at, sum);
        }
    }
}

/// The diagonals that hold trusted cells, by the place where they end, in order, each with its
/// weighted sum; none before the first full window.
#[inline(always)]
pub(super) fn weigh_anchored(
    diagonal: &Diagonal,
    window: Window<'_>,
    anchored: &mut Vec<(usize, f64)>,
) {
    anchored.clear();
    let back = &diagonal.back;
    if window.columns.len() < back.len() {
        return;
    }
    let on_route = diagonal.first()..window.columns.height();
    for (age, at) in window.anchors.trusted() {
        let place = at + back[age];
        // In a drive that is followed well, all lie on one diagonal.
        let known = anchored.last().is_some_and(|&(last, _)| last == place);
        if on_route.contains(&place) && !known {
            anchored.push((place, 0.0));
        }
    }
    anchored.sort_unstable_by_key(|&(place, _)| place);
    anchored.dedup_by_key(|&mut (place, _)| place);
    for (place, sum) in anchored {
        *sum = window.weighted_sum(*place, back);
    }
}
