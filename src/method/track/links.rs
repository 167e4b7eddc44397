//! Links (method 1.14): a place at which links begin is a fork, and a move past it is divided.
//!
//! What arrives at a place near a junction is gathered along all walks that lead there; the other
//! places do not ask (`steps.rs`). A walk takes one link at most, so that the walks to a place are
//! its own segment's, and for each link that ends shortly before it, those to the link's beginning.

use std::ops::Range;

use super::steps::Tap;
use crate::method::layout::FARTHEST;
use crate::segments::{Segment, Segments};
use crate::sums::{BLOCK, CHUNK};

/// Places that are looked at together.
const TOGETHER: usize = 32;

/// The links of a route for moves onward, and for moves back, which take them the other way.
#[derive(Clone, Debug)]
pub(super) struct Links {
    onward: Direction,
    back: Direction,
}

/// The links for moves in one direction. For moves back, places count from the route's end, so that
/// all moves go to greater places.
#[derive(Clone, Debug)]
struct Direction {
    /// How many places the route has, for moves back.
    mirrored: Option<usize>,
    lines: Vec<Line>,
    /// The places at which links begin or end, in order.
    sites: Vec<Site>,
    /// The sites at which links end, by those at which they begin; and the other way round.
    to: Vec<usize>,
    from: Vec<usize>,
    /// How many places before each place the last one lies to which a divided move leads; at most
    /// 255.
    since: Vec<u8>,
    /// The least of each chunk of these.
    least: Vec<u8>,
}

/// A segment and the indices of its sites.
#[derive(Clone, Debug)]
struct Line {
    segment: Segment,
    sites: Range<usize>,
}

#[derive(Clone, Debug)]
struct Site {
    place: usize,
    /// The index of its line.
    line: usize,
    /// The probability to go on along the segment, and along each of the links that begin here.
    straight: f64,
    link: f64,
    /// The links that begin here, in `Direction::to`, and those that end here, in
    /// `Direction::from`.
    to: Range<usize>,
    from: Range<usize>,
}

/// A place with the index of its line and of the first site after it.
#[derive(Clone, Copy)]
struct Spot {
    place: usize,
    line: usize,
    after: usize,
}

/// A move by some places, in the direction at hand.
#[derive(Clone, Copy)]
struct Move {
    places: usize,
    weight: f64,
}

/// Taps by their direction, and the rest, which do not follow links.
#[derive(Clone, Copy)]
struct Split<'a> {
    onward: Moves<'a>,
    back: Moves<'a>,
    rest: [&'a [Tap]; 3],
}

impl<'a> Split<'a> {
    /// Of taps in the order of their shifts.
    fn new(taps: &'a [Tap]) -> Self {
        let far = FARTHEST as isize;
        let first = |from: isize| taps.partition_point(|tap| tap.shift < from);
        let [back, none, onward, rest] = [-far, 0, 1, far + 1].map(first);
        Self {
            onward: Moves { taps: &taps[onward..rest], backwards: false },
            back: Moves { taps: &taps[back..none], backwards: true },
            rest: [&taps[..back], &taps[none..onward], &taps[rest..]],
        }
    }
}

/// The moves in one direction, at most `FARTHEST` places.
#[derive(Clone, Copy)]
struct Moves<'a> {
    taps: &'a [Tap],
    backwards: bool,
}

impl Moves<'_> {
    /// The shortest first.
    fn iter(&self) -> impl Iterator<Item = Move> {
        let last = self.taps.len().wrapping_sub(1);
        (0..self.taps.len()).map(move |index| {
            let tap = &self.taps[if self.backwards { last - index } else { index }];
            Move { places: tap.shift.unsigned_abs(), weight: tap.weight }
        })
    }

    /// The places of the longest move.
    fn reach(&self) -> usize {
        let longest = if self.backwards { self.taps.first() } else { self.taps.last() };
        longest.map_or(0, |tap| tap.shift.unsigned_abs())
    }
}

impl Links {
    /// `None` if there are none.
    pub(super) fn new(segments: &Segments) -> Option<Self> {
        (!segments.links().is_empty()).then(|| Self {
            onward: Direction::new(segments, false),
            back: Direction::new(segments, true),
        })
    }

    /// The places of an open segment from which no walk by a tap passes a junction, before the end
    /// beyond which it leads.
    pub(super) fn clear(&self, segment: usize, tap: Tap) -> Range<usize> {
        let direction = if tap.shift > 0 { &self.onward } else { &self.back };
        let line = match direction.mirrored {
            None => &direction.lines[segment],
            Some(_) => &direction.lines[direction.lines.len() - 1 - segment],
        };
        if tap.shift.unsigned_abs() > FARTHEST {
            return direction.natural(line.segment.places());
        }
        let last = direction.sites[line.sites.clone()].iter().rfind(|site| site.is_fork());
        let first = last.map_or(line.segment.start, |fork| fork.place + 1);
        direction.natural(first..line.segment.end)
    }

