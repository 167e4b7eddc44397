//! Whole runs at once: the same answers as the stream, on all cores.

mod align;
mod distances;
mod drive;
mod fused;

use serde::{Deserialize, Serialize};
use std::io::{self, Write};

use ndarray::ArrayView2;

use crate::config::{Config, Floor};
use crate::error::Error;
use crate::image::Progress;
use crate::interrupt::check;
use crate::map::{Map, Positions};
use crate::method::{Fix, Matcher, Memory, is_constant, minimum};
use crate::numbers::{View, first_not_finite};
use crate::parallel::each;
use crate::post::ChainState;
use crate::segments::Segments;

pub use align::{Alignment, align_descriptors, align_distances};
pub use distances::{drive_distances, fused_distances};
pub use drive::Drive;
pub use fused::{match_fused, match_fused_distances};

use drive::Flags;

/// How many queries are matched between two reports of progress.
const REPORTED: usize = 64;
/// Distances that are held at a time while descriptors are matched: 16 MB.
const HELD: usize = 1 << 22;
/// Queries whose distances are computed at a time, at most.
const AT_ONCE: usize = 256;

/// The fixes of a whole run, one a query, in order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Run {
    /// One fix a query.
    pub fixes: Vec<Fix>,
    /// How the route's places follow each other.
    pub segments: Segments,
    /// The position of each fix's place, if the map (the first that has any) has positions.
    #[serde(default)]
    pub positions: Option<Positions>,
}

impl Run {
    /// On maps of the same places.
    fn on<'a>(
        maps: impl IntoIterator<Item = &'a Map>,
        fixes: Vec<Fix>,
        segments: Segments,
    ) -> Self {
        let known = maps.into_iter().find_map(Map::positions);
        let positions = known.map(|known| known.of(fixes.iter().map(|fix| fix.place)));
        Self { fixes, segments, positions }
    }

    /// How many places the route has.
    pub fn places(&self) -> usize {
        self.segments.places()
    }

    /// Writes the fixes as CSV: a line of names, then a line a query. Warm-up leaves `anchors` and
    /// `speed` empty; without motion, `confidence` and `off_map` are empty.
    ///
    /// # Errors
    /// Whatever `out` gives.
    pub fn write_csv(&self, out: &mut impl Write) -> io::Result<()> {
        writeln!(
            out,
            "frame,place,score,trusted,ready,anchors,speed,single_place,single_distance,gradient_place,gradient_value,confidence,off_map,blank,segment,segment_place"
        )?;
        for fix in &self.fixes {
            let Fix { frame, place, score, trusted, single, gradient, sequence, blank, .. } = fix;
            let anchors = sequence.map(|sequence| sequence.anchors);
            writeln!(
                out,
                "{frame},{place},{score},{trusted},{},{},{},{},{},{},{},{},{},{blank},{},{}",
                fix.is_ready(),
                shown(anchors),
                shown(fix.speed()),
                single.place,
                single.distance,
                gradient.place,
                gradient.value,
                shown(fix.confidence()),
                shown(fix.off_map()),
                fix.segment,
                fix.segment_place,
            )?;
        }
        Ok(())
    }
}

fn shown(value: Option<impl ToString>) -> String {
    value.map_or_else(String::new, |value| value.to_string())
}

