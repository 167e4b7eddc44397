//! One drive along the route: where each frame was taken, and the frame.

use serde::{Deserialize, Serialize};
use surefix::{Channels, Error, Image, ImageSource};

use super::RouteConfig;
use super::camera::Camera;
use super::canvas::Canvas;
use super::conditions::Conditions;
use super::legs::{Itinerary, Leg, Stand};
use super::look::Look;
use super::noise::{Dice, hash, mix, smoothstep, wave};
use super::paint::paint;
use super::scene::Scene;
use super::traffic::Traffic;

/// Frames from one knot of the speed's two waves to the next.
const SPEED_KNOTS: [f64; 2] = [40.0, 17.0];
/// The steepest slope of a wave between -1 and 1: 15 / 8 of the rise.
const STEEPEST: f64 = 3.75;

/// One drive along a [`Route`](super::Route), in some [`Conditions`].
///
/// Nothing is stored: a frame is computed when it is asked for, in any order and from any thread.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Traverse {
    config: RouteConfig,
    conditions: Conditions,
    look: Look,
    itinerary: Itinerary,
}

impl Traverse {
    pub(super) fn new(
        config: RouteConfig,
        conditions: Conditions,
        legs: &[Leg],
    ) -> Result<Self, Error> {
        let itinerary = Itinerary::new(legs, config.places)?;
        Ok(Self { look: Look::new(&conditions), config, conditions, itinerary })
    }

    /// The number of frames.
    #[must_use]
    pub fn len(&self) -> usize {
        self.itinerary.frames()
    }

    /// Never true: a drive has at least one frame.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The conditions of the drive.
    #[must_use]
    pub fn conditions(&self) -> &Conditions {
        &self.conditions
    }

    /// Where frame `index` was taken, in metres along the route, or `None` off the map; an index
    /// past the end means the last frame.
    ///
    /// A drive from end to end begins and ends at the ends of the route, and its positions grow
    /// strictly.
    #[must_use]
    pub fn position(&self, index: usize) -> Option<f64> {
        let stand = self.itinerary.stand(index);
        (stand.street == 0).then(|| self.metres(stand))
    }

    /// The metres that the wheels count from the frame before to frame `index`, on the map and off
    /// it: 0 for the first frame and while standing, negative backwards.
    ///
    /// `scale` is 1 for wheels that count right, `noise` the standard deviation of a step's error
    /// as a share of the step; the errors follow from the seed of the conditions.
    #[must_use]
    pub fn odometry(&self, index: usize, scale: f64, noise: f64) -> f64 {
        let index = index.min(self.len().saturating_sub(1));
        let here = self.itinerary.stand(index);
        let before = self.itinerary.stand(index.saturating_sub(1));
        let metres = here.ahead * (self.metres(here) - self.metres(before));
        // The sum of 12 numbers from 0 to 1: nearly a bell curve, with a standard deviation of 1.
        let mut dice = Dice::new(hash(self.conditions.seed ^ 0x0D0, index as i64));
        let bell: f64 = (0..12).map(|_| f64::from(dice.unit()) - 0.5).sum();
        metres * (scale + noise * bell)
    }

    /// The metres along the route, or along the street beside it.
    fn metres(&self, stand: Stand) -> f64 {
        (stand.place + self.lead(stand.place)) * self.config.spacing
    }

    /// The places by which the drive is ahead of an even one.
    fn lead(&self, place: f64) -> f64 {
        let jitter = f64::from(self.conditions.speed_jitter);
        if jitter == 0.0 {
            return 0.0;
        }
        let mut lead = 0.0;
        for (number, knots) in (0_i64..).zip(SPEED_KNOTS) {
            // Bounded noise whose steepest slope is 0.15: two of them vary the speed by 30 %.
            let seed = hash(self.conditions.seed ^ 0x5BEE, number);
            let swing = 0.15 * knots / STEEPEST;
            lead += swing * f64::from(wave(seed, place / knots));
        }
        // Drives begin and end together.
        let from_end = place.min((self.config.places - 1) as f64 - place) as f32;
        jitter * lead * f64::from(smoothstep(0.0, SPEED_KNOTS[0] as f32, from_end))
    }

