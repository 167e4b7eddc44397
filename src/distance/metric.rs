//! How descriptors are compared.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::Error;

/// How two descriptors are compared (method 1.6). Less is more alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Metric {
    /// The mean absolute difference (the sum of absolute differences, SAD, divided by the
    /// dimension).
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
