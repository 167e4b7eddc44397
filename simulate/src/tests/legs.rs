//! Drives that stop, reverse, leave the map and come back, and what their wheels count.

use super::*;

fn driven(places: usize, conditions: Conditions, legs: &[Leg]) -> Traverse {
    route(places, 1).drive(conditions, legs).unwrap()
}

/// Every kind of leg, off the map twice.
const LEGS: [Leg; 8] = [
    Leg::Drive(120, 1.0),
    Leg::Stop(10),
    Leg::Reverse(20, 0.5),
    Leg::Detour(60, 1.0),
    Leg::Stop(5),
    Leg::Drive(50, 2.0),
    Leg::Loop(40, 1.5),
    Leg::Drive(80, 1.0),
];

#[test]
fn legs_say_where_each_frame_is_taken() {
    let drive = driven(300, Conditions::reference(), &LEGS);
    let place = |index| drive.position(index).map(|metres| metres / 3.0);
    assert_eq!(drive.len(), 385);
    assert_eq!((place(0), place(119), place(129)), (Some(0.0), Some(119.0), Some(119.0)));
    assert_eq!((place(130), place(149)), (Some(118.5), Some(109.0)));
    // A stop after a detour is off the map, too, and the road goes on where the detour leads to.
    assert!((150..215).all(|index| place(index).is_none()));
    assert_eq!((place(215), place(264)), (Some(171.0), Some(269.0)));
    assert!((265..305).all(|index| place(index).is_none()));
    assert_eq!((place(305), place(384)), (Some(210.0), Some(289.0)));
    let truth = drive.truth(&driven(300, Conditions::reference(), &[Leg::Drive(300, 1.0)]));
    assert_eq!(
        (truth[129], truth[149], truth[214], truth[305]),
        (Some(119), Some(109), None, Some(210))
    );
    // The earliest frame of those that stood there, and none of those off the map.
    assert_eq!(drive.truth(&drive)[129], Some(119));
    assert_eq!(drive.truth(&drive)[364], Some(264));
}

#[test]
fn a_traverse_is_the_drive_of_one_leg() {
    let whole = driven(90, Conditions::revisit(), &[Leg::Drive(90, 1.0)]);
    let traverse = route(90, 1).traverse(Conditions::revisit()).unwrap();
    assert!((0..90).all(|index| whole.frame(index) == traverse.frame(index)));
    // However the drive gets there: the frame depends on the place and, by traffic and noise, on
    // the time.
    let still = Conditions { occluders: 0.0, noise: 0.0, ..Conditions::revisit() };
    let back = [Leg::Drive(60, 1.0), Leg::Stop(4), Leg::Reverse(30, 1.0), Leg::Drive(20, 0.5)];
    let (back, ahead) = (driven(90, still, &back), driven(90, still, &[Leg::Drive(90, 1.0)]));
    for (index, place) in [(63, 59), (64, 58), (93, 29), (95, 30), (113, 39)] {
        assert_eq!(back.frame(index), ahead.frame(place), "frame {index}");
        assert_eq!(back.position(index), ahead.position(place));
    }
    let noisy = driven(90, Conditions::revisit(), &[Leg::Drive(60, 1.0), Leg::Stop(4)]);
    assert_ne!(noisy.frame(62), noisy.frame(63), "standing, the traffic and the noise go on");
}

#[test]
fn the_wheels_count_the_way_that_was_driven() {
    for conditions in [Conditions::reference(), Conditions::revisit()] {
        let drive = driven(300, conditions, &LEGS);
        let sum = |frames: std::ops::Range<usize>| -> f64 {
            frames.map(|index| drive.odometry(index, 1.0, 0.0)).sum()
        };
        let way = |from, to| metres(&drive, to) - metres(&drive, from);
        assert!((sum(0..120) - metres(&drive, 119)).abs() < 1e-9);
        assert_eq!(sum(120..130), 0.0);
        assert!((sum(130..150) - way(129, 149)).abs() < 1e-9);
        assert!(sum(130..150) < -25.0, "backwards is negative");
        // The detour is as long as the stretch that it goes around.
        assert!((sum(150..216) - way(149, 215)).abs() < 1e-9);
        assert_eq!(sum(210..215), 0.0);
        // Around and back is forward for the wheels: there, and a frame on again.
        let around = way(305, 264) + 2.0 * drive.odometry(305, 1.0, 0.0);
        assert!((sum(265..306) - around).abs() < 1e-9);
        assert!(sum(265..305) > 150.0);
    }
}

