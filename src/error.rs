//! What can go wrong, said once: what was expected, what came, and where.

use std::io;
use std::path::PathBuf;

use crate::dtype::Dtype;

/// Every error of the library.
///
/// A call that returns one has left its object as it was.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An option is outside its range.
    #[error("option `{name}`: expected {expected}, got {got}")]
    Option {
        /// The option's name, the same in Rust, Python and on the command line.
        name: &'static str,
        /// What it may be.
        expected: String,
        /// What came.
        got: String,
    },

    /// A route of no or one place: there is nothing to tell apart.
    #[error("{what}: expected at least 2 places, got {got}")]
    TooFewPlaces {
        /// What held the places.
        what: &'static str,
        /// How many came.
        got: usize,
    },

    /// A vector of the wrong length.
    #[error("{what}: expected {expected} values, got {got}")]
    Length {
        /// What the vector is.
        what: &'static str,
        /// The length it must have.
        expected: usize,
        /// The length it has.
        got: usize,
    },

    /// An array, matrix or pixel buffer of the wrong shape.
    #[error("{what}: expected {expected}, got {got}")]
    Shape {
        /// What the array is.
        what: &'static str,
        /// The shape it must have.
        expected: String,
        /// The shape it has.
        got: String,
    },

    /// More memory than there is.
    #[error(
        "matcher: not enough memory for a window of {columns} columns of {places} places, 4 bytes each"
    )]
    Memory {
        /// Places of the route.
        places: usize,
        /// Columns of the window: the sequence length, or the smoothing.
        columns: usize,
    },

    /// A NaN or an infinity where a finite number must be.
    #[error("{what}: expected finite numbers, got {value} at {}", place(*.row, *.index))]
    NotFinite {
        /// What the numbers are.
        what: &'static str,
        /// The row (place or query), where there are rows.
        row: Option<usize>,
        /// The index within the row.
        index: usize,
        /// What stands there.
        value: f32,
    },

    /// A vector of zeros has no direction: neither a cosine distance nor a multiple of length 1.
    #[error("{what}{}: expected a vector that is not all zeros, which have no direction", of_row(*.row))]
    NoDirection {
        /// What the vector is.
        what: &'static str,
        /// Its row, where there are rows.
        row: Option<usize>,
    },

    /// A descriptor of a type that cannot be compared with the map's.
    #[error("{what}: expected {}, got {got}", either(*.map, *.or_float))]
    Dtype {
        /// What has the wrong type.
        what: &'static str,
        /// The map's own type.
        map: Dtype,
        /// Whether float32 would do too: on a map of ready descriptors.
        or_float: bool,
        /// What came.
        got: Dtype,
    },

    /// An image that cannot be read.
    #[error("image {name}: {reason}")]
    Image {
        /// The file, or the index in a list.
        name: String,
        /// Why not.
        reason: String,
    },

    /// Images of one traverse must have one size.
    #[error("image {name}: expected {} x {} pixels like the ones before it, got {} x {}", .expected.0, .expected.1, .got.0, .got.1)]
    ImageSize {
        /// The file, or the index in a list.
        name: String,
        /// Width and height of the first image.
        expected: (usize, usize),
        /// Width and height of this one.
        got: (usize, usize),
    },

    /// A folder or a pattern without images.
    #[error("{place}: expected images (png, jpeg, bmp, tiff, webp or pnm), found none")]
    NoImages {
        /// The folder or the pattern.
        place: String,
    },

    /// The operating system refused a file.
    #[error("{}: cannot {action}: {source}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// What the system says.
        source: io::Error,
    },

    /// A file that is not a map, or a damaged one.
    #[error("{}: not a usable surefix map: {reason}", .path.display())]
    MapFile {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },

    /// A map written by a newer version of the library.
    #[error("{}: map format {found}, but this version of surefix reads up to {supported}: upgrade surefix", .path.display())]
    MapVersion {
        /// The file.
        path: PathBuf,
        /// Its format version.
        found: u64,
        /// The newest one known here.
        supported: u64,
    },

    /// Places that cannot follow those of a map.
    #[error("{map}: cannot append: expected {expected}, got {got}")]
    Append {
        /// The map's file, or "the map".
        map: String,
        /// What the map has.
        expected: String,
        /// What the places that come have.
        got: String,
    },

    /// A snapshot that does not fit: damaged, of another map, or of another configuration.
    #[error("snapshot: {reason}")]
    Snapshot {
        /// What does not fit.
        reason: String,
    },

    /// An image was pushed, but the map was made of ready descriptors.
    #[error(
        "image: this map was made of ready descriptors, so it cannot describe an image: push the image's descriptor instead"
    )]
    NoDescriptor,

    /// The progress callback asked to stop.
    #[error("stopped after {done} of {total}")]
    Interrupted {
        /// Images or queries finished.
        done: usize,
        /// Images or queries to do.
        total: usize,
    },
}

fn place(row: Option<usize>, index: usize) -> String {
    row.map_or_else(|| format!("index {index}"), |row| format!("row {row}, index {index}"))
}

fn of_row(row: Option<usize>) -> String {
    row.map_or_else(String::new, |row| format!(" (row {row})"))
}

fn either(map: Dtype, or_float: bool) -> String {
    match map {
        Dtype::F32 => "float32".to_owned(),
        other if or_float => format!("float32 or the map's own {other}"),
        other => format!("{other}, as the map's own SAD descriptors are"),
    }
}
