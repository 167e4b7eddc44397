//! The tracker's filter (docs/method.md, 1.9 and 1.14) with a probability for each pair of places,
//! written as plainly as can be: it shares no code with the library. Its transposed gives the
//! alignment (1.10).

use surefix::{Motion, Segment, Segments};

use crate::evidence::{Said, correlation};

/// Moves by more places do not follow links.
const FARTHEST: i64 = 64;

/// The segment of a place.
pub(crate) fn of(route: &Segments, place: usize) -> Segment {
    *route.iter().find(|segment| segment.places().contains(&place)).unwrap()
}

/// The place that lies `by` places on along the segment.
pub(crate) fn along(route: &Segments, place: usize, by: i64) -> Option<usize> {
    let segment = of(route, place);
    let (len, to) = (segment.len() as i64, (place - segment.start) as i64 + by);
    let to = if segment.closed { to.rem_euclid(len) } else { to };
    (0..len).contains(&to).then(|| segment.start + to as usize)
}

/// Where a move by `by` places ends and how likely: it follows one link at most.
fn walks(route: &Segments, place: usize, by: i64) -> Vec<(usize, f64)> {
    if by.abs() > FARTHEST {
        return along(route, place, by).map(|to| (to, 1.0)).into_iter().collect();
    }
    let (mut ends, mut at, mut share) = (Vec::new(), place, 1.0);
    for made in 1..=by.abs() {
        let turns = route.links().iter().filter_map(|&(from, to)| {
            let (from, to) = if by > 0 { (from, to) } else { (to, from) };
            (from == at).then_some(to)
        });
        let (turns, next): (Vec<usize>, _) = (turns.collect(), along(route, at, by.signum()));
        share /= (turns.len() + usize::from(next.is_some())).max(1) as f64;
        for turn in turns {
            let end = along(route, turn, by.signum() * (by.abs() - made));
            ends.extend(end.map(|end| (end, share)));
        }
        match next {
            Some(next) => at = next,
            None => return ends,
        }
    }
    ends.push((at, share));
    ends
}

/// The moves by about `places` places, each with its probability: jitter reaches `reach` places.
fn moves(places: f64, jitter: f64, reach: i64) -> Vec<(i64, f64)> {
    let (whole, part) = (places.floor() as i64, places - places.floor());
    let jitter = jitter.min(0.25 / reach as f64);
    let astray = |off: i64| match off.abs() {
        0 => 1.0 - 2.0 * reach as f64 * jitter,
        off if off <= reach => jitter,
        _ => 0.0,
    };
    let off = -reach..=reach + 1;
    off.map(|off| (whole + off, (1.0 - part) * astray(off) + part * astray(off - 1))).collect()
}

/// The probability to change from one speed to another.
fn switched(motion: &Motion, from: usize, to: usize) -> f64 {
    let last = motion.speeds.len() - 1;
    match from.abs_diff(to) {
        _ if last == 0 => 1.0,
        0 => 1.0 - motion.switching,
        1 if from == 0 || from == last => motion.switching,
        1 => motion.switching / 2.0,
        _ => 0.0,
    }
}

/// What is before a query.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Gap {
    Not,
    /// A gap in which the robot may have gone anywhere.
    Unknown,
    /// One in which it moved by so many places.
    Bridged(f64),
}

/// A query as the filter sees it.
pub(crate) struct Query {
    evidence: Vec<f64>,
    /// The moves of each speed, and the share of the belief that moves.
    moves: Vec<Vec<(i64, f64)>>,
    moved: f64,
    pub(crate) advance: Option<f64>,
    /// To leave, to restart and to rejoin.
    rates: [f64; 3],
    /// It is the first of the drive or after a gap.
    pub(crate) fresh: bool,
}

/// The belief for each speed and place, and off the map.
#[derive(Clone)]
pub(crate) struct State {
    pub(crate) on: Vec<Vec<f64>>,
    pub(crate) off: f64,
}

impl State {
    pub(crate) fn new(speeds: usize, places: usize, of: f64, off: f64) -> Self {
        Self { on: vec![vec![of; places]; speeds], off }
    }

    /// All speeds are equally likely before they change.
    pub(crate) fn start(motion: &Motion, places: usize) -> Self {
        let speeds = motion.speeds.len();
        let mut start = Self::new(speeds, places, 0.95 / (speeds * places) as f64, 0.05);
        for (to, row) in start.on.iter_mut().enumerate() {
            let share: f64 = (0..speeds).map(|from| switched(motion, from, to)).sum();
            for belief in row {
                *belief *= share;
            }
        }
        start
    }

    pub(crate) fn in_place(&self, place: usize) -> f64 {
        self.on.iter().map(|row| row[place]).sum()
    }

    /// Its product with another, number by number.
    pub(crate) fn times(&self, other: &Self) -> Self {
        let row = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| a * b).collect();
        let on = self.on.iter().zip(&other.on).map(row).collect();
        Self { on, off: self.off * other.off }
    }

    fn total(&self) -> f64 {
        self.on.iter().flatten().sum::<f64>() + self.off
    }

    pub(crate) fn scaled(mut self) -> Self {
        let total = self.total();
        self.on.iter_mut().flatten().for_each(|belief| *belief /= total);
        self.off /= total;
        self
    }
}

