//! A batch gives the stream's fixes, bit for bit, whatever the memory layout and however it is cut
//! into pieces.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::cases::{
    Bits, DTYPES, Kind, Told, all_bits, cases, columns, given, kind, known, least_of_all, numbers,
    route, stream,
};
use ndarray::{Array2, ArrayView2, ShapeBuilder, s};
use proptest::prelude::*;
use proptest::sample::select;
use surefix::{
    Config, Drive, Error, Fix, Floor, Localizer, Map, Metric, Values, match_descriptors,
    match_distances,
};

#[expect(clippy::needless_pass_by_value, reason = "a view is a borrow already")]
fn batch(distances: ArrayView2<'_, f32>, config: &Config, drive: Drive<'_>) -> Vec<Bits> {
    all_bits(&match_distances(distances, config, drive).unwrap().fixes)
}

fn matrix(columns: &[Vec<f32>]) -> Array2<f32> {
    Array2::from_shape_fn((columns[0].len(), columns.len()), |(i, j)| columns[j][i])
}

/// The same matrix, element by element, in four layouts of memory.
fn in_every_layout(matrix: &Array2<f32>, mut visit: impl FnMut(&str, ArrayView2<'_, f32>)) {
    let (n, m) = matrix.dim();
    visit("C order", matrix.view());
    let mut fortran = Array2::zeros((n, m).f());
    fortran.assign(matrix);
    visit("Fortran order", fortran.view());
    let mut wide = Array2::from_elem((2 * n + 1, 3 * m + 2), f32::NAN);
    wide.slice_mut(s![1..;2, ..3 * m;3]).assign(matrix);
    visit("strided", wide.slice(s![1..;2, ..3 * m;3]));
    let mut turned = Array2::zeros((n, m));
    turned.slice_mut(s![..;-1, ..;-1]).assign(matrix);
    visit("both axes reversed", turned.slice(s![..;-1, ..;-1]));
}

proptest! {
    #![proptest_config(cases(2_000))]

    #[test]
    fn every_layout_gives_the_streams_fixes(
        (n, config) in route(2..64), m in 1..200_usize, kind in kind(), seed: u64,
        external: bool, odometry: bool,
    ) {
        let d = columns(kind, n, m, seed);
        let told = Told::new(m, seed, external, odometry);
        let expected = all_bits(&stream(n, &config, &d, told.drive()));
        in_every_layout(&matrix(&d), |layout, view| assert_eq!(batch(view, &config, told.drive()), expected, "{layout}"));
    }

    #[test]
    fn the_global_floor_is_the_matrix_minimum_given_beforehand(
        (n, config) in route(2..64), m in 1..200_usize, kind in kind(), seed: u64,
    ) {
        let d = columns(kind, n, m, seed);
        let fixed = config! { config.clone() => floor: least_of_all(&d) };
        let global = config! { config => floor: Floor::Global };
        prop_assert_eq!(batch(matrix(&d).view(), &global, Drive::default()), all_bits(&stream(n, &fixed, &d, Drive::default())));
    }
}

proptest! {
    #![proptest_config(cases(150))]

    /// Long runs are cut into pieces, each with a lead-in: long windows and long smoothing must
    /// reach across.
    #[test]
    fn pieces_do_not_show(
        (n, config) in route(2..40), length in 1..40_usize, smoothing in 1..30_usize,
        m in 600..2600_usize, kind in kind(), seed: u64,
        external: bool, odometry: bool,
    ) {
        let config = config! { config => sequence_length: length.min(n), smoothing, speeds: vec![1.0, 0.5] };
        let d = columns(kind, n, m, seed);
        let told = Told::new(m, seed, external, odometry);
        prop_assert_eq!(batch(matrix(&d).view(), &config, told.drive()), all_bits(&stream(n, &config, &d, told.drive())));
    }

    #[test]
    fn descriptors_in_a_batch_give_the_localizers_fixes(
        (n, config) in route(2..30), m in 1..600_usize, dim in 1..20_usize,
        dtype in select(DTYPES.to_vec()), floats: bool,
        metric in select(vec![Metric::Manhattan, Metric::Euclidean, Metric::Cosine]),
        seed: u64,
        external: bool, odometry: bool,
    ) {
        let map = Arc::new(Map::from_descriptors(numbers(dtype, n * dim, seed), dim, metric)?);
        let queries = numbers(if floats { surefix::Dtype::F32 } else { dtype }, m * dim, !seed);
        let told = Told::new(m, seed, external, odometry);
        let alone = |config: &Config| -> Result<Vec<Fix>, Error> {
            let mut localizer = Localizer::new(Arc::clone(&map), config.clone())?;
            let row = |j| queries.view().row(j, dim).unwrap();
            (0..m).map(|j| localizer.push_descriptor_with(row(j), given(told.drive(), j))).collect()
        };
        let together = |config: &Config| match_descriptors(&map, &queries, config, told.drive(), &mut |_, _| ControlFlow::Continue(()));
        prop_assert_eq!(all_bits(&together(&config)?.fixes), all_bits(&alone(&config)?));

        let distances = |j| map.distances(queries.view().row(j, dim).unwrap());
        let columns: Vec<Vec<f32>> = (0..m).map(distances).collect::<Result<_, _>>()?;
        let global = config! { config.clone() => floor: Floor::Global };
        let fixed = config! { config => floor: least_of_all(&columns) };
        let got = all_bits(&together(&global)?.fixes);
        prop_assert_eq!(&got, &all_bits(&alone(&fixed)?));
        prop_assert_eq!(&got, &batch(matrix(&columns).view(), &global, told.drive()));
    }
}

#[test]
fn a_run_without_queries_is_empty() {
    let nothing = Array2::<f32>::zeros((5, 0));
    let map =
        Map::from_descriptors(numbers(surefix::Dtype::U8, 10, 1), 2, Metric::Manhattan).unwrap();
    for floor in [Floor::Running, Floor::Fixed(0.0), Floor::Global] {
        let config = config! { floor };
        assert!(
            match_distances(nothing.view(), &config, Drive::default()).unwrap().fixes.is_empty()
        );
        let none = Values::U8(Vec::new());
        let run = match_descriptors(&map, &none, &config, known(Some(&[]), &[]), &mut |_, _| {
            ControlFlow::Continue(())
        });
        let run = run.unwrap();
        assert_eq!((run.places(), run.fixes), (5, Vec::new()));
    }
}

#[test]
fn what_is_not_finite_is_named_by_query_and_place() {
    for (query, place, value) in
        [(0, 0, f32::NAN), (150, 7, f32::INFINITY), (299, 19, f32::NEG_INFINITY)]
    {
        let mut d = matrix(&columns(Kind::Smooth, 20, 300, 1));
        d[[place, query]] = value;
        // A later one must not be named instead, in whatever piece it lies.
        d[[0, 299]] = if query == 299 { 0.5 } else { f32::NAN };
        in_every_layout(&d, |layout, view| {
            match match_distances(view, &Config::default(), Drive::default()) {
                Err(error @ Error::NotFinite { row: Some(row), index, .. }) => {
                    assert_eq!((row, index), (query, place), "{layout}");
                    assert!(
                        error.to_string().contains(&format!("row {query}, index {place}")),
                        "{error}"
                    );
                }
                other => panic!("{layout}: {other:?}"),
            }
        });
    }
    let map =
        Map::from_descriptors(numbers(surefix::Dtype::F32, 30, 1), 3, Metric::Cosine).unwrap();
    let mut queries = vec![0.5_f32; 300];
    queries[3 * 42 + 1] = f32::NAN;
    let refused = match_descriptors(
        &map,
        &Values::F32(queries),
        &Config::default(),
        Drive::default(),
        &mut |_, _| ControlFlow::Continue(()),
    )
    .unwrap_err();
    assert!(matches!(refused, Error::NotFinite { row: Some(42), index: 1, .. }), "{refused}");
}

#[test]
fn a_query_of_zeros_under_the_cosine_is_named_by_its_row() {
    let map =
        Map::from_descriptors(numbers(surefix::Dtype::F32, 30, 1), 3, Metric::Cosine).unwrap();
    let mut queries = vec![0.5_f32; 300];
    queries[3 * 42..3 * 43].fill(0.0);
    let refused = match_descriptors(
        &map,
        &Values::F32(queries),
        &Config::default(),
        Drive::default(),
        &mut |_, _| ControlFlow::Continue(()),
    )
    .unwrap_err();
    assert!(matches!(refused, Error::NoDirection { row: Some(42), .. }), "{refused}");
}

#[test]
fn a_word_too_few_or_too_many_is_refused() {
    let d = Array2::<f32>::zeros((5, 4));
    let map =
        Map::from_descriptors(numbers(surefix::Dtype::U8, 10, 1), 2, Metric::Manhattan).unwrap();
    let queries = numbers(surefix::Dtype::U8, 8, 2);
    for count in [0, 3, 5] {
        let words = vec![true; count];
        let refusals = [
            match_distances(d.view(), &Config::default(), known(Some(&words), &[])),
            match_descriptors(
                &map,
                &queries,
                &Config::default(),
                known(Some(&words), &[]),
                &mut |_, _| ControlFlow::Continue(()),
            ),
        ];
        for refused in refusals {
            let message = refused.unwrap_err().to_string();
            assert_eq!(message, format!("trusted: expected 4 values, got {count}"));
        }
    }
}

#[test]
fn the_csv_has_a_line_a_query_and_reads_back() {
    let d = columns(Kind::Smooth, 12, 9, 5);
    let run = match_distances(matrix(&d).view(), &config! { sequence_length: 3 }, Drive::default())
        .unwrap();
    let mut out = Vec::new();
    run.write_csv(&mut out).unwrap();
    let text = String::from_utf8(out).unwrap();
    let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(lines.len(), 1 + run.fixes.len());
    for (line, fix) in lines[1..].iter().zip(&run.fixes) {
        let field = |name: &str| line[lines[0].iter().position(|n| *n == name).unwrap()];
        assert_eq!(field("frame").parse(), Ok(fix.frame));
        assert_eq!(field("place").parse(), Ok(fix.place));
        assert_eq!(
            field("score").parse(),
            Ok(fix.score),
            "a score survives the text to the last bit"
        );
        assert_eq!(field("trusted").parse(), Ok(fix.trusted));
        assert_eq!(field("ready").parse(), Ok(fix.sequence.is_some()));
        assert_eq!(field("anchors").parse().ok(), fix.sequence.map(|s| s.anchors));
        assert_eq!(field("speed").parse().ok(), fix.sequence.map(|s| s.speed));
        assert_eq!(field("gradient_value").parse(), Ok(fix.gradient.value));
    }
}
