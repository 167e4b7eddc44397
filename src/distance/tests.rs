//! Every metric on every pair of types against a line of f64, over all lengths around the block
//! sizes.

mod kernels;

use half::f16;
use proptest::prelude::*;
use proptest::sample::select;

use super::{Metric, Query, Rows, Tuning, distances, norm};
use crate::cases::cases;
use crate::dtype::Dtype;
use crate::error::Error;
use crate::numbers::{Values, View};
use crate::random::SplitMix64;
use crate::simd::Isa;

const METRICS: [Metric; 3] = [Metric::Manhattan, Metric::Euclidean, Metric::Cosine];
const DTYPES: [Dtype; 4] = [Dtype::F32, Dtype::F16, Dtype::I8, Dtype::U8];
const ROWS: usize = 3;

/// The types of query and rows that may be compared: float32, or the rows' own.
fn pairs() -> impl Iterator<Item = (Dtype, Dtype)> {
    DTYPES.into_iter().flat_map(|rows| {
        let own = (rows != Dtype::F32).then_some((rows, rows));
        [Some((Dtype::F32, rows)), own].into_iter().flatten()
    })
}

/// `count` numbers of a type from a seed, over its whole range (floats: of mixed sizes).
fn numbers(dtype: Dtype, count: usize, seed: u64) -> Values {
    let mut random = SplitMix64(seed);
    let mut draw = || random.next() >> 40;
    let mut float = || (draw() as f32 / 8_388_608.0 - 1.0) * [1.0, 1e-3, 30.0][draw() as usize % 3];
    match dtype {
        Dtype::F32 => Values::F32((0..count).map(|_| float()).collect()),
        Dtype::F16 => Values::F16((0..count).map(|_| f16::from_f32(float())).collect()),
        Dtype::I8 => Values::I8((0..count).map(|_| draw() as i8).collect()),
        Dtype::U8 => Values::U8((0..count).map(|_| draw() as u8).collect()),
    }
}

fn wide(numbers: View<'_>) -> Vec<f64> {
    match numbers {
        View::F32(v) => v.iter().map(|&x| f64::from(x)).collect(),
        View::F16(v) => v.iter().map(|&x| f64::from(x)).collect(),
        View::I8(v) => v.iter().map(|&x| f64::from(x)).collect(),
        View::U8(v) => v.iter().map(|&x| f64::from(x)).collect(),
    }
}

fn naive(metric: Metric, a: &[f64], b: &[f64], unit: f64) -> f64 {
    let sum = |term: fn(f64, f64) -> f64| a.iter().zip(b).map(|(&a, &b)| term(a, b)).sum::<f64>();
    match metric {
        Metric::Manhattan => sum(|a, b| (a - b).abs()) / a.len() as f64 / unit,
        Metric::Euclidean => sum(|a, b| (a - b).powi(2)).sqrt() / unit,
        Metric::Cosine => 1.0 - sum(|a, b| a * b) / (sum(|a, _| a * a) * sum(|_, b| b * b)).sqrt(),
    }
}

/// The same numbers from the second one on: memory that is aligned to no more than one number.
fn unaligned(values: &Values) -> View<'_> {
    match values {
        Values::F32(v) => View::F32(&v[1..]),
        Values::F16(v) => View::F16(&v[1..]),
        Values::I8(v) => View::I8(&v[1..]),
        Values::U8(v) => View::U8(&v[1..]),
    }
}

fn run(metric: Metric, query: View<'_>, values: View<'_>, unit: f64) -> Result<Vec<f32>, Error> {
    let dim = query.len();
    let norms: Vec<f64> = match metric {
        Metric::Cosine => {
            (0..values.len() / dim).map(|i| norm(values.row(i, dim).unwrap())).collect()
        }
        _ => Vec::new(),
    };
    let on = |isa, tuning| {
        let mut out = vec![f32::NAN; values.len() / dim];
        let rows = Rows { values, dim, metric, unit, norms: &norms, isa, tuning };
        distances(Query::new(query, rows)?, rows, &mut out);
        Ok(out)
    };
    let plain = on(Isa::Scalar, Tuning::of(0));
    for (isa, tuning) in every_way() {
        // Every bit: one unit off would be another answer on that machine.
        match (&plain, on(isa, tuning)) {
            (Ok(plain), Ok(out)) => assert_eq!(bits(plain), bits(&out), "{isa}"),
            (plain, out) => assert_eq!(format!("{plain:?}"), format!("{out:?}"), "{isa}"),
        }
    }
    plain
}

