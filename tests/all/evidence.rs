//! What a query speaks for (docs/method.md, 1.9), technique by technique, as plainly as can be.

use surefix::Motion;

use crate::cases::tells;

/// What the techniques say of a query, by the statistics so far.
pub(crate) struct Said {
    /// The weighted mean of their standard scores: the column of the paper's steps.
    pub(crate) mean: Vec<f64>,
    /// The scores that views are compared by, and those that speak for places.
    pub(crate) view: Vec<f64>,
    pub(crate) evidence: Vec<f64>,
    /// Whether any technique tells a place from another.
    pub(crate) tells: bool,
}

/// What a drive's queries say; `d` has the columns of each technique.
pub(crate) fn said(d: &[Vec<Vec<f32>>], weights: &[f64], motion: &Motion) -> Vec<Said> {
    let places = d[0][0].len();
    let mean = |x: &[f64]| x.iter().sum::<f64>() / places as f64;
    let total: f64 = weights.iter().sum();
    let root = weights.iter().map(|weight| weight * weight).sum::<f64>().sqrt();
    let alone = d.len() == 1;
    let mut known = vec![(0.0, vec![0.0; places]); d.len()];
    let query = |j: usize| {
        let zeros = || vec![0.0; places];
        let mut said = Said { mean: zeros(), view: zeros(), evidence: zeros(), tells: false };
        for ((d, weight), (k, sums)) in d.iter().zip(weights).zip(&mut known) {
            let column = &d[j];
            if !tells(column) || *weight == 0.0 {
                continue;
            }
            *k += 1.0;
            sums.iter_mut().zip(column).for_each(|(sum, &d)| *sum += f64::from(d));
            let hubs: Vec<f64> = sums.iter().map(|sum| sum / (*k + motion.hubness)).collect();
            let d: Vec<f64> = column.iter().map(|&d| d.into()).collect();
            let x: Vec<f64> = d.iter().zip(&hubs).map(|(d, hub)| d - hub).collect();
            let centre = mean(&x);
            let squares: Vec<f64> = x.iter().map(|one| (one - centre).powi(2)).collect();
            let deviation = mean(&squares).sqrt();
            let flat = deviation <= 1e-12 * (mean(&d).abs() + mean(&hubs).abs());
            for (place, x) in x.iter().enumerate() {
                let z = if flat { 0.0 } else { (x - centre) / deviation };
                let clipped = z.clamp(-motion.clip, motion.clip);
                said.mean[place] += weight / total * z;
                said.evidence[place] += weight / root * clipped;
                said.view[place] += if alone { z } else { weight / root * clipped };
            }
            said.tells = true;
        }
        said
    };
    (0..d[0].len()).map(query).collect()
}

/// What the frames of a drive say of its own earlier places, which become more: a place's usual
/// distance is what it is beyond the mean of all, over the frames since it is there.
pub(crate) fn said_of_itself(d: &[Vec<f32>], motion: &Motion) -> Vec<Said> {
    let mut known: Vec<(f64, f64)> = Vec::new();
    let query = |column: &Vec<f32>| {
        let places = column.len();
        let mean = |x: &[f64]| x.iter().sum::<f64>() / places as f64;
        known.resize(places, (0.0, 0.0));
        let d: Vec<f64> = column.iter().map(|&d| d.into()).collect();
        let mut z = vec![0.0; places];
        if tells(column) {
            let all = mean(&d);
            let usual = |(d, (k, sum)): (&f64, &mut (f64, f64))| {
                (*k, *sum) = (*k + 1.0, *sum + d - all);
                d - *sum / (*k + motion.hubness)
            };
            let x: Vec<f64> = d.iter().zip(&mut known).map(usual).collect();
            let centre = mean(&x);
            let squares: Vec<f64> = x.iter().map(|one| (one - centre).powi(2)).collect();
            let deviation = mean(&squares).sqrt();
            if deviation > 1e-12 * mean(&d).abs() {
                let z_of = |one: &f64| (one - centre) / deviation;
                z = x.iter().map(|one| z_of(one).clamp(-motion.clip, motion.clip)).collect();
            }
        }
        Said { mean: z.clone(), view: z.clone(), evidence: z, tells: tells(column) }
    };
    d.iter().map(query).collect()
}

/// The correlation of two views, if neither is flat.
pub(crate) fn correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let off = |x: &[f64]| {
        let mean = x.iter().sum::<f64>() / x.len() as f64;
        x.iter().map(|x| x - mean).collect::<Vec<f64>>()
    };
    let (a, b) = (off(a), off(b));
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let spread = product(&a, &a).sqrt() * product(&b, &b).sqrt();
    (spread > 1e-12).then(|| product(&a, &b) / spread)
}