/// Matches a whole distance matrix: `D[[i, j]]` is the distance between place `i` and query `j`, in
/// any memory layout. The answers are those of a [`Matcher`] that is pushed column by column;
/// `floor: Global` (the paper's own) is possible here too. `drive` is what else is
/// known about the queries.
///
/// ```
/// use ndarray::array;
/// use surefix::{Config, Drive, match_distances};
/// let distances = array![[0.1_f32, 0.8, 0.9], [0.8, 0.1, 0.9], [0.9, 0.8, 0.1]];
/// let run = match_distances(distances.view(), &Config::default(), Drive::default().gaps(&[1]))?;
/// let ready: Vec<bool> = run.fixes.iter().map(|fix| fix.sequence.is_some()).collect();
/// assert_eq!(ready, [false, false, true]); // query 1 has no sequence with query 0
/// # Ok::<(), surefix::Error>(())
/// ```
///
/// # Errors
/// As for [`Config::validate_along`], [`Error::Length`] for segments of other places,
/// [`Error::Option`] for a gap before a query that there is not and for an
/// advance that is not finite;
/// [`Error::NotFinite`] (row: query, index: place) for a NaN or an infinity; [`Error::Length`]
/// unless `trusted` and `advance` have one entry a query.
#[expect(clippy::needless_pass_by_value, reason = "a view is a borrow already")]
pub fn match_distances(
    distances: ArrayView2<'_, f32>,
    config: &Config,
    drive: Drive<'_>,
) -> Result<Run, Error> {
    let (places, queries) = distances.dim();
    let segments = drive.route(places)?;
    config.validate_along(&segments)?;
    let flags = Flags::new(drive, queries)?;
    let config_of_stream = Config { floor: Floor::Running, ..config.clone() };
    let stream = Matcher::along(segments.clone(), config_of_stream)?;
    let Pieces { lead, length } = Pieces::new(stream.memory(), queries);
    let pieces = 0..queries.div_ceil(length);
    let span = |index: usize| (index * length, queries.min((index + 1) * length));
    let minima = each(
        pieces.clone(),
        || (),
        |(), index| {
            let (start, end) = span(index);
            column_minima(&distances, start, end)
        },
    )?
    .concat();
    let lowest = |minima: &[f32]| minima.iter().copied().fold(f32::INFINITY, f32::min);
    let stream = stream.with_floor(match config.floor {
        Floor::Global => fixed(lowest(&minima)),
        floor => floor,
    });

    // The batch is the stream, cut into pieces. Each begins early enough for its first window and
    // gradients to be those of the whole stream, and with the minimum that the stream would have
    // had.
    let fixes = each(
        pieces,
        || (),
        |(), index| {
            let (start, end) = span(index);
            let first = start.saturating_sub(lead);
            let mut matcher = stream.clone();
            matcher.begin_at(first, lowest(&minima[..first]));
            let mut fixes = Vec::with_capacity(end - start);
            for_each_column(&distances, first, end, |query, column| {
                let fix = flags.push(&mut matcher, query, column)?;
                if query >= start {
                    fixes.push(fix);
                }
                Ok(())
            })?;
            Ok(fixes)
        },
    )?
    .concat();
    Ok(Run { fixes, segments, positions: None })
}

/// The floor at the smallest distance of all queries, if there is one.
fn fixed(lowest: f32) -> Floor {
    if lowest.is_finite() { Floor::Fixed(f64::from(lowest)) } else { Floor::Running }
}

/// How a batch is cut into pieces that are matched side by side.
#[derive(Debug, PartialEq)]
struct Pieces {
    /// Queries before its own that a piece begins with, to remember what the stream remembers.
    lead: usize,
    /// Queries of a piece: enough that the lead costs little.
    length: usize,
}

impl Pieces {
    fn new(memory: Memory, queries: usize) -> Self {
        let cores = if cfg!(feature = "rayon") { 8 } else { 1 };
        match memory {
            Memory::Queries(memory) => {
                let length = (queries / cores).max(memory.saturating_mul(8)).max(64);
                Self { lead: memory - 1, length }
            }
            // A memory of everything cannot begin in the middle.
            Memory::Whole => Self { lead: 0, length: queries.max(1) },
        }
    }
}

/// The smallest distance of each query; infinity if it says nothing.
///
/// # Errors
/// [`Error::NotFinite`] for a NaN or an infinity.
fn column_minima(
    distances: &ArrayView2<'_, f32>,
    start: usize,
    end: usize,
) -> Result<Vec<f32>, Error> {
    let mut minima = Vec::with_capacity(end - start);
    for_each_column(distances, start, end, |query, column| {
        if let Some((index, value)) = first_not_finite(column) {
            return Err(Error::NotFinite {
                what: "distances (row: query)",
                row: Some(query),
                index,
                value,
            });
        }
        // A column that says nothing does not lower the floor.
        let least = minimum(column).distance;
        minima.push(if is_constant(column) { f32::INFINITY } else { least });
        Ok(())
    })?;
    Ok(minima)
}

