//! Where the belief goes between two queries (method 1.9, 3): shifts with their probabilities.

use crate::error::Error;
use crate::motion::Motion;
use crate::preallocated::reserved;
use crate::segments::Segments;

/// A move by `shift` places, and its probability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tap {
    pub(super) shift: isize,
    pub(super) weight: f64,
}

/// The taps of each speed, by their shifts.
#[derive(Clone, Debug)]
pub(super) struct Steps {
    taps: Vec<Tap>,
    /// Where each speed's taps end.
    ends: Vec<usize>,
    switching: f64,
    /// Each speed's share after the change of speed, if all were equally likely before.
    pub(super) shares: Vec<f64>,
}

impl Steps {
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(super) fn new(motion: &Motion) -> Result<Self, Error> {
        let speeds = motion.speeds.len();
        let mut steps = Self {
            taps: Vec::new(),
            ends: reserved(speeds)?,
            switching: motion.switching,
            shares: vec![0.0; speeds],
        };
        for speed in 0..speeds {
            let [below, own, above] = steps.switches(speed);
            steps.shares[speed] = (below + own + above) / speeds as f64;
        }
        for (index, &speed) in motion.speeds.iter().enumerate() {
            let neighbours = [index.checked_sub(1), Some(index + 1)];
            let gap = |at: usize| motion.speeds.get(at).map(|other| (other - speed).abs());
            let widest = neighbours.into_iter().flatten().filter_map(gap).fold(0.0, f64::max);
            // Jitter must reach half of the way to the next speed.
            let reach = (widest * motion.pace / 2.0).ceil().max(1.0) as isize;
            let places = speed * motion.pace;
            if places == 0.0 {
                steps.taps.push(Tap { shift: 0, weight: 1.0 });
            } else {
                let (whole, part) = (places.floor() as isize, places.fract());
                let start = steps.taps.len();
                for shift in whole - reach..=whole + 1 + reach {
                    let of = |target: isize| jittered(shift - target, reach, motion.jitter);
                    let weight = (1.0 - part) * of(whole) + part * of(whole + 1);
                    if weight > 0.0 {
                        steps.taps.push(Tap { shift, weight });
                    }
                }
                debug_assert!(steps.taps.len() > start);
            }
            steps.ends.push(steps.taps.len());
        }
        Ok(steps)
    }

    /// Which shares of the speed below, of its own and of the speed above have this speed after the
    /// change of speed: of each, `switching` goes to its neighbours, half to each, or all to the
    /// only one.
    pub(super) fn switches(&self, speed: usize) -> [f64; 3] {
        let last = self.shares.len() - 1;
        if last == 0 {
            return [0.0, 1.0, 0.0];
        }
        let from = |other: usize| {
            let ends = other == 0 || other == last;
            if ends { self.switching } else { self.switching / 2.0 }
        };
        let below = speed.checked_sub(1).map_or(0.0, from);
        let above = if speed == last { 0.0 } else { from(speed + 1) };
        [below, 1.0 - self.switching, above]
    }

    /// The row of a speed, and the share of it that has this speed: all, or, if the speeds are
    /// `joint` in the first row, what the change of speed made of equal parts.
    pub(super) fn row<'a>(&self, mass: &'a [f64], speed: usize, joint: bool) -> (&'a [f64], f64) {
        let places = mass.len() / self.shares.len();
        if joint {
            (&mass[..places], self.shares[speed])
        } else {
            (&mass[speed * places..][..places], 1.0)
        }
    }

    /// The taps of one speed.
    pub(super) fn of(&self, speed: usize) -> &[Tap] {
        let start = speed.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.taps[start..self.ends[speed]]
    }
}

/// Those of a known advance: by `shift` places and `part` of one more, and jitter.
pub(super) fn known(shift: isize, part: f64, jitter: f64) -> [Tap; 4] {
    [-1, 0, 1, 2].map(|off| {
        let weight = (1.0 - part) * jittered(off, 1, jitter) + part * jittered(off - 1, 1, jitter);
        Tap { shift: shift + off, weight }
    })
}

