//! What a map's file holds, and where.
//!
//! The file is a safetensors file, so any reader of those can open it. Tensors, from the strictest alignment to the loosest:
//! `positions` (places, axes), float64 metres; `norms` (places), float64, the length of each descriptor where the metric is the
//! cosine; `descriptors` (places, dim); `names`, the UTF-8 names with a NUL after each. All but the descriptors are
//! optional. One metadata entry, `surefix`, holds the rest as JSON.

use std::collections::HashMap;
use std::io::{self, Read};
use std::ops::Range;
use std::path::Path;

use safetensors::tensor::{Dtype as FileDtype, Metadata, TensorInfo};
use serde::{Deserialize, Serialize};

use super::{Map, Recipe, count_places};
use crate::distance::{Dtype, Metric};
use crate::error::Error;

const FORMAT: &str = "surefix-map";
const VERSION: u64 = 1;
/// The one metadata entry: one, so that the same map gives the same bytes.
const ENTRY: &str = "surefix";
/// The length of the header comes first.
const LENGTH: usize = 8;
/// The longest header that the format allows.
const MAX_HEADER: usize = 100_000_000;
/// Descriptors begin at a multiple of this, so that those of a mapped file do in memory.
const LINE: usize = 64;

#[derive(Serialize, Deserialize)]
struct Entry {
    format: String,
    version: u64,
    metric: Metric,
    descriptor: Recipe,
}

/// What a map is but for its numbers, and where in the file those lie: bytes from the end of the header on.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) metric: Metric,
    pub(super) recipe: Recipe,
    pub(super) dtype: Dtype,
    pub(super) places: usize,
    pub(super) dim: usize,
    /// Coordinates a place; 0 where there are no positions.
    pub(super) axes: usize,
    pub(super) positions: Option<Range<usize>>,
    pub(super) norms: Option<Range<usize>>,
    pub(super) rows: Range<usize>,
    pub(super) names: Option<Range<usize>>,
}

/// Why a file is not one of a map that can be read here.
pub(super) enum Refusal {
    Foreign(String),
    Newer(u64),
    Io(io::Error),
}

impl Refusal {
    pub(super) fn of(self, path: &Path) -> Error {
        let path = path.to_owned();
        match self {
            Self::Foreign(reason) => Error::MapFile { path, reason },
            Self::Newer(found) => Error::MapVersion { path, found, supported: VERSION },
            Self::Io(source) => Error::Io { path, action: "read the map", source },
        }
    }
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Self::Foreign(error.to_string())
    }
}

impl From<io::Error> for Refusal {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

impl Map {
    /// The layout of the file that this map makes.
    pub(super) fn layout(&self) -> Layout {
        Layout {
            metric: self.metric,
            recipe: self.recipe,
            dtype: self.dtype(),
            places: self.places,
            dim: self.dim,
            axes: self.positions().map_or(0, super::Positions::axes),
            positions: None,
            norms: None,
            rows: 0..0,
            names: None,
        }
        .placed(self.names.as_ref().map(|names| names.bytes().len()))
    }
}

impl Layout {
    /// The same, of so many places and with names of so many bytes, each part put in its place.
    pub(super) fn placed(mut self, names: Option<usize>) -> Self {
        let mut end = 0;
        let mut next = |bytes: usize| {
            let start = end;
            end += bytes;
            start..end
        };
        self.positions = (self.axes > 0).then(|| next(self.places * self.axes * 8));
        self.norms = (self.metric == Metric::Cosine).then(|| next(self.places * 8));
        self.rows = next(self.places * self.dim * self.dtype.size());
        self.names = names.map(next);
        self
    }

    /// The file's head: its length, and then the header.
    pub(super) fn head(&self) -> io::Result<Vec<u8>> {
        let part = |name: &str, dtype, shape: Vec<usize>, span: &Range<usize>| {
            (name.to_owned(), TensorInfo { dtype, shape, data_offsets: (span.start, span.end) })
        };
        let mut tensors = Vec::new();
        if let Some(span) = &self.positions {
            tensors.push(part("positions", FileDtype::F64, vec![self.places, self.axes], span));
        }
        if let Some(span) = &self.norms {
            tensors.push(part("norms", FileDtype::F64, vec![self.places], span));
        }
        tensors.push(part("descriptors", file_dtype(self.dtype), vec![self.places, self.dim], &self.rows));
        if let Some(span) = &self.names {
            tensors.push(part("names", FileDtype::U8, vec![span.len()], span));
        }
        let entry = Entry {
            format: FORMAT.to_owned(),
            version: VERSION,
            metric: self.metric,
            descriptor: self.recipe,
        };
        let entries = HashMap::from([(ENTRY.to_owned(), serde_json::to_string(&entry)?)]);
        let metadata = Metadata::new(Some(entries), tensors).map_err(io::Error::other)?;
        let mut text = serde_json::to_vec(&metadata)?;
        let before_rows = LENGTH + text.len() + self.rows.start;
        text.resize(text.len() + before_rows.next_multiple_of(LINE) - before_rows, b' ');
        Ok([&(text.len() as u64).to_le_bytes(), text.as_slice()].concat())
    }

