//! Alignment (method 1.10): where each query of a whole drive was, by all of its queries.

use serde::{Deserialize, Serialize};
use std::io::{self, Write};
use std::sync::Arc;

use ndarray::ArrayView2;

use super::drive::{Drive, Flags};
use super::fused::{one_drive, one_shape};
use super::{AT_ONCE, Columns, REPORTED};
use crate::config::Config;
use crate::error::Error;
use crate::evaluate::Match;
use crate::image::Progress;
use crate::localizer::one_route;
use crate::map::{Map, Positions};
use crate::method::{Aligned, Aligner, Given, Source, Track, stretch};
use crate::numbers::{View, first_not_finite};
use crate::segments::Segments;

/// The track of each query of a drive by all of its queries, those after it too.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Alignment {
    /// One a query, in order.
    pub queries: Vec<Aligned>,
    /// For each list of places that was asked about, one a query: the belief that the query is
    /// within `tolerance` places of it.
    pub right: Vec<Vec<f64>>,
    /// The position of each query's place, if the map (the first that has any) has positions.
    pub positions: Option<Positions>,
    /// How the route's places follow each other.
    pub segments: Segments,
}

impl Alignment {
    /// How many places the route has.
    pub fn places(&self) -> usize {
        self.segments.places()
    }

    /// For each query its place, if that is sure: its confidence is `least` or more, and no other
    /// query of the place is surer (of equal ones, the first counts). For
    /// [`Map::add_traverse`](crate::Map::add_traverse).
    pub fn sure_places(&self, least: f64) -> Vec<Option<usize>> {
        let mut best = vec![None; self.places()];
        for (query, one) in self.queries.iter().enumerate() {
            let (place, confidence) = (one.track.place, one.track.confidence);
            let Some(best) = best.get_mut(place) else { continue };
            let surer = best.is_none_or(|(_, known)| confidence > known);
            if confidence >= least && surer {
                *best = Some((query, confidence));
            }
        }
        let mut places = vec![None; self.queries.len()];
        for (place, best) in best.iter().enumerate() {
            if let Some((query, _)) = *best {
                places[query] = Some(place);
            }
        }
        places
    }

    /// How wrong each match of the same drive is, from 0 to 1: wholly if its place is more than
    /// `tolerance` places of the same segment from the aligned one, else as much as the alignment is
    /// not sure.
    ///
    /// # Errors
    /// [`Error::Length`] if the alignment has another number of queries.
    pub fn wrong(&self, matches: &[Match], tolerance: usize) -> Result<Vec<Option<f64>>, Error> {
        let (expected, got) = (matches.len(), self.queries.len());
        if expected != got {
            return Err(Error::Length { what: "alignment", expected, got });
        }
        let wrong = |(found, aligned): (&Match, &Aligned)| {
            let there = aligned.track.place;
            let near = found.place < self.places()
                && self.segments.are_near(there, found.place, tolerance);
            if near { 1.0 - aligned.track.confidence } else { 1.0 }
        };
        Ok(matches.iter().zip(&self.queries).map(|each| Some(wrong(each))).collect())
    }

    /// Writes the tracks as CSV: a line of names, then a line a query. `reference` is the place,
    /// and -1 if the confidence is below `least`: with the column `query` it is a truth. Positions
    /// are the columns `x`, `y` and `z`.
    ///
    /// # Errors
    /// Whatever `out` gives.
    pub fn write_csv(&self, out: &mut impl Write, least: f64) -> io::Result<()> {
        let axes = self.positions.as_ref().map_or(0, Positions::axes);
        let names = &",x,y,z"[..2 * axes];
        writeln!(
            out,
            "query,reference,place,confidence,off_map,speed,place_low,place_high,single_place,single_right{names}"
        )?;
        for (query, Aligned { track, single, single_right }) in self.queries.iter().enumerate() {
            let Track { place, confidence, off_map, speed, interval: (low, high) } = track;
            if *confidence < least {
                write!(out, "{query},-1")?;
            } else {
                write!(out, "{query},{place}")?;
            }
            write!(
                out,
                ",{place},{confidence},{off_map},{speed},{low},{high},{},{single_right}",
                single.place
            )?;
            for metres in
                self.positions.iter().flat_map(|known| &known.metres()[query * axes..][..axes])
            {
                write!(out, ",{metres}")?;
            }
            writeln!(out)?;
        }
        Ok(())
    }
}

