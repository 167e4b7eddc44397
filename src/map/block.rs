//! A map's rows in blocks. A block never changes, so maps share it: a longer map shares those of
//! the shorter one, a slice of a map those of the whole.
//!
//! Blocks that were made together are spans of one memory. A large one lies in huge pages, which
//! makes a scan up to 1.9 times as fast as one over memory of a block each.

use std::ops::Range;
use std::sync::Arc;

use once_cell::race::OnceBox;

use super::storage::Storage;
use crate::distance::{Metric, norm};
use crate::dtype::Dtype;
use crate::error::Error;
use crate::interrupt::check;
use crate::numbers::{View, each_type};

/// Bytes of rows in a block: far more than it costs to go from one block to the next.
const BYTES: usize = 1 << 20;
/// The rows of a block are a multiple of this, so that kernels that take several rows at a time
/// find no remainder within a map.
const ROWS: usize = 16;

/// Rows of up to this many numbers are points of a small space, often with meaning of their own:
/// zeros are the origin, and points may coincide. In longer rows, zeros show nothing.
pub(super) const SMALL: usize = 8;

/// Consecutive rows.
#[derive(Debug)]
pub(crate) struct Block {
    memory: Arc<Storage>,
    /// The numbers of this block in the memory.
    span: Range<usize>,
    /// The length of each row, for the cosine; else empty.
    norms: Vec<f64>,
}

impl Block {
    pub(crate) fn rows(&self) -> View<'_> {
        part(self.memory.view(), self.span.clone())
    }

    pub(crate) fn norms(&self) -> &[f64] {
        &self.norms
    }

    /// All rows in a memory of their own.
    pub(super) fn whole(memory: Storage, norms: Vec<f64>) -> Self {
        let span = 0..memory.view().len();
        Self { memory: Arc::new(memory), span, norms }
    }
}

/// The rows of a block.
pub(super) fn rows_of_a_block(dim: usize, dtype: Dtype) -> usize {
    (BYTES / (dim * dtype.size()) / ROWS * ROWS).max(ROWS)
}

/// The rows of a map: blocks in route order.
#[derive(Clone, Debug)]
pub(crate) struct Blocks {
    list: Vec<Arc<Block>>,
    /// The first row of each block.
    starts: Vec<usize>,
    rows: usize,
    dim: usize,
    dtype: Dtype,
    /// All rows in one piece, once that was asked for and if it took a copy.
    joined: OnceBox<Arc<Storage>>,
}

impl Blocks {
    /// Cuts rows of `dim` numbers into blocks. `norms` holds each row's length or nothing.
    pub(super) fn of(memory: Storage, dim: usize, norms: &[f64]) -> Self {
        let (dtype, memory) = (memory.view().dtype(), Arc::new(memory));
        let rows = memory.view().len() / dim;
        let step = rows_of_a_block(dim, dtype);
        let blocks = (0..rows).step_by(step).map(|first| {
            let last = rows.min(first + step);
            let norms = norms.get(first..last).unwrap_or_default().to_vec();
            Arc::new(Block { memory: Arc::clone(&memory), span: first * dim..last * dim, norms })
        });
        Self::joining(blocks.collect(), dim, dtype)
    }

    pub(super) fn joining(blocks: Vec<Arc<Block>>, dim: usize, dtype: Dtype) -> Self {
        let mut rows = 0;
        let starts = blocks.iter().map(|block| {
            let start = rows;
            rows += block.span.len() / dim;
            start
        });
        let starts = starts.collect();
        Self { list: blocks, starts, rows, dim, dtype, joined: OnceBox::new() }
    }

    /// These blocks and then those, which have rows of the same kind. None is copied.
    pub(super) fn followed_by(&self, more: &Self) -> Self {
        let blocks = self.list.iter().chain(&more.list).cloned().collect();
        Self::joining(blocks, self.dim, self.dtype)
    }

    /// Some of the rows, which must be there. They share the memory of these.
    pub(super) fn slice(&self, rows: Range<usize>) -> Self {
        let mut blocks = Vec::new();
        self.each(rows, |block, within, _| {
            blocks.push(if within.len() * self.dim == block.span.len() {
                Arc::clone(block)
            } else {
                let start = block.span.start;
                Arc::new(Block {
                    memory: Arc::clone(&block.memory),
                    span: start + within.start * self.dim..start + within.end * self.dim,
                    norms: block.norms.get(within).unwrap_or_default().to_vec(),
                })
            });
        });
        Self::joining(blocks, self.dim, self.dtype)
    }

