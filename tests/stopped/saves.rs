//! The saves, and the matrix of their calls.

use std::collections::{BTreeMap, HashMap};
use std::env;
use std::ffi::OsString;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

#[cfg(feature = "toml")]
use surefix::Settings;
use surefix::saving::{AtomicFile, AtomicFolder};
use surefix::{Map, Metric};

/// Names the save and the folder to the child.
const SAVE: &str = "SUREFIX_TEST_SAVE";
const FOLDER: &str = "SUREFIX_TEST_FOLDER";
/// The calls that look at files or change them; the write to a terminal at the end is no such.
const CALLS: &str = "%file,read,write,fsync,flock,close,fchmod,fchown,ftruncate,lseek,getdents64";
const PAGE: &str = "report.html";

/// Files by their names, relative to the folder.
type Files = BTreeMap<String, Vec<u8>>;

/// A way to save, in a folder that `before` fills.
struct Save {
    name: &'static str,
    before: fn(&Path),
    run: fn(&Path) -> Result<(), Box<dyn std::error::Error>>,
    /// The files that are replaced together.
    together: fn(&str) -> bool,
}

const SAVES: &[Save] = &[
    Save { name: "a map", before: old_map, run: save_map, together: |_| true },
    Save { name: "a map that is new", before: |_| {}, run: save_map, together: |_| true },
    Save { name: "an append", before: old_map, run: append, together: |_| true },
    Save { name: "through links", before: linked_map, run: save_map, together: |_| true },
    Save { name: "rows", before: old_rows, run: save_rows, together: |_| true },
    #[cfg(feature = "toml")]
    Save { name: "settings", before: old_settings, run: save_settings, together: |_| true },
    Save { name: "a report", before: old_report, run: report, together: |_| true },
    Save { name: "a report that is new", before: |_| {}, run: report, together: |_| true },
    Save {
        name: "a report beside other files",
        before: shared_report,
        run: report,
        together: |name| name == "report/report.html",
    },
];

pub(super) fn main() {
    if let Some(name) = env::var_os(SAVE) {
        let save = SAVES.iter().find(|save| *save.name == *name).unwrap();
        let folder = PathBuf::from(env::var_os(FOLDER).unwrap());
        if let Err(error) = (save.run)(&folder) {
            eprintln!("{error}");
            std::process::exit(1);
        }
        return;
    }
    // In memory, if that is offered: nothing waits for a disk.
    let folder = tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap();
    let tried = Command::new("strace").args(["-qq", "-o", "/dev/null", "true"]).output();
    if !tried.is_ok_and(|tried| tried.status.success()) {
        println!("skipped: strace is not installed, or may not trace");
        return;
    }
    let mut count = 0;
    for (index, save) in SAVES.iter().enumerate() {
        count += Matrix::new(save, folder.path().join(index.to_string())).run();
    }
    println!("{count} stops: the old or the new one after each");
}

fn map(value: f32) -> Map {
    Map::from_descriptors(vec![value; 40], 4, Metric::Euclidean).unwrap()
}

fn old_map(folder: &Path) {
    map(1.0).save(folder.join("map")).unwrap();
}

fn linked_map(folder: &Path) {
    map(1.0).save(folder.join("target")).unwrap();
    std::os::unix::fs::symlink("target", folder.join("map")).unwrap();
}

fn save_map(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    Ok(map(2.0).save(folder.join("map"))?)
}

fn append(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    Ok(Map::append(folder.join("map"), &map(2.0))?)
}

fn old_rows(folder: &Path) {
    fs::write(folder.join("fixes.csv"), "an old row\n").unwrap();
}

fn save_rows(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let mut file = AtomicFile::of_rows(&folder.join("fixes.csv"))?;
    for row in ["a,b\n", "1,2\n", "3,4\n"] {
        if let Err(error) = file.write_all(row.as_bytes()) {
            file.keep()?;
            return Err(error.into());
        }
    }
    Ok(file.commit()?)
}

#[cfg(feature = "toml")]
fn old_settings(folder: &Path) {
    Settings::default().save(folder.join("route.toml")).unwrap();
}

