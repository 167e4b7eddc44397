//! The driver of a map's shards.

use std::hash::Hasher as _;
use std::ops::Range;
use std::sync::Arc;

use twox_hash::XxHash3_64;

use super::flight::{At, Flight, of_stage, unexpected};
use super::mark::Header;
use super::message::{Address, Answer, Asked, Numbers, QueryMark, Question, Said, Stage};
use crate::calibration::{Alarm, Threshold};
use crate::config::Config;
use crate::error::Error;
use crate::localizer::{Input, Judge, Queries, Told};
use crate::map::{Map, Means, Position, RowSums};
use crate::method::shard::Whole;
use crate::method::{Fix, Given};
use crate::sums::BLOCK;

/// Takes queries, asks the shards of a map, and makes fixes of their answers: a
/// [`Localizer`](crate::Localizer)'s, to the last bit.
///
/// A query begins with [`push`](Self::push), and is given up by [`abandon`](Self::abandon) or an
/// error; it counts once its fix is there. Until the last questions, those of
/// [`Stage::Second`](super::Stage::Second), are asked, giving up changes nothing.
#[derive(Clone, Debug)]
pub struct Driver {
    map: Arc<Map>,
    pub(super) header: Header,
    pub(super) queries: Queries,
    pub(super) whole: Whole,
    pub(super) history: u64,
    flight: Option<Flight>,
    judge: Option<Box<Judge>>,
    told: Option<Told>,
}

/// What comes next of a query.
#[derive(Clone, Debug)]
pub enum Next {
    /// A question for each shard, in their order.
    Ask(Vec<Question>),
    /// Its fix.
    Fix(Fix),
}

impl Driver {
    /// The driver of a map in `shards` shards.
    ///
    /// # Errors
    /// As for [`Shard::new`](super::Shard::new).
    pub fn new(map: Arc<Map>, config: &Config, shards: usize) -> Result<Self, Error> {
        Ok(Self {
            whole: Whole::new(map.segments(), shards, config)?,
            header: Header::new(&map, config),
            queries: Queries::new(&map),
            map,
            history: 0,
            flight: None,
            judge: None,
            told: None,
        })
    }

    /// The places of each shard.
    pub fn shards(&self) -> &[Range<usize>] {
        self.whole.cuts()
    }

    /// Refuses a message that is not for this driver.
    ///
    /// # Errors
    /// [`Error::Shard`].
    pub fn check_header(&self, header: &Header) -> Result<(), Error> {
        self.header.check(header)
    }

    /// Begins a query: what to ask the shards.
    ///
    /// # Errors
    /// Those of [`Localizer::push_inputs`](crate::Localizer::push_inputs) about the query;
    /// [`Error::Shard`] if the fix of the query before is not there yet.
    pub fn push(&mut self, input: Input<'_>, given: Given) -> Result<Next, Error> {
        self.at_rest("a query")?;
        given.check()?;
        let Self { map, queries, whole, .. } = self;
        let (numbers, nothing) = queries.numbers(map, input)?;
        map.query(numbers)?;
        let query = Numbers::new(numbers);
        let (frame, before) = (whole.frames(), self.history);
        let mut hash = XxHash3_64::with_seed(before);
        hash.write(
            format!("{frame} {given:?} {nothing} {:?}", whole.first(given).first()).as_bytes(),
        );
        hash.write(query.bytes());
        let mark = QueryMark { frame, before, after: hash.finish() };
        let descriptor = matches!(input, Input::Descriptor(_));
        let stage = if nothing || map.has_several() || !map.blank().is_empty() {
            At::Census { query, nothing }
        } else {
            At::First { query, means: None }
        };
        self.flight = Some(Flight { mark, given, descriptor, at: stage });
        Ok(self.ask())
    }

