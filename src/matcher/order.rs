//! In which order the distances on one diagonal are added (method 1.5, Eq. 6).

/// The window of a query, split by age into the columns of its own block of queries, the block
/// before, and what the window holds of the one before that.
///
/// Blocks are `max(1, L / 2)` queries long and begin at query 0, so that the split is a function of
/// the query's number and `L` only: a stream, a piece of a batch and a restored snapshot add in the
/// same order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Runs {
    /// How many columns of the query's own block there are, itself included: ages `0..newest`.
    pub(super) newest: usize,
    /// How many of the block before: the next ages. A whole block, unless `L` is 1.
    pub(super) full: usize,
    /// How many of the one before that: the oldest ages.
    pub(super) rest: usize,
}

impl Runs {
    pub(super) fn at(frame: u64, length: usize) -> Self {
        let newest = row(frame, length) + 1;
        let full = block(length).min(length - newest);
        Self { newest, full, rest: length - newest - full }
    }
}

/// Queries a block.
pub(super) fn block(length: usize) -> usize {
    (length / 2).max(1)
}

/// Where the query stands in its block, from 0.
pub(super) fn row(frame: u64, length: usize) -> usize {
    (frame % block(length) as u64) as usize
}

/// The sum of `length` distances on the diagonal whose newest one is of query `frame`; `term(age)`
/// is that of `age` queries ago. This is the definition of the order of additions, and what every
/// faster way must equal to the last bit: the block of the query and the one before it are each
/// added from the oldest distance to the newest, the rest from the newest to the oldest, and then
/// the three sums in this order.
#[inline(always)]
pub(super) fn diagonal_sum(frame: u64, length: usize, term: impl Fn(usize) -> f64) -> f64 {
    let Runs { newest, full, rest } = Runs::at(frame, length);
    let add = |sum: f64, next: f64| sum + next;
    let own = (0..newest).rev().map(&term).reduce(add);
    let before = (newest..newest + full).rev().map(&term).reduce(add);
    let oldest = (length - rest..length).map(&term).reduce(add);
    [own, before, oldest].into_iter().flatten().reduce(add).unwrap_or(0.0)
}
