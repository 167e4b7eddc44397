//! Threads that die, that are delayed, that are late.

use super::*;
use crate::distance::Metric;
use crate::numbers::View;

fn map() -> (Arc<Map>, Vec<u8>) {
    let rows: Vec<u8> = (0..200_u32 * 16).map(|at| (at * 37 % 251) as u8).collect();
    (Arc::new(Map::from_descriptors(rows, 16, Metric::Manhattan).unwrap()), (0..16).collect())
}

fn job<'a>(map: &Map, query: &'a [u8]) -> Job<'a> {
    Job::Distances(map.query(View::U8(query)).unwrap())
}

#[test]
fn the_results_do_not_need_a_thread_that_died() {
    let (map, query) = map();
    let expected = map.distances(&query).unwrap();
    let mut pool = Pool::new(&map, 3).unwrap();
    let mut out = vec![0.0; 200];
    let mailbox = Arc::clone(&pool.workers[0].mailbox);
    let died = thread::spawn(move || {
        let _held = mailbox.slot.lock();
        std::panic::resume_unwind(Box::new("without a word"));
    });
    assert!(died.join().is_err());
    for _ in 0..3 {
        out.fill(-1.0);
        pool.scan(job(&map, &query), &mut out);
        assert_eq!(out, expected);
    }
}

#[test]
fn the_caller_does_not_wait_for_a_delayed_thread() {
    let (map, query) = map();
    let expected = map.distances(&query).unwrap();
    let mut pool = Pool::new(&map, 3).unwrap();
    let mailbox = Arc::clone(&pool.workers[1].mailbox);
    let held = mailbox.slot.lock().unwrap();
    let mut out = vec![0.0; 200];
    for _ in 0..3 {
        out.fill(-1.0);
        pool.scan(job(&map, &query), &mut out);
        assert_eq!(out, expected);
    }
    drop(held);
}

#[test]
fn late_results_are_ignored() {
    let (map, query) = map();
    let pool = Pool::new(&map, 2).unwrap();
    let (mailbox, shared) = (&pool.workers[0].mailbox, &pool.shared);
    // All chunks are taken: the thread finds none by itself.
    while shared.take().is_some() {}
    mailbox.post(2, job(&map, &query));
    let places = shared.rows(0);
    let late = vec![-1.0; places.len()];
    assert!(!mailbox.hand_in(1, 0, &late, places.clone()), "of the round before");
    assert!(mailbox.hand_in(2, 0, &late, places));
    let (mut out, mut done) = (vec![0.0; 200], vec![false; pool.done.len()]);
    mailbox.collect(3, shared, &mut out, &mut done);
    assert!(out.iter().all(|&d| d == 0.0) && !done.contains(&true), "asked for the round after");
    mailbox.collect(2, shared, &mut out, &mut done);
    assert!(out[0] == -1.0 && done[0]);
}

#[test]
fn a_thread_that_missed_a_post_allocates_nothing() {
    let (map, query) = map();
    let pool = Pool::new(&map, 2).unwrap();
    let (mailbox, shared) = (&pool.workers[0].mailbox, &pool.shared);
    while shared.take().is_some() {}
    mailbox.post(1, job(&map, &query));
    let hand_in = |chunk: usize| {
        let rows = shared.rows(chunk);
        mailbox.hand_in(1, chunk, &vec![0.0; rows.len()], rows)
    };
    let room = || mailbox.slot.lock().unwrap().chunks.capacity();
    let before = room();
    assert!((0..shared.len()).all(hand_in));
    // The caller has not collected them, and its chunks of the next frame are free.
    (0..shared.len()).for_each(|chunk| _ = hand_in(chunk));
    assert_eq!(room(), before);
}

#[test]
fn small_maps_have_no_workers_and_large_ones_have_them_unasked() {
    let map =
        |places: usize| Map::from_descriptors(vec![1_u8; places * 4096], 4096, Metric::Manhattan);
    assert_eq!(threads_for(&map(1800).unwrap()), 1);
    let cores = thread::available_parallelism().map_or(1, usize::from);
    assert_eq!(threads_for(&map(4096).unwrap()), cores.min(2));
}
