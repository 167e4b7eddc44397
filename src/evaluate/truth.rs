//! When a match counts as correct.

use ndarray::ArrayView2;

use crate::error::Error;
use crate::map::Positions;
use crate::parallel::each;
use crate::segments::Segments;

/// The true place of each query.
///
/// By place, a query off the map among them; or by metres:
///
/// ```
/// use surefix::Positions;
/// use surefix::evaluate::{Truth, Verdict};
///
/// let truth = Truth::places(vec![Some(4), None], 1);
/// assert_eq!(truth.judge(0, 5), Verdict::Correct);
/// assert_eq!(truth.judge(1, 5), Verdict::Wrong); // nothing is right there
///
/// let along = |metres: &[f64]| Positions::new(metres.iter().flat_map(|&x| [x, 0.0]).collect(), 2);
/// let truth = Truth::positions(along(&[0.0, 10.0, 20.0])?, along(&[12.0])?, 5.0)?;
/// assert_eq!(truth.judge(0, 1), Verdict::Correct);
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Truth {
    kind: Kind,
    /// How the places follow each other, if not in one open segment.
    segments: Option<Segments>,
    /// Ascending: the queries whose place is not known.
    unknown: Vec<usize>,
}

#[derive(Clone, Debug)]
enum Kind {
    /// The true place of each query, if it has one; up to `tolerance` places off is correct.
    Places { truth: Vec<Option<usize>>, tolerance: usize },
    /// For each query its column of cells; up to `tolerance` places off is correct.
    Cells { columns: Vec<Vec<i8>>, tolerance: usize },
    /// The positions of places and queries; up to `metres` apart is correct.
    Positions { places: Positions, queries: Positions, metres: f64, exists: Vec<bool> },
}

/// The truth's verdict on one match.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The place is the true one, within the tolerance.
    Correct,
    /// It is not.
    Wrong,
    /// The truth does not say. The query is left out.
    Ignored,
}

impl Truth {
    /// The true place of each query; `None` for a query off the map. A match within
    /// `tolerance` places is correct.
    pub fn places(truth: Vec<Option<usize>>, tolerance: usize) -> Self {
        Self::of(Kind::Places { truth, tolerance })
    }

    /// A matrix, places by queries: 1 if they show the same place, 0 if they do not, -1 if that is
    /// to be ignored. A match within `tolerance` places of a 1 is correct.
    ///
    /// # Errors
    /// [`Error::Shape`] for any other number in a cell.
    pub fn cells(cells: &ArrayView2<'_, i8>, tolerance: usize) -> Result<Self, Error> {
        if let Some(((place, query), cell)) =
            cells.indexed_iter().find(|(_, cell)| !(-1..=1).contains(*cell))
        {
            let expected = "cells of 1 (the same place), 0 (not) or -1 (ignored)".to_owned();
            let got = format!("{cell} at place {place}, query {query}");
            return Err(Error::Shape { what: "truth", expected, got });
        }
        let columns = cells.columns().into_iter().map(|column| column.to_vec()).collect();
        Ok(Self::of(Kind::Cells { columns, tolerance }))
    }

    /// The positions of places and queries. A match within `metres` is correct; a query that has no
    /// place within `metres` is off the map.
    ///
    /// # Errors
    /// [`Error::Shape`] if one has two axes and the other three, [`Error::Option`] for a
    /// tolerance that is not a number of 0 or more.
    pub fn positions(places: Positions, queries: Positions, metres: f64) -> Result<Self, Error> {
        if places.axes() != queries.axes() {
            let expected = format!("{} coordinates a query, as the places have", places.axes());
            let got = queries.axes().to_string();
            return Err(Error::Shape { what: "query positions", expected, got });
        }
        if !(metres >= 0.0 && metres.is_finite()) {
            let expected = "metres, 0 or more".to_owned();
            return Err(Error::Option { name: "tolerance", expected, got: metres.to_string() });
        }
        let near = |place, query| distance(&places, place, &queries, query) <= metres;
        let exists = each(
            0..queries.len(),
            || (),
            |(), query| Ok((0..places.len()).any(|place| near(place, query))),
        )?;
        Ok(Self::of(Kind::Positions { places, queries, metres, exists }))
    }

    /// The same without a verdict on some queries, whose place is not known: every match of theirs
    /// is [`Verdict::Ignored`].
    ///
    /// ```
    /// use surefix::evaluate::{Truth, Verdict};
    ///
    /// let truth = Truth::places(vec![Some(4), None], 1).ignoring([1]);
    /// assert_eq!(truth.judge(1, 5), Verdict::Ignored);
    /// ```
    #[must_use]
    pub fn ignoring(mut self, queries: impl IntoIterator<Item = usize>) -> Self {
        self.unknown.extend(queries);
        self.unknown.sort_unstable();
        self
    }

    /// The same on a route of these segments. A tolerance in places ends at a break, and goes on from
    /// the last place of a closed segment to its first. Positions are as near as they are.
    ///
    /// ```
    /// use surefix::Segments;
    /// use surefix::evaluate::{Truth, Verdict};
    ///
    /// let loops = Segments::new(8, &[4])?.with_closed(&[0])?; // places 0 to 3, closed; 4 to 7
    /// let truth = Truth::places(vec![Some(3)], 1).along(&loops);
    /// assert_eq!(truth.judge(0, 0), Verdict::Correct);
    /// assert_eq!(truth.judge(0, 4), Verdict::Wrong);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    #[must_use]
    pub fn along(mut self, segments: &Segments) -> Self {
        self.segments = Some(segments.clone());
        self
    }

