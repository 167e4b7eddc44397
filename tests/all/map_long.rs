//! A map that is built straight into its file, or becomes longer, is the map that all its places at
//! once would have made.

use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};

use crate::cases::{DTYPES, numbers};
use surefix::{
    Channels, Config, Dtype, Error, Image, ImageSource, Localizer, Map, Metric, Positions, Sad,
    Values,
};
use tempfile::tempdir;

const METRICS: [Metric; 3] = [Metric::Manhattan, Metric::Euclidean, Metric::Cosine];

/// Images that count how many times they are asked for, and of which one may be missing.
struct Drive {
    range: std::ops::Range<usize>,
    named: bool,
    missing: Option<usize>,
    loaded: AtomicUsize,
}

fn drive(range: std::ops::Range<usize>) -> Drive {
    Drive { range, named: true, missing: None, loaded: AtomicUsize::new(0) }
}

impl ImageSource for Drive {
    fn len(&self) -> usize {
        self.range.len()
    }

    fn load(&self, index: usize) -> Result<Image, Error> {
        self.loaded.fetch_add(1, SeqCst);
        if self.missing == Some(index) {
            return Err(Error::Image { name: self.name(index), reason: "gone".into() });
        }
        let place = self.range.start + index;
        let pixel = |i: usize| (i * (place * 31 + 7) % 251) as u8;
        Image::new(16, 8, Channels::Grey, (0..128).map(pixel).collect())
    }

    fn name(&self, index: usize) -> String {
        let place = self.range.start + index;
        if self.named { format!("frame{place}.png") } else { index.to_string() }
    }
}

fn sad(dtype: Dtype) -> Sad {
    Sad::new((8, 4), 4, dtype).unwrap()
}

fn positions(range: std::ops::Range<usize>, axes: usize) -> Positions {
    Positions::new((range.start * axes..range.end * axes).map(|i| i as f64 / 7.0).collect(), axes)
        .unwrap()
}

fn quietly(_done: usize, _total: usize) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// The bytes of the map's file.
fn bytes(map: &Map) -> Vec<u8> {
    let folder = tempdir().unwrap();
    let path = folder.path().join("map");
    map.save(&path).unwrap();
    fs::read(path).unwrap()
}

fn listing(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// Ready descriptors of the places `range`, with names and positions where asked.
fn ready(
    dtype: Dtype,
    metric: Metric,
    range: std::ops::Range<usize>,
    named: bool,
    axes: usize,
) -> Map {
    const DIM: usize = 7;
    let all = numbers(dtype, DIM * 40, 5);
    let span = range.start * DIM..range.end * DIM;
    let part = match all {
        Values::F32(v) => Values::F32(v[span].to_vec()),
        Values::F16(v) => Values::F16(v[span].to_vec()),
        Values::I8(v) => Values::I8(v[span].to_vec()),
        Values::U8(v) => Values::U8(v[span].to_vec()),
    };
    let mut map = Map::from_descriptors(part, DIM, metric).unwrap();
    if named {
        map = map.with_names(range.clone().map(|i| format!("é{i}")).collect()).unwrap();
    }
    if axes > 0 {
        map = map.with_positions(positions(range, axes)).unwrap();
    }
    map
}

#[test]
fn a_map_built_into_its_file_is_the_one_built_in_memory_to_the_byte() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    for dtype in [Dtype::U8, Dtype::F32] {
        // Fewer images than a batch, and many more.
        for places in [2, 3, 31, 32, 33, 64, 65, 300] {
            for axes in [0, 2, 3] {
                let images = drive(0..places);
                let where_ = (axes > 0).then(|| positions(0..places, axes));
                Map::build(&path, &images, sad(dtype), where_.as_ref(), &mut quietly).unwrap();
                let mut whole = Map::from_images(&images, sad(dtype), &mut quietly).unwrap();
                if let Some(positions) = where_ {
                    whole = whole.with_positions(positions).unwrap();
                }
                assert_eq!(
                    fs::read(&path).unwrap(),
                    bytes(&whole),
                    "{places} places, {dtype}, {axes} axes"
                );
            }
        }
    }
    assert_eq!(listing(folder.path()), ["route.safetensors"]);
}

#[test]
fn each_place_of_a_map_from_images_is_that_image_s_descriptor() {
    let images = drive(0..100);
    let map = Map::from_images(&images, sad(Dtype::F32), &mut quietly).unwrap();
    for place in 0..100 {
        let alone = sad(Dtype::F32).describe(images.load(place).unwrap().view()).unwrap();
        assert_eq!(map.descriptors().row(place, 32).unwrap(), alone.view());
    }
}