    /// Frame `index` as an RGB image; an index past the end means the last frame.
    #[must_use]
    #[allow(
        clippy::expect_used,
        clippy::missing_panics_doc,
        reason = "the sides are those that the buffer is made for"
    )]
    pub fn frame(&self, index: usize) -> Image {
        let RouteConfig { width, height, .. } = self.config;
        let mut pixels = vec![0; width * height * Channels::Rgb.count()];
        self.render(index, &mut pixels);
        Image::new(width, height, Channels::Rgb, pixels).expect("sides of at least 8 pixels")
    }

    /// Renders frame `index` into `pixels`: rows of RGB bytes from the top, `3 * width * height` of
    /// them.
    ///
    /// Allocates nothing. An index past the end means the last frame. A buffer that is too short
    /// gets the rows that fit, of a longer one the rest is left as it is.
    pub fn render(&self, index: usize, pixels: &mut [u8]) {
        let index = index.min(self.len().saturating_sub(1));
        let (config, conditions) = (&self.config, &self.conditions);
        let stand = self.itinerary.stand(index);
        // Another street is the same stretch of another world.
        let seed = match stand.street {
            0 => config.seed,
            street => hash(config.seed ^ 0x0FF, street as i64),
        };
        // A driver who keeps aside does not keep aside evenly.
        let sway = wave(mix(conditions.seed ^ 0x5A1), stand.place / 23.0);
        let offset = conditions.lateral_offset * (1.0 + 0.35 * sway);
        let along = stand.ahead * self.metres(stand);
        let mut scene = Scene {
            canvas: Canvas::new(pixels, config.width, config.height),
            camera: Camera::new(config.width, config.height, seed, along, offset),
            look: &self.look,
            seed,
        };
        let traffic = Traffic::new(conditions.occluders, mix(conditions.seed), index);
        paint(&mut scene, &traffic);
        if conditions.noise > 0.0 {
            let seed = hash(mix(conditions.seed ^ 0x4015E), index as i64);
            add_noise(&mut scene.canvas, 24.0 * conditions.noise, seed);
        }
    }

    /// For each frame of this drive the nearest frame of `reference`, the earliest one of equally
    /// near ones; `None` where `reference` never was: farther than one of its frame spacings, off
    /// the map, or in another world.
    #[must_use]
    pub fn truth(&self, reference: &Self) -> Vec<Option<usize>> {
        let same_world = self.config.seed == reference.config.seed;
        let mut map: Vec<(f64, usize)> = (0..reference.len())
            .filter_map(|place| Some((reference.position(place)?, place)))
            .filter(|_| same_world)
            .collect();
        // Stable, so the earliest of those that stood at one position is kept.
        map.sort_by(|a, b| a.0.total_cmp(&b.0));
        map.dedup_by_key(|frame| frame.0);
        let nearest = |here: f64| {
            let after = map.partition_point(|frame| frame.0 < here);
            let around = map.get(after.saturating_sub(1)..map.len().min(after + 1))?;
            let away = |frame: &(f64, usize)| ((frame.0 - here).abs(), frame.1);
            let (metres, place) =
                around.iter().map(away).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
            (metres <= reference.config.spacing).then_some(place)
        };
        (0..self.len()).map(|index| nearest(self.position(index)?)).collect()
    }
}

/// Adds noise of a standard deviation of `sigma` grey levels, mostly the same in the three
/// channels.
fn add_noise(canvas: &mut Canvas, sigma: f32, seed: u64) {
    // The sum of four bytes of a hash: nearly a bell curve, with a standard deviation of 148.
    let gain = (sigma / 148.0 * 65536.0) as i32;
    for y in 0..canvas.rows() {
        let mut state = hash(seed, y as i64);
        for pixel in canvas.row_mut(y).chunks_exact_mut(3) {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let bits = state ^ (state >> 29);
            // The four bytes of the upper half, added two by two.
            let pairs = ((bits >> 32) & 0x00FF_00FF) + ((bits >> 40) & 0x00FF_00FF);
            let sum = ((pairs + (pairs >> 16)) & 0x3FF) as i32 - 510;
            for (channel, shift) in pixel.iter_mut().zip([0, 8, 16]) {
                let tinge = (((bits >> shift) & 0x7F) as i32) - 64;
                let noise = ((sum + tinge) * gain) >> 16;
                *channel = (i32::from(*channel) + noise).clamp(0, 255) as u8;
            }
        }
    }
}

impl ImageSource for Traverse {
    fn len(&self) -> usize {
        Self::len(self)
    }

    fn load(&self, index: usize) -> Result<Image, Error> {
        Ok(self.frame(index))
    }
}
