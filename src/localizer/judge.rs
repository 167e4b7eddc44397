//! The judgement of a localizer's fixes by a threshold, and the alarm that it holds no longer.

use std::fmt;
use std::sync::Arc;

use crate::calibration::{Alarm, Threshold};
use crate::error::Error;
use crate::method::Fix;

/// The probability of a false alarm on a drive, at most.
const LEVEL: f64 = 0.01;

/// Told once that the scores are no longer those of the calibration drive, with the fix that raised
/// the alarm.
#[derive(Clone)]
pub(crate) struct Told(Arc<dyn Fn(&Fix) + Send + Sync>);

impl Told {
    pub(crate) fn new(told: impl Fn(&Fix) + Send + Sync + 'static) -> Self {
        Self(Arc::new(told))
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Judge {
    pub(crate) threshold: Threshold,
    pub(crate) alarm: Alarm,
}

impl Judge {
    /// # Errors
    /// [`Error::Option`] for a threshold of fixes with a track if these have none, or the other way
    /// round; [`Error::Settings`] for one that no calibration makes.
    pub(crate) fn new(threshold: Threshold, tracked: bool) -> Result<Self, Error> {
        if threshold.tracked != tracked {
            let kind = |tracked| if tracked { "with a track" } else { "without a track" };
            let (name, expected) = ("threshold", format!("one of fixes {}", kind(tracked)));
            let got = format!("one of fixes {}", kind(!tracked));
            return Err(Error::Option { name, expected, got });
        }
        threshold.check()?;
        let alarm = threshold.alarm(LEVEL)?;
        Ok(Self { threshold, alarm })
    }

    /// The fix, judged; `told` is called if it raises the alarm.
    pub(crate) fn judge(&mut self, mut fix: Fix, told: Option<&Told>) -> Fix {
        fix.accepted = Some(self.threshold.accepts(&fix));
        fix.probability = self.threshold.probability_of(&fix);
        let before = self.alarm.raised();
        // A score that is not finite says nothing.
        let raised = fix.is_ready() && self.alarm.push(fix.score).is_ok_and(|raised| raised);
        if let (true, false, Some(told)) = (raised, before, told) {
            told.0(&fix);
        }
        fix
    }
}

impl fmt::Debug for Told {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str("a function")
    }
}
