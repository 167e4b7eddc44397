//! The states of the parts between two queries.

use serde::{Deserialize, Serialize};

use super::super::track::{PartState, TrackerPart, TrackerWhole, WholeState};
use super::super::trust::{Anchor, Anchors};
use super::super::{MAX_FRAMES, Single};
use super::{Part, Whole};
use crate::archive::{Refusal, Tensors, Writer};

/// The name of the window's tensor.
const COLUMNS: &str = "columns";

/// That of the driver's tracker.
pub(crate) const VIEW: &str = "track.view";

/// The single match and the trust of the newest queries, newest first.
type Newest = Vec<(Single, bool)>;

/// A shard's, beside its tensors.
#[derive(Serialize, Deserialize)]
pub(crate) struct PartSaved {
    anchors: Newest,
    track: Option<PartState>,
}

/// The driver's.
#[derive(Serialize, Deserialize)]
pub(crate) struct WholeSaved {
    frames: u64,
    lowest: Option<f32>,
    follows: bool,
    anchors: Newest,
    track: Option<WholeState>,
}

fn newest(anchors: &Anchors, frames: u64, length: usize) -> Newest {
    let held = length.min(usize::try_from(frames).unwrap_or(usize::MAX));
    let each = (0..held).map(|age| anchors.get(age));
    each.map(|Anchor { single, trusted }| (single, trusted)).collect()
}

/// Anchors again.
///
/// # Errors
/// Other ones than queries can have had.
fn resumed(newest: &Newest, frames: u64, length: usize, places: usize) -> Result<Anchors, Refusal> {
    let held = length.min(usize::try_from(frames).unwrap_or(usize::MAX));
    let known = |(single, _): &(Single, bool)| single.place < places && single.distance.is_finite();
    if frames > MAX_FRAMES || newest.len() != held || !newest.iter().all(known) {
        return Err(Refusal::Foreign("impossible anchors".to_owned()));
    }
    let mut anchors = Anchors::new(length)?;
    for &(single, trusted) in newest.iter().rev() {
        anchors.push(Anchor { single, trusted });
    }
    Ok(anchors)
}

impl Part {
    /// The state after `frames` queries, beside its tensors; without the query in hand.
    pub(crate) fn save(&self, frames: u64) -> PartSaved {
        let anchors = newest(&self.anchors, frames, self.config.sequence_length);
        PartSaved { anchors, track: self.tracker.as_ref().map(TrackerPart::state) }
    }

    /// Adds its tensors.
    pub(crate) fn write<'a>(&'a self, writer: &mut Writer<'a>) {
        let ring = &self.window.cells.lower;
        let newest_first: Vec<_> = ring.columns(self.done).collect();
        writer.numbers(COLUMNS, vec![newest_first.len(), ring.height()], newest_first);
        for (name, numbers) in self.tracker.iter().flat_map(TrackerPart::tensors) {
            writer.numbers(name, vec![numbers.len()], vec![numbers]);
        }
    }

    /// Goes on from a state.
    ///
    /// # Errors
    /// One that no queries can have led to. The part is then as it was.
    pub(crate) fn resume(
        &mut self,
        saved: &PartSaved,
        frames: u64,
        tensors: &Tensors<'_>,
    ) -> Result<(), Refusal> {
        let places = self.places;
        let anchors = resumed(&saved.anchors, frames, self.config.sequence_length, places)?;
        let ring = &self.window.cells.lower;
        let (height, most) = (ring.height(), ring.capacity() - 1);
        let expected = format!("(at most {most}, {height})");
        let fits = |shape: &[usize]| {
            shape.len() == 2 && shape[1] == height && shape[0] <= most && shape[0] as u64 <= frames
        };
        let (_, columns) = tensors.required::<f32>(COLUMNS, &expected, fits)?;
        if columns.iter().any(|d| !d.is_finite()) {
            return Err(Refusal::Foreign("a distance that is not finite".to_owned()));
        }
        let tracker = match (&self.tracker, &saved.track) {
            (None, _) => None,
            (Some(tracker), Some(state)) => Some(tracker.resumed(state, tensors)?),
            (Some(_), None) => return Err(Refusal::Foreign("no state of the tracker".to_owned())),
        };
        (self.anchors, self.tracker, self.asked) = (anchors, tracker, None);
        let ring = &mut self.window.cells.lower;
        ring.clear();
        for column in columns.chunks_exact(height).rev() {
            ring.advance().copy_from_slice(column);
        }
        self.done = ring.held();
        Ok(())
    }
}

impl Whole {
    /// The numbers of the tensor [`VIEW`].
    pub(crate) fn view(&self) -> Vec<f64> {
        self.tracker.as_ref().map(TrackerWhole::view).unwrap_or_default()
    }

    pub(crate) fn save(&self) -> WholeSaved {
        WholeSaved {
            frames: self.frames,
            lowest: self.lowest.is_finite().then_some(self.lowest),
            follows: self.follows,
            anchors: newest(&self.anchors, self.frames, self.config.sequence_length),
            track: self.tracker.as_ref().map(TrackerWhole::saved),
        }
    }

    /// Goes on from a state.
    ///
    /// # Errors
    /// One that no queries can have led to.
    pub(crate) fn resume(
        &mut self,
        saved: &WholeSaved,
        tensors: &Tensors<'_>,
    ) -> Result<(), Refusal> {
        let WholeSaved { frames, lowest, follows, .. } = *saved;
        let (length, places) = (self.config.sequence_length, self.segments.places());
        let anchors = resumed(&saved.anchors, frames, length, places)?;
        match (&mut self.tracker, &saved.track) {
            (None, _) => {}
            (Some(tracker), Some(state)) => {
                let (_, view) = tensors.required::<f64>(VIEW, "(n)", |shape| shape.len() == 1)?;
                tracker.resume(state, &view)?;
            }
            (Some(_), None) => return Err(Refusal::Foreign("no state of the tracker".to_owned())),
        }
        self.anchors = anchors;
        (self.frames, self.follows) = (frames, follows);
        self.lowest = lowest.unwrap_or(f32::INFINITY);
        Ok(())
    }
}
