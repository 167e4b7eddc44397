//! The memory that a map's rows lie in.

use std::fmt;
#[cfg(feature = "mmap")]
use std::{ops::Range, sync::Arc};

use crate::dtype::Dtype;
use crate::numbers::{Values, View, each_type};

/// Where rows begin in memory: at a multiple of a cache line, which is the widest vector register
/// too. Loads that straddle lines cost twice as much where the map is in the cache.
const LINE: usize = 64;

/// From so many bytes on, rows lie in memory that is asked for in huge pages where the system has
/// them. Large maps are then scanned up to 1.9 times as fast, for the processor need not look up
/// the place of every 4 kB.
#[cfg(feature = "mmap")]
const LARGE: usize = 4 << 20;
/// How much is moved from one memory to another before the first is made shorter.
#[cfg(feature = "mmap")]
const PIECE: usize = 32 << 20;

/// A map's rows, one after the other without gaps.
pub(crate) struct Storage(Kind);

enum Kind {
    /// `len` numbers from `start` on, which is on a line.
    Owned { numbers: Values, start: usize, len: usize },
    /// Memory of its own, in whole pages: no file.
    #[cfg(feature = "mmap")]
    Pages { memory: memmap2::MmapMut, dtype: Dtype },
    /// A part of a file that is mapped into memory: checked to be aligned for its type.
    #[cfg(feature = "mmap")]
    Mapped { file: Arc<memmap2::Mmap>, span: Range<usize>, dtype: Dtype },
}

impl Storage {
    /// `len` zeros.
    pub(super) fn zeros(dtype: Dtype, len: usize) -> Self {
        #[cfg(feature = "mmap")]
        if let Some(pages) = pages(dtype, len) {
            return pages;
        }
        let numbers = Values::zeros(dtype, len + slack(dtype));
        let start = first_on_a_line(&numbers);
        Self(Kind::Owned { numbers, start, len })
    }

    /// The same, or nothing where the system has no room for them.
    pub(super) fn try_zeros(dtype: Dtype, len: usize) -> Option<Self> {
        #[cfg(feature = "mmap")]
        if let Some(pages) = pages(dtype, len) {
            return Some(pages);
        }
        let bytes = len.checked_mul(dtype.size())?;
        Vec::<u8>::new().try_reserve_exact(bytes).ok()?;
        Some(Self::zeros(dtype, len))
    }

    /// The numbers of one after those of the other, which are of one type.
    pub(super) fn joined(first: View<'_>, second: View<'_>) -> Self {
        let mut joined = Self::zeros(first.dtype(), first.len() + second.len());
        let (head, tail) = joined.bytes_mut().split_at_mut(first.bytes().len());
        head.copy_from_slice(first.bytes());
        tail.copy_from_slice(second.bytes());
        joined
    }

    /// The numbers of the type `dtype` in a part of a mapped file; nothing where they are not
    /// aligned for it.
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
            Kind::Pages { memory, dtype } => cast(memory, *dtype),
            #[cfg(feature = "mmap")]
            Kind::Mapped { file, span, dtype } => {
                cast(file.get(span.clone()).unwrap_or_default(), *dtype)
            }
        }
    }

    /// The numbers' memory, to be written; empty where they are mapped, for those are never
    /// written.
    pub(super) fn bytes_mut(&mut self) -> &mut [u8] {
        match &mut self.0 {
            Kind::Owned { numbers, start, len } => {
                let size = numbers.dtype().size();
                &mut numbers.bytes_mut()[*start * size..(*start + *len) * size]
            }
            #[cfg(feature = "mmap")]
            Kind::Pages { memory, .. } => memory,
            #[cfg(feature = "mmap")]
            Kind::Mapped { .. } => &mut [],
        }
    }
}

/// Takes the numbers over, without ever having two copies: they are moved up to the next line
/// within their own memory, or piece by piece into pages.
impl From<Values> for Storage {
    fn from(mut numbers: Values) -> Self {
        #[cfg(feature = "mmap")]
        if let Some(mut pages) = pages(numbers.dtype(), numbers.len()) {
            let memory = pages.bytes_mut();
            each_type!(Values, &mut numbers, v => move_into(memory, v));
            return pages;
        }
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
        #[cfg(feature = "mmap")]
        if let Kind::Mapped { file, span, dtype } = &self.0 {
            return Self(Kind::Mapped {
                file: Arc::clone(file),
                span: span.clone(),
                dtype: *dtype,
            });
        }
        let view = self.view();
        let mut copy = Self::zeros(view.dtype(), view.len());
        copy.bytes_mut().copy_from_slice(view.bytes());
        copy
    }
}

/// Zeros in pages of their own, where they are many and the system gives them.
#[cfg(feature = "mmap")]
fn pages(dtype: Dtype, len: usize) -> Option<Storage> {
    let bytes = len.checked_mul(dtype.size()).filter(|&bytes| bytes >= LARGE)?;
    let memory = memmap2::MmapMut::map_anon(bytes).ok()?;
    // Where there are no huge pages, small ones do.
    #[cfg(target_os = "linux")]
    let _ = memory.advise(memmap2::Advice::HugePage);
    Some(Storage(Kind::Pages { memory, dtype }))
}

/// Moves the numbers, the last ones first, so that their own memory can be given back as they go.
#[cfg(feature = "mmap")]
fn move_into<T: bytemuck::NoUninit>(memory: &mut [u8], numbers: &mut Vec<T>) {
    while !numbers.is_empty() {
        let start = numbers.len().saturating_sub(PIECE / size_of::<T>());
        let bytes: &[u8] = bytemuck::must_cast_slice(&numbers[start..]);
        let at = start * size_of::<T>();
        memory[at..at + bytes.len()].copy_from_slice(bytes);
        numbers.truncate(start);
        numbers.shrink_to_fit();
    }
}

/// The numbers of bytes that are aligned for them, in whole pages or by a check when they were
/// mapped: nothing can fail.
#[cfg(feature = "mmap")]
fn cast(bytes: &[u8], dtype: Dtype) -> View<'_> {
    match dtype {
        Dtype::F32 => View::F32(bytemuck::try_cast_slice(bytes).unwrap_or_default()),
        Dtype::F16 => View::F16(bytemuck::try_cast_slice(bytes).unwrap_or_default()),
        Dtype::I8 => View::I8(bytemuck::must_cast_slice(bytes)),
        Dtype::U8 => View::U8(bytes),
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
        for len in [0, 1, 3, 63, 64, 65, 1000, 70_000, (9 << 20) + 3] {
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
