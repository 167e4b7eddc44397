//! A matcher's state as bytes, so that a robot that restarts goes on where it was, to the last bit:
//! an [`archive`](crate::archive) of the tensors `columns` (newest first) and, of a localizer,
//! `running.K`: statistics of the drive, each as its own archive.

use safetensors::tensor::Dtype;
use serde::{Deserialize, Serialize};

use super::single::{is_constant, minimum};
use super::trust::Anchor;
use super::{Fusion, Matcher, track, track::Tracker};
use crate::archive::{self, Format, Refusal, Tensors, Writer, in_pieces};
use crate::config::Config;
use crate::error::Error;
use crate::segments::Segments;

const FORMAT: Format = Format { name: "surefix-snapshot", version: 1 };
/// More queries than any camera has sent, and far below an overflow.
pub(super) const MAX_FRAMES: u64 = 1 << 60;
/// The bytes of memory that any snapshot may ask for, and those for each of its own bytes: one that
/// is forged takes no more. A snapshot of a large matcher with few columns is made longer.
const ANY: usize = 64 << 20;
const EACH: usize = 64;

#[derive(Serialize, Deserialize)]
struct Entry {
    /// The fingerprint of the map that it belongs to, if any.
    map: Option<u64>,
    places: usize,
    /// How the places follow each other, unless in one segment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    segments: Option<Segments>,
    config: Config,
    frames: u64,
    /// How many statistics of the drive there are.
    running: usize,
    /// How many columns each of several techniques has seen; their sums are tensors.
    #[serde(default)]
    techniques: Vec<u64>,
    /// The smallest distance so far; `None` before the first query.
    lowest: Option<f32>,
    /// The single match's place and trust of the newest queries, newest first.
    anchors: Vec<(usize, bool)>,
    /// The tracker's state, if there is motion; its beliefs are tensors.
    #[serde(default)]
    track: Option<track::Saved>,
}

/// The contents of a snapshot.
pub(crate) struct Saved {
    pub(crate) matcher: Matcher,
    /// A localizer's statistics of the drive.
    pub(crate) running: Vec<Vec<u8>>,
    /// The statistics of each of several techniques.
    pub(crate) techniques: Vec<track::Hubness>,
}

/// The map that a snapshot must belong to.
pub(crate) struct Owner<'a> {
    pub(crate) fingerprint: u64,
    pub(crate) segments: &'a Segments,
}

impl Matcher {
    /// The matcher's whole state as bytes; [`restore`](Self::restore) goes on from it
    /// bit-identically.
    ///
    /// # Errors
    /// [`Error::Snapshot`] if the state is too large for the format (over 8 MiB of header).
    pub fn snapshot(&self) -> Result<Vec<u8>, Error> {
        self.save(None, &[], None)
    }

    /// A matcher that goes on where the snapshot was taken. If `expected` is given, the snapshot
    /// must have been taken under the same options.
    ///
    /// # Errors
    /// [`Error::Snapshot`] if the bytes are damaged, foreign, of a newer version, or of other
    /// options.
    pub fn restore(snapshot: &[u8], expected: Option<&Config>) -> Result<Self, Error> {
        Ok(load(snapshot, expected, None)?.matcher)
    }

    /// The state as bytes, marked with the fingerprint of the map that it belongs to, and with
    /// snapshots of a drive's statistics.
    pub(crate) fn save(
        &self,
        map: Option<u64>,
        running: &[Vec<u8>],
        fusion: Option<&Fusion>,
    ) -> Result<Vec<u8>, Error> {
        let techniques = || fusion.into_iter().flat_map(Fusion::statistics);
        let columns = &self.window.cells.lower;
        let held = columns.len().min(self.config.sequence_length);
        let entry = Entry {
            map,
            places: self.places(),
            segments: {
                let several = self.segments != Segments::one(self.places());
                several.then(|| self.segments.clone())
            },
            config: self.config.clone(),
            frames: self.frames,
            running: running.len(),
            techniques: techniques().map(|(columns, _)| columns).collect(),
            lowest: self.lowest.is_finite().then_some(self.lowest),
            anchors: (0..held)
                .map(|age| self.anchors.get(age))
                .map(|anchor| (anchor.single.place, anchor.trusted))
                .collect(),
            track: self.tracker.as_ref().map(Tracker::saved),
        };
        let mut writer = Writer::new();
        let newest_first = (0..columns.len()).map(|age| columns.column(age)).collect();
        writer.numbers("columns", vec![columns.len(), self.places()], newest_first);
        if let Some(tracker) = &self.tracker {
            for (name, numbers) in tracker.tensors() {
                writer.numbers(name, vec![numbers.len()], vec![numbers]);
            }
        }
        for (index, (_, sums)) in techniques().enumerate() {
            writer.numbers(technique_name(index), vec![sums.len()], vec![sums]);
        }
        for (index, bytes) in running.iter().enumerate() {
            writer.numbers(running_name(index), vec![bytes.len()], vec![bytes.as_slice()]);
        }
        let room = asked(&self.segments, &self.config).saturating_sub(ANY).div_ceil(EACH);
        let room = room.saturating_sub(writer.len());
        if room > 0 {
            writer.stream("room", Dtype::U8, vec![room], move |out| {
                in_pieces(room, |zeros| out.bytes(zeros))
            });
        }
        writer.to_bytes(&FORMAT, &entry)
    }
}

