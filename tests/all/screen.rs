//! A map with a screen: the same fixes as without, to the last bit, whatever the descriptors are.

use std::sync::Arc;

use crate::cases::{bits, cases, config};
use crate::random::SplitMix64;
use proptest::prelude::*;
use proptest::sample::select;
use surefix::{Config, Dtype, Error, Isa, Localizer, Map, Metric, Sad, Values};

/// Rows of fewer numbers are never screened.
const DIM: usize = 256;

/// What the descriptors of a route are like.
#[derive(Clone, Copy, Debug)]
enum Route {
    /// Neighbours alike, and the second drive like the first: what the screen is for.
    Street,
    /// The same few places again and again, with next to no difference.
    Aliased,
    /// Nothing is like anything else.
    Noise,
    /// Numbers of few values: distances tie, and some dimensions never change.
    Whole,
    /// Rows of very different lengths, dimensions of very different scales.
    Scales,
    /// None below 0, as after a rectifier, and most of them 0.
    Sparse,
    /// From 1e-38 to 1e38: distances overflow sums.
    Wild,
    /// Far from 0 and close together.
    Offset,
}

const ROUTES: [Route; 8] = [
    Route::Street,
    Route::Aliased,
    Route::Noise,
    Route::Whole,
    Route::Scales,
    Route::Sparse,
    Route::Wild,
    Route::Offset,
];

impl Route {
    fn number(self, dice: &mut SplitMix64, row: usize, at: usize) -> f32 {
        let centred = dice.share() + dice.share() - 1.0;
        match self {
            Self::Street | Self::Noise => centred,
            Self::Aliased => {
                SplitMix64((row % 3 * 1000 + at) as u64).share() - 0.5 + 1e-6 * centred
            }
            Self::Whole if at.is_multiple_of(7) => 1.0,
            Self::Whole => dice.below(3) as f32 - 1.0,
            Self::Scales => {
                centred * 10_f32.powi(row as i32 % 5 - 2) * 10_f32.powi(at as i32 % 9 - 4)
            }
            Self::Sparse => (centred - 0.3).max(0.0) + f32::from(at == 0),
            Self::Wild => centred * 10_f32.powi(dice.below(76) as i32 - 38),
            Self::Offset => 1000.0 + centred,
        }
    }

    fn rows(self, dice: &mut SplitMix64, places: usize, dim: usize) -> Vec<f32> {
        let mut rows: Vec<f32> =
            (0..places * dim).map(|i| self.number(dice, i / dim, i % dim)).collect();
        if matches!(self, Self::Street) {
            for i in dim..rows.len() {
                rows[i] += 0.7 * rows[i - dim];
            }
        }
        rows
    }

    /// A query near some row, or one of its own.
    fn query(self, dice: &mut SplitMix64, rows: &[f32], dim: usize, place: usize) -> Vec<f32> {
        let row = &rows[place * dim..(place + 1) * dim];
        match dice.below(8) {
            0 => (0..dim).map(|at| self.number(dice, place, at)).collect(),
            1 => row.to_vec(),
            _ => row.iter().map(|x| x + 0.5 * x * (dice.share() - 0.5)).collect(),
        }
    }
}

fn metric() -> impl Strategy<Value = Metric> {
    select(vec![Metric::Euclidean, Metric::Cosine])
}

fn map(rows: &[f32], dim: usize, metric: Metric) -> Option<Map> {
    match Map::from_descriptors(rows.to_vec(), dim, metric) {
        Err(Error::NoDirection { .. }) => None,
        refused => Some(refused.unwrap()),
    }
}

