//! Samples of more than 8 bits become 8: by a range that a map fixes.

use serde::{Deserialize, Serialize};

use super::source::ImageSource;
use super::view::{Image, ImageView};
use crate::error::Error;

/// Images that are looked at to find a map's levels.
const LOOKED_AT: usize = 32;
/// One sample in this many, at each end of an image, may lie outside of the levels: hot and dead
/// pixels do.
const OUTLIERS: usize = 1000;

/// The samples of deep images (of more than 8 bits) that become black and white.
///
/// Cameras of 10, 12 or 14 bits fill a part of 16 bits, and a thermal camera a small one. The map
/// fixes the range: it is measured on the map's images, kept in its recipe ([`Sad`](crate::Sad)),
/// and applied to every query, so that images of one drive stay comparable. No image is stretched
/// by itself. 8-bit images are taken as they are.
///
/// ```
/// use surefix::Levels;
/// let levels = Levels::new(7_000, 7_510)?;
/// assert_eq!([6_000, 7_000, 7_255, 9_000].map(|sample| levels.grey(sample)), [0, 0, 128, 255]);
/// assert_eq!(Levels::FULL.grey(257 * 99), 99);
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "(u16, u16)", into = "(u16, u16)")]
pub struct Levels {
    low: u16,
    high: u16,
}

impl TryFrom<(u16, u16)> for Levels {
    type Error = Error;

    fn try_from((low, high): (u16, u16)) -> Result<Self, Error> {
        Self::new(low, high)
    }
}

impl From<Levels> for (u16, u16) {
    fn from(levels: Levels) -> Self {
        (levels.low, levels.high)
    }
}

impl Levels {
    /// All 16 bits: a 257th of each sample.
    pub const FULL: Self = Self { low: 0, high: u16::MAX };

    /// `low` becomes 0 and `high` 255.
    ///
    /// # Errors
    /// [`Error::Option`] unless `low` is below `high`.
    pub fn new(low: u16, high: u16) -> Result<Self, Error> {
        if low < high {
            return Ok(Self { low, high });
        }
        let (expected, got) = ("a low below a high".to_owned(), format!("{low} and {high}"));
        Err(Error::Option { name: "levels", expected, got })
    }

    /// The sample that becomes 0.
    pub fn low(self) -> u16 {
        self.low
    }

    /// The sample that becomes 255.
    pub fn high(self) -> u16 {
        self.high
    }

    /// The 8 bits of a sample, to the nearest.
    #[must_use]
    pub fn grey(self, sample: u16) -> u8 {
        let range = u32::from(self.high - self.low);
        let above = u32::from(sample.clamp(self.low, self.high) - self.low);
        ((above * 255 + range / 2) / range) as u8
    }

    /// The image in 8 bits, in `memory` if it is deep. Nothing is allocated if that is long enough.
    pub(crate) fn view<'a>(self, image: ImageView<'a>, memory: &'a mut Vec<u8>) -> ImageView<'a> {
        if !image.is_deep() {
            return image;
        }
        memory.clear();
        memory.extend(image.deep_samples().map(|sample| self.grey(sample)));
        image.with_bytes(memory)
    }

    /// The image in 8 bits.
    pub fn apply(self, image: ImageView<'_>) -> Image {
        self.view(image, &mut Vec::new()).to_image()
    }

    /// The range of the images of a map, whose first one is given: the least and the greatest of
    /// up to 32 of them, evenly spread, without the 0.1 % of samples at each end of each. `None` if
    /// the first has 8 bits. Images that cannot be read are passed over.
    pub fn measured(images: &(impl ImageSource + ?Sized), first: &Image) -> Option<Self> {
        if !first.is_deep() {
            return None;
        }
        let mut range = ends(first);
        let (count, looked_at) = (images.len(), images.len().min(LOOKED_AT));
        for step in 1..looked_at {
            let index = step * (count - 1) / (looked_at - 1);
            if let Ok(image) = images.load(index)
                && image.is_deep()
            {
                let (low, high) = ends(&image);
                range = (range.0.min(low), range.1.max(high));
            }
        }
        let (low, high) = range;
        // All one level: there is nothing to see, whatever the range.
        Some(Self { low: low.min(u16::MAX - 1), high: high.max(low.saturating_add(1)) })
    }
}

/// The least and the greatest sample without outliers.
fn ends(image: &Image) -> (u16, u16) {
    let mut counts = vec![0_usize; 1 << 16];
    let mut all = 0;
    for sample in image.deep_samples() {
        counts[usize::from(sample)] += 1;
        all += 1;
    }
    // The first level beyond the outliers.
    let past = |counts: &mut dyn Iterator<Item = (usize, usize)>| {
        let mut seen = 0;
        for (level, count) in counts {
            seen += count;
            if seen > all / OUTLIERS {
                return level as u16;
            }
        }
        0
    };
    let mut counted = counts.iter().copied().enumerate();
    let mut backwards = counted.clone().rev();
    (past(&mut counted), past(&mut backwards))
}
