//! Lists whose memory is taken once: a copy has the capacity of the original, and allocates nothing
//! later.

use std::collections::VecDeque;
use std::ops::{Deref, DerefMut};

use crate::error::Error;
use crate::memory;

/// A list that is cloned with its capacity.
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

/// An empty list with memory for `length` items.
///
/// # Errors
/// [`Error::Memory`] if there is not enough.
pub(crate) fn reserved<T>(length: usize) -> Result<Vec<T>, Error> {
    let mut list = Vec::new();
    memory::reserve(&mut list, length).map_err(|_| Error::Memory { places: 1, columns: length })?;
    Ok(list)
}
