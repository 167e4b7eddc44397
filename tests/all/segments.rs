//! Routes of several segments, open and closed (method 1.14), as their users see them.

use proptest::prelude::*;
use surefix::evaluate::{Truth, Verdict};
use surefix::{Config, Drive, Error, Fix, Isa, Matcher, Segments, match_distances};

use crate::cases::{all_bits, cases, columns, config, kind};
use crate::random::SplitMix64;

/// Segments of 1 to 40 places, some of them closed.
fn roads(places: usize, seed: u64) -> Segments {
    let mut dice = SplitMix64(seed);
    let (most, mut at, mut breaks) = ([1, 4, 40][dice.below(3)], 0, Vec::new());
    while at < places {
        at += 1 + dice.below(most);
        breaks.extend((at < places).then_some(at));
    }
    let roads = Segments::new(places, &breaks).unwrap();
    let closed = roads.iter().enumerate().filter(|(_, road)| road.len() > 2 && dice.below(2) == 0);
    let closed: Vec<usize> = closed.map(|(index, _)| index).collect();
    roads.with_closed(&closed).unwrap()
}

proptest! {
    #![proptest_config(cases(300))]

    /// In pieces, in order, and restored in the middle, on every instruction set.
    #[test]
    fn a_batch_is_the_stream_on_every_route(
        (places, config) in (2..70_usize).prop_flat_map(|n| (Just(n), config(n))),
        kind in kind(), queries in 1..90_usize, cut: u64, seed: u64,
    ) {
        let (roads, mut config) = (roads(places, cut), config);
        config.motion = None;
        if config.validate_along(&roads).is_err() {
            config.sequence_length = 1;
        }
        let columns = columns(kind, places, queries, seed);
        let matrix = ndarray::Array2::from_shape_fn((places, queries), |(i, j)| columns[j][i]);
        let gaps = [queries / 2];
        let drive = Drive::default().along(&roads).gaps(&gaps);
        let run = match_distances(matrix.view(), &config, drive).unwrap();
        prop_assert_eq!(&run.segments, &roads);
        for isa in Isa::available() {
            let mut matcher = Matcher::along(roads.clone(), config.clone()).unwrap();
            matcher = matcher.with_isa(isa).unwrap();
            let mut fixes: Vec<Fix> = Vec::new();
            for (query, column) in columns.iter().enumerate() {
                if query == queries / 2 {
                    matcher.gap();
                }
                if query == queries / 3 {
                    let snapshot = matcher.snapshot().unwrap();
                    matcher = Matcher::restore(&snapshot, Some(&config)).unwrap();
                    prop_assert_eq!(matcher.segments(), &roads);
                }
                fixes.push(matcher.push(column).unwrap());
            }
            prop_assert_eq!(all_bits(&fixes), all_bits(&run.fixes));
        }
        for fix in &run.fixes {
            let road = roads.iter().nth(fix.segment).unwrap();
            prop_assert!(road.places().contains(&fix.place));
            prop_assert_eq!(road.start + fix.segment_place, fix.place);
        }
    }

    /// Roads that are matched together and alone have the same sequences: each fix of the town is
    /// the best of those of its roads.
    #[test]
    fn a_sequence_on_roads_is_the_best_of_the_roads(
        lengths in prop::collection::vec(3..30_usize, 2..5), closed: u64, seed: u64,
    ) {
        let places = lengths.iter().sum();
        let ends: Vec<usize> =
            lengths.iter().scan(0, |end, n| { *end += n; Some(*end) }).collect();
        let round: Vec<usize> = (0..lengths.len()).filter(|road| (closed >> road) & 1 == 1).collect();
        let roads = Segments::new(places, &ends[..ends.len() - 1]).unwrap();
        let roads = roads.with_closed(&round).unwrap();
        let mut config = Config::default();
        (config.sequence_length, config.weight) = (3, 0.0);
        let mut town = Matcher::along(roads.clone(), config.clone()).unwrap();
        let mut alone: Vec<Matcher> = roads.iter().map(|road| {
            let own = Segments::one(road.len());
            let own = own.with_closed(if road.closed { &[0] } else { &[] }).unwrap();
            Matcher::along(own, config.clone()).unwrap()
        }).collect();
        for column in columns(crate::cases::Kind::Smooth, places, 8, seed) {
            let fix = town.push(&column).unwrap();
            let each = roads.iter().zip(&mut alone);
            let own = each.map(|(road, matcher)| {
                let fix = matcher.push(&column[road.places()]).unwrap();
                fix.sequence.map(|found| (found.score, road.start + found.place))
            });
            let own: Vec<(f32, usize)> = own.flatten().collect();
            let best = own.iter().map(|&(score, _)| score).reduce(f32::min);
            prop_assert_eq!(fix.sequence.map(|found| found.score), best);
            let among_them = |found: surefix::Sequence| own.contains(&(found.score, found.place));
            prop_assert!(fix.sequence.is_none_or(among_them));
        }
    }
}

