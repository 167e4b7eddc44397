//! The contents of a map's file beside its rows: their order in the file, and how they are read.

use std::cell::RefCell;
use std::fs::File;
use std::ops::Range;
use std::rc::Rc;
use std::sync::Arc;

use once_cell::race::OnceBox;
use safetensors::tensor::{Dtype as FileDtype, TensorInfo};
use serde::{Deserialize, Serialize};

use super::blank::{flagged, flags};
use super::positions::{Origin, Positions};
use super::recipe::{Kind, is_recipe};
use super::route::Names;
use super::storage::Storage;
use super::thumbnails::{Pictures, Thumbnails};
use super::traverses::Traverses;
use super::traverses_file::ROWS as TRAVERSES;
use super::{Map, Recipe, count_places};
use crate::archive::{Format, Header, Reader, Refusal, Sink, Tensors, Writer};
use crate::distance::Metric;
use crate::dtype::Dtype;
use crate::error::Error;
use crate::post::{FittedStep, MAX_STEPS, Post, Step};
use crate::segments::Segments;

pub(super) const FORMAT: Format = Format { name: "surefix-map", version: 1 };
pub(super) const ROWS: &str = "descriptors";
pub(super) const THUMBNAILS: &str = "thumbnails";
const BLANK: &str = "blank";

/// The metadata entry.
#[derive(Serialize, Deserialize)]
pub(super) struct Entry {
    pub(super) metric: Metric,
    descriptor: Recipe,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    post: Vec<Step>,
    /// The recipe of a learned descriptor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    learned: Option<serde_json::Value>,
    /// Width and height of the images.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    image_size: Option<(usize, usize)>,
    /// That of the positions' local plane.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    origin: Option<(f64, f64)>,
    /// The name of the positions' plane, if it is another.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    plane: Option<String>,
}

/// The contents of a file beside its rows. Each part is written in pieces: those of the old file
/// and those that are appended, for one.
pub(super) struct Sidecar<'a> {
    pub(super) places: usize,
    pub(super) segments: Segments,
    pub(super) positions: Vec<&'a Positions>,
    pub(super) norms: Vec<&'a [f64]>,
    pub(super) names: Vec<&'a Names>,
    pub(super) pictures: Option<Pictures<'a>>,
    /// Those of a whole map.
    pub(super) traverses: Option<&'a Traverses>,
}

/// The tensors of a map's file, in the order of the file: from the strictest alignment to the
/// loosest. `rows` writes the rows and gives the places that show nothing.
pub(super) fn contents<'a>(
    kind: &'a Kind,
    sidecar: Sidecar<'a>,
    rows: impl FnOnce(&mut Sink<'_>) -> Result<Vec<usize>, Error> + 'a,
) -> Writer<'a> {
    let Sidecar { places, segments, positions, norms, names, pictures, traverses } = sidecar;
    let mut writer = Writer::new();
    if let Some(first) = positions.first() {
        let metres = positions.iter().map(|positions| positions.metres()).collect();
        writer.numbers("positions", vec![places, first.axes()], metres);
    }
    if kind.metric == Metric::Cosine {
        writer.numbers("norms", vec![places], norms);
    }
    add_segments(&mut writer, &segments);
    if let Some(traverses) = traverses {
        traverses.write_head(kind, &mut writer);
    }
    let stages = kind.post.as_deref().map_or(&[][..], Post::fitted_steps).iter().enumerate();
    for (step, stage) in stages.clone() {
        for (part, numbers) in [("offset", &stage.offset), ("scale", &stage.scale)] {
            if !numbers.is_empty() {
                let name = format!("post.{step}.{part}");
                writer.numbers(name, vec![numbers.len()], vec![numbers.as_slice()]);
            }
        }
    }
    writer.align();
    // Known only when all rows are written.
    let blank = Rc::new(RefCell::new(Vec::new()));
    let found = Rc::clone(&blank);
    writer.stream(ROWS, file_dtype(kind.dtype), vec![places, kind.dim], move |out| {
        *found.borrow_mut() = rows(out)?;
        Ok(())
    });
    if let Some(traverses) = traverses {
        traverses.write_rows(kind, &mut writer);
    }
    let mut width = kind.post.as_deref().map_or(0, Post::input);
    for (step, stage) in stages {
        let output = stage.output(width);
        if !stage.matrix.is_empty() {
            let name = format!("post.{step}.matrix");
            writer.numbers(name, vec![output, width], vec![stage.matrix.as_slice()]);
        }
        width = output;
    }
    writer.stream(BLANK, FileDtype::U8, vec![places], move |out| {
        out.bytes(&flags(&blank.borrow(), places))
    });
    if !names.is_empty() {
        let texts: Vec<_> = names.into_iter().map(Names::bytes).collect();
        writer.numbers("names", vec![texts.iter().map(|text| text.len()).sum()], texts);
    }
    if let Some(Pictures { size: (width, height), write }) = pictures {
        writer.stream(THUMBNAILS, FileDtype::U8, vec![places, height, width], write);
    }
    if let Some(traverses) = traverses {
        traverses.write_tail(kind, &mut writer);
    }
    writer
}

