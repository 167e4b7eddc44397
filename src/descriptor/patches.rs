//! Patch by patch: less the mean, divided by the standard deviation.

/// Grey levels a unit of `z` has in the 8-bit form, and the level of `z = 0`.
pub(super) const LEVELS: f64 = 32.0;
const MIDDLE: f64 = 128.0;

/// Normalises images of one width, a band of patches at a time. A patch's sum and scale are written
/// to each of its columns, so that whole rows of pixels are worked on, whatever the patch.
#[derive(Clone, Debug)]
pub(super) struct Patches {
    side: usize,
    /// Each column's sum, and that of its squares. A patch has 4096 rows at most: they fit.
    sums: Vec<u32>,
    squares: Vec<u32>,
    /// The sum of the column's patch, and the factor.
    totals: Vec<f64>,
    scales: Vec<f64>,
}

impl Patches {
    /// For images of `width` pixels a row, which the patch's `side` divides.
    pub(super) fn new(width: usize, side: usize) -> Self {
        let (whole, real) = (vec![0; width], vec![0.0; width]);
        Self { side, sums: whole.clone(), squares: whole, totals: real.clone(), scales: real }
    }

    /// Each patch by itself: `z = (p - mean) / std`, and 0 if the std is below one grey level.
    /// The sums are whole numbers, so nothing is lost before the last division.
    #[inline(always)]
    pub(super) fn normalise<T>(&mut self, small: &[u8], out: &mut [T], store: impl Fn(f64) -> T) {
        let (width, count) = (self.sums.len(), (self.side * self.side) as f64);
        let band = width * self.side;
        for (band, out) in small.chunks_exact(band).zip(out.chunks_exact_mut(band)) {
            self.add_up(band);
            self.measure();
            for (row, out) in band.chunks_exact(width).zip(out.chunks_exact_mut(width)) {
                let (totals, scales) = (&self.totals[..width], &self.scales[..width]);
                for at in 0..width {
                    let above = count * f64::from(row[at]) - totals[at];
                    // A zero, never a negative one: a flat patch is 0 to the last bit.
                    out[at] = store(above * scales[at] + 0.0);
                }
            }
        }
    }

    #[inline(always)]
    fn add_up(&mut self, band: &[u8]) {
        self.sums.fill(0);
        self.squares.fill(0);
        let width = self.sums.len();
        let (sums, squares) = (&mut self.sums[..width], &mut self.squares[..width]);
        for row in band.chunks_exact(width) {
            for at in 0..width {
                let pixel = u32::from(row[at]);
                sums[at] += pixel;
                squares[at] += pixel * pixel;
            }
        }
    }

    #[inline(always)]
    fn measure(&mut self) {
        let count = (self.side * self.side) as u64;
        let whole = self.sums.chunks_exact(self.side).zip(self.squares.chunks_exact(self.side));
        let real =
            self.totals.chunks_exact_mut(self.side).zip(self.scales.chunks_exact_mut(self.side));
        for ((sums, squares), (totals, scales)) in whole.zip(real) {
            let add =
                |numbers: &[u32]| numbers.iter().map(|&number| u64::from(number)).sum::<u64>();
            let (sum, squares) = (add(sums), add(squares));
            // count^2 times the variance.
            let spread = count * squares - sum * sum;
            let flat = spread < count * count;
            totals.fill(sum as f64);
            scales.fill(if flat { 0.0 } else { 1.0 / (spread as f64).sqrt() });
        }
    }
}

/// `clamp(round(128 + 32 z))`, halves away from zero. Within the clamp that is upwards, and needs
/// no library function.
#[inline(always)]
pub(super) fn level(z: f64) -> u8 {
    let level = (MIDDLE + LEVELS * z).clamp(0.0, 255.0);
    let below = level as i32;
    let half = level - f64::from(below) >= 0.5;
    (below + i32::from(half)) as u8
}
