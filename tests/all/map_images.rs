//! Maps of images with segments, positions and thumbnails: in memory, straight into a file, and
//! appended.

use std::fs;

use surefix::{
    Channels, Dtype, Error, Extras, Image, ImageSource, Map, Origin, Positions, Sad, Segments,
    quiet,
};
use tempfile::tempdir;

/// Images of some size; each load is counted by its name in the error if it is forbidden.
struct Drive {
    images: Vec<Image>,
    forbidden: bool,
}

impl ImageSource for Drive {
    fn len(&self) -> usize {
        self.images.len()
    }

    fn load(&self, index: usize) -> Result<Image, Error> {
        if self.forbidden {
            return Err(Error::Image { name: index.to_string(), reason: "was read".to_owned() });
        }
        Ok(self.images[index].clone())
    }
}

fn drive(count: usize, first: usize) -> Drive {
    let pixel = |at: usize| (at * at * 31 % 253) as u8;
    let image = |seed: usize| {
        let pixels = (0..192 * 108 * 3).map(|at| pixel(at / 7 + 1000 * seed)).collect();
        Image::new(192, 108, Channels::Rgb, pixels).unwrap()
    };
    Drive { images: (first..first + count).map(image).collect(), forbidden: false }
}

fn sad() -> Sad {
    Sad::new((16, 8), 4, Dtype::U8).unwrap()
}

fn positions(count: usize) -> Positions {
    let metres = (0..2 * count).map(|at| at as f64).collect();
    let origin = Origin::new(-33.9, 18.4).unwrap();
    Positions::new(metres, 2).unwrap().with_origin(origin).unwrap()
}

#[test]
fn built_and_appended_maps_are_those_made_at_once() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    // More than a batch on any machine is not needed: batches are drained one by one.
    let (all, first) = (drive(70, 0), drive(40, 0));
    let segments = Segments::new(70, &[10, 40]).unwrap().with_closed(&[0]).unwrap();
    let known = positions(70);
    let extras = Extras::default().positions(&known).segments(&segments).thumbnails();
    let whole = Map::from_images_with(&all, sad(), extras, &mut quiet).unwrap();
    assert_eq!(*whole.segments(), segments);
    let pictures = whole.thumbnails().unwrap();
    assert_eq!((pictures.len(), pictures.size()), (70, (96, 54)));
    let shrunk = Sad::new((96, 54), 1, Dtype::U8).unwrap();
    for at in [0, 33, 69] {
        let expected = shrunk.thumbnail(all.images[at].view()).unwrap();
        assert_eq!(pictures.get(at).unwrap().pixels(), expected.pixels());
    }
    Map::build_with(&path, &all, sad(), extras, &mut quiet).unwrap();
    assert!(fs::read(&path).unwrap() == whole.to_bytes().unwrap());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no other file is left");

    let some = Segments::new(40, &[10]).unwrap().with_closed(&[0]).unwrap();
    let start = positions(40);
    let extras = Extras::default().positions(&start).segments(&some).thumbnails();
    Map::build_with(&path, &first, sad(), extras, &mut quiet).unwrap();
    // On a plane that is not known: taken to be on the map's.
    let rest = Positions::new((80..140).map(f64::from).collect(), 2).unwrap();
    let extras = Extras::default().positions(&rest).new_segment();
    Map::append_images_with(&path, &drive(30, 40), extras, &mut quiet).unwrap();
    assert!(fs::read(&path).unwrap() == whole.to_bytes().unwrap());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no other file is left");
}

#[test]
fn what_does_not_fit_is_refused_before_an_image_is_read() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    let unread = Drive { forbidden: true, ..drive(10, 0) };
    let (short, segments) = (positions(9), Segments::one(9));
    for extras in [
        Extras::default().positions(&short),
        Extras::default().segments(&segments),
        Extras::default().thumbnails_of((0, 3)),
    ] {
        let made = Map::from_images_with(&unread, sad(), extras, &mut quiet).map(|_| ());
        let built = Map::build_with(&path, &unread, sad(), extras, &mut quiet);
        for refused in [made, built] {
            let error = refused.unwrap_err();
            assert!(matches!(error, Error::Length { .. } | Error::Shape { .. }), "{error}");
        }
    }
    // Pictures have up to 1024 pixels a side.
    for (size, read) in [((1024, 1), true), ((1025, 1), false), ((1, 1030), false)] {
        let extras = Extras::default().thumbnails_of(size);
        let error = Map::from_images_with(&unread, sad(), extras, &mut quiet).unwrap_err();
        assert_eq!(matches!(error, Error::Image { .. }), read, "{size:?}: {error}");
    }
    let ring = Segments::one(10).with_closed(&[0]).unwrap();
    let extras = Extras::default().segments(&ring);
    Map::build_with(&path, &drive(10, 0), sad(), extras, &mut quiet).unwrap();
    let before = fs::read(&path).unwrap();
    for extras in [
        Extras::default(),
        Extras::default().segments(&segments).new_segment(),
        Extras::default().positions(&positions(10)).new_segment(),
    ] {
        let error = Map::append_images_with(&path, &unread, extras, &mut quiet).unwrap_err();
        assert!(matches!(error, Error::Append { .. } | Error::Length { .. }), "{error}");
    }
    assert!(fs::read(&path).unwrap() == before);
}

#[test]
fn deep_images_have_thumbnails_by_the_levels_of_the_map() {
    let deep = |seed: usize| {
        let samples: Vec<u16> = (0..64 * 48).map(|at| (1000 + (at * seed) % 500) as u16).collect();
        Image::new_deep(64, 48, Channels::Grey, &samples).unwrap()
    };
    let images: Vec<Image> = (3..9).map(deep).collect();
    let extras = Extras::default().thumbnails_of((32, 24));
    let map = Map::from_images_with(&images, sad(), extras, &mut quiet).unwrap();
    let picture = map.thumbnails().and_then(|pictures| pictures.get(2)).unwrap();
    assert!(picture.pixels().iter().max() > Some(&150), "the levels' range, not 16 bits'");
}

/// Images of another size fit if width to height is the same, to 2 %.
#[test]
fn appended_images_have_the_shape_of_the_map() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    let image = |(width, height): (usize, usize)| {
        let pixels = (0..width * height).map(|at| (at * 31 % 253) as u8).collect();
        Image::new(width, height, Channels::Grey, pixels).unwrap()
    };
    let made = vec![image((100, 50)); 3];
    Map::build(&path, &made, sad(), None, &mut quiet).unwrap();
    for size in [(100, 50), (200, 100), (60, 30), (101, 50), (101, 51), (203, 100)] {
        Map::append_images(&path, &vec![image(size); 2], None, &mut quiet).unwrap();
    }
    for size in [(50, 100), (50, 50), (104, 50), (96, 50), (100, 53), (207, 100)] {
        let error = Map::append_images(&path, &vec![image(size); 2], None, &mut quiet).unwrap_err();
        assert!(
            matches!(error, Error::ImageSize { expected: (100, 50), got, .. } if got == size),
            "{error}"
        );
    }
    assert_eq!(Map::open(&path).unwrap().places(), 15);
}
