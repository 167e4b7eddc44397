//! The tracker and the alignment are docs/method.md (1.9, 1.10 and 1.14): their beliefs are those of
//! a plain filter.

use std::ops::ControlFlow;

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use surefix::{
    Config, Drive, Error, Given, Input, LoopCloser, LoopConfig, Matcher, Metric, Motion, Segment,
    Segments, Track, View, align_distances, quiet,
};

use crate::cases::{Kind, cases, columns};
use crate::evidence::{said, said_of_itself};
use crate::filter::{Gap, State, along, of, queries};
use crate::random::SplitMix64;

/// How far beliefs may be apart by rounding.
const CLOSE: f64 = 1e-7;

/// An answer beside the belief that it is to be of, and the speed in its place.
fn check(
    track: &Track,
    belief: &State,
    speed: f64,
    tolerance: usize,
    route: &Segments,
) -> Result<(), TestCaseError> {
    let places = route.places();
    let each: Vec<f64> = (0..places).map(|place| belief.in_place(place)).collect();
    let most = each.iter().copied().fold(0.0, f64::max);
    prop_assert!(most - each[track.place] <= CLOSE, "{track:?} of {each:?}");
    let segment = of(route, track.place);
    let near = segment.places().filter(|&place| {
        let apart = place.abs_diff(track.place);
        let round = if segment.closed { segment.len() - apart } else { apart };
        apart.min(round) <= tolerance
    });
    let confidence = near.map(|place| each[place]).sum::<f64>();
    prop_assert!((track.confidence - confidence).abs() < CLOSE, "{track:?}: {confidence}");
    prop_assert!((track.off_map - belief.off).abs() < CLOSE, "{track:?}: {}", belief.off);
    prop_assert!((track.speed - speed).abs() <= 1e-5 * speed.abs().max(1.0), "{track:?}: {speed}");
    // From the place opposite on, 2.5 % of the belief lie before the interval at most, and more
    // with its first place; and the same from behind. The most probable place is in it.
    let round = segment.closed && route.len() == 1;
    let seam = if round { track.place + places.div_ceil(2) } else { 0 };
    let order: Vec<usize> = (0..places).map(|at| (seam + at) % places).collect();
    let (first, last) = track.interval;
    for (order, end) in [(order.clone(), first), (order.into_iter().rev().collect(), last)] {
        let at = |place: usize| order.iter().position(|&other| other == place).unwrap();
        let tail = 0.025 * each.iter().sum::<f64>();
        let before = order[..at(end)].iter().map(|&place| each[place]).sum::<f64>();
        prop_assert!(at(end) <= at(track.place) && before <= tail + CLOSE, "{track:?} of {each:?}");
        prop_assert!(
            end == track.place || before + each[end] > tail - CLOSE,
            "{track:?} of {each:?}"
        );
    }
    Ok(())
}

/// A drive of a matcher beside the filter.
fn follow(
    motion: &Motion,
    route: &Segments,
    tolerance: usize,
    d: &[Vec<f32>],
    advance: &[Option<f64>],
    gaps: &[Gap],
) -> Result<(), TestCaseError> {
    let config = config! { motion: Some(motion.clone()), tolerance, sequence_length: 1 };
    let mut matcher = Matcher::along(route.clone(), config).unwrap();
    let start = State::start(motion, route.places());
    let mut state = start.clone();
    let said = said(&[d.to_vec()], &[1.0], motion);
    for (j, query) in queries(&said, motion, advance, gaps).iter().enumerate() {
        match gaps[j] {
            Gap::Bridged(advance) => matcher.gap_with_advance(advance).unwrap(),
            Gap::Unknown => matcher.gap(),
            Gap::Not => {}
        }
        if query.fresh {
            state = start.clone();
        }
        let (next, speeds) = query.step(&state, motion, route);
        state = next.scaled();
        let mut given = Given::default();
        given.advance = advance[j];
        let fix = matcher.push_with(&d[j], given).unwrap();
        let track = fix.track.unwrap();
        let said = (fix.confidence(), fix.off_map(), fix.speed());
        prop_assert_eq!(said, (Some(track.confidence), Some(track.off_map), Some(track.speed)));
        check(&track, &state, speeds[track.place], tolerance, route)?;
        let beliefs: Vec<f64> = matcher.belief().unwrap().collect();
        prop_assert_eq!(beliefs.len(), route.places());
        for (place, belief) in beliefs.into_iter().enumerate() {
            prop_assert!((belief - state.in_place(place)).abs() < CLOSE, "query {j}: {place}");
        }
    }
    Ok(())
}

