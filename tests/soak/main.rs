//! Long drives: no push calls the allocator, memory does not grow, and the answers stay those of a
//! plain localizer. `make test` runs some thousand pushes of each kind, `make soak` ten million
//! (`PUSHES`). Arguments choose kinds, as a test's name would.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

#[macro_use]
#[path = "../all/options.rs"]
mod options;

#[path = "../all/cases.rs"]
mod cases;
#[path = "../all/counting.rs"]
mod counting;
mod drive;
mod kinds;
#[path = "../../src/random.rs"]
mod random;
mod report;

use std::process::ExitCode;

use kinds::KINDS;

fn main() -> ExitCode {
    let asked: Vec<String> = std::env::args().skip(1).filter(|arg| !arg.starts_with('-')).collect();
    let pushes = std::env::var("PUSHES").map_or(Ok(10_000), |pushes| pushes.parse());
    let Ok(pushes) = pushes else {
        eprintln!("PUSHES: expected a whole number");
        return ExitCode::from(2);
    };
    let chosen = |name: &str| asked.is_empty() || asked.iter().any(|asked| name.contains(asked));
    let mut held = true;
    for kind in KINDS.iter().filter(|kind| chosen(kind.name)) {
        let report = drive::soak(kind, pushes);
        println!("{report}");
        held &= report.holds();
    }
    if held { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
