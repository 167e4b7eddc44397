//! Every kernel of every instruction set against naive sums: 10,000 cases each (`make test-long` has
//! 100,000).

use std::any::type_name;

use half::f16;

use super::every_way;
use crate::cases::cases;
use crate::distance::scan;
use crate::distance::term::{Differences, Products, Squares, Term};
use crate::random::SplitMix64;
use crate::simd::{Byte, Number};

/// Numbers that rows and queries are cut from, at any start.
const POOL: usize = 1 << 13;
const LENGTHS: usize = 258;

/// A type with pools of numbers that are hard in different ways.
trait Drawn: Copy {
    /// As f32, which is exact.
    fn single(self) -> f32;
    /// A number of one of four kinds: common ones, all there are, the smallest, the largest.
    fn draw(random: &mut SplitMix64, kind: usize) -> Self;
}

impl Drawn for f32 {
    fn single(self) -> f32 {
        self
    }
    fn draw(random: &mut SplitMix64, kind: usize) -> Self {
        let bits = random.next() as u32;
        let any = f32::from_bits(if bits >> 23 & 0xFF == 0xFF { bits ^ (1 << 30) } else { bits });
        match kind {
            0 => bits as f32 / 2_147_483_648.0 - 1.0,
            1 => any,
            2 => f32::from_bits(bits & 0x80FF_FFFF),
            _ => any.signum() * f32::MAX,
        }
    }
}

impl Drawn for f16 {
    fn single(self) -> f32 {
        self.into()
    }
    fn draw(random: &mut SplitMix64, kind: usize) -> Self {
        let bits = random.next() as u16;
        let any = f16::from_bits(if bits >> 10 & 0x1F == 0x1F { bits ^ (1 << 14) } else { bits });
        match kind {
            0 => f16::from_f32(f32::from(bits) / 32_768.0 - 1.0),
            1 => any,
            2 => f16::from_bits(bits & 0x83FF),
            _ => any.signum() * f16::MAX,
        }
    }
}

macro_rules! drawn_bytes {
    ($($byte:ty),*) => {$(
        impl Drawn for $byte {
            fn single(self) -> f32 {
                self.into()
            }
            fn draw(random: &mut SplitMix64, kind: usize) -> Self {
                let byte = random.next() as $byte;
                match kind {
                    0 | 1 => byte,
                    2 => byte % 3,
                    _ => if byte % 2 == 0 { <$byte>::MIN } else { <$byte>::MAX },
                }
            }
        }
    )*};
}
drawn_bytes!(i8, u8);

/// Numbers of 14 bits, as a screen's queries are.
impl Drawn for i16 {
    fn single(self) -> f32 {
        self.into()
    }
    fn draw(random: &mut SplitMix64, kind: usize) -> Self {
        let number = (random.next() % 16_383) as i16 - 8191;
        match kind {
            0 | 1 => number,
            2 => number % 2,
            _ => number.signum() * 8191,
        }
    }
}

fn pools<T: Drawn>(random: &mut SplitMix64, size: usize) -> [Vec<T>; 4] {
    [0, 1, 2, 3].map(|kind| (0..size).map(|_| T::draw(random, kind)).collect())
}

/// The sixteen sums of method 1.6, one number at a time.
fn in_lanes(terms: impl Iterator<Item = f64>) -> f64 {
    let mut lanes = [0.0; 16];
    terms.enumerate().for_each(|(i, term)| lanes[i % 16] += term);
    let eight: [f64; 8] = std::array::from_fn(|i| lanes[i] + lanes[i + 8]);
    let four: [f64; 4] = std::array::from_fn(|i| eight[i] + eight[i + 4]);
    (four[0] + four[2]) + (four[1] + four[3])
}

/// Neumaier's sum, which keeps what each addition rounds off, and the sum of the absolute terms.
fn compensated(terms: impl Iterator<Item = f64>) -> (f64, f64) {
    let (mut sum, mut lost, mut size) = (0.0_f64, 0.0, 0.0);
    for term in terms {
        let next = sum + term;
        lost += if sum.abs() >= term.abs() { (sum - next) + term } else { (term - next) + sum };
        sum = next;
        size += term.abs();
    }
    (sum + lost, size)
}

/// A term of floats: as method 1.6 rounds it, the true one, and by how much the two can differ, of
/// its size.
trait Rounded {
    fn rounded(a: f32, b: f32) -> f64;
    fn exact(a: f64, b: f64) -> f64;
    const OFF: f64;
}

impl Rounded for Differences {
    fn rounded(a: f32, b: f32) -> f64 {
        ((f64::from(a) - f64::from(b)) as f32).abs().into()
    }
    fn exact(a: f64, b: f64) -> f64 {
        (a - b).abs()
    }
    const OFF: f64 = 1.0 / (1 << 24) as f64;
}