#[test]
fn a_map_that_is_appended_to_is_the_whole_one_to_the_byte() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    for dtype in DTYPES {
        for metric in METRICS {
            for (named, axes) in [(false, 0), (true, 0), (false, 2), (true, 3)] {
                let part = |range| ready(dtype, metric, range, named, axes);
                let whole = bytes(&part(0..40));
                part(0..2).save(&path).unwrap();
                Map::append(&path, &part(2..9)).unwrap();
                Map::append(&path, &part(9..40)).unwrap();
                assert_eq!(
                    fs::read(&path).unwrap(),
                    whole,
                    "{dtype} {metric} {named} {axes}: in the file"
                );
                let joined =
                    part(0..2).extended(&part(2..9)).unwrap().extended(&part(9..40)).unwrap();
                assert_eq!(bytes(&joined), whole, "{dtype} {metric} {named} {axes}: in memory");
                assert_eq!(joined.names(), part(0..40).names());
            }
        }
    }
    assert_eq!(listing(folder.path()), ["route.safetensors"]);
}

#[test]
fn images_that_are_appended_make_the_map_of_all_images() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    for (named, axes) in [(true, 0), (true, 2), (false, 3)] {
        let part = |range| Drive { named, ..drive(range) };
        let at = |range| (axes > 0).then(|| positions(range, axes));
        let build = |path: &Path, range: std::ops::Range<usize>| {
            let sad = sad(Dtype::U8);
            Map::build(path, &part(range.clone()), sad, at(range).as_ref(), &mut quietly).unwrap();
        };
        build(&path, 0..150);
        let whole = fs::read(&path).unwrap();
        build(&path, 0..70);
        for range in [70..71, 71..150] {
            Map::append_images(&path, &part(range.clone()), at(range).as_ref(), &mut quietly)
                .unwrap();
        }
        assert!(fs::read(&path).unwrap() == whole, "named {named}, {axes} axes");
    }
}

#[test]
fn places_that_cannot_follow_are_refused_with_both_sides_and_the_file_stays() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    let base = || ready(Dtype::F32, Metric::Cosine, 0..9, true, 2);
    base().save(&path).unwrap();
    let old = fs::read(&path).unwrap();
    let wide = Map::from_descriptors(numbers(Dtype::F32, 16, 1), 8, Metric::Cosine).unwrap();
    let images = Map::from_images(&drive(0..3), sad(Dtype::U8), &mut quietly).unwrap();
    for (more, expected, got) in [
        (ready(Dtype::F16, Metric::Cosine, 9..12, true, 2), "7 x float32", "7 x float16"),
        (ready(Dtype::F32, Metric::Euclidean, 9..12, true, 2), "cosine", "euclidean"),
        (wide, "7 x float32", "8 x float32"),
        (images, "ready descriptors", "SAD descriptors of 8 x 4 x uint8, patch 4"),
        (ready(Dtype::F32, Metric::Cosine, 9..12, false, 2), "a name for each place", "no names"),
        (ready(Dtype::F32, Metric::Cosine, 9..12, true, 0), "positions of 2", "no positions"),
        (ready(Dtype::F32, Metric::Cosine, 9..12, true, 3), "positions of 2", "positions of 3"),
    ] {
        for (refused, named) in [
            (base().extended(&more).map(drop), "the map".to_owned()),
            (Map::append(&path, &more), path.display().to_string()),
        ] {
            let error = refused.unwrap_err();
            assert!(matches!(error, Error::Append { .. }), "{error}");
            let error = error.to_string();
            assert!([expected, got, &named].iter().all(|part| error.contains(part)), "{error}");
        }
    }
    let error =
        Map::append_images(&path, &drive(0..3), None, &mut quietly).unwrap_err().to_string();
    assert!(error.contains("ready descriptors") && error.contains("images"), "{error}");
    assert_eq!(fs::read(&path).unwrap(), old);

    Map::build(&path, &drive(0..3), sad(Dtype::U8), None, &mut quietly).unwrap();
    let old = fs::read(&path).unwrap();
    for (images, at, expected) in [
        (drive(3..3), None, "at least one image"),
        (drive(3..6), Some(positions(3..6, 2)), "no positions"),
        (drive(3..6), Some(positions(3..5, 2)), "expected 3 values, got 2"),
    ] {
        let error =
            Map::append_images(&path, &images, at.as_ref(), &mut quietly).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    assert_eq!(fs::read(&path).unwrap(), old);
    assert_eq!(listing(folder.path()), ["route.safetensors"]);
}