/// The columns from `start` to `end`, each in one piece of memory. A matrix that is stored row by
/// row is turned a tile at a time, so that whole cache lines are read and written.
fn for_each_column(
    distances: &ArrayView2<'_, f32>,
    start: usize,
    end: usize,
    mut visit: impl FnMut(usize, &[f32]) -> Result<(), Error>,
) -> Result<(), Error> {
    const TILE: usize = 16;
    let places = distances.nrows();
    let mut gathered = vec![0.0; TILE * places];
    for first in (start..end).step_by(TILE) {
        let queries = first..end.min(first + TILE);
        for top in (0..places).step_by(TILE) {
            let rows = top..places.min(top + TILE);
            for (slot, query) in queries.clone().enumerate() {
                let column = &mut gathered[slot * places..][rows.clone()];
                for (number, place) in column.iter_mut().zip(rows.clone()) {
                    *number = distances[[place, query]];
                }
            }
        }
        for (query, column) in queries.zip(gathered.chunks_exact(places)) {
            check()?;
            visit(query, column)?;
        }
    }
    Ok(())
}

/// Matches many descriptors, one after the other in `queries`, against a map: the distances on all
/// cores, the answers those of a [`Localizer`](crate::Localizer). `floor: Global` scans the map
/// twice, so that no matrix need be held. `drive` is what else is
/// known about the queries. `progress` is told how many queries are done and to do; `Break`
/// from it stops the work.
///
/// ```
/// use surefix::{Config, Drive, Map, Metric, match_descriptors, quiet};
///
/// let rows: Vec<f32> = (0..20).flat_map(|i| [i as f32, (i * i % 7) as f32]).collect();
/// let map = Map::from_descriptors(rows.clone(), 2, Metric::Euclidean)?;
/// let queries = &rows[2 * 2..]; // the same drive, from place 2 on
/// let run = match_descriptors(&map, queries, &Config::default(), Drive::default(), &mut quiet)?;
/// assert!(run.fixes.iter().all(|fix| fix.place == fix.frame as usize + 2));
/// # Ok::<(), surefix::Error>(())
/// ```
///
/// # Errors
/// As for [`Matcher::new`] and [`Map::distances_into`]; [`Error::Shape`] if the map's dimension
/// does not divide the numbers; [`Error::Length`] unless `trusted` and `advance` have one entry a
/// query; [`Error::Option`] for a gap before a query that there is not and for an advance that is
/// not finite; [`Error::Interrupted`] if `progress` breaks.
pub fn match_descriptors<'a>(
    map: &Map,
    queries: impl Into<View<'a>>,
    config: &Config,
    drive: Drive<'_>,
    progress: Progress<'_>,
) -> Result<Run, Error> {
    let queries = queries.into();
    let count = count(map, queries)?;
    drive.on_a_map()?;
    let flags = Flags::new(drive, count)?;
    let segments = map.route().segments().clone();
    config.validate_along(&segments)?;
    queries.check_finite("queries", map.input_dim())?;
    let mut config = config.clone();
    let total = if config.floor == Floor::Global { 2 * count } else { count };
    let mut report = |done: usize| {
        let due = done.is_multiple_of(REPORTED) || done == total;
        if due && progress(done, total).is_break() {
            Err(Error::Interrupted { done, total })
        } else {
            Ok(())
        }
    };
    let mut columns = Columns::new(map, queries, count, AT_ONCE)?;
    let mut scanned = 0;
    if config.floor == Floor::Global {
        let mut lowest = f32::INFINITY;
        for query in 0..count {
            let distances = columns.of(query)?;
            report(scanned)?;
            scanned += 1;
            if !is_constant(distances) {
                lowest = lowest.min(minimum(distances).distance);
            }
        }
        // Without a query that says something there is no minimum.
        config.floor = fixed(lowest);
    }
    let mut matcher = Matcher::along(segments.clone(), config)?;
    let mut fixes = Vec::with_capacity(count);
    for query in 0..count {
        let distances = columns.of(query)?;
        report(scanned)?;
        scanned += 1;
        let fix = flags.push(&mut matcher, query, distances);
        fixes.push(fix.map_err(|error| of_query(error, query))?);
    }
    report(total)?;
    Ok(Run::on([map], fixes, segments))
}

