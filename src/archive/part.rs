//! A part: what a writer fills beside the file or folder that it will replace.
//!
//! Its name follows from the target's, so that all writers of one target meet at it. A writer makes
//! the part under that name, which must be free, and locks it for as long as it works. Whoever finds
//! a part that is locked names the writer and gives up; one that is not locked is left of a writer
//! that was killed, and is swept. Only who holds a part's lock takes its name away, by moving it to
//! the target or by sweeping it. So after each lock a writer looks whether the name still means what
//! it has locked, and else begins again: then the other was faster.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::hash::Hasher as _;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use twox_hash::XxHash3_64;

/// The longest name of a part; encrypted file systems take no longer ones.
const MAX_NAME: usize = 143;
/// How often others may be faster, before something else must be wrong.
const MAX_RACES: usize = 1000;
const ENDING: &str = ".part";

#[derive(Clone, Copy)]
pub(super) enum Kind {
    /// For its owner alone until it is done, if it is private. So is a folder.
    File {
        private: bool,
    },
    Folder {
        private: bool,
    },
}

/// A part that this writer holds. Dropped, it goes.
pub(super) struct Part {
    pub(super) path: PathBuf,
    /// The file, or the folder as far as the system opens those.
    pub(super) file: File,
    /// Of the process that made it: a fork's copy must not remove it.
    process: u32,
    /// Whether it was moved away from its name.
    moved: bool,
}

impl Part {
    /// Makes the part of `target`. Before one that a killed writer left is removed, `sweep` may move
    /// it away.
    ///
    /// # Errors
    /// Of the kind `ResourceBusy` if another writer holds it.
    pub(super) fn new(
        target: &Path,
        kind: Kind,
        sweep: &mut dyn FnMut(&Path) -> io::Result<()>,
    ) -> io::Result<Self> {
        Self::at(target.with_file_name(part_name(target)), kind, sweep)
    }

    /// Makes the part of this path.
    pub(super) fn at(
        path: PathBuf,
        kind: Kind,
        sweep: &mut dyn FnMut(&Path) -> io::Result<()>,
    ) -> io::Result<Self> {
        for _ in 0..MAX_RACES {
            if let Some(file) = made(&path, kind)? {
                // A file system without locks is written to all the same.
                let locked = !matches!(file.try_lock(), Err(TryLockError::WouldBlock));
                if locked && is_at(&file, &path) {
                    let process = std::process::id();
                    return Ok(Self { path, file, process, moved: false });
                }
            } else if let Some(file) = opened(&path).map_err(|error| in_the_way(&path, &error))? {
                match file.try_lock() {
                    Ok(()) if is_at(&file, &path) => {
                        sweep(&path)?;
                        remove(&path)?;
                    }
                    Ok(()) => {}
                    Err(TryLockError::WouldBlock) => return Err(busy(&file)),
                    Err(TryLockError::Error(error)) => return Err(in_the_way(&path, &error)),
                }
            }
            std::thread::yield_now();
        }
        Err(io::Error::other(format!("{} comes and goes", path.display())))
    }

    /// Moves it to a name; what was there is replaced.
    pub(super) fn rename(&mut self, to: &Path) -> io::Result<()> {
        if !is_at(&self.file, &self.path) {
            let gone = format!("{} was removed or replaced meanwhile", self.path.display());
            return Err(io::Error::new(ErrorKind::NotFound, gone));
        }
        fs::rename(&self.path, to)?;
        self.moved = true;
        Ok(())
    }

    /// Its name means something else now.
    #[cfg(any(target_os = "linux", target_vendor = "apple"))]
    pub(super) fn has_moved(&mut self) {
        self.moved = true;
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        if self.process != std::process::id() {
            return;
        }
        if !self.moved && is_at(&self.file, &self.path) {
            let _ = remove(&self.path);
        }
        // A fork may still have the file open, and with it the lock.
        let _ = self.file.unlock();
    }
}

/// The name of a target's part.
fn part_name(target: &Path) -> OsString {
    let own = target.file_name().unwrap_or_default();
    let mut name = OsString::from(".");
    name.push(own);
    name.push(ENDING);
    if name.len() > MAX_NAME { format!(".{}{ENDING}", short(own)).into() } else { name }
}

/// In place of a name that is too long.
pub(super) fn short(name: &std::ffi::OsStr) -> String {
    let mut hash = XxHash3_64::with_seed(0);
    hash.write(name.as_encoded_bytes());
    format!("{:016x}", hash.finish())
}

