//! A query against rows, written once for every [`Machine`].

use std::marker::PhantomData;
use std::ptr;

use bytemuck::must_cast_ref;

use super::padded::Padded;
use super::term::Term;
use super::tuning::{Kind, Reading, Tuning};
use crate::simd::{BLOCK, Byte, Isa, Kernel, LANES, Machine, Number, run, scalar};

/// The sums are emptied after this many blocks of bytes. A lane of 32 bits gets at most sixteen
/// terms a block, each below 2^16, so that it stays below 2^30; and a row's last, broken block fits
/// in as well.
const RUN: usize = 1024;

/// The same for products with numbers of 14 bits: sixteen terms a block, each below 2^20, and a
/// last block more.
const SHORTS_RUN: usize = 64;

/// Blocks of a row that are taken at a time, each with sums of its own: none waits for another.
const UNROLLED: usize = 4;

/// The sums of `T` over the query and each row of `values`, in f64, each handed to `finish` with
/// its row's number.
pub(super) fn floats<T: Term, Q: Number, R: Number, O>(
    (isa, tuning): (Isa, Tuning),
    query: &[Q],
    values: &[R],
    out: &mut [O],
    finish: impl Fn(usize, f64) -> O,
) {
    let (dim, single) = (query.len(), size_of::<R>() == size_of::<f32>());
    let kind = if single { Kind::Single } else { Kind::Narrow };
    tuning.read(kind, dim * size_of::<R>(), out.len(), |rows, reading| {
        let (first, values) = (rows.start, &values[rows.start * dim..rows.end * dim]);
        let (out, finish) = (&mut out[rows], |row: usize, sum| finish(first + row, sum));
        let term = PhantomData;
        run(isa, Floats::<T, Q, R, O, _> { query, values, out, finish, reading, term });
    });
}

/// The sums of `T` over the query and each row of `values`, exactly, each handed to `finish` with
/// its row's number.
pub(super) fn bytes<T: Term, B: Byte, O>(
    how: (Isa, Tuning),
    query: &[B],
    values: &[B],
    out: &mut [O],
    finish: impl Fn(usize, i64) -> O,
) {
    whole::<OfBytes<T, B>, O>(how, query, values, out, finish);
}

/// The sums of the products of numbers of up to 14 bits with the bytes of each row, exactly, each
/// handed to `finish` with its row's number.
pub(super) fn shorts<O>(
    how: (Isa, Tuning),
    query: &[i16],
    values: &[i8],
    out: &mut [O],
    finish: impl Fn(usize, i64) -> O,
) {
    whole::<OfShorts, O>(how, query, values, out, finish);
}

fn whole<C: Counted, O>(
    (isa, tuning): (Isa, Tuning),
    query: &[C::Query],
    values: &[C::Row],
    out: &mut [O],
    finish: impl Fn(usize, i64) -> O,
) {
    let dim = query.len();
    tuning.read(Kind::Bytes, dim, out.len(), |rows, Reading { ahead, .. }| {
        let (first, values) = (rows.start, &values[rows.start * dim..rows.end * dim]);
        let (out, finish) = (&mut out[rows], |row: usize, sum| finish(first + row, sum));
        run(isa, Whole::<C, O, _> { query, values, out, finish, ahead });
    });
}

struct Floats<'a, T, Q, R, O, F> {
    query: &'a [Q],
    values: &'a [R],
    out: &'a mut [O],
    finish: F,
    reading: Reading,
    term: PhantomData<T>,
}

impl<T: Term, Q: Number, R: Number, O, F: Fn(usize, f64) -> O> Floats<'_, T, Q, R, O, F> {
    #[inline(always)]
    fn side_by_side<M: Machine, const ROWS: usize>(self, machine: M) {
        let Self { query, values, out, finish, reading: Reading { ahead, .. }, .. } = self;
        let query = Padded::new(query);
        let (groups, alone) = out.as_chunks_mut::<ROWS>();
        let first_alone = ROWS * groups.len();
        for (group, out) in groups.iter_mut().enumerate() {
            let first = ROWS * group;
            let sums = sums::<M, T, Q, R, ROWS>(machine, &query, values, first, ahead);
            for side in 0..ROWS {
                out[side] = finish(first + side, sums[side]);
            }
        }
        for (at, out) in alone.iter_mut().enumerate() {
            let row = first_alone + at;
            let [sum] = sums::<M, T, Q, R, 1>(machine, &query, values, row, ahead);
            *out = finish(row, sum);
        }
    }
}

