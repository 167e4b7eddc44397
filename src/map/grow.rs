//! A map that becomes longer: in memory, or in its file.

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;

use serde_json::Value;

use super::blank::Census;
use super::contents::{Parts, Sidecar};
use super::file::write;
use super::recipe::Kind;
use super::route::Names;
use super::{Map, Positions, Recipe};
use crate::archive::{Refusal, Sink, swap_to_file_order};
use crate::descriptor::DescriberPool;
use crate::distance::Metric;
use crate::error::Error;
use crate::image::{ImageSource, Progress, go_on};
use crate::numbers::Values;
use crate::post::Post;

/// Bytes of rows that are copied at a time.
const PIECE: usize = 1 << 18;
const ONE: &str = "a map of one traverse (others can be extended in memory)";
const SEVERAL: &str = "one of several";

impl Map {
    /// This map and then `more`, as one: the map that all their descriptors at once would have
    /// made. It shares the rows of both. A snapshot that was taken on the shorter one is refused on
    /// the longer one, which is another map.
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
    /// [`Error::Append`] unless both have descriptors of one length, type, metric and recipe (if
    /// both have one) that went through the same post-processing, both or neither have names, and
    /// both or neither have positions, of the same number of coordinates; if this map has a screen,
    /// so has the longer one, with the errors of [`with_screen`](Self::with_screen).
    pub fn extended(&self, more: &Self) -> Result<Self, Error> {
        let about = |map: &Self| (axes(map.positions()), map.route.names.is_some());
        let ((map_axes, map_named), (more_axes, named)) = (about(self), about(more));
        check("the map", (&self.kind, map_axes, map_named), (&more.kind, more_axes, named))?;
        let blocks = self.blocks.followed_by(&more.blocks);
        self.screened_like(blocks, self.route.followed_by(&more.route))
    }

