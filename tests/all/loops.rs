//! Loop closure: what a `LoopCloser` promises.

use std::sync::Arc;

use proptest::prelude::*;
use surefix::{
    Channels, Config, Error, Graph, ImageView, Input, Isa, Localizer, LoopCloser, LoopClosure,
    LoopConfig, Metric, Motion, Poses, Recipe, Sad, View,
};

use crate::cases::cases;
use crate::random::SplitMix64;

/// A circle of `around` places, seen again with a little noise.
fn circle(frames: usize, around: usize, dim: usize, seed: u64) -> Vec<Vec<f32>> {
    let mut random = SplitMix64(seed);
    let mut number = move || (random.next() >> 40) as f32 / (1 << 24) as f32;
    let places: Vec<Vec<f32>> = (0..around).map(|_| (0..dim).map(|_| number()).collect()).collect();
    (0..frames)
        .map(|frame| places[frame % around].iter().map(|x| x + 0.1 * number()).collect())
        .collect()
}

fn config(exclude: usize) -> LoopConfig {
    let mut config = LoopConfig::default();
    config.exclude = exclude;
    config.lasting = 1;
    config
}

fn of_vectors(dim: usize, config: LoopConfig) -> LoopCloser {
    LoopCloser::of_descriptors(dim, Metric::Euclidean, config).unwrap()
}

fn all(closer: &mut LoopCloser, frames: &[Vec<f32>]) -> Vec<LoopClosure> {
    frames.iter().map(|frame| closer.push_descriptor(frame.as_slice()).unwrap()).collect()
}

#[test]
fn the_second_time_around_closes_loops() {
    let mut closer = of_vectors(32, config(10));
    let answers = all(&mut closer, &circle(150, 60, 32, 1));
    assert!(answers[..60].iter().all(|answer| !answer.edge && answer.off_map > 0.2));
    assert!(answers[70..].iter().all(|answer| answer.edge));
    for edge in closer.edges() {
        assert_eq!(edge.frame as usize % 60, edge.place % 60);
        assert!(edge.place + 10 < edge.frame as usize);
    }
    assert_eq!((closer.places(), closer.frames()), (150, 150));
}

#[test]
fn an_edge_must_last() {
    let frames = circle(150, 60, 32, 1);
    let first = |lasting: usize| {
        let mut config = config(10);
        config.lasting = lasting;
        let mut closer = of_vectors(32, config);
        all(&mut closer, &frames);
        closer.edges()[0].frame
    };
    assert_eq!(first(7), first(1) + 6);
}

#[test]
fn a_road_without_loops_has_no_edges() {
    let mut closer = of_vectors(32, config(10));
    let answers = all(&mut closer, &circle(300, 300, 32, 2));
    assert!(closer.edges().is_empty());
    let sum: f64 = closer.belief().sum();
    assert!((sum + answers[299].off_map - 1.0).abs() < 1e-9);
}

#[test]
fn the_first_frames_have_no_place_to_be_compared_with() {
    let mut closer = of_vectors(8, config(5));
    let answers = all(&mut closer, &circle(20, 4, 8, 3));
    for answer in &answers[..7] {
        assert_eq!((answer.place, answer.confidence, answer.off_map), (0, 0.0, 1.0));
    }
    assert!(answers[7].confidence > 0.0);
    assert_eq!(closer.distances().len(), 14);
}

#[test]
fn it_takes_images_and_becomes_a_map() {
    let mut random = SplitMix64(4);
    let pixels: Vec<Vec<u8>> =
        (0..40).map(|_| (0..64 * 32).map(|_| (random.next() >> 56) as u8).collect()).collect();
    let image = |frame: usize| ImageView::new(64, 32, Channels::Grey, &pixels[frame % 20]).unwrap();
    let mut closer = LoopCloser::of_images(Sad::default(), config(5)).unwrap();
    for frame in 0..40 {
        closer.push_image(image(frame)).unwrap();
    }
    closer.gap();
    closer.push_image(image(7)).unwrap();
    closer.push_image(image(8)).unwrap();
    let map = Arc::new(closer.to_map().unwrap());
    assert_eq!(map.places(), 42);
    let mut localizer = Localizer::new(map, Config::default()).unwrap();
    assert_eq!(localizer.push_image(image(13)).unwrap().single.place, 13);
    // It goes on, and the map stays as it was.
    let before = closer.push_image(image(8)).unwrap();
    assert_eq!((before.frame, closer.to_map().unwrap().places()), (42, 43));
    closer.reset().unwrap();
    assert_eq!(
        (closer.recipe(), closer.dim()),
        (Recipe::Sad(Sad::default()), Sad::default().dim())
    );
    assert_eq!(closer.push_image(image(8)).unwrap().frame, 0);
}

