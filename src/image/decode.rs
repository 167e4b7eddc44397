//! The bytes of image files become upright pixels.

use std::io::Cursor;
use std::path::Path;

use image::ColorType::{L16, La16, Rgb16, Rgb32F, Rgba16, Rgba32F};
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};

use super::limit::{Share, max_pixels};
use super::orientation;
use super::view::{Channels, Image};
use crate::error::Error;
use crate::{memory, regular};

/// The most bytes of a pixel: of RGB and alpha, as floats.
const WIDEST: u64 = 16;
/// Bytes beside the pixels: of profiles and other metadata, and of a decoder's own work.
const BESIDE: u64 = 64 << 20;

/// Reads one image file, upright: turned and mirrored as its EXIF orientation says. Grey ones are
/// grey, all others RGB; transparency is ignored. Files of more than 8 bits a sample give deep
/// images ([`Image::is_deep`]), floats from 0 to 1 among them.
///
/// # Errors
/// [`Error::Io`] if the file cannot be opened, [`Error::Image`] if it is not an image that
/// can be decoded whole, or one of more than [`max_pixels`] ([`set_max_pixels`] sets another
/// limit).
///
/// [`set_max_pixels`]: crate::set_max_pixels
pub fn read_image(path: impl AsRef<Path>) -> Result<Image, Error> {
    let path = path.as_ref();
    let io = |source| Error::Io { path: path.to_owned(), action: "read the image", source };
    let most = max_pixels().saturating_mul(WIDEST).saturating_add(BESIDE);
    decode_image(&regular::read(path, most).map_err(io)?, &path.display().to_string())
}

/// Decodes the bytes of an image file, such as a camera driver's compressed frame, as
/// [`read_image`] does.
///
/// An error calls it `name`.
///
/// # Errors
/// [`Error::Image`] as for [`read_image`].
pub fn decode_image(bytes: &[u8], name: &str) -> Result<Image, Error> {
    let unreadable = |reason: String| Error::Image { name: name.to_owned(), reason };
    if bytes.is_empty() {
        return Err(unreadable("the file is empty".to_owned()));
    }
    if is_cut_short(bytes) {
        return Err(unreadable("a truncated JPEG: its end marker is missing".to_owned()));
    }
    // The share is held until the pixels are handed on.
    let (upright, _share) = upright(bytes).map_err(unreadable)?;
    let (width, height) = (upright.width() as usize, upright.height() as usize);
    let image = match upright.color() {
        L16 | La16 => {
            Image::new_deep(width, height, Channels::Grey, upright.into_luma16().as_raw())
        }
        Rgb16 | Rgba16 | Rgb32F | Rgba32F => {
            Image::new_deep(width, height, Channels::Rgb, upright.into_rgb16().as_raw())
        }
        color if color.has_color() => {
            Image::new(width, height, Channels::Rgb, upright.into_rgb8().into_raw())
        }
        _ => Image::new(width, height, Channels::Grey, upright.into_luma8().into_raw()),
    };
    image.map_err(|e| unreadable(e.to_string()))
}

/// Whether the first bytes of a file are those of an image that can be decoded.
pub(super) fn looks_like_an_image(start: &[u8]) -> bool {
    let format = image::guess_format(start).ok().or_else(|| big_tiff(start));
    format.is_some_and(|format| format.reading_enabled())
}

/// TIFF with numbers of 64 bits, which `guess_format` does not know.
fn big_tiff(start: &[u8]) -> Option<ImageFormat> {
    let big = start.starts_with(b"II+\0") || start.starts_with(b"MM\0+");
    big.then_some(ImageFormat::Tiff)
}