    /// Takes the answers to its questions, in the shards' order: the fix, or what to ask next.
    ///
    /// # Errors
    /// [`Error::Shard`] unless they are the answers to the newest questions; the driver is then as
    /// it was. [`Error::NotFinite`] as for a localizer; the query is then given up.
    pub fn answer(&mut self, answers: &[Answer]) -> Result<Next, Error> {
        let Some(flight) = &self.flight else {
            return unexpected("no answers: nothing was asked");
        };
        self.check(answers, flight.mark)?;
        let next = match &flight.at {
            At::Census { query, nothing } => {
                let said = of_stage(answers, Stage::Census, |said| match said {
                    Said::Census(sums) => Some(sums),
                    _ => None,
                })?;
                let means = Some(self.means(&said, *nothing)?);
                At::First { query: query.clone(), means }
            }
            At::First { .. } => {
                let said = of_stage(answers, Stage::First, |said| match said {
                    Said::First(said) => Some(said),
                    _ => None,
                })?;
                match self.whole.second(&said, flight.given) {
                    Ok((decided, asked)) => At::Second { decided: Box::new(decided), asked },
                    Err(error) => {
                        if let Error::NotFinite { .. } = error {
                            self.flight = None;
                        }
                        return Err(error);
                    }
                }
            }
            At::Second { decided, .. } => {
                let said = of_stage(answers, Stage::Second, |said| match said {
                    Said::Second(said) => Some(said),
                    _ => None,
                })?;
                let fix = self.whole.fix(decided, &said)?;
                return Ok(Next::Fix(self.finish(fix)));
            }
        };
        if let Some(flight) = &mut self.flight {
            flight.at = next;
        }
        Ok(self.ask())
    }

    /// The means of the shards' sums.
    fn means(&self, said: &[&Vec<f64>], nothing: bool) -> Result<Means, Error> {
        let numbers = 2 + 2 * self.map.further();
        let mut all = RowSums::NONE;
        for (said, places) in said.iter().zip(self.whole.cuts()) {
            let expected = places.len().div_ceil(BLOCK) * numbers;
            if said.len() != expected {
                return unexpected(&format!("{expected} sums of rows, got {}", said.len()));
            }
            for block in said.chunks_exact(numbers) {
                all.add(&RowSums::of_numbers(block));
            }
        }
        Ok(self.map.means(nothing, &all))
    }

    /// Gives up the query in hand, if there is one: it was never there.
    ///
    /// # Errors
    /// [`Error::Shard`] if [`Stage::Second`](super::Stage::Second) has been asked: some shards may have kept the query.
    pub fn abandon(&mut self) -> Result<(), Error> {
        if self.flight.as_ref().is_some_and(|flight| matches!(flight.at, At::Second { .. })) {
            return unexpected("the answers of the stage second: shards may have kept the query");
        }
        self.flight = None;
        Ok(())
    }

    /// The questions of the query's stage.
    fn ask(&mut self) -> Next {
        let Some(Flight { mark, given, at, .. }) = &self.flight else {
            return Next::Ask(Vec::new());
        };
        let asked: Vec<Asked> = match at {
            At::Census { query, nothing } => {
                let asked = Asked::Census { query: query.clone(), nothing: *nothing };
                vec![asked; self.whole.cuts().len()]
            }
            At::First { query, means } => {
                let each = self.whole.first(*given).into_iter();
                let first =
                    |first| Asked::First { query: query.clone(), means: means.clone(), first };
                each.map(first).collect()
            }
            At::Second { asked, .. } => asked.iter().cloned().map(Asked::Second).collect(),
        };
        let questions = self.whole.cuts().iter().zip(asked).map(|(places, body)| Question {
            header: self.header.clone(),
            to: Address { places: places.clone(), query: *mark },
            body,
        });
        Next::Ask(questions.collect())
    }

