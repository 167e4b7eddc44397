//! The first pass of the resize with the registers of AVX-512: the same sums as in `resize`, taken
//! apart into bytes, for the instruction that adds up four products of bytes at once (VNNI).
//!
//! A weight of 22 bits is `low + 256 middle + 65536 high`, three bytes with a sign; sums of 32 bits
//! wrap around, and the result is the same whole number.

#![allow(unsafe_code, reason = "intrinsics, which run only after the CPU check")]
#![allow(clippy::wildcard_imports, reason = "their names are prefixed")]

use std::arch::x86_64::*;

use super::axis::{Axis, PRECISION};
use super::view::{Channels, ImageView};
use crate::simd::Isa;

/// Rows that are worked on together, and 32-bit words a register.
const ROWS: usize = 16;
/// Bytes a register.
const BYTES: usize = 64;
/// Which four neighbouring columns the words of a row's register are: the order in which `grey`
/// leaves them.
const GROUPS: [usize; ROWS] = [0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15];

/// A register's bytes in memory.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Line([u8; BYTES]);

const EMPTY: Line = Line([0; BYTES]);

/// The three bytes of four neighbouring weights each.
type Weights = [[i8; 4]; 3];

/// The memory of the pass, for `ROWS` rows, and its weights.
#[derive(Clone, Debug, Default)]
pub(super) struct Columns {
    /// The widths that the weights are of.
    of: (usize, usize),
    /// For each target column: its first group of four source columns.
    firsts: Vec<usize>,
    /// The groups of each target column that have weights; some of these may be zeros.
    reach: usize,
    weights: Vec<Weights>,
    /// `BYTES` columns of each row, then the next.
    grey: Vec<[Line; ROWS]>,
    /// Four columns of all rows, then the next.
    wide: Vec<Line>,
    /// The same of the target.
    narrow: Vec<Line>,
}

impl Columns {
    fn prepare(&mut self, across: &Axis) {
        let of = (across.source, across.target);
        if self.of == of {
            return;
        }
        self.of = of;
        // The last weight is the mark of the end.
        let groups =
            |(first, weights): (usize, &[i32])| (first % 4 + weights.len() - 1).div_ceil(4);
        self.reach = across.each().map(groups).max().unwrap_or(0);
        let lines = |columns: usize| columns.div_ceil(BYTES);
        self.grey.resize(lines(of.0), [EMPTY; ROWS]);
        // Columns past the last one have no weight.
        self.wide.resize(lines(of.0) * ROWS + self.reach, EMPTY);
        self.narrow.resize(lines(of.1) * ROWS, EMPTY);
        self.firsts.clear();
        self.weights.clear();
        for (first, weights) in across.each() {
            let start = self.weights.len();
            self.weights.resize(start + self.reach, Weights::default());
            for (at, &weight) in (first % 4..).zip(&weights[..weights.len() - 1]) {
                for (bytes, byte) in self.weights[start + at / 4].iter_mut().zip(digits(weight)) {
                    bytes[at % 4] = byte;
                }
            }
            self.firsts.push(first / 4);
        }
        // A register holds four targets.
        self.firsts.resize(of.1.next_multiple_of(4), 0);
        self.weights.resize(self.firsts.len() * self.reach, Weights::default());
    }

