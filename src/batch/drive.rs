//! What is known about the queries of a batch: flags, odometry and gaps.

use crate::error::Error;
use crate::interrupt::check;
use crate::method::{Fix, Given, Matcher};
use crate::segments::Segments;

/// What is known about the queries of a batch beside their distances.
///
/// ```
/// use surefix::Drive;
/// let drive = Drive::default().advance(&[0.0, 1.1, 0.9]).gaps(&[2]);
/// assert_eq!(drive.trusted, None);
/// ```
#[derive(Clone, Copy, Debug, Default)]
#[non_exhaustive]
pub struct Drive<'a> {
    /// An external predictor's flag for each query ([`Given::trusted`]).
    pub trusted: Option<&'a [bool]>,
    /// The places that the robot moved before each query ([`Given::advance`]). Then gaps are
    /// [bridged](Matcher::gap_with_advance).
    pub advance: Option<&'a [f64]>,
    /// The queries, in any order, before which there is a gap ([`Matcher::gap`]).
    pub gaps: &'a [usize],
    /// How the places of a distance matrix follow each other: in one segment if it is not said. A
    /// map knows its own.
    pub segments: Option<&'a Segments>,
}

impl<'a> Drive<'a> {
    /// With an external predictor's flags.
    #[must_use]
    pub fn trusted(self, trusted: &'a [bool]) -> Self {
        Self { trusted: Some(trusted), ..self }
    }

    /// With odometry.
    #[must_use]
    pub fn advance(self, advance: &'a [f64]) -> Self {
        Self { advance: Some(advance), ..self }
    }

    /// With gaps.
    #[must_use]
    pub fn gaps(self, gaps: &'a [usize]) -> Self {
        Self { gaps, ..self }
    }

    /// Along these segments.
    #[must_use]
    pub fn along(self, segments: &'a Segments) -> Self {
        Self { segments: Some(segments), ..self }
    }

    /// The segments of a distance matrix of `places` places.
    ///
    /// # Errors
    /// [`Error::Length`] for those of another number of places.
    pub(super) fn route(&self, places: usize) -> Result<Segments, Error> {
        match self.segments {
            None => Ok(Segments::one(places)),
            Some(segments) if segments.places() == places => Ok(segments.clone()),
            Some(segments) => {
                let (what, got) = ("segments", segments.places());
                Err(Error::Length { what, expected: places, got })
            }
        }
    }

    /// # Errors
    /// [`Error::Option`] if there are segments.
    pub(super) fn on_a_map(&self) -> Result<(), Error> {
        match self.segments {
            None => Ok(()),
            Some(segments) => Err(Error::Option {
                name: "segments",
                expected: "none with a map, which has its own".to_owned(),
                got: format!("those of {} places", segments.places()),
            }),
        }
    }
}

/// [`Drive`], checked.
pub(super) struct Flags<'a> {
    trusted: Option<&'a [bool]>,
    advance: Option<&'a [f64]>,
    /// For each query, whether there is a gap before it.
    gaps: Vec<bool>,
}

impl<'a> Flags<'a> {
    pub(super) fn new(drive: Drive<'a>, queries: usize) -> Result<Self, Error> {
        let Drive { trusted, advance, gaps, .. } = drive;
        let lengths = [("trusted", trusted.map(<[_]>::len)), ("advance", advance.map(<[_]>::len))];
        for (what, length) in lengths {
            if let Some(got) = length.filter(|&got| got != queries) {
                return Err(Error::Length { what, expected: queries, got });
            }
        }
        for (query, &advance) in advance.unwrap_or_default().iter().enumerate() {
            Given::default().advance(advance).check().map_err(|error| match error {
                Error::Option { name, expected, got } => {
                    Error::Option { name, expected, got: format!("{got} for query {query}") }
                }
                other => other,
            })?;
        }
        let mut cut = vec![false; queries];
        for &query in gaps {
            *cut.get_mut(query).ok_or_else(|| Error::Option {
                name: "gaps",
                expected: match queries.checked_sub(1) {
                    Some(last) => format!("indices of queries, from 0 to {last}"),
                    None => "none, as there is no query".to_owned(),
                },
                got: query.to_string(),
            })? = true;
        }
        Ok(Self { trusted, advance, gaps: cut })
    }

    /// Pushes a query's distances, after its gap if there is one.
    pub(super) fn push(
        &self,
        matcher: &mut Matcher,
        query: usize,
        distances: &[f32],
    ) -> Result<Fix, Error> {
        check()?;
        let given = self.before(query, |advance| matcher.gap_of(advance))?;
        matcher.push_with(distances, given)
    }

    /// Says `gap` if there is one before the query, with an advance of 0 if the query's is known,
    /// and gives what is known about the query.
    pub(super) fn before(
        &self,
        query: usize,
        gap: impl FnOnce(Option<f64>) -> Result<(), Error>,
    ) -> Result<Given, Error> {
        let given = Given {
            trusted: self.trusted.map(|trusted| trusted[query]),
            advance: self.advance.map(|advance| advance[query]),
        };
        if self.gaps[query] {
            gap(given.advance.map(|_| 0.0))?;
        }
        Ok(given)
    }
}
