//! Reading an archive.

use std::borrow::Cow;
use std::collections::HashMap;
use std::fmt::Display;
use std::hash::Hasher as _;
use std::io::{self, Read};
use std::ops::Range;

use safetensors::tensor::{Dtype, Metadata, TensorInfo};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use twox_hash::XxHash3_64;

use super::bounds::Bounded;
use super::{
    CHECKSUM, ENTRY, Format, MAX_HEADER, Number, PIECE, Refusal, WORD, in_pieces,
    swap_to_file_order,
};
use crate::interrupt;
use crate::memory;

/// What an archive says of itself. All of its tensors lie within the bytes that there are.
#[derive(Debug)]
pub(crate) struct Header {
    metadata: Metadata,
    /// The metadata entry.
    entry: String,
    signed: bool,
    /// Where the tensors begin in the file.
    start: usize,
}

/// Reads an archive from front to back.
pub(crate) struct Reader<R> {
    pub(crate) header: Header,
    from: R,
    hash: XxHash3_64,
}

/// A header with the tensors' bytes.
pub(crate) struct Tensors<'a> {
    pub(crate) header: Header,
    /// If it has one.
    pub(crate) checksum: Option<u64>,
    data: HashMap<String, Cow<'a, [u8]>>,
}

/// A tensor's shape and numbers.
type Shaped<'a, T> = (&'a [usize], Vec<T>);

/// The part of the metadata entry that every version has.
#[derive(Deserialize)]
struct Stamp {
    format: String,
    version: u64,
    #[serde(default)]
    checksum: Option<String>,
}

impl Header {
    /// Reads the header of `length` bytes of an archive.
    fn read(
        from: &mut impl Read,
        length: u64,
        format: &Format,
        hash: &mut XxHash3_64,
    ) -> Result<Self, Refusal> {
        let broken = |reason: &dyn Display| {
            Refusal::Foreign(format!("truncated, or not a safetensors file ({reason})"))
        };
        let mut first = [0; WORD];
        if length < WORD as u64 {
            return Err(broken(&format!("{length} bytes")));
        }
        from.read_exact(&mut first)?;
        let size = u64::from_le_bytes(first);
        if size > MAX_HEADER as u64 || size > length - WORD as u64 {
            return Err(broken(&format!("a header of {size} bytes in a file of {length}")));
        }
        let mut text = vec![0; size as usize];
        from.read_exact(&mut text)?;
        hash.write(&first);
        hash.write(&text);
        // Its bounds first: what is parsed takes far more memory than the text.
        serde_json::from_slice::<Bounded>(&text).map_err(|e| broken(&e))?;
        let metadata: Metadata = serde_json::from_slice(&text).map_err(|e| broken(&e))?;
        let start = WORD + text.len();
        let (expected, got) = (metadata.data_len() as u64, length - start as u64);
        if expected != got {
            return Err(broken(&format!("expected {expected} bytes after the header, got {got}")));
        }
        let entry = metadata.metadata().as_ref().and_then(|entries| entries.get(ENTRY)).cloned();
        let foreign = |reason: &str| Refusal::Foreign(format!("a safetensors file, but {reason}"));
        let entry =
            entry.ok_or_else(|| foreign("without surefix's entry: some other program wrote it"))?;
        let mut header = Self { metadata, entry, signed: false, start };
        let stamp: Stamp = header.entry()?;
        if stamp.format != format.name {
            let (expected, got) = (format.name, stamp.format);
            return Err(foreign(&format!("expected the format {expected:?}, got {got:?}")));
        }
        if stamp.version == 0 {
            return Err(foreign("expected a version of 1 or more, got 0"));
        }
        if stamp.version > format.version {
            return Err(Refusal::Newer { found: stamp.version, supported: format.version });
        }
        let tensor = header.info(CHECKSUM);
        let last = tensor.is_some_and(|info| {
            (info.dtype, info.data_offsets.1) == (Dtype::U8, got as usize) && info.shape == [WORD]
        });
        let signed = stamp.checksum.is_some() || tensor.is_some();
        if signed && !last {
            return Err(foreign("expected the tensor `checksum` (U8, 8 bytes) at its end"));
        }
        header.signed = signed;
        Ok(header)
    }

