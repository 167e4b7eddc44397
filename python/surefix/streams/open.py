"""The stream that a name means."""

from collections.abc import Iterable
from os import PathLike, fspath
from pathlib import Path

from surefix.descriptors.ready import ENDINGS
from surefix.errors import SurefixValueError
from surefix.streams.arrays import ArrayStream
from surefix.streams.bag import BAG_ENDINGS, BagStream, is_bag
from surefix.streams.camera import CameraStream, is_camera
from surefix.streams.every import Every, Stride, check_stride
from surefix.streams.follow import FollowStream
from surefix.streams.gaps import Gaps
from surefix.streams.images import ImageStream
from surefix.streams.metres import EveryMetres
from surefix.streams.newest import KeepNewest
from surefix.streams.odometry import Odometry
from surefix.streams.stream import Stream
from surefix.streams.video import VIDEO_ENDINGS, VideoStream, is_video

__all__ = ["open_stream"]


def open_stream(
    place: str | PathLike[str] | int | Iterable[str | PathLike[str]],
    *,
    topic: str | None = None,
    follow: bool = False,
    idle: float | None = None,
    gap: float | None = None,
    stride: int = 1,
    every: float | None = None,
    metres: float | None = None,
    odometry: Odometry | str | PathLike[str] | None = None,
    newest: bool | int | None = None,
) -> Stream:
    """The frames of whatever is named: images, a folder that grows, a video, a bag, a camera or an
    array.

    Parameters ---------- place : str, path, int, or list of files A folder of images or a pattern;
    a ``.npy``, or another file of descriptors; a video file; a bag (``.bag``, ``.mcap``, ``.db3``,
    or the folder of a ROS 2 bag); a camera's number, device file or URL; or a list of image files.
    topic : str, optional Of a bag: the images' topic, where there are several. follow : bool Of a
    folder or a pattern: go on with the files that come. idle : float, optional With ``follow``: end
    when none has come for so many seconds; by default never. gap : float, optional Frames more than
    so many seconds apart, or going back in time, have a gap between them. stride : int Take every
    n-th frame. every : float, optional Take a frame every so many seconds. metres : float, optional
    Take a frame every so many metres, by ``odometry``. odometry : Odometry, str or path, optional
    For ``metres``: a ``.csv`` (``Odometry.from_csv``), or a bag's topic of poses
    (``Odometry.from_bag``). newest : bool or int, optional Read in a thread, and keep the newest
    frame, or so many, for a slow reader (``KeepNewest``). By default for a camera only: the frames
    of a folder wait.

    Returns
    -------
    Stream
        Iterate over it for ``Frame``.

    Raises
    ------
    SurefixValueError
        For options that do not fit what is named, and as each kind of stream says.
    SurefixFileError
        Where it is not there.

    Examples
    --------
    >>> from surefix.streams import open_stream
    >>> localizer.stream(open_stream("drive.mp4", every=0.5, gap=2))                            # doctest: +SKIP
    >>> localizer.stream(open_stream("drive.bag", metres=3, odometry="/odom"))                  # doctest: +SKIP
    """
    source = _source(place, topic, follow, idle)
    stream = source
    # Gaps are of the source's frames, not of those that are left (see Gaps).
    if gap is not None:
        stream = Gaps(stream, gap)
    # True is 1, and 1.0 too: refused all the same.
    if check_stride(stride) != 1:
        stream = Stride(stream, stride)
    if every is not None:
        stream = Every(stream, every)
    for option, value in (("gap", gap), ("every", every), ("metres", metres)):
        if value is not None and not source.timed:
            raise SurefixValueError(
                f"{option}: expected frames with times, as of a video or a bag, got {place}"
            )
    if (metres is None) != (odometry is None):
        given, lacking = ("metres", "odometry") if odometry is None else ("odometry", "metres")
        raise SurefixValueError(f"{given}: expected {lacking} too, got none")
    if metres is not None and odometry is not None:
        stream = EveryMetres(stream, _odometry(odometry, source), metres)
    if newest is None:
        newest = isinstance(source, CameraStream)
    return KeepNewest(stream, int(newest)) if newest else stream


def _source(
    place: str | PathLike[str] | int | Iterable[str | PathLike[str]],
    topic: str | None,
    follow: bool,
    idle: float | None,
) -> Stream:
    if idle is not None and not follow:
        raise SurefixValueError("idle: expected follow too, got none")
    if not isinstance(place, (str, PathLike, int)):
        if follow or topic is not None:
            raise SurefixValueError(f"{'follow' if follow else 'topic'}: not for a list of files")
        return ImageStream(place)
    name = str(place) if isinstance(place, int) else fspath(place)
    file = Path(name)
    bag = is_bag(file)
    if topic is not None and not bag:
        raise SurefixValueError(f"topic: expected a bag, got {name}")
    array, camera = file.suffix.lower() in ENDINGS, is_camera(name) and not file.is_dir()
    video = is_video(file)
    if follow:
        if bag or array or camera or video:
            raise SurefixValueError(f"follow: expected a folder or a pattern, got {name}")
        return FollowStream(name, idle=idle)
    if bag:
        return BagStream(name, topic)
    if array:
        return ArrayStream(name)
    if camera:
        return CameraStream(name)
    if video:
        return VideoStream(name)
    if file.is_file():
        endings = ", ".join(sorted({*VIDEO_ENDINGS, *BAG_ENDINGS, *ENDINGS}))
        raise SurefixValueError(
            f"{name}: expected a folder of images, a pattern, or a file that ends in {endings}"
        )
    try:
        return ImageStream(name)
    except SurefixValueError:
        parts = (
            sorted(path.name for path in file.glob("*") if is_bag(path)) if file.is_dir() else []
        )
        if not parts:
            raise
        # A recorder that was interrupted leaves a bag's folder so.
        listed = ", ".join(parts)
        raise SurefixValueError(
            f"{name}: expected images, or the metadata.yaml of a bag; name one of {listed}"
        ) from None


def _odometry(given: Odometry | str | PathLike[str], source: Stream) -> Odometry:
    if isinstance(given, Odometry):
        return given
    name = fspath(given)
    if not name.startswith("/") or Path(name).is_file():
        return Odometry.from_csv(name)
    if not isinstance(source, BagStream):
        raise SurefixValueError(
            f"odometry: expected a .csv, or a topic of the bag that the images are in, got {name}"
        )
    return Odometry.from_bag(source.path, name)
