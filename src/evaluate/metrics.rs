//! Single figures from a curve. Each is a number at every corner: an empty curve has found nothing.

use super::curve::Curve;

impl Curve {
    /// The area under the curve up to the recall `upto`, divided by `upto`: 1 where every match accepted by then is
    /// correct. Trapezoids through the last, so lowest, precision at each recall; the first precision is held back to
    /// recall 0. A curve that ends before `upto` adds nothing beyond its end, so read it beside
    /// [`max_recall`](Self::max_recall).
    pub fn auc(&self, upto: f64) -> f64 {
        let Some(first) = self.points().first() else { return 0.0 };
        let (mut area, mut last) = (0.0, (0.0, first.precision));
        for equals in self.points().chunk_by(|a, b| a.recall == b.recall) {
            let Some(point) = equals.last() else { continue };
            let (from, to) = (last.0, point.recall);
            if to > from {
                let end = to.min(upto);
                let precision = last.1 + (end - from) / (to - from) * (point.precision - last.1);
                area += (end - from) * (last.1 + precision) / 2.0;
            }
            if to >= upto {
                break;
            }
            last = (to, point.precision);
        }
        if upto > 0.0 { area / upto } else { first.precision }
    }

    /// The largest recall that the curve reaches.
    pub fn max_recall(&self) -> f64 {
        self.points().last().map_or(0.0, |point| point.recall)
    }

    /// The largest recall at a precision of at least `precision`; 0 where there is none.
    pub fn recall_at_precision(&self, precision: f64) -> f64 {
        let enough = self.points().iter().filter(|point| point.precision >= precision);
        enough.map(|point| point.recall).fold(0.0, f64::max)
    }

    /// How many wrong matches are accepted by the time that the recall is reached; nothing where it never is.
    pub fn false_positives_at(&self, recall: f64) -> Option<usize> {
        self.points().iter().find(|point| point.recall >= recall).map(|point| point.false_positives)
    }
}
