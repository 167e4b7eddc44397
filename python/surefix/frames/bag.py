"""Frames from bags of ROS 1, bags of ROS 2 and MCAP files."""

from collections.abc import Generator, Iterable, Iterator
from contextlib import closing
from dataclasses import replace
from functools import cached_property, partial
from os import PathLike, fspath
from typing import Any, NamedTuple

import numpy as np

from surefix._progress import Bar, terminal_bar
from surefix._words import plural
from surefix.errors import SurefixValueError, mismatch
from surefix.frames.frame import Frames, Shot
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

    ``remarks`` says all of this, once it is read; and how many messages of a video come before its
    first key frame, which are left out.

    Parameters
    ----------
    path : str or path, or list of them
        A ``.bag`` of ROS 1, the folder of a ROS 2 bag, a ``.mcap`` or a ``.db3``; a folder or a
        pattern of these, or a list, which are one drive.
    topic : str, optional
        The image topic. By default the only camera's: depth images, masks, images of 16 bits beside
        a camera's, and its compressed form beside itself, are left aside.
    skip_bad : bool
        Pass over messages that cannot be read, and of a video those that cannot be decoded; they
        count as dropped before the next frame. Of several files, pass over damaged ones, and the
        rest of a file from where it is damaged. (``SkipBad`` does it for images by themselves.)

    Attributes
    ----------
    bad : list of str
        Why each message was passed over, in the newest iteration so far.

    Raises
    ------
    SurefixError
        If rosbags is missing: ``pip install "surefix[bags]"``.
    SurefixFileError
        If there is no such file.
    SurefixValueError
        If it is no bag, or a damaged one, or has no such topic, or the images of several cameras
        (the error lists the topics); while it is read, for an image that cannot be decoded, unless
        it is passed over: the error names the topic and the message.
    """

    timed = True

    def __init__(
        self,
        path: Place | Iterable[Place],
        topic: str | None = None,
        *,
        skip_bad: bool = False,
    ) -> None:
        self.place = path if isinstance(path, (str, PathLike)) else list(path)
        self.path = fspath(self.place) if isinstance(self.place, (str, PathLike)) else ""
        self.skip_bad = skip_bad
        self.bad: list[str] = []
        with open_recording(self.place, skip_bad) as bag:
            self.path = bag.name
            self.topic, self._said = choose_topic(bag, topic)
            self._messages = bag.topics[self.topic].count
            self._damaged = bag.remarks
        parts = bag_parts(self.place)
        inside = [list(part.iterdir()) if part.is_dir() else [part] for part in parts]
        self._files = [str(file) for part in inside for file in part]
        self._early = 0

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
    def total(self) -> int | None:
        """The number of messages that there are."""
        return self._read.messages

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
        """The topic if it was chosen, the clock, damaged files, and messages left out."""
        known = self.__dict__.get("_read")
        read = [] if known is None else [*known.timeline.remarks, *known.damaged]
        early = f"{plural(self._early, 'message')} before the first key frame left out"
        return [*self._said, *self._damaged, *read, *([early] if self._early else [])]

    def shots(self) -> Generator[Shot, None, None]:
        """Each image, by its number from 0 on the topic."""
        read = self._read
        self.bad, self._early = list(read.bad.values()), 0
        line = read.timeline
        rank = {number: at for at, number in enumerate(line.order)}
        # Those that are kept have the rows of all that are, in order of time.
        rows = sorted(line.order)
        waiting: dict[int, Shot | None] = {}
        taken, lost, gap = 0, 0, False
        with open_recording(self.place, self.skip_bad) as bag:
            found = self._pictures(bag, read) if read.codec else self._images(bag, read)
            with closing(found):
                for number, image in found:
                    if number not in rank:
                        lost += number in read.bad
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
                        row = rows[taken - 1]
                        yield replace(next_one, dropped=lost, gap=next_one.gap or gap, number=row)
                        lost, gap = 0, False
        if read.error is not None:
            raise read.error

    def _images(self, bag: Recording, read: "_Read") -> Generator[tuple[int, Any], None, None]:
        """Of each message its number, and the call that decodes it, None if it is damaged."""
        with closing(bag.messages(self.topic)) as found:
            for number, message in enumerate(found):
                if number >= read.messages:
                    return
                image = partial(image_of, message.content, message.where)
                yield number, None if number in read.bad else image

    def _pictures(self, bag: Recording, read: "_Read") -> Generator[tuple[int, Any], None, None]:
        """The same of the packets of a video."""
        assert read.codec is not None
        wheres: dict[int, str] = {}

        def packets() -> Iterator[tuple[int, Any]]:
            with closing(bag.messages(self.topic)) as found:
                for number, message in enumerate(found):
                    if number < read.messages:
                        wheres[number] = message.where
                        yield number, None if number in read.bad else message.content

        good = False
        for number, picture in decoded(read.codec, packets()):
            where = wheres.pop(number)
            if picture is None and good and number not in read.bad:
                problem = f"{where}: a damaged video: it cannot be decoded whole"
                if not self.skip_bad:
                    raise SurefixValueError(problem)
                self.bad.append(problem)
            self._early += picture is None and not good
            good = good or picture is not None
            yield number, None if picture is None else partial(rgb, picture, where)
        if not good:
            got = f"none in {plural(read.messages, 'message')} of {read.codec}"
            raise mismatch(f"{self.path}, {self.topic}", "a picture that can be decoded", got)

    @cached_property
    def _read(self) -> "_Read":
        """The times of all messages, which are read once for them."""
        stamps: list[int] = []
        recorded: list[int] = []
        file: list[int] = []
        problems: dict[int, str] = {}
        codec, error, known = None, None, False
        bar = Bar(terminal_bar("Reading times"), None, self._messages)
        with open_recording(self.place, self.skip_bad) as bag:
            with closing(bag.messages(self.topic)) as found:
                for number, message in enumerate(found):
                    problem = _problem(message)
                    if problem and not self.skip_bad:
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
        whole = np.array([number not in problems for number in range(len(stamps))], bool)
        at, received, files = (np.array(each, np.int64) for each in (stamps, recorded, file))
        line = timeline(at, received, files, whole, bag.files)
        damaged = [each for each in damaged if each not in self._damaged]
        return _Read(line, len(stamps), problems, codec, damaged, error)


class _Read(NamedTuple):
    """What is known of a topic once all messages were read: how many there are; which are bad, and
    why; the codec of a video; damaged files; and the error at which it ends.
    """

    timeline: Timeline
    messages: int
    bad: dict[int, str]
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
