//! Images from files: the order of a route, every format, and files that are none.

use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

use image::{DynamicImage, GrayImage, ImageFormat, RgbImage};
use surefix::{
    Channels, Error, Image, ImageFiles, ImageSource, Levels, Localizer, Map, Order, ReadableImages,
    Recipe, Sad, decode_image, read_image,
};
use tempfile::tempdir;

fn grey(width: u32, height: u32) -> DynamicImage {
    GrayImage::from_fn(width, height, |x, y| [(x * 9 + y * 5) as u8].into()).into()
}

fn rgb(width: u32, height: u32) -> DynamicImage {
    RgbImage::from_fn(width, height, |x, y| [(x * 9) as u8, (y * 5) as u8, (x + y) as u8].into())
        .into()
}

fn names(files: &ImageFiles) -> Vec<String> {
    (0..files.len()).map(|index| files.name(index)).collect()
}

fn build(files: &ImageFiles) -> Result<Map, Error> {
    Map::from_images(files, Sad::default(), &mut |_, _| ControlFlow::Continue(()))
}

#[test]
fn every_format_is_read_in_its_own_colours() {
    let folder = tempdir().unwrap();
    let formats = [
        ("png", ImageFormat::Png, true),
        ("jpg", ImageFormat::Jpeg, false),
        ("JPEG", ImageFormat::Jpeg, false),
        #[cfg(feature = "image-formats")]
        ("bmp", ImageFormat::Bmp, true),
        #[cfg(feature = "image-formats")]
        ("tiff", ImageFormat::Tiff, true),
        #[cfg(feature = "image-formats")]
        ("tif", ImageFormat::Tiff, true),
        #[cfg(feature = "image-formats")]
        ("webp", ImageFormat::WebP, true),
        #[cfg(feature = "image-formats")]
        ("pnm", ImageFormat::Pnm, true),
        #[cfg(feature = "image-formats")]
        ("pgm", ImageFormat::Pnm, true),
        #[cfg(feature = "image-formats")]
        ("ppm", ImageFormat::Pnm, true),
    ];
    for (ending, format, lossless) in formats {
        for image in [grey(23, 17), rgb(23, 17)] {
            let path = folder.path().join(format!("frame.{ending}"));
            // WebP has no grey and is written as RGB.
            let written = if format == ImageFormat::WebP { image.to_rgb8().into() } else { image };
            written.save_with_format(&path, format).unwrap();
            let read = read_image(&path).unwrap();
            assert_eq!((read.width(), read.height()), (23, 17), "{ending}");
            assert_eq!(decode_image(&fs::read(&path).unwrap(), "frame").unwrap(), read, "{ending}");
            let coloured = read.channels() == Channels::Rgb;
            // Some formats keep grey as equal colours: the same brightness in the end.
            let expected =
                if coloured { written.to_rgb8().into_raw() } else { written.to_luma8().into_raw() };
            assert!(coloured || !written.color().has_color(), "{ending}: colours were lost");
            if lossless {
                assert_eq!(read.pixels(), expected, "{ending}");
            } else {
                let far = read.pixels().iter().zip(&expected).map(|(a, b)| a.abs_diff(*b)).max();
                assert!(far.unwrap() < 60, "{ending}: {far:?}");
            }
            assert_eq!(
                ImageFiles::find(folder.path()).unwrap().len(),
                1,
                "{ending} counts as an image"
            );
            fs::remove_file(path).unwrap();
        }
    }
}

#[test]
fn transparency_is_ignored_and_sixteen_bits_stay() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.png");
    for (image, channels) in [
        (DynamicImage::ImageLuma16(grey(5, 4).to_luma16()), Channels::Grey),
        (DynamicImage::ImageLumaA8(grey(5, 4).to_luma_alpha8()), Channels::Grey),
        (DynamicImage::ImageRgb16(rgb(5, 4).to_rgb16()), Channels::Rgb),
        (DynamicImage::ImageRgba8(rgb(5, 4).to_rgba8()), Channels::Rgb),
    ] {
        image.save(&path).unwrap();
        let read = read_image(&path).unwrap();
        assert_eq!(read.channels(), channels);
        let expected = if channels == Channels::Grey { grey(5, 4) } else { rgb(5, 4) };
        assert_eq!(Levels::FULL.apply(read.view()).pixels(), expected.as_bytes());
        assert_eq!(
            read.is_deep(),
            image.color().bits_per_pixel() / u16::from(image.color().channel_count()) == 16
        );
    }
}

#[test]
fn the_content_decides_not_the_ending() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("really_a_png.jpg");
    grey(6, 5).save_with_format(&path, ImageFormat::Png).unwrap();
    assert_eq!(read_image(&path).unwrap().pixels(), grey(6, 5).as_bytes());
}

fn touch(folder: &Path, names: &[&str]) {
    for name in names {
        grey(8, 8).save_with_format(folder.join(name), ImageFormat::Png).unwrap();
    }
}

