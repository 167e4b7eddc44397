//! A file that is written beside its name and then moved there.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Seek as _, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::part::{Kind, Part, short};

/// The most links that a path may lead through, as in Linux.
const MAX_LINKS: usize = 40;
/// The longest name that file systems take.
const MAX_NAME: usize = 255;

/// A file to be written: the old one stays whole until `commit`, and no other writer can begin one.
/// If it is dropped before, nothing of it is left.
pub struct AtomicFile {
    part: Part,
    target: PathBuf,
    left: Option<PathBuf>,
}

impl AtomicFile {
    /// Begins the file that `path` leads to through symbolic links. What a killed writer left of it
    /// is removed.
    ///
    /// # Errors
    /// If it is no file, or cannot be written; of the kind `ResourceBusy` while another writes it.
    pub fn new(path: &Path) -> io::Result<Self> {
        Self::begin(path, false)
    }

    /// As `new`, for rows that are of use one by one: those that a killed writer left are kept under
    /// another name, `left`.
    ///
    /// # Errors
    /// As for `new`.
    pub fn of_rows(path: &Path) -> io::Result<Self> {
        Self::begin(path, true)
    }

    fn begin(path: &Path, rows: bool) -> io::Result<Self> {
        let target = behind_links(path)?;
        let old = existing(fs::metadata(&target))?;
        if target.file_name().is_none() || old.as_ref().is_some_and(fs::Metadata::is_dir) {
            return Err(io::Error::other("expected a file name, got a folder"));
        }
        if is_stream(path) {
            return Err(io::Error::other("expected a file, got a device or a pipe"));
        }
        let folder = folder_of(&target);
        if !folder.is_dir() {
            let missing = format!("there is no folder {}", folder.display());
            return Err(io::Error::new(ErrorKind::NotFound, missing));
        }
        let mut left = None;
        let kind = Kind::File { private: old.is_some() };
        let part = Part::new(&target, kind, &mut |found| {
            if rows && fs::metadata(found)?.len() > 0 {
                dress(&File::open(found)?, &target)?;
                left = Some(move_aside(found, &target)?);
            }
            Ok(())
        })?;
        Ok(Self { part, target, left })
    }

    /// The part: for another library to write to, on systems whose locks do not keep it out (Unix).
    pub fn path(&self) -> &Path {
        &self.part.path
    }

    /// The rows of a killed writer, if there were some.
    pub fn left(&self) -> Option<&Path> {
        self.left.as_deref()
    }

    /// A whole file at once.
    ///
    /// # Errors
    /// As for `new` and `commit`.
    pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
        let mut file = Self::new(path)?;
        file.write_all(bytes)?;
        file.commit()
    }

    /// Puts the file in its place, with the mode and, if that is allowed, the owner of an old one.
    ///
    /// # Errors
    /// If it cannot be; the old file is then as it was.
    pub fn commit(mut self) -> io::Result<()> {
        self.finish()?;
        self.part.rename(&self.target)?;
        sync_folder(folder_of(&self.target));
        Ok(())
    }

    /// Leaves the target as it was, and keeps what there is beside it under another name, which is
    /// returned; nothing if it is empty.
    ///
    /// # Errors
    /// If it cannot be kept.
    pub fn keep(mut self) -> io::Result<Option<PathBuf>> {
        if self.part.file.metadata()?.len() == 0 {
            return Ok(None);
        }
        self.finish()?;
        let kept = move_aside(&self.part.path, &self.target)?;
        sync_folder(folder_of(&self.target));
        Ok(Some(kept))
    }

    fn finish(&mut self) -> io::Result<()> {
        dress(&self.part.file, &self.target)?;
        self.part.file.sync_all()
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.part.file.write(bytes)
    }

    /// All of them or none, so that a full disk leaves no half a row.
    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        let file = &mut self.part.file;
        let start = file.stream_position()?;
        file.write_all(bytes).inspect_err(|_| {
            let _ = file.set_len(start).and_then(|()| file.seek(SeekFrom::Start(start)));
        })
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Writes text by `write`: a file as a whole, and what is no file, such as `/dev/stdout` or a pipe,
/// itself.
///
/// # Errors
/// As for [`AtomicFile`], and those of `write`.
pub fn write_text(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    if is_stream(path) {
        // Nothing before it is lost if it leads to a file after all.
        let mut out = io::BufWriter::new(fs::OpenOptions::new().append(true).open(path)?);
        write(&mut out)?;
        return out.flush();
    }
    let mut out = io::BufWriter::new(AtomicFile::new(path)?);
    write(&mut out)?;
    out.into_inner().map_err(io::IntoInnerError::into_error)?.commit()
}