    /// Makes the map in the file `path` longer by `more`, without reading its rows into memory:
    /// they are copied, and the longer file is then renamed into place. It is the file that all
    /// descriptors at once would have made.
    ///
    /// # Errors
    /// As for [`open`](Self::open), [`extended`](Self::extended) and [`save`](Self::save). The file
    /// is then as it was.
    pub fn append(path: impl AsRef<Path>, more: &Self) -> Result<(), Error> {
        let old = Existing::open(path.as_ref())?;
        if more.has_several() {
            return Err(misfit(&old.name(), ONE, SEVERAL));
        }
        let (positions, names) = (more.positions(), more.route.names.as_ref());
        check(&old.name(), old.about(), (&more.kind, axes(positions), names.is_some()))?;
        if old.parts.kind.metric == Metric::Cosine && old.parts.norms.is_none() {
            // A foreign file: its norms are those of its rows.
            return Self::open(old.path)?.extended(more)?.save(old.path);
        }
        old.write(&more.sidecar(), |old, out| {
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
        let old = Existing::open(path.as_ref())?;
        let Recipe::Sad(sad) = old.parts.kind.recipe else {
            return Err(misfit(&old.name(), "ready descriptors, as its own are", "images"));
        };
        let (first, places) = (old.parts.places, images.len());
        if places == 0 {
            return Err(misfit(&old.name(), "at least one image", "none"));
        }
        let got = positions.map_or(places, Positions::len);
        if got != places {
            return Err(Error::Length { what: "positions", expected: places, got });
        }
        check_positions(&old.name(), old.about().1, axes(positions))?;
        let names = old.parts.names.as_ref();
        let names = names.map(|_| Names::new(numbered_on(images, first))).transpose()?;
        let addition = Sidecar {
            places,
            positions: positions.into_iter().collect(),
            norms: Vec::new(),
            names: names.iter().collect(),
            traverses: None,
        };
        old.write(&addition, |old, out| {
            let mut census = old.copy_rows(out, &mut || go_on(progress(0, places), 0, places))?;
            let pool = DescriberPool::new(&sad, images)?;
            check_shape(images, old.parts.kind.image_size, pool.size())?;
            pool.describe_each(progress, |rows| {
                census.add(rows);
                out.numbers(rows.bytes(), sad.dtype().size())
            })?;
            Ok(census.places())
        })
    }
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

/// Coordinates of a position; 0 without positions.
fn axes(positions: Option<&Positions>) -> usize {
    positions.map_or(0, Positions::axes)
}

/// The images' names. Those that are only numbers count from `first`.
fn numbered_on(images: &(impl ImageSource + ?Sized), first: usize) -> impl Iterator<Item = String> {
    (0..images.len()).map(move |index| {
        let name = images.name(index);
        if name == index.to_string() { (first + index).to_string() } else { name }
    })
}

/// Refuses places that cannot follow those of the map.
pub(super) fn check(
    name: &str,
    map: (&Kind, usize, bool),
    more: (&Kind, usize, bool),
) -> Result<(), Error> {
    let ((map, map_axes, map_named), (more, axes, named)) = (map, more);
    let kind = |of: &Kind| match of.recipe {
        Recipe::Ready => format!("ready descriptors of {} x {}, {}", of.dim, of.dtype, of.metric),
        Recipe::Sad(sad) => {
            let ((width, height), patch) = (sad.size(), sad.patch());
            let levels = sad
                .levels()
                .map(|levels| format!(", of the levels {} to {}", levels.low(), levels.high()));
            let levels = levels.unwrap_or_default();
            format!("SAD descriptors of {width} x {height} x {}, patch {patch}{levels}", of.dtype)
        }
    };
    let names = |named| if named { "a name for each place" } else { "no names" }.to_owned();
    for (expected, got) in [(kind(map), kind(more)), (names(map_named), names(named))] {
        if expected != got {
            return Err(misfit(name, &expected, &got));
        }
    }
    check_learned(name, map.learned.as_deref(), more.learned.as_deref())?;
    check_positions(name, map_axes, axes)?;
    check_post(name, map.post.as_deref(), more.post.as_deref())
}

/// Refuses descriptors of another recipe. Ready descriptors need none.
fn check_learned(name: &str, map: Option<&str>, more: Option<&str>) -> Result<(), Error> {
    let parsed = |recipe: &str| serde_json::from_str::<Value>(recipe).ok();
    let said = |recipe: &str| recipe.chars().take(200).collect::<String>();
    match (map, more) {
        (Some(map), Some(more)) if parsed(map) != parsed(more) => {
            Err(misfit(name, &format!("descriptors by the recipe {}", said(map)), &said(more)))
        }
        _ => Ok(()),
    }
}

/// Refuses rows after other post-processing.
fn check_post(name: &str, map: Option<&Post>, more: Option<&Post>) -> Result<(), Error> {
    let said = |post: Option<&Post>| match post {
        None => "descriptors without post-processing".to_owned(),
        Some(post) => format!("descriptors after {:?}", post.steps()),
    };
    if map == more {
        return Ok(());
    }
    let (expected, got) = (said(map), said(more));
    let refitted = "the same fitted on other references (use the map's own)";
    Err(misfit(name, &expected, if expected == got { refitted } else { &got }))
}

fn check_positions(name: &str, map: usize, more: usize) -> Result<(), Error> {
    let positions = |axes| match axes {
        0 => "no positions".to_owned(),
        axes => format!("positions of {axes} coordinates"),
    };
    if map == more { Ok(()) } else { Err(misfit(name, &positions(map), &positions(more))) }
}

fn misfit(map: &str, expected: &str, got: &str) -> Error {
    Error::Append { map: map.to_owned(), expected: expected.to_owned(), got: got.to_owned() }
}

/// The file that becomes longer. Its checksum was compared.
struct Existing<'a> {
    path: &'a Path,
    file: File,
    /// The byte at which its rows begin.
    start: u64,
    parts: Parts,
}

impl<'a> Existing<'a> {
    fn open(path: &'a Path) -> Result<Self, Error> {
        let read = || -> Result<Self, Refusal> {
            let file = File::open(path)?;
            let (parts, start, signed) = Parts::read(&file)?;
            if !signed {
                // Nothing vouches for its rows: they are read.
                Map::open(path)?;
            }
            Ok(Self { path, file, start, parts })
        };
        let old = read().map_err(|refusal| refusal.of_map(path))?;
        if old.parts.several {
            return Err(misfit(&old.name(), ONE, SEVERAL));
        }
        Ok(old)
    }

    fn name(&self) -> String {
        self.path.display().to_string()
    }

    fn about(&self) -> (&Kind, usize, bool) {
        let Parts { kind, positions, names, .. } = &self.parts;
        (kind, axes(positions.as_ref()), names.is_some())
    }

    /// Writes the longer file into the place of this one. `rows` writes the rows, old and new.
    fn write(
        &self,
        addition: &Sidecar<'_>,
        rows: impl FnOnce(&Self, &mut Sink<'_>) -> Result<Vec<usize>, Error>,
    ) -> Result<(), Error> {
        let Parts { kind, places, positions, norms, names, .. } = &self.parts;
        let sidecar = Sidecar {
            places: places + addition.places,
            positions: positions.iter().chain(addition.positions.iter().copied()).collect(),
            norms: norms.iter().map(Vec::as_slice).chain(addition.norms.iter().copied()).collect(),
            names: names.iter().chain(addition.names.iter().copied()).collect(),
            traverses: None,
        };
        write(self.path, kind, sidecar, |out| rows(self, out))
    }

    /// Copies the old rows and looks at each. `proceed` is asked before each piece.
    fn copy_rows(
        &self,
        out: &mut Sink<'_>,
        proceed: &mut dyn FnMut() -> Result<(), Error>,
    ) -> Result<Census, Error> {
        let Parts { kind, places, .. } = &self.parts;
        let (dim, size) = (kind.dim, kind.dtype.size());
        let io = |source| Error::Io { path: self.path.to_owned(), action: "read the map", source };
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
