//! The order of a drive's image files.

use std::cmp::Ordering;
use std::fmt;
use std::fs;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::SystemTime;

use crate::error::Error;
use crate::regular;

/// The order of image files, first to last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Order {
    /// By their names, as a person counts: `frame10` follows `Frame9`. Of numbers with a point,
    /// the digits after it are decimals (9.25 before 9.5), unless one of them ends in 0 and none
    /// begins with 0, as whole numbers do.
    #[default]
    Name,
    /// By name, with decimals after a point: 9.25 before 9.5.
    Decimals,
    /// By name, with a whole number after a point, such as unpadded nanoseconds: 9.5 before 9.25.
    Whole,
    /// By the time of their last change.
    Time,
    /// By the time at which the camera took them (EXIF `DateTimeOriginal`, with its fraction of a
    /// second).
    Exif,
}

const OPEN: &str = "the digits after the point in the files' names are read as decimals (9.25 before \
     9.5); if they are whole numbers, such as nanoseconds, choose the order \"whole\"";
const ONE_TIME: &str = "all files have one time of change: their order is that of names";

const NAMES: [(Order, &str); 5] = [
    (Order::Name, "name"),
    (Order::Decimals, "decimals"),
    (Order::Whole, "whole"),
    (Order::Time, "time"),
    (Order::Exif, "exif"),
];

impl fmt::Display for Order {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = NAMES.iter().find(|(order, _)| order == self).map_or("", |(_, name)| name);
        f.write_str(name)
    }
}

impl FromStr for Order {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let found = NAMES.iter().find(|(_, name)| *name == text);
        found.map(|(order, _)| *order).ok_or_else(|| Error::Option {
            name: "order",
            expected: NAMES.map(|(_, name)| name).join(", "),
            got: format!("{text:?}"),
        })
    }
}

impl Order {
    pub(super) fn is_by_name(self) -> bool {
        !matches!(self, Self::Time | Self::Exif)
    }
}

/// Sorts the files, and says if the order is a guess.
pub(super) fn sort(paths: &mut Vec<PathBuf>, order: Order) -> Result<Option<String>, Error> {
    // Files of one time stay in the order of their names.
    let open = sort_by_name(paths, order);
    match order {
        Order::Name => Ok(open.then(|| OPEN.to_owned())),
        Order::Decimals | Order::Whole => Ok(None),
        Order::Time => {
            let times = sort_by(paths, changed)?;
            let same = paths.len() > 1 && times.windows(2).all(|pair| pair[0] == pair[1]);
            Ok(same.then(|| ONE_TIME.to_owned()))
        }
        Order::Exif => sort_by(paths, taken).map(|_| None),
    }
}

/// Sorts by a key, which may be missing; files with equal keys stay as they are.
fn sort_by<K: Ord>(
    paths: &mut Vec<PathBuf>,
    key: impl Fn(&Path) -> Result<K, Error>,
) -> Result<Vec<K>, Error> {
    let keyed: Result<Vec<_>, Error> =
        paths.drain(..).map(|path| Ok((key(&path)?, path))).collect();
    let mut keyed = keyed?;
    keyed.sort_by(|a, b| a.0.cmp(&b.0));
    let (keys, sorted) = keyed.into_iter().unzip();
    *paths = sorted;
    Ok(keys)
}

fn changed(path: &Path) -> Result<SystemTime, Error> {
    let io =
        |source| Error::Io { path: path.to_owned(), action: "read the time of change", source };
    fs::metadata(path).and_then(|about| about.modified()).map_err(io)
}

/// `2026:11:29 12:30:05` and the digits of the fraction, which sort as texts.
fn taken(path: &Path) -> Result<(String, String), Error> {
    use exif::{In, Tag, Value};
    let io = |source| Error::Io { path: path.to_owned(), action: "read the image", source };
    let mut file = BufReader::new(regular::open(path).map_err(io)?.0);
    let found = exif::Reader::new().read_from_container(&mut file).ok();
    let text = |tag: Tag| match &found.as_ref()?.get_field(tag, In::PRIMARY)?.value {
        Value::Ascii(texts) => {
            let text = String::from_utf8_lossy(texts.first()?).trim().to_owned();
            text.chars().any(|c| c.is_ascii_digit()).then_some(text)
        }
        _ => None,
    };
    let pairs = [
        (Tag::DateTimeOriginal, Tag::SubSecTimeOriginal),
        (Tag::DateTimeDigitized, Tag::SubSecTimeDigitized),
        (Tag::DateTime, Tag::SubSecTime),
    ];
    let time = pairs
        .into_iter()
        .find_map(|(second, part)| Some((text(second)?, text(part).unwrap_or_default())));
    time.ok_or_else(|| Error::Image {
        name: path.display().to_string(),
        reason: "expected the time at which it was taken (EXIF DateTimeOriginal) for the order \
                 exif, got none"
            .to_owned(),
    })
}

/// A path as it is compared. Upper and lower case are one.
struct Key {
    folder: String,
    stem: String,
    ending: String,
}