    /// Some of the rows, in order. They share the memory of these, unless they lie in so short
    /// pieces that a scan would be slow: then they are copied.
    pub(super) fn keep(&self, runs: &[Range<usize>]) -> Self {
        let rows: usize = runs.iter().map(Range::len).sum();
        if rows >= runs.len() * ROWS {
            let parts = runs.iter().flat_map(|run| self.slice(run.clone()).list);
            return Self::joining(parts.collect(), self.dim, self.dtype);
        }
        let mut memory = Storage::zeros(self.dtype, rows * self.dim);
        let (mut left, mut norms) = (memory.bytes_mut(), Vec::new());
        for run in runs {
            self.each(run.clone(), |block, within, _| {
                let span = within.start * self.dim..within.end * self.dim;
                let numbers = part(block.rows(), span).bytes();
                let (head, tail) = std::mem::take(&mut left).split_at_mut(numbers.len());
                head.copy_from_slice(numbers);
                left = tail;
                norms.extend_from_slice(block.norms.get(within).unwrap_or_default());
            });
        }
        Self::of(memory, self.dim, &norms)
    }

    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &Arc<Block>> {
        self.list.iter()
    }

    /// Calls `work` with each block that holds some of `rows`, their range within the block, and
    /// their range within `rows`.
    pub(super) fn each(
        &self,
        rows: Range<usize>,
        mut work: impl FnMut(&Arc<Block>, Range<usize>, Range<usize>),
    ) {
        let first = match self.starts.as_slice() {
            [_] => 0,
            starts => starts.partition_point(|&start| start <= rows.start).saturating_sub(1),
        };
        for (block, &start) in self.list[first..].iter().zip(&self.starts[first..]) {
            if start >= rows.end {
                break;
            }
            let from = rows.start.max(start);
            let to = rows.end.min(start + block.span.len() / self.dim);
            work(block, from - start..to - start, from - rows.start..to - rows.start);
        }
    }

    /// The rows of the first block.
    pub(super) fn first(&self) -> View<'_> {
        self.list.first().map_or(View::U8(&[]), |block| block.rows())
    }

    /// One row, if there is one of that number.
    pub(crate) fn row(&self, row: usize) -> Option<View<'_>> {
        let at = self.starts.partition_point(|&start| start <= row).checked_sub(1)?;
        self.list[at].rows().row(row - self.starts[at], self.dim)
    }

    /// All rows in one piece. They are copied once if they lie in several.
    pub(super) fn in_one_piece(&self) -> View<'_> {
        let (Some(first), Some(last)) = (self.list.first(), self.list.last()) else {
            return View::U8(&[]);
        };
        let follow = |pair: &[Arc<Block>]| {
            Arc::ptr_eq(&pair[0].memory, &pair[1].memory) && pair[0].span.end == pair[1].span.start
        };
        if self.list.windows(2).all(follow) {
            return part(first.memory.view(), first.span.start..last.span.end);
        }
        let joined = self.joined.get_or_init(|| {
            let mut joined = Storage::zeros(self.dtype, self.rows * self.dim);
            let mut memory = joined.bytes_mut();
            for block in self.iter() {
                let rows = block.rows().bytes();
                let (head, tail) = std::mem::take(&mut memory).split_at_mut(rows.len());
                head.copy_from_slice(rows);
                memory = tail;
            }
            Box::new(joined.into())
        });
        joined.view()
    }

    /// Refuses a NaN or an infinity, and says where it stands.
    pub(crate) fn check_finite(&self, what: &'static str) -> Result<(), Error> {
        for (block, &start) in self.list.iter().zip(&self.starts) {
            check()?;
            block.rows().check_finite(what, self.dim).map_err(|error| match error {
                Error::NotFinite { what, row, index, value } => {
                    Error::NotFinite { what, row: Some(start + row.unwrap_or(0)), index, value }
                }
                other => other,
            })?;
        }
        Ok(())
    }

    /// The mapped files that rows lie in, each once.
    #[cfg(feature = "mmap")]
    pub(super) fn mapped_files(&self) -> Vec<&memmap2::Mmap> {
        let mut files: Vec<&memmap2::Mmap> = Vec::new();
        for file in self.list.iter().filter_map(|block| block.memory.file()) {
            if !files.iter().any(|known| std::ptr::eq(*known, file)) {
                files.push(file);
            }
        }
        files
    }
}

