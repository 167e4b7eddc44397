//! Several maps as one, and whether they fit.

use std::hash::Hasher as _;

use serde_json::Value;
use twox_hash::XxHash3_64;

use super::block::Blocks;
use super::positions::Positions;
use super::recipe::Kind;
use super::route::Route;
use super::{Map, Recipe};
use crate::error::Error;
use crate::post::Post;
use crate::segments::Segments;

impl Map {
    /// Maps one after the other, as one: each begins a new segment, closed segments stay closed,
    /// and links stay. Rows are shared. Positions around another origin are moved to the plane of
    /// the first map's. Thumbnails stay if all maps have them, of one size.
    ///
    /// ```
    /// use surefix::{Map, Metric};
    /// let road = Map::from_descriptors(vec![0_u8, 1, 2], 1, Metric::Manhattan)?;
    /// let street = Map::from_descriptors(vec![9_u8, 8], 1, Metric::Manhattan)?;
    /// let town = Map::join(&[&road, &street])?;
    /// assert_eq!((town.places(), town.segments().index_of(3)), (5, 1));
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Option`] for no map; [`Error::Append`], which names the map by its index, unless
    /// all have descriptors of one length, type, metric and recipe (if they have one) that went
    /// through the same post-processing, all or none have names, and all or none have positions, of
    /// one number of coordinates and one kind of plane.
    pub fn join(maps: &[&Self]) -> Result<Self, Error> {
        let Some((first, rest)) = maps.split_first() else {
            let (expected, got) = ("at least one map".to_owned(), "none".to_owned());
            return Err(Error::Option { name: "maps", expected, got });
        };
        for (index, more) in rest.iter().enumerate() {
            check(&format!("map {}", index + 1), first.about(), more.about())?;
        }
        let (blocks, route) = joined(maps, first.positions());
        route.traverses.check_count()?;
        let checksum = checksum_of(maps);
        Ok(Self { checksum, ..first.screened_like(blocks, route)? })
    }

    pub(super) fn about(&self) -> About<'_> {
        About {
            kind: &self.kind,
            positions: self.positions(),
            is_named: self.route.names.is_some(),
            thumbnails: self.thumbnails().map(super::Thumbnails::size),
        }
    }
}

/// Of the files of maps that are as they were there.
fn checksum_of(maps: &[&Map]) -> Option<u64> {
    if let [one] = maps {
        return one.checksum();
    }
    let mut hash = XxHash3_64::with_seed(0);
    for map in maps {
        hash.write_u64(map.checksum()?);
    }
    Some(hash.finish())
}

/// The blocks and the routes of maps, of which there is at least one, with positions on the plane of
/// `first`. They are joined by halves, so that many maps are not copied many times.
fn joined(maps: &[&Map], first: Option<&Positions>) -> (Blocks, Route) {
    if let [one] = maps {
        let mut route = (*one.route).clone();
        if let (Some(first), Some(own)) = (first, &route.positions) {
            route.positions = Some(own.on_plane_of(first).into_owned());
        }
        return (one.blocks.clone(), route);
    }
    let (some, rest) = maps.split_at(maps.len() / 2);
    let ((blocks, route), (more, along)) = (joined(some, first), joined(rest, first));
    (blocks.followed_by(&more), route.followed_by(&along, true))
}

/// What decides whether places can follow others.
#[derive(Clone, Copy)]
pub(super) struct About<'a> {
    pub(super) kind: &'a Kind,
    pub(super) positions: Option<&'a Positions>,
    pub(super) is_named: bool,
    pub(super) thumbnails: Option<(usize, usize)>,
}

impl<'a> About<'a> {
    /// Of descriptors alone.
    pub(super) fn kind(kind: &'a Kind) -> Self {
        Self { kind, positions: None, is_named: false, thumbnails: None }
    }
}

/// Refuses places that cannot follow those of the map.
pub(super) fn check(name: &str, map: About<'_>, more: About<'_>) -> Result<(), Error> {
    let kind = |of: &Kind| match of.recipe {
        Recipe::Ready => format!("ready descriptors of {} x {}, {}", of.dim, of.dtype, of.metric),
        Recipe::Sad(sad) => {
            let ((width, height), patch) = (sad.size(), sad.patch());
            let levels = sad
                .levels()
                .map(|levels| format!(", of the levels {} to {}", levels.low(), levels.high()));
            let levels = levels.unwrap_or_default();
            format!("SAD descriptors of {width} x {height} x {}, patch {patch}{levels}", of.dtype)
        }
    };
    let names = |named| if named { "a name for each place" } else { "no names" }.to_owned();
    let pairs = [(kind(map.kind), kind(more.kind)), (names(map.is_named), names(more.is_named))];
    for (expected, got) in pairs {
        if expected != got {
            return Err(misfit(name, &expected, &got));
        }
    }
    check_learned(name, map.kind.learned.as_deref(), more.kind.learned.as_deref())?;
    check_positions(name, map.positions, more.positions)?;
    check_post(name, map.kind.post.as_deref(), more.kind.post.as_deref())
}

/// Refuses places that cannot go on with the last segment of the map.
pub(super) fn check_onward(name: &str, map: &Segments, more: &Segments) -> Result<(), Error> {
    let last = map.iter().last().is_some_and(|segment| segment.closed);
    let first = more.iter().next().is_some_and(|segment| segment.closed);
    let (whose, which) = match (last, first) {
        (false, false) => return Ok(()),
        (true, _) => ("its", "last"),
        (false, true) => ("their", "first"),
    };
    let expected = format!("a new segment, as {whose} {which} segment is closed");
    Err(misfit(name, &expected, "places that go on with the last one"))
}

/// Refuses descriptors of another recipe. Ready descriptors need none.
fn check_learned(name: &str, map: Option<&str>, more: Option<&str>) -> Result<(), Error> {
    let parsed = |recipe: &str| serde_json::from_str::<Value>(recipe).ok();
    let said = |recipe: &str| recipe.chars().take(200).collect::<String>();
    match (map, more) {
        (Some(map), Some(more)) if parsed(map) != parsed(more) => {
            Err(misfit(name, &format!("descriptors by the recipe {}", said(map)), &said(more)))
        }
        _ => Ok(()),
    }
}

/// Refuses rows after other post-processing.
fn check_post(name: &str, map: Option<&Post>, more: Option<&Post>) -> Result<(), Error> {
    let said = |post: Option<&Post>| match post {
        None => "descriptors without post-processing".to_owned(),
        Some(post) => format!("descriptors after {:?}", post.steps()),
    };
    if map == more {
        return Ok(());
    }
    let (expected, got) = (said(map), said(more));
    let refitted = "the same fitted on other references (use the map's own)";
    Err(misfit(name, &expected, if expected == got { refitted } else { &got }))
}

pub(super) fn check_positions(
    name: &str,
    map: Option<&Positions>,
    more: Option<&Positions>,
) -> Result<(), Error> {
    let kind =
        |of: Option<&Positions>| of.map_or_else(|| "no positions".to_owned(), Positions::kind);
    let (map, more) = (kind(map), kind(more));
    if map == more { Ok(()) } else { Err(misfit(name, &map, &more)) }
}

pub(super) fn misfit(map: &str, expected: &str, got: &str) -> Error {
    Error::Append { map: map.to_owned(), expected: expected.to_owned(), got: got.to_owned() }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]
mod tests {
    use super::*;
    use crate::distance::Metric;

    /// Maps of files are told apart by what the files say of themselves.
    #[test]
    fn a_map_has_its_files_checksum_until_it_is_another_map() {
        let folder = tempfile::tempdir().unwrap();
        let of = |name: &str, rows: [u8; 3]| {
            let map = Map::from_descriptors(rows.to_vec(), 1, Metric::Manhattan).unwrap();
            let path = folder.path().join(name);
            map.save(&path).unwrap();
            (map, Map::open(path).unwrap())
        };
        let ((one, own), (_, other)) = (of("one", [1, 2, 3]), of("other", [1, 2, 4]));
        assert_eq!(one.checksum(), None);
        let sums = [own.checksum(), other.checksum()].map(Option::unwrap);
        assert_ne!(sums[0], sums[1]);
        assert_eq!(Map::join(&[&own]).unwrap().checksum(), Some(sums[0]));
        let joined = |maps: &[&Map]| Map::join(maps).unwrap().checksum();
        let several = [joined(&[&own, &other]), joined(&[&other, &own]), joined(&[&own, &own])];
        let several = several.map(Option::unwrap);
        for (index, sum) in several.iter().enumerate() {
            assert!(!several[..index].contains(sum) && !sums.contains(sum));
        }
        assert_eq!(joined(&[&own, &one]), None);
        assert_eq!(joined(&[&one]), None);
        let cut = own.with_segments(Segments::new(3, &[2]).unwrap()).unwrap();
        assert_eq!(cut.checksum(), None);
    }
}
