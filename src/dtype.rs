//! The types of a descriptor's numbers.

use std::fmt;

use serde::{Deserialize, Serialize};

/// The type of a descriptor's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Dtype {
    /// 32-bit floats.
    #[serde(rename = "f32")]
    F32,
    /// 16-bit floats: half the memory.
    #[serde(rename = "f16")]
    F16,
    /// Signed bytes.
    #[serde(rename = "i8")]
    I8,
    /// Unsigned bytes.
    #[serde(rename = "u8")]
    U8,
}

impl Dtype {
    /// Bytes a number.
    #[must_use]
    pub const fn size(self) -> usize {
        match self {
            Self::F32 => 4,
            Self::F16 => 2,
            Self::I8 | Self::U8 => 1,
        }
    }
}

impl fmt::Display for Dtype {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::F32 => "float32",
            Self::F16 => "float16",
            Self::I8 => "int8",
            Self::U8 => "uint8",
        })
    }
}
