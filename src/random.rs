//! Random numbers that are the same everywhere. Tests and benches include this file as well.

use serde::{Deserialize, Serialize};

/// The generator `SplitMix64` (Steele, Lea and Flood, 2014), with its seed.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct SplitMix64(pub(crate) u64);

#[allow(dead_code, reason = "some are for tests and benches alone")]
impl SplitMix64 {
    /// 64 random bits.
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    /// A whole number below `limit`.
    pub(crate) fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit as u64) as usize
    }

    /// A number from 0 to 1.
    pub(crate) fn share(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1 << 24) as f32
    }

    /// `count` numbers from -1 to 1.
    pub(crate) fn signed(&mut self, count: usize) -> Vec<f32> {
        (0..count).map(|_| 2.0 * self.share() - 1.0).collect()
    }
}