impl Rounded for Squares {
    fn rounded(a: f32, b: f32) -> f64 {
        Differences::rounded(a, b).powi(2)
    }
    fn exact(a: f64, b: f64) -> f64 {
        (a - b).powi(2)
    }
    const OFF: f64 = 2.000_001 * Differences::OFF;
}

impl Rounded for Products {
    fn rounded(a: f32, b: f32) -> f64 {
        f64::from(a) * f64::from(b)
    }
    fn exact(a: f64, b: f64) -> f64 {
        a * b
    }
    const OFF: f64 = 0.0;
}

/// One query, `rows` rows: every instruction set gives the bits of the naive lanes, and those are
/// within the stated bound of the true sum.
fn check_floats<T: Term + Rounded, Q: Number + Drawn, R: Number + Drawn>(
    query: &[Q],
    values: &[R],
    rows: usize,
) {
    let dim = query.len();
    let expected: Vec<f64> = (0..rows)
        .map(|row| {
            let row = &values[row * dim..(row + 1) * dim];
            let pairs = || query.iter().zip(row).map(|(a, b)| (a.single(), b.single()));
            let sum = in_lanes(pairs().map(|(a, b)| T::rounded(a, b)));
            let (truth, size) = compensated(pairs().map(|(a, b)| T::exact(a.into(), b.into())));
            let bound = size * ((dim as f64 / 16.0 + 8.0) * f64::EPSILON / 2.0 + T::OFF);
            // A difference of more than float32 holds is infinite.
            let close = (sum - truth).abs() <= bound || sum == f64::INFINITY;
            assert!(close, "{} {dim}: {sum:e} {truth:e}", type_name::<(T, Q, R)>());
            sum
        })
        .collect();
    let mut out = vec![f64::NAN; rows];
    for how in every_way() {
        scan::floats::<T, Q, R, f64>(how, query, values, &mut out, |_, sum| sum);
        let same = out.iter().zip(&expected).all(|(a, b)| a.to_bits() == b.to_bits());
        assert!(same, "{how:?} {} {dim}: {out:?} {expected:?}", type_name::<(T, Q, R)>());
    }
}

fn check_bytes<T: Term, B: Byte>(query: &[B], values: &[B], rows: usize) {
    let dim = query.len();
    let term = |(&a, &b): (&B, &B)| i64::from(T::byte(a.into(), b.into()));
    let sum =
        |row: usize| query.iter().zip(&values[row * dim..(row + 1) * dim]).map(term).sum::<i64>();
    let expected: Vec<i64> = (0..rows).map(sum).collect();
    let mut out = vec![-1; rows];
    for how in every_way() {
        scan::bytes::<T, B, i64>(how, query, values, &mut out, |_, sum| sum);
        assert_eq!(out, expected, "{how:?} {} {dim}", type_name::<(T, B)>());
    }
}

fn check_shorts(query: &[i16], values: &[i8], rows: usize) {
    let dim = query.len();
    let sum = |row: usize| {
        let row = &values[row * dim..(row + 1) * dim];
        query.iter().zip(row).map(|(&a, &b)| i64::from(a) * i64::from(b)).sum::<i64>()
    };
    let expected: Vec<i64> = (0..rows).map(sum).collect();
    let mut out = vec![-1; rows];
    for how in every_way() {
        scan::shorts(how, query, values, &mut out, |_, sum| sum);
        assert_eq!(out, expected, "{how:?} {dim}");
    }
}

/// A query and rows, cut from pools: their kinds, starts, number and length are all drawn.
fn each_case<Q: Drawn, R: Drawn>(seed: u64, mut check: impl FnMut(&[Q], &[R], usize)) {
    let mut random = SplitMix64(seed);
    let (queries, values) = (pools::<Q>(&mut random, POOL), pools::<R>(&mut random, POOL));
    for case in 0..cases(10_000).cases as usize {
        let (dim, rows) = (case % LENGTHS, 1 + random.below(6));
        let (query, values) = (&queries[random.below(4)], &values[random.below(4)]);
        let (from, start) = (random.below(POOL - dim), random.below(POOL - rows * dim));
        check(&query[from..from + dim], &values[start..start + rows * dim], rows);
    }
}

macro_rules! kernels {
    ($($name:ident: $check:ident<$term:ty, $($number:ty),+>, $query:ty, $row:ty;)*) => {$(
        #[test]
        fn $name() {
            each_case::<$query, $row>(line!().into(), $check::<$term, $($number),+>);
        }
    )*};
}

