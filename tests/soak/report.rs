//! A soak's figures, as a row of a table.

use std::fmt;

use hdrhistogram::Histogram;

/// Less than this many bytes more than at the start.
const MOST_DRIFT: u64 = 1 << 20;

pub(crate) struct Report {
    pub(crate) kind: &'static str,
    pub(crate) allocator_calls: usize,
    pub(crate) drift: Option<u64>,
    /// The fixes that were compared with those of the plain localizer.
    pub(crate) compared: u64,
    /// Nanoseconds of each push.
    pub(crate) times: Histogram<u64>,
}

impl Report {
    pub(crate) fn holds(&self) -> bool {
        self.allocator_calls == 0 && self.drift.is_none_or(|drift| drift < MOST_DRIFT)
    }
}

/// Kind, pushes, allocator calls, drift, p50, p99, p99.99, the longest, compared fixes.
impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, allocator_calls, compared, times, .. } = self;
        let drift =
            self.drift.map_or("not known".to_owned(), |drift| format!("{} KiB", drift / 1024));
        write!(f, "| {kind} | {} | {allocator_calls} | {drift} |", times.len())?;
        for quantile in [0.5, 0.99, 0.9999, 1.0] {
            let microseconds = times.value_at_quantile(quantile) as f64 / 1e3;
            if microseconds < 1e3 {
                write!(f, " {microseconds:.1} us |")?;
            } else {
                write!(f, " {:.1} ms |", microseconds / 1e3)?;
            }
        }
        write!(f, " {compared} |")
    }
}