/// The number of queries in a list of descriptors.
fn count(map: &Map, queries: View<'_>) -> Result<usize, Error> {
    let dim = map.input_dim();
    if queries.len().is_multiple_of(dim) {
        return Ok(queries.len() / dim);
    }
    let (expected, got) = (format!("rows of {dim} numbers"), format!("{} numbers", queries.len()));
    Err(Error::Shape { what: "queries", expected, got })
}

/// The distances of queries to all places, computed a few queries at a time on all cores. They are
/// asked for in order, or in order again from an earlier query.
struct Columns<'a> {
    map: &'a Map,
    queries: View<'a>,
    count: usize,
    /// The queries after a post-processing whose statistics depend on the queries before.
    passed: Option<Vec<f32>>,
    /// How many are computed at a time.
    at_once: usize,
    first: usize,
    held: Vec<Vec<f32>>,
}

impl<'a> Columns<'a> {
    /// At most `at_once` are computed at a time.
    fn new(map: &'a Map, queries: View<'a>, count: usize, at_once: usize) -> Result<Self, Error> {
        let passed = match map.post().filter(|post| post.runs()) {
            None => None,
            Some(post) => {
                let mut through = ChainState::of_drive(post);
                let mut passed = Vec::with_capacity(count * map.dim());
                for query in 0..count {
                    check()?;
                    let Some(row) = queries.row(query, map.input_dim()) else { continue };
                    let row = map.passed(row, Some(&mut through));
                    if let View::F32(row) = row.map_err(|error| of_query(error, query))? {
                        passed.extend_from_slice(row);
                    }
                    through.commit();
                }
                Some(passed)
            }
        };
        Ok(Self { passed, ..Self::alone(map, queries, count, at_once) })
    }

    /// Of queries that are no drive: each goes through the post-processing alone.
    fn alone(map: &'a Map, queries: View<'a>, count: usize, at_once: usize) -> Self {
        let at_once = (HELD / map.rows()).min(at_once).max(1);
        Self { map, queries, count, passed: None, at_once, first: 0, held: Vec::new() }
    }

    fn of(&mut self, query: usize) -> Result<&[f32], Error> {
        let Self { map, queries, count, ref passed, at_once, .. } = *self;
        if !(self.first..self.first + self.held.len()).contains(&query) {
            self.held = each(
                query..count.min(query + at_once),
                || (),
                |(), query| {
                    let mut out = vec![0.0; map.places()];
                    let done = if let Some(passed) = passed {
                        let row = View::F32(&passed[query * map.dim()..][..map.dim()]);
                        let given = queries.row(query, map.input_dim());
                        let nothing = given.is_some_and(|given| map.shows_nothing(given));
                        map.distances_of_passed(row, nothing, &mut out)
                    } else {
                        let row = queries.row(query, map.input_dim());
                        row.map_or(Ok(()), |row| map.distances_into(row, &mut out))
                    };
                    done.map_err(|error| of_query(error, query)).map(|()| out)
                },
            )?;
            self.first = query;
        }
        Ok(&self.held[query - self.first])
    }
}

/// The same error with the query's index.
fn of_query(error: Error, query: usize) -> Error {
    match error {
        Error::NoDirection { what: "descriptor", .. } => {
            Error::NoDirection { what: "queries", row: Some(query) }
        }
        // After post-processing.
        Error::NoDirection { what, .. } => Error::NoDirection { what, row: Some(query) },
        Error::NotFinite { what, index, value, .. } if what.starts_with("descriptor") => {
            Error::NotFinite { what, row: Some(query), index, value }
        }
        Error::NotFinite { index, value, .. } => {
            Error::NotFinite { what: "distances (row: query)", row: Some(query), index, value }
        }
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_memory_of_everything_is_one_piece_and_any_other_leads_into_its_pieces() {
        for queries in [0, 1, 1000, 100_000] {
            let Pieces { lead, length } = Pieces::new(Memory::Whole, queries);
            assert!(lead == 0 && length >= queries);
            let Pieces { lead, length } = Pieces::new(Memory::Queries(12), queries);
            assert!(lead == 11 && length >= 96);
        }
    }
}
