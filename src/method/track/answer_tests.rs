//! The answer beside its definition. Masses are whole numbers, whose sums are exact in any order.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::ops::Range;

use proptest::prelude::*;
use proptest::sample::{Index, select};

use super::answer::{Belief, FINE, asked, most_probable};
use crate::cases::cases;
use crate::random::SplitMix64;
use crate::segments::{Segment, Segments};
use crate::sums::CHUNK;

/// Lengths around those of chunks; of the last, the sum is more than 65,536.
fn routes(last: impl Strategy<Value = usize>) -> impl Strategy<Value = Segments> {
    let length = prop_oneof![3..40_usize, 250..260_usize, 510..515_usize, 1000..1030_usize];
    let first = proptest::collection::vec((length, any::<bool>()), 0..3);
    (first, (last, any::<bool>())).prop_map(|(first, last)| {
        let mut start = 0;
        let list = first.into_iter().chain([last]).map(|(len, closed)| {
            start += len;
            Segment { start: start - len, end: start, closed }
        });
        Segments::of_list(list.collect())
    })
}

/// Many or few places with some mass, or those near a place.
fn masses(places: usize, kind: u8, near: usize, seed: u64) -> Vec<f64> {
    let mut dice = SplitMix64(seed);
    let mut masses: Vec<f64> = match kind {
        0 => (0..places).map(|_| dice.below(4) as f64).collect(),
        _ => vec![0.0; places],
    };
    for _ in 0..[0, 1, 3, 60][usize::from(kind)] {
        let beside = near.saturating_sub(400) + dice.below(800);
        let place = if seed.is_multiple_of(2) { dice.below(places) } else { beside % places };
        masses[place] += (1 + dice.below(40)) as f64;
    }
    masses
}

fn check(
    segments: &Segments,
    masses: &[f64],
    place: usize,
    tolerance: usize,
    scale: f64,
) -> Result<(), TestCaseError> {
    let places = masses.len();
    let sums: Vec<f64> = masses.chunks(CHUNK).map(|chunk| chunk.iter().sum()).collect();
    let total: f64 = sums.iter().sum();
    let looked_at = RefCell::new(BTreeSet::new());
    let mass = |places: Range<usize>| {
        looked_at.borrow_mut().extend([places.start / CHUNK, (places.end - 1) / CHUNK]);
        &masses[places]
    };
    let belief = Belief { places, mass, sums: &sums, on: scale * total, off: 0.125, scale };
    let track = belief.answer(place, tolerance, segments, 1.5);
    prop_assert_eq!((track.place, track.off_map, track.speed), (place, 0.125, 1.5));

    let near: BTreeSet<usize> =
        (0..places).filter(|&other| segments.are_near(place, other, tolerance)).collect();
    let confidence = near.iter().map(|&place| masses[place]).sum::<f64>();
    prop_assert_eq!(track.confidence, scale * confidence);

    let fine = places > FINE;
    let one_lap = segments.len() == 1 && segments.of(0).closed;
    let opposite = (place + places.div_ceil(2)) % places;
    let seam = match (one_lap, fine) {
        (true, true) => opposite / CHUNK * CHUNK,
        (true, false) => opposite,
        (false, _) => 0,
    };
    let in_order: Vec<usize> = (seam..places).chain(0..seam).collect();
    // The first place with which the sum exceeds the share, or the place itself.
    let end = |order: &mut dyn Iterator<Item = usize>, backwards: bool| {
        let mut sum = 0.0;
        for at in order.take_while(|&at| at != place) {
            sum += masses[at];
            if sum > 0.025 * total {
                let chunk = at / CHUNK;
                let far = fine && chunk.abs_diff(place / CHUNK) > 1;
                return match (far, backwards) {
                    (false, _) => at,
                    (true, false) => chunk * CHUNK,
                    (true, true) => ((chunk + 1) * CHUNK).min(places) - 1,
                };
            }
        }
        place
    };
    let low = end(&mut in_order.iter().copied(), false);
    let high = end(&mut in_order.iter().rev().copied(), true);
    prop_assert_eq!(track.interval, (low, high), "{} of {}", place, places);

    // Only what was asked for is looked at.
    let chunk = place / CHUNK;
    let known: BTreeSet<usize> = asked(place, tolerance, segments).collect();
    let expected: BTreeSet<usize> = if fine {
        let is_end = |&&place: &&usize| {
            !near.contains(&(place + 1)) || place == 0 || !near.contains(&(place - 1))
        };
        let ends = near.iter().filter(is_end).map(|place| place / CHUNK);
        ends.chain(chunk.saturating_sub(1)..=(chunk + 1).min(sums.len() - 1)).collect()
    } else {
        (0..sums.len()).collect()
    };
    prop_assert_eq!(&known, &expected);
    prop_assert!(looked_at.borrow().is_subset(&known));
    Ok(())
}

