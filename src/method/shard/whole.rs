//! What stays in one place of the method in parts: the driver's part.

use std::ops::Range;

use super::super::estimator::Seen;
use super::super::sequence::SequenceSearch;
use super::super::track::{TrackDecided, TrackerWhole, counted};
use super::super::trust::{Anchor, Anchors, consensus};
use super::super::{Fix, Given, Peak, Single};
use super::said::{First, FirstSaid, Second, SecondSaid};
use crate::config::Config;
use crate::error::Error;
use crate::segments::Segments;
use crate::sums::BLOCK;

/// The state that no shard has, and what makes fixes of what the shards say.
#[derive(Clone, Debug)]
pub(crate) struct Whole {
    pub(super) config: Config,
    pub(super) segments: Segments,
    /// The places of each shard.
    cuts: Vec<Range<usize>>,
    pub(super) frames: u64,
    pub(super) lowest: f32,
    /// Whether the next query follows the newest.
    pub(super) follows: bool,
    pub(super) anchors: Anchors,
    sequence: SequenceSearch,
    pub(super) tracker: Option<TrackerWhole>,
}

/// What is known of a query after the first answers.
#[derive(Clone, Debug)]
pub(crate) struct Decided {
    single: Single,
    gradient: Peak,
    trusted: bool,
    blank: bool,
    lowest: f32,
    floor: f64,
    track: Option<TrackDecided>,
}

impl Whole {
    /// For a route in `shards` shards.
    ///
    /// # Errors
    /// Those of [`Matcher::along`](crate::Matcher::along); [`Error::Option`] for no shard, or more
    /// than there are blocks of places.
    pub(crate) fn new(segments: &Segments, shards: usize, config: &Config) -> Result<Self, Error> {
        check(segments, config)?;
        let cuts = cuts(segments.places(), shards)?;
        let tracker = config
            .motion
            .as_ref()
            .map(|motion| TrackerWhole::new(motion, config.tolerance, segments, &cuts));
        Ok(Self {
            tracker: tracker.transpose()?,
            cuts,
            segments: segments.clone(),
            frames: 0,
            lowest: f32::INFINITY,
            follows: true,
            anchors: Anchors::new(config.sequence_length)?,
            sequence: SequenceSearch::new(config)?,
            config: config.clone(),
        })
    }

    /// The places of each shard.
    pub(crate) fn cuts(&self) -> &[Range<usize>] {
        &self.cuts
    }

    pub(crate) fn config(&self) -> &Config {
        &self.config
    }

    pub(crate) fn frames(&self) -> u64 {
        self.frames
    }

    /// As [`Matcher::gap`](crate::Matcher::gap).
    pub(crate) fn gap(&mut self) {
        self.follows = false;
        if let Some(tracker) = &mut self.tracker {
            tracker.clear();
        }
    }

    /// As [`Matcher::gap_with_advance`](crate::Matcher::gap_with_advance).
    ///
    /// # Errors
    /// [`Error::Option`] for an advance that is not finite.
    pub(crate) fn gap_with_advance(&mut self, advance: f64) -> Result<(), Error> {
        Given::default().advance(advance).check()?;
        self.follows = false;
        if let Some(tracker) = &mut self.tracker {
            tracker.moved(advance);
        }
        Ok(())
    }

    /// As [`Matcher::reset`](crate::Matcher::reset).
    pub(crate) fn reset(&mut self) {
        self.frames = 0;
        self.lowest = f32::INFINITY;
        self.follows = true;
        if let Some(tracker) = &mut self.tracker {
            tracker.reset();
        }
    }

    /// What each shard is asked first about a query.
    pub(crate) fn first(&mut self, given: Given) -> Vec<First> {
        let Self { cuts, tracker, frames, follows, .. } = self;
        let track = tracker.as_mut().map(|tracker| tracker.first(given.advance, cuts));
        let mut track = track.into_iter().flatten();
        let each = cuts.iter().map(|_| First {
            fresh: *frames == 0,
            follows: *follows,
            track: track.next(),
        });
        each.collect()
    }

    /// What the shards' first answers, in their order, come to, and what each is asked next.
    ///
    /// # Errors
    /// [`Error::NotFinite`] if a distance is not finite; [`Error::Shard`] for answers to other
    /// questions.
    pub(crate) fn second(
        &self,
        said: &[&FirstSaid],
        given: Given,
    ) -> Result<(Decided, Vec<Second>), Error> {
        if let Some((index, value)) = said.iter().find_map(|said| said.refused) {
            return Err(Error::NotFinite { what: "distances", row: None, index, value });
        }
        let Self { config, segments, cuts, .. } = self;
        let mut single = Single { place: 0, distance: f32::INFINITY };
        let mut gradient = Peak { place: 0, value: f32::NEG_INFINITY };
        for said in said {
            if said.single.distance < single.distance {
                single = said.single;
            }
            if said.peak.value > gradient.value {
                gradient = said.peak;
            }
        }
        let first = said.first().and_then(|said| said.constant);
        let blank = first.is_some() && said.iter().all(|said| said.constant == first);
        let trusted = !blank
            && given
                .trusted
                .unwrap_or_else(|| consensus(single, gradient, segments, config.tolerance));
        let lower = !blank && single.distance < self.lowest;
        let lowest = if lower { single.distance } else { self.lowest };
        let floor = config.floor.value(lowest);
        let (mut track, mut asked) = (None, Vec::new());
        if let Some(tracker) = &self.tracker {
            let said: Vec<_> = said.iter().filter_map(|said| said.track.as_ref()).collect();
            counted("answers about the track", cuts.len(), said.len())?;
            let (decided, second) = tracker.second(&said, blank, given.advance)?;
            (track, asked) = (Some(decided), second);
        }
        let mut asked = asked.into_iter();
        let second = cuts.iter().map(|_| Second { single, trusted, floor, track: asked.next() });
        let decided = Decided { single, gradient, trusted, blank, lowest, floor, track };
        Ok((decided, second.collect()))
    }

