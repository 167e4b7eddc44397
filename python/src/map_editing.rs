//! `surefix.Map`: how places follow each other, and maps of some of a map's places or of several
//! maps.

use std::sync::Arc;

use pyo3::prelude::*;

use crate::batch::indices;
use crate::error::{OrRaise as _, if_it_can, value};
use crate::map::Map;
use crate::options::{whole, wrong};
use crate::segments::{Segments, given_segments};
use crate::signals::detached;

#[pymethods]
impl Map {
    /// How the places follow each other: ``Segments``.
    #[getter]
    fn segments(&self) -> Segments {
        Segments(self.0.segments().clone())
    }

    /// The same map, whose places follow each other as ``segments`` say.
    ///
    /// Parameters
    /// ----------
    /// segments : Segments
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     Unless they have this map's number of places.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> route = surefix.Map.from_descriptors(np.eye(8, dtype=np.float32), breaks=[5])
    /// >>> segments = surefix.Segments(8, breaks=[5], closed=[0], links=[(4, 5)])
    /// >>> route.with_segments(segments).segments
    /// Segments(8 places, 2 segments, 1 closed, 1 links)
    fn with_segments(&self, py: Python<'_>, segments: &Bound<'_, PyAny>) -> PyResult<Self> {
        let Some(given) = given_segments(Some(segments))? else {
            return wrong("segments", "surefix.Segments", segments);
        };
        let map = surefix::Map::clone(&self.0);
        Ok(Self(Arc::new(map.with_segments(given).or_raise(py)?)))
    }

    /// The places from ``start`` to before ``stop``, as a map of their own. It shares the memory of
    /// this map's rows. A closed segment that is cut becomes open, and links to places that are left
    /// out are no more. ``cut`` is the same.
    ///
    /// Parameters
    /// ----------
    /// start, stop : int
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     Unless this map has these places, or for less than two.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> route = surefix.Map.from_descriptors(np.eye(5, dtype=np.float32))
    /// >>> len(route.slice(1, 4))
    /// 3
    fn slice(
        &self,
        py: Python<'_>,
        start: &Bound<'_, PyAny>,
        stop: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let (start, stop) = (whole("start", start)?, whole("stop", stop)?);
        Ok(Self(Arc::new(detached(py, || self.0.slice(start..stop))?)))
    }

    /// The same map without the places that show nothing (``blank``). Those after them move up,
    /// within the same segments, as for ``keep``. If 5 places or more that follow each other show
    /// nothing, as in a tunnel, a new segment begins after them, with a link to it from the place
    /// before: the road goes on, and the track may follow.
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     If fewer than two places are left.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> images = np.random.default_rng(0).integers(0, 255, (5, 48, 96), np.uint8)
    /// >>> images[2] = 0
    /// >>> route = surefix.Map.from_images(images)
    /// >>> route.blank, len(route.without_blank())
    /// (array([2]), 4)
    pub(crate) fn without_blank(&self, py: Python<'_>) -> PyResult<Self> {
        Ok(Self(Arc::new(detached(py, || self.0.without_blank())?)))
    }

    /// The same as ``slice``.
    ///
    /// Parameters
    /// ----------
    /// start, stop : int
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     As for ``slice``.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> route = surefix.Map.from_descriptors(np.eye(5, dtype=np.float32), closed=True)
    /// >>> route.cut(1, 4).segments[0]
    /// Segment(0, 3)
    fn cut(
        &self,
        py: Python<'_>,
        start: &Bound<'_, PyAny>,
        stop: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        self.slice(py, start, stop)
    }

    /// Some of the places, one by one: the others are thinned out, so that the places before and
    /// after one that is left out follow each other. Rows are shared if most lie in long runs, else
    /// copied.
    ///
    /// A closed segment stays closed; if it keeps fewer than 3 places, it becomes open. The ends of
    /// links move to the nearest place of their segment that is kept; a segment without such a
    /// place is no more, and neither are its links.
    ///
    /// Parameters
    /// ----------
    /// places : array of int, shape (k,)
    ///     In ascending order.
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     Unless the places ascend within this map, or for less than two.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> route = surefix.Map.from_descriptors(np.eye(9, dtype=np.float32), breaks=[5])
    /// >>> route.keep([0, 2, 4, 6, 8]).segments.breaks
    /// array([3])
    fn keep(&self, py: Python<'_>, places: &Bound<'_, PyAny>) -> PyResult<Self> {
        let places = indices(places, "places", "places")?;
        Ok(Self(Arc::new(detached(py, || self.0.keep(&places))?)))
    }

