//! A fix as a plain struct.

use surefix::Fix as Answer;

/// Where a place is.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    /// How many of the metres are known: 2 or 3, or 0 on a map without positions.
    pub axes: usize,
    /// Planar coordinates: east, north and height, if the plane is one of degrees. NaN if they are
    /// not known.
    pub metres: [f64; 3],
    /// Degrees (WGS84); NaN if the origin of the map's plane is not known.
    pub latitude: f64,
    /// Degrees (WGS84); NaN if the origin of the map's plane is not known.
    pub longitude: f64,
}

impl Position {
    pub(crate) fn new(at: Option<surefix::Position>) -> Self {
        let known = at.as_ref().map_or(&[][..], |at| at.metres());
        let mut metres = [f64::NAN; 3];
        metres[..known.len()].copy_from_slice(known);
        let [latitude, longitude] = at.and_then(|at| at.degrees()).unwrap_or([f64::NAN; 2]);
        Self { axes: known.len(), metres, latitude, longitude }
    }
}

/// Where the robot is, and whether to trust it. Numbers that are not known are NaN, with which
/// every comparison is false; places that are not known are SIZE_MAX.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    /// The number of this query, from 0 since the start or the last reset.
    pub frame: u64,
    /// The track's place if there is motion; else the sequence's once it is ready, and before that
    /// the single match's.
    pub place: usize,
    /// The index of that place's segment: 0 on a route without breaks.
    pub segment: usize,
    /// That place, counted from its segment's first.
    pub segment_place: usize,
    /// Where that place is.
    pub position: Position,
    /// The score of that place: 1 - confidence of the track, the sequence's score, or the single
    /// match's distance. Less is better.
    pub score: f32,
    /// Whether place and score are those of the track or the sequence, not of one query alone.
    pub ready: bool,
    /// Whether the single match is trusted.
    pub trusted: bool,
    /// Whether the query shows nothing. It is never trusted, and says nothing of the place.
    pub blank: bool,
    /// Whether there is a threshold, that of the settings' file, to judge by.
    pub judged: bool,
    /// Whether the threshold accepts it; false without one.
    pub accepted: bool,
    /// Whether the threshold's promise holds no longer, as scores are not those of its calibration
    /// drive any more; false without one.
    pub alarm: bool,
    /// The probability that the place is right, by the threshold's calibration; NaN without one,
    /// and if the fix is not ready.
    pub probability: f64,
    /// The speed in places a query: the track's, else the sequence's; NaN without either.
    pub speed: f64,

    /// Whether there is a track: the option `motion` is set.
    pub has_track: bool,
    /// The track's belief that the robot is within `tolerance` places of the place; NaN without
    /// one.
    pub confidence: f64,
    /// The track's belief that the robot is off the map; NaN without one.
    pub off_map: f64,
    /// The first place of the interval that holds 95 % of the belief on the map. On a route that is
    /// one closed segment it may go round: the first is then greater than the last. On more than
    /// 65,536 places, ends far from the place are rounded outwards, by up to 255 places.
    pub interval_first: usize,
    /// The last place of that interval.
    pub interval_last: usize,

    /// Whether there is a sequence: not for the first `sequence_length - 1` queries, nor after a
    /// gap.
    pub has_sequence: bool,
    /// The sequence's place.
    pub sequence_place: usize,
    /// The mean of the weighted distances along the sequence's diagonal; less is better.
    pub sequence_score: f32,
    /// The trusted matches on the diagonal; 0 without a sequence.
    pub sequence_anchors: usize,
    /// The diagonal's slope, in places a query.
    pub sequence_speed: f64,

    /// The place at the smallest distance from this query alone.
    pub single_place: usize,
    /// That distance.
    pub single_distance: f32,
    /// The place of the enhanced gradient's peak.
    pub gradient_place: usize,
    /// The gradient there, in units of distance.
    pub gradient_value: f32,
}

impl Fix {
    pub(crate) fn new(fix: &Answer, at: Option<surefix::Position>, alarm: bool) -> Self {
        let (track, sequence) = (fix.track, fix.sequence);
        let interval = track.map_or((usize::MAX, usize::MAX), |track| track.interval);
        Self {
            frame: fix.frame,
            place: fix.place,
            segment: fix.segment,
            segment_place: fix.segment_place,
            position: Position::new(at),
            score: fix.score,
            ready: fix.is_ready(),
            trusted: fix.trusted,
            blank: fix.blank,
            judged: fix.accepted.is_some(),
            accepted: fix.accepted == Some(true),
            alarm,
            probability: fix.probability.unwrap_or(f64::NAN),
            speed: fix.speed().unwrap_or(f64::NAN),
            has_track: track.is_some(),
            confidence: fix.confidence().unwrap_or(f64::NAN),
            off_map: fix.off_map().unwrap_or(f64::NAN),
            interval_first: interval.0,
            interval_last: interval.1,
            has_sequence: sequence.is_some(),
            sequence_place: sequence.map_or(usize::MAX, |sequence| sequence.place),
            sequence_score: sequence.map_or(f32::NAN, |sequence| sequence.score),
            sequence_anchors: sequence.map_or(0, |sequence| sequence.anchors),
            sequence_speed: sequence.map_or(f64::NAN, |sequence| sequence.speed),
            single_place: fix.single.place,
            single_distance: fix.single.distance,
            gradient_place: fix.gradient.place,
            gradient_value: fix.gradient.value,
        }
    }
}
