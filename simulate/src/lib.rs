//! A generated drive: the same route seen twice, in different conditions.
//!
//! It stands in for real data in the demo, the tests and the scale runs: structured scenery along a
//! winding road, frames that change smoothly, and places that look alike because blocks of houses
//! come back all along the route. A second traverse differs in light, season, lane, speed, traffic
//! and sensor noise, each adjustable; and it can stop, reverse, leave the map and come back
//! ([`Leg`]).
//!
//! Every frame is a pure function of the options and its index, so a route of a million places
//! takes no memory, and the same options give the same bits on every machine.
//!
//! ```
//! use surefix_simulate::{Conditions, Route, RouteConfig};
//!
//! let route = Route::new(RouteConfig { places: 100, width: 64, height: 32, ..RouteConfig::default() })?;
//! let reference = route.traverse(Conditions::reference())?;
//! let revisit = route.traverse(Conditions::revisit())?;
//! let frame = revisit.frame(50);
//! assert_eq!((frame.width(), frame.height()), (64, 32));
//! let truth = revisit.truth(&reference);
//! assert!(truth[50].is_some_and(|place| place.abs_diff(50) < 5));
//! # Ok::<(), surefix::Error>(())
//! ```
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "pixels, metres and hashes change type all the time; float to integer saturates, as it should"
)]

mod building;
mod camera;
mod canvas;
mod conditions;
mod ground;
mod legs;
mod look;
mod noise;
mod paint;
mod plants;
mod scene;
mod scenery;
mod sky;
mod street;
mod traffic;
mod traverse;

#[cfg(test)]
mod tests;

pub use conditions::Conditions;
pub use legs::Leg;
pub use traverse::Traverse;

use serde::{Deserialize, Serialize};
use surefix::Error;

/// The shortest and the longest side of a frame, in pixels.
const SIDES: std::ops::RangeInclusive<usize> = 8..=8192;

/// The options of a [`Route`], all with defaults.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RouteConfig {
    /// Frames of a traverse, at least 2.
    pub places: usize,
    /// Width of a frame in pixels, 8 to 8192.
    pub width: usize,
    /// Height of a frame in pixels, 8 to 8192.
    pub height: usize,
    /// Metres from one frame of the reference drive to the next.
    pub spacing: f64,
    /// Chooses the world: another seed is another route.
    pub seed: u64,
}

impl Default for RouteConfig {
    fn default() -> Self {
        Self { places: 1000, width: 320, height: 160, spacing: 3.0, seed: 1 }
    }
}

impl RouteConfig {
    fn validate(&self) -> Result<(), Error> {
        let bad = |name, expected: &str, got: String| {
            Err(Error::Option { name, expected: expected.to_owned(), got })
        };
        if self.places < 2 {
            return bad("places", "at least 2", self.places.to_string());
        }
        for (name, side) in [("width", self.width), ("height", self.height)] {
            if !SIDES.contains(&side) {
                return bad(name, "8 to 8192 pixels", side.to_string());
            }
        }
        if !(self.spacing > 0.0 && self.spacing <= 1e6) {
            let expected = "metres, above 0 and at most 1000000";
            return bad("spacing", expected, self.spacing.to_string());
        }
        Ok(())
    }
}

/// The world and the road through it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Route {
    config: RouteConfig,
}

impl Route {
    /// A route through the world that `config` names.
    ///
    /// # Errors
    ///
    /// [`Error::Option`] if an option of `config` is out of its range.
    pub fn new(config: RouteConfig) -> Result<Self, Error> {
        config.validate()?;
        Ok(Self { config })
    }

    /// A drive along the route, a frame a place.
    ///
    /// # Errors
    ///
    /// [`Error::Option`] if one of the `conditions` is out of its range.
    pub fn traverse(&self, conditions: Conditions) -> Result<Traverse, Error> {
        self.drive(conditions, &[Leg::Drive(self.config.places, 1.0)])
    }

    /// A drive of these `legs`, which begins at place 0.
    ///
    /// ```
    /// use surefix_simulate::{Conditions, Leg, Route, RouteConfig};
    ///
    /// let route = Route::new(RouteConfig { places: 100, ..RouteConfig::default() })?;
    /// let legs = [Leg::Drive(40, 1.0), Leg::Stop(10), Leg::Detour(20, 1.0), Leg::Drive(30, 0.5)];
    /// let drive = route.drive(Conditions::reference(), &legs)?;
    /// assert_eq!(drive.position(45), Some(39.0 * 3.0));
    /// assert_eq!(drive.position(60), None);
    /// assert_eq!(drive.odometry(60, 1.0, 0.0), 3.0);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error::Option`] if one of the `conditions` is out of its range; if there is no leg, or one
    /// without frames, or a speed of 0 or less, or one that ends before place 0 or past the last
    /// place.
    pub fn drive(&self, conditions: Conditions, legs: &[Leg]) -> Result<Traverse, Error> {
        conditions.validate()?;
        Traverse::new(self.config.clone(), conditions, legs)
    }

    /// The options that the route was made from.
    #[must_use]
    pub fn config(&self) -> &RouteConfig {
        &self.config
    }
}
