//! The numbers that descriptors are made of, owned and borrowed.

use half::f16;

use crate::dtype::Dtype;
use crate::error::Error;
use crate::memory;
use crate::simd::Isa;

/// Numbers that are checked at a time.
const BLOCK: usize = 1024;

/// Numbers of one of the four types, owned: one descriptor, or many in a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// 32-bit floats.
    F32(Vec<f32>),
    /// 16-bit floats.
    F16(Vec<f16>),
    /// Signed bytes.
    I8(Vec<i8>),
    /// Unsigned bytes.
    U8(Vec<u8>),
}

/// Numbers of one of the four types, borrowed. `&[f32]` and the like turn into one by themselves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum View<'a> {
    /// 32-bit floats.
    F32(&'a [f32]),
    /// 16-bit floats.
    F16(&'a [f16]),
    /// Signed bytes.
    I8(&'a [i8]),
    /// Unsigned bytes.
    U8(&'a [u8]),
}

/// Runs the same expression on the slice or vector inside, whatever its type.
macro_rules! each_type {
    ($type:ident, $numbers:expr, $slice:ident => $body:expr) => {
        match $numbers {
            $type::F32($slice) => $body,
            $type::F16($slice) => $body,
            $type::I8($slice) => $body,
            $type::U8($slice) => $body,
        }
    };
}
pub(crate) use each_type;

impl Values {
    /// `count` zeros.
    pub fn zeros(dtype: Dtype, count: usize) -> Self {
        match dtype {
            Dtype::F32 => Self::F32(vec![0.0; count]),
            Dtype::F16 => Self::F16(vec![f16::ZERO; count]),
            Dtype::I8 => Self::I8(vec![0; count]),
            Dtype::U8 => Self::U8(vec![0; count]),
        }
    }

    /// The same numbers, borrowed.
    pub fn view(&self) -> View<'_> {
        match self {
            Self::F32(v) => View::F32(v),
            Self::F16(v) => View::F16(v),
            Self::I8(v) => View::I8(v),
            Self::U8(v) => View::U8(v),
        }
    }

    /// The memory of the numbers, to be written.
    pub(crate) fn bytes_mut(&mut self) -> &mut [u8] {
        each_type!(Self, self, v => bytemuck::must_cast_slice_mut(v.as_mut_slice()))
    }

    /// The number of numbers.
    pub fn len(&self) -> usize {
        self.view().len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Their type.
    pub fn dtype(&self) -> Dtype {
        self.view().dtype()
    }
}

impl<'a> View<'a> {
    /// The number of numbers.
    pub fn len(&self) -> usize {
        each_type!(View, self, v => v.len())
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Their type.
    pub fn dtype(&self) -> Dtype {
        match self {
            Self::F32(_) => Dtype::F32,
            Self::F16(_) => Dtype::F16,
            Self::I8(_) => Dtype::I8,
            Self::U8(_) => Dtype::U8,
        }
    }

    /// The row `index` of rows of `dim` numbers; `None` past the end.
    pub fn row(&self, index: usize, dim: usize) -> Option<View<'a>> {
        let span = index.checked_mul(dim)?..index.checked_add(1)?.checked_mul(dim)?;
        Some(match self {
            Self::F32(v) => View::F32(v.get(span)?),
            Self::F16(v) => View::F16(v.get(span)?),
            Self::I8(v) => View::I8(v.get(span)?),
            Self::U8(v) => View::U8(v.get(span)?),
        })
    }

    /// [`to_values`](Self::to_values), of numbers that there may be no memory for: those of a mapped
    /// file.
    ///
    /// # Errors
    /// [`Error::Copy`] if there is not enough memory.
    pub fn try_to_values(&self) -> Result<Values, Error> {
        let bytes = self.bytes().len();
        memory::reserve(&mut Vec::<u8>::new(), bytes).map_err(|_| Error::Copy { bytes })?;
        Ok(self.to_values())
    }

    /// A copy that owns its numbers.
    pub fn to_values(&self) -> Values {
        match self {
            Self::F32(v) => Values::F32(v.to_vec()),
            Self::F16(v) => Values::F16(v.to_vec()),
            Self::I8(v) => Values::I8(v.to_vec()),
            Self::U8(v) => Values::U8(v.to_vec()),
        }
    }

    /// The memory of the numbers.
    pub(crate) fn bytes(&self) -> &'a [u8] {
        each_type!(Self, self, v => bytemuck::must_cast_slice(v))
    }

    /// Refuses a NaN or an infinity, and names its row of `dim` numbers (if there are several) and
    /// its index.
    pub(crate) fn check_finite(&self, what: &'static str, dim: usize) -> Result<(), Error> {
        let found = match self {
            Self::F32(v) => first_not_finite(v),
            Self::F16(v) => first_spoilt(v, |x| !x.is_finite()).map(|i| (i, f32::from(v[i]))),
            Self::I8(_) | Self::U8(_) => None,
        };
        let Some((at, value)) = found else { return Ok(()) };
        let row = (self.len() > dim).then(|| at / dim);
        Err(Error::NotFinite { what, row, index: at % dim.max(1), value })
    }
}

/// The first number that is a NaN or an infinity, with its index.
pub(crate) fn first_not_finite(numbers: &[f32]) -> Option<(usize, f32)> {
    first_spoilt(numbers, |x| !x.is_finite()).map(|index| (index, numbers[index]))
}

/// The index of the first number that is `bad`.
fn first_spoilt<T: Copy>(numbers: &[T], bad: impl Fn(T) -> bool + Copy) -> Option<usize> {
    // Without a way out in the middle, the check of a block runs in vector registers.
    let spoilt = |block: &[T]| block.iter().fold(false, |spoilt, &x| spoilt | bad(x));
    let start = Isa::best().run(|| numbers.chunks(BLOCK).position(spoilt))? * BLOCK;
    Some(start + numbers[start..].iter().position(|&x| bad(x))?)
}

macro_rules! from_slices {
    ($($type:ty => $variant:ident),*) => {$(
        impl<'a> From<&'a [$type]> for View<'a> {
            fn from(numbers: &'a [$type]) -> Self {
                View::$variant(numbers)
            }
        }
        impl<'a> From<&'a Vec<$type>> for View<'a> {
            fn from(numbers: &'a Vec<$type>) -> Self {
                View::$variant(numbers)
            }
        }
        impl From<Vec<$type>> for Values {
            fn from(numbers: Vec<$type>) -> Self {
                Values::$variant(numbers)
            }
        }
    )*};
}
from_slices!(f32 => F32, f16 => F16, i8 => I8, u8 => U8);

impl<'a> From<&'a Values> for View<'a> {
    fn from(values: &'a Values) -> Self {
        values.view()
    }
}
