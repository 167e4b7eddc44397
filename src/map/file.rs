//! A map's file, an [`archive`](crate::archive): saved, built from images, read, or mapped into
//! memory.

use std::cell::RefCell;
use std::io::{self, Read};
use std::path::Path;
#[cfg(feature = "mmap")]
use std::sync::Arc;

use super::blank::Census;
#[cfg(feature = "mmap")]
use super::block::Blocks;
use super::block::lengths;
#[cfg(feature = "mmap")]
use super::contents::checked_norms;
use super::contents::{FORMAT, Head, ROWS, Sidecar, THUMBNAILS, contents, entry, is_part};
use super::extras::Extras;
use super::positions::Positions;
use super::recipe::Kind;
use super::route::Names;
use super::storage::Storage;
use super::thumbnails::{Pictures, Seen, Spool, Thumbnails};
use super::traverses_file::{self, TraverseParts};
use super::{Map, Recipe, at_least_two};
use crate::archive::{AtomicFile, Reader, Refusal, Sink, swap_to_file_order};
#[cfg(feature = "mmap")]
use crate::archive::{Tensors, verify};
use crate::descriptor::{DescriberPool, Sad};
use crate::distance::Metric;
#[cfg(feature = "mmap")]
use crate::dtype::Dtype;
use crate::error::Error;
use crate::image::{ImageSource, Progress};
use crate::numbers::{Values, View};
use crate::regular;

/// The largest relative difference between a norm in a file and that of its row: far above
/// rounding, far below damage.
const NORM_ERROR: f64 = 1e-6;

const WRITE: &str = "write the map";

/// Begins a map's file, so that no other writer can.
pub(super) fn begin(path: &Path) -> Result<AtomicFile, Error> {
    let failed = |source| Error::Io { path: path.to_owned(), action: WRITE, source };
    AtomicFile::new(path).map_err(failed)
}

