//! Helpers that die, that are held up, that are late.

use super::*;
use crate::distance::Metric;
use crate::numbers::View;

fn map() -> (Arc<Map>, Vec<u8>) {
    let rows: Vec<u8> = (0..200_u32 * 16).map(|at| (at * 37 % 251) as u8).collect();
    (Arc::new(Map::from_descriptors(rows, 16, Metric::Manhattan).unwrap()), (0..16).collect())
}

fn sought<'a>(map: &Map, query: &'a [u8]) -> Sought<'a> {
    Sought::Distances(map.query(View::U8(query)).unwrap())
}

#[test]
fn a_helper_that_dies_is_missed_by_nobody() {
    let (map, query) = map();
    let expected = map.distances(&query).unwrap();
    let mut crew = Crew::new(&map, 3).unwrap();
    let mut out = vec![0.0; 200];
    let desk = Arc::clone(&crew.helpers[0].desk);
    let died = thread::spawn(move || {
        let _held = desk.tray.lock();
        std::panic::resume_unwind(Box::new("without a word"));
    });
    assert!(died.join().is_err());
    for _ in 0..3 {
        out.fill(-1.0);
        crew.scan(sought(&map, &query), &mut out);
        assert_eq!(out, expected);
    }
}

#[test]
fn nobody_waits_for_a_helper_that_is_held_up() {
    let (map, query) = map();
    let expected = map.distances(&query).unwrap();
    let mut crew = Crew::new(&map, 3).unwrap();
    let desk = Arc::clone(&crew.helpers[1].desk);
    let held = desk.tray.lock().unwrap();
    let mut out = vec![0.0; 200];
    for _ in 0..3 {
        out.fill(-1.0);
        crew.scan(sought(&map, &query), &mut out);
        assert_eq!(out, expected);
    }
    drop(held);
}

#[test]
fn what_is_handed_in_late_is_not_looked_at() {
    let (map, query) = map();
    let crew = Crew::new(&map, 2).unwrap();
    let (desk, work) = (&crew.helpers[0].desk, &crew.work);
    // All is dealt out: the helper finds nothing to do by itself.
    work.next.store(1 << 20, Ordering::Relaxed);
    desk.order(2, sought(&map, &query));
    let places = work.places(0);
    let late = vec![-1.0; places.len()];
    assert!(!desk.hand_in(1, 0, &late, places.clone()), "of the round before");
    assert!(desk.hand_in(2, 0, &late, places));
    let (mut out, mut done) = (vec![0.0; 200], vec![false; crew.done.len()]);
    desk.collect(3, work, &mut out, &mut done);
    assert!(out.iter().all(|&d| d == 0.0) && !done.contains(&true), "asked for the round after");
    desk.collect(2, work, &mut out, &mut done);
    assert!(out[0] == -1.0 && done[0]);
}

#[test]
fn small_maps_have_no_helpers_and_large_ones_have_them_unasked() {
    let map =
        |places: usize| Map::from_descriptors(vec![1_u8; places * 4096], 4096, Metric::Manhattan);
    assert_eq!(threads_for(&map(1800).unwrap()), 1);
    let cores = thread::available_parallelism().map_or(1, usize::from);
    assert_eq!(threads_for(&map(4096).unwrap()), cores.min(2));
}
