//! Loop closure on a map that grows (method 1.14): each frame is compared with the places before
//! it, and becomes a place.

mod config;
mod edges;
mod memory;

use serde::{Deserialize, Serialize};

use crate::descriptor::{Describer, Sad};
use crate::distance::Metric;
use crate::dtype::Dtype;
use crate::error::Error;
use crate::image::ImageView;
use crate::localizer::Input;
use crate::map::{GrowingMap, Map, Recipe};
use crate::method::{Given, LoopFilter, Track};
use crate::numbers::{Values, View};
use crate::segments::Segments;
use crate::simd::Isa;
pub use config::LoopConfig;
pub use edges::{Graph, Poses};

/// The newest places that a frame is compared with make no edge: if one of them is the most like
/// it, those after it, which are left out, may be more so.
const AT_THE_END: usize = 5;
/// Places of a loop follow each other if they are at most this far apart.
const FOLLOWING: usize = 5;

/// What a [`LoopCloser`] says of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LoopClosure {
    /// The number of the frame, from 0. As a place it has the same number, unless the loop closer
    /// is [frozen](LoopCloser::freeze).
    pub frame: u64,
    /// The most probable place, an earlier frame's number; 0 as long as there are not two to
    /// compare with.
    pub place: usize,
    /// The belief that the robot is within `tolerance` places of it: 0 as long as there are not two
    /// to compare with.
    pub confidence: f64,
    /// The belief that the robot is at none of the earlier places, as it nearly always is.
    pub off_map: f64,
    /// Whether it is an edge: the loop is closed between `frame` and `place`.
    pub edge: bool,
    /// Whether the frame shows nothing. It becomes a place, and no edge leads from it or to it.
    pub blank: bool,
}

/// Closes loops on a road without a map: each frame is compared with all places but the newest
/// [`exclude`](LoopConfig::exclude), and then becomes a place itself. The filter is that of
/// [`Localizer`](crate::Localizer)'s track, on a route that grows; the robot begins off the map,
/// and most of the time is.
///
/// The cost of a push grows with the places, as a scan does. To append one costs the same however
/// many there are: rows go into blocks of 1 MB that never move. Memory is taken for a block of rows
/// at a time, and for the belief twice as much as before at a time; in between, a push allocates
/// nothing, nor does it within what was [reserved](Self::reserve). [`bytes`](Self::bytes) says how
/// much is in use. Before a limit ([`LoopConfig::memory`]) is passed, the oldest blocks go to a
/// file, from which each push reads them. One thread does all of it.
///
/// ```
/// use surefix::{LoopCloser, LoopConfig, Metric};
/// // A circle of 40 places, driven twice.
/// let view = |frame: usize| -> Vec<f32> {
///     (0..64_usize).map(|at| ((frame % 40 * 64 + at) * 7919 % 1009) as f32).collect()
/// };
/// let mut config = LoopConfig::default();
/// config.exclude = 10;
/// let mut closer = LoopCloser::of_descriptors(64, Metric::Euclidean, config)?;
/// for frame in 0..80 {
///     closer.push_descriptor(view(frame).as_slice())?;
/// }
/// let last = closer.edges().last().expect("an edge");
/// assert_eq!((last.frame, last.place), (79, 39));
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Debug)]
pub struct LoopCloser {
    config: LoopConfig,
    map: GrowingMap,
    filter: LoopFilter,
    /// Describes images, if it takes any.
    describer: Option<(Describer, Values)>,
    /// The newest frame's distances to the places that it was compared with.
    column: Vec<f32>,
    edges: Vec<LoopClosure>,
    /// The first place after each gap.
    breaks: Vec<usize>,
    gap: bool,
    frames: u64,
    frozen: bool,
    /// The place of the newest frame, and how many in a row were sure of places that follow each
    /// other.
    sure: (usize, usize),
}

impl LoopCloser {
    /// Of images, which `sad` describes.
    ///
    /// # Errors
    /// [`Error::Option`] for an option outside its range, a limit of memory among them that is
    /// too low for the first places; [`Error::Memory`] if there is not enough.
    pub fn of_images(sad: Sad, config: LoopConfig) -> Result<Self, Error> {
        let describer = (Describer::new(sad), Values::zeros(sad.dtype(), sad.dim()));
        let kind = (Recipe::Sad(sad), sad.dim(), sad.dtype(), Metric::Manhattan);
        Self::new(kind, Some(describer), config)
    }

