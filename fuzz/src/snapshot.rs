//! Target `snapshot`: bytes as snapshots of a matcher, of localizers on the maps of the seeds, and of
//! statistics. What is restored goes on, and its own snapshot gives the same answers.

use std::sync::{Arc, OnceLock};

use surefix::{Given, Input, Localizer, Map, Matcher, Metric, Running, Segments, Step, View};

use crate::bits::bits;
use crate::signed::signed;

/// Places and numbers of the maps.
pub(crate) const PLACES: usize = 12;
pub(crate) const DIM: usize = 4;

/// A row or a query, of a seed.
pub(crate) fn numbers(seed: usize) -> [f32; DIM] {
    std::array::from_fn(|at| ((seed * DIM + at) * 7919 % 1009) as f32 / 64.0 - 5.0)
}

/// The maps that snapshots may belong to: plain ones, and one that standardises by the drive.
pub(crate) fn maps() -> &'static [Arc<Map>; 3] {
    static MAPS: OnceLock<[Arc<Map>; 3]> = OnceLock::new();
    MAPS.get_or_init(|| {
        let map = |seed: usize| {
            let rows: Vec<f32> = (0..PLACES).flat_map(|place| numbers(seed + place)).collect();
            Map::from_descriptors(rows, DIM, Metric::Euclidean).expect("a small map")
        };
        let route = Segments::new(PLACES, &[5]).and_then(|route| route.with_closed(&[1]));
        let town = map(0).with_segments(route.expect("two segments")).expect("as many places");
        let steps = [Step::StandardizeRunning];
        let rows: Vec<f32> = (0..PLACES).flat_map(numbers).collect();
        let (post, rows) = surefix::Post::fit(&steps, &rows, DIM).expect("a step");
        let running = Map::from_descriptors(rows, DIM, Metric::Manhattan).expect("a small map");
        [Arc::new(map(0)), Arc::new(town), Arc::new(running.with_post(post).expect("f32 rows"))]
    })
}

pub(crate) fn snapshot(data: &[u8]) {
    let Some((&kind, bytes)) = data.split_first() else { return };
    let bytes = signed(bytes);
    match kind % 6 {
        0 => matcher(&bytes),
        1 => running(&bytes),
        2..=4 => localizer(&maps()[usize::from(kind % 6) - 2..][..1], &bytes),
        _ => localizer(&[Arc::clone(&maps()[0]), Arc::clone(&maps()[2])], &bytes),
    }
}

fn matcher(bytes: &[u8]) {
    let Ok(mut one) = Matcher::restore(bytes, None) else { return };
    let config = one.config().clone();
    if one.places() * config.sequence_length.max(config.smoothing) > 1 << 12 {
        return;
    }
    let saved = one.snapshot().expect("what was restored");
    let mut other = Matcher::restore(&saved, Some(&config)).expect("its own snapshot");
    assert!(other.snapshot().expect("what was restored") == saved);
    for query in 0..4_usize {
        let column: Vec<f32> = (0..one.places()).map(|place| numbers(place + query)[0]).collect();
        let given = if query == 2 { Given::default().advance(1.5) } else { Given::default() };
        let fixes = [&mut one, &mut other].map(|matcher| matcher.push_with(&column, given));
        let [one, other] = fixes.map(|fix| bits(&fix.expect("finite distances")));
        assert_eq!(one, other);
    }
    one.gap();
    one.reset();
}

fn running(bytes: &[u8]) {
    let Ok(mut one) = Running::restore(bytes) else { return };
    if one.dim() > 1 << 12 {
        return;
    }
    let saved = one.snapshot().expect("what was restored");
    let mut other = Running::restore(&saved).expect("its own snapshot");
    let vector = vec![0.5; one.dim()];
    let mut out = [vec![0.0; one.dim()], vec![0.0; one.dim()]];
    let [first, second] = &mut out;
    let pushed = (one.push(&vector, first), other.push(&vector, second));
    assert_eq!(pushed.0.is_ok(), pushed.1.is_ok());
    assert_eq!(out[0], out[1]);
    assert!(one == other && out[0].iter().all(|x| x.is_finite()));
}

fn localizer(maps: &[Arc<Map>], bytes: &[u8]) {
    let Ok(mut one) = Localizer::restore_fused(maps.to_vec(), bytes, None) else { return };
    let config = one.config().clone();
    let saved = one.snapshot().expect("what was restored");
    let mut other =
        Localizer::restore_fused(maps.to_vec(), &saved, Some(&config)).expect("its own snapshot");
    for query in 0..4 {
        let numbers = numbers(3 + query);
        let inputs = vec![Input::Descriptor(View::F32(&numbers)); maps.len()];
        let push = |localizer: &mut Localizer| localizer.push_inputs(&inputs, Given::default());
        let (one, other) = (push(&mut one), push(&mut other));
        match (one, other) {
            (Ok(one), Ok(other)) => assert_eq!(bits(&one), bits(&other)),
            (one, other) => assert!(one.is_err() && other.is_err()),
        }
    }
}
