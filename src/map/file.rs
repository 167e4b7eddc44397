//! A map's file, an [`archive`](crate::archive): saved, built from images, read, or mapped into
//! memory. Its tensors are listed in [`contents`], in the order of the file.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use safetensors::tensor::{Dtype as FileDtype, TensorInfo};
use serde::{Deserialize, Serialize};

use super::block::lengths;
use super::recipe::{Kind, is_recipe};
use super::route::{Names, Positions};
use super::storage::Storage;
use super::{Map, Recipe, at_least_two, count_places};
#[cfg(feature = "mmap")]
use crate::archive::verify;
use crate::archive::{Format, Header, Reader, Refusal, Sink, Tensors, Writer, swap_to_file_order};
use crate::descriptor::{Sad, describe_each};
use crate::distance::Metric;
use crate::dtype::Dtype;
use crate::error::Error;
use crate::image::{ImageSource, Progress};
use crate::post::{FittedStep, Post, Step};

pub(super) const FORMAT: Format = Format { name: "surefix-map", version: 1 };
/// The largest relative difference between a norm in a file and that of its row: far above
/// rounding, far below damage.
const NORM_ERROR: f64 = 1e-6;
const ROWS: &str = "descriptors";

/// The metadata entry.
#[derive(Serialize, Deserialize)]
struct Entry {
    metric: Metric,
    descriptor: Recipe,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    post: Vec<Step>,
    /// The recipe of a learned descriptor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    learned: Option<serde_json::Value>,
}

/// The contents of a file beside its rows. Each part is written in pieces: those of the old file
/// and those that are appended, for one.
#[derive(Default)]
pub(super) struct Sidecar<'a> {
    pub(super) places: usize,
    pub(super) positions: Vec<&'a Positions>,
    pub(super) norms: Vec<&'a [f64]>,
    pub(super) names: Vec<&'a Names>,
}

/// The tensors of a map's file, in the order of the file: from the strictest alignment to the
/// loosest.
fn contents<'a>(
    kind: &'a Kind,
    sidecar: Sidecar<'a>,
    rows: impl FnOnce(&mut Sink<'_>) -> Result<(), Error> + 'a,
) -> Writer<'a> {
    let Sidecar { places, positions, norms, names } = sidecar;
    let mut writer = Writer::new();
    if let Some(first) = positions.first() {
        let metres = positions.iter().map(|positions| positions.metres()).collect();
        writer.numbers("positions", vec![places, first.axes()], metres);
    }
    if kind.metric == Metric::Cosine {
        writer.numbers("norms", vec![places], norms);
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
    writer.stream(ROWS, file_dtype(kind.dtype), vec![places, kind.dim], rows);
    let mut width = kind.post.as_deref().map_or(0, Post::input);
    for (step, stage) in stages {
        let output = stage.output(width);
        if !stage.matrix.is_empty() {
            let name = format!("post.{step}.matrix");
            writer.numbers(name, vec![output, width], vec![stage.matrix.as_slice()]);
        }
        width = output;
    }
    if !names.is_empty() {
        let texts: Vec<_> = names.into_iter().map(Names::bytes).collect();
        writer.numbers("names", vec![texts.iter().map(|text| text.len()).sum()], texts);
    }
    writer
}

fn entry(kind: &Kind) -> Entry {
    Entry {
        metric: kind.metric,
        descriptor: kind.recipe,
        post: kind.post.as_deref().map(Post::steps).unwrap_or_default(),
        learned: kind.learned.as_deref().and_then(|recipe| serde_json::from_str(recipe).ok()),
    }
}

