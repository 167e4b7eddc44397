//! A map and a matcher: the loop that a robot runs.

mod screening;

use std::sync::Arc;

use crate::config::Config;
use crate::descriptor::Describer;
use crate::distance::Query;
use crate::error::Error;
use crate::image::ImageView;
use crate::map::{Map, Recipe};
use crate::method::{Column, Fix, Given, Matcher, Owner, load};
use crate::numbers::{Values, View};
use crate::post::{ChainState, Running};
use crate::scan::{Job, Pool, threads_for};
use screening::Screening;

/// The most threads that are accepted.
const MAX_THREADS: usize = 1024;

/// Localizes along a map, one camera frame at a time.
///
/// Many localizers can read one map at once. `push_descriptor` allocates nothing after
/// construction; `push_image` allocates only if the camera's image size changes, so for the first
/// image.
///
/// A map of 16 MB or more is scanned by several threads, one for every 8 MB, up to all cores; a
/// smaller one by the caller alone. [`with_threads`](Self::with_threads) sets their number. The
/// answers are the same to the last bit. The threads are started with the localizer, sleep between
/// frames, and end with it. A push never waits for a thread: chunks that another thread has begun
/// but not finished when all others are done, the caller scans itself. With one thread, a push
/// takes no lock and makes no system call; with several, it tries locks (and goes on if one is
/// taken) and wakes the others. In a process forked off this one, the caller scans alone.
///
/// A map with a screen ([`Map::with_screen`]) is scanned at a quarter of the bytes, for the same
/// answers.
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
    /// The newest frame's distances, or lower bounds of them.
    column: Vec<f32>,
    /// The bounds of a map with a screen.
    screening: Option<Box<Screening>>,
    /// The threads that scan the map; `None` if the caller scans alone.
    pool: Option<Pool>,
    /// Describes images the map's own way, if the map has one.
    describer: Option<(Describer, Values)>,
    /// The state of the map's post-processing: scratch memory, and running statistics of the drive.
    through: Option<ChainState>,
}

impl Localizer {
    /// A localizer on `map`.
    ///
    /// # Errors
    /// As for [`Matcher::new`].
    pub fn new(map: Arc<Map>, config: Config) -> Result<Self, Error> {
        let matcher = Matcher::along(map.route().segments().clone(), config)?;
        Self::with_matcher(map, matcher)
    }