#[test]
fn a_gap_puts_the_robot_off_the_map_and_breaks_the_route() {
    let frames = circle(130, 60, 32, 5);
    let mut closer = of_vectors(32, config(10));
    let before = all(&mut closer, &frames[..100]);
    closer.gap();
    let after = closer.push_descriptor(frames[100].as_slice()).unwrap();
    assert!(before[99].edge && !after.edge && after.off_map > 0.5);
    let again = all(&mut closer, &frames[101..130]);
    assert!(again.last().unwrap().edge);
}

#[test]
fn a_frame_that_shows_nothing_is_a_place_and_no_edge() {
    let mut frames = circle(150, 60, 32, 6);
    for frame in &mut frames[90..96] {
        frame.fill(0.0);
    }
    frames[20].fill(0.0);
    for metric in [Metric::Euclidean, Metric::Cosine, Metric::Manhattan] {
        let mut closer = LoopCloser::of_descriptors(32, metric, config(10)).unwrap();
        let answers = all(&mut closer, &frames);
        assert!(answers[90..96].iter().all(|answer| answer.blank && !answer.edge));
        assert_eq!(closer.places(), 150);
        assert!(closer.edges().iter().all(|edge| edge.place != 20));
        assert!(answers[110].edge);
    }
}

#[test]
fn memory_stays_within_its_limit_and_the_answers_are_the_same() {
    let (dim, frames) = (16384, circle(120, 50, 16384, 7));
    let folder = tempfile::tempdir().unwrap();
    for metric in [Metric::Euclidean, Metric::Cosine] {
        let mut free = LoopCloser::of_descriptors(dim, metric, config(10)).unwrap();
        let mut limited = config(10);
        let limit = 4 << 20;
        limited.memory = Some(limit);
        limited.folder = Some(folder.path().to_owned());
        let mut closer = LoopCloser::of_descriptors(dim, metric, limited).unwrap();
        for frame in &frames {
            let expected = free.push_descriptor(frame.as_slice()).unwrap();
            assert_eq!(closer.push_descriptor(frame.as_slice()).unwrap(), expected);
            assert_eq!(closer.distances(), free.distances());
            assert!(closer.bytes() <= limit, "{} of {limit}", closer.bytes());
        }
        assert!(closer.bytes_in_file() >= 3 << 20 && free.bytes_in_file() == 0);
        assert_eq!(closer.to_map().unwrap().descriptors(), free.to_map().unwrap().descriptors());
        // The file has no name.
        #[cfg(unix)]
        assert_eq!(folder.path().read_dir().unwrap().count(), 0);
    }
}

#[test]
fn reserved_memory_is_that_of_the_places_to_come() {
    let (dim, frames) = (16384, circle(50, 50, 16384, 7));
    for metric in [Metric::Euclidean, Metric::Cosine] {
        let mut closer = LoopCloser::of_descriptors(dim, metric, config(10)).unwrap();
        all(&mut closer, &frames[..5]);
        closer.reserve(45).unwrap();
        let reserved = closer.bytes();
        // Four blocks of 16 rows, and less than another one.
        let row = 4 * dim + if metric == Metric::Cosine { 8 } else { 0 };
        assert!((64 * row..80 * row).contains(&reserved), "{reserved}");
        all(&mut closer, &frames[5..]);
        assert_eq!(closer.bytes(), reserved);
    }
    let mut limited = config(10);
    limited.memory = Some(3 << 20);
    let mut closer = of_vectors(dim, limited);
    all(&mut closer, &frames[..5]);
    let before = closer.bytes();
    assert!(matches!(closer.reserve(45), Err(Error::MemoryLimit { .. })));
    assert!(matches!(closer.reserve(usize::MAX), Err(Error::MemoryLimit { .. })));
    assert_eq!(closer.bytes(), before);
    closer.reserve(20).unwrap();
}

