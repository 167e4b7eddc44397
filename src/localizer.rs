//! A map and a matcher: the loop that a robot runs.

use std::sync::Arc;

use crate::config::Config;
use crate::crew::{Crew, threads_for};
use crate::descriptor::{Describer, ImageView};
use crate::distance::{Values, View};
use crate::error::Error;
use crate::map::{Map, Recipe};
use crate::matcher::{Fix, Matcher, load};

/// The most threads that are accepted.
const MAX_THREADS: usize = 1024;

/// Localizes along a map, one camera frame at a time.
///
/// Many localizers can read one map at once. `push_descriptor` allocates nothing after construction;
/// `push_image` allocates only when the camera's image size changes, so for the first image.
///
/// A map of 16 MB or more is scanned by several threads, one for every 8 MB, up to all cores; a smaller one by the caller
/// alone. [`with_threads`](Self::with_threads) sets their number. The answers are the same to the last bit. The threads are
/// started with the localizer, sleep between frames, and end with it. A push waits for none of them, whatever holds one up:
/// what another thread has begun and not finished when the rest of the map is scanned, the caller does itself. With one
/// thread, a push takes no lock and asks nothing of the operating system; with several, it tries locks (and goes on where
/// one is taken) and asks the system to wake the others. In a process forked off this one, the caller scans alone.
///
/// ```
/// use std::sync::Arc;
/// use surefix::{Config, Localizer, Map, Metric};
/// let route = vec![1.0_f32, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
/// let map = Arc::new(Map::from_descriptors(route, 3, Metric::Euclidean)?);
/// let mut localizer = Localizer::new(map, Config::default())?;
/// let fix = localizer.push_descriptor([0.1_f32, 0.9, 0.0].as_slice())?;
/// assert_eq!(fix.place, 1);
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Localizer {
    map: Arc<Map>,
    matcher: Matcher,
    /// Scans the map, where more than one thread does.
    crew: Option<Crew>,
    /// Describes images the map's own way, where the map has one.
    describer: Option<(Describer, Values)>,
    /// The newest frame's distances.
    distances: Vec<f32>,
    /// Where those of the next frame are written, so that a frame that is refused leaves the newest ones alone.
    next: Vec<f32>,
}

impl Localizer {
    /// A localizer on `map`.
    ///
    /// # Errors
    /// As for [`Matcher::new`].
    pub fn new(map: Arc<Map>, config: Config) -> Result<Self, Error> {
        let matcher = Matcher::new(map.places(), config)?;
        Ok(Self::with_matcher(map, matcher))
    }

    /// The same localizer with `threads` threads to scan the map, the caller's own among them; with none given, as many as
    /// suit the map's size, which is what a new one has.
    ///
    /// ```
    /// # use std::sync::Arc;
    /// # use surefix::{Config, Localizer, Map, Metric};
    /// # let map = Arc::new(Map::from_descriptors(vec![1.0_f32, 0.0, 0.0, 1.0], 2, Metric::Euclidean)?);
    /// let localizer = Localizer::new(map, Config::default())?.with_threads(Some(2))?;
    /// assert_eq!(localizer.threads(), 2);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Option`] for no thread, for more than 1024, or for more than the system starts.
    pub fn with_threads(mut self, threads: Option<usize>) -> Result<Self, Error> {
        let refused = |got: String| {
            let expected = format!("from 1 to {MAX_THREADS}, and no more than the system starts");
            Error::Option { name: "threads", expected, got }
        };
        self.crew = match threads {
            None => automatic(&self.map),
            Some(1) => None,
            Some(threads) if (2..=MAX_THREADS).contains(&threads) => {
                let crew = Crew::new(&self.map, threads);
                Some(crew.map_err(|why| refused(format!("{threads} ({why})")))?)
            }
            Some(other) => return Err(refused(other.to_string())),
        };
        Ok(self)
    }

    /// How many threads scan the map, the caller's own among them.
    pub fn threads(&self) -> usize {
        self.crew.as_ref().map_or(1, Crew::threads)
    }

    fn with_matcher(map: Arc<Map>, matcher: Matcher) -> Self {
        let describer = match map.recipe() {
            Recipe::Sad(sad) => Some((Describer::new(sad), Values::zeros(sad.dtype(), sad.dim()))),
            Recipe::Ready => None,
        };
        let distances = vec![0.0; map.places()];
        let crew = automatic(&map);
        Self { matcher, crew, describer, next: distances.clone(), distances, map }
    }

