"""The compiled part of surefix.

Docstrings are copied from the binary by `make stubs`; stubtest holds the signatures to it.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from collections.abc import Sequence as _Sequence
from os import PathLike
from pathlib import Path as _RealPath
from typing import (
    Any,
    ClassVar,
    Literal,
    Protocol,
    SupportsIndex,
    TypeAlias,
    Unpack,
    final,
    overload,
)

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes as _Axes

from surefix.motion import Motion
from surefix.options import Options

__version__: str
__all__ = [
    "Alarm",
    "Alignment",
    "Evaluation",
    "Fix",
    "FixStream",
    "Localizer",
    "LoopCloser",
    "LoopClosure",
    "Map",
    "MapTraverse",
    "Matcher",
    "Peak",
    "Position",
    "Post",
    "Route",
    "Run",
    "Running",
    "Sad",
    "Segment",
    "Segments",
    "Sequence",
    "Settings",
    "Shard",
    "ShardDriver",
    "Single",
    "Threshold",
    "Track",
    "Traverse",
    "Trust",
    "_AtomicFile",
    "_AtomicFolder",
    "__version__",
    "_is_stream",
    "align",
    "block_length",
    "calibrate",
    "decode_image",
    "described",
    "evaluate",
    "evaluate_trust",
    "find_images",
    "fit_post",
    "image_files",
    "instruction_set",
    "judged",
    "match",
    "match_distances",
    "max_pixels",
    "read_image",
    "recall_at",
    "set_max_pixels",
    "thumbnail",
]

class _HasArray(Protocol):
    def __array__(self, *args: Any, **kwargs: Any) -> npt.NDArray[Any]: ...

class _HasDlpack(Protocol):
    def __dlpack__(self, *args: Any, **kwargs: Any) -> Any: ...

class _Matches(Protocol):
    @property
    def place(self) -> npt.NDArray[np.int64]: ...
    @property
    def score(self) -> npt.NDArray[np.float32]: ...
    @property
    def ready(self) -> npt.NDArray[np.bool_] | None: ...
    @property
    def accepted(self) -> npt.NDArray[np.bool_] | None: ...

class _Frame(Protocol):
    @property
    def image(self) -> _Array | _Path: ...
    @property
    def gap(self) -> bool: ...
    @property
    def dropped(self) -> int: ...

class _Descriptor(Protocol):
    @property
    def name(self) -> str: ...
    @property
    def recipe(self) -> Mapping[str, object]: ...
    def describe(self, images: _Sequence[npt.NDArray[np.uint8]], /) -> npt.NDArray[np.float32]: ...

_Array: TypeAlias = npt.NDArray[Any] | _HasArray | _HasDlpack | _Sequence[Any]
_Path: TypeAlias = str | PathLike[str]
_Progress: TypeAlias = Callable[[int, int], bool | None] | Literal[False] | None
_Float32: TypeAlias = npt.NDArray[np.float32]
_Float64: TypeAlias = npt.NDArray[np.float64]
_Int64: TypeAlias = npt.NDArray[np.int64]
_Bool: TypeAlias = npt.NDArray[np.bool_]
_Truth: TypeAlias = _Array | list[int] | tuple[npt.ArrayLike, npt.ArrayLike]
_UInt8: TypeAlias = npt.NDArray[np.uint8]
_Stage: TypeAlias = Literal["census", "first", "second"]
_Order: TypeAlias = Literal["name", "decimals", "whole", "time", "exif"] | str

@final
class Single:
    """The best match of one query alone: the smallest distance. Ties go to the lowest place."""

    @property
    def place(self) -> int: ...
    @property
    def distance(self) -> float: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Peak:
    """Where the enhanced gradient peaks (Eqs. 1 and 2, with the 3 x 3 kernel).

    ``place`` is the place whose distance dips most sharply; ``value`` the enhanced gradient there,
    in units of distance.
    """

    @property
    def place(self) -> int: ...
    @property
    def value(self) -> float: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Sequence:
    """The best match of the last ``sequence_length`` queries together (Eqs. 4 to 6).

    ``place`` is the current query's place; ``score`` the mean of the weighted distances along the
    diagonal that ends there; ``anchors`` the number of trusted matches on it; ``speed`` its slope,
    in places a query.
    """

    @property
    def place(self) -> int: ...
    @property
    def score(self) -> float: ...
    @property
    def anchors(self) -> int: ...
    @property
    def speed(self) -> float: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Track:
    """Where the robot is by all queries so far: a Bayes filter over places, speeds and a state off the
    map (method 1.9).

    ``place`` is the most probable place; ``confidence`` the belief that the robot is within
    ``tolerance`` places of it; ``off_map`` the belief that it is off the map, which ranks well and
    is a lower bound as a probability; ``speed`` in places a query, or the advance if it is known;
    ``interval`` the first and the last place of those that hold 95 % of the belief on the map; on
    more than 65,536 places, ends far from ``place`` are rounded outwards, by up to 255 places.
    """

    @property
    def place(self) -> int:
        """The most probable place."""
    @property
    def confidence(self) -> float:
        """The belief that the robot is within ``tolerance`` places of it."""
    @property
    def off_map(self) -> float:
        """The belief that the robot is off the map."""
    @property
    def speed(self) -> float:
        """In places a query; the advance if it is known."""
    @property
    def interval(self) -> tuple[int, int]:
        """The first and the last place of those that hold 95 % of the belief on the map. On a
        closed route it may go round: the first is then the greater.
        """
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Fix:
    """Where the robot is, as far as one query tells, and whether to believe it.

    Attributes
    ----------
    frame : int
        Which query this is, counted from 0 since the start or the last reset.
    trusted : bool
        Whether the single match is trusted (Eq. 3 of the paper), or an external predictor's word.
    blank : bool
        Whether the query shows nothing: an image or a descriptor without content, or distances that
        are all equal. It is never trusted, whatever ``place`` says.
    place : int
        The track's place if there is motion; else the sequence's once it is ready, and before that
        the single match's.
    segment : int
        The index of that place's segment: 0 on a route without breaks.
    segment_place : int
        That place, counted from its segment's first.
    score : float
        The score of that place: ``1 - confidence`` of the track, the sequence's score, or the
        single match's distance. Less is better.
    single : Single
        The best match of this query alone: ``place`` and ``distance``.
    gradient : Peak
        Where the enhanced gradient peaks: ``place`` and ``value``.
    sequence : Sequence or None
        The sequence's match: ``place``, ``score``, ``anchors``, ``speed``. None while the matcher
        warms up, for the first ``sequence_length - 1`` queries, and again after a gap.
    track : Track or None
        Where the robot is by all queries so far: ``place``, ``confidence``, ``off_map``, ``speed``,
        ``interval``. None without the option ``motion``.
    position : Position or None
        Where ``place`` is: ``metres``, and ``degrees`` or None. None on a map without positions.
    accepted : bool or None
        Whether it is above the threshold of a calibration (``Localizer(config=...)``).
    probability : float or None
        How probable it is that the place is right, by that calibration.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> matcher = surefix.Matcher(places=4, sequence_length=1)
    >>> fix = matcher.push(np.array([0.9, 0.1, 0.8, 0.9], np.float32))
    >>> fix.place, fix.trusted, fix.sequence.anchors
    (1, True, 1)
    """

    @property
    def frame(self) -> int:
        """Which query this is, counted from 0."""
    @property
    def trusted(self) -> bool:
        """Whether the single match is trusted."""
    @property
    def blank(self) -> bool:
        """Whether the query shows nothing, so that it can never be trusted."""
    @property
    def segment(self) -> int:
        """The index of that place's segment."""
    @property
    def segment_place(self) -> int:
        """That place, counted from its segment's first."""
    @property
    def place(self) -> int:
        """The track's place, else the sequence's once it is ready, else the single match's."""
    @property
    def score(self) -> float:
        """The score of that place: ``1 - confidence``, the sequence's score, or the single match's
        distance. Less is better.
        """
    @property
    def single(self) -> Single:
        """The best match of this query alone."""
    @property
    def gradient(self) -> Peak:
        """Where the enhanced gradient peaks."""
    @property
    def position(self) -> Position | None:
        """Where ``place`` is: ``metres`` and ``degrees``. None on a map without positions, and of a
        ``Matcher``, which knows no map.
        """

    @property
    def accepted(self) -> bool | None:
        """Whether it is above the threshold of the localizer's settings; None without one."""
    @property
    def probability(self) -> float | None:
        """The probability that the place is right, by the calibration of the localizer's settings;
        None without one, and while the fix is not ready.
        """
    @property
    def sequence(self) -> Sequence | None:
        """The sequence's match; None while the matcher warms up."""
    @property
    def track(self) -> Track | None:
        """Where the robot is by all queries so far; None without the option ``motion``."""
    @property
    def confidence(self) -> float | None:
        """The track's confidence; None without the option ``motion``."""
    @property
    def off_map(self) -> float | None:
        """The track's belief that the robot is off the map; None without the option ``motion``."""
    @property
    def speed(self) -> float | None:
        """The track's speed, else the sequence's slope, in places a query; None in the warm-up."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class MapTraverse:
    """One drive of a map's road: its ``label``, and the ``places`` that it has a row for, int64."""

    @property
    def label(self) -> str:
        """Its name, such as the drive's folder; may be empty."""
    @property
    def places(self) -> _Int64:
        """The places that it covers, in order: int64."""
    @property
    def rows(self) -> int:
        """How many rows it has: one for each place that it covers."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Segment:
    """A stretch of places that follow each other: ``start``, ``end`` (the place after its last) and
    ``closed``, whether its last place is followed by its first.
    """

    @property
    def start(self) -> int:
        """Its first place."""
    @property
    def end(self) -> int:
        """The place after its last."""
    @property
    def closed(self) -> bool:
        """Whether its last place is followed by its first."""
    def __len__(self) -> int: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Segments:
    """How a route's places follow each other: segments, one after the other, that cover all places.

    Gradients, sequences and motion end at the end of a segment. A closed segment has no end: its
    last place is followed by its first. Links are further successors for the tracker's motion, as
    at a junction.

    Parameters
    ----------
    places : int
        The number of places of the route.
    breaks : sequence of int
        The places at which a new segment begins, ascending, from 1 to ``places - 1``.
    closed : bool or sequence of int
        Whether all segments are closed; or the indices of those that are. A closed segment has at
        least 3 places.
    links : array, shape (k, 2)
        Pairs of places: the second may follow the first, beside the one that follows it in its
        segment.

    Raises
    ------
    SurefixValueError
        For breaks that do not ascend within the route, a closed segment of fewer than 3 places or
        that there is not, or a link that leads nowhere, to itself or to the place that follows
        anyway.

    Examples
    --------
    >>> import surefix
    >>> town = surefix.Segments(100, breaks=[60], closed=[1], links=[(59, 60)])
    >>> list(town)
    [Segment(0, 60), Segment(60, 100, closed=True)]
    >>> town.links.tolist()
    [[59, 60]]
    """

    def __new__(
        cls,
        places: SupportsIndex,
        breaks: npt.ArrayLike = (),
        closed: bool | npt.ArrayLike = False,
        links: npt.ArrayLike = (),
    ) -> Segments: ...
    @property
    def places(self) -> int:
        """How many places the route has."""
    @property
    def breaks(self) -> _Int64:
        """The places at which a new segment begins."""
    @property
    def links(self) -> _Int64:
        """The links, array of int64, shape (k, 2)."""
    def keep(self, places: npt.ArrayLike) -> Segments:
        """The segments of a route that keeps only some of its places, as ``Map.keep`` does.

        Parameters
        ----------
        places : array of int, shape (k,)
            In ascending order.

        Returns
        -------
        Segments

        Raises
        ------
        SurefixValueError
            Unless the places ascend within the route, or for none.

        Examples
        --------
        >>> import surefix
        >>> surefix.Segments(10, breaks=[6], links=[(3, 6)]).keep([0, 2, 4, 6, 8]).links
        array([[1, 3]])
        """

    def index_of(self, place: SupportsIndex) -> int:
        """The index of a place's segment.

        Parameters
        ----------
        place : int

        Raises
        ------
        SurefixValueError
            For a place that there is not.
        """
    def are_near(
        self, one: npt.ArrayLike, other: npt.ArrayLike, tolerance: SupportsIndex = 1
    ) -> _Bool:
        """Whether places are near each other: in one segment, and at most ``tolerance`` places apart,
        the shorter way round a closed one.

        Parameters
        ----------
        one, other : array of int, shape (m,)
            Places; any other number, such as the -1 of a query off the map, is near none.
        tolerance : int

        Returns
        -------
        array of bool, shape (m,)

        Raises
        ------
        SurefixValueError
            For arrays of two lengths, or of other than whole numbers.

        Examples
        --------
        >>> import surefix
        >>> town = surefix.Segments(100, breaks=[60], closed=[1])
        >>> town.are_near([59, 60, 3], [60, 99, -1])
        array([False,  True, False])
        """
    def __len__(self) -> int: ...
    def __iter__(self) -> Iterator[Segment]: ...
    def __getitem__(self, index: int, /) -> Segment: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Sad:
    """The SAD descriptor: an image in grey, made small, normalised patch by patch.

    Parameters
    ----------
    size : (int, int)
        Width and height of the small image, in pixels.
    patch : int
        The side of a patch, in pixels; it must divide both sides.
    dtype : {"u8", "f32"}
        "u8" keeps ``clamp(round(128 + 32 z))``: a quarter of the memory, exact integer distances.
        "f32" keeps ``z``.
    levels : (int, int), optional
        The samples of uint16 images that become black and white. A map of such images measures
        them if they are not given, and its queries are described by the map's; without a map, the
        full range is taken. uint8 images are taken as they are.

    Raises
    ------
    SurefixValueError
        For a patch that does not divide the sides, or another dtype.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> sad = surefix.Sad(size=(64, 32), patch=8)
    >>> sad.describe(np.zeros((480, 640, 3), np.uint8)).shape
    (2048,)
    """

    def __new__(
        cls,
        size: tuple[int, int] = (64, 32),
        patch: int = 8,
        dtype: npt.DTypeLike | Literal["u8", "f32"] = "u8",
        levels: tuple[int, int] | None = None,
    ) -> Sad: ...
    def describe(self, image: _Array) -> npt.NDArray[Any]:
        """The image's descriptor.

        Parameters
        ----------
        image : array of uint8 or uint16, shape (H, W) or (H, W, 3) RGB

        Returns
        -------
        array of uint8 or float32, shape (width * height,), row by row

        Raises
        ------
        SurefixValueError
            For another type or shape.
        """
    def shows_nothing(self, image: _Array) -> bool:
        """Whether an image shows nothing: a lens cap, a tunnel, a text on black, whatever describes it.

        Parameters
        ----------
        image : array of uint8, shape (H, W) or (H, W, 3) RGB

        Returns
        -------
        bool
        """
    def thumbnail(self, image: _Array) -> _UInt8:
        """The image that the descriptor normalises: in grey, made small (as Pillow's
        ``convert("L").resize(size, BILINEAR)``).

        Parameters
        ----------
        image : array of uint8 or uint16, shape (H, W) or (H, W, 3) RGB

        Returns
        -------
        array of uint8, shape (height, width) of the descriptor
        """
    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the small image, in pixels."""
    @property
    def patch(self) -> int:
        """The side of a patch, in pixels."""
    @property
    def dim(self) -> int:
        """How many numbers a descriptor has."""
    @property
    def dtype(self) -> Literal["u8", "f32"]:
        """The type of the descriptor's numbers: "u8" or "f32"."""
    @property
    def levels(self) -> tuple[int, int] | None:
        """The samples of uint16 images that become black and white; None if that is not fixed."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Map:
    """A known route: one descriptor a place, in route order, and all that is needed to use them.

    Make one with ``Map.from_images``, ``Map.from_descriptors`` or ``Map.open``. A map does not
    change: many localizers, in many threads, can read one.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> route = surefix.Map.from_descriptors(np.eye(3, dtype=np.float32), metric="cosine")
    >>> len(route), route.dim, route.metric
    (3, 3, 'cosine')
    >>> route.distances(np.array([0, 1, 0], np.float32))
    array([1., 0., 1.], dtype=float32)
    """

    @staticmethod
    def from_images(
        images: _Path | Iterable[_Path] | Iterable[_Array] | _Array | Traverse,
        descriptor: Sad | _Descriptor | None = None,
        *,
        positions: npt.ArrayLike | None = None,
        progress: _Progress = None,
        skip_blank: bool = False,
        metric: Literal["cosine", "euclidean", "manhattan"] | str | None = None,
        post: Post | Iterable[Any] | None = None,
        cache: _Path | None = None,
        levels: tuple[int, int] | None = None,
        skip_bad: bool = False,
        mixed_sizes: bool = False,
        breaks: Iterable[int] | None = None,
        closed: bool | Iterable[int] = False,
        thumbnails: bool | tuple[int, int] = False,
        origin: tuple[float, float] | str | None = None,
    ) -> Map:
        """A map of the descriptors of a traverse's images, described on all cores. Places are named as
        the files are.

        Parameters
        ----------
        images : path, iterable of paths or of uint8 arrays, or an array (n, H, W) or (n, H, W, 3)
            A folder or a pattern like ``"route/*.png"`` is sorted as a person would: ``frame10``
            follows ``frame9``. Files, and the items of a sequence that is no list, are read when it
            is their turn. All images have one size. Files and arrays of more than 8 bits (uint16)
            become 8-bit ones by the map's ``levels``.
        descriptor : Sad or surefix.descriptors.Descriptor, optional
            The recipe; ``Sad()`` by default. With a learned descriptor, images are described by
            ``surefix.descriptors.extract``, a batch at a time, and may have any sizes that it
            takes.
        positions : array, shape (n, 2) or (n, 3), optional
            Where each place is, in planar metres.
        breaks : sequence of int, optional
            The images at which a new segment begins, ascending: the drive jumps there, so that
            gradients, sequences and motion end (``Segments``).
        closed : bool or sequence of int
            Whether all segments are closed, their last place followed by their first; or the
            indices of those that are.
        thumbnails : bool or (int, int)
            Keep a small grey picture of each place in the map, 1 byte a pixel: 96 pixels on the
            longer side (5,184 bytes a place for images of 16 : 9), or of this width and height.
        origin : (float, float) or str, optional
            The plane of the positions: latitude and longitude of the origin of a local one, as of
            ``surefix.datasets.local_metres``; or the name of another, such as "UTM 55S".
        progress : callable, optional
            Called with ``(done, total)``; returning False stops. By default a bar on a terminal;
            False for none.
        skip_blank : bool
            Leave out the places that show nothing, as ``without_blank`` does.
        metric, post : optional
            For a learned descriptor, as for ``from_descriptors``.
        cache : path, optional
            For a learned descriptor: a file from which it goes on after an interruption, as for
            ``extract``.
        levels : (int, int), optional
            The samples of images of more than 8 bits that are black and white; by default they are
            measured on up to 32 of the images.
        skip_bad : bool
            Pass over images that cannot be read, such as half a file, and say so by the logger
            ``surefix``. ``names`` says which are left; positions are still one an image.
        mixed_sizes : bool
            Whether images may differ in size.

        Returns
        -------
        Map

        Raises
        ------
        SurefixValueError
            For an image that cannot be read or has another size (the error names it), or fewer than
            two images; before any is read, for breaks, closed segments, positions or an origin that
            are none of these images; for metric, post or cache with SAD, which has its own metric and needs
            neither.
        SurefixFileError
            If there is no such folder.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> route = surefix.Map.from_images(np.random.default_rng(0).integers(0, 255, (5, 48, 96), np.uint8))
        >>> len(route), route.dim, route.descriptor
        (5, 2048, Sad(size=(64, 32), patch=8, dtype='u8'))
        """
    @staticmethod
    def from_descriptors(
        descriptors: _Array,
        metric: Literal["cosine", "euclidean", "manhattan"] | str = "cosine",
        positions: npt.ArrayLike | None = None,
        names: Iterable[str] | None = None,
        *,
        screen: Literal["i8"] | None = None,
        post: Post | Iterable[Any] | None = None,
        recipe: Mapping[str, Any] | None = None,
        image_size: tuple[int, int] | None = None,
        breaks: Iterable[int] | None = None,
        closed: bool | Iterable[int] = False,
        origin: tuple[float, float] | str | None = None,
    ) -> Map:
        """A map of ready descriptors, from any technique.

        Parameters
        ----------
        descriptors : array, shape (n, dim), of float32, float16, int8 or uint8
            Kept in its own type. Copied once.
        metric : {"cosine", "euclidean", "manhattan"}
            How descriptors are compared; "manhattan" is the mean absolute difference.
        positions : array, shape (n, 2) or (n, 3), optional
            Where each place is, in planar metres.
        names : sequence of str, optional
            A name for each place.
        screen : {"i8"}, optional
            As for ``with_screen``.
        post : list of steps, or a fitted surefix.post.Post, optional
            Post-processing of the float32 descriptors before they are kept, fitted on them; see
            ``surefix.post``. Queries go through the same: from then on ``distances``,
            ``Localizer.push`` and ``match`` take vectors as they are before it.
        recipe : mapping, optional
            The origin of learned descriptors: a mapping that JSON can hold, with a "name".
        image_size : (int, int), optional
            Width and height of the images that were described.
        breaks, closed, origin : optional
            As for ``from_images``.

        Returns
        -------
        Map

        Raises
        ------
        SurefixValueError
            For fewer than two rows, another type, a NaN or an infinity (the error names its row), a
            row of up to 8 zeros under the cosine, or another number of positions or names than of
            rows; as for ``with_screen`` and ``surefix.post.fit``; for a recipe without a name.
        """
    @staticmethod
    def build(
        path: _Path,
        images: _Path | Iterable[_Path] | Iterable[_Array] | _Array | Traverse,
        descriptor: Sad | None = None,
        *,
        positions: npt.ArrayLike | None = None,
        progress: _Progress = None,
        levels: tuple[int, int] | None = None,
        skip_bad: bool = False,
        mixed_sizes: bool = False,
        breaks: Iterable[int] | None = None,
        closed: bool | Iterable[int] = False,
        thumbnails: bool | tuple[int, int] = False,
        origin: tuple[float, float] | str | None = None,
    ) -> None:
        """Makes the map of a traverse's images straight into a file, on all cores: the file that
        ``from_images(...).save(path)`` would write, in the memory of one image a core. Open it
        afterwards.

        The file is written beside its place and then renamed. If it fails, or is stopped,
        nothing is left of it.

        Parameters
        ----------
        path : str or path
            The file to write.
        images, descriptor, positions, progress, levels, skip_bad, mixed_sizes, breaks, closed, thumbnails, origin
            As for ``from_images``. A list of arrays, or an array, is in memory anyway; files, and
            sequences such as a data set's, are not.

        Raises
        ------
        SurefixValueError
            As for ``from_images``.
        SurefixFileError
            If there is no such folder, or the file cannot be written.

        Examples
        --------
        >>> import pathlib, tempfile, surefix.simulate
        >>> drive = surefix.simulate.Route(places=30, size=(64, 32)).reference()
        >>> path = pathlib.Path(tempfile.mkdtemp()) / "route.safetensors"
        >>> surefix.Map.build(path, drive)
        >>> surefix.Map.append(path, drive)
        >>> len(surefix.Map.open(path, mmap=True))
        60
        """
    @staticmethod
    def append(
        path: _Path,
        more: Map | _Path | Iterable[_Path] | Iterable[_Array] | _Array | Traverse,
        descriptor: _Descriptor | None = None,
        *,
        positions: npt.ArrayLike | None = None,
        progress: _Progress = None,
        cache: _Path | None = None,
        skip_bad: bool = False,
        mixed_sizes: bool = False,
        new_segment: bool = False,
    ) -> None:
        """Makes the map in a file longer, without reading its rows into memory. The longer file is
        written beside the old one and then renamed: if it fails, or is stopped, the old one
        stays. It is the file that all places at once would have made.

        Maps that are open stay as they are; a snapshot of a localizer is of the map that it was
        taken on.

        Parameters
        ----------
        path : str or path
            The file of a map.
        more : Map, or images as for ``from_images``
            The places that follow: a map of the same kind, or the images of a drive that goes on,
            if the map was made of images. They are described as those were. Images in arrays are
            numbered on.
        descriptor : surefix.descriptors.Descriptor, optional
            The map's own descriptor, if its descriptors are learned.
        positions : array, shape (m, 2) or (m, 3), optional
            Where the images' places are, in planar metres on the map's plane; needed if the map has
            positions.
        progress : callable, optional
            As for ``from_images``.
        cache : path, optional
            With ``descriptor``, as for ``from_images``.
        skip_bad, mixed_sizes : bool
            As for ``from_images``.
        new_segment : bool
            By default the map's last segment goes on. True begins a new one.

        Raises
        ------
        SurefixValueError
            If the file is not a map, or the places differ from its own in type, length, metric
            or recipe, or one has names or positions and the other has none; if the file has
            thumbnails and a map none of their size; if a closed segment would have to go on; and as
            for ``from_images``.
        SurefixFileError
            If the file cannot be read or written.
        """
    def extended(self, more: Map, *, new_segment: bool = False) -> Map:
        """The places of this map and then those of ``more``: the map that all their descriptors at
        once would have made. Neither changes. Thumbnails stay if both have them, of one size.

        Parameters
        ----------
        more : Map
            A map of the same kind, with names and positions if this one has them.
        new_segment : bool
            By default the last segment goes on with the first one of ``more``. True begins a new
            one, as ``join`` does.

        Returns
        -------
        Map

        Raises
        ------
        SurefixValueError
            If they differ in type, length, metric or recipe, or one has names or positions and
            the other has none; if a closed segment would have to go on.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> half = surefix.Map.from_descriptors(np.eye(3, dtype=np.float32))
        >>> len(half.extended(half))
        6
        """
    @staticmethod
    def open(path: _Path, mmap: bool = False, *, screen: Literal["i8"] | None = None) -> Map:
        """Opens a map that ``save`` or ``build`` wrote.

        Parameters
        ----------
        path : str or path
        mmap : bool
            By default the file is read whole into memory. True maps it instead: a map of gigabytes
            is open in milliseconds, what is used is read when it is used, and processes share the
            memory. The danger: as long as the map lives, no process may change the file in place or
            make it shorter, or the program ends (SIGBUS) or sees other numbers. To replace the
            file, as ``save``, ``build`` and ``append`` do, is safe. A NaN in it is found when a
            frame is pushed, not here; the first ``snapshot`` of a localizer reads the whole file
            once.
        screen : {"i8"}, optional
            As for ``with_screen``: it is not in the file, and making it reads all of it.

        Returns
        -------
        Map

        Raises
        ------
        SurefixFileError
            If the file cannot be read.
        SurefixValueError
            If it is truncated, damaged, not a map, or of a newer version; and as for
            ``with_screen``.
        """
    def with_screen(self, dtype: Literal["i8"]) -> Map:
        """The same map with a screen: a copy of its rows in signed bytes, a quarter more memory; the
        rows are shared. A ``Localizer`` scans those, which says of each distance between which two
        numbers it lies, and looks only at the rows that these leave in doubt. Its answers are those
        that it would give without, to the last bit.

        This pays if the map is larger than the cache and its places differ:
        ``Localizer.looked_at`` says at how many rows a frame made it look. If it does not pay,
        the localizer notices, and scans the rows for a while before it tries again. Rows of fewer
        than 256 numbers are always scanned as they are. A screen is not saved with the map: making
        it takes about as long as a few pushes.

        Parameters
        ----------
        dtype : {"i8"}
            The type of the screen's numbers.

        Returns
        -------
        Map

        Raises
        ------
        SurefixValueError
            For another type, a map of other numbers than float32, the manhattan distance, or too
            little memory.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> rows = np.random.default_rng(0).standard_normal((5000, 512), np.float32)
        >>> route = surefix.Map.from_descriptors(rows).with_screen("i8")
        >>> localizer = surefix.Localizer(route)
        >>> localizer.push(rows[7]).place, localizer.looked_at < 500
        (7, True)
        """
    def save(self, path: _Path) -> None:
        """Saves the map as one safetensors file with everything that it takes to use it. It is written
        beside its place and then renamed: there is never half a file. Symbolic links and the mode
        of an old file stay.

        Raises
        ------
        SurefixFileError
            If the file cannot be written.
        """
    def to_bytes(self) -> bytes:
        """The bytes of the file that ``save`` writes.

        Returns
        -------
        bytes
        """
    @staticmethod
    def from_bytes(data: bytes, screen: Literal["i8"] | None = None) -> Map:
        """A map from the bytes of its file. Maps are pickled this way, too.

        Parameters
        ----------
        data : bytes
        screen : {"i8"}, optional
            As for ``with_screen``.

        Returns
        -------
        Map

        Raises
        ------
        SurefixValueError
            If the bytes are not a map's, are damaged, or of a newer version of the library.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> route = surefix.Map.from_descriptors(np.eye(3, dtype=np.float32))
        >>> surefix.Map.from_bytes(route.to_bytes())
        Map(3 places x 3 float32, cosine, 0.0 MB)
        """
    def verify(self) -> None:
        """Checks a map that was opened with ``mmap=True``: reads its whole file, and compares its
        checksum. A map in memory was checked when it was opened.

        Raises
        ------
        SurefixValueError
            If the file is damaged.
        """
    def slice(self, start: int, stop: int) -> Map:
        """The places from ``start`` to before ``stop``, as a map of their own. It shares the memory of
        this map's rows. A closed segment that is cut becomes open, and links to places that are left
        out are no more. ``cut`` is the same.

        Parameters
        ----------
        start, stop : int

        Returns
        -------
        Map

        Raises
        ------
        SurefixValueError
            Unless this map has these places, or for less than two.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> route = surefix.Map.from_descriptors(np.eye(5, dtype=np.float32))
        >>> len(route.slice(1, 4))
        3
        """
    @property
    def segments(self) -> Segments:
        """How the places follow each other: ``Segments``."""

    def add_traverse(
        self,
        drive: _Path | Iterable[_Path] | Iterable[_Array] | _Array | Traverse | Map,
        alignment: Alignment | None = None,
        *,
        least: float = 0.9,
        motion: Motion | str = "any",
        label: str | None = None,
        descriptor: _Descriptor | None = None,
        progress: _Progress = None,
    ) -> Map:
        """The map with one more drive of its road, such as in another season. A place then has several
        rows, and its distance is the least of theirs, each drive's brought to the same mean (method
        1.14). It is a new map, which shares the rows of this one.

        Of the drive's images, those are kept whose place is sure, and for each place the surest.

        Parameters
        ----------
        drive : images, as for ``Map.from_images``; array of descriptors, shape (m, dim); or Map
            The drive. Images are described as the map's own were, and descriptors go through its
            post-processing. A map must be of the same kind.
        alignment : Alignment, optional
            Of this drive with this map. By default, it is aligned here.
        least : float
            Rows of a smaller confidence are left out.
        motion : {"any", "steady", "free"} or Motion
            As for ``align``, if the drive is aligned here.
        label : str, optional
            The traverse's name; by default that of the folder, or its number.
        descriptor : surefix.descriptors.Descriptor, optional
            On a map of learned descriptors: what describes the images, as for ``match``.
        progress : callable, optional
            As for ``Map.from_images``.

        Returns
        -------
        Map

        Raises
        ------
        SurefixValueError
            For a drive of another number of images than its alignment, an alignment with another
            number of places, descriptors of another length, type, metric, recipe or
            post-processing, a drive of no sure place, or at more than 65 traverses. For a map as
            the drive if this one has post-processing and there is no alignment.

        Examples
        --------
        >>> import surefix
        >>> from surefix.simulate import Route
        >>> road = Route(places=60, size=(128, 64))
        >>> summer = surefix.Map.from_images(road.reference(), progress=False)
        >>> both = summer.add_traverse(road.traverse(season=0.9), label="winter", progress=False)
        >>> len(both), len(both.traverses), both.traverses[1].label
        (60, 2, 'winter')
        >>> both.traverses[1].rows > 50
        True
        """
    @property
    def traverses(self) -> list[MapTraverse]:
        """The drives that the map's rows are of: the first, which has a row for each place, and those
        that were added. A list of ``MapTraverse``.
        """
    def without_traverse(self, index: SupportsIndex) -> Map:
        """The map without one of its traverses. If it is the first, the next that covers all places
        takes its part.

        Parameters
        ----------
        index : int
            Of ``traverses``.

        Returns
        -------
        Map

        Raises
        ------
        SurefixValueError
            For a traverse that there is not, the only one, or the first if no other covers all
            places.
        """
    def with_label(self, label: str) -> Map:
        """The map with a label for its first traverse.

        Parameters
        ----------
        label : str
            At most 1024 bytes.

        Returns
        -------
        Map
        """
    def with_segments(self, segments: Segments) -> Map:
        """The same map, whose places follow each other as ``segments`` say.

        Parameters
        ----------
        segments : Segments

        Returns
        -------
        Map

        Raises
        ------
        SurefixValueError
            Unless they have this map's number of places.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> route = surefix.Map.from_descriptors(np.eye(8, dtype=np.float32), breaks=[5])
        >>> segments = surefix.Segments(8, breaks=[5], closed=[0], links=[(4, 5)])
        >>> route.with_segments(segments).segments
        Segments(8 places, 2 segments, 1 closed, 1 links)
        """

    def cut(self, start: int, stop: int) -> Map:
        """The same as ``slice``.

        Parameters
        ----------
        start, stop : int

        Returns
        -------
        Map

        Raises
        ------
        SurefixValueError
            As for ``slice``.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> route = surefix.Map.from_descriptors(np.eye(5, dtype=np.float32), closed=True)
        >>> route.cut(1, 4).segments[0]
        Segment(0, 3)
        """

    def keep(self, places: npt.ArrayLike) -> Map:
        """Some of the places, one by one: the others are thinned out, so that the places before and
        after one that is left out follow each other. Rows are shared if most lie in long runs, else
        copied.

        A closed segment stays closed; if it keeps fewer than 3 places, it becomes open. The ends of
        links move to the nearest place of their segment that is kept; a segment without such a
        place is no more, and neither are its links.

        Parameters
        ----------
        places : array of int, shape (k,)
            In ascending order.

        Returns
        -------
        Map

        Raises
        ------
        SurefixValueError
            Unless the places ascend within this map, or for less than two.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> route = surefix.Map.from_descriptors(np.eye(9, dtype=np.float32), breaks=[5])
        >>> route.keep([0, 2, 4, 6, 8]).segments.breaks
        array([3])
        """

    def thin(self, metres: float) -> Map:
        """The map with places about ``metres`` apart: of each segment the first, and each that is at
        least ``metres`` from the last one kept, straight. A vehicle's stops become one place. The
        rest is as for ``keep``.

        Parameters
        ----------
        metres : float
            0 keeps all places.

        Returns
        -------
        Map

        Raises
        ------
        SurefixValueError
            For a map without positions, a negative distance, or if one place is left.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> metres = [[0, 0], [0.4, 0], [1.1, 0], [1.2, 0], [2.2, 0]]
        >>> route = surefix.Map.from_descriptors(np.eye(5, dtype=np.float32), positions=metres)
        >>> route.thin(1.0).positions[:, 0]
        array([0. , 1.1, 2.2])
        """

    @staticmethod
    def join(maps: Iterable[Map]) -> Map:
        """Maps one after the other, as one: each begins a new segment, closed segments stay closed,
        and links stay. Rows are shared. Positions around another origin are moved to the plane of
        the first map's. Thumbnails stay if all maps have them, of one size.

        Parameters
        ----------
        maps : iterable of Map

        Returns
        -------
        Map

        Raises
        ------
        SurefixValueError
            For no map; unless all have descriptors of one length, type, metric and recipe that went
            through the same post-processing, all or none have names, and all or none have
            positions, of one number of coordinates and one kind of plane. The error names the map
            by its index.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> road = surefix.Map.from_descriptors(np.eye(4, dtype=np.float32))
        >>> ring = surefix.Map.from_descriptors(np.eye(4, dtype=np.float32)[1:], closed=True)
        >>> list(surefix.Map.join([road, ring]).segments)
        [Segment(0, 4), Segment(4, 7, closed=True)]
        """

    @property
    def origin(self) -> tuple[float, float] | None:
        """Latitude and longitude of the origin of the positions' local plane, in degrees; None if it is
        not known. Metres on this plane are those of ``surefix.datasets.local_metres``.
        """

    @property
    def plane(self) -> str | None:
        """The name of the plane that the positions lie on, such as "UTM 55S"; None if it is not known,
        or a local one around ``origin``.
        """

    @property
    def degrees(self) -> _Float64 | None:
        """Latitude and longitude of each place: shape (n, 2), float64; None if the origin is not known."""

    def with_positions(
        self, positions: npt.ArrayLike, *, origin: tuple[float, float] | str | None = None
    ) -> Map:
        """The same map with a position for each place.

        Parameters
        ----------
        positions : array, shape (n, 2) or (n, 3)
            In planar metres.
        origin : (float, float) or str, optional
            As for ``from_images``.

        Returns
        -------
        Map

        Raises
        ------
        SurefixValueError
            Unless there is a position for each place; for an origin that is none.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> route = surefix.Map.from_descriptors(np.eye(3, dtype=np.float32))
        >>> route = route.with_positions([[0, 0], [0, 60], [0, 120]], origin=(51.5, -0.12))
        >>> route.degrees.round(4)[2]
        array([51.5011, -0.12  ])
        """

    @property
    def thumbnails(self) -> npt.NDArray[np.uint8] | None:
        """A small grey picture of each place, a copy: shape (n, height, width), uint8; None if the map
        keeps none.
        """

    def thumbnail(self, place: int) -> npt.NDArray[np.uint8] | None:
        """The small grey picture of a place, a copy; None if the map keeps none.

        Parameters
        ----------
        place : int

        Returns
        -------
        array of uint8, shape (height, width), or None

        Raises
        ------
        SurefixValueError
            For a place that there is not.
        """

    def with_thumbnails(self, thumbnails: npt.NDArray[np.uint8]) -> Map:
        """The same map with a small grey picture of each place.

        Parameters
        ----------
        thumbnails : array of uint8, shape (n, height, width)

        Returns
        -------
        Map

        Raises
        ------
        SurefixValueError
            For another type or shape, or unless there is a picture for each place.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> route = surefix.Map.from_descriptors(np.eye(3, dtype=np.float32))
        >>> route.with_thumbnails(np.zeros((3, 54, 96), np.uint8)).thumbnail(2).shape
        (54, 96)
        """

    def without_blank(self) -> Map:
        """The same map without the places that show nothing (``blank``). Those after them move up,
        within the same segments, as for ``keep``. If 5 places or more that follow each other show
        nothing, as in a tunnel, a new segment begins after them, with a link to it from the place
        before: the road goes on, and the track may follow.

        Returns
        -------
        Map

        Raises
        ------
        SurefixValueError
            If fewer than two places are left.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> images = np.random.default_rng(0).integers(0, 255, (5, 48, 96), np.uint8)
        >>> images[2] = 0
        >>> route = surefix.Map.from_images(images)
        >>> route.blank, len(route.without_blank())
        (array([2]), 4)
        """
    def distances(
        self,
        queries: _Path | Iterable[_Path] | Iterable[_Array] | _Array | Traverse,
        *,
        descriptor: _Descriptor | None = None,
        progress: _Progress = None,
    ) -> _Float32:
        """The distances from a query to every place, or from many. A place that shows nothing
        (``blank``) has the mean of the others' distances; a query that shows nothing has one distance
        to all.

        Parameters
        ----------
        queries : descriptor, (input_dim,), or image; or several: (m, input_dim), images as for ``match``
            Descriptors are of the map's own type, or of float32 on a map of ready descriptors, and as
            they are before post-processing, if the map has any. Each is taken alone: statistics that
            run along a drive are those of a ``Localizer``, ``match`` and ``Run.distances``. An array
            of two axes is descriptors if its rows are as long as one.
        descriptor : surefix.descriptors.Descriptor, optional
            On a map of learned descriptors: what describes the images.
        progress : callable, optional
            As for ``Map.from_images``.

        Returns
        -------
        array of float32, shape (n,) for one query, (n, m) for several
            SAD distances are in units of ``z``, whatever the type that the map keeps.

        Raises
        ------
        SurefixValueError
            For another length or type, a NaN or an infinity, or up to 8 zeros under the cosine; of
            several queries, the error says which.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> road = surefix.simulate.Route(places=20, seed=1)
        >>> route = surefix.Map.from_images(road.reference())
        >>> route.distances(road.revisit()).shape, route.distances(road.revisit()[3]).shape
        ((20, 20), (20,))
        """
    def plot(self, *, ax: _Axes | None = None, **options: Any) -> _Axes:
        """Draws the route from above, by the map's positions.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default a new figure of ``matplotlib.pyplot``.
        **options
            As for ``surefix.plot.plan``: ``names`` of the segments; ``place=run.place`` draws the
            fixes of a run on it.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        SurefixValueError
            If the map has no positions.
        ModuleNotFoundError
            If matplotlib is not installed.

        Examples
        --------
        >>> route.plot().figure.savefig("plan.png")  # doctest: +SKIP
        """
    def _repr_html_(self) -> str: ...
    def __copy__(self) -> Map: ...
    def __deepcopy__(self, memo: object, /) -> Map: ...
    def __len__(self) -> int: ...
    @property
    def dim(self) -> int:
        """How many numbers a descriptor has."""
    @property
    def input_dim(self) -> int:
        """The length of a query: before post-processing, if the map has any, else ``dim``."""
    @property
    def post(self) -> Post | None:
        """The post-processing of queries and descriptors; None if
        there is nothing.
        """
    @property
    def recipe(self) -> dict[str, Any] | None:
        """Where a learned map's descriptors come from, a dict with a "name"; None if none was given."""
    @property
    def dtype(self) -> np.dtype[Any]:
        """The type of the descriptors' numbers."""
    @property
    def metric(self) -> Literal["cosine", "euclidean", "manhattan"]:
        """How descriptors are compared: "cosine", "euclidean" or "manhattan"."""
    @property
    def screen(self) -> Literal["i8"] | None:
        """The type of the screen's numbers, "i8"; None if the map has no screen."""
    @property
    def descriptor(self) -> Sad | None:
        """The recipe that describes an image; None if the map was made of ready descriptors."""
    @property
    def image_size(self) -> tuple[int, int] | None:
        """Width and height of the images that the map was made of; None if that is not known, or they
        differ. Queries should have the same shape.
        """
    @property
    def levels(self) -> tuple[int, int] | None:
        """The samples of images of more than 8 bits that are black and white, (low, high), for the
        map's images and all queries; None for a map of 8-bit images or ready descriptors.
        """
    @property
    def descriptors(self) -> npt.NDArray[Any]:
        """All descriptors, a copy: shape (n, dim)."""
    @property
    def positions(self) -> _Float64 | None:
        """Where each place is, in planar metres: shape (n, 2) or (n, 3), or None. ``origin`` or
        ``plane`` say on which plane, if that is known.
        """
    @property
    def places_per_metre(self) -> float | None:
        """How many places a robot passes in a metre, by the map's positions
        (``surefix.datasets.places_per_metre``); None without positions. An odometry's metres times
        this are the ``advance`` of ``Localizer.push``.
        """
    @property
    def blank(self) -> _Int64:
        """The places that show nothing, in order: int64. They are SAD descriptors of images with hardly
        any content, ready descriptors of zeros, and those that at least 5 places share; ready
        descriptors of up to 8 numbers are taken as they are. Nothing is matched to such a place.
        """
    @property
    def names(self) -> list[str] | None:
        """A name for each place, or None."""