    /// Of ready float32 descriptors of `dim` numbers.
    ///
    /// # Errors
    /// As for [`of_images`](Self::of_images); [`Error::Option`] for a `dim` of 0.
    pub fn of_descriptors(dim: usize, metric: Metric, config: LoopConfig) -> Result<Self, Error> {
        const LONGEST: usize = 1 << 24;
        if !(1..=LONGEST).contains(&dim) {
            let expected = format!("a whole number from 1 to {LONGEST}");
            return Err(Error::Option { name: "dim", expected, got: dim.to_string() });
        }
        Self::new((Recipe::Ready, dim, Dtype::F32, metric), None, config)
    }

    fn new(
        (recipe, dim, dtype, metric): (Recipe, usize, Dtype, Metric),
        describer: Option<(Describer, Values)>,
        config: LoopConfig,
    ) -> Result<Self, Error> {
        config.validate()?;
        let mut closer = Self {
            map: GrowingMap::new(recipe, dim, dtype, metric, config.folder.clone()),
            filter: LoopFilter::new(&config.motion, config.tolerance)?,
            describer,
            column: Vec::new(),
            edges: Vec::new(),
            breaks: Vec::new(),
            gap: false,
            frames: 0,
            frozen: false,
            sure: (0, 0),
            config,
        };
        closer.make_room().map_err(|error| match error {
            Error::MemoryLimit { limit, .. } => {
                let least = closer.bytes_of_the_first();
                let expected = format!("at least {least} bytes, for the first places");
                Error::Option { name: "memory", expected, got: limit.to_string() }
            }
            other => other,
        })?;
        Ok(closer)
    }

    /// The same on another instruction set than the best one; the answers are the same to the last
    /// bit.
    ///
    /// # Errors
    /// [`Error::Option`] for one that this processor lacks.
    pub fn with_isa(mut self, isa: Isa) -> Result<Self, Error> {
        let isa = isa.checked()?;
        self.map.set_isa(isa);
        self.filter.set_isa(isa);
        Ok(self)
    }

