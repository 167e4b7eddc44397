//! Where a localizer's places are.

use super::Localizer;
use crate::map::Position;
use crate::method::Fix;

impl Localizer {
    /// Where the place of one of its fixes is, if the map (the first that has any) has positions.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use surefix::{Config, Localizer, Map, Metric, Positions};
    /// let map = Map::from_descriptors(vec![1.0_f32, 0.0, 0.0, 1.0], 2, Metric::Euclidean)?;
    /// let map = map.with_positions(Positions::new(vec![0.0, 0.0, 7.0, 1.0], 2)?)?;
    /// let mut localizer = Localizer::new(Arc::new(map), Config::default())?;
    /// let fix = localizer.push_descriptor([0.1_f32, 0.9].as_slice())?;
    /// assert_eq!(localizer.position(&fix).unwrap().metres(), [7.0, 1.0]);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    pub fn position(&self, fix: &Fix) -> Option<Position> {
        self.maps().find_map(|map| map.positions())?.at(fix.place)
    }
}
