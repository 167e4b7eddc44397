//! Moves along segments and links beside walks that take one place after the other.

use std::ops::Range;

use proptest::collection::vec;
use proptest::prelude::*;

use super::later::leading;
use super::links::Links;
use super::steps::{Tap, Way, arriving, lost};
use crate::cases::cases;
use crate::method::layout::FARTHEST;
use crate::random::SplitMix64;
use crate::segments::Segments;
use crate::sums::BLOCK;

/// Adds the walks of `moves` places on to `out`, the last number of which is for those that end
/// beyond a segment. A walk takes one link at most; until then it divides.
fn walk(
    segments: &Segments,
    place: usize,
    moves: isize,
    divides: bool,
    share: f64,
    out: &mut Vec<f64>,
) {
    if moves == 0 {
        out[place] += share;
        return;
    }
    let step = moves.signum();
    let natural = segments.of(place).onward(place, step);
    let linked = |&(from, to): &(usize, usize)| {
        let (from, to) = if step > 0 { (from, to) } else { (to, from) };
        (divides && from == place).then_some(to)
    };
    let links: Vec<usize> = segments.links().iter().filter_map(linked).collect();
    let share = share / (links.len() + usize::from(natural.is_some())).max(1) as f64;
    match natural {
        Some(next) => walk(segments, next, moves - step, divides, share, out),
        None if links.is_empty() => *out.last_mut().unwrap() += share,
        None => {}
    }
    for to in links {
        walk(segments, to, moves - step, false, share, out);
    }
}

fn routes() -> impl Strategy<Value = Segments> {
    let sizes = prop_oneof![4 => 2..40_usize, 1 => 250..600_usize];
    let parts =
        (sizes, vec((0.0..1.0_f64, any::<bool>()), 0..5), vec((0.0..1.0_f64, 0.0..1.0_f64), 0..9));
    parts.prop_map(|(places, breaks, links)| {
        let at = |share: f64| (share * places as f64) as usize;
        let mut starts: Vec<usize> = breaks.iter().map(|&(share, _)| at(share).max(1)).collect();
        starts.sort_unstable();
        starts.dedup();
        let open = Segments::new(places, &starts).unwrap();
        let closed = open.iter().zip(breaks.iter().map(|one| one.1).chain([true])).enumerate();
        let closed = closed.filter(|(_, (segment, closed))| *closed && segment.len() > 2);
        let closed: Vec<usize> = closed.map(|(index, _)| index).collect();
        let route = open.clone().with_closed(&closed).unwrap();
        let mut links: Vec<_> = links.iter().map(|&(from, to)| (at(from), at(to))).collect();
        links.sort_unstable();
        links.dedup();
        links.retain(|&link| route.clone().with_links(&[link]).is_ok());
        route.with_links(&links).unwrap()
    })
}

fn taps() -> impl Strategy<Value = Vec<Tap>> {
    let first = prop_oneof![8 => -6..6_isize, 1 => -75..75_isize, 1 => -2000..2000_isize];
    (first, vec((1..4_isize, 0.0..1.0_f64), 1..7)).prop_map(|(mut shift, each)| {
        let tap = |&(more, weight): &(isize, f64)| {
            shift += more;
            Tap { shift, weight }
        };
        each.iter().map(tap).collect()
    })
}

proptest! {
    #![proptest_config(cases(500))]

    #[test]
    fn moves_are_those_of_walks(
        route in routes(),
        taps in taps(),
        seed in any::<u64>(),
        start in 0..600_usize,
        factor in 0.1..2.0_f64,
    ) {
        let places = route.places();
        let mut random = SplitMix64(seed);
        let source: Vec<f64> = (0..places).map(|_| f64::from(random.share())).collect();
        let source = &source[..];
        let links = Links::new(&route);
        let way = Way { segments: &route, links: links.as_ref() };
        let (mut moved, mut onward) = (vec![0.0; places + 1], Vec::new());
        for (place, mass) in source.iter().enumerate() {
            let mut from_here = vec![0.0; places + 1];
            for &Tap { shift, weight } in &taps {
                let divides = shift.unsigned_abs() <= FARTHEST;
                walk(&route, place, shift, divides, weight, &mut from_here);
            }
            let weight: f64 = taps.iter().map(|tap| tap.weight).sum();
            prop_assert!((from_here.iter().sum::<f64>() - weight).abs() < 1e-9);
            moved.iter_mut().zip(&from_here).for_each(|(moved, x)| *moved += mass * x);
            onward.push(from_here);
        }
        let start = start % places;
        let mut out = vec![f64::NAN; (places - start).min(256)];
        arriving(source, &taps, way, factor, start, &mut out);
        for (place, out) in (start..).zip(&out) {
            let expected = factor * moved[place];
            prop_assert!((out - expected).abs() < 1e-9, "{place}: {out}, {expected}");
        }
        let mut gone = [0.0];
        lost(source, 0, &taps, 0.5, way, &mut gone);
        prop_assert!((2.0 * gone[0] - moved[places]).abs() < 1e-9);
        // The other way round: the mean of numbers where the walks lead.
        let mut back = vec![f64::NAN; places];
        leading(source, &taps, 0.75, 0.4, way, &mut back);
        for (place, back) in back.iter().enumerate() {
            let ends = onward[place].iter().zip(source.iter().chain(&[0.4]));
            let mean: f64 = ends.map(|(share, number)| share * number).sum();
            let expected = 0.75 * mean + 0.25 * source[place];
            prop_assert!((back - expected).abs() < 1e-9, "{place}: {back}, {expected}");
        }
    }
}

/// Who has some blocks of a long route loses from these what the route loses from them.
#[test]
fn a_block_loses_the_same_alone() {
    let places = 2 * BLOCK + 300;
    let around = [BLOCK - 40, BLOCK + 3, 2 * BLOCK - 1];
    let route = Segments::new(places, &around).unwrap().with_closed(&[0]).unwrap();
    let links =
        [(5, BLOCK + 1), (BLOCK - 2, BLOCK + 2), (BLOCK + 1, 9), (2 * BLOCK - 2, places - 1)];
    let linked = route.clone().with_links(&links).unwrap();
    let mut random = SplitMix64(7);
    let mass: Vec<f64> = (0..places).map(|_| f64::from(random.share())).collect();
    let near = |weights: &[f64]| -> Vec<Tap> {
        let shifts = weights.iter().zip(-2..);
        shifts.map(|(&weight, shift)| Tap { shift, weight }).collect()
    };
    let far = [-5000, 5000, 1 << 40].map(|shift| Tap { shift, weight: 0.3 });
    for (route, taps) in [(&route, &far[..]), (&linked, &near(&[0.1, 0.2, 0.3, 0.3, 0.1]))] {
        let links = Links::new(route);
        let way = Way { segments: route, links: links.as_ref() };
        let of = |own: Range<usize>, blocks: usize| {
            let mut gone = vec![0.0; blocks];
            for share in [0.3, 0.7] {
                lost(&mass[own.clone()], own.start, taps, share, way, &mut gone);
            }
            gone
        };
        let whole = of(0..places, 3);
        let parts = [of(0..BLOCK, 1), of(BLOCK..2 * BLOCK, 1), of(2 * BLOCK..places, 1)];
        assert_eq!(parts.concat(), whole);
        assert!(whole[1] > 0.0, "{whole:?}");
    }
}
