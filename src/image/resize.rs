//! Antialiased bilinear resizing as Pillow does it: grey, then rows, then columns, in fixed point.
//!
//! It is our own because `push` may not allocate, and resize libraries compute their tables anew
//! for each image: here they are kept for as long as the camera does not change its image size.
//!
//! A row's sums are a few dozen products each, at places that differ from sum to sum: little for a
//! vector register to hold. So the rows are taken a block at a time and turned on their side: the
//! same sum of all rows of a block then runs side by side. Everything is in whole numbers, so the
//! order of additions makes no difference.

#[cfg(target_arch = "x86_64")]
use super::avx512::Columns;
use super::axis::{Axis, END, PRECISION};
use super::grey::brightness;
use super::view::{Channels, ImageView};
use crate::simd::Isa;

/// Rows a block: the 32-bit sums of the widest register.
const ROWS: usize = 16;

/// Makes images grey and small, and remembers the tables and the memory of the last size.
#[derive(Clone, Debug, Default)]
pub(crate) struct Resize {
    across: Axis,
    down: Axis,
    block: Block,
    #[cfg(target_arch = "x86_64")]
    columns: Columns,
    /// The image after the first pass: target width, source height.
    narrow: Vec<u8>,
    /// One row of sums.
    sums: Vec<i32>,
}

impl Resize {
    /// `image` in grey into `out` of `to` (width, height), rows first, then columns, each rounded
    /// to 8 bits.
    #[inline(always)]
    pub(crate) fn run(
        &mut self,
        isa: Isa,
        image: ImageView<'_>,
        to: (usize, usize),
        out: &mut [u8],
    ) {
        let (width, height) = (image.width(), image.height());
        self.across.prepare(width, to.0);
        self.down.prepare(height, to.1);
        // Whatever the image's channels, so that another of its size finds it there.
        self.narrow.resize(to.0 * height, 0);
        let narrow = if width != to.0 {
            self.across(isa, image);
            &self.narrow
        } else if image.channels() == Channels::Rgb {
            brightness(image.pixels(), &mut self.narrow);
            &self.narrow
        } else {
            image.pixels()
        };
        if height == to.1 {
            out.copy_from_slice(narrow);
            return;
        }
        self.sums.resize(to.0, 0);
        let sums = &mut self.sums[..to.0];
        for (out, (first, weights)) in out.chunks_exact_mut(to.0).zip(self.down.each()) {
            sums.fill(0);
            for (row, &weight) in narrow[first * to.0..].chunks_exact(to.0).zip(weights) {
                if weight == END {
                    break;
                }
                for at in 0..to.0 {
                    sums[at] += i32::from(row[at]) * weight;
                }
            }
            for at in 0..to.0 {
                out[at] = rounded(sums[at]);
            }
        }
    }

    /// The first pass.
    #[inline(always)]
    fn across(&mut self, isa: Isa, image: ImageView<'_>) {
        #[cfg(target_arch = "x86_64")]
        if isa == Isa::Avx512 && self.columns.run(image, &self.across, &mut self.narrow) {
            return;
        }
        let _ = isa;
        self.block.run(image, &self.across, &mut self.narrow);
    }
}

/// The memory of the first pass, for `ROWS` rows. Four bytes of a column are a word, four words the
/// column.
#[derive(Clone, Debug, Default)]
struct Block {
    /// The rows in grey, one after the other.
    grey: Vec<u8>,
    /// The same, a word a column, rows 0 to 3 first.
    words: [Vec<u32>; 4],
    /// The same, column by column.
    wide: Vec<[u32; 4]>,
    /// The columns of the target.
    narrow: Vec<[u32; 4]>,
}