    fn check(&self, answers: &[Answer], query: QueryMark) -> Result<(), Error> {
        let shards = self.whole.cuts();
        if answers.len() != shards.len() {
            let (what, expected, got) = ("answers, one a shard", shards.len(), answers.len());
            return Err(Error::Length { what, expected, got });
        }
        for (shard, (answer, places)) in answers.iter().zip(shards).enumerate() {
            self.header.check(&answer.header)?;
            if answer.from.places != *places || answer.from.query != query {
                let what = format!(
                    "the answer of shard {shard} to frame {}, got another's, to frame {}",
                    query.frame, answer.from.query.frame
                );
                return unexpected(&what);
            }
        }
        Ok(())
    }

    fn finish(&mut self, fix: Fix) -> Fix {
        if let Some(Flight { mark, descriptor, .. }) = self.flight.take() {
            self.history = mark.after;
            if descriptor {
                self.queries.commit();
            }
        }
        match &mut self.judge {
            Some(judge) => judge.judge(fix, self.told.as_ref()),
            None => fix,
        }
    }

    /// # Errors
    /// [`Error::Shard`] if a query is in hand.
    pub(super) fn at_rest(&self, what: &str) -> Result<(), Error> {
        match &self.flight {
            None => Ok(()),
            Some(flight) => {
                let frame = flight.mark.frame;
                unexpected(&format!("the answers of frame {frame} first, got {what}"))
            }
        }
    }
}

/// The same as a localizer's.
impl Driver {
    /// As [`Localizer::gap`](crate::Localizer::gap).
    ///
    /// # Errors
    /// [`Error::Shard`] if a query is in hand.
    pub fn gap(&mut self) -> Result<(), Error> {
        self.at_rest("a gap")?;
        self.whole.gap();
        Ok(())
    }

    /// As [`Localizer::gap_with_advance`](crate::Localizer::gap_with_advance).
    ///
    /// # Errors
    /// [`Error::Shard`] if a query is in hand, and those of the localizer.
    pub fn gap_with_advance(&mut self, advance: f64) -> Result<(), Error> {
        self.at_rest("a gap")?;
        self.whole.gap_with_advance(advance)
    }

    /// As [`Localizer::reset`](crate::Localizer::reset). The shards forget their queries when the
    /// next one comes.
    ///
    /// # Errors
    /// [`Error::Shard`] if a query is in hand.
    pub fn reset(&mut self) -> Result<(), Error> {
        self.at_rest("a reset")?;
        self.whole.reset();
        self.history = 0;
        self.queries.reset(&self.map);
        if let Some(judge) = &mut self.judge {
            judge.alarm.reset();
        }
        Ok(())
    }

    /// As [`Localizer::with_threshold`](crate::Localizer::with_threshold).
    ///
    /// # Errors
    /// As there.
    pub fn with_threshold(mut self, threshold: Threshold) -> Result<Self, Error> {
        let tracked = self.config().motion.is_some();
        self.judge = Some(Box::new(Judge::new(threshold, tracked)?));
        Ok(self)
    }

    /// As [`Localizer::on_alarm`](crate::Localizer::on_alarm).
    pub fn on_alarm(&mut self, told: impl Fn(&Fix) + Send + Sync + 'static) {
        self.told = Some(Told::new(told));
    }

    /// The threshold that judges its fixes.
    pub fn threshold(&self) -> Option<&Threshold> {
        self.judge.as_ref().map(|judge| &judge.threshold)
    }

    /// The alarm that the threshold holds no longer.
    pub fn alarm(&self) -> Option<&Alarm> {
        self.judge.as_ref().map(|judge| &judge.alarm)
    }

    /// Where the place of one of its fixes is, if the map has positions.
    pub fn position(&self, fix: &Fix) -> Option<Position> {
        self.map.positions()?.at(fix.place)
    }

    /// The map.
    pub fn map(&self) -> &Arc<Map> {
        &self.map
    }

    /// Its options.
    pub fn config(&self) -> &Config {
        self.whole.config()
    }

    /// How many frames it has taken since the start or the last reset.
    pub fn frames(&self) -> u64 {
        self.whole.frames()
    }
}
