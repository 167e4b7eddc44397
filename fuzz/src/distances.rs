//! Distances once more (methods 1.6 and 1.14): plain, in their order.

use surefix::Metric;

/// The sum of terms by sixteen sums, that of index `i` to sum `i mod 16`.
fn sixteen(terms: impl Iterator<Item = f64>) -> f64 {
    let mut sums = [0.0; 16];
    terms.enumerate().for_each(|(index, term)| sums[index % 16] += term);
    for half in [8, 4, 2, 1] {
        for at in 0..half {
            sums[at] += sums[at + half];
        }
    }
    sums[0]
}

/// The distance of two vectors that are compared in units of 1.
pub(crate) fn distance(row: &[f32], query: &[f32], metric: Metric) -> f32 {
    let pairs = || row.iter().zip(query);
    let apart = || pairs().map(|(r, q)| f64::from(r - q));
    let products =
        |a: &[f32], b: &[f32]| sixteen(a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)));
    let distance = match metric {
        Metric::Manhattan => sixteen(apart().map(f64::abs)) / row.len() as f64,
        Metric::Euclidean => sixteen(apart().map(|x| x * x)).sqrt(),
        _ => {
            let length = |x: &[f32]| products(x, x).sqrt();
            let lengths = length(query) * length(row);
            let cosine = if lengths > 0.0 { products(row, query) / lengths } else { 0.0 };
            (1.0 - cosine).clamp(0.0, 2.0)
        }
    };
    distance as f32
}

/// Brings a further traverse's distances to the mean that the first has at its places, and takes
/// the least for each place.
pub(crate) fn least(first: &[f32], further: &[(Vec<usize>, Vec<f32>)]) -> Vec<f32> {
    let mut least = first.to_vec();
    for (places, distances) in further {
        let mut shift = 0.0;
        for (&place, &distance) in places.iter().zip(distances) {
            shift += f64::from(first[place]) - f64::from(distance);
        }
        let shift = shift / places.len() as f64;
        for (&place, &distance) in places.iter().zip(distances) {
            let distance = (f64::from(distance) + shift) as f32;
            // Beyond the range of float32 there are NaNs, which stay.
            if distance < least[place] || distance.is_nan() {
                least[place] = distance;
            }
        }
    }
    least
}
