//! Single figures from a curve. Each is a number even for an empty curve, which has found nothing.

use super::curve::{Curve, Point};

/// The threshold with the best balance of precision and recall.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BestF1 {
    /// The harmonic mean of precision and recall there.
    pub f1: f64,
    /// The score up to which matches are accepted there.
    pub threshold: f32,
    /// The precision there.
    pub precision: f64,
    /// The recall there.
    pub recall: f64,
}

impl Curve {
    /// The area under the curve up to the recall `upto`, divided by `upto`: 1 if every match
    /// accepted by then is correct. Trapezoids between the lowest precisions at each recall; in the
    /// segment that `upto` cuts, the sweep's own line, which leads to the highest precision at the
    /// next recall. The first precision is held back to recall 0. A curve that ends before `upto`
    /// adds nothing beyond its end, so read it beside [`max_recall`](Self::max_recall).
    pub fn auc(&self, upto: f64) -> f64 {
        area(self.points(), upto)
    }

    /// The largest recall that the curve reaches.
    pub fn max_recall(&self) -> f64 {
        self.points().last().map_or(0.0, |point| point.recall)
    }

    /// The largest recall at a precision of at least `precision`; 0 if there is none.
    pub fn recall_at_precision(&self, precision: f64) -> f64 {
        let enough = self.points().iter().filter(|point| point.precision >= precision);
        enough.map(|point| point.recall).fold(0.0, f64::max)
    }

    /// The wrong matches accepted by the time that the recall is reached; `None` if it never is.
    pub fn false_positives_at(&self, recall: f64) -> Option<usize> {
        self.points().iter().find(|point| point.recall >= recall).map(|point| point.false_positives)
    }

    /// The threshold with the largest harmonic mean of precision and recall, the strictest of
    /// equals; zeros if nothing is correct.
    pub fn best_f1(&self) -> BestF1 {
        let mut best = BestF1::default();
        for &Point { threshold, precision, recall, .. } in self.points() {
            let f1 = 2.0 * precision * recall / (precision + recall).max(f64::MIN_POSITIVE);
            if f1 > best.f1 {
                best = BestF1 { f1, threshold, precision, recall };
            }
        }
        best
    }
}

/// The area under a curve's points up to a recall, divided by that recall.
pub(super) fn area(points: &[Point], upto: f64) -> f64 {
    let Some(first) = points.first() else { return 0.0 };
    let (mut area, mut last) = (0.0, (0.0, first.precision));
    for equals in points.chunk_by(|a, b| a.recall == b.recall) {
        let (Some(highest), Some(lowest)) = (equals.first(), equals.last()) else { continue };
        let (from, to) = (last.0, lowest.recall);
        if to > upto {
            let end = last.1 + (upto - from) / (to - from) * (highest.precision - last.1);
            area += (upto - from) * (last.1 + end) / 2.0;
            break;
        }
        area += (to - from) * (last.1 + lowest.precision) / 2.0;
        last = (to, lowest.precision);
    }
    if upto > 0.0 { area / upto } else { first.precision }
}