/// Writes a map's file.
pub(super) fn write(
    path: &Path,
    kind: &Kind,
    sidecar: Sidecar<'_>,
    rows: impl FnOnce(&mut Sink<'_>) -> Result<(), Error>,
) -> Result<(), Error> {
    contents(kind, sidecar, rows).save(path, "write the map", &FORMAT, &entry(kind))
}

impl Map {
    /// Saves the map as one safetensors file with everything that it takes to use it. The file is
    /// written beside its place and then renamed: there is never half a file, and an old one stays
    /// until the new one is whole. So a mapped map can be saved to its own file. Symbolic links
    /// stay, and so does the mode of an old file.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        write(path.as_ref(), &self.kind, self.sidecar(), |out| self.write_rows(out))
    }

    /// The bytes of the file that [`save`](Self::save) writes.
    ///
    /// ```
    /// use surefix::{Map, Metric};
    /// let map = Map::from_descriptors(vec![0_u8, 1, 2, 3], 2, Metric::Euclidean)?;
    /// assert_eq!(Map::from_bytes(&map.to_bytes()?)?.descriptors(), map.descriptors());
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::MapFile`] if there is no such file: its header would be too long.
    pub fn to_bytes(&self) -> Result<Vec<u8>, Error> {
        let rows = |out: &mut Sink<'_>| self.write_rows(out);
        contents(&self.kind, self.sidecar(), rows)
            .to_bytes(&FORMAT, &entry(&self.kind))
            .map_err(|error| Refusal::Foreign(error.to_string()).of_map(in_memory()))
    }

    pub(super) fn sidecar(&self) -> Sidecar<'_> {
        Sidecar {
            places: self.places(),
            positions: self.route.positions.iter().collect(),
            norms: self.blocks.iter().map(|block| block.norms()).collect(),
            names: self.route.names.iter().collect(),
        }
    }

    pub(super) fn write_rows(&self, out: &mut Sink<'_>) -> Result<(), Error> {
        let size = self.dtype().size();
        self.blocks.iter().try_for_each(|block| out.numbers(block.rows().bytes(), size))
    }

    /// Describes a traverse's images straight into a file: the bytes that
    /// [`from_images`](Self::from_images) and [`save`](Self::save) would write, in the memory of one
    /// image for each core. If it fails or is stopped, an old file stays as it was and no other
    /// file is left.
    ///
    /// ```
    /// use std::ops::ControlFlow;
    /// use surefix_simulate::{Conditions, Route, RouteConfig};
    /// use surefix::{Map, Sad};
    /// let route = Route::new(RouteConfig { places: 20, width: 64, height: 32, ..RouteConfig::default() })?;
    /// let drive = route.traverse(Conditions::reference())?;
    /// let folder = tempfile::tempdir().unwrap();
    /// let path = folder.path().join("route.safetensors");
    /// Map::build(&path, &drive, Sad::default(), None, &mut |_done, _total| ControlFlow::Continue(()))?;
    /// assert_eq!(Map::open(&path)?.places(), 20);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// As for [`from_images`](Self::from_images); [`Error::Length`] unless there is a position for
    /// each image, [`Error::Io`] if the file cannot be written.
    pub fn build(
        path: impl AsRef<Path>,
        images: &(impl ImageSource + ?Sized),
        sad: Sad,
        positions: Option<&Positions>,
        progress: Progress<'_>,
    ) -> Result<(), Error> {
        let places = at_least_two(images.len())?;
        let got = positions.map_or(places, Positions::len);
        if got != places {
            return Err(Error::Length { what: "positions", expected: places, got });
        }
        let names = Names::new((0..places).map(|index| images.name(index)))?;
        let (metric, recipe) = (Metric::Manhattan, Recipe::Sad(sad));
        let (dim, dtype) = (sad.dim(), sad.dtype());
        let kind = Kind { dim, dtype, metric, recipe, post: None, learned: None };
        let positions = positions.into_iter().collect();
        let sidecar = Sidecar { places, positions, norms: Vec::new(), names: vec![&names] };
        write(path.as_ref(), &kind, sidecar, |out| {
            describe_each(&sad, images, progress, |rows| out.numbers(rows, dtype.size()))
        })
    }

    /// Opens a map that [`save`](Self::save) wrote: reads it into memory, and compares its checksum.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read, [`Error::MapFile`] if it is not a map or a damaged
    /// one, [`Error::MapVersion`] if a newer version of the library wrote it.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        read_file(path).map_err(|refusal| refusal.of_map(path))
    }

    /// Opens a map whose file lies in memory. Its rows are copied.
    ///
    /// # Errors
    /// As for [`open`](Self::open); their path is `<bytes>`.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        read(bytes, bytes.len() as u64).map_err(|refusal| refusal.of_map(in_memory()))
    }

    /// Opens a map without reading its rows: they are mapped into memory, and the system reads the
    /// ones that are used, when they are used. A map of gigabytes is open in milliseconds, and
    /// processes that open the same one share its memory.
    ///
    /// No row is read in advance, so damage that [`open`](Self::open) would refuse is found late, or
    /// by [`verify`](Self::verify): a NaN or an infinity in a row makes the distance to its place
    /// one, and [`Localizer`](crate::Localizer) refuses that frame and names the place. Two things
    /// read the whole file once: the first snapshot of a localizer, which identifies the map by a
    /// hash, and opening a map for the cosine whose file has no `norms`.
    ///
    /// # Safety
    /// As long as the map or a clone of it lives, no process may change the file or make it shorter.
    /// If it is shortened, the next access to the rows ends the program (SIGBUS on Unix); if it is
    /// changed, numbers change under references that Rust takes for constant, which is undefined
    /// behaviour. To put another file in its place, as [`save`](Self::save) does, is safe.
    ///
    /// # Errors
    /// As for [`open`](Self::open), and [`Error::MapFile`] if the rows are not aligned for their
    /// type or the machine is big-endian: such a file can only be read into memory.
    #[cfg(feature = "mmap")]
    #[allow(unsafe_code)]
    pub unsafe fn open_mapped(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let io = |source| Error::Io { path: path.to_owned(), action: "map the file", source };
        let file = File::open(path).map_err(io)?;
        // SAFETY: the caller has promised that the file stays as it is.
        let mapping = unsafe { memmap2::Mmap::map(&file) }.map_err(io)?;
        of_mapping(mapping).map_err(|refusal| refusal.of_map(path))
    }

    /// Checks a map whose rows are mapped from a file: the checksum over all bytes of the file, and
    /// that all numbers are finite. It reads the whole file. A map in memory was checked when it was
    /// made or opened.
    ///
    /// # Errors
    /// [`Error::MapFile`] if the file is damaged. Its path is `<mapped>`.
    #[cfg(feature = "mmap")]
    pub fn verify(&self) -> Result<(), Error> {
        let files = self.blocks.mapped_files();
        if files.is_empty() {
            return Ok(());
        }
        let checked = files.into_iter().try_for_each(|file| verify(file, &FORMAT));
        let checked = checked.and_then(|()| Ok(self.blocks.check_finite(ROWS)?));
        checked.map_err(|refusal| refusal.of_map(Path::new("<mapped>")))
    }
}

