//! The generated route behaves as real ones do: hard for single frames, and easier for trusted
//! sequences.

use std::ops::ControlFlow;

use surefix::describe_all;
use surefix::evaluate::{Recall, Truth, evaluate};
use surefix::{Config, Drive, Floor, Map, Run, Sad, match_descriptors};
use surefix_simulate::{Conditions, Leg, Route, RouteConfig};

/// A map of the reference drive, the revisit matched against it with each weight, and the truth.
fn drive(seed: u64, conditions: Conditions, weights: [f64; 2]) -> ([Run; 2], Vec<Option<usize>>) {
    let config =
        RouteConfig { places: 1000, width: 64, height: 32, seed, ..RouteConfig::default() };
    let route = Route::new(config).unwrap();
    let reference = route.traverse(Conditions::reference()).unwrap();
    let revisit = route.traverse(conditions).unwrap();
    let progress = &mut |_, _| ControlFlow::Continue(());
    let map = Map::from_images(&reference, Sad::default(), progress).unwrap();
    let queries = describe_all(&Sad::default(), &revisit, progress).unwrap();
    let runs = weights.map(|weight| {
        let config = config! { weight, floor: Floor::Global };
        match_descriptors(&map, &queries, &config, Drive::default(), &mut |_, _| {
            ControlFlow::Continue(())
        })
        .unwrap()
    });
    (runs, revisit.truth(&reference))
}

fn share_right(run: &Run, truth: &[Option<usize>], of: impl Fn(&surefix::Fix) -> bool) -> f64 {
    let judged = run.fixes.iter().zip(truth).filter(|(fix, _)| of(fix));
    let right: Vec<bool> = judged
        .map(|(fix, truth)| truth.is_some_and(|truth| truth.abs_diff(fix.single.place) <= 1))
        .collect();
    right.iter().filter(|right| **right).count() as f64 / right.len() as f64
}

#[test]
fn single_frames_are_hard_trusted_ones_are_right_and_weighting_wins() {
    for seed in 1..=3 {
        let ([plain, weighted], truth) = drive(seed, Conditions::revisit(), [0.0, 0.99]);
        let r1 = share_right(&plain, &truth, |_| true);
        assert!((0.2..=0.7).contains(&r1), "seed {seed}: R@1 {r1}");
        let trusted = share_right(&plain, &truth, |fix| fix.trusted);
        assert!(
            trusted > 0.85 && trusted > r1 + 0.2,
            "seed {seed}: {trusted} of the trusted are right"
        );
        let truth = Truth::places(truth, 1);
        let area = |run| evaluate(&Run::matches(run), &truth, Recall::Correct).unwrap().auc(0.2);
        let (plain, weighted) = (area(&plain), area(&weighted));
        assert!(
            weighted > plain + 0.05,
            "seed {seed}: {plain} without the weights, {weighted} with them"
        );
    }
}

#[test]
fn the_same_drive_again_is_found_frame_by_frame() {
    let ([run, _], truth) = drive(1, Conditions::reference(), [0.99, 0.0]);
    assert_eq!(share_right(&run, &truth, |_| true), 1.0);
    assert!(run.fixes.iter().all(|fix| fix.single.distance == 0.0));
}

#[test]
fn frames_of_a_route_of_a_million_places_need_no_others() {
    let route = |places| {
        let config = RouteConfig { places, width: 64, height: 32, ..RouteConfig::default() };
        Route::new(config).unwrap().traverse(Conditions::reference()).unwrap()
    };
    let (long, short) = (route(1_000_000), route(1000));
    assert_eq!(long.len(), 1_000_000);
    assert_eq!(long.frame(500), short.frame(500));
    assert_ne!(long.frame(999_999), long.frame(999_990));
}

#[test]
fn off_the_map_no_place_is_near() {
    for seed in 1..=3 {
        let config = RouteConfig { places: 400, width: 64, height: 32, seed, ..Default::default() };
        let route = Route::new(config).unwrap();
        let progress = &mut |_, _| ControlFlow::Continue(());
        let reference = route.traverse(Conditions::reference()).unwrap();
        let map = Map::from_images(&reference, Sad::default(), progress).unwrap();
        let legs = [
            Leg::Drive(150, 1.0),
            Leg::Detour(100, 1.0),
            Leg::Loop(100, 1.0),
            Leg::Drive(150, 1.0),
        ];
        let conditions = Conditions { noise: 0.05, ..Conditions::reference() };
        let drive = route.drive(conditions, &legs).unwrap();
        let queries = describe_all(&Sad::default(), &drive, progress).unwrap();
        let run = match_descriptors(&map, &queries, &Config::default(), Drive::default(), progress)
            .unwrap();
        let nearest = |on_map: bool| -> Vec<f32> {
            let frames =
                (0..drive.len()).filter(|&index| drive.position(index).is_some() == on_map);
            let mut nearest: Vec<f32> =
                frames.map(|index| run.fixes[index].single.distance).collect();
            nearest.sort_by(f32::total_cmp);
            nearest
        };
        let (on, off) = (nearest(true), nearest(false));
        assert_eq!((on.len(), off.len()), (300, 200));
        assert!(2.0 * on[299] < off[0], "seed {seed}: {} on the map, {} off it", on[299], off[0]);
    }
}