    /// The map with places about ``metres`` apart: of each segment the first, and each that is at
    /// least ``metres`` from the last one kept, straight. A vehicle's stops become one place. The
    /// rest is as for ``keep``.
    ///
    /// Parameters
    /// ----------
    /// metres : float
    ///     0 keeps all places.
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For a map without positions, a negative distance, or if one place is left.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> metres = [[0, 0], [0.4, 0], [1.1, 0], [1.2, 0], [2.2, 0]]
    /// >>> route = surefix.Map.from_descriptors(np.eye(5, dtype=np.float32), positions=metres)
    /// >>> route.thin(1.0).positions[:, 0]
    /// array([0. , 1.1, 2.2])
    fn thin(&self, py: Python<'_>, metres: f64) -> PyResult<Self> {
        Ok(Self(Arc::new(detached(py, || self.0.thin(metres))?)))
    }

    /// Maps one after the other, as one: each begins a new segment, closed segments stay closed,
    /// and links stay. Rows are shared. Positions around another origin are moved to the plane of
    /// the first map's. Thumbnails stay if all maps have them, of one size.
    ///
    /// Parameters
    /// ----------
    /// maps : iterable of Map
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For no map; unless all have descriptors of one length, type, metric and recipe that went
    ///     through the same post-processing, all or none have names, and all or none have
    ///     positions, of one number of coordinates and one kind of plane. The error names the map
    ///     by its index.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> road = surefix.Map.from_descriptors(np.eye(4, dtype=np.float32))
    /// >>> ring = surefix.Map.from_descriptors(np.eye(4, dtype=np.float32)[1:], closed=True)
    /// >>> list(surefix.Map.join([road, ring]).segments)
    /// [Segment(0, 4), Segment(4, 7, closed=True)]
    #[staticmethod]
    fn join(maps: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = maps.py();
        let refused = |got: &Bound<'_, PyAny>| {
            let got =
                got.get_type().name().map_or_else(|_| "?".to_owned(), |name| name.to_string());
            value(py, format!("maps: expected an iterable of surefix.Map, got {got}"))
        };
        if maps.is_instance_of::<Self>() {
            return Err(refused(maps));
        }
        let each = if_it_can(py, maps.try_iter())?.ok_or_else(|| refused(maps))?.map(|given| {
            let given = given?;
            given.cast::<Self>().map(|map| Arc::clone(&map.get().0)).map_err(|_| refused(&given))
        });
        let maps = each.collect::<PyResult<Vec<_>>>()?;
        let maps: Vec<&surefix::Map> = maps.iter().map(Arc::as_ref).collect();
        Ok(Self(Arc::new(detached(py, || surefix::Map::join(&maps))?)))
    }

    /// The places of this map and then those of ``more``: the map that all their descriptors at
    /// once would have made. Neither changes. Thumbnails stay if both have them, of one size.
    ///
    /// Parameters
    /// ----------
    /// more : Map
    ///     A map of the same kind, with names and positions if this one has them.
    /// new_segment : bool
    ///     By default the last segment goes on with the first one of ``more``. True begins a new
    ///     one, as ``join`` does.
    ///
    /// Returns
    /// -------
    /// Map
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     If they differ in type, length, metric or recipe, or one has names or positions and
    ///     the other has none; if a closed segment would have to go on.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, surefix
    /// >>> half = surefix.Map.from_descriptors(np.eye(3, dtype=np.float32))
    /// >>> len(half.extended(half))
    /// 6
    #[pyo3(signature = (more, *, new_segment=false))]
    fn extended(&self, py: Python<'_>, more: &Self, new_segment: bool) -> PyResult<Self> {
        let (first, more) = (&self.0, &more.0);
        let longer = detached(py, || {
            if new_segment { surefix::Map::join(&[first, more]) } else { first.extended(more) }
        })?;
        Ok(Self(Arc::new(longer)))
    }
}