fn upright(bytes: &[u8]) -> Result<(DynamicImage, Share), String> {
    let is_jpeg = bytes.starts_with(&[0xFF, 0xD8]);
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let mut reader = reader.map_err(|e| e.to_string())?;
    if let Some(format) = big_tiff(bytes) {
        reader.set_format(format);
    }
    // Of the decoder's own work. The limit of pixels is surefix's, which names it.
    let limits = |bytes| {
        let mut limits = Limits::no_limits();
        limits.max_alloc = Some(bytes);
        limits
    };
    reader.limits(limits(BESIDE));
    let mut decoder = reader.into_decoder().map_err(|e| said(&e))?;
    let (size, (width, height)) = (decoder.total_bytes(), decoder.dimensions());
    let share = Share::of((width, height), size)?;
    decoder.set_limits(limits(size.saturating_add(BESIDE))).map_err(|e| said(&e))?;
    // The pixels as they are decoded, and as they are handed on.
    memory::reserve(&mut Vec::<u8>::new(), 2 * size as usize)
        .map_err(|e| format!("{width} x {height} pixels: {e}"))?;
    let orientation = orientation::of(&mut decoder, bytes);
    let mut decoded = DynamicImage::from_decoder(decoder).map_err(|e| said(&e))?;
    if is_jpeg && is_filled_up(&decoded) {
        return Err("a damaged JPEG: the rest of the picture is missing".to_owned());
    }
    if let Some(range) = beyond_one(&decoded) {
        return Err(format!(
            "floats of {range}; expected RGB floats from 0 to 1, or samples of 8 or 16 bits: scale \
             them to 16 bits, all images of a route and its drives alike"
        ));
    }
    decoded.apply_orientation(orientation);
    Ok((decoded, share))
}

/// The range of floats if one in 1000 or more is not from 0 to 1; some that overshoot are cut.
fn beyond_one(decoded: &DynamicImage) -> Option<String> {
    let samples: &[f32] = match decoded {
        DynamicImage::ImageRgb32F(image) => image.as_raw(),
        DynamicImage::ImageRgba32F(image) => image.as_raw(),
        _ => return None,
    };
    let beyond = samples.iter().filter(|sample| !(0.0..=1.0).contains(*sample)).count();
    let (low, high) = samples
        .iter()
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &s| (low.min(s), high.max(s)));
    (1000 * beyond > samples.len()).then(|| format!("{low} to {high}"))
}

/// Whether a decoder made up the end of a picture whose data ended too early: it repeats the last
/// block, or fills in 128. Two rows of blocks, and those before them, are then the same: a picture
/// of one grey level only is none.
fn is_filled_up(decoded: &DynamicImage) -> bool {
    // Of a block, twice the least.
    const SIDE: usize = 16;
    let channels = usize::from(decoded.color().bytes_per_pixel());
    let (bytes, width) = (decoded.as_bytes(), decoded.width() as usize);
    let (across, down) = (width / SIDE, decoded.height() as usize / SIDE);
    let line = |block: usize, row: usize| {
        let (x, y) = (block % across * SIDE, block / across * SIDE + row);
        let start = (y * width + x) * channels;
        bytes.get(start..start + SIDE * channels)
    };
    let Some(last) = (across * down).checked_sub(1) else { return false };
    let same = |block: usize| (0..SIDE).all(|row| line(block, row) == line(last, row));
    let repeated = (0..last).rev().take_while(|&block| same(block)).count();
    // Cameras see no such block twice, but for bars and skies of one colour.
    let pixels = |row| line(last, row).unwrap_or_default().iter();
    let first = line(last, 0).map(|line| line[..channels].to_vec()).unwrap_or_default();
    let plain = (0..SIDE).all(|row| pixels(row).zip(first.iter().cycle()).all(|(a, b)| a == b));
    let made_up = !plain || first.iter().all(|&byte| byte == 128);
    made_up && repeated >= 2 * across && repeated < last
}

fn said(error: &ImageError) -> String {
    let text = error.to_string();
    let more = match error {
        ImageError::Unsupported(_) if cfg!(not(feature = "image-formats")) => {
            "; more formats come with the cargo feature `image-formats`"
        }
        ImageError::Unsupported(_) if text.contains("Palette") => {
            "; expected grey or RGB samples: save it as RGB"
        }
        ImageError::Unsupported(_)
            if text.contains("olor type") || text.contains("ample format") =>
        {
            "; expected samples of 8 or 16 bits without sign, or RGB floats from 0 to 1: scale \
             those of other kinds to 16 bits, all images of a route and its drives alike"
        }
        _ => "",
    };
    format!("{text}{more}")
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
