//! Whatever is saved is the old one or the new one, at whichever system call the program is stopped
//! or refused. The program runs itself under `strace`, which injects the kill or the error at the
//! first call that touches the folder, then at the second, and so on.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

#[cfg(target_os = "linux")]
mod saves;

fn main() {
    #[cfg(target_os = "linux")]
    saves::main();
    #[cfg(not(target_os = "linux"))]
    println!("skipped: strace is for Linux");
}