/// Of three speeds more, each has two numbers a place, all have their sum, and the view is kept.
#[test]
fn memory_grows_with_the_speeds() {
    let bytes = |motion: Motion| {
        let mut config = config(10);
        config.motion = motion;
        let mut closer = of_vectors(4, config);
        closer.reserve(1000).unwrap();
        closer.bytes()
    };
    assert_eq!(bytes(Motion::loops()) - bytes(Motion::steady()), 1000 * 8 * 8);
    // The cosine needs the length of each row.
    let bytes = |metric: Metric| {
        let mut closer = LoopCloser::of_descriptors(16384, metric, config(10)).unwrap();
        closer.reserve(64).unwrap();
        closer.bytes()
    };
    assert_eq!(bytes(Metric::Cosine) - bytes(Metric::Euclidean), 64 * 8);
}

/// More room for the belief is taken on the way, and the belief stays.
#[test]
fn room_that_is_taken_on_the_way_changes_no_answer() {
    let frames = circle(1500, 300, 8, 12);
    for motion in [Motion::loops(), Motion::steady()] {
        let mut config = config(10);
        config.motion = motion;
        let [mut reserved, mut free] = [(); 2].map(|()| of_vectors(8, config.clone()));
        reserved.reserve(1500).unwrap();
        assert_eq!(all(&mut free, &frames), all(&mut reserved, &frames));
        assert!(free.edges().len() > 1000);
    }
}

/// Blocks that a map shares go to the file like others.
#[test]
fn a_map_of_what_is_there_changes_no_answer() {
    let (dim, frames) = (16384, circle(120, 50, 16384, 7));
    let mut limited = config(10);
    limited.memory = Some(4 << 20);
    let mut closer = of_vectors(dim, limited.clone());
    let mut free = of_vectors(dim, limited);
    for (at, frame) in frames.iter().enumerate() {
        if [40, 100].contains(&at) {
            let map = closer.to_map().unwrap();
            let rows = map.descriptors();
            let View::F32(rows) = rows else { panic!("float32") };
            assert_eq!(rows, &frames[..at].concat());
        }
        let expected = free.push_descriptor(frame.as_slice()).unwrap();
        assert_eq!(closer.push_descriptor(frame.as_slice()).unwrap(), expected);
        assert_eq!(closer.distances(), free.distances());
    }
    assert!(closer.bytes_in_file() >= 3 << 20);
}

#[test]
fn without_room_for_a_place_it_is_as_it_was_and_can_be_frozen() {
    // The belief cannot go to the file.
    let frames = circle(1000, 1000, 8, 8);
    let mut small = config(10);
    small.memory = Some(1_200_000);
    let mut closer = of_vectors(8, small.clone());
    let mut pushed = 0;
    let error = loop {
        match closer.push_descriptor(frames[pushed].as_slice()) {
            Ok(_) => pushed += 1,
            Err(error) => break error,
        }
    };
    assert!(matches!(error, Error::MemoryLimit { .. }), "{error}");
    assert!((400..900).contains(&pushed) && closer.bytes() <= 1_200_000);
    assert_eq!((closer.places(), closer.frames()), (pushed, pushed as u64));
    assert!(closer.push_descriptor(frames[0].as_slice()).is_err());
    closer.freeze();
    let edges = closer.edges().len();
    for more in 0..30 {
        closer.push_descriptor(frames[100 + more].as_slice()).unwrap();
    }
    assert_eq!((closer.places(), closer.frames()), (pushed, pushed as u64 + 30));
    assert!(closer.edges().len() > edges);
}

