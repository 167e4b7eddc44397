//! Fuzz targets for libFuzzer: CONTRIBUTING.md says how to run them. A target is a function of any
//! bytes that panics if it finds something; `fuzz_targets` makes a program of each.

#![allow(clippy::expect_used, clippy::panic, reason = "a finding is a panic")]

mod bits;
mod distances;
mod image;
mod input;
mod map;
mod matcher;
mod oracle;
mod screen;
#[cfg(feature = "seeds")]
mod seeds;
mod settings;
mod signed;
mod snapshot;
mod truth;

use std::path::Path;

#[cfg(feature = "seeds")]
pub use seeds::write;

/// A name and a function of any bytes.
type Target = (&'static str, fn(&[u8]));

/// The targets.
const TARGETS: [Target; 6] = [
    ("image", image::image),
    ("map", map::map),
    ("matcher", matcher::matcher),
    ("screen", screen::screen),
    ("settings", settings::settings),
    ("snapshot", snapshot::snapshot),
];

/// Runs a target with some bytes.
///
/// # Panics
/// If it finds something; for a name of no target.
pub fn run(name: &str, data: &[u8]) {
    let target = TARGETS.iter().find(|(known, _)| *known == name);
    target.expect("one of `TARGETS`").1(data);
}

/// Runs a target with the files, or the files in the folders, of the command line: the program of a
/// target that is built without libFuzzer.
///
/// # Panics
/// As [`run`]; for a file that cannot be read.
pub fn replay(name: &str) {
    let mut count = 0;
    for path in std::env::args_os().skip(1) {
        count += replay_path(name, path.as_ref());
    }
    println!("{name}: {count} inputs");
}

/// The number of files.
fn replay_path(name: &str, path: &Path) -> usize {
    if path.is_dir() {
        let inside = path.read_dir().expect("a folder").map(|one| one.expect("a file").path());
        return inside.map(|path| replay_path(name, &path)).sum();
    }
    run(name, &std::fs::read(path).expect("a file"));
    1
}

/// The program of a target: with libFuzzer's main if it is built for that, else with one that
/// replays files.
#[macro_export]
macro_rules! program {
    ($name:literal) => {
        #[cfg(fuzzing)]
        libfuzzer_sys::fuzz_target!(|data: &[u8]| $crate::run($name, data));

        #[cfg(not(fuzzing))]
        fn main() {
            $crate::replay($name);
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The seeds, and the inputs of findings that were mended.
    #[test]
    fn the_committed_inputs_find_nothing() {
        let seeds = Path::new(env!("CARGO_MANIFEST_DIR")).join("seeds");
        for (name, _) in TARGETS {
            assert!(replay_path(name, &seeds.join(name)) > 0, "{name}");
        }
    }
}
