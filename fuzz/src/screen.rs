//! Target `screen`: a map's distances are the oracle's, and a localizer with a screen gives the fixes
//! of one without, which are those of a matcher with these distances.

use std::sync::Arc;

use arbitrary::{Result, Unstructured};
use surefix::{Dtype, Given, Isa, Localizer, Map, Matcher, Metric};

use crate::bits::bits;
use crate::distances::{distance, least};
use crate::input::{config, motion, number, rarely, route};

pub(crate) fn screen(data: &[u8]) {
    let _ = run(&mut Unstructured::new(data));
}

/// Rows of one kind: of any numbers, of few levels, copies with one number changed.
fn rows(u: &mut Unstructured<'_>, count: usize, dim: usize) -> Result<Vec<f32>> {
    let mut rows = Vec::with_capacity(count * dim);
    let mut state = u64::from(u.arbitrary::<u32>()?) | 1;
    let levels = [2, 5, 256, 1 << 16][u.int_in_range(0..=3)?];
    for _ in 0..count * dim {
        state = state.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(1);
        rows.push((state >> 40) as f32 % levels as f32 / levels as f32);
    }
    for _ in 0..u.int_in_range(0..=6)? {
        let at = u.choose_index(rows.len())?;
        rows[at] = number(u)?;
    }
    if count > 1 && rarely(u, 3)? {
        let (from, to) = (u.choose_index(count)?, u.choose_index(count)?);
        rows.copy_within(from * dim..(from + 1) * dim, to * dim);
    }
    Ok(rows)
}

fn run(u: &mut Unstructured<'_>) -> Result<()> {
    let segments = route(u, 300)?;
    let dim = if segments.places() > 40 { 3 } else { u.int_in_range(1..=40)? };
    let metric = [Metric::Manhattan, Metric::Euclidean, Metric::Cosine][u.int_in_range(0..=2)?];
    let mut config = config(u)?;
    if rarely(u, 5)? {
        config.motion = Some(motion(u)?);
    }
    let numbers = rows(u, segments.places(), dim)?;
    let Ok(map) = Map::from_descriptors(numbers.clone(), dim, metric) else { return Ok(()) };
    let map = map.with_segments(segments.clone()).expect("as many places");
    if rarely(u, 6)? {
        return traverse(u, &map, &numbers);
    }
    let Ok(screened) = map.clone().with_screen(Dtype::I8) else { return Ok(()) };
    let Ok(matcher) = Matcher::along(segments, config.clone()) else { return Ok(()) };
    let isas: Vec<Isa> = Isa::available().collect();
    let isa = isas[u.choose_index(isas.len())?];
    let on = |map: &Map| {
        let map = Arc::new(map.clone().with_isa(isa).expect("an available one"));
        Localizer::new(map, config.clone()).expect("what a matcher takes")
    };
    let (mut plain, mut screened, mut matcher) = (on(&map), on(&screened), matcher);
    let mut query = vec![0.0; dim];
    for _ in 0..12 {
        if u.is_empty() {
            break;
        }
        match u.int_in_range(0..=9)? {
            0 => {
                plain.gap();
                screened.gap();
                matcher.gap();
            }
            1 => swap(&mut plain, &mut screened),
            2 => query = rows(u, 1, dim)?,
            _ => {
                let place = u.choose_index(map.places())?;
                query.copy_from_slice(&numbers[place * dim..][..dim]);
                for _ in 0..u.int_in_range(0..=2)? {
                    query[u.choose_index(dim)?] = number(u)?;
                }
            }
        }
        let one = plain.push_descriptor(query.as_slice());
        let other = screened.push_descriptor(query.as_slice());
        match (one, other) {
            (Ok(one), Ok(other)) => {
                assert_eq!(bits(&one), bits(&other), "{one:?}, {other:?}");
                let distances = map.distances(query.as_slice()).expect("it was pushed");
                let third = matcher.push_with(&distances, Given::default()).expect("it was pushed");
                assert_eq!(bits(&one), bits(&third), "{one:?}, {third:?}");
                check(&map, &numbers, &query, &distances);
            }
            (Err(one), Err(other)) => assert_eq!(one.to_string(), other.to_string()),
            (one, other) => panic!("{one:?}, {other:?}"),
        }
    }
    Ok(())
}

/// Either goes on from the other's snapshot.
fn swap(plain: &mut Localizer, screened: &mut Localizer) {
    let bytes = [&*plain, &*screened].map(|one| one.snapshot().expect("a small state"));
    assert!(bytes[0] == bytes[1]);
    for (localizer, bytes) in [(plain, &bytes[1]), (screened, &bytes[0])] {
        let map = Arc::clone(localizer.map());
        let config = localizer.config().clone();
        *localizer = Localizer::restore(map, bytes, Some(&config)).expect("its own snapshot");
    }
}

/// Whether a vector, or a place of the map, may show nothing (method 1.7).
fn shows_all(map: &Map, query: &[f32]) -> bool {
    map.blank().is_empty() && (query.len() <= 8 || query.iter().any(|&x| x != 0.0))
}

fn check(map: &Map, rows: &[f32], query: &[f32], distances: &[f32]) {
    if shows_all(map, query) {
        for (row, got) in rows.chunks_exact(query.len()).zip(distances) {
            let expected = distance(row, query, map.metric());
            assert_eq!(got.to_bits(), expected.to_bits(), "{row:?} {query:?}: {got} {expected}");
        }
    }
}

/// A further traverse: the distances are the least of its and the first's.
fn traverse(u: &mut Unstructured<'_>, map: &Map, first: &[f32]) -> Result<()> {
    let dim = map.dim();
    let count = u.int_in_range(2..=map.places())?;
    let numbers = rows(u, count, dim)?;
    let Ok(more) = Map::from_descriptors(numbers.clone(), dim, map.metric()) else {
        return Ok(());
    };
    let skipped = u.int_in_range(0..=map.places() - count)?;
    let places: Vec<Option<usize>> = (0..count).map(|row| Some(row + skipped)).collect();
    let Ok(both) = map.add_traverse(&more, &places, "winter") else { return Ok(()) };
    let bytes = both.to_bytes().expect("a map");
    let again = Map::from_bytes(&bytes).expect("its own bytes");
    assert!(again.to_bytes().expect("a map") == bytes);
    let query = rows(u, 1, dim)?;
    let (one, other) = (both.distances(query.as_slice()), again.distances(query.as_slice()));
    let (Ok(one), Ok(other)) = (one, other) else { return Ok(()) };
    // Beyond the range of float32 there are NaNs.
    assert!(one.iter().zip(&other).all(|(a, b)| a.to_bits() == b.to_bits()), "{one:?} {other:?}");
    if shows_all(map, &query) && shows_all(&both, &query) && shows_all(&more, &query) {
        let of = |rows: &[f32]| -> Vec<f32> {
            rows.chunks_exact(dim).map(|row| distance(row, &query, map.metric())).collect()
        };
        let places = places.into_iter().flatten().collect();
        let expected = least(&of(first), &[(places, of(&numbers))]);
        let equal = |(a, b): (&f32, &f32)| a == b || (a.is_nan() && b.is_nan());
        assert!(one.iter().zip(&expected).all(equal), "{one:?} {expected:?}");
    }
    Ok(())
}
