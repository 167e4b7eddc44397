//! Every error, with the value that was expected, the one given, and its place.

use std::path::PathBuf;
use std::{fmt, io};

use crate::dtype::Dtype;
use crate::plain::Plain;

/// Every error of the library.
///
/// A call that returns one has left its object as it was. Its `Debug` is the message, too: that is
/// what a `main` which returns it prints. Control characters of names are escaped in it.
#[derive(thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An option is outside its range.
    #[error("option `{name}`: expected {expected}, got {}", Plain(.got))]
    Option {
        /// The option's name, the same in Rust, Python and on the command line.
        name: &'static str,
        /// Its range.
        expected: String,
        /// The value given.
        got: String,
    },

    /// A route of no or one place.
    #[error("{what}: expected at least 2 places, got {got}")]
    TooFewPlaces {
        /// The object that held the places.
        what: &'static str,
        /// The number of places.
        got: usize,
    },

    /// A vector of the wrong length.
    #[error("{what}: expected {expected} values, got {got}")]
    Length {
        /// The vector's name.
        what: &'static str,
        /// The length it must have.
        expected: usize,
        /// The length it has.
        got: usize,
    },

    /// An array, matrix or pixel buffer of the wrong shape.
    #[error("{what}: expected {expected}, got {got}")]
    Shape {
        /// The array's name.
        what: &'static str,
        /// The shape it must have.
        expected: String,
        /// The shape it has.
        got: String,
    },

    /// Not enough memory.
    #[error(
        "matcher: not enough memory for a window of {columns} columns of {places} places, 4 bytes each"
    )]
    Memory {
        /// Places of the route.
        places: usize,
        /// Columns of the window: the sequence length, or the smoothing.
        columns: usize,
    },

    /// Not enough memory for numbers that lie in a mapped file, for one.
    #[error("not enough memory for a copy of {bytes} bytes of numbers")]
    Copy {
        /// The bytes of the numbers.
        bytes: usize,
    },

    /// A limit of memory that the next place would pass.
    #[error(
        "loop closer: the next place needs {needed} bytes of memory, and the limit is {limit}: set a higher one, or `freeze` the places that there are"
    )]
    MemoryLimit {
        /// The limit, in bytes.
        limit: usize,
        /// The bytes that would be in use.
        needed: usize,
    },

    /// A NaN or an infinity.
    #[error("{what}: expected finite numbers, got {value} at {}", place(*.row, *.index))]
    NotFinite {
        /// The numbers' name.
        what: &'static str,
        /// The row (place or query), if there are several.
        row: Option<usize>,
        /// The index within the row.
        index: usize,
        /// The number.
        value: f32,
    },

    /// A vector of zeros has no direction: neither a cosine distance nor a multiple of length 1.
    #[error("{what}{}: expected a vector that is not all zeros, which have no direction", of_row(*.row))]
    NoDirection {
        /// The vector's name.
        what: &'static str,
        /// Its row, if there are several.
        row: Option<usize>,
    },

    /// A descriptor of a type that cannot be compared with the map's.
    #[error("{what}: expected {}, got {got}", either(*.map, *.or_float))]
    Dtype {
        /// The descriptor's name.
        what: &'static str,
        /// The map's own type.
        map: Dtype,
        /// Whether float32 is accepted too, as on a map of ready descriptors.
        or_float: bool,
        /// The type given.
        got: Dtype,
    },

    /// An image that cannot be read.
    #[error("image {}: {}", Plain(.name), Plain(.reason))]
    Image {
        /// The file, or the index in a list.
        name: String,
        /// Why not.
        reason: String,
    },

    /// Images of one traverse must have one size.
    #[error(
        "image {}: expected {} x {} pixels like the ones before it, got {} x {}",
        Plain(.name), .expected.0, .expected.1, .got.0, .got.1
    )]
    ImageSize {
        /// The file, or the index in a list.
        name: String,
        /// Width and height of the first image.
        expected: (usize, usize),
        /// Width and height of this one.
        got: (usize, usize),
    },

    /// A folder or a pattern without images.
    #[error(
        "{}: expected images (png, jpeg, bmp, tiff, webp or pnm), found none{}{}",
        Plain(.place), if left_out.is_empty() { "" } else { "; " }, Plain(.left_out)
    )]
    NoImages {
        /// The folder or the pattern.
        place: String,
        /// The files that were left out, counted, or nothing.
        left_out: String,
    },

    /// The operating system refused a file.
    #[error("{}: cannot {action}: {}", Plain(.path.display()), Plain(.source))]
    Io {
        /// The file.
        path: PathBuf,
        /// The action that failed.
        action: &'static str,
        /// The system's error.
        source: io::Error,
    },

    /// A file that is not a map, or a damaged one.
    #[error("{}: not a usable surefix map: {}", Plain(.path.display()), Plain(.reason))]
    MapFile {
        /// The file.
        path: PathBuf,
        /// The defect.
        reason: String,
    },

    /// A map written by a newer version of the library.
    #[error(
        "{}: map format {found}, but this version of surefix reads up to {supported}: upgrade surefix",
        Plain(.path.display())
    )]
    MapVersion {
        /// The file.
        path: PathBuf,
        /// Its format version.
        found: u64,
        /// The newest one known here.
        supported: u64,
    },

    /// Places that cannot follow those of a map.
    #[error("{}: cannot append: expected {}, got {}", Plain(.map), Plain(.expected), Plain(.got))]
    Append {
        /// The map's file, "the map", or the index of the one that cannot be joined to the first.
        map: String,
        /// A value of the map.
        expected: String,
        /// That of the new places.
        got: String,
    },

    /// A snapshot that does not fit: damaged, of another map, or of another configuration.
    #[error("snapshot: {}", Plain(.reason))]
    Snapshot {
        /// The part that does not fit.
        reason: String,
    },

    /// A message between a driver and a shard that does not fit: of another map, version, options
    /// or query. Neither has changed.
    #[error("shard: {}", Plain(.reason))]
    Shard {
        /// What was expected, and what came.
        reason: String,
    },

    /// Settings that cannot be read, or that are for another map.
    #[error("settings: {}", Plain(.reason))]
    Settings {
        /// Why not.
        reason: String,
    },

    /// An image was pushed, but the map was made of ready descriptors.
    #[error(
        "image: this map was made of ready descriptors, so it cannot describe an image: push the image's descriptor instead"
    )]
    NoDescriptor,

    /// The progress callback asked to stop, or [`interruptible`](crate::interruptible) did.
    #[error("stopped{}", after(*done, *total))]
    Interrupted {
        /// Images or queries finished; 0 of 0 if they are not counted.
        done: usize,
        /// Images or queries to do.
        total: usize,
    },
}

impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

fn place(row: Option<usize>, index: usize) -> String {
    row.map_or_else(|| format!("index {index}"), |row| format!("row {row}, index {index}"))
}

fn after(done: usize, total: usize) -> String {
    if total == 0 { String::new() } else { format!(" after {done} of {total}") }
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
