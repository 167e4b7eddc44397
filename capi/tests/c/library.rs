//! The library is built and installed once, and programs are compiled against it.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Mutex, OnceLock, PoisonError};

pub(crate) const WARNINGS: &[&str] =
    &["-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror"];

/// The folder that the library is installed in.
pub(crate) fn prefix() -> &'static Path {
    static INSTALLED: OnceLock<PathBuf> = OnceLock::new();
    INSTALLED.get_or_init(install)
}

/// What stands in the source folder.
pub(crate) fn source(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// As `make capi` does, with the profile of this test.
fn install() -> PathBuf {
    let exe = std::env::current_exe().unwrap();
    let folder = exe.ancestors().nth(2).unwrap();
    let profile = match folder.file_name().and_then(OsStr::to_str).unwrap() {
        "debug" => "dev",
        other => other,
    };
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["build", "--quiet", "--locked", "--package", "surefix-capi", "--profile", profile]);
    cargo.env("CARGO_TARGET_DIR", folder.parent().unwrap());
    done(cargo.current_dir(source("")));
    let prefix = Path::new(env!("CARGO_TARGET_TMPDIR")).join("capi");
    if prefix.exists() {
        std::fs::remove_dir_all(&prefix).unwrap();
    }
    done(Command::new("sh").arg(source("install.sh")).args([folder, &prefix]));
    prefix
}

/// A program of one file, by the compiler for its language. Each is compiled once.
pub(crate) fn compiled(file: &str, options: &[&str]) -> PathBuf {
    static PROGRAMS: Mutex<Vec<(String, PathBuf)>> = Mutex::new(Vec::new());
    let key = format!("{file} {options:?}");
    let mut programs = PROGRAMS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, program)) = programs.iter().find(|(known, _)| *known == key) {
        return program.clone();
    }
    let (plus, program) = (file.ends_with("cpp"), prefix().join(programs.len().to_string()));
    let mut compiler = Command::new(if plus { "g++" } else { "gcc" });
    compiler.arg(if plus { "-std=c++11" } else { "-std=c99" }).args(WARNINGS).args(["-g", "-O1"]);
    compiler.arg(source(file)).arg("-o").arg(&program);
    compiler.arg("-I").arg(prefix().join("include")).args(options);
    done(compiler.args(shared()).args(["-lpthread", "-lm"]));
    programs.push((key, program.clone()));
    program
}

fn shared() -> [String; 3] {
    let lib = prefix().join("lib").display().to_string();
    [format!("-L{lib}"), "-lsurefix".to_owned(), format!("-Wl,-rpath,{lib}")]
}

/// Runs a command, which must succeed.
pub(crate) fn done(command: &mut Command) -> Output {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {}\n{said}", output.status);
    output
}

/// Whether a program is installed; if not, that is said.
pub(crate) fn has(program: &str) -> bool {
    let found = Command::new(program).arg("--version").output().is_ok();
    if !found {
        println!("skipped: {program} is not installed");
    }
    found
}