/// Whether a path leads to a device, a pipe, or what the process has open, such as `/dev/stdout`.
pub fn is_stream(path: &Path) -> bool {
    let open = |link: &Path| {
        let folder = fs::canonicalize(folder_of(link)).unwrap_or_default();
        folder.starts_with("/proc") || folder.starts_with("/dev/fd")
    };
    let mut link = path.to_owned();
    for _ in 0..MAX_LINKS {
        let Ok(next) = fs::read_link(&link) else { break };
        if open(&link) {
            return true;
        }
        link = folder_of(&link).join(next);
    }
    fs::metadata(path).is_ok_and(|there| !there.is_file() && !there.is_dir())
}

/// The file that a path leads to through symbolic links, whether or not it exists.
pub(super) fn behind_links(path: &Path) -> io::Result<PathBuf> {
    let mut target = path.to_owned();
    for _ in 0..MAX_LINKS {
        let there = existing(fs::symlink_metadata(&target))?;
        if !there.is_some_and(|there| there.is_symlink()) {
            return Ok(target);
        }
        target = target.parent().unwrap_or(Path::new("")).join(fs::read_link(&target)?);
    }
    Err(io::Error::other(format!("expected at most {MAX_LINKS} symbolic links in a row, got more")))
}

/// What is there, if anything is. What cannot be looked at is not taken for missing.
fn existing(looked: io::Result<fs::Metadata>) -> io::Result<Option<fs::Metadata>> {
    match looked {
        Ok(there) => Ok(Some(there)),
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A new name survives a power cut once the folder is on the disk. Some file systems cannot sync a
/// folder, and the file is in its place either way.
pub(super) fn sync_folder(folder: &Path) {
    if let Ok(folder) = File::open(folder) {
        let _ = folder.sync_all();
    }
}

/// Gives a file or folder the mode and the owner of the one that it will replace, if there is one.
#[cfg(unix)]
pub(super) fn dress(new: &File, target: &Path) -> io::Result<()> {
    use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _, fchown};
    let Some(old) = existing(fs::metadata(target))? else { return Ok(()) };
    let own = new.metadata()?;
    let mut mode = old.mode() & 0o7777;
    if own.uid() != old.uid() {
        // For the administrator alone.
        let _ = fchown(new, Some(old.uid()), None);
    }
    if own.gid() != old.gid() && fchown(new, None, Some(old.gid())).is_err() {
        // Another group may do what all may.
        mode = mode & !0o070 | (mode & 0o007) << 3;
    }
    new.set_permissions(fs::Permissions::from_mode(mode))
}

#[cfg(not(unix))]
pub(super) fn dress(new: &File, target: &Path) -> io::Result<()> {
    match existing(fs::metadata(target))? {
        Some(old) if old.is_file() => new.set_permissions(old.permissions()),
        _ => Ok(()),
    }
}

/// Moves a part to the first free of the target's other names: `fixes.part.csv`, then
/// `fixes.part2.csv`.
fn move_aside(part: &Path, target: &Path) -> io::Result<PathBuf> {
    let stem = target.file_stem().unwrap_or_default();
    let ending = target.extension();
    for count in 1_u32.. {
        let number = if count == 1 { String::new() } else { count.to_string() };
        let name = |stem: &OsStr| {
            let mut name = stem.to_owned();
            name.push(format!(".part{number}"));
            if let Some(ending) = ending {
                name.push(".");
                name.push(ending);
            }
            name
        };
        let full = name(stem);
        let fits = full.len() <= MAX_NAME;
        let to = target.with_file_name(if fits { full } else { name(short(stem).as_ref()) });
        match fs::hard_link(part, &to) {
            Ok(()) => return fs::remove_file(part).map(|()| to),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            // A file system without hard links.
            Err(_) if fs::symlink_metadata(&to).is_err() => {
                return fs::rename(part, &to).map(|()| to);
            }
            Err(_) => {}
        }
    }
    Err(io::Error::other("expected a free name"))
}
