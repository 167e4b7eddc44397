//! The memory that a map's rows lie in.

use std::fmt;
#[cfg(feature = "mmap")]
use std::{ops::Range, sync::Arc};

use crate::distance::{Dtype, Values, View, each_type};

/// Where rows begin in memory: at a multiple of a cache line, which is the widest vector register too. Loads that straddle
/// lines cost twice as much where the map is in the cache.
const LINE: usize = 64;

/// A map's rows, one after the other without gaps.
pub(crate) struct Storage(Kind);

enum Kind {
    /// `len` numbers from `start` on, which is on a line.
    Owned { numbers: Values, start: usize, len: usize },
    /// A part of a file that is mapped into memory: checked to be aligned for its type.
    #[cfg(feature = "mmap")]
    Mapped { file: Arc<memmap2::Mmap>, span: Range<usize>, dtype: Dtype },
}

impl Storage {
    /// `len` zeros.
    pub(super) fn zeros(dtype: Dtype, len: usize) -> Self {
        let numbers = Values::zeros(dtype, len + slack(dtype));
        let start = first_on_a_line(&numbers);
        Self(Kind::Owned { numbers, start, len })
    }

    /// The numbers of one after those of the other, which are of one type.
    pub(super) fn joined(first: View<'_>, second: View<'_>) -> Self {
        let mut joined = Self::zeros(first.dtype(), first.len() + second.len());
        let (head, tail) = joined.bytes_mut().split_at_mut(first.bytes().len());
        head.copy_from_slice(first.bytes());
        tail.copy_from_slice(second.bytes());
        joined
    }

    /// The numbers of the type `dtype` in a part of a mapped file; nothing where they are not aligned for it.
    #[cfg(feature = "mmap")]
    pub(super) fn mapped(file: memmap2::Mmap, span: Range<usize>, dtype: Dtype) -> Option<Self> {
        let bytes = file.get(span.clone())?;
        let aligned = bytes.as_ptr().addr().is_multiple_of(dtype.size());
        let file = Arc::new(file);
        aligned.then_some(Self(Kind::Mapped { file, span, dtype }))
    }

    /// The numbers.
    pub(crate) fn view(&self) -> View<'_> {
        match &self.0 {
            Kind::Owned { numbers, start, len } => {
                each_type!(Values, numbers, v => View::from(&v[*start..*start + *len]))
            }
            #[cfg(feature = "mmap")]
            Kind::Mapped { file, span, dtype } => {
                // Neither the bounds nor the alignment can fail: both were checked when it was made.
                let bytes = file.get(span.clone()).unwrap_or_default();
                match dtype {
                    Dtype::F32 => View::F32(bytemuck::try_cast_slice(bytes).unwrap_or_default()),
                    Dtype::F16 => View::F16(bytemuck::try_cast_slice(bytes).unwrap_or_default()),
                    Dtype::I8 => View::I8(bytemuck::must_cast_slice(bytes)),
                    Dtype::U8 => View::U8(bytes),
                }
            }
        }
    }

    /// The numbers' memory, to be written; empty where they are mapped, for those are never written.
    pub(super) fn bytes_mut(&mut self) -> &mut [u8] {
        match &mut self.0 {
            Kind::Owned { numbers, start, len } => {
                let size = numbers.dtype().size();
                &mut numbers.bytes_mut()[*start * size..(*start + *len) * size]
            }
            #[cfg(feature = "mmap")]
            Kind::Mapped { .. } => &mut [],
        }
    }
}

/// Takes the numbers over: they are moved up to the next line within their own memory, so there are never two copies.
impl From<Values> for Storage {
    fn from(mut numbers: Values) -> Self {
        let (len, slack) = (numbers.len(), slack(numbers.dtype()));
        if first_on_a_line(&numbers) == 0 {
            return Self(Kind::Owned { numbers, start: 0, len });
        }
        each_type!(Values, &mut numbers, v => grow(v, slack));
        let start = first_on_a_line(&numbers);
        each_type!(Values, &mut numbers, v => v.copy_within(..len, start));
        Self(Kind::Owned { numbers, start, len })
    }
}

impl Clone for Storage {
    fn clone(&self) -> Self {
        match &self.0 {
            Kind::Owned { numbers, .. } => {
                let view = self.view();
                let mut copy = Self::zeros(numbers.dtype(), view.len());
                copy.bytes_mut().copy_from_slice(view.bytes());
                copy
            }
            #[cfg(feature = "mmap")]
            Kind::Mapped { file, span, dtype } => {
                Self(Kind::Mapped { file: Arc::clone(file), span: span.clone(), dtype: *dtype })
            }
        }
    }
}

/// Not the numbers, of which there may be billions.
impl fmt::Debug for Storage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let view = self.view();
        write!(f, "{} x {}", view.len(), view.dtype())
    }
}

/// So many numbers more than a line has make sure that there is one to begin at.
fn slack(dtype: Dtype) -> usize {
    LINE / dtype.size()
}

/// Room for `by` numbers more, without a second copy of those that are there.
fn grow<T: Clone + Default>(numbers: &mut Vec<T>, by: usize) {
    numbers.reserve_exact(by);
    numbers.resize(numbers.len() + by, T::default());
}

/// The index of the first number that is on a line.
fn first_on_a_line(numbers: &Values) -> usize {
    let past = numbers.view().bytes().as_ptr().addr() % LINE;
    (LINE - past) % LINE / numbers.dtype().size()
}

#[cfg(test)]
mod tests {
    use half::f16;

    use super::*;

    fn check(storage: &Storage, expected: View<'_>) {
        assert_eq!(storage.view(), expected);
        if !expected.is_empty() {
            assert_eq!(storage.view().bytes().as_ptr().addr() % LINE, 0, "on a line");
        }
    }

    #[test]
    fn rows_keep_their_numbers_and_begin_on_a_line_wherever_they_came_from() {
        for len in [0, 1, 3, 63, 64, 65, 1000, 70_000] {
            let bytes: Vec<u8> = (0..len).map(|i| i as u8).collect();
            let floats: Vec<f32> = (0..len).map(|i| i as f32).collect();
            for values in [
                Values::F32(floats.clone()),
                Values::F16(floats.iter().map(|&x| f16::from_f32(x)).collect()),
                Values::I8(bytes.iter().map(|x| x.cast_signed()).collect()),
                Values::U8(bytes),
            ] {
                let storage = Storage::from(values.clone());
                check(&storage, values.view());
                check(&storage.clone(), values.view());
                let mut zeros = Storage::zeros(values.dtype(), len);
                check(&zeros, Values::zeros(values.dtype(), len).view());
                zeros.bytes_mut().copy_from_slice(values.view().bytes());
                check(&zeros, values.view());
                let cut = len / 3;
                let (head, tail) = match values.view() {
                    View::F32(v) => (View::F32(&v[..cut]), View::F32(&v[cut..])),
                    View::F16(v) => (View::F16(&v[..cut]), View::F16(&v[cut..])),
                    View::I8(v) => (View::I8(&v[..cut]), View::I8(&v[cut..])),
                    View::U8(v) => (View::U8(&v[..cut]), View::U8(&v[cut..])),
                };
                check(&Storage::joined(head, tail), values.view());
            }
        }
    }
}
