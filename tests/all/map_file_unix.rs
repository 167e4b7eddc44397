//! What a saved map is to the operating system: its permissions, and what a full disk leaves
//! behind.

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::Command;

use surefix::saving::AtomicFile;
use surefix::{Error, Map, Metric};
use tempfile::tempdir;

/// Tells the child where to save, and that it is the child.
const CHILD: &str = "SUREFIX_TEST_SAVE_TO";

/// 400 kB of descriptors.
fn large_map() -> Map {
    let rows: Vec<f32> = (0..100_000_u32).map(|i| i as f32).collect();
    Map::from_descriptors(rows, 100, Metric::Euclidean).unwrap()
}

/// Runs this very test again in a shell that has set `limits`, there to save a map; whether it
/// could.
fn save_under(limits: &str, test: &str, path: &Path) -> bool {
    let script = format!("{limits}; exec \"$0\" --exact map_file_unix::{test} --nocapture");
    let mut shell = Command::new("sh");
    shell.arg("-c").arg(script).arg(std::env::current_exe().unwrap()).env(CHILD, path);
    let output = shell.output().unwrap();
    assert!(
        String::from_utf8_lossy(&output.stdout).contains("running 1 test"),
        "the child ran: {output:?}"
    );
    output.status.success()
}

fn names(folder: &Path) -> Vec<String> {
    fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}

#[test]
fn permissions_follow_the_umask() {
    if let Some(path) = std::env::var_os(CHILD) {
        return large_map().save(path).unwrap();
    }
    let folder = tempdir().unwrap();
    for (umask, expected) in [("022", 0o644), ("077", 0o600), ("002", 0o664)] {
        let path = folder.path().join(umask);
        assert!(save_under(&format!("umask {umask}"), "permissions_follow_the_umask", &path));
        let mode = fs::metadata(&path).unwrap().permissions().mode() & 0o777;
        assert_eq!(mode, expected, "umask {umask}: {mode:o}");
    }
}

#[test]
fn an_old_file_s_permissions_stay() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    for mode in [0o600, 0o444, 0o640] {
        fs::write(&path, "the old map").or_else(|_| fs::remove_file(&path)).unwrap();
        large_map().save(&path).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
        large_map().save(&path).unwrap();
        Map::append(&path, &large_map()).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, mode);
        assert_eq!(Map::open(&path).unwrap().places(), 2000);
        fs::remove_file(&path).unwrap();
    }
}

#[test]
fn symbolic_links_stay_and_their_target_is_replaced() {
    use std::os::unix::fs::symlink;
    let folder = tempdir().unwrap();
    let inside = folder.path().join("maps");
    fs::create_dir(&inside).unwrap();
    let target = inside.join("monday.safetensors");
    symlink("maps/monday.safetensors", folder.path().join("latest")).unwrap();
    symlink(folder.path().join("latest"), inside.join("link")).unwrap();
    // The target does not exist the first time.
    for link in [folder.path().join("latest"), inside.join("link")] {
        large_map().save(&link).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert!(fs::symlink_metadata(&target).unwrap().is_file());
        assert_eq!(Map::open(&link).unwrap().places(), 1000);
        Map::append(&link, &large_map()).unwrap();
        assert_eq!(Map::open(&target).unwrap().places(), 2000);
    }
    assert_eq!(names(&inside).len(), 2, "nothing else is left");
    symlink("b", folder.path().join("a")).unwrap();
    symlink("a", folder.path().join("b")).unwrap();
    let error = large_map().save(folder.path().join("a")).unwrap_err();
    assert!(error.to_string().contains("cannot write the map"), "{error}");
}

