//! A map that grows by a place at a time: rows in an open block, full blocks in memory, and blocks
//! in a file.

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::blank::{quieten, shows_nothing};
use super::block::{Block, Blocks, part, rows_of_a_block};
use super::recipe::{Kind, Recipe};
use super::route::Route;
use super::{Map, Storage, at_least_two};
use crate::distance::{self, Metric, Query};
use crate::dtype::Dtype;
use crate::error::Error;
use crate::numbers::View;
use crate::segments::Segments;
use crate::simd::Isa;

/// Rows that grow by one at a time. A row never moves in memory.
#[derive(Debug)]
pub(crate) struct GrowingMap {
    kind: Kind,
    isa: Isa,
    /// Rows of a block.
    step: usize,
    /// Blocks that are full, in order: those in the file come first.
    full: Vec<Full>,
    /// How many of them are in the file.
    filed: usize,
    open: Option<Open>,
    /// Blocks whose memory is reserved, or was before they went to the file.
    spare: Vec<Open>,
    /// Where a block of the file is read to.
    buffer: Option<Storage>,
    file: Option<File>,
    /// The folder of the file: the system's for temporary files if it is not given.
    folder: Option<PathBuf>,
    rows: usize,
    /// The places that show nothing, in order.
    blank: Vec<usize>,
}

#[derive(Debug)]
enum Full {
    Memory(Open),
    /// In memory too, shared with a map.
    Shared(Arc<Block>),
    /// The lengths of the rows.
    File(Vec<f64>),
}

/// A block with room for more rows.
#[derive(Debug, Default)]
struct Open {
    memory: Storage,
    norms: Vec<f64>,
    rows: usize,
}

impl GrowingMap {
    pub(crate) fn new(
        recipe: Recipe,
        dim: usize,
        dtype: Dtype,
        metric: Metric,
        folder: Option<PathBuf>,
    ) -> Self {
        let kind = Kind { dim, dtype, metric, recipe, post: None, learned: None, image_size: None };
        Self {
            kind,
            isa: Isa::best(),
            step: rows_of_a_block(dim, dtype),
            full: Vec::new(),
            filed: 0,
            open: None,
            spare: Vec::new(),
            buffer: None,
            file: None,
            folder,
            rows: 0,
            blank: Vec::new(),
        }
    }

    pub(crate) fn set_isa(&mut self, isa: Isa) {
        self.isa = isa;
    }

    pub(crate) fn isa(&self) -> Isa {
        self.isa
    }

    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    pub(crate) fn dim(&self) -> usize {
        self.kind.dim
    }

    pub(crate) fn metric(&self) -> Metric {
        self.kind.metric
    }

    pub(crate) fn dtype(&self) -> Dtype {
        self.kind.dtype
    }

    pub(crate) fn recipe(&self) -> Recipe {
        self.kind.recipe
    }

    /// Whether a place shows nothing.
    pub(crate) fn is_blank(&self, place: usize) -> bool {
        self.blank.binary_search(&place).is_ok()
    }

    /// Whether a descriptor shows nothing.
    pub(crate) fn shows_nothing(&self, descriptor: View<'_>) -> bool {
        shows_nothing(self.kind.recipe, descriptor)
    }

