//! A shard's part of the method.

use std::ops::Range;

use super::super::estimator::Seen;
use super::super::gradient::{Enhancement, missing_between, missing_gradient};
use super::super::layout::Layout;
use super::super::sequence::{Own, SequenceSearch};
use super::super::single::checked_minimum;
use super::super::track::TrackerPart;
use super::super::trust::{Anchor, Anchors};
use super::super::window::{Held, Window};
use super::super::{Peak, Single, is_constant};
use super::said::{First, FirstSaid, Second, SecondSaid};
use crate::config::Config;
use crate::error::Error;
use crate::segments::Segments;
use crate::simd::Isa;

/// The window of a shard's line, and what is made of it in the shard's own places.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    pub(super) config: Config,
    /// Of the whole route.
    pub(super) places: usize,
    layout: Layout,
    /// One column more than a matcher has: that of the query in hand, which may be given up.
    pub(super) window: Window,
    /// The columns of the queries that are done.
    pub(super) done: Held,
    pub(super) anchors: Anchors,
    sequence: SequenceSearch,
    pub(super) tracker: Option<TrackerPart>,
    /// The column in hand in its own places, and what was asked first about it.
    own: Vec<f32>,
    pub(super) asked: Option<First>,
    isa: Isa,
}

impl Part {
    /// That of the places `own`, of whole blocks.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(crate) fn new(
        segments: &Segments,
        own: Range<usize>,
        config: &Config,
    ) -> Result<Self, Error> {
        let sequence = SequenceSearch::new(config)?;
        let before = sequence.reach().max(config.smoothing);
        let layout = Layout::new(segments, own, [before.saturating_add(1), 1]);
        let columns = config.columns(segments).saturating_add(1);
        let window = Window::new(columns, layout.len())?;
        Ok(Self {
            done: window.cells.lower.held(),
            window,
            anchors: Anchors::new(config.sequence_length)?,
            sequence,
            tracker: config
                .motion
                .as_ref()
                .map(|motion| TrackerPart::new(motion, config.tolerance, segments, layout.own()))
                .transpose()?,
            own: if config.motion.is_some() { vec![0.0; layout.own().len()] } else { Vec::new() },
            asked: None,
            layout,
            isa: Isa::best(),
            config: config.clone(),
            places: segments.places(),
        })
    }

    /// The places whose distances it takes: the line, and then the [`ends`](Layout::ends).
    pub(crate) fn layout(&self) -> &Layout {
        &self.layout
    }

    /// What a query's column says. Nothing changes but the query in hand.
    ///
    /// # Errors
    /// [`Error::Shard`] for a question that is not to this part.
    pub(crate) fn first(&mut self, column: &[f32], asked: &First) -> Result<FirstSaid, Error> {
        let isa = self.isa;
        isa.run(|| self.say(column, asked))
    }

    #[inline(always)]
    fn say(&mut self, column: &[f32], asked: &First) -> Result<FirstSaid, Error> {
        let Self { config, layout, window, done, tracker, own: of_own, .. } = self;
        let mut said = FirstSaid {
            refused: None,
            single: Single { place: 0, distance: f32::INFINITY },
            constant: None,
            peak: Peak { place: 0, value: f32::NEG_INFINITY },
            track: None,
        };
        self.asked = None;
        let (line, ends) = column.split_at(layout.len());
        let columns = &mut window.cells.lower;
        columns.hold(*done);
        if asked.fresh || !asked.follows {
            columns.clear();
        }
        columns.advance().copy_from_slice(line);

        // The single match, and whether all distances are equal.
        let mut equal = true;
        for piece in layout.pieces() {
            let own = &line[piece.own()];
            let first = piece.own_places().start;
            match checked_minimum(own, own.len()) {
                Ok(Single { place, distance }) if distance < said.single.distance => {
                    said.single = Single { place: first + place, distance };
                }
                Err(Error::NotFinite { index, value, .. }) => {
                    said.refused = Some((first + index, value));
                    return Ok(said);
                }
                _ => {}
            }
            let constant = *said.constant.get_or_insert(own[0]);
            equal &= constant == own[0] && is_constant(own);
        }
        said.constant = said.constant.filter(|_| equal);

        // 1.1, 1.2 The peak of the enhanced gradient (Eqs. 1 and 2).
        let enhancement = Enhancement { gradient: config.gradient, smoothing: config.smoothing };
        let mut cut = ends.as_chunks::<4>().0.iter();
        for (piece, segment) in layout.pieces().iter().zip(layout.segments().iter()) {
            let missing = match piece.ends().and_then(|_| cut.next()) {
                Some(&ends) => missing_between(ends, piece.whole().len(), config.gradient),
                None => {
                    missing_gradient(&line[segment.places()], piece.whole().closed, config.gradient)
                }
            };
            let own = piece.own().start - segment.start..piece.own().end - segment.start;
            let above = Peak { place: usize::MAX, ..said.peak };
            let peak = enhancement.peak_within(columns, segment, missing, own, above);
            if peak.place != usize::MAX {
                said.peak = Peak { place: piece.place(peak.place), ..peak };
            }
        }

        // 1.9 What the track needs of the other shards.
        match (tracker, &asked.track) {
            (Some(tracker), Some(track)) => {
                for (at, own) in layout.own_parts(0..of_own.len()) {
                    let len = own.len();
                    of_own[own].copy_from_slice(&line[at..at + len]);
                }
                said.track = Some(tracker.first(of_own, asked.fresh, track)?);
            }
            (None, None) => {}
            _ => return Err(no_track()),
        }
        self.asked = Some(asked.clone());
        Ok(said)
    }

    /// Keeps the query in hand, and tells what is known then.
    ///
    /// # Errors
    /// [`Error::Shard`] for a question that is not to this part, which is then as it was.
    pub(crate) fn second(&mut self, asked: &Second) -> Result<SecondSaid, Error> {
        let isa = self.isa;
        isa.run(|| self.keep(asked))
    }

    #[inline(always)]
    fn keep(&mut self, asked: &Second) -> Result<SecondSaid, Error> {
        let Self { layout, window, done, anchors, sequence, tracker, own, asked: first, .. } = self;
        let Second { single, trusted, floor, track } = asked;
        let first = first.as_ref().ok_or_else(no_track)?;
        match (&mut *tracker, &first.track, track) {
            (Some(tracker), Some(first), Some(track)) => tracker.receive(first, track)?,
            (None, None, None) => {}
            _ => return Err(no_track()),
        }
        let (single, trusted, floor) = (*single, *trusted, *floor);
        *done = window.cells.lower.held();
        anchors.push(Anchor { single, trusted });
        let segments = layout.segments();
        let seen = Seen { segments, anchors, floor, advance: None, evidence: None };
        let best = sequence.best(window, &seen, Own::Of(layout), &mut ());
        let place = |at: usize| {
            let piece = layout.pieces().iter().find(|piece| piece.own().contains(&at));
            piece.map_or(at, |piece| piece.place(at))
        };
        let best = best.map(|((sum, at), slope)| ((sum, place(at)), slope));
        let track = match (tracker, track) {
            (Some(tracker), Some(track)) => Some(tracker.second(own, first.fresh, track)),
            _ => None,
        };
        self.asked = None;
        Ok(SecondSaid { best, track })
    }
}

fn no_track() -> Error {
    let reason = "expected a question of a driver with the same motion, got another".to_owned();
    Error::Shard { reason }
}
