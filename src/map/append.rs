//! A map that becomes longer: in memory, or in its file.

use std::fs::File;
use std::io::{self, BufReader, Read as _, Seek as _, SeekFrom};
use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, OnceLock};

use serde_json::Value;

use super::beside::{Beside, swap_to_file_order, write_beside};
use super::layout::{Layout, Refusal};
use super::names::Names;
use super::parts::{Part, Small, checked_norms};
use super::storage::Storage;
use super::{Map, Positions, Recipe};
use crate::descriptor::describe_each;
use crate::distance::norm;
use crate::error::Error;
use crate::image::{ImageSource, Progress, go_on};
use crate::numbers::Values;
use crate::post::Post;

impl Map {
    /// This map and then `more`, as one: the map that all their descriptors at once would have
    /// made. A snapshot that was taken on the shorter one is refused on the longer one, which is
    /// another map.
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
    /// [`Error::Append`] unless both have descriptors of one length, type, metric and recipe (where
    /// both say theirs) that went through the same post-processing, both or neither have names, and
    /// both or neither have positions, of as many coordinates; where this map has a screen, so has
    /// the longer one, with the errors of [`with_screen`](Self::with_screen).
    pub fn extended(&self, more: &Self) -> Result<Self, Error> {
        check_before("the map", &self.layout(), &more.layout())?;
        check_post("the map", self.post(), more.post())?;
        let longer = Self {
            rows: Arc::new(Storage::joined(self.descriptors(), more.descriptors())),
            places: self.places + more.places,
            norms: [self.norms.as_slice(), &more.norms].concat(),
            names: self.names.as_ref().zip(more.names.as_ref()).map(|(a, b)| a.followed_by(b)),
            positions: self.positions().zip(more.positions()).map(|(a, b)| a.followed_by(b)),
            post: self.post.clone(),
            learned: self.learned.clone(),
            fingerprint: OnceLock::new(),
            screen: None,
            ..*self
        };
        match self.screen() {
            Some(dtype) => longer.with_screen(dtype),
            None => Ok(longer),
        }
    }

    /// Makes the map in the file `path` longer by `more`, without reading its rows into memory:
    /// they are copied, and the longer file is then renamed into place. It is the file that all
    /// descriptors at once would have made.
    ///
    /// # Errors
    /// As for [`open`](Self::open), [`extended`](Self::extended) and [`save`](Self::save). The file
    /// is then as it was.
    pub fn append(path: impl AsRef<Path>, more: &Self) -> Result<(), Error> {
        let mut old = Old::open(path.as_ref())?;
        check_before(&old.name(), &old.layout, &more.layout())?;
        let post = old.small.post(&old.layout).map_err(|refusal| refusal.of(old.path))?;
        check_post(&old.name(), post.as_ref(), more.post())?;
        old.post = post;
        let longer = Longer {
            places: more.places,
            positions: more.positions(),
            norms: &more.norms,
            names: more.names.as_ref(),
        };
        old.write(&longer, |old, out| {
            old.copy_rows(out, &mut || Ok(()))?;
            out.numbers(more.descriptors().bytes(), more.dtype().size())
        })
    }

    /// Makes the map in the file `path` longer by the SAD descriptors of `images`, described as its
    /// own were, on all cores and in the memory of one image a core. It is the file that all images
    /// at once would have made: images without a name, which go by their number, are numbered on.
    ///
    /// # Errors
    /// As for [`append`](Self::append) and [`build`](Self::build); [`Error::Append`] where the map
    /// was made of ready descriptors, or there are no images. The file is then as it was.
    pub fn append_images(
        path: impl AsRef<Path>,
        images: &(impl ImageSource + ?Sized),
        positions: Option<&Positions>,
        progress: Progress<'_>,
    ) -> Result<(), Error> {
        let old = Old::open(path.as_ref())?;
        let Recipe::Sad(sad) = old.layout.recipe else {
            return Err(misfit(&old.name(), "ready descriptors, as its own are", "images"));
        };
        let (first, places) = (old.layout.places, images.len());
        if places == 0 {
            return Err(misfit(&old.name(), "at least one image", "none"));
        }
        let got = positions.map_or(places, Positions::len);
        if got != places {
            return Err(Error::Length { what: "positions", expected: places, got });
        }
        let axes = positions.map_or(0, Positions::axes);
        check_positions(&old.name(), old.layout.axes, axes)?;
        let names =
            old.small.names.as_ref().map(|_| Names::new(numbered_on(images, first))).transpose()?;
        let longer = Longer { places, positions, norms: &[], names: names.as_ref() };
        old.write(&longer, |old, out| {
            old.copy_rows(out, &mut || go_on(progress(0, places), 0, places))?;
            describe_each(&sad, images, progress, |rows| out.numbers(rows, sad.dtype().size()))
        })
    }
}

/// The images' names; those that are but their numbers count from `first`.
fn numbered_on(images: &(impl ImageSource + ?Sized), first: usize) -> impl Iterator<Item = String> {
    (0..images.len()).map(move |index| {
        let name = images.name(index);
        if name == index.to_string() { (first + index).to_string() } else { name }
    })
}

