//! Target `image`: bytes as an image file. Nothing panics, no image is larger than the limit, and
//! what is decoded is described the same on all instruction sets.

use surefix::{Channels, Describer, Dtype, Image, Isa, Levels, Sad, Values, decode_image};

/// The limit of the library unless the environment says otherwise, in MiB.
const MIB: usize = 512;

pub(crate) fn image(data: &[u8]) {
    let image = match decode_image(data, "input") {
        Ok(image) => image,
        Err(error) => return drop(error.to_string()),
    };
    let channels = if image.channels() == Channels::Grey { 1 } else { 3 };
    let numbers = image.width() * image.height() * channels;
    let limit = std::env::var("SUREFIX_MAX_IMAGE_MIB").ok().and_then(|mib| mib.parse().ok());
    let bytes = if image.is_deep() { 2 * numbers } else { numbers };
    assert!(bytes <= limit.unwrap_or(MIB) << 20, "{bytes} bytes");
    assert_eq!(image.pixels().len(), bytes);
    if numbers <= 1 << 20 {
        describe(&image);
    }
}

fn describe(image: &Image) {
    let view = image.view();
    let levels = Levels::new(10, 50_000).expect("low, then high");
    for sad in [Sad::default(), Sad::default().with_levels(Some(levels))] {
        let described = sad.describe(view);
        let thumbnail = sad.thumbnail(view);
        assert_eq!(described.is_ok(), thumbnail.is_ok());
        let Ok(described) = described else { continue };
        assert_eq!(described.len(), sad.dim());
        sad.shows_nothing(view).expect("it was described");
        for isa in Isa::available() {
            let mut describer = Describer::new(sad).with_isa(isa).expect("an available one");
            let mut out = Values::zeros(Dtype::U8, sad.dim());
            describer.describe(view, &mut out).expect("it was described");
            assert_eq!(out, described, "{isa}");
        }
    }
}
