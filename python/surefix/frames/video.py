"""Frames from a video file, by PyAV."""

import logging
from collections.abc import Generator
from functools import partial
from heapq import heappop, heappush
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._extra import require
from surefix.errors import SurefixFileError, SurefixValueError, mismatch, refusal
from surefix.frames.frame import Frames, Shot
from surefix.frames.pixels import check_pixels, most_pixels
from surefix.tables.regular import check_regular

# A video is known by its name; VideoFrames itself takes any file.
VIDEO_ENDINGS = frozenset((
    ".3gp", ".asf", ".avi", ".flv", ".m2ts", ".m4v", ".mjpeg", ".mkv", ".mov", ".mp4", ".mpeg",
    ".mpg", ".mts", ".ogv", ".ts", ".webm", ".wmv",
))  # fmt: skip

LOG = logging.getLogger("surefix")


class VideoFrames(Frames):
    """The frames of a video's first picture track, upright (turned and mirrored as the file says),
    as RGB, with times in seconds. Colours of 10 and 12 bits become 8-bit ones, as players show
    them; grey of more than 8 bits, as of a thermal camera, stays as uint16.

    Parameters
    ----------
    path : str or path
        Any file that FFmpeg reads.
    skip_bad : bool
        Pass over damaged frames, and those up to the next key frame, which are made of them; and
        take a file that was cut short as far as it goes. The logger ``surefix`` says so, and they
        count as dropped.

    Attributes
    ----------
    bad : list of str
        What was passed over, in the newest iteration so far.

    Raises
    ------
    SurefixError
        If PyAV is missing: ``pip install "surefix[video]"``.
    SurefixFileError
        If there is no such file.
    SurefixValueError
        If it is no video, or no frame of it can be decoded. While it is read, unless ``skip_bad``:
        if it is damaged, or ends before it should. The error names the frame, and those before it
        have been given. (An MPEG transport stream does not say its end.)
    """

    timed = True

    def __init__(self, path: str | PathLike[str], *, skip_bad: bool = False) -> None:
        self.path = fspath(path)
        self.skip_bad = skip_bad
        self.bad: list[str] = []
        self._files = [self.path]
        self._total: int | None = None
        self._av = require("av", "a video", "PyAV", "surefix[video]")
        with self._open() as container:
            self._estimate = int(container.streams.video[0].frames) or None
            ends, rate = _end(container), container.streams.video[0].average_rate
        if not self._estimate and ends is not None and rate:
            self._estimate = round(ends * float(rate)) or None

    @property
    def total(self) -> int | None:
        """The number of frames, with the damaged ones, once all are read."""
        return self._total

    def shots(self) -> Generator[Shot, None, None]:
        """Each frame, by its number from 0."""
        with self._open() as container:
            track = container.streams.video[0]
            # Otherwise FFmpeg fills a damaged frame up from the frame before.
            track.codec_context.options |= {"err_detect": "explode"}
            self.bad = []
            index, end, lost, given, whole = 0, 0.0, 0, 0, True
            # The times of packets whose frames have not come yet.
            waiting: list[int] = []
            for packet in container.demux(track):
                if packet.pts is not None and packet.size:
                    heappush(waiting, packet.pts)
                try:
                    frames = packet.decode()
                except self._av.EOFError:
                    continue
                except self._av.FFmpegError as error:
                    self._pass_over(index, error.strerror or str(error))
                    whole = False
                    if packet.pts is None:
                        index, lost = index + 1, lost + 1
                    continue
                for frame in frames:
                    while waiting and frame.pts is not None and waiting[0] <= frame.pts:
                        if heappop(waiting) < frame.pts and self.bad:
                            # No frame came of it.
                            index, lost = index + 1, lost + 1
                    end = max(end, _end_of(frame, track))
                    # What follows a damaged frame is made of it, up to the next key frame.
                    whole = frame.key_frame or whole
                    if frame.is_corrupt:
                        self._pass_over(index, "it cannot be decoded whole")
                        whole = False
                    if whole:
                        given += 1
                        read = partial(_upright, frame)
                        yield Shot(frame.time, str(index), read, lost, number=index)
                    index, lost = index + 1, 0 if whole else lost + 1
            # Those at the end of which nothing came.
            self._total = index + (len(waiting) if self.bad else 0)
            self._check_whole(container, index, end)
            if self.bad and not given:
                raise SurefixValueError(self.bad[0])

    def _open(self) -> Any:
        # FFmpeg also takes URLs, devices and lists of files.
        if not Path(self.path).exists():
            raise SurefixFileError(f"{self.path}: cannot read the video: there is no such file")
        check_regular(self.path, "cannot read the video")
        try:
            container = self._av.open(self.path)
        except (FileNotFoundError, PermissionError) as error:
            raise refusal(self.path, "cannot read the video", error) from None
        except (OSError, self._av.FFmpegError, ValueError) as error:
            raise self._no_video(getattr(error, "strerror", None) or str(error)) from None
        if not container.streams.video:
            container.close()
            raise self._no_video("it has no picture track")
        codec = container.streams.video[0].codec_context
        try:
            check_pixels(codec.width or 0, codec.height or 0, self.path)
        except SurefixValueError:
            container.close()
            raise
        # FFmpeg refuses a frame that becomes larger on the way.
        codec.options = {"max_pixels": most_pixels()}
        return container

    def _check_whole(self, container: Any, count: int, end: float) -> None:
        """Refuses a Matroska or AVI file that was cut short: FFmpeg takes that for the end."""
        expected = _end(container)
        track = container.streams.video[0]
        period = 1 / float(track.average_rate) if track.average_rate else 0.1
        if count == 0:
            raise self._damaged(0, "the file ends before the first frame")
        if expected is not None and end < expected - max(1.5 * period, 0.1):
            self._pass_over(
                count, f"the file ends at {end:.2f} s of {expected:.2f} s; it was cut short"
            )

    def _pass_over(self, index: int, reason: str) -> None:
        """Says that a frame is damaged; an error unless that is allowed."""
        error = self._damaged(index, reason)
        if not self.skip_bad:
            raise error
        self.bad.append(str(error))
        LOG.warning("Passed over: %s", error)

    def _no_video(self, reason: str) -> SurefixValueError:
        return mismatch(self.path, "a video", f"a file that is none, or a damaged one ({reason})")

    def _damaged(self, index: int, reason: str) -> SurefixValueError:
        return SurefixValueError(f"{self.path}, frame {index}: a damaged video: {reason}")


