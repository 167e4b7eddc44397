//! Section 1.9: the filter over places and speeds, all places at once.

use surefix::{Motion, Segments, Track};

use super::sums::{about, blocks, chunks, exp, lanes, spans};
use super::{Query, Road};

/// The belief may be off by this much if there are links, by the order of sums.
const ROUNDING: f64 = 1e-9;

pub(crate) struct Filter {
    motion: Motion,
    tolerance: usize,
    roads: Vec<Road>,
    links: Vec<(usize, usize)>,
    /// 1: the sum of each place's distances, and how many they are.
    hubs: Vec<f64>,
    columns: u64,
    /// The belief of each speed after its change, times `scale`: one row if all are equally likely.
    rows: Vec<Vec<f64>>,
    scale: f64,
    on: f64,
    off: f64,
    way: f64,
    gap: Option<f64>,
    fresh: bool,
    /// The corrected distances of the query before, unless they are constant.
    view: Option<Vec<f64>>,
    /// The newest answer: the belief in each place, and the speed in it.
    places: Vec<f64>,
    speed: Vec<f64>,
}

/// A move and its probability.
type Tap = (i64, f64);

/// How likely a move ends `off` places from its target, if jitter reaches `reach` places.
fn astray(off: i64, reach: i64, jitter: f64) -> f64 {
    let jitter = jitter.min(0.25 / reach as f64);
    if off == 0 {
        1.0 - 2.0 * jitter * reach as f64
    } else if off.abs() <= reach {
        jitter
    } else {
        0.0
    }
}

impl Filter {
    pub(crate) fn new(motion: Motion, tolerance: usize, segments: &Segments) -> Self {
        let count = segments.places();
        let mut filter = Self {
            motion,
            tolerance,
            roads: Road::all(segments),
            links: segments.links().to_vec(),
            hubs: vec![0.0; count],
            columns: 0,
            rows: Vec::new(),
            scale: 0.0,
            on: 0.0,
            off: 0.0,
            way: 0.0,
            gap: None,
            fresh: true,
            view: None,
            places: Vec::new(),
            speed: Vec::new(),
        };
        filter.anywhere();
        filter
    }

    /// At the start, and after a gap of an unknown advance.
    fn anywhere(&mut self) {
        let count = self.hubs.len();
        self.rows = vec![vec![1.0 / count as f64; count]];
        (self.scale, self.on, self.off) = (1.0 - 0.05, 1.0 - 0.05, 0.05);
        (self.gap, self.fresh, self.view) = (None, true, None);
    }

    pub(crate) fn next(&mut self, query: &Query) {
        for gap in &query.gaps {
            match gap {
                None => self.anywhere(),
                Some(by) => self.gap = Some(self.gap.unwrap_or(0.0) + by),
            }
        }
        let gap = self.gap.take();
        let advance = query.advance.map_or(gap, |by| Some(by + gap.unwrap_or(0.0)));
        let (z, alike) = match self.standardised(&query.column) {
            None => (None, None),
            Some((x, z)) => (Some(z), self.alike(x)),
        };
        self.follow(z, advance, alike);
    }

    /// 1 and the first half of 2: the distances corrected for hubs, unless they are all equal, and
    /// their `z`; `None` if the column says nothing.
    fn standardised(&mut self, d: &[f32]) -> Option<(Option<Vec<f64>>, Vec<f64>)> {
        if d.iter().all(|&x| x == d[0]) {
            return None;
        }
        let count = d.len() as f64;
        self.columns += 1;
        for (hub, &x) in self.hubs.iter_mut().zip(d) {
            *hub += f64::from(x);
        }
        let share = 1.0 / (self.columns as f64 + self.motion.hubness);
        let x = d.iter().zip(&self.hubs).map(|(&d, hub)| f64::from(d) - share * hub);
        let x: Vec<f64> = x.collect();
        let distance = blocks(d.len(), |i| f64::from(d[i])) / count;
        let mean = blocks(d.len(), |i| x[i]) / count;
        let std = (about(&x, &x) / count).sqrt();
        if std <= 1e-12 * (distance.abs() + (distance - mean).abs()) {
            return Some((None, vec![0.0; d.len()]));
        }
        let inverse = 1.0 / std;
        let z = x.iter().map(|x| (x - mean) * inverse).collect();
        Some((Some(x), z))
    }

    /// The correlation with the view before, if views are compared.
    fn alike(&mut self, x: Option<Vec<f64>>) -> Option<f64> {
        if self.motion.repeat >= 1.0 {
            return None;
        }
        let before = std::mem::replace(&mut self.view, x)?;
        let x = self.view.as_ref()?;
        Some(about(x, &before) / (about(x, x).sqrt() * about(&before, &before).sqrt()))
    }

