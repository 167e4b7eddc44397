//! Which closed loops become edges of the graph: places that show something, and not the newest.

use surefix::{Input, LoopCloser, LoopClosure, LoopConfig, Metric, View};

use crate::random::SplitMix64;

const DIM: usize = 16;
const EXCLUDE: usize = 10;

/// The answers to a drive round and round, `period` frames a lap, and how many places there were.
fn laps(
    period: usize,
    frames: usize,
    row: impl Fn(usize, &mut Vec<f32>),
) -> Vec<(LoopClosure, usize)> {
    let mut config = LoopConfig::default();
    (config.exclude, config.confidence, config.lasting) = (EXCLUDE, 0.5, 1);
    let mut closer = LoopCloser::of_descriptors(DIM, Metric::Euclidean, config).unwrap();
    let push = |frame: usize| {
        let mut numbers = SplitMix64((frame % period) as u64).signed(DIM);
        row(frame, &mut numbers);
        let answer = closer.push(Input::Descriptor(View::F32(&numbers)), None).unwrap();
        (answer, closer.distances().len())
    };
    (0..frames).map(push).collect()
}

#[test]
fn a_place_that_shows_nothing_is_no_end_of_an_edge() {
    let dark = 40;
    let answers = laps(80, 160, |frame, row| {
        if frame == dark {
            row.fill(0.0);
        }
    });
    let again: Vec<_> = answers[80 + dark - 3..80 + dark + 4].iter().map(|one| one.0).collect();
    for (at, answer) in (dark - 3..).zip(again) {
        assert_eq!((answer.place, answer.blank), (at, false));
        assert!(answer.confidence > 0.5, "{answer:?}");
        assert_eq!(answer.edge, at != dark, "{answer:?}");
    }
}

/// The last five places may be those where the robot has only just been.
#[test]
fn the_newest_places_are_no_ends_of_edges() {
    let mut seen = [false; 2];
    for period in EXCLUDE + 1..EXCLUDE + 12 {
        // The second lap knows the first alone.
        for (answer, places) in laps(period, 2 * period, |_, _| ()) {
            if answer.confidence > 0.5 {
                let newest = answer.place + 5 >= places;
                assert_eq!(answer.edge, !newest, "{answer:?} of {places}");
                seen[usize::from(answer.place + 5 == places)] = true;
            }
        }
    }
    assert_eq!(seen, [true; 2]);
}
