//! Target `matcher`, with and without a tracker: a stream on all instruction sets, the batch and the oracle give
//! the same bits.

use arbitrary::{Result, Unstructured};
use ndarray::Array2;
use surefix::{
    Config, Drive, Error, Fix, Floor, Given, Isa, Matcher, Run, Segments, align_distances,
    match_distances, quiet,
};

use crate::bits::bits;
use crate::input::{advance, column, config, motion, rarely, route};
use crate::oracle::{Oracle, Query};

/// Queries of one input, at most.
const LONGEST: usize = 12;

pub(crate) fn matcher(data: &[u8]) {
    let _ = run(&mut Unstructured::new(data));
}

/// A stream on every instruction set, and what it was told since the last reset.
struct Stream {
    config: Config,
    segments: Segments,
    matchers: Vec<Matcher>,
    oracle: Oracle,
    queries: Vec<Query>,
    fixes: Vec<Fix>,
    /// The gap before the next query.
    broken: bool,
    gaps: Vec<Option<f64>>,
}

fn run(u: &mut Unstructured<'_>) -> Result<()> {
    let segments = route(u, 520)?;
    let mut config = config(u)?;
    if u.arbitrary()? {
        config.motion = Some(motion(u)?);
    }
    let matcher = match Matcher::along(segments.clone(), config.clone()) {
        Ok(matcher) => matcher,
        Err(error) => {
            refused_by_batch(&error, &config, &segments);
            return Ok(());
        }
    };
    let mut stream = Stream::new(&matcher, config, segments);
    let [flags, odometry] = [u.int_in_range(0..=2)?, u.int_in_range(0..=2)?];
    while !u.is_empty() && stream.queries.len() < LONGEST {
        match u.int_in_range(0..=15)? {
            0 | 1 => stream.gap(match odometry {
                0 => None,
                1 => Some(0.0),
                _ => u.arbitrary::<bool>()?.then(|| advance(u)).transpose()?,
            }),
            2 => stream.restore(rarely(u, 2)?),
            3 => stream.refuse(u)?,
            4 if rarely(u, 4)? => stream.reset(),
            _ => {
                let mut given = Given::default();
                if flags == 1 || flags == 2 && u.arbitrary()? {
                    given = given.trusted(u.arbitrary()?);
                }
                if odometry == 1 || odometry == 2 && u.arbitrary()? {
                    given = given.advance(advance(u)?);
                }
                let before = u.choose_index(stream.queries.len().max(1))?;
                let before = stream.queries.get(before).map(|query| &query.column[..]);
                stream.push(column(u, before, stream.segments.places())?, given);
            }
        }
    }
    stream.batch();
    Ok(())
}

/// What a stream refuses, a batch does too, in the same words.
fn refused_by_batch(error: &Error, config: &Config, segments: &Segments) {
    let distances = Array2::zeros((segments.places(), 1));
    let drive = Drive::default().along(segments);
    let batch = match_distances(distances.view(), config, drive).expect_err("refused");
    assert_eq!(batch.to_string(), error.to_string());
}

impl Stream {
    fn new(matcher: &Matcher, config: Config, segments: Segments) -> Self {
        let on = |isa| matcher.clone().with_isa(isa).expect("an available one");
        Self {
            matchers: Isa::available().map(on).collect(),
            oracle: Oracle::new(&config, &segments),
            config,
            segments,
            queries: Vec::new(),
            fixes: Vec::new(),
            broken: false,
            gaps: Vec::new(),
        }
    }

    fn push(&mut self, column: Vec<f32>, given: Given) {
        let fixes = self.matchers.iter_mut().map(|m| m.push_with(&column, given));
        let fixes: Vec<Fix> = fixes.map(|fix| fix.expect("finite distances")).collect();
        for (fix, matcher) in fixes.iter().zip(&self.matchers) {
            assert_eq!(bits(fix), bits(&fixes[0]), "{}", matcher.isa());
        }
        let beliefs: Vec<Option<Vec<f64>>> =
            self.matchers.iter().map(|m| m.belief().map(Iterator::collect)).collect();
        assert!(beliefs.iter().all(|belief| *belief == beliefs[0]));
        let query = Query {
            column,
            trusted: given.trusted,
            advance: given.advance,
            broken: std::mem::take(&mut self.broken),
            gaps: std::mem::take(&mut self.gaps),
        };
        self.oracle.check(&query, &fixes[0], beliefs[0].clone());
        self.queries.push(query);
        self.fixes.push(fixes[0]);
    }

