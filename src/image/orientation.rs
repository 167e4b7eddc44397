//! Which way up an image is.

use std::io::Cursor;

use exif::{In, Tag};
use image::ImageDecoder;
use image::metadata::Orientation;

/// The orientation that the file of these bytes gives: by EXIF (by its own tag in TIFF), else by
/// XMP.
pub(super) fn of(decoder: &mut impl ImageDecoder, bytes: &[u8]) -> Orientation {
    let by_exif = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    if by_exif != Orientation::NoTransforms {
        return by_exif;
    }
    // The decoder misses one after the picture in a PNG, and one that is no SHORT.
    if let Some(by_exif) = by_exif_anywhere(bytes) {
        return by_exif;
    }
    let xmp = decoder.xmp_metadata().ok().flatten();
    xmp.and_then(|xmp| by_xmp(&xmp)).unwrap_or(Orientation::NoTransforms)
}

fn by_exif_anywhere(bytes: &[u8]) -> Option<Orientation> {
    let found = exif::Reader::new().read_from_container(&mut Cursor::new(bytes)).ok()?;
    let number = found.get_field(Tag::Orientation, In::PRIMARY)?.value.get_uint(0)?;
    let given = Orientation::from_exif(u8::try_from(number).ok()?)?;
    (given != Orientation::NoTransforms).then_some(given)
}

/// `tiff:Orientation="6"`, or the same as an element.
fn by_xmp(xmp: &[u8]) -> Option<Orientation> {
    const NAME: &[u8] = b"tiff:Orientation";
    let at = xmp.windows(NAME.len()).position(|window| window == NAME)?;
    let after = &xmp[at + NAME.len()..];
    let digit = after.iter().take(3).find(|byte| byte.is_ascii_digit())?;
    Orientation::from_exif(digit - b'0')
}
