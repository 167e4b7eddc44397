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

use super::consensus::Single;
use super::gradient::gradient;
use super::ring::Ring;
use super::{Anchor, Matcher};
use crate::config::Config;
use crate::error::Error;
use crate::post::Running;

const FORMAT: &str = "surefix-snapshot";
const VERSION: u64 = 3;
/// What is written without statistics of a drive, for versions of the library that know none.
const WITHOUT_RUNNING: u64 = 2;
/// And where no gap is within reach either.
const WITHOUT_GAP: u64 = 1;
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
    /// How many queries have come since a gap, where they are fewer than the window and the
    /// smoothing reach back.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    since_gap: Option<u64>,
    /// How many statistics of the drive there are.
    #[serde(default, skip_serializing_if = "is_zero")]
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
        let (window, smoothed) =
            (self.held(self.config.sequence_length), self.held(self.smoothed()));
        let columns = bytes((0..window).flat_map(|age| self.columns.column(age).iter().copied()));
        let gradients = bytes((0..smoothed).flat_map(|age| self.gradient(age)));
        let (seen, reach) =
            (self.held(self.columns.capacity()) as u64, self.columns.capacity() as u64);
        let since_gap = (seen < self.frames.min(reach)).then_some(seen);
        let header = Header {
            format: FORMAT.to_owned(),
            version: version(running.len(), since_gap),
            map,
            places: self.places,
            config: self.config.clone(),
            frames: self.frames,
            since_gap,
            running: running.len(),
            lowest: self.lowest.is_finite().then_some(self.lowest),
            anchors: (0..window).map(|age| self.anchor(age)).collect(),
        };
        let header = serde_json::to_string(&header).map_err(|e| refused(&e))?;
        let tensor = |bytes, count: usize| {
            TensorView::new(Dtype::F32, vec![count, self.places], bytes).map_err(|e| refused(&e))
        };
        let parts = [&columns, &gradients].into_iter().chain(running).map(Vec::as_slice);
        let checksum = checksum(&header, parts);
        let bytes = |dtype, count: usize, bytes| {
            TensorView::new(dtype, vec![count], bytes).map_err(|e| refused(&e))
        };
        let mut tensors = vec![
            ("columns".to_owned(), tensor(&columns, window)?),
            ("gradients".to_owned(), tensor(&gradients, smoothed)?),
            ("checksum".to_owned(), bytes(Dtype::U64, 1, &checksum)?),
        ];
        for (index, running) in running.iter().enumerate() {
            tensors.push((running_name(index), bytes(Dtype::U8, running.len(), running)?));
        }
        serialize(tensors, Some(HashMap::from([(ENTRY.to_owned(), header)])))
            .map_err(|e| refused(&e))
    }

    /// How many of the newest `capacity` columns or gradients there are yet.
    fn held(&self, capacity: usize) -> usize {
        (self.columns.len() + self.earlier.len()).min(capacity)
    }

    /// How many gradients a snapshot holds at most.
    fn smoothed(&self) -> usize {
        self.config.smoothing.min(self.places)
    }

    /// The gradient (Eq. 1) of `age` queries ago.
    fn gradient(&self, age: usize) -> Vec<f32> {
        let seen = self.columns.len();
        if age >= seen {
            return self.earlier.column(age - seen).to_vec();
        }
        let mut g = vec![0.0; self.places];
        gradient(self.columns.column(age), self.config.gradient, &mut g);
        g
    }

    fn anchor(&self, age: usize) -> (usize, bool) {
        let anchor = self.anchors.get(age);
        (anchor.single.place, anchor.trusted)
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
    let gradients = tensors.tensor("gradients").map_err(|e| damaged(&e))?;
    let written = tensors.tensor("checksum").map_err(|e| damaged(&e))?;
    let running: Vec<_> =
        (0..).map_while(|index| tensors.tensor(&running_name(index)).ok()).collect();
    let parts = [&columns, &gradients].into_iter().chain(&running).map(TensorView::data);
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
    let (length, smoothed) =
        (header.config.sequence_length, header.config.smoothing.min(header.places));
    let seen = header.since_gap.unwrap_or(header.frames);
    let reached = header.frames.min(length.max(smoothed) as u64);
    if header.running != running.len() {
        return Err(damaged(&"a wrong number of statistics of the drive"));
    }
    let format = version(header.running, header.since_gap);
    if header.version != format || (header.since_gap.is_some() && seen >= reached) {
        return Err(damaged(&"an impossible gap"));
    }
    let held = |capacity: usize| usize::try_from(seen).unwrap_or(usize::MAX).min(capacity);
    check_shape(&columns, held(length), header.places)?;
    check_shape(&gradients, held(smoothed), header.places)?;
    if header.anchors.len() != held(length) {
        return Err(damaged(&"a wrong number of anchors"));
    }

    let mut matcher = Matcher::new(header.places, header.config).map_err(|e| damaged(&e))?;
    matcher.lowest = header.lowest.unwrap_or(f32::INFINITY);
    matcher.frames = header.frames - header.anchors.len() as u64;
    for (column, &(place, trusted)) in
        newest_last(columns.data(), header.places).zip(header.anchors.iter().rev())
    {
        for (number, x) in matcher.columns.advance().iter_mut().zip(floats(column)) {
            *number = x;
        }
        let distance = matcher.columns.column(0).get(place);
        let distance = *distance.ok_or_else(|| damaged(&"an anchor off the route"))?;
        matcher.anchors.push(Anchor { single: Single { place, distance }, trusted });
        matcher.search.catch_up(&matcher.columns, matcher.frames);
        matcher.frames += 1;
    }
    // Where the smoothing reaches further back than the sequence, the gradients are all that is
    // left of the older columns.
    let older = gradients.shape()[0].saturating_sub(header.anchors.len());
    matcher.earlier = Ring::new(older, header.places)?;
    for gradient in newest_last(gradients.data(), header.places).take(older) {
        for (number, x) in matcher.earlier.advance().iter_mut().zip(floats(gradient)) {
            *number = x;
        }
    }
    let made = (0..gradients.shape()[0]).flat_map(|age| matcher.gradient(age));
    let mut pairs = made.zip(floats(gradients.data()));
    // Processors differ in how they write a NaN, which is what an overflow can end in.
    if !pairs.all(|(made, written)| made == written || (made.is_nan() && written.is_nan())) {
        return Err(damaged(&"gradients of other columns than its own"));
    }
    let running = running.iter().map(|running| Running::restore(running.data()));
    Ok(Saved { matcher, map: header.map, running: running.collect::<Result<_, _>>()? })
}

/// The version that knows all of it.
fn version(running: usize, since_gap: Option<u64>) -> u64 {
    match since_gap {
        _ if running > 0 => VERSION,
        Some(_) => WITHOUT_RUNNING,
        None => WITHOUT_GAP,
    }
}

fn running_name(index: usize) -> String {
    format!("running.{index}")
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
fn is_zero(count: &usize) -> bool {
    *count == 0
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

/// The columns of a tensor, which are written newest first, from the oldest on.
fn newest_last(tensor: &[u8], places: usize) -> impl Iterator<Item = &[u8]> {
    tensor.chunks_exact(places * 4).rev()
}

fn check_shape(tensor: &TensorView<'_>, columns: usize, places: usize) -> Result<(), Error> {
    if tensor.dtype() == Dtype::F32 && tensor.shape() == [columns, places] {
        return Ok(());
    }
    let expected = format!("expected float32 ({columns}, {places}), got {:?}", tensor.shape());
    Err(refused(&format!("damaged: a tensor of the wrong shape: {expected}")))
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
