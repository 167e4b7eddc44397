//! Small grey pictures of a map's places, for those who look at it.

use std::collections::BTreeMap;
use std::io::{Read, Seek, SeekFrom, Write as _};
use std::ops::Range;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use super::Map;
use super::block::Blocks;
use super::storage::Storage;
use crate::archive::Sink;
use crate::dtype::Dtype;
use crate::error::Error;
use crate::image::{Channels, Image, ImageSource, ImageView, Levels, Resize};
use crate::numbers::{Values, View};
use crate::simd::Isa;

/// The longer side, in pixels.
const SIDE: usize = 96;
/// The longest side that may be asked for.
pub(super) const LARGEST: usize = 1024;
/// Bytes that are copied at a time.
const PIECE: usize = 1 << 18;

/// A small grey picture of each place of a map, all of one size: 1 byte a pixel. Those that a map
/// makes of its images are 96 pixels on the longer side: 5,184 bytes a place for images of 16 : 9.
///
/// ```
/// use surefix::{Map, Metric, Thumbnails};
/// let map = Map::from_descriptors(vec![0_u8, 1, 2], 1, Metric::Manhattan)?;
/// let map = map.with_thumbnails(Thumbnails::new(4, 2, vec![128; 3 * 4 * 2])?)?;
/// let picture = map.thumbnails().and_then(|pictures| pictures.get(2)).unwrap();
/// assert_eq!((picture.width(), picture.height()), (4, 2));
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Thumbnails {
    size: (usize, usize),
    pictures: Blocks,
}

impl Thumbnails {
    /// Pictures of `width x height` grey pixels, row by row, place by place.
    ///
    /// # Errors
    /// [`Error::Shape`] for a side of 0, or pixels that are no such pictures.
    pub fn new(width: usize, height: usize, pixels: Vec<u8>) -> Result<Self, Error> {
        let size = width.checked_mul(height).filter(|&size| size > 0);
        if !size.is_some_and(|size| pixels.len().is_multiple_of(size)) {
            let expected = "pictures of sides above 0, all of one size".to_owned();
            let got = format!("{} pixels in pictures of {width} x {height}", pixels.len());
            return Err(Error::Shape { what: "thumbnails", expected, got });
        }
        Ok(Self::of((width, height), Values::U8(pixels).into()))
    }

    /// Pictures whose memory has been checked.
    pub(super) fn of(size: (usize, usize), pixels: Storage) -> Self {
        Self { size, pictures: Blocks::of(pixels, size.0 * size.1, &[]) }
    }

    /// The size of those of images of this width and height.
    pub fn size_for((width, height): (usize, usize)) -> (usize, usize) {
        let longer = width.max(height).max(1);
        let side = |side: usize| ((side * SIDE + longer / 2) / longer).max(1);
        (side(width), side(height))
    }

    /// Width and height of a picture.
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// The number of pictures.
    pub fn len(&self) -> usize {
        self.pictures.rows()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The picture of a place; `None` for one that there is not.
    pub fn get(&self, place: usize) -> Option<ImageView<'_>> {
        let Some(View::U8(pixels)) = self.pictures.row(place) else { return None };
        ImageView::new(self.size.0, self.size.1, Channels::Grey, pixels).ok()
    }

    pub(super) fn followed_by(&self, more: &Self) -> Self {
        Self { size: self.size, pictures: self.pictures.followed_by(&more.pictures) }
    }

    pub(super) fn slice(&self, places: Range<usize>) -> Self {
        Self { size: self.size, pictures: self.pictures.slice(places) }
    }

    pub(super) fn keep(&self, runs: &[Range<usize>]) -> Self {
        Self { size: self.size, pictures: self.pictures.keep(runs) }
    }

    pub(super) fn write(&self, out: &mut Sink<'_>) -> Result<(), Error> {
        self.pictures.iter().try_for_each(|block| out.bytes(block.rows().bytes()))
    }
}

impl Map {
    /// The same map with a small picture of each place.
    ///
    /// # Errors
    /// [`Error::Length`] unless there is a picture for each place.
    pub fn with_thumbnails(mut self, pictures: Thumbnails) -> Result<Self, Error> {
        self.one_for_each_place("thumbnails", pictures.len())?;
        self.route_mut().thumbnails = Some(pictures);
        Ok(self)
    }

    /// A small picture of each place, if the map keeps them.
    pub fn thumbnails(&self) -> Option<&Thumbnails> {
        self.route().thumbnails.as_ref()
    }
}

/// The thumbnails of a file that is written: their size, and what writes them.
pub(super) struct Pictures<'a> {
    pub(super) size: (usize, usize),
    pub(super) write: Write<'a>,
}

