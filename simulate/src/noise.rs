//! Hashing and smooth noise: every random thing of the world is a pure function of a seed and a
//! place.
//!
//! Only integer arithmetic and the IEEE basic operations are used, so every machine gets the same
//! bits.

/// Scrambles 64 bits (the finaliser of splitmix64).
pub(super) const fn mix(value: u64) -> u64 {
    let mut x = value.wrapping_add(0x9E37_79B9_7F4A_7C15);
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

/// A seed for the thing `key` under `seed`.
pub(super) const fn hash(seed: u64, key: i64) -> u64 {
    mix(seed ^ mix(key as u64))
}

/// The top 24 bits as a number in [0, 1).
pub(super) fn unit(bits: u64) -> f32 {
    (bits >> 40) as f32 / 16_777_216.0
}

/// Rounds down. `f32::floor` is a call into libm on processors without SSE 4.1, this is a few
/// instructions; both give the same for everything that fits an image.
pub(super) fn floor(x: f32) -> f32 {
    let whole = x as i32 as f32;
    if whole > x { whole - 1.0 } else { whole }
}

/// Rounds down, for metres along the route.
pub(super) fn floor64(x: f64) -> f64 {
    let whole = x as i64 as f64;
    if whole > x { whole - 1.0 } else { whole }
}

/// From `a` at 0 to `b` at 1.
pub(super) fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// 0 below `from`, 1 above `to`, an S between.
pub(super) fn smoothstep(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Smooth noise in [-1, 1] and its slope; knots at the whole numbers, twice differentiable.
pub(super) fn wave_and_slope(seed: u64, x: f64) -> (f32, f32) {
    let cell = floor64(x);
    let t = (x - cell) as f32;
    let a = 2.0 * unit(hash(seed, cell as i64)) - 1.0;
    let b = 2.0 * unit(hash(seed, cell as i64 + 1)) - 1.0;
    let blend = t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let slope = 30.0 * t * t * (t - 1.0) * (t - 1.0);
    (a + (b - a) * blend, (b - a) * slope)
}

/// Smooth noise in [-1, 1].
pub(super) fn wave(seed: u64, x: f64) -> f32 {
    wave_and_slope(seed, x).0
}

/// Lattice noise in [0, 1] along one image row: `value` at `(column, across)`, smooth in both.
///
/// Neighbouring pixels mostly share a lattice cell, so the two corners are kept and looked up
/// afresh only when the cell changes.
pub(super) struct Lattice {
    /// The hashes of the two lattice rows around `across`.
    rows: (u64, u64),
    blend: f32,
    cell: i32,
    /// The value where the cell begins, and the rise to where it ends.
    ends: (f32, f32),
}

impl Lattice {
    pub(super) fn new(seed: u64, across: f64) -> Self {
        let row = floor64(across);
        Self {
            rows: (hash(seed, row as i64), hash(seed, row as i64 + 1)),
            blend: smoothstep(0.0, 1.0, (across - row) as f32),
            cell: i32::MIN,
            ends: (0.0, 0.0),
        }
    }

    fn corner(&self, cell: i32) -> f32 {
        let key = (cell as u64).wrapping_mul(0xD6E8_FEB8_6659_FD93);
        let (here, next) = (mix(self.rows.0 ^ key), mix(self.rows.1 ^ key));
        lerp(unit(here), unit(next), self.blend)
    }

    #[inline]
    pub(super) fn value(&mut self, along: f32) -> f32 {
        let cell = floor(along) as i32;
        if cell != self.cell {
            self.enter(cell);
        }
        let t = along - cell as f32;
        self.ends.0 + self.ends.1 * (t * t * (3.0 - 2.0 * t))
    }

    #[inline(never)]
    fn enter(&mut self, cell: i32) {
        let first = self.corner(cell);
        self.ends = (first, self.corner(cell + 1) - first);
        self.cell = cell;
    }
}

/// A stream of random numbers from one seed.
#[derive(Clone, Debug)]
pub(super) struct Dice(u64);

impl Dice {
    pub(super) const fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub(super) fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        unit(mix(self.0))
    }

    pub(super) fn between(&mut self, low: f32, high: f32) -> f32 {
        lerp(low, high, self.unit())
    }

    pub(super) fn chance(&mut self, probability: f32) -> bool {
        self.unit() < probability
    }

    /// One of `choices`, each as likely.
    pub(super) fn pick<T: Copy, const N: usize>(&mut self, choices: &[T; N]) -> T {
        // unit() < 1, so the product stays below N.
        choices[((self.unit() * N as f32) as usize).min(N - 1)]
    }
}