    /// The rows of `image` in grey, each as wide as the target of `across`, into `out`. Does
    /// nothing and gives `false` if the CPU lacks the instructions.
    pub(super) fn run(&mut self, image: ImageView<'_>, across: &Axis, out: &mut [u8]) -> bool {
        if !Isa::Avx512.is_available() {
            return false;
        }
        self.prepare(across);
        // SAFETY: the processor has just been asked.
        unsafe { self.pass(image, out) };
        true
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx512vnni")]
    fn pass(&mut self, image: ImageView<'_>, out: &mut [u8]) {
        let (wide, narrow) = self.of;
        let row = wide * image.channels().count();
        for (pixels, out) in image.pixels().chunks(row * ROWS).zip(out.chunks_mut(narrow * ROWS)) {
            // In the last block, rows of the one before take the place of missing ones.
            for (index, pixels) in pixels.chunks_exact(row).enumerate() {
                match image.channels() {
                    Channels::Grey => {
                        self.fill(index, pixels, |bytes: &[u8; BYTES]| ordered(bytes));
                    }
                    Channels::Rgb => {
                        self.fill(index, pixels, |bytes: &[u8; 3 * BYTES]| grey(bytes));
                    }
                }
            }
            for (lines, wide) in self.grey.iter().zip(self.wide.as_chunks_mut::<ROWS>().0) {
                let columns = turned(lines);
                for (column, group) in columns.iter().zip(GROUPS) {
                    store(&mut wide[group], *column);
                }
            }
            self.reduce();
            for (at, lines) in self.narrow.as_chunks::<ROWS>().0.iter().enumerate() {
                let rows = turned(lines);
                for (out, row) in out.chunks_exact_mut(narrow).zip(&rows) {
                    let out = &mut out[at * BYTES..];
                    let mut line = EMPTY;
                    store(&mut line, *row);
                    match out.first_chunk_mut() {
                        Some(out) => *out = line.0,
                        None => out.copy_from_slice(&line.0[..out.len()]),
                    }
                }
            }
        }
    }

    /// A row of `pixels`, `N` of its bytes a register.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
    fn fill<const N: usize>(
        &mut self,
        index: usize,
        pixels: &[u8],
        grey: impl Fn(&[u8; N]) -> __m512i,
    ) {
        let (whole, rest) = pixels.as_chunks::<N>();
        for (lines, pixels) in self.grey.iter_mut().zip(whole) {
            store(&mut lines[index], grey(pixels));
        }
        if !rest.is_empty() {
            let mut pixels = [0; N];
            pixels[..rest.len()].copy_from_slice(rest);
            store(&mut self.grey[whole.len()][index], grey(&pixels));
        }
    }

    /// Each column of the target from those of the source.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx512vnni")]
    fn reduce(&mut self) {
        let half = _mm512_set1_epi32(1 << (PRECISION - 1));
        let most = _mm512_set1_epi32(255);
        let firsts = self.firsts.as_chunks::<4>().0;
        let weights = self.weights.chunks_exact(4 * self.reach);
        for ((narrow, firsts), weights) in self.narrow.iter_mut().zip(firsts).zip(weights) {
            let mut sums = [half; 4];
            for (place, sum) in sums.iter_mut().enumerate() {
                let weights = &weights[place * self.reach..][..self.reach];
                let wide = &self.wide[firsts[place]..][..self.reach];
                let (mut low, mut middle, mut high) =
                    (half, _mm512_setzero_si512(), _mm512_setzero_si512());
                for (wide, weights) in wide.iter().zip(weights) {
                    let wide = fetch(wide);
                    low = _mm512_dpbusd_epi32(low, wide, four(weights[0]));
                    middle = _mm512_dpbusd_epi32(middle, wide, four(weights[1]));
                    high = _mm512_dpbusd_epi32(high, wide, four(weights[2]));
                }
                let (middle, high) =
                    (_mm512_slli_epi32::<8>(middle), _mm512_slli_epi32::<16>(high));
                let total = _mm512_add_epi32(low, _mm512_add_epi32(middle, high));
                *sum = _mm512_min_epi32(_mm512_srai_epi32::<PRECISION>(total), most);
            }
            let [a, b, c, d] = sums;
            let ab = _mm512_or_si512(a, _mm512_slli_epi32::<8>(b));
            let cd = _mm512_or_si512(_mm512_slli_epi32::<16>(c), _mm512_slli_epi32::<24>(d));
            store(narrow, _mm512_or_si512(ab, cd));
        }
    }
}

/// `low + 256 middle + 65536 high`.
fn digits(weight: i32) -> [i8; 3] {
    let low = weight as i8;
    let rest = (weight - i32::from(low)) >> 8;
    let middle = rest as i8;
    [low, middle, ((rest - i32::from(middle)) >> 8) as i8]
}

/// The same four bytes in every lane.
#[inline]
#[target_feature(enable = "avx512f")]
fn four(bytes: [i8; 4]) -> __m512i {
    _mm512_set1_epi32(bytemuck::must_cast(bytes))
}

/// 64 of the bytes, from `at`.
#[inline]
#[target_feature(enable = "avx512f")]
fn load<const N: usize>(bytes: &[u8; N], at: usize) -> __m512i {
    let bytes = &bytes[at..at + BYTES];
    // SAFETY: a slice of that many bytes.
    unsafe { _mm512_loadu_si512(bytes.as_ptr().cast()) }
}

#[inline]
#[target_feature(enable = "avx512f")]
fn fetch(line: &Line) -> __m512i {
    // SAFETY: a line is a register's bytes, aligned as one.
    unsafe { _mm512_load_si512(line.0.as_ptr().cast()) }
}

#[inline]
#[target_feature(enable = "avx512f")]
fn store(line: &mut Line, register: __m512i) {
    // SAFETY: a line is a register's bytes, aligned as one.
    unsafe { _mm512_store_si512(line.0.as_mut_ptr().cast(), register) }
}

/// A row's bytes with its groups of four in the order of `GROUPS`.
#[inline]
#[target_feature(enable = "avx512f")]
fn ordered(bytes: &[u8; BYTES]) -> __m512i {
    let order = _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15);
    _mm512_permutexvar_epi32(order, load(bytes, 0))
}

