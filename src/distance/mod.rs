//! Distances between a query's descriptor and every row of a map (method 1.6).
//!
//! Manhattan and euclidean distances are computed by direct differences: the expansion
//! `|a|^2 + |b|^2 - 2ab` loses its digits exactly where a match is found, near zero.

mod element;
mod scalar;
#[cfg(test)]
mod tests;

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::Error;
pub use element::{Dtype, Values, View};
pub(crate) use element::{each_type, first_not_finite};
pub(crate) use scalar::norm;

/// How two descriptors are compared (method 1.6). Less is more alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Metric {
    /// The mean absolute difference (the sum of absolute differences, SAD, divided by the dimension).
    Manhattan,
    /// The root of the sum of squared differences.
    Euclidean,
    /// One minus the cosine of the angle, from 0 to 2.
    Cosine,
}

impl fmt::Display for Metric {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Manhattan => "manhattan",
            Self::Euclidean => "euclidean",
            Self::Cosine => "cosine",
        })
    }
}

impl FromStr for Metric {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        match name {
            "manhattan" => Ok(Self::Manhattan),
            "euclidean" => Ok(Self::Euclidean),
            "cosine" => Ok(Self::Cosine),
            other => Err(Error::Option {
                name: "metric",
                expected: "\"manhattan\", \"euclidean\" or \"cosine\"".to_owned(),
                got: format!("{other:?}"),
            }),
        }
    }
}

/// The rows of a map as the kernels see them.
#[derive(Clone, Copy)]
pub(crate) struct Rows<'a> {
    pub(crate) values: View<'a>,
    pub(crate) dim: usize,
    pub(crate) metric: Metric,
    /// What one unit of distance is, in the numbers of the rows: 32 for SAD in u8, else 1.
    pub(crate) unit: f64,
    /// The length of each row, for the cosine; else empty.
    pub(crate) norms: &'a [f64],
}

/// Writes the distance from `query` to each row into `out`.
///
/// The query is float32, or of the rows' own type; its length and that of `out` are the caller's to have checked.
///
/// # Errors
/// [`Error::Dtype`] for another type, [`Error::NotFinite`] for a NaN or an infinity in the query,
/// [`Error::NoDirection`] for a cosine of zeros. `out` is then unchanged.
pub(crate) fn distances(query: View<'_>, rows: Rows<'_>, out: &mut [f32]) -> Result<(), Error> {
    let what = "descriptor";
    query.check_finite(what, rows.dim)?;
    match (query, rows.values) {
        (View::U8(q), View::U8(r)) => scalar::integer(q, r, rows, out),
        (View::I8(q), View::I8(r)) => scalar::integer(q, r, rows, out),
        (View::F16(q), View::F16(r)) => scalar::float(q, r, rows, out),
        (View::F32(q), values) => each_type!(View, values, r => scalar::float(q, r, rows, out)),
        (query, values) => {
            Err(Error::Dtype { what, map: values.dtype(), or_float: true, got: query.dtype() })
        }
    }
}
