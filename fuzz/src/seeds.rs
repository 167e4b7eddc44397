//! The seeds: small valid inputs, made by the library itself. Those of structured targets are random
//! bytes, which mean something whatever they are.

use std::fs;
use std::io;
use std::path::Path;
use std::sync::Arc;

use surefix::calibration::{Calibrate, calibrate};
use surefix::evaluate::Match;
use surefix::{
    Channels, Config, Drive, Dtype, Extras, Given, Image, Input, Localizer, Map, MapMark, Matcher,
    Metric, Motion, Positions, Post, Running, Sad, Segments, Settings, Step, Values, View,
    align_distances, match_distances, quiet,
};

use crate::snapshot::{DIM, PLACES, maps, numbers};

/// Writes them into folders of the targets' names.
///
/// # Errors
/// Those of the file system.
pub fn write(folder: &Path) -> io::Result<()> {
    let sets = [
        ("map", map_seeds()),
        ("snapshot", snapshots()),
        ("image", images()),
        ("settings", settings()),
        ("matcher", random(6)),
        ("screen", random(6)),
    ];
    for (target, seeds) in sets {
        let folder = folder.join(target);
        fs::create_dir_all(&folder)?;
        for (name, bytes) in seeds {
            fs::write(folder.join(name), bytes)?;
        }
    }
    Ok(())
}

type Seeds = Vec<(String, Vec<u8>)>;

fn random(count: u64) -> Seeds {
    let of = |seed: u64| {
        let mut state = seed;
        let mut byte = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1 + seed);
            (state >> 56) as u8
        };
        (format!("random-{seed}"), (0..64 << seed.min(4)).map(|_| byte()).collect())
    };
    (0..count).map(of).collect()
}

fn named(seeds: Vec<(&str, Vec<u8>)>) -> Seeds {
    seeds.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect()
}

fn config(motion: Option<Motion>) -> Config {
    let mut config = Config::default();
    config.sequence_length = 3;
    config.motion = motion;
    config
}

fn rows(places: usize) -> Vec<f32> {
    (0..places).flat_map(numbers).collect()
}

fn map_seeds() -> Seeds {
    let small =
        |rows: Vec<f32>| Map::from_descriptors(rows, DIM, Metric::Euclidean).expect("a small map");
    let map = small(rows(6));
    let whole = map.clone().with_names((0..6).map(|at| format!("{at}.png")).collect());
    let metres = (0..12).map(f64::from).collect();
    let positions = Positions::new(metres, 2).and_then(|metres| metres.with_plane("map"));
    let route = Segments::new(6, &[3]).and_then(|route| route.with_closed(&[1]));
    let route = route.and_then(|route| route.with_links(&[(2, 4)])).expect("a small route");
    let whole = whole.and_then(|map| map.with_positions(positions?)).expect("six of each");
    let whole = whole.with_segments(route).expect("six places");
    let more = small(rows(3));
    let places = [Some(1), Some(2), Some(4)];
    let both = map.add_traverse(&more, &places, "winter").expect("three places");
    let bytes = Values::U8((0..24).collect());
    let bytes = Map::from_descriptors(bytes, DIM, Metric::Manhattan).expect("a small map");
    let levels = Values::I8((-12..12).collect());
    let levels = Map::from_descriptors(levels, DIM, Metric::Cosine).expect("a small map");
    let steps = [Step::Standardize, Step::Normalize];
    let maps = [
        ("plain", map),
        ("whole", whole),
        ("traverses", both),
        ("bytes", bytes),
        ("levels", levels),
        ("standardized", posted(&steps)),
        ("running", posted(&[Step::StandardizeRunning])),
        ("projected", posted(&[Step::Projection { dim: 2, seed: 1 }])),
        ("pca", posted(&[Step::Pca { dim: 2, whiten: true }])),
        ("sad", of_images()),
    ];
    named(maps.iter().map(|(name, map)| (*name, map.to_bytes().expect("a map"))).collect())
}

fn posted(steps: &[Step]) -> Map {
    let (post, rows) = Post::fit(steps, &rows(6), DIM).expect("a few rows");
    let map = Map::from_descriptors(rows, post.output(), Metric::Euclidean).expect("a small map");
    map.with_post(post).expect("float32 rows")
}

fn of_images() -> Map {
    let sad = Sad::new((16, 8), 8, Dtype::U8).expect("a small recipe");
    let of = |seed: usize| {
        let pixels = (0..16 * 8).map(|at| (at * (seed + 3) * 37 % 251) as u8).collect();
        Image::new(16, 8, Channels::Grey, pixels).expect("a small image")
    };
    let images: Vec<Image> = (0..3).map(of).collect();
    let extras = Extras::default().thumbnails();
    Map::from_images_with(images.as_slice(), sad, extras, &mut quiet).expect("three images")
}

