//! One shard of a map.

use std::ops::Range;
use std::sync::Arc;

use super::mark::Header;
use super::message::{Address, Answer, Asked, QueryMark, Question, Said};
use super::scan::Scan;
use crate::config::Config;
use crate::error::Error;
use crate::map::Map;
use crate::method::shard::{Part, check, cuts};

/// A range of a map's places, whose rows it scans, and what is known of these by the queries so
/// far.
///
/// It has the whole map, which is best opened by [`Map::open_mapped`], and reads only the rows of
/// its own places and of some beside them.
#[derive(Clone, Debug)]
pub struct Shard {
    map: Arc<Map>,
    pub(super) header: Header,
    pub(super) places: Range<usize>,
    pub(super) part: Part,
    /// How many queries it has kept, and their hash.
    pub(super) frames: u64,
    pub(super) history: u64,
    /// The query in hand.
    pub(super) pending: Option<QueryMark>,
    scan: Scan,
}

impl Shard {
    /// Shard `index` of `count` of a map, for a driver with these options.
    ///
    /// # Errors
    /// [`Error::Option`] for a shard that there is not, or for more shards than the map has blocks
    /// of 4,096 places; those of [`Matcher::along`](crate::Matcher::along).
    pub fn new(map: Arc<Map>, config: &Config, index: usize, count: usize) -> Result<Self, Error> {
        let segments = map.segments();
        check(segments, config)?;
        let cuts = cuts(map.places(), count)?;
        let Some(places) = cuts.get(index).cloned() else {
            let expected = format!("a shard from 0 to {}", count - 1);
            return Err(Error::Option { name: "shard", expected, got: index.to_string() });
        };
        let part = Part::new(segments, places.clone(), config)?;
        let scan = Scan::new(&map, part.layout());
        // Now, so that the first query need not find them.
        map.blank();
        let header = Header::new(&map, config);
        let (frames, history, pending) = (0, 0, None);
        Ok(Self { map, header, places, part, frames, history, pending, scan })
    }

    /// Its own places.
    pub fn places(&self) -> Range<usize> {
        self.places.clone()
    }

    /// The places whose rows it reads: its own, some beside them, and ends of segments. Some may
    /// come twice.
    pub fn rows(&self) -> impl Iterator<Item = Range<usize>> {
        let layout = self.part.layout();
        let ends = layout.ends().flatten().map(|place| place..place + 1);
        layout.ranges().map(|(range, _)| range).chain(ends)
    }

    /// How many queries it has kept.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Refuses a message that is not for this shard.
    ///
    /// # Errors
    /// [`Error::Shard`].
    pub fn check_header(&self, header: &Header) -> Result<(), Error> {
        self.header.check(header)
    }

    /// Answers a question of its driver.
    ///
    /// # Errors
    /// [`Error::Shard`] for a question of another version, map, options or places, and for one that
    /// does not follow the queries that it has kept. The shard is then as it was.
    pub fn answer(&mut self, question: &Question) -> Result<Answer, Error> {
        self.header.check(&question.header)?;
        let Address { places, query } = &question.to;
        if *places != self.places {
            let of = |places: &Range<usize>| format!("{} to {}", places.start, places.end - 1);
            return refused("a question to the shard of places", &of(&self.places), &of(places));
        }
        let body = match &question.body {
            Asked::Census { query: numbers, nothing } => {
                self.follows(*query)?;
                let Self { map, scan, places, .. } = self;
                scan.run(map, numbers)?;
                Said::Census(scan.sums(map, *nothing, places))
            }
            Asked::First { query: numbers, means, first } => {
                self.follows(*query)?;
                self.pending = None;
                let Self { map, scan, part, .. } = self;
                scan.run(map, numbers)?;
                let column = scan.column(map, part.layout(), means.as_ref());
                let said = part.first(column, first)?;
                self.pending = Some(*query);
                Said::First(said)
            }
            Asked::Second(second) => {
                if self.pending != Some(*query) {
                    return Err(self.out_of_turn("the question that is asked first", query.frame));
                }
                let said = self.part.second(second)?;
                self.pending = None;
                (self.frames, self.history) = (query.frame + 1, query.after);
                Said::Second(said)
            }
        };
        Ok(Answer { header: self.header.clone(), from: question.to.clone(), body })
    }

    /// Refuses a query that is neither the first of a drive nor the next one.
    fn follows(&self, query: QueryMark) -> Result<(), Error> {
        let next = query.frame == self.frames && query.before == self.history;
        if next || (query.frame == 0 && query.before == 0) {
            return Ok(());
        }
        Err(self.out_of_turn("the next query", query.frame))
    }

    fn out_of_turn(&self, expected: &str, frame: u64) -> Error {
        let Self { frames, history, .. } = self;
        let reason = format!(
            "expected {expected}, frame {frames} after the queries {history:016x}, got another: frame \
             {frame}"
        );
        Error::Shard { reason }
    }
}

fn refused<T>(what: &str, expected: &str, got: &str) -> Result<T, Error> {
    Err(Error::Shard { reason: format!("expected {what} {expected}, got {got}") })
}