#[test]
fn options_and_input_that_do_not_fit_are_refused() {
    let refused = |change: &dyn Fn(&mut LoopConfig)| {
        let mut config = LoopConfig::default();
        change(&mut config);
        LoopCloser::of_images(Sad::default(), config).unwrap_err().to_string()
    };
    assert!(refused(&|c| c.exclude = 0).starts_with("option `exclude`: expected a whole number"));
    assert!(refused(&|c| c.lasting = 0).starts_with("option `lasting`"));
    assert!(refused(&|c| c.confidence = f64::NAN).starts_with("option `confidence`"));
    assert!(refused(&|c| c.memory = Some(1000)).starts_with("option `memory`: expected at least"));
    assert!(refused(&|c| c.folder = Some("no/such".into())).starts_with("option `folder`"));
    assert!(refused(&|c| c.motion.rejoin = 2.0).starts_with("option `motion.rejoin`"));
    assert!(LoopCloser::of_descriptors(0, Metric::Cosine, config(3)).is_err());

    let mut closer = of_vectors(4, config(3));
    let good = [0.1_f32, 0.2, 0.3, 0.4];
    closer.push_descriptor(&good[..]).unwrap();
    let bad = [0.1_f32, f32::NAN, 0.3, 0.4];
    assert!(matches!(closer.push_descriptor(&good[..3]), Err(Error::Length { .. })));
    assert!(matches!(closer.push_descriptor(&bad[..]), Err(Error::NotFinite { .. })));
    assert!(matches!(closer.push_descriptor(&[1_u8; 4][..]), Err(Error::Dtype { .. })));
    let image = [0; 64 * 32];
    let image = ImageView::new(64, 32, Channels::Grey, &image).unwrap();
    assert!(matches!(closer.push_image(image), Err(Error::NoDescriptor)));
    let given = Input::Descriptor(View::F32(&good));
    assert!(closer.push(given, Some(f64::INFINITY)).is_err());
    assert!(closer.gap_with_advance(f64::NAN).is_err());
    assert_eq!((closer.places(), closer.frames()), (1, 1));
    assert!(matches!(closer.to_map(), Err(Error::TooFewPlaces { .. })));

    // However large, it only never compares anything.
    let mut lonely = of_vectors(4, config(usize::MAX));
    assert!(all(&mut lonely, &circle(50, 10, 4, 9)).iter().all(|answer| answer.off_map == 1.0));
}

#[test]
fn the_edges_are_written_for_pose_graphs() {
    let mut closer = of_vectors(32, config(10));
    all(&mut closer, &circle(100, 60, 32, 10));
    let edges = closer.edges().to_vec();
    let mut csv = Vec::new();
    closer.write_csv(&mut csv).unwrap();
    let csv = String::from_utf8(csv).unwrap();
    assert!(csv.starts_with("frame,place,confidence\n"));
    assert_eq!(csv.lines().count(), 1 + edges.len());

    let g2o = |graph: &Graph| {
        let mut text = Vec::new();
        closer.write_g2o(&mut text, graph).map(|()| String::from_utf8(text).unwrap())
    };
    let mut graph = Graph::default();
    graph.first = 1000;
    let alone = g2o(&graph).unwrap();
    assert_eq!(alone.lines().count(), edges.len());
    for (line, edge) in alone.lines().zip(&edges) {
        let mut words = line.split(' ');
        assert_eq!(words.next(), Some("EDGE_SE2"));
        let numbers: Vec<f64> = words.map(|word| word.parse().unwrap()).collect();
        let (place, c) = (edge.place as f64, edge.confidence);
        let [position, heading] = [c / (2.0 * 2.0), c / (0.2 * 0.2)];
        let expected = [1000.0 + place, 1000.0 + edge.frame as f64, 0.0, 0.0, 0.0];
        assert_eq!(numbers[..5], expected);
        assert_eq!(numbers[5..], [position, 0.0, 0.0, position, 0.0, heading]);
    }
    for (axes, numbers) in [(3, 3 + 6 + 2), (7, 7 + 21 + 2)] {
        let mut pose = vec![0.0; axes];
        *pose.last_mut().unwrap() = 1.0;
        graph.poses = Some(Poses::new(pose.repeat(100), axes).unwrap());
        let whole = g2o(&graph).unwrap();
        let (vertices, rest): (Vec<_>, Vec<_>) =
            whole.lines().partition(|line| line.starts_with("VERTEX_SE"));
        assert_eq!((vertices.len(), rest.len()), (100, 99 + edges.len()));
        assert!(rest.iter().all(|line| line.split(' ').count() == 1 + numbers));
    }
    let poses = Poses::new(vec![0.0; 3 * 99], 3).unwrap();
    assert!(!poses.is_empty() && Poses::new(Vec::new(), 3).unwrap().is_empty());
    graph.poses = Some(poses);
    assert!(matches!(g2o(&graph), Err(Error::Length { .. })));
    // The way to pose 7 is too long for a number.
    let mut far = vec![1e308; 3 * 100];
    far[3 * 7] = -1e308;
    graph.poses = Some(Poses::new(far, 3).unwrap());
    assert!(matches!(g2o(&graph), Err(Error::NotFinite { what: "poses", row: Some(7), .. })));
    graph.poses = None;
    graph.deviation = (0.0, 1.0);
    assert!(matches!(g2o(&graph), Err(Error::Option { .. })));
}

