//! The order of the tracker's sums (end of method 1.9), and its `exp`.

/// Adds side by side in eight lanes, and then the lanes by twos.
pub(crate) fn lanes(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut sums = [0.0; 8];
    numbers.enumerate().for_each(|(index, number)| sums[index % 8] += number);
    let [a, b, c, d] = [0, 2, 4, 6].map(|at| sums[at] + sums[at + 1]);
    (a + b) + (c + d)
}

/// Adds the lanes of pieces of `piece` numbers, in order.
fn pieces(from: usize, to: usize, piece: usize, of: &impl Fn(usize) -> f64) -> f64 {
    let mut total = 0.0;
    for start in (from..to).step_by(piece) {
        total += lanes((start..to.min(start + piece)).map(of));
    }
    total
}

/// The sum of `of(0)`, `of(1)`, ... by blocks of 4,096 in one piece.
pub(crate) fn blocks(count: usize, of: impl Fn(usize) -> f64) -> f64 {
    pieces(0, count, 4096, &of)
}

/// The same by blocks of 4,096 in chunks of 256.
pub(crate) fn chunks(count: usize, of: impl Fn(usize) -> f64) -> f64 {
    let mut total = 0.0;
    for block in (0..count).step_by(4096) {
        total += pieces(block, count.min(block + 4096), 256, &of);
    }
    total
}

/// `e^x` by the Taylor polynomial up to `r^10 / 10!`, for `x = k ln 2 + r`.
pub(crate) fn exp(x: f64) -> f64 {
    const HIGH: f64 = f64::from_bits(0x3fe6_2e42_fee0_0000);
    const LOW: f64 = f64::from_bits(0x3dea_39ef_3579_3c76);
    const FACTORIALS: [f64; 11] =
        [1.0, 1.0, 2.0, 6.0, 24.0, 120.0, 720.0, 5040.0, 40320.0, 362_880.0, 3_628_800.0];
    let k = (x * std::f64::consts::LOG2_E).round_ties_even();
    let r = x - k * HIGH - k * LOW;
    let terms = FACTORIALS.iter().rev().map(|factorial| 1.0 / factorial);
    let polynomial = terms.reduce(|sum, term| sum * r + term);
    polynomial.unwrap_or_default() * 2.0_f64.powi(k as i32)
}
