//! A map that becomes longer: in memory, or in its file.

use std::borrow::Cow;
use std::cell::RefCell;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::Path;

use super::blank::Census;
use super::contents::{Parts, PictureSpan, Sidecar};
use super::file::{begin, write};
use super::join::{About, check, check_onward, check_positions, misfit};
use super::route::Names;
use super::thumbnails::{Pictures, Seen, Spool, copy};
use super::{Extras, Map, Positions, Recipe};
use crate::archive::{AtomicFile, Refusal, Sink, swap_to_file_order};
use crate::descriptor::{DescriberPool, Sad};
use crate::distance::Metric;
use crate::error::Error;
use crate::image::{ImageSource, Progress, go_on};
use crate::numbers::{Values, View};
use crate::regular;

/// Bytes of rows that are copied at a time.
const PIECE: usize = 1 << 18;
const ONE: &str = "a map of one traverse (others can be extended in memory)";
const SEVERAL: &str = "one of several";

impl Map {
    /// This map and then `more`, as one: the map that all their descriptors at once would have
    /// made. The last segment goes on with the first one of `more`; [`join`](Self::join) begins a
    /// new one. It shares the rows of both. A snapshot that was taken on the shorter one is refused
    /// on the longer one, which is another map.
    ///
    /// ```
    /// use surefix::{Map, Metric};
    /// let first = Map::from_descriptors(vec![0_u8, 1, 2, 3], 2, Metric::Euclidean)?;
    /// let more = Map::from_descriptors(vec![4_u8, 5, 6, 7], 2, Metric::Euclidean)?;
    /// assert_eq!(first.extended(&more)?.places(), 4);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// As for [`join`](Self::join), and [`Error::Append`] if the segments that would become one are
    /// not open; if this map has a screen, so has the longer one, with the errors of
    /// [`with_screen`](Self::with_screen).
    pub fn extended(&self, more: &Self) -> Result<Self, Error> {
        check("the map", self.about(), more.about())?;
        check_onward("the map", self.segments(), more.segments())?;
        let blocks = self.blocks.followed_by(&more.blocks);
        let route = self.route.followed_by(&more.route, false);
        route.traverses.check_count()?;
        self.screened_like(blocks, route)
    }

    /// Makes the map in the file `path` longer by `more`, without reading its rows into memory:
    /// they are copied, and the longer file is then renamed into place. It is the file that all
    /// descriptors at once would have made. The last segment goes on.
    ///
    /// # Errors
    /// As for [`open`](Self::open), [`extended`](Self::extended) and [`save`](Self::save), and
    /// [`Error::Append`] if the file has thumbnails and `more` has none of their size. The file is
    /// then as it was.
    pub fn append(path: impl AsRef<Path>, more: &Self) -> Result<(), Error> {
        Self::append_places(path.as_ref(), more, false)
    }

    /// [`append`](Self::append) places that begin a new segment, as those of [`join`](Self::join).
    ///
    /// # Errors
    /// As for [`append`](Self::append), but any segment can follow any.
    pub fn append_segment(path: impl AsRef<Path>, more: &Self) -> Result<(), Error> {
        Self::append_places(path.as_ref(), more, true)
    }

    fn append_places(path: &Path, more: &Self, begins: bool) -> Result<(), Error> {
        let (old, new) = Existing::open(path)?;
        if more.has_several() {
            return Err(misfit(&old.name(), ONE, SEVERAL));
        }
        let (name, about) = (old.name(), more.about());
        check(&name, old.about(), about)?;
        if !begins {
            check_onward(&name, &old.parts.segments, more.segments())?;
        }
        let pictures = match (old.picture_size(), more.thumbnails()) {
            (Some(size), pictures) => {
                let pictures = pictures.filter(|pictures| pictures.size() == size);
                Some(pictures.ok_or_else(|| {
                    let said = |(width, height)| format!("thumbnails of {width} x {height}");
                    let got = about.thumbnails.map_or_else(|| "no thumbnails".to_owned(), said);
                    misfit(&name, &said(size), &got)
                })?)
            }
            (None, _) => None,
        };
        if old.parts.kind.metric == Metric::Cosine && old.parts.norms.is_none() {
            // A foreign file: its norms are those of its rows.
            let whole = Self::open(path)?;
            let longer = if begins { Self::join(&[&whole, more]) } else { whole.extended(more) };
            return longer?.save_as(new, path);
        }
        let mut addition = more.sidecar();
        addition.pictures = pictures.map(Pictures::of);
        old.write(new, addition, begins, |old, out| {
            let mut census = old.copy_rows(out, &mut || Ok(()))?;
            more.blocks.iter().for_each(|block| census.add(block.rows()));
            more.write_rows(out)?;
            Ok(census.places())
        })
    }

