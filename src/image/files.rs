//! Images from files: a folder, a pattern or a list, in the order that a person would count them.

use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::{fs, io};

use super::source::ImageSource;
use super::view::{Channels, Image};
use crate::error::Error;

/// The endings that count as images in a folder.
const ENDINGS: [&str; 11] =
    ["png", "jpg", "jpeg", "bmp", "tif", "tiff", "webp", "ppm", "pgm", "pbm", "pnm"];

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
}

impl ImageFiles {
    /// The images of a folder (other files are passed over), or those that a pattern such as
    /// `route/*.png` matches.
    ///
    /// # Errors
    /// [`Error::Io`] if there is no such folder, [`Error::Option`] for a malformed pattern,
    /// [`Error::NoImages`] if none is found.
    pub fn find(place: impl AsRef<Path>) -> Result<Self, Error> {
        let place = place.as_ref();
        let pattern = place.to_string_lossy();
        let mut paths = if !place.exists() && pattern.contains(['*', '?', '[']) {
            matching(&pattern)?
        } else {
            inside(place)?
        };
        if paths.is_empty() {
            return Err(Error::NoImages { place: pattern.into_owned() });
        }
        alphanumeric_sort::sort_path_slice(&mut paths);
        Ok(Self { paths })
    }

    /// These files, in this order.
    pub fn list(paths: Vec<PathBuf>) -> Self {
        Self { paths }
    }

    /// The files, in route order.
    pub fn paths(&self) -> &[PathBuf] {
        &self.paths
    }
}

fn inside(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let refused = |source| Error::Io { path: folder.to_owned(), action: "list the folder", source };
    if folder.is_file() {
        return Err(refused(io::Error::other(
            "it is a file, where a folder of images or a pattern is expected",
        )));
    }
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).map_err(refused)? {
        let path = entry.map_err(refused)?.path();
        let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
        if !hidden && is_image(&path) && path.is_file() {
            paths.push(path);
        }
    }
    Ok(paths)
}

fn matching(pattern: &str) -> Result<Vec<PathBuf>, Error> {
    let malformed = |e: glob::PatternError| Error::Option {
        name: "images",
        expected: "a folder or a pattern like route/*.png".to_owned(),
        got: format!("{pattern:?} ({e})"),
    };
    let found = glob::glob(pattern).map_err(malformed)?;
    found
        .map(|entry| {
            entry.map_err(|e| {
                let path = e.path().to_owned();
                Error::Io { path, action: "list the folder", source: e.into() }
            })
        })
        .filter(|path| path.as_ref().map_or(true, |path| path.is_file()))
        .collect()
}

fn is_image(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str()))
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
}

/// Reads one image file: grey ones as grey, all others as RGB, 8 bits a channel. Deeper ones are
/// scaled to 8 bits; transparency and EXIF orientation are ignored.
///
/// # Errors
/// [`Error::Io`] if the file cannot be opened, [`Error::Image`] if it is not an image that
/// can be decoded.
pub fn read_image(path: impl AsRef<Path>) -> Result<Image, Error> {
    let path = path.as_ref();
    let io = |source| Error::Io { path: path.to_owned(), action: "read the image", source };
    decode_image(&fs::read(path).map_err(io)?, &path.display().to_string())
}

/// Decodes the bytes of an image file, such as a camera driver's compressed frame, as
/// [`read_image`] does.
///
/// An error calls it `name`.
///
/// # Errors
/// [`Error::Image`] if they are not an image that can be decoded.
pub fn decode_image(bytes: &[u8], name: &str) -> Result<Image, Error> {
    let unreadable = |reason: String| Error::Image { name: name.to_owned(), reason };
    if is_cut_short(bytes) {
        return Err(unreadable("a truncated JPEG: its end marker is missing".to_owned()));
    }
    let reader = image::ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let decoded = reader.map_err(|e| unreadable(e.to_string()))?.decode().map_err(|e| {
        let more = match e {
            image::ImageError::Unsupported(_) if cfg!(not(feature = "image-formats")) => {
                "; more formats come with the cargo feature `image-formats`"
            }
            _ => "",
        };
        unreadable(format!("{e}{more}"))
    })?;
    let (width, height) = (decoded.width() as usize, decoded.height() as usize);
    let (channels, pixels) = if decoded.color().has_color() {
        (Channels::Rgb, decoded.into_rgb8().into_raw())
    } else {
        (Channels::Grey, decoded.into_luma8().into_raw())
    };
    Image::new(width, height, channels, pixels).map_err(|e| unreadable(e.to_string()))
}

/// Whether these are the bytes of a JPEG without its end marker: decoders fill the rest in grey.
fn is_cut_short(bytes: &[u8]) -> bool {
    const START_OF_SCAN: u8 = 0xDA;
    let Some(mut rest) = bytes.strip_prefix(&[0xFF, 0xD8]) else { return false };
    // The segments before the picture, each with its length: a thumbnail in one of them has an end
    // marker of its own.
    while let [0xFF, marker, high, low, ..] = rest {
        if *marker == START_OF_SCAN {
            return !rest.windows(2).any(|pair| pair == [0xFF, 0xD9]);
        }
        let length = usize::from(u16::from_be_bytes([*high, *low]));
        let Some(next) = rest.get(2 + length..) else { return true };
        rest = next;
    }
    // Fill bytes, or something odd: the decoder decides.
    rest.len() < 4
}