/// The queries of a drive, with what is known of its moves.
pub(crate) fn queries(
    said: &[Said],
    motion: &Motion,
    advance: &[Option<f64>],
    gaps: &[Gap],
) -> Vec<Query> {
    let mut travelled = 0.0_f64;
    let mut viewed: Option<&[f64]> = None;
    let mut queries = Vec::new();
    for (j, said) in said.iter().enumerate() {
        let (gap, mut a) = (gaps[j], advance[j]);
        let fresh = j == 0 || gap == Gap::Unknown;
        if let Gap::Bridged(bridge) = gap {
            a = Some(bridge + a.unwrap_or(0.0));
        }
        let asked = a.is_none() && motion.repeat < 1.0;
        let alike = viewed.filter(|_| asked).and_then(|before: &[f64]| {
            // A place that was not there yet has shown nothing.
            let mut before = before.to_vec();
            before.resize(said.view.len(), 0.0);
            correlation(&before, &said.view)
        });
        // How much it teaches, moves and makes happen, and the odometry's jitter.
        let [weight, moved, happens, jitter] = match (a, alike) {
            _ if fresh => [1.0; 4],
            (Some(a), _) => {
                let way = a.abs().clamp(0.05, 1.0);
                if motion.by_distance {
                    [way, 1.0, way, a.abs().max(0.05)]
                } else {
                    [way, 1.0, 1.0, 1.0]
                }
            }
            (None, Some(alike)) => {
                let new = (1.0 - alike) / (1.0 - motion.repeat);
                let moved = (2.0 * new).clamp(0.0, 1.0);
                [new.clamp(0.1, 1.0), moved, moved.max(0.1), 1.0]
            }
            (None, None) => [1.0; 4],
        };
        let evidence = said.evidence.iter().map(|z| (-motion.evidence * weight * z).exp());
        let evidence = evidence.collect();
        if said.tells {
            viewed = Some(&said.view);
        } else if fresh {
            viewed = None;
        }
        let of_speed = |(speed, &v): (usize, &f64)| {
            let beside = [speed.checked_sub(1), Some(speed + 1)].into_iter().flatten();
            let gap = |other| motion.speeds.get(other).map(|other: &f64| (other - v).abs());
            let widest = beside.filter_map(gap).fold(0.0, f64::max) * motion.pace;
            let jitter = if v == 0.0 { 0.0 } else { motion.jitter };
            moves(v * motion.pace, jitter, (widest / 2.0).ceil().max(1.0) as i64)
        };
        let moves = match a {
            None => motion.speeds.iter().enumerate().map(of_speed).collect(),
            Some(a) => {
                let to = travelled + a;
                let rounded = to.round_ties_even() - travelled.round_ties_even();
                travelled = to;
                let by = if motion.by_distance { a } else { rounded };
                vec![moves(by, (motion.jitter * jitter).min(0.25), 1); motion.speeds.len()]
            }
        };
        let rates = [motion.leave, motion.restart, motion.rejoin].map(|rate| rate * happens);
        queries.push(Query { evidence, moves, moved, advance: a, rates, fresh });
    }
    queries
}

impl Query {
    /// The state after this query and the change of speed, not yet divided by its total, and the
    /// speed in each place.
    pub(crate) fn step(
        &self,
        before: &State,
        motion: &Motion,
        route: &Segments,
    ) -> (State, Vec<f64>) {
        let (speeds, places) = (motion.speeds.len(), route.places());
        let mut moved = vec![vec![0.0; places]; speeds];
        for ((row, moved), moves) in before.on.iter().zip(&mut moved).zip(&self.moves) {
            for (place, belief) in row.iter().enumerate().filter(|(_, belief)| **belief != 0.0) {
                for &(by, chance) in moves {
                    for (to, share) in walks(route, place, by) {
                        moved[to] += chance * share * belief;
                    }
                }
            }
        }
        let [leave, restart, rejoin] = self.rates;
        let on = before.total() - before.off;
        let left = self.moved * (on - moved.iter().flatten().sum::<f64>());
        let keep = (1.0 - leave) * (1.0 - restart);
        let anew = rejoin * before.off + (1.0 - leave) * restart * on + keep * left;
        let mut after = State::new(speeds, places, 0.0, 0.0);
        let mut speed_in = vec![0.0; places];
        for place in 0..places {
            let moving =
                |v: usize| keep * self.moved * moved[v][place] + anew / (speeds * places) as f64;
            let staying = |v: usize| keep * (1.0 - self.moved) * before.on[v][place];
            let predicted: Vec<f64> = (0..speeds).map(|v| moving(v) + staying(v)).collect();
            let fast = (0..speeds).map(|v| moving(v) * motion.speeds[v] * motion.pace).sum::<f64>();
            speed_in[place] = self.advance.unwrap_or(fast / predicted.iter().sum::<f64>());
            for to in 0..speeds {
                // After a known advance, all speeds are equally likely.
                let each = predicted.iter().sum::<f64>() / speeds as f64;
                let known = self.advance.is_some();
                let of = |v: usize| if known { each } else { predicted[v] };
                let share = |v: usize| of(v) * switched(motion, v, to);
                after.on[to][place] = (0..speeds).map(share).sum::<f64>() * self.evidence[place];
            }
        }
        let mean = self.evidence.iter().sum::<f64>() / places as f64;
        after.off = ((1.0 - rejoin) * before.off + leave * on) * mean;
        (after, speed_in)
    }

    /// How likely this query and those after it are from each state before it: the step's answer to
    /// each of them alone.
    pub(crate) fn back(&self, later: &State, motion: &Motion, route: &Segments) -> State {
        let (speeds, places) = (motion.speeds.len(), route.places());
        let none = State::new(speeds, places, 0.0, 0.0);
        let likely = |from: &State| self.step(from, motion, route).0.times(later).total();
        let mut before = none.clone();
        for (v, row) in before.on.iter_mut().enumerate() {
            for (place, out) in row.iter_mut().enumerate() {
                let mut from = none.clone();
                from.on[v][place] = 1.0;
                *out = likely(&from);
            }
        }
        before.off = likely(&State { off: 1.0, ..none });
        before.scaled()
    }
}