/// Reads a snapshot: of the `expected` options and of `owner`, if given.
///
/// # Errors
/// [`Error::Snapshot`] if it does not fit these, or is none.
pub(crate) fn load(
    snapshot: &[u8],
    expected: Option<&Config>,
    owner: Option<&Owner<'_>>,
) -> Result<Saved, Error> {
    let damaged = |refusal: Refusal| refusal.of_snapshot("a snapshot");
    let tensors = archive::read(snapshot, &FORMAT).map_err(damaged)?;
    let entry: Entry = tensors.header.entry().map_err(damaged)?;
    if let Some(expected) = expected.filter(|&expected| *expected != entry.config) {
        let differences = expected.differences(&entry.config);
        let reason = format!("taken under other options: {differences}");
        return Err(Error::Snapshot { reason });
    }
    let segments = entry.segments.clone().unwrap_or_else(|| Segments::one(entry.places));
    if let Some(owner) = owner {
        let same = entry.map == Some(owner.fingerprint) && entry.places == owner.segments.places();
        let reason = match entry.map {
            Some(_) if same && segments == *owner.segments => None,
            Some(_) if same => Some("taken on other segments of this map"),
            Some(_) => Some("taken on another map than this one"),
            None => Some("of a matcher without a map: restore it with Matcher"),
        };
        if let Some(reason) = reason {
            return Err(Error::Snapshot { reason: reason.to_owned() });
        }
    }
    read(&tensors, entry, segments, snapshot.len()).map_err(damaged)
}

/// About how many bytes of memory a matcher takes.
fn asked(segments: &Segments, config: &Config) -> usize {
    let speeds = config.motion.as_ref().map_or(0, |motion| motion.speeds.len());
    let of_a_place = (4 * config.columns(segments)).saturating_add(32 * speeds).saturating_add(32);
    segments.places().saturating_mul(of_a_place)
}

/// The matcher of a snapshot of `given` bytes, whose numbers must fit together.
fn read(
    tensors: &Tensors<'_>,
    entry: Entry,
    segments: Segments,
    given: usize,
) -> Result<Saved, Refusal> {
    let refused = |reason: &str| Refusal::Foreign(reason.to_owned());
    let Entry { places, config, frames, anchors, track, .. } = entry;
    let places_of = format!("({places})");
    if segments.places() != places {
        return Err(refused("segments of another number of places"));
    }
    config.validate_along(&segments)?;
    if frames > MAX_FRAMES {
        return Err(refused("an impossible number of frames"));
    }
    let length = config.sequence_length;
    let reach = config.columns(&segments);
    let asked = asked(&segments, &config);
    if asked > given.saturating_mul(EACH).saturating_add(ANY) {
        let more = format!("{given} bytes that ask for {asked} bytes of memory");
        return Err(refused(&more));
    }
    // The shape first: columns of a forged size must not take memory.
    let expected = format!("(columns, {places})");
    let fits = |shape: &[usize]| shape.len() == 2 && shape[1] == places;
    let (shape, columns) = tensors.required::<f32>("columns", &expected, fits)?;
    let held = shape[0];
    if held > reach || held as u64 > frames || anchors.len() != held.min(length) {
        return Err(refused("a wrong number of columns or anchors"));
    }
    if columns.iter().any(|d| !d.is_finite()) {
        return Err(refused("a distance that is not finite"));
    }
    let running = (0..entry.running)
        .map_while(|index| tensors.numbers(&running_name(index), "(n)", |_| true).transpose())
        .map(|tensor| Ok(tensor?.1))
        .collect::<Result<Vec<_>, Refusal>>()?;
    if running.len() != entry.running {
        return Err(refused("a wrong number of statistics of the drive"));
    }

    let mut matcher = Matcher::along(segments, config)?;
    matcher.lowest = entry.lowest.unwrap_or(f32::INFINITY);
    matcher.frames = frames;
    for (age, column) in columns.chunks_exact(places).enumerate().rev() {
        let single = minimum(column);
        if single.distance < matcher.lowest && !is_constant(column) {
            return Err(refused("a distance below the smallest so far"));
        }
        if let Some(&(place, trusted)) = anchors.get(age) {
            if place != single.place {
                return Err(refused("an anchor that is not its column's minimum"));
            }
            if trusted && is_constant(column) {
                return Err(refused("an anchor of a column that says nothing"));
            }
            matcher.anchors.push(Anchor { single, trusted });
        }
        matcher.window.cells.push(column, column, places);
    }
    if let Some(tracker) = &mut matcher.tracker {
        let numbers = |name: &str, length: usize| {
            let fits = |shape: &[usize]| shape == [length];
            tensors.required::<f64>(name, &format!("({length})"), fits).map(|(_, numbers)| numbers)
        };
        let track = track.ok_or_else(|| refused("no state of the tracker"))?;
        tracker.resume(track, numbers)?;
    }
    let technique = |(index, &columns): (usize, &u64)| {
        let name = technique_name(index);
        let (_, sums) = tensors.required::<f64>(&name, &places_of, |shape| shape == [places])?;
        let known = track::Hubness::resumed(columns, sums);
        known.ok_or_else(|| refused("impossible statistics of a technique"))
    };
    let techniques = entry.techniques.iter().enumerate().map(technique);
    let techniques = techniques.collect::<Result<Vec<_>, Refusal>>()?;
    Ok(Saved { matcher, running, techniques })
}

fn technique_name(index: usize) -> String {
    format!("technique.{index}")
}

fn running_name(index: usize) -> String {
    format!("running.{index}")
}
