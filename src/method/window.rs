//! The columns of the newest queries: distances, or bounds of them and an oracle to ask.
//!
//! A screened map (method 2.1) gives two bounds of each distance instead of the distance. Each
//! search of the method then works on bounds and resolves (asks for) the few distances that decide
//! it. Every addition on bounds is the method's own, in the same order, and rounding keeps the
//! order of numbers: the results are bounds again, rounding included, so that the answers are those
//! of the distances, to the last bit.

use std::collections::VecDeque;
use std::ops::Range;

use super::argmin::{Candidate, Search, first_least};
use super::single::{Single, checked_minimum, is_constant, minimum};
use crate::error::Error;
use crate::memory;
use crate::preallocated::Preallocated;

/// If more than one place in four is unresolved, all of the column is computed: in order, that is
/// no slower.
pub(super) const MAX_OPEN: usize = 4;

/// Computes distances of the newest queries on request.
pub(crate) trait Exact {
    /// Whether columns can be bounds. If not, the search by bounds is not compiled.
    const BOUNDS: bool;

    /// Writes the distances of the query of `age` pushes ago to `places` into `out`.
    fn distances(&mut self, age: usize, places: Range<usize>, out: &mut [f32]);
}

/// Columns are distances: there is nothing to ask for.
impl Exact for () {
    const BOUNDS: bool = false;

    fn distances(&mut self, _age: usize, _places: Range<usize>, _out: &mut [f32]) {}
}

/// One query's distances to all places, or bounds of them.
#[derive(Clone, Copy)]
pub(crate) struct Column<'a> {
    /// The distances, or lower bounds: finite, and so small that sums of them do not overflow.
    pub(crate) lower: &'a [f32],
    /// Upper bounds, likewise; `None` if `lower` is the distances.
    pub(crate) upper: Option<&'a [f32]>,
    /// What several techniques say together for each place, in place of the distances (method 1.9).
    pub(crate) evidence: Option<&'a [f64]>,
}

impl<'a> Column<'a> {
    /// The distances themselves.
    pub(crate) fn exact(distances: &'a [f32]) -> Self {
        Self { lower: distances, upper: None, evidence: None }
    }

    /// Bounds of them.
    pub(crate) fn bounds(lower: &'a [f32], upper: &'a [f32]) -> Self {
        Self { lower, upper: Some(upper), evidence: None }
    }
}

/// The newest columns since the last gap, raw.
#[derive(Clone, Debug)]
pub(crate) struct Window {
    pub(super) cells: Cells,
    pub(super) scratch: Scratch,
}

/// The columns, and which of their distances are resolved.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    /// Distances, or lower bounds of them.
    pub(super) lower: Ring,
    /// Upper bounds. A distance that is resolved is both. `None` if all columns are distances.
    upper: Option<Ring>,
    /// How many distances of each column are resolved, the newest column's first.
    resolved: Preallocated<VecDeque<usize>>,
    /// How many were resolved since the newest column came.
    asked: usize,
}

/// Memory for the searches by bounds.
#[derive(Clone, Debug)]
pub(super) struct Scratch {
    /// The negated upper bounds of the gradients.
    pub(super) gradients: Vec<f32>,
    /// The lower bounds of the diagonals' sums.
    pub(super) sums: Vec<f64>,
    pub(super) candidates: Preallocated<Vec<Candidate>>,
}