def is_video(place: Path) -> bool:
    """Whether this is a video by its name, and not a folder or a pattern."""
    pattern = any(mark in str(place) for mark in "*?[") and not place.exists()
    return place.suffix.lower() in VIDEO_ENDINGS and not place.is_dir() and not pattern


def _end(container: Any) -> float | None:
    """The end of the picture track in seconds, by the file's header; None if it has none."""
    track = container.streams.video[0]
    if container.format.name == "avi":
        # Its duration is made up from the size of the file; the number of frames is right.
        known = track.frames and track.average_rate
        return float(track.frames / track.average_rate) if known else None
    if container.format.name == "asf":
        return None  # Each track has the duration of the longest.
    start = track.start_time or 0
    if container.format.name == "flv":
        # Its duration counts from 0, and not from its first frame.
        start = 0
    if track.duration is not None:
        return float((track.duration + start) * track.time_base)
    tagged = track.metadata.get("DURATION", "").split(":")
    try:
        hours, minutes, seconds = (float(part) for part in tagged)
        return 3600 * hours + 60 * minutes + seconds
    except ValueError:
        pass
    # The container's duration is that of its longest track.
    alone = len(container.streams) == 1 and container.duration is not None
    begin = 0 if container.format.name == "flv" else container.start_time or 0
    return (container.duration + begin) / 1e6 if alone else None


def _end_of(frame: Any, track: Any) -> float:
    return (frame.time or 0.0) + float((frame.duration or 0) * track.time_base)


def _upright(frame: Any) -> npt.NDArray[Any]:
    """RGB, or deep grey, turned and mirrored as the file says."""
    component = frame.format.components[0]
    # Raw samples of a camera; 10-bit colours have a range that all players know.
    deep = component.bits > 8 and frame.format.name.startswith("gray")
    image: npt.NDArray[Any] = frame.to_ndarray(format="gray16le" if deep else "rgb24")
    matrix = _matrix(frame)
    if matrix is None:
        quarters = round(frame.rotation / 90) % 4
        return np.ascontiguousarray(np.rot90(image, quarters)) if quarters else image
    a, b, c, d = matrix
    # A point (x, y) is shown at (a x + c y, b x + d y).
    if abs(b) + abs(c) > abs(a) + abs(d):
        image = np.swapaxes(image, 0, 1)
        a, d = c, b
    return np.ascontiguousarray(image[:: -1 if d < 0 else 1, :: -1 if a < 0 else 1])


def _matrix(frame: Any) -> tuple[int, int, int, int] | None:
    """The turning part of the frame's display matrix, a b c d; None if it has none."""
    for data in frame.side_data:
        if data.type.name == "DISPLAYMATRIX":
            a, b, _, c, d = np.frombuffer(bytes(data), np.int32)[:5].tolist()
            return a, b, c, d
    return None
