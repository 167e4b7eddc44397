//! Files that hold more than one image.

use std::ffi::OsStr;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use crate::parallel::each;
use crate::regular;

/// The most pages of a TIFF that are looked at.
const PAGES: usize = 16;

/// Says of how many files only the first image is taken: TIFF of several pages, PNG and WebP that
/// move.
pub(super) fn several(paths: &[PathBuf]) -> Option<String> {
    let holds = each(0..paths.len(), || (), |(), index| Ok(has_several(&paths[index])));
    match holds.ok()?.into_iter().filter(|&holds| holds).count() {
        0 => None,
        1 => Some("1 file holds several images: the first of it is taken".to_owned()),
        count => Some(format!("{count} files hold several images: the first of each is taken")),
    }
}

fn has_several(path: &Path) -> bool {
    let ending = path.extension().map(OsStr::to_ascii_lowercase).unwrap_or_default();
    // These alone may; the others need not be opened.
    if !["png", "tif", "tiff", "webp", ""].iter().any(|&known| ending == *known) {
        return false;
    }
    // What is wrong with a file shows when it is read.
    regular::open(path)
        .and_then(|(file, _)| counts_several(BufReader::with_capacity(512, file)))
        .unwrap_or(false)
}

fn counts_several(mut file: impl Read + Seek) -> io::Result<bool> {
    let start: [u8; 8] = read(&mut file)?;
    match &start {
        b"\x89PNG\r\n\x1a\n" => png(&mut file),
        [b'R', b'I', b'F', b'F', ..] => {
            // The flags of the extended header.
            let head: [u8; 13] = read(&mut file)?;
            Ok(head.starts_with(b"WEBPVP8X") && head[12] & 2 != 0)
        }
        [b'I', b'I', kind @ (42 | 43), 0, ..] | [b'M', b'M', 0, kind @ (42 | 43), ..] => {
            Tiff { file, little: start[0] == b'I', big: *kind == 43 }.pages(start)
        }
        _ => Ok(false),
    }
}

fn read<const N: usize>(file: &mut impl Read) -> io::Result<[u8; N]> {
    let mut bytes = [0; N];
    file.read_exact(&mut bytes)?;
    Ok(bytes)
}

/// Whether the control of an animation comes before the picture.
fn png(file: &mut (impl Read + Seek)) -> io::Result<bool> {
    loop {
        let [length @ .., a, b, c, d] = read::<8>(file)?;
        match &[a, b, c, d] {
            b"acTL" => return Ok(u32::from_be_bytes(read(file)?) > 1),
            b"IDAT" | b"IEND" => return Ok(false),
            _ => file.seek_relative(i64::from(u32::from_be_bytes(length)) + 4)?,
        }
    }
}

struct Tiff<R> {
    file: R,
    little: bool,
    big: bool,
}

impl<R: Read + Seek> Tiff<R> {
    /// Whether a page after the first is neither a smaller copy of one nor a mask.
    fn pages(mut self, start: [u8; 8]) -> io::Result<bool> {
        let mut at = if self.big {
            self.number(8)?
        } else {
            let at = [start[4], start[5], start[6], start[7]];
            u64::from(if self.little { u32::from_le_bytes(at) } else { u32::from_be_bytes(at) })
        };
        for page in 0..PAGES {
            if at == 0 {
                return Ok(false);
            }
            self.file.seek(SeekFrom::Start(at))?;
            let (size, count) =
                if self.big { (20, self.number(8)?) } else { (12, self.number(2)?) };
            let tags = self.file.stream_position()?;
            if page > 0 && !self.is_copy(count, size)? {
                return Ok(true);
            }
            let end = count.checked_mul(size).and_then(|length| length.checked_add(tags));
            self.file.seek(SeekFrom::Start(end.unwrap_or(u64::MAX >> 1)))?;
            at = self.number(if self.big { 8 } else { 4 })?;
        }
        Ok(false)
    }

    /// By the tag `NewSubfileType`, which is the first if there is one.
    fn is_copy(&mut self, count: u64, size: u64) -> io::Result<bool> {
        for _ in 0..count.min(2) {
            let tag = self.number(2)?;
            let _kind = self.number(2)?;
            let _count = self.number(if self.big { 8 } else { 4 })?;
            let value = self.number(4)?;
            if tag == 254 {
                return Ok(value & 0b101 != 0);
            }
            self.file.seek_relative(size as i64 - if self.big { 16 } else { 12 })?;
        }
        Ok(false)
    }

    fn number(&mut self, size: usize) -> io::Result<u64> {
        let mut bytes = vec![0; size];
        self.file.read_exact(&mut bytes)?;
        if !self.little {
            bytes.reverse();
        }
        Ok(bytes.iter().rev().fold(0, |number, &byte| number << 8 | u64::from(byte)))
    }
}