/// The new part; none if the name is taken.
fn made(path: &Path, kind: Kind) -> io::Result<Option<File>> {
    // Systems without modes have other rules.
    #[cfg(not(unix))]
    let (Kind::File { private: _ } | Kind::Folder { private: _ }) = kind;
    let made = match kind {
        Kind::File { private } => {
            let mut options = OpenOptions::new();
            options.read(true).write(true).create_new(true);
            // The umask decides who may read a new file, as for other programs' files.
            #[cfg(unix)]
            std::os::unix::fs::OpenOptionsExt::mode(&mut options, mode(private, 0o666));
            options.open(path)
        }
        Kind::Folder { private } => {
            let mut builder = fs::DirBuilder::new();
            #[cfg(unix)]
            std::os::unix::fs::DirBuilderExt::mode(&mut builder, mode(private, 0o777));
            let open = || folder(path).inspect_err(|_| drop(fs::remove_dir(path)));
            builder.create(path).and_then(|()| open())
        }
    };
    match made {
        Ok(file) => Ok(Some(file)),
        Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(None),
        // A folder that another writer swept before it was opened.
        Err(error)
            if error.kind() == ErrorKind::NotFound && matches!(kind, Kind::Folder { .. }) =>
        {
            if path.parent().is_some_and(Path::is_dir) { Ok(None) } else { Err(error) }
        }
        Err(error) => Err(error),
    }
}

/// The umask takes the rest away.
#[cfg(unix)]
fn mode(private: bool, full: u32) -> u32 {
    if private { full & 0o700 } else { full }
}

/// A part that there is; none if it is gone.
fn opened(path: &Path) -> io::Result<Option<File>> {
    let open = || {
        let about = fs::symlink_metadata(path)?;
        if about.is_dir() {
            return folder(path);
        }
        if !about.is_file() {
            return Err(io::Error::other("it is no file"));
        }
        // Some file systems lock only what is open to be written.
        OpenOptions::new().read(true).write(true).open(path).or_else(|_| File::open(path))
    };
    match open() {
        Ok(file) => Ok(Some(file)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

/// A folder, open to be locked.
fn folder(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.read(true);
    #[cfg(windows)]
    {
        use std::os::windows::fs::OpenOptionsExt as _;
        const FILE_FLAG_BACKUP_SEMANTICS: u32 = 0x0200_0000;
        options.custom_flags(FILE_FLAG_BACKUP_SEMANTICS);
    }
    options.open(path)
}

fn remove(path: &Path) -> io::Result<()> {
    let removed = match fs::symlink_metadata(path) {
        Ok(about) if about.is_dir() => fs::remove_dir_all(path),
        Ok(_) => fs::remove_file(path),
        Err(error) => Err(error),
    };
    removed.or_else(|error| if error.kind() == ErrorKind::NotFound { Ok(()) } else { Err(error) })
}

/// Whether the path still means the file that is open.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let pair = file.metadata().and_then(|own| Ok((own, fs::symlink_metadata(path)?)));
    pair.is_ok_and(|(own, there)| own.dev() == there.dev() && own.ino() == there.ino())
}

/// Files that are open and locked are not moved by others there.
#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

fn in_the_way(path: &Path, error: &io::Error) -> io::Error {
    let path = path.display();
    let said = format!("expected no {path}, the part of another writer or of one that was stopped");
    io::Error::new(error.kind(), format!("{said} ({error}): remove it if no program writes it"))
}

/// The error for a part that another writer holds.
fn busy(file: &File) -> io::Error {
    let who = match holder(file) {
        Some(id) if id == std::process::id() => "another thread of this process".to_owned(),
        Some(id) => {
            let name = fs::read_to_string(format!("/proc/{id}/comm")).unwrap_or_default();
            let name: String = name.trim_end().chars().filter(|c| !c.is_control()).collect();
            let name = if name.is_empty() { name } else { format!(" ({name})") };
            format!("process {id}{name}")
        }
        None => "another process or thread".to_owned(),
    };
    let said = format!("{who} is writing it at this moment: try again when that has ended");
    io::Error::new(ErrorKind::ResourceBusy, said)
}

/// The process that has locked a file, if the system says so.
#[cfg(target_os = "linux")]
fn holder(file: &File) -> Option<u32> {
    use std::os::unix::fs::MetadataExt as _;
    let inode = file.metadata().ok()?.ino().to_string();
    let locks = fs::read_to_string("/proc/locks").ok()?;
    // 1: FLOCK  ADVISORY  WRITE 4242 08:01:131090 0 EOF
    let mut found = locks.lines().filter_map(|line| {
        let words: Vec<_> = line.split_whitespace().collect();
        let [_, "FLOCK", _, _, process, place, ..] = words[..] else { return None };
        (place.rsplit(':').next()? == inode).then(|| process.parse().ok())?
    });
    // The numbers of files of two file systems may be the same.
    let first = found.next()?;
    (first != 0 && found.all(|other| other == first)).then_some(first)
}

#[cfg(not(target_os = "linux"))]
fn holder(_: &File) -> Option<u32> {
    None
}