/// Each instruction set of this processor, with each order of reading.
fn every_way() -> impl Iterator<Item = (Isa, Tuning)> {
    Isa::available().flat_map(|isa| Tuning::all().map(move |tuning| (isa, tuning)))
}

fn bits(numbers: &[f32]) -> Vec<u32> {
    numbers.iter().map(|x| x.to_bits()).collect()
}

/// Within two units in the last place of the f64 result; the cosine loses what `1 - x` loses in
/// f64.
fn close(got: f32, expected: f64, metric: Metric) -> bool {
    let rounded = expected as f32;
    let (below, above) = match metric {
        Metric::Cosine => (rounded.next_down(), rounded.next_up()),
        _ => (rounded.next_down().next_down(), rounded.next_up().next_up()),
    };
    let (below, above) = (f64::from(below), f64::from(above));
    let slack = if metric == Metric::Cosine { 1e-14 } else { 0.0 };
    (below - slack..=above + slack).contains(&f64::from(got))
}

fn compare(metric: Metric, (query, rows): (Dtype, Dtype), dim: usize, seed: u64, unit: f64) {
    let (query, rows) = (numbers(query, dim + 1, seed), numbers(rows, ROWS * dim + 1, !seed));
    let (query, rows) = (unaligned(&query), unaligned(&rows));
    if metric == Metric::Cosine && norm(query) == 0.0 {
        return;
    }
    let got = run(metric, query, rows, unit).unwrap();
    for (index, got) in got.into_iter().enumerate() {
        let row = rows.row(index, dim).unwrap();
        if metric == Metric::Cosine && norm(row) == 0.0 {
            continue; // A map refuses such a row.
        }
        let expected = naive(metric, &wide(query), &wide(row), unit);
        let whole = matches!(query, View::I8(_) | View::U8(_));
        let about = format!(
            "{metric} {} to {}, {dim} numbers: {got} for {expected}",
            query.dtype(),
            rows.dtype()
        );
        if whole && metric != Metric::Cosine {
            // Whole numbers add without loss in f64 too: one rounding in the end.
            assert_eq!(got, expected as f32, "{about}");
        } else {
            assert!(close(got, expected, metric), "{about}");
        }
    }
}

#[test]
fn every_length_around_the_blocks() {
    let lengths = (1..=257).chain([511, 512, 513, 1000, 16_383, 16_384, 16_385, 32_768, 40_001]);
    for dim in lengths {
        for (metric, pair) in
            METRICS.into_iter().flat_map(|metric| pairs().map(move |pair| (metric, pair)))
        {
            compare(metric, pair, dim, dim as u64, 1.0);
        }
    }
}

proptest! {
    #![proptest_config(cases(10_000))]

    #[test]
    fn every_metric_is_its_formula(
        metric in select(METRICS.to_vec()), pair in select(pairs().collect::<Vec<_>>()),
        dim in 1..300_usize, seed: u64, unit in select(vec![1.0, 32.0]),
    ) {
        compare(metric, pair, dim, seed, unit);
    }
}

#[test]
fn the_extremes_of_bytes_do_not_overflow() {
    for dim in [16_384, 16_385, 100_000] {
        let far = 255.0 * (dim as f64).sqrt();
        let (low, high) = (Values::U8(vec![0; dim]), Values::U8(vec![255; dim]));
        assert_eq!(run(Metric::Manhattan, low.view(), high.view(), 1.0).unwrap(), [255.0]);
        assert_eq!(run(Metric::Euclidean, low.view(), high.view(), 1.0).unwrap(), [far as f32]);
        assert!(run(Metric::Cosine, high.view(), high.view(), 1.0).unwrap()[0] < 1e-15);
        let (low, high) = (Values::I8(vec![-128; dim]), Values::I8(vec![127; dim]));
        assert_eq!(run(Metric::Manhattan, low.view(), high.view(), 1.0).unwrap(), [255.0]);
        assert_eq!(run(Metric::Euclidean, low.view(), high.view(), 1.0).unwrap(), [far as f32]);
        assert_eq!(run(Metric::Cosine, low.view(), high.view(), 1.0).unwrap(), [2.0]);
        assert!(run(Metric::Cosine, low.view(), low.view(), 1.0).unwrap()[0] < 1e-15);
    }
}

