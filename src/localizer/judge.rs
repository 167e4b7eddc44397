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
type Told = Arc<dyn Fn(&Fix) + Send + Sync>;

#[derive(Clone)]
pub(super) struct Judge {
    pub(super) threshold: Threshold,
    pub(super) alarm: Alarm,
    pub(super) told: Option<Told>,
}

impl Judge {
    /// # Errors
    /// [`Error::Option`] for a threshold of fixes with a track if these have none, or the other way
    /// round; those of [`Threshold::alarm`].
    pub(super) fn new(threshold: Threshold, tracked: bool) -> Result<Self, Error> {
        if threshold.tracked != tracked {
            let kind = |tracked| if tracked { "with a track" } else { "without a track" };
            let (name, expected) = ("threshold", format!("one of fixes {}", kind(tracked)));
            let got = format!("one of fixes {}", kind(!tracked));
            return Err(Error::Option { name, expected, got });
        }
        let alarm = threshold.alarm(LEVEL)?;
        Ok(Self { threshold, alarm, told: None })
    }

    /// The fix, judged.
    pub(super) fn judge(&mut self, mut fix: Fix) -> Fix {
        fix.accepted = Some(self.threshold.accepts(&fix));
        fix.probability = self.threshold.probability_of(&fix);
        let before = self.alarm.raised();
        // A score that is not finite says nothing.
        let raised = fix.is_ready() && self.alarm.push(fix.score).is_ok_and(|raised| raised);
        if let (true, false, Some(told)) = (raised, before, &self.told) {
            told(&fix);
        }
        fix
    }
}

impl fmt::Debug for Judge {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { threshold, alarm, told: _ } = self;
        to.debug_struct("Judge").field("threshold", threshold).field("alarm", alarm).finish()
    }
}
