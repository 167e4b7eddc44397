"""The frames that a name means."""

from collections.abc import Iterable
from contextlib import suppress
from os import PathLike, fspath
from pathlib import Path

from surefix.errors import SurefixFileError, SurefixValueError, mismatch
from surefix.frames.advances import Advances, on_clock
from surefix.frames.bag import BagFrames
from surefix.frames.camera import CameraFrames, is_camera
from surefix.frames.follow import FollowFrames
from surefix.frames.frame import Frames
from surefix.frames.images import ImageFrames
from surefix.frames.nearest import Every, EveryMetres
from surefix.frames.newest import KeepNewest
from surefix.frames.odometry import Odometry
from surefix.frames.passing import SkipBad
from surefix.frames.recording import BAG_ENDINGS, is_bag, is_bags
from surefix.frames.sampling import Gaps, Stride, check_stride
from surefix.frames.shape import Crop
from surefix.frames.video import VIDEO_ENDINGS, VideoFrames, is_video
from surefix.tables.vectors import ENDINGS

Place = str | PathLike[str]


def open(
    place: Place | int | Iterable[Place],
    *,
    topic: str | None = None,
    follow: bool = False,
    idle: float | None = None,
    gap: float | None = None,
    stride: int = 1,
    every: float | None = None,
    metres: float | None = None,
    odometry: Odometry | Place | None = None,
    places_per_metre: float | None = None,
    newest: bool | int | None = None,
    order: str = "name",
    skip_bad: bool = False,
    crop: tuple[int, int] | None = None,
) -> Frames:
    """The frames of images, a folder that grows, a video, a bag, a camera or an array.

    Parameters
    ----------
    place : str, path, int, or list of files
        A folder of images, a pattern or one image; a ``.npy``, or another file of descriptors; a
        video file; a bag (``.bag``, ``.mcap``, ``.db3``, or the folder of a ROS 2 bag), or a
        folder, a pattern or a list of the bags of one drive; a camera's number, device file or URL;
        or a list of image files.
    topic : str, optional
        Of a bag: the images' topic, if there are several cameras.
    follow : bool
        Of a folder or a pattern: go on with the files that come.
    idle : float, optional
        With ``follow``: end when none has come for this many seconds; by default never.
    gap : float, optional
        Frames more than this many seconds apart, or going back in time, have a gap between them.
    stride : int
        Take every n-th frame.
    every : float, optional
        Take the frame nearest to each tick of this many seconds (``Every``).
    metres : float, optional
        Take the frame nearest to each mark of this many metres, by ``odometry`` (``EveryMetres``).
    odometry : Odometry, str or path, optional
        For ``metres``, ``places_per_metre`` or both: a ``.csv`` or a trajectory of TUM, KITTI or
        EuRoC (``Odometry.from_file``), a topic of poses of the bag that the images are in, or
        another bag with one such topic (``Odometry.from_bag``). Images without times need files
        named by them, or KITTI's rows, one a frame.
    places_per_metre : float, optional
        Give each frame its ``advance`` by ``odometry`` (``Advances``);
        ``surefix.datasets.places_per_metre`` has the number for a map with positions.
    newest : bool or int, optional
        Read in a thread, and keep the newest frame, or this many, for a slow reader
        (``KeepNewest``). By default for a camera only: the frames of a folder wait.
    order : str
        Of the files of a folder or a pattern, as for ``surefix.find_images``.
    skip_bad : bool
        Pass over frames that cannot be decoded, and say so (``SkipBad``, ``VideoFrames``).
    crop : (int, int), optional
        Cut each image around its centre to the shape of this width and height (``Crop``).

    skip_bad : bool
        Pass over frames that cannot be decoded, and say so (``SkipBad``, ``BagFrames``).

    Returns
    -------
    Frames
        Iterate over it for ``Frame``.

    Raises
    ------
    SurefixValueError
        For options that do not fit the place, and as each kind of frames says.
    SurefixFileError
        If the place does not exist.

    Examples
    --------
    >>> import surefix
    >>> localizer.stream(surefix.frames.open("drive.mp4", every=0.5, gap=2))     # doctest: +SKIP
    >>> bag = surefix.frames.open("drive.bag", metres=3, odometry="/odom")       # doctest: +SKIP
    """
    source = _source(place, topic, follow, idle, order, skip_bad)
    for option, value in (("gap", gap), ("every", every)):
        if value is not None and not source.timed:
            raise mismatch(option, "frames with times, as of a video or a bag", place)
    for option, value in (("metres", metres), ("places_per_metre", places_per_metre)):
        if value is not None and odometry is None:
            raise mismatch(option, "odometry too", "none")
    frames, track = source, None
    if odometry is not None:
        if metres is None and places_per_metre is None:
            raise mismatch("odometry", "metres or places_per_metre too", "none")
        frames, track = on_clock(source, _odometry(odometry, source))
    # Gaps are between the source's frames, not between those that are left (see Gaps).
    if gap is not None:
        frames = Gaps(frames, gap)
    # `True == 1` and `1.0 == 1`, so they are rejected explicitly.
    if check_stride(stride) != 1:
        frames = Stride(frames, stride)
    if every is not None:
        frames = Every(frames, every)
    if metres is not None and track is not None:
        frames = EveryMetres(frames, track, metres)
    if crop is not None:
        frames = Crop(frames, crop)
    # Of the frames that are left: the others are not decoded.
    if skip_bad and not (source.live or isinstance(source, VideoFrames)):
        frames = SkipBad(frames)
    if newest is None:
        newest = isinstance(source, CameraFrames)
    if newest:
        frames = KeepNewest(frames, int(newest))
    # The last: of the frames that are left.
    if places_per_metre is not None and track is not None:
        frames = Advances(frames, track, places_per_metre)
    return frames