    /// The rest of 2, and 3 to 5.
    fn follow(&mut self, z: Option<Vec<f64>>, advance: Option<f64>, alike: Option<f64>) {
        let Motion { repeat, by_distance, clip, leave, restart, rejoin, pace, .. } = self.motion;
        // How much of the evidence counts, of the belief moves, of the rates happens, of jitter.
        let (mut counts, mut moves, mut happens, mut shakes) = (1.0, 1.0, 1.0, 1.0);
        match (advance, alike) {
            _ if self.fresh => {}
            (Some(by), _) => {
                counts = by.abs().clamp(0.05, 1.0);
                if by_distance {
                    (happens, shakes) = (counts, by.abs().max(0.05));
                }
            }
            (None, Some(r)) => {
                let new = ((1.0 - r) / (1.0 - repeat)).clamp(0.0, 1.0);
                (counts, moves) = (new.max(0.1), (2.0 * new).min(1.0));
                happens = moves.max(0.1);
            }
            (None, None) => {}
        }
        let weight = self.motion.evidence * counts;
        let count = self.hubs.len();
        let evidence = |z: f64| exp(-weight * z.max(-clip).min(clip));
        let e: Vec<f64> = match z {
            Some(z) => z.into_iter().map(evidence).collect(),
            None => vec![1.0; count],
        };

        // 3 For each speed, or the advance: the belief before, its share, and the moves.
        let speeds = self.motion.speeds.len();
        let before = std::mem::take(&mut self.rows);
        let mut lines: Vec<(Vec<f64>, f64, Vec<Tap>)> = Vec::new();
        if let Some(by) = advance {
            let mut sum = before[0].clone();
            for row in &before[1..] {
                sum.iter_mut().zip(row).for_each(|(sum, x)| *sum += x);
            }
            lines.push((sum, 1.0, self.known(by, shakes)));
        } else {
            for speed in 0..speeds {
                let [below, own, above] = self.switches(speed);
                let joint = (before[0].clone(), (below + own + above) / speeds as f64);
                let one = before.len() == 1;
                let (row, share) = if one { joint } else { (before[speed].clone(), 1.0) };
                lines.push((row, share, self.taps(speed)));
            }
        }

        // 4
        let mut lost = vec![0.0; spans(0, count, 4096).count()];
        for (row, share, taps) in &lines {
            self.lost(row, taps, *share, &mut lost);
        }
        let left = moves * self.scale * lost.iter().sum::<f64>();
        let [leave, restart, rejoin] = [leave, restart, rejoin].map(|rate| rate * happens);
        let keep = (1.0 - leave) * (1.0 - restart);
        let anew = rejoin * self.off + (1.0 - leave) * restart * self.on + keep * left;
        let anew = anew / (lines.len() * count) as f64;
        let off = (1.0 - rejoin) * self.off + leave * self.on;
        let keep = keep * self.scale;

        // 5
        let (mut moved, mut speed) = (Vec::new(), vec![(0.0, 0.0); count]);
        for ((row, share, taps), unit) in lines.iter().zip(&self.motion.speeds) {
            // One row counts as a whole.
            let keep = if lines.len() == 1 { keep } else { keep * share };
            let mut out = self.arrived(row, taps, keep * moves);
            for place in 0..count {
                let (total, sum) = &mut speed[place];
                let moving = out[place] + anew;
                *total += moving + keep * (1.0 - moves) * row[place];
                *sum += moving * unit;
                if keep * (1.0 - moves) != 0.0 {
                    out[place] += keep * (1.0 - moves) * row[place];
                }
                out[place] = (out[place] + anew) * e[place];
            }
            moved.push(out);
        }
        let mut places = moved[0].clone();
        for row in &moved[1..] {
            places.iter_mut().zip(row).for_each(|(sum, x)| *sum += x);
        }
        let on = chunks(count, |i| places[i]);
        let off = off * (chunks(count, |i| e[i]) / count as f64);
        let total = on + off;
        (self.scale, self.on, self.off) = (1.0 / total, on / total, off / total);
        self.fresh = false;
        self.rows = if moved.len() == 1 { moved } else { self.switched(&moved) };
        self.places = places;
        let of_place = |&(total, sum): &(f64, f64)| {
            advance.unwrap_or(if total > 0.0 { pace * sum / total } else { 0.0 })
        };
        self.speed = speed.iter().map(of_place).collect();
    }

