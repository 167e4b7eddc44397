//! Misuse, threads, and the tools that watch memory: sanitizers and valgrind.

use std::path::Path;
use std::process::Command;

use surefix::{Dtype, Map, Metric, Sad, quiet};

use crate::drives::images;
use crate::library::{compiled, done, has};
use crate::route::{DIM, Files, descriptors, image_map, winter};

const MEMORY: &[&str] = &["-fsanitize=address,undefined", "-fno-sanitize-recover=all"];
const VALGRIND: &[&str] = &[
    "valgrind",
    "--quiet",
    "--leak-check=full",
    "--errors-for-leak-kinds=definite,indirect,possible",
    "--error-exitcode=9",
];

/// A program with its maps: of images, of others, of descriptors; and a folder.
fn run(program: &Path, maps: &[usize], runner: &[&str]) {
    let files = Files::new();
    let other = Map::from_images(&winter()[..20], Sad::default(), &mut quiet).unwrap();
    let rows = descriptors(Dtype::F32, 0);
    let ready = Map::from_descriptors(rows, DIM, Metric::Euclidean).unwrap();
    let all = [
        files.save("map.safetensors", &image_map()),
        files.save("other.safetensors", &other),
        files.save("ready.safetensors", &ready),
    ];
    let mut words = runner.iter().copied().map(AsRef::as_ref).chain([program.as_os_str()]);
    let mut command = Command::new(words.next().unwrap());
    command.args(words).args(maps.iter().map(|&map| &all[map]));
    let output = done(command.arg(files.path()));
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
}

fn misuse(program: &Path, runner: &[&str]) {
    run(program, &[0, 1, 2], runner);
}

#[test]
fn the_wrapper_for_c_plus_plus_owns_and_throws() {
    run(&compiled("tests/c/programs/wrapper.cpp", MEMORY), &[0, 2], &[]);
}

#[test]
fn what_a_caller_does_wrong_is_an_error_with_words() {
    let program = compiled("tests/c/programs/misuse.c", &[]);
    misuse(&program, &[]);
    if has("valgrind") {
        misuse(&program, VALGRIND);
    }
}

#[test]
fn nothing_leaks_and_nothing_is_read_beyond_its_end() {
    misuse(&compiled("tests/c/programs/misuse.c", MEMORY), &[]);
    images().check(&compiled("tests/c/programs/drive.c", MEMORY), &[]);
    if has("valgrind") {
        images().check(&compiled("tests/c/programs/drive.c", &[]), VALGRIND);
    }
}

#[test]
fn threads_share_a_map_and_not_a_localizer() {
    let files = Files::new();
    let map = files.save("map.safetensors", &image_map());
    let thread = &["-fsanitize=thread"][..];
    for (options, words) in [(&[][..], &[][..]), (MEMORY, &[]), (thread, &["apart"])] {
        let program = compiled("tests/c/programs/threads.c", options);
        let output = done(Command::new(program).arg(&map).args(words));
        assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    }
}