    fn gap(&mut self, by: Option<f64>) {
        for matcher in &mut self.matchers {
            match by {
                None => matcher.gap(),
                Some(by) => matcher.gap_with_advance(by).expect("a finite advance"),
            }
        }
        self.broken = true;
        self.gaps.push(by);
    }

    /// One of the matchers goes on from its snapshot, or is a copy of itself.
    fn restore(&mut self, copy: bool) {
        let last = self.matchers.pop().expect("the scalar one at least");
        let isa = last.isa();
        let next = if copy {
            last.clone()
        } else {
            let bytes = last.snapshot().expect("a small state");
            let next = Matcher::restore(&bytes, Some(&self.config)).expect("its own snapshot");
            assert!(next.snapshot().expect("a small state") == bytes);
            next.with_isa(isa).expect("it was available")
        };
        assert_eq!((next.frames(), next.segments()), (last.frames(), last.segments()));
        self.matchers.insert(0, next);
    }

    /// A query that is refused changes nothing.
    fn refuse(&mut self, u: &mut Unstructured<'_>) -> Result<()> {
        let n = self.segments.places();
        let mut column = column(u, None, n)?;
        let mut given = Given::default();
        match u.int_in_range(0..=3)? {
            0 => column.push(0.0),
            1 => drop(column.pop()),
            2 => given = given.advance([f64::NAN, f64::INFINITY, 2e12][u.int_in_range(0..=2)?]),
            _ => column[u.choose_index(n)?] = [f32::NAN, f32::INFINITY][u.int_in_range(0..=1)?],
        }
        for matcher in &mut self.matchers {
            let before = matcher.snapshot().expect("a small state");
            matcher.push_with(&column, given).expect_err("a refusal");
            matcher.gap_with_advance(f64::NAN).expect_err("a refusal");
            assert!(matcher.snapshot().expect("a small state") == before);
        }
        Ok(())
    }

    fn reset(&mut self) {
        self.batch();
        self.matchers.iter_mut().for_each(Matcher::reset);
        self.oracle = Oracle::new(&self.config, &self.segments);
        self.queries.clear();
        self.fixes.clear();
        self.gaps.clear();
        self.broken = false;
    }

    /// The same queries as a batch, if a batch can say all that was said.
    fn batch(&self) {
        let (n, queries) = (self.segments.places(), &self.queries);
        let all = |known: usize| known == 0 || known == queries.len();
        let trusted: Vec<bool> = queries.iter().filter_map(|q| q.trusted).collect();
        let advance: Vec<f64> = queries.iter().filter_map(|q| q.advance).collect();
        let known = !advance.is_empty();
        let gap = |gap: &Option<f64>| *gap == known.then_some(0.0);
        let bridged = queries.iter().all(|q| q.gaps.iter().all(gap));
        if queries.is_empty() || !(all(trusted.len()) && all(advance.len()) && bridged) {
            return;
        }
        let gaps: Vec<usize> = (0..queries.len()).filter(|&j| queries[j].broken).collect();
        let distances = Array2::from_shape_fn((n, queries.len()), |(i, j)| queries[j].column[i]);
        let mut drive = Drive::default().along(&self.segments).gaps(&gaps);
        if !trusted.is_empty() {
            drive = drive.trusted(&trusted);
        }
        if known {
            drive = drive.advance(&advance);
        }
        let batch = |config: &Config| match_distances(distances.view(), config, drive);
        let run = batch(&self.config).expect("what the stream took");
        self.compare(&run, &self.fixes);
        let transposed = distances.t().as_standard_layout().into_owned();
        let again = match_distances(transposed.t(), &self.config, drive).expect("the same");
        self.compare(&again, &self.fixes);
        self.global(&batch);
        self.align(&distances, drive);
    }

    fn compare(&self, run: &Run, fixes: &[Fix]) {
        assert_eq!((run.fixes.len(), run.places()), (fixes.len(), self.segments.places()));
        for (batch, stream) in run.fixes.iter().zip(fixes) {
            assert_eq!(bits(batch), bits(stream));
        }
    }

