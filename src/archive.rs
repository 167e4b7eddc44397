//! The container of maps, snapshots and running statistics: named tensors, one metadata entry
//! `surefix` with a format name, a version and the rest as JSON, and a checksum.
//!
//! It is a safetensors file, so every reader of those shows the tensors. Its last tensor,
//! `checksum`, is the XXH3 hash (64 bits, little-endian) of all bytes before it: header, padding
//! and data. The entry says that there is one, so no flipped byte can hide it. A file that another
//! program wrote may do without both.

use std::borrow::Cow;
use std::collections::HashMap;
use std::fmt::Display;
use std::fs::{self, File};
use std::hash::Hasher as _;
use std::io::{self, BufWriter, Read, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

use safetensors::tensor::{Dtype, Metadata, TensorInfo};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use twox_hash::XxHash3_64;

use crate::error::Error;

/// The one metadata entry. With a second one, the same contents could give different bytes.
const ENTRY: &str = "surefix";
const CHECKSUM: &str = "checksum";
/// The length of the checksum, and of the header's length at the start.
const WORD: usize = 8;
/// The longest header: 4 MiB, and a recipe of 1 MiB, which can be four times as long if its
/// numbers are written out.
const MAX_HEADER: usize = 8 << 20;
/// Rows begin at a multiple of a cache line in the file, and so do those of a mapped file.
const LINE: usize = 64;
/// Bytes that are read and hashed, or copied, at a time.
const PIECE: usize = 1 << 18;
/// The most links that a path may lead through, as in Linux.
const MAX_LINKS: usize = 40;

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

// Writing.

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

    /// Lets the tensor that is added next begin at a multiple of 64 bytes in the file.
    pub(crate) fn align(&mut self) {
        self.aligned = self.end;
    }

    /// Writes the file beside `path` and then renames it: there is never half a file, and the old
    /// one stays until the new one is whole. Programs that have the old file open or mapped keep
    /// it. If `path` is a symbolic link, its target is replaced. The new file has the old one's
    /// mode. Errors say that surefix cannot `action`.
    pub(crate) fn save(
        self,
        path: &Path,
        action: &'static str,
        format: &Format,
        entry: &impl Serialize,
    ) -> Result<(), Error> {
        let failed = |source| Error::Io { path: path.to_owned(), action, source };
        let file = AtomicFile::beside(path).map_err(failed)?;
        let mut out = BufWriter::with_capacity(PIECE, file.temporary.as_file());
        self.write(&mut out, &failed, format, entry)?;
        out.flush().map_err(failed)?;
        drop(out);
        file.commit().map_err(failed)
    }

    /// The same bytes in memory.
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
        self.hash.write(bytes);
        self.written += bytes.len();
        self.out.write_all(bytes).map_err(self.failed)
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

    /// The next `count` bytes of another file. `proceed` is asked before each piece.
    pub(crate) fn copy(
        &mut self,
        from: &mut impl Read,
        count: usize,
        proceed: &mut dyn FnMut() -> Result<(), Error>,
    ) -> Result<(), Error> {
        let failed = self.failed;
        in_pieces(count, |piece| {
            proceed()?;
            from.read_exact(piece).map_err(failed)?;
            self.bytes(piece)
        })
    }
}

/// Calls `each` with memory for the next bytes, until `count` bytes have had their turn.
fn in_pieces<E>(count: usize, mut each: impl FnMut(&mut [u8]) -> Result<(), E>) -> Result<(), E> {
    let mut memory = vec![0; count.min(PIECE)];
    let mut left = count;
    while left > 0 {
        let size = left.min(PIECE);
        each(&mut memory[..size])?;
        left -= size;
    }
    Ok(())
}

/// A file under a temporary name, in the folder of the file that it will replace.
struct AtomicFile {
    temporary: tempfile::NamedTempFile,
    target: PathBuf,
    folder: PathBuf,
    old: Option<fs::Permissions>,
}

impl AtomicFile {
    fn beside(path: &Path) -> io::Result<Self> {
        let target = behind_links(path)?;
        let old = fs::metadata(&target).ok();
        if target.file_name().is_none() || old.as_ref().is_some_and(fs::Metadata::is_dir) {
            return Err(io::Error::other("expected a file name, got a folder"));
        }
        if old.as_ref().is_some_and(|old| !old.is_file()) {
            return Err(io::Error::other("expected a file, got a device or a pipe"));
        }
        let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new(".")).to_owned();
        if !folder.is_dir() {
            let missing = format!("there is no folder {}", folder.display());
            return Err(io::Error::new(io::ErrorKind::NotFound, missing));
        }
        let mut builder = tempfile::Builder::new();
        builder.prefix(".surefix-").suffix(".part");
        // The umask decides who may read a new file, as for other programs' files.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let temporary = builder.tempfile_in(&folder)?;
        Ok(Self { temporary, target, folder, old: old.map(|old| old.permissions()) })
    }

    fn commit(self) -> io::Result<()> {
        if let Some(mode) = self.old {
            self.temporary.as_file().set_permissions(mode)?;
        }
        self.temporary.as_file().sync_all()?;
        self.temporary.persist(&self.target).map_err(|e| e.error)?;
        // The new name survives a power cut once the folder is on the disk. Some file systems
        // cannot sync a folder, and the file is in its place either way.
        if let Ok(folder) = File::open(&self.folder) {
            let _ = folder.sync_all();
        }
        Ok(())
    }
}