proptest! {
    #![proptest_config(cases(3_000))]

    #[test]
    fn an_answer_is_that_of_all_places(
        segments in routes(3..2000_usize), place: Index, kind in 0..4_u8, seed: u64,
        tolerance in prop_oneof![0..5_usize, 0..1100_usize], scale in select(vec![1.0, 0.25]),
    ) {
        let place = place.index(segments.places());
        let masses = masses(segments.places(), kind, place, seed);
        let (best, mass) = most_probable(&masses);
        let most = masses.iter().copied().fold(0.0, f64::max);
        prop_assert_eq!((Some(best), mass), (masses.iter().position(|&mass| mass == most), most));
        for place in [best, place] {
            for tolerance in [tolerance, segments.of(place).len() / 2] {
                check(&segments, &masses, place, tolerance, scale)?;
            }
        }
    }
}

proptest! {
    #![proptest_config(cases(200))]

    #[test]
    fn on_a_long_route_far_ends_are_those_of_chunks(
        segments in routes(65_500..67_000_usize), place: Index, kind in 0..4_u8, seed: u64,
        tolerance in prop_oneof![0..5_usize, 0..1100_usize], scale in select(vec![1.0, 0.25]),
    ) {
        let place = place.index(segments.places());
        let masses = masses(segments.places(), kind, place, seed);
        for place in [place, most_probable(&masses).0] {
            // To the last place of a chunk.
            for tolerance in [tolerance, CHUNK - 1 - place % CHUNK] {
                check(&segments, &masses, place, tolerance, scale)?;
            }
        }
    }
}

/// Up to 65,536 places, all ends are exact.
#[test]
fn a_route_of_65_536_places_is_not_long() {
    for places in [FINE, FINE + 1] {
        let masses = masses(places, 0, 0, 3);
        for closed in [false, true] {
            let segments = Segments::of_list(vec![Segment { start: 0, end: places, closed }]);
            check(&segments, &masses, 12_345, 2, 1.0).unwrap();
        }
    }
}

/// The share that is left out on either side may be as large as it is said to be.
#[test]
fn an_interval_leaves_out_the_whole_share() {
    for (masses, interval) in [
        ([1.0, 0.0, 38.0, 1.0], (2, 2)),
        ([2.0, 0.0, 36.0, 2.0], (0, 3)),
        ([0.5, 0.5, 38.0, 1.0], (2, 2)),
        ([0.5, 0.75, 38.0, 0.75], (1, 2)),
    ] {
        let segments = Segments::one(4);
        check(&segments, &masses, 2, 1, 1.0).unwrap();
        let total = masses.iter().sum::<f64>();
        let mass = |places: Range<usize>| &masses[places];
        let belief = Belief { places: 4, mass, sums: &[total], on: total, off: 0.0, scale: 1.0 };
        assert_eq!(belief.answer(2, 1, &segments, 1.0).interval, interval, "{masses:?}");
    }
}
