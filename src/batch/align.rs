//! Alignment (method 1.10): where each query of a whole drive was, by all of its queries.

use std::io::{self, Write};

use ndarray::ArrayView2;

use super::drive::{Drive, Flags};
use super::{Columns, REPORTED, count};
use crate::config::Config;
use crate::error::Error;
use crate::evaluate::Match;
use crate::image::Progress;
use crate::map::Map;
use crate::method::{Aligned, Aligner, Given, Source, Track};
use crate::motion::Motion;
use crate::numbers::{View, first_not_finite};
use crate::segments::Segments;

/// The track of each query of a drive by all of its queries, those after it too.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Alignment {
    /// One a query, in order.
    pub queries: Vec<Aligned>,
    /// How many places the route has.
    pub places: usize,
}

impl Alignment {
    /// How wrong each match of the same drive is, from 0 to 1: wholly if its place is more than
    /// `tolerance` places from the aligned one, else as much as the alignment is not sure.
    ///
    /// # Errors
    /// [`Error::Length`] if the alignment has another number of queries.
    pub fn wrong(&self, matches: &[Match], tolerance: usize) -> Result<Vec<Option<f64>>, Error> {
        let (expected, got) = (matches.len(), self.queries.len());
        if expected != got {
            return Err(Error::Length { what: "alignment", expected, got });
        }
        let wrong = |(found, aligned): (&Match, &Aligned)| {
            let near = found.place.abs_diff(aligned.track.place) <= tolerance;
            if near { 1.0 - aligned.track.confidence } else { 1.0 }
        };
        Ok(matches.iter().zip(&self.queries).map(|each| Some(wrong(each))).collect())
    }

    /// Writes the tracks as CSV: a line of names, then a line a query. `reference` is the place,
    /// and -1 if the confidence is below `least`: with the column `query` it is a truth.
    ///
    /// # Errors
    /// Whatever `out` gives.
    pub fn write_csv(&self, out: &mut impl Write, least: f64) -> io::Result<()> {
        writeln!(
            out,
            "query,reference,place,confidence,off_map,speed,place_low,place_high,single_place,single_right"
        )?;
        for (query, Aligned { track, single, single_right }) in self.queries.iter().enumerate() {
            let Track { place, confidence, off_map, speed, interval: (low, high) } = track;
            if *confidence < least {
                write!(out, "{query},-1")?;
            } else {
                write!(out, "{query},{place}")?;
            }
            writeln!(
                out,
                ",{place},{confidence},{off_map},{speed},{low},{high},{},{single_right}",
                single.place
            )?;
        }
        Ok(())
    }
}

/// Aligns the drive of a whole distance matrix, as for [`match_distances`](super::match_distances):
/// the tracker of [`Config::motion`](crate::Config::motion) in both directions (method 1.10). No
/// label is needed: for two recorded drives it stands in for the truth.
///
/// Beside the matrix, `2 sqrt(m) (V + 2) n` numbers of 8 bytes are held for `n` places, `m` queries
/// and `V` speeds.
///
/// ```
/// use ndarray::Array2;
/// use surefix::{Config, Drive, Motion, align_distances};
/// let distances = Array2::from_shape_fn((30, 30), |(i, j)| f32::from(i != j));
/// let mut config = Config::default();
/// config.motion = Some(Motion::steady());
/// let mut go_on = |_, _| std::ops::ControlFlow::Continue(());
/// let alignment = align_distances(distances.view(), &config, Drive::default(), &mut go_on)?;
/// assert!(alignment.queries.iter().enumerate().all(|(query, one)| one.track.place == query));
/// # Ok::<(), surefix::Error>(())
/// ```
///
/// # Errors
/// As for [`match_distances`](super::match_distances), and [`Error::Option`] without a motion;
/// [`Error::Interrupted`] if `progress` breaks.
#[expect(clippy::needless_pass_by_value, reason = "a view is a borrow already")]
pub fn align_distances(
    distances: ArrayView2<'_, f32>,
    config: &Config,
    drive: Drive<'_>,
    progress: Progress<'_>,
) -> Result<Alignment, Error> {
    let (places, queries) = distances.dim();
    let motion = motion_of(config, places)?;
    let flags = Flags::new(drive, queries)?;
    let segments = Segments::one(places);
    let column = |query: usize, out: &mut [f32]| {
        out.iter_mut().zip(distances.column(query)).for_each(|(out, &distance)| *out = distance);
        finite(out, query)
    };
    let source = Drives { queries, flags, column };
    run(motion, config.tolerance, &segments, source, progress)
}

/// Aligns many descriptors, one after the other in `queries`, with a map: as
/// [`align_distances`], without holding a matrix. The distances are computed twice, on all cores.
///
/// # Errors
/// As for [`match_descriptors`](super::match_descriptors), and [`Error::Option`] without a motion.
pub fn align_descriptors<'a>(
    map: &Map,
    queries: impl Into<View<'a>>,
    config: &Config,
    drive: Drive<'_>,
    progress: Progress<'_>,
) -> Result<Alignment, Error> {
    let queries = queries.into();
    let total = count(map, queries)?;
    let motion = motion_of(config, map.places())?;
    let flags = Flags::new(drive, total)?;
    queries.check_finite("queries", map.input_dim())?;
    let mut columns = Columns::new(map, queries, total)?;
    let column = |query: usize, out: &mut [f32]| {
        out.copy_from_slice(columns.of(query)?);
        finite(out, query)
    };
    let source = Drives { queries: total, flags, column };
    run(motion, config.tolerance, map.route().segments(), source, progress)
}

fn motion_of(config: &Config, places: usize) -> Result<&Motion, Error> {
    config.validate(places)?;
    config.motion.as_ref().ok_or_else(|| {
        let expected = "\"steady\", \"free\" or \"any\" for an alignment".to_owned();
        Error::Option { name: "motion", expected, got: "none".to_owned() }
    })
}

fn finite(column: &[f32], query: usize) -> Result<(), Error> {
    match first_not_finite(column) {
        None => Ok(()),
        Some((index, value)) => {
            let what = "distances (row: query)";
            Err(Error::NotFinite { what, row: Some(query), index, value })
        }
    }
}

fn run(
    motion: &Motion,
    tolerance: usize,
    segments: &Segments,
    mut source: impl Source,
    progress: Progress<'_>,
) -> Result<Alignment, Error> {
    let steps = 2 * source.queries();
    let aligner = Aligner::new(motion, tolerance, segments)?;
    let queries = aligner.align(&mut source, |done| {
        let due = done.is_multiple_of(REPORTED) || done == steps;
        if due && progress(done, steps).is_break() {
            return Err(Error::Interrupted { done, total: steps });
        }
        Ok(())
    })?;
    Ok(Alignment { queries, places: segments.places() })
}

/// A drive whose columns are computed when they are asked for.
struct Drives<'a, C> {
    queries: usize,
    flags: Flags<'a>,
    column: C,
}

impl<C: FnMut(usize, &mut [f32]) -> Result<(), Error>> Source for Drives<'_, C> {
    fn queries(&self) -> usize {
        self.queries
    }

    fn column(&mut self, query: usize, out: &mut [f32]) -> Result<(bool, Given), Error> {
        (self.column)(query, out)?;
        let mut cut = false;
        let given = self.flags.before(query, |_| {
            cut = true;
            Ok(())
        })?;
        Ok((cut, given))
    }
}