    /// The fix of the shards' second answers, in their order.
    ///
    /// # Errors
    /// [`Error::Shard`] for answers to other questions; all is then as it was.
    pub(crate) fn fix(&mut self, decided: &Decided, said: &[&SecondSaid]) -> Result<Fix, Error> {
        let Self { segments, anchors, sequence, tracker, .. } = self;
        let Decided { single, gradient, trusted, blank, lowest, floor, ref track } = *decided;
        let track = match (tracker, track) {
            (Some(tracker), Some(track)) => {
                let said: Vec<_> = said.iter().filter_map(|said| said.track.as_ref()).collect();
                counted("answers about the track", self.cuts.len(), said.len())?;
                Some(tracker.track(track.clone(), &said)?)
            }
            _ => None,
        };
        anchors.push(Anchor { single, trusted });
        self.lowest = lowest;
        // The first of equal sums has the lowest place.
        let best = said.iter().filter_map(|said| said.best);
        let best = best.reduce(|best, one| if one.0.0 < best.0.0 { one } else { best });
        let seen = Seen { segments, anchors, floor, advance: None, evidence: None };
        let sequence = best.and_then(|best| sequence.sequence(best, &seen));
        let frame = self.frames;
        self.frames += 1;
        self.follows = true;
        Ok(Fix::of(frame, [trusted, blank], single, gradient, sequence, track, segments))
    }
}

/// Refuses options that shards do not have.
///
/// # Errors
/// [`Error::Option`].
pub(crate) fn check(segments: &Segments, config: &Config) -> Result<(), Error> {
    config.validate_along(segments)?;
    config.validate_stream()?;
    if config.technique_weights.len() > 1 {
        let expected = "one technique: shards do not fuse several".to_owned();
        let got = config.technique_weights.len().to_string();
        return Err(Error::Option { name: "technique_weights", expected, got });
    }
    Ok(())
}

/// The places of each shard.
///
/// # Errors
/// [`Error::Option`] for no shard, or more than there are blocks.
pub(crate) fn cuts(places: usize, shards: usize) -> Result<Vec<Range<usize>>, Error> {
    let blocks = places.div_ceil(BLOCK);
    if shards == 0 || shards > blocks {
        let expected = format!("from 1 to {blocks}, the blocks of 4,096 places");
        return Err(Error::Option { name: "shards", expected, got: shards.to_string() });
    }
    Ok(cut(places, shards).collect())
}

/// The places of each of `count` shards: whole blocks, shared evenly.
fn cut(places: usize, count: usize) -> impl Iterator<Item = Range<usize>> {
    let blocks = places.div_ceil(BLOCK);
    let at = move |shard: usize| {
        let block = shard as u128 * blocks as u128 / count as u128;
        (block as usize * BLOCK).min(places)
    };
    (0..count).map(move |shard| at(shard)..at(shard + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_share_the_blocks_evenly() {
        let shards: Vec<_> = cut(5 * BLOCK + 1, 4).collect();
        let expected = [0..BLOCK, BLOCK..3 * BLOCK, 3 * BLOCK..4 * BLOCK, 4 * BLOCK..5 * BLOCK + 1];
        assert_eq!(shards, expected);
        assert!(cut(7, 1).eq(std::iter::once(0..7)));
    }

    #[test]
    fn there_are_no_more_shards_than_blocks() {
        for (places, most) in [(1, 1), (BLOCK, 1), (BLOCK + 1, 2), (3 * BLOCK, 3)] {
            for shards in 0..=most + 1 {
                let known = (1..=most).contains(&shards);
                assert_eq!(cuts(places, shards).is_ok(), known, "{shards} of {places} places");
            }
            assert_eq!(cuts(places, most).map(|cuts| cuts.len()).ok(), Some(most));
        }
    }

    #[test]
    fn shards_have_one_technique() {
        for (count, taken) in [(0, true), (1, true), (2, false), (3, false)] {
            let config = Config { technique_weights: vec![1.0; count], ..Config::default() };
            assert_eq!(check(&Segments::one(9), &config).is_ok(), taken, "{count}");
        }
    }
}