    /// Reads the head of a file of `length` bytes: the layout, and the byte at which the header ends. All of it fits inside
    /// the file.
    pub(super) fn read(from: &mut impl Read, length: u64) -> Result<(Self, u64), Refusal> {
        let broken = |reason: &dyn std::fmt::Display| {
            Refusal::Foreign(format!("truncated, or not a safetensors file ({reason})"))
        };
        let mut first = [0; LENGTH];
        if length < LENGTH as u64 {
            return Err(broken(&format!("{length} bytes")));
        }
        from.read_exact(&mut first)?;
        let header = u64::from_le_bytes(first);
        if header > MAX_HEADER as u64 || header > length - LENGTH as u64 {
            return Err(broken(&format!("a header of {header} bytes in a file of {length}")));
        }
        let mut text = vec![0; header as usize];
        from.read_exact(&mut text)?;
        let metadata: Metadata = serde_json::from_slice(&text).map_err(|e| broken(&e))?;
        let start = LENGTH as u64 + header;
        let (expected, got) = (metadata.data_len() as u64, length - start);
        if expected != got {
            return Err(broken(&format!("expected {expected} bytes after the header, got {got}")));
        }
        Ok((Self::of_metadata(&metadata)?, start))
    }

    fn of_metadata(metadata: &Metadata) -> Result<Self, Refusal> {
        let entry = read_entry(metadata)?;
        let Some(rows) = metadata.info("descriptors") else {
            let (expected, got) = ("a tensor of that name".to_owned(), "none".to_owned());
            return Err(Error::Shape { what: "descriptors", expected, got }.into());
        };
        let &[_, dim] = rows.shape.as_slice() else {
            return Err(misfit("descriptors", "a tensor (places, dim)".to_owned(), rows));
        };
        let dtype = memory_dtype(rows.dtype).filter(|&dtype| match entry.descriptor {
            Recipe::Sad(sad) => (sad.dtype(), sad.dim(), Metric::Manhattan) == (dtype, dim, entry.metric),
            Recipe::Ready => true,
        });
        let Some(dtype) = dtype else {
            let expected = "a tensor of F32, F16, I8 or U8, as the descriptor's recipe has it".to_owned();
            return Err(misfit("descriptors", expected, rows));
        };
        let span = |info: &TensorInfo| info.data_offsets.0..info.data_offsets.1;
        let places = count_places(span(rows).len() / dtype.size(), dim)?;
        let mut axes = 0;
        let optional = |name, dtype, fits: &mut dyn FnMut(&[usize]) -> bool, expected: String| {
            let Some(info) = metadata.info(name) else { return Ok(None) };
            if info.dtype == dtype && fits(&info.shape) {
                return Ok(Some(span(info)));
            }
            Err(misfit(name, expected, info))
        };
        let mut is_positions = |shape: &[usize]| {
            axes = shape.get(1).copied().unwrap_or(0);
            shape == [places, 2] || shape == [places, 3]
        };
        let expected = format!("a tensor of F64 ({places}, 2) or ({places}, 3), a row for each place");
        let positions = optional("positions", FileDtype::F64, &mut is_positions, expected)?;
        let norms = match entry.metric {
            Metric::Cosine => {
                let expected = format!("a tensor of F64 ({places}), a number for each place");
                optional("norms", FileDtype::F64, &mut |shape| shape == [places], expected)?
            }
            Metric::Manhattan | Metric::Euclidean => None,
        };
        let names = optional("names", FileDtype::U8, &mut |_| true, "UTF-8 text".to_owned())?;
        let (metric, recipe, rows) = (entry.metric, entry.descriptor, span(rows));
        Ok(Self { metric, recipe, dtype, places, dim, axes, positions, norms, rows, names })
    }
}

fn misfit(what: &'static str, expected: String, info: &TensorInfo) -> Refusal {
    Error::Shape { what, expected, got: format!("{:?} {:?}", info.dtype, info.shape) }.into()
}

fn read_entry(metadata: &Metadata) -> Result<Entry, Refusal> {
    /// The part that every version has: a newer one may lack the rest.
    #[derive(Deserialize)]
    struct Version {
        format: String,
        version: u64,
    }
    let foreign = |reason: &str| Refusal::Foreign(format!("a safetensors file, but {reason}"));
    let text = metadata.metadata().as_ref().and_then(|entries| entries.get(ENTRY));
    let text = text.ok_or_else(|| foreign("without surefix's entry: some other program wrote it"))?;
    let Version { format, version } =
        serde_json::from_str(text).map_err(|e| foreign(&format!("its entry cannot be read ({e})")))?;
    if format != FORMAT {
        return Err(foreign(&format!("expected the format {FORMAT:?}, got {format:?}")));
    }
    if version > VERSION {
        return Err(Refusal::Newer(version));
    }
    serde_json::from_str(text).map_err(|e| foreign(&format!("its entry cannot be read ({e})")))
}

fn file_dtype(dtype: Dtype) -> FileDtype {
    match dtype {
        Dtype::F32 => FileDtype::F32,
        Dtype::F16 => FileDtype::F16,
        Dtype::I8 => FileDtype::I8,
        Dtype::U8 => FileDtype::U8,
    }
}

fn memory_dtype(dtype: FileDtype) -> Option<Dtype> {
    match dtype {
        FileDtype::F32 => Some(Dtype::F32),
        FileDtype::F16 => Some(Dtype::F16),
        FileDtype::I8 => Some(Dtype::I8),
        FileDtype::U8 => Some(Dtype::U8),
        _ => None,
    }
}
