//! A map's rows at a quarter of the bytes, beside its own: the data of a screen. The scan of a
//! screen, and the proof of its bounds, are in `scan/screen.rs`.

use super::storage::Storage;

/// The rows as codes: number `j` of row `i` is `offset[j] + scale[j] * code[i, j]`. The difference
/// to the row itself has at most the length `error[i]`.
#[derive(Debug)]
pub(crate) struct Codes {
    /// Signed bytes, row by row. They are in one piece, because offsets and scales are those of all
    /// rows.
    pub(crate) rows: Storage,
    pub(crate) offset: Vec<f64>,
    pub(crate) scale: Vec<f64>,
    pub(crate) error: Vec<f64>,
    /// The squared length of each row's `scale * code`, and of the row less `offset`, for the
    /// euclidean distance.
    pub(crate) square: Vec<f64>,
    pub(crate) row_square: Vec<f64>,
    /// No row of codes is longer.
    pub(crate) longest: f64,
    /// No row is longer, and neither is `offset`.
    pub(crate) extent: f64,
}
