//! Weighted sequence matching (method 1.4 and 1.5, Eqs. 4 to 6).

use super::consensus::Single;
use super::extreme::{extreme, first_equal};
use super::ring::Ring;
use crate::config::reach;
use crate::error::Error;

/// The best match of the last `L` queries together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sequence {
    /// The current query's place, from 0.
    pub place: usize,
    /// The mean of the weighted distances along the diagonal that ends there (Eq. 6).
    pub score: f32,
    /// How many trusted matches lie on that diagonal, from 0 to `L`.
    pub anchors: usize,
    /// The slope of that diagonal, in places a query.
    pub speed: f64,
}

/// The single match of a column and whether it was trusted: all that Eq. 4 needs to weight it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Anchor {
    pub(super) single: Single,
    pub(super) trusted: bool,
}

/// A slope, and how many places back it lies `k` queries ago: `round(v k)`.
#[derive(Clone, Debug)]
pub(super) struct Diagonal {
    speed: f64,
    back: Vec<usize>,
}

impl Diagonal {
    pub(super) fn new(speed: f64, length: usize) -> Result<Self, Error> {
        let mut back = Vec::new();
        back.try_reserve_exact(length).map_err(|_| Error::Memory { places: 1, columns: length })?;
        back.extend((0..length).map(|age| reach(speed, age) as usize));
        Ok(Self { speed, back })
    }

    /// Eq. 6: the place where the sum along this diagonal, and so the mean, is smallest, the first of equals, and that
    /// sum. Only places far enough along the route have a full window.
    fn best(&self, columns: &Ring) -> (usize, f64) {
        const BLOCK: usize = 128;
        let places = columns.column(0).len();
        let first = self.back.last().copied().unwrap_or(0);
        let mut best = (first, f64::INFINITY);
        let mut sums = [0.0_f64; BLOCK];
        for start in (first..places).step_by(BLOCK) {
            let sums = &mut sums[..BLOCK.min(places - start)];
            sums.fill(0.0);
            for (age, back) in self.back.iter().enumerate() {
                let terms = &columns.column(age)[start - back..start - back + sums.len()];
                sums.iter_mut().zip(terms).for_each(|(sum, &term)| *sum += f64::from(term));
            }
            let smallest = extreme(sums, f64::INFINITY, |a, b| if b < a { b } else { a });
            if smallest < best.1 {
                best = (start + first_equal(sums, smallest), smallest);
            }
        }
        best
    }

    /// How many trusted cells lie on the diagonal that ends in `place`.
    fn anchors(&self, place: usize, anchors: impl Iterator<Item = Anchor>) -> usize {
        self.back
            .iter()
            .zip(anchors)
            .filter(|(back, anchor)| anchor.trusted && anchor.single.place + **back == place)
            .count()
    }
}

/// Eq. 4: the trusted cell's distance, drawn towards the floor by `weight`.
fn weighted(distance: f32, weight: f64, floor: f64) -> f32 {
    let distance = f64::from(distance);
    (distance - weight * (distance - floor)) as f32
}

/// Eqs. 4 to 6 on full windows: weights the trusted cells of `columns` while it sums, and restores them.
///
/// The sums run in f64, where sums of f32 numbers of like size are exact: their order cannot change the answer.
pub(super) fn best_sequence(
    columns: &mut Ring,
    anchors: impl Fn(usize) -> Anchor,
    diagonals: &[Diagonal],
    weight: f64,
    floor: f64,
) -> Option<Sequence> {
    let length = columns.len();
    let set_anchored_cells = |value: &dyn Fn(f32) -> f32, columns: &mut Ring| {
        for (age, anchor) in (0..length).map(|age| (age, anchors(age))).filter(|(_, anchor)| anchor.trusted) {
            columns.column_mut(age)[anchor.single.place] = value(anchor.single.distance);
        }
    };
    set_anchored_cells(&|distance| weighted(distance, weight, floor), columns);
    let mut best: Option<(&Diagonal, (usize, f64))> = None;
    for diagonal in diagonals {
        let (place, sum) = diagonal.best(columns);
        // The smallest sum; of equals the lowest place, then the speed named first.
        let wins = best.is_none_or(|(_, (at, least))| sum < least || (sum == least && place < at));
        if wins {
            best = Some((diagonal, (place, sum)));
        }
    }
    set_anchored_cells(&|distance| distance, columns);
    best.map(|(diagonal, (place, sum))| Sequence {
        place,
        score: (sum / length as f64) as f32,
        anchors: diagonal.anchors(place, (0..length).map(&anchors)),
        speed: diagonal.speed,
    })
}