/// The probability to land `off` places from the target, if jitter reaches `reach` places: at most
/// half of all goes astray.
fn jittered(off: isize, reach: isize, jitter: f64) -> f64 {
    let jitter = jitter.min(0.25 / reach as f64);
    match off.abs() {
        0 => 1.0 - 2.0 * jitter * reach as f64,
        away if away <= reach => jitter,
        _ => 0.0,
    }
}

/// The mass that a move takes beyond the ends of its segment.
pub(super) fn lost(source: &[f64], taps: &[Tap], segments: &Segments) -> f64 {
    let mut lost = 0.0;
    for &Tap { shift, weight } in taps {
        for segment in segments.iter() {
            let away = shift.unsigned_abs().min(segment.len());
            let leaving = if shift > 0 {
                segment.end - away..segment.end
            } else {
                segment.start..segment.start + away
            };
            lost += weight * source[leaving].iter().sum::<f64>();
        }
    }
    lost
}

/// Writes the belief that arrives at the places from `start` on: `factor` times the sum over the
/// taps of the weight and the belief where it comes from. Nothing comes across the end of a
/// segment.
#[inline(always)]
pub(super) fn arriving(
    source: &[f64],
    taps: &[Tap],
    segments: &Segments,
    factor: f64,
    start: usize,
    out: &mut [f64],
) {
    if !inside(taps, segments, start, out.len()) {
        return arriving_at_ends(source, taps, segments, factor, start, out);
    }
    let count = out.len();
    let from = |tap: Tap| &source[(start as isize - tap.shift) as usize..][..count];
    match *taps {
        [a] => {
            let w = factor * a.weight;
            for (out, &x) in out.iter_mut().zip(from(a)) {
                *out = w * x;
            }
        }
        [a, b, c] => {
            let w = [factor * a.weight, factor * b.weight, factor * c.weight];
            let sources = from(a).iter().zip(from(b)).zip(from(c));
            for (out, ((&a, &b), &c)) in out.iter_mut().zip(sources) {
                *out = w[0] * a + w[1] * b + w[2] * c;
            }
        }
        [a, b, c, d] => {
            let w = [factor * a.weight, factor * b.weight, factor * c.weight, factor * d.weight];
            let sources = from(a).iter().zip(from(b)).zip(from(c)).zip(from(d));
            for (out, (((&a, &b), &c), &d)) in out.iter_mut().zip(sources) {
                *out = w[0] * a + w[1] * b + w[2] * c + w[3] * d;
            }
        }
        _ => {
            out.fill(0.0);
            for &tap in taps {
                let w = factor * tap.weight;
                for (out, &x) in out.iter_mut().zip(from(tap)) {
                    *out += w * x;
                }
            }
        }
    }
}

/// Whether all that arrives at `count` places from `start` on, and they themselves, are in one
/// segment.
#[inline(always)]
pub(super) fn inside(taps: &[Tap], segments: &Segments, start: usize, count: usize) -> bool {
    let (Some(first), Some(last)) = (taps.first(), taps.last()) else { return false };
    let segment = segments.of(start);
    let (low, high) = (start as isize - last.shift, (start + count) as isize - first.shift);
    low.min(start as isize) >= segment.start as isize
        && high.max((start + count) as isize) <= segment.end as isize
}

/// [`arriving`] near the ends of segments: the same sums, with terms left out.
#[inline(always)]
fn arriving_at_ends(
    source: &[f64],
    taps: &[Tap],
    segments: &Segments,
    factor: f64,
    start: usize,
    out: &mut [f64],
) {
    out.fill(0.0);
    let end = start + out.len();
    for segment in segments.iter().filter(|segment| segment.start < end && segment.end > start) {
        for &Tap { shift, weight } in taps {
            let w = factor * weight;
            let low = segment.start.saturating_add_signed(shift).max(segment.start).max(start);
            let high = segment.end.saturating_add_signed(shift).min(segment.end).min(end);
            if low < high {
                let from = low.saturating_add_signed(-shift);
                let source = &source[from..from + high - low];
                for (out, &x) in out[low - start..high - start].iter_mut().zip(source) {
                    *out += w * x;
                }
            }
        }
    }
}
