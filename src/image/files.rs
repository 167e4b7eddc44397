//! Images from files: a folder, a pattern or a list, in the order of the drive.

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use super::decode::{looks_like_an_image, read_image};
use super::doubts::doubtful;
use super::drives::two_drives;
use super::order::{Order, sort};
use super::several::several;
use super::source::ImageSource;
use super::view::Image;
use crate::error::Error;
use crate::regular;

/// The endings that count as images in a folder.
const ENDINGS: [&str; 14] = [
    "png", "jpg", "jpeg", "jpe", "jfif", "jif", "bmp", "tif", "tiff", "webp", "ppm", "pgm", "pbm",
    "pnm",
];
/// Endings of images that are not read.
const FOREIGN: [&str; 12] =
    ["heic", "heif", "avif", "gif", "jp2", "j2k", "jxl", "dng", "cr2", "nef", "arw", "exr"];

/// Image files in route order. `frame10` follows `frame9`.
///
/// ```no_run
/// use std::ops::ControlFlow;
/// use surefix::{ImageFiles, Map, Sad};
///
/// let photos = ImageFiles::find("photos/monday")?;
/// Map::build("route.safetensors", &photos, Sad::default(), None, &mut |done, total| {
///     eprint!("\r{done} of {total}");
///     ControlFlow::Continue(())
/// })?;
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct ImageFiles {
    paths: Vec<PathBuf>,
    remarks: Vec<String>,
    mixed: bool,
}

impl ImageFiles {
    /// The images of a folder, or those that a pattern such as `route/*.png` matches, in the
    /// order of their names; or the one image of a file. Other files, and the folders in it, are left out, and
    /// [`remarks`](Self::remarks) counts them.
    ///
    /// # Errors
    /// [`Error::Io`] if there is no such folder, [`Error::Option`] for a malformed pattern,
    /// [`Error::NoImages`] if none is found.
    pub fn find(place: impl AsRef<Path>) -> Result<Self, Error> {
        Self::find_by(place, Order::Name)
    }

    /// The same in another order.
    ///
    /// # Errors
    /// As for [`find`](Self::find); [`Error::Image`] for a file without the time that it is to be
    /// sorted by.
    pub fn find_by(place: impl AsRef<Path>, order: Order) -> Result<Self, Error> {
        Self::find_also(place, order, &[])
    }

    /// The same, and files with these other endings, such as `heic`, for a caller that reads them
    /// by another library.
    ///
    /// # Errors
    /// As for [`find_by`](Self::find_by).
    pub fn find_also(
        place: impl AsRef<Path>,
        order: Order,
        also: &[String],
    ) -> Result<Self, Error> {
        let place = place.as_ref();
        let pattern = place.to_string_lossy();
        let mut left_out = LeftOut::default();
        let mut paths = if !place.exists() && pattern.contains(['*', '?', '[']) {
            matching(&pattern, also, &mut left_out)?
        } else if place.is_file() && (has_ending(place, also) || is_image(place)) {
            vec![place.to_owned()]
        } else {
            inside(place, also, &mut left_out)?
        };
        let left_out = left_out.to_string();
        if paths.is_empty() {
            return Err(Error::NoImages { place: pattern.into_owned(), left_out });
        }
        let mut remarks = Vec::from_iter(sort(&mut paths, order)?);
        if order.is_by_name() {
            remarks.extend(doubtful(&paths));
            remarks.extend(two_drives(&paths));
        }
        if !left_out.is_empty() {
            remarks.push(left_out);
        }
        Ok(Self { paths, remarks, mixed: false })
    }

    /// These files, in this order.
    pub fn list(paths: Vec<PathBuf>) -> Self {
        Self { paths, remarks: Vec::new(), mixed: false }
    }

    /// The same, of which a map may be made even if their sizes differ.
    #[must_use]
    pub fn with_mixed_sizes(self) -> Self {
        Self { mixed: true, ..self }
    }

    /// The files, in route order.
    pub fn paths(&self) -> &[PathBuf] {
        &self.paths
    }

    /// What a user should know: the files that were left out, an order that the names leave open,
    /// two drives in one folder, files of which only the first image is taken. It opens the files
    /// that may hold several.
    pub fn remarks(&self) -> Vec<String> {
        several(&self.paths).into_iter().chain(self.remarks.iter().cloned()).collect()
    }
}

