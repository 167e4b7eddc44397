//! `e^x` for all instruction sets: plain arithmetic, so that each gives the same bits.

/// Rounds to a whole number, which then stands in the lowest bits: `1.5 * 2^52`.
const ROUNDING: f64 = 6_755_399_441_055_744.0;
/// `ln 2` in two parts. The first has zeros at its end, so that its multiples are exact.
const LN_2: [f64; 2] =
    [f64::from_bits(0x3fe6_2e42_fee0_0000), f64::from_bits(0x3dea_39ef_3579_3c76)];
/// `1 / k!`, from `k` = 10 down to 0.
const INVERSE_FACTORIALS: [f64; 11] = {
    let mut all = [1.0; 11];
    let (mut k, mut factorial) = (1, 1.0);
    while k < all.len() {
        factorial *= k as f64;
        all[all.len() - 1 - k] = 1.0 / factorial;
        k += 1;
    }
    all
};

/// `e^x` for `x` from -700 to 700, with a relative error below `3e-13`.
///
/// `x = k ln 2 + r` with `|r| <= ln 2 / 2`, and the Taylor polynomial of `e^r` up to the power of
/// 10: evidence needs no more, and each further power costs a place two operations.
#[inline(always)]
pub(super) fn exp(x: f64) -> f64 {
    let rounded = x * std::f64::consts::LOG2_E + ROUNDING;
    let k = rounded - ROUNDING;
    let r = x - k * LN_2[0] - k * LN_2[1];
    let mut sum = INVERSE_FACTORIALS[0];
    let mut term = 1;
    while term < INVERSE_FACTORIALS.len() {
        sum = sum * r + INVERSE_FACTORIALS[term];
        term += 1;
    }
    // 2^k by its exponent bits.
    sum * f64::from_bits(rounded.to_bits().wrapping_add(1023) << 52)
}
