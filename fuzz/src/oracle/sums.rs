//! The order of the tracker's sums (end of method 1.9), and its `exp`.

/// Adds side by side in eight lanes, and then the lanes by twos.
pub(crate) fn lanes(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut sums = [0.0; 8];
    numbers.enumerate().for_each(|(index, number)| sums[index % 8] += number);
    let [a, b, c, d] = [0, 2, 4, 6].map(|at| sums[at] + sums[at + 1]);
    (a + b) + (c + d)
}

/// The first place and the end of each part of a range that a multiple of `piece` begins.
pub(crate) fn spans(from: usize, to: usize, piece: usize) -> impl Iterator<Item = (usize, usize)> {
    let pieces = from / piece..to.div_ceil(piece);
    pieces.map(move |at| (from.max(at * piece), to.min((at + 1) * piece)))
}

/// The sum of `of(0)`, `of(1)`, ... by blocks of 4,096 in one piece.
pub(crate) fn blocks(count: usize, of: impl Fn(usize) -> f64) -> f64 {
    spans(0, count, 4096).map(|(a, b)| lanes((a..b).map(&of))).sum()
}

/// The same by blocks of 4,096 in chunks of 256.
pub(crate) fn chunks(count: usize, of: impl Fn(usize) -> f64) -> f64 {
    let block = |(a, b)| spans(a, b, 256).map(|(a, b)| lanes((a..b).map(&of))).sum::<f64>();
    spans(0, count, 4096).map(block).sum()
}

/// The sum of the products of `a` and `b` about their means: in each block about its own, and then
/// that of the blocks' means.
pub(crate) fn about(a: &[f64], b: &[f64]) -> f64 {
    let all = a.len();
    let mean = |x: &[f64]| blocks(all, |i| x[i]) / all as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let of_block = |(from, to): (usize, usize)| {
        let count = (to - from) as f64;
        let own = |x: &[f64]| lanes(x[from..to].iter().copied()) / count;
        let (own_a, own_b) = (own(a), own(b));
        let inside = lanes((from..to).map(|i| (a[i] - own_a) * (b[i] - own_b)));
        inside + count * ((own_a - mean_a) * (own_b - mean_b))
    };
    spans(0, all, 4096).map(of_block).sum()
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