    /// The descriptor as a query, which can become a row.
    ///
    /// # Errors
    /// [`Error::Length`], [`Error::Dtype`], [`Error::NotFinite`] and [`Error::NoDirection`] as for
    /// [`Map::distances_into`].
    pub(crate) fn query<'a>(&self, descriptor: View<'a>) -> Result<Query<'a>, Error> {
        let Kind { dim, dtype, metric, .. } = self.kind;
        let what = "descriptor";
        if descriptor.len() != dim {
            return Err(Error::Length { what, expected: dim, got: descriptor.len() });
        }
        if descriptor.dtype() != dtype {
            let (map, got) = (dtype, descriptor.dtype());
            return Err(Error::Dtype { what, map, or_float: false, got });
        }
        if metric == Metric::Cosine && self.shows_nothing(descriptor) {
            return Ok(Query { numbers: descriptor, length: 1.0 });
        }
        let none = part(descriptor, 0..0);
        Query::new(descriptor, self.kind.rows(none, &[], self.isa, 0))
    }

    /// Bytes of memory: rows, their lengths and the buffer of the file.
    pub(crate) fn bytes(&self) -> usize {
        let blocks = self.full.len() - self.filed + self.spare.len();
        let blocks = blocks + usize::from(self.open.is_some());
        let buffer = usize::from(self.buffer.is_some()) * self.step * self.width();
        let lists = self.filed * self.bytes_of_norms() + self.blank.capacity() * size_of::<usize>();
        blocks * self.bytes_of_a_block() + lists + buffer
    }

    /// Bytes of rows that are in the file.
    pub(crate) fn bytes_in_file(&self) -> usize {
        self.filed * self.step * self.width()
    }

    pub(crate) fn rows_of_a_block(&self) -> usize {
        self.step
    }

    pub(crate) fn bytes_of_a_block(&self) -> usize {
        self.step * self.width() + self.bytes_of_norms()
    }

    fn bytes_of_norms(&self) -> usize {
        let norms = self.kind.metric == Metric::Cosine;
        usize::from(norms) * self.step * size_of::<f64>()
    }

    /// Bytes of a row.
    fn width(&self) -> usize {
        self.kind.dim * self.kind.dtype.size()
    }

    /// Rows for which there is memory.
    pub(crate) fn room(&self) -> usize {
        let open = self.open.as_ref().map_or(0, |open| self.step - open.rows);
        self.rows + open + self.spare.len() * self.step
    }

    /// Takes memory for a block more.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(crate) fn reserve_block(&mut self) -> Result<(), Error> {
        let Kind { dim, dtype, metric, .. } = self.kind;
        let refused = || Error::Memory { places: self.step, columns: 1 };
        let memory = Storage::try_zeros(dtype, self.step * dim).ok_or_else(refused)?;
        let count = if metric == Metric::Cosine { self.step } else { 0 };
        let mut norms = Vec::new();
        norms.try_reserve_exact(count).map_err(|_| refused())?;
        self.spare.reserve(1);
        self.full.reserve(self.spare.len() + 2);
        self.spare.push(Open { memory, norms, rows: 0 });
        Ok(())
    }

    /// Appends a row, for which there is memory. `length` is that of a query.
    pub(crate) fn append(&mut self, query: Query<'_>) {
        let Some(mut open) = self.open.take().or_else(|| self.spare.pop()) else { return };
        let row = query.numbers.bytes();
        let at = open.rows * row.len();
        open.memory.bytes_mut()[at..at + row.len()].copy_from_slice(row);
        if self.kind.metric == Metric::Cosine {
            open.norms.push(query.length);
        }
        open.rows += 1;
        if self.shows_nothing(query.numbers) {
            self.blank.push(self.rows);
        }
        self.rows += 1;
        if open.rows == self.step {
            self.full.push(Full::Memory(open));
        } else {
            self.open = Some(open);
        }
    }

    /// Moves the oldest full block that is in memory to the file; false if there is none. Its
    /// memory is what blocks of the file are read to; or, if there is such, that of the next rows.
    ///
    /// # Errors
    /// [`Error::Io`] if the folder or the disk does not take it. Nothing has changed then.
    pub(crate) fn move_to_file(&mut self) -> Result<bool, Error> {
        let size = self.step * self.width();
        let rows = match self.full.get(self.filed) {
            Some(Full::Memory(block)) => block.memory.view(),
            Some(Full::Shared(block)) => block.rows(),
            Some(Full::File(_)) | None => return Ok(false),
        };
        let folder = self.folder.clone().unwrap_or_else(std::env::temp_dir);
        let refused = |action| move |source| Error::Io { path: folder.clone(), action, source };
        if self.file.is_none() {
            let made = match &self.folder {
                Some(folder) => tempfile::tempfile_in(folder),
                None => tempfile::tempfile(),
            };
            self.file = Some(made.map_err(refused.clone()("create a file of places in"))?);
        }
        let Some(file) = &mut self.file else { return Ok(false) };
        let start = (self.filed * size) as u64;
        let written = file.seek(SeekFrom::Start(start)).and_then(|_| file.write_all(rows.bytes()));
        if let Err(error) = written {
            // A part of the block may have gone to a full disk.
            let _ = file.set_len(start);
            return Err(refused("write places to a file in")(error));
        }
        let moved = std::mem::replace(&mut self.full[self.filed], Full::File(Vec::new()));
        self.filed += 1;
        let (norms, memory) = match moved {
            Full::Memory(Open { memory, norms, .. }) => (norms, Some(memory)),
            // Its memory is the map's.
            Full::Shared(block) => (block.norms().to_vec(), None),
            Full::File(norms) => (norms, None),
        };
        if self.buffer.is_none() {
            let Kind { dim, dtype, .. } = self.kind;
            self.buffer = Some(memory.unwrap_or_else(|| Storage::zeros(dtype, self.step * dim)));
        } else if let Some(memory) = memory {
            let norms = Vec::with_capacity(norms.len());
            self.spare.push(Open { memory, norms, rows: 0 });
        }
        self.full[self.filed - 1] = Full::File(norms);
        Ok(true)
    }

    /// Gives back the memory of a block that was reserved last.
    pub(crate) fn drop_spare(&mut self) {
        self.spare.pop();
    }

    /// Gives back memory that is not needed for the next row; false if there is none.
    pub(crate) fn give_back(&mut self) -> bool {
        let needed = usize::from(self.open.is_none());
        let more = self.spare.len() > needed;
        if more {
            self.spare.pop();
        }
        more
    }

    /// Writes the distances from a query to the first rows into `out`, which has a number for each.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read.
    pub(crate) fn scan(&mut self, query: Query<'_>, out: &mut [f32]) -> Result<(), Error> {
        let nothing = self.shows_nothing(query.numbers);
        let Self { kind, isa, step, full, open, buffer, file, .. } = self;
        let (dim, all) = (kind.dim, out.len());
        let compare = |rows: View<'_>, norms: &[f64], out: &mut [f32]| {
            let count = out.len();
            let rows = part(rows, 0..count * dim);
            let norms = norms.get(..count).unwrap_or_default();
            distance::distances(query, kind.rows(rows, norms, *isa, all), out);
        };
        let mut chunks = out.chunks_mut(*step);
        let mut read = 0;
        for block in &*full {
            let Some(out) = chunks.next() else { break };
            match block {
                Full::Memory(block) => compare(block.memory.view(), &block.norms, out),
                Full::Shared(block) => compare(block.rows(), block.norms(), out),
                Full::File(norms) => {
                    let (Some(file), Some(buffer)) = (&mut *file, &mut *buffer) else { break };
                    let memory = buffer.bytes_mut();
                    read_block(file, read, memory, self.folder.as_deref())?;
                    read += memory.len();
                    compare(buffer.view(), norms, out);
                }
            }
        }
        if let (Some(out), Some(open)) = (chunks.next(), open) {
            compare(open.memory.view(), &open.norms, out);
        }
        let blank = &self.blank[..self.blank.partition_point(|&place| place < out.len())];
        quieten(blank, nothing, out);
        Ok(())
    }

    /// All rows as a map, with the segments of its places. Full blocks in memory are shared.
    ///
    /// # Errors
    /// [`Error::TooFewPlaces`] below two rows; [`Error::Io`] if the file cannot be read.
    #[expect(clippy::wrong_self_convention, reason = "own blocks become shared")]
    pub(crate) fn to_map(&mut self, segments: Segments) -> Result<Map, Error> {
        at_least_two(self.rows)?;
        let Kind { dim, dtype, .. } = self.kind;
        let mut blocks = Vec::with_capacity(self.full.len() + 1);
        for (index, block) in self.full.iter_mut().enumerate() {
            blocks.push(match block {
                Full::Memory(own) => {
                    let Open { memory, norms, .. } = std::mem::take(own);
                    let shared = Arc::new(Block::whole(memory, norms));
                    *block = Full::Shared(Arc::clone(&shared));
                    shared
                }
                Full::Shared(block) => Arc::clone(block),
                Full::File(norms) => {
                    let mut memory = Storage::zeros(dtype, self.step * dim);
                    let bytes = memory.bytes_mut();
                    let start = index * bytes.len();
                    if let Some(file) = &mut self.file {
                        read_block(file, start, bytes, self.folder.as_deref())?;
                    }
                    Arc::new(Block::whole(memory, norms.clone()))
                }
            });
        }
        if let Some(open) = &self.open {
            let rows: Range<usize> = 0..open.rows * dim;
            let memory = Storage::from(part(open.memory.view(), rows).to_values());
            let norms = open.norms.clone();
            blocks.push(Arc::new(Block::whole(memory, norms)));
        }
        let blocks = Blocks::joining(blocks, dim, dtype);
        Ok(Map::joining(blocks, Route::along(segments), self.kind.clone(), self.isa))
    }
}

