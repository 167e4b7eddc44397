//! Which way up an image is.

use image::ImageDecoder;
use image::metadata::Orientation;

/// The orientation that the file gives: by EXIF (by its own tag in TIFF), else by XMP.
pub(super) fn of(decoder: &mut impl ImageDecoder) -> Orientation {
    let by_exif = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    if by_exif != Orientation::NoTransforms {
        return by_exif;
    }
    let xmp = decoder.xmp_metadata().ok().flatten();
    xmp.and_then(|xmp| by_xmp(&xmp)).unwrap_or(Orientation::NoTransforms)
}

/// `tiff:Orientation="6"`, or the same as an element.
fn by_xmp(xmp: &[u8]) -> Option<Orientation> {
    const NAME: &[u8] = b"tiff:Orientation";
    let at = xmp.windows(NAME.len()).position(|window| window == NAME)?;
    let after = &xmp[at + NAME.len()..];
    let digit = after.iter().take(3).find(|byte| byte.is_ascii_digit())?;
    Orientation::from_exif(digit - b'0')
}
