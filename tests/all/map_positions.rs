//! Positions on planes that are known: degrees, and maps around different origins.

use std::sync::Arc;

use crate::cases::{cases, numbers};
use proptest::prelude::*;
use surefix::{Config, Dtype, Error, Given, Input, Localizer, Map, Metric, Origin, Positions};

fn apart(one: f64, other: f64) -> f64 {
    let turned = (one - other + 180.0).rem_euclid(360.0) - 180.0;
    turned.abs()
}

proptest! {
    #![proptest_config(cases(500))]

    #[test]
    fn degrees_come_back(
        latitude in -80.0..80.0_f64,
        longitude in -540.0..540.0_f64,
        north in -1.0..1.0_f64,
        east in -1.0..1.0_f64,
    ) {
        let origin = Origin::new(latitude, longitude).unwrap();
        let (lat, lon) = (latitude + north, longitude + east);
        let [x, y] = origin.metres(lat, lon);
        let [back_lat, back_lon] = origin.degrees(x, y);
        prop_assert!((back_lat - lat).abs() < 1e-11 && apart(back_lon, lon) < 1e-11);
        prop_assert!((-180.0..180.0).contains(&back_lon));
    }

    /// Ten metres away, the plane is as far as the straight line between points of the ellipsoid.
    #[test]
    fn metres_are_those_of_the_ellipsoid(
        latitude in -80.0..80.0_f64, longitude in -180.0..180.0_f64, step in 1e-5..1e-4_f64,
    ) {
        let point = |latitude: f64, longitude: f64| {
            let (major, flattening) = (6_378_137.0, 1.0 / 298.257_223_563_f64);
            let ratio = (1.0 - flattening).powi(2);
            let ((sine, cosine), turn) = (latitude.to_radians().sin_cos(), longitude.to_radians());
            let normal = major / (cosine * cosine + ratio * sine * sine).sqrt();
            [normal * cosine * turn.cos(), normal * cosine * turn.sin(), ratio * normal * sine]
        };
        let here = point(latitude, longitude);
        let origin = Origin::new(latitude, longitude).unwrap();
        for (by, axis) in [([0.0, step], 0), ([step, 0.0], 1)] {
            let there = point(latitude + by[0], longitude + by[1]);
            let away: f64 = here.iter().zip(there).map(|(a, b)| (a - b).powi(2)).sum();
            let metres = origin.metres(latitude + by[0], longitude + by[1]);
            prop_assert!((metres[axis] / away.sqrt() - 1.0).abs() < 1e-6, "{metres:?}: {away}");
            prop_assert_eq!(metres[1 - axis], 0.0);
        }
    }
}

fn map(first: usize, places: usize, positions: Positions) -> Map {
    let rows = numbers(Dtype::F32, places * 4, first as u64 + 1);
    Map::from_descriptors(rows, 4, Metric::Manhattan).unwrap().with_positions(positions).unwrap()
}

#[test]
fn maps_around_other_origins_are_moved_to_the_first_plane() {
    let origins = [Origin::new(10.0, 179.99).unwrap(), Origin::new(10.01, -179.99).unwrap()];
    let degrees = [[10.002, 179.995], [10.003, -179.998], [10.004, -179.995]];
    let on = |origin: Origin| {
        let metres = degrees.iter().flat_map(|&[lat, lon]| {
            let [x, y] = origin.metres(lat, lon);
            [x, y, 7.5]
        });
        Positions::new(metres.collect(), 3).unwrap().with_origin(origin).unwrap()
    };
    let [one, other] = origins.map(on);
    let joined = Map::join(&[&map(0, 3, one.clone()), &map(3, 3, other)]).unwrap();
    let positions = joined.positions().unwrap();
    assert_eq!(positions.origin(), Some(origins[0]));
    assert_eq!(positions.metres()[..9], *one.metres(), "those of the first stay to the bit");
    for place in 0..6 {
        let [lat, lon] = positions.degrees(place).unwrap();
        let [known, turned] = degrees[place % 3];
        assert!((lat - known).abs() < 1e-11 && apart(lon, turned) < 1e-11);
        assert_eq!(positions.at(place).unwrap().metres()[2], 7.5);
    }
    let again = Map::from_bytes(&joined.to_bytes().unwrap()).unwrap();
    assert_eq!(again.positions(), joined.positions());
}