/// A route of one open segment has no tensor of its own.
fn add_segments(writer: &mut Writer<'_>, segments: &Segments) {
    let mut add = |name: &str, shape: Vec<usize>, numbers: Vec<usize>| {
        if !numbers.is_empty() {
            let numbers: Vec<u64> = numbers.into_iter().map(|number| number as u64).collect();
            writer.stream(name, FileDtype::U64, shape, move |out| {
                out.numbers(bytemuck::must_cast_slice(&numbers), size_of::<u64>())
            });
        }
    };
    let breaks: Vec<_> = segments.iter().skip(1).map(|segment| segment.start).collect();
    add("breaks", vec![breaks.len()], breaks);
    let closed = segments.iter().enumerate().filter(|(_, segment)| segment.closed);
    let closed: Vec<_> = closed.map(|(index, _)| index).collect();
    add("closed", vec![closed.len()], closed);
    let links = segments.links();
    add("links", vec![links.len(), 2], links.iter().flat_map(|&(from, to)| [from, to]).collect());
}

/// The segments of a file.
fn segments_of(tensors: &Tensors<'_>, places: usize) -> Result<Segments, Refusal> {
    let list = |name: &str| {
        let numbers = tensors.numbers::<u64>(name, "(k)", |shape| shape.len() == 1)?;
        Ok::<_, Refusal>(numbers.map(|(_, numbers)| whole(&numbers)).unwrap_or_default())
    };
    let segments = Segments::new(places, &list("breaks")?)?.with_closed(&list("closed")?)?;
    let pairs = |shape: &[usize]| matches!(shape, [_, 2]);
    let Some((_, links)) = tensors.numbers::<u64>("links", "(k, 2)", pairs)? else {
        return Ok(segments);
    };
    let links: Vec<_> = whole(&links).chunks_exact(2).map(|pair| (pair[0], pair[1])).collect();
    Ok(segments.with_links(&links)?)
}

/// Places and segments. One that the machine cannot count is none of a map.
fn whole(numbers: &[u64]) -> Vec<usize> {
    numbers.iter().map(|&number| usize::try_from(number).unwrap_or(usize::MAX)).collect()
}

pub(super) fn entry(kind: &Kind, positions: Option<&Positions>) -> Entry {
    Entry {
        origin: positions.and_then(Positions::origin).map(Into::into),
        plane: positions.and_then(Positions::plane).map(ToOwned::to_owned),
        metric: kind.metric,
        descriptor: kind.recipe,
        post: kind.post.as_deref().map(Post::steps).unwrap_or_default(),
        learned: kind.learned.as_deref().and_then(|recipe| serde_json::from_str(recipe).ok()),
        image_size: kind.image_size,
    }
}

/// The properties of a map that its file's header holds.
pub(super) struct Head {
    pub(super) entry: Entry,
    pub(super) dtype: Dtype,
    pub(super) places: usize,
    pub(super) dim: usize,
    /// The bytes of the rows in the file.
    pub(super) rows: Range<usize>,
    pub(super) pictures: Option<PictureSpan>,
}

/// The thumbnails in a file.
#[derive(Clone)]
pub(super) struct PictureSpan {
    /// Width and height of each.
    pub(super) size: (usize, usize),
    /// Their bytes.
    pub(super) span: Range<usize>,
}

/// A map without its rows.
pub(super) struct Parts {
    pub(super) kind: Kind,
    pub(super) places: usize,
    pub(super) positions: Option<Positions>,
    pub(super) norms: Option<Vec<f64>>,
    pub(super) names: Option<Names>,
    pub(super) segments: Segments,
    pub(super) thumbnails: Option<Thumbnails>,
    /// The places that show nothing, if the file says so.
    blank: Option<Arc<[usize]>>,
    /// Whether there are several traverses.
    pub(super) several: bool,
    /// They come with their rows.
    pub(super) traverses: Traverses,
}

