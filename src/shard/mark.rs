//! The head of each message: what the two sides must have in common.

use std::hash::Hasher as _;

use serde::{Deserialize, Serialize};
use twox_hash::XxHash3_64;

use crate::config::Config;
use crate::error::Error;
use crate::map::Map;

/// The version of the messages. Another one is refused.
pub const PROTOCOL: u32 = 1;

/// What a driver and its shards must have in common. It comes first in each message, so that it can
/// be read and compared even if the rest cannot be.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    protocol: u32,
    /// The version of surefix.
    surefix: String,
    map: String,
    options: String,
}

impl Header {
    pub(super) fn new(map: &Map, config: &Config) -> Self {
        let options = serde_json::to_string(config).unwrap_or_default();
        let options = format!("{:016x}", XxHash3_64::oneshot(options.as_bytes()));
        let surefix = env!("CARGO_PKG_VERSION").to_owned();
        Self { protocol: PROTOCOL, surefix, map: mark(map), options }
    }

    /// Refuses a message of another version, map or options than these.
    ///
    /// # Errors
    /// [`Error::Shard`], which names both.
    pub fn check(&self, got: &Self) -> Result<(), Error> {
        let differ = |what: &str, expected: &dyn std::fmt::Display, got: &dyn std::fmt::Display| {
            Err(Error::Shard { reason: format!("expected {what} {expected}, got {got}") })
        };
        if self.protocol != got.protocol {
            let of = |header: &Self| format!("{} (surefix {})", header.protocol, header.surefix);
            return differ("messages of version", &of(self), &of(got));
        }
        if self.surefix != got.surefix {
            return differ("surefix", &self.surefix, &got.surefix);
        }
        if self.map != got.map {
            return differ("the map of", &self.map, &got.map);
        }
        if self.options != got.options {
            return differ("the options with the mark", &self.options, &got.options);
        }
        Ok(())
    }
}

/// What tells a map from others: by the checksum in its file, or else by a hash of its rows.
fn mark(map: &Map) -> String {
    let mut hash = XxHash3_64::with_seed(0);
    let (recipe, segments) = (map.recipe(), map.segments());
    hash.write_u64(map.checksum().unwrap_or_else(|| map.fingerprint()));
    hash.write(format!("{recipe:?} {segments:?}").as_bytes());
    format!(
        "{} places x {} {} ({}, {} segments, {:016x})",
        map.places(),
        map.dim(),
        map.dtype(),
        map.metric(),
        segments.len(),
        hash.finish()
    )
}
