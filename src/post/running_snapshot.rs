//! Statistics of a drive as bytes, so that a robot that restarts continues with the same numbers,
//! bit for bit: an [`archive`](crate::archive) of the tensors `mean` and `square`.

use serde::{Deserialize, Serialize};

use super::running::Running;
use crate::archive::{self, Format, Refusal, Writer};
use crate::error::Error;

const FORMAT: Format = Format { name: "surefix-running", version: 1 };
/// More vectors than any camera has sent, and far below an overflow.
const MAX_COUNT: u64 = 1 << 60;

#[derive(Serialize, Deserialize)]
struct Entry {
    count: u64,
}

impl Running {
    /// The whole state as bytes; [`restore`](Self::restore) continues from it bit-identically. A
    /// localizer's snapshot has its own copy.
    ///
    /// ```
    /// use surefix::Running;
    /// let mut running = Running::new(2);
    /// running.push(&[1.0, 5.0], &mut [0.0; 2])?;
    /// assert_eq!(Running::restore(&running.snapshot()?)?, running);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Snapshot`] if the bytes cannot be made.
    pub fn snapshot(&self) -> Result<Vec<u8>, Error> {
        let mut writer = Writer::new();
        for (name, numbers) in [("mean", &self.mean), ("square", &self.square)] {
            writer.numbers(name, vec![numbers.len()], vec![numbers.as_slice()]);
        }
        writer.to_bytes(&FORMAT, &Entry { count: self.count })
    }

    /// Statistics that continue from the snapshot.
    ///
    /// # Errors
    /// [`Error::Snapshot`] if the bytes are damaged, foreign or of a newer version.
    pub fn restore(snapshot: &[u8]) -> Result<Self, Error> {
        Self::read(snapshot).map_err(|refusal| refusal.of_snapshot("one of running statistics"))
    }

    fn read(snapshot: &[u8]) -> Result<Self, Refusal> {
        let tensors = archive::read(snapshot, &FORMAT)?;
        let Entry { count } = tensors.header.entry()?;
        let (shape, mean) = tensors.required("mean", "(n)", |shape| shape.len() == 1)?;
        let (_, square) = tensors.required("square", "(n), like `mean`", |other| other == shape)?;
        // Numbers that no float32 vectors give: with them, later vectors would not come out finite.
        // Two float32 numbers are at most twice the largest one apart.
        let sized = |x: f64| (x as f32).is_finite();
        let spread = |square: f64| (square / count.max(1) as f64).sqrt() / 2.0;
        let finite = mean.iter().all(|&x: &f64| sized(x));
        let known = square.iter().all(|&square: &f64| square >= 0.0 && sized(spread(square)));
        if count > MAX_COUNT || !finite || !known {
            return Err(Refusal::Foreign("numbers that no vectors have".to_owned()));
        }
        Ok(Self { count, mean, square })
    }
}