    /// The moves of a known advance.
    fn known(&mut self, by: f64, shakes: f64) -> Vec<Tap> {
        let (before, jitter) = (self.way, (self.motion.jitter * shakes).min(0.25));
        self.way += by;
        let (whole, part) = if self.motion.by_distance {
            (by.floor(), by - by.floor())
        } else {
            (self.way.round_ties_even() - before.round_ties_even(), 0.0)
        };
        let tap = |off: i64| {
            let weight = (1.0 - part) * astray(off, 1, jitter) + part * astray(off - 1, 1, jitter);
            (whole as i64 + off, weight)
        };
        [-1, 0, 1, 2].map(tap).to_vec()
    }

    /// The moves of a speed.
    fn taps(&self, speed: usize) -> Vec<Tap> {
        let Motion { speeds, pace, jitter, .. } = &self.motion;
        let apart = |other: Option<&f64>| other.map_or(0.0, |other| (other - speeds[speed]).abs());
        let before = speed.checked_sub(1).and_then(|before| speeds.get(before));
        let widest = apart(before).max(apart(speeds.get(speed + 1)));
        let reach = ((widest * pace / 2.0).ceil() as i64).max(1);
        let places = speeds[speed] * pace;
        if places == 0.0 {
            return vec![(0, 1.0)];
        }
        let (whole, part) = (places.floor() as i64, places.fract());
        let tap = |shift: i64| {
            let of = |target: i64| astray(shift - target, reach, *jitter);
            (shift, (1.0 - part) * of(whole) + part * of(whole + 1))
        };
        (whole - reach..=whole + 1 + reach).map(tap).filter(|tap| tap.1 > 0.0).collect()
    }

    /// Which shares of the speed below, of its own and of the one above turn into a speed.
    fn switches(&self, speed: usize) -> [f64; 3] {
        let (count, switching) = (self.motion.speeds.len(), self.motion.switching);
        if count == 1 {
            return [0.0, 1.0, 0.0];
        }
        let gives = |from: usize| {
            let neighbours = usize::from(from > 0) + usize::from(from + 1 < count);
            if neighbours == 1 { switching } else { switching / 2.0 }
        };
        let below = if speed == 0 { 0.0 } else { gives(speed - 1) };
        let above = if speed + 1 == count { 0.0 } else { gives(speed + 1) };
        [below, 1.0 - switching, above]
    }

    fn switched(&self, moved: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let row = |speed: usize| {
            let [a, b, c] = self.switches(speed);
            let (below, above) = (&moved[speed.saturating_sub(1)], moved.get(speed + 1));
            let (own, above) = (&moved[speed], above.unwrap_or(&moved[speed]));
            (0..own.len()).map(|i| a * below[i] + b * own[i] + c * above[i]).collect()
        };
        (0..moved.len()).map(row).collect()
    }

    fn road(&self, place: usize) -> Road {
        *self.roads.iter().find(|road| road.has(place)).expect("a place of the route")
    }

    /// What arrives at each place, times `factor`.
    fn arrived(&self, row: &[f64], taps: &[Tap], factor: f64) -> Vec<f64> {
        if !self.links.is_empty() {
            let mut out = vec![0.0; row.len() + 1];
            self.walk(row, taps, factor, &mut out);
            out.pop();
            return out;
        }
        let arrived = |place: usize| {
            let road = self.road(place);
            let from = taps.iter().map(|&(shift, weight)| (road.back(place, shift), weight));
            from.fold(0.0, |sum, (from, w)| sum + from.map_or(0.0, |at| factor * w * row[at]))
        };
        (0..row.len()).map(arrived).collect()
    }

    /// Adds to each block of places the belief that leaves the route from there, by its ends.
    fn lost(&self, row: &[f64], taps: &[Tap], share: f64, blocks: &mut [f64]) {
        if !self.links.is_empty() {
            let mut out = vec![0.0; row.len() + 1];
            self.walk(row, taps, share, &mut out);
            blocks[0] += out[row.len()];
            return;
        }
        for road in self.roads.iter().filter(|road| !road.closed) {
            for &(shift, weight) in taps {
                let leaves = |&place: &usize| road.back(place, shift.saturating_neg()).is_none();
                let leaving: Vec<usize> = (road.first..road.end).filter(leaves).collect();
                for of_block in leaving.chunk_by(|a, b| a / 4096 == b / 4096) {
                    let mass: f64 = of_block.iter().map(|&place| row[place]).sum();
                    blocks[of_block[0] / 4096] += (share * weight) * mass;
                }
            }
        }
    }

    /// Every walk from every place (method 1.14). The last number is for those that leave the route.
    fn walk(&self, row: &[f64], taps: &[Tap], factor: f64, out: &mut [f64]) {
        for (place, &mass) in row.iter().enumerate() {
            for &(shift, weight) in taps {
                self.step(place, shift, shift.abs() <= 64, factor * weight * mass, out);
            }
        }
    }