proptest! {
    #![proptest_config(cases(3000))]

    #[test]
    fn the_answers_are_those_of_the_rows(
        route in select(ROUTES.to_vec()), metric in metric(),
        (places, config) in (2..70_usize).prop_flat_map(|places| (Just(places), config(places))),
        more in prop_oneof![2 => Just(0), 1 => 1..70_usize], threads in 1..3_usize, isa: prop::sample::Index, seed: u64,
    ) {
        let (dim, mut dice) = (DIM + more, SplitMix64(seed));
        let rows = route.rows(&mut dice, places, dim);
        let Some(plain) = map(&rows, dim, metric) else { return Ok(()) };
        let isa = *isa.get(&Isa::available().collect::<Vec<_>>());
        let screened = Arc::new(plain.clone().with_screen(Dtype::I8).unwrap().with_isa(isa).unwrap());
        let mut plain = Localizer::new(Arc::new(plain), config.clone()).unwrap();
        let new = |map: &Arc<Map>| Localizer::new(Arc::clone(map), config.clone()).unwrap();
        let mut localizer = new(&screened).with_threads(Some(threads)).unwrap();
        for query in 0..2 * config.sequence_length + 8 {
            let descriptor = route.query(&mut dice, &rows, dim, query % places);
            match (plain.push_descriptor(&descriptor), localizer.push_descriptor(&descriptor)) {
                (Ok(expected), Ok(got)) => {
                    prop_assert_eq!(bits(&got), bits(&expected), "query {}", query);
                }
                (expected, got) => {
                    // A distance that is too large for a float32, and is refused; or zeros that
                    // have no direction.
                    prop_assert_eq!(format!("{:?}", got), format!("{:?}", expected), "query {}", query);
                }
            }
            prop_assert_eq!(localizer.frames(), plain.frames());
            match dice.below(12) {
                0 => prop_assert_eq!(localizer.distances(), plain.distances()),
                1 => prop_assert_eq!(localizer.snapshot().unwrap(), plain.snapshot().unwrap()),
                2 => {
                    let blob = plain.snapshot().unwrap();
                    localizer = Localizer::restore(Arc::clone(&screened), &blob, Some(&config)).unwrap();
                    prop_assert_eq!(localizer.looked_at(), plain.looked_at());
                    prop_assert_eq!(localizer.distances(), plain.distances());
                }
                3 if query == config.sequence_length => {
                    localizer.reset();
                    plain.reset();
                    prop_assert_eq!(localizer.distances(), plain.distances());
                    prop_assert_eq!(localizer.looked_at(), 0);
                }
                4 => localizer = localizer.clone(),
                5 if dice.below(config.sequence_length) == 0 => {
                    plain.gap();
                    localizer.gap();
                    prop_assert_eq!(localizer.distances(), plain.distances());
                }
                _ => {}
            }
        }
    }
}

/// A route of places that differ, and a second drive along it.
fn street(places: usize, dim: usize) -> (Vec<f32>, Vec<Vec<f32>>) {
    let mut dice = SplitMix64(5);
    let rows = Route::Street.rows(&mut dice, places, dim);
    let drive = (0..60).map(|query| {
        let row = &rows[(query + 40) * dim..(query + 41) * dim];
        row.iter().map(|x| x + 0.8 * (dice.share() - 0.5)).collect()
    });
    let drive = drive.collect();
    (rows, drive)
}

#[test]
fn on_a_route_few_rows_are_looked_at_and_among_look_alikes_all() {
    const PLACES: usize = 2000;
    let (rows, drive) = street(PLACES, DIM);
    for metric in [Metric::Euclidean, Metric::Cosine] {
        let plain = map(&rows, DIM, metric).unwrap();
        let screened = Arc::new(plain.clone().with_screen(Dtype::I8).unwrap());
        let config = config! { sequence_length: 3 };
        let mut localizer = Localizer::new(screened, config.clone()).unwrap();
        assert_eq!(localizer.looked_at(), 0);
        let mut plain = Localizer::new(Arc::new(plain), config).unwrap();
        for (query, descriptor) in drive.iter().enumerate() {
            let (got, expected) = (
                localizer.push_descriptor(descriptor).unwrap(),
                plain.push_descriptor(descriptor).unwrap(),
            );
            assert_eq!(bits(&got), bits(&expected));
            assert_eq!(got.single.place, 40 + query, "the drive is recognized");
            assert!(
                localizer.looked_at() < PLACES / 20,
                "{metric}: {} rows",
                localizer.looked_at()
            );
            assert_eq!(plain.looked_at(), PLACES);
        }
    }

    let mut dice = SplitMix64(6);
    let aliased = Arc::new(
        map(&Route::Aliased.rows(&mut dice, 500, DIM), DIM, Metric::Cosine)
            .unwrap()
            .with_screen(Dtype::I8)
            .unwrap(),
    );
    let mut localizer = Localizer::new(aliased, Config::default()).unwrap();
    for frame in 0..200 {
        let query: Vec<f32> =
            (0..DIM).map(|at| Route::Aliased.number(&mut dice, frame, at)).collect();
        localizer.push_descriptor(&query).unwrap();
        assert!(localizer.looked_at() >= 250, "it does not pay");
    }
}

#[test]
fn short_rows_are_scanned_as_they_are() {
    let (rows, drive) = street(200, DIM - 1);
    let plain = map(&rows, DIM - 1, Metric::Cosine).unwrap();
    let screened = Arc::new(plain.with_screen(Dtype::I8).unwrap());
    let mut localizer = Localizer::new(screened, Config::default()).unwrap();
    localizer.push_descriptor(&drive[0]).unwrap();
    assert_eq!(localizer.looked_at(), 200);
}