impl<T: Term, Q: Number, R: Number, O, F: Fn(usize, f64) -> O> Kernel
    for Floats<'_, T, Q, R, O, F>
{
    #[inline(always)]
    fn simd<M: Machine>(self, machine: M) {
        match self.reading.rows {
            4 => self.side_by_side::<M, 4>(machine),
            2 => self.side_by_side::<M, 2>(machine),
            _ => self.side_by_side::<M, 1>(machine),
        }
    }

    fn scalar(self) {
        let dim = self.query.len();
        for (index, out) in self.out.iter_mut().enumerate() {
            let row = &self.values[index * dim..(index + 1) * dim];
            *out = (self.finish)(index, scalar::sum(self.query, row, T::float));
        }
    }
}

struct Whole<'a, C: Counted, O, F> {
    query: &'a [C::Query],
    values: &'a [C::Row],
    out: &'a mut [O],
    finish: F,
    ahead: usize,
}

impl<C: Counted, O, F: Fn(usize, i64) -> O> Kernel for Whole<'_, C, O, F> {
    #[inline(always)]
    fn simd<M: Machine>(self, machine: M) {
        let excess = C::excess::<M>(self.query);
        let query = Padded::new(self.query);
        for (row, out) in self.out.iter_mut().enumerate() {
            let total = total::<M, C>(machine, &query, self.values, row, self.ahead);
            *out = (self.finish)(row, total - excess);
        }
    }

    fn scalar(self) {
        let dim = self.query.len();
        for (index, out) in self.out.iter_mut().enumerate() {
            let row = &self.values[index * dim..(index + 1) * dim];
            *out = (self.finish)(index, C::plain(self.query, row));
        }
    }
}

/// The sums of some rows, which are read side by side, each in the lanes of method 1.6.
#[inline(always)]
fn sums<M: Machine, T: Term, Q: Number, R: Number, const ROWS: usize>(
    machine: M,
    query: &Padded<'_, Q, LANES>,
    values: &[R],
    first: usize,
    ahead: usize,
) -> [f64; ROWS] {
    // Not a loop: what it has an index of would lie in memory.
    macro_rules! each_side {
        ([$($at:literal)*] |$side:ident| $work:expr) => {$(
            if $at < ROWS {
                let $side: usize = $at;
                $work
            }
        )*};
    }
    let mut lanes = [machine.lanes(); ROWS];
    for (blocks, ahead) in query.ahead_of::<R>(ROWS, ahead) {
        let query_blocks = &query.blocks[blocks.clone()];
        let (mut rows, mut later) = ([[].as_slice(); ROWS], [ptr::null(); ROWS]);
        each_side!([0 1 2 3] |side| {
            let row = query.row::<R>(values, first + side);
            rows[side] = &row[blocks.clone()][..query_blocks.len()];
            later[side] = rows[side].as_ptr().wrapping_byte_add(ahead);
        });
        for at in 0..query_blocks.len() {
            let numbers = Q::load(machine, &query_blocks[at]);
            each_side!([0 1 2 3] |side| {
                machine.fetch(later[side].wrapping_add(at));
                let row = R::load(machine, &rows[side][at]);
                T::add(machine, &mut lanes[side], numbers, row);
            });
        }
    }
    let mut sums = [0.0; ROWS];
    for side in 0..ROWS {
        sums[side] = finish::<M, T, Q, R>(machine, lanes[side], query, values, first + side);
    }
    sums
}

/// Adds the row's last, broken block, and the lanes.
#[inline(always)]
fn finish<M: Machine, T: Term, Q: Number, R: Number>(
    machine: M,
    mut lanes: M::Lanes,
    query: &Padded<'_, Q, LANES>,
    values: &[R],
    row: usize,
) -> f64 {
    if query.broken > 0 {
        let last = R::load(machine, &query.last_of(values, row));
        T::add(machine, &mut lanes, Q::load(machine, &query.last), last);
    }
    scalar::sum_of_lanes(machine.store(lanes))
}

