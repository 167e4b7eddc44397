//! Sections 1.1 to 1.5 for one query, from all columns of the run.

use surefix::{Config, Floor, Gradient, Sequence};

use super::{Query, Road};

pub(crate) struct Paper {
    config: Config,
    roads: Vec<Road>,
    columns: Vec<Vec<f32>>,
    /// The single match of each query, and whether it is trusted.
    matches: Vec<(usize, bool)>,
    /// The first query of the drive since the last gap.
    since: usize,
    /// The least distance of all columns that say something.
    least: f32,
}

pub(crate) struct Answer {
    pub(crate) trusted: bool,
    pub(crate) blank: bool,
    pub(crate) single: (usize, f32),
    pub(crate) peak: (usize, f32),
    pub(crate) sequence: Option<Sequence>,
}

/// `round(v k)`, halves up.
fn steps(speed: f64, k: usize) -> i64 {
    (speed * k as f64 + 0.5).floor() as i64
}

impl Paper {
    pub(crate) fn new(config: Config, roads: Vec<Road>) -> Self {
        let (columns, matches) = (Vec::new(), Vec::new());
        Self { config, roads, columns, matches, since: 0, least: f32::INFINITY }
    }

    pub(crate) fn queries(&self) -> usize {
        self.columns.len()
    }

    /// The number of a place's road, and the road.
    pub(crate) fn road_of(&self, place: usize) -> (usize, Road) {
        let found = self.roads.iter().enumerate().find(|(_, road)| road.has(place));
        found.map(|(number, road)| (number, *road)).expect("a place of the route")
    }

    pub(crate) fn next(&mut self, query: &Query) -> Answer {
        if query.broken {
            self.since = self.columns.len();
        }
        let d = &query.column;
        self.columns.push(d.clone());
        let mut single = (0, d[0]);
        for (place, &distance) in d.iter().enumerate() {
            if distance < single.1 {
                single = (place, distance);
            }
        }
        let mut peak = (0, f32::NEG_INFINITY);
        for place in 0..d.len() {
            let sum = self.enhanced(place);
            if sum > peak.1 {
                peak = (place, sum);
            }
        }
        let blank = d.iter().all(|&x| x == d[0]);
        let (_, road) = self.road_of(single.0);
        let near = road.has(peak.0) && road.apart(single.0, peak.0) <= self.config.tolerance;
        let trusted = !blank && query.trusted.unwrap_or(near && road.count() > 1);
        self.matches.push((single.0, trusted));
        if !blank && single.1 < self.least {
            self.least = single.1;
        }
        Answer { trusted, blank, single, peak, sequence: self.sequence() }
    }

    /// Eq. 1 at a place of query `j`.
    fn gradient(&self, j: usize, place: usize, road: Road) -> f32 {
        let d = &self.columns[j];
        let at = |back| road.back(place, back).filter(|_| road.count() > 1).map(|place| d[place]);
        match (at(1), at(-1)) {
            (Some(before), Some(after)) => match self.config.gradient {
                Gradient::Halved => 0.5 * (after + before) - d[place],
                _ => (after + before) - 2.0 * d[place],
            },
            (None, Some(only)) | (Some(only), None) => only - d[place],
            (None, None) => 0.0,
        }
    }

    /// 1.2 at a place of the newest query.
    fn enhanced(&self, place: usize) -> f32 {
        let (_, road) = self.road_of(place);
        let j = self.columns.len() - 1;
        let d = &self.columns[j][road.first..road.end];
        let open = !road.closed && d.len() > 1 && self.config.gradient == Gradient::Halved;
        let ends = || (d[1] - d[0]) + (d[d.len() - 2] - d[d.len() - 1]);
        let mean = if open { ends() / (2 * d.len()) as f32 } else { 0.0 };
        let mut sum = self.gradient(j, place, road);
        for k in 1..self.config.smoothing {
            let query = j.checked_sub(k).filter(|&query| query >= self.since);
            sum += match (query, road.back(place, k as i64)) {
                (Some(query), Some(at)) => self.gradient(query, at, road),
                _ => mean,
            };
        }
        sum
    }

    /// 1.4 and 1.5.
    fn sequence(&self) -> Option<Sequence> {
        let length = self.config.sequence_length;
        let (j, least) = (self.columns.len() - 1, f64::from(self.least));
        if j + 1 < self.since + length {
            return None;
        }
        let floor = match self.config.floor {
            Floor::Fixed(floor) if floor < least => floor,
            _ => least,
        };
        let mut best: Option<(f64, Sequence)> = None;
        for &speed in &self.config.speeds {
            for place in 0..self.columns[j].len() {
                let (_, road) = self.road_of(place);
                let cells = (0..length).rev().map(|k| (j - k, road.back(place, steps(speed, k))));
                let Some(cells) = cells.map(|(q, at)| Some((q, at?))).collect::<Option<Vec<_>>>()
                else {
                    continue;
                };
                let (mut sum, mut anchors) = (0.0, 0);
                for (query, at) in cells {
                    let mut distance = self.columns[query][at];
                    if self.matches[query] == (at, true) {
                        let raw = f64::from(distance);
                        distance = (raw - self.config.weight * (raw - floor)) as f32;
                        anchors += 1;
                    }
                    sum += f64::from(distance);
                }
                let better = |(other, at): &(f64, Sequence)| {
                    sum < *other || sum == *other && place < at.place
                };
                if best.as_ref().is_none_or(better) {
                    let score = (sum / length as f64) as f32;
                    best = Some((sum, Sequence { place, score, anchors, speed }));
                }
            }
        }
        best.map(|(_, sequence)| sequence)
    }
}
