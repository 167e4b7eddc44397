//! The SAD descriptor against exact arithmetic, and the resize against a plain triangle filter.

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;

use surefix::{Channels, Describer, Dtype, ImageView, Isa, Sad, Values};

use crate::cases::cases;
use crate::sad_bits::shrunk;

/// The descriptor of a grey image that already has the recipe's size.
fn describe(pixels: &[u8], size: (usize, usize), patch: usize, dtype: Dtype) -> Values {
    let image = ImageView::new(size.0, size.1, Channels::Grey, pixels).unwrap();
    Sad::new(size, patch, dtype).unwrap().describe(image).unwrap()
}

fn bytes(values: Values) -> Vec<u8> {
    let Values::U8(bytes) = values else { panic!("expected bytes") };
    bytes
}

fn floats(values: Values) -> Vec<f32> {
    let Values::F32(floats) = values else { panic!("expected floats") };
    floats
}

/// The pixels of the tile that holds the pixel `at`.
fn tile(pixels: &[u8], width: usize, patch: usize, at: usize) -> Vec<u8> {
    let (left, top) = (at % width / patch * patch, at / width / patch * patch);
    let inside = |y: usize| (left..left + patch).map(move |x| pixels[y * width + x]);
    (top..top + patch).flat_map(inside).collect()
}

/// `round(128 + 32 (p - mean) / std)` in whole numbers alone. With `a = N p - sum` and `s = N^2
/// var`, `k = round(32 a / sqrt(s))` is the largest `k` with `(2 k - 1) sqrt(s) <= 64 a`.
fn exact_byte(tile: &[u8], pixel: u8) -> u8 {
    let count = tile.len() as i128;
    let sum: i128 = tile.iter().map(|&p| i128::from(p)).sum();
    let squares: i128 = tile.iter().map(|&p| i128::from(p) * i128::from(p)).sum();
    let (a, s) = (count * i128::from(pixel) - sum, count * squares - sum * sum);
    if s < count * count {
        return 128;
    }
    // x sqrt(s) <= y, by squares and signs.
    let at_most = |x: i128, y: i128| match (x <= 0, y >= 0) {
        (true, true) => true,
        (false, false) => false,
        (false, true) => x * x * s <= y * y,
        (true, false) => x * x * s >= y * y,
    };
    (-128..=127).rev().find(|k| at_most(2 * k - 1, 64 * a)).map_or(0, |k| (128 + k) as u8)
}

/// (width, height), patch, and pixels in a narrow or a wide band of greys.
fn small_image() -> impl Strategy<Value = ((usize, usize), usize, Vec<u8>)> {
    let band = select(vec![(0_u8, 1_u8), (100, 103), (0, 50), (0, 255), (250, 255)]);
    (1..9_usize, 1..4_usize, 1..4_usize, band).prop_flat_map(
        |(patch, across, down, (low, high))| {
            let size = (patch * across, patch * down);
            (Just(size), Just(patch), vec(low..=high, size.0 * size.1))
        },
    )
}

proptest! {
    #![proptest_config(cases(20_000))]

    #[test]
    fn bytes_are_rounded_from_the_exact_z((size, patch, pixels) in small_image()) {
        let got = bytes(describe(&pixels, size, patch, Dtype::U8));
        for (at, (&got, &pixel)) in got.iter().zip(&pixels).enumerate() {
            let tile = tile(&pixels, size.0, patch, at);
            prop_assert_eq!(got, exact_byte(&tile, pixel), "pixel {} of {:?}", pixel, tile);
        }
    }

    #[test]
    fn floats_are_z((size, patch, pixels) in small_image()) {
        let got = floats(describe(&pixels, size, patch, Dtype::F32));
        for (at, (&got, &pixel)) in got.iter().zip(&pixels).enumerate() {
            let tile = tile(&pixels, size.0, patch, at);
            let count = tile.len() as f64;
            let mean = tile.iter().map(|&p| f64::from(p)).sum::<f64>() / count;
            let std = (tile.iter().map(|&p| (f64::from(p) - mean).powi(2)).sum::<f64>() / count).sqrt();
            // A std of one to the last digit is decided in whole numbers, not here.
            let z = if std < 1.0 - 1e-12 { 0.0 } else { (f64::from(pixel) - mean) / std };
            prop_assert!((f64::from(got) - z).abs() <= 1e-6 * z.abs().max(1e-6), "{} for {}", got, z);
        }
    }
}