fn in_memory() -> &'static Path {
    Path::new("<bytes>")
}

impl Refusal {
    /// The error for a map's file.
    pub(super) fn of_map(self, path: &Path) -> Error {
        let path = path.to_owned();
        match self {
            Self::Foreign(reason) => Error::MapFile { path, reason },
            Self::Newer { found, supported } => Error::MapVersion { path, found, supported },
            Self::Io(source) => Error::Io { path, action: "read the map", source },
        }
    }
}

fn read_file(path: &Path) -> Result<Map, Refusal> {
    let mut file = File::open(path)?;
    let about = file.metadata()?;
    if about.is_file() {
        return read(file, about.len());
    }
    // A pipe, for one, has no length in advance.
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    read(&bytes[..], bytes.len() as u64)
}

/// Reads a map from `length` bytes, its rows straight to the memory where they stay.
fn read(from: impl Read, length: u64) -> Result<Map, Refusal> {
    let reader = Reader::new(from, length, &FORMAT)?;
    let head = Head::of(&reader.header)?;
    let (size, dim, metric) = (head.dtype.size(), head.dim, head.entry.metric);
    let rows = Storage::try_zeros(head.dtype, head.places * dim);
    let mut rows = rows.ok_or_else(|| io::Error::from(io::ErrorKind::OutOfMemory))?;
    let tensors = reader.tensors(ROWS, Some(rows.bytes_mut()))?;
    swap_to_file_order(rows.bytes_mut(), size);
    let parts = head.parts(&tensors)?;
    rows.view().check_finite(ROWS, dim)?;
    let own = lengths(rows.view(), dim, metric)?;
    if let Some(norms) = &parts.norms {
        let fits = |(stored, norm): (&f64, &f64)| (stored - norm).abs() <= NORM_ERROR * norm;
        if let Some(row) = norms.iter().zip(&own).position(|pair| !fits(pair)) {
            let (got, expected) = (norms[row], own[row]);
            let reason = format!("norms: expected {expected}, the length of row {row}, got {got}");
            return Err(Refusal::Foreign(reason));
        }
    }
    Ok(parts.map(rows, &own))
}

