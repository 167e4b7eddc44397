//! The promises that the demo, the tests and the scale runs rely on.

use surefix::Image;

use super::*;

fn route(places: usize, seed: u64) -> Route {
    Route::new(RouteConfig { places, width: 64, height: 32, seed, ..RouteConfig::default() })
        .unwrap()
}

fn drive(places: usize, conditions: Conditions) -> Traverse {
    route(places, 1).traverse(conditions).unwrap()
}

/// The position of a frame on the route.
fn metres(drive: &Traverse, index: usize) -> f64 {
    drive.position(index).unwrap()
}

/// The mean difference of two frames in grey levels.
fn difference(a: &Image, b: &Image) -> f64 {
    let sum: u64 = a.pixels().iter().zip(b.pixels()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / a.pixels().len() as f64
}

#[test]
fn the_same_options_give_the_same_bits() {
    let (one, two) = (drive(1000, Conditions::revisit()), drive(1000, Conditions::revisit()));
    // In another order, too: a frame depends on nothing but its index.
    let later: Vec<Image> = [700, 3, 512].map(|index| one.frame(index)).into();
    let sooner: Vec<Image> = [512, 3, 700].map(|index| two.frame(index)).into();
    assert!(later.iter().eq(sooner.iter().rev()));
}

#[test]
fn every_machine_gives_the_same_bits() {
    // FNV-1a of a few frames: another number if the world is to look otherwise.
    let mut sum = 0xCBF2_9CE4_8422_2325_u64;
    for conditions in [Conditions::reference(), Conditions::revisit()] {
        let drive = drive(1000, conditions);
        for index in (0..1000).step_by(50) {
            for &byte in drive.frame(index).pixels() {
                sum = (sum ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3);
            }
        }
    }
    assert_eq!(sum, 0x432E_5ACA_D514_076E, "{sum:#018X}");
}

#[test]
fn conditions_of_zero_are_the_reference_drive() {
    let reference = drive(300, Conditions::reference());
    let other = drive(300, Conditions { seed: 99, ..Conditions::default() });
    for index in [0, 77, 299] {
        assert_eq!(reference.frame(index), other.frame(index));
        assert_eq!(reference.position(index), other.position(index));
    }
}

#[test]
fn each_condition_changes_the_frames_the_more_the_stronger() {
    let plain = Conditions { seed: 5, ..Conditions::reference() };
    let at = |x: f32| {
        [
            Conditions { light: x, ..plain },
            Conditions { season: x, ..plain },
            Conditions { lateral_offset: x, ..plain },
            Conditions { occluders: x, ..plain },
            Conditions { noise: x, ..plain },
        ]
    };
    let reference = drive(400, plain);
    let change = |conditions| {
        let drive = drive(400, conditions);
        let frames = (0..400).step_by(25);
        frames.map(|index| difference(&drive.frame(index), &reference.frame(index))).sum::<f64>()
    };
    for (weak, strong) in at(0.3).into_iter().zip(at(1.0)) {
        let (little, much) = (change(weak), change(strong));
        assert!(0.0 < little && little < much, "{strong:?}: {little} then {much}");
    }
    let uneven = drive(400, Conditions { speed_jitter: 1.0, ..plain });
    assert_ne!(uneven.frame(200), reference.frame(200));
}

#[test]
fn frames_change_smoothly() {
    for conditions in [Conditions::reference(), Conditions::revisit()] {
        let drive = drive(1000, conditions);
        let mut away = [0.0; 4];
        for index in (20..900).step_by(23) {
            let frame = drive.frame(index);
            for (sum, ahead) in away.iter_mut().zip([1, 3, 10, 90]) {
                *sum += difference(&frame, &drive.frame(index + ahead));
            }
        }
        assert!(away.is_sorted(), "{away:?}");
        assert!(away[0] < 0.6 * away[3], "{away:?}");
    }
}

#[test]
fn places_far_apart_can_look_alike() {
    // Some frames have a look-alike far away: nearer than the view from a few metres on. That is
    // aliasing.
    let drive = drive(800, Conditions::reference());
    let frames: Vec<Image> = (0..800).step_by(2).map(|index| drive.frame(index)).collect();
    let queries = (0..390).step_by(10);
    let alike = queries.clone().filter(|&index| {
        let ahead = difference(&frames[index], &frames[index + 3]);
        let mut far = (0..400_usize).filter(|other| other.abs_diff(index) > 20);
        far.any(|other| difference(&frames[index], &frames[other]) < ahead)
    });
    let alike = alike.count();
    assert!((4..35).contains(&alike), "{alike} of {}", queries.count());
}

#[test]
fn positions_go_forward_at_a_bounded_speed_and_never_drift() {
    let spacing = RouteConfig::default().spacing;
    for (seed, jitter) in [(1, 1.0), (2, 1.0), (3, 0.4)] {
        let drive =
            drive(1_000_000, Conditions { speed_jitter: jitter, seed, ..Conditions::reference() });
        let mut speeds = (f64::MAX, f64::MIN);
        for index in (0..3000).chain(500_000..503_000).chain(997_000..999_999) {
            let speed = (metres(&drive, index + 1) - metres(&drive, index)) / spacing;
            speeds = (speeds.0.min(speed), speeds.1.max(speed));
            let lead = metres(&drive, index) / spacing - index as f64;
            assert!(lead.abs() < 3.0, "{lead} frames ahead at {index}");
        }
        let jitter = f64::from(jitter);
        assert!(speeds.0 > 1.0 - 0.45 * jitter && speeds.0 < 1.0 - 0.15 * jitter, "{speeds:?}");
        assert!(speeds.1 < 1.0 + 0.45 * jitter && speeds.1 > 1.0 + 0.15 * jitter, "{speeds:?}");
        assert_eq!(drive.position(0), Some(0.0));
        assert_eq!(drive.position(999_999), Some(999_999.0 * spacing));
    }
}

#[test]
fn truth_is_the_nearest_reference_frame() {
    let reference = drive(600, Conditions::reference());
    let uneven = drive(600, Conditions { speed_jitter: 1.0, seed: 3, ..Conditions::reference() });
    for (query, map) in [(&uneven, &reference), (&reference, &uneven), (&reference, &reference)] {
        let truth = query.truth(map);
        assert!(truth.is_sorted());
        for (index, place) in truth.into_iter().enumerate() {
            let away = |place: usize| (metres(map, place) - metres(query, index)).abs();
            let nearest = (0..map.len()).min_by(|&a, &b| away(a).total_cmp(&away(b)));
            assert_eq!(place, nearest);
        }
    }
    assert!(reference.truth(&reference).iter().enumerate().all(|(i, &place)| place == Some(i)));
}

#[test]
fn what_the_map_does_not_hold_has_no_truth() {
    let long = drive(300, Conditions::reference());
    let short = drive(200, Conditions::reference());
    let truth = long.truth(&short);
    assert_eq!(truth[199], Some(199));
    assert!(truth[201..].iter().all(Option::is_none));
    assert_eq!(long.frame(150), short.frame(150), "the same world, however long the route");
    let elsewhere = route(300, 2).traverse(Conditions::reference()).unwrap();
    assert!(long.truth(&elsewhere).iter().all(Option::is_none));
}

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

#[test]
fn any_size_and_any_index_can_be_rendered() {
    for (width, height) in [(8, 8), (8, 8192), (8192, 8), (31, 47), (640, 480)] {
        let config = RouteConfig { places: 50, width, height, ..RouteConfig::default() };
        let drive = Route::new(config).unwrap().traverse(Conditions::revisit()).unwrap();
        let last = drive.frame(49);
        assert_eq!((last.width(), last.height()), (width, height));
        assert_eq!(last, drive.frame(usize::MAX));
        assert_eq!(drive.position(49), drive.position(usize::MAX));
    }
}

#[test]
fn a_short_buffer_gets_the_rows_that_fit() {
    let drive = drive(50, Conditions::revisit());
    let whole = drive.frame(7);
    let row = 3 * whole.width();
    for bytes in [0, 1, row - 1, row, 20 * row + 5, whole.pixels().len() + 9] {
        let mut buffer = vec![77; bytes];
        drive.render(7, &mut buffer);
        let full = (bytes / row).min(whole.height()) * row;
        // The buffer's old pixels must not shine through.
        assert!(buffer[..full] == whole.pixels()[..full], "{bytes} bytes");
        assert!(buffer[full..].iter().all(|&byte| byte == 77));
    }
}

#[test]
fn a_bad_option_is_named() {
    let named = |result: Result<(), Error>| match result {
        Err(Error::Option { name, .. }) => name,
        other => panic!("{other:?}"),
    };
    let good = RouteConfig::default;
    let configs = [
        ("places", RouteConfig { places: 1, ..good() }),
        ("width", RouteConfig { width: 7, ..good() }),
        ("height", RouteConfig { height: 8193, ..good() }),
        ("spacing", RouteConfig { spacing: 0.0, ..good() }),
        ("spacing", RouteConfig { spacing: f64::NAN, ..good() }),
        ("spacing", RouteConfig { spacing: f64::INFINITY, ..good() }),
    ];
    for (name, config) in configs {
        assert_eq!(named(Route::new(config).map(drop)), name);
    }
    let usual = Conditions::revisit();
    let conditions = [
        ("light", Conditions { light: 1.5, ..usual }),
        ("season", Conditions { season: f32::NAN, ..usual }),
        ("lateral_offset", Conditions { lateral_offset: -3.1, ..usual }),
        ("speed_jitter", Conditions { speed_jitter: f32::INFINITY, ..usual }),
        ("occluders", Conditions { occluders: -0.1, ..usual }),
        ("noise", Conditions { noise: 2.0, ..usual }),
    ];
    for (name, conditions) in conditions {
        assert_eq!(named(route(10, 1).traverse(conditions).map(drop)), name);
    }
}

#[test]
fn a_traverse_can_be_shared_between_threads() {
    fn shared<T: Send + Sync + Clone + std::fmt::Debug>(_: &T) {}
    shared(&drive(10, Conditions::revisit()));
    shared(&route(10, 1));
}
