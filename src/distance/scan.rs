//! A query against rows, written once for every [`Machine`], several rows at a time.

use std::array;
use std::marker::PhantomData;

use super::machine::{BLOCK, Byte, LANES, Machine, Number};
use super::scalar;
use super::term::Term;
use crate::isa::Isa;

/// After how many blocks of bytes the sums are emptied. A lane of 32 bits gets at most sixteen terms a block, each below
/// 2^16, so that it stays below 2^30; and a row's last, broken block fits in as well.
const RUN: usize = 1024;

/// The same for products with numbers of 14 bits: sixteen terms a block, each below 2^20, and a last block more.
const SHORTS_RUN: usize = 64;

/// How many blocks of bytes ahead the memory is asked for there, 4 KiB: of 16, 32, 64, 256 and 512, the fastest by a quarter.
const SHORTS_AHEAD: usize = 64;

/// How many blocks of f32 ahead the memory is asked for: 1 KiB.
const AHEAD: usize = 16;

/// A scan, before it is known what runs it.
pub(super) trait Work {
    /// On a machine's registers, `GROUP` rows at a time.
    fn on<M: Machine, const GROUP: usize>(self, machine: M);
    /// Without any.
    fn plainly(self);
}

/// Does the work on an instruction set. One that this processor lacks runs as [`Isa::Scalar`].
fn run(isa: Isa, work: impl Work) {
    match isa {
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => match super::avx512::Avx512::new() {
            Some(machine) => machine.run(work),
            None => work.plainly(),
        },
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => match super::avx2::Avx2::new() {
            Some(machine) => machine.run(work),
            None => work.plainly(),
        },
        #[cfg(target_arch = "aarch64")]
        Isa::Neon => match super::neon::Neon::new() {
            Some(machine) => machine.run(work),
            None => work.plainly(),
        },
        _ => work.plainly(),
    }
}

/// The sums of `T` over the query and each row of `values`, in f64, each handed to `finish` with its row's number.
pub(super) fn floats<T: Term, Q: Number, R: Number, O>(
    isa: Isa,
    query: &[Q],
    values: &[R],
    out: &mut [O],
    finish: impl Fn(usize, f64) -> O,
) {
    run(isa, Floats::<T, Q, R, O, _> { query, values, out, finish, term: PhantomData });
}

/// The sums of `T` over the query and each row of `values`, exactly, each handed to `finish` with its row's number.
pub(super) fn bytes<T: Term, B: Byte, O>(
    isa: Isa,
    query: &[B],
    values: &[B],
    out: &mut [O],
    finish: impl Fn(usize, i64) -> O,
) {
    run(isa, Bytes::<T, B, O, _> { query, values, out, finish, term: PhantomData });
}

/// The sums of the products of numbers of up to 14 bits with the bytes of each row, exactly, each handed to `finish` with its
/// row's number.
pub(super) fn shorts<O>(
    isa: Isa,
    query: &[i16],
    values: &[i8],
    out: &mut [O],
    finish: impl Fn(usize, i64) -> O,
) {
    run(isa, Shorts { query, values, out, finish });
}

struct Floats<'a, T, Q, R, O, F> {
    query: &'a [Q],
    values: &'a [R],
    out: &'a mut [O],
    finish: F,
    term: PhantomData<T>,
}

impl<T: Term, Q: Number, R: Number, O, F: Fn(usize, f64) -> O> Work for Floats<'_, T, Q, R, O, F> {
    #[inline(always)]
    fn on<M: Machine, const GROUP: usize>(self, machine: M) {
        let query = Padded::new(self.query);
        let (groups, rest) = self.out.as_chunks_mut::<GROUP>();
        let first_of_rest = groups.len() * GROUP;
        for (group, out) in groups.iter_mut().enumerate() {
            let first = group * GROUP;
            let sums = sums::<M, T, Q, R, GROUP>(machine, &query, self.values, first);
            for (index, (out, sum)) in out.iter_mut().zip(sums).enumerate() {
                *out = (self.finish)(first + index, sum);
            }
        }
        for (index, out) in rest.iter_mut().enumerate() {
            let row = first_of_rest + index;
            let [sum] = sums::<M, T, Q, R, 1>(machine, &query, self.values, row);
            *out = (self.finish)(row, sum);
        }
    }

    fn plainly(self) {
        let dim = self.query.len();
        for (index, out) in self.out.iter_mut().enumerate() {
            let row = &self.values[index * dim..(index + 1) * dim];
            *out = (self.finish)(index, scalar::sum(self.query, row, T::float));
        }
    }
}

struct Bytes<'a, T, B, O, F> {
    query: &'a [B],
    values: &'a [B],
    out: &'a mut [O],
    finish: F,
    term: PhantomData<T>,
}