impl Head {
    pub(super) fn of(header: &Header) -> Result<Self, Refusal> {
        let entry: Entry = header.entry()?;
        let foreign = |reason: &str| Err(Refusal::Foreign(reason.to_owned()));
        let Some(rows) = header.info(ROWS) else {
            return foreign("descriptors: expected a tensor of that name, got none");
        };
        let &[_, dim] = rows.shape.as_slice() else {
            return Err(misfit(ROWS, "a tensor (places, dim)", rows));
        };
        let dtype = memory_dtype(rows.dtype).filter(|&dtype| match entry.descriptor {
            Recipe::Sad(sad) => {
                (sad.dtype(), sad.dim(), Metric::Manhattan) == (dtype, dim, entry.metric)
            }
            Recipe::Ready => true,
        });
        let Some(dtype) = dtype else {
            let expected = "a tensor of F32, F16, I8 or U8, as the descriptor's recipe has it";
            return Err(misfit(ROWS, expected, rows));
        };
        let span = header.span(rows);
        let places = count_places(span.len() / dtype.size(), dim)?;
        let ready = entry.descriptor == Recipe::Ready;
        if entry.post.len() > MAX_STEPS {
            return foreign(&format!(
                "post-processing: expected at most {MAX_STEPS} steps, got {}",
                entry.post.len()
            ));
        }
        if !entry.post.is_empty() && (dtype != Dtype::F32 || !ready) {
            return foreign("post-processing: expected ready descriptors of F32");
        }
        if entry.learned.as_ref().is_some_and(|learned| !ready || !is_recipe(learned)) {
            return foreign("learned: expected an object with a name, beside ready descriptors");
        }
        let pictures = match header.info(THUMBNAILS) {
            None => None,
            Some(info) => match info.shape[..] {
                [count, height, width]
                    if info.dtype == FileDtype::U8 && count == places && height * width > 0 =>
                {
                    Some(PictureSpan { size: (width, height), span: header.span(info) })
                }
                _ => {
                    let expected = format!("a tensor of U8 ({places}, height, width)");
                    return Err(misfit(THUMBNAILS, &expected, info));
                }
            },
        };
        Ok(Self { entry, dtype, places, dim, rows: span, pictures })
    }

    /// The tensors other than the rows.
    pub(super) fn parts(self, tensors: &Tensors<'_>) -> Result<Parts, Refusal> {
        let Self { entry, dtype, places, dim, .. } = self;
        let expected = format!("({places}, 2) or ({places}, 3), a row for each place");
        let positions = tensors.numbers("positions", &expected, |shape| {
            shape == [places, 2] || shape == [places, 3]
        })?;
        let positions =
            positions.map(|(shape, metres)| Positions::new(metres, shape[1])).transpose()?;
        let positions = match (positions, entry.origin, entry.plane) {
            (Some(known), Some((latitude, longitude)), _) => {
                Some(known.with_origin(Origin::new(latitude, longitude)?)?)
            }
            (Some(known), None, Some(name)) => Some(known.with_plane(&name)?),
            (known, _, _) => known,
        };
        let segments = segments_of(tensors, places)?;
        let mut norms = None;
        if entry.metric == Metric::Cosine {
            let expected = format!("({places}), a number for each place");
            norms = tensors.numbers("norms", &expected, |shape| shape == [places])?;
        }
        let norms = norms.map(|(_, norms)| checked_norms(norms)).transpose()?;
        let names = tensors.numbers("names", "(bytes), UTF-8 text", |_| true)?;
        let names = names.map(|(_, bytes)| names_of(bytes, places)).transpose()?;
        let expected = format!("({places}), 0 or 1 for each place");
        let blank = tensors.numbers::<u8>(BLANK, &expected, |shape| shape == [places])?;
        let blank = blank.map(|(_, flags)| {
            let reason = || Refusal::Foreign(format!("{BLANK}: expected {expected}"));
            flagged(&flags).ok_or_else(reason)
        });
        let blank = blank.transpose()?;
        let post = if entry.post.is_empty() {
            None
        } else {
            let stages = entry.post.iter().enumerate();
            let stages = stages.map(|(step, &kind)| stage(tensors, step, kind));
            let stages = stages.collect::<Result<Vec<_>, _>>()?;
            Some(Post::from_fitted(stages, dim).map_err(Refusal::Foreign)?.into())
        };
        let learned = entry.learned.map(|recipe| recipe.to_string().into());
        let (metric, recipe) = (entry.metric, entry.descriptor);
        let image_size = entry.image_size.filter(|&(width, height)| width > 0 && height > 0);
        let kind = Kind { dim, dtype, metric, recipe, post, learned, image_size };
        let several = tensors.header.info(TRAVERSES).is_some();
        Ok(Parts {
            kind,
            places,
            positions,
            norms,
            names,
            segments,
            thumbnails: None,
            blank,
            several,
            traverses: Traverses::first_of(tensors)?,
        })
    }
}