    /// Makes the map in the file `path` longer by the SAD descriptors of `images`, described as its
    /// own were, on all cores and in the memory of one image for each core. It is the file that all
    /// images at once would have made: numbers in place of names are counted on.
    ///
    /// # Errors
    /// As for [`append`](Self::append) and [`build`](Self::build); [`Error::Append`] if the map was
    /// made of ready descriptors, or there are no images. The file is then as it was.
    pub fn append_images(
        path: impl AsRef<Path>,
        images: &(impl ImageSource + ?Sized),
        positions: Option<&Positions>,
        progress: Progress<'_>,
    ) -> Result<(), Error> {
        Self::append_images_with(path, images, Extras::default().with(positions), progress)
    }

    /// [`append_images`](Self::append_images) with segments, or as a new one. Positions on a plane
    /// that is not known are taken to be on the map's.
    ///
    /// # Errors
    /// As for [`append_images`](Self::append_images), and [`Error::Length`] unless `extras` has
    /// segments of the number of images; all before any image is read.
    pub fn append_images_with(
        path: impl AsRef<Path>,
        images: &(impl ImageSource + ?Sized),
        extras: Extras<'_>,
        progress: Progress<'_>,
    ) -> Result<(), Error> {
        let (old, new) = Existing::open(path.as_ref())?;
        let Recipe::Sad(sad) = old.parts.kind.recipe else {
            return Err(misfit(&old.name(), "ready descriptors, as its own are", "images"));
        };
        let (first, places) = (old.parts.places, images.len());
        if places == 0 {
            return Err(misfit(&old.name(), "at least one image", "none"));
        }
        let segments = extras.check(places)?;
        let own = old.parts.positions.as_ref();
        let positions = extras.positions.map(|given| match own {
            Some(own) => given.taken_as_of(own),
            None => Cow::Borrowed(given),
        });
        check_positions(&old.name(), own, positions.as_deref())?;
        if !extras.new_segment {
            check_onward(&old.name(), &old.parts.segments, &segments)?;
        }
        let names = old.parts.names.as_ref();
        let names = names.map(|_| Names::new(numbered_on(images, first))).transpose()?;
        let size = old.picture_size();
        let seen = size.map(|size| Seen::new(images, sad.levels(), size));
        let spool = seen.is_some().then(|| Spool::beside(old.path)).transpose();
        let spool = RefCell::new(spool.map_err(|source| old.failed(source))?);
        let pictures = size.map(|size| Pictures {
            size,
            write: Box::new(|out: &mut Sink<'_>| match spool.take() {
                Some(spool) => spool.write(out, |source| old.failed(source)),
                None => Ok(()),
            }),
        });
        let addition = Sidecar {
            places,
            segments: segments.into_owned(),
            positions: positions.as_deref().into_iter().collect(),
            norms: Vec::new(),
            names: names.iter().collect(),
            pictures,
            traverses: None,
        };
        old.write(new, addition, extras.new_segment, |old, out| {
            let mut census = old.copy_rows(out, &mut || go_on(progress(0, places), 0, places))?;
            let mut take = |rows: View<'_>, done: usize| {
                census.add(rows);
                if let (Some(seen), Some(spool)) = (&seen, &mut *spool.borrow_mut()) {
                    spool.add(seen.take(done)).map_err(|source| old.failed(source))?;
                }
                out.numbers(rows.bytes(), sad.dtype().size())
            };
            let size = old.parts.kind.image_size;
            match &seen {
                Some(seen) => described(&sad, seen, size, progress, &mut take)?,
                None => described(&sad, images, size, progress, &mut take)?,
            }
            Ok(census.places())
        })
    }
}

/// Describes images of the shape `expected`. `take` is handed the descriptors of each batch, and the
/// number of images that are done then.
fn described<I: ImageSource + ?Sized>(
    sad: &Sad,
    images: &I,
    expected: Option<(usize, usize)>,
    progress: Progress<'_>,
    take: &mut dyn FnMut(View<'_>, usize) -> Result<(), Error>,
) -> Result<(), Error> {
    let pool = DescriberPool::new(sad, images)?;
    check_shape(images, expected, pool.size())?;
    let mut done = 0;
    pool.describe_each(progress, |rows| {
        done += rows.len() / sad.dim();
        take(rows, done)
    })
}

/// Refuses images of another shape (width to height) than the map's.
fn check_shape(
    images: &(impl ImageSource + ?Sized),
    map: Option<(usize, usize)>,
    more: Option<(usize, usize)>,
) -> Result<(), Error> {
    match (map, more) {
        (Some(expected), Some(got)) if !same_shape(expected, got) => {
            Err(Error::ImageSize { name: images.name(0), expected, got })
        }
        _ => Ok(()),
    }
}

/// Whether two sizes have one shape, to 2 %.
fn same_shape(one: (usize, usize), other: (usize, usize)) -> bool {
    let [one, other] = [one, other].map(|(width, height)| width as f64 / height as f64);
    (one / other - 1.0).abs() <= 0.02
}

/// The images' names. Those that are only numbers count from `first`.
fn numbered_on(images: &(impl ImageSource + ?Sized), first: usize) -> impl Iterator<Item = String> {
    (0..images.len()).map(move |index| {
        let name = images.name(index);
        if name == index.to_string() { (first + index).to_string() } else { name }
    })
}

/// The file that becomes longer. Its checksum was compared.
struct Existing<'a> {
    path: &'a Path,
    file: File,
    /// The byte at which its rows begin.
    start: u64,
    parts: Parts,
    pictures: Option<PictureSpan>,
}