#[test]
fn a_frame_that_is_refused_leaves_it_as_it_was() {
    let (rows, drive) = street(100, DIM);
    let screened =
        Arc::new(map(&rows, DIM, Metric::Cosine).unwrap().with_screen(Dtype::I8).unwrap());
    let mut localizer = Localizer::new(Arc::clone(&screened), Config::default()).unwrap();
    let mut spared = localizer.clone();
    let mut spoilt = drive[0].clone();
    spoilt[DIM - 1] = f32::NAN;
    for descriptor in &drive {
        assert!(matches!(localizer.push_descriptor(&spoilt), Err(Error::NotFinite { .. })));
        assert!(matches!(localizer.push_descriptor(&spoilt[1..]), Err(Error::Length { .. })));
        assert!(matches!(localizer.push_descriptor(&vec![1_u8; DIM]), Err(Error::Dtype { .. })));
        let (got, expected) = (
            localizer.push_descriptor(descriptor).unwrap(),
            spared.push_descriptor(descriptor).unwrap(),
        );
        assert_eq!(bits(&got), bits(&expected));
        assert_eq!(localizer.looked_at(), spared.looked_at());
    }
    assert_eq!(localizer.snapshot().unwrap(), spared.snapshot().unwrap());

    // Too far for a float32: only the rows can tell.
    let rows: Vec<f32> = (0..3 * DIM).map(|i| if i < DIM { f32::MAX } else { i as f32 }).collect();
    let far = Arc::new(map(&rows, DIM, Metric::Euclidean).unwrap().with_screen(Dtype::I8).unwrap());
    let mut localizer = Localizer::new(far, Config::default()).unwrap();
    let refused = localizer.push_descriptor(&rows[DIM..2 * DIM]).unwrap_err();
    assert!(
        matches!(refused, Error::NotFinite { what: "distances", row: None, index: 0, .. }),
        "{refused}"
    );
    assert_eq!((localizer.frames(), localizer.distances()), (0, [0.0; 3].as_slice()));
}

#[test]
fn a_map_keeps_its_screen_and_its_file_knows_nothing_of_it() {
    let (rows, _) = street(100, 20);
    let plain = map(&rows[..50 * 20], 20, Metric::Cosine).unwrap();
    assert_eq!(plain.screen(), None);
    let screened = plain.clone().with_screen(Dtype::I8).unwrap();
    assert_eq!(screened.screen(), Some(Dtype::I8));
    assert_eq!(
        screened.clone().with_names(vec!["x".to_owned(); 50]).unwrap().screen(),
        Some(Dtype::I8)
    );
    assert_eq!(screened.extended(&plain).unwrap().screen(), Some(Dtype::I8));
    assert_eq!(plain.extended(&screened).unwrap().screen(), None);
    let folder = tempfile::tempdir().unwrap();
    let (one, other) = (folder.path().join("plain"), folder.path().join("screened"));
    plain.save(&one).unwrap();
    screened.save(&other).unwrap();
    assert_eq!(std::fs::read(&one).unwrap(), std::fs::read(&other).unwrap());
    assert_eq!(Map::open(&other).unwrap().screen(), None);
}

#[test]
fn maps_that_cannot_have_a_screen_say_why() {
    let of = |rows: Values, metric| Map::from_descriptors(rows, 4, metric).unwrap();
    let floats = || Values::F32((1..=8_u8).map(f32::from).collect());
    let refused = |map: Map, dtype| map.with_screen(dtype).unwrap_err().to_string();
    for dtype in [Dtype::F16, Dtype::U8, Dtype::F32] {
        let error = refused(of(floats(), Metric::Cosine), dtype);
        assert!(
            error.contains("screen") && error.contains("i8") && error.contains(&dtype.to_string()),
            "{error}"
        );
    }
    let error = refused(of(floats(), Metric::Manhattan), Dtype::I8);
    assert!(error.contains("euclidean") && error.contains("manhattan"), "{error}");
    let error = refused(of(Values::U8(vec![1; 8]), Metric::Cosine), Dtype::I8);
    assert!(error.contains("float32") && error.contains("uint8"), "{error}");
    let images: Vec<_> = (0..2)
        .map(|i| surefix::Image::new(16, 8, surefix::Channels::Grey, vec![i; 128]).unwrap())
        .collect();
    let sad = Sad::new((16, 8), 4, Dtype::F32).unwrap();
    let sad =
        Map::from_images(&images, sad, &mut |_, _| std::ops::ControlFlow::Continue(())).unwrap();
    assert!(refused(sad, Dtype::I8).contains("manhattan"));
}
