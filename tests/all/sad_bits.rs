//! The SAD descriptor is the naive one, a step and a number at a time: the same bits for every
//! image on every instruction set.

use surefix::{Channels, Describer, Dtype, Image, ImageView, Isa, Sad, Values, View};

use crate::cases::cases;
use crate::random::SplitMix64;

/// Bits behind the point of a weight.
const PRECISION: u32 = 22;

fn grey(image: &Image) -> Vec<u8> {
    let luma = |[red, green, blue]: &[u8; 3]| {
        let sum = 19_595 * u32::from(*red) + 38_470 * u32::from(*green) + 7_471 * u32::from(*blue);
        let fixed = ((sum + 0x8000) >> 16) as u8;
        let luma = 0.299 * f64::from(*red) + 0.587 * f64::from(*green) + 0.114 * f64::from(*blue);
        assert!((luma - f64::from(fixed)).abs() < 0.51, "{red} {green} {blue}");
        fixed
    };
    match image.channels() {
        Channels::Grey => image.pixels().to_vec(),
        _ => image.pixels().as_chunks().0.iter().map(luma).collect(),
    }
}

/// For each target pixel: its first source pixel, and the weights from there.
fn axis(source: usize, target: usize) -> Vec<(usize, Vec<i32>)> {
    let scale = source as f64 / target as f64;
    let support = scale.max(1.0);
    let taps = |index: usize| {
        let centre = (index as f64 + 0.5) * scale;
        let first = (centre - support + 0.5).max(0.0) as usize;
        let last = ((centre + support + 0.5) as usize).min(source);
        let triangle = |pixel: usize| {
            let distance = (pixel as f64 - centre + 0.5) * (1.0 / support);
            (1.0 - distance.abs()).max(0.0)
        };
        let total: f64 = (first..last).map(triangle).sum();
        let weight = |pixel| (0.5 + triangle(pixel) / total * f64::from(1_u32 << PRECISION)) as i32;
        (first, (first..last).map(weight).collect())
    };
    (0..target).map(taps).collect()
}

fn weighted(pixels: impl Iterator<Item = u8>, weights: &[i32]) -> u8 {
    let sum: i32 = pixels.zip(weights).map(|(pixel, &weight)| i32::from(pixel) * weight).sum();
    ((sum + (1 << (PRECISION - 1))) >> PRECISION).clamp(0, 255) as u8
}

/// Rows first, then columns, each rounded to 8 bits; an axis that keeps its size is left alone.
fn resize(grey: &[u8], (width, height): (usize, usize), to: (usize, usize)) -> Vec<u8> {
    let narrow: Vec<u8> = if width == to.0 {
        grey.to_vec()
    } else {
        let across = axis(width, to.0);
        let pixel = |row: &[u8], (first, weights): &(usize, Vec<i32>)| {
            weighted(row[*first..].iter().copied(), weights)
        };
        grey.chunks(width).flat_map(|row| across.iter().map(move |taps| pixel(row, taps))).collect()
    };
    if height == to.1 {
        return narrow;
    }
    let column = |x: usize, first: usize| narrow[first * to.0 + x..].iter().step_by(to.0).copied();
    let down = axis(height, to.1);
    down.iter()
        .flat_map(|(first, weights)| (0..to.0).map(move |x| weighted(column(x, *first), weights)))
        .collect()
}

/// The `z` of every pixel.
fn normalise(small: &[u8], width: usize, patch: usize) -> Vec<f64> {
    let count = (patch * patch) as u64;
    let z = |at: usize| {
        let (left, top) = (at % width / patch * patch, at / width / patch * patch);
        let tile = (top..top + patch).flat_map(|y| &small[y * width + left..][..patch]);
        let (sum, squares) = tile.fold((0, 0), |(sum, squares), &pixel| {
            (sum + u64::from(pixel), squares + u64::from(pixel) * u64::from(pixel))
        });
        let spread = count * squares - sum * sum;
        let above = (count * u64::from(small[at])) as f64 - sum as f64;
        if spread < count * count { 0.0 } else { above * (1.0 / (spread as f64).sqrt()) }
    };
    (0..small.len()).map(z).collect()
}

fn describe(image: &Image, sad: Sad) -> Values {
    let small = resize(&grey(image), (image.width(), image.height()), sad.size());
    let z = normalise(&small, sad.size().0, sad.patch());
    match sad.dtype() {
        Dtype::U8 => {
            let byte = |z: &f64| (128.0 + 32.0 * z).round().clamp(0.0, 255.0) as u8;
            Values::U8(z.iter().map(byte).collect())
        }
        _ => Values::F32(z.iter().map(|&z| z as f32).collect()),
    }
}

/// Random images and recipes.
struct Dice(SplitMix64);