impl Key {
    fn of(path: &Path) -> Self {
        let text = |part: Option<&std::ffi::OsStr>| {
            part.map_or_else(String::new, |part| part.to_string_lossy().to_lowercase())
        };
        Self {
            folder: text(path.parent().map(Path::as_os_str)),
            stem: text(path.file_stem()),
            ending: text(path.extension()),
        }
    }

    fn compare(&self, other: &Self) -> Ordering {
        let parts = [
            (&self.folder, &other.folder),
            (&self.stem, &other.stem),
            (&self.ending, &other.ending),
        ];
        let compared = parts.map(|(a, b)| alphanumeric_sort::compare_str(a, b));
        compared.into_iter().fold(Ordering::Equal, Ordering::then)
    }
}

/// Sorts by name; true if the names leave open how to read the digits after a point.
fn sort_by_name(paths: &mut Vec<PathBuf>, order: Order) -> bool {
    let mut keyed: Vec<(Key, PathBuf)> =
        paths.drain(..).map(|path| (Key::of(&path), path)).collect();
    let fractions: Vec<_> = keyed.iter().map(|(key, _)| fractions(&key.stem)).collect();
    let digits: Vec<&str> = fractions
        .iter()
        .zip(&keyed)
        .flat_map(|(found, (key, _))| found.iter().map(|range| &key.stem[range.clone()]))
        .collect();
    let longest = digits.iter().map(|digits| digits.len()).max().unwrap_or(0);
    let uneven = digits.iter().any(|digits| digits.len() != longest);
    let any = |wanted: &dyn Fn(&str) -> bool| {
        digits.iter().any(|digits| digits.len() > 1 && wanted(digits))
    };
    // Whole numbers do not begin with 0, and decimals that were cut to what is needed do not end
    // in 0.
    let (leading, trailing) =
        (any(&|digits| digits.starts_with('0')), any(&|digits| digits.ends_with('0')));
    let decimals = match order {
        Order::Decimals => true,
        Order::Whole => false,
        _ => leading || !trailing,
    };
    if uneven && decimals {
        for ((key, _), found) in keyed.iter_mut().zip(&fractions) {
            for range in found.iter().rev() {
                key.stem.insert_str(range.end, &"0".repeat(longest - range.len()));
            }
        }
    }
    keyed.sort_by(|a, b| a.0.compare(&b.0).then_with(|| a.1.cmp(&b.1)));
    paths.extend(keyed.into_iter().map(|(_, path)| path));
    uneven && !leading && !trailing
}

/// Where the digits after the points of numbers lie: of 9.25, but neither of 10.30.05 nor of
/// frame.7.
fn fractions(stem: &str) -> Vec<std::ops::Range<usize>> {
    let bytes = stem.as_bytes();
    let mut found = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let part_of_number = |byte: &&u8| byte.is_ascii_digit() || **byte == b'.';
        if !bytes[at].is_ascii_digit() {
            at += 1;
            continue;
        }
        let length = bytes[at..].iter().take_while(part_of_number).count();
        let text = stem[at..at + length].trim_end_matches('.');
        if let Some((whole, digits)) = text.split_once('.')
            && !digits.contains('.')
            && !digits.is_empty()
            && (at == 0 || bytes[at - 1] != b'.')
        {
            found.push(at + whole.len() + 1..at + text.len());
        }
        at += length;
    }
    found
}

#[cfg(all(test, unix))]
mod tests {
    use std::ffi::OsString;
    use std::os::unix::ffi::OsStringExt as _;

    use proptest::prelude::*;

    use super::*;

    /// Digits, letters and marks, bytes that are no UTF-8, and letters beyond them.
    fn name() -> impl Strategy<Value = PathBuf> {
        let part = prop_oneof![
            prop::sample::select(vec!["0", "00", "1", "9", "10", "a", "f", "A", ".", "-", "_"])
                .prop_map(|text| text.as_bytes().to_vec()),
            prop::sample::select(vec!["é", "點", "\u{fffd}", "٣"])
                .prop_map(|text| text.as_bytes().to_vec()),
            prop::sample::select(vec![0xFF_u8, 0xC3, 0x80]).prop_map(|byte| vec![byte]),
        ];
        prop::collection::vec(part, 1..6)
            .prop_map(|parts| PathBuf::from(OsString::from_vec(parts.concat())))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        /// One order of all names, those that are no UTF-8 among them.
        #[test]
        fn names_have_a_total_order(names in prop::collection::vec(name(), 3)) {
            let before = |a: &PathBuf, b: &PathBuf| {
                Key::of(a).compare(&Key::of(b)).then_with(|| a.cmp(b))
            };
            for a in &names {
                for b in &names {
                    prop_assert_eq!(before(a, b), before(b, a).reverse());
                    prop_assert_eq!(before(a, b).is_eq(), a == b);
                    for c in &names {
                        if before(a, b).is_le() && before(b, c).is_le() {
                            prop_assert!(before(a, c).is_le(), "{a:?} {b:?} {c:?}");
                        }
                    }
                }
            }
        }
    }
}
