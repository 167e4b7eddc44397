//! The library is built and installed once, and programs are compiled against it.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use tempfile::TempDir;

pub(crate) const WARNINGS: &[&str] =
    &["-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror"];

/// The folder that the library is installed in.
pub(crate) fn prefix() -> &'static Path {
    static INSTALLED: OnceLock<TempDir> = OnceLock::new();
    INSTALLED.get_or_init(install).path()
}

/// What stands in the source folder.
pub(crate) fn source(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// As `make capi` does, with the profile of this test.
fn install() -> TempDir {
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
    let prefix = TempDir::new().unwrap();
    done(Command::new("sh").arg(source("install.sh")).args([folder, prefix.path()]));
    prefix
}

/// A program of these sources, by the compiler for their language.
pub(crate) fn compiled(to: &Path, file: &str, options: &[&str]) -> PathBuf {
    let plus = file.ends_with("cpp");
    let program = to.join(Path::new(file).file_stem().unwrap());
    let mut compiler = Command::new(if plus { "g++" } else { "gcc" });
    compiler.arg(if plus { "-std=c++11" } else { "-std=c99" }).args(WARNINGS).args(["-g", "-O1"]);
    compiler.arg(source(file)).arg("-o").arg(&program);
    compiler.arg("-I").arg(prefix().join("include")).args(options);
    done(compiler.args(shared()).args(["-lpthread", "-lm"]));
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