/// The file that a path leads to through symbolic links, whether or not it exists.
fn behind_links(path: &Path) -> io::Result<PathBuf> {
    let mut target = path.to_owned();
    for _ in 0..MAX_LINKS {
        match fs::read_link(&target) {
            Ok(next) => target = target.parent().unwrap_or(Path::new("")).join(next),
            Err(_) => return Ok(target),
        }
    }
    Err(io::Error::other(format!("expected at most {MAX_LINKS} symbolic links in a row, got more")))
}

// Reading.

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
    data: HashMap<String, Cow<'a, [u8]>>,
}

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

    /// Reads the tensors into memory and compares the checksum. The tensor `large` is not among
    /// them: its bytes go into `into` if that has their length, else they are only hashed.
    pub(crate) fn tensors(
        mut self,
        large: &str,
        mut into: Option<&mut [u8]>,
    ) -> Result<Tensors<'static>, Refusal> {
        let mut data = HashMap::new();
        let Self { header, from, hash } = &mut self;
        let mut stored = None;
        for name in header.metadata.offset_keys() {
            let Some(info) = header.metadata.info(&name) else { continue };
            let size = info.data_offsets.1 - info.data_offsets.0;
            if name == large {
                match into.take() {
                    Some(memory) if memory.len() == size => {
                        for piece in memory.chunks_mut(PIECE) {
                            from.read_exact(piece)?;
                            hash.write(piece);
                        }
                    }
                    _ => in_pieces(size, |piece| {
                        from.read_exact(piece)?;
                        hash.write(piece);
                        io::Result::Ok(())
                    })?,
                }
                continue;
            }
            let mut bytes = vec![0; size];
            from.read_exact(&mut bytes)?;
            if name == CHECKSUM {
                stored = bytes.as_slice().try_into().ok();
                continue;
            }
            hash.write(&bytes);
            data.insert(name, bytes.into());
        }
        check(&self.header, self.hash.finish(), stored)?;
        Ok(Tensors { header: self.header, data })
    }
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
    Reader::new(bytes, bytes.len() as u64, format)?.tensors("", None)
}

/// Compares the checksum of an archive that lies in memory, if it has one.
pub(crate) fn verify(bytes: &[u8], format: &Format) -> Result<(), Refusal> {
    let mut hash = XxHash3_64::with_seed(0);
    let header = Header::read(&mut &bytes[..], bytes.len() as u64, format, &mut hash)?;
    let Some((_, rest)) = bytes.split_at_checked(header.start) else { return Ok(()) };
    let Some((data, stored)) = rest.split_last_chunk() else { return Ok(()) };
    hash.write(data);
    check(&header, hash.finish(), Some(*stored))
}

impl<'a> Tensors<'a> {
    /// The tensors of an archive that lies in memory, without a look at their bytes.
    pub(crate) fn borrowed(bytes: &'a [u8], format: &Format) -> Result<Self, Refusal> {
        let mut hash = XxHash3_64::with_seed(0);
        let header = Header::read(&mut &bytes[..], bytes.len() as u64, format, &mut hash)?;
        let tensors = header.metadata.tensors().into_iter();
        let data = tensors
            .map(|(name, info)| (name, bytes.get(header.span(info)).unwrap_or_default().into()))
            .collect();
        Ok(Self { header, data })
    }

    /// A tensor's shape and numbers, or `None` if there is no tensor of that name.
    ///
    /// # Errors
    /// A tensor of another type, or of a shape that does not fit: `expected` says which one does.
    pub(crate) fn numbers<T: Number>(
        &self,
        name: &str,
        expected: &str,
        fits: impl FnOnce(&[usize]) -> bool,
    ) -> Result<Option<(&[usize], Vec<T>)>, Refusal> {
        let Some(info) = self.header.info(name) else { return Ok(None) };
        if info.dtype != T::DTYPE || !fits(&info.shape) {
            let (dtype, got) = (T::DTYPE, format!("{:?} {:?}", info.dtype, info.shape));
            return Err(Refusal::Foreign(format!(
                "{name}: expected a tensor of {dtype:?} {expected}, got {got}"
            )));
        }
        let bytes = self.data.get(name).map_or(&[][..], |bytes| bytes);
        let mut numbers = vec![T::zeroed(); bytes.len() / size_of::<T>()];
        let memory = bytemuck::must_cast_slice_mut(&mut numbers);
        memory.copy_from_slice(bytes);
        swap_to_file_order(memory, size_of::<T>());
        Ok(Some((&info.shape, numbers)))
    }

    /// The same, of a tensor that must be there.
    pub(crate) fn required<T: Number>(
        &self,
        name: &str,
        expected: &str,
        fits: impl FnOnce(&[usize]) -> bool,
    ) -> Result<(&[usize], Vec<T>), Refusal> {
        self.numbers(name, expected, fits)?
            .ok_or_else(|| Refusal::Foreign(format!("{name}: expected a tensor, got none")))
    }
}

#[cfg(test)]
mod tests {
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
        assert_eq!(at % LINE, 0);
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
        reader.tensors("rows", Some(&mut rows)).unwrap();
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