    /// The metadata entry as the format has it.
    pub(crate) fn entry<T: DeserializeOwned>(&self) -> Result<T, Refusal> {
        serde_json::from_str(&self.entry).map_err(|e| {
            Refusal::Foreign(format!("a safetensors file, but its entry cannot be read ({e})"))
        })
    }

    /// Whether it has a checksum.
    pub(crate) fn is_signed(&self) -> bool {
        self.signed
    }

    pub(crate) fn info(&self, name: &str) -> Option<&TensorInfo> {
        self.metadata.info(name)
    }

    /// Where a tensor lies in the file.
    pub(crate) fn span(&self, info: &TensorInfo) -> Range<usize> {
        self.start + info.data_offsets.0..self.start + info.data_offsets.1
    }
}

impl<R: Read> Reader<R> {
    /// Reads the header of an archive of `length` bytes.
    pub(crate) fn new(mut from: R, length: u64, format: &Format) -> Result<Self, Refusal> {
        let mut hash = XxHash3_64::with_seed(0);
        let header = Header::read(&mut from, length, format, &mut hash)?;
        Ok(Self { header, from, hash })
    }

    /// Reads the tensors that are `wanted` into memory and compares the checksum; others are only
    /// hashed. The bytes of the tensor `large` go into `into` if that has their length.
    pub(crate) fn tensors(
        mut self,
        wanted: impl Fn(&str) -> bool,
        large: &str,
        mut into: Option<&mut [u8]>,
    ) -> Result<Tensors<'static>, Refusal> {
        let mut data = HashMap::new();
        let Self { header, from, hash } = &mut self;
        let mut stored = None;
        for name in header.metadata.offset_keys() {
            let Some(info) = header.metadata.info(&name) else { continue };
            let size = info.data_offsets.1 - info.data_offsets.0;
            let memory = into.take_if(|memory| name == large && memory.len() == size);
            if name == CHECKSUM && header.signed {
                let mut word = [0; WORD];
                from.read_exact(&mut word)?;
                stored = Some(word);
            } else if let Some(memory) = memory {
                for piece in memory.chunks_mut(PIECE) {
                    unless_stopped()?;
                    from.read_exact(piece)?;
                    hash.write(piece);
                }
            } else if name != large && wanted(&name) {
                let mut bytes = zeros(size)?;
                from.read_exact(&mut bytes)?;
                hash.write(&bytes);
                data.insert(name, bytes.into());
            } else {
                in_pieces(size, |piece| {
                    unless_stopped()?;
                    from.read_exact(piece)?;
                    hash.write(piece);
                    io::Result::Ok(())
                })?;
            }
        }
        check(&self.header, self.hash.finish(), stored)?;
        let checksum = stored.filter(|_| self.header.signed).map(u64::from_le_bytes);
        Ok(Tensors { header: self.header, checksum, data })
    }
}

fn unless_stopped() -> io::Result<()> {
    interrupt::check().map_err(io::Error::other)
}

/// Memory for numbers that a file claims to hold: refused if there is not enough.
fn zeros<T: bytemuck::Zeroable + Clone>(count: usize) -> Result<Vec<T>, Refusal> {
    let mut memory = Vec::new();
    memory::reserve(&mut memory, count)?;
    memory.resize(count, T::zeroed());
    Ok(memory)
}

/// Compares the checksum, if the archive has one.
fn check(header: &Header, expected: u64, got: Option<[u8; WORD]>) -> Result<(), Refusal> {
    if header.signed && got != Some(expected.to_le_bytes()) {
        return Err(Refusal::Foreign("damaged: its checksum does not fit its bytes".to_owned()));
    }
    Ok(())
}