/// Writes the map's file that was begun for `path`. `rows` gives the places that show nothing.
pub(super) fn write(
    (file, path): (AtomicFile, &Path),
    kind: &Kind,
    sidecar: Sidecar<'_>,
    rows: impl FnOnce(&mut Sink<'_>) -> Result<Vec<usize>, Error>,
) -> Result<(), Error> {
    let entry = entry(kind, sidecar.positions.first().copied());
    contents(kind, sidecar, rows).save(file, path, WRITE, &FORMAT, &entry)
}

impl Map {
    /// Saves the map as one safetensors file with everything that it takes to use it. The file is
    /// written beside its place and then renamed: there is never half a file, and an old one stays
    /// until the new one is whole. So a mapped map can be saved to its own file. Symbolic links
    /// stay, and so does the mode of an old file. While another process or thread writes the file,
    /// it is an error that names that one.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        self.save_as(begin(path.as_ref())?, path.as_ref())
    }

    pub(super) fn save_as(&self, file: AtomicFile, path: &Path) -> Result<(), Error> {
        let rows = |out: &mut Sink<'_>| {
            self.write_rows(out)?;
            Ok(self.blank_rows().to_vec())
        };
        write((file, path), &self.kind, self.sidecar(), rows)
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
        let rows = |out: &mut Sink<'_>| {
            self.write_rows(out)?;
            Ok(self.blank_rows().to_vec())
        };
        contents(&self.kind, self.sidecar(), rows)
            .to_bytes(&FORMAT, &entry(&self.kind, self.positions()))
            .map_err(|error| Refusal::Foreign(error.to_string()).of_map(in_memory()))
    }

    pub(super) fn sidecar(&self) -> Sidecar<'_> {
        Sidecar {
            places: self.places(),
            positions: self.route.positions.iter().collect(),
            norms: self.blocks.iter().map(|block| block.norms()).collect(),
            names: self.route.names.iter().collect(),
            segments: self.segments().clone(),
            pictures: self.thumbnails().map(Pictures::of),
            traverses: Some(&self.route.traverses),
        }
    }

    pub(super) fn write_rows(&self, out: &mut Sink<'_>) -> Result<(), Error> {
        let size = self.dtype().size();
        self.blocks.iter().try_for_each(|block| out.numbers(block.rows().bytes(), size))
    }

    /// Describes a traverse's images straight into a file: the bytes that
    /// [`from_images`](Self::from_images) and [`save`](Self::save) would write, in the memory of
    /// one image for each core. If it fails or is stopped, an old file stays as it was and no other
    /// file is left.
    ///
    /// ```
    /// use surefix_simulate::{Conditions, Route, RouteConfig};
    /// use surefix::{Map, Sad, quiet};
    /// let config = RouteConfig { places: 20, width: 64, height: 32, ..RouteConfig::default() };
    /// let route = Route::new(config)?;
    /// let drive = route.traverse(Conditions::reference())?;
    /// let folder = tempfile::tempdir().unwrap();
    /// let path = folder.path().join("route.safetensors");
    /// Map::build(&path, &drive, Sad::default(), None, &mut quiet)?;
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
        Self::build_with(path, images, sad, Extras::default().with(positions), progress)
    }

    /// [`build`](Self::build) with segments and thumbnails.
    ///
    /// # Errors
    /// As for [`build`](Self::build), and [`Error::Length`] unless `extras` has segments of the
    /// number of images; before any image is read.
    pub fn build_with(
        path: impl AsRef<Path>,
        images: &(impl ImageSource + ?Sized),
        sad: Sad,
        extras: Extras<'_>,
        progress: Progress<'_>,
    ) -> Result<(), Error> {
        let places = at_least_two(images.len())?;
        let segments = extras.check(places)?.into_owned();
        let path = path.as_ref();
        let io = |source| Error::Io { path: path.to_owned(), action: WRITE, source };
        // Before any image is read.
        let file = begin(path)?;
        let names = Names::new((0..places).map(|index| images.name(index)))?;
        let pool = DescriberPool::of_map(sad, images)?;
        let (metric, recipe) = (Metric::Manhattan, Recipe::Sad(pool.sad()));
        let (dim, dtype, image_size) = (sad.dim(), sad.dtype(), pool.size());
        let kind = Kind { dim, dtype, metric, recipe, post: None, learned: None, image_size };
        let size = extras.picture_size(pool.first_size());
        let seen = size.map(|size| Seen::new(images, pool.sad().levels(), size));
        // They come after the rows in the file.
        let spool = seen.is_some().then(|| Spool::beside(path)).transpose().map_err(io)?;
        let spool = RefCell::new(spool);
        let pictures = size.map(|size| Pictures {
            size,
            write: Box::new(|out: &mut Sink<'_>| match spool.take() {
                Some(spool) => spool.write(out, io),
                None => Ok(()),
            }),
        });
        let positions = extras.positions.into_iter().collect();
        let (names, norms) = (vec![&names], Vec::new());
        let traverses = None;
        let sidecar = Sidecar { places, segments, positions, norms, names, pictures, traverses };
        write((file, path), &kind, sidecar, |out| {
            let mut census = Census::new(&kind);
            let mut done = 0;
            let mut take = |rows: View<'_>| {
                census.add(rows);
                done += rows.len() / dim;
                if let (Some(seen), Some(spool)) = (&seen, &mut *spool.borrow_mut()) {
                    spool.add(seen.take(done)).map_err(io)?;
                }
                out.numbers(rows.bytes(), dtype.size())
            };
            match &seen {
                Some(seen) => {
                    DescriberPool::new(&pool.sad(), seen)?.describe_each(progress, &mut take)?;
                }
                None => pool.describe_each(progress, &mut take)?,
            }
            Ok(census.places())
        })
    }

    /// Opens a map that [`save`](Self::save) wrote: reads it into memory, and compares its
    /// checksum.
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
    /// No row is read in advance, so damage that [`open`](Self::open) would refuse is found late,
    /// or by [`verify`](Self::verify): a NaN or an infinity in a row makes the distance to its
    /// place one, and [`Localizer`](crate::Localizer) refuses that frame and names the place. Three
    /// things read the whole file once: the first snapshot of a localizer, which identifies the map
    /// by a hash; opening a map for the cosine whose file has no `norms`; and
    /// [`blank`](Self::blank), which a localizer asks for, if the file has no such list.
    ///
    /// # Safety
    /// As long as the map or a clone of it lives, no process may change the file or make it
    /// shorter. If it is shortened, the next access to the rows ends the program (SIGBUS on Unix);
    /// if it is changed, numbers change under references that Rust takes for constant, which is
    /// undefined behaviour. To put another file in its place, as [`save`](Self::save) does, is
    /// safe.
    ///
    /// # Errors
    /// As for [`open`](Self::open), and [`Error::MapFile`] if the rows are not aligned for their
    /// type or the machine is big-endian: such a file can only be read into memory.
    #[cfg(feature = "mmap")]
    #[allow(unsafe_code)]
    pub unsafe fn open_mapped(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let io = |source| Error::Io { path: path.to_owned(), action: "map the file", source };
        let (file, _) = regular::open(path).map_err(io)?;
        // SAFETY: the caller has promised that the file stays as it is.
        let mapping = unsafe { memmap2::Mmap::map(&file) }.map_err(io)?;
        of_mapping(mapping).map_err(|refusal| refusal.of_map(path))
    }

    /// Checks a map whose rows are mapped from a file: the checksum over all bytes of the file,
    /// that all numbers are finite, and that norms are those of their rows. It reads the whole
    /// file. A map in memory was checked when it was made or opened.
    ///
    /// # Errors
    /// [`Error::MapFile`] if the file is damaged. Its path is `<mapped>`.
    #[cfg(feature = "mmap")]
    pub fn verify(&self) -> Result<(), Error> {
        let files: Vec<_> = self.all_blocks().flat_map(Blocks::mapped_files).collect();
        if files.is_empty() {
            return Ok(());
        }
        let checked = files.into_iter().try_for_each(|file| verify(file, &FORMAT));
        let checked = checked.and_then(|()| {
            for blocks in self.all_blocks() {
                blocks.check_finite(ROWS)?;
                let mut first = 0;
                for block in blocks.iter() {
                    let lengths = lengths(block.rows(), self.dim(), self.metric())?;
                    check_norms(block.norms(), &lengths, first)?;
                    first += block.rows().len() / self.dim();
                }
            }
            Ok(())
        });
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
    let (file, length) = regular::open(path)?;
    read(file, length)
}