/// Sums of blocks of 4,096 places are added up.
#[test]
fn a_tracker_of_several_blocks_is_a_filter() {
    for places in [4097, 8200] {
        let route = Segments::new(places, &[300]).unwrap().with_closed(&[1]).unwrap();
        let mut d = columns(Kind::Smooth, places, 4, 3);
        // Views that are alike, and less bright in the last places.
        for j in 1..4 {
            d[j] = d[0].iter().zip(&d[j]).map(|(a, b)| a + 0.2 * b).collect();
        }
        for d in d.iter_mut().flat_map(|d| &mut d[4000..]) {
            *d *= 0.5;
        }
        for motion in [Motion::any(), Motion::free()] {
            follow(&motion, &route, 2, &d, &[None; 4], &[Gap::Not; 4]).unwrap();
        }
    }
}

/// Moves follow links for 64 places, and not beyond.
#[test]
fn long_moves_past_junctions_are_those_of_a_filter() {
    let open = Segments::new(330, &[200]).unwrap();
    let links = [(20, 150), (100, 30), (110, 250), (150, 90), (260, 3), (280, 115)];
    for closed in [&[][..], &[1], &[0, 1]] {
        let route = open.clone().with_closed(closed).unwrap().with_links(&links).unwrap();
        let advance = [2.0, 62.0, -62.5, 63.0, -63.0, 64.0, -64.0, 65.0, -65.0, 66.5, -66.0, 90.0];
        let d = columns(Kind::Smooth, 330, advance.len(), 7);
        for motion in [Motion::steady(), Motion::any()] {
            let advance = advance.map(Some);
            follow(&motion, &route, 3, &d, &advance, &[Gap::Not; 12]).unwrap();
        }
        let mut fast = Motion::steady();
        (fast.speeds, fast.pace, fast.jitter) = (vec![0.5, 1.0, 1.5], 64.0, 0.01);
        follow(&fast, &route, 3, &d, &[None; 12], &[Gap::Not; 12]).unwrap();
    }
}

/// A route of segments, some of them closed, and links between any two places.
fn town(places: usize, seed: u64) -> Segments {
    let mut dice = SplitMix64(seed);
    let breaks: Vec<usize> = (1..places).filter(|_| dice.below(12) == 0).collect();
    let open = Segments::new(places, &breaks).unwrap();
    let closed = open.iter().enumerate().filter(|(_, one)| one.len() > 2 && dice.below(2) == 0);
    let closed: Vec<usize> = closed.map(|(index, _)| index).collect();
    let alone = open.with_closed(&closed).unwrap();
    let mut links: Vec<(usize, usize)> = (0..[0, 0, 1, 3, places.min(40)][dice.below(5)])
        .map(|_| (dice.below(places), dice.below(places)))
        .filter(|&(from, to)| from != to && along(&alone, from, 1) != Some(to))
        .collect();
    links.sort_unstable();
    links.dedup();
    alone.with_links(&links).unwrap()
}