/// Whether the places of `more` can follow those of `map`.
fn check_before(name: &str, map: &Layout, more: &Layout) -> Result<(), Error> {
    let kind = |of: &Layout| match of.recipe {
        Recipe::Ready => format!("ready descriptors of {} x {}, {}", of.dim, of.dtype, of.metric),
        Recipe::Sad(sad) => {
            let ((width, height), patch) = (sad.size(), sad.patch());
            format!("SAD descriptors of {width} x {height} x {}, patch {patch}", of.dtype)
        }
    };
    let named = |of: &Layout| if of.names.is_some() { "a name for each place" } else { "no names" };
    for (expected, got) in
        [(kind(map), kind(more)), (named(map).to_owned(), named(more).to_owned())]
    {
        if expected != got {
            return Err(misfit(name, &expected, &got));
        }
    }
    check_learned(name, map, more)?;
    check_positions(name, map.axes, more.axes)
}

/// Whether what is known of the descriptors' origin fits together. Of ready descriptors, nothing
/// need be known.
fn check_learned(name: &str, map: &Layout, more: &Layout) -> Result<(), Error> {
    let parsed = |recipe: &str| serde_json::from_str::<Value>(recipe).ok();
    let said = |recipe: &str| recipe.chars().take(200).collect::<String>();
    match (map.learned.as_deref(), more.learned.as_deref()) {
        (Some(map), Some(more)) if parsed(map) != parsed(more) => {
            Err(misfit(name, &format!("descriptors by the recipe {}", said(map)), &said(more)))
        }
        _ => Ok(()),
    }
}

/// Whether the rows of both went through the same.
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

/// The file that becomes longer.
struct Old<'a> {
    path: &'a Path,
    file: File,
    layout: Layout,
    /// Where the header ends.
    start: u64,
    small: Small,
    post: Option<Post>,
}

/// What it becomes longer by, but for the rows.
struct Longer<'a> {
    places: usize,
    positions: Option<&'a Positions>,
    norms: &'a [f64],
    names: Option<&'a Names>,
}

impl<'a> Old<'a> {
    fn open(path: &'a Path) -> Result<Self, Error> {
        let read = || -> Result<Self, Refusal> {
            let mut file = File::open(path)?;
            let length = file.metadata()?.len();
            let (layout, start) = Layout::read(&mut file, length)?;
            let mut old = Self { path, file, layout, start, small: Small::default(), post: None };
            for (part, span) in old.layout.parts() {
                if part != Part::Rows {
                    let bytes = old.bytes(span)?;
                    old.small.take(&old.layout, part, bytes.into())?;
                }
            }
            Ok(old)
        };
        read().map_err(|refusal| refusal.of(path))
    }

    fn name(&self) -> String {
        self.path.display().to_string()
    }

    fn bytes(&self, span: Range<usize>) -> io::Result<Vec<u8>> {
        (&self.file).seek(SeekFrom::Start(self.start + span.start as u64))?;
        let mut bytes = vec![0; span.len()];
        (&self.file).read_exact(&mut bytes)?;
        Ok(bytes)
    }

    /// Writes the longer file into the place of this one. `rows` writes the rows, old and new.
    fn write(
        mut self,
        longer: &Longer<'_>,
        rows: impl FnOnce(&Self, &mut Beside<'_>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let mut layout = self.layout.clone();
        layout.places += longer.places;
        let names = self
            .small
            .names
            .as_ref()
            .zip(longer.names)
            .map(|(old, new)| [old.bytes(), new.bytes()]);
        let layout = layout.placed(names.map(|[old, new]| old.len() + new.len()));
        if layout.norms.is_some() && self.small.norms.is_none() {
            self.small.norms = Some(self.norms().map_err(|refusal| refusal.of(self.path))?);
        }
        write_beside(self.path, |out| {
            out.head(&layout)?;
            out.floats(self.small.positions.as_ref().map_or(&[], Positions::metres))?;
            out.floats(longer.positions.map_or(&[], Positions::metres))?;
            out.floats(self.small.norms.as_deref().unwrap_or_default())?;
            out.floats(longer.norms)?;
            out.vectors_of_post(self.post.as_ref())?;
            rows(&self, out)?;
            out.matrices_of_post(self.post.as_ref())?;
            names.iter().flatten().try_for_each(|bytes| out.bytes(bytes))
        })
    }

    /// Copies the old rows. `go_on` is asked now and then.
    fn copy_rows(
        &self,
        out: &mut Beside<'_>,
        go_on: &mut dyn FnMut() -> Result<(), Error>,
    ) -> Result<(), Error> {
        let rows = &self.layout.rows;
        let seek = (&self.file).seek(SeekFrom::Start(self.start + rows.start as u64));
        seek.map_err(|source| Refusal::Io(source).of(self.path))?;
        out.copied(&self.file, rows.len() as u64, go_on)
    }

    /// The lengths of the rows, which an old file may lack: row by row.
    fn norms(&self) -> Result<Vec<f64>, Refusal> {
        let mut row = Values::zeros(self.layout.dtype, self.layout.dim);
        let size = self.layout.dtype.size();
        let mut file = BufReader::with_capacity(1 << 20, &self.file);
        file.seek(SeekFrom::Start(self.start + self.layout.rows.start as u64))?;
        let norms = (0..self.layout.places).map(|_| -> io::Result<f64> {
            file.read_exact(row.bytes_mut())?;
            swap_to_file_order(row.bytes_mut(), size);
            Ok(norm(row.view()))
        });
        checked_norms(norms.collect::<io::Result<_>>()?)
    }
}
