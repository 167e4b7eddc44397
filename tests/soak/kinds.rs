//! What is soaked: localizers on one map of 800 places, each beside a plain one.

use std::path::Path;
use std::sync::Arc;

use surefix::{Config, Dtype, Isa, Localizer, Map, Metric, Motion};

use crate::random::SplitMix64;

pub(crate) const PLACES: usize = 800;
/// Numbers of a row, and of one on a map with a screen, which shorter rows do without.
const DIM: usize = 64;
const SCREENED_DIM: usize = 256;

/// A way to localize.
pub(crate) struct Kind {
    pub(crate) name: &'static str,
    pub(crate) screened: bool,
    mapped: bool,
    pub(crate) threads: usize,
    pub(crate) tracks: bool,
}

const PLAIN: Kind =
    Kind { name: "plain", screened: false, mapped: false, threads: 1, tracks: false };

pub(crate) const KINDS: &[Kind] = &[
    PLAIN,
    Kind { name: "screened", screened: true, ..PLAIN },
    Kind { name: "two threads", threads: 2, ..PLAIN },
    #[cfg(all(feature = "mmap", target_endian = "little"))]
    Kind { name: "mapped", mapped: true, ..PLAIN },
    Kind { name: "tracker", tracks: true, ..PLAIN },
];

impl Kind {
    pub(crate) fn dim(&self) -> usize {
        if self.screened { SCREENED_DIM } else { DIM }
    }

    /// The rows of the map.
    pub(crate) fn rows(&self) -> Vec<f32> {
        SplitMix64(1).signed(PLACES * self.dim())
    }

    fn config(&self) -> Config {
        let motion = self.tracks.then(Motion::any);
        config! { sequence_length: 10, speeds: vec![0.8, 1.0, 1.2], motion }
    }

    /// The localizer, and a plain one with the same answers: one thread, no screen, memory, and no
    /// vector instructions. `folder` takes the mapped file.
    pub(crate) fn pair(&self, folder: &Path) -> [Localizer; 2] {
        let map = || Map::from_descriptors(self.rows(), self.dim(), Metric::Euclidean).unwrap();
        let plain = map().with_isa(Isa::Scalar).unwrap();
        let tested = match self {
            Self { screened: true, .. } => map().with_screen(Dtype::I8).unwrap(),
            Self { mapped: true, .. } => mapped(&map(), folder),
            _ => map(),
        };
        let [tested, plain] =
            [tested, plain].map(|map| Localizer::new(Arc::new(map), self.config()).unwrap());
        [tested.with_threads(Some(self.threads)).unwrap(), plain]
    }
}

#[cfg(all(feature = "mmap", target_endian = "little"))]
fn mapped(map: &Map, folder: &Path) -> Map {
    let path = folder.join("map.safetensors");
    map.save(&path).unwrap();
    // SAFETY: the file is this program's own, and stays as it is.
    #[allow(unsafe_code, reason = "the caller's promise about the file")]
    unsafe {
        Map::open_mapped(path).unwrap()
    }
}

#[cfg(not(all(feature = "mmap", target_endian = "little")))]
fn mapped(map: &Map, _folder: &Path) -> Map {
    map.clone()
}
