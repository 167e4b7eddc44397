//! Batches of several techniques, fused.

use std::sync::Arc;

use ndarray::ArrayView2;

use super::drive::{Drive, Flags};
use super::{REPORTED, Run, count, fixed, of_query};
use crate::config::{Config, Floor};
use crate::error::Error;
use crate::image::Progress;
use crate::interrupt::check;
use crate::localizer::{Input, Localizer, one_route};
use crate::map::Map;
use crate::method::{Fix, Fusion, MAX_TECHNIQUES, Matcher};
use crate::numbers::View;

/// Matches the distance matrices of several techniques, of one shape, as
/// [`Localizer::fused`] fuses their columns. One core works, in order.
///
/// # Errors
/// As for [`match_distances`](super::match_distances); [`Error::Option`] for no matrix or more than
/// 32, and [`Error::Shape`] for matrices of different shapes.
pub fn match_fused_distances(
    distances: &[ArrayView2<'_, f32>],
    config: &Config,
    drive: Drive<'_>,
) -> Result<Run, Error> {
    let (places, queries) = one_shape(distances)?;
    let segments = drive.route(places)?;
    config.validate_along(&segments)?;
    let flags = Flags::new(drive, queries)?;
    let fixes = twice_if_global(config, |config| {
        let mut matcher = Matcher::along(segments.clone(), config.clone())?;
        let mut fusion = Fusion::new(distances.len(), places, config)?;
        let mut columns = vec![vec![0.0; places]; distances.len()];
        let push = |query: usize| {
            check()?;
            for (column, distances) in columns.iter_mut().zip(distances) {
                for (number, &distance) in column.iter_mut().zip(distances.column(query)) {
                    *number = distance;
                }
            }
            fusion.fuse(|technique| &columns[technique]).map_err(|error| of_query(error, query))?;
            let given = flags.before(query, |advance| matcher.gap_of(advance))?;
            matcher.push_column(fusion.column(), given, &mut ())
        };
        (0..queries).map(push).collect()
    })?;
    Ok(Run { fixes, segments, positions: None })
}

/// The places and the queries of several techniques' distances.
///
/// # Errors
/// [`Error::Option`] for no matrix or more than 32, [`Error::Shape`] for different shapes.
pub(super) fn one_shape(distances: &[ArrayView2<'_, f32>]) -> Result<(usize, usize), Error> {
    let Some(first) = distances.first().filter(|_| distances.len() <= MAX_TECHNIQUES) else {
        let expected = format!("1 to {MAX_TECHNIQUES} matrices");
        let got = distances.len().to_string();
        return Err(Error::Option { name: "distances", expected, got });
    };
    if let Some(other) = distances.iter().find(|other| other.dim() != first.dim()) {
        let (expected, got) = (format!("{:?}", first.dim()), format!("{:?}", other.dim()));
        return Err(Error::Shape { what: "distances of several techniques", expected, got });
    }
    Ok(first.dim())
}

/// The number of queries in several techniques' lists of descriptors.
///
/// # Errors
/// [`Error::Length`] unless there is one list for each map, all with one number of rows;
/// [`Error::Shape`] if a map's dimension does not divide the numbers.
pub(super) fn one_drive(maps: &[Arc<Map>], queries: &[View<'_>]) -> Result<usize, Error> {
    let (expected, got) = (maps.len(), queries.len());
    if expected != got {
        return Err(Error::Length { what: "queries, one list for each map", expected, got });
    }
    let counts = maps.iter().zip(queries).map(|(map, queries)| count(map, *queries));
    let counts = counts.collect::<Result<Vec<_>, _>>()?;
    let expected = counts.first().copied().unwrap_or_default();
    if let Some(&got) = counts.iter().find(|&&count| count != expected) {
        return Err(Error::Length { what: "queries of a map, as of the first", expected, got });
    }
    Ok(expected)
}

/// Matches descriptors of several techniques, one list of rows for each map: the answers are those
/// of a [`Localizer::fused`]. One query is matched after the other; large maps are scanned on all
/// cores. `progress` is as for [`match_descriptors`](super::match_descriptors).
///
/// # Errors
/// As for [`match_descriptors`](super::match_descriptors) and [`Localizer::fused`];
/// [`Error::Length`] unless there is one list for each map, all with one number of rows.
pub fn match_fused(
    maps: &[Arc<Map>],
    queries: &[View<'_>],
    config: &Config,
    drive: Drive<'_>,
    progress: Progress<'_>,
) -> Result<Run, Error> {
    let total = one_drive(maps, queries)?;
    drive.on_a_map()?;
    let flags = Flags::new(drive, total)?;
    let mut report = |done: usize| {
        if done.is_multiple_of(REPORTED) && progress(done, total).is_break() {
            return Err(Error::Interrupted { done, total });
        }
        Ok(())
    };
    let fixes = twice_if_global(config, |config| {
        let mut localizer = Localizer::fused(maps.to_vec(), config.clone())?;
        let mut inputs = Vec::with_capacity(maps.len());
        let mut push = |query: usize| {
            report(query)?;
            check()?;
            inputs.clear();
            for (map, queries) in maps.iter().zip(queries) {
                inputs.extend(queries.row(query, map.input_dim()).map(Input::Descriptor));
            }
            let given = flags.before(query, |advance| localizer.gap_of(advance))?;
            localizer.push_inputs(&inputs, given).map_err(|error| of_query(error, query))
        };
        (0..total).map(&mut push).collect()
    })?;
    if progress(total, total).is_break() {
        return Err(Error::Interrupted { done: total, total });
    }
    Ok(Run::on(maps.iter().map(Arc::as_ref), fixes, one_route(maps)?.clone()))
}

/// The fixes of a run in order; for the floor of the whole matrix, of two runs: the first finds it.
fn twice_if_global(
    config: &Config,
    mut run: impl FnMut(&Config) -> Result<Vec<Fix>, Error>,
) -> Result<Vec<Fix>, Error> {
    if config.floor != Floor::Global {
        return run(config);
    }
    let mut config = Config { floor: Floor::Running, ..config.clone() };
    let first = run(&config)?;
    let told = first.iter().filter(|fix| !fix.blank);
    let lowest = told.map(|fix| fix.single.distance).fold(f32::INFINITY, f32::min);
    config.floor = fixed(lowest);
    if config.floor == Floor::Running {
        return Ok(first);
    }
    run(&config)
}
