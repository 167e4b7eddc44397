//! Writing an archive.

use std::collections::HashMap;
use std::hash::Hasher as _;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use safetensors::tensor::{Dtype, Metadata, TensorInfo};
use serde::Serialize;
use twox_hash::XxHash3_64;

use super::AtomicFile;
use super::bounds::MAX_TENSORS;
use super::{CHECKSUM, ENTRY, Format, MAX_HEADER, Number, PIECE, WORD, swap_to_file_order};
use crate::error::Error;
use crate::interrupt::check;

/// Rows begin at a multiple of a cache line in the file, and so do those of a mapped file.
pub(super) const LINE: usize = 64;

/// Tensors to be written, in the order in which they are added.
pub(crate) struct Writer<'a> {
    tensors: Vec<(String, TensorInfo)>,
    data: Vec<Data<'a>>,
    end: usize,
    /// The tensor byte that lies at a multiple of a cache line in the file.
    aligned: usize,
}

/// Writes one tensor's bytes: exactly those that its shape says.
type Data<'a> = Box<dyn FnOnce(&mut Sink<'_>) -> Result<(), Error> + 'a>;

/// Where a tensor's bytes go.
pub(crate) struct Sink<'a> {
    out: &'a mut dyn Write,
    hash: XxHash3_64,
    written: usize,
    failed: &'a dyn Fn(io::Error) -> Error,
}

/// The metadata entry.
#[derive(Serialize)]
struct Stamped<'a, T> {
    format: &'a str,
    version: u64,
    checksum: &'a str,
    #[serde(flatten)]
    rest: &'a T,
}

impl<'a> Writer<'a> {
    pub(crate) fn new() -> Self {
        Self { tensors: Vec::new(), data: Vec::new(), end: 0, aligned: 0 }
    }

    /// Adds a tensor of the numbers in `pieces`, one piece after the other.
    pub(crate) fn numbers<T: Number>(
        &mut self,
        name: impl Into<String>,
        shape: Vec<usize>,
        pieces: Vec<&'a [T]>,
    ) {
        self.stream(name, T::DTYPE, shape, move |out| {
            pieces
                .into_iter()
                .try_for_each(|piece| out.numbers(bytemuck::must_cast_slice(piece), size_of::<T>()))
        });
    }

    /// Adds a tensor whose bytes are made while the file is written.
    pub(crate) fn stream(
        &mut self,
        name: impl Into<String>,
        dtype: Dtype,
        shape: Vec<usize>,
        data: impl FnOnce(&mut Sink<'_>) -> Result<(), Error> + 'a,
    ) {
        let start = self.end;
        self.end += shape.iter().product::<usize>() * dtype.bitsize() / 8;
        let info = TensorInfo { dtype, shape, data_offsets: (start, self.end) };
        self.tensors.push((name.into(), info));
        self.data.push(Box::new(data));
    }

    /// The bytes of the tensors so far.
    pub(crate) fn len(&self) -> usize {
        self.end
    }

    /// Lets the tensor that is added next begin at a multiple of 64 bytes in the file.
    pub(crate) fn align(&mut self) {
        self.aligned = self.end;
    }

    /// Writes the file that was begun for `path`, and puts it in its place: there is never half a
    /// file, and the old one stays until the new one is whole. Programs that have the old file open
    /// or mapped keep it. Errors say that surefix cannot `action`.
    pub(crate) fn save(
        self,
        file: AtomicFile,
        path: &Path,
        action: &'static str,
        format: &Format,
        entry: &impl Serialize,
    ) -> Result<(), Error> {
        let failed = |source| Error::Io { path: path.to_owned(), action, source };
        let mut out = BufWriter::with_capacity(PIECE, file);
        self.write(&mut out, &failed, format, entry)?;
        let file = out.into_inner().map_err(|error| failed(error.into_error()))?;
        file.commit().map_err(failed)
    }

    /// The same bytes in memory.
    #[expect(clippy::wrong_self_convention, reason = "streams are written once")]
    pub(crate) fn to_bytes(
        self,
        format: &Format,
        entry: &impl Serialize,
    ) -> Result<Vec<u8>, Error> {
        let mut bytes = Vec::with_capacity(self.end + (1 << 12));
        let failed = |source: io::Error| Error::Snapshot { reason: source.to_string() };
        self.write(&mut bytes, &failed, format, entry)?;
        Ok(bytes)
    }

    fn write(
        mut self,
        out: &mut dyn Write,
        failed: &dyn Fn(io::Error) -> Error,
        format: &Format,
        entry: &impl Serialize,
    ) -> Result<(), Error> {
        let data = std::mem::take(&mut self.data);
        let ends: Vec<usize> = self.tensors.iter().map(|(_, info)| info.data_offsets.1).collect();
        let header = self.header(format, entry).map_err(failed)?;
        let mut sink = Sink { out, hash: XxHash3_64::with_seed(0), written: 0, failed };
        sink.bytes(&header)?;
        let start = sink.written;
        for (data, end) in data.into_iter().zip(ends) {
            data(&mut sink)?;
            let got = sink.written - start;
            if got != end {
                let wrong = format!("expected the tensors to end at byte {end}, got {got}");
                return Err(failed(io::Error::other(wrong)));
            }
        }
        let checksum = sink.hash.finish().to_le_bytes();
        sink.bytes(&checksum)
    }

    fn header(mut self, format: &Format, entry: &impl Serialize) -> io::Result<Vec<u8>> {
        self.stream(CHECKSUM, Dtype::U8, vec![WORD], |_| Ok(()));
        if self.tensors.len() > MAX_TENSORS {
            let many =
                format!("expected at most {MAX_TENSORS} tensors, got {}", self.tensors.len());
            return Err(io::Error::other(many));
        }
        let &Format { name: format, version } = format;
        let entry = Stamped { format, version, checksum: "xxh3-64", rest: entry };
        let entries = HashMap::from([(ENTRY.to_owned(), serde_json::to_string(&entry)?)]);
        let metadata = Metadata::new(Some(entries), self.tensors).map_err(io::Error::other)?;
        let mut text = serde_json::to_vec(&metadata)?;
        let aligned = WORD + text.len() + self.aligned;
        text.resize(text.len() + aligned.next_multiple_of(LINE) - aligned, b' ');
        if text.len() > MAX_HEADER {
            let got = text.len();
            let long = format!("expected a header of at most {MAX_HEADER} bytes, got {got}");
            return Err(io::Error::other(long));
        }
        Ok([&(text.len() as u64).to_le_bytes(), text.as_slice()].concat())
    }
}

impl Sink<'_> {
    pub(crate) fn bytes(&mut self, bytes: &[u8]) -> Result<(), Error> {
        for piece in bytes.chunks(PIECE) {
            check()?;
            self.hash.write(piece);
            self.out.write_all(piece).map_err(self.failed)?;
        }
        self.written += bytes.len();
        Ok(())
    }

    /// Numbers of `size` bytes each, as they lie in memory.
    pub(crate) fn numbers(&mut self, bytes: &[u8], size: usize) -> Result<(), Error> {
        if cfg!(target_endian = "little") {
            return self.bytes(bytes);
        }
        for piece in bytes.chunks(size * (1 << 16)) {
            let mut piece = piece.to_vec();
            swap_to_file_order(&mut piece, size);
            self.bytes(&piece)?;
        }
        Ok(())
    }
}