impl<'a> Existing<'a> {
    /// With the new file, which is begun before the old one is read and held to the end: no other
    /// writer's places can be lost.
    fn open(path: &'a Path) -> Result<(Self, AtomicFile), Error> {
        let there = regular::open(path).map(drop);
        there.map_err(|error| Refusal::from(error).of_map(path))?;
        let new = begin(path)?;
        let read = || -> Result<Self, Refusal> {
            let (file, _) = regular::open(path)?;
            let (parts, start, pictures, signed) = Parts::read(&file)?;
            if !signed {
                // Nothing vouches for its rows: they are read.
                Map::open(path)?;
            }
            Ok(Self { path, file, start, parts, pictures })
        };
        let old = read().map_err(|refusal| refusal.of_map(path))?;
        if old.parts.several {
            return Err(misfit(&old.name(), ONE, SEVERAL));
        }
        Ok((old, new))
    }

    fn name(&self) -> String {
        self.path.display().to_string()
    }

    fn about(&self) -> About<'_> {
        let Parts { kind, positions, names, .. } = &self.parts;
        let (positions, is_named) = (positions.as_ref(), names.is_some());
        About { kind, positions, is_named, thumbnails: self.picture_size() }
    }

    /// The size of its thumbnails, if it has any.
    fn picture_size(&self) -> Option<(usize, usize)> {
        self.pictures.as_ref().map(|pictures| pictures.size)
    }

    fn failed(&self, source: io::Error) -> Error {
        Error::Io { path: self.path.to_owned(), action: "read the map", source }
    }

    /// Writes the longer file into the place of this one. `rows` writes the rows, old and new. The
    /// addition has the same kind of positions; it has thumbnails if this file has some.
    fn write(
        &self,
        new: AtomicFile,
        addition: Sidecar<'_>,
        begins: bool,
        rows: impl FnOnce(&Self, &mut Sink<'_>) -> Result<Vec<usize>, Error>,
    ) -> Result<(), Error> {
        let Parts { kind, places, positions, norms, names, segments, .. } = &self.parts;
        let moved = positions.as_ref().map(|own| {
            addition.positions.iter().map(|given| given.on_plane_of(own)).collect::<Vec<_>>()
        });
        let moved = moved.iter().flatten().map(AsRef::as_ref);
        let pictures = self.pictures.as_ref().zip(addition.pictures).map(|(own, added)| Pictures {
            size: own.size,
            write: Box::new(|out: &mut Sink<'_>| {
                let (start, length) = (own.span.start as u64, own.span.len() as u64);
                copy(&mut &self.file, start, length, out, |source| self.failed(source))?;
                (added.write)(out)
            }),
        });
        let sidecar = Sidecar {
            places: places + addition.places,
            segments: segments.followed_by(&addition.segments, begins),
            positions: positions.iter().chain(moved).collect(),
            norms: norms.iter().map(Vec::as_slice).chain(addition.norms.iter().copied()).collect(),
            names: names.iter().chain(addition.names.iter().copied()).collect(),
            pictures,
            traverses: Some(&self.parts.traverses),
        };
        write((new, self.path), kind, sidecar, |out| rows(self, out))
    }

    /// Copies the old rows and looks at each. `proceed` is asked before each piece.
    fn copy_rows(
        &self,
        out: &mut Sink<'_>,
        proceed: &mut dyn FnMut() -> Result<(), Error>,
    ) -> Result<Census, Error> {
        let Parts { kind, places, .. } = &self.parts;
        let (dim, size) = (kind.dim, kind.dtype.size());
        let io = |source| self.failed(source);
        let mut file = &self.file;
        file.seek(SeekFrom::Start(self.start)).map_err(io)?;
        let mut census = Census::new(kind);
        let rows = (PIECE / (dim * size)).max(1);
        for start in (0..*places).step_by(rows) {
            proceed()?;
            let mut piece = Values::zeros(kind.dtype, dim * rows.min(places - start));
            file.read_exact(piece.bytes_mut()).map_err(io)?;
            swap_to_file_order(piece.bytes_mut(), size);
            census.add(piece.view());
            out.numbers(piece.view().bytes(), size)?;
        }
        Ok(census)
    }
}
