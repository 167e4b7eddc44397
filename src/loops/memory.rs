//! The memory of a loop closer: taken ahead of the places, counted, and limited.

use super::{LoopCloser, LoopClosure};
use crate::error::Error;

/// Places that there is room for at first, beside their rows.
const FIRST: usize = 256;
/// Edges that there is room for at first.
const EDGES: usize = 64;

impl LoopCloser {
    /// Bytes of memory that places, beliefs and edges have, whether in use or reserved. What is
    /// small and fixed is not counted.
    pub fn bytes(&self) -> usize {
        self.map.bytes()
            + self.filter.room() * self.filter.bytes_a_place()
            + self.column.capacity() * size_of::<f32>()
            + self.edges.capacity() * size_of::<LoopClosure>()
    }

    /// Bytes of places that went to a file, so as not to pass the limit of memory.
    pub fn bytes_in_file(&self) -> usize {
        self.map.bytes_in_file()
    }

    /// Takes the memory of `frames` more places and edges now: until they have come, `push`
    /// allocates nothing, but for the first image's size, after a gap, and for frames that show
    /// nothing.
    ///
    /// # Errors
    /// [`Error::MemoryLimit`] if that would pass the limit, [`Error::Memory`] if there is not
    /// enough. It has as many places and edges then as before.
    pub fn reserve(&mut self, frames: usize) -> Result<(), Error> {
        let places = self.map.rows().saturating_add(frames);
        let refused = Error::Memory { places, columns: 1 };
        let blocks = places.saturating_sub(self.map.room()).div_ceil(self.map.rows_of_a_block());
        let more = (blocks.saturating_mul(self.map.bytes_of_a_block()))
            .saturating_add(places.saturating_mul(self.bytes_of_belief()))
            .saturating_add(frames.saturating_mul(size_of::<LoopClosure>()));
        self.within_limit(more)?;
        // More than the system has is refused before any of it is taken.
        if Vec::<u8>::new().try_reserve_exact(more).is_err() {
            return Err(refused);
        }
        for taken in 0..blocks {
            if let Err(error) = self.map.reserve_block() {
                (0..taken).for_each(|_| self.map.drop_spare());
                return Err(error);
            }
        }
        let room = self
            .make_belief_room(places)
            .and_then(|()| self.edges.try_reserve(frames).map_err(|_| refused));
        if room.is_err() {
            (0..blocks).for_each(|_| self.map.drop_spare());
        }
        room
    }

    /// Makes room for the next place.
    ///
    /// # Errors
    /// [`Error::MemoryLimit`] if that would pass the limit, though all blocks that can be are in the
    /// file; [`Error::Memory`] and [`Error::Io`] if the system refuses.
    pub(super) fn make_room(&mut self) -> Result<(), Error> {
        let places = self.map.rows() + 1;
        if places > self.filter.room() {
            let twice = (2 * self.filter.room()).max(FIRST);
            let bit = (places + self.filter.room() / 4).max(FIRST);
            let target =
                if self.within_limit(twice * self.bytes_of_belief()).is_ok() { twice } else { bit };
            self.fit(target * self.bytes_of_belief())?;
            self.make_belief_room(target)?;
        }
        if self.edges.len() == self.edges.capacity() {
            let more = self.edges.len().max(EDGES);
            self.fit((self.edges.len() + more) * size_of::<LoopClosure>())?;
            let refused = |_| Error::Memory { places: more, columns: 1 };
            self.edges.try_reserve_exact(more).map_err(refused)?;
        }
        if places > self.map.room() {
            let more = self.map.bytes_of_a_block();
            // The memory of a block that goes to the file is that of the next.
            while self.map.room() < places && self.within_limit(more).is_err() {
                if !self.map.move_to_file()? {
                    return self.within_limit(more);
                }
            }
            if self.map.room() < places {
                self.map.reserve_block()?;
            }
        }
        Ok(())
    }

    /// Bytes of belief for each place.
    fn bytes_of_belief(&self) -> usize {
        self.filter.bytes_a_place() + size_of::<f32>()
    }

    /// Bytes of a loop closer that has room for the first places.
    pub(super) fn bytes_of_the_first(&self) -> usize {
        FIRST * self.bytes_of_belief()
            + EDGES * size_of::<LoopClosure>()
            + self.map.bytes_of_a_block()
    }

    fn make_belief_room(&mut self, places: usize) -> Result<(), Error> {
        let more = places.saturating_sub(self.column.len());
        let refused = |_| Error::Memory { places, columns: 1 };
        self.column.try_reserve_exact(more).map_err(refused)?;
        self.filter.reserve(places)
    }

    /// Whether `more` bytes stay within the limit.
    fn within_limit(&self, more: usize) -> Result<(), Error> {
        let needed = self.bytes().saturating_add(more);
        match self.config.memory {
            Some(limit) if needed > limit => Err(Error::MemoryLimit { limit, needed }),
            _ => Ok(()),
        }
    }

    /// Moves blocks to the file until `more` bytes stay within the limit.
    fn fit(&mut self, more: usize) -> Result<(), Error> {
        while self.within_limit(more).is_err() {
            if !self.map.give_back() && !self.map.move_to_file()? {
                return self.within_limit(more);
            }
        }
        Ok(())
    }
}