/// Some of the numbers, which must be there.
pub(super) fn part(numbers: View<'_>, span: Range<usize>) -> View<'_> {
    each_type!(View, numbers, v => View::from(&v[span]))
}

/// The length of each row if the metric needs it, else nothing. A long row of zeros has the length
/// 1: it is as far from all queries.
///
/// # Errors
/// [`Error::NoDirection`] for a short row of zeros.
pub(super) fn lengths(rows: View<'_>, dim: usize, metric: Metric) -> Result<Vec<f64>, Error> {
    if metric != Metric::Cosine {
        return Ok(Vec::new());
    }
    let length = |row| match norm(row) {
        0.0 if dim > SMALL => 1.0,
        length => length,
    };
    let rows = (0..rows.len() / dim).filter_map(|row| rows.row(row, dim));
    let norms = rows.map(|row| check().map(|()| length(row)));
    let norms = norms.collect::<Result<Vec<f64>, Error>>()?;
    match norms.iter().position(|&norm| norm == 0.0) {
        Some(row) => Err(Error::NoDirection { what: "descriptors", row: Some(row) }),
        None => Ok(norms),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::Values;

    fn blocks(rows: usize, dim: usize) -> (Values, Blocks) {
        let values = Values::U8((0..rows * dim).map(|at| (at * 37 % 251) as u8).collect());
        let norms: Vec<f64> = (0..rows).map(|row| row as f64).collect();
        (values.clone(), Blocks::of(values.into(), dim, &norms))
    }

    #[test]
    fn every_range_of_rows_is_found_across_blocks() {
        let (values, all) = blocks(70, 1 << 16);
        assert_eq!(all.starts, [0, 16, 32, 48, 64]);
        for range in [0..70, 0..1, 15..17, 16..32, 31..70, 69..70, 20..20] {
            let (mut seen, mut norms) = (range.start, Vec::new());
            all.each(range.clone(), |block, within, out| {
                assert_eq!(out.start, seen - range.start);
                for row in within.clone() {
                    let expected = values.view().row(seen, 1 << 16);
                    assert_eq!(block.rows().row(row, 1 << 16), expected);
                    assert_eq!(all.row(seen), expected);
                    seen += 1;
                }
                norms.extend_from_slice(&block.norms()[within]);
            });
            assert_eq!(seen, range.end);
            assert_eq!(norms, range.map(|row| row as f64).collect::<Vec<_>>());
        }
        assert_eq!(all.row(70), None);
    }

    #[test]
    fn a_nan_is_found_in_any_block() {
        let mut numbers = vec![0.5_f32; 40 << 14];
        numbers[(37 << 14) + 5] = f32::NAN;
        let blocks = Blocks::of(Values::F32(numbers).into(), 1 << 14, &[]);
        let found = blocks.check_finite("rows");
        assert_eq!(blocks.starts, [0, 16, 32]);
        assert!(
            matches!(found, Err(Error::NotFinite { row: Some(37), index: 5, .. })),
            "{found:?}"
        );
    }

    #[test]
    fn longer_and_shorter_maps_share_memory() {
        let ((values, all), (_, more)) = (blocks(70, 1 << 16), blocks(3, 1 << 16));
        let memory = |blocks: &Blocks, at: usize| blocks.list[at].rows().bytes().as_ptr();
        let kept = all.keep(&[0..2, 10..70]);
        assert!(Arc::ptr_eq(&kept.list[2], &all.list[1]));
        let apart = all.keep(&[3..4, 15..17]);
        for (row, from) in [3, 15, 16].into_iter().enumerate() {
            assert_eq!(apart.row(row), values.view().row(from, 1 << 16));
        }
        assert_eq!(apart.list[0].norms(), [3.0, 15.0, 16.0]);
        let longer = all.followed_by(&more);
        assert!(longer.iter().zip(all.iter().chain(more.iter())).all(|(a, b)| Arc::ptr_eq(a, b)));
        assert_eq!(longer.in_one_piece().len(), 73 << 16);
        let slice = all.slice(10..40);
        assert_eq!(memory(&slice, 1), memory(&all, 1));
        assert!(Arc::ptr_eq(&slice.list[1], &all.list[1]));
        assert_eq!(slice.in_one_piece(), part(values.view(), 10 << 16..40 << 16));
        assert_eq!(all.in_one_piece().bytes().as_ptr(), memory(&all, 0), "without a copy");
    }
}
