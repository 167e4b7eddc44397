//! The distances that a batch matches, kept as a matrix.

use std::sync::Arc;

use ndarray::ArrayView2;

use super::fused::{one_drive, one_shape};
use super::{AT_ONCE, Columns, REPORTED, count, of_query};
use crate::config::Config;
use crate::error::Error;
use crate::image::Progress;
use crate::interrupt::check;
use crate::map::Map;
use crate::method::Fusion;
use crate::numbers::View;
use crate::preallocated::reserved;

impl Map {
    /// The distances from many descriptors, one after the other in `queries`, to every place, on all
    /// cores: for each descriptor the numbers of [`distances`](Self::distances), one descriptor
    /// after the other. Each is taken alone, also if the map's post-processing has statistics that
    /// run along a drive. `progress` is told how many are done; `Break` from it stops the work.
    ///
    /// ```
    /// use surefix::{Map, Metric, quiet};
    /// let map = Map::from_descriptors(vec![0.0_f32, 1.0, 3.0, 5.0], 2, Metric::Euclidean)?;
    /// let distances = map.distances_of_each([0.0_f32, 1.0, 3.0, 1.0].as_slice(), &mut quiet)?;
    /// assert_eq!(distances, [0.0, 5.0, 3.0, 4.0]);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// As for [`distances_into`](Self::distances_into), with the descriptor's index;
    /// [`Error::Shape`] if the map's dimension does not divide the numbers; [`Error::Memory`] if
    /// there is too little; [`Error::Interrupted`] if `progress` breaks.
    pub fn distances_of_each<'a>(
        &self,
        queries: impl Into<View<'a>>,
        progress: Progress<'_>,
    ) -> Result<Vec<f32>, Error> {
        let queries = queries.into();
        let total = count(self, queries)?;
        queries.check_finite("queries", self.input_dim())?;
        let mut columns = Columns::alone(self, queries, total, AT_ONCE);
        gathered(total, self.places(), progress, |query, out| {
            out.extend_from_slice(columns.of(query)?);
            Ok(())
        })
    }
}

