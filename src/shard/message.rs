//! Questions and answers.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::mark::Header;
use crate::dtype::Dtype;
use crate::error::Error;
use crate::map::Means;
use crate::method::shard::{First, FirstSaid, Second, SecondSaid};
use crate::numbers::{Values, View};

/// A driver's question to one shard.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Question {
    pub(super) header: Header,
    pub(super) to: Address,
    pub(super) body: Asked,
}

/// A shard's answer to its question.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Answer {
    pub(super) header: Header,
    pub(super) from: Address,
    pub(super) body: Said,
}

/// One of a query's round trips.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stage {
    /// The means over the whole column, if the query needs them. It changes no shard.
    Census,
    /// What the query's column says. It changes no shard, and may be asked again.
    First,
    /// What all shards said: each keeps the query. It may be asked once.
    Second,
}

/// Which shard, and which query.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Address {
    /// The shard's places.
    pub(super) places: std::ops::Range<usize>,
    pub(super) query: QueryMark,
}

/// Which query, after which others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct QueryMark {
    pub(super) frame: u64,
    /// A hash of all queries before it; 0 if there are none.
    pub(super) before: u64,
    /// A hash of these and this one.
    pub(super) after: u64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) enum Asked {
    Census { query: Numbers, nothing: bool },
    First { query: Numbers, means: Option<Means>, first: First },
    Second(Second),
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) enum Said {
    /// The sums of each block's rows.
    Census(#[serde(with = "crate::bytes")] Vec<f64>),
    First(FirstSaid),
    Second(SecondSaid),
}

/// A query's numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Numbers {
    dtype: Dtype,
    #[serde(with = "crate::bytes")]
    bytes: Vec<u8>,
}

impl Question {
    /// Which round trip it belongs to.
    pub fn stage(&self) -> Stage {
        match self.body {
            Asked::Census { .. } => Stage::Census,
            Asked::First { .. } => Stage::First,
            Asked::Second(_) => Stage::Second,
        }
    }
}

impl Numbers {
    pub(super) fn new(view: View<'_>) -> Self {
        let (dtype, mut bytes) = (view.dtype(), view.bytes().to_vec());
        crate::archive::swap_to_file_order(&mut bytes, dtype.size());
        Self { dtype, bytes }
    }

    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// # Errors
    /// [`Error::Shard`] for a part of a number.
    pub(super) fn values(&self) -> Result<Values, Error> {
        let Self { dtype, ref bytes } = *self;
        let size = dtype.size();
        if !bytes.len().is_multiple_of(size) {
            let reason = format!("expected a query of {dtype}, got {} bytes", bytes.len());
            return Err(Error::Shard { reason });
        }
        let mut values = Values::zeros(dtype, bytes.len() / size);
        values.bytes_mut().copy_from_slice(bytes);
        crate::archive::swap_to_file_order(values.bytes_mut(), size);
        Ok(values)
    }
}

impl fmt::Display for Stage {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str(match self {
            Self::Census => "census",
            Self::First => "first",
            Self::Second => "second",
        })
    }
}
