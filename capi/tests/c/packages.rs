//! The installed files are found by compilers, `pkg-config` and `cmake`, and the examples run.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use surefix::{Config, Dtype, Given, Image, Localizer, Map, Metric, Motion, View};

use crate::library::{WARNINGS, compiled, done, has, prefix, source};
use crate::route::{DIM, Files, PLACES, SIZE, descriptors, image_map, winter};

/// The numbers of an example's rows.
fn numbers(printed: &[u8]) -> Vec<Vec<f64>> {
    let lines = std::str::from_utf8(printed).unwrap().lines();
    let lines = lines.filter(|line| !line.starts_with("frame"));
    lines.map(|line| line.split(',').map(|number| number.parse().unwrap()).collect()).collect()
}

fn same(got: &[Vec<f64>], expected: &[Vec<f64>]) {
    let bits = |row: &Vec<f64>| -> Vec<Option<u64>> {
        row.iter().map(|number| (!number.is_nan()).then_some(number.to_bits())).collect()
    };
    assert_eq!(got.len(), expected.len());
    for (got, expected) in got.iter().zip(expected) {
        assert_eq!(bits(got), bits(expected), "{got:?} {expected:?}");
    }
}

/// camera.cpp along the route.
fn camera(program: &Path) {
    let (files, map, (width, height)) = (Files::new(), image_map(), SIZE);
    let path = files.save("map.safetensors", &map);
    let pnm = |(index, image): (usize, &Image)| {
        let mut bytes = format!("P6 {width} {height} 255\n").into_bytes();
        bytes.extend(image.pixels());
        files.write(&format!("{index:03}.ppm"), &bytes)
    };
    let frames = winter();
    let names: Vec<PathBuf> = frames.iter().enumerate().map(pnm).collect();
    let options = ["--motion", "any", "--sequence_length", "5"];
    let output = done(Command::new(program).arg(path).args(names).args(options));

    let mut config = Config::default();
    (config.motion, config.sequence_length) = (Some(Motion::any()), 5);
    let mut localizer = Localizer::new(map, config).unwrap();
    let row = |image: &Image| {
        let fix = localizer.push_image(image).unwrap();
        let track = fix.track.unwrap();
        let at = localizer.position(&fix).unwrap();
        let (score, trusted) = (f64::from(fix.score), f64::from(u8::from(fix.trusted)));
        let place = [fix.frame as f64, fix.place as f64, score, trusted, 0.0];
        [&place[..], &[track.confidence, track.off_map], at.metres()].concat()
    };
    let rows: Vec<Vec<f64>> = frames.iter().map(row).collect();
    assert!(
        rows.iter().filter(|row| row[5] > 0.9).count() > PLACES / 3,
        "a drive that tells nothing"
    );
    same(&numbers(&output.stdout), &rows);
}

/// descriptors.c, which restarts on its way.
fn network(program: &Path) {
    let files = Files::new();
    let rows = descriptors(Dtype::F32, 0);
    let map = Arc::new(Map::from_descriptors(rows, DIM, Metric::Cosine).unwrap());
    let queries = descriptors(Dtype::F32, 3);
    let View::F32(values) = queries.view() else { panic!("float32") };
    let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_ne_bytes()).collect();
    let names = [files.save("map.safetensors", &map), files.write("queries", &bytes)];
    let output = done(Command::new(program).args(names));

    let mut config = Config::default();
    (config.motion, config.sequence_length) = (Some(Motion::steady()), 5);
    let mut localizer = Localizer::new(map, config).unwrap();
    let row = |values: &[f32]| {
        let fix = localizer.push_descriptor_with(values, Given::default().advance(1.0)).unwrap();
        let track = fix.track.unwrap();
        vec![fix.place as f64, f64::from(fix.score), track.confidence, track.off_map]
    };
    let rows: Vec<Vec<f64>> = values.chunks_exact(DIM).map(row).collect();
    same(&numbers(&output.stdout), &rows);
}

#[test]
fn the_examples_give_the_fixes_of_rust_to_the_bit() {
    camera(&compiled("examples/camera.cpp", &[]));
    network(&compiled("examples/descriptors.c", &[]));
}