impl Window {
    /// For `columns` columns of `places` distances.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(super) fn new(columns: usize, places: usize) -> Result<Self, Error> {
        let lower = Ring::new(columns, places)?;
        let resolved = Preallocated(VecDeque::new());
        let scratch = Scratch {
            gradients: Vec::new(),
            sums: Vec::new(),
            candidates: Preallocated(Vec::new()),
        };
        Ok(Self { cells: Cells { lower, upper: None, resolved, asked: 0 }, scratch })
    }

    /// Makes room for bounds beside the distances.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is not enough for a second window.
    pub(super) fn accept_bounds(&mut self) -> Result<(), Error> {
        let lower = &self.cells.lower;
        let (columns, places) = (lower.capacity(), lower.height());
        let refused = |_| Error::Memory { places, columns };
        let Scratch { gradients, sums, candidates } = &mut self.scratch;
        gradients.try_reserve_exact(places).map_err(refused)?;
        sums.try_reserve_exact(places).map_err(refused)?;
        candidates.try_reserve_exact(places).map_err(refused)?;
        let resolved = &mut self.cells.resolved;
        resolved.try_reserve_exact(columns + 1).map_err(refused)?;
        resolved.extend(std::iter::repeat_n(places, lower.len()));
        gradients.resize(places, 0.0);
        sums.resize(places, 0.0);
        self.cells.upper = Some(lower.clone());
        Ok(())
    }

    /// Takes the newest column, and gives its minimum (method 1.3).
    ///
    /// # Errors
    /// Those of [`checked_minimum`] for a column of distances. Nothing is kept of it then.
    #[inline(always)]
    pub(super) fn push<E: Exact>(
        &mut self,
        column: Column<'_>,
        ask: &mut E,
    ) -> Result<Single, Error> {
        let Self { cells, scratch } = self;
        let Some(upper) = column.upper.filter(|_| E::BOUNDS) else {
            let single = checked_minimum(column.lower, cells.lower.height())?;
            cells.push(column.lower, column.lower, column.lower.len());
            return Ok(single);
        };
        cells.push(column.lower, upper, 0);
        let distance = |place: usize, _: Option<Candidate>| {
            cells.resolve(0, place..place + 1, ask);
            Some(cells.lower.column(0)[place].into())
        };
        let most = column.lower.len() / MAX_OPEN;
        match first_least(column.lower, 0, None, most, &mut scratch.candidates, distance) {
            Search::Best(Some((distance, place))) => {
                Ok(Single { place, distance: distance as f32 })
            }
            Search::Best(None) | Search::TooMany => {
                cells.resolve_all(0, ask);
                Ok(minimum(cells.lower.column(0)))
            }
        }
    }

    /// Whether all distances of the newest column, whose minimum is `single`, are equal.
    #[inline(always)]
    pub(super) fn says_nothing<E: Exact>(&mut self, single: Single, ask: &mut E) -> bool {
        let cells = &mut self.cells;
        if E::BOUNDS && !cells.is_resolved(0) {
            if cells.lower.column(0).iter().any(|&low| low > single.distance) {
                return false;
            }
            cells.resolve_all(0, ask);
        }
        is_constant(cells.lower.column(0))
    }

    /// How many columns it holds.
    pub(crate) fn len(&self) -> usize {
        self.cells.lower.len()
    }

    /// How many it holds at most.
    pub(crate) fn capacity(&self) -> usize {
        self.cells.lower.capacity()
    }

    /// How many distances have been asked for since the newest column came.
    pub(crate) fn asked(&self) -> usize {
        self.cells.asked
    }

    /// Resolves all places of all columns.
    pub(crate) fn resolve(&mut self, ask: &mut impl Exact) {
        (0..self.len()).for_each(|age| self.cells.resolve_all(age, ask));
    }

    /// The newest query's distances, all of them resolved; `None` before the first, and right after
    /// a gap.
    pub(crate) fn newest(&mut self, ask: &mut impl Exact) -> Option<&[f32]> {
        if self.len() == 0 {
            return None;
        }
        self.cells.resolve_all(0, ask);
        Some(self.cells.lower.column(0))
    }

    pub(super) fn clear(&mut self) {
        let Cells { lower, upper, resolved, .. } = &mut self.cells;
        lower.clear();
        resolved.clear();
        if let Some(upper) = upper {
            upper.clear();
        }
    }
}

impl Cells {
    pub(super) fn push(&mut self, lower: &[f32], upper: &[f32], resolved: usize) {
        self.lower.advance().copy_from_slice(lower);
        self.asked = 0;
        if let Some(bounds) = &mut self.upper {
            bounds.advance().copy_from_slice(upper);
            self.resolved.truncate(self.lower.len() - 1);
            self.resolved.push_front(resolved);
        }
    }

    /// Puts numbers in place of a distance's bounds, or of the distance itself, and gives back what
    /// was there.
    #[inline(always)]
    pub(super) fn replace(&mut self, age: usize, place: usize, [low, high]: [f32; 2]) -> [f32; 2] {
        let low = std::mem::replace(&mut self.lower.column_mut(age)[place], low);
        let upper = self.upper.as_mut().map(|upper| &mut upper.column_mut(age)[place]);
        [low, upper.map_or(low, |upper| std::mem::replace(upper, high))]
    }

    /// Upper bounds of the distances.
    pub(super) fn upper(&self) -> &Ring {
        self.upper.as_ref().unwrap_or(&self.lower)
    }

    /// Whether all distances of a column are resolved.
    pub(super) fn is_resolved(&self, age: usize) -> bool {
        self.resolved.get(age).is_none_or(|&resolved| resolved == self.lower.height())
    }

