//! Saving a map, and opening one: read into memory, or mapped.

#[cfg(feature = "mmap")]
use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Cursor, Read};
use std::path::Path;

use super::beside::{swap_to_file_order, write_beside};
use super::layout::{Layout, Refusal};
use super::names::Names;
#[cfg(feature = "mmap")]
use super::parts::checked_norms;
use super::parts::{Part, Small};
use super::storage::Storage;
use super::{Map, Positions};
use crate::error::Error;

/// How far the norms of a file may be from those of its rows: rounding is far below, damage above.
const NORM_ERROR: f64 = 1e-6;

impl Map {
    /// Saves the map as one safetensors file that carries all that is needed to use it. The file is
    /// written beside its place and then renamed: there is never half a file, and an old one stays
    /// until the new one is whole. So a mapped map can be saved onto its own file.
    ///
    /// # Errors
    /// [`Error::Io`] where the file cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let path = path.as_ref();
        write_beside(path, |out| {
            out.head(&self.layout())?;
            out.floats(self.positions().map_or(&[], Positions::metres))?;
            out.floats(&self.norms)?;
            out.vectors_of_post(self.post())?;
            out.numbers(self.descriptors().bytes(), self.dtype().size())?;
            out.matrices_of_post(self.post())?;
            out.bytes(self.names.as_ref().map_or(&[], Names::bytes))
        })
    }

    /// Opens a map that [`save`](Self::save) wrote: reads it into memory, straight to where its
    /// rows stay.
    ///
    /// # Errors
    /// [`Error::Io`] where the file cannot be read, [`Error::MapFile`] where it is not a map or a
    /// damaged one, [`Error::MapVersion`] where a newer version of the library wrote it.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        read_file(path).map_err(|refusal| refusal.of(path))
    }

    /// Opens a map without reading its rows: they are mapped into memory, and the system reads what
    /// is used, when it is used. A map of gigabytes is open in milliseconds, and processes that
    /// open the same one share its memory.
    ///
    /// Nothing looks at all rows, so numbers that [`open`](Self::open) would refuse are found late:
    /// a NaN or an infinity in a row makes the distance to its place one, and
    /// [`Localizer`](crate::Localizer) refuses that frame and names the place. Two things read the
    /// whole file once: the first snapshot of a localizer, which identifies the map by a hash, and
    /// opening a map for the cosine that a version without `norms` in its files wrote.
    ///
    /// # Safety
    /// As long as the map or a clone of it lives, nobody may change the file or make it shorter, in
    /// this process or in another. Where it is shortened, the next look at the rows ends the
    /// program (SIGBUS on Unix); where it is changed, numbers change under references that Rust
    /// takes for constant, which is undefined behaviour. To put another file in its place, as
    /// [`save`](Self::save) does, is safe.
    ///
    /// # Errors
    /// As for [`open`](Self::open), and [`Error::MapFile`] where the rows are not aligned for their
    /// type or the machine is big-endian: such a file can only be read into memory.
    #[cfg(feature = "mmap")]
    #[allow(unsafe_code)]
    pub unsafe fn open_mapped(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let io = |source| Error::Io { path: path.to_owned(), action: "map the file", source };
        let file = File::open(path).map_err(io)?;
        // SAFETY: that the file stays as it is, the caller has promised.
        let mapping = unsafe { memmap2::Mmap::map(&file) }.map_err(io)?;
        of_mapping(mapping).map_err(|refusal| refusal.of(path))
    }
}

fn read_file(path: &Path) -> Result<Map, Refusal> {
    let mut file = File::open(path)?;
    let about = file.metadata()?;
    if about.is_file() {
        return read(file, about.len());
    }
    // A pipe, for one, does not say how long it is.
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    let length = bytes.len() as u64;
    read(Cursor::new(bytes), length)
}

/// Reads a map from the start of a file of `length` bytes, one part after the other.
fn read(mut from: impl Read, length: u64) -> Result<Map, Refusal> {
    let (layout, _) = Layout::read(&mut from, length)?;
    let mut small = Small::default();
    let mut rows = zeros(&layout)?;
    let mut at = 0;
    for (part, span) in layout.parts() {
        let before = (span.start - at) as u64;
        io::copy(&mut from.by_ref().take(before), &mut io::sink())?;
        match part {
            Part::Rows => {
                from.read_exact(rows.bytes_mut())?;
                swap_to_file_order(rows.bytes_mut(), layout.dtype.size());
            }
            part => {
                let mut bytes = vec![0; span.len()];
                from.read_exact(&mut bytes)?;
                small.take(&layout, part, bytes.into())?;
            }
        }
        at = span.end;
    }
    let mut map = Map::assemble(rows, layout.dim, layout.metric, layout.recipe)?;
    if let Some(norms) = small.norms.take() {
        let fits = |(stored, norm): (&f64, &f64)| (stored - norm).abs() <= NORM_ERROR * norm;
        if let Some(row) = norms.iter().zip(&map.norms).position(|pair| !fits(pair)) {
            let (got, expected) = (norms[row], map.norms[row]);
            let reason = format!("norms: expected {expected}, the length of row {row}, got {got}");
            return Err(Refusal::Foreign(reason));
        }
        // Those of the file, so that the same map mapped gives the same bits.
        map.norms = norms;
    }
    small.finish(&layout, map)
}

/// Room for the rows, or the system's word that there is none.
fn zeros(layout: &Layout) -> Result<Storage, Refusal> {
    let zeros = Storage::try_zeros(layout.dtype, layout.places * layout.dim);
    zeros.ok_or_else(|| io::Error::from(io::ErrorKind::OutOfMemory).into())
}

#[cfg(feature = "mmap")]
fn of_mapping(mapping: memmap2::Mmap) -> Result<Map, Refusal> {
    let foreign = |reason: String| Refusal::Foreign(format!("{reason}: open it into memory"));
    if cfg!(target_endian = "big") {
        return Err(foreign("its numbers are little-endian, and this machine is not".to_owned()));
    }
    let (layout, start) = Layout::read(&mut &mapping[..], mapping.len() as u64)?;
    let start = start as usize;
    let mut small = Small::default();
    for (part, span) in layout.parts() {
        if part != Part::Rows {
            small.take(
                &layout,
                part,
                Cow::Borrowed(&mapping[start + span.start..start + span.end]),
            )?;
        }
    }
    let (from, to) = (start + layout.rows.start, start + layout.rows.end);
    let rows = Storage::mapped(mapping, from..to, layout.dtype);
    let size = layout.dtype.size();
    let rows = rows
        .ok_or_else(|| foreign(format!("its rows begin at byte {from}, no multiple of {size}")))?;
    let norms = match small.norms.take() {
        Some(norms) => norms,
        None => checked_norms(super::lengths(rows.view(), layout.dim, layout.metric)?)?,
    };
    let Layout { places, dim, metric, recipe, .. } = layout;
    small.finish(&layout, Map::of_parts(rows, places, dim, metric, recipe, norms))
}