/// Whether a map has a tensor of this name beside its rows and thumbnails.
pub(super) fn is_part(name: &str) -> bool {
    let known = ["positions", "norms", "names", "breaks", "closed", "links", BLANK];
    let prefixes = ["post.", "traverse."];
    known.contains(&name) || prefixes.iter().any(|prefix| name.starts_with(prefix))
}

impl Parts {
    /// The parts of the map in a file, whose rows and thumbnails are only hashed, for the checksum;
    /// the byte at which rows begin; the thumbnails; and whether there is a checksum.
    pub(super) fn read(file: &File) -> Result<(Self, u64, Option<PictureSpan>, bool), Refusal> {
        let reader = Reader::new(file, file.metadata()?.len(), &FORMAT)?;
        let head = Head::of(&reader.header)?;
        let (start, pictures) = (head.rows.start as u64, head.pictures.clone());
        let signed = reader.header.is_signed();
        let parts = head.parts(&reader.tensors(is_part, ROWS, None)?)?;
        Ok((parts, start, pictures, signed))
    }

    /// The map of these parts. Norms are those of the file, so that the same file gives the same
    /// bits read and mapped; `own` if it has none.
    pub(super) fn map(self, rows: Storage, own: &[f64]) -> Map {
        let mut map = Map::of(rows, self.norms.as_deref().unwrap_or(own), self.kind);
        let route = Arc::make_mut(&mut map.route);
        (route.positions, route.names) = (self.positions, self.names);
        (route.segments, route.thumbnails) = (self.segments, self.thumbnails);
        route.traverses = self.traverses;
        if let Some(blank) = self.blank {
            map.blank = OnceBox::with_value(Box::new(blank));
        }
        map
    }
}

/// One step of the post-processing.
fn stage(tensors: &Tensors<'_>, step: usize, kind: Step) -> Result<FittedStep, Refusal> {
    let vector = |part| {
        let name = format!("post.{step}.{part}");
        let vector = tensors.numbers(&name, "of 1 axis", |shape| shape.len() == 1)?;
        Ok::<_, Refusal>(vector.map(|(_, numbers)| numbers).unwrap_or_default())
    };
    let mut stage = FittedStep::new(kind);
    (stage.offset, stage.scale) = (vector("offset")?, vector("scale")?);
    let name = format!("post.{step}.matrix");
    let rows = stage.output(0);
    let expected = format!("({rows}, n), as the step gives {rows} numbers");
    let fits = |shape: &[usize]| shape.len() == 2 && (shape[0] == rows || rows == 0);
    let matrix = tensors.numbers(&name, &expected, fits)?;
    stage.matrix = matrix.map(|(_, numbers)| numbers).unwrap_or_default();
    Ok(stage)
}

fn names_of(bytes: Vec<u8>, places: usize) -> Result<Names, Refusal> {
    let count = bytes.len();
    let names = Names::from_bytes(bytes).ok_or_else(|| {
        Refusal::Foreign(format!("names: expected UTF-8 text, got {count} bytes of none"))
    })?;
    if names.len() != places {
        let (expected, got) = (places, names.len());
        return Err(Error::Length { what: "names", expected, got }.into());
    }
    Ok(names)
}

/// Norms of rows, none of which holds a NaN or only zeros.
pub(super) fn checked_norms(norms: Vec<f64>) -> Result<Vec<f64>, Refusal> {
    match norms.iter().position(|norm| !(norm.is_finite() && *norm > 0.0)) {
        None => Ok(norms),
        Some(row) => {
            let got = norms[row];
            let reason = format!("norms: expected finite numbers above 0, got {got} at row {row}");
            Err(Refusal::Foreign(reason))
        }
    }
}

fn misfit(what: &str, expected: &str, info: &TensorInfo) -> Refusal {
    let got = format!("{:?} {:?}", info.dtype, info.shape);
    Refusal::Foreign(format!("{what}: expected {expected}, got {got}"))
}

pub(super) fn file_dtype(dtype: Dtype) -> FileDtype {
    match dtype {
        Dtype::F32 => FileDtype::F32,
        Dtype::F16 => FileDtype::F16,
        Dtype::I8 => FileDtype::I8,
        Dtype::U8 => FileDtype::U8,
    }
}

fn memory_dtype(dtype: FileDtype) -> Option<Dtype> {
    [Dtype::F32, Dtype::F16, Dtype::I8, Dtype::U8].into_iter().find(|&d| file_dtype(d) == dtype)
}