#[test]
fn planes_that_cannot_be_are_refused() {
    for (latitude, longitude) in [(90.0, 0.0), (-91.0, 0.0), (f64::NAN, 0.0), (0.0, 541.0)] {
        let error = Origin::new(latitude, longitude).unwrap_err();
        assert!(matches!(error, Error::Option { name: "origin", .. }), "{error}");
    }
    let far = Positions::new(vec![0.0, 0.0, 0.0, 2e7], 2).unwrap();
    let error = far.clone().with_origin(Origin::new(0.0, 0.0).unwrap()).unwrap_err().to_string();
    assert!(error.contains("at place 1"), "{error}");
    // Half of the globe to the east, and a quarter of it to the pole.
    for (east, north, fits) in
        [(2.0e7, 0.0, true), (2.1e7, 0.0, false), (0.0, -9.9e6, true), (0.0, -1.1e7, false)]
    {
        let origin = Origin::new(0.0, 0.0).unwrap();
        let positions = Positions::new(vec![east, north], 2).unwrap().with_origin(origin);
        assert_eq!(positions.is_ok(), fits, "{east}, {north}");
    }
    for name in ["", &"x".repeat(201)] {
        assert!(matches!(far.clone().with_plane(name), Err(Error::Option { name: "plane", .. })));
    }
    let named = far.with_plane("UTM 55S").unwrap();
    let map = map(0, 2, named.clone());
    let again = Map::from_bytes(&map.to_bytes().unwrap()).unwrap();
    assert_eq!(again.positions(), Some(&named));
    assert_eq!((named.plane(), named.origin(), named.degrees(1)), (Some("UTM 55S"), None, None));
    assert!(named.with_plane(&"x".repeat(200)).is_ok());
    let origin = Origin::new(51.5, -0.1).unwrap();
    assert_eq!((origin.latitude(), origin.longitude()), (51.5, -0.1));
}

#[test]
fn a_fix_has_the_position_of_its_place() {
    let metres = vec![0.0, 0.0, 0.0, 50.0, 0.0, 100.0];
    let origin = Origin::new(51.5, -0.1).unwrap();
    let positions = Positions::new(metres, 2).unwrap().with_origin(origin).unwrap();
    let known = map(0, 3, positions);
    let bare = Map::from_descriptors(
        known.descriptors().row(0, 12).map(|_| numbers(Dtype::F32, 12, 1)).unwrap(),
        4,
        Metric::Manhattan,
    )
    .unwrap();
    let mut localizer = Localizer::new(Arc::new(known.clone()), Config::default()).unwrap();
    let row = |place| known.descriptors().row(place, 4).unwrap();
    let fix = localizer.push_descriptor(row(2)).unwrap();
    let position = localizer.position(&fix).unwrap();
    assert_eq!((fix.place, position.metres()), (2, &[0.0, 100.0][..]));
    assert!((position.degrees().unwrap()[0] - 51.500_899).abs() < 1e-6);
    let mut plain = Localizer::new(Arc::new(bare.clone()), Config::default()).unwrap();
    let fix = plain.push_descriptor(row(1)).unwrap();
    assert_eq!(plain.position(&fix), None);
    // Of several maps, the first that has positions.
    let maps = vec![Arc::new(bare), Arc::new(known.clone())];
    let mut fused = Localizer::fused(maps, Config::default()).unwrap();
    let fix =
        fused.push_inputs(&[row(1), row(1)].map(Input::Descriptor), Given::default()).unwrap();
    assert_eq!(fused.position(&fix).unwrap().metres(), [0.0, 50.0 * fix.place as f64]);
}

#[test]
fn positions_are_numbers_on_the_globe() {
    let far_north = Origin::new(80.0, 10.0).unwrap();
    // A degree is 112 km here.
    for (north, on_it) in
        [(1.1e6, true), (1.15e6, false), (-1.15e6, true), (-1.85e7, true), (-1.95e7, false)]
    {
        let positions = Positions::new(vec![0.0, 0.0, 5.0, north], 2).unwrap();
        assert_eq!(positions.with_origin(far_north).is_ok(), on_it, "{north}");
    }
    for (axes, at, row, index) in [(2, 3, 1, 1), (2, 6, 3, 0), (3, 8, 2, 2), (3, 9, 3, 0)] {
        let mut metres = vec![1.0; 12];
        metres[at] = f64::NAN;
        let refused = Positions::new(metres, axes);
        assert!(
            matches!(refused, Err(Error::NotFinite { row: Some(r), index: i, .. }) if (r, i) == (row, index)),
            "{at} of {axes}"
        );
    }
    let none = Positions::new(Vec::new(), 2).unwrap();
    assert!(none.is_empty() && !Positions::new(vec![0.0; 4], 2).unwrap().is_empty());
}