    /// Adds to each block the mass that walks past forks take from its places beyond the ends of
    /// segments, as `lost` in `steps.rs`.
    pub(super) fn lost(
        &self,
        mass: &[f64],
        start: usize,
        taps: &[Tap],
        share: f64,
        blocks: &mut [f64],
    ) {
        let split = Split::new(taps);
        for (direction, moves) in [(&self.onward, split.onward), (&self.back, split.back)] {
            direction.each_divided(moves.reach(), |spot| {
                let own = direction.at(spot.place).checked_sub(start);
                let Some((own, mass)) = own.and_then(|own| Some((own, *mass.get(own)?))) else {
                    return;
                };
                direction.walks(moves, spot, |weight, to| {
                    if to.is_none() {
                        blocks[own / BLOCK] += share * weight * mass;
                    }
                });
            });
        }
    }

    /// Writes what arrives at the places near junctions among those from `start` on; `source` gives
    /// the belief in a place.
    pub(super) fn arriving(
        &self,
        source: impl Fn(usize) -> f64,
        taps: &[Tap],
        factor: f64,
        start: usize,
        out: &mut [f64],
    ) {
        let (split, Self { onward, back }) = (Split::new(taps), self);
        let reach = [split.onward.reach(), split.back.reach()];
        let range = start..start + out.len();
        if !onward.is_near(range.clone(), reach[0]) && !back.is_near(range.clone(), reach[1]) {
            return;
        }
        let (mut ahead, mut behind) = (onward.spot(onward.at(start)), back.spot(back.at(start)));
        for first in range.clone().step_by(TOGETHER) {
            let together = first..range.end.min(first + TOGETHER);
            let near = |direction: &Direction, reach: usize| {
                let own = direction.natural(together.clone());
                direction.since[own].iter().fold(false, |any, &s| any | (usize::from(s) < reach))
            };
            if !near(onward, reach[0]) && !near(back, reach[1]) {
                continue;
            }
            for place in together {
                let (to, from) = (onward.at(place), back.at(place));
                let near = usize::from(onward.since[to]) < reach[0]
                    || usize::from(back.since[from]) < reach[1];
                if !near {
                    continue;
                }
                onward.seek(&mut ahead, to);
                back.seek(&mut behind, from);
                let segment = &onward.lines[ahead.line].segment;
                let mut sum = 0.0;
                for tap in split.rest.into_iter().flatten() {
                    let from = segment.onward(place, -tap.shift);
                    sum += from.map_or(0.0, |from| tap.weight * source(from));
                }
                sum += onward.arriving(&source, split.onward, ahead);
                sum += back.arriving(&source, split.back, behind);
                out[place - start] = factor * sum;
            }
        }
    }

    /// Calls `visit` for each place from which a walk by a tap may pass a fork, with the mean of
    /// `h` where the taps lead from there, and of `anywhere` beyond an end.
    pub(super) fn leading(
        &self,
        h: &[f64],
        taps: &[Tap],
        anywhere: f64,
        mut visit: impl FnMut(usize, f64),
    ) {
        let split = Split::new(taps);
        let [onward, back] = [(&self.onward, split.onward), (&self.back, split.back)];
        for (divided, reach) in [(onward.0, onward.1.reach()), (back.0, back.1.reach())] {
            divided.each_divided(reach, |spot| {
                let place = divided.at(spot.place);
                let segment = &self.onward.lines[self.onward.spot(place).line].segment;
                let mut sum = 0.0;
                for tap in split.rest.into_iter().flatten() {
                    sum +=
                        tap.weight * segment.onward(place, tap.shift).map_or(anywhere, |to| h[to]);
                }
                for (direction, moves) in [onward, back] {
                    direction.walks(moves, direction.spot(direction.at(place)), |weight, to| {
                        sum += weight * to.map_or(anywhere, |to| h[direction.at(to)]);
                    });
                }
                visit(place, sum);
            });
        }
    }
}

impl Site {
    /// Whether links begin here.
    fn is_fork(&self) -> bool {
        !self.to.is_empty()
    }
}