/// The distances that [`match_descriptors`](super::match_descriptors) sees of a drive, to the last
/// bit: for each query one number a place, one query after the other. Of several maps, the fused
/// ones of [`match_fused`](super::match_fused), which have no unit.
///
/// # Errors
/// As for those two; [`Error::Memory`] if there is too little for the matrix.
pub fn drive_distances(
    maps: &[Arc<Map>],
    queries: &[View<'_>],
    config: &Config,
    progress: Progress<'_>,
) -> Result<Vec<f32>, Error> {
    let total = one_drive(maps, queries)?;
    let mut each = Vec::with_capacity(maps.len());
    for (map, queries) in maps.iter().zip(queries) {
        queries.check_finite("queries", map.input_dim())?;
        each.push(Columns::new(map, *queries, total, AT_ONCE)?);
    }
    let places = maps.first().map_or(0, |map| map.places());
    if let [only] = &mut each[..] {
        return gathered(total, places, progress, |query, out| {
            out.extend_from_slice(only.of(query)?);
            Ok(())
        });
    }
    fused(maps.len(), (places, total), config, progress, |technique, query, column| {
        column.copy_from_slice(each[technique].of(query)?);
        Ok(())
    })
}

/// The column of each query that [`match_fused_distances`](super::match_fused_distances) makes of
/// several matrices, one query after the other.
///
/// # Errors
/// As for [`match_fused_distances`](super::match_fused_distances); [`Error::Memory`] if there is too
/// little for the matrix; [`Error::Interrupted`] if `progress` breaks.
pub fn fused_distances(
    distances: &[ArrayView2<'_, f32>],
    config: &Config,
    progress: Progress<'_>,
) -> Result<Vec<f32>, Error> {
    let shape = one_shape(distances)?;
    fused(distances.len(), shape, config, progress, |technique, query, column| {
        let given = distances[technique].column(query);
        column.iter_mut().zip(given).for_each(|(number, &distance)| *number = distance);
        Ok(())
    })
}

/// The fused columns of techniques, whose own `column` writes.
fn fused(
    techniques: usize,
    (places, queries): (usize, usize),
    config: &Config,
    progress: Progress<'_>,
    mut column: impl FnMut(usize, usize, &mut [f32]) -> Result<(), Error>,
) -> Result<Vec<f32>, Error> {
    let mut fusion = Fusion::new(techniques, places, config)?;
    let mut columns = vec![vec![0.0; places]; techniques];
    gathered(queries, places, progress, |query, out| {
        for (technique, numbers) in columns.iter_mut().enumerate() {
            column(technique, query, numbers)?;
        }
        fusion.fuse(|technique| &columns[technique]).map_err(|error| of_query(error, query))?;
        out.extend_from_slice(fusion.column().lower);
        Ok(())
    })
}

/// The columns that `add` appends, one a query.
fn gathered(
    queries: usize,
    places: usize,
    progress: Progress<'_>,
    mut add: impl FnMut(usize, &mut Vec<f32>) -> Result<(), Error>,
) -> Result<Vec<f32>, Error> {
    let memory = |_| Error::Memory { places, columns: queries };
    let mut all = reserved(queries.saturating_mul(places)).map_err(memory)?;
    for query in 0..queries {
        if query.is_multiple_of(REPORTED) && progress(query, queries).is_break() {
            return Err(Error::Interrupted { done: query, total: queries });
        }
        check()?;
        add(query, &mut all)?;
    }
    if progress(queries, queries).is_break() {
        return Err(Error::Interrupted { done: queries, total: queries });
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Metric;
    use crate::image::quiet;
    use crate::localizer::{Input, Localizer};
    use crate::method::Given;

    fn numbers(seed: u32, count: usize) -> Vec<f32> {
        let mut state = seed;
        let next = |_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 1e6
        };
        (0..count).map(next).collect()
    }

    #[test]
    fn a_drive_has_the_distances_that_a_localizer_sees() -> Result<(), Error> {
        let (dim, queries) = (12, numbers(2, 12 * 30));
        let map = |metric| Map::from_descriptors(numbers(1, 12 * 50), dim, metric).map(Arc::new);
        let (one, other) = (map(Metric::Euclidean)?, map(Metric::Cosine)?);
        let config = Config::default();
        let view = View::from(&queries);
        let alone = drive_distances(std::slice::from_ref(&one), &[view], &config, &mut quiet)?;
        assert_eq!(alone, one.distances_of_each(view, &mut quiet)?);
        let maps = [one, other];
        let fused = drive_distances(&maps, &[view, view], &config, &mut quiet)?;
        let mut localizer = Localizer::fused(maps.to_vec(), config.clone())?;
        for (query, column) in queries.chunks(dim).zip(fused.chunks(50)) {
            let input = Input::Descriptor(query.into());
            localizer.push_inputs(&[input, input], Given::default())?;
            assert_eq!(localizer.distances(), column);
        }
        let matrix = |map: &Map| -> Result<_, Error> {
            let columns = map.distances_of_each(view, &mut quiet)?;
            let shaped = ndarray::Array2::from_shape_vec((30, 50), columns);
            Ok(shaped.unwrap_or_default().reversed_axes())
        };
        let each = [matrix(&maps[0])?, matrix(&maps[1])?];
        let views = [each[0].view(), each[1].view()];
        assert_eq!(fused_distances(&views, &config, &mut quiet)?, fused);
        Ok(())
    }

    #[test]
    fn a_bad_query_is_named_and_a_break_stops() -> Result<(), Error> {
        let map = Map::from_descriptors(numbers(1, 40), 4, Metric::Cosine)?;
        let mut queries = numbers(2, 4 * 9);
        queries[4 * 7..4 * 8].fill(0.0);
        let refused = map.distances_of_each(&queries, &mut quiet);
        assert!(matches!(refused, Err(Error::NoDirection { row: Some(7), .. })), "{refused:?}");
        queries[5] = f32::NAN;
        let refused = map.distances_of_each(&queries, &mut quiet);
        assert!(matches!(refused, Err(Error::NotFinite { row: Some(1), index: 1, .. })));
        let mut stop = |_, _| std::ops::ControlFlow::Break(());
        let stopped = map.distances_of_each(&numbers(2, 4 * 9), &mut stop);
        assert!(matches!(stopped, Err(Error::Interrupted { done: 0, total: 9 })));
        Ok(())
    }
}
