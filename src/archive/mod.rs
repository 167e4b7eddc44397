//! The container of maps, snapshots and running statistics: named tensors, one metadata entry
//! `surefix` with a format name, a version and the rest as JSON, and a checksum.
//!
//! It is a safetensors file, so every reader of those shows the tensors. Its last tensor,
//! `checksum`, is the XXH3 hash (64 bits, little-endian) of all bytes before it: header, padding
//! and data. The entry says that there is one, so no flipped byte can hide it. A file that another
//! program wrote may do without both.

mod atomic;
mod bounds;
mod folder;
mod part;
mod reader;
mod writer;

use std::io;

use safetensors::tensor::Dtype;

use crate::error::Error;
pub use atomic::{AtomicFile, is_stream, write_text};
pub use folder::AtomicFolder;
#[cfg(feature = "mmap")]
pub(crate) use reader::verify;
pub(crate) use reader::{Header, Reader, Tensors, read};
pub(crate) use writer::{Sink, Writer};

/// The one metadata entry. With a second one, the same contents could give different bytes.
const ENTRY: &str = "surefix";
const CHECKSUM: &str = "checksum";
/// The length of the checksum, and of the header's length at the start.
const WORD: usize = 8;
/// The longest header: 4 MiB, and a recipe of 1 MiB, which can be four times as long if its
/// numbers are written out.
const MAX_HEADER: usize = 8 << 20;
/// Bytes that are read and hashed, or copied, at a time.
const PIECE: usize = 1 << 18;

/// A kind of archive, and the newest version of it that is known here.
pub(crate) struct Format {
    pub(crate) name: &'static str,
    pub(crate) version: u64,
}

/// Why bytes cannot be used.
#[derive(Debug)]
pub(crate) enum Refusal {
    /// Damaged, or another program's.
    Foreign(String),
    /// Of a newer version.
    Newer {
        found: u64,
        supported: u64,
    },
    Io(io::Error),
}

impl Refusal {
    /// The error for a snapshot of `what`.
    pub(crate) fn of_snapshot(self, what: &str) -> Error {
        let reason = match self {
            Self::Foreign(reason) => format!("damaged or not {what} ({reason})"),
            Self::Newer { found, supported } => format!(
                "format {found}, but this version of surefix reads up to {supported}: upgrade surefix"
            ),
            Self::Io(source) => source.to_string(),
        };
        Error::Snapshot { reason }
    }
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Self::Foreign(error.to_string())
    }
}

impl From<io::Error> for Refusal {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// A number that tensors hold: little-endian in the file.
pub(crate) trait Number: bytemuck::Pod {
    const DTYPE: Dtype;
}

impl Number for f64 {
    const DTYPE: Dtype = Dtype::F64;
}

impl Number for f32 {
    const DTYPE: Dtype = Dtype::F32;
}

impl Number for u64 {
    const DTYPE: Dtype = Dtype::U64;
}

impl Number for u8 {
    const DTYPE: Dtype = Dtype::U8;
}

/// Turns numbers of `size` bytes each from memory's order into the file's, or back.
pub(crate) fn swap_to_file_order(bytes: &mut [u8], size: usize) {
    if cfg!(target_endian = "big") {
        bytes.chunks_exact_mut(size).for_each(<[u8]>::reverse);
    }
}

/// Calls `each` with memory for the next bytes, until `count` bytes are done.
pub(crate) fn in_pieces<E>(
    count: usize,
    mut each: impl FnMut(&mut [u8]) -> Result<(), E>,
) -> Result<(), E> {
    let mut memory = vec![0; count.min(PIECE)];
    let mut left = count;
    while left > 0 {
        let size = left.min(PIECE);
        each(&mut memory[..size])?;
        left -= size;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::reader::verify;
    use super::*;

    const FORMAT: Format = Format { name: "surefix-test", version: 1 };

    fn archive() -> Vec<u8> {
        let mut writer = Writer::new();
        writer.numbers("floats", vec![3], vec![&[1.0_f64, 2.0][..], &[3.0]]);
        writer.align();
        writer.stream("rows", Dtype::U8, vec![2, 2], |out| out.bytes(b"rows"));
        writer.numbers("text", vec![3], vec![&b"abc"[..]]);
        writer.to_bytes(&FORMAT, &serde_json::json!({"answer": 42})).unwrap()
    }

    #[test]
    fn tensors_come_back_and_any_safetensors_reader_sees_them() {
        let bytes = archive();
        let file = safetensors::SafeTensors::deserialize(&bytes).unwrap();
        assert_eq!(file.tensor("rows").unwrap().data(), b"rows");
        let at = file.tensor("rows").unwrap().data().as_ptr().addr() - bytes.as_ptr().addr();
        assert_eq!(at % writer::LINE, 0);
        for tensors in [read(&bytes, &FORMAT), Tensors::borrowed(&bytes, &FORMAT)] {
            let tensors = tensors.unwrap();
            let floats = tensors.required::<f64>("floats", "(n)", |shape| shape.len() == 1);
            assert_eq!(floats.unwrap(), (&[3][..], vec![1.0, 2.0, 3.0]));
            assert_eq!(tensors.header.entry::<serde_json::Value>().unwrap()["answer"], 42);
            assert!(tensors.numbers::<f64>("other", "", |_| true).unwrap().is_none());
            assert!(tensors.numbers::<f32>("floats", "", |_| true).is_err());
        }
        let mut rows = [0; 4];
        let reader = Reader::new(&bytes[..], bytes.len() as u64, &FORMAT).unwrap();
        reader.tensors(|_| true, "rows", Some(&mut rows)).unwrap();
        assert_eq!(&rows, b"rows");
        verify(&bytes, &FORMAT).unwrap();
    }

    #[test]
    fn every_flipped_bit_is_found() {
        let bytes = archive();
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut bytes = bytes.clone();
                bytes[at] ^= 1 << bit;
                assert!(read(&bytes, &FORMAT).is_err(), "byte {at}, bit {bit}");
                assert!(verify(&bytes, &FORMAT).is_err(), "byte {at}, bit {bit}");
            }
        }
    }

    #[test]
    fn a_tensor_of_another_length_than_its_shape_is_not_written() {
        let mut writer = Writer::new();
        writer.stream("rows", Dtype::U8, vec![5], |out| out.bytes(b"rows"));
        let error = writer.to_bytes(&FORMAT, &serde_json::json!({})).unwrap_err();
        assert!(error.to_string().contains("byte 5, got 4"), "{error}");
    }
}