    fn step(&self, place: usize, left: i64, divides: bool, share: f64, out: &mut [f64]) {
        let road = self.road(place);
        if left == 0 || !divides {
            let end = road.back(place, left.saturating_neg()).unwrap_or(out.len() - 1);
            out[end] += share;
            return;
        }
        let one = left.signum();
        let ways = self.links.iter().filter_map(|&(from, to)| {
            let (from, to) = if one > 0 { (from, to) } else { (to, from) };
            (from == place).then_some(to)
        });
        let (ways, onward): (Vec<usize>, _) = (ways.collect(), road.back(place, -one));
        let share = share / (ways.len() + usize::from(onward.is_some())).max(1) as f64;
        match onward {
            Some(next) => self.step(next, left - one, true, share, out),
            None if ways.is_empty() => out[out.len() - 1] += share,
            None => {}
        }
        for to in ways {
            self.step(to, left - one, false, share, out);
        }
    }

    /// 6 Fails unless `track` is the answer.
    pub(crate) fn check(&self, track: &Track, belief: &[f64]) {
        let exact = self.links.is_empty();
        let same = |got: f64, expected: f64| {
            if exact {
                got.to_bits() == expected.to_bits()
            } else {
                (got - expected).abs() <= ROUNDING
            }
        };
        for (place, &got) in belief.iter().enumerate() {
            let sum: f64 = self.rows.iter().map(|row| row[place]).sum();
            assert!(same(got, self.scale * sum), "place {place}: {got}, {}", self.scale * sum);
        }
        assert!(same(track.off_map, self.off), "{track:?}, expected {}", self.off);
        let mut place = 0;
        for (at, &mass) in self.places.iter().enumerate() {
            place = if mass > self.places[place] { at } else { place };
        }
        if exact {
            assert_eq!(track.place, place);
        }
        let short = self.scale * (self.places[place] - self.places[track.place]);
        assert!(short <= ROUNDING, "{track:?}, and {place} is more probable");
        let confidence = self.near(track.place);
        assert!(same(track.confidence, confidence), "{track:?}, expected {confidence}");
        // A speed is a ratio: of a belief near 0, rounding makes any.
        let (speed, mass) = (self.speed[track.place], self.scale * self.places[track.place]);
        let known = exact || mass > 1e-3;
        assert!(!known || same(track.speed, speed), "{track:?}, expected {speed}");
        self.check_interval(track);
    }

    /// The belief within the tolerance of a place: of a closed road, that beyond the seam is a sum
    /// of its own.
    fn near(&self, place: usize) -> f64 {
        let road = self.road(place);
        let of = |from: usize, to: usize| {
            let mut sum = 0.0;
            for (a, b) in spans(from, to, 256) {
                let chunk = &self.places[a..b];
                if a % 256 == 0 && (b % 256 == 0 || b == self.places.len()) {
                    sum += lanes(chunk.iter().copied());
                } else {
                    for mass in chunk {
                        sum += mass;
                    }
                }
            }
            sum
        };
        let all = road.closed && self.tolerance >= road.count() / 2;
        if !road.closed || all {
            let reach = if all { road.count() } else { self.tolerance };
            let from = place.saturating_sub(reach).max(road.first);
            let to = place.saturating_add(reach).saturating_add(1).min(road.end);
            return self.scale * of(from, to);
        }
        let reach = self.tolerance as i64;
        let ends = (road.back(place, reach), road.back(place, -reach));
        let (Some(from), Some(to)) = ends else { return f64::NAN };
        if from <= to {
            return self.scale * of(from, to + 1);
        }
        self.scale * (of(from, road.end) + of(road.first, to + 1))
    }

    /// 2.5 % of the belief at most lie on either side of the interval, and more with its ends. (Of
    /// at most 65,536 places.)
    fn check_interval(&self, track: &Track) {
        let (count, road) = (self.places.len(), self.road(track.place));
        let round = road.closed && self.roads.len() == 1;
        let seam = if round { (track.place + count.div_ceil(2)) % count } else { 0 };
        let along = |place: usize| (place + count - seam) % count;
        let (low, high) = (along(track.interval.0), along(track.interval.1));
        let middle = along(track.place);
        assert!(low <= middle && middle <= high, "{track:?}");
        let mass = |at: usize| self.scale * self.places[(at + seam) % count];
        let sum = |from: usize, to: usize| (from..to).map(mass).sum::<f64>();
        let tail = 0.025 * self.on;
        assert!(sum(0, low) <= tail + ROUNDING, "{track:?}");
        assert!(sum(high + 1, count) <= tail + ROUNDING, "{track:?}");
        assert!(low == middle || sum(0, low + 1) >= tail - ROUNDING, "{track:?}");
        assert!(high == middle || sum(high, count) >= tail - ROUNDING, "{track:?}");
    }
}
