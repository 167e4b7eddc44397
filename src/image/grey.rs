//! Colours to brightness.

/// Rec. 601 luma in whole numbers, as Pillow computes it: `(19595 R + 38470 G + 7471 B + 32768) >>
/// 16`, pixel by pixel.
///
/// Each weight is taken apart into `256 high + low`, so that 16 bits hold every sum, and a register
/// twice the pixels: `(256 H + L + 128 * 256) >> 16 = (H + (L >> 8) + 128) >> 8`, where `H` and
/// `L` are at most `255 * 255` and `255 * 256`.
#[inline(always)]
pub(super) fn brightness(rgb: &[u8], grey: &mut [u8]) {
    let pixels = rgb.as_chunks::<3>().0;
    let count = pixels.len().min(grey.len());
    let (pixels, grey) = (&pixels[..count], &mut grey[..count]);
    for at in 0..count {
        let [red, green, blue] = pixels[at];
        let (red, green, blue) = (u16::from(red), u16::from(green), u16::from(blue));
        let high = 76 * red + 150 * green + 29 * blue;
        let low = 139 * red + 70 * green + 47 * blue;
        grey[at] = ((high + (low >> 8) + 128) >> 8) as u8;
    }
}