impl Direction {
    fn new(segments: &Segments, back: bool) -> Self {
        let places = segments.places();
        let mirrored = back.then_some(places);
        let turned = |place: usize| if back { places - 1 - place } else { place };
        let segment = |segment: &Segment| {
            let mut turned = *segment;
            if back {
                (turned.start, turned.end) = (places - segment.end, places - segment.start);
            }
            turned
        };
        let mut list: Vec<Segment> = segments.iter().map(segment).collect();
        let links = segments.links().iter();
        let mut links: Vec<(usize, usize)> = links
            .map(|&(from, to)| if back { (turned(to), turned(from)) } else { (from, to) })
            .collect();
        if back {
            list.reverse();
        }
        links.sort_unstable();
        let mut all: Vec<usize> = links.iter().flat_map(|&(from, to)| [from, to]).collect();
        all.sort_unstable();
        all.dedup();
        let site = |place: usize| all.partition_point(|&other| other < place);
        let to = links.iter().map(|&(_, to)| site(to)).collect();
        let mut by_end: Vec<(usize, usize)> =
            links.iter().map(|&(from, to)| (site(to), site(from))).collect();
        by_end.sort_unstable();
        let line = |place: usize| list.partition_point(|segment| segment.end <= place);
        let sites = all.iter().enumerate().map(|(index, &place)| {
            let line = line(place);
            let first = |from: usize| links.partition_point(|link| link.0 < from);
            let entering = |site: usize| by_end.partition_point(|link| link.0 < site);
            let to = first(place)..first(place + 1);
            let next = usize::from(list[line].onward(place, 1).is_some());
            let link = 1.0 / (next + to.len()).max(1) as f64;
            // All of it, and if that leads beyond the end, unless there are links.
            let straight = if to.is_empty() { 1.0 } else { next as f64 * link };
            let from = entering(index)..entering(index + 1);
            Site { place, line, straight, link, to, from }
        });
        let sites: Vec<Site> = sites.collect();
        let lines = list.iter().map(|segment| {
            let first = |from: usize| sites.partition_point(|site| site.place < from);
            Line { segment: *segment, sites: first(segment.start)..first(segment.end) }
        });
        let lines: Vec<Line> = lines.collect();
        let from = by_end.iter().map(|&(_, from)| from).collect();
        let since = since(&lines, &sites, places);
        let least = since.chunks(CHUNK).filter_map(|chunk| chunk.iter().min().copied()).collect();
        Self { mirrored, lines, sites, to, from, since, least }
    }

    /// From a place of the route to one of this direction, and back.
    fn at(&self, place: usize) -> usize {
        self.mirrored.map_or(place, |places| places - 1 - place)
    }

    /// The same for a range.
    fn natural(&self, range: Range<usize>) -> Range<usize> {
        match self.mirrored {
            None => range,
            Some(places) => places - range.end..places - range.start,
        }
    }

    /// Whether moves of `reach` places lead to some of these places of the route by a junction.
    fn is_near(&self, range: Range<usize>, reach: usize) -> bool {
        let own = self.natural(range);
        let chunks = own.start / CHUNK..own.end.div_ceil(CHUNK);
        self.least[chunks].iter().any(|&since| usize::from(since) < reach)
    }

    fn spot(&self, place: usize) -> Spot {
        Spot {
            place,
            line: self.lines.partition_point(|line| line.segment.end <= place),
            after: self.sites.partition_point(|site| site.place <= place),
        }
    }

    /// The spot of a site.
    fn at_site(&self, index: usize) -> Spot {
        let Site { place, line, .. } = self.sites[index];
        Spot { place, line, after: index + 1 }
    }

    /// Moves a spot to a place that is near.
    fn seek(&self, spot: &mut Spot, place: usize) {
        spot.place = place;
        while self.lines[spot.line].segment.end <= place {
            spot.line += 1;
        }
        while self.lines[spot.line].segment.start > place {
            spot.line -= 1;
        }
        while self.sites.get(spot.after).is_some_and(|site| site.place <= place) {
            spot.after += 1;
        }
        while spot.after > 0 && self.sites[spot.after - 1].place > place {
            spot.after -= 1;
        }
    }

    /// The sites at and before a spot on its segment, the nearest first, and how many places away
    /// they are. They come again with each lap of a closed segment.
    fn before(&self, spot: Spot) -> impl Iterator<Item = (usize, &Site)> {
        let Line { segment, sites } = &self.lines[spot.line];
        let (mut next, mut laps) = (spot.after, 0);
        std::iter::from_fn(move || {
            if next <= sites.start {
                if !segment.closed || sites.is_empty() {
                    return None;
                }
                (next, laps) = (sites.end, laps + segment.len());
            }
            next -= 1;
            let site = &self.sites[next];
            Some((laps + spot.place - site.place, site))
        })
    }

