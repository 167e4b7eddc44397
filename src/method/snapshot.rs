//! A matcher's state as bytes, so that a robot that restarts goes on where it was, to the last bit.
//!
//! A snapshot is a small safetensors file: the tensors `columns` and `gradients` (newest first), a
//! localizer's `running.K`, each the snapshot of a drive's statistics, one metadata entry `surefix`
//! with the rest as JSON, and the tensor `checksum` over all of it.

use std::collections::HashMap;
use std::hash::Hasher as _;

use safetensors::tensor::{Dtype, TensorView};
use safetensors::{SafeTensors, serialize};
use serde::{Deserialize, Serialize};
use twox_hash::XxHash3_64;

use super::trust::Single;
use super::{Anchor, Matcher};
use crate::config::Config;
use crate::descriptor::Running;
use crate::error::Error;

const FORMAT: &str = "surefix-snapshot";
const VERSION: u64 = 1;
/// The one metadata entry; a map file has the same.
const ENTRY: &str = "surefix";
/// More queries than any camera has sent, and far from where a count overflows.
const MAX_FRAMES: u64 = 1 << 60;

#[derive(Serialize, Deserialize)]
struct Header {
    format: String,
    version: u64,
    /// The fingerprint of the map that it belongs to, if any.
    map: Option<u64>,
    places: usize,
    config: Config,
    frames: u64,
    /// How many statistics of the drive there are.
    running: usize,
    /// The smallest distance so far; nothing before the first query.
    lowest: Option<f32>,
    /// The single match's place and trust of each column, newest first.
    anchors: Vec<(usize, bool)>,
}

/// What a snapshot held.
pub(crate) struct Saved {
    pub(crate) matcher: Matcher,
    pub(crate) map: Option<u64>,
    /// What a localizer knew of the drive.
    pub(crate) running: Vec<Running>,
}

impl Matcher {
    /// The matcher's whole state as bytes; [`restore`](Self::restore) goes on from it
    /// bit-identically.
    ///
    /// # Errors
    /// [`Error::Snapshot`] where the state is too large for the format (over 100 MB of header).
    pub fn snapshot(&self) -> Result<Vec<u8>, Error> {
        self.save(None, &[])
    }

    /// A matcher that goes on where the snapshot was taken. Where `expected` is given, the snapshot
    /// must have been taken under the same options.
    ///
    /// # Errors
    /// [`Error::Snapshot`] where the bytes are damaged, foreign, of a newer version, or of other
    /// options.
    pub fn restore(snapshot: &[u8], expected: Option<&Config>) -> Result<Self, Error> {
        let saved = load(snapshot, expected)?;
        Ok(saved.matcher)
    }

    /// The state as bytes, marked with the fingerprint of the map that it belongs to, and with
    /// snapshots of a drive's statistics.
    pub(crate) fn save(&self, map: Option<u64>, running: &[Vec<u8>]) -> Result<Vec<u8>, Error> {
        let held = &self.window.cells.lower;
        let (columns, places) = (held.len(), self.places());
        let numbers = bytes((0..columns).flat_map(|age| held.column(age).iter().copied()));
        let anchors =
            (0..columns.min(self.config.sequence_length)).map(|age| self.anchors.get(age));
        let header = Header {
            format: FORMAT.to_owned(),
            version: VERSION,
            map,
            places,
            config: self.config.clone(),
            frames: self.frames,
            running: running.len(),
            lowest: self.lowest.is_finite().then_some(self.lowest),
            anchors: anchors.map(|anchor| (anchor.single.place, anchor.trusted)).collect(),
        };
        let header = serde_json::to_string(&header).map_err(|e| refused(&e))?;
        let parts = [&numbers].into_iter().chain(running).map(Vec::as_slice);
        let checksum = checksum(&header, parts);
        let tensor = |dtype, shape: Vec<usize>, bytes| {
            TensorView::new(dtype, shape, bytes).map_err(|e| refused(&e))
        };
        let mut tensors = vec![
            ("columns".to_owned(), tensor(Dtype::F32, vec![columns, places], &numbers)?),
            ("checksum".to_owned(), tensor(Dtype::U64, vec![1], &checksum)?),
        ];
        for (index, running) in running.iter().enumerate() {
            tensors.push((running_name(index), tensor(Dtype::U8, vec![running.len()], running)?));
        }
        let entries = HashMap::from([(ENTRY.to_owned(), header)]);
        serialize(tensors, Some(entries)).map_err(|e| refused(&e))
    }
}