/// The named motions, and any others.
fn motions() -> impl Strategy<Value = Motion> {
    let named = [Motion::steady(), Motion::free(), Motion::any()];
    let speeds = proptest::sample::subsequence((0..17).collect::<Vec<_>>(), 1..6);
    let rates = (
        select(vec![0.0, 0.05, 0.6, 1.0]),
        select(vec![0.01, 0.1, 0.5]),
        select(vec![0.0, 0.05, 0.4]),
        select(vec![0.0, 0.1, 0.7]),
    );
    let options = (
        select(vec![0.3, 1.0, 1.7, 4.0]),
        select(vec![0.0, 0.01, 0.1, 0.25]),
        select(vec![0.0, 0.5, 2.0]),
        select(vec![0.5, 3.0]),
        select(vec![0.0, 1.0, 10.0]),
        any::<bool>(),
        select(vec![0.0, 0.9, 1.0]),
    );
    let custom = (speeds, rates, options).prop_map(|(speeds, rates, options)| {
        let mut motion = Motion::steady();
        motion.speeds = speeds.into_iter().map(|quarters| f64::from(quarters) / 4.0).collect();
        (motion.switching, motion.restart, motion.leave, motion.rejoin) = rates;
        (motion.pace, motion.jitter, motion.evidence, motion.clip, ..) = options;
        (.., motion.hubness, motion.by_distance, motion.repeat) = options;
        motion
    });
    prop_oneof![select(named.to_vec()), custom]
}

/// What is known of a drive's moves: steps, jumps and stops; all of them, some or none.
fn advances(queries: usize, dice: &mut SplitMix64) -> Vec<Option<f64>> {
    let unknown = [0, 3, 10][dice.below(3)];
    let mut advance = || match dice.below(8) {
        0 => dice.below(200) as f64 - 100.0,
        1 => 0.0,
        2 => dice.below(9) as f64 / 2.0 - 1.5,
        _ => f64::from(4.0 * dice.share() - 1.0),
    };
    let all: Vec<f64> = (0..queries).map(|_| advance()).collect();
    all.into_iter().map(|advance| (dice.below(10) >= unknown).then_some(advance)).collect()
}

