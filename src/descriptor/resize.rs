//! Antialiased bilinear resizing of grey images as Pillow does it: rows first, then columns, in fixed point.
//!
//! It is our own because `push` may not allocate, and resize libraries compute their tables anew for each
//! image: here they are kept for as long as the camera does not change its image size.

/// Bits behind the point of a weight: an 8-bit pixel times a weight, summed, fits 32 bits with a sign.
const PRECISION: u32 = 32 - 8 - 2;

/// The weighted source pixels of each target pixel along one axis.
#[derive(Clone, Debug, Default)]
struct Axis {
    source: usize,
    target: usize,
    /// For each target pixel: its first source pixel, and where its weights end in `weights`.
    taps: Vec<(usize, usize)>,
    weights: Vec<i32>,
}

impl Axis {
    /// The triangle filter, widened by the factor of reduction (so that it does not alias), normalised, and rounded to
    /// `PRECISION` bits.
    fn prepare(&mut self, source: usize, target: usize) {
        if (self.source, self.target) == (source, target) {
            return;
        }
        (self.source, self.target) = (source, target);
        self.taps.clear();
        self.weights.clear();
        let scale = source as f64 / target as f64;
        let support = scale.max(1.0);
        for index in 0..target {
            let centre = (index as f64 + 0.5) * scale;
            let first = (centre - support + 0.5).max(0.0) as usize;
            let last = ((centre + support + 0.5) as usize).min(source);
            let triangle = |pixel: usize| {
                let distance = (pixel as f64 - centre + 0.5) * (1.0 / support);
                (1.0 - distance.abs()).max(0.0)
            };
            let total: f64 = (first..last).map(triangle).sum();
            let one = f64::from(1_u32 << PRECISION);
            self.weights.extend((first..last).map(|pixel| (0.5 + triangle(pixel) / total * one) as i32));
            self.taps.push((first, self.weights.len()));
        }
    }

    /// For each target pixel: its first source pixel and its weights.
    fn each(&self) -> impl Iterator<Item = (usize, &[i32])> {
        let mut start = 0;
        self.taps.iter().map(move |&(first, end)| {
            let weights = &self.weights[start..end];
            start = end;
            (first, weights)
        })
    }
}

/// Resizes grey images, and remembers the tables and the memory of the last size.
#[derive(Clone, Debug, Default)]
pub(super) struct Resize {
    across: Axis,
    down: Axis,
    /// The image after the first pass: target width, source height.
    narrow: Vec<u8>,
    /// One row of sums.
    sums: Vec<i32>,
}

impl Resize {
    /// `grey` of `from` (width, height) into `out` of `to` (width, height), rows first, then columns, each rounded to
    /// 8 bits.
    pub(super) fn run(&mut self, grey: &[u8], from: (usize, usize), to: (usize, usize), out: &mut [u8]) {
        self.across.prepare(from.0, to.0);
        self.down.prepare(from.1, to.1);
        let narrow = if from.0 == to.0 {
            grey
        } else {
            self.narrow.resize(to.0 * from.1, 0);
            let rows = self.narrow.chunks_exact_mut(to.0).zip(grey.chunks_exact(from.0));
            for (narrow, row) in rows {
                for (pixel, (first, weights)) in narrow.iter_mut().zip(self.across.each()) {
                    let taps = row[first..first + weights.len()].iter().zip(weights);
                    *pixel = rounded(taps.map(|(&p, &w)| i32::from(p) * w).sum());
                }
            }
            &self.narrow
        };
        if from.1 == to.1 {
            out.copy_from_slice(narrow);
            return;
        }
        self.sums.resize(to.0, 0);
        for (out, (first, weights)) in out.chunks_exact_mut(to.0).zip(self.down.each()) {
            self.sums.fill(0);
            for (row, &weight) in narrow[first * to.0..].chunks_exact(to.0).zip(weights) {
                self.sums.iter_mut().zip(row).for_each(|(sum, &p)| *sum += i32::from(p) * weight);
            }
            out.iter_mut().zip(&self.sums).for_each(|(pixel, &sum)| *pixel = rounded(sum));
        }
    }
}

fn rounded(sum: i32) -> u8 {
    ((sum + (1 << (PRECISION - 1))) >> PRECISION).clamp(0, 255) as u8
}