#[test]
fn what_is_not_a_map_cannot_be_appended_to() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    let more = ready(Dtype::U8, Metric::Euclidean, 0..4, false, 0);
    let error = Map::append(&path, &more).unwrap_err();
    assert!(matches!(&error, Error::Io { path: named, .. } if *named == path), "{error}");
    assert!(listing(folder.path()).is_empty());
    let whole = bytes(&more);
    for damaged in [&b"hello"[..], &whole[..whole.len() - 1], &[&whole[..], &[0]].concat()] {
        fs::write(&path, damaged).unwrap();
        for refused in
            [Map::append(&path, &more), Map::append_images(&path, &drive(0..3), None, &mut quietly)]
        {
            assert!(
                matches!(&refused, Err(Error::MapFile { path: named, .. }) if *named == path),
                "{refused:?}"
            );
        }
        assert_eq!(fs::read(&path).unwrap(), damaged, "it stays as it was");
    }
    assert_eq!(listing(folder.path()), ["route.safetensors"]);
}

#[test]
fn work_that_is_stopped_or_fails_leaves_the_old_file_and_nothing_else() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    let build = |images: &Drive, stop_at: usize| {
        let mut stop = |done, _| {
            if done >= stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        Map::build(&path, images, sad(Dtype::U8), None, &mut stop)
    };
    let spoilt = Drive { missing: Some(280), ..drive(0..300) };
    for stop_at in [0, 1, 200, 300] {
        assert!(matches!(
            build(&drive(0..300), stop_at),
            Err(Error::Interrupted { total: 300, .. })
        ));
        assert!(listing(folder.path()).is_empty(), "stopped at {stop_at}");
    }
    assert!(build(&spoilt, 1000).unwrap_err().to_string().contains("frame280.png"));
    assert!(listing(folder.path()).is_empty());

    build(&drive(0..10), 1000).unwrap();
    let old = fs::read(&path).unwrap();
    let append = |images: &Drive, stop_at: usize| {
        let mut stop = |done, _| {
            if done >= stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        Map::append_images(&path, images, None, &mut stop)
    };
    for stop_at in [0, 1, 200, 300] {
        assert!(matches!(append(&drive(10..310), stop_at), Err(Error::Interrupted { .. })));
    }
    assert!(append(&spoilt, 1000).unwrap_err().to_string().contains("frame280.png"));
    assert!(build(&spoilt, 1000).is_err());
    assert_eq!(fs::read(&path).unwrap(), old);
    assert_eq!(listing(folder.path()), ["route.safetensors"]);
}

#[test]
fn a_folder_that_is_not_there_is_named_before_any_image_is_read() {
    let folder = tempdir().unwrap();
    for path in [folder.path().join("missing/route"), folder.path().to_owned()] {
        let images = drive(0..5);
        let error = Map::build(&path, &images, sad(Dtype::U8), None, &mut quietly).unwrap_err();
        assert!(matches!(&error, Error::Io { path: named, .. } if *named == path), "{error}");
        assert_eq!(images.loaded.load(SeqCst), 0);
    }
}

#[test]
fn images_are_asked_for_batch_by_batch_and_once_each() {
    let folder = tempdir().unwrap();
    let images = drive(0..2000);
    let mut ahead = 0;
    let mut listen = |done: usize, _| {
        ahead = ahead.max(images.loaded.load(SeqCst).saturating_sub(done));
        ControlFlow::Continue(())
    };
    Map::build(folder.path().join("route"), &images, sad(Dtype::U8), None, &mut listen).unwrap();
    // The first one is looked at for its size.
    assert_eq!(images.loaded.load(SeqCst), 2001);
    assert_eq!(ahead, 1);
}

#[test]
fn a_snapshot_of_the_shorter_map_is_refused_on_the_longer_one() {
    let part = |range| ready(Dtype::F32, Metric::Cosine, range, false, 0);
    let short = std::sync::Arc::new(part(0..9));
    let long = std::sync::Arc::new(short.extended(&part(9..12)).unwrap());
    let snapshot = Localizer::new(std::sync::Arc::clone(&short), Config::default())
        .unwrap()
        .snapshot()
        .unwrap();
    assert!(Localizer::restore(short, &snapshot, None).is_ok());
    let error = Localizer::restore(long, &snapshot, None).unwrap_err().to_string();
    assert!(error.contains("another map"), "{error}");
}