    /// The same localizer with `threads` threads to scan the map, the caller's own among them;
    /// `None` for the number that suits the map's size, as in a new one.
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
        self.pool = match threads {
            None => automatic(&self.map),
            Some(1) => None,
            Some(threads) if (2..=MAX_THREADS).contains(&threads) => {
                let pool = Pool::new(&self.map, threads);
                Some(pool.map_err(|why| refused(format!("{threads} ({why})")))?)
            }
            Some(other) => return Err(refused(other.to_string())),
        };
        Ok(self)
    }

    /// How many threads scan the map, the caller's own among them.
    pub fn threads(&self) -> usize {
        self.pool.as_ref().map_or(1, Pool::threads)
    }

    fn with_matcher(map: Arc<Map>, mut matcher: Matcher) -> Result<Self, Error> {
        let describer = match map.recipe() {
            Recipe::Sad(sad) => Some((Describer::new(sad), Values::zeros(sad.dtype(), sad.dim()))),
            Recipe::Ready => None,
        };
        let screening = match map.codes() {
            // The tracker needs all distances: bounds would only be work before them.
            Some(_) if map.dim() >= screening::SHORTEST && matcher.config().motion.is_none() => {
                Some(Box::new(Screening::new(&map, &mut matcher)?))
            }
            _ => None,
        };
        let column = vec![0.0; map.places()];
        let pool = automatic(&map);
        let through = map.post().map(ChainState::of_drive);
        Ok(Self { map, matcher, column, screening, pool, describer, through })
    }

    /// Localizes by a camera image, described as the map's own images were.
    ///
    /// # Errors
    /// [`Error::NoDescriptor`] if the map was made of ready descriptors. The localizer is then
    /// as it was.
    pub fn push_image<'a>(&mut self, image: impl Into<ImageView<'a>>) -> Result<Fix, Error> {
        self.push_image_with(image, Given::default())
    }

    /// Localizes by a descriptor: float32, or of the map's own type; on a map with post-processing
    /// as it is before that.
    ///
    /// # Errors
    /// As for [`Map::distances_into`]. The localizer is then as it was.
    pub fn push_descriptor<'a>(&mut self, descriptor: impl Into<View<'a>>) -> Result<Fix, Error> {
        self.push_descriptor_with(descriptor, Given::default())
    }

    /// [`push_image`](Self::push_image), with what else is known about the frame.
    ///
    /// # Errors
    /// As for [`push_image`](Self::push_image), and for an advance that is not finite.
    pub fn push_image_with<'a>(
        &mut self,
        image: impl Into<ImageView<'a>>,
        given: Given,
    ) -> Result<Fix, Error> {
        given.check()?;
        let Some((describer, values)) = &mut self.describer else {
            return Err(Error::NoDescriptor);
        };
        describer.describe(image.into(), values)?;
        let query = self.map.query(values.view())?;
        let scan = Scan { map: &self.map, pool: &mut self.pool, column: &mut self.column };
        scan.push(&mut self.matcher, self.screening.as_deref_mut(), query, given)
    }

    /// [`push_descriptor`](Self::push_descriptor), with what else is known about the frame.
    ///
    /// # Errors
    /// As for [`push_descriptor`](Self::push_descriptor), and for an advance that is not finite.
    pub fn push_descriptor_with<'a>(
        &mut self,
        descriptor: impl Into<View<'a>>,
        given: Given,
    ) -> Result<Fix, Error> {
        given.check()?;
        let descriptor = self.map.passed(descriptor.into(), self.through.as_mut())?;
        let query = self.map.query(descriptor)?;
        let scan = Scan { map: &self.map, pool: &mut self.pool, column: &mut self.column };
        let fix = scan.push(&mut self.matcher, self.screening.as_deref_mut(), query, given)?;
        if let Some(through) = &mut self.through {
            through.commit();
        }
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

    /// The distances from the newest frame to every place; zeros before the first, and right after
    /// a gap. On a map with a screen, those that were not needed for the fix are computed now.
    pub fn distances(&mut self) -> &[f32] {
        let Self { map, matcher, column, screening, pool, .. } = self;
        let newest = match screening {
            Some(screening) => screening.newest(matcher, map, pool),
            None => matcher.window().newest(&mut ()),
        };
        newest.unwrap_or_else(|| {
            column.fill(0.0);
            column
        })
    }

    /// The track's belief in each place, as [`Matcher::belief`].
    pub fn belief(&self) -> Option<impl Iterator<Item = f64>> {
        self.matcher.belief()
    }

    /// How many of the map's rows the newest frame made the localizer look at: all of them, or, on
    /// a map with a screen, those that were left in doubt, for this query and for the ones before
    /// it in the window. 0 before the first frame; right after a restart, all.
    pub fn looked_at(&self) -> usize {
        match &self.screening {
            Some(screening) => screening.looked_at(),
            None if self.frames() == 0 => 0,
            None => self.map.places(),
        }
    }

    /// Says that the next frame does not follow on the one before, as [`Matcher::gap`] does: until
    /// `L` frames have come, fixes have no sequence. The running floor goes on, and so do a drive's
    /// running statistics of the map's post-processing.
    ///
    /// ```
    /// # use std::sync::Arc;
    /// # use surefix::{Config, Localizer, Map, Metric};
    /// # let map = Arc::new(Map::from_descriptors(vec![1.0_f32, 0.0, 0.0, 1.0], 2, Metric::Euclidean)?);
    /// let mut localizer = Localizer::new(map, Config::default())?;
    /// localizer.push_descriptor([1.0_f32, 0.0].as_slice())?;
    /// localizer.gap();
    /// let fix = localizer.push_descriptor([0.0_f32, 1.0].as_slice())?;
    /// assert_eq!((fix.frame, fix.place, fix.sequence), (1, 1, None));
    /// # Ok::<(), surefix::Error>(())
    /// ```
    pub fn gap(&mut self) {
        self.matcher.gap();
        self.screening_gap();
    }

    /// A gap during which the robot moved, as [`Matcher::gap_with_advance`].
    ///
    /// # Errors
    /// As for [`Matcher::gap_with_advance`].
    pub fn gap_with_advance(&mut self, advance: f64) -> Result<(), Error> {
        self.matcher.gap_with_advance(advance)?;
        self.screening_gap();
        Ok(())
    }

    fn screening_gap(&mut self) {
        if let Some(screening) = &mut self.screening {
            screening.gap();
        }
    }

    /// Forgets all frames and statistics of the drive: the next one is frame 0.
    pub fn reset(&mut self) {
        self.matcher.reset();
        if let Some(screening) = &mut self.screening {
            screening.reset();
        }
        if let (Some(through), Some(post)) = (&mut self.through, self.map.post()) {
            through.reset(post);
        }
    }

    /// The state as bytes, without the map; [`restore`](Self::restore) goes on from it
    /// bit-identically. It is the same whether the map has a screen or not, so that either can go
    /// on from it; with a screen, all distances of the window are computed for it.
    ///
    /// # Errors
    /// As for [`Matcher::snapshot`].
    pub fn snapshot(&self) -> Result<Vec<u8>, Error> {
        let map = Some(self.map.fingerprint());
        let running = self.through.iter().flat_map(ChainState::running);
        let running = running.map(Running::snapshot).collect::<Result<Vec<_>, _>>()?;
        match &self.screening {
            None => self.matcher.save(map, &running),
            Some(screening) => {
                let mut matcher = self.matcher.clone();
                screening.resolve(&mut matcher, &self.map, &mut None);
                matcher.save(map, &running)
            }
        }
    }

    /// A localizer that goes on where the snapshot was taken, on the same map. If `expected` is
    /// given, the snapshot must have been taken under the same options.
    ///
    /// # Errors
    /// [`Error::Snapshot`] if the bytes are damaged, of another map, of other options or of a
    /// newer version.
    pub fn restore(
        map: Arc<Map>,
        snapshot: &[u8],
        expected: Option<&Config>,
    ) -> Result<Self, Error> {
        let owner = Owner { fingerprint: map.fingerprint(), segments: map.route().segments() };
        let saved = load(snapshot, expected, Some(&owner))?;
        let running = saved.running.iter().map(|running| Running::restore(running));
        let running = running.collect::<Result<Vec<_>, _>>()?;
        let mut localizer = Self::with_matcher(map, saved.matcher)?;
        let fits = match &mut localizer.through {
            Some(through) => through.resume(running),
            None => running.is_empty(),
        };
        if !fits {
            let reason = "damaged: statistics of another chain than the map's".to_owned();
            return Err(Error::Snapshot { reason });
        }
        Ok(localizer)
    }

    /// The map.
    pub fn map(&self) -> &Arc<Map> {
        &self.map
    }

    /// Its options.
    pub fn config(&self) -> &Config {
        self.matcher.config()
    }

    /// How many frames it has taken since the start or the last reset.
    pub fn frames(&self) -> u64 {
        self.matcher.frames()
    }
}

/// One query's scan: the map, the threads, and memory for the column.
struct Scan<'a> {
    map: &'a Map,
    pool: &'a mut Option<Pool>,
    column: &'a mut [f32],
}

impl Scan<'_> {
    /// A query becomes a column, by the screen if there is one, and the column a fix.
    fn push(
        self,
        matcher: &mut Matcher,
        screening: Option<&mut Screening>,
        query: Query<'_>,
        given: Given,
    ) -> Result<Fix, Error> {
        let Self { map, pool, column } = self;
        if let Some(screening) = screening {
            return screening.push(matcher, map, pool, query, column, given);
        }
        Job::Distances(query).column(map, pool, column);
        matcher.push_column(Column { lower: column, upper: None }, given, &mut ())
    }
}

/// The pool that suits the map's size; `None` for one thread.
fn automatic(map: &Arc<Map>) -> Option<Pool> {
    let threads = threads_for(map);
    (threads > 1).then(|| Pool::at_most(map, threads))
}