/// Random tiles never meet a rounding edge, so the few tiles of three greys where `32 z` is a half
/// are searched for.
#[test]
fn halves_round_up_wherever_they_occur() {
    let mut halves = 0;
    for (patch, few, many) in
        (2..=8).flat_map(|patch| (1..=3).flat_map(move |a| (1..=3).map(move |b| (patch, a, b))))
    {
        let count: i64 = patch * patch;
        for (x, y) in (1..=255_i64)
            .flat_map(|x| (x..=255).map(move |y| (x, y)))
            .filter(|_| few + many < count)
        {
            let (sum, squares) = (few * x + many * y, few * x * x + many * y * y);
            let spread = count * squares - sum * sum;
            let root = (spread as f64).sqrt() as i64;
            let half = |pixel: i64| {
                (64 * (count * pixel - sum)) % root == 0
                    && (64 * (count * pixel - sum)) / root % 2 != 0
            };
            if root * root != spread || root < count || ![0, x, y].into_iter().any(half) {
                continue;
            }
            halves += 1;
            let mut tile = vec![0_u8; count as usize];
            tile[..few as usize].fill(x as u8);
            tile[few as usize..(few + many) as usize].fill(y as u8);
            let negative = tile.iter().map(|pixel| 255 - pixel).collect();
            for tile in [tile, negative] {
                let side = patch as usize;
                let got = bytes(describe(&tile, (side, side), side, Dtype::U8));
                let expected: Vec<u8> =
                    tile.iter().map(|&pixel| exact_byte(&tile, pixel)).collect();
                assert_eq!(got, expected, "{tile:?}");
            }
        }
    }
    assert!(halves > 0, "the search found none");
}

#[test]
fn a_tile_without_contrast_says_nothing() {
    for grey in [0, 1, 127, 255] {
        assert_eq!(bytes(describe(&[grey; 64], (8, 8), 8, Dtype::U8)), [128; 64]);
        assert_eq!(floats(describe(&[grey; 64], (8, 8), 8, Dtype::F32)), [0.0; 64]);
    }
}

#[test]
fn one_grey_level_of_contrast_is_the_limit() {
    // Half at 10 and half at 12: the std is 1 exactly, and z is +-1.
    let mut pixels: Vec<u8> = (0..64).map(|i| if i < 32 { 10 } else { 12 }).collect();
    assert_eq!(bytes(describe(&pixels, (8, 8), 8, Dtype::U8)), [[96; 32], [160; 32]].concat());
    assert_eq!(floats(describe(&pixels, (8, 8), 8, Dtype::F32)), [[-1.0; 32], [1.0; 32]].concat());
    // One pixel nearer to the mean: just below.
    pixels[0] = 11;
    assert_eq!(bytes(describe(&pixels, (8, 8), 8, Dtype::U8)), [128; 64]);
    assert_eq!(floats(describe(&pixels, (8, 8), 8, Dtype::F32)), [0.0; 64]);
    // One farther: just above.
    pixels[0] = 9;
    assert!(bytes(describe(&pixels, (8, 8), 8, Dtype::U8)).iter().all(|&byte| byte != 128));
}

#[test]
fn tiles_are_normalised_each_by_itself() {
    // Two tiles, the second ten times the contrast and brighter: the same descriptor.
    let dull = |x: usize, y: usize| (x + y) as u8;
    let tile = |x: usize, y: usize| if x < 4 { dull(x, y) } else { 100 + 10 * dull(x - 4, y) };
    let pixels: Vec<u8> = (0..32).map(|at| tile(at % 8, at / 8)).collect();
    for row in bytes(describe(&pixels, (8, 4), 4, Dtype::U8)).chunks(8) {
        assert_eq!(row[..4], row[4..]);
    }
}