#[test]
fn nothing_is_nearer_than_itself() {
    for dtype in DTYPES {
        for dim in [1, 7, 8, 9, 255, 256, 257, 2048] {
            let same = numbers(dtype, dim, 5);
            for metric in [Metric::Manhattan, Metric::Euclidean] {
                assert_eq!(
                    run(metric, same.view(), same.view(), 1.0).unwrap(),
                    [0.0],
                    "{metric} {dtype} {dim}"
                );
            }
            let cosine = run(Metric::Cosine, same.view(), same.view(), 1.0).unwrap()[0];
            assert!((0.0..=1e-7).contains(&cosine), "{dtype} {dim}: {cosine}");
        }
    }
}

/// The reason for direct differences (method 1.6): two numbers that agree in six digits of seven.
#[test]
fn near_zero_no_digit_is_lost() {
    let a = vec![1000.0_f32; 128];
    let b = vec![1000.0_f32.next_up(); 128];
    let apart = f64::from(b[0]) - 1000.0;
    assert_eq!(run(Metric::Manhattan, View::F32(&a), View::F32(&b), 1.0).unwrap(), [apart as f32]);
    let expected = (128.0_f64.sqrt() * apart) as f32;
    assert_eq!(run(Metric::Euclidean, View::F32(&a), View::F32(&b), 1.0).unwrap(), [expected]);
}

#[test]
fn types_that_do_not_compare_are_refused() {
    for query in DTYPES {
        for rows in DTYPES.into_iter().filter(|&rows| !pairs().any(|pair| pair == (query, rows))) {
            for metric in METRICS {
                let (q, r) = (numbers(query, 4, 1), numbers(rows, 8, 2));
                match run(metric, q.view(), r.view(), 1.0) {
                    Err(Error::Dtype { map, got, .. }) => assert_eq!((map, got), (rows, query)),
                    other => panic!("{query} to {rows}: {other:?}"),
                }
            }
        }
    }
}

#[test]
fn what_is_not_finite_is_found_wherever_it_stands() {
    let rows = Values::F32(vec![1.0; 2 * 2100]);
    for at in [0, 1, 255, 256, 1023, 1024, 1025, 2047, 2048, 2099] {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut query = vec![0.5_f32; 2100];
            query[at] = bad;
            query[2099] = if at == 2099 { bad } else { f32::NAN };
            let refused = run(Metric::Cosine, View::F32(&query), rows.view(), 1.0).unwrap_err();
            match refused {
                Error::NotFinite { row: None, index, value, .. } => {
                    assert_eq!((index, value.to_bits()), (at, bad.to_bits()));
                }
                other => panic!("{other}"),
            }
            let halves: Vec<f16> = query.iter().map(|&x| f16::from_f32(x)).collect();
            let refused = View::F16(&halves).check_finite("rows", 100).unwrap_err();
            let Error::NotFinite { row, index, .. } = refused else { panic!("{refused}") };
            assert_eq!((row, index), (Some(at / 100), at % 100));
        }
    }
}

#[test]
fn zeros_have_no_direction() {
    for dtype in DTYPES {
        let (zeros, rows) = (Values::zeros(dtype, 5), numbers(dtype, 10, 1));
        let refused = run(Metric::Cosine, zeros.view(), rows.view(), 1.0).unwrap_err();
        assert!(matches!(refused, Error::NoDirection { row: None, .. }), "{refused}");
        assert!(run(Metric::Euclidean, zeros.view(), rows.view(), 1.0).is_ok());
    }
}
