//! The settings of a route, in a file: options, a threshold, and what they were measured on.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::calibration::Threshold;
use crate::config::Config;
use crate::error::Error;
use crate::localizer::Localizer;
use crate::map::Map;

/// The longest file in bytes. Far longer than a threshold's; what is parsed takes about 60 times its
/// memory.
#[cfg(feature = "toml")]
const MOST: usize = 1 << 20;
/// Characters of a line that an error shows.
#[cfg(feature = "toml")]
const SHOWN: usize = 200;

/// The options and the threshold that suit a route, as `surefix tune` writes them (`route.toml`).
///
/// ```
/// use std::sync::Arc;
/// use surefix::{Config, Map, MapMark, Metric, Settings};
/// let map = Arc::new(Map::from_descriptors(vec![1.0_f32, 0.0, 0.0, 1.0], 2, Metric::Euclidean)?);
/// let mut settings = Settings::default();
/// settings.config.sequence_length = 1;
/// settings.maps = vec![MapMark::of(&map)];
/// let text = settings.to_toml()?;
/// let mut localizer = Settings::from_toml(&text)?.localizer(vec![map])?;
/// assert_eq!(localizer.push_descriptor([0.9_f32, 0.1].as_slice())?.place, 0);
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct Settings {
    /// The options.
    pub config: Config,
    /// Where and how they were measured, for those who read the file.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub measured: BTreeMap<String, String>,
    /// The maps that they are for, one a technique; empty for any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub maps: Vec<MapMark>,
    /// Which fixes are accepted; `None` for no judgement.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threshold: Option<Threshold>,
}

/// What tells a map from others.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct MapMark {
    /// Its places.
    pub places: usize,
    /// A hash of its rows, of their type and of the distance, in hexadecimal digits.
    pub hash: String,
}

impl MapMark {
    /// That of a map, all of whose rows are read for it once.
    pub fn of(map: &Map) -> Self {
        Self { places: map.places(), hash: format!("{:016x}", map.fingerprint()) }
    }
}

impl Settings {
    /// A localizer on `maps` with these options, which judges its fixes by the threshold.
    ///
    /// # Errors
    /// [`Error::Settings`] if they are for other maps; those of [`Localizer::fused`] and
    /// [`Localizer::with_threshold`].
    pub fn localizer(&self, maps: Vec<Arc<Map>>) -> Result<Localizer, Error> {
        self.check_maps(maps.iter().map(|map| &**map))?;
        let localizer = Localizer::fused(maps, self.config.clone())?;
        match &self.threshold {
            Some(threshold) => localizer.with_threshold(threshold.clone()),
            None => Ok(localizer),
        }
    }

    /// Refuses other maps than those that they are for.
    ///
    /// # Errors
    /// [`Error::Settings`].
    pub fn check_maps<'a>(&self, maps: impl IntoIterator<Item = &'a Map>) -> Result<(), Error> {
        if self.maps.is_empty() {
            return Ok(());
        }
        let maps: Vec<&Map> = maps.into_iter().collect();
        let shown = |marks: &[MapMark]| {
            let each = marks.iter().map(|mark| format!("{} places ({})", mark.places, mark.hash));
            each.collect::<Vec<_>>().join(" and ")
        };
        // The hash is computed if the size alone does not tell.
        let sizes =
            self.maps.iter().map(|mark| mark.places).eq(maps.iter().map(|map| map.places()));
        if sizes {
            let marks: Vec<MapMark> = maps.iter().map(|map| MapMark::of(map)).collect();
            if marks == self.maps {
                return Ok(());
            }
            let reason = format!(
                "expected the map that they were measured on, of {}, got one of {}; \
                 without their `maps` they are for any map",
                shown(&self.maps),
                shown(&marks)
            );
            return Err(Error::Settings { reason });
        }
        let sizes = maps.iter().map(|map| format!("{} places", map.places()));
        let got = sizes.collect::<Vec<_>>().join(" and ");
        let reason = format!(
            "expected the map that they were measured on, of {}, got one of {got}",
            shown(&self.maps)
        );
        Err(Error::Settings { reason })
    }
}

#[cfg(feature = "toml")]
impl Settings {
    /// Reads a file.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read, [`Error::Settings`] if it holds no settings: the line
    /// and the name are said.
    pub fn open(path: impl AsRef<std::path::Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let io = |source| Error::Io { path: path.to_owned(), action: "read the settings", source };
        let bytes = crate::regular::read(path, MOST as u64).map_err(io)?;
        let text = String::from_utf8(bytes).map_err(|error| io(std::io::Error::other(error)))?;
        Self::from_toml(&text).map_err(|error| match error {
            Error::Settings { reason } => {
                Error::Settings { reason: format!("{}: {reason}", path.display()) }
            }
            other => other,
        })
    }

    /// Writes a file, in place of one that is there.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be written. One that was there is then as it was.
    pub fn save(&self, path: impl AsRef<std::path::Path>) -> Result<(), Error> {
        let path = path.as_ref();
        let io = |source| Error::Io { path: path.to_owned(), action: "write the settings", source };
        crate::archive::AtomicFile::write(path, self.to_toml()?.as_bytes()).map_err(io)
    }

    /// From the text of a file.
    ///
    /// # Errors
    /// [`Error::Settings`].
    pub fn from_toml(text: &str) -> Result<Self, Error> {
        check_length(text)?;
        let refused = |error: toml::de::Error| {
            let before = error.span().and_then(|span| text.get(..span.start));
            let line = before.map(|before| format!("line {}: ", 1 + before.matches('\n').count()));
            let reason = format!("{}{}", line.unwrap_or_default(), error.message());
            Error::Settings { reason: shortened(&reason) }
        };
        let settings: Self = toml::from_str(text).map_err(refused)?;
        settings.threshold.as_ref().map_or(Ok(()), Threshold::check)?;
        Ok(settings)
    }

    /// The text of a file.
    ///
    /// # Errors
    /// [`Error::Settings`].
    pub fn to_toml(&self) -> Result<String, Error> {
        let text = toml::to_string(self);
        let text = text.map_err(|error| Error::Settings { reason: error.to_string() })?;
        check_length(&text)?;
        Ok(text)
    }
}

#[cfg(feature = "toml")]
fn check_length(text: &str) -> Result<(), Error> {
    let got = text.len();
    let reason = || format!("expected at most {MOST} bytes of text, got {got}");
    if got > MOST { Err(Error::Settings { reason: reason() }) } else { Ok(()) }
}

/// The text, of whose lines the ends are left out if they are long.
#[cfg(feature = "toml")]
fn shortened(text: &str) -> String {
    let lines = text.lines().map(|line| match line.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}...", &line[..end]),
        None => line.to_owned(),
    });
    lines.collect::<Vec<_>>().join("\n")
}
