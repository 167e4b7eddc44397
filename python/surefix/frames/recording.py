"""The bags of one drive as one: ROS 1, ROS 2 and MCAP, by rosbags, without ROS."""

from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass, field
from heapq import merge
from os import PathLike, fspath
from pathlib import Path
from typing import Any, NamedTuple

from surefix._core import find_images
from surefix._extra import require
from surefix._words import plural
from surefix.errors import (
    SurefixError,
    SurefixFileError,
    SurefixValueError,
    mismatch,
    refusal,
)
from surefix.frames.mcap_stream import McapStream
from surefix.tables.regular import check_regular

Place = str | PathLike[str]

BAG_ENDINGS = frozenset({".bag", ".db3", ".mcap"})
MEND = {
    ".bag": "rosbag reindex",
    ".mcap": "mcap recover",
    ".db3": "ros2 bag reindex",
    "": "ros2 bag reindex",
}
# Bags of ROS 2 before Iron do not define their messages; those of ROS itself never changed.
DEFINITIONS = {
    "foxglove_msgs/msg/CompressedVideo": (
        "builtin_interfaces/Time timestamp\nstring frame_id\nuint8[] data\nstring format\n"
    ),
    "ffmpeg_image_transport_msgs/msg/FFMPEGPacket": (
        "std_msgs/Header header\nint32 width\nint32 height\nstring encoding\nuint64 pts\n"
        "uint8 flags\nbool is_bigendian\nuint8[] data\n"
    ),
}


@dataclass(frozen=True)
class Topic:
    """The type of a topic's messages, and their number."""

    kind: str
    count: int


class Message(NamedTuple):
    """A message as it was recorded: when, in nanoseconds, by which file, and its content, or the
    reason why there is none; ``where`` is its name in an error.
    """

    recorded: int
    file: int
    content: Any
    where: str
    damage: str = ""


@dataclass(eq=False)
class Recording:
    """Open bags, of which each file has its own reader.

    Attributes
    ----------
    files : list of str
    topics : dict of Topic
        By name, those of all files.
    skip_bad : bool
        Whether the end of a damaged file is no damaged message.
    remarks : list of str
        What is damaged, and so passed over.
    """

    files: list[str]
    readers: list[Any]
    name: str
    skip_bad: bool = False
    remarks: list[str] = field(default_factory=list)
    topics: dict[str, Topic] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for reader in self.readers:
            for name, info in reader.topics.items():
                before = self.topics.get(name, Topic(str(info.msgtype), 0))
                self.topics[name] = Topic(before.kind, before.count + int(info.msgcount))

    def messages(self, topic: str) -> Generator[Message, None, None]:
        """The messages of a topic in the order in which they were recorded, over all files."""
        with ExitStack() as stack:
            parts = [
                stack.enter_context(closing(self._of(file, topic)))
                for file in range(len(self.files))
            ]
            for number, message in enumerate(merge(*parts, key=lambda each: each.recorded)):
                name = self.files[message.file] if len(self.files) > 1 else self.name
                yield message._replace(where=f"{name}, {topic}, message {number}")

    def _of(self, file: int, topic: str) -> Generator[Message, None, None]:
        reader = self.readers[file]
        connections = [each for each in reader.connections if each.topic == topic]
        if not connections:
            return
        count, total = 0, sum(int(each.msgcount) for each in connections)
        last = 0
        with closing(reader.messages(connections=connections)) as found:
            while True:
                try:
                    one = next(found, None)
                except Exception as error:  # It depends on the damaged bytes.
                    if not self.skip_bad:
                        yield Message(last, file, None, "", f"a damaged bag: {reason(error)}")
                    lost = plural(max(total - count, 0), "message")
                    self._remark(
                        f"{self.files[file]}: damaged: the last {lost} of {topic} cannot be read "
                        f"({reason(error)})"
                    )
                    return
                if one is None:
                    return
                connection, last, data = one
                count += 1
                try:
                    content = reader.deserialize(data, connection.msgtype)
                except Exception as error:  # As above.
                    yield Message(last, file, None, "", f"a damaged bag: {reason(error)}")
                else:
                    yield Message(last, file, content, "")

    def _remark(self, text: str) -> None:
        # Once, however often it is read.
        if text not in self.remarks:
            self.remarks.append(text)