#[cfg(feature = "toml")]
fn save_settings(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let settings = Settings::from_toml("[config]\nmotion = \"steady\"")?;
    Ok(settings.save(folder.join("route.toml"))?)
}

fn old_report(folder: &Path) {
    fs::create_dir(folder.join("report")).unwrap();
    for name in [PAGE, "curve.png", "gone.csv"] {
        fs::write(folder.join("report").join(name), format!("old {name}")).unwrap();
    }
}

fn shared_report(folder: &Path) {
    old_report(folder);
    fs::write(folder.join("report/notes.txt"), "the user's").unwrap();
    fs::create_dir(folder.join("report/more")).unwrap();
    fs::write(folder.join("report/more/notes.txt"), "the user's").unwrap();
}

fn report(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let new = AtomicFolder::new(&folder.join("report"))?;
    for name in ["curve.png", "table.csv", PAGE] {
        fs::write(new.path().join(name), format!("new {name}"))?;
    }
    Ok(new.commit(&[OsString::from("gone.csv")], PAGE)?)
}

/// A save that is stopped at each of its calls.
struct Matrix<'a> {
    save: &'a Save,
    folder: PathBuf,
    old: Files,
    new: Files,
}

impl<'a> Matrix<'a> {
    fn new(save: &'a Save, folder: PathBuf) -> Self {
        fs::create_dir(&folder).unwrap();
        let mut matrix = Self { save, folder, old: Files::new(), new: Files::new() };
        matrix.old = matrix.begin();
        assert!(matrix.child(&[]).status.success());
        matrix.new = files(&matrix.folder);
        assert_ne!(matrix.old, matrix.new);
        assert!(matrix.new.keys().all(|name| !name.contains(".part")), "{:?}", matrix.new.keys());
        matrix
    }

    fn run(&self) -> usize {
        let calls = self.calls();
        assert!(calls.len() > 8, "{}: {calls:?}", self.save.name);
        for call in &calls {
            self.stop(&format!("{}:signal=KILL:when={}", call.0, call.1));
        }
        // No file is lost by a close that fails, and Rust's own folders cannot bear one.
        let errors = calls.iter().filter(|call| call.0 != "close");
        for call in errors.clone() {
            self.stop(&format!("{}:error=ENOSPC:when={}", call.0, call.1));
        }
        calls.len() + errors.count()
    }

    /// The save's calls, each with its number among those of its name.
    fn calls(&self) -> Vec<(String, usize)> {
        self.begin();
        let log = self.folder.with_extension("log");
        let log_name = log.to_str().unwrap();
        let traced = self.child(&["strace", "-qq", "-y", "-e", CALLS, "-o", log_name]);
        assert!(traced.status.success(), "{traced:?}");
        let log = fs::read_to_string(log).unwrap();
        let folder = self.folder.to_str().unwrap();
        let first = log.lines().position(|line| line.contains(folder)).unwrap();
        let last = log.lines().count();
        let mut numbers = HashMap::new();
        let mut calls = Vec::new();
        for (index, line) in log.lines().enumerate() {
            let Some((name, _)) = line.split_once('(') else { continue };
            let number: &mut usize = numbers.entry(name.to_owned()).or_default();
            *number += 1;
            if (first..last).contains(&index) {
                calls.push((name.to_owned(), *number));
            }
        }
        calls
    }

    /// Stops the save once; then saves again.
    fn stop(&self, injected: &str) {
        self.begin();
        let inject = format!("inject={injected}");
        let stopped = self.child(&["strace", "-qq", "-e", CALLS, "-e", &inject, "-o", "/dev/null"]);
        let said = format!("{}: {injected}: {stopped:?}", self.save.name);
        let there = files(&self.folder);
        self.check(&there, &said);
        if injected.contains("error") && !stopped.status.success() {
            let marked = |name: &&String| name.ends_with("/.replacing.part");
            let parts = there.keys().filter(|name| hidden(name) && !marked(name));
            assert_eq!(parts.count(), 0, "a part is left: {said}: {:?}", there.keys());
        }
        if stopped.status.success() {
            assert_eq!(whole(&there), self.new, "it says that it was saved: {said}");
        }
        let again = self.child(&[]);
        if self.save.name == "an append" && whole(&there) == self.new {
            return;
        }
        assert!(again.status.success(), "{said}, then {again:?}");
        let swept = files(&self.folder);
        assert_eq!(whole(&swept), self.new, "{said}");
        assert!(!swept.keys().any(|name| hidden(name)), "{said}: {:?}", swept.keys());
        self.check_rows(&swept, &said);
    }

