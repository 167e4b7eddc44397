//! Files to be read: regular ones. A pipe may never end, and a device never does.

use std::fs::{self, File, Metadata};
use std::io;
use std::path::Path;

/// Opens a regular file, and gives its length.
///
/// # Errors
/// The system's, and one in words for a pipe, a device or a socket.
pub(crate) fn open(path: &Path) -> io::Result<(File, u64)> {
    // Before it is opened: to open a pipe waits for its other end.
    check(&fs::metadata(path)?)?;
    let file = File::open(path)?;
    let about = file.metadata()?;
    check(&about)?;
    Ok((file, about.len()))
}

/// The bytes of a regular file of at most `most` bytes.
///
/// # Errors
/// As for [`open`], and one in words for a longer file.
#[cfg(any(feature = "image", feature = "toml"))]
pub(crate) fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let (file, length) = open(path)?;
    if length > most {
        let long = format!("expected a file of at most {most} bytes, got one of {length}");
        return Err(io::Error::other(long));
    }
    let mut bytes = Vec::new();
    crate::memory::reserve(&mut bytes, length as usize)?;
    // It may have become longer since.
    io::Read::read_to_end(&mut io::Read::take(file, most), &mut bytes)?;
    Ok(bytes)
}

fn check(about: &Metadata) -> io::Result<()> {
    let kind = about.file_type();
    if kind.is_file() {
        return Ok(());
    }
    if kind.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    Err(io::Error::other(format!("expected a file, got {}", name_of(kind))))
}

#[cfg(unix)]
fn name_of(kind: fs::FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt as _;
    if kind.is_fifo() {
        "a pipe"
    } else if kind.is_socket() {
        "a socket"
    } else {
        "a device"
    }
}

#[cfg(not(unix))]
fn name_of(_kind: fs::FileType) -> &'static str {
    "none"
}
