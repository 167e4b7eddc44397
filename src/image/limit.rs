//! How many pixels are decoded at once: a file of a few bytes can claim to be of any size, and
//! every core may read one.

use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

/// About 100 megapixels: every camera's images, and panoramas of 14,000 x 7,000.
const DEFAULT: u64 = 100_000_000;
/// Bytes of a pixel; one of more bytes counts as several.
const PIXEL: u64 = 4;
/// The bits of `TAKEN` that count pixels; those above them tell the process.
const BITS: u32 = 42;
const MASK: u64 = (1 << BITS) - 1;
/// How long to wait for another image to be done: a small part of the time that one takes.
const PAUSE: Duration = Duration::from_millis(1);

static MAX_PIXELS: AtomicU64 = AtomicU64::new(DEFAULT);
/// The pixels that are being decoded, and the process that decodes them: one that was forked off
/// meanwhile has none.
static TAKEN: AtomicU64 = AtomicU64::new(0);

/// The most pixels that are decoded at once, by all threads together: 100,000,000 unless
/// [`set_max_pixels`] has set another number.
#[must_use]
pub fn max_pixels() -> u64 {
    MAX_PIXELS.load(Ordering::Relaxed)
}

/// Sets how many pixels are decoded at once, in the whole process. A larger image is refused;
/// smaller ones wait for each other if several threads read them. Pixels of more than 4 bytes, such
/// as RGB of 16 bits, count as more. Decoding takes up to about 8 bytes a pixel.
///
/// ```
/// surefix::set_max_pixels(242_000_000); // panoramas of 22,000 x 11,000
/// assert_eq!(surefix::max_pixels(), 242_000_000);
/// ```
pub fn set_max_pixels(pixels: u64) {
    MAX_PIXELS.store(pixels.min(MASK), Ordering::Relaxed);
}

/// The share of the limit that an image has while it is decoded.
pub(super) struct Share(u64);

impl Share {
    /// For an image of this size, whose pixels take `bytes`. Waits until the images that are being
    /// decoded leave room.
    ///
    /// # Errors
    /// In words, if the image alone is larger than the limit.
    pub(super) fn of((width, height): (u32, u32), bytes: u64) -> Result<Self, String> {
        let pixels = (u64::from(width) * u64::from(height)).max(bytes.div_ceil(PIXEL));
        loop {
            let limit = max_pixels();
            if pixels > limit {
                return Err(format!(
                    "{width} x {height} pixels count as {pixels}, and surefix reads images of up to \
                     max_pixels = {limit}: make it smaller, or set max_pixels (on the command line \
                     --max-pixels) to {pixels} or more"
                ));
            }
            let word = TAKEN.load(Ordering::Acquire);
            let taken = taken_here(word);
            let next = mark() | (taken + pixels).min(MASK);
            if taken == 0 || taken + pixels <= limit {
                let swapped =
                    TAKEN.compare_exchange(word, next, Ordering::AcqRel, Ordering::Relaxed);
                if swapped.is_ok() {
                    return Ok(Self(pixels));
                }
            } else {
                thread::sleep(PAUSE);
            }
        }
    }
}

impl Drop for Share {
    fn drop(&mut self) {
        let give_back = |word| Some(mark() | taken_here(word).saturating_sub(self.0));
        let _ = TAKEN.fetch_update(Ordering::AcqRel, Ordering::Relaxed, give_back);
    }
}

/// The bits that tell this process.
fn mark() -> u64 {
    u64::from(std::process::id()) << BITS
}

/// The pixels that this process decodes.
fn taken_here(word: u64) -> u64 {
    if word & !MASK == mark() { word & MASK } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_share_the_limit_and_a_larger_one_is_refused() {
        let refused = Share::of((20_000, 10_000), 0).err().unwrap();
        assert!(refused.contains("20000 x 10000") && refused.contains("max_pixels"), "{refused}");
        // Few pixels of many bytes.
        assert!(Share::of((9_000, 9_000), 12 * 81_000_000).is_err());
        let most = AtomicU64::new(0);
        thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..20 {
                        let _share = Share::of((10_000, 6_000), 3 * 60_000_000).unwrap();
                        most.fetch_max(taken_here(TAKEN.load(Ordering::Acquire)), Ordering::AcqRel);
                        thread::yield_now();
                    }
                });
            }
        });
        assert!((60_000_000..=DEFAULT).contains(&most.into_inner()));
        // What another process left behind counts for nothing.
        assert_eq!(taken_here((u64::from(std::process::id()) + 1) << BITS | 7), 0);
    }
}