    /// Old or new, never neither.
    fn check(&self, there: &Files, said: &str) {
        let part = |files: &Files| -> Files {
            let together = |name: &String| (self.save.together)(name);
            whole(files).into_iter().filter(|(name, _)| together(name)).collect()
        };
        let (found, old, new) = (part(there), part(&self.old), part(&self.new));
        assert!(found == old || found == new, "neither: {said}: {:?}", found.keys());
        if found == new {
            // Also if only the page is replaced in one step: it comes last.
            let all = self.new.iter().all(|(name, content)| there.get(name) == Some(content));
            assert!(all, "the page came first: {said}: {:?}", there.keys());
        }
        let mixed = whole(there) != self.old && whole(there) != self.new;
        let marked = there.contains_key("report/.replacing.part");
        assert!(marked || !mixed, "a mixture without a mark: {said}: {:?}", there.keys());
        for (name, content) in whole(there) {
            let of = |files: &Files| files.get(&name) == Some(&content);
            assert!(of(&self.old) || of(&self.new), "{name} is neither: {said}");
        }
        for (name, content) in self.old.iter().filter(|(name, _)| name.contains("notes")) {
            assert_eq!(there.get(name), Some(content), "{name} is another's: {said}");
        }
        self.check_rows(there, said);
    }

    /// Rows that are kept are the first ones of the new.
    fn check_rows(&self, there: &Files, said: &str) {
        for (name, rows) in there.iter().filter(|(name, _)| name.contains(".part")) {
            if self.save.name == "rows" {
                assert!(self.new["fixes.csv"].starts_with(rows), "{name}: {said}");
            }
        }
    }

    /// Fills the folder anew.
    fn begin(&self) -> Files {
        fs::remove_dir_all(&self.folder).unwrap();
        fs::create_dir(&self.folder).unwrap();
        (self.save.before)(&self.folder);
        files(&self.folder)
    }

    /// Saves in a child, under the words of `tracer`.
    fn child(&self, tracer: &[&str]) -> Output {
        let own = env::current_exe().unwrap();
        let mut command = match tracer {
            [] => Command::new(own),
            [tracer, options @ ..] => {
                let mut command = Command::new(tracer);
                command.args(options).arg(own);
                command
            }
        };
        command.env(SAVE, self.save.name).env(FOLDER, &self.folder).output().unwrap()
    }
}

/// Whether a name is that of a part.
fn hidden(name: &str) -> bool {
    name.split('/').any(|part| part.starts_with('.'))
}

/// Without parts and rows that were kept.
fn whole(files: &Files) -> Files {
    let whole = files.iter().filter(|(name, _)| !name.contains(".part"));
    whole.map(|(name, content)| (name.clone(), content.clone())).collect()
}

/// All files of a folder, and of those in it; a link is its target's name.
fn files(folder: &Path) -> Files {
    let mut found = Files::new();
    let mut left = vec![folder.to_owned()];
    while let Some(next) = left.pop() {
        for entry in fs::read_dir(&next).unwrap() {
            let path = entry.unwrap().path();
            let name = path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
            let about = fs::symlink_metadata(&path).unwrap();
            if about.is_dir() {
                found.extend(hidden(&name).then(|| (format!("{name}/"), Vec::new())));
                left.push(path);
            } else if about.is_symlink() {
                let to = fs::read_link(&path).unwrap();
                found.insert(name, to.into_os_string().into_encoded_bytes());
            } else {
                found.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    found
}
