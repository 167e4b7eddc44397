//! `include/surefix.h` is what cbindgen makes of the sources. After a change of them,
//! `make header` writes it anew.

use std::path::Path;

#[test]
fn the_header_is_that_of_the_sources() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(folder.join("cbindgen.toml")).unwrap();
    let bindings = cbindgen::Builder::new().with_crate(folder).with_config(config).generate();
    let mut made = Vec::new();
    bindings.unwrap().write(&mut made);
    let (header, made) = (folder.join("include/surefix.h"), String::from_utf8(made).unwrap());
    if std::env::var_os("UPDATE").is_some() {
        std::fs::write(&header, &made).unwrap();
    }
    let kept = std::fs::read_to_string(&header).unwrap_or_default();
    let difference = kept.lines().zip(made.lines()).position(|(kept, made)| kept != made);
    assert!(kept == made, "line {difference:?} of {header:?}: make header writes it anew");
}