/// Of two beliefs a speed, their sum, the view, what is known of the distances, and a distance.
fn bytes_a_place(config: &LoopConfig) -> usize {
    let motion = &config.motion;
    let several = usize::from(motion.speeds.len() > 1);
    let viewed = usize::from(motion.repeat < 1.0);
    8 * (2 * motion.speeds.len() + several + viewed + 3) + 4
}

/// Twice as many as before if the limit allows that, else a quarter more.
#[test]
fn room_for_places_grows_within_the_limit() {
    let frames = circle(257, 50, 16, 3);
    let place = bytes_a_place(&config(10));
    let mut free = of_vectors(16, config(10));
    all(&mut free, &frames[..256]);
    // It has more edges than there was room for at first.
    let before = free.bytes();
    assert!(before > of_vectors(16, config(10)).bytes());
    for (more, room) in [
        (512 * place, Some(512)),
        (512 * place - 1, Some(257 + 64)),
        (321 * place, Some(257 + 64)),
        (321 * place - 1, None),
    ] {
        let mut limited = config(10);
        limited.memory = Some(before + more);
        let mut closer = of_vectors(16, limited);
        all(&mut closer, &frames[..256]);
        assert_eq!(closer.bytes(), before);
        let pushed = closer.push_descriptor(frames[256].as_slice());
        match room {
            Some(room) => {
                assert!(pushed.is_ok());
                assert_eq!(closer.bytes(), before + (room - 256) * place);
            }
            None => assert!(matches!(pushed, Err(Error::MemoryLimit { .. })), "{pushed:?}"),
        }
    }
}

/// 64 more edges are kept beside those that there are, until these are given back.
#[test]
fn room_for_edges_grows_within_the_limit() {
    let frames = circle(256, 50, 16, 3);
    let mut free = of_vectors(16, config(10));
    let bytes = frames.iter().map(|frame| {
        free.push_descriptor(frame.as_slice()).unwrap();
        free.bytes()
    });
    let bytes: Vec<usize> = bytes.collect();
    let grows = bytes.windows(2).position(|pair| pair[0] < pair[1]).unwrap();
    let [before, after] = [bytes[grows], bytes[grows + 1]];
    assert_eq!(after - before, 64 * size_of::<LoopClosure>());
    for (spare, fits) in [(0, true), (1, false)] {
        let mut limited = config(10);
        limited.memory = Some(before + 128 * size_of::<LoopClosure>() - spare);
        let mut closer = of_vectors(16, limited);
        all(&mut closer, &frames[..=grows]);
        assert_eq!(closer.bytes(), before);
        let pushed = closer.push_descriptor(frames[grows + 1].as_slice());
        match pushed {
            Ok(_) => assert!(fits && closer.bytes() == after),
            Err(error) => assert!(!fits && matches!(error, Error::MemoryLimit { .. }), "{error}"),
        }
    }
}

/// The rotation of a pose, row by row.
fn turned(pose: &[f64]) -> [[f64; 3]; 3] {
    if let [_, _, heading] = *pose {
        let (sin, cos) = heading.sin_cos();
        return [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]];
    }
    let [x, y, z, w] = pose[3..] else { panic!("a pose of 3 or 7 numbers") };
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

fn times(a: [[f64; 3]; 3], b: [f64; 3]) -> [f64; 3] {
    a.map(|row| row.iter().zip(b).map(|(a, b)| a * b).sum())
}