@contextmanager
def open_recording(place: Place | Sequence[Place], skip_bad: bool = False) -> Iterator[Recording]:
    """The open bags of a drive: a file, a ROS 2 bag's folder, a folder of either, a pattern, or a
    list of them. With ``skip_bad``, of several, damaged ones are passed over, and remarked.
    """
    require("rosbags", "a bag", "rosbags", "surefix[bags]")
    parts = bag_parts(place)
    name = fspath(place) if isinstance(place, (str, PathLike)) else fspath(parts[0])
    with ExitStack() as stack:
        files: list[str] = []
        readers: list[Any] = []
        errors: list[SurefixError] = []
        cut: list[str] = []
        waiting = list(parts)
        while waiting:
            part = waiting.pop(0)
            try:
                reader = _opened(part, skip_bad)
            except SurefixFileError:
                raise
            except SurefixError as error:
                inside = _inside(part) if skip_bad and part.is_dir() else []
                # Of a ROS 2 bag whose list of files is wrong, those that are there.
                waiting[:0] = inside
                errors.append(error)
                continue
            stack.callback(reader.close)
            files.append(fspath(part))
            readers.append(reader)
            if damage := getattr(reader, "damage", ""):
                cut.append(f"{part}: damaged: read as far as it goes ({damage})")
        if errors and not (skip_bad and readers):
            raise errors[0]
        remarks = [*cut, *(f"passed over: {error}" for error in errors)]
        yield Recording(files, readers, name, skip_bad, remarks)


def bag_parts(place: Place | Iterable[Place]) -> list[Path]:
    """The files and ROS 2 folders of a drive; a single file need not exist."""
    if not isinstance(place, (str, PathLike)):
        return [Path(part) for part in place]
    path = Path(place)
    if path.is_dir():
        return [path] if (path / "metadata.yaml").is_file() else _inside(path)
    if any(mark in fspath(place) for mark in "*?[") and not path.exists():
        root = Path(path.anchor) if path.is_absolute() else Path()
        found = sorted(root.glob(fspath(path.relative_to(path.anchor))))
        if found and all(_is_part(part) for part in found):
            return found
        return []
    return [path]


def is_bag(place: Place) -> bool:
    """Whether this is a bag by its name, or the folder of one or of several that has no images, or
    a pattern of them.
    """
    path = Path(place)
    if path.suffix.lower() in BAG_ENDINGS and not path.is_dir():
        return True
    if (path / "metadata.yaml").is_file():
        return True
    if not path.is_dir():
        pattern = any(mark in fspath(place) for mark in "*?[")
        return pattern and not path.exists() and bool(bag_parts(place))
    if not _inside(path):
        return False
    try:
        find_images(fspath(place))
    except SurefixError:
        return True
    return False


def is_bags(place: object) -> bool:
    """Whether this is a list of bags, none of anything else."""
    if isinstance(place, (str, PathLike)) or not isinstance(place, Sequence) or not place:
        return False
    return all(isinstance(part, (str, PathLike)) and _is_part(Path(part)) for part in place)


def reason(error: Exception) -> str:
    """The text of an error of rosbags."""
    text = str(error.args[0]) if len(error.args) == 1 else str(error)
    return text.rstrip(".") or type(error).__name__


def _is_part(path: Path) -> bool:
    return path.suffix.lower() in BAG_ENDINGS or (path / "metadata.yaml").is_file()


def _inside(folder: Path) -> list[Path]:
    return sorted(part for part in folder.iterdir() if _is_part(part))


def _opened(path: Path, skip_bad: bool) -> Any:
    highlevel = require("rosbags.highlevel", "a bag", "rosbags", "surefix[bags]")
    typesys = require("rosbags.typesys", "a bag", "rosbags", "surefix[bags]")
    if not path.exists():
        raise SurefixFileError(f"{path}: cannot read the bag: there is no such file or folder")
    # The files of a folder are opened one by one.
    for part in (path, *(path.iterdir() if path.is_dir() else ())):
        check_regular(part, "cannot read the bag", folder=True)
    usual = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    for kind, text in DEFINITIONS.items():
        usual.register(typesys.get_types_from_msg(text, kind))
    try:
        bag = highlevel.AnyReader([path], default_typestore=usual)
        bag.open()
    except PermissionError as error:
        raise refusal(path, "cannot read the bag", error) from None
    except Exception as error:  # It depends on the damaged bytes.
        if path.suffix.lower() == ".mcap" and path.is_file() and _has_data(path):
            with suppress(SurefixValueError):
                other = McapStream(path)
                if skip_bad or not other.damage:
                    return other
        expected = "a bag of ROS 1 or 2, or an MCAP file with messages of ROS or protobuf"
        got = f"none, or a damaged one ({reason(error)})"
        tool = MEND.get("" if path.is_dir() else path.suffix.lower())
        # A recorder that was interrupted has not written the index.
        mend = f"; if its recorder was interrupted: {tool}" if tool and _has_data(path) else ""
        raise SurefixValueError(f"{mismatch(path, expected, got)}{mend}") from None
    return bag


def _has_data(path: Path) -> bool:
    starts = (b"#ROSBAG", b"\x89MCAP", b"SQLite format 3")
    if path.is_dir():
        return True
    with path.open("rb") as file:
        return file.read(16).startswith(starts)
