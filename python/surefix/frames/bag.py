"""Frames from a ROS 1 bag, a ROS 2 bag or an MCAP file, by rosbags, without ROS."""

from collections.abc import Generator, Iterator
from contextlib import closing, contextmanager
from functools import partial
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from surefix._extra import require
from surefix.errors import SurefixError, SurefixFileError, SurefixValueError, mismatch, refusal
from surefix.frames.frame import Frames, Shot
from surefix.frames.ros_image import IMAGE, image_of

BAG_ENDINGS = frozenset({".bag", ".db3", ".mcap"})


class BagFrames(Frames):
    """The images of one topic, raw or compressed, in the order in which they were recorded.

    The time is the message's own stamp, in seconds, or the time of recording if it has none. See
    ``surefix.frames.image_of`` for the encodings.

    Parameters
    ----------
    path : str or path
        A ``.bag`` of ROS 1, the folder of a ROS 2 bag, a ``.mcap`` or a ``.db3``.
    topic : str, optional
        The image topic; not needed if there is only one.

    Raises
    ------
    SurefixError
        If rosbags is missing: ``pip install "surefix[bags]"``.
    SurefixFileError
        If there is no such file.
    SurefixValueError
        If it is no bag, or a damaged one, or has no such topic (the error lists those there are);
        while it is read, for an image that cannot be decoded: the error names the topic and the
        message.
    """

    timed = True

    def __init__(self, path: str | PathLike[str], topic: str | None = None) -> None:
        self.path = fspath(path)
        with open_bag(self.path) as bag:
            topics = {name: (info.msgtype, info.msgcount) for name, info in bag.topics.items()}
        self.topic = _chosen(self.path, topics, topic)
        self._count = int(topics[self.topic][1])
        folder = Path(self.path)
        inside = [str(path) for path in folder.iterdir()] if folder.is_dir() else []
        self._files = inside or [self.path]

    def shots(self) -> Generator[Shot, None, None]:
        """Each image, by its number from 0 on the topic."""
        with open_bag(self.path) as bag, closing(messages(bag, self.path, self.topic)) as found:
            for index, (time, message, where) in enumerate(found):
                yield Shot(time, str(index), partial(image_of, message, where))


def is_bag(place: Path) -> bool:
    """Whether this is a bag by its name, or the folder of one."""
    return place.suffix.lower() in BAG_ENDINGS or (place / "metadata.yaml").is_file()


@contextmanager
def open_bag(path: str) -> Iterator[Any]:
    """The open reader of a bag."""
    highlevel = require("rosbags.highlevel", "a bag", "rosbags", "surefix[bags]")
    typesys = require("rosbags.typesys", "a bag", "rosbags", "surefix[bags]")
    if not Path(path).exists():
        raise SurefixFileError(f"{path}: cannot read the bag: there is no such file or folder")
    # Bags of ROS 2 before Iron do not define their messages; those used here never changed.
    usual = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    try:
        bag = highlevel.AnyReader([Path(path)], default_typestore=usual)
        bag.open()
    except PermissionError as error:
        raise refusal(path, "cannot read the bag", error) from None
    except Exception as error:  # It depends on the damaged bytes.
        expected = "a bag of ROS 1 or 2, or an MCAP file with ROS messages"
        raise mismatch(path, expected, f"none, or a damaged one ({_reason(error)})") from None
    try:
        yield bag
    finally:
        bag.close()


def messages(bag: Any, path: str, topic: str) -> Generator[tuple[float, Any, str], None, None]:
    """Each message of a topic: its time in seconds, itself, and its name in an error."""
    connections = [connection for connection in bag.connections if connection.topic == topic]
    index = 0
    with closing(bag.messages(connections=connections)) as found:
        while True:
            where = f"{path}, {topic}, message {index}"
            try:
                one = next(found, None)
                if one is None:
                    return
                connection, recorded, data = one
                message = bag.deserialize(data, connection.msgtype)
            except SurefixError:
                raise
            except Exception as error:  # As above.
                raise SurefixValueError(f"{where}: a damaged bag: {_reason(error)}") from None
            yield stamp_of(message) or recorded / 1e9, message, where
            index += 1


def stamp_of(message: Any) -> float | None:
    """The stamp of a message in seconds; None if it has none."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is None or not (stamp.sec or stamp.nanosec):
        return None
    return float(stamp.sec + stamp.nanosec / 1e9)


def _chosen(path: str, topics: dict[str, tuple[str | None, int]], topic: str | None) -> str:
    images = {name: kind for name, (kind, _) in topics.items() if kind in IMAGE}
    counts = {name: f"{name} ({kind}, {count} messages)" for name, (kind, count) in topics.items()}
    listed = ", ".join(counts[name] for name in sorted(images or topics))
    if topic is None and len(images) == 1:
        return next(iter(images))
    if topic is not None and topic in images:
        return topic
    if not images:
        raise mismatch(path, "a topic of images", listed or "a bag without topics")
    if topic is None:
        several = f"expected the topic of the images, as there are several: {listed}"
        raise SurefixValueError(f"{path}: {several}")
    raise mismatch(path, f"an image topic, one of {listed}", repr(topic))


def _reason(error: Exception) -> str:
    text = str(error.args[0]) if len(error.args) == 1 else str(error)
    return text.rstrip(".") or type(error).__name__
