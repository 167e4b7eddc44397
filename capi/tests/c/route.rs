//! A generated route: its maps, its frames, and what else a drive needs, as files.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use surefix::{
    Channels, Dtype, Image, ImageView, Map, Origin, Positions, Sad, Segments, Values, quiet,
};
use surefix_simulate::{Conditions, Route, RouteConfig};
use tempfile::TempDir;

pub(crate) const PLACES: usize = 60;
pub(crate) const SIZE: (usize, usize) = (64, 32);
pub(crate) const DIM: usize = 8;

/// A folder for the files of one test.
pub(crate) struct Files(TempDir);

impl Files {
    pub(crate) fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }

    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }

    pub(crate) fn save(&self, name: &str, map: &Map) -> PathBuf {
        let path = self.path().join(name);
        map.save(&path).unwrap();
        path
    }
}

fn route() -> Route {
    let (width, height) = SIZE;
    let config = RouteConfig { places: PLACES, width, height, ..RouteConfig::default() };
    Route::new(config).unwrap()
}

/// A map of images with names, positions with degrees, and a break.
pub(crate) fn image_map() -> Arc<Map> {
    let summer = route().traverse(Conditions::reference()).unwrap();
    let map = Map::from_images(&summer, Sad::default(), &mut quiet).unwrap();
    let metres = (0..PLACES).flat_map(|place| [3.0 * place as f64, place as f64]).collect();
    let origin = Origin::new(-27.47, 153.02).unwrap();
    let positions = Positions::new(metres, 2).unwrap().with_origin(origin).unwrap();
    let map = map.with_positions(positions).unwrap();
    Arc::new(map.with_segments(Segments::new(PLACES, &[40]).unwrap()).unwrap())
}

/// The same places in winter, in colour.
pub(crate) fn winter() -> Vec<Image> {
    let winter = route().traverse(Conditions::revisit()).unwrap();
    (0..PLACES).map(|frame| winter.frame(frame)).collect()
}

/// Of an image, the channel of a colour, by its index in RGB.
pub(crate) fn channel(image: &Image, index: usize) -> Vec<u8> {
    image.pixels().iter().skip(index).step_by(3).copied().collect()
}

/// Deep grey images, as of a thermal camera, and the map of half of them.
pub(crate) fn thermal() -> (Arc<Map>, Vec<Vec<u16>>) {
    let deep = |image: &Image| -> Vec<u16> {
        channel(image, 1).iter().map(|&grey| 7000 + 2 * u16::from(grey)).collect()
    };
    let frames: Vec<_> = winter().iter().map(deep).collect();
    let of = |frame: &Vec<u16>| Image::new_deep(SIZE.0, SIZE.1, Channels::Grey, frame).unwrap();
    let images: Vec<Image> = frames[..30].iter().map(of).collect();
    (Arc::new(Map::from_images(&images, Sad::default(), &mut quiet).unwrap()), frames)
}

pub(crate) fn view(frame: &[u16]) -> ImageView<'_> {
    ImageView::new_deep(SIZE.0, SIZE.1, Channels::Grey, frame).unwrap()
}

/// Descriptors of a type that change from place to place; with noise, if it is not 0.
pub(crate) fn descriptors(dtype: Dtype, noise: u64) -> Values {
    let mut state = 1 + noise;
    let mut random = move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1_u64 << 24) as f32
    };
    let level = if noise == 0 { 0.0 } else { 30.0 };
    let numbers = (0..PLACES * DIM).map(|at| {
        let (place, index) = ((at / DIM) as f32, (at % DIM) as f32);
        60.0 + 50.0 * (place * (0.05 + 0.02 * index) + index).sin() + level * (random() - 0.5)
    });
    match dtype {
        Dtype::F32 => Values::F32(numbers.collect()),
        Dtype::F16 => Values::F16(numbers.map(half::f16::from_f32).collect()),
        Dtype::I8 => Values::I8(numbers.map(|number| number.clamp(-127.0, 127.0) as i8).collect()),
        Dtype::U8 => Values::U8(numbers.map(|number| number.clamp(0.0, 255.0) as u8).collect()),
    }
}