fn inside(folder: &Path, also: &[String], left_out: &mut LeftOut) -> Result<Vec<PathBuf>, Error> {
    let refused = |source| Error::Io { path: folder.to_owned(), action: "list the folder", source };
    if folder.is_file() {
        return Err(refused(io::Error::other(
            "it is a file, where a folder of images or a pattern is expected",
        )));
    }
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).map_err(refused)? {
        let path = entry.map_err(refused)?.path();
        if !is_hidden(&path) && has_ending(&path, also) && path.is_file() {
            paths.push(path);
        } else {
            left_out.add(&path);
        }
    }
    Ok(paths)
}

fn matching(pattern: &str, also: &[String], left_out: &mut LeftOut) -> Result<Vec<PathBuf>, Error> {
    let malformed = |e: glob::PatternError| Error::Option {
        name: "images",
        expected: "a folder or a pattern like route/*.png".to_owned(),
        got: format!("{pattern:?} ({e})"),
    };
    let mut paths = Vec::new();
    for entry in glob::glob(pattern).map_err(malformed)? {
        let path = entry.map_err(|e| {
            let path = e.path().to_owned();
            Error::Io { path, action: "list the folder", source: e.into() }
        })?;
        // Of a file that a pattern names, the content decides if the name does not.
        if path.is_file() && (has_ending(&path, also) && !is_hidden(&path) || is_image(&path)) {
            paths.push(path);
        } else {
            left_out.add(&path);
        }
    }
    Ok(paths)
}

fn ending(path: &Path) -> String {
    path.extension().map_or_else(String::new, |ending| ending.to_string_lossy().to_lowercase())
}

fn has_ending(path: &Path, also: &[String]) -> bool {
    let ending = ending(path);
    ENDINGS.contains(&ending.as_str()) || also.contains(&ending)
}

fn is_hidden(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'))
}

/// By its first bytes.
fn is_image(path: &Path) -> bool {
    let mut start = Vec::new();
    let opened = regular::open(path);
    let read = opened.and_then(|(file, _)| file.take(32).read_to_end(&mut start));
    read.is_ok() && looks_like_an_image(&start)
}

/// The entries of a folder, or those that a pattern matches, that are not taken.
#[derive(Default)]
struct LeftOut {
    /// By ending.
    files: BTreeMap<String, usize>,
    hidden: usize,
    folders: Vec<String>,
}

impl LeftOut {
    fn add(&mut self, path: &Path) {
        if is_hidden(path) {
            self.hidden += 1;
        } else if path.is_dir() {
            let name = path.file_name().unwrap_or(path.as_os_str());
            self.folders.push(name.to_string_lossy().into_owned());
        } else {
            *self.files.entry(ending(path)).or_default() += 1;
        }
    }
}

/// `5 files left out: 3 .heic, 1 .txt, 1 hidden, folder part2`; nothing if all were taken.
impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { files, hidden, folders } = self;
        let mut folders = folders.clone();
        folders.sort();
        let count = files.values().sum::<usize>() + hidden;
        let mut parts: Vec<String> = files
            .iter()
            .map(|(ending, count)| match ending.as_str() {
                "" => format!("{count} without an ending"),
                ending => format!("{count} .{ending}"),
            })
            .collect();
        parts.extend((*hidden > 0).then(|| format!("{hidden} hidden")));
        let named = folders.len().min(3);
        parts.extend(folders[..named].iter().map(|name| format!("folder {name}")));
        parts.extend(
            (folders.len() > named).then(|| format!("{} folders more", folders.len() - named)),
        );
        match count {
            0 if folders.is_empty() => return Ok(()),
            0 => write!(f, "left out: ")?,
            1 => write!(f, "1 file left out: ")?,
            count => write!(f, "{count} files left out: ")?,
        }
        f.write_str(&parts.join(", "))?;
        let foreign = files.keys().find(|ending| FOREIGN.contains(&ending.as_str()));
        match foreign {
            Some(ending) => write!(
                f,
                " (convert them to png or jpeg first, for instance with ImageMagick: magick \
                 mogrify -format jpg *.{ending})"
            ),
            None => Ok(()),
        }
    }
}

impl ImageSource for ImageFiles {
    fn len(&self) -> usize {
        self.paths.len()
    }

    fn load(&self, index: usize) -> Result<Image, Error> {
        read_image(&self.paths[index])
    }

    fn name(&self, index: usize) -> String {
        let path = &self.paths[index];
        path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
    }

    fn has_mixed_sizes(&self) -> bool {
        self.mixed
    }
}
