//! A gap breaks the diagonal and nothing else: later fixes depend on earlier queries by the floor
//! alone.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::cases::{all_bits, bits, cases, columns, kind, known, least_of_all, numbers, route};
use crate::random::SplitMix64;
use ndarray::Array2;
use proptest::prelude::*;
use proptest::sample::select;
use surefix::{
    Config, Dtype, Error, Fix, Floor, Given, Localizer, Map, Matcher, Metric, match_descriptors,
    match_distances,
};

/// Some of the queries, in no order and some of them twice: few, or many in a row.
fn gaps(queries: usize, seed: u64) -> Vec<usize> {
    let mut dice = SplitMix64(seed ^ 0x9a9);
    let one_in = [2, 5, 20, 60, 1000][dice.below(5)];
    let mut gaps: Vec<usize> = (0..queries).filter(|_| dice.below(one_in) == 0).collect();
    for at in 1..gaps.len() {
        gaps.swap(at, dice.below(at + 1));
    }
    gaps.extend_from_within(..gaps.len() / 3);
    gaps
}

/// A predictor's word, where there is one for this query.
type Words = Vec<Option<bool>>;

fn words(queries: usize, seed: u64) -> Words {
    let mut dice = SplitMix64(seed ^ 0xabc);
    (0..queries).map(|_| [None, None, Some(true), Some(false)][dice.below(4)]).collect()
}

fn push(matcher: &mut Matcher, column: &[f32], word: Option<bool>) -> Fix {
    match word {
        Some(trusted) => matcher.push_with(column, Given::default().trusted(trusted)).unwrap(),
        None => matcher.push(column).unwrap(),
    }
}

/// The stream, with one gap or several before some queries.
fn stream(
    places: usize,
    config: &Config,
    columns: &[Vec<f32>],
    words: &Words,
    gaps: &[usize],
) -> Vec<Fix> {
    let mut matcher = Matcher::new(places, config.clone()).unwrap();
    let each = columns.iter().zip(words).enumerate().map(|(query, (column, &word))| {
        for _ in gaps.iter().filter(|&&gap| gap == query) {
            matcher.gap();
        }
        push(&mut matcher, column, word)
    });
    each.collect()
}

fn matrix(columns: &[Vec<f32>]) -> Array2<f32> {
    Array2::from_shape_fn((columns[0].len(), columns.len()), |(i, j)| columns[j][i])
}

proptest! {
    #![proptest_config(cases(3_000))]

    /// What a query's gradient and trust are after a gap, a matcher that begins there says; what
    /// its sequence is, one that never heard of the gap says as soon as its window no longer
    /// reaches across. The floor is that of all queries.
    #[test]
    fn after_a_gap_it_begins_anew_and_then_goes_on(
        (n, config) in route(2..120), m in 1..260_usize, kind in kind(), seed: u64,
    ) {
        // A track depends on all queries before, by what it knows of the places.
        let config = config! { config => motion: None };
        let (d, words, gaps) = (columns(kind, n, m, seed), words(m, seed), gaps(m, seed));
        let got = stream(n, &config, &d, &words, &gaps);
        // The words of the run itself, so that a trust that the gap has changed does not tell in
        // later sequences.
        let trust: Words = got.iter().map(|fix| Some(fix.trusted)).collect();
        let unbroken = stream(n, &config, &d, &trust, &[]);
        let mut begun = 0;
        let mut anew = Matcher::new(n, config.clone())?;
        for (query, fix) in got.iter().enumerate() {
            if gaps.contains(&query) {
                begun = query;
                anew = Matcher::new(n, config.clone())?;
            }
            let (alone, whole) = (push(&mut anew, &d[query], words[query]), &unbroken[query]);
            prop_assert_eq!(fix.frame, query as u64);
            prop_assert_eq!((fix.single, fix.trusted), (alone.single, alone.trusted));
            prop_assert_eq!(fix.gradient.place, alone.gradient.place);
            prop_assert_eq!(fix.gradient.value.to_bits(), alone.gradient.value.to_bits());
            prop_assert_eq!(fix.sequence.is_some(), query + 1 >= begun + config.sequence_length);
            if fix.sequence.is_some() {
                let mut fix = *fix;
                fix.gradient = whole.gradient;
                prop_assert_eq!(bits(&fix), bits(whole), "query {}", query);
            } else {
                prop_assert_eq!((fix.place, fix.score.to_bits()), (fix.single.place, fix.single.distance.to_bits()));
            }
        }
    }

    /// Cuts anywhere, within the warm-up after a gap and right at one too.
    #[test]
    fn a_snapshot_remembers_the_gap(
        (n, config) in route(2..60), cut in 0..80_usize, more in 1..60_usize, kind in kind(), seed: u64, at_the_cut: bool,
    ) {
        let (d, gaps) = (columns(kind, n, cut + more, seed), gaps(cut + more, seed));
        let mut whole = Matcher::new(n, config.clone())?;
        let gap = |matcher: &mut Matcher, query: usize| {
            if query.is_multiple_of(3) {
                matcher.gap_with_advance(query as f64 / 4.0).unwrap();
            } else {
                matcher.gap();
            }
        };
        for (query, column) in d[..cut].iter().enumerate() {
            if gaps.contains(&query) {
                gap(&mut whole, query);
            }
            whole.push(column)?;
        }
        if at_the_cut {
            gap(&mut whole, cut);
        }
        let blob = whole.snapshot()?;
        let mut restored = Matcher::restore(&blob, Some(&config))?;
        prop_assert_eq!(&restored.snapshot()?, &blob);
        prop_assert_eq!(restored.frames(), cut as u64);
        for (query, column) in d.iter().enumerate().skip(cut) {
            if gaps.contains(&query) {
                gap(&mut whole, query);
                gap(&mut restored, query);
            }
            prop_assert_eq!(bits(&restored.push(column)?), bits(&whole.push(column)?));
            prop_assert_eq!(restored.snapshot()?, whole.snapshot()?);
        }
    }
}

