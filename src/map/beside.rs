//! A file that is written beside its place and then renamed: there is never half a file.

use std::fs::File;
use std::io::{self, BufWriter, Read, Write as _};
use std::path::Path;

use tempfile::NamedTempFile;

use super::layout::Layout;
use crate::error::Error;
use crate::post::Post;

/// How much is copied from one file to another between two looks at whether to go on.
const PIECE: u64 = 64 << 20;

/// A file in the making. Its errors name the place that it is for.
pub(super) struct Beside<'a> {
    out: BufWriter<&'a File>,
    path: &'a Path,
}

/// Has `write` write a file beside `path`, and then puts it there. An old file stays until the new
/// one is whole, and where `write` fails; nothing else is left behind. Whoever has the old file
/// open or mapped keeps it as it was.
pub(super) fn write_beside(
    path: &Path,
    write: impl FnOnce(&mut Beside<'_>) -> Result<(), Error>,
) -> Result<(), Error> {
    let io = |source| cannot_write(path, source);
    let file = create(path).map_err(io)?;
    let mut beside = Beside { out: BufWriter::with_capacity(1 << 20, file.as_file()), path };
    write(&mut beside)?;
    beside.out.flush().map_err(io)?;
    drop(beside);
    file.as_file().sync_all().map_err(io)?;
    file.persist(path).map_err(|e| io(e.error))?;
    Ok(())
}

fn create(path: &Path) -> io::Result<NamedTempFile> {
    if path.file_name().is_none() || path.is_dir() {
        return Err(io::Error::other("expected a file name, got a folder"));
    }
    let folder =
        path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !folder.is_dir() {
        let missing = format!("there is no folder {}", folder.display());
        return Err(io::Error::new(io::ErrorKind::NotFound, missing));
    }
    let mut beside = tempfile::Builder::new();
    beside.prefix(".surefix-").suffix(".part");
    #[cfg(unix)]
    {
        // Readable by whom the umask says, as any file that a program makes.
        use std::os::unix::fs::PermissionsExt as _;
        beside.permissions(std::fs::Permissions::from_mode(0o666));
    }
    beside.tempfile_in(folder)
}

fn cannot_write(path: &Path, source: io::Error) -> Error {
    Error::Io { path: path.to_owned(), action: "write the map", source }
}

impl Beside<'_> {
    /// The file's head, which says what follows.
    pub(super) fn head(&mut self, layout: &Layout) -> Result<(), Error> {
        let head = layout.head().map_err(|source| cannot_write(self.path, source))?;
        self.bytes(&head)
    }

    pub(super) fn bytes(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.out.write_all(bytes).map_err(|source| cannot_write(self.path, source))
    }

    pub(super) fn floats(&mut self, numbers: &[f64]) -> Result<(), Error> {
        numbers.iter().try_for_each(|x| self.bytes(&x.to_le_bytes()))
    }

    /// What post-processing adds and multiplies with, step by step: before the rows.
    pub(super) fn vectors_of_post(&mut self, post: Option<&Post>) -> Result<(), Error> {
        let stages = post.map_or(&[][..], Post::fitted_steps).iter();
        stages
            .flat_map(|stage| [&stage.offset, &stage.scale])
            .try_for_each(|numbers| self.floats(numbers))
    }

    /// Its matrices: behind the rows.
    pub(super) fn matrices_of_post(&mut self, post: Option<&Post>) -> Result<(), Error> {
        let mut stages = post.map_or(&[][..], Post::fitted_steps).iter();
        stages.try_for_each(|stage| {
            self.numbers(bytemuck::must_cast_slice(&stage.matrix), size_of::<f32>())
        })
    }

    /// Numbers of `size` bytes each, as they lie in memory.
    pub(super) fn numbers(&mut self, bytes: &[u8], size: usize) -> Result<(), Error> {
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

    /// The next `count` bytes of another file. `go_on` is asked now and then.
    pub(super) fn copied(
        &mut self,
        from: &File,
        count: u64,
        mut go_on: impl FnMut() -> Result<(), Error>,
    ) -> Result<(), Error> {
        let io = |source| cannot_write(self.path, source);
        let mut left = count;
        while left > 0 {
            go_on()?;
            let copied = io::copy(&mut from.take(left.min(PIECE)), &mut self.out).map_err(io)?;
            if copied == 0 {
                return Err(io(io::Error::other(
                    "the old file became shorter while it was copied",
                )));
            }
            left -= copied;
        }
        Ok(())
    }
}

/// Turns numbers of `size` bytes each from memory's order into the file's, which is little-endian,
/// or back.
pub(super) fn swap_to_file_order(bytes: &mut [u8], size: usize) {
    if cfg!(target_endian = "big") {
        bytes.chunks_exact_mut(size).for_each(<[u8]>::reverse);
    }
}