#[test]
fn frame10_follows_frame9() {
    let folder = tempdir().unwrap();
    touch(
        folder.path(),
        &["frame10.png", "frame9.png", "frame1.png", "frame100.png", "frame02.png", "a.PNG"],
    );
    touch(folder.path(), &[".hidden.png", "._frame9.png"]);
    fs::write(folder.path().join("notes.txt"), "not an image").unwrap();
    fs::create_dir(folder.path().join("folder.png")).unwrap();
    let expected =
        ["a.PNG", "frame1.png", "frame02.png", "frame9.png", "frame10.png", "frame100.png"];
    let files = ImageFiles::find(folder.path()).unwrap();
    assert_eq!(names(&files), expected);
    assert_eq!(build(&files).unwrap().names().unwrap(), expected);

    let find = |pattern: &str| {
        ImageFiles::find(folder.path().join(pattern)).map(|files| names(&files)).unwrap()
    };
    assert_eq!(find("frame*.png"), expected[1..]);
    assert_eq!(find("frame1*.png"), ["frame1.png", "frame10.png", "frame100.png"]);
    assert_eq!(find("frame?.png"), ["frame1.png", "frame9.png"]);
    assert_eq!(find("frame[19]*.png"), ["frame1.png", "frame9.png", "frame10.png", "frame100.png"]);

    let given = vec![folder.path().join("frame9.png"), folder.path().join("frame1.png")];
    assert_eq!(ImageFiles::list(given.clone()).paths(), given, "a list keeps its order");
}

#[test]
fn a_folder_whose_name_looks_like_a_pattern_is_a_folder() {
    let folder = tempdir().unwrap();
    let odd = folder.path().join("run [1]");
    fs::create_dir(&odd).unwrap();
    touch(&odd, &["a.png", "b.png"]);
    assert_eq!(names(&ImageFiles::find(&odd).unwrap()), ["a.png", "b.png"]);
}

#[test]
fn nothing_found_is_an_error_that_names_the_place() {
    let folder = tempdir().unwrap();
    fs::write(folder.path().join("notes.txt"), "not an image").unwrap();
    for place in [folder.path().to_owned(), folder.path().join("*.png")] {
        let error = ImageFiles::find(&place).unwrap_err();
        assert!(matches!(error, Error::NoImages { .. }), "{error}");
        let message = error.to_string();
        assert!(
            message.starts_with(&place.display().to_string()) && message.contains("png, jpeg"),
            "{message}"
        );
    }
    let missing = folder.path().join("missing");
    for place in [missing.clone(), folder.path().join("notes.txt")] {
        let error = ImageFiles::find(&place).unwrap_err();
        assert!(matches!(&error, Error::Io { path, .. } if *path == place), "{error}");
    }
    let error = ImageFiles::find(folder.path().join("***")).unwrap_err();
    assert!(matches!(error, Error::Option { .. }), "{error}");
    assert!(error.to_string().contains("***"), "{error}");
    let error = read_image(missing).unwrap_err();
    assert!(matches!(error, Error::Io { .. }), "{error}");
}

#[test]
fn an_unreadable_image_is_named() {
    let folder = tempdir().unwrap();
    touch(folder.path(), &["frame1.png", "frame3.png"]);
    let bad = folder.path().join("frame2.png");
    let whole = fs::read(folder.path().join("frame1.png")).unwrap();
    let mut flipped = whole.clone();
    let middle = flipped.len() / 2;
    flipped[middle] ^= 0x55;
    for content in [&b"this is a text"[..], b"", &whole[..whole.len() / 2], &whole[..20], &flipped]
    {
        fs::write(&bad, content).unwrap();
        for error in [
            read_image(&bad).unwrap_err(),
            build(&ImageFiles::find(folder.path()).unwrap()).unwrap_err(),
        ] {
            assert!(matches!(error, Error::Image { .. }), "{error:?}");
            assert!(error.to_string().contains("frame2.png"), "{error}");
        }
        let error = decode_image(content, "message 7").unwrap_err();
        assert!(matches!(error, Error::Image { .. }), "{error:?}");
        assert!(error.to_string().contains("message 7"), "{error}");
    }
}

#[test]
fn an_odd_sized_image_is_named() {
    let folder = tempdir().unwrap();
    touch(folder.path(), &["frame1.png", "frame3.png"]);
    grey(8, 9).save(folder.path().join("frame2.png")).unwrap();
    let error = build(&ImageFiles::find(folder.path()).unwrap()).unwrap_err();
    assert!(matches!(error, Error::ImageSize { expected: (8, 8), got: (8, 9), .. }), "{error}");
    assert_eq!(
        error.to_string(),
        "image frame2.png: expected 8 x 8 pixels like the ones before it, got 8 x 9"
    );
}

#[test]
fn grey_and_coloured_files_of_one_scene_are_the_same_place() {
    // A grey camera on a route that was mapped in colour: equal colours have their own brightness.
    let folder = tempdir().unwrap();
    let coloured: DynamicImage = grey(64, 32).to_rgb8().into();
    coloured.save(folder.path().join("a.png")).unwrap();
    grey(64, 32).save(folder.path().join("b.png")).unwrap();
    let map = build(&ImageFiles::find(folder.path()).unwrap()).unwrap();
    assert_eq!(map.descriptors().row(0, map.dim()), map.descriptors().row(1, map.dim()));
}