#[test]
fn wheels_err_by_their_scale_and_noise_and_always_the_same() {
    let stands = driven(9000, Conditions::reference(), &[Leg::Drive(9000, 1.0), Leg::Stop(50)]);
    assert_eq!(stands.odometry(7, 1.02, 0.0), 3.0 * 1.02);
    let errors: Vec<f64> =
        (1..9000).map(|index| stands.odometry(index, 1.0, 0.05) / 3.0 - 1.0).collect();
    let mean = errors.iter().sum::<f64>() / 8999.0;
    let spread = (errors.iter().map(|x| x * x).sum::<f64>() / 8999.0).sqrt();
    assert!(mean.abs() < 0.002 && (spread - 0.05).abs() < 0.002, "{mean} {spread}");
    assert!((9000..9050).all(|index| stands.odometry(index, 1.02, 0.05) == 0.0));
    let again = driven(9000, Conditions::reference(), &[Leg::Drive(9000, 1.0)]);
    assert_eq!(stands.odometry(5000, 1.0, 0.05), again.odometry(5000, 1.0, 0.05));
    let other = drive(9000, Conditions { seed: 2, ..Conditions::reference() });
    assert_ne!(stands.odometry(50, 1.0, 0.05), other.odometry(50, 1.0, 0.05));
}

#[test]
fn each_leg_off_the_map_has_a_street_of_its_own() {
    let detour = Leg::Detour(10, 1.0);
    let legs = [Leg::Drive(50, 1.0), detour, Leg::Reverse(10, 1.0), detour];
    let drive = driven(100, Conditions::reference(), &legs);
    let frames = [59, 79].map(|index| drive.frame(index));
    assert!(difference(&frames[0], &frames[1]) > 5.0);
}

#[test]
fn a_bad_leg_is_named() {
    let refused = |legs: &[Leg]| {
        route(50, 1).drive(Conditions::reference(), legs).map(drop).unwrap_err().to_string()
    };
    let on = Leg::Drive(10, 1.0);
    for (legs, said) in [
        (vec![], "option `legs`: expected 1 leg or more, got none"),
        (
            vec![on, Leg::Stop(0)],
            "expected 1 frame or more a leg, and a sum that can be counted, got leg 1: Stop(0)",
        ),
        (vec![on, Leg::Stop(usize::MAX)], "leg 1: Stop("),
        (
            vec![Leg::Drive(10, 0.0)],
            "expected a speed above 0, in places a frame, got leg 0: Drive(10, 0.0)",
        ),
        (vec![on, Leg::Loop(3, f64::NAN)], "got leg 1: Loop(3, NaN)"),
        (vec![on, Leg::Detour(3, f64::INFINITY)], "got leg 1: Detour(3, inf)"),
        (vec![on, Leg::Reverse(3, -1.0)], "got leg 1: Reverse(3, -1.0)"),
        (
            vec![on, Leg::Reverse(10, 1.0)],
            "expected legs that end at the places 0 to 49, got leg 1: Reverse(10, 1.0), which ends at -1",
        ),
        (vec![on, Leg::Loop(10, 1.0)], "which ends at -1"),
        (vec![on, Leg::Detour(41, 1.0)], "got leg 1: Detour(41, 1.0), which ends at 50"),
    ] {
        assert!(refused(&legs).contains(said), "{}", refused(&legs));
    }
    // To both ends exactly, in tenths, too.
    let whole = [Leg::Drive(491, 0.1), Leg::Reverse(490, 0.1), Leg::Detour(49, 1.0)];
    assert_eq!(driven(50, Conditions::reference(), &whole).len(), 1030);
}