/// Writes a tensor's bytes.
type Write<'a> = Box<dyn FnOnce(&mut Sink<'_>) -> Result<(), Error> + 'a>;

impl<'a> Pictures<'a> {
    pub(super) fn of(pictures: &'a Thumbnails) -> Self {
        Self { size: pictures.size, write: Box::new(|out| pictures.write(out)) }
    }
}

/// Images, of each of which a small picture is kept when it is loaded.
pub(super) struct Seen<'a, I: ?Sized> {
    images: &'a I,
    levels: Levels,
    size: (usize, usize),
    /// Pictures that wait for those of the images before them.
    waiting: Mutex<BTreeMap<usize, Vec<u8>>>,
    resizes: Mutex<Vec<(Resize, Vec<u8>)>>,
}

impl<'a, I: ImageSource + ?Sized> Seen<'a, I> {
    pub(super) fn new(images: &'a I, levels: Option<Levels>, size: (usize, usize)) -> Self {
        let levels = levels.unwrap_or(Levels::FULL);
        Self { images, levels, size, waiting: Mutex::default(), resizes: Mutex::default() }
    }

    /// The pictures of the images before `end` that were not taken yet, in order.
    pub(super) fn take(&self, end: usize) -> impl Iterator<Item = Vec<u8>> {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let rest = waiting.split_off(&end);
        std::mem::replace(&mut *waiting, rest).into_values()
    }

    fn keep(&self, index: usize, image: &Image) {
        let resizes = || self.resizes.lock().unwrap_or_else(PoisonError::into_inner);
        let free = resizes().pop();
        let (mut resize, mut shallow) = free.unwrap_or_default();
        let mut picture = vec![0; self.size.0 * self.size.1];
        let view = self.levels.view(image.view(), &mut shallow);
        // Reading the image takes far longer; every instruction set gives the same.
        resize.run(Isa::Scalar, view, self.size, &mut picture);
        resizes().push((resize, shallow));
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        waiting.insert(index, picture);
    }
}

impl<I: ImageSource + ?Sized> ImageSource for Seen<'_, I> {
    fn len(&self) -> usize {
        self.images.len()
    }

    fn load(&self, index: usize) -> Result<Image, Error> {
        let image = self.images.load(index)?;
        self.keep(index, &image);
        Ok(image)
    }

    fn name(&self, index: usize) -> String {
        self.images.name(index)
    }

    fn has_mixed_sizes(&self) -> bool {
        self.images.has_mixed_sizes()
    }
}

/// Pictures on the disk, until the rows before them in the file are written.
pub(super) struct Spool(std::fs::File);

impl Spool {
    /// In the folder of the file that will hold them.
    pub(super) fn beside(path: &Path) -> std::io::Result<Self> {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        tempfile::tempfile_in(folder.unwrap_or(Path::new("."))).map(Self)
    }

    pub(super) fn add(&mut self, pictures: impl Iterator<Item = Vec<u8>>) -> std::io::Result<()> {
        let mut pictures = pictures;
        pictures.try_for_each(|picture| self.0.write_all(&picture))
    }

    /// Copies all to `out`. `failed` makes the error of a read that fails.
    pub(super) fn write(
        mut self,
        out: &mut Sink<'_>,
        failed: impl Fn(std::io::Error) -> Error,
    ) -> Result<(), Error> {
        let length = self.0.stream_position().map_err(&failed)?;
        copy(&mut self.0, 0, length, out, failed)
    }
}

/// Copies `length` bytes of a file from the byte `start` on.
pub(super) fn copy(
    file: &mut (impl Read + Seek),
    start: u64,
    length: u64,
    out: &mut Sink<'_>,
    failed: impl Fn(std::io::Error) -> Error,
) -> Result<(), Error> {
    file.seek(SeekFrom::Start(start)).map_err(&failed)?;
    let mut left = length as usize;
    let mut piece = vec![0; PIECE.min(left)];
    while left > 0 {
        let size = left.min(PIECE);
        file.read_exact(&mut piece[..size]).map_err(&failed)?;
        out.bytes(&piece[..size])?;
        left -= size;
    }
    Ok(())
}

/// Memory for the pictures of a map of images.
pub(super) fn in_memory<I: ImageSource + ?Sized>(seen: &Seen<'_, I>) -> Thumbnails {
    let mut pixels = Storage::zeros(Dtype::U8, seen.len() * seen.size.0 * seen.size.1);
    let pictures = pixels.bytes_mut().chunks_exact_mut(seen.size.0 * seen.size.1);
    pictures
        .zip(seen.take(seen.len()))
        .for_each(|(memory, picture)| memory.copy_from_slice(&picture));
    Thumbnails::of(seen.size, pixels)
}
