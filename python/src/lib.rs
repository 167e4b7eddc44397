//! The Python binding: converts arguments and results, and leaves all logic to the crate.
#![allow(clippy::doc_markdown, reason = "docstrings are for Python readers, in reStructuredText")]
#![allow(clippy::needless_pass_by_value, reason = "arguments come from Python by value")]

mod alarm;
mod align;
mod arrays;
mod batch;
mod calibrate;
mod error;
mod evaluate;
mod fix;
mod images;
mod inputs;
mod kept;
mod learned;
mod localizer;
mod loops;
mod map;
mod map_editing;
mod map_growing;
mod map_making;
mod map_places;
mod matcher;
mod options;
mod pickle;
mod pictures;
mod places;
mod position;
mod post;
mod sad;
mod saving;
mod segments;
mod settings;
mod shards;
mod signals;
mod simulate;
mod traverses;
mod truth;

use pyo3::prelude::*;
use surefix::Isa;

/// The instruction set that the kernels run on here: "scalar", "avx2", "avx512" or "neon".
#[pyfunction]
fn instruction_set() -> String {
    Isa::best().to_string()
}

#[pymodule]
mod _core {
    #[pymodule_export]
    use crate::alarm::Alarm;
    #[pymodule_export]
    use crate::align::{Alignment, align};
    #[pymodule_export]
    use crate::batch::{Run, described, match_, match_distances};
    #[pymodule_export]
    use crate::calibrate::{Threshold, block_length, calibrate};
    #[pymodule_export]
    use crate::evaluate::{Evaluation, evaluate, judged, recall_at};
    #[pymodule_export]
    use crate::fix::{Fix, Peak, Sequence, Single, Track};
    #[pymodule_export]
    use crate::images::{
        decode_image, find_images, image_files, max_pixels, read_image, set_max_pixels,
    };
    #[pymodule_export]
    use crate::localizer::{FixStream, Localizer};
    #[pymodule_export]
    use crate::loops::{LoopCloser, LoopClosure};
    #[pymodule_export]
    use crate::map::Map;
    #[pymodule_export]
    use crate::map_places::thumbnail;
    #[pymodule_export]
    use crate::matcher::Matcher;
    #[pymodule_export]
    use crate::position::Position;
    #[pymodule_export]
    use crate::post::{Post, Running, fit_post};
    #[pymodule_export]
    use crate::sad::Sad;
    #[pymodule_export]
    use crate::saving::{_AtomicFile, _AtomicFolder, _is_stream};
    #[pymodule_export]
    use crate::segments::{Segment, Segments};
    #[pymodule_export]
    use crate::settings::Settings;
    #[pymodule_export]
    use crate::shards::{Shard, ShardDriver};
    #[pymodule_export]
    use crate::simulate::{Route, Traverse};
    #[pymodule_export]
    use crate::traverses::MapTraverse;
    #[pymodule_export]
    use crate::truth::{Trust, evaluate_trust};

    #[pymodule_export]
    use super::instruction_set;

    use super::{Bound, PyModule, PyModuleMethods as _, PyResult};
    use half::f16;
    use numpy::{PyArray1, PyArrayMethods as _};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        // Found now, and not at a first array, in whose midst a fork would leave it half-done.
        let array = PyArray1::<f16>::zeros(module.py(), [1], false);
        array.try_readonly()?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