#[cfg(feature = "mmap")]
fn of_mapping(mapping: memmap2::Mmap) -> Result<Map, Refusal> {
    let foreign = |reason: String| Refusal::Foreign(format!("{reason}: open it into memory"));
    if cfg!(target_endian = "big") {
        return Err(foreign("its numbers are little-endian, and this machine is not".to_owned()));
    }
    let tensors = Tensors::borrowed(&mapping, &FORMAT)?;
    let head = Head::of(&tensors.header)?;
    let (dtype, dim, metric, span) = (head.dtype, head.dim, head.entry.metric, head.rows.clone());
    let parts = head.parts(&tensors)?;
    drop(tensors);
    let (from, size) = (span.start, dtype.size());
    let rows = Storage::mapped(mapping, span, dtype)
        .ok_or_else(|| foreign(format!("its rows begin at byte {from}, no multiple of {size}")))?;
    let own = if parts.norms.is_none() {
        checked_norms(lengths(rows.view(), dim, metric)?)?
    } else {
        Vec::new()
    };
    Ok(parts.map(rows, &own))
}

/// The properties of a map that its file's header holds.
struct Head {
    entry: Entry,
    dtype: Dtype,
    places: usize,
    dim: usize,
    /// The bytes of the rows in the file.
    #[cfg_attr(not(feature = "mmap"), expect(dead_code))]
    rows: std::ops::Range<usize>,
}

/// A map without its rows.
pub(super) struct Parts {
    pub(super) kind: Kind,
    pub(super) places: usize,
    pub(super) positions: Option<Positions>,
    pub(super) norms: Option<Vec<f64>>,
    pub(super) names: Option<Names>,
}

impl Head {
    fn of(header: &Header) -> Result<Self, Refusal> {
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
        if !entry.post.is_empty() && (dtype != Dtype::F32 || !ready) {
            return foreign("post-processing: expected ready descriptors of F32");
        }
        if entry.learned.as_ref().is_some_and(|learned| !ready || !is_recipe(learned)) {
            return foreign("learned: expected an object with a name, beside ready descriptors");
        }
        Ok(Self { entry, dtype, places, dim, rows: span })
    }

    /// The tensors other than the rows.
    fn parts(self, tensors: &Tensors<'_>) -> Result<Parts, Refusal> {
        let Self { entry, dtype, places, dim, .. } = self;
        let expected = format!("({places}, 2) or ({places}, 3), a row for each place");
        let positions = tensors.numbers("positions", &expected, |shape| {
            shape == [places, 2] || shape == [places, 3]
        })?;
        let positions =
            positions.map(|(shape, metres)| Positions::new(metres, shape[1])).transpose()?;
        let mut norms = None;
        if entry.metric == Metric::Cosine {
            let expected = format!("({places}), a number for each place");
            norms = tensors.numbers("norms", &expected, |shape| shape == [places])?;
        }
        let norms = norms.map(|(_, norms)| checked_norms(norms)).transpose()?;
        let names = tensors.numbers("names", "(bytes), UTF-8 text", |_| true)?;
        let names = names.map(|(_, bytes)| names_of(bytes, places)).transpose()?;
        let post = if entry.post.is_empty() {
            None
        } else {
            let stages = entry.post.iter().enumerate();
            let stages = stages.map(|(step, &kind)| stage(tensors, step, kind));
            let stages = stages.collect::<Result<_, _>>()?;
            Some(Post::from_fitted(stages, dim).map_err(Refusal::Foreign)?.into())
        };
        let learned = entry.learned.map(|recipe| recipe.to_string().into());
        let (metric, recipe) = (entry.metric, entry.descriptor);
        let kind = Kind { dim, dtype, metric, recipe, post, learned };
        Ok(Parts { kind, places, positions, norms, names })
    }
}

impl Parts {
    /// The parts of the map in a file, whose rows are only hashed, for the checksum; and the byte at
    /// which they begin.
    pub(super) fn read(file: &File) -> Result<(Self, u64), Refusal> {
        let reader = Reader::new(file, file.metadata()?.len(), &FORMAT)?;
        let head = Head::of(&reader.header)?;
        let start = reader.header.info(ROWS).map_or(0, |rows| reader.header.span(rows).start);
        Ok((head.parts(&reader.tensors(ROWS, None)?)?, start as u64))
    }

    /// The map of these parts. Norms are those of the file, so that the same file gives the same
    /// bits read and mapped; `own` if it has none.
    fn map(self, rows: Storage, own: &[f64]) -> Map {
        let mut map = Map::of(rows, self.norms.as_deref().unwrap_or(own), self.kind);
        let route = std::sync::Arc::make_mut(&mut map.route);
        (route.positions, route.names) = (self.positions, self.names);
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
    let matrix = tensors.numbers(&name, "of 2 axes", |shape| shape.len() == 2)?;
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
fn checked_norms(norms: Vec<f64>) -> Result<Vec<f64>, Refusal> {
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

fn file_dtype(dtype: Dtype) -> FileDtype {
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
