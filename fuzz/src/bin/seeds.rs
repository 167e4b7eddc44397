//! Writes the seeds of all targets into `fuzz/seeds`, or into the folder of the command line.

use std::path::PathBuf;

fn main() -> std::io::Result<()> {
    let own = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("seeds");
    surefix_fuzz::write(&std::env::args_os().nth(1).map_or_else(own, PathBuf::from))
}