fn view(grey: &[u8], (width, height): (usize, usize)) -> ImageView<'_> {
    ImageView::new(width, height, Channels::Grey, grey).unwrap()
}

fn resize(grey: &[u8], from: (usize, usize), to: (usize, usize)) -> Vec<u8> {
    shrunk(Isa::best(), view(grey, from), to)
}

/// One row by the triangle filter, in plain f64.
fn triangle(row: &[f64], target: usize) -> Vec<f64> {
    let scale = row.len() as f64 / target as f64;
    let reach = scale.max(1.0);
    let pixel = |index: usize| {
        let centre = (index as f64 + 0.5) * scale;
        let weights =
            (0..row.len()).map(|x| (1.0 - ((x as f64 + 0.5 - centre) / reach).abs()).max(0.0));
        let (sum, total) =
            row.iter().zip(weights).fold((0.0, 0.0), |(s, t), (p, w)| (s + p * w, t + w));
        sum / total
    };
    (0..target).map(pixel).collect()
}

fn naive_resize(grey: &[u8], (width, height): (usize, usize), to: (usize, usize)) -> Vec<f64> {
    let wide: Vec<f64> = grey.iter().map(|&p| f64::from(p)).collect();
    let narrow: Vec<Vec<f64>> = wide.chunks(width).map(|row| triangle(row, to.0)).collect();
    let column = |x: usize| triangle(&(0..height).map(|y| narrow[y][x]).collect::<Vec<_>>(), to.1);
    let columns: Vec<Vec<f64>> = (0..to.0).map(column).collect();
    (0..to.1).flat_map(|y| columns.iter().map(move |column| column[y])).collect()
}

fn size() -> impl Strategy<Value = (usize, usize)> {
    (1..41_usize, 1..41_usize)
}

proptest! {
    #![proptest_config(cases(3_000))]

    #[test]
    fn resize_is_the_triangle_filter(
        ((width, height), grey) in size().prop_flat_map(|s| (Just(s), vec(any::<u8>(), s.0 * s.1))), to in size(),
    ) {
        let got = resize(&grey, (width, height), to);
        for (got, expected) in got.iter().zip(naive_resize(&grey, (width, height), to)) {
            prop_assert!((f64::from(*got) - expected).abs() <= 1.001, "{} for {}", got, expected);
        }
        prop_assert_eq!(resize(&grey, (width, height), (width, height)), grey);
    }

    #[test]
    fn a_describer_that_has_seen_other_sizes_gives_the_same(to in size(), sizes in vec(size(), 1..5)) {
        let mut used = Describer::new(Sad::new(to, 1, Dtype::U8).unwrap());
        for from in sizes {
            let grey: Vec<u8> = (0..from.0 * from.1).map(|i| (i * 37 % 256) as u8).collect();
            prop_assert_eq!(used.thumbnail(view(&grey, from)), resize(&grey, from, to));
        }
    }
}

#[test]
fn one_grey_stays_one_grey_and_a_ramp_stays_a_ramp() {
    for from in 1..=40 {
        for to in 1..=40 {
            for grey in [0, 1, 128, 254, 255] {
                assert_eq!(
                    resize(&vec![grey; from * 3], (from, 3), (to, 5)),
                    vec![grey; to * 5],
                    "{from} to {to}"
                );
            }
            for step in 1..=6 {
                let ramp: Vec<u8> = (0..from).map(|i| (i * step) as u8).collect();
                let across = resize(&ramp, (from, 1), (to, 1));
                assert!(across.is_sorted(), "{from} to {to}, steps of {step}: {across:?}");
                assert_eq!(
                    resize(&ramp, (1, from), (1, to)),
                    across,
                    "both axes are filtered alike"
                );
            }
        }
    }
}
