//! Memory for numbers that a file claims to hold: refused if there is not enough. A system that
//! promises more than it has (Linux does) would end the process when the memory is used.

use std::io;

/// Below this, the system is not asked: it takes longer than the memory is worth.
const SMALL: usize = 64 << 20;

/// Memory for `count` items more, or the error that there is not enough.
pub(crate) fn reserve<T>(list: &mut Vec<T>, count: usize) -> io::Result<()> {
    let refused = || io::Error::from(io::ErrorKind::OutOfMemory);
    let bytes = count.checked_mul(size_of::<T>()).ok_or_else(refused)?;
    if !is_there(bytes) {
        return Err(refused());
    }
    list.try_reserve_exact(count).map_err(|_| refused())
}

/// Whether that much memory is free, as far as the system tells it.
pub(crate) fn is_there(bytes: usize) -> bool {
    bytes < SMALL || free().is_none_or(|free| bytes as u64 <= free)
}

#[cfg(target_os = "linux")]
fn free() -> Option<u64> {
    let read = |file: &str| std::fs::read_to_string(file).ok();
    let machine = read("/proc/meminfo").and_then(|text| {
        let line = |name| number_after(&text, name).map(|kilobytes| kilobytes * 1024);
        Some(line("MemAvailable:")? + line("SwapFree:").unwrap_or(0))
    });
    let group = |file: &str| read(&format!("/sys/fs/cgroup/{file}"));
    let container = group("memory.max").and_then(|most| {
        let most: u64 = most.trim().parse().ok()?;
        let used: u64 = group("memory.current")?.trim().parse().ok()?;
        // Pages of files are given back when memory is short.
        let files = group("memory.stat").and_then(|text| number_after(&text, "file "));
        Some(most.saturating_sub(used.saturating_sub(files.unwrap_or(0))))
    });
    machine.into_iter().chain(container).min()
}

#[cfg(not(target_os = "linux"))]
fn free() -> Option<u64> {
    None
}

#[cfg(target_os = "linux")]
fn number_after(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_that_there_is_not_is_refused() {
        assert!(is_there(0) && is_there(SMALL));
        let mut list = Vec::<u64>::new();
        for count in [usize::MAX, usize::MAX / 16, 1 << 50] {
            let error = reserve(&mut list, count).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::OutOfMemory);
        }
        reserve(&mut list, 1000).unwrap();
        assert!(list.capacity() >= 1000);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_system_tells_how_much_is_free() {
        assert!(free().is_some_and(|free| free > 1 << 20));
        assert!(!is_there(1 << 60));
    }
}