/// The brightness of 64 pixels, in groups of four in the order of `GROUPS`.
///
/// `(19595 R + 38470 G + 7471 B + 32768) >> 16` with the weights in bytes, green's in two halves:
/// `256 (77 R + 75 G + 29 B + 75 G) + (-117 R + 35 G + 47 B + 35 G)`.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
fn grey(rgb: &[u8; 3 * BYTES]) -> __m512i {
    let lanes = _mm512_setr_epi32(0, 1, 2, 0, 3, 4, 5, 0, 6, 7, 8, 0, 9, 10, 11, 0);
    let last = _mm512_setr_epi32(4, 5, 6, 4, 7, 8, 9, 4, 10, 11, 12, 4, 13, 14, 15, 4);
    let expand =
        _mm512_broadcast_i32x4(_mm_setr_epi8(0, 1, 2, 1, 3, 4, 5, 4, 6, 7, 8, 7, 9, 10, 11, 10));
    let high = _mm512_set1_epi32(i32::from_le_bytes([77, 75, 29, 75]));
    let low = _mm512_set1_epi32(i32::from_le_bytes([-117_i8 as u8, 35, 47, 35]));
    let half = _mm512_set1_epi32(128);
    let mut sums = [half; 4];
    for (part, sum) in sums.iter_mut().enumerate() {
        let bytes = if part < 3 {
            _mm512_permutexvar_epi32(lanes, load(rgb, 48 * part))
        } else {
            _mm512_permutexvar_epi32(last, load(rgb, 2 * BYTES))
        };
        let pixels = _mm512_shuffle_epi8(bytes, expand);
        let above = _mm512_slli_epi32::<8>(_mm512_dpbusd_epi32(half, pixels, high));
        *sum = _mm512_dpbusd_epi32(above, pixels, low);
    }
    // The third byte of each sum is the brightness: sixteen words of four pixels that are sixteen
    // apart.
    let [a, b, c, d] = sums;
    let ab = choose(0x0000_FF00, _mm512_srli_epi32::<8>(b), _mm512_srli_epi32::<16>(a));
    let abc = choose(0x00FF_0000, c, ab);
    let abcd = choose(-0x0100_0000, _mm512_slli_epi32::<8>(d), abc);
    // Four neighbours a word.
    let turn =
        _mm512_broadcast_i32x4(_mm_setr_epi8(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15));
    _mm512_shuffle_epi8(abcd, turn)
}

/// The bits of `one` that `mask` has, else those of `other`.
#[inline]
#[target_feature(enable = "avx512f")]
fn choose(mask: i32, one: __m512i, other: __m512i) -> __m512i {
    _mm512_ternarylogic_epi32::<0xCA>(_mm512_set1_epi32(mask), one, other)
}

/// Sixteen words of sixteen rows as columns.
#[inline]
#[target_feature(enable = "avx512f")]
fn turned(rows: &[Line; ROWS]) -> [__m512i; ROWS] {
    // Within quarters of a register: words 4 q + i of rows 4 p to 4 p + 3, in column (p, i),
    // quarter q.
    let mut quarters = [_mm512_setzero_si512(); ROWS];
    for part in 0..4 {
        let [a, b, c, d] = &rows.as_chunks::<4>().0[part];
        let (a, b, c, d) = (fetch(a), fetch(b), fetch(c), fetch(d));
        let (ab, cd) = (_mm512_unpacklo_epi32(a, b), _mm512_unpacklo_epi32(c, d));
        let (ab_high, cd_high) = (_mm512_unpackhi_epi32(a, b), _mm512_unpackhi_epi32(c, d));
        quarters[4 * part] = _mm512_unpacklo_epi64(ab, cd);
        quarters[4 * part + 1] = _mm512_unpackhi_epi64(ab, cd);
        quarters[4 * part + 2] = _mm512_unpacklo_epi64(ab_high, cd_high);
        quarters[4 * part + 3] = _mm512_unpackhi_epi64(ab_high, cd_high);
    }
    let mut columns = quarters;
    for word in 0..4 {
        let (a, b) = (quarters[word], quarters[word + 4]);
        let (c, d) = (quarters[word + 8], quarters[word + 12]);
        let (ab, cd) = (_mm512_shuffle_i32x4::<0x88>(a, b), _mm512_shuffle_i32x4::<0x88>(c, d));
        let (ab_odd, cd_odd) =
            (_mm512_shuffle_i32x4::<0xDD>(a, b), _mm512_shuffle_i32x4::<0xDD>(c, d));
        columns[word] = _mm512_shuffle_i32x4::<0x88>(ab, cd);
        columns[word + 4] = _mm512_shuffle_i32x4::<0x88>(ab_odd, cd_odd);
        columns[word + 8] = _mm512_shuffle_i32x4::<0xDD>(ab, cd);
        columns[word + 12] = _mm512_shuffle_i32x4::<0xDD>(ab_odd, cd_odd);
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_weight_is_the_sum_of_its_bytes() {
        for weight in 0..=1 << PRECISION {
            let [low, middle, high] = digits(weight).map(i32::from);
            assert_eq!(low + 256 * middle + 65_536 * high, weight);
        }
    }
}
