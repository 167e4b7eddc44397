//! The promises that the demo, the tests and the scale runs rely on.

use surefix::Image;

use super::*;

mod legs;

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