/// Reads a map from `length` bytes, its rows straight to the memory where they stay.
fn read(from: impl Read, length: u64) -> Result<Map, Refusal> {
    let reader = Reader::new(from, length, &FORMAT)?;
    let head = Head::of(&reader.header)?;
    let (size, dim, metric) = (head.dtype.size(), head.dim, head.entry.metric);
    let rows = Storage::try_zeros(head.dtype, head.places * dim);
    let mut rows = rows.ok_or_else(|| io::Error::from(io::ErrorKind::OutOfMemory))?;
    let wanted = |name: &str| is_part(name) || name == THUMBNAILS;
    let mut tensors = reader.tensors(wanted, ROWS, Some(rows.bytes_mut()))?;
    swap_to_file_order(rows.bytes_mut(), size);
    let pictures = head.pictures.clone();
    let further = TraverseParts::of(&head, &tensors)?;
    let mut parts = head.parts(&tensors)?;
    let more = TraverseParts::storage(parts.kind.dtype, tensors.bytes(traverses_file::ROWS))?;
    parts.traverses = further.with_rows(more, (dim, metric), false)?;
    parts.thumbnails = pictures.map(|pictures| {
        let pixels = Values::U8(tensors.take(THUMBNAILS));
        Thumbnails::of(pictures.size, pixels.into())
    });
    rows.view().check_finite(ROWS, dim)?;
    let own = lengths(rows.view(), dim, metric)?;
    if let Some(norms) = &parts.norms {
        check_norms(norms, &own, 0)?;
    }
    Ok(Map { checksum: tensors.checksum, ..parts.map(rows, &own) })
}

/// Refuses norms that are not the lengths of their rows, of which the first is row `first`.
pub(super) fn check_norms(norms: &[f64], lengths: &[f64], first: usize) -> Result<(), Refusal> {
    let fits = |(stored, norm): (&f64, &f64)| (stored - norm).abs() <= NORM_ERROR * norm;
    let Some(at) = norms.iter().zip(lengths).position(|pair| !fits(pair)) else { return Ok(()) };
    let (row, got, expected) = (first + at, norms[at], lengths[at]);
    let reason = format!("norms: expected {expected}, the length of row {row}, got {got}");
    Err(Refusal::Foreign(reason))
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
    let pictures = head.pictures.clone();
    let further = TraverseParts::of(&head, &tensors)?;
    let mut parts = head.parts(&tensors)?;
    let checksum = tensors.checksum;
    drop(tensors);
    let mapping = Arc::new(mapping);
    parts.thumbnails = pictures.and_then(|pictures| {
        let pixels = Storage::mapped(Arc::clone(&mapping), pictures.span, Dtype::U8)?;
        Some(Thumbnails::of(pictures.size, pixels))
    });
    let more = Some(further.rows.clone()).filter(|rows| !rows.is_empty());
    let (from, size) = (span.start, dtype.size());
    let aligned = || foreign(format!("its rows begin at byte {from}, no multiple of {size}"));
    let more =
        more.map(|rows| Storage::mapped(Arc::clone(&mapping), rows, dtype).ok_or_else(aligned));
    parts.traverses = further.with_rows(more.transpose()?, (dim, metric), true)?;
    let rows = Storage::mapped(mapping, span, dtype).ok_or_else(aligned)?;
    let own = if parts.norms.is_none() {
        checked_norms(lengths(rows.view(), dim, metric)?)?
    } else {
        Vec::new()
    };
    Ok(Map { checksum, ..parts.map(rows, &own) })
}
