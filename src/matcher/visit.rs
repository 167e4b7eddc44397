//! What is done with numbers as they are made, some places at a time.

use std::ops::Range;

/// A closure, or, so that it is compiled for each instruction set, a type whose method is marked
/// `#[inline(always)]`.
pub(super) trait Visit<T> {
    /// The numbers of the places `start`, `start + 1`, ...
    fn visit(&mut self, start: usize, numbers: &mut [T]);

    /// What a number of these places must beat to be needed; nothing where all are.
    #[inline(always)]
    fn to_beat(&self, _places: Range<usize>) -> Option<T> {
        None
    }
}

impl<T, F: FnMut(usize, &mut [T])> Visit<T> for F {
    #[inline(always)]
    fn visit(&mut self, start: usize, numbers: &mut [T]) {
        self(start, numbers);
    }
}