    /// Resolves those of the places that are not yet, and says whether any was not.
    pub(super) fn resolve(
        &mut self,
        age: usize,
        places: Range<usize>,
        ask: &mut impl Exact,
    ) -> bool {
        if self.is_resolved(age) {
            return false;
        }
        let mut any = false;
        for place in places {
            let (low, high) = (self.lower.column(age)[place], self.upper().column(age)[place]);
            if low.to_bits() == high.to_bits() {
                continue;
            }
            if self.resolved[age] >= self.lower.height() / MAX_OPEN {
                self.resolve_all(age, ask);
                return true;
            }
            let mut distance = [0.0];
            ask.distances(age, place..place + 1, &mut distance);
            debug_assert!((low..=high).contains(&distance[0]), "{distance:?}: {low} to {high}");
            self.lower.column_mut(age)[place] = distance[0];
            if let Some(upper) = &mut self.upper {
                upper.column_mut(age)[place] = distance[0];
            }
            self.resolved[age] += 1;
            self.asked += 1;
            any = true;
        }
        any
    }

    /// Resolves all places of a column.
    pub(super) fn resolve_all(&mut self, age: usize, ask: &mut impl Exact) {
        if self.is_resolved(age) {
            return;
        }
        let lower = self.lower.column_mut(age);
        ask.distances(age, 0..lower.len(), lower);
        self.asked += lower.len() - self.resolved[age];
        self.resolved[age] = lower.len();
        if let Some(upper) = &mut self.upper {
            upper.column_mut(age).copy_from_slice(lower);
        }
    }
}

/// Which columns a ring holds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Held {
    newest: usize,
    len: usize,
}

/// The newest `capacity` columns of `height` numbers each, oldest overwritten first.
#[derive(Clone, Debug)]
pub(crate) struct Ring {
    numbers: Vec<f32>,
    height: usize,
    capacity: usize,
    /// The index of the newest column.
    newest: usize,
    len: usize,
}

impl Ring {
    /// Memory for `capacity` columns, taken and touched now.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(crate) fn new(capacity: usize, height: usize) -> Result<Self, Error> {
        let refused = || Error::Memory { places: height, columns: capacity };
        let count = capacity.checked_mul(height).ok_or_else(refused)?;
        let mut numbers = Vec::new();
        memory::reserve(&mut numbers, count).map_err(|_| refused())?;
        numbers.resize(count, 0.0);
        Ok(Self { numbers, height, capacity, newest: 0, len: 0 })
    }

    /// How many columns it holds at most.
    pub(crate) fn capacity(&self) -> usize {
        self.capacity
    }

    /// Numbers a column.
    pub(crate) fn height(&self) -> usize {
        self.height
    }

    /// How many columns it holds now.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    pub(crate) fn clear(&mut self) {
        self.len = 0;
    }

    /// Which columns it holds.
    pub(crate) fn held(&self) -> Held {
        Held { newest: self.newest, len: self.len }
    }

    /// Holds those again, of which no more than one column has been overwritten since: the oldest
    /// is left out if it is that one.
    pub(crate) fn hold(&mut self, Held { newest, len }: Held) {
        self.newest = newest;
        self.len = len.min(self.capacity - 1);
    }

    /// The columns of then, newest first, of which no more than one has been overwritten since.
    pub(crate) fn columns(&self, Held { newest, len }: Held) -> impl Iterator<Item = &[f32]> {
        let index = move |age: usize| (newest + self.capacity - age) % self.capacity;
        let len = len.min(self.capacity - 1);
        (0..len).map(move |age| &self.numbers[index(age) * self.height..][..self.height])
    }

    /// Adds a column, to be written by the caller.
    pub(crate) fn advance(&mut self) -> &mut [f32] {
        self.newest = if self.newest + 1 == self.capacity { 0 } else { self.newest + 1 };
        self.len = (self.len + 1).min(self.capacity);
        let start = self.newest * self.height;
        &mut self.numbers[start..start + self.height]
    }

    /// The column of `age` pushes ago: 0 is the newest. `age` is below `len()`.
    pub(crate) fn column(&self, age: usize) -> &[f32] {
        let start = self.start(age);
        &self.numbers[start..start + self.height]
    }

    /// The same, to be written.
    pub(crate) fn column_mut(&mut self, age: usize) -> &mut [f32] {
        let start = self.start(age);
        &mut self.numbers[start..start + self.height]
    }

    fn start(&self, age: usize) -> usize {
        debug_assert!(age < self.len, "column {age} of {}", self.len);
        let newest = self.newest;
        let index = if age <= newest { newest - age } else { newest + self.capacity - age };
        index * self.height
    }
}
