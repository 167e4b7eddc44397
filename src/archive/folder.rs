//! A folder that is filled beside its name and then moved there, with all its files at once.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
#[cfg(any(target_os = "linux", target_vendor = "apple"))]
use std::fs::File;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use super::atomic::{behind_links, dress, folder_of, sync_folder};
use super::part::{Kind, Part};

/// The part inside a folder that cannot be replaced as a whole.
const INSIDE: &str = ".surefix.part";

/// Lies in a folder while its files are replaced one by one: until then it is no whole report.
const REPLACING: &str = ".replacing.part";

/// A folder of files to be written: those of an old one stay whole until `commit`, and no other
/// writer can begin one. If it is dropped before, nothing of it is left.
pub struct AtomicFolder {
    part: Part,
    target: PathBuf,
    /// Whether the part lies in the folder, for want of a place beside it.
    #[cfg_attr(not(any(target_os = "linux", target_vendor = "apple")), expect(dead_code))]
    inside: bool,
}

impl AtomicFolder {
    /// Begins the folder that `path` leads to; those above it are made.
    ///
    /// # Errors
    /// If it is a file, or cannot be written; of the kind `ResourceBusy` while another writes it.
    pub fn new(path: &Path) -> io::Result<Self> {
        let target = behind_links(path)?;
        let target = match fs::metadata(&target) {
            Ok(there) if !there.is_dir() => return Err(ErrorKind::NotADirectory.into()),
            Ok(_) => fs::canonicalize(&target)?,
            Err(_) => target,
        };
        fs::create_dir_all(folder_of(&target))?;
        let mut keep_none = |_: &Path| Ok(());
        let kind = Kind::Folder { private: target.is_dir() };
        let beside = match target.file_name() {
            Some(_) => Part::new(&target, kind, &mut keep_none),
            None => Err(ErrorKind::PermissionDenied.into()),
        };
        match beside {
            Ok(part) => Ok(Self { part, target, inside: false }),
            Err(error) if is_closed(&error) && target.is_dir() => {
                let part = Part::at(target.join(INSIDE), kind, &mut keep_none)?;
                Ok(Self { part, target, inside: true })
            }
            Err(error) => Err(error),
        }
    }

    /// The folder to fill.
    pub fn path(&self) -> &Path {
        &self.part.path
    }

    /// Puts the files in their place. `old` are the names of files that an earlier one may have and
    /// this one lacks: they go. If the folder has no file but these and its own, it is replaced as a
    /// whole, in one step. Else the others stay, and its files are moved one by one, each whole,
    /// `last` as the last: so of a page that stands for itself there is always the old or the new.
    /// Meanwhile there is a file `.replacing.part`; it stays if that is stopped.
    ///
    /// # Errors
    /// If a file cannot be moved, or a folder has its name.
    pub fn commit(mut self, old: &[OsString], last: &str) -> io::Result<()> {
        let new = names(&self.part.path)?;
        for name in &new {
            let file = fs::OpenOptions::new().write(true).open(self.part.path.join(name))?;
            dress(&file, &self.target.join(name))?;
            file.sync_all()?;
        }
        sync_folder(&self.part.path);
        if !self.target.exists() {
            self.part.rename(&self.target)?;
            sync_folder(folder_of(&self.target));
            return Ok(());
        }
        let mark = OsString::from(REPLACING);
        let known: BTreeSet<_> = new.iter().chain(old).chain([&mark]).cloned().collect();
        for name in &known {
            if self.target.join(name).is_dir() {
                let said = format!("expected a file {}, got a folder", name.display());
                return Err(io::Error::new(ErrorKind::IsADirectory, said));
            }
        }
        if self.exchange(&known)? {
            return Ok(());
        }
        fs::write(self.target.join(&mark), [])?;
        sync_folder(&self.target);
        for (index, name) in in_order(&new, last).into_iter().enumerate() {
            let moved = fs::rename(self.part.path.join(name), self.target.join(name));
            if moved.is_err() && index == 0 {
                // The older report is whole.
                let _ = fs::remove_file(self.target.join(&mark));
            }
            moved?;
        }
        sync_folder(&self.target);
        for name in old.iter().filter(|name| !new.contains(*name)).chain([&mark]) {
            match fs::remove_file(self.target.join(name)) {
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
                _ => {}
            }
        }
        sync_folder(&self.target);
        Ok(())
    }

    /// Lets the new and the old folder change their names at once; whether that could be done.
    #[cfg(any(target_os = "linux", target_vendor = "apple"))]
    fn exchange(&mut self, known: &BTreeSet<OsString>) -> io::Result<bool> {
        use rustix::fs::{CWD, RenameFlags, renameat_with};
        let working = std::env::current_dir().and_then(fs::canonicalize);
        // Who works in the folder would stay in the old one.
        let here = working.is_ok_and(|working| working.starts_with(&self.target));
        if self.inside || here || !names(&self.target)?.is_subset(known) {
            return Ok(false);
        }
        // Under the part's name it is this writer's, too.
        let old = File::open(&self.target)?;
        if old.try_lock().is_err() {
            return Ok(false);
        }
        dress(&self.part.file, &self.target)?;
        let (new, target) = (&self.part.path, &self.target);
        if renameat_with(CWD, new, CWD, target, RenameFlags::EXCHANGE).is_err() {
            return Ok(false);
        }
        self.part.has_moved();
        sync_folder(folder_of(&self.target));
        // From here on the new one is in its place, and nothing can fail.
        for name in names(&self.part.path).unwrap_or_default().difference(known) {
            let _ = fs::rename(self.part.path.join(name), self.target.join(name));
        }
        let _ = fs::remove_dir_all(&self.part.path);
        Ok(true)
    }

    #[cfg(not(any(target_os = "linux", target_vendor = "apple")))]
    #[expect(clippy::unused_self, clippy::unnecessary_wraps, reason = "other systems can")]
    fn exchange(&mut self, _: &BTreeSet<OsString>) -> io::Result<bool> {
        Ok(false)
    }
}

/// Whether the folder above takes no new names.
fn is_closed(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem)
}

fn names(folder: &Path) -> io::Result<BTreeSet<OsString>> {
    fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name())).collect()
}

fn in_order<'a>(names: &'a BTreeSet<OsString>, last: &str) -> Vec<&'a OsString> {
    let mut names: Vec<_> = names.iter().collect();
    names.sort_by_key(|name| name.as_os_str() == last);
    names
}