#[test]
fn what_is_left_out_is_counted() {
    let folder = tempdir().unwrap();
    touch(folder.path(), &["a.png", "b.jfif", "c.jpe"]);
    for name in ["d.heic", "e.HEIC", "notes.txt", ".DS_Store", "raw"] {
        fs::write(folder.path().join(name), "other").unwrap();
    }
    fs::create_dir(folder.path().join("part2")).unwrap();
    for place in [folder.path().to_owned(), folder.path().join("*")] {
        let files = ImageFiles::find(&place).unwrap();
        assert_eq!(names(&files), ["a.png", "b.jfif", "c.jpe"]);
        let said = files.remarks().pop().unwrap();
        let expected =
            "5 files left out: 1 without an ending, 2 .heic, 1 .txt, 1 hidden, folder part2";
        assert!(said.starts_with(expected), "{said}");
    }
}

#[test]
fn the_order_is_chosen() {
    let folder = tempdir().unwrap();
    touch(folder.path(), &["9.5.png", "9.25.png", "9.125.png"]);
    let find = |order| names(&ImageFiles::find_by(folder.path(), order).unwrap());
    assert_eq!(find(Order::Name), ["9.125.png", "9.25.png", "9.5.png"]);
    assert_eq!(find(Order::Decimals), find(Order::Name));
    assert_eq!(find(Order::Whole), ["9.5.png", "9.25.png", "9.125.png"]);
    for (name, order) in [("name", Order::Name), ("time", Order::Time), ("exif", Order::Exif)] {
        assert_eq!((name.parse::<Order>().unwrap(), order.to_string().as_str()), (order, name));
    }
    let error = ImageFiles::find_by(folder.path(), Order::Exif).unwrap_err();
    assert!(error.to_string().contains("DateTimeOriginal"), "{error}");
    assert!("size".parse::<Order>().unwrap_err().to_string().contains("decimals"));
}

#[test]
fn images_that_cannot_be_read_are_passed_over_if_that_is_said() {
    let folder = tempdir().unwrap();
    touch(folder.path(), &["a.png", "b.png", "c.png", "d.png"]);
    fs::write(folder.path().join("b.png"), "").unwrap();
    let files = ImageFiles::find(folder.path()).unwrap();
    assert!(build(&files).is_err());
    let mut told = Vec::new();
    let readable = ReadableImages::of(&files, &mut |done, total| {
        told.push((done, total));
        ControlFlow::Continue(())
    });
    let readable = readable.unwrap();
    assert_eq!((readable.kept(), readable.bad()[0].0), (&[0, 2, 3][..], 1));
    assert_eq!(told, [(0, 4), (4, 4)]);
    let map =
        Map::from_images(&readable, Sad::default(), &mut |_, _| ControlFlow::Continue(())).unwrap();
    assert_eq!(map.names().unwrap(), ["a.png", "c.png", "d.png"]);
    for name in ["a.png", "c.png", "d.png"] {
        fs::write(folder.path().join(name), "").unwrap();
    }
    let error = ReadableImages::of(&files, &mut |_, _| ControlFlow::Continue(())).unwrap_err();
    assert!(error.to_string().contains("a.png"), "{error}");
}

/// Frames of 12 bits that differ.
struct Deep;

impl Deep {
    fn samples(index: usize) -> Vec<u16> {
        (0..64 * 32).map(|i: usize| ((i * i * (index + 7)) % 4001 + 17) as u16).collect()
    }
}

impl ImageSource for Deep {
    fn len(&self) -> usize {
        9
    }

    fn load(&self, index: usize) -> Result<Image, Error> {
        Image::new_deep(64, 32, Channels::Grey, &Self::samples(index))
    }
}

#[test]
fn the_map_fixes_the_range_of_deep_images() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("route");
    Map::build(&path, &Deep, Sad::default(), None, &mut |_, _| ControlFlow::Continue(())).unwrap();
    let map = Map::open(&path).unwrap();
    let Recipe::Sad(sad) = map.recipe() else { panic!("a map of images") };
    let levels = sad.levels().unwrap();
    assert!(
        (17..40).contains(&levels.low()) && (3980..4018).contains(&levels.high()),
        "{levels:?}"
    );
    assert_eq!(map.image_size(), Some((64, 32)));
    let mut localizer = Localizer::new(map.into(), surefix::Config::default()).unwrap();
    for index in 0..9 {
        let image = Deep.load(index).unwrap();
        assert_eq!(localizer.push_image(&image).unwrap().single.place, index);
        // The same in 8 bits by hand.
        let shallow = levels.apply(image.view());
        assert_eq!(sad.describe(shallow.view()).unwrap(), sad.describe(image.view()).unwrap());
    }
    let short = Image::new_deep(64, 32, Channels::Rgb, &Deep::samples(0)).unwrap_err();
    assert!(short.to_string().contains("16-bit"), "{short}");
}
