//! Several techniques' columns of one query as one (method 1.9): which technique is best on a route
//! need not be known.

use super::single::checked_minimum;
use super::track::Hubness;
use super::window::Column;
use crate::config::Config;
use crate::error::Error;
use crate::motion::Motion;
use crate::preallocated::reserved;
use crate::simd::{Compiled, Isa};

/// The most techniques that are fused: far more than a robot has time for. The evidence of so many
/// is within the range of the tracker's exponential.
pub(crate) const MAX_TECHNIQUES: usize = 32;

/// The techniques' statistics, and memory for the fused column.
#[derive(Clone, Debug)]
pub(crate) struct Fusion {
    techniques: Vec<Hubness>,
    motion: Motion,
    isa: Isa,
    /// The weights of each technique: in the mean of `z`, and in the sum of clipped `z`.
    weights: Vec<(f64, f64)>,
    /// The weighted mean of the techniques' `z`: the column of the paper's steps.
    column: Vec<f32>,
    /// The weighted sum of their clipped `z`, as spread as one of them would be.
    evidence: Vec<f64>,
    /// Whether any technique's column said anything.
    says: bool,
}

impl Fusion {
    /// For `count` techniques, which is at least 1.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is not enough; [`Error::Option`] for weights of another number of
    /// techniques.
    pub(crate) fn new(count: usize, places: usize, config: &Config) -> Result<Self, Error> {
        let (mut column, mut evidence) = (reserved(places)?, reserved(places)?);
        column.resize(places, 0.0);
        evidence.resize(places, 0.0);
        let techniques = (0..count).map(|_| Hubness::new(places)).collect::<Result<_, _>>()?;
        let motion = config.motion.clone().unwrap_or_default();
        let weights = weights(&config.technique_weights, count)?;
        Ok(Self { techniques, motion, isa: Isa::best(), weights, column, evidence, says: false })
    }

    /// Fuses the techniques' columns of a query; `column` gives one. The result is
    /// [`column`](Self::column).
    ///
    /// # Errors
    /// [`Error::Length`] unless each has one distance a place, [`Error::NotFinite`] for a NaN or an
    /// infinity (row: the technique). Nothing is learned then.
    pub(crate) fn fuse<'a>(&mut self, column: impl Fn(usize) -> &'a [f32]) -> Result<(), Error> {
        for technique in 0..self.techniques.len() {
            let checked = checked_minimum(column(technique), self.column.len());
            checked.map_err(|error| match error {
                Error::NotFinite { index, value, .. } => Error::NotFinite {
                    what: "distances (row: technique)",
                    row: Some(technique),
                    index,
                    value,
                },
                other => other,
            })?;
        }
        self.column.fill(0.0);
        self.evidence.fill(0.0);
        self.says = false;
        let each = self.techniques.iter_mut().zip(&self.weights);
        for (index, (hubness, &(share, weight))) in each.enumerate() {
            if weight == 0.0 {
                continue;
            }
            let (fused, evidence) = (&mut self.column[..], &mut self.evidence[..]);
            let (motion, column) = (&self.motion, column(index));
            let add = Add { hubness, motion, column, share, weight, fused, evidence };
            self.says |= self.isa.run(add);
        }
        Ok(())
    }

    /// The fused column. One that says nothing is constant, and the tracker sees that.
    pub(crate) fn column(&self) -> Column<'_> {
        let evidence = self.says.then_some(&self.evidence[..]);
        Column { lower: &self.column, upper: None, evidence }
    }

    /// Forgets the statistics of the drive.
    pub(crate) fn reset(&mut self) {
        self.techniques.iter_mut().for_each(Hubness::clear);
    }

    /// The statistics of each technique: how many columns, and the sum of each place's distances.
    pub(crate) fn statistics(&self) -> impl Iterator<Item = (u64, &[f64])> {
        self.techniques.iter().map(|hubness| (hubness.columns, &hubness.sums[..]))
    }

    /// The same, to go on with later.
    pub(super) fn known(&self) -> Vec<Hubness> {
        self.techniques.clone()
    }

    /// Goes on with known statistics, of as many places; false if they do not fit.
    pub(crate) fn resume(&mut self, known: Vec<Hubness>) -> bool {
        let fits = known.len() == self.techniques.len();
        if fits {
            self.techniques = known;
        }
        fits
    }
}

/// Of each technique: its part of the sum of all weights, and of the root of the sum of squares.
fn weights(given: &[f64], count: usize) -> Result<Vec<(f64, f64)>, Error> {
    if !given.is_empty() && given.len() != count {
        let expected = format!("one of each of {count} techniques");
        let got = given.len().to_string();
        return Err(Error::Option { name: "technique_weights", expected, got });
    }
    // As shares of the largest, so that their squares are numbers.
    let largest = given.iter().copied().fold(0.0, f64::max);
    let each: Vec<f64> = match given {
        [] => vec![1.0; count],
        given => given.iter().map(|weight| weight / largest).collect(),
    };
    let sum: f64 = each.iter().sum();
    let root = each.iter().map(|weight| weight * weight).sum::<f64>().sqrt();
    Ok(each.into_iter().map(|weight| (weight / sum, weight / root)).collect())
}

/// One technique's part of the fused column, compiled for each instruction set.
struct Add<'a> {
    hubness: &'a mut Hubness,
    motion: &'a Motion,
    column: &'a [f32],
    share: f64,
    weight: f64,
    fused: &'a mut [f32],
    evidence: &'a mut [f64],
}

impl Compiled for Add<'_> {
    /// Whether the column says anything.
    type Out = bool;

    #[inline(always)]
    fn run(self) -> bool {
        let Self { hubness, motion, column, share, weight, fused, evidence } = self;
        // A column that says nothing adds nothing.
        let Some(standard) = hubness.learn(column, motion) else { return false };
        let clip = motion.clip;
        let count = column.len();
        let sums = &hubness.sums[..count];
        let (fused, evidence) = (&mut fused[..count], &mut evidence[..count]);
        for place in 0..count {
            let z = standard.z(column[place], sums[place]);
            fused[place] += (share * z) as f32;
            evidence[place] += weight * z.max(-clip).min(clip);
        }
        true
    }
}