    /// Takes a camera image.
    ///
    /// # Errors
    /// As for [`push`](Self::push).
    pub fn push_image<'a>(
        &mut self,
        image: impl Into<ImageView<'a>>,
    ) -> Result<LoopClosure, Error> {
        self.push(Input::Image(image.into()), None)
    }

    /// Takes a descriptor.
    ///
    /// # Errors
    /// As for [`push`](Self::push).
    pub fn push_descriptor<'a>(
        &mut self,
        descriptor: impl Into<View<'a>>,
    ) -> Result<LoopClosure, Error> {
        self.push(Input::Descriptor(descriptor.into()), None)
    }

    /// Takes a frame, compares it with the places, and makes it one. `advance` is how many places
    /// the robot has moved since the frame before, by odometry, if that is known: as frames are
    /// places, in frames of its usual speed.
    ///
    /// # Errors
    /// [`Error::NoDescriptor`] for an image if descriptors are expected; [`Error::Length`],
    /// [`Error::Dtype`], [`Error::NotFinite`] and [`Error::NoDirection`] for a descriptor that does
    /// not fit; [`Error::Option`] for an advance that is not finite; [`Error::MemoryLimit`],
    /// [`Error::Memory`] and [`Error::Io`] if there is no room for the place. It is then as it was.
    pub fn push(&mut self, input: Input<'_>, advance: Option<f64>) -> Result<LoopClosure, Error> {
        advance.map_or(Ok(()), |advance| Given::default().advance(advance).check())?;
        if !self.frozen {
            self.make_room()?;
        }
        let places = self.compared();
        let Self { config, map, filter, describer, column, edges, breaks, .. } = self;
        let numbers = match input {
            Input::Descriptor(numbers) => numbers,
            Input::Image(image) => {
                let Some((describer, values)) = describer else {
                    return Err(Error::NoDescriptor);
                };
                describer.describe(image, values)?;
                values.view()
            }
        };
        let query = map.query(numbers)?;
        let blank = map.shows_nothing(numbers);
        column.resize(places, 0.0);
        map.scan(query, column)?;

        // From here on, nothing fails.
        while filter.places() < places {
            filter.grow(breaks.binary_search(&filter.places()).is_ok());
        }
        let (mut place, mut confidence, mut off_map) = (0, 0.0, 1.0);
        if places >= 2 {
            let track: Track = filter.push(column, advance);
            (place, confidence, off_map) = (track.place, track.confidence, track.off_map);
        }
        let (before, count) = self.sure;
        let follows = place.abs_diff(before) <= FOLLOWING;
        let closes = confidence >= config.confidence && place + AT_THE_END < places;
        let count = if closes { 1 + if follows { count } else { 0 } } else { 0 };
        self.sure = (place, count);
        let edge = count >= config.lasting && !blank && !map.is_blank(place);
        let answer = LoopClosure { frame: self.frames, place, confidence, off_map, edge, blank };
        if edge {
            edges.push(answer);
        }
        if !self.frozen {
            if std::mem::take(&mut self.gap) && map.rows() > 0 {
                breaks.push(map.rows());
            }
            map.append(query);
        }
        self.frames += 1;
        Ok(answer)
    }

    /// How many places the next frame is compared with.
    fn compared(&self) -> usize {
        let old = self.frames.saturating_sub(self.config.exclude as u64);
        self.map.rows().min(usize::try_from(old).unwrap_or(usize::MAX))
    }

    /// Says that the next frame does not follow on the one before. The robot may be anywhere, and
    /// most likely at no earlier place; among the places, a new segment begins, for which memory
    /// is taken.
    pub fn gap(&mut self) {
        self.filter.gap();
        self.gap = true;
        self.sure = (0, 0);
    }

    /// A [`gap`](Self::gap) in which the robot moved by `advance` places: the belief goes on from
    /// there.
    ///
    /// # Errors
    /// [`Error::Option`] for an advance that is not finite. It is then as it was.
    pub fn gap_with_advance(&mut self, advance: f64) -> Result<(), Error> {
        Given::default().advance(advance).check()?;
        self.filter.moved(advance);
        self.gap = true;
        Ok(())
    }

    /// From now on, frames are compared, and no longer become places: if there is no memory for
    /// more.
    pub fn freeze(&mut self) {
        self.frozen = true;
    }

    /// Whether frames no longer become places.
    pub fn is_frozen(&self) -> bool {
        self.frozen
    }

    /// Forgets all frames, places and edges, and goes on at frame 0. Of the memory, what is
    /// [reserved](Self::reserve) for the belief is kept.
    ///
    /// # Errors
    /// [`Error::Option`] and [`Error::Memory`] as for a new one. It is then as it was.
    pub fn reset(&mut self) -> Result<(), Error> {
        let kind = (self.map.recipe(), self.map.dim(), self.map.dtype(), self.map.metric());
        let isa = self.map.isa();
        let fresh = Self::new(kind, None, self.config.clone())?.with_isa(isa)?;
        let describer = self.describer.take();
        *self = Self { describer, ..fresh };
        Ok(())
    }

    /// All edges so far, in the order of their frames.
    pub fn edges(&self) -> &[LoopClosure] {
        &self.edges
    }

    /// How many frames it has taken.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// How many places there are: a frame each, until it is frozen.
    pub fn places(&self) -> usize {
        self.map.rows()
    }

    /// The numbers of a descriptor.
    pub fn dim(&self) -> usize {
        self.map.dim()
    }

    /// How the places' descriptors are made.
    pub fn recipe(&self) -> Recipe {
        self.map.recipe()
    }

    /// How descriptors are compared.
    pub fn metric(&self) -> Metric {
        self.map.metric()
    }

    /// Its options.
    pub fn config(&self) -> &LoopConfig {
        &self.config
    }

    /// The distances of the newest frame to the places that it was compared with.
    pub fn distances(&self) -> &[f32] {
        &self.column
    }

    /// The belief in each of the places that the newest frame was compared with. With
    /// [`LoopClosure::off_map`], it sums to 1.
    pub fn belief(&self) -> impl Iterator<Item = f64> {
        self.filter.belief()
    }

    /// All places as a map: for a [`Localizer`](crate::Localizer), or to be saved. A gap is a break
    /// of its route. Rows in full blocks are shared with it, and count here still; those in the
    /// file are read into memory, whatever the limit.
    ///
    /// ```
    /// use surefix::{LoopCloser, LoopConfig, Metric};
    /// let mut closer = LoopCloser::of_descriptors(2, Metric::Euclidean, LoopConfig::default())?;
    /// for row in [[0.0_f32, 1.0], [1.0, 1.0], [2.0, 1.0]] {
    ///     closer.push_descriptor(&row[..])?;
    /// }
    /// assert_eq!(closer.to_map()?.places(), 3);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::TooFewPlaces`] below two places; [`Error::Io`] if the file cannot be read.
    pub fn to_map(&mut self) -> Result<Map, Error> {
        let segments = Segments::new(self.map.rows(), &self.breaks)?;
        self.map.to_map(segments)
    }
}
