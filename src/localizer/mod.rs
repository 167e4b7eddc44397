//! A map and a matcher: the loop that a robot runs.

mod judge;
mod position;
mod screening;
mod technique;

use std::sync::Arc;

use crate::calibration::{Alarm, Threshold};
use crate::config::Config;
use crate::error::Error;
use crate::image::ImageView;
use crate::map::Map;
use crate::method::{Fix, Fusion, Given, MAX_TECHNIQUES, Matcher, Owner, load};
use crate::numbers::View;
use crate::post::Running;
use crate::scan::{Pool, threads_for};
use crate::segments::Segments;
pub(crate) use judge::{Judge, Told};
use screening::Screening;
pub use technique::Input;
pub(crate) use technique::Queries;
use technique::Technique;

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
/// answers; one with places that show nothing ([`Map::blank`]) or with several traverses
/// ([`Map::add_traverse`]) is scanned without.
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
    /// One or several maps of the same route.
    techniques: Vec<Technique>,
    /// Makes one column of those of several techniques.
    fusion: Option<Fusion>,
    matcher: Matcher,
    /// The bounds of a map with a screen.
    screening: Option<Box<Screening>>,
    judge: Option<Box<Judge>>,
    told: Option<Told>,
}

impl Localizer {
    /// A localizer on `map`.
    ///
    /// # Errors
    /// As for [`Matcher::new`].
    pub fn new(map: Arc<Map>, config: Config) -> Result<Self, Error> {
        Self::fused(vec![map], config)
    }

    /// A localizer on several maps of the same places, each of another technique. The single match
    /// and the sequence run on the mean of the techniques' standardised distances, and the track on
    /// the evidence of all (method 1.9): nobody has to know which technique is best on a route.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use surefix::{Config, Input, Given, Localizer, Map, Metric, View};
    /// let map = |rows: Vec<f32>| Map::from_descriptors(rows, 2, Metric::Euclidean).map(Arc::new);
    /// let maps = vec![map(vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0])?, map(vec![5.0, 5.0, 1.0, 0.0, 0.0, 1.0])?];
    /// let mut localizer = Localizer::fused(maps, Config::default())?;
    /// let query = [Input::Descriptor(View::F32(&[0.1, 0.9])), Input::Descriptor(View::F32(&[1.0, 0.1]))];
    /// assert_eq!(localizer.push_inputs(&query, Given::default())?.place, 1);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// As for [`Matcher::new`]; [`Error::Option`] for no map or more than 32, and
    /// [`Error::Length`] unless all have one number of places.
    pub fn fused(maps: Vec<Arc<Map>>, config: Config) -> Result<Self, Error> {
        let matcher = Matcher::along(one_route(&maps)?.clone(), config)?;
        Self::with_matcher(maps, matcher)
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
        for Technique { map, pool, .. } in &mut self.techniques {
            *pool = match threads {
                None => automatic(map),
                Some(1) => None,
                Some(threads) if (2..=MAX_THREADS).contains(&threads) => {
                    let pool = Pool::new(map, threads);
                    Some(pool.map_err(|why| refused(format!("{threads} ({why})")))?)
                }
                Some(other) => return Err(refused(other.to_string())),
            };
        }
        Ok(self)
    }

    /// The same localizer, which judges each fix: whether `threshold` accepts it, and how probable
    /// it is that it is right. Neither the threshold nor the state of its alarm is part of a
    /// snapshot.
    ///
    /// # Errors
    /// [`Error::Option`] if the threshold is of fixes with a track and there is no
    /// [`Config::motion`], or the other way round; [`Error::Settings`] for a threshold that no
    /// calibration makes.
    pub fn with_threshold(mut self, threshold: Threshold) -> Result<Self, Error> {
        let tracked = self.config().motion.is_some();
        self.judge = Some(Box::new(Judge::new(threshold, tracked)?));
        Ok(self)
    }

    /// Calls `told` once, with the fix at that time, if the scores are no longer those of the
    /// threshold's calibration drive, so that its promise and its probabilities hold no longer.
    /// Without a threshold it is never called.
    ///
    /// ```
    /// # use std::sync::Arc;
    /// # use surefix::{Config, Localizer, Map, Metric};
    /// # let map = Arc::new(Map::from_descriptors(vec![1.0_f32, 0.0, 0.0, 1.0], 2, Metric::Euclidean)?);
    /// let mut localizer = Localizer::new(map, Config::default())?;
    /// localizer.on_alarm(|fix| eprintln!("frame {}: calibrate anew", fix.frame));
    /// # Ok::<(), surefix::Error>(())
    /// ```
    pub fn on_alarm(&mut self, told: impl Fn(&Fix) + Send + Sync + 'static) {
        self.told = Some(Told::new(told));
    }

