//! What is done with numbers as they are made, some places at a time.

/// A closure, or, so that it is compiled for each instruction set, a type whose method is marked `#[inline(always)]`.
pub(super) trait Visit<T> {
    /// The numbers of the places `start`, `start + 1`, ...
    fn visit(&mut self, start: usize, numbers: &mut [T]);
}

impl<T, F: FnMut(usize, &mut [T])> Visit<T> for F {
    #[inline(always)]
    fn visit(&mut self, start: usize, numbers: &mut [T]) {
        self(start, numbers);
    }
}