proptest! {
    #![proptest_config(cases(1_000))]

    #[test]
    fn the_tracker_is_a_filter(
        motion in motions(), places in prop_oneof![20 => 2..40_usize, 1 => 250..600_usize],
        count in 1..10_usize, tolerance in prop_oneof![5 => 0..4_usize, 1 => 100..400_usize],
        kind in select(vec![Kind::Smooth, Kind::Ties, Kind::Constant]), seed: u64,
    ) {
        let (route, mut dice) = (town(places, seed), SplitMix64(seed));
        let mut d = columns(kind, places, count, seed);
        for j in 1..count {
            // The robot stands.
            if dice.below(4) == 0 {
                d[j] = d[j - 1].clone();
            }
        }
        let advance = advances(count, &mut dice);
        let mut gap = |_| match dice.below(12) {
            0 => Gap::Unknown,
            1 => Gap::Bridged(2.25),
            _ => Gap::Not,
        };
        let gaps: Vec<_> = (0..count).map(&mut gap).collect();
        follow(&motion, &route, tolerance, &d, &advance, &gaps)?;
    }

    #[test]
    fn an_alignment_is_the_filter_in_both_directions(
        (motion, places) in prop_oneof![
            20 => (motions(), 2..12_usize), 1 => (Just(Motion::steady()), 250..300_usize),
        ],
        count in 1..14_usize,
        tolerance in 0..3_usize,
        told: bool,
        weights in vec(select(vec![0.0, 0.5, 1.0, 2.0]), 0..3),
        seed: u64,
    ) {
        let (route, mut dice) = (town(places, seed), SplitMix64(seed));
        // As many techniques as weights; the last one always counts.
        let weights: Vec<f64> = weights.into_iter().chain([1.5]).collect();
        let drives = 0..weights.len() as u64;
        let d: Vec<Vec<Vec<f32>>> =
            drives.map(|drive| columns(Kind::Smooth, places, count, seed ^ drive)).collect();
        let of = |d: &Vec<Vec<f32>>| ndarray::Array2::from_shape_fn((places, count), |(i, j)| d[j][i]);
        let matrices: Vec<_> = d.iter().map(of).collect();
        let views: Vec<_> = matrices.iter().map(|matrix| matrix.view()).collect();
        let advance: Vec<f64> = (0..count).map(|_| f64::from(6.0 * dice.share() - 2.0)).collect();
        let gap = dice.below(2 * count);
        let drive = Drive::default().along(&route).gaps(if gap < count { std::slice::from_ref(&gap) } else { &[] });
        let drive = if told { drive.advance(&advance) } else { drive };
        let asked: Vec<usize> = (0..count).map(|_| dice.below(places)).collect();
        let config: Config = config! {
            motion: Some(motion.clone()),
            tolerance,
            sequence_length: 1,
            technique_weights: weights.clone(),
        };
        let got = align_distances(&views, &config, drive, &[&asked], &mut quiet).unwrap();

        let advance: Vec<_> = advance.into_iter().map(|advance| told.then_some(advance)).collect();
        let at_gap = if told { Gap::Bridged(0.0) } else { Gap::Unknown };
        let gaps: Vec<_> = (0..count).map(|j| if j == gap { at_gap } else { Gap::Not }).collect();
        let said = said(&d, &weights, &motion);
        let queries = queries(&said, &motion, &advance, &gaps);
        let mut states = vec![State::start(&motion, places)];
        for query in &queries {
            let start = State::start(&motion, places);
            let before = if query.fresh { &start } else { &states[states.len() - 1] };
            states.push(query.step(before, &motion, &route).0.scaled());
        }
        let mut later = State::new(motion.speeds.len(), places, 1.0, 1.0);
        for j in (0..count).rev() {
            let belief = states[j + 1].times(&later).scaled();
            let aligned = got.queries[j];
            let here = |v: usize| belief.on[v][aligned.track.place];
            let fast = (0..motion.speeds.len()).map(|v| here(v) * motion.speeds[v] * motion.pace);
            let speed = fast.sum::<f64>() / belief.in_place(aligned.track.place);
            let speed = queries[j].advance.unwrap_or(speed);
            check(&aligned.track, &belief, speed, tolerance, &route)?;
            if weights.len() > 1 {
                let (mean, single) = (&said[j].mean, aligned.single);
                let least = mean.iter().copied().fold(f64::INFINITY, f64::min);
                let distance = f64::from(single.distance);
                prop_assert!((mean[single.place] - least).abs() < 1e-5 && (distance - least).abs() < 1e-5);
            }
            let near = |to: usize| -> f64 {
                let Segment { start, end, .. } = crate::filter::of(&route, to);
                let reach = (1..=tolerance as i64).flat_map(|by| [by, -by]).chain([0]);
                let mut near: Vec<usize> = reach.filter_map(|by| along(&route, to, by)).collect();
                near.sort_unstable();
                near.dedup();
                near.iter().filter(|at| (start..end).contains(at)).map(|&at| belief.in_place(at)).sum()
            };
            prop_assert!((got.right[0][j] - near(asked[j])).abs() < CLOSE);
            prop_assert!((aligned.single_right - near(aligned.single.place)).abs() < CLOSE);
            later = if queries[j].fresh {
                State::new(motion.speeds.len(), places, 1.0, 1.0)
            } else {
                queries[j].back(&later, &motion, &route)
            };
        }
    }

    /// The places are those of earlier frames, and more with each frame.
    #[test]
    fn a_loop_closer_is_the_filter_on_its_own_road(
        motion in motions(), dim in 1..4_usize, exclude in 1..5_usize, tolerance in 0..3_usize,
        events in vec(0..12_u8, 8..40), seed: u64,
    ) {
        let mut dice = SplitMix64(seed);
        let mut config = LoopConfig::default();
        (config.exclude, config.tolerance, config.motion) = (exclude, tolerance, motion.clone());
        let mut closer = LoopCloser::of_descriptors(dim, Metric::Euclidean, config).unwrap();
        let (mut d, mut advances, mut gaps) = (Vec::new(), Vec::new(), Vec::new());
        let (mut answers, mut breaks) = (Vec::new(), Vec::new());
        for (frame, event) in events.into_iter().enumerate() {
            let advance = (event > 8).then(|| f64::from(4.0 * dice.share() - 1.0));
            let mut gap = Gap::Not;
            if frame >= exclude + 2 && event < 2 {
                gap = if event == 0 { Gap::Bridged(1.75) } else { Gap::Unknown };
                breaks.push(frame);
            }
            match gap {
                Gap::Bridged(advance) => closer.gap_with_advance(advance).unwrap(),
                Gap::Unknown => closer.gap(),
                Gap::Not => {}
            }
            let row: Vec<f32> = (0..dim).map(|_| dice.below(5) as f32).collect();
            let answer = closer.push(Input::Descriptor(View::F32(&row)), advance).unwrap();
            if closer.distances().len() >= 2 {
                d.push(closer.distances().to_vec());
                advances.push(advance);
                gaps.push(gap);
                answers.push((answer, closer.belief().collect::<Vec<f64>>()));
            }
        }
        let said = said_of_itself(&d, &motion);
        let start = State::new(motion.speeds.len(), 0, 0.0, 1.0);
        let mut state = start.clone();
        for (j, query) in queries(&said, &motion, &advances, &gaps).iter().enumerate() {
            let places = d[j].len();
            let breaks: Vec<usize> = breaks.iter().copied().filter(|&at| at < places).collect();
            let route = Segments::new(places, &breaks).unwrap();
            if query.fresh {
                state = start.clone();
            }
            state.on.iter_mut().for_each(|row| row.resize(places, 0.0));
            state = query.step(&state, &motion, &route).0.scaled();
            let (answer, belief) = &answers[j];
            prop_assert_eq!(belief.len(), places);
            for (place, belief) in belief.iter().enumerate() {
                prop_assert!((belief - state.in_place(place)).abs() < CLOSE, "{j}: {place}");
            }
            let segment = of(&route, answer.place);
            let near = segment.places().filter(|at| at.abs_diff(answer.place) <= tolerance);
            let confidence = near.map(|place| state.in_place(place)).sum::<f64>();
            prop_assert!((answer.confidence - confidence).abs() < CLOSE, "{answer:?}");
            prop_assert!((answer.off_map - state.off).abs() < CLOSE, "{answer:?}");
            let most = (0..places).map(|place| state.in_place(place)).fold(0.0, f64::max);
            prop_assert!(most - state.in_place(answer.place) < CLOSE, "{answer:?}");
        }
    }
}

/// Each query is a step forwards and one backwards.
#[test]
fn an_alignment_tells_its_progress_and_can_be_stopped() {
    let distances =
        ndarray::Array2::from_shape_fn((9, 100), |(i, j)| ((i * 7 + j * 5) % 11) as f32);
    let config: Config = config! { motion: Some(Motion::steady()), sequence_length: 1 };
    let run = |stop_at: usize| {
        let mut told = Vec::new();
        let mut progress = |done: usize, total: usize| {
            told.push((done, total));
            if done >= stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let drive = Drive::default();
        let aligned = align_distances(&[distances.view()], &config, drive, &[], &mut progress);
        (aligned.map(|aligned| aligned.queries.len()), told)
    };
    let (aligned, told) = run(usize::MAX);
    assert_eq!(aligned.unwrap(), 100);
    assert_eq!(told, [64, 128, 192, 200].map(|done| (done, 200)));
    for stop_at in [64, 128, 200] {
        let (aligned, _) = run(stop_at);
        assert!(matches!(aligned, Err(Error::Interrupted { done, total: 200 }) if done == stop_at));
    }
}