#[test]
fn an_example_says_what_is_wrong_in_one_line() {
    let files = Files::new();
    let program = compiled("examples/camera.cpp", &[]);
    let map = files.save("map.safetensors", &image_map());
    let image = files.write("grey.pgm", b"P5 2 2 65535\n........");
    let words = |words: &[&str]| {
        let output = Command::new(&program).args(words).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let (map, image) = (map.to_str().unwrap(), image.to_str().unwrap());
    for (given, code, said) in [
        (&[][..], 2, "usage: camera MAP"),
        (&["nowhere"], 1, "camera: nowhere: cannot read the map"),
        (&[map, image], 1, "expected a PNM image"),
        (&[map, "--speed", "2"], 1, "camera: option `speed`: expected one of floor, gradient"),
        (&[map, "--settings", "none.toml"], 1, "camera: none.toml: cannot read the settings"),
        (&[map, "--sequence_length", "99"], 1, "from 1 to 40"),
    ] {
        let (got, words) = words(given);
        assert_eq!(got, Some(code), "{words}");
        assert!(words.contains(said) && words.lines().count() == 1, "{words}");
    }
}

#[test]
fn both_headers_stand_alone_in_every_standard() {
    let files = Files::new();
    for (header, compiler, standards) in [
        ("surefix.h", "gcc", &["c99", "c11", "c17"][..]),
        ("surefix.h", "g++", &["c++11"]),
        ("surefix.hpp", "g++", &["c++11", "c++14", "c++17", "c++20"]),
    ] {
        let twice = format!("#include <{header}>\n#include <{header}>\n");
        let ending = if compiler == "gcc" { "c" } else { "cpp" };
        let file = files.write(&format!("alone.{ending}"), twice.as_bytes());
        for standard in standards {
            let mut command = Command::new(compiler);
            command.arg(format!("-std={standard}")).args(WARNINGS).arg("-fsyntax-only");
            done(command.arg("-I").arg(prefix().join("include")).arg(&file));
        }
    }
}

#[test]
fn pkg_config_knows_how_to_link_both_libraries() {
    if !has("pkg-config") {
        return;
    }
    let lib = prefix().join("lib");
    let files = Files::new();
    let flags = |more: &[&str]| -> Vec<String> {
        let mut command = Command::new("pkg-config");
        command.args(["--cflags", "--libs", "surefix"]).args(more);
        let output = done(command.env("PKG_CONFIG_PATH", lib.join("pkgconfig")));
        let text = String::from_utf8(output.stdout).unwrap();
        text.split_whitespace().map(str::to_owned).collect()
    };
    let program = files.path().join("camera");
    let compile = |flags: Vec<String>| {
        let mut compiler = Command::new("g++");
        compiler.arg("-std=c++11").arg(source("examples/camera.cpp")).arg("-o").arg(&program);
        done(compiler.args(flags));
    };
    compile([flags(&[]), vec![format!("-Wl,-rpath,{}", lib.display())]].concat());
    camera(&program);
    // The static library by its file, as both lie in one folder.
    let archive = format!("-l:{}", "libsurefix.a");
    let linked = flags(&["--static"]).into_iter();
    compile(linked.map(|flag| if flag == "-lsurefix" { archive.clone() } else { flag }).collect());
    camera(&program);
}

#[test]
fn cmake_finds_the_package() {
    if !has("cmake") {
        return;
    }
    let files = Files::new();
    let mut cmake = Command::new("cmake");
    cmake.arg("-S").arg(source("examples")).arg("-B").arg(files.path());
    done(cmake.arg(format!("-DCMAKE_PREFIX_PATH={}", prefix().display())));
    done(Command::new("cmake").arg("--build").arg(files.path()));
    camera(&files.path().join("camera"));
    network(&files.path().join("descriptors"));

    // A program that wants a later interface is told so.
    let file = prefix().join("lib/cmake/surefix/surefixConfigVersion.cmake");
    let script = "include(${FILE})\nmessage(\"${PACKAGE_VERSION_COMPATIBLE}\")\n";
    let script = files.write("ask.cmake", script.as_bytes());
    let version = env!("CARGO_PKG_VERSION");
    let (interface, _) = version.rsplit_once('.').unwrap();
    for (asked, fits) in
        [(version, "TRUE"), (interface, "TRUE"), ("9.9", "FALSE"), ("0.0.1", "FALSE")]
    {
        let mut cmake = Command::new("cmake");
        cmake.arg(format!("-DFILE={}", file.display()));
        cmake.arg(format!("-DPACKAGE_FIND_VERSION={asked}")).arg("-P").arg(&script);
        assert_eq!(String::from_utf8_lossy(&done(&mut cmake).stderr).trim(), fits, "{asked}");
    }
}

/// The exported names are the header's, and programs ask for the library by its interface.
#[test]
fn the_shared_library_exports_what_the_header_declares() {
    if !(has("nm") && has("readelf")) {
        return;
    }
    let library = prefix().join("lib/libsurefix.so");
    let output = done(Command::new("nm").args(["-D", "--defined-only"]).arg(&library));
    let names = String::from_utf8(output.stdout).unwrap();
    let names: Vec<&str> = names.lines().filter_map(|line| line.split(' ').nth(2)).collect();
    let header = std::fs::read_to_string(prefix().join("include/surefix.h")).unwrap();
    let code = header.lines().filter(|line| !line.starts_with("///"));
    let declared = code.filter_map(|line| line.split_once('(')?.0.rsplit([' ', '*']).next());
    let mut declared: Vec<&str> = declared.filter(|name| name.starts_with("surefix_")).collect();
    declared.sort_unstable();
    assert_eq!(names, declared);
    let output = done(Command::new("readelf").arg("-d").arg(&library));
    let (interface, _) = env!("CARGO_PKG_VERSION").rsplit_once('.').unwrap();
    let soname = format!("[libsurefix.so.{interface}]");
    assert!(String::from_utf8_lossy(&output.stdout).contains(&soname));
}
