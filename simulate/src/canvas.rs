//! Antialiased filling of simple shapes in an RGB buffer.

use super::noise::lerp;

/// Red, green, blue, each 0 to 255.
pub(super) type Rgb = [f32; 3];

/// A point of the image: pixels from the left, pixels from the top.
pub(super) type Point = (f32, f32);

/// From `a` at 0 to `b` at 1.
pub(super) fn blend(a: Rgb, b: Rgb, t: f32) -> Rgb {
    [lerp(a[0], b[0], t), lerp(a[1], b[1], t), lerp(a[2], b[2], t)]
}

/// A colour made brighter or darker.
pub(super) fn scale(colour: Rgb, by: f32) -> Rgb {
    [colour[0] * by, colour[1] * by, colour[2] * by]
}

/// An alpha below this changes nothing.
const FAINTEST: f32 = 1.0 / 512.0;

/// The image being painted.
pub(super) struct Canvas<'a> {
    pixels: &'a mut [u8],
    width: usize,
    rows: usize,
    /// Multiplies every alpha, 0 to 1: lets far things fade in rather than pop up.
    pub(super) opacity: f32,
}

fn bytes(colour: Rgb) -> [u8; 3] {
    // `as` saturates at 0 and 255.
    colour.map(|c| (c + 0.5) as u8)
}

fn mix_pixel(pixel: &mut [u8], colour: [u8; 3], alpha: i32) {
    for (old, new) in pixel.iter_mut().zip(colour) {
        let from = i32::from(*old);
        *old = (from + (((i32::from(new) - from) * alpha + 128) >> 8)) as u8;
    }
}

/// Blends `colour` into neighbouring pixels.
pub(super) fn mix_pixels(pixels: &mut [u8], colour: Rgb, alpha: f32) {
    let (paint, alpha) = (bytes(colour), alpha_256(alpha));
    if alpha > 0 {
        for pixel in pixels.chunks_exact_mut(3) {
            mix_pixel(pixel, paint, alpha);
        }
    }
}

fn alpha_256(alpha: f32) -> i32 {
    ((alpha * 256.0 + 0.5) as i32).min(256)
}

/// How much of the unit interval that starts at `cell` lies in `[from, to]`.
fn overlap(cell: f32, from: f32, to: f32) -> f32 {
    (to.min(cell + 1.0) - from.max(cell)).max(0.0)
}

/// The first and the last cell of `[from, to]`, which is not empty and not negative.
fn cells(from: f32, to: f32) -> (usize, usize) {
    let (first, end) = (from as usize, to as usize);
    // A whole `to` ends in the cell before it.
    let last = if end as f32 == to { end.saturating_sub(1) } else { end };
    (first, last.max(first))
}

/// Fills whole pixels.
fn fill(pixels: &mut [u8], paint: [u8; 3], alpha: i32) {
    if alpha < 256 {
        for pixel in pixels.chunks_exact_mut(3) {
            mix_pixel(pixel, paint, alpha);
        }
        return;
    }
    // Sixteen pixels at a time copy faster than one by one.
    let [r, g, b] = paint;
    let piece: [u8; 48] = std::array::from_fn(|i| [r, g, b][i % 3]);
    for part in pixels.chunks_mut(48) {
        let length = part.len();
        part.copy_from_slice(&piece[..length]);
    }
}