/// How the terms of a block of whole numbers are counted. (A trait, since closures are not surely
/// inlined, and what is not inlined is not compiled for the instruction set.)
trait Counted {
    type Query: Copy + Default;
    type Row: Copy + Default;
    /// After this many blocks the sums are emptied.
    const RUN: usize;
    fn count<M: Machine>(
        machine: M,
        sum: M::Counts,
        query: &[Self::Query; BLOCK],
        row: &[Self::Row; BLOCK],
    ) -> M::Counts;
    fn total<M: Machine>(machine: M, sum: M::Counts) -> i64;
    /// By how much the totals of this query are too large on this machine.
    fn excess<M: Machine>(query: &[Self::Query]) -> i64;
    /// The total of a row, without a machine.
    fn plain(query: &[Self::Query], row: &[Self::Row]) -> i64;
}

/// The terms `T` of bytes.
struct OfBytes<T, B>(PhantomData<(T, B)>);
/// The products of numbers of 14 bits with bytes.
struct OfShorts;

impl<T: Term, B: Byte> Counted for OfBytes<T, B> {
    type Query = B;
    type Row = B;
    const RUN: usize = RUN;

    #[inline(always)]
    fn count<M: Machine>(
        machine: M,
        sum: M::Counts,
        query: &[B; BLOCK],
        row: &[B; BLOCK],
    ) -> M::Counts {
        let (query, row) = (machine.block(must_cast_ref(query)), machine.block(must_cast_ref(row)));
        T::count::<M, B>(machine, sum, query, row)
    }

    #[inline(always)]
    fn total<M: Machine>(machine: M, sum: M::Counts) -> i64 {
        T::total(machine, sum)
    }

    #[inline(always)]
    fn excess<M: Machine>(query: &[B]) -> i64 {
        T::excess::<M, B>(query)
    }

    fn plain(query: &[B], row: &[B]) -> i64 {
        scalar::total(query, row, T::byte)
    }
}

impl Counted for OfShorts {
    type Query = i16;
    type Row = i8;
    const RUN: usize = SHORTS_RUN;

    #[inline(always)]
    fn count<M: Machine>(
        machine: M,
        sum: M::Counts,
        query: &[i16; BLOCK],
        row: &[i8; BLOCK],
    ) -> M::Counts {
        machine.products_i16(sum, machine.shorts(query), row)
    }

    #[inline(always)]
    fn total<M: Machine>(machine: M, sum: M::Counts) -> i64 {
        machine.total(sum)
    }

    #[inline(always)]
    fn excess<M: Machine>(_: &[i16]) -> i64 {
        0
    }

    fn plain(query: &[i16], row: &[i8]) -> i64 {
        scalar::short_total(query, row)
    }
}

/// The total of a row.
#[inline(always)]
fn total<M: Machine, C: Counted>(
    machine: M,
    query: &Padded<'_, C::Query, BLOCK>,
    values: &[C::Row],
    row: usize,
    ahead: usize,
) -> i64 {
    let run = UNROLLED * C::RUN;
    let mut total = 0;
    let (mut rest, mut rest_of_row) = (query.blocks, query.row::<C::Row>(values, row));
    while !rest.is_empty() {
        let some = rest.len().min(run);
        let (query, row) = (&rest[..some], &rest_of_row[..some]);
        (rest, rest_of_row) = (&rest[some..], &rest_of_row[some..]);
        let mut counts = [machine.counts(); UNROLLED];
        let ((queries, last_of_query), (rows, last_of_row)) =
            (query.as_chunks::<UNROLLED>(), row.as_chunks::<UNROLLED>());
        for at in 0..queries.len() {
            count::<M, C>(machine, &mut counts, &queries[at], &rows[at], ahead);
        }
        count::<M, C>(machine, &mut counts, last_of_query, last_of_row, ahead);
        for count in &counts {
            total += C::total(machine, *count);
        }
    }
    if query.broken > 0 {
        let last = query.last_of(values, row);
        total += C::total(machine, C::count(machine, machine.counts(), &query.last, &last));
    }
    total
}

/// Counts some blocks, each to a sum of its own.
#[inline(always)]
fn count<M: Machine, C: Counted>(
    machine: M,
    counts: &mut [M::Counts; UNROLLED],
    query: &[[C::Query; BLOCK]],
    row: &[[C::Row; BLOCK]],
    ahead: usize,
) {
    for at in 0..query.len() {
        machine.fetch(row[at].as_ptr().cast::<u8>().wrapping_add(ahead));
        counts[at] = C::count(machine, counts[at], &query[at], &row[at]);
    }
}