/// Reads an archive that lies in memory, all of it.
pub(crate) fn read(bytes: &[u8], format: &Format) -> Result<Tensors<'static>, Refusal> {
    Reader::new(bytes, bytes.len() as u64, format)?.tensors(|_| true, "", None)
}

/// Compares the checksum of an archive that lies in memory, if it has one.
#[cfg(any(feature = "mmap", test))]
pub(crate) fn verify(bytes: &[u8], format: &Format) -> Result<(), Refusal> {
    let mut hash = XxHash3_64::with_seed(0);
    let header = Header::read(&mut &bytes[..], bytes.len() as u64, format, &mut hash)?;
    let Some((_, rest)) = bytes.split_at_checked(header.start) else { return Ok(()) };
    let Some((data, stored)) = rest.split_last_chunk() else { return Ok(()) };
    hash.write(data);
    check(&header, hash.finish(), Some(*stored))
}

#[cfg(any(feature = "mmap", test))]
impl<'a> Tensors<'a> {
    /// The tensors of an archive that lies in memory, without a look at their bytes.
    pub(crate) fn borrowed(bytes: &'a [u8], format: &Format) -> Result<Self, Refusal> {
        let mut hash = XxHash3_64::with_seed(0);
        let header = Header::read(&mut &bytes[..], bytes.len() as u64, format, &mut hash)?;
        let tensors = header.metadata.tensors().into_iter();
        let data = tensors
            .map(|(name, info)| (name, bytes.get(header.span(info)).unwrap_or_default().into()))
            .collect();
        let stored = bytes.last_chunk().filter(|_| header.signed);
        Ok(Self { checksum: stored.copied().map(u64::from_le_bytes), header, data })
    }
}

impl Tensors<'_> {
    /// A tensor's shape and numbers, or `None` if there is no tensor of that name.
    ///
    /// # Errors
    /// A tensor of another type, or of a shape that does not fit: `expected` says which one does.
    pub(crate) fn numbers<T: Number>(
        &self,
        name: &str,
        expected: &str,
        fits: impl FnOnce(&[usize]) -> bool,
    ) -> Result<Option<Shaped<'_, T>>, Refusal> {
        let Some(info) = self.header.info(name) else { return Ok(None) };
        if info.dtype != T::DTYPE || !fits(&info.shape) {
            let (dtype, got) = (T::DTYPE, format!("{:?} {:?}", info.dtype, info.shape));
            return Err(Refusal::Foreign(format!(
                "{name}: expected a tensor of {dtype:?} {expected}, got {got}"
            )));
        }
        let bytes = self.data.get(name).map_or(&[][..], |bytes| bytes);
        let mut numbers = zeros::<T>(bytes.len() / size_of::<T>())?;
        let memory = bytemuck::must_cast_slice_mut(&mut numbers);
        memory.copy_from_slice(bytes);
        swap_to_file_order(memory, size_of::<T>());
        Ok(Some((&info.shape, numbers)))
    }

    /// A tensor's bytes, without a copy of those that are owned; empty if there is none of that
    /// name.
    pub(crate) fn take(&mut self, name: &str) -> Vec<u8> {
        self.data.remove(name).map(Cow::into_owned).unwrap_or_default()
    }

    /// A tensor's bytes as they lie in the file; none if there is no tensor of that name.
    pub(crate) fn bytes(&self, name: &str) -> &[u8] {
        self.data.get(name).map_or(&[][..], |bytes| bytes)
    }

    /// The same as [`numbers`](Self::numbers), of a tensor that must be there.
    pub(crate) fn required<T: Number>(
        &self,
        name: &str,
        expected: &str,
        fits: impl FnOnce(&[usize]) -> bool,
    ) -> Result<Shaped<'_, T>, Refusal> {
        self.numbers(name, expected, fits)?
            .ok_or_else(|| Refusal::Foreign(format!("{name}: expected a tensor, got none")))
    }
}