#[test]
fn a_save_that_runs_out_of_room_leaves_the_old_map() {
    if let Some(path) = std::env::var_os(CHILD) {
        let error = large_map().save(path).unwrap_err();
        assert!(error.to_string().contains("cannot write the map"), "{error}");
        return;
    }
    let folder = tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    fs::write(&path, "the old map").unwrap();
    // No file above 100 blocks, and the signal for it ignored: the write fails as on a full disk.
    let full = "trap '' XFSZ; ulimit -f 100";
    assert!(
        save_under(full, "a_save_that_runs_out_of_room_leaves_the_old_map", &path),
        "it must fail with Io"
    );
    assert_eq!(fs::read(&path).unwrap(), b"the old map");
    assert_eq!(names(folder.path()), ["map.safetensors"], "nothing half-written stays");
}

#[test]
fn a_program_killed_while_saving_leaves_the_old_map() {
    if let Some(path) = std::env::var_os(CHILD) {
        return large_map().save(path).unwrap();
    }
    let folder = tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    fs::write(&path, "the old map").unwrap();
    let killed =
        !save_under("ulimit -f 100", "a_program_killed_while_saving_leaves_the_old_map", &path);
    assert!(killed, "the limit must have ended it");
    assert_eq!(fs::read(&path).unwrap(), b"the old map");
}

#[test]
fn the_second_writer_is_refused_and_the_first_goes_on() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("map.safetensors");
    large_map().save(&path).unwrap();
    let first = AtomicFile::new(&path).unwrap();
    for refused in [large_map().save(&path), Map::append(&path, &large_map())] {
        let error = refused.unwrap_err();
        let Error::Io { source, .. } = &error else { panic!("{error}") };
        assert_eq!(source.kind(), std::io::ErrorKind::ResourceBusy);
        if cfg!(target_os = "linux") {
            assert!(error.to_string().contains("another thread of this process"), "{error}");
        }
    }
    drop(first);
    Map::append(&path, &large_map()).unwrap();
    assert_eq!(Map::open(&path).unwrap().places(), 2000);
    assert_eq!(names(folder.path()), ["map.safetensors"]);
}

#[test]
fn threads_that_save_at_once_leave_one_whole_map() {
    let folder = tempdir().unwrap();
    let path = &folder.path().join("map.safetensors");
    // The part is what a killed writer left.
    for name in [".map.safetensors.part", "map.safetensors"] {
        fs::write(folder.path().join(name), "left").unwrap();
    }
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for _ in 0..10 {
                    while let Err(error) = large_map().save(path) {
                        let Error::Io { source, .. } = &error else { panic!("{error}") };
                        assert_eq!(source.kind(), std::io::ErrorKind::ResourceBusy);
                        std::thread::yield_now();
                    }
                }
            });
        }
    });
    assert_eq!(Map::open(path).unwrap().places(), 1000);
    assert_eq!(names(folder.path()), ["map.safetensors"]);
}

#[test]
fn pipes_and_devices_are_no_files() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.png");
    assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
    let refused = |error: surefix::Error, kind: &str| {
        assert!(matches!(error, surefix::Error::Io { .. }), "{error}");
        let expected = format!("expected a file, got a {kind}");
        assert!(error.to_string().contains(&expected), "{error}");
    };
    for (path, kind) in [(&*path, "pipe"), (Path::new("/dev/zero"), "device")] {
        refused(Map::open(path).unwrap_err(), kind);
        refused(Map::append(path, &large_map()).unwrap_err(), kind);
        #[cfg(feature = "mmap")]
        {
            // SAFETY: the file is refused.
            #[allow(unsafe_code)]
            let mapped = unsafe { Map::open_mapped(path) };
            refused(mapped.unwrap_err(), kind);
        }
        #[cfg(feature = "toml")]
        refused(surefix::Settings::open(path).unwrap_err(), kind);
        #[cfg(feature = "image")]
        {
            use surefix::{ImageFiles, ImageSource as _};
            refused(surefix::read_image(path).unwrap_err(), kind);
            let files = ImageFiles::list(vec![path.to_owned()]);
            refused(files.load(0).unwrap_err(), kind);
            assert!(files.remarks().is_empty());
        }
    }
}