proptest! {
    #![proptest_config(cases(300))]

    /// Batches that are cut into pieces, with gaps in the pieces, between them and in their
    /// lead-ins.
    #[test]
    fn a_batch_gives_the_streams_fixes(
        (n, config) in route(2..120), m in prop_oneof![1..200_usize, 600..1600_usize], kind in kind(), seed: u64,
        external: bool,
    ) {
        let (d, gaps) = (columns(kind, n, m, seed), gaps(m, seed));
        let trusted: Option<Vec<bool>> =
            external.then(|| words(m, seed).into_iter().map(|word| word == Some(true)).collect());
        let words = trusted.as_ref().map_or(vec![None; m], |t| t.iter().copied().map(Some).collect());
        let least = least_of_all(&d);
        for floor in [config.floor, Floor::Global] {
            let live = if floor == Floor::Global { least } else { floor };
            let expected = stream(n, &config! { config.clone() => floor: live }, &d, &words, &gaps);
            let config = config! { config.clone() => floor };
            let run = match_distances(matrix(&d).view(), &config, known(trusted.as_deref(), &gaps))?;
            prop_assert_eq!(all_bits(&run.fixes), all_bits(&expected));
        }
    }

    #[test]
    fn descriptors_in_a_batch_give_the_localizers_fixes(
        (n, config) in route(2..30), m in 1..300_usize, dim in 1..20_usize, seed: u64, global: bool,
    ) {
        let map = Arc::new(Map::from_descriptors(numbers(Dtype::F32, n * dim, seed), dim, Metric::Euclidean)?);
        let (queries, gaps) = (numbers(Dtype::F32, m * dim, !seed), gaps(m, seed));
        let row = |j| queries.view().row(j, dim).unwrap();
        let distances = (0..m).map(|j| map.distances(row(j))).collect::<Result<Vec<_>, _>>()?;
        let least = least_of_all(&distances);
        let [live, whole] = if global { [least, Floor::Global] } else { [config.floor; 2] };
        let mut localizer = Localizer::new(Arc::clone(&map), config! { config.clone() => floor: live })?;
        let mut expected = Vec::new();
        for (query, distances) in distances.iter().enumerate() {
            if gaps.contains(&query) {
                localizer.gap();
                prop_assert!(localizer.distances().iter().all(|&d| d == 0.0));
            }
            expected.push(localizer.push_descriptor(row(query))?);
            prop_assert_eq!(localizer.distances(), distances.as_slice());
        }
        let config = config! { config => floor: whole };
        let run = match_descriptors(&map, &queries, &config, known(None, &gaps), &mut |_, _| ControlFlow::Continue(()))?;
        prop_assert_eq!(all_bits(&run.fixes), all_bits(&expected));
    }
}

/// Distances that are 0 on one diagonal and 1 elsewhere.
fn drive(places: usize, queries: usize) -> Vec<Vec<f32>> {
    (0..queries)
        .map(|query| (0..places).map(|place| f32::from(u8::from(place != query))).collect())
        .collect()
}

#[test]
fn before_the_first_query_a_gap_is_nothing() {
    let config = config! { sequence_length: 3 };
    let (mut cut, mut never) =
        (Matcher::new(20, config.clone()).unwrap(), Matcher::new(20, config.clone()).unwrap());
    for round in 0..2 {
        cut.gap();
        cut.gap();
        assert_eq!(cut.snapshot().unwrap(), never.snapshot().unwrap());
        for column in drive(20, 9) {
            assert_eq!(
                bits(&cut.push(&column).unwrap()),
                bits(&never.push(&column).unwrap()),
                "round {round}"
            );
        }
        cut.reset();
        never.reset();
    }
}