fn position(pose: &[f64]) -> [f64; 3] {
    [pose[0], pose[1], if pose.len() == 7 { pose[2] } else { 0.0 }]
}

/// From each pose, an edge of odometry leads to the next.
#[test]
fn a_pose_graph_leads_from_pose_to_pose() {
    let mut closer = of_vectors(32, config(10));
    all(&mut closer, &circle(100, 60, 32, 10));
    let loops = closer.edges().to_vec();
    for (axes, moves, vertex, edge) in
        [(3, 2, "VERTEX_SE2", "EDGE_SE2"), (7, 3, "VERTEX_SE3:QUAT", "EDGE_SE3:QUAT")]
    {
        let mut dice = SplitMix64(axes as u64);
        let given: Vec<f64> =
            (0..100 * axes).map(|_| 3.0 * f64::from(dice.share()) - 1.2).collect();
        let mut graph = Graph::default();
        graph.first = 40;
        (graph.deviation, graph.odometry_deviation) = ((3.0, 0.5), (0.25, 5.0));
        graph.poses = Some(Poses::new(given.clone(), axes).unwrap());
        let mut text = Vec::new();
        closer.write_g2o(&mut text, &graph).unwrap();
        let text = String::from_utf8(text).unwrap();
        let read = |line: &str, tag: &str| -> Vec<f64> {
            let words = line.strip_prefix(tag).unwrap_or_else(|| panic!("{line}: {tag}"));
            words.split_whitespace().map(|word| word.parse().unwrap()).collect()
        };
        let near = |a: &[f64], b: &[f64]| {
            assert_eq!(a.len(), b.len());
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9), "{a:?}, expected {b:?}");
        };
        let information = |metres: f64, radians: f64, share: f64| -> Vec<f64> {
            let all = if axes == 3 { 3 } else { 6 };
            let of =
                |row: usize| share / if row < moves { metres.powi(2) } else { radians.powi(2) };
            let cell = |row: usize, column: usize| if row == column { of(row) } else { 0.0 };
            (0..all).flat_map(|row| (row..all).map(move |column| cell(row, column))).collect()
        };
        let lines: Vec<&str> = text.lines().collect();
        let mut poses = Vec::new();
        for (at, given) in given.chunks_exact(axes).enumerate() {
            let mut given = given.to_vec();
            if axes == 7 {
                let length = given[3..].iter().map(|x| x * x).sum::<f64>().sqrt();
                given[3..].iter_mut().for_each(|x| *x /= length);
            }
            let numbers = read(lines[at], vertex);
            assert_eq!(numbers[0], 40.0 + at as f64);
            near(&numbers[1..], &given);
            poses.push(given);
        }
        for (at, two) in poses.windows(2).enumerate() {
            let numbers = read(lines[100 + at], edge);
            near(&numbers[..2], &[40.0 + at as f64, 41.0 + at as f64]);
            let by = &numbers[2..2 + axes];
            let (from, onward, to) = (turned(&two[0]), turned(by), turned(&two[1]));
            let way = times(from, position(by));
            let [x, y, z] = position(&two[0]);
            near(&[way[0] + x, way[1] + y, way[2] + z], &position(&two[1]));
            for column in 0..3 {
                let of = |turn: [[f64; 3]; 3]| turn.map(|row| row[column]);
                near(&times(from, of(onward)), &of(to));
            }
            near(&numbers[2 + axes..], &information(0.25, 5.0, 1.0));
        }
        assert_eq!(lines.len(), 199 + loops.len());
        for (line, closed) in lines[199..].iter().zip(&loops) {
            let numbers = read(line, edge);
            near(&numbers[..2], &[40.0 + closed.place as f64, 40.0 + closed.frame as f64]);
            let mut same = vec![0.0; axes];
            same[6 % axes] = if axes == 7 { 1.0 } else { 0.0 };
            near(&numbers[2..2 + axes], &same);
            near(&numbers[2 + axes..], &information(3.0, 0.5, closed.confidence));
        }
    }
    let mut graph = Graph::default();
    for deviation in
        [(0.0, 1.0), (1.0, 0.0), (-1.0, 1.0), (1.0, -1.0), (1e200, 1.0), (1.0, f64::NAN)]
    {
        graph.deviation = deviation;
        let refused = closer.write_g2o(&mut Vec::new(), &graph);
        assert!(matches!(refused, Err(Error::Option { name: "deviation", .. })), "{refused:?}");
    }
    for axes in [3, 7] {
        let mut numbers = vec![1.0; 5 * axes];
        numbers[3 * axes + 2] = f64::INFINITY;
        let refused = Poses::new(numbers, axes);
        assert!(matches!(refused, Err(Error::NotFinite { row: Some(3), index: 2, .. })));
    }
    let mut numbers = vec![1.0; 5 * 7];
    numbers[2 * 7 + 3..3 * 7].fill(0.0);
    assert!(matches!(Poses::new(numbers, 7), Err(Error::NoDirection { row: Some(2), .. })));
}

