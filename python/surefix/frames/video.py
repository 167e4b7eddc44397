"""Frames from a video file, by PyAV."""

from collections.abc import Generator
from contextlib import closing
from functools import partial
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._extra import require
from surefix.errors import SurefixFileError, SurefixValueError, mismatch, refusal
from surefix.frames.frame import Frames, Shot

# A video is known by its name; VideoFrames itself takes any file.
VIDEO_ENDINGS = frozenset((
    ".3gp", ".asf", ".avi", ".flv", ".m2ts", ".m4v", ".mjpeg", ".mkv", ".mov", ".mp4", ".mpeg",
    ".mpg", ".mts", ".ogv", ".ts", ".webm", ".wmv",
))  # fmt: skip


class VideoFrames(Frames):
    """The frames of a video's first picture track, upright, as RGB, with times in seconds.

    Parameters
    ----------
    path : str or path
        Any file that FFmpeg reads.

    Raises
    ------
    SurefixError
        If PyAV is missing: ``pip install "surefix[video]"``.
    SurefixFileError
        If there is no such file.
    SurefixValueError
        If it is no video. While it is read: if it is damaged, or ends before it should. The error
        names the frame, and those before it have been given. (An MPEG transport stream does not say
        its end.)
    """

    timed = True

    def __init__(self, path: str | PathLike[str]) -> None:
        self.path = fspath(path)
        self._files = [self.path]
        self._av = require("av", "a video", "PyAV", "surefix[video]")
        with self._open() as container:
            self._estimate = int(container.streams.video[0].frames) or None
            ends, rate = _end(container), container.streams.video[0].average_rate
        if not self._estimate and ends is not None and rate:
            self._estimate = round(ends * float(rate)) or None

    def shots(self) -> Generator[Shot, None, None]:
        """Each frame, by its number from 0."""
        with self._open() as container:
            track = container.streams.video[0]
            # Otherwise FFmpeg fills a damaged frame up from the frame before.
            track.codec_context.options = {"err_detect": "explode"}
            index, end = 0, 0.0
            with closing(container.decode(track)) as frames:
                while True:
                    try:
                        frame = next(frames, None)
                    except (self._av.FFmpegError, EOFError) as error:
                        reason = getattr(error, "strerror", None) or str(error)
                        raise self._damaged(index, reason) from None
                    if frame is None:
                        break
                    if frame.is_corrupt:
                        raise self._damaged(index, "it cannot be decoded whole")
                    end = max(end, _end_of(frame, track))
                    yield Shot(frame.time, str(index), partial(_upright, frame))
                    index += 1
            self._check_whole(container, index, end)

    def _open(self) -> Any:
        # FFmpeg also takes URLs, devices and lists of files.
        if not Path(self.path).is_file():
            raise SurefixFileError(f"{self.path}: cannot read the video: there is no such file")
        try:
            container = self._av.open(self.path)
        except (FileNotFoundError, PermissionError) as error:
            raise refusal(self.path, "cannot read the video", error) from None
        except (OSError, self._av.FFmpegError, ValueError) as error:
            raise self._no_video(getattr(error, "strerror", None) or str(error)) from None
        if not container.streams.video:
            container.close()
            raise self._no_video("it has no picture track")
        return container

    def _check_whole(self, container: Any, count: int, end: float) -> None:
        """Refuses a Matroska or AVI file that was cut short: FFmpeg takes that for the end."""
        expected = _end(container)
        track = container.streams.video[0]
        period = 1 / float(track.average_rate) if track.average_rate else 0.1
        if expected is not None and end < expected - max(1.5 * period, 0.1):
            cut = f"the file ends at {end:.2f} s of {expected:.2f} s; it was cut short"
            raise self._damaged(count, cut)
        if count == 0:
            raise self._damaged(0, "the file ends before the first frame")

    def _no_video(self, reason: str) -> SurefixValueError:
        return mismatch(self.path, "a video", f"a file that is none, or a damaged one ({reason})")

    def _damaged(self, index: int, reason: str) -> SurefixValueError:
        return SurefixValueError(f"{self.path}, frame {index}: a damaged video: {reason}")


def is_video(place: Path) -> bool:
    """Whether this is a video by its name, and not a folder or a pattern."""
    pattern = any(mark in str(place) for mark in "*?[")
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
    if track.duration is not None:
        return float((track.duration + (track.start_time or 0)) * track.time_base)
    tagged = track.metadata.get("DURATION", "").split(":")
    try:
        hours, minutes, seconds = (float(part) for part in tagged)
        return 3600 * hours + 60 * minutes + seconds
    except ValueError:
        pass
    # The container's duration is that of its longest track.
    alone = len(container.streams) == 1 and container.duration is not None
    return (container.duration + (container.start_time or 0)) / 1e6 if alone else None


def _end_of(frame: Any, track: Any) -> float:
    return (frame.time or 0.0) + float((frame.duration or 0) * track.time_base)


def _upright(frame: Any) -> npt.NDArray[np.uint8]:
    """RGB, turned by the rotation that the file gives."""
    image: npt.NDArray[np.uint8] = frame.to_ndarray(format="rgb24")
    quarters = round(frame.rotation / 90) % 4
    return np.ascontiguousarray(np.rot90(image, quarters)) if quarters else image
