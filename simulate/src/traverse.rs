//! One drive along the route: where each frame was taken, and the frame.

use surefix::{Channels, Error, Image, ImageSource};

use super::RouteConfig;
use super::camera::Camera;
use super::canvas::Canvas;
use super::conditions::Conditions;
use super::look::Look;
use super::noise::{hash, mix, smoothstep, wave};
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
#[derive(Clone, Debug)]
pub struct Traverse {
    config: RouteConfig,
    conditions: Conditions,
    look: Look,
}

impl Traverse {
    pub(super) fn new(config: RouteConfig, conditions: Conditions) -> Self {
        Self { look: Look::new(&conditions), config, conditions }
    }

    /// The number of frames.
    #[must_use]
    pub fn len(&self) -> usize {
        self.config.places
    }

    /// Never true: a route has at least two places.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.config.places == 0
    }

    /// The conditions of the drive.
    #[must_use]
    pub fn conditions(&self) -> &Conditions {
        &self.conditions
    }

    /// Where frame `index` was taken, in metres along the route; an index past the end means the
    /// last frame.
    ///
    /// Positions grow strictly with the index. The first and the last frame are at the ends of the
    /// route.
    #[must_use]
    pub fn position(&self, index: usize) -> f64 {
        let last = self.len().saturating_sub(1);
        let index = index.min(last);
        (index as f64 + self.lead(index, last)) * self.config.spacing
    }

    /// The frames by which frame `index` is ahead of an even drive.
    fn lead(&self, index: usize, last: usize) -> f64 {
        let jitter = f64::from(self.conditions.speed_jitter);
        if jitter == 0.0 {
            return 0.0;
        }
        let mut lead = 0.0;
        for (number, knots) in (0_i64..).zip(SPEED_KNOTS) {
            // Bounded noise whose steepest slope is 0.15: two of them vary the speed by 30 %.
            let seed = hash(self.conditions.seed ^ 0x5BEE, number);
            let swing = 0.15 * knots / STEEPEST;
            lead += swing * f64::from(wave(seed, index as f64 / knots));
        }
        // Drives begin and end together.
        let from_end = index.min(last - index) as f32;
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
        // A driver who keeps aside does not keep aside evenly.
        let sway = wave(mix(conditions.seed ^ 0x5A1), index as f64 / 23.0);
        let offset = conditions.lateral_offset * (1.0 + 0.35 * sway);
        let mut scene = Scene {
            canvas: Canvas::new(pixels, config.width, config.height),
            camera: Camera::new(
                config.width,
                config.height,
                config.seed,
                self.position(index),
                offset,
            ),
            look: &self.look,
            seed: config.seed,
        };
        let traffic = Traffic::new(conditions.occluders, mix(conditions.seed), index);
        paint(&mut scene, &traffic);
        if conditions.noise > 0.0 {
            let seed = hash(mix(conditions.seed ^ 0x4015E), index as i64);
            add_noise(&mut scene.canvas, 24.0 * conditions.noise, seed);
        }
    }

    /// For each frame of this drive the nearest frame of `reference`, the earlier one of two
    /// equally near ones; `None` where `reference` never was: farther than one of its frame
    /// spacings, or in another world.
    #[must_use]
    pub fn truth(&self, reference: &Self) -> Vec<Option<usize>> {
        let last = reference.len().saturating_sub(1);
        let same_world = self.config.seed == reference.config.seed;
        let mut nearest = 0;
        (0..self.len())
            .map(|index| {
                let here = self.position(index);
                let away = |place: usize| (reference.position(place) - here).abs();
                // Both drives only go forward, so the nearest frame does too.
                while nearest < last && away(nearest + 1) < away(nearest) {
                    nearest += 1;
                }
                (same_world && away(nearest) <= reference.config.spacing).then_some(nearest)
            })
            .collect()
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
