//! Queries and rows in blocks of one size.

use std::ops::Range;

/// A query as whole blocks, the last one padded with zeros. If a row's last block is padded too,
/// the terms of the padding are zeros.
pub(super) struct Padded<'a, N, const WIDTH: usize> {
    dim: usize,
    pub(super) blocks: &'a [[N; WIDTH]],
    pub(super) last: [N; WIDTH],
    pub(super) broken: usize,
}

impl<'a, N: Copy + Default, const WIDTH: usize> Padded<'a, N, WIDTH> {
    #[inline(always)]
    pub(super) fn new(numbers: &'a [N]) -> Self {
        let (blocks, rest) = numbers.as_chunks();
        let mut last = [N::default(); WIDTH];
        last[..rest.len()].copy_from_slice(rest);
        Self { dim: numbers.len(), blocks, last, broken: rest.len() }
    }

    /// The whole blocks of a row.
    #[inline(always)]
    pub(super) fn row<'b, R>(&self, values: &'b [R], row: usize) -> &'b [[R; WIDTH]] {
        let start = row * self.dim;
        &values[start..start + self.dim].as_chunks().0[..self.blocks.len()]
    }

    /// `side` rows are read side by side, and memory is prefetched that is read `ahead` bytes later
    /// in each: near the end of a row, that is a row on, past those beside it. Gives the blocks of
    /// a row in two parts, each with the distance to that memory in bytes. A row alone is not
    /// parted: two loops would take turns, and Zen's own prefetch follows each instruction by
    /// itself.
    #[inline(always)]
    pub(super) fn ahead_of<R>(&self, side: usize, ahead: usize) -> [(Range<usize>, usize); 2] {
        let (row, count) = (self.dim * size_of::<R>(), self.blocks.len());
        if side == 1 {
            return [(0..count, ahead), (count..count, ahead)];
        }
        let (rows, rest) = (ahead / row.max(1), ahead % row.max(1));
        let here = (row - rest).div_ceil(WIDTH * size_of::<R>()).min(count);
        let beside = (side - 1) * row;
        [(0..here, ahead + rows * beside), (here..count, ahead + (rows + 1) * beside)]
    }

    /// The last, broken block of a row, padded with zeros.
    #[inline(always)]
    pub(super) fn last_of<R: Copy + Default>(&self, values: &[R], row: usize) -> [R; WIDTH] {
        let start = row * self.dim + self.blocks.len() * WIDTH;
        let mut last = [R::default(); WIDTH];
        match values.get(start..).and_then(|from| from.first_chunk::<WIDTH>()) {
            // The numbers behind the row are read as well, and dropped: a copy of a fixed size is
            // far faster.
            Some(numbers) => {
                for index in 0..WIDTH {
                    last[index] = if index < self.broken { numbers[index] } else { R::default() };
                }
            }
            None => last[..self.broken].copy_from_slice(&values[start..start + self.broken]),
        }
        last
    }
}
