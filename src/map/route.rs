//! The route: how rows become places, which places follow each other, their positions and names.

use std::ops::Range;

use once_cell::race::OnceBox;

use super::positions::Positions;
use super::thumbnails::Thumbnails;
use super::traverses::Traverses;
use crate::error::Error;
use crate::segments::Segments;

/// The route along the map's rows. The rest of the crate asks [`segments`](Self::segments) where
/// neighbours end, and [`rows`](Self::rows) which rows are places; a place may have further rows in
/// other traverses.
#[derive(Clone, Debug)]
pub(crate) struct Route {
    pub(super) segments: Segments,
    pub(super) positions: Option<Positions>,
    pub(super) names: Option<Names>,
    pub(super) thumbnails: Option<Thumbnails>,
    pub(super) traverses: Traverses,
}

impl Route {
    /// A route without breaks.
    pub(super) fn unbroken(places: usize) -> Self {
        Self::along(Segments::one(places))
    }

    /// A route of these segments.
    pub(super) fn along(segments: Segments) -> Self {
        let traverses = Traverses::default();
        Self { segments, positions: None, names: None, thumbnails: None, traverses }
    }

    pub(crate) fn places(&self) -> usize {
        self.segments.places()
    }

    /// Where neighbours follow each other: gradients and diagonals do not cross from one segment to
    /// the next.
    pub(crate) fn segments(&self) -> &Segments {
        &self.segments
    }

    /// The rows of a range of places in the first traverse.
    #[expect(clippy::unused_self, reason = "the first traverse has one row for each place")]
    pub(crate) fn rows(&self, places: Range<usize>) -> Range<usize> {
        places
    }

    /// This route and then `more`, which has the same kind of positions and can follow. Its first
    /// segment goes on with the last of this one, unless it `begins` a new one. Names and positions
    /// stay if both have them, thumbnails if they are of one size, too.
    pub(super) fn followed_by(&self, more: &Self, begins: bool) -> Self {
        fn both<T>(one: Option<&T>, other: Option<&T>, join: impl Fn(&T, &T) -> T) -> Option<T> {
            one.zip(other).map(|(one, other)| join(one, other))
        }
        let (pictures, others) = (self.thumbnails.as_ref(), more.thumbnails.as_ref());
        let others =
            others.filter(|others| pictures.is_some_and(|own| own.size() == others.size()));
        Self {
            segments: self.segments.followed_by(&more.segments, begins),
            positions: both(
                self.positions.as_ref(),
                more.positions.as_ref(),
                Positions::followed_by,
            ),
            names: both(self.names.as_ref(), more.names.as_ref(), Names::followed_by),
            thumbnails: both(pictures, others, Thumbnails::followed_by),
            traverses: self.traverses.followed_by(self.places(), &more.traverses),
        }
    }

    /// Some of the places, which must be there, with the breaks between them.
    pub(super) fn slice(&self, places: Range<usize>) -> Self {
        Self {
            segments: self.segments.slice(places.clone()),
            positions: self.positions.as_ref().map(|positions| positions.slice(places.clone())),
            names: self.names.as_ref().map(|names| names.slice(places.clone())),
            thumbnails: self.thumbnails.as_ref().map(|pictures| pictures.slice(places.clone())),
            traverses: self.traverses.keep(&places),
        }
    }

    /// Some of the places, which are in order; `runs` are the same. A stretch of `tunnel` places or
    /// more that is left out becomes a break with a link across.
    pub(super) fn keep(&self, places: &[usize], runs: &[Range<usize>], tunnel: usize) -> Self {
        Self {
            segments: self.segments.kept(places, tunnel),
            positions: self.positions.as_ref().map(|known| known.of(places.iter().copied())),
            names: self.names.as_ref().map(|names| names.keep(places)),
            thumbnails: self.thumbnails.as_ref().map(|pictures| pictures.keep(runs)),
            traverses: self.traverses.keep(&places.iter().copied()),
        }
    }
}

/// Place names in one string, as in the file: a NUL after each, split on first use. Making a
/// million strings would take longer than opening the rest of a map.
#[derive(Clone, Debug)]
pub(super) struct Names {
    text: String,
    count: usize,
    list: OnceBox<Vec<String>>,
}

impl Names {
    /// # Errors
    /// [`Error::Option`] for a name with a NUL.
    pub(super) fn new<S: AsRef<str>>(names: impl IntoIterator<Item = S>) -> Result<Self, Error> {
        let mut text = String::new();
        let mut count = 0;
        for name in names {
            let name = name.as_ref();
            if name.contains('\0') {
                let expected = "names without NUL characters".to_owned();
                return Err(Error::Option { name: "names", expected, got: format!("{name:?}") });
            }
            text.push_str(name);
            text.push('\0');
            count += 1;
        }
        Ok(Self { text, count, list: OnceBox::new() })
    }

    /// The names in a file, or `None` if they are not UTF-8.
    pub(super) fn from_bytes(bytes: Vec<u8>) -> Option<Self> {
        let mut text = String::from_utf8(bytes).ok()?;
        if !text.is_empty() && !text.ends_with('\0') {
            text.push('\0');
        }
        let count = text.bytes().filter(|&byte| byte == 0).count();
        Some(Self { text, count, list: OnceBox::new() })
    }

    /// These and then those.
    fn followed_by(&self, more: &Self) -> Self {
        let text = [self.text.as_str(), &more.text].concat();
        Self { text, count: self.count + more.count, list: OnceBox::new() }
    }

    /// Those of some places, in order.
    fn keep(&self, places: &[usize]) -> Self {
        let mut next = places.iter().peekable();
        let mut text = String::new();
        for (place, name) in self.text.split_inclusive('\0').enumerate() {
            if next.next_if_eq(&&place).is_some() {
                text.push_str(name);
            }
        }
        Self { text, count: places.len(), list: OnceBox::new() }
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// The names as they are in a file.
    pub(super) fn bytes(&self) -> &[u8] {
        self.text.as_bytes()
    }

    pub(super) fn list(&self) -> &[String] {
        let names = || self.text.split_terminator('\0').map(str::to_owned);
        self.list.get_or_init(|| Box::new(names().collect()))
    }

    fn slice(&self, places: Range<usize>) -> Self {
        let names = self.text.split_inclusive('\0').skip(places.start).take(places.len());
        Self { text: names.collect(), count: places.len(), list: OnceBox::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::Names;

    fn names(bytes: &[u8]) -> (usize, Vec<String>) {
        let names = Names::from_bytes(bytes.to_vec());
        names.map(|names| (names.len(), names.list().to_vec())).unwrap_or_default()
    }

    #[test]
    fn the_last_name_of_another_programs_file_may_lack_its_end() {
        let two = || (2, vec!["a".to_owned(), "bc".to_owned()]);
        assert_eq!(names(b"a\0bc\0"), two());
        assert_eq!(names(b"a\0bc"), two());
        assert_eq!(names(b""), (0, Vec::new()));
        assert_eq!(names(b"\0"), (1, vec![String::new()]));
        assert!(Names::from_bytes(vec![0xFF, 0]).is_none());
    }

    #[test]
    fn names_follow_names() {
        let of = |names: &[&str]| Names::new(names).ok();
        let (Some(one), Some(other)) = (of(&["a", ""]), of(&["b", "c", "d"])) else {
            panic!("names without NUL")
        };
        let both = one.followed_by(&other);
        assert_eq!(
            (both.len(), both.list()),
            (5, &["a", "", "b", "c", "d"].map(str::to_owned)[..])
        );
        assert!(of(&["a\0"]).is_none());
    }
}
