//! The states of the parts between two queries.

use serde::{Deserialize, Serialize};

use super::super::trust::{Anchor, Anchors};
use super::super::{MAX_FRAMES, Single};
use super::{Part, Whole};
use crate::archive::{Refusal, Tensors};

/// The name of the window's tensor.
const COLUMNS: &str = "columns";

/// The single match and the trust of the newest queries, newest first.
type Newest = Vec<(Single, bool)>;

/// A shard's, beside its tensors.
#[derive(Serialize, Deserialize)]
pub(crate) struct PartSaved {
    anchors: Newest,
}

/// The driver's.
#[derive(Serialize, Deserialize)]
pub(crate) struct WholeSaved {
    frames: u64,
    lowest: Option<f32>,
    follows: bool,
    anchors: Newest,
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
        PartSaved { anchors: newest(&self.anchors, frames, self.config.sequence_length) }
    }

    /// Its tensors: names, shapes and pieces.
    pub(crate) fn tensors(&self) -> Vec<(&'static str, Vec<usize>, Vec<&[f32]>)> {
        let ring = &self.window.cells.lower;
        let newest_first: Vec<_> = ring.columns(self.done).collect();
        vec![(COLUMNS, vec![newest_first.len(), ring.height()], newest_first)]
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
        self.anchors = anchors;
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
    pub(crate) fn save(&self) -> WholeSaved {
        WholeSaved {
            frames: self.frames,
            lowest: self.lowest.is_finite().then_some(self.lowest),
            follows: self.follows,
            anchors: newest(&self.anchors, self.frames, self.config.sequence_length),
        }
    }

    /// Goes on from a state.
    ///
    /// # Errors
    /// One that no queries can have led to.
    pub(crate) fn resume(&mut self, saved: &WholeSaved) -> Result<(), Refusal> {
        let WholeSaved { frames, lowest, follows, .. } = *saved;
        let (length, places) = (self.config.sequence_length, self.segments.places());
        self.anchors = resumed(&saved.anchors, frames, length, places)?;
        (self.frames, self.follows) = (frames, follows);
        self.lowest = lowest.unwrap_or(f32::INFINITY);
        Ok(())
    }
}