    /// Of positions, the diagonal of the box that holds the places, in metres: within a greater
    /// tolerance every match is right. `None` for other truths, and without places.
    ///
    /// ```
    /// use surefix::Positions;
    /// use surefix::evaluate::Truth;
    ///
    /// let places = Positions::new(vec![0.0, 0.0, 3.0, 4.0], 2)?;
    /// let truth = Truth::positions(places, Positions::new(vec![1.0, 0.0], 2)?, 5.0)?;
    /// assert_eq!(truth.extent(), Some(5.0));
    /// # Ok::<(), surefix::Error>(())
    /// ```
    pub fn extent(&self) -> Option<f64> {
        let Kind::Positions { places, .. } = &self.kind else { return None };
        if places.is_empty() {
            return None;
        }
        let axes = places.axes();
        let side = |axis: usize| {
            let along = || places.metres().iter().skip(axis).step_by(axes).copied();
            along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
        };
        Some((0..axes).map(|axis| side(axis).powi(2)).sum::<f64>().sqrt())
    }

    fn of(kind: Kind) -> Self {
        Self { kind, segments: None, unknown: Vec::new() }
    }

    fn is_unknown(&self, query: usize) -> bool {
        self.unknown.binary_search(&query).is_ok()
    }

    /// The number of queries.
    pub fn len(&self) -> usize {
        match &self.kind {
            Kind::Places { truth, .. } => truth.len(),
            Kind::Cells { columns, .. } => columns.len(),
            Kind::Positions { queries, .. } => queries.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Refuses a truth of another route than one of `places` places.
    ///
    /// # Errors
    /// [`Error::Option`] for a true place past the end, [`Error::Length`] for a matrix or positions
    /// of other places.
    pub fn check_places(&self, places: usize) -> Result<(), Error> {
        let length = |got| {
            if got == places {
                return Ok(());
            }
            Err(Error::Length { what: "truth: the route", expected: places, got })
        };
        match &self.kind {
            Kind::Places { truth, .. } => {
                let beyond = truth
                    .iter()
                    .enumerate()
                    .find(|(_, place)| place.is_some_and(|place| place >= places));
                let Some((query, Some(place))) = beyond else { return Ok(()) };
                let expected = format!("places below {places}, or none");
                Err(Error::Option {
                    name: "truth",
                    expected,
                    got: format!("{place} for query {query}"),
                })
            }
            Kind::Cells { columns, .. } => {
                columns.first().map_or(Ok(()), |column| length(column.len()))
            }
            Kind::Positions { places: positions, .. } => length(positions.len()),
        }
    }

    /// Whether query `query` has a true place at all. A query past the end has none, nor has one
    /// whose place is not known.
    pub fn exists(&self, query: usize) -> bool {
        if self.is_unknown(query) {
            return false;
        }
        match &self.kind {
            Kind::Places { truth, .. } => truth.get(query).is_some_and(Option::is_some),
            Kind::Cells { columns, .. } => {
                columns.get(query).is_some_and(|column| column.contains(&1))
            }
            Kind::Positions { exists, .. } => exists.get(query).copied().unwrap_or(false),
        }
    }

    /// The verdict on matching query `query` to `place`. Off the map and past the end, every match
    /// is wrong.
    pub fn judge(&self, query: usize, place: usize) -> Verdict {
        if self.is_unknown(query) {
            return Verdict::Ignored;
        }
        let correct = match &self.kind {
            Kind::Places { truth, tolerance } => {
                let truth = truth.get(query).copied().flatten();
                truth.is_some_and(|truth| self.are_near(place, truth, *tolerance))
            }
            Kind::Cells { columns, tolerance } => {
                let column = columns.get(query).map_or(&[][..], Vec::as_slice);
                let mut same = column.iter().enumerate().filter(|&(_, &cell)| cell == 1);
                let near = same.any(|(true_place, _)| self.are_near(place, true_place, *tolerance));
                if !near && column.get(place) == Some(&-1) {
                    return Verdict::Ignored;
                }
                near
            }
            Kind::Positions { places, queries, metres, .. } => {
                place < places.len()
                    && query < queries.len()
                    && distance(places, place, queries, query) <= *metres
            }
        };
        if correct { Verdict::Correct } else { Verdict::Wrong }
    }

    /// Whether two places are at most `tolerance` places apart on the route. A place past its end is
    /// near none.
    fn are_near(&self, one: usize, other: usize, tolerance: usize) -> bool {
        match &self.segments {
            None => one.abs_diff(other) <= tolerance,
            Some(segments) => {
                one.max(other) < segments.places() && segments.are_near(one, other, tolerance)
            }
        }
    }
}

/// How far a place and a query are apart, in metres.
fn distance(places: &Positions, place: usize, queries: &Positions, query: usize) -> f64 {
    let axes = places.axes();
    let here = &places.metres()[place * axes..(place + 1) * axes];
    let there = &queries.metres()[query * axes..(query + 1) * axes];
    here.iter().zip(there).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}