/// Aligns the drive of a whole distance matrix, as for [`match_distances`](super::match_distances),
/// or of those of several techniques, fused as by
/// [`match_fused_distances`](super::match_fused_distances): the tracker of
/// [`Config::motion`](crate::Config::motion) in both directions (method 1.10). No label is needed:
/// for two recorded drives it stands in for the truth.
///
/// `at` are places to ask about: lists of one a query, such as the matches of other methods. What
/// is believed of them is [`Alignment::right`].
///
/// Beside the matrix, about `2 sqrt(m) (V + 2) n` numbers of 8 bytes are held for `n` places, `m`
/// queries and `V` speeds, and `sqrt(m) n` for each of several techniques.
///
/// ```
/// use ndarray::Array2;
/// use surefix::{Config, Drive, Motion, align_distances, quiet};
/// let distances = Array2::from_shape_fn((30, 30), |(i, j)| f32::from(i != j));
/// let mut config = Config::default();
/// config.motion = Some(Motion::steady());
/// let at: Vec<usize> = (0..30).collect();
/// let drive = Drive::default();
/// let alignment = align_distances(&[distances.view()], &config, drive, &[&at], &mut quiet)?;
/// assert!(alignment.queries.iter().enumerate().all(|(query, one)| one.track.place == query));
/// assert!(alignment.right[0].iter().all(|&right| right > 0.5));
/// # Ok::<(), surefix::Error>(())
/// ```
///
/// # Errors
/// As for [`match_fused_distances`](super::match_fused_distances), and [`Error::Option`] without a
/// motion; [`Error::Length`] unless each list in `at` has one place a query, and [`Error::Option`]
/// for a place that there is not; [`Error::Interrupted`] if `progress` breaks.
pub fn align_distances(
    distances: &[ArrayView2<'_, f32>],
    config: &Config,
    drive: Drive<'_>,
    at: &[&[usize]],
    progress: Progress<'_>,
) -> Result<Alignment, Error> {
    let (places, queries) = one_shape(distances)?;
    let flags = Flags::new(drive, queries)?;
    let column = |technique: usize, query: usize, out: &mut [f32]| {
        let column = distances[technique].column(query);
        out.iter_mut().zip(column).for_each(|(out, &distance)| *out = distance);
        finite(out, query)
    };
    let source = Drives { queries, techniques: distances.len(), flags, column };
    run(config, &drive.route(places)?, source, at, progress)
}

/// Aligns many descriptors, one after the other, with a map; or those of several techniques, one
/// list for each map: as [`align_distances`], without holding a matrix. The distances are computed
/// twice, on all cores.
///
/// # Errors
/// As for [`match_fused`](super::match_fused) and [`align_distances`].
pub fn align_descriptors(
    maps: &[Arc<Map>],
    queries: &[View<'_>],
    config: &Config,
    drive: Drive<'_>,
    at: &[&[usize]],
    progress: Progress<'_>,
) -> Result<Alignment, Error> {
    let segments = one_route(maps)?;
    let total = one_drive(maps, queries)?;
    drive.on_a_map()?;
    let flags = Flags::new(drive, total)?;
    let mut each = Vec::with_capacity(maps.len());
    for (map, queries) in maps.iter().zip(queries) {
        queries.check_finite("queries", map.input_dim())?;
        each.push(Columns::new(map, *queries, total, AT_ONCE.min(stretch(total)))?);
    }
    let column = |technique: usize, query: usize, out: &mut [f32]| {
        out.copy_from_slice(each[technique].of(query)?);
        finite(out, query)
    };
    let source = Drives { queries: total, techniques: maps.len(), flags, column };
    let mut alignment = run(config, segments, source, at, progress)?;
    let places = alignment.queries.iter().map(|one| one.track.place);
    alignment.positions = maps.iter().find_map(|map| Some(map.positions()?.of(places.clone())));
    Ok(alignment)
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

fn run<C: FnMut(usize, usize, &mut [f32]) -> Result<(), Error>>(
    config: &Config,
    segments: &Segments,
    mut source: Drives<'_, C>,
    at: &[&[usize]],
    progress: Progress<'_>,
) -> Result<Alignment, Error> {
    let places = segments.places();
    config.validate(places)?;
    if config.motion.is_none() {
        let expected = "\"steady\", \"free\" or \"any\" for an alignment".to_owned();
        return Err(Error::Option { name: "motion", expected, got: "none".to_owned() });
    }
    for list in at {
        let (expected, got) = (source.queries, list.len());
        if expected != got {
            return Err(Error::Length { what: "at, places to ask about", expected, got });
        }
        if let Some(place) = list.iter().find(|&&place| place >= places) {
            let expected = format!("places from 0 to {}", places - 1);
            return Err(Error::Option { name: "at", expected, got: place.to_string() });
        }
    }
    let steps = 2 * source.queries;
    let aligner = Aligner::new(config, source.techniques, segments)?;
    let (queries, right) = aligner.align(&mut source, at, |done| {
        let due = done.is_multiple_of(REPORTED) || done == steps;
        if due && progress(done, steps).is_break() {
            return Err(Error::Interrupted { done, total: steps });
        }
        Ok(())
    })?;
    Ok(Alignment { queries, right, positions: None, segments: segments.clone() })
}

/// A drive whose columns are computed when they are asked for, by technique and query.
struct Drives<'a, C> {
    queries: usize,
    techniques: usize,
    flags: Flags<'a>,
    column: C,
}

impl<C: FnMut(usize, usize, &mut [f32]) -> Result<(), Error>> Source for Drives<'_, C> {
    fn queries(&self) -> usize {
        self.queries
    }

    fn column(&mut self, technique: usize, query: usize, out: &mut [f32]) -> Result<(), Error> {
        (self.column)(technique, query, out)
    }

    fn given(&self, query: usize) -> Result<(bool, Given), Error> {
        let mut cut = false;
        let given = self.flags.before(query, |_| {
            cut = true;
            Ok(())
        })?;
        Ok((cut, given))
    }
}
