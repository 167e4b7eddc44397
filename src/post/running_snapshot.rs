//! A drive's statistics as bytes, so that a robot that restarts goes on where it was, to the last
//! bit.
//!
//! A small safetensors file: the tensors `mean` and `square`, one metadata entry `surefix` with the
//! rest as JSON, and the tensor `checksum` over all of it.

use std::collections::HashMap;
use std::fmt::Display;
use std::hash::Hasher as _;

use safetensors::tensor::{Dtype, TensorView};
use safetensors::{SafeTensors, serialize};
use serde::{Deserialize, Serialize};
use twox_hash::XxHash3_64;

use super::running::Running;
use crate::error::Error;

const FORMAT: &str = "surefix-running";
const VERSION: u64 = 1;
const ENTRY: &str = "surefix";
/// More vectors than any camera has sent, and far from where a count overflows.
const MAX_COUNT: u64 = 1 << 60;

#[derive(Serialize, Deserialize)]
struct Header {
    format: String,
    version: u64,
    count: u64,
}

impl Running {
    /// The whole state as bytes; [`restore`](Self::restore) goes on from it bit-identically. A
    /// localizer's own snapshot does not hold it.
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
    /// [`Error::Snapshot`] where the bytes cannot be made.
    pub fn snapshot(&self) -> Result<Vec<u8>, Error> {
        let header = Header { format: FORMAT.to_owned(), version: VERSION, count: self.count };
        let header = serde_json::to_string(&header).map_err(|e| refused(&e))?;
        let [mean, square] = [&self.mean, &self.square].map(|v| bytes(v));
        let sum = checksum(&header, &mean, &square);
        let tensor = |dtype, length: usize, bytes| {
            TensorView::new(dtype, vec![length], bytes).map_err(|e| refused(&e))
        };
        let tensors = [
            ("mean", tensor(Dtype::F64, self.mean.len(), &mean)?),
            ("square", tensor(Dtype::F64, self.square.len(), &square)?),
            ("checksum", tensor(Dtype::U64, 1, &sum)?),
        ];
        serialize(tensors, Some(HashMap::from([(ENTRY.to_owned(), header)])))
            .map_err(|e| refused(&e))
    }

    /// Statistics that go on where the snapshot was taken.
    ///
    /// # Errors
    /// [`Error::Snapshot`] where the bytes are damaged, foreign or of a newer version.
    pub fn restore(snapshot: &[u8]) -> Result<Self, Error> {
        let damaged =
            |e: &dyn Display| refused(&format!("damaged or not one of running statistics ({e})"));
        let tensors = SafeTensors::deserialize(snapshot).map_err(|e| damaged(&e))?;
        let (_, metadata) = SafeTensors::read_metadata(snapshot).map_err(|e| damaged(&e))?;
        let text = metadata.metadata().as_ref().and_then(|entries| entries.get(ENTRY));
        let text = text.ok_or_else(|| damaged(&"no surefix entry"))?;
        let header: Header = serde_json::from_str(text).map_err(|e| damaged(&e))?;
        if header.format != FORMAT {
            return Err(damaged(&format!(
                "expected the format {FORMAT:?}, got {:?}",
                header.format
            )));
        }
        if header.version > VERSION {
            let found = header.version;
            return Err(refused(&format!(
                "format {found}, but this version of surefix reads up to {VERSION}: upgrade surefix"
            )));
        }
        let [mean, square, sum] = ["mean", "square", "checksum"].map(|name| tensors.tensor(name));
        let (mean, square) = (mean.map_err(|e| damaged(&e))?, square.map_err(|e| damaged(&e))?);
        if checksum(text, mean.data(), square.data()) != sum.map_err(|e| damaged(&e))?.data() {
            return Err(damaged(&"its checksum does not fit"));
        }
        let fits =
            |tensor: &TensorView<'_>| tensor.dtype() == Dtype::F64 && tensor.shape().len() == 1;
        if !fits(&mean) || !fits(&square) || mean.shape() != square.shape() {
            return Err(damaged(&"tensors of the wrong shape"));
        }
        let (mean, square) = (floats(mean.data()), floats(square.data()));
        // What no vectors can have had: the next ones would not come out finite.
        let square_fits = square.iter().all(|x| x.is_finite() && *x >= 0.0);
        if header.count > MAX_COUNT || !mean.iter().all(|x| x.is_finite()) || !square_fits {
            return Err(damaged(&"numbers that no vectors have"));
        }
        Ok(Self { count: header.count, mean, square })
    }
}

fn bytes(numbers: &[f64]) -> Vec<u8> {
    numbers.iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn floats(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks().0.iter().map(|x| f64::from_le_bytes(*x)).collect()
}

/// A hash of all that a snapshot says, so that a flipped bit does not pass.
fn checksum(header: &str, mean: &[u8], square: &[u8]) -> [u8; 8] {
    let mut hash = XxHash3_64::with_seed(0);
    hash.write(header.as_bytes());
    hash.write(mean);
    hash.write(square);
    hash.finish().to_le_bytes()
}

fn refused(reason: &dyn Display) -> Error {
    Error::Snapshot { reason: reason.to_string() }
}
