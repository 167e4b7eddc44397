//! The method once more (docs/method.md), slow and plain: whole runs from all columns so far, with
//! no window, no ring and no instruction set. It shares no code with the library.
//!
//! All numbers must be those of the library to the last bit, except along links: there it adds up
//! the walks in another order.

mod paper;
mod road;
mod sums;
mod track;

pub(crate) use road::Road;
use surefix::{Config, Fix, Segments};

/// What a query brings.
#[derive(Clone, Debug)]
pub(crate) struct Query {
    pub(crate) column: Vec<f32>,
    pub(crate) trusted: Option<bool>,
    pub(crate) advance: Option<f64>,
    /// Whether there is a gap before it, and the advances of such gaps.
    pub(crate) broken: bool,
    pub(crate) gaps: Vec<Option<f64>>,
}

/// The answers to the queries pushed so far.
pub(crate) struct Oracle {
    paper: paper::Paper,
    track: Option<track::Filter>,
}

impl Oracle {
    pub(crate) fn new(config: &Config, segments: &Segments) -> Self {
        let roads = Road::all(segments);
        let filter = |motion| track::Filter::new(motion, config.tolerance, segments);
        Self {
            paper: paper::Paper::new(config.clone(), roads),
            track: config.motion.clone().map(filter),
        }
    }

    /// Fails unless `fix` is the answer to the next query, and `belief` the track's.
    pub(crate) fn check(&mut self, query: &Query, fix: &Fix, belief: Option<Vec<f64>>) {
        let expected = self.paper.next(query);
        let bits = |value: f32| value.to_bits();
        let frame = self.paper.queries() - 1;
        assert_eq!(fix.frame as usize, frame);
        assert_eq!((fix.trusted, fix.blank), (expected.trusted, expected.blank), "query {frame}");
        let single = (fix.single.place, bits(fix.single.distance));
        assert_eq!(single, (expected.single.0, bits(expected.single.1)), "query {frame}");
        let peak = (fix.gradient.place, bits(fix.gradient.value));
        assert_eq!(peak, (expected.peak.0, bits(expected.peak.1)), "query {frame}");
        let sequence = fix.sequence.map(|s| (s.place, bits(s.score), s.anchors, s.speed.to_bits()));
        let best =
            expected.sequence.map(|s| (s.place, bits(s.score), s.anchors, s.speed.to_bits()));
        assert_eq!(sequence, best, "query {frame}");
        assert_eq!(fix.track.is_some(), self.track.is_some());
        let (place, score) = match (&mut self.track, fix.track, belief) {
            (Some(filter), Some(track), Some(belief)) => {
                filter.next(query);
                filter.check(&track, &belief);
                (track.place, (1.0 - track.confidence) as f32)
            }
            _ => expected.sequence.map_or(expected.single, |best| (best.place, best.score)),
        };
        assert_eq!((fix.place, bits(fix.score)), (place, bits(score)), "query {frame}");
        let (segment, road) = self.paper.road_of(place);
        assert_eq!((fix.segment, fix.segment_place), (segment, place - road.first));
    }
}