impl Block {
    /// The first pass: the rows of `image` in grey, each as wide as the target of `across`, into
    /// `out`.
    #[inline(always)]
    fn run(&mut self, image: ImageView<'_>, across: &Axis, out: &mut [u8]) {
        let (wide, narrow, channels) = (across.source, across.target, image.channels());
        self.grey.resize(wide * ROWS, 0);
        self.wide.resize(wide, [0; 4]);
        self.narrow.resize(narrow, [0; 4]);
        self.words.iter_mut().for_each(|words| words.resize(wide.max(narrow), 0));

        let blocks = image.pixels().chunks(wide * channels.count() * ROWS);
        for (pixels, out) in blocks.zip(out.chunks_mut(narrow * ROWS)) {
            // In the last block, rows of the one before take the place of missing ones.
            match channels {
                Channels::Grey => self.grey[..pixels.len()].copy_from_slice(pixels),
                Channels::Rgb => brightness(pixels, &mut self.grey),
            }
            self.turn();
            self.reduce(across);
            self.turn_back(narrow, out);
        }
    }

    /// The rows' columns.
    #[inline(always)]
    fn turn(&mut self) {
        let width = self.wide.len();
        for (rows, words) in self.grey.chunks_exact(4 * width).zip(&mut self.words) {
            let row = |index: usize| &rows[index * width..][..width];
            interleave(
                [row(0), row(1), row(2), row(3)],
                bytemuck::must_cast_slice_mut(&mut words[..width]),
            );
        }
        let [a, b, c, d] = &self.words;
        interleave([a, b, c, d], &mut self.wide);
    }

    /// Each column of the target, from those of the source that have a weight.
    #[inline(always)]
    fn reduce(&mut self, across: &Axis) {
        let wide: &[[u8; ROWS]] = bytemuck::must_cast_slice(&self.wide);
        let narrow: &mut [[u8; ROWS]] = bytemuck::must_cast_slice_mut(&mut self.narrow);
        for (narrow, (first, weights)) in narrow.iter_mut().zip(across.each()) {
            let mut sums = [0; ROWS];
            for (column, &weight) in wide[first..].iter().zip(weights) {
                if weight == END {
                    break;
                }
                for row in 0..ROWS {
                    sums[row] += i32::from(column[row]) * weight;
                }
            }
            for row in 0..ROWS {
                narrow[row] = rounded(sums[row]);
            }
        }
    }

    /// The target's columns as the rows of `out` again.
    #[inline(always)]
    fn turn_back(&mut self, width: usize, out: &mut [u8]) {
        let [a, b, c, d] = &mut self.words;
        deinterleave(&self.narrow, [a, b, c, d]);
        for (words, out) in self.words.iter().zip(out.chunks_mut(4 * width)) {
            let columns: &[[u8; 4]] = bytemuck::must_cast_slice(&words[..width]);
            if let Some((a, rest)) = out.split_at_mut_checked(width)
                && let Some((b, rest)) = rest.split_at_mut_checked(width)
                && let Some((c, d)) = rest.split_at_mut_checked(width)
                && d.len() == width
            {
                deinterleave(columns, [a, b, c, d]);
                continue;
            }
            for (index, row) in out.chunks_exact_mut(width).enumerate() {
                row.iter_mut().zip(columns).for_each(|(pixel, column)| *pixel = column[index]);
            }
        }
    }
}

#[inline(always)]
fn rounded(sum: i32) -> u8 {
    ((sum + (1 << (PRECISION - 1))) >> PRECISION).clamp(0, 255) as u8
}

/// Turns rows on their side: `out[i]` is the `i`-th of each. Four by four, because compilers turn
/// this loop into the shuffles of any instruction set.
#[inline(always)]
fn interleave<T: Copy>(rows: [&[T]; 4], out: &mut [[T; 4]]) {
    let ([a, b, c, d], count) = (rows, out.len());
    let (a, b, c, d) = (&a[..count], &b[..count], &c[..count], &d[..count]);
    for i in 0..count {
        out[i] = [a[i], b[i], c[i], d[i]];
    }
}

/// The way back: the `i`-th of each row is from `columns[i]`.
#[inline(always)]
fn deinterleave<T: Copy>(columns: &[[T; 4]], rows: [&mut [T]; 4]) {
    let ([a, b, c, d], count) = (rows, columns.len());
    let (a, b, c, d) = (&mut a[..count], &mut b[..count], &mut c[..count], &mut d[..count]);
    for i in 0..count {
        [a[i], b[i], c[i], d[i]] = columns[i];
    }
}