    /// The threshold that judges its fixes.
    pub fn threshold(&self) -> Option<&Threshold> {
        self.judge.as_ref().map(|judge| &judge.threshold)
    }

    /// The alarm that the threshold holds no longer.
    pub fn alarm(&self) -> Option<&Alarm> {
        self.judge.as_ref().map(|judge| &judge.alarm)
    }

    /// How many threads scan the map, the caller's own among them.
    pub fn threads(&self) -> usize {
        let threads = |technique: &Technique| technique.pool.as_ref().map_or(1, Pool::threads);
        self.techniques.iter().map(threads).max().unwrap_or(1)
    }

    fn with_matcher(maps: Vec<Arc<Map>>, mut matcher: Matcher) -> Result<Self, Error> {
        let fusion = match maps.len() {
            1 if matcher.config().technique_weights.len() <= 1 => None,
            count => Some(Fusion::new(count, matcher.places(), matcher.config())?),
        };
        let screening = match &maps[..] {
            // The tracker and the fusion need all distances: bounds would only be work before them.
            // So does the mean that stands for places which show nothing.
            [map]
                if map.codes().is_some()
                    && map.blank().is_empty()
                    && !map.has_several()
                    && map.dim() >= screening::SHORTEST
                    && matcher.config().motion.is_none() =>
            {
                Some(Box::new(Screening::new(map, &mut matcher)?))
            }
            _ => None,
        };
        let techniques = maps.into_iter().map(Technique::new).collect();
        Ok(Self { techniques, fusion, matcher, screening, judge: None, told: None })
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
        let image = Input::Image(image.into());
        self.push_each(|_| image, given)
    }