fn snapshots() -> Seeds {
    let with = |kind: u8, bytes: Vec<u8>| [vec![kind], bytes].concat();
    let mut seeds = Vec::new();
    let motions = [("", None), ("-tracked", Some(Motion::any())), ("-free", Some(Motion::free()))];
    for (name, motion) in motions {
        let route = maps()[1].segments().clone();
        let mut matcher = Matcher::along(route, config(motion.clone())).expect("options");
        for query in 0..4 {
            let column: Vec<f32> = (0..PLACES).map(|at| numbers(at + query)[0]).collect();
            matcher.push(&column).expect("a column");
        }
        let bytes = matcher.snapshot().expect("a small state");
        seeds.push((format!("matcher{name}"), with(0, bytes)));
        let sets: [(u8, Vec<Arc<Map>>); 4] = [
            (2, vec![Arc::clone(&maps()[0])]),
            (3, vec![Arc::clone(&maps()[1])]),
            (4, vec![Arc::clone(&maps()[2])]),
            (5, vec![Arc::clone(&maps()[0]), Arc::clone(&maps()[2])]),
        ];
        for (kind, maps) in sets {
            let count = maps.len();
            let localizer = Localizer::fused(maps, config(motion.clone()));
            let mut localizer = localizer.expect("options");
            for query in 0..4 {
                let numbers = numbers(query);
                let inputs = vec![Input::Descriptor(View::F32(&numbers)); count];
                localizer.push_inputs(&inputs, Given::default()).expect("a query");
            }
            let bytes = localizer.snapshot().expect("a small state");
            seeds.push((format!("localizer-{kind}{name}"), with(kind, bytes)));
        }
    }
    let mut running = Running::new(DIM);
    running.push(&numbers(1), &mut [0.0; DIM]).expect("a vector");
    seeds.push(("running".to_owned(), with(1, running.snapshot().expect("a small state"))));
    seeds
}

/// Images of a few pixels, one of each format.
fn images() -> Seeds {
    named(vec![
        ("grey.pgm", b"P5 4 2 255\n\x00\x20\x40\x60\x80\xa0\xc0\xe0".to_vec()),
        ("colour.ppm", b"P6 2 1 255\n\x00\x20\x40\x60\x80\xa0".to_vec()),
        ("deep.pgm", b"P5 2 1 65535\n\x00\x20\x40\x60".to_vec()),
        ("text.pbm", b"P1 4 1\n0 1 0 1\n".to_vec()),
        ("grey.png", include_bytes!("images/grey.png").to_vec()),
        ("deep.png", include_bytes!("images/deep.png").to_vec()),
        ("turned.jpg", include_bytes!("images/turned.jpg").to_vec()),
        ("colour.bmp", include_bytes!("images/colour.bmp").to_vec()),
        ("colour.tiff", include_bytes!("images/colour.tiff").to_vec()),
        ("colour.webp", include_bytes!("images/colour.webp").to_vec()),
    ])
}

fn settings() -> Seeds {
    let mut whole = Settings::default();
    whole.config = config(Some(Motion::any()));
    whole.config.technique_weights = vec![1.0, 0.5];
    whole.measured.insert("on".to_owned(), "a drive".to_owned());
    whole.maps = vec![MapMark::of(&maps()[0])];
    let matches: Vec<Match> = (0..40_u8)
        .map(|at| Match { place: 0, score: f32::from(at) / 64.0, ready: true, accepted: true })
        .collect();
    let wrong: Vec<Option<f64>> = (0..40).map(|at| Some(f64::from(u8::from(at > 30)))).collect();
    let mut options = Calibrate::default();
    options.wrong = 0.2;
    let mut judged = Settings::default();
    judged.threshold = Some(calibrate(&matches, &wrong, &options).expect("forty matches"));
    let toml = |settings: &Settings| settings.to_toml().expect("numbers and texts");
    let distances = ndarray::Array2::from_shape_fn((4, 3), |(i, j)| numbers(i + j)[0]);
    let tracked = config(Some(Motion::steady()));
    let run = match_distances(distances.view(), &tracked, Drive::default()).expect("a matrix");
    let matrices = [distances.view()];
    let alignment = align_distances(&matrices, &tracked, Drive::default(), &[], &mut quiet);
    let json = |value: serde_json::Result<String>| value.expect("numbers and texts");
    let text = |kind: char, text: String| [vec![kind as u8 - b'0'], text.into_bytes()].concat();
    let short = "[config]\nsequence_length = 5\nmotion = \"free\"\nfloor = { fixed = 0.5 }\n";
    let texts = named(vec![
        ("short", text('7', short.to_owned())),
        ("whole", text('7', toml(&whole))),
        ("judged", text('7', toml(&judged))),
        ("segments", text('0', json(serde_json::to_string(maps()[1].segments())))),
        ("config", text('1', json(serde_json::to_string(&Config::default())))),
        ("motion", text('2', json(serde_json::to_string(&Motion::any())))),
        ("step", text('3', json(serde_json::to_string(&Step::Pca { dim: 2, whiten: true })))),
        ("run", text('4', json(serde_json::to_string(&run)))),
        ("alignment", text('5', json(serde_json::to_string(&alignment.expect("a matrix"))))),
        ("fix", text('6', json(serde_json::to_string(&run.fixes[2])))),
    ]);
    let truth = |(name, bytes): (String, Vec<u8>)| {
        (name.replace("random", "truth"), [vec![8], bytes].concat())
    };
    texts.into_iter().chain(random(6).into_iter().map(truth)).collect()
}