    /// The floor of the whole run is a number that a stream can be told.
    fn global(&self, batch: &impl Fn(&Config) -> std::result::Result<Run, Error>) {
        let says = |q: &&Query| q.column.iter().any(|&x| x != q.column[0]);
        let all = self.queries.iter().filter(says).flat_map(|q| &q.column);
        let least = all.copied().fold(f32::INFINITY, f32::min);
        if least.is_finite() {
            let with = |floor| {
                let mut config = self.config.clone();
                config.floor = floor;
                config
            };
            let global = batch(&with(Floor::Global)).expect("a batch knows it");
            let fixed = batch(&with(Floor::Fixed(f64::from(least)))).expect("a number");
            self.compare(&global, &fixed.fixes);
        }
    }

    /// The last query's alignment knows what the track knew.
    fn align(&self, distances: &Array2<f32>, drive: Drive<'_>) {
        if self.config.motion.is_none() {
            return;
        }
        let at: Vec<usize> = self.fixes.iter().map(|fix| fix.place).collect();
        let aligned = align_distances(&[distances.view()], &self.config, drive, &[&at], &mut quiet);
        let aligned = aligned.expect("what the stream took");
        assert_eq!(aligned.queries.len(), at.len());
        let sure = |share: f64| (0.0..=1.0 + 1e-9).contains(&share);
        for one in &aligned.queries {
            assert!(sure(one.track.confidence) && sure(one.track.off_map), "{one:?}");
            assert!(sure(one.single_right), "{one:?}");
        }
        assert!(aligned.right[0].iter().all(|&right| sure(right)));
        let last = aligned.queries.last().zip(self.fixes.last().and_then(|fix| fix.track));
        if let Some((aligned, track)) = last {
            assert!((aligned.track.off_map - track.off_map).abs() < 1e-9, "{aligned:?} {track:?}");
            let right = aligned.track.confidence - track.confidence;
            let same = aligned.track.place == track.place;
            assert!(!same || right.abs() < 1e-9, "{aligned:?} {track:?}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use surefix::Motion;

    /// Cut at borders of blocks and beside them, closed or not; with links across a border.
    fn routes(places: usize) -> Vec<Segments> {
        let cut = |at: &[usize]| {
            let at: Vec<usize> = at.iter().copied().filter(|&at| at < places).collect();
            Segments::new(places, &at).expect("breaks in order")
        };
        let closed = |route: Segments, index| route.with_closed(&[index]).expect("three places");
        let open = cut(&[4000, 4096, 8190]);
        let links = [(4090, 4099), (4101, 12), (places - 1, 4080), (30, 4097)];
        let links: Vec<_> =
            links.into_iter().filter(|link| link.1 < places && link.0 < places).collect();
        vec![
            Segments::one(places),
            closed(Segments::one(places), 0),
            closed(cut(&[90, 4095, 8192]), 1),
            open.clone(),
            open.with_links(&links).expect("links to other places"),
        ]
    }

    /// Routes of several blocks of places, which take too long for a fuzzer.
    #[test]
    fn several_blocks_are_those_of_the_oracle() {
        let mut any = Motion::any();
        any.repeat = 0.5;
        let motions = [Motion::steady(), Motion::free(), any];
        for places in [4095, 4096, 4103, 8192, 8500] {
            for (number, segments) in routes(places).into_iter().enumerate() {
                let mut config = Config::default();
                config.motion = Some(motions[(number + places) % 3].clone());
                config.tolerance = [1, 300, 5000][(number + places / 2) % 3];
                let matcher = Matcher::along(segments.clone(), config.clone()).expect("a route");
                let mut stream = Stream::new(&matcher, config, segments);
                let mut state = places as u64;
                let mut column = vec![0.0; places];
                // A view that repeats in part, and ways beyond the ends.
                for (share, advance) in [
                    (1.0, None),
                    (0.3, None),
                    (0.3, None),
                    (1.0, Some(4200.0)),
                    (0.1, Some(-60.0)),
                    (0.2, None),
                ] {
                    for distance in &mut column {
                        state = state
                            .wrapping_mul(6_364_136_223_846_793_005)
                            .wrapping_add(1_442_695_040_888_963_407);
                        let drawn = (state >> 40) as f32 / (1 << 24) as f32;
                        *distance = (1.0 - share) * *distance + share * drawn;
                    }
                    let given = Given::default();
                    let given = advance.map_or(given, |advance| given.advance(advance));
                    stream.push(column.clone(), given);
                }
                stream.restore(false);
                stream.push(column.clone(), Given::default());
            }
        }
    }
}