/// The window reaches ten queries back here and the smoothing one: without the gap, place 2 would
/// win at query 12.
#[test]
fn nothing_is_matched_across_a_jump() {
    const JUMP: usize = 12;
    let config = config! { sequence_length: 10, weight: 0.0, smoothing: 1 };
    let d = drive(100, 60);
    // Ten frames of a road that is driven on elsewhere.
    let d = [&d[..JUMP], &d[40..]].concat();
    let words = vec![None; d.len()];
    let across = stream(100, &config, &d, &words, &[]);
    let broken = stream(100, &config, &d, &words, &[JUMP]);
    for query in JUMP..JUMP + 9 {
        let (across, broken) = (across[query], broken[query]);
        assert!(across.sequence.is_some() && broken.sequence.is_none());
        assert_eq!(broken.place, broken.single.place);
        assert!(across.score > 0.0, "the mean of two roads");
    }
    assert_eq!(across[JUMP].place, JUMP, "the sequence holds on to the road that was left");
    assert_eq!(broken[JUMP].place, 40);
    let ready = broken[JUMP + 9];
    assert_eq!((ready.place, ready.score, ready.sequence.is_some()), (49, 0.0, true));
}

#[test]
fn the_running_floor_outlives_a_gap() {
    let config = config! { sequence_length: 1, weight: 1.0 };
    let mut matcher = Matcher::new(2, config).unwrap();
    matcher.push(&[0.25, 1.0]).unwrap();
    matcher.gap();
    assert_eq!(matcher.push_with(&[0.5, 1.0], Given::default().trusted(true)).unwrap().score, 0.25);
}

#[test]
fn a_gap_before_a_query_that_there_is_not_is_named() {
    let map = Map::from_descriptors(numbers(Dtype::U8, 10, 1), 2, Metric::Manhattan).unwrap();
    let (d, config) = (Array2::<f32>::zeros((5, 4)), Config::default());
    let queries = numbers(Dtype::U8, 8, 2);
    for (gaps, named) in [(&[0, 4, 9][..], "4"), (&[usize::MAX, 0], "18446744073709551615")] {
        let refusals = [
            match_distances(d.view(), &config, known(None, gaps)),
            match_descriptors(&map, &queries, &config, known(None, gaps), &mut |_, _| {
                ControlFlow::Continue(())
            }),
        ];
        for refused in refusals {
            let message = refused.unwrap_err().to_string();
            assert_eq!(
                message,
                format!("option `gaps`: expected indices of queries, from 0 to 3, got {named}")
            );
        }
    }
    let nothing = Array2::<f32>::zeros((5, 0));
    let refused = match_distances(nothing.view(), &config, known(None, &[0])).unwrap_err();
    assert!(matches!(refused, Error::Option { name: "gaps", .. }), "{refused}");
    assert!(refused.to_string().contains("no query"), "{refused}");
}

proptest! {
    #![proptest_config(cases(300))]

    /// Both ways of a localizer, with gaps, snapshots, resets and refused frames in any order.
    #[test]
    fn a_screen_changes_nothing(
        (places, config) in route(2..60), metric in select(vec![Metric::Euclidean, Metric::Cosine]), seed: u64,
    ) {
        const DIM: usize = 256;
        let mut dice = SplitMix64(seed);
        let rows: Vec<f32> = (0..places * DIM).map(|_| dice.share() - 0.5).collect();
        let map = Map::from_descriptors(rows.clone(), DIM, metric)?;
        let screened = Arc::new(map.clone().with_screen(Dtype::I8)?);
        let map = Arc::new(map);
        let mut plain = Localizer::new(Arc::clone(&map), config.clone())?;
        let mut other = Localizer::new(Arc::clone(&screened), config.clone())?;
        for query in 0..2 * config.sequence_length + 30 {
            match dice.below(10) {
                0 | 1 if dice.below(config.sequence_length) < 2 => for _ in 0..=dice.below(2) {
                    plain.gap();
                    other.gap();
                },
                2 => {
                    let blob = plain.snapshot()?;
                    prop_assert_eq!(&other.snapshot()?, &blob);
                    other = Localizer::restore(Arc::clone(&screened), &blob, Some(&config))?;
                    plain = Localizer::restore(Arc::clone(&map), &blob, Some(&config))?;
                }
                3 => prop_assert_eq!(plain.distances(), other.distances()),
                4 if dice.below(8) == 0 => {
                    plain.reset();
                    other.reset();
                }
                5 => {
                    prop_assert!(plain.push_descriptor(&[f32::NAN; DIM][..]).is_err());
                    prop_assert!(other.push_descriptor(&[f32::NAN; DIM][..]).is_err());
                }
                _ => {}
            }
            let row = &rows[query % places * DIM..][..DIM];
            // Now and then so far away that nothing is screened.
            let far = if dice.below(30) == 0 { 1e32 } else { 1.0 };
            let descriptor: Vec<f32> = row.iter().map(|x| far * (x + 0.3 * dice.share())).collect();
            let (expected, got) = (plain.push_descriptor(&descriptor)?, other.push_descriptor(&descriptor)?);
            prop_assert_eq!(bits(&got), bits(&expected), "query {}", query);
        }
    }
}
