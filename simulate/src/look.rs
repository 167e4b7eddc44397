//! The effect of light and season on colours.

use super::camera::FAR;
use super::canvas::{Rgb, blend, scale};
use super::conditions::Conditions;
use super::noise::{lerp, smoothstep};
use serde::{Deserialize, Serialize};

/// Snow, before light falls on it.
pub(super) const SNOW: Rgb = [236.0, 240.0, 247.0];

/// The light and the season of a traverse, worked out once.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Look {
    /// 0 to 1: how dark it is, and so how bright lamps and windows are.
    pub(super) lamps: f32,
    /// 0 to 1: how strong the sun and its shadows are.
    pub(super) sun: f32,
    /// 0 to 1: how much snow lies.
    pub(super) snow: f32,
    /// 0 to 1: the leaves left on the trees.
    pub(super) leaves: f32,
    pub(super) zenith: Rgb,
    pub(super) haze: Rgb,
    /// How far the clouds have moved on since the reference drive.
    pub(super) clouds: f32,
    tint: Rgb,
    autumn: f32,
}

impl Look {
    pub(super) fn new(conditions: &Conditions) -> Self {
        let (light, season) = (conditions.light, conditions.season);
        let winter = smoothstep(0.2, 1.0, season);
        let day = blend([104.0, 164.0, 222.0], [176.0, 192.0, 208.0], winter);
        let pale = blend([214.0, 228.0, 238.0], [226.0, 230.0, 234.0], winter);
        Self {
            lamps: smoothstep(0.2, 0.85, light),
            sun: (1.0 - smoothstep(0.0, 0.8, light)) * (1.0 - 0.45 * winter),
            snow: smoothstep(0.45, 1.0, season),
            leaves: 1.0 - smoothstep(0.3, 0.8, season),
            zenith: blend(day, [52.0, 58.0, 104.0], light),
            haze: blend(pale, [228.0, 158.0, 124.0], light),
            clouds: light * 23.0,
            tint: blend([1.0, 1.0, 0.98], [0.50, 0.46, 0.58], light),
            autumn: smoothstep(0.05, 0.5, season),
        }
    }

    /// The colour of something `z` metres away, of which `lit` of the light falls on it.
    pub(super) fn shade(&self, colour: Rgb, lit: f32, z: f32) -> Rgb {
        let t = &self.tint;
        let seen = [colour[0] * t[0] * lit, colour[1] * t[1] * lit, colour[2] * t[2] * lit];
        self.veil(seen, z)
    }

    /// The colour of something that shines by itself, `z` metres away.
    pub(super) fn veil(&self, colour: Rgb, z: f32) -> Rgb {
        blend(colour, self.haze, 0.8 * smoothstep(-0.25 * FAR, FAR, z) - 0.07)
    }

    /// How bright a wall is that faces right (`side` -1, left of the road) or left (`side` 1).
    pub(super) fn facing(&self, side: f32) -> f32 {
        // The sun of the reference drive stands on the left, so walls that face left are in it.
        lerp(0.9, if side > 0.0 { 1.06 } else { 0.74 }, self.sun)
    }

    /// Something that snow settles on.
    pub(super) fn snowed(&self, colour: Rgb, share: f32) -> Rgb {
        blend(colour, SNOW, self.snow * share)
    }

    /// Leaves and grass as the year goes by.
    pub(super) fn foliage(&self, green: Rgb, turns: f32) -> Rgb {
        let autumn = [205.0, 140.0 - 40.0 * turns, 52.0];
        blend(green, autumn, self.autumn * (0.45 + 0.5 * turns))
    }

    /// Grass: it fades in autumn and lies under snow in winter.
    pub(super) fn grass(&self, green: Rgb) -> Rgb {
        self.snowed(blend(green, [158.0, 148.0, 92.0], self.autumn * 0.7), 0.96)
    }

    /// A window pane: dark by day, and by dusk warm if `home` (0 to 1) is high.
    pub(super) fn pane(&self, home: f32, lit: f32, z: f32) -> Rgb {
        let glass = blend([62.0, 78.0, 94.0], self.zenith, 0.18);
        let dark = self.shade(scale(glass, 0.8 + 0.35 * home), lit, z);
        if home < 0.52 {
            return dark;
        }
        let warm = self.veil([255.0, 196.0 + 36.0 * (home - 0.52), 112.0], z);
        blend(dark, warm, self.lamps)
    }
}