fn read_block(
    file: &mut File,
    start: usize,
    memory: &mut [u8],
    folder: Option<&Path>,
) -> Result<(), Error> {
    let read = file.seek(SeekFrom::Start(start as u64)).and_then(|_| file.read_exact(memory));
    read.map_err(|source| {
        let path = folder.map_or_else(std::env::temp_dir, Path::to_owned);
        Error::Io { path, action: "read the file of places in", source }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const DIM: usize = 16384;
    /// Rows of a block.
    const STEP: usize = 16;

    fn map(metric: Metric) -> GrowingMap {
        GrowingMap::new(Recipe::Ready, DIM, Dtype::F32, metric, None)
    }

    fn append(map: &mut GrowingMap, count: usize, number: f32) {
        for _ in 0..count {
            let row = vec![number; DIM];
            let query = map.query(View::F32(&row)).unwrap();
            map.append(query);
        }
    }

    /// Of each block its rows and their lengths, in memory or of those in the file.
    #[test]
    fn memory_in_use_is_counted() {
        for (metric, lengths) in [(Metric::Euclidean, 0), (Metric::Cosine, STEP * 8)] {
            let (mut map, rows) = (map(metric), STEP * DIM * 4);
            for _ in 0..4 {
                map.reserve_block().unwrap();
            }
            for (appended, open) in [(0, false), (2 * STEP, false), (5, true), (STEP - 5, false)] {
                append(&mut map, appended, 1.0);
                assert_eq!((map.bytes(), map.open.is_some()), (4 * (rows + lengths), open));
                assert_eq!((map.room(), map.bytes_in_file()), (4 * STEP, 0));
            }
            // Lengths stay in memory, and there is room for those of the next rows.
            for (filed, bytes, room) in [
                (1, 4 * (rows + lengths), 4 * STEP),
                (2, 4 * rows + 5 * lengths, 5 * STEP),
                (3, 4 * rows + 6 * lengths, 6 * STEP),
            ] {
                assert!(map.move_to_file().unwrap());
                assert_eq!((map.bytes(), map.bytes_in_file()), (bytes, filed * rows));
                assert_eq!(map.room(), room);
            }
            assert!(!map.move_to_file().unwrap());
            append(&mut map, 7, 1.0);
            assert_eq!((map.bytes(), map.room()), (4 * rows + 6 * lengths, 6 * STEP));
            let before = map.bytes();
            append(&mut map, 4, 0.0);
            assert!((before + 4 * 8..before + 16 * 8).contains(&map.bytes()), "blank places");
        }
    }

    #[test]
    fn memory_for_the_next_row_is_not_given_back() {
        let mut map = map(Metric::Euclidean);
        for _ in 0..3 {
            map.reserve_block().unwrap();
        }
        append(&mut map, STEP, 1.0);
        assert!(map.give_back() && !map.give_back());
        assert_eq!(map.room(), 2 * STEP);
        append(&mut map, 1, 1.0);
        map.reserve_block().unwrap();
        assert!(map.give_back() && !map.give_back());
        assert_eq!(map.room(), 2 * STEP);
    }
}
