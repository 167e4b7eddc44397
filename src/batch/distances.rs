//! A whole distance matrix, cut into pieces that are matched side by side.

use ndarray::ArrayView2;

use super::{Run, cut_before};
use crate::config::{Config, Floor};
use crate::error::Error;
use crate::method::{Column, Matcher, Memory, minimum};
use crate::numbers::first_not_finite;
use crate::parallel::each;

/// Matches a whole distance matrix: `D[[i, j]]` is the distance between place `i` and query `j`, in
/// any memory layout. The answers are those of a [`Matcher`] that is pushed column by column;
/// `floor: Global` (the paper's own) is possible here too. `trusted`, where given, is an external
/// predictor's word for each query; `gaps` are the queries, in any order, before which there is a
/// gap ([`Matcher::gap`]).
///
/// ```
/// use ndarray::array;
/// use surefix::{Config, match_distances};
/// let distances = array![[0.1_f32, 0.8, 0.9], [0.8, 0.1, 0.9], [0.9, 0.8, 0.1]];
/// let run = match_distances(distances.view(), &Config::default(), None, &[1])?;
/// let ready: Vec<bool> = run.fixes.iter().map(|fix| fix.sequence.is_some()).collect();
/// assert_eq!(ready, [false, false, true]); // query 1 has no sequence with query 0
/// # Ok::<(), surefix::Error>(())
/// ```
///
/// # Errors
/// As for [`Config::validate`], and [`Error::Option`] for a gap before a query that there is not;
/// [`Error::NotFinite`] (row: query, index: place) for a NaN or an infinity; [`Error::Length`]
/// where `trusted` has not one word a query.
#[expect(clippy::needless_pass_by_value, reason = "a view is a borrow already")]
pub fn match_distances(
    distances: ArrayView2<'_, f32>,
    config: &Config,
    trusted: Option<&[bool]>,
    gaps: &[usize],
) -> Result<Run, Error> {
    let (places, queries) = distances.dim();
    config.validate(places)?;
    if let Some(trusted) = trusted
        && trusted.len() != queries
    {
        return Err(Error::Length { what: "trusted", expected: queries, got: trusted.len() });
    }
    let cut = cut_before(gaps, queries)?;
    let stream = Matcher::new(places, Config { floor: Floor::Running, ..config.clone() })?;
    let Pieces { lead, length } = Pieces::new(stream.memory(), queries);
    let pieces = 0..queries.div_ceil(length);
    let span = |index: usize| (index * length, queries.min((index + 1) * length));
    let minima = flatten(each(
        pieces.clone(),
        || (),
        |(), index| {
            let (start, end) = span(index);
            column_minima(&distances, start, end)
        },
    ))?;
    let lowest = |minima: &[f32]| minima.iter().copied().fold(f32::INFINITY, f32::min);
    let stream = stream.with_floor(match config.floor {
        Floor::Global if queries > 0 => Floor::Fixed(f64::from(lowest(&minima))),
        Floor::Global => Floor::Running,
        floor => floor,
    });

    // The batch is the stream, cut into pieces. Each begins early enough for its first window and
    // gradients to be those of the whole stream, and with the minimum that the stream would have
    // had.
    let fixes = flatten(each(
        pieces,
        || (),
        |(), index| {
            let (start, end) = span(index);
            let first = start.saturating_sub(lead);
            let mut matcher = stream.clone();
            matcher.begin_at(first, lowest(&minima[..first]));
            let mut fixes = Vec::with_capacity(end - start);
            for_each_column(&distances, first, end, |query, column| {
                if cut[query] {
                    matcher.gap();
                }
                let column = Column { lower: column, upper: None };
                let trusted = trusted.map(|trusted| trusted[query]);
                let fix = matcher.push_column(column, trusted, &mut ())?;
                if query >= start {
                    fixes.push(fix);
                }
                Ok(())
            })?;
            Ok(fixes)
        },
    ))?;
    Ok(Run { fixes, places })
}

/// How a batch is cut into pieces that are matched side by side.
#[derive(Debug, PartialEq)]
struct Pieces {
    /// Queries before a piece that it begins with, so that it remembers what the stream does.
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
            // What remembers everything cannot begin in the middle.
            Memory::Whole => Self { lead: 0, length: queries.max(1) },
        }
    }
}

/// The smallest distance of each query, and a refusal of what is not finite.
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
        minima.push(minimum(column).distance);
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
            visit(query, column)?;
        }
    }
    Ok(())
}

fn flatten<T>(pieces: Vec<Result<Vec<T>, Error>>) -> Result<Vec<T>, Error> {
    let mut all = Vec::new();
    for piece in pieces {
        all.extend(piece?);
    }
    Ok(all)
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
