//! What a map's file holds, and where.
//!
//! The file is a safetensors file, so any reader of those can open it. Tensors, from the strictest
//! alignment to the loosest: `positions` (places, axes), float64 metres; `norms` (places), float64,
//! the length of each descriptor where the metric is the cosine; `post.K.offset` and
//! `post.K.scale`, float64, of step `K` of the post-processing; `descriptors` (places, dim);
//! `post.K.matrix`, float32, as many rows as the step gives numbers; `names`, the UTF-8 names with
//! a NUL after each. All but the descriptors are optional. One metadata entry, `surefix`, holds the
//! rest as JSON. A file with post-processing has version 2, so that a reader that knows nothing of
//! it does not compare queries as they come.

use std::collections::HashMap;
use std::io::{self, Read};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use safetensors::tensor::{Dtype as FileDtype, Metadata, TensorInfo};
use serde::{Deserialize, Serialize};

use super::learned::is_recipe;
use super::{Map, Recipe, count_places};
use crate::distance::Metric;
use crate::dtype::Dtype;
use crate::error::Error;
use crate::post::{Post, Step};

const FORMAT: &str = "surefix-map";
const VERSION: u64 = 2;
/// That of a file without post-processing, which older versions of the library read.
const WITHOUT_POST: u64 = 1;
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
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    post: Vec<Step>,
    /// The recipe of a learned descriptor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    learned: Option<serde_json::Value>,
}

/// What a map is but for its numbers, and where in the file those lie: bytes from the end of the
/// header on.
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
    pub(super) post: Vec<Step>,
    /// The tensors of the steps, in the order of the file.
    pub(super) post_parts: Vec<PostPart>,
    pub(super) learned: Option<Arc<str>>,
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
            post: self.post().map(Post::steps).unwrap_or_default(),
            post_parts: self.post().map(post_parts).unwrap_or_default(),
            learned: self.learned.clone(),
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
        for part in self.post_parts.iter_mut().filter(|part| part.kind != PostKind::Matrix) {
            part.span = next(part.span.len());
        }
        self.rows = next(self.places * self.dim * self.dtype.size());
        for part in self.post_parts.iter_mut().filter(|part| part.kind == PostKind::Matrix) {
            part.span = next(part.span.len());
        }
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
        let post = |matrix: bool| {
            let parts = self
                .post_parts
                .iter()
                .filter(move |part| (part.kind == PostKind::Matrix) == matrix);
            parts
                .map(|p| part(&p.name(), p.kind.dtype(), p.shape.clone(), &p.span))
                .collect::<Vec<_>>()
        };
        tensors.extend(post(false));
        tensors.push(part(
            "descriptors",
            file_dtype(self.dtype),
            vec![self.places, self.dim],
            &self.rows,
        ));
        tensors.extend(post(true));
        if let Some(span) = &self.names {
            tensors.push(part("names", FileDtype::U8, vec![span.len()], span));
        }
        let entry = Entry {
            format: FORMAT.to_owned(),
            version: if self.post.is_empty() { WITHOUT_POST } else { VERSION },
            metric: self.metric,
            descriptor: self.recipe,
            post: self.post.clone(),
            learned: self.learned.as_deref().map(serde_json::from_str).transpose()?,
        };
        let entries = HashMap::from([(ENTRY.to_owned(), serde_json::to_string(&entry)?)]);
        let metadata = Metadata::new(Some(entries), tensors).map_err(io::Error::other)?;
        let mut text = serde_json::to_vec(&metadata)?;
        let before_rows = LENGTH + text.len() + self.rows.start;
        text.resize(text.len() + before_rows.next_multiple_of(LINE) - before_rows, b' ');
        Ok([&(text.len() as u64).to_le_bytes(), text.as_slice()].concat())
    }

    /// Reads the head of a file of `length` bytes: the layout, and the byte at which the header
    /// ends. All of it fits inside the file.
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
            Recipe::Sad(sad) => {
                (sad.dtype(), sad.dim(), Metric::Manhattan) == (dtype, dim, entry.metric)
            }
            Recipe::Ready => true,
        });
        let Some(dtype) = dtype else {
            let expected =
                "a tensor of F32, F16, I8 or U8, as the descriptor's recipe has it".to_owned();
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
        let expected =
            format!("a tensor of F64 ({places}, 2) or ({places}, 3), a row for each place");
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
        if !entry.post.is_empty() && entry.version == WITHOUT_POST {
            let reason =
                format!("post-processing: expected version {VERSION}, got {}", entry.version);
            return Err(Refusal::Foreign(reason));
        }
        if !entry.post.is_empty() && (dtype != Dtype::F32 || recipe != Recipe::Ready) {
            let reason = "post-processing: expected ready descriptors of F32".to_owned();
            return Err(Refusal::Foreign(reason));
        }
        let post_parts = read_post_parts(metadata, entry.post.len())?;
        if entry
            .learned
            .as_ref()
            .is_some_and(|learned| recipe != Recipe::Ready || !is_recipe(learned))
        {
            let reason =
                "learned: expected an object with a name, beside ready descriptors".to_owned();
            return Err(Refusal::Foreign(reason));
        }
        let learned = entry.learned.map(|recipe| recipe.to_string().into());
        let post = entry.post;
        Ok(Self {
            metric,
            recipe,
            dtype,
            places,
            dim,
            axes,
            positions,
            norms,
            rows,
            names,
            post,
            post_parts,
            learned,
        })
    }
}