impl<'a> Canvas<'a> {
    /// Paints on the whole rows that `pixels` holds, at most `height`.
    pub(super) fn new(pixels: &'a mut [u8], width: usize, height: usize) -> Self {
        let rows = (pixels.len() / (3 * width)).min(height);
        let (pixels, _) = pixels.split_at_mut(rows * width * 3);
        Self { pixels, width, rows, opacity: 1.0 }
    }

    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Pixels from one sample of a smooth texture to the next; between them a straight
    /// line will do.
    pub(super) fn grain(&self) -> usize {
        (self.width / 80).max(1)
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    /// The bytes of row `y`, empty below the image.
    pub(super) fn row_mut(&mut self, y: usize) -> &mut [u8] {
        let stride = self.width * 3;
        self.pixels.get_mut(y * stride..(y + 1) * stride).unwrap_or_default()
    }

    /// Fills row `y` from `left` to `right`.
    pub(super) fn row(&mut self, y: usize, left: f32, right: f32, colour: Rgb, alpha: f32) {
        let left = left.max(0.0);
        let right = right.min(self.width as f32);
        let alpha = alpha * self.opacity;
        if left >= right || y >= self.rows || alpha < FAINTEST {
            return;
        }
        let paint = bytes(colour);
        let row = self.row_mut(y);
        let (first, last) = cells(left, right);
        let mut edge = |cell: usize| {
            if let Some(pixel) = row.get_mut(cell * 3..cell * 3 + 3) {
                let cover = alpha * overlap(cell as f32, left, right);
                mix_pixel(pixel, paint, alpha_256(cover));
            }
        };
        edge(first);
        if last > first {
            edge(last);
        }
        if last > first + 1 {
            let inside = row.get_mut((first + 1) * 3..last * 3).unwrap_or_default();
            fill(inside, paint, alpha_256(alpha));
        }
    }

    /// Fills column `x` from `top` to `bottom`.
    pub(super) fn column(&mut self, x: usize, top: f32, bottom: f32, colour: Rgb, alpha: f32) {
        let top = top.max(0.0);
        let bottom = bottom.min(self.rows as f32);
        let alpha = alpha * self.opacity;
        if top >= bottom || x >= self.width || alpha < FAINTEST {
            return;
        }
        let paint = bytes(colour);
        let whole = alpha_256(alpha);
        let (first, last) = cells(top, bottom);
        let count = last - first + 1;
        let at = x * 3;
        let rows = self.pixels.chunks_exact_mut(self.width * 3);
        for (step, row) in rows.skip(first).take(count).enumerate() {
            let Some(pixel) = row.get_mut(at..at + 3) else {
                return;
            };
            let inner = step > 0 && step + 1 < count;
            let cover = if inner {
                whole
            } else {
                alpha_256(alpha * overlap((first + step) as f32, top, bottom))
            };
            if cover == 256 {
                pixel.copy_from_slice(&paint);
            } else {
                mix_pixel(pixel, paint, cover);
            }
        }
    }

    /// Fills the rectangle between two corners, given in any order.
    pub(super) fn rect(&mut self, a: Point, b: Point, colour: Rgb, alpha: f32) {
        let (left, right) = (a.0.min(b.0), a.0.max(b.0));
        let (top, bottom) = (a.1.min(b.1).max(0.0), a.1.max(b.1).min(self.rows as f32));
        if top >= bottom {
            return;
        }
        for y in top as usize..=cells(top, bottom).1 {
            let cover = overlap(y as f32, top, bottom);
            self.row(y, left, right, colour, alpha * cover);
        }
    }

    /// Fills an upright ellipse.
    pub(super) fn ellipse(&mut self, centre: Point, radii: Point, colour: Rgb, alpha: f32) {
        let (top, bottom) = (centre.1 - radii.1, centre.1 + radii.1);
        if radii.1 < 0.5 || radii.0 < 0.5 {
            // Too small for scan lines: a rectangle of the same area.
            let half = (radii.0 * 0.886, radii.1 * 0.886);
            let a = (centre.0 - half.0, centre.1 - half.1);
            return self.rect(a, (centre.0 + half.0, centre.1 + half.1), colour, alpha);
        }
        let (from, to) = (top.max(0.0), bottom.min(self.rows as f32));
        if from >= to {
            return;
        }
        for y in from as usize..=cells(from, to).1 {
            let middle = (y as f32 + 0.5).clamp(top, bottom);
            let off = (middle - centre.1) / radii.1;
            let half = radii.0 * (1.0 - off * off).max(0.0).sqrt();
            let cover = overlap(y as f32, top, bottom);
            self.row(y, centre.0 - half, centre.0 + half, colour, alpha * cover);
        }
    }

    /// Fills a convex polygon, along its longer side so that thin shapes stay whole.
    pub(super) fn convex(&mut self, corners: &[Point], colour: Rgb, alpha: f32) {
        let mut low = (f32::MAX, f32::MAX);
        let mut high = (f32::MIN, f32::MIN);
        for corner in corners {
            low = (low.0.min(corner.0), low.1.min(corner.1));
            high = (high.0.max(corner.0), high.1.max(corner.1));
        }
        if high.0 <= 0.0 || low.0 >= self.width as f32 || high.1 <= 0.0 || low.1 >= self.rows as f32
        {
            return;
        }
        let upright = high.1 - low.1 > high.0 - low.0;
        let (start, end, limit) =
            if upright { (low.1, high.1, self.rows) } else { (low.0, high.0, self.width) };
        let (from, to) = (start.max(0.0), end.min(limit as f32));
        if from >= to {
            return;
        }
        for line in from as usize..=cells(from, to).1 {
            let middle = (line as f32 + 0.5).clamp(start, end);
            let (near, far) = crossing(corners, middle, upright);
            let cover = alpha * overlap(line as f32, start, end);
            if upright {
                self.row(line, near, far, colour, cover);
            } else {
                self.column(line, near, far, colour, cover);
            }
        }
    }

    /// Draws a straight stroke; one thinner than a pixel is drawn a pixel wide and fainter.
    pub(super) fn stroke(&mut self, a: Point, b: Point, thickness: f32, colour: Rgb, alpha: f32) {
        let (dx, dy) = (b.0 - a.0, b.1 - a.1);
        let length = (dx * dx + dy * dy).sqrt();
        if length < 0.05 {
            return;
        }
        let half = thickness.max(1.0) * 0.5 / length;
        let (nx, ny) = (-dy * half, dx * half);
        let corners = [
            (a.0 + nx, a.1 + ny),
            (b.0 + nx, b.1 + ny),
            (b.0 - nx, b.1 - ny),
            (a.0 - nx, a.1 - ny),
        ];
        self.convex(&corners, colour, alpha * thickness.min(1.0));
    }
}

/// Where the scan line at `at` enters and leaves the polygon; an empty span if it misses.
fn crossing(corners: &[Point], at: f32, upright: bool) -> (f32, f32) {
    let mut span = (f32::MAX, f32::MIN);
    let pair = |p: Point| if upright { (p.1, p.0) } else { p };
    let Some(&last) = corners.last() else {
        return span;
    };
    let mut from = pair(last);
    for &corner in corners {
        let to = pair(corner);
        if (from.0 <= at) != (to.0 <= at) || from.0 == at {
            let step = to.0 - from.0;
            let t = if step == 0.0 { 0.0 } else { (at - from.0) / step };
            let hit = lerp(from.1, to.1, t);
            span = (span.0.min(hit), span.1.max(hit));
        }
        from = to;
    }
    span
}
