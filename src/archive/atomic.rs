//! A file that is written under a temporary name and then renamed.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// The most links that a path may lead through, as in Linux.
const MAX_LINKS: usize = 40;

/// A file under a temporary name, in the folder of the file that it will replace.
pub(crate) struct AtomicFile {
    pub(super) temporary: tempfile::NamedTempFile,
    target: PathBuf,
    folder: PathBuf,
    old: Option<fs::Permissions>,
}

impl AtomicFile {
    pub(super) fn beside(path: &Path) -> io::Result<Self> {
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

    /// Refuses a path that no file can be written to.
    pub(crate) fn check(path: &Path) -> io::Result<()> {
        Self::beside(path).map(drop)
    }

    /// A whole file at once.
    #[cfg(feature = "toml")]
    pub(crate) fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
        let mut file = Self::beside(path)?;
        io::Write::write_all(&mut file.temporary, bytes)?;
        file.commit()
    }

    pub(super) fn commit(self) -> io::Result<()> {
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
