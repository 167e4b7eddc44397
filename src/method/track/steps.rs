//! Where the belief goes between two queries (method 1.9, 3): shifts with their probabilities.

use std::ops::Range;

use super::links::Links;
use crate::error::Error;
use crate::motion::Motion;
use crate::preallocated::reserved;
use crate::segments::{Segment, Segments};
use crate::sums::BLOCK;

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
    pub(super) fn row(&self, speed: usize, joint: bool) -> (usize, f64) {
        if joint { (0, self.shares[speed]) } else { (speed, 1.0) }
    }

    /// The shifts of all taps: the least and the greatest.
    pub(super) fn shifts(&self) -> [isize; 2] {
        let shifts = || self.taps.iter().map(|tap| tap.shift);
        [shifts().min().unwrap_or(0), shifts().max().unwrap_or(0)]
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

/// How the places follow each other.
#[derive(Clone, Copy)]
pub(super) struct Way<'a> {
    pub(super) segments: &'a Segments,
    /// If it has links.
    pub(super) links: Option<&'a Links>,
}

/// Adds to each block the mass that a move takes from its places beyond the ends of their segments.
/// `mass` is that in the places from `start` on, at which a block begins; `share` of it counts.
pub(super) fn lost(
    mass: &[f64],
    start: usize,
    taps: &[Tap],
    share: f64,
    way: Way<'_>,
    blocks: &mut [f64],
) {
    beyond(taps, way, |weight, leaving| {
        let (mut at, end) = (leaving.start.max(start), leaving.end.min(start + mass.len()));
        while at < end {
            let block = (at - start) / BLOCK;
            let next = end.min(start + (block + 1) * BLOCK);
            let leaving = &mass[at - start..next - start];
            blocks[block] += share * weight * leaving.iter().sum::<f64>();
            at = next;
        }
    });
    if let Some(links) = way.links {
        links.lost(mass, start, taps, share, blocks);
    }
}

/// Calls `visit` with the weight of each tap and the places from which it leads beyond the end of
/// their segment, save those from which it may follow a link.
pub(super) fn beyond(taps: &[Tap], way: Way<'_>, mut visit: impl FnMut(f64, Range<usize>)) {
    for (index, segment) in way.segments.iter().enumerate() {
        if segment.closed {
            continue;
        }
        for &tap in taps {
            let away = tap.shift.unsigned_abs().min(segment.len());
            let leaving = if tap.shift > 0 {
                segment.end - away..segment.end
            } else {
                segment.start..segment.start + away
            };
            let clear = way.links.map_or(leaving.clone(), |links| links.clear(index, tap));
            let leaving = leaving.start.max(clear.start)..leaving.end.min(clear.end);
            if leaving.start < leaving.end {
                visit(tap.weight, leaving);
            }
        }
    }
}

/// Writes the belief that arrives at the places from `start` on: `factor` times the sum over the
/// taps of the weight and the belief where it comes from. Nothing comes across the end of a
/// segment but by a link.
#[inline(always)]
pub(super) fn arriving(
    source: &[f64],
    taps: &[Tap],
    way: Way<'_>,
    factor: f64,
    start: usize,
    out: &mut [f64],
) {
    let (Some(first), Some(last)) = (taps.first(), taps.last()) else { return out.fill(0.0) };
    let end = start + out.len();
    for segment in way.segments.within(start..end) {
        let here = segment.start.max(start)..segment.end.min(end);
        // The places that all taps reach from within the segment.
        let low = segment.start.saturating_add_signed(last.shift.max(0)).min(here.end);
        let high = segment.end.saturating_add_signed(first.shift.min(0)).max(here.start);
        let low = low.max(here.start);
        let high = high.min(here.end).max(low);
        let mut at_an_end = |places: Range<usize>| {
            if !places.is_empty() {
                let out = &mut out[places.start - start..places.end - start];
                arriving_at_an_end(source, taps, segment, factor, places.start, out);
            }
        };
        at_an_end(here.start..low);
        at_an_end(high..here.end);
        if low < high {
            arriving_inside(source, taps, factor, low, &mut out[low - start..high - start]);
        }
    }
    if let Some(links) = way.links {
        links.arriving(|place| source[place], taps, factor, start, out);
    }
}

/// [`arriving`] at places that all taps reach from within the segment.
#[inline(always)]
fn arriving_inside(source: &[f64], taps: &[Tap], factor: f64, start: usize, out: &mut [f64]) {
    let count = out.len();
    let from = |tap: Tap| &source[(start as isize - tap.shift) as usize..][..count];
    match *taps {
        [a] => {
            let w = factor * a.weight;
            let a = from(a);
            for at in 0..count {
                out[at] = w * a[at];
            }
        }
        [a, b, c] => {
            let w = [factor * a.weight, factor * b.weight, factor * c.weight];
            let (a, b, c) = (from(a), from(b), from(c));
            for at in 0..count {
                out[at] = w[0] * a[at] + w[1] * b[at] + w[2] * c[at];
            }
        }
        [a, b, c, d] => {
            let w = [factor * a.weight, factor * b.weight, factor * c.weight, factor * d.weight];
            let (a, b, c, d) = (from(a), from(b), from(c), from(d));
            for at in 0..count {
                out[at] = w[0] * a[at] + w[1] * b[at] + w[2] * c[at] + w[3] * d[at];
            }
        }
        _ => {
            out.fill(0.0);
            for &tap in taps {
                let w = factor * tap.weight;
                let source = from(tap);
                for at in 0..count {
                    out[at] += w * source[at];
                }
            }
        }
    }
}

/// [`arriving`] near the ends of a segment: the same sums, with terms left out if it is open, and
/// from its other end if it is closed.
#[inline(always)]
fn arriving_at_an_end(
    source: &[f64],
    taps: &[Tap],
    segment: &Segment,
    factor: f64,
    start: usize,
    out: &mut [f64],
) {
    out.fill(0.0);
    let (count, len) = (out.len(), segment.len());
    let at = start - segment.start;
    for &Tap { shift, weight } in taps {
        let w = factor * weight;
        let mut add = |to: usize, from: usize, count: usize| {
            let source = &source[segment.start + from..][..count];
            for (out, &x) in out[to..to + count].iter_mut().zip(source) {
                *out += w * x;
            }
        };
        if segment.closed {
            let back = shift.rem_euclid(len as isize) as usize;
            let from = if at < back { at + len - back } else { at - back };
            let before_the_seam = count.min(len - from);
            add(0, from, before_the_seam);
            add(before_the_seam, 0, count - before_the_seam);
        } else {
            // From `from` on, and those after it on the segment.
            let from = at as isize - shift;
            let skipped = from.saturating_neg().clamp(0, count as isize) as usize;
            let first = from.max(0) as usize;
            add(skipped, first.min(len), len.saturating_sub(first).min(count - skipped));
        }
    }
}