kernels! {
    differences_of_u8: check_bytes<Differences, u8>, u8, u8;
    differences_of_i8: check_bytes<Differences, i8>, i8, i8;
    differences_of_f32: check_floats<Differences, f32, f32>, f32, f32;
    differences_of_f16: check_floats<Differences, f16, f16>, f16, f16;
    differences_of_f32_and_f16: check_floats<Differences, f32, f16>, f32, f16;
    differences_of_f32_and_i8: check_floats<Differences, f32, i8>, f32, i8;
    differences_of_f32_and_u8: check_floats<Differences, f32, u8>, f32, u8;
    squares_of_u8: check_bytes<Squares, u8>, u8, u8;
    squares_of_i8: check_bytes<Squares, i8>, i8, i8;
    squares_of_f32: check_floats<Squares, f32, f32>, f32, f32;
    squares_of_f16: check_floats<Squares, f16, f16>, f16, f16;
    squares_of_f32_and_f16: check_floats<Squares, f32, f16>, f32, f16;
    squares_of_f32_and_i8: check_floats<Squares, f32, i8>, f32, i8;
    squares_of_f32_and_u8: check_floats<Squares, f32, u8>, f32, u8;
    products_of_u8: check_bytes<Products, u8>, u8, u8;
    products_of_i8: check_bytes<Products, i8>, i8, i8;
    products_of_f32: check_floats<Products, f32, f32>, f32, f32;
    products_of_f16: check_floats<Products, f16, f16>, f16, f16;
    products_of_f32_and_f16: check_floats<Products, f32, f16>, f32, f16;
    products_of_f32_and_i8: check_floats<Products, f32, i8>, f32, i8;
    products_of_f32_and_u8: check_floats<Products, f32, u8>, f32, u8;
}

#[test]
fn products_of_14_bits_and_i8() {
    each_case::<i16, i8>(1, check_shorts);
}

/// Beyond where 32-bit sums are emptied, with the numbers that fill them fastest.
#[test]
fn long_rows_overflow_nothing() {
    let mut random = SplitMix64(7);
    for dim in [2048, 4096, 65_535, 65_536, 65_600, 100_003, 131_136] {
        for kind in [0, 3] {
            let mut bytes = pools::<u8>(&mut random, 3 * dim + 1).into_iter().nth(kind).unwrap();
            let mut signed = pools::<i8>(&mut random, 3 * dim + 1).into_iter().nth(kind).unwrap();
            if kind == 3 {
                // Two rows as far from the query as can be, and one that it multiplies to the most.
                bytes[..=dim].fill(255);
                bytes[dim + 1..=2 * dim].fill(0);
                bytes[2 * dim + 1..].fill(255);
                signed[..=dim].fill(-128);
                signed[dim + 1..=2 * dim].fill(127);
                signed[2 * dim + 1..].fill(-128);
            }
            let (query, rows) = bytes[1..].split_at(dim);
            check_bytes::<Differences, u8>(query, rows, 2);
            check_bytes::<Squares, u8>(query, rows, 2);
            check_bytes::<Products, u8>(query, rows, 2);
            let (query, rows) = signed[1..].split_at(dim);
            check_bytes::<Differences, i8>(query, rows, 2);
            check_bytes::<Squares, i8>(query, rows, 2);
            check_bytes::<Products, i8>(query, rows, 2);
        }
        for sign in [1, -1] {
            check_shorts(
                &vec![8191; dim],
                &vec![-128 * sign.max(0) + 127 * (-sign).max(0); 2 * dim],
                2,
            );
            let query: Vec<i16> = (0..dim).map(|_| i16::draw(&mut random, 3)).collect();
            let row: Vec<i8> = query.iter().map(|q| q.signum() as i8 * 127 * sign).collect();
            check_shorts(&query, &row, 1);
        }
        let floats = pools::<f32>(&mut random, 3 * dim + 1);
        for kind in floats {
            let (query, rows) = kind[1..].split_at(dim);
            check_floats::<Differences, f32, f32>(query, rows, 2);
            check_floats::<Squares, f32, f32>(query, rows, 2);
            check_floats::<Products, f32, f32>(query, rows, 2);
        }
    }
}

/// The cosine's fused products rest on this.
#[test]
fn the_product_of_two_f32_is_exact_in_f64() {
    let mut random = SplitMix64(3);
    for _ in 0..100_000 {
        let [a, b, sum] = [(); 3].map(|()| f64::from(f32::draw(&mut random, 1)));
        assert_eq!(a.mul_add(b, sum).to_bits(), (a * b + sum).to_bits(), "{a:e} {b:e} {sum:e}");
    }
}
