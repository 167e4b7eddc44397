//! Whether to trust the single match (method 1.3, Eq. 3), and the trusted matches of the window.

use super::gradient::Peak;
use super::single::Single;
use crate::error::Error;
use crate::preallocated::reserved;
use crate::segments::Segments;

/// Eq. 3: the smallest distance and the largest gradient fall on the same place, within
/// `tolerance` places of one segment. A segment of one place has no gradient, and no say.
pub(super) fn consensus(single: Single, peak: Peak, segments: &Segments, tolerance: usize) -> bool {
    segments.of(single.place).len() > 1 && segments.are_near(single.place, peak.place, tolerance)
}

/// The single match of a column and whether it was trusted: all that Eq. 4 needs to weight it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Anchor {
    pub(super) single: Single,
    pub(super) trusted: bool,
}

/// The anchors of the newest queries.
#[derive(Clone, Debug)]
pub(super) struct Anchors {
    ring: Vec<Anchor>,
    /// The index of the newest.
    newest: usize,
}

impl Anchors {
    /// Those of `length` queries.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is not enough.
    pub(super) fn new(length: usize) -> Result<Self, Error> {
        let none = Anchor { single: Single { place: 0, distance: 0.0 }, trusted: false };
        let mut ring = reserved(length)?;
        ring.resize(length, none);
        Ok(Self { ring, newest: 0 })
    }

    pub(super) fn push(&mut self, anchor: Anchor) {
        self.newest = if self.newest + 1 == self.ring.len() { 0 } else { self.newest + 1 };
        self.ring[self.newest] = anchor;
    }

    /// That of `age` queries ago, below `length`.
    pub(super) fn get(&self, age: usize) -> Anchor {
        self.ring[self.mirrored(age)]
    }

    /// The age of each trusted match, and the match, in any order, which is always the same;
    /// `length` queries must have been pushed.
    pub(super) fn trusted(&self) -> impl Iterator<Item = (usize, Single)> {
        let trusted = self.ring.iter().enumerate().filter(|(_, anchor)| anchor.trusted);
        trusted.map(|(index, anchor)| (self.mirrored(index), anchor.single))
    }

    /// The index of an age, and the age of an index.
    fn mirrored(&self, index: usize) -> usize {
        let newest = self.newest;
        if index > newest { newest + self.ring.len() - index } else { newest - index }
    }
}