@final
class Post:
    """A chain of steps of post-processing that has been fitted on references.

    ``surefix.post.fit`` makes one; ``Map.from_descriptors(..., post=[...])`` fits one on the map's
    own rows, and ``Map.post`` is it.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.post import Normalize, Pca, Standardize, fit
    >>> rows = np.random.default_rng(0).standard_normal((50, 8), np.float32)
    >>> chain = fit(rows, [Standardize(), Pca(3), Normalize()])
    >>> chain
    Post(Standardize(), Pca(dim=3, whiten=True), Normalize(), from 8 to 3 numbers)
    >>> chain.apply(rows[:2]).shape
    (2, 3)
    """

    def apply(self, vectors: _Array) -> _Float32:
        """Does the steps to one vector, (input_dim,), or to many, (n, input_dim), as they were done to
        the references. (Statistics of a drive, ``Standardize("running")``, are kept by a
        ``Localizer``, and by ``match``.)

        Returns
        -------
        array of float32, shape (output_dim,) or (n, output_dim)

        Raises
        ------
        SurefixValueError
            For another shape or type than float32, a NaN or an infinity; it names the row.
        """
    @property
    def input_dim(self) -> int:
        """How many numbers a vector has before."""
    @property
    def output_dim(self) -> int:
        """How many numbers a vector has after."""
    @property
    def steps(self) -> list[dict[str, Any]]:
        """The steps, each as it would be asked for: ``{"step": "pca", "dim": 3, "whiten": True}``."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

def fit_post(references: _Array, steps: str) -> tuple[Post, _Float32]:
    """Fits steps, given as JSON, on references (n, dim) of float32. Gives the chain, and the
    references as it makes them.
    """

@final
class Running:
    """Standardises vector after vector by the mean and standard deviation of those that came, the
    newest among them: the statistics that a stream can have of itself (Welford, 1962).

    Parameters
    ----------
    dim : int, optional
        How many numbers a vector has.
    references : array of float32, shape (n, dim), optional
        Instead of ``dim``: begins with their statistics, as if these were one vector. So the first
        vectors of a drive are standardised by the references, and what follows more and more by the
        drive. Without, the first vector becomes zeros.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.post import Running
    >>> running = Running(2)
    >>> [running.push(np.float32(v)).tolist() for v in ([1, 5], [3, 5], [5, 6])]
    [[0.0, 0.0], [1.0, 0.0], [1.2247449159622192, 1.4142135381698608]]
    """

    def __new__(cls, dim: int | None = None, *, references: _Array | None = None) -> Running: ...
    def push(self, vector: _Array) -> _Float32:
        """Takes a vector in, float32 (dim,), and gives it standardised.

        Raises
        ------
        SurefixValueError
            For another length or type, a NaN or an infinity; nothing has changed then.
        """
    @property
    def count(self) -> int:
        """How many vectors have come, the references as one."""
    def snapshot(self) -> bytes:
        """The state as bytes; ``Running.restore`` goes on from it bit-identically. Keep it beside the
        localizer's own snapshot, which does not hold it.
        """
    @staticmethod
    def restore(blob: bytes) -> Running:
        """Statistics that go on where the snapshot was taken.

        Raises
        ------
        SurefixValueError
            If the bytes are damaged, no such snapshot, or of a newer version.

        Examples
        --------
        >>> import numpy as np
        >>> from surefix.post import Running
        >>> running = Running(2)
        >>> _ = running.push(np.float32([1, 5]))
        >>> Running.restore(running.snapshot()).count
        1
        """
    def reset(self) -> None:
        """Forgets all vectors, and the references."""

@final
class Matcher:
    """Turns distance vectors into fixes, one at a time: the paper's method, for any technique that
    yields distances.

    Parameters
    ----------
    places : int or Segments
        The number of places of the route, at least 2; or how they follow each other, if that is not
        in one segment.
    sequence_length : int
        `L`, the number of queries of a sequence (Eq. 5), from 1 to `places`, or to those of the
        longest segment if none is closed.
    weight : float
        `w`, how far a trusted cell is drawn to the floor (Eq. 4), from 0 (the plain sequence) to 1.
    tolerance : int
        The most places between the minimum and the gradient's peak of a trusted match (Eq.
        3), on one segment.
    smoothing : int
        The number of gradients that are summed along the diagonal (the paper's 3 x 3 kernel); 1 if
        queries come in any order.
    gradient : {"halved", "unhalved"}
        Eq. 1 as printed, or without its 1/2 as in the authors' public code; they can differ only at
        the route's ends.
    floor : {"running"} or float
        The target of trusted cells: the smallest distance so far, or this number if it is
        smaller still.
    speeds : sequence of float
        Slopes to try, in places a query; the best mean wins. Halves of a place round up.
    motion : {"steady", "free", "any"} or Motion, optional
        How the robot moves, for the tracker: fixes then have a ``track``. None for the paper alone.

    Raises
    ------
    SurefixValueError
        For an option outside its range; it names the option.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> matcher = surefix.Matcher(places=4)
    >>> matcher.push(np.array([0.1, 0.8, 0.9, 0.7], np.float32)).sequence is None    # warming up: L is 2
    True
    >>> fix = matcher.push(np.array([0.9, 0.2, 0.8, 0.9], np.float32))
    >>> fix.place, fix.trusted, fix.sequence.anchors
    (1, True, 2)
    """

    def __new__(
        cls,
        places: SupportsIndex | Segments,
        **options: Unpack[Options],
    ) -> Matcher: ...
    def push(
        self, distances: _Array, trusted: bool | None = None, advance: float | None = None
    ) -> Fix:
        """Takes the distances from the current query to every place, and says where the robot is.

        Its cost grows with the places, and for each of them with ``sequence_length`` times the number
        of speeds (an addition each) and the number of speeds of a motion. Data and flags make a push
        at most three times as dear as the usual one of the same options.

        Parameters
        ----------
        distances : array of float32, shape (places,)
            Any technique's distances; less is more alike. Read without a copy if contiguous.
        trusted : bool, optional
            An external predictor's word in place of the consensus.
        advance : float, optional
            The places that the robot has moved since the query before, by odometry: 0 if it stands
            still, negative if it reverses.

        Returns
        -------
        Fix

        Raises
        ------
        SurefixValueError
            For a wrong length or type, a NaN or an infinity, or an advance that is not finite. The
            matcher is then as it was.
        """
    @property
    def belief(self) -> _Float64 | None:
        """The track's belief in each place after the newest query, a copy: shape (places,), float64. With
        ``off_map`` of the track, it sums to 1. None without the option ``motion``.
        """
    def gap(self, advance: float | None = None) -> None:
        """Says that the next query does not follow on the one before: frames were dropped, or the
        camera was away.

        The diagonal is broken there, so that no gradient is summed and no sequence made across:
        ``fix.sequence`` is None until ``sequence_length`` queries have come. Frame numbers and the
        running floor go on. A gap before the first query, or right after another, changes nothing.

        Parameters
        ----------
        advance : float, optional
            The places that the robot moved meanwhile, by odometry: the track goes on from there.
            Those of several gaps and of the next query add up. Without it, the robot may be
            anywhere.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> matcher = surefix.Matcher(places=4)
        >>> columns = 1 - np.eye(4, dtype=np.float32)
        >>> [matcher.push(column).sequence is None for column in columns[:2]]
        [True, False]
        >>> matcher.gap()
        >>> matcher.push(columns[3])
        Fix(frame=2, place=3, score=0, trusted=True, sequence=None)
        """
    @property
    def segments(self) -> Segments:
        """How the places follow each other."""
    def reset(self) -> None:
        """Forgets all queries: the next one is frame 0."""
    def snapshot(self) -> bytes:
        """The whole state as bytes; ``Matcher.restore`` goes on from it bit-identically.

        Examples
        --------
        >>> import surefix
        >>> blob = surefix.Matcher(places=4).snapshot()
        >>> surefix.Matcher.restore(blob).places
        4
        """
    @staticmethod
    def restore(
        blob: bytes,
        **options: Unpack[Options],
    ) -> Matcher:
        """A matcher that goes on where the snapshot was taken.

        Parameters
        ----------
        blob : bytes
            From ``snapshot``.
        **options
            If given, as for ``Matcher``: the snapshot must have been taken under exactly these.

        Raises
        ------
        SurefixValueError
            If the bytes are damaged, foreign, of a newer version, or of other options.
        """
    @property
    def places(self) -> int:
        """The number of places of the route."""
    @property
    def frames(self) -> int:
        """How many queries it has taken since the start or the last reset."""

@final
class LoopClosure:
    """What a ``LoopCloser`` says of a frame."""

    @property
    def frame(self) -> int:
        """The number of the frame, from 0. As a place it has the same number, unless the loop closer
        is frozen.
        """
    @property
    def place(self) -> int:
        """The most probable place, an earlier frame's number; 0 as long as there are not two to
        compare with.
        """
    @property
    def confidence(self) -> float:
        """The belief that the robot is within ``tolerance`` places of it; 0 as long as there are not
        two to compare with.
        """
    @property
    def off_map(self) -> float:
        """The belief that the robot is at none of the earlier places, as it nearly always is."""
    @property
    def edge(self) -> bool:
        """Whether it is an edge: the loop is closed between ``frame`` and ``place``."""
    @property
    def blank(self) -> bool:
        """Whether the frame shows nothing. It becomes a place, and no edge leads from it or to it."""

@final
class LoopCloser:
    """Closes loops on a road without a map: each frame is compared with all places but the newest
    ``exclude``, and then becomes a place itself.

    The filter is that of a localizer's track, on a route that grows; the robot begins off the map,
    and most of the time is. Memory is taken for a block of places (1 MB) at a time, and for the
    belief twice as much as before at a time; in between, a push takes none. One thread does all of
    it.

    Parameters
    ----------
    descriptor : Sad or surefix.descriptors.Descriptor, optional
        It describes the images that are pushed. Without one, the first frame decides: an image is
        described by ``Sad()``; a vector of float32 is a ready descriptor, and so are all after it.
    exclude : int
        The newest places, with which a frame is not compared: it looks like them because the robot
        has only just left them.
    confidence : float
        The least confidence of an edge, from 0 to 1.
    lasting : int
        The frames in a row that must be as sure, at places that follow each other, before the last
        of them makes an edge: places that look alike by chance do not for long.
    tolerance : int
        Confidence is the belief within this many places of the most probable one.
    motion : {"steady", "free", "any", "loops"} or Motion
        How the robot moves along the earlier places, and how often it comes to one.
    metric : {"cosine", "euclidean", "manhattan"}
        How ready and learned descriptors are compared.
    memory : int, optional
        The most memory in bytes. Before it is passed, the oldest blocks of places go to a file,
        from which each push reads them.
    folder : path, optional
        The folder of that file, which has no name and ends with the program; by default the
        system's for temporary files.

    Raises
    ------
    SurefixValueError
        For an option outside its range; it names the option.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> places = np.random.default_rng(0).random((60, 64), np.float32)
    >>> closer = surefix.LoopCloser(metric="euclidean", exclude=10)
    >>> for frame in range(120):  # the same circle twice
    ...     answer = closer.push(places[frame % 60])
    >>> answer.edge, answer.frame, answer.place
    (True, 119, 59)
    >>> closer.edges[-1] == answer
    True
    """

    def __new__(
        cls,
        descriptor: Sad | _Descriptor | None = None,
        exclude: SupportsIndex = 30,
        *,
        confidence: float = 0.9,
        lasting: SupportsIndex = 10,
        tolerance: SupportsIndex = 3,
        motion: Literal["loops", "steady", "free", "any"] | Motion = "loops",
        metric: Literal["cosine", "euclidean", "manhattan"] = "cosine",
        memory: SupportsIndex | None = None,
        folder: _Path | None = None,
    ) -> LoopCloser: ...
    def push(self, frame: _Array | _Path, advance: float | None = None) -> LoopClosure:
        """Takes a frame, compares it with the places, and makes it one.

        Parameters
        ----------
        frame : array or path
            An image, (H, W) or (H, W, 3), or a file of one; or a ready descriptor, (dim,), float32.
        advance : float, optional
            The places that the robot has moved since the frame before, by odometry. As frames are
            places: in frames at its usual speed.

        Returns
        -------
        LoopClosure

        Raises
        ------
        SurefixValueError
            For another shape or type, a NaN or an infinity; if there is no memory for the place
            within the limit. It is then as it was.
        SurefixFileError
            If places cannot be written to the file, or read from it. It is then as it was.
        """
    def gap(self, advance: float | None = None) -> None:
        """Says that the next frame does not follow on the one before. The robot may be anywhere, and
        most likely at no earlier place; among the places, a new segment begins.

        Parameters
        ----------
        advance : float, optional
            The places that the robot moved meanwhile, by odometry: the belief goes on from there.
        """
    def freeze(self) -> None:
        """From now on, frames are compared, and no longer become places: if there is no memory for
        more.
        """
    @property
    def frozen(self) -> bool:
        """Whether frames no longer become places."""
    def reserve(self, frames: SupportsIndex) -> None:
        """Takes the memory of this many more places and edges now: until they have come, a push takes
        none, but after a gap and for frames that show nothing.

        Parameters
        ----------
        frames : int

        Raises
        ------
        SurefixValueError
            If that would pass the limit, or there is not enough; before the first frame, unless it
            was made with a ``Sad``: a place's size is not known then.
        """
    def reset(self) -> None:
        """Forgets all frames, places and edges, and goes on at frame 0."""
    @property
    def edges(self) -> list[LoopClosure]:
        """All edges so far, in the order of their frames: a list of LoopClosure."""
    @property
    def frames(self) -> int:
        """How many frames it has taken."""
    def __len__(self) -> int: ...
    @property
    def memory(self) -> int:
        """Bytes of memory that places, beliefs and edges have, whether in use or reserved."""
    @property
    def in_file(self) -> int:
        """Bytes of places that went to the file, so as not to pass the limit of memory."""
    @property
    def distances(self) -> npt.NDArray[np.float32]:
        """The distances of the newest frame to the places that it was compared with, a copy: float32."""
    @property
    def belief(self) -> npt.NDArray[np.float64]:
        """The belief in each of the places that the newest frame was compared with, a copy: float64.
        With ``off_map`` it sums to 1.
        """
    def to_map(self) -> Map:
        """All places as a map: for a ``Localizer``, or to be saved. A gap is a break of its route.

        Returns
        -------
        Map

        Raises
        ------
        SurefixValueError
            If there are fewer than two places.
        SurefixFileError
            If the file of places cannot be read.
        """
    def to_csv(self, path: _Path) -> None:
        """Writes the edges as CSV: ``frame``, ``place`` and ``confidence``.

        Parameters
        ----------
        path : str or path

        Raises
        ------
        SurefixFileError
            If the file cannot be written; an older one is then as it was.
        """
    def to_g2o(
        self,
        path: _Path,
        poses: _Array | None = None,
        *,
        first: SupportsIndex = 0,
        deviation: tuple[float, float] = (2.0, 0.2),
        odometry_deviation: tuple[float, float] = (0.1, 0.02),
    ) -> None:
        """Writes a pose graph in the text format of g2o, as GTSAM reads it too.

        With poses: a vertex a frame, an edge from each frame to the next by the difference of
        their poses, and the loop edges. Without: the loop edges alone (``EDGE_SE2``), to be added
        to the graph of an odometry whose vertices are the frames.

        A loop edge leads from the place to the frame. A camera says that they are at one place, and
        not how they lie to each other: the measurement is the identity, and the information matrix
        is diagonal, ``confidence / deviation ** 2``. An edge can be wrong: give these edges a
        robust kernel.

        Parameters
        ----------
        path : str or path
        poses : array, shape (frames, 3) or (frames, 7), optional
            Each frame's x, y and heading in radians, or x, y, z and the quaternion qx, qy, qz, qw.
        first : int
            The vertex of frame 0.
        deviation : (float, float)
            The standard deviations of a sure loop edge, in metres and radians: how far apart the
            camera may be at what counts as one place.
        odometry_deviation : (float, float)
            Those of an odometry edge.

        Raises
        ------
        SurefixValueError
            For another number or shape of poses, or a deviation of 0 or less.
        SurefixFileError
            If the file cannot be written; an older one is then as it was.
        """

@final
class Localizer:
    """Localizes along a map, one camera frame at a time.

    Parameters
    ----------
    map : Map or list of Map
        The known route. Many localizers can share one. Several maps of the same places, each of
        another technique, are fused: the single match and the sequence run on the mean of their
        standardised distances, the track on the evidence of all.
    descriptor : surefix.descriptors.Descriptor, or a list with one or None for each map, optional
        On a map of learned descriptors: it describes the images that are pushed. Its name is the
        one in the map's recipe.
    config : Settings or path, optional
        The settings of this route, as ``tune`` makes them: options, and a threshold, by which fixes
        have ``accepted`` and ``probability``. Beside a threshold, ``**options`` can change none.
    threads : int, optional
        The number of threads of the scan, the caller's own among them. None chooses by size: one
        for every 8 MB, up to all cores, so one for a map below 16 MB. The answers are the same to
        the last bit. A forked child has one.
    **options
        As for ``Matcher``: sequence_length, weight, tolerance, smoothing, gradient, floor, speeds,
        motion.

    Raises
    ------
    SurefixValueError
        For an option outside its range; it names the option.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> frames = np.random.default_rng(0).integers(0, 255, (5, 48, 96), np.uint8)
    >>> localizer = surefix.Localizer(surefix.Map.from_images(frames))
    >>> [fix.place for fix in localizer.stream(frames)]
    [0, 1, 2, 3, 4]
    """

    def __new__(
        cls,
        map: Map | _Sequence[Map],
        *,
        descriptor: _Descriptor | _Sequence[_Descriptor | None] | None = None,
        threads: SupportsIndex | None = None,
        **options: Unpack[Options],
    ) -> Localizer: ...
    def push(
        self,
        frame: _Array | _Path | _Sequence[_Array | _Path],
        trusted: bool | None = None,
        advance: float | None = None,
    ) -> Fix:
        """Takes one camera frame, and says where the robot is.

        Parameters
        ----------
        frame : array or path
            A uint8 image, (H, W) or (H, W, 3), or a file of one, described as the map's own images
            were (or of uint16, by the map's ``levels``); or a descriptor, (input_dim,), of the map's own type, or float32 on a map of ready
            descriptors, as it is before post-processing. On several maps, an image for all of them,
            or a list with one of these for each map.
        trusted : bool, optional
            An external predictor's word in place of the consensus.
        advance : float, optional
            The places that the robot has moved since the query before, by odometry: 0 if it stands
            still, negative if it reverses.

        Returns
        -------
        Fix

        Raises
        ------
        SurefixValueError
            For another shape or type, a NaN or an infinity, or an image on a map of ready
            descriptors. The localizer is then as it was.
        """
    def stream(self, frames: _Path | int | Iterable[_Array | _Path | _Frame]) -> FixStream:
        """A fix for each frame, as it comes.

        Parameters
        ----------
        frames : iterable of arrays or paths, or a path
            Each as for ``push``. A path is a folder or a pattern of images, or whatever else
            ``surefix.frames.open`` opens: a video, a bag, a camera by its number or URL, a
            file of arrays. Or a source that reports lost frames, such as
            ``surefix.frames.Frames``: an iterable of objects with an ``image`` to push, and ``gap``
            and ``dropped``. If ``gap`` is true, or ``dropped``, the number of frames lost just
            before this one, is more than 0, ``Localizer.gap`` comes first. It holds even if the
            image is then refused. An ``advance`` of theirs is pushed with the image, and bridges
            the gap; that of an image that is refused bridges a gap in its place.

        Returns
        -------
        iterator of Fix

        Raises
        ------
        SurefixValueError
            As for ``push``, when the frame's turn comes.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> from types import SimpleNamespace
        >>> images = np.random.default_rng(0).integers(0, 255, (5, 48, 96), np.uint8)
        >>> frames = [SimpleNamespace(image=images[i], gap=False, dropped=int(i == 3)) for i in (0, 1, 3, 4)]
        >>> localizer = surefix.Localizer(surefix.Map.from_images(images))
        >>> [(fix.place, fix.sequence is not None) for fix in localizer.stream(frames)]
        [(0, False), (1, True), (3, False), (4, True)]
        """
    @property
    def belief(self) -> _Float64 | None:
        """The track's belief in each place after the newest frame, a copy: shape (n,), float64. With
        ``off_map`` of the track, it sums to 1. None without the option ``motion``.
        """
    def gap(self, advance: float | None = None) -> None:
        """Says that the next frame does not follow on the one before: frames were dropped, or the
        camera was away.

        As ``Matcher.gap``: ``fix.sequence`` is None until ``sequence_length`` frames have come;
        frame numbers, the running floor and a drive's statistics (``surefix.post.Standardize``) go
        on.

        Parameters
        ----------
        advance : float, optional
            The places that the robot moved meanwhile, by odometry: the track goes on from there.
            Without it, the robot may be anywhere.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> rows = np.eye(6, dtype=np.float32)
        >>> localizer = surefix.Localizer(surefix.Map.from_descriptors(rows))
        >>> [localizer.push(row).sequence is None for row in rows[:3]]
        [True, False, False]
        >>> localizer.gap()
        >>> [localizer.push(row).sequence is None for row in rows[4:]]
        [True, False]
        """
    def reset(self) -> None:
        """Forgets all frames and the statistics of the drive: the next one is frame 0."""
    def snapshot(self) -> bytes:
        """The state as bytes, a drive's statistics among it, without the map; ``Localizer.restore``
        goes on from it bit-identically.
        """
    @staticmethod
    def restore(
        map: Map | _Sequence[Map],
        blob: bytes,
        *,
        descriptor: _Descriptor | _Sequence[_Descriptor | None] | None = None,
        threads: SupportsIndex | None = None,
        **options: Unpack[Options],
    ) -> Localizer:
        """A localizer that goes on where the snapshot was taken, on the same map.

        Parameters
        ----------
        map : Map
            The map that the snapshot was taken on.
        blob : bytes
            From ``snapshot``.
        threads : int, optional
            As for ``Localizer``.
        **options
            If given, as for ``Localizer``: the snapshot must have been taken under exactly these.

        Raises
        ------
        SurefixValueError
            If the bytes are damaged, of another map, of other options or of a newer version.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> route = surefix.Map.from_descriptors(np.eye(4, dtype=np.float32))
        >>> localizer = surefix.Localizer(route)
        >>> blob = localizer.snapshot()
        >>> surefix.Localizer.restore(route, blob)
        Localizer(Map(4 places x 4 float32, cosine, 0.0 MB), frames=0)
        """
    @property
    def alarm(self) -> bool:
        """Whether the scores are no longer those of the calibration drive of the settings' threshold,
        so that its promise holds no longer: it is raised on at most 1 % of drives like that one.
        False without a threshold.
        """
    @property
    def threshold(self) -> Threshold | None:
        """The threshold that judges its fixes; None without."""
    @property
    def distances(self) -> _Float32:
        """The distances from the newest frame to every place, a copy: shape (n,), float32; zeros
        before the first, and right after a gap. On a map with a screen, those that were not needed
        for the fix are computed now.
        """
    @property
    def looked_at(self) -> int:
        """How many of the map's rows the newest frame made it look at: all of them, or, on a map with
        a screen, those that were left in doubt, for this query and for the ones before it in the
        window. 0 before the first frame.
        """
    @property
    def maps(self) -> list[Map]:
        """The maps, one for each technique."""
    @property
    def map(self) -> Map:
        """The map that it localizes on, the first if there are several."""
    @property
    def threads(self) -> int:
        """How many threads scan the map, the caller's own among them."""

@final
class FixStream(Iterator[Fix]):
    """The fixes of ``Localizer.stream``, one a frame."""

    def __iter__(self) -> FixStream: ...
    def __next__(self) -> Fix: ...

@final
class Shard:
    """A range of a map's places: it scans their rows and keeps what is known of them.

    Parameters
    ----------
    map : Map
        The whole map, best opened with ``mmap=True``: only the rows of the shard are read.
    index : int
        Which shard, from 0.
    shards : int
        How many there are: at most one for every 4,096 places.
    **options
        As for ``Localizer``, the same as the driver's.

    Raises
    ------
    SurefixValueError
        For an option outside its range, or one that shards do not have.
    """

    def __new__(
        cls, map: Map, index: SupportsIndex, shards: SupportsIndex, **options: Unpack[Options]
    ) -> Shard: ...
    def census(self, question: bytes) -> bytes:
        """Answers a question of the stage ``census``: the means over its places."""
    def first(self, question: bytes) -> bytes:
        """Answers a question of the stage ``first``: what the query's column says in its places. It
        may be asked again.
        """
    def second(self, question: bytes) -> bytes:
        """Answers a question of the stage ``second``: it keeps the query."""
    def snapshot(self) -> bytes:
        """The state as bytes, after the queries that it has kept."""
    def restore(self, snapshot: bytes) -> None:
        """Goes on where a snapshot of the same shard was taken."""
    @property
    def places(self) -> tuple[int, int]:
        """Its own places: the first, and the one after the last."""
    def rows(self) -> list[tuple[int, int]]:
        """The places whose rows it reads, as ranges: the first of each, and the one after its last."""
    @property
    def frames(self) -> int:
        """How many queries it has kept since the start of the drive."""

@final
class ShardDriver:
    """Takes frames, asks the shards of a map, and makes fixes of their answers: those of a
    ``Localizer``, to the last bit.

    Parameters
    ----------
    map : Map
        The whole map.
    shards : int
        How many shards there are.
    descriptor : surefix.descriptors.Descriptor, optional
        As for ``Localizer``.
    **options
        As for ``Localizer``.
    """

    def __new__(
        cls,
        map: Map,
        shards: SupportsIndex,
        *,
        descriptor: _Descriptor | None = None,
        **options: Unpack[Options],
    ) -> ShardDriver: ...
    def push(
        self,
        frame: _Array | _Path,
        advance: float | None = None,
        trusted: bool | None = None,
    ) -> tuple[_Stage, list[bytes]]:
        """Begins a query, given as to ``Localizer.push``: a stage, and a question for each shard."""
    def answer(self, answers: list[bytes]) -> tuple[_Stage, list[bytes]] | Fix:
        """Takes the shards' answers, in their order: the next stage and its questions, or the fix."""
    def abandon(self) -> None:
        """Gives up the query in hand. Once ``second`` has been asked, it cannot be given up."""
    def gap(self, advance: float | None = None) -> None:
        """As ``Localizer.gap``."""
    def reset(self) -> None:
        """As ``Localizer.reset``. The shards forget their queries when the next one comes."""
    def snapshot(self) -> bytes:
        """The state as bytes, between two queries."""
    def restore(self, snapshot: bytes) -> None:
        """Goes on where a snapshot of a driver of the same map and options was taken."""
    @property
    def places(self) -> list[tuple[int, int]]:
        """The places of each shard: the first, and the one after the last."""
    @property
    def frames(self) -> int:
        """How many frames it has taken since the start or the last reset."""
    @property
    def alarm(self) -> bool:
        """As ``Localizer.alarm``."""

@final
class Position:
    """Where a place is: ``metres``, a tuple of 2 or 3 coordinates on the plane of the map's positions
    (``Map.origin``, ``Map.plane``), and ``degrees``, latitude and longitude, or None if the origin
    of the plane is not known.
    """

    @property
    def metres(self) -> tuple[float, ...]:
        """Two or three coordinates in metres: east, north and height, if the plane is one of degrees."""

    @property
    def degrees(self) -> tuple[float, float] | None:
        """Latitude and longitude; None if the origin of the plane is not known."""

    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Run:
    """The fixes of a whole run, one a query: as arrays of the shape (m,), or one by one (``run[j]``).

    ``place``, ``score``, ``trusted`` and ``blank`` are those of each ``Fix``; ``ready`` is False in
    the warm-up, where ``anchors`` is 0 and ``speed`` is NaN. ``confidence`` and ``off_map`` are None
    without the option ``motion``; with it, all queries are ready.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> run = surefix.match_distances(1 - np.eye(4, dtype=np.float32))
    >>> run.ready.tolist(), run.anchors.tolist()
    ([False, True, True, True], [0, 2, 2, 2])
    >>> run[3]
    Fix(frame=3, place=3, score=0, trusted=True)
    """

    @property
    def segment(self) -> _Int64:
        """The index of that place's segment: int64."""
    @property
    def segment_place(self) -> _Int64:
        """That place, counted from its segment's first: int64."""
    @property
    def segments(self) -> Segments:
        """How the route's places follow each other."""
    @property
    def place(self) -> _Int64:
        """Where the robot was: int64."""
    @property
    def score(self) -> _Float32:
        """How good the match is, less is better: float32."""
    @property
    def trusted(self) -> _Bool:
        """Whether the single match is trusted: bool."""
    @property
    def blank(self) -> _Bool:
        """Whether the query shows nothing, so that it can never be trusted: bool."""
    @property
    def anchors(self) -> _Int64:
        """How many trusted matches lie on the winning diagonal: int64."""
    @property
    def ready(self) -> _Bool:
        """Whether place and score are those of the track or of a full window: bool."""
    @property
    def speed(self) -> _Float64:
        """The track's speed, else the slope of the winning diagonal, in places a query: float64."""
    @property
    def positions(self) -> _Float64 | None:
        """The position of each query's place in metres: float64, (m, 2) or (m, 3); None if the map has
        no positions, and of distances.
        """

    @property
    def degrees(self) -> _Float64 | None:
        """Latitude and longitude of each query's place: float64, (m, 2); None if they are not known."""

    @property
    def confidence(self) -> _Float64 | None:
        """The belief that the robot is within ``tolerance`` places of the track's place: float64."""
    @property
    def off_map(self) -> _Float64 | None:
        """The belief that the robot is off the map: float64."""
    @property
    def single_place(self) -> _Int64:
        """The best match of each query alone: int64."""
    @property
    def single_distance(self) -> _Float32:
        """Its distance: float32."""
    @property
    def gradient_place(self) -> _Int64:
        """Where the enhanced gradient peaks: int64."""
    @property
    def gradient_value(self) -> _Float32:
        """The enhanced gradient there: float32."""
    @property
    def distances(self) -> _Float32:
        """The distances that the method saw, to the last bit: float32, (n, m), ``distances[i, j]``
        between place ``i`` and query ``j``; of several techniques the fused ones, which have no unit.

        Of ``match`` they are computed when they are first asked for, and then kept: ``4 n m`` bytes.
        Until then a run keeps its map, which is shared, and the queries' descriptors: those that were
        given, without a copy, or those of images (2 kB an image by default). Of ``match_distances``
        they are the array that was given, not a copy. Arrays that were given must not change. A
        pickle keeps the fixes alone.

        Raises
        ------
        SurefixValueError
            If the run comes from a pickle, or the memory does not suffice.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> rows = np.random.default_rng(0).normal(size=(30, 9)).astype(np.float32)
        >>> run = surefix.match(surefix.Map.from_descriptors(rows), rows[5:])
        >>> run.distances.shape, bool((run.distances.min(0) == run.single_distance).all())
        ((30, 25), True)
        """
    def plot(
        self,
        truth: _Truth | None = None,
        *,
        tolerance: float = 1,
        single: bool = False,
        kind: Literal["matrix", "confidence"] = "matrix",
        ax: _Axes | None = None,
        **options: Any,
    ) -> _Axes:
        """Draws the run: the distances (n, m) as tones, dark if a query looks like a place, and on them
        the place of each query. With the truth the marks say right or wrong, too.

        Parameters
        ----------
        truth : as for ``evaluate``, optional
        tolerance : float
            As for ``evaluate``.
        single : bool
            Draws the best match of each query alone, of which ``trusted`` speaks, in place of the fix.
        kind : {"matrix", "confidence"}
            What to draw. "confidence": what the tracker believes along the drive, if there is
            ``motion``.
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default a new figure of ``matplotlib.pyplot``.
        **options
            As for ``surefix.plot.distance_matrix`` or ``confidence``: such as ``queries`` and
            ``places`` for a close-up.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        SurefixValueError
            For a kind of picture that the run has no data for, or a truth as ``evaluate`` refuses it.
        ModuleNotFoundError
            If matplotlib is not installed.

        Examples
        --------
        >>> run.plot(truth).figure.savefig("run.png")  # doctest: +SKIP
        """
    def _repr_html_(self) -> str: ...
    def __copy__(self) -> Run: ...
    def __deepcopy__(self, memo: object, /) -> Run: ...
    def to_csv(self, path: _Path) -> None:
        """Writes a CSV file: a line of names, then a line a query.

        Raises
        ------
        SurefixFileError
            If the file cannot be written; an older one is then as it was.
        """
    def to_dataframe(self) -> Any:
        """A pandas DataFrame, a row a query; its index is the frame.

        Raises
        ------
        ModuleNotFoundError
            If pandas is not installed.
        """
    def __len__(self) -> int: ...
    def __getitem__(self, key: SupportsIndex, /) -> Fix: ...

@final
class _AtomicFile:
    def __new__(cls, path: _Path, rows: bool) -> _AtomicFile: ...
    @property
    def path(self) -> _RealPath: ...
    @property
    def left(self) -> _RealPath | None: ...
    def write(self, data: bytes) -> int: ...
    def commit(self) -> None: ...
    def keep(self) -> _RealPath | None: ...
    def discard(self) -> None: ...

@final
class _AtomicFolder:
    def __new__(cls, path: _Path) -> _AtomicFolder: ...
    @property
    def path(self) -> _RealPath: ...
    def commit(self, old: list[str], last: str) -> None: ...
    def discard(self) -> None: ...

def _is_stream(path: _Path) -> bool: ...

@final
class Alarm:
    """Notices that scores have become worse than those of a calibration drive, so that what was
    measured there (a threshold, a probability) holds no longer. It needs no truth.

    A score is better the smaller it is. Frames are averaged in blocks, as neighbours are not
    independent, and each block's mean is bet upon once: a conformal test martingale (Vovk, Gammerman
    and Shafer, *Algorithmic Learning in a Random World*, 2005), whose money mixes over when the
    change came. Scores that become better raise no alarm, and neither does a robot that is sure and
    wrong: only what the scores show is noticed.

    Parameters
    ----------
    scores : array of float32, shape (m,)
        Of the calibration drive, one a frame. A last block that is not complete is left out. The
        fewer blocks there are, the longer it takes to notice a change: if all scores are worse than
        any of these, 7 blocks after a calibration of 30, 23 after one of 8.
    block : int
        How many frames are averaged: at least twice the correlation time of the scores, after which
        their autocorrelation is below 1 / e; three times it for drives of more than 1,000 blocks.
    level : float
        The probability, at most, that a drive like the calibration's raises the alarm: on average
        over calibration drives, not for each of them.

    Raises
    ------
    SurefixValueError
        For an option outside its range, fewer scores than a block, a NaN or an infinity.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> calibration = np.float32(np.arange(300) * 7 % 11 / 100)
    >>> alarm = surefix.Alarm(calibration, block=10)
    >>> any(alarm.push(score) for score in calibration)
    False
    >>> [alarm.push(0.9) for _ in range(70)].index(True)
    69
    """

    def __new__(cls, scores: _Array, block: int, level: float = 0.01) -> Alarm: ...
    def push(self, score: float) -> bool:
        """The next frame's score; whether the alarm is raised. Once raised, it stays so until
        ``reset``.

        Raises
        ------
        SurefixValueError
            For a NaN or an infinity; nothing has changed then.
        """
    @property
    def raised(self) -> bool:
        """Whether the alarm has been raised."""
    @property
    def evidence(self) -> float:
        """What has become of an initial 1 by betting that scores are worse: the martingale. The alarm
        is raised at ``1 / level**2``.
        """
    def reset(self) -> None:
        """Forgets the drive, for a new one."""

@final
class Alignment:
    """Where each query of a drive was, by all of its queries: arrays of the shape (m,).

    ``place`` is the most probable place, int64; ``confidence`` the belief that the query is
    within ``tolerance`` places of it, ``off_map`` that it is off the map, and ``speed`` the places a
    query, float64; ``interval``, int64 of the shape (m, 2), the first and the last place of those
    that hold 95 % of the belief on the map (rounded as those of a ``Track``). ``single_place`` is
    each query's best match alone, and ``single_right`` the belief that it is right. ``right``,
    (k, m), is what is believed of the places that ``align`` was asked about with ``at``.
    """

    @property
    def place(self) -> _Int64:
        """The most probable place: int64."""
    @property
    def confidence(self) -> _Float64:
        """The belief that the query is within ``tolerance`` places of it: float64."""
    @property
    def off_map(self) -> _Float64:
        """The belief that the query is off the map: float64."""
    @property
    def speed(self) -> _Float64:
        """The speed in places a query, or the advance if it is known: float64."""
    @property
    def interval(self) -> _Int64:
        """The first and the last place that hold 95 % of the belief on the map: int64, (m, 2).
        On a closed route it may go round: the first is then the greater.
        """
    @property
    def single_place(self) -> _Int64:
        """The best match of each query alone: int64."""
    @property
    def single_right(self) -> _Float64:
        """The belief that this match is right, within ``tolerance`` places: float64."""
    @property
    def right(self) -> _Float64:
        """The belief that each query is within ``tolerance`` places of those of ``at``: float64,
        (k, m).
        """
    @property
    def degrees(self) -> _Float64 | None:
        """Latitude and longitude of each query's place: float64, (m, 2); None if they are not known."""

    @property
    def position(self) -> _Float64 | None:
        """The position of each query's place in metres: float64, (m, 2) or (m, 3); None if the map has
        no positions.
        """
    @property
    def segments(self) -> Segments:
        """How the route's places follow each other."""
    @property
    def distances(self) -> _Float32:
        """The distances that were aligned: float32, (n, m), as ``Run.distances``.

        Raises
        ------
        SurefixValueError
            If the alignment comes from a pickle, or the memory does not suffice.
        """
    def plot(self, *, ax: _Axes | None = None, **options: Any) -> _Axes:
        """Draws the distances (n, m) as tones, dark if a query looks like a place, and on them the place
        of each query; stretches without a sure place are shaded.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default a new figure of ``matplotlib.pyplot``.
        **options
            As for ``surefix.plot.aligned_track``, such as ``least``.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ModuleNotFoundError
            If matplotlib is not installed.

        Examples
        --------
        >>> alignment.plot().figure.savefig("alignment.png")  # doctest: +SKIP
        """
    def _repr_html_(self) -> str: ...
    def __copy__(self) -> Alignment: ...
    def __deepcopy__(self, memo: object, /) -> Alignment: ...
    def to_csv(self, path: _Path, least: float = 0.0) -> None:
        """Writes a CSV file: a line of names, then a line a query. If the map has positions, that of
        ``place`` is in the columns ``x``, ``y`` and ``z``.

        Parameters
        ----------
        path : path
        least : float
            The column ``reference`` is the place, or -1 if the confidence is below this. With the
            column ``query`` it is a truth for ``surefix eval --truth``.

        Raises
        ------
        SurefixFileError
            If the file cannot be written; an older one is then as it was.
        """
    def __len__(self) -> int: ...

def align(
    map: Map | _Array | _Sequence[Map] | _Sequence[_Array],
    queries: _Path | Iterable[_Path] | Iterable[_Array] | _Array | Traverse | None = None,
    *,
    motion: Motion | str | None = None,
    advance: _Array | list[float] | None = None,
    gaps: _Array | list[int] | None = None,
    segments: Segments | None = None,
    tolerance: SupportsIndex | None = None,
    at: _Array | _Sequence[_Array | list[int]] | None = None,
    descriptor: _Descriptor | _Sequence[_Descriptor | None] | None = None,
    progress: _Progress = None,
) -> Alignment:
    """Aligns a whole drive with a route, without any label: the tracker in both directions (method
    1.10), so that each query's place is that of all queries, those after it too.

    Parameters
    ----------
    map : Map; or array of float32, shape (n, m); or a list of maps or of arrays
        The known route; or distances, where ``distances[i, j]`` is between place ``i`` and query
        ``j``. Several techniques are fused, as by ``Localizer``.
    queries : array of descriptors, shape (m, dim); images, as for ``Map.from_images``; or a list
        As for ``match``. None with distances.
    motion : {"any", "steady", "free"} or Motion
        How the robot moves. "steady" is the most exact if both drives took frames at the same
        distances.
    advance : array of float, shape (m,), optional
        The places that the robot moved before each query, by odometry.
    gaps : array or list of int, optional
        As for ``match``.
    segments : Segments, optional
        With distances: how the places follow each other. A map knows it.
    tolerance : int
        The confidence is the belief within this many places.
    at : array of int, shape (k, m), optional
        Places to ask about, one a query in each row, such as the matches of other methods:
        ``Alignment.right`` is what is believed of them.
    descriptor : surefix.descriptors.Descriptor, optional
        On maps of learned descriptors: what describes the images, as for ``match``.
    progress : callable, optional
        As for ``Map.from_images``.

    Returns
    -------
    Alignment

    Raises
    ------
    SurefixValueError
        As for ``match`` and ``match_distances``, and for a place in ``at`` that there is not.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> distances = 1 - np.eye(30, dtype=np.float32)
    >>> alignment = surefix.align(distances, motion="steady")
    >>> alignment.place.tolist() == list(range(30))
    True
    >>> at = [alignment.place, alignment.place[::-1]]
    >>> surefix.align(distances, motion="steady", at=at).right.mean(1).round(1)
    array([1. , 0.1])
    """

def described(
    map: Map | _Sequence[Map],
    queries: _Path | Iterable[_Path] | Iterable[_Array] | _Array | Traverse,
    descriptor: _Descriptor | _Sequence[_Descriptor | None] | None = None,
    progress: _Progress = None,
) -> list[_Array]:
    """The queries' descriptors for each map, (m, dim): images are described, ready ones are as given."""

def match_distances(
    distances: _Array | _Sequence[_Array],
    *,
    trusted: _Array | list[bool] | None = None,
    advance: _Array | list[float] | None = None,
    gaps: _Array | list[int] | None = None,
    segments: Segments | None = None,
    **options: Unpack[Options],
) -> Run:
    """Matches a whole distance matrix, in parallel: the answers are those of a ``Matcher`` that is
    pushed column by column.

    Parameters
    ----------
    distances : array of float32, shape (n, m), in any memory layout; or a list of such
        ``distances[i, j]`` is the distance between place ``i`` and query ``j``. Those of several
        techniques are fused, as by ``Localizer``.
    floor : {"global", "running"} or float
        What trusted cells are drawn towards. "global", the default, is the paper's own: the minimum
        of the whole matrix, which is there. ``match`` has "running" by default, so that its fixes
        are those of a ``Localizer``, which cannot know it: give both one floor to compare them.
    trusted : array of bool, shape (m,), optional
        An external predictor's words in place of the consensus.
    advance : array of float, shape (m,), optional
        The places that the robot moved before each query, by odometry. Then gaps are bridged by it.
    gaps : array or list of int, optional
        The queries, in any order, before which there is a gap (``Matcher.gap``): one that does not
        follow on the one before.
    segments : Segments, optional
        How the places follow each other; in one segment by default.
    **options
        As for ``Matcher``.

    Returns
    -------
    Run

    Raises
    ------
    SurefixValueError
        For another shape or type, a NaN or an infinity (the error says where), an option outside
        its range, a gap before a query that there is not, or segments of other places.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> distances = 1 - np.eye(4, dtype=np.float32)
    >>> surefix.match_distances(distances, sequence_length=2).place
    array([0, 1, 2, 3])
    >>> surefix.match_distances(distances, sequence_length=2, gaps=[2]).ready
    array([False,  True, False,  True])
    """

def match(
    map: Map | _Sequence[Map],
    queries: _Path | Iterable[_Path] | Iterable[_Array] | _Array | Traverse,
    *,
    trusted: _Array | list[bool] | None = None,
    advance: _Array | list[float] | None = None,
    gaps: _Array | list[int] | None = None,
    descriptor: _Descriptor | _Sequence[_Descriptor | None] | None = None,
    progress: _Progress = None,
    **options: Unpack[Options],
) -> Run:
    """Matches all queries against a map, in parallel: the answers are those of a ``Localizer`` that is
    pushed one by one.

    Parameters
    ----------
    map : Map or list of Map
        The known route. Several maps are fused, as by ``Localizer``.
    queries : array of descriptors, shape (m, dim); or images, as for ``Map.from_images``
        Descriptors are of the map's own type, or of float32 on a map of ready descriptors. On
        several maps, images, or a list of such arrays, one for each map.
    trusted : array of bool, shape (m,), optional
        An external predictor's words in place of the consensus.
    advance : array of float, shape (m,), optional
        The places that the robot moved before each query, by odometry. Then gaps are bridged by it.
    gaps : array or list of int, optional
        The queries, in any order, before which there is a gap (``Localizer.gap``).
    descriptor : surefix.descriptors.Descriptor, optional
        On a map of learned descriptors: what describes the images, as for ``Localizer``.
    progress : callable, optional
        As for ``Map.from_images``.
    **options
        As for ``Matcher``, with its defaults, so that the fixes are those of a ``Localizer``;
        ``floor="global"`` too, that of ``match_distances``, which scans the map twice.

    Returns
    -------
    Run

    Raises
    ------
    SurefixValueError
        As for ``Localizer.push`` and ``Map.from_images``, and for a gap before a query that there
        is not.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> route = surefix.Map.from_descriptors(np.eye(4, dtype=np.float32))
    >>> surefix.match(route, np.eye(4, dtype=np.float32)[1:]).place
    array([1, 2, 3])
    >>> surefix.match(route, np.eye(4, dtype=np.float32), gaps=[2]).ready
    array([False,  True, False,  True])
    """

@final
class Evaluation:
    """A precision-recall curve, from the best score to the worst, and single figures from it.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> matches = surefix.Matches(place=[0, 1, 7, 3], score=[0.1, 0.2, 0.3, 0.4])
    >>> curve = surefix.evaluate(matches, np.arange(4), tolerance=0)
    >>> curve.precision.round(2).tolist(), curve.false_positives_at(1.0)
    ([1.0, 1.0, 0.67, 0.75], 1)
    """

    @property
    def recall(self) -> _Float64:
        """The share found at each threshold: float64."""
    @property
    def precision(self) -> _Float64:
        """The share of the accepted matches that is correct at each threshold: float64."""
    @property
    def thresholds(self) -> _Float32:
        """The scores up to which matches are accepted: float32."""
    @property
    def false_positives(self) -> _Int64:
        """How many wrong matches are accepted at each threshold: int64."""
    def auc(self, upto: float) -> float:
        """The area under the curve up to a recall, divided by it: 1 if all matches accepted by then
        are correct.

        Trapezoids between the lowest precisions at each recall; in the segment that ``upto`` cuts,
        the sweep's own line, which leads to the highest precision at the next recall. The first
        precision is held back to recall 0. A curve that ends before adds nothing beyond its end:
        read it beside ``max_recall``.
        """
    def auc_interval(
        self,
        upto: float,
        *,
        level: float = 0.95,
        samples: int = 1000,
        block: int | None = None,
        seed: int = 0,
    ) -> tuple[float, float]:
        """An interval for ``auc(upto)``, by a bootstrap over blocks of consecutive queries, as
        neighbours are not independent.

        Parameters
        ----------
        upto : float
        level : float
            The share of the samples inside.
        samples : int
            How often the queries are drawn anew.
        block : int, optional
            How many consecutive queries a block has; ``self.block`` by default.
        seed : int
            Another seed draws other blocks.

        Returns
        -------
        (low, high)
        """
    @property
    def block(self) -> int | None:
        """The queries a block of an interval: an upper bound of how long errors last, from their
        autocorrelation (method 1.12). None if all matches are right, or all wrong.
        """
    def auc_difference_interval(
        self,
        other: Evaluation,
        upto: float,
        *,
        level: float = 0.95,
        samples: int = 1000,
        block: int | None = None,
        seed: int = 0,
    ) -> tuple[float, float]:
        """An interval for ``self.auc(upto) - other.auc(upto)`` on the same queries; each sample draws
        the same ones for both. If it holds 0, the drive does not tell which is better.

        Parameters
        ----------
        other : Evaluation
            Of the same number of queries.
        upto, level, samples, block, seed
            As for ``auc_interval``.

        Returns
        -------
        (low, high)
        """
    def plot(self, *, name: str = "", ax: _Axes | None = None, **options: Any) -> _Axes:
        """Draws the curve, from the best score to the worst. Another curve goes onto the same axes, in
        the next colour: ``ax = weighted.plot(name="weighted")``, ``plain.plot(ax=ax, name="plain")``.

        Parameters
        ----------
        name : str
            Of the curve, in the legend.
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default a new figure of ``matplotlib.pyplot``.
        **options
            As for ``surefix.plot.precision_recall``, such as ``upto``, the recall up to which the
            area counts.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ModuleNotFoundError
            If matplotlib is not installed.

        Examples
        --------
        >>> curve.plot(name="weighted").figure.savefig("curve.png")  # doctest: +SKIP
        """
    def _repr_html_(self) -> str: ...
    def recall_at_precision(self, precision: float) -> float:
        """The largest recall at a precision of at least this; 0 if there is none."""
    def false_positives_at(self, recall: float) -> int | None:
        """The number of wrong matches that are accepted when this recall is reached; None if it
        never is.
        """
    @property
    def max_recall(self) -> float:
        """The largest recall that the curve reaches."""
    @property
    def best_f1(self) -> float:
        """The largest harmonic mean of precision and recall over all thresholds; 0 if nothing is
        correct.
        """
    @property
    def best_f1_threshold(self) -> float:
        """The threshold of ``best_f1``."""
    @property
    def judged(self) -> int:
        """How many queries were judged: ready, and not ignored."""
    @property
    def correct(self) -> int:
        """How many of the judged matches are correct, accepted or not."""

@final
class Trust:
    """The confusion table of a trust flag: positive is trusted, true is a correct single match."""

    @property
    def true_positives(self) -> int:
        """Trusted, and correct."""
    @property
    def false_positives(self) -> int:
        """Trusted, but wrong."""
    @property
    def false_negatives(self) -> int:
        """Correct, but not trusted."""
    @property
    def true_negatives(self) -> int:
        """Not trusted, and wrong."""
    @property
    def precision(self) -> float:
        """The share of the trusted matches that is correct; 0 if none is trusted."""
    @property
    def recall(self) -> float:
        """The share of the correct matches that is trusted (the true positive rate); 0 if none is
        correct.
        """
    @property
    def false_positive_rate(self) -> float:
        """The share of the wrong matches that is trusted; 0 if none is wrong."""
    def plot(self, *, ax: _Axes | None = None, **options: Any) -> _Axes:
        """Draws the four counts as a table, trusted or not by right or wrong.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default a new figure of ``matplotlib.pyplot``.
        **options
            As for ``surefix.plot.trust_table``.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ModuleNotFoundError
            If matplotlib is not installed.

        Examples
        --------
        >>> trust.plot().figure.savefig("trust.png")  # doctest: +SKIP
        """
    @property
    def share_trusted(self) -> float:
        """The share of all matches that is trusted."""

@final
class Threshold:
    """A threshold from a calibration drive, with its promise, by ``calibrate``.

    Attributes
    ----------
    score : float or None
        A fix of this score or less is accepted. None if nothing can be promised, so that none is.
    confidence : float or None
        ``1 - score`` for fixes of a track; else None.
    wrong, sure : float
        The promise: at most the share ``wrong`` of the accepted is wrong, with probability ``sure``.
    promise : str
        The same in words, or why there is none.
    queries, accepted, errors : int, int, float
        The queries of the drive that have a fix and a truth, how many are accepted, and how many of
        these are wrong.
    block : int or None
        Consecutive queries a block, for how long errors last; None if they are independent.
    more, more_metres : int or None, float or None
        If nothing is promised: how much more drive would do, if it is like this one. None if no
        length would, or the drive's is not known.
    carried : bool
        Whether it was carried over to other conditions, for which nothing is promised.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> matches = surefix.Matches(place=np.arange(500), score=np.arange(500) / 500)
    >>> truth = np.where(np.arange(500) < 400, np.arange(500), 0)
    >>> threshold = surefix.calibrate(matches, truth, wrong=0.1, block=2)
    >>> threshold.accepted, threshold.score > 0.7
    (418, True)
    >>> threshold.probability(matches)[[0, 499]] > 0.5
    array([ True, False])
    """

    @property
    def score(self) -> float | None:
        """A fix of this score or less is accepted; None if nothing can be promised."""
    @property
    def confidence(self) -> float | None:
        """``1 - score`` for fixes of a track; else None."""
    @property
    def wrong(self) -> float:
        """At most this share of the accepted is wrong."""
    @property
    def sure(self) -> float:
        """The probability of that."""
    @property
    def promise(self) -> str:
        """The promise in words, or why there is none."""
    @property
    def queries(self) -> int:
        """The queries of the calibration drive that have a fix and a truth."""
    @property
    def accepted(self) -> int:
        """How many of them are accepted."""
    @property
    def errors(self) -> float:
        """How many of the accepted are wrong."""
    @property
    def block(self) -> int | None:
        """Consecutive queries a block; None if they are independent."""
    @property
    def more(self) -> int | None:
        """How many queries more would do, if nothing is promised."""
    @property
    def more_metres(self) -> float | None:
        """The same in metres, if the length of the drive is known."""
    @property
    def carried(self) -> bool:
        """Whether it was carried over to other conditions."""
    @overload
    def accepts(self, fixes: Fix) -> bool:
        """Whether a fix is accepted; of a run or matches, an array of bool, shape (m,). Fixes that are
        not ready are not.

        Parameters
        ----------
        fixes : Fix, Run or Matches

        Raises
        ------
        SurefixValueError
            For fixes with a track if those of the calibration had none, and the other way round.
        """
    @overload
    def accepts(self, fixes: Run | _Matches) -> _Bool:
        """Whether a fix is accepted; of a run or matches, an array of bool, shape (m,). Fixes that are
        not ready are not.

        Parameters
        ----------
        fixes : Fix, Run or Matches

        Raises
        ------
        SurefixValueError
            For fixes with a track if those of the calibration had none, and the other way round.
        """
    @overload
    def probability(self, fixes: Fix) -> float | None:
        """The probability that a fix is right, by isotonic regression of the calibration drive; of a
        run or matches, an array of float64, shape (m,). None or NaN for fixes that are not ready.

        Parameters
        ----------
        fixes : Fix, Run or Matches

        Raises
        ------
        SurefixValueError
            As for ``accepts``.
        """
    @overload
    def probability(self, fixes: Run | _Matches) -> _Float64:
        """The probability that a fix is right, by isotonic regression of the calibration drive; of a
        run or matches, an array of float64, shape (m,). None or NaN for fixes that are not ready.

        Parameters
        ----------
        fixes : Fix, Run or Matches

        Raises
        ------
        SurefixValueError
            As for ``accepts``.
        """
    def carried_to(self, fixes: Run | _Matches) -> Threshold:
        """The threshold for other conditions, by the scores of a drive in them and without its truth:
        it accepts the same share, and probabilities are carried over by quantiles. That is a guess,
        for which nothing is promised.

        Parameters
        ----------
        fixes : Run or Matches
            Of the new drive.

        Returns
        -------
        Threshold

        Raises
        ------
        SurefixValueError
            If no fix is ready; as for ``accepts``.
        """
    __hash__: ClassVar[None]  # type: ignore[assignment]
    def __eq__(self, other: object, /) -> bool: ...

def calibrate(
    matches: Run | _Matches,
    truth: Alignment | _Truth,
    wrong: float = 0.05,
    sure: float = 0.95,
    *,
    tolerance: float = 1,
    block: int | None = None,
    independent: bool = False,
    metres: float | None = None,
    only: _Array | None = None,
) -> Threshold:
    """The loosest threshold on a score with a promise: at most the share ``wrong`` of the accepted
    fixes is wrong, with probability ``sure`` over drives like this one (method 1.12).

    It is found by Learn then Test in a fixed sequence (Angelopoulos et al. 2021), from strict to
    lax, with bets on blocks of consecutive queries, as their errors are not independent.

    Parameters
    ----------
    matches : Run or Matches
        Of a calibration drive, which nothing else was chosen on.
    truth : Alignment, or array or pair of arrays
        Where each query really was: as for ``evaluate``, or an alignment of the same drive.
    wrong : float
        Between 0 and 1.
    sure : float
        Between 0 and 1.
    tolerance : float
        As for ``evaluate``.
    block : int, optional
        Consecutive queries a block; by default for how long errors last (method 1.12); the root of
        the number of queries if there are no errors.
    independent : bool
        Queries are independent of each other, such as one of each of many drives: the exact
        binomial test, without blocks.
    metres : float, optional
        The length of the drive, for ``more_metres``.
    only : array of bool, shape (m,), optional
        The queries that it is calibrated on: those that nothing else was chosen on. All by default.

    Returns
    -------
    Threshold

    Raises
    ------
    SurefixValueError
        If no query has a fix and a truth; for an option outside its range; for a truth of another
        number of queries or of another route.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> run = surefix.match_distances(1 - np.eye(300, dtype=np.float32))
    >>> threshold = surefix.calibrate(run, np.arange(300), wrong=0.1, block=1)
    >>> threshold.score is not None, threshold.errors
    (True, 0.0)
    >>> bool(threshold.accepts(run)[1:].all())
    True
    """

def block_length(errors: _Array) -> int | None:
    """The queries a block, by how long errors last: an upper bound of their correlation time (method
    1.12). None if all are equal.

    Parameters
    ----------
    errors : array of float32, shape (m,)
        How wrong each query is, from 0 to 1.

    Returns
    -------
    int or None
    """

@final
class Settings:
    """The options and the threshold that suit a route, for ``Localizer(map, config=...)``; as a file,
    ``route.toml``, for ``surefix run --config`` and Rust's ``Settings::open``.

    Parameters
    ----------
    threshold : Threshold, optional
        Which fixes are accepted.
    maps : Map or list of Map, optional
        Those that they are for, one a technique; any by default.
    measured : dict of str, optional
        Where and how they were measured, for those who read the file.
    **options
        As for ``Matcher``; ``config``, other settings or a file of them, of which these take all
        that is not given here.

    Raises
    ------
    SurefixValueError
        For an unknown option, or one of another type.

    Examples
    --------
    >>> import surefix
    >>> settings = surefix.Settings(sequence_length=5, motion="steady")
    >>> settings.save("route.toml")   # doctest: +SKIP
    >>> options = settings.options
    >>> options.get("sequence_length"), options.get("motion").get("speeds")
    (5, [1.0])
    """

    def __new__(
        cls,
        *,
        threshold: Threshold | None = None,
        maps: Map | _Sequence[Map] | None = None,
        measured: Mapping[str, str] | None = None,
        **options: Unpack[Options],
    ) -> Settings: ...
    @staticmethod
    def open(path: _Path) -> Settings:
        """Reads a file.

        Parameters
        ----------
        path : path

        Raises
        ------
        SurefixFileError
            If it cannot be read.
        SurefixValueError
            If it holds no settings; the line is said.
        """
    def save(self, path: _Path) -> None:
        """Writes a file, in place of one that is there.

        Parameters
        ----------
        path : path

        Raises
        ------
        SurefixFileError
            If it cannot be written. One that was there is then as it was.
        """
    @property
    def options(self) -> dict[str, Any]:
        """All options, by their names; ``motion`` as a dict of its own."""
    @property
    def threshold(self) -> Threshold | None:
        """Which fixes are accepted."""
    @property
    def measured(self) -> dict[str, str]:
        """Where and how they were measured."""
    __hash__: ClassVar[None]  # type: ignore[assignment]
    def __eq__(self, other: object, /) -> bool: ...

def judged(
    place: npt.NDArray[np.int64], truth: _Truth, tolerance: float, segments: Segments
) -> list[_Bool]:
    """Which matches are right, and which the truth judges, as by ``evaluate``: a list of two arrays of
    bool, (m,).
    """

def evaluate(
    matches: Run | _Matches,
    truth: _Truth,
    tolerance: float = 1,
    recall: Literal["correct", "place_exists", "rejected"] | str = "correct",
    *,
    segments: Segments | None = None,
) -> Evaluation:
    """The precision-recall curve of matches against the truth: an exact sweep of the scores, equal
    ones together. A sequence's warm-up, and queries that the truth ignores, are left out.

    Parameters
    ----------
    matches : Run or Matches
        Of any method.
    truth : array or pair of arrays
        Where each query really was. Places: int, shape (m,), -1 for a query that was off the map,
        so that any accepted match is a mistake; or such numbers as float, NaN for a query whose
        place is not known, which is left out. Or a matrix, shape (n, m): bool, or int with 1 (the
        same place), 0 (not) and -1 (ignored). Or a pair of positions in planar metres, of the
        places, shape (n, 2) or (n, 3), and of the queries, shape (m, 2) or (m, 3), a row with a NaN
        for one that is not known (``surefix.datasets.local_metres`` turns latitude and longitude
        into metres).
    tolerance : float
        How far from the truth still counts as correct: places, or metres if the truth is
        positions. Places on either side of a break are not near each other; the last place of a
        closed segment and its first are.
    recall : {"correct", "place_exists", "rejected"}
        What recall is a share of. "correct" (the paper's wording): the queries whose match is
        correct. "place_exists": those that have a true place. "rejected": true positives and all
        rejected queries (the authors' earlier code).
    segments : Segments, optional
        How the route's places follow each other, for ``Matches``; a ``Run`` knows it.

    Returns
    -------
    Evaluation

    Raises
    ------
    SurefixValueError
        If the truth is of another length than the matches, of another type or shape, or an
        option outside its range.

    Warns
    -----
    UserWarning
        Of 20 queries and places or more: if no query is within the tolerance of a place, or all
        places are within it. Positions of another unit, such as degrees, make all matches wrong,
        or right.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> run = surefix.match_distances(1 - np.eye(5, dtype=np.float32))
    >>> surefix.evaluate(run, np.arange(5)).auc(0.2)
    1.0
    """

def evaluate_trust(run: Run, truth: _Truth, tolerance: float = 1) -> Trust:
    """The confusion table of a run's trust flags, which speak of its single matches: positive is
    trusted, true is correct.

    Parameters
    ----------
    run : Run
    truth, tolerance
        As for ``evaluate``.

    Returns
    -------
    Trust

    Raises
    ------
    SurefixValueError
        As for ``evaluate``.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> run = surefix.match_distances(1 - np.eye(5, dtype=np.float32))
    >>> trust = surefix.evaluate_trust(run, np.arange(5))
    >>> trust.precision, trust.share_trusted
    (1.0, 1.0)
    """

def recall_at(
    distances: _Array,
    truth: _Truth,
    ks: Iterable[int] = [1, 5, 10],
    tolerance: float = 1,
    *,
    segments: Segments | None = None,
) -> list[float]:
    """Recall at K: the share of the queries with a true place that have one among their K nearest
    places.

    Parameters
    ----------
    distances : array of float32, shape (n, m)
    truth, tolerance, segments
        As for ``evaluate``.
    ks : sequence of int

    Returns
    -------
    list of float, one a K

    Raises
    ------
    SurefixValueError
        As for ``evaluate``.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> surefix.recall_at(1 - np.eye(5, dtype=np.float32), np.arange(5), ks=(1, 5))
    [1.0, 1.0]
    """

def read_image(path: _Path) -> npt.NDArray[Any]:
    """Reads an image file (png, jpeg, bmp, tiff, webp or pnm; with ``surefix[heif]`` heic and avif too),
    upright: turned and mirrored as its EXIF orientation says.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    array of uint8, shape (H, W) for a grey file, (H, W, 3) RGB for any other
        Of uint16 if the file has more than 8 bits a sample. The levels of a map say which range of
        them is black to white (``Sad``).

    Raises
    ------
    SurefixFileError
        If the file cannot be opened.
    SurefixValueError
        If it is not an image that can be decoded whole, or has more pixels than ``max_pixels()``.
    """

def decode_image(data: bytes, name: str = "image") -> npt.NDArray[Any]:
    """Decodes the bytes of an image file, such as a camera driver's compressed frame, as
    ``read_image`` does.

    Parameters
    ----------
    data : bytes
    name : str
        What the error calls it.

    Returns
    -------
    array of uint8 or uint16, shape (H, W) for a grey image, (H, W, 3) RGB for any other

    Raises
    ------
    SurefixValueError
        As for ``read_image``.
    """

def max_pixels() -> int:
    """The most pixels that are decoded at once, by all threads together: 100,000,000 unless
    ``set_max_pixels`` has set another number.

    Returns
    -------
    int
    """

def set_max_pixels(pixels: int) -> None:
    """Sets how many pixels are decoded at once, in the whole process: of image files, and of the frames
    of bags and videos. A larger image is refused; smaller ones wait for each other if several threads
    read them. Pixels of more than 4 bytes, such as RGB of 16 bits, count as more. Decoding takes up
    to about 8 bytes a pixel. The command line has ``--max-pixels``.

    Parameters
    ----------
    pixels : int
        More than 0.

    Raises
    ------
    SurefixValueError
        For another number.

    Examples
    --------
    >>> import surefix
    >>> surefix.set_max_pixels(242_000_000)   # panoramas of 22,000 x 11,000
    >>> surefix.max_pixels()
    242000000
    >>> surefix.set_max_pixels(100_000_000)
    """

def thumbnail(
    image: _Array,
    size: tuple[int, int] | None = None,
    levels: tuple[int, int] | None = None,
) -> npt.NDArray[np.uint8]:
    """A small grey picture of an image, as a map keeps them: of this width and height, else 96 pixels
    on the longer side. Levels make images of more than 8 bits 8-bit ones.
    """

def find_images(place: _Path, order: _Order = "name") -> list[str]:
    """The image files of a folder or of a pattern like ``route/*.png``, in route order: ``frame10``
    follows ``Frame9``.

    Parameters
    ----------
    place : str or path
    order : {"name", "decimals", "whole", "time", "exif"}
        "name" is by names, as a person counts. In numbers with a point, such as the seconds of
        ``9.25.png``, the digits after it are decimals, unless one of them ends in 0 and none begins
        with 0; "decimals" (9.25 before 9.5) and "whole" (9.5 before 9.25, as of unpadded
        nanoseconds) choose. "time" is by the time of the file's last change, "exif" by the time at
        which the camera took it.

    Returns
    -------
    list of str

    Raises
    ------
    SurefixFileError
        If there is no such folder.
    SurefixValueError
        If it holds no images; for another order, or a file without the time of capture.
    """

def image_files(
    place: _Path, order: _Order = "name", also: _Sequence[str] = ()
) -> tuple[list[str], list[str]]:
    """The files of ``find_images``, and what a user should know: the files that were left out, an
    order that the names leave open, two drives in one folder, files of which only the first image is
    taken.

    Parameters
    ----------
    place, order
        As for ``find_images``.
    also : list of str
        Other endings that count as images, such as "heic".

    Returns
    -------
    (list of str, list of str)
    """

@final
class Route:
    """A generated route: a drive past structured scenery, the same for the same seed on every machine.

    Parameters
    ----------
    places : int
        Frames of a traverse, at least 2. Frames are rendered when asked for: a million places need
        no storage.
    size : (int, int)
        Width and height of a frame, in pixels.
    spacing : float
        Metres from one frame of the reference drive to the next.
    seed : int
        Another seed is another route.

    Raises
    ------
    SurefixValueError
        For an option outside its range.

    Examples
    --------
    >>> from surefix.simulate import Route
    >>> route = Route(places=100, size=(64, 32))
    >>> summer, winter = route.reference(), route.revisit()
    >>> winter[0].shape
    (32, 64, 3)
    """

    def __new__(
        cls,
        places: int = 1000,
        size: tuple[int, int] = (320, 160),
        spacing: float = 3.0,
        seed: int = 1,
    ) -> Route: ...
    def reference(self) -> Traverse:
        """The reference drive: summer, noon, nothing in the way."""
    def revisit(
        self,
        *,
        legs: _Sequence[tuple[str, int] | tuple[str, int, float]] | None = None,
        speed: float = 1.0,
        light: float = ...,
        season: float = ...,
        lateral_offset: float = ...,
        speed_jitter: float = ...,
        occluders: float = ...,
        noise: float = ...,
        seed: int = ...,
    ) -> Traverse:
        """The default second drive: another season, light, lane, speed and traffic. Each can be
        changed.

        Parameters
        ----------
        legs, speed
            As for ``traverse``.
        **conditions
            As for ``traverse``, over the defaults of the second drive.
        """
    def traverse(
        self,
        *,
        legs: _Sequence[tuple[str, int] | tuple[str, int, float]] | None = None,
        speed: float = 1.0,
        light: float = 0.0,
        season: float = 0.0,
        lateral_offset: float = 0.0,
        speed_jitter: float = 0.0,
        occluders: float = 0.0,
        noise: float = 0.0,
        seed: int = 0,
    ) -> Traverse:
        """A drive in the given conditions; those not given are the reference drive's, of which each is
        0.

        Parameters
        ----------
        legs : sequence of (str, int) or (str, int, float), optional
            What the drive does from place 0 on: the kind of a leg, its frames, and its speed if it
            is not ``speed``. By default it drives the whole route.

            "drive"
                On along the route.
            "stop"
                Standing still, on the street of the leg before.
            "reverse"
                Backwards along the route.
            "detour"
                Off the map along a parallel street, and back as far ahead as if the drive had
                stayed on the route.
            "loop"
                Off the map, around and back: as far behind as the drive went meanwhile, so that it
                comes to earlier places once more.
        speed : float
            Places of the route a frame.
        light, season, speed_jitter, occluders, noise : float
            From 0 (as in the reference drive) to 1.
        lateral_offset : float
            How far to the side the camera drives, in metres.
        seed : int
            Another seed has other traffic and noise, and other errors of the wheels.

        Raises
        ------
        SurefixValueError
            For a condition outside its range; for a leg of another kind, without frames, with a
            speed of 0 or less, or with an end that is not on the route.

        Examples
        --------
        >>> from surefix.simulate import Route
        >>> route = Route(places=100, size=(64, 32))
        >>> legs = [("drive", 40), ("stop", 10), ("detour", 20), ("drive", 30, 0.5)]
        >>> drive = route.revisit(legs=legs)
        >>> truth = drive.truth(route.reference())
        >>> truth[40:50].tolist() == [int(truth[39])] * 10, truth[50:70].max()
        (True, np.int64(-1))
        >>> advance = drive.odometry(scale=1.02, noise=0.05) / 3.0  # metres to places
        """

@final
class Traverse:
    """A drive along a generated route: a sequence of frames, each rendered when asked for, uint8 (H,
    W, 3).

    Examples
    --------
    >>> from surefix.simulate import Route
    >>> drive = Route(places=10, size=(64, 32)).reference()
    >>> len(drive), drive[-1].shape
    (10, (32, 64, 3))
    """

    def __len__(self) -> int: ...
    def __getitem__(self, key: SupportsIndex, /) -> _UInt8: ...
    @property
    def positions(self) -> _Float64:
        """How far along the route each frame was taken, in metres: shape (n,), float64, NaN off the
        map.
        """
    def odometry(self, *, scale: float = 1.0, noise: float = 0.0) -> _Float64:
        """The metres that the wheels count from each frame to the next, on the map and off it.

        Parameters
        ----------
        scale : float
            1 for wheels that count right.
        noise : float
            The standard deviation of a step's error, as a share of the step.

        Returns
        -------
        array of float64, shape (n,)
            From the frame before to each frame: 0 for the first one and while standing, negative
            backwards. The same for the same seed of the conditions.

        Raises
        ------
        SurefixValueError
            If a number is not finite, or the noise is negative.

        Examples
        --------
        >>> from surefix.simulate import Route
        >>> drive = Route(places=10, size=(64, 32)).traverse(legs=[("drive", 3), ("reverse", 1)])
        >>> drive.odometry(scale=1.5)
        array([ 0. ,  4.5,  4.5, -4.5])
        """
    def truth(self, reference: Traverse) -> _Int64:
        """The true place of each frame on a map of the drive ``reference``: shape (n,), int64, -1 off
        the map.
        """

def instruction_set() -> str:
    """The instruction set that the kernels run on here: "scalar", "avx2", "avx512" or "neon"."""
