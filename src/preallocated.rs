//! Lists whose room is set aside once: a copy of one has as much room as the original, and need not
//! ask for more later.

use std::collections::VecDeque;
use std::ops::{Deref, DerefMut};

/// A list that is cloned with its room.
#[derive(Debug)]
pub(crate) struct Preallocated<L>(pub(crate) L);

impl<T: Clone> Clone for Preallocated<Vec<T>> {
    fn clone(&self) -> Self {
        let mut copy = Vec::with_capacity(self.capacity());
        copy.extend_from_slice(self);
        Self(copy)
    }
}

impl<T: Clone> Clone for Preallocated<VecDeque<T>> {
    fn clone(&self) -> Self {
        let mut copy = VecDeque::with_capacity(self.capacity());
        copy.extend(self.iter().cloned());
        Self(copy)
    }
}

impl<L> Deref for Preallocated<L> {
    type Target = L;

    fn deref(&self) -> &L {
        &self.0
    }
}

impl<L> DerefMut for Preallocated<L> {
    fn deref_mut(&mut self) -> &mut L {
        &mut self.0
    }
}