impl Dice {
    /// Noise, two levels near each other, black and white, or a slope.
    fn image(&mut self, (width, height): (usize, usize), channels: Channels) -> Image {
        let (kind, low) = (self.0.below(4), self.0.below(253) as u8);
        let pixel = |at: usize| match kind {
            0 => self.0.next() as u8,
            1 => low + self.0.below(3) as u8,
            2 => 255 * self.0.below(2) as u8,
            _ => (at * 255 / (width * height * 3)) as u8,
        };
        let pixels = (0..width * height * channels.count()).map(pixel).collect();
        Image::new(width, height, channels, pixels).unwrap()
    }

    fn recipe(&mut self, most: usize) -> Sad {
        let patch = 1 + self.0.below(9);
        let size = (patch * (1 + self.0.below(most)), patch * (1 + self.0.below(most)));
        let dtype = if self.0.below(2) == 0 { Dtype::U8 } else { Dtype::F32 };
        Sad::new(size, patch, dtype).unwrap()
    }
}

/// `image` in grey and as large as `to`.
pub(crate) fn shrunk(isa: Isa, image: ImageView<'_>, to: (usize, usize)) -> Vec<u8> {
    let sad = Sad::new(to, 1, Dtype::U8).unwrap();
    Describer::new(sad).with_isa(isa).unwrap().thumbnail(image).to_vec()
}

/// Negative zeros and zeros are not the same here.
fn same(a: &Values, b: &Values) -> bool {
    match (a.view(), b.view()) {
        (View::F32(a), View::F32(b)) => {
            a.iter().map(|x| x.to_bits()).eq(b.iter().map(|x| x.to_bits()))
        }
        (a, b) => a == b,
    }
}

fn hold(image: &Image, describer: &mut Describer) {
    let sad = *describer.sad();
    let mut got = Values::zeros(sad.dtype(), sad.dim());
    describer.describe(image.view(), &mut got).unwrap();
    let of = format!(
        "{} x {} {} into {sad:?} on {}",
        image.width(),
        image.height(),
        image.channels(),
        describer.isa()
    );
    assert!(same(&got, &describe(image, sad)), "{of}");
}

#[test]
fn every_image_has_the_same_descriptor_on_every_instruction_set() {
    let mut dice = Dice(SplitMix64(1));
    for case in 0..cases(12_000).cases {
        let sad = dice.recipe(6);
        let mut size = (1 + dice.0.below(70), 1 + dice.0.below(70));
        match case % 8 {
            0 => size.0 = 1,
            1 => size.1 = 1,
            2 => size.0 = sad.size().0,
            3 => size.1 = sad.size().1,
            _ => {}
        }
        let channels = if dice.0.below(3) == 0 { Channels::Grey } else { Channels::Rgb };
        let image = dice.image(size, channels);
        for isa in Isa::available() {
            hold(&image, &mut Describer::new(sad).with_isa(isa).unwrap());
        }
    }
}

#[test]
fn large_images_have_it_too_and_a_describer_that_has_seen_other_sizes_gives_it() {
    let mut dice = Dice(SplitMix64(2));
    for _ in 0..10 {
        let sad = dice.recipe(12);
        for isa in Isa::available() {
            let mut describer = Describer::new(sad).with_isa(isa).unwrap();
            for _ in 0..4 {
                let size = (1 + dice.0.below(900), 1 + dice.0.below(500));
                let channels = [Channels::Grey, Channels::Rgb][dice.0.below(2)];
                let image = dice.image(size, channels);
                hold(&image, &mut describer);
            }
        }
    }
}

#[test]
fn every_colour_has_its_brightness() {
    let mut colours = Vec::with_capacity(256 * 256 * 3);
    for red in 0..=255 {
        colours.clear();
        colours.extend(
            (0..=255).flat_map(|green| (0..=255).map(move |blue| [red, green, blue])).flatten(),
        );
        let image = Image::new(256, 256, Channels::Rgb, colours.clone()).unwrap();
        for isa in Isa::available() {
            let got = shrunk(isa, image.view(), (256, 256));
            assert!(got == grey(&image), "a colour of red {red} on {isa}");
            // Through the first pass, which may have another way: each pixel twice.
            let twice = shrunk(isa, image.view(), (512, 256));
            let expected = resize(&got, (256, 256), (512, 256));
            assert!(twice == expected, "a colour of red {red}, resized on {isa}");
        }
    }
}

#[test]
fn rows_of_many_pixels_have_their_sums() {
    let mut dice = Dice(SplitMix64(3));
    for (width, to) in [(200_000, 1), (200_000, 3), (70_000, 70), (4_097, 4_095)] {
        let image = dice.image((width, 3), Channels::Rgb);
        for isa in Isa::available() {
            let got = shrunk(isa, image.view(), (to, 3));
            assert!(got == resize(&grey(&image), (width, 3), (to, 3)), "{width} to {to} on {isa}");
        }
    }
    // Weights that are rounded up sum to more than one: white stays white, and not what is left of
    // a larger number.
    let white = Image::new(2_000_000, 1, Channels::Grey, vec![255; 2_000_000]).unwrap();
    for isa in Isa::available() {
        assert_eq!(shrunk(isa, white.view(), (1, 1)), [255], "{isa}");
    }
}