#[test]
fn the_least_memory_is_named() {
    let limited = |bytes: usize| {
        let mut config = config(10);
        config.memory = Some(bytes);
        LoopCloser::of_descriptors(16, Metric::Cosine, config)
    };
    let Err(error) = limited(1) else { panic!("a place has more than a byte") };
    let said = error.to_string();
    let least = said.split("at least ").nth(1).and_then(|rest| rest.split(' ').next());
    let least: usize = least.unwrap().parse().unwrap();
    assert!(limited(least - 1).is_err(), "{said}");
    let mut closer = limited(least).unwrap();
    assert_eq!(closer.bytes(), least);
    // 256 places, 64 edges, and a block of 1 MiB of rows with their lengths.
    let edges = 64 * size_of::<LoopClosure>();
    assert_eq!(least, 256 * bytes_a_place(closer.config()) + edges + (1 << 14) * (16 * 4 + 8));
    assert_eq!((closer.dim(), closer.recipe()), (16, Recipe::Ready));
    assert_eq!(closer.config().memory, Some(least));
    assert!(!closer.is_frozen());
    closer.freeze();
    assert!(closer.is_frozen());
}

#[test]
fn reset_begins_anew() {
    let frames = circle(120, 50, 16, 11);
    let mut closer = of_vectors(16, config(10));
    let first = all(&mut closer, &frames);
    closer.reset().unwrap();
    assert_eq!((closer.frames(), closer.places(), closer.edges().len()), (0, 0, 0));
    assert_eq!(all(&mut closer, &frames), first);
}

proptest! {
    #![proptest_config(cases(24))]

    /// Whatever the drive, it never panics, beliefs sum to 1, and all instruction sets agree to the
    /// last bit.
    #[test]
    fn any_drive(
        seed in any::<u64>(),
        dim in 1_usize..20,
        around in 1_usize..40,
        exclude in 1_usize..40,
        steps in proptest::collection::vec((0_u8..20, -3.0..3.0_f64), 1..120),
    ) {
        let frames = circle(steps.len(), around, dim, seed);
        let closers = Isa::available().map(|isa| of_vectors(dim, config(exclude)).with_isa(isa));
        let mut closers: Vec<LoopCloser> = closers.map(Result::unwrap).collect();
        for (frame, (event, advance)) in frames.iter().zip(&steps) {
            let zeros = vec![0.0; dim];
            let frame = if *event == 0 { &zeros } else { frame };
            let advance = (*event > 14).then_some(*advance);
            let mut answers = Vec::new();
            for closer in &mut closers {
                match event {
                    1 => closer.gap(),
                    2 => closer.gap_with_advance(2.5).unwrap(),
                    _ => {}
                }
                let given = Input::Descriptor(View::F32(frame));
                let answer = closer.push(given, advance).unwrap();
                let total = closer.belief().sum::<f64>() + answer.off_map;
                prop_assert!((total - 1.0).abs() < 1e-9);
                answers.push((answer, answer.confidence.to_bits(), answer.off_map.to_bits()));
            }
            prop_assert!(answers.windows(2).all(|two| two[0] == two[1]));
        }
        if steps.len() > 1 {
            prop_assert_eq!(closers[0].to_map().unwrap().places(), steps.len());
        }
    }
}
