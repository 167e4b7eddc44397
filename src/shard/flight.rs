//! A query on its way through the stages.

use super::message::{Answer, Numbers, QueryMark, Said, Stage};
use crate::error::Error;
use crate::map::Means;
use crate::method::Given;
use crate::method::shard::{Decided, Second};

/// A query whose fix is not there yet.
#[derive(Clone, Debug)]
pub(super) struct Flight {
    pub(super) mark: QueryMark,
    pub(super) given: Given,
    /// Whether it is a descriptor, which counts in the statistics of the drive.
    pub(super) descriptor: bool,
    pub(super) at: At,
}

/// What its shards have been asked.
#[derive(Clone, Debug)]
pub(super) enum At {
    Census { query: Numbers, nothing: bool },
    First { query: Numbers, means: Option<Means> },
    Second { decided: Box<Decided>, asked: Vec<Second> },
}

/// What the answers of a stage say.
pub(super) fn of_stage<'a, T>(
    answers: &'a [Answer],
    stage: Stage,
    of: impl Fn(&'a Said) -> Option<&'a T>,
) -> Result<Vec<&'a T>, Error> {
    let said: Option<Vec<_>> = answers.iter().map(|answer| of(&answer.body)).collect();
    said.map_or_else(|| unexpected(&format!("answers of the stage {stage}, got others")), Ok)
}

pub(super) fn unexpected<T>(expected: &str) -> Result<T, Error> {
    Err(Error::Shard { reason: format!("expected {expected}") })
}
