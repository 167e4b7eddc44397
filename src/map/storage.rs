//! The memory of a map's rows.

use std::fmt;
#[cfg(feature = "mmap")]
use std::ops::Range;
#[cfg(feature = "mmap")]
use std::sync::Arc;

use crate::dtype::Dtype;
use crate::memory;
use crate::numbers::{Values, View, each_type};

/// Rows begin at a multiple of a cache line, which is also the widest vector register. Loads that
/// straddle lines cost twice as much if the map is in the cache.
const LINE: usize = 64;

/// From this number of bytes on, rows lie in huge pages if the system has them. Large maps are then
/// scanned up to 1.9 times as fast, because the processor need not look up the address of every
/// 4 kB.
#[cfg(feature = "mmap")]
const LARGE: usize = 4 << 20;
/// Bytes that are moved from one memory to another before the first is made shorter.
#[cfg(feature = "mmap")]
const PIECE: usize = 32 << 20;

/// Numbers without gaps, beginning on a cache line unless they are mapped.
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

/// No numbers.
impl Default for Storage {
    fn default() -> Self {
        Self(Kind::Owned { numbers: Values::U8(Vec::new()), start: 0, len: 0 })
    }
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

    /// The same, or `None` if the system has too little memory.
    pub(crate) fn try_zeros(dtype: Dtype, len: usize) -> Option<Self> {
        let bytes = len.checked_mul(dtype.size()).filter(|&bytes| memory::is_there(bytes))?;
        #[cfg(feature = "mmap")]
        if let Some(pages) = pages(dtype, len) {
            return Some(pages);
        }
        Vec::<u8>::new().try_reserve_exact(bytes).ok()?;
        Some(Self::zeros(dtype, len))
    }

    /// The numbers of the type `dtype` in a part of a mapped file, or `None` if they are not
    /// aligned for it.
    #[cfg(feature = "mmap")]
    pub(super) fn mapped(
        file: Arc<memmap2::Mmap>,
        span: Range<usize>,
        dtype: Dtype,
    ) -> Option<Self> {
        let bytes = file.get(span.clone())?;
        let aligned = bytes.as_ptr().addr().is_multiple_of(dtype.size());
        aligned.then_some(Self(Kind::Mapped { file, span, dtype }))
    }

    /// The mapped file that the numbers lie in.
    #[cfg(feature = "mmap")]
    pub(super) fn file(&self) -> Option<&memmap2::Mmap> {
        match &self.0 {
            Kind::Mapped { file, .. } => Some(file),
            Kind::Owned { .. } | Kind::Pages { .. } => None,
        }
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

    /// The memory of the numbers, to be written. It is empty for a mapped file, which is never
    /// written.
    pub(crate) fn bytes_mut(&mut self) -> &mut [u8] {
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

/// Never holds two copies: the numbers are moved to the next line within their own memory, or piece
/// by piece into pages.
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

/// Zeros in huge pages, if they are many and the system has the memory.
#[cfg(feature = "mmap")]
fn pages(dtype: Dtype, len: usize) -> Option<Storage> {
    let bytes = len.checked_mul(dtype.size()).filter(|&bytes| bytes >= LARGE)?;
    let memory = memmap2::MmapMut::map_anon(bytes).ok()?;
    // Without huge pages, small ones do.
    #[cfg(target_os = "linux")]
    let _ = memory.advise(memmap2::Advice::HugePage);
    Some(Storage(Kind::Pages { memory, dtype }))
}

/// Moves the numbers, the last ones first, and gives their memory back on the way.
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

/// The numbers in bytes. Pages are aligned for all types, and mapped files were checked.
#[cfg(feature = "mmap")]
fn cast(bytes: &[u8], dtype: Dtype) -> View<'_> {
    match dtype {
        Dtype::F32 => View::F32(bytemuck::try_cast_slice(bytes).unwrap_or_default()),
        Dtype::F16 => View::F16(bytemuck::try_cast_slice(bytes).unwrap_or_default()),
        Dtype::I8 => View::I8(bytemuck::must_cast_slice(bytes)),
        Dtype::U8 => View::U8(bytes),
    }
}

/// Leaves the numbers out: there may be billions.
impl fmt::Debug for Storage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let view = self.view();
        write!(f, "{} x {}", view.len(), view.dtype())
    }
}

/// Extra numbers, so that a cache line begins inside the memory.
fn slack(dtype: Dtype) -> usize {
    LINE / dtype.size()
}

/// Appends `by` zeros without a second copy of the numbers.
fn grow<T: Clone + Default>(numbers: &mut Vec<T>, by: usize) {
    numbers.reserve_exact(by);
    numbers.resize(numbers.len() + by, T::default());
}

/// The index of the first number on a cache line.
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
                let mut zeros = Storage::zeros(values.dtype(), len);
                check(&zeros, Values::zeros(values.dtype(), len).view());
                zeros.bytes_mut().copy_from_slice(values.view().bytes());
                check(&zeros, values.view());
            }
        }
    }
}
