//! Random signs that are the same everywhere.

/// `rows` rows of `dim` signs, 1 or -1, drawn by `SplitMix64` from `seed`: 64 a draw, the lowest
/// bit first. Nothing where there is no memory for them.
pub(super) fn signs(rows: usize, dim: usize, seed: u64) -> Option<Vec<f32>> {
    let count = rows.checked_mul(dim)?;
    let mut signs = Vec::new();
    signs.try_reserve_exact(count).ok()?;
    let mut state = seed;
    let mut bits = 0_u64;
    signs.extend((0..count).map(|index| {
        if index % 64 == 0 {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mixed = (state ^ (state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            bits = mixed ^ (mixed >> 31);
        }
        let sign = if bits & 1 == 1 { 1.0 } else { -1.0 };
        bits >>= 1;
        sign
    }));
    Some(signs)
}
