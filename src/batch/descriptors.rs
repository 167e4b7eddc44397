//! Many descriptors against a map: the distances side by side, a few queries at a time.

use super::{Run, cut_before};
use crate::config::{Config, Floor};
use crate::error::Error;
use crate::image::Progress;
use crate::map::Map;
use crate::method::{Column, Matcher, minimum};
use crate::numbers::View;
use crate::parallel::each;
use crate::post::ChainState;

/// How many queries are matched between two reports of progress.
const REPORTED: usize = 64;

/// Distance vectors that are held at a time, in numbers: 16 MB.
const HELD: usize = 1 << 22;

/// Matches many descriptors, one after the other in `queries`, against a map: the distances on all
/// cores, the answers those of a [`Localizer`](crate::Localizer). `floor: Global` scans the map
/// twice, so that no matrix need be held. `gaps` are the queries, in any order, before which there
/// is a gap ([`Matcher::gap`]). `progress` hears of queries done and to do; `Break` from it stops
/// the work.
///
/// ```
/// use std::ops::ControlFlow;
/// use surefix::{Config, Map, Metric, match_descriptors};
///
/// let rows: Vec<f32> = (0..20).flat_map(|i| [i as f32, (i * i % 7) as f32]).collect();
/// let map = Map::from_descriptors(rows.clone(), 2, Metric::Euclidean)?;
/// let queries = &rows[2 * 2..]; // the same drive, from place 2 on
/// let mut progress = |_done, _total| ControlFlow::Continue(());
/// let run = match_descriptors(&map, queries, &Config::default(), None, &[], &mut progress)?;
/// assert!(run.fixes.iter().all(|fix| fix.place == fix.frame as usize + 2));
/// # Ok::<(), surefix::Error>(())
/// ```
///
/// # Errors
/// As for [`Matcher::new`] and [`Map::distances_into`]; [`Error::Shape`] where the map's dimension
/// does not divide the numbers; [`Error::Length`] where `trusted` has not one word a query;
/// [`Error::Option`] for a gap before a query that there is not; [`Error::Interrupted`] where
/// `progress` breaks.
pub fn match_descriptors<'a>(
    map: &Map,
    queries: impl Into<View<'a>>,
    config: &Config,
    trusted: Option<&[bool]>,
    gaps: &[usize],
    progress: Progress<'_>,
) -> Result<Run, Error> {
    let queries = queries.into();
    let dim = map.input_dim();
    if !queries.len().is_multiple_of(dim) {
        let (expected, got) =
            (format!("rows of {dim} numbers"), format!("{} numbers", queries.len()));
        return Err(Error::Shape { what: "queries", expected, got });
    }
    let count = queries.len() / dim;
    if let Some(trusted) = trusted
        && trusted.len() != count
    {
        return Err(Error::Length { what: "trusted", expected: count, got: trusted.len() });
    }
    let cut = cut_before(gaps, count)?;
    config.validate(map.places())?;
    queries.check_finite("queries", dim)?;
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
    let mut scanned = 0;
    if config.floor == Floor::Global {
        let mut lowest = f32::INFINITY;
        for_each_query(map, queries, count, |_, distances| {
            report(scanned)?;
            scanned += 1;
            lowest = lowest.min(minimum(distances).distance);
            Ok(())
        })?;
        // Without a query there is no matrix and no minimum.
        config.floor = if count == 0 { Floor::Running } else { Floor::Fixed(f64::from(lowest)) };
    }
    let mut matcher = Matcher::new(map.places(), config)?;
    let mut fixes = Vec::with_capacity(count);
    for_each_query(map, queries, count, |query, distances| {
        report(scanned)?;
        scanned += 1;
        if cut[query] {
            matcher.gap();
        }
        let column = Column { lower: distances, upper: None };
        let fix = matcher.push_column(column, trusted.map(|trusted| trusted[query]), &mut ());
        fixes.push(fix.map_err(|error| of_query(error, query))?);
        Ok(())
    })?;
    report(total)?;
    Ok(Run { fixes, places: map.places() })
}

/// The distances of each query in turn, computed a few queries at a time on all cores.
fn for_each_query(
    map: &Map,
    queries: View<'_>,
    count: usize,
    mut visit: impl FnMut(usize, &[f32]) -> Result<(), Error>,
) -> Result<(), Error> {
    let at_once = (HELD / map.places()).clamp(1, 256);
    // What a query becomes may depend on those before it.
    let mut drive = map.post().filter(|post| post.runs()).map(ChainState::of_drive);
    let mut passed = Vec::new();
    for start in (0..count).step_by(at_once) {
        let indices = start..count.min(start + at_once);
        if let Some(through) = &mut drive {
            passed.clear();
            for query in indices.clone() {
                let Some(row) = queries.row(query, map.input_dim()) else { continue };
                let row = map.passed(row, Some(through)).map_err(|error| of_query(error, query))?;
                if let View::F32(row) = row {
                    passed.extend_from_slice(row);
                }
                through.commit();
            }
        }
        let columns = each(
            indices.clone(),
            || (),
            |(), query| {
                let mut out = vec![0.0; map.places()];
                let done = if drive.is_some() {
                    let at = (query - start) * map.dim();
                    map.distances_of_passed(View::F32(&passed[at..at + map.dim()]), &mut out)
                } else {
                    let row = queries.row(query, map.input_dim());
                    row.map_or(Ok(()), |row| map.distances_into(row, &mut out))
                };
                done.map_err(|error| of_query(error, query))?;
                Ok(out)
            },
        );
        for (query, column) in indices.zip(columns) {
            visit(query, &column?)?;
        }
    }
    Ok(())
}

/// The same error, which says which query it was.
fn of_query(error: Error, query: usize) -> Error {
    match error {
        Error::NoDirection { what: "descriptor", .. } => {
            Error::NoDirection { what: "queries", row: Some(query) }
        }
        // What post-processing made of it.
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