impl<T: Term, B: Byte, O, F: Fn(usize, i64) -> O> Work for Bytes<'_, T, B, O, F> {
    #[inline(always)]
    fn on<M: Machine, const GROUP: usize>(self, machine: M) {
        let excess = T::excess::<M, B>(self.query);
        let query = Padded::new(bytemuck::must_cast_slice::<B, u8>(self.query));
        let values: &[u8] = bytemuck::must_cast_slice(self.values);
        let (groups, rest) = self.out.as_chunks_mut::<GROUP>();
        let first_of_rest = groups.len() * GROUP;
        for (group, out) in groups.iter_mut().enumerate() {
            let first = group * GROUP;
            let totals = totals::<M, T, B, GROUP>(machine, &query, values, first);
            for (index, (out, total)) in out.iter_mut().zip(totals).enumerate() {
                *out = (self.finish)(first + index, total - excess);
            }
        }
        for (index, out) in rest.iter_mut().enumerate() {
            let row = first_of_rest + index;
            let [total] = totals::<M, T, B, 1>(machine, &query, values, row);
            *out = (self.finish)(row, total - excess);
        }
    }

    fn plainly(self) {
        let dim = self.query.len();
        for (index, out) in self.out.iter_mut().enumerate() {
            let row = &self.values[index * dim..(index + 1) * dim];
            *out = (self.finish)(index, scalar::total(self.query, row, T::byte));
        }
    }
}

struct Shorts<'a, O, F> {
    query: &'a [i16],
    values: &'a [i8],
    out: &'a mut [O],
    finish: F,
}

impl<O, F: Fn(usize, i64) -> O> Work for Shorts<'_, O, F> {
    #[inline(always)]
    fn on<M: Machine, const GROUP: usize>(self, machine: M) {
        let query = Padded::new(self.query);
        let (groups, rest) = self.out.as_chunks_mut::<GROUP>();
        let first_of_rest = groups.len() * GROUP;
        for (group, out) in groups.iter_mut().enumerate() {
            let first = group * GROUP;
            let totals = short_totals::<M, GROUP>(machine, &query, self.values, first);
            for (index, (out, total)) in out.iter_mut().zip(totals).enumerate() {
                *out = (self.finish)(first + index, total);
            }
        }
        for (index, out) in rest.iter_mut().enumerate() {
            let row = first_of_rest + index;
            let [total] = short_totals::<M, 1>(machine, &query, self.values, row);
            *out = (self.finish)(row, total);
        }
    }

    fn plainly(self) {
        let dim = self.query.len();
        for (index, out) in self.out.iter_mut().enumerate() {
            let row = &self.values[index * dim..(index + 1) * dim];
            *out = (self.finish)(index, scalar::short_total(self.query, row));
        }
    }
}

/// A query as whole blocks, the last one filled up with zeros. Where a row's last block is filled up in the same way, the
/// terms of what was filled in are zeros too.
struct Padded<'a, N, const WIDTH: usize> {
    dim: usize,
    blocks: &'a [[N; WIDTH]],
    last: [N; WIDTH],
    broken: usize,
}

impl<'a, N: Copy + Default, const WIDTH: usize> Padded<'a, N, WIDTH> {
    #[inline(always)]
    fn new(numbers: &'a [N]) -> Self {
        let (blocks, rest) = numbers.as_chunks();
        let mut last = [N::default(); WIDTH];
        last[..rest.len()].copy_from_slice(rest);
        Self { dim: numbers.len(), blocks, last, broken: rest.len() }
    }

    /// The whole blocks of `GROUP` rows, as many as the query has.
    #[inline(always)]
    fn rows<'b, R, const GROUP: usize>(&self, values: &'b [R], first: usize) -> [&'b [[R; WIDTH]]; GROUP] {
        array::from_fn(|index| {
            let start = (first + index) * self.dim;
            &values[start..start + self.dim].as_chunks().0[..self.blocks.len()]
        })
    }

    /// The last, broken block of a row, filled up with zeros.
    #[inline(always)]
    fn last_of<R: Copy + Default>(&self, values: &[R], row: usize) -> [R; WIDTH] {
        let start = row * self.dim + self.blocks.len() * WIDTH;
        let mut last = [R::default(); WIDTH];
        match values.get(start..).and_then(|from| from.first_chunk::<WIDTH>()) {
            // What stands behind the row is read as well, and dropped: a copy of one size is far faster.
            Some(numbers) => {
                for (index, (last, number)) in last.iter_mut().zip(numbers).enumerate() {
                    *last = if index < self.broken { *number } else { R::default() };
                }
            }
            None => last[..self.broken].copy_from_slice(&values[start..start + self.broken]),
        }
        last
    }
}