/// A tensor of a step of post-processing.
#[derive(Clone, Debug)]
pub(super) struct PostPart {
    pub(super) step: usize,
    pub(super) kind: PostKind,
    shape: Vec<usize>,
    pub(super) span: Range<usize>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PostKind {
    Offset,
    Scale,
    Matrix,
}

impl PostKind {
    const ALL: [Self; 3] = [Self::Offset, Self::Scale, Self::Matrix];

    fn dtype(self) -> FileDtype {
        if self == Self::Matrix { FileDtype::F32 } else { FileDtype::F64 }
    }
}

impl PostPart {
    fn name(&self) -> String {
        let kind = match self.kind {
            PostKind::Offset => "offset",
            PostKind::Scale => "scale",
            PostKind::Matrix => "matrix",
        };
        format!("post.{}.{kind}", self.step)
    }
}

/// The tensors of a chain, those that there are; where they lie is still to be said.
fn post_parts(post: &Post) -> Vec<PostPart> {
    let mut parts = Vec::new();
    let mut width = post.input();
    for (step, stage) in post.fitted_steps().iter().enumerate() {
        let output = stage.output(width);
        let shapes = [
            (PostKind::Offset, vec![stage.offset.len()], 8 * stage.offset.len()),
            (PostKind::Scale, vec![stage.scale.len()], 8 * stage.scale.len()),
            (PostKind::Matrix, vec![output, width], 4 * stage.matrix.len()),
        ];
        let there = shapes.into_iter().filter(|(_, _, bytes)| *bytes > 0);
        parts.extend(there.map(|(kind, shape, bytes)| PostPart {
            step,
            kind,
            shape,
            span: 0..bytes,
        }));
        width = output;
    }
    parts
}

fn read_post_parts(metadata: &Metadata, steps: usize) -> Result<Vec<PostPart>, Refusal> {
    let mut parts = Vec::new();
    for (step, kind) in (0..steps).flat_map(|step| PostKind::ALL.map(|kind| (step, kind))) {
        let mut part = PostPart { step, kind, shape: Vec::new(), span: 0..0 };
        let Some(info) = metadata.info(&part.name()) else { continue };
        let axes = if kind == PostKind::Matrix { 2 } else { 1 };
        if info.dtype != kind.dtype() || info.shape.len() != axes {
            let expected = format!("{:?} of {axes} axes", kind.dtype());
            let got = format!("{:?} {:?}", info.dtype, info.shape);
            return Err(Refusal::Foreign(format!(
                "{}: expected {expected}, got {got}",
                part.name()
            )));
        }
        (part.shape, part.span) = (info.shape.clone(), info.data_offsets.0..info.data_offsets.1);
        parts.push(part);
    }
    Ok(parts)
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
    let text =
        text.ok_or_else(|| foreign("without surefix's entry: some other program wrote it"))?;
    let Version { format, version } = serde_json::from_str(text)
        .map_err(|e| foreign(&format!("its entry cannot be read ({e})")))?;
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