/// A sequence that no segment is long enough for is refused, and the error names the longest.
#[test]
fn a_sequence_longer_than_all_segments_is_refused() {
    let mut config = Config::default();
    config.sequence_length = 8;
    let roads = || Segments::new(12, &[7]).unwrap();
    let refused = |roads: Segments, config: &Config| {
        Matcher::along(roads, config.clone()).map(|_| ()).unwrap_err().to_string()
    };
    assert_eq!(
        refused(roads(), &config),
        "option `sequence_length`: expected a whole number from 1 to 7 (the places of the longest \
         segment), got 8"
    );
    // Of a closed segment each place has a diagonal.
    assert!(Matcher::along(roads().with_closed(&[1]).unwrap(), config.clone()).is_ok());
    (config.sequence_length, config.speeds) = (5, vec![1.0, 2.0]);
    let error = refused(roads(), &config);
    assert!(error.contains("fits a segment: at most 6 places back"), "{error}");
    let matrix = ndarray::Array2::zeros((12, 3));
    let roads = roads();
    let batch = match_distances(matrix.view(), &config, Drive::default().along(&roads));
    assert!(matches!(batch, Err(Error::Option { name: "speeds", .. })));
    let other = Segments::one(11);
    let batch = match_distances(matrix.view(), &Config::default(), Drive::default().along(&other));
    assert!(matches!(batch, Err(Error::Length { what: "segments", expected: 12, got: 11 })));
}

/// A snapshot from before there were segments is of one; a forged one is refused.
#[test]
fn a_snapshot_of_one_segment_does_not_name_it() {
    let mut matcher = Matcher::new(5, Config::default()).unwrap();
    matcher.push(&[0.5, 0.1, 0.5, 0.5, 0.5]).unwrap();
    let snapshot = matcher.snapshot().unwrap();
    assert!(!String::from_utf8_lossy(&snapshot).contains("\"segments\""));
    assert_eq!(Matcher::restore(&snapshot, None).unwrap().segments(), &Segments::one(5));
}

/// Place 0 is one place from the last of a closed route, and no tolerance reaches across a break.
#[test]
fn a_truth_along_segments_ends_at_breaks_and_goes_round() {
    let roads = Segments::new(12, &[5]).unwrap().with_closed(&[0]).unwrap();
    let truth = Truth::places(vec![Some(4), Some(5), None], 1).along(&roads);
    let right = |query: usize| -> Vec<usize> {
        (0..14).filter(|&place| truth.judge(query, place) == Verdict::Correct).collect()
    };
    assert_eq!([right(0), right(1), right(2)], [vec![0, 3, 4], vec![5, 6], vec![]]);
    let cells = ndarray::Array2::from_shape_fn((12, 1), |(place, _)| i8::from(place == 4));
    let truth = Truth::cells(&cells.view(), 2).unwrap().along(&roads);
    let right = (0..14).filter(|&place| truth.judge(0, place) == Verdict::Correct);
    assert_eq!(right.collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
}

/// Three laps: the sequences go on from the last place to the first.
#[test]
fn sequences_go_on_from_lap_to_lap() {
    const LAP: usize = 30;
    let mut config = Config::default();
    config.sequence_length = 10;
    let closed = Segments::one(LAP).with_closed(&[0]).unwrap();
    let mut matcher = Matcher::along(closed, config).unwrap();
    let mut dice = SplitMix64(8);
    for query in 0..3 * LAP {
        let mut column: Vec<f32> = (0..LAP).map(|_| 0.4 + 0.6 * dice.share()).collect();
        column[query % LAP] = 0.3 * dice.share();
        let fix = matcher.push(&column).unwrap();
        if query >= 9 {
            assert_eq!(fix.sequence.unwrap().place, query % LAP, "query {query}");
        }
    }
}

/// Its gradient is 0, which is the largest if all distances are equal but its own.
#[test]
fn a_match_on_a_segment_of_one_place_is_never_trusted() {
    let mut config = Config::default();
    config.sequence_length = 1;
    for (column, breaks, alone) in [
        ([0.25_f32, 1.0, 1.0, 1.0, 1.0], &[1][..], true),
        ([1.0, 1.0, 1.0, 1.0, 0.25], &[4], true),
        ([1.0, 1.0, 0.25, 1.0, 1.0], &[2, 3], true),
        ([0.25, 1.0, 1.0, 1.0, 1.0], &[2], false),
    ] {
        let mut matcher =
            Matcher::along(Segments::new(5, breaks).unwrap(), config.clone()).unwrap();
        let fix = matcher.push(&column).unwrap();
        assert_eq!(fix.single.distance, 0.25);
        assert_eq!(fix.trusted, !alone, "{column:?}");
    }
}