    /// [`push_descriptor`](Self::push_descriptor), with what else is known about the frame.
    ///
    /// # Errors
    /// As for [`push_descriptor`](Self::push_descriptor), and for an advance that is not finite;
    /// [`Error::Length`] if there are several maps.
    pub fn push_descriptor_with<'a>(
        &mut self,
        descriptor: impl Into<View<'a>>,
        given: Given,
    ) -> Result<Fix, Error> {
        self.push_inputs(&[Input::Descriptor(descriptor.into())], given)
    }

    /// Localizes by an image or a descriptor for each map, in their order.
    ///
    /// # Errors
    /// [`Error::Length`] unless there is one for each map, and those of
    /// [`push_image`](Self::push_image) and [`push_descriptor`](Self::push_descriptor). The
    /// localizer is then as it was.
    pub fn push_inputs(&mut self, inputs: &[Input<'_>], given: Given) -> Result<Fix, Error> {
        let (expected, got) = (self.techniques.len(), inputs.len());
        if expected != got {
            return Err(Error::Length { what: "inputs, one for each map", expected, got });
        }
        self.push_each(|technique| inputs[technique], given)
    }

    fn push_each<'a>(
        &mut self,
        input: impl Fn(usize) -> Input<'a>,
        given: Given,
    ) -> Result<Fix, Error> {
        given.check()?;
        let Self { techniques, fusion, matcher, screening, judge, told } = self;
        let fix = match (fusion, &mut techniques[..], screening) {
            (None, [one], Some(screening)) => {
                let (query, scan) = one.query(input(0))?;
                screening.push(matcher, query, scan, given)
            }
            (None, [one], None) => {
                let (query, mut scan) = one.query(input(0))?;
                scan.run(query);
                matcher.push_with(scan.column, given)
            }
            (fusion, techniques, _) => {
                for (index, technique) in techniques.iter_mut().enumerate() {
                    let (query, mut scan) = technique.query(input(index))?;
                    scan.run(query);
                }
                let Some(fusion) = fusion else { return Err(wrong_number(techniques.len())) };
                fusion.fuse(|technique| &techniques[technique].column[..])?;
                matcher.push_column(fusion.column(), given, &mut ())
            }
        }?;
        for (index, technique) in techniques.iter_mut().enumerate() {
            if let Input::Descriptor(_) = input(index) {
                technique.queries.commit();
            }
        }
        Ok(match judge {
            Some(judge) => judge.judge(fix, told.as_ref()),
            None => fix,
        })
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
    /// a gap. On a map with a screen, those that were not needed for the fix are computed now. Of
    /// several maps, the mean of their standardised distances.
    pub fn distances(&mut self) -> &[f32] {
        let Self { techniques, matcher, screening, .. } = self;
        let Technique { map, column, pool, .. } = &mut techniques[0];
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
            None => self.techniques.iter().map(|technique| technique.map.rows()).sum(),
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

    /// A gap, of a known advance if there is one.
    pub(crate) fn gap_of(&mut self, advance: Option<f64>) -> Result<(), Error> {
        if let Some(advance) = advance {
            return self.gap_with_advance(advance);
        }
        self.gap();
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
        for Technique { map, queries, .. } in &mut self.techniques {
            queries.reset(map);
        }
        if let Some(fusion) = &mut self.fusion {
            fusion.reset();
        }
        if let Some(judge) = &mut self.judge {
            judge.alarm.reset();
        }
    }

    /// The state as bytes, without the map; [`restore`](Self::restore) goes on from it
    /// bit-identically. It is the same whether the map has a screen or not, so that either can go
    /// on from it; with a screen, all distances of the window are computed for it.
    ///
    /// # Errors
    /// As for [`Matcher::snapshot`].
    pub fn snapshot(&self) -> Result<Vec<u8>, Error> {
        let running = self.techniques.iter().flat_map(|technique| technique.queries.running());
        let running = running.map(Running::snapshot).collect::<Result<Vec<_>, _>>()?;
        let map = Some(fingerprint(self.techniques.iter().map(|technique| &technique.map)));
        match &self.screening {
            None => self.matcher.save(map, &running, self.fusion.as_ref()),
            Some(screening) => {
                let mut matcher = self.matcher.clone();
                screening.resolve(&mut matcher, &self.techniques[0].map, &mut None);
                matcher.save(map, &running, None)
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
        Self::restore_fused(vec![map], snapshot, expected)
    }

    /// [`restore`](Self::restore), of a localizer on several maps.
    ///
    /// # Errors
    /// As for [`restore`](Self::restore) and [`fused`](Self::fused).
    pub fn restore_fused(
        maps: Vec<Arc<Map>>,
        snapshot: &[u8],
        expected: Option<&Config>,
    ) -> Result<Self, Error> {
        let segments = one_route(&maps)?;
        let owner = Owner { fingerprint: fingerprint(&maps), segments };
        let saved = load(snapshot, expected, Some(&owner))?;
        let running = saved.running.iter().map(|running| Running::restore(running));
        let mut running = running.collect::<Result<Vec<_>, _>>()?.into_iter();
        let mut localizer = Self::with_matcher(maps, saved.matcher)?;
        let whole = localizer.techniques.iter_mut().all(|one| one.queries.resume(&mut running));
        let fused = match &mut localizer.fusion {
            Some(fusion) => fusion.resume(saved.techniques),
            None => saved.techniques.is_empty(),
        };
        if !(whole && fused && running.next().is_none()) {
            let reason = "damaged: statistics of another drive than the map's".to_owned();
            return Err(Error::Snapshot { reason });
        }
        Ok(localizer)
    }

    /// The map, the first if there are several.
    pub fn map(&self) -> &Arc<Map> {
        &self.techniques[0].map
    }

    /// The maps, one for each technique.
    pub fn maps(&self) -> impl ExactSizeIterator<Item = &Arc<Map>> {
        self.techniques.iter().map(|technique| &technique.map)
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

/// The segments of the first of some techniques' maps.
///
/// # Errors
/// [`Error::Option`] for no map or more than 32, or for different segments; [`Error::Length`] unless
/// all have one number of places.
pub(crate) fn one_route(maps: &[Arc<Map>]) -> Result<&Segments, Error> {
    let Some(first) = maps.first().filter(|_| maps.len() <= MAX_TECHNIQUES) else {
        return Err(wrong_number(maps.len()));
    };
    let expected = first.places();
    if let Some(other) = maps.iter().find(|map| map.places() != expected) {
        let what = "places of a map, as of the first";
        return Err(Error::Length { what, expected, got: other.places() });
    }
    if maps.iter().any(|map| map.segments() != first.segments()) {
        let expected = "maps of the same segments, links among them".to_owned();
        let got = "maps of different ones".to_owned();
        return Err(Error::Option { name: "maps", expected, got });
    }
    Ok(first.segments())
}

fn wrong_number(got: usize) -> Error {
    let expected = format!("1 to {MAX_TECHNIQUES} maps");
    Error::Option { name: "maps", expected, got: got.to_string() }
}

/// What identifies the maps of a snapshot.
fn fingerprint<'a>(maps: impl IntoIterator<Item = &'a Arc<Map>>) -> u64 {
    maps.into_iter().fold(0, |all, map| all.rotate_left(1) ^ map.fingerprint())
}

/// The pool that suits the map's size; `None` for one thread.
fn automatic(map: &Arc<Map>) -> Option<Pool> {
    let threads = threads_for(map);
    (threads > 1).then(|| Pool::at_most(map, threads))
}
