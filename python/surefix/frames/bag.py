"""Frames from bags of ROS 1, bags of ROS 2 and MCAP files."""

from collections.abc import Generator, Iterable, Iterator
from contextlib import closing
from dataclasses import replace
from functools import cached_property, partial
from os import PathLike, fspath
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from surefix._progress import Bar, terminal_bar
from surefix._words import plural
from surefix.errors import SurefixValueError, mismatch
from surefix.frames.frame import Frames, Shot, UndecodableError
from surefix.frames.image_topic import choose_topic
from surefix.frames.packets import codec_of, decoded, rgb
from surefix.frames.recording import Message, Place, Recording, bag_parts, open_recording
from surefix.frames.ros_image import check_fits, image_of
from surefix.frames.timeline import SECOND, Timeline, timeline


class BagFrames(Frames):
    """The images of one topic of a drive's bags, in the order in which they were taken.

    Topics may be of ``sensor_msgs`` Image or CompressedImage, of Foxglove's RawImage,
    CompressedImage or CompressedVideo, or of ffmpeg_image_transport's FFMPEGPacket; H.264 and H.265
    also as the data of a CompressedImage. Videos take ``surefix[video]``. See
    ``surefix.frames.image_of`` for the encodings.

    The time of a frame is its message's own stamp, in seconds; of all frames it is the time of
    recording if a stamp is 0. Frames are in order of time. If the clock goes back and stays back,
    as in a bag that was recorded in a loop, a new stretch begins: its first frame has ``gap`` set.
    So has the first frame after a pause of more than a second between two files.

    A message that cannot be read or decoded is passed over, and counts as dropped before the next.
    ``remarks`` says all of this, once it is read.

    Parameters
    ----------
    path : str or path, or list of them
        A ``.bag`` of ROS 1, the folder of a ROS 2 bag, a ``.mcap`` or a ``.db3``; a folder or a
        pattern of these, or a list, which are one drive. Of several, damaged ones are passed over.
    topic : str, optional
        The image topic. By default the only camera's: depth images, masks, images of 16 bits beside
        a camera's, and its compressed form beside itself, are passed over.
    strict : bool
        Refuse what is damaged instead of passing it over.

    Raises
    ------
    SurefixError
        If rosbags is missing: ``pip install "surefix[bags]"``.
    SurefixFileError
        If there is no such file.
    SurefixValueError
        If it is no bag, or a damaged one, or has no such topic, or the images of several cameras
        (the error lists the topics); while it is read, if none of the first ten images can be
        decoded, or with ``strict`` if one cannot: the error names the topic and the message.
    """

    timed = True

    def __init__(
        self, path: Place | Iterable[Place], topic: str | None = None, strict: bool = False
    ) -> None:
        self.place = path if isinstance(path, (str, PathLike)) else list(path)
        self.path = fspath(self.place) if isinstance(self.place, (str, PathLike)) else ""
        self.strict = strict
        with open_recording(self.place, strict) as bag:
            self.path = bag.name
            self.topic, self._said = choose_topic(bag, topic)
            self._messages = bag.topics[self.topic].count
            self._damaged = bag.remarks
        parts = bag_parts(self.place)
        inside = [list(part.iterdir()) if part.is_dir() else [part] for part in parts]
        self._files = [str(file) for part in inside for file in part]
        self._undecoded: list[str] = []

    @property
    def count(self) -> int | None:
        """The number of frames, less those that turn out undecodable; None of a video."""
        kept = len(self._read.timeline.order)
        return None if self._read.codec else kept

    @property
    def estimate(self) -> int | None:
        """The number of messages."""
        return self._messages

    @property
    def span(self) -> tuple[float, float] | None:
        """The first and the last time, in seconds; None without frames."""
        times = self._read.timeline.time[self._read.timeline.order]
        return (int(times.min()) / SECOND, int(times.max()) / SECOND) if len(times) else None

    @property
    def recorded(self) -> bool:
        """Whether times are those of the recording."""
        return self._read.timeline.recorded

    @property
    def remarks(self) -> list[str]:
        """The topic if it was chosen, the clock, and what is passed over."""
        known = self.__dict__.get("_read")
        read = [] if known is None else [*known.timeline.remarks, *known.damaged]
        return [*self._said, *self._damaged, *read, *self._undecoded, *super().remarks]

    def shots(self) -> Generator[Shot, None, None]:
        """Each image, by its number from 0 on the topic."""
        read, self._undecoded = self._read, []
        line = read.timeline
        rank = {number: at for at, number in enumerate(line.order)}
        waiting: dict[int, Shot | None] = {}
        taken, lost, gap = 0, 0, False
        with open_recording(self.place, self.strict) as bag:
            found = self._pictures(bag, read) if read.codec else self._images(bag, read)
            with closing(found):
                for number, image in found:
                    if number not in rank:
                        continue
                    broken = number in line.breaks
                    time = int(line.time[number]) / SECOND
                    shot = None if image is None else Shot(time, str(number), image, gap=broken)
                    gap = gap or (broken and shot is None)
                    waiting[rank[number]] = shot
                    while taken in waiting:
                        next_one = waiting.pop(taken)
                        taken += 1
                        if next_one is None:
                            lost += 1
                            continue
                        yield replace(next_one, dropped=lost, gap=next_one.gap or gap)
                        lost, gap = 0, False
        if read.error is not None:
            raise read.error

    def _images(self, bag: Recording, read: "_Read") -> Generator[tuple[int, Any], None, None]:
        """Of each message its number, and the call that decodes it, None if it is damaged."""
        with closing(bag.messages(self.topic)) as found:
            for number, message in enumerate(found):
                if number >= len(read.whole):
                    return
                image = partial(_decode, message, self.strict)
                yield number, image if read.whole[number] else None

    def _pictures(self, bag: Recording, read: "_Read") -> Generator[tuple[int, Any], None, None]:
        """The same of the packets of a video."""
        assert read.codec is not None
        wheres: dict[int, str] = {}

        def packets() -> Iterator[tuple[int, Any]]:
            with closing(bag.messages(self.topic)) as found:
                for number, message in enumerate(found):
                    if number < len(read.whole) and read.whole[number]:
                        wheres[number] = message.where
                        yield number, message.content

        early, damaged = 0, 0
        good = False
        for number, picture in decoded(read.codec, packets()):
            where = wheres.pop(number)
            if picture is None and good and self.strict:
                raise SurefixValueError(f"{where}: a damaged video: it cannot be decoded whole")
            early, damaged = early + (picture is None and not good), damaged + (picture is None)
            good = good or picture is not None
            yield number, None if picture is None else partial(rgb, picture, where)
        if not good:
            got = f"none in {plural(len(read.whole), 'message')} of {read.codec}"
            raise mismatch(f"{self.path}, {self.topic}", "a picture that can be decoded", got)
        if early:
            text = "before the first key frame are left out"
            self._undecoded.append(f"{plural(early, 'message')} {text}")
        if damaged - early:
            text = "of a damaged video are passed over"
            self._undecoded.append(f"{plural(damaged - early, 'message')} {text}")

    @cached_property
    def _read(self) -> "_Read":
        """The times of all messages, which are read once for them."""
        stamps: list[int] = []
        recorded: list[int] = []
        file: list[int] = []
        problems: dict[int, str] = {}
        codec, error, known = None, None, False
        bar = Bar(terminal_bar("Reading times"), None, self._messages)
        with open_recording(self.place, self.strict) as bag:
            with closing(bag.messages(self.topic)) as found:
                for number, message in enumerate(found):
                    problem = _problem(message)
                    if problem and self.strict:
                        error = SurefixValueError(problem)
                        break
                    if problem:
                        problems[number] = problem
                    elif not known:
                        codec, known = codec_of(message.content, message.where), True
                    stamps.append(stamp_of(message.content) or 0)
                    recorded.append(message.recorded)
                    file.append(message.file)
                    bar.show(number + 1)
            bar.end(len(stamps))
            damaged = [*bag.remarks]
        if len(problems) == len(stamps) and error is None and (problems or damaged):
            raise SurefixValueError(next(iter([*problems.values(), *damaged])))
        if problems:
            of = f"{plural(len(problems), 'message')} of {len(stamps)} passed over"
            damaged.append(f"{of}; the first: {next(iter(problems.values()))}")
        whole = np.array([number not in problems for number in range(len(stamps))], bool)
        at, received, files = (np.array(each, np.int64) for each in (stamps, recorded, file))
        line = timeline(at, received, files, whole, bag.files)
        damaged = [each for each in damaged if each not in self._damaged]
        return _Read(line, whole, codec, damaged, error)


class _Read(NamedTuple):
    """What is known of a topic once all messages were read: which are whole; the codec of a video;
    what is passed over; and the error at which it ends if it is strict.
    """

    timeline: Timeline
    whole: npt.NDArray[np.bool_]
    codec: str | None
    damaged: list[str]
    error: SurefixValueError | None


def stamp_of(message: Any) -> int | None:
    """The stamp of a message in nanoseconds; None if it has none."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    stamp = getattr(message, "timestamp", None) if stamp is None else stamp
    return None if stamp is None else int(stamp.sec) * SECOND + int(stamp.nanosec)


def _problem(message: Message) -> str:
    """Why a message cannot be read; empty if it can."""
    if message.damage:
        return f"{message.where}: {message.damage}"
    try:
        check_fits(message.content, message.where)
    except SurefixValueError as error:
        return str(error)
    return ""


def _decode(message: Message, strict: bool) -> Any:
    try:
        return image_of(message.content, message.where)
    except SurefixValueError as error:
        raise error if strict else UndecodableError(str(error)) from None