/// Reads a snapshot, and refuses one that no matcher can have written.
pub(crate) fn load(snapshot: &[u8], expected: Option<&Config>) -> Result<Saved, Error> {
    let damaged = |e: &dyn std::fmt::Display| refused(&format!("damaged or not a snapshot ({e})"));
    let tensors = SafeTensors::deserialize(snapshot).map_err(|e| damaged(&e))?;
    let (_, metadata) = SafeTensors::read_metadata(snapshot).map_err(|e| damaged(&e))?;
    let entry = metadata.metadata().as_ref().and_then(|entries| entries.get(ENTRY));
    let text = entry.ok_or_else(|| damaged(&"no surefix entry"))?;
    check_version(text)?;
    let columns = tensors.tensor("columns").map_err(|e| damaged(&e))?;
    let written = tensors.tensor("checksum").map_err(|e| damaged(&e))?;
    let running: Vec<_> =
        (0..).map_while(|index| tensors.tensor(&running_name(index)).ok()).collect();
    let parts = [&columns].into_iter().chain(&running).map(TensorView::data);
    if checksum(text, parts) != written.data() {
        return Err(damaged(&"its checksum does not fit"));
    }
    let header: Header = serde_json::from_str(text).map_err(|e| damaged(&e))?;
    if let Some(expected) = expected
        && *expected != header.config
    {
        return Err(refused(&format!(
            "taken under other options: {}",
            expected.differences(&header.config)
        )));
    }

    // The shapes first: a forged size must not take memory.
    header.config.validate(header.places).map_err(|e| damaged(&e))?;
    if header.frames > MAX_FRAMES {
        return Err(damaged(&"an impossible number of frames"));
    }
    if header.running != running.len() {
        return Err(damaged(&"a wrong number of statistics of the drive"));
    }
    let (places, length) = (header.places, header.config.sequence_length);
    let reach = length.max(header.config.smoothing.min(places));
    let held = columns.shape().first().copied().unwrap_or(0);
    if columns.dtype() != Dtype::F32 || columns.shape() != [held, places] {
        let expected = format!("float32 (columns, {places}), got {:?}", columns.shape());
        return Err(damaged(&format!("a tensor of the wrong shape: expected {expected}")));
    }
    if held > reach || held as u64 > header.frames || header.anchors.len() != held.min(length) {
        return Err(damaged(&"a wrong number of columns or anchors"));
    }

    let mut matcher = Matcher::new(places, header.config).map_err(|e| damaged(&e))?;
    matcher.lowest = header.lowest.unwrap_or(f32::INFINITY);
    matcher.frames = header.frames;
    // Newest first in the file.
    let columns: Vec<&[u8]> = columns.data().chunks_exact(places * 4).collect();
    for (age, column) in columns.iter().enumerate().rev() {
        let column: Vec<f32> = floats(column).collect();
        if let Some(&(place, trusted)) = header.anchors.get(age) {
            let distance = *column.get(place).ok_or_else(|| damaged(&"an anchor off the route"))?;
            matcher.anchors.push(Anchor { single: Single { place, distance }, trusted });
        }
        if let Some(index) = column.iter().position(|d| !d.is_finite()) {
            return Err(damaged(&format!("a distance that is not finite at place {index}")));
        }
        matcher.window.cells.push(&column, &column, places);
    }
    let running = running.iter().map(|running| Running::restore(running.data()));
    Ok(Saved { matcher, map: header.map, running: running.collect::<Result<_, _>>()? })
}

fn running_name(index: usize) -> String {
    format!("running.{index}")
}

/// The version first: a newer header may lack what this one has.
fn check_version(header: &str) -> Result<(), Error> {
    #[derive(Deserialize)]
    struct Version {
        format: String,
        version: u64,
    }
    match serde_json::from_str::<Version>(header) {
        Ok(Version { format, version }) if format == FORMAT && version > VERSION => {
            Err(refused(&format!(
                "format {version}, but this version of surefix reads up to {VERSION}: upgrade surefix"
            )))
        }
        Ok(Version { format, .. }) if format == FORMAT => Ok(()),
        _ => Err(refused(&"damaged or not a snapshot (the header is not a snapshot's)")),
    }
}

fn bytes(numbers: impl Iterator<Item = f32>) -> Vec<u8> {
    numbers.flat_map(f32::to_le_bytes).collect()
}

fn floats(bytes: &[u8]) -> impl Iterator<Item = f32> {
    bytes.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes))
}

/// A hash of all that a snapshot says, so that a flipped bit does not pass.
fn checksum<'a>(header: &str, parts: impl IntoIterator<Item = &'a [u8]>) -> [u8; 8] {
    let mut hash = XxHash3_64::with_seed(0);
    hash.write(header.as_bytes());
    for part in parts {
        hash.write(part);
    }
    hash.finish().to_le_bytes()
}

fn refused(reason: &dyn std::fmt::Display) -> Error {
    Error::Snapshot { reason: reason.to_string() }
}
