//! How a traverse differs from the reference drive.

use serde::{Deserialize, Serialize};
use surefix::Error;

/// How a traverse differs from the reference drive. Each option but the seed is 0 for no
/// difference; all of them at 0, which is the default, are the reference drive itself: noon in
/// summer.
///
/// ```
/// use surefix_simulate::Conditions;
///
/// let winter = Conditions { season: 1.0, ..Conditions::reference() };
/// assert_eq!(winter.light, 0.0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Conditions {
    /// Time of day, 0 to 1: from noon to dusk, with its lit windows and street lamps.
    pub light: f32,
    /// Season, 0 to 1: from summer through autumn to winter, with bare trees and snow.
    pub season: f32,
    /// How far to the right of the reference drive the camera keeps, in metres, -3 to 3.
    pub lateral_offset: f32,
    /// How unevenly the vehicle drives, 0 to 1: at 1 its speed varies by about 30 %.
    pub speed_jitter: f32,
    /// Other vehicles and pedestrians, 0 to 1: from none to heavy traffic.
    pub occluders: f32,
    /// Sensor noise, 0 to 1: at 1 a standard deviation of 24 grey levels.
    pub noise: f32,
    /// Chooses among the traverses of the same options; alone it changes nothing.
    pub seed: u64,
}

impl Conditions {
    /// The reference drive: noon in summer, an empty road, an even speed, no noise.
    #[must_use]
    pub fn reference() -> Self {
        Self::default()
    }

    /// The default second traverse: a winter afternoon, in traffic, not quite in the same lane.
    ///
    /// It is set so that SAD behaves on it as on real data: somewhat under half of the single-frame
    /// matches are correct, mostly because places look alike, and a quarter to a third of them can
    /// be trusted.
    #[must_use]
    pub fn revisit() -> Self {
        Self {
            light: 0.62,
            season: 0.88,
            lateral_offset: 0.3,
            speed_jitter: 0.4,
            occluders: 0.6,
            noise: 0.12,
            seed: 1,
        }
    }

    pub(super) fn validate(&self) -> Result<(), Error> {
        let shares = [
            ("light", self.light),
            ("season", self.season),
            ("speed_jitter", self.speed_jitter),
            ("occluders", self.occluders),
            ("noise", self.noise),
        ];
        for (name, value) in shares {
            within(name, value, 0.0, 1.0)?;
        }
        within("lateral_offset", self.lateral_offset, -3.0, 3.0)
    }
}

fn within(name: &'static str, value: f32, low: f32, high: f32) -> Result<(), Error> {
    // NaN is in no range.
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(Error::Option {
        name,
        expected: format!("a number from {low} to {high}"),
        got: value.to_string(),
    })
}