    /// The same of those at and after it.
    fn after(&self, spot: Spot) -> impl Iterator<Item = (usize, &Site)> {
        let Line { segment, sites } = &self.lines[spot.line];
        let at = spot.after.checked_sub(1).filter(|&at| self.sites[at].place == spot.place);
        let (mut next, mut laps) = (at.unwrap_or(spot.after), 0);
        std::iter::from_fn(move || {
            if next >= sites.end {
                if !segment.closed || sites.is_empty() {
                    return None;
                }
                (next, laps) = (sites.start, laps + segment.len());
            }
            let site = &self.sites[next];
            next += 1;
            Some((laps + site.place - spot.place, site))
        })
    }

    /// What the moves bring to a place.
    fn arriving(&self, source: &impl Fn(usize) -> f64, moves: Moves<'_>, to: Spot) -> f64 {
        let mut sum = self.straight(source, moves, to, 0, 1.0);
        let reach = moves.reach();
        for (away, site) in self.before(to).take_while(|&(away, _)| away < reach) {
            for &fork in &self.from[site.from.clone()] {
                let link = self.sites[fork].link;
                sum += self.straight(source, moves, self.at_site(fork), away + 1, link);
            }
        }
        sum
    }

    /// What the moves bring along a segment to a place, from which `share` of it goes on, by
    /// `made` of the places of each move.
    fn straight(
        &self,
        source: &impl Fn(usize) -> f64,
        moves: Moves<'_>,
        to: Spot,
        made: usize,
        share: f64,
    ) -> f64 {
        let segment = &self.lines[to.line].segment;
        let (mut sum, mut share) = (0.0, share);
        let mut passed = self.before(to).peekable();
        // What goes on from the place itself is known.
        passed.next_if(|&(away, _)| away == 0);
        for Move { places, weight } in moves.iter() {
            let Some(way) = places.checked_sub(made) else { continue };
            let Some(from) = segment.onward(to.place, -(way as isize)) else { break };
            while let Some((_, site)) = passed.next_if(|&(away, _)| away <= way) {
                share *= site.straight;
            }
            sum += weight * share * source(self.at(from));
        }
        sum
    }

    /// Each place from which a move by `reach` places may pass a fork, once.
    fn each_divided(&self, reach: usize, mut visit: impl FnMut(Spot)) {
        for (index, fork) in self.sites.iter().enumerate().filter(|(_, site)| site.is_fork()) {
            let mut spot = self.at_site(index);
            let segment = &self.lines[fork.line].segment;
            // The places up to the fork before belong to that one.
            let other = self.before(spot).skip(1).find(|(_, site)| site.is_fork());
            let other = other.map_or(usize::MAX, |(away, _)| away);
            for away in 0..reach.min(other) {
                let Some(place) = segment.onward(fork.place, -(away as isize)) else { break };
                if place > spot.place {
                    spot = self.spot(place);
                }
                self.seek(&mut spot, place);
                visit(spot);
            }
        }
    }

    /// Calls `visit` with the weight of each walk from a place and where it ends, `None` beyond the
    /// end of its segment.
    fn walks(&self, moves: Moves<'_>, from: Spot, mut visit: impl FnMut(f64, Option<usize>)) {
        let segment = &self.lines[from.line].segment;
        let (mut share, mut passed) = (1.0, self.after(from).peekable());
        for Move { places, weight } in moves.iter() {
            while let Some((_, site)) = passed.next_if(|&(away, _)| away < places) {
                share *= site.straight;
            }
            visit(weight * share, segment.onward(from.place, places as isize));
        }
        let (mut share, reach) = (1.0, moves.reach());
        for (away, fork) in self.after(from).take_while(|&(away, _)| away < reach) {
            for &to in &self.to[fork.to.clone()] {
                let Site { place, line, .. } = self.sites[to];
                let segment = &self.lines[line].segment;
                for Move { places, weight } in moves.iter().filter(|by| by.places > away) {
                    let end = segment.onward(place, (places - 1 - away) as isize);
                    visit(weight * share * fork.link, end);
                }
            }
            share *= fork.straight;
        }
    }
}

/// For each place, how many places before it on its segment the last one lies that follows a fork
/// or at which a link ends.
fn since(lines: &[Line], sites: &[Site], places: usize) -> Vec<u8> {
    let mut since = vec![u8::MAX; places];
    for site in sites {
        let next = lines[site.line].segment.onward(site.place, 1).filter(|_| site.is_fork());
        let end = Some(site.place).filter(|_| !site.from.is_empty());
        next.into_iter().chain(end).for_each(|place| since[place] = 0);
    }
    for Line { segment, .. } in lines {
        let mut last = u8::MAX;
        for _ in 0..if segment.closed { 2 } else { 1 } {
            for since in &mut since[segment.places()] {
                last = last.saturating_add(1).min(*since);
                *since = last;
            }
        }
    }
    since
}