    /// Localizes by a camera image, described as the map's own images were.
    ///
    /// # Errors
    /// [`Error::NoDescriptor`] where the map was made of ready descriptors. The localizer is then as it was.
    pub fn push_image<'a>(&mut self, image: impl Into<ImageView<'a>>) -> Result<Fix, Error> {
        self.push_image_with_trust(image.into(), None)
    }

    /// Localizes by a descriptor: float32, or of the map's own type.
    ///
    /// # Errors
    /// As for [`Map::distances_into`]. The localizer is then as it was.
    pub fn push_descriptor<'a>(&mut self, descriptor: impl Into<View<'a>>) -> Result<Fix, Error> {
        self.push_descriptor_with_trust(descriptor.into(), None)
    }

    /// [`push_image`](Self::push_image), with an external predictor's word in place of the consensus where there is one.
    ///
    /// # Errors
    /// As for [`push_image`](Self::push_image).
    pub fn push_image_with_trust(
        &mut self,
        image: ImageView<'_>,
        trusted: Option<bool>,
    ) -> Result<Fix, Error> {
        let Some((describer, values)) = &mut self.describer else { return Err(Error::NoDescriptor) };
        describer.describe(image, values)?;
        scan(&self.map, &mut self.crew, values.view(), &mut self.next)?;
        self.step(trusted)
    }

    /// [`push_descriptor`](Self::push_descriptor), with an external predictor's word in place of the consensus where
    /// there is one.
    ///
    /// # Errors
    /// As for [`push_descriptor`](Self::push_descriptor).
    pub fn push_descriptor_with_trust(
        &mut self,
        descriptor: View<'_>,
        trusted: Option<bool>,
    ) -> Result<Fix, Error> {
        scan(&self.map, &mut self.crew, descriptor, &mut self.next)?;
        self.step(trusted)
    }

    fn step(&mut self, trusted: Option<bool>) -> Result<Fix, Error> {
        let fix = self.matcher.step(&self.next, trusted)?;
        std::mem::swap(&mut self.distances, &mut self.next);
        Ok(fix)
    }

    /// Fixes for frame after frame of a camera, as they are asked for.
    pub fn stream<'a, I>(&mut self, frames: I) -> impl Iterator<Item = Result<Fix, Error>>
    where
        I: IntoIterator,
        I::Item: Into<ImageView<'a>>,
    {
        frames.into_iter().map(|frame| self.push_image(frame))
    }

    /// The distances from the newest frame to every place; zeros before the first.
    pub fn distances(&self) -> &[f32] {
        &self.distances
    }

    /// Forgets all frames: the next one is frame 0.
    pub fn reset(&mut self) {
        self.matcher.reset();
        self.distances.fill(0.0);
    }

    /// The state as bytes, without the map; [`restore`](Self::restore) goes on from it bit-identically.
    ///
    /// # Errors
    /// As for [`Matcher::snapshot`].
    pub fn snapshot(&self) -> Result<Vec<u8>, Error> {
        self.matcher.save(Some(self.map.fingerprint()))
    }

    /// A localizer that goes on where the snapshot was taken, on the same map. Where `expected` is given, the snapshot
    /// must have been taken under the same options.
    ///
    /// # Errors
    /// [`Error::Snapshot`] where the bytes are damaged, of another map, of other options or of a newer version.
    pub fn restore(map: Arc<Map>, snapshot: &[u8], expected: Option<&Config>) -> Result<Self, Error> {
        let saved = load(snapshot, expected)?;
        if saved.map != Some(map.fingerprint()) || saved.matcher.places() != map.places() {
            let reason = match saved.map {
                Some(_) => "taken on another map than this one".to_owned(),
                None => "of a matcher without a map: restore it with Matcher".to_owned(),
            };
            return Err(Error::Snapshot { reason });
        }
        let mut localizer = Self::with_matcher(map, saved.matcher);
        if let Some(newest) = localizer.matcher.newest() {
            localizer.distances.copy_from_slice(newest);
        }
        Ok(localizer)
    }

    /// The map.
    pub fn map(&self) -> &Arc<Map> {
        &self.map
    }

    /// The matcher behind it.
    pub fn matcher(&self) -> &Matcher {
        &self.matcher
    }
}

/// As many threads as suit the map, where that is more than one.
fn automatic(map: &Arc<Map>) -> Option<Crew> {
    let threads = threads_for(map);
    (threads > 1).then(|| Crew::at_most(map, threads))
}

fn scan(map: &Map, crew: &mut Option<Crew>, query: View<'_>, out: &mut [f32]) -> Result<(), Error> {
    match crew {
        Some(crew) => crew.distances_into(query, out),
        None => map.distances_into(query, out),
    }
}