def is_recording(place: str) -> bool:
    """Whether this names a video or a bag."""
    return is_bag(place) or is_video(Path(place))


def _source(
    place: Place | int | Iterable[Place],
    topic: str | None,
    follow: bool,
    idle: float | None,
    order: str,
    skip_bad: bool,
) -> Frames:
    if idle is not None and not follow:
        raise mismatch("idle", "follow too", "none")
    if not isinstance(place, (str, PathLike, int)):
        place = list(place)
        if is_bags(place) and not follow:
            return BagFrames(place, topic, skip_bad=skip_bad)
        if follow or topic is not None:
            raise SurefixValueError(f"{'follow' if follow else 'topic'}: not for a list of files")
        if order != "name":
            raise mismatch("order", "a folder or a pattern", "a list of files, which has its own")
        return ImageFrames(place)
    name = str(place) if isinstance(place, int) else fspath(place)
    file = Path(name)
    bag, video = is_bag(name), is_video(file)
    if topic is not None and not bag:
        raise mismatch("topic", "a bag", name)
    array, camera = file.suffix.lower() in ENDINGS, is_camera(name) and not file.is_dir()
    if order != "name" and (follow or bag or array or camera or video):
        raise mismatch("order", "a folder of images or a pattern", name)
    if follow:
        if bag or array or camera or video:
            raise mismatch("follow", "a folder or a pattern", name)
        return FollowFrames(name, idle=idle)
    if bag:
        return BagFrames(name, topic, skip_bad=skip_bad)
    if video:
        return VideoFrames(name, skip_bad=skip_bad)
    for fits, kind in ((array, ImageFrames), (camera, CameraFrames)):
        if fits:
            return kind(name)
    if file.is_file():
        with suppress(SurefixFileError):
            return ImageFrames(name)
        endings = ", ".join(sorted({*VIDEO_ENDINGS, *BAG_ENDINGS, *ENDINGS}))
        expected = f"a folder of images, a pattern, or a file that ends in {endings}"
        raise SurefixValueError(f"{name}: expected {expected}")
    return ImageFrames(name, order=order)


def _odometry(given: Odometry | Place, source: Frames) -> Odometry:
    if isinstance(given, Odometry):
        return given
    name = fspath(given)
    if is_bag(name):
        return Odometry.from_bag(name)
    if not name.startswith("/") or Path(name).is_file():
        return Odometry.from_file(name)
    if not isinstance(source, BagFrames):
        expected = "a .csv or a trajectory's file, or a topic of the bag that the images are in"
        raise mismatch("odometry", expected, name)
    return Odometry.from_bag(source.place, name, recorded=source.recorded)