/// The sums of `GROUP` rows, in the lanes of method 1.6.
#[inline(always)]
fn sums<M: Machine, T: Term, Q: Number, R: Number, const GROUP: usize>(
    machine: M,
    query: &Padded<'_, Q, LANES>,
    values: &[R],
    first: usize,
) -> [f64; GROUP] {
    let rows = query.rows::<R, GROUP>(values, first);
    let mut lanes = [machine.lanes(); GROUP];
    for (index, block) in query.blocks.iter().enumerate() {
        if size_of::<R>() == size_of::<f32>() {
            // Rows of f32 come as fast as the memory gives them, and the processor stops looking ahead at the end of a page.
            for row in rows {
                machine.fetch(row.as_ptr().wrapping_add(index + AHEAD));
            }
        }
        add::<M, T, Q, R, GROUP>(machine, &mut lanes, block, array::from_fn(|row| &rows[row][index]));
    }
    if query.broken > 0 {
        let last: [[R; LANES]; GROUP] = array::from_fn(|row| query.last_of(values, first + row));
        add::<M, T, Q, R, GROUP>(machine, &mut lanes, &query.last, last.each_ref());
    }
    lanes.map(|lanes| scalar::sum_of_lanes(machine.store(lanes)))
}

/// Adds the terms of one block of `GROUP` rows, to each lane its own.
#[inline(always)]
fn add<M: Machine, T: Term, Q: Number, R: Number, const GROUP: usize>(
    machine: M,
    lanes: &mut [M::Lanes; GROUP],
    query: &[Q; LANES],
    rows: [&[R; LANES]; GROUP],
) {
    let parts = lanes[0].as_ref().len();
    for part in 0..parts {
        let a = Q::load(machine, query, part);
        for (lanes, row) in lanes.iter_mut().zip(rows) {
            let sum = &mut lanes.as_mut()[part];
            *sum = T::add(machine, *sum, a, R::load(machine, row, part));
        }
    }
}

/// The totals of `GROUP` rows of bytes.
#[inline(always)]
fn totals<M: Machine, T: Term, B: Byte, const GROUP: usize>(
    machine: M,
    query: &Padded<'_, u8, BLOCK>,
    values: &[u8],
    first: usize,
) -> [i64; GROUP] {
    let rows = query.rows::<u8, GROUP>(values, first);
    let mut totals = [0; GROUP];
    let mut counts = [machine.counts(); GROUP];
    for (index, block) in query.blocks.iter().enumerate() {
        let block = machine.block(block);
        for (count, row) in counts.iter_mut().zip(rows) {
            *count = T::count::<M, B>(machine, *count, block, machine.block(&row[index]));
        }
        if index % RUN == RUN - 1 {
            for (total, count) in totals.iter_mut().zip(&mut counts) {
                *total += T::total(machine, *count);
                *count = machine.counts();
            }
        }
    }
    if query.broken > 0 {
        let block = machine.block(&query.last);
        for (index, count) in counts.iter_mut().enumerate() {
            let last = query.last_of(values, first + index);
            *count = T::count::<M, B>(machine, *count, block, machine.block(&last));
        }
    }
    for (total, count) in totals.iter_mut().zip(counts) {
        *total += T::total(machine, count);
    }
    totals
}

/// The totals of the products of numbers of 14 bits with `GROUP` rows of bytes.
#[inline(always)]
fn short_totals<M: Machine, const GROUP: usize>(
    machine: M,
    query: &Padded<'_, i16, BLOCK>,
    values: &[i8],
    first: usize,
) -> [i64; GROUP] {
    let rows = query.rows::<i8, GROUP>(values, first);
    let mut totals = [0; GROUP];
    let mut counts = [machine.counts(); GROUP];
    for (index, block) in query.blocks.iter().enumerate() {
        let block = machine.shorts(block);
        for (count, row) in counts.iter_mut().zip(rows) {
            machine.fetch(row.as_ptr().wrapping_add(index + SHORTS_AHEAD));
            *count = machine.products_i16(*count, block, &row[index]);
        }
        if index % SHORTS_RUN == SHORTS_RUN - 1 {
            for (total, count) in totals.iter_mut().zip(&mut counts) {
                *total += machine.total(*count);
                *count = machine.counts();
            }
        }
    }
    if query.broken > 0 {
        let block = machine.shorts(&query.last);
        for (index, count) in counts.iter_mut().enumerate() {
            let last = query.last_of(values, first + index);
            *count = machine.products_i16(*count, block, &last);
        }
    }
    for (total, count) in totals.iter_mut().zip(counts) {
        *total += machine.total(count);
    }
    totals
}
