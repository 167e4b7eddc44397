"""MCAP files that rosbags does not read: of ROS 1, of Foxglove's protobuf, and those cut short."""

from collections import Counter
from collections.abc import Generator, Iterable
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO, NamedTuple

from surefix._extra import require
from surefix.errors import mismatch


class Channel(NamedTuple):
    """A topic's messages of one type."""

    topic: str
    msgtype: str
    msgcount: int
    number: int


class McapStream:
    """A file's records from its start, as far as they go, in the place of a reader of rosbags.

    Attributes
    ----------
    damage : str
        Why it ends before it should; empty if it does not.

    Raises
    ------
    SurefixError
        If the package mcap is missing; a SurefixValueError if the file has no messages that can be
        decoded.
    """

    def __init__(self, path: Path) -> None:
        self._reader = require("mcap.stream_reader", "this MCAP file", "mcap", "surefix[bags]")
        self._records = require("mcap.records", "this MCAP file", "mcap", "surefix[bags]")
        self._path, self.damage = path, ""
        self._decoders: dict[str, Any] = {}
        schemas: dict[int, Any] = {}
        channels: dict[int, Any] = {}
        counts: Counter[int] = Counter()
        for record in self._all():
            if isinstance(record, self._records.Schema):
                schemas[record.id] = record
            elif isinstance(record, self._records.Channel):
                channels[record.id] = record
            elif isinstance(record, self._records.Message):
                counts[record.channel_id] += 1
        self.connections: list[Channel] = []
        for number, channel in channels.items():
            schema = schemas.get(channel.schema_id)
            kind = _kind(schema.name) if schema is not None else "unknown"
            self.connections.append(Channel(channel.topic, kind, counts[number], number))
            # A type that cannot be decoded is of no use to anybody, and no reason to stop.
            with suppress(Exception):
                self._decoders[kind] = _decoder(channel.message_encoding, schema, kind)
        if not counts or not self._decoders:
            raise mismatch(path, "messages of ROS or of protobuf", "none that can be read")

    @property
    def topics(self) -> dict[str, Channel]:
        """By name; of several types, the first."""
        found: dict[str, Channel] = {}
        for each in self.connections:
            before = found.get(each.topic)
            more = 0 if before is None else before.msgcount
            found[each.topic] = (before or each)._replace(msgcount=each.msgcount + more)
        return found

    def messages(
        self, connections: Iterable[Channel]
    ) -> Generator[tuple[Channel, int, bytes], None, None]:
        """The channel of each message, the time of its recording, and its bytes."""
        wanted = {each.number: each for each in connections}
        for record in self._all():
            if isinstance(record, self._records.Message) and record.channel_id in wanted:
                yield wanted[record.channel_id], record.log_time, record.data

    def deserialize(self, data: bytes, kind: str) -> Any:
        """The message."""
        return self._decoders[kind](data)

    def close(self) -> None:
        """Nothing is open between two readings."""

    def _all(self) -> Generator[Any, None, None]:
        with self._path.open("rb") as file:
            try:
                # No record is longer than the file, whatever it says.
                most = self._path.stat().st_size
                read = self._reader.StreamReader(_Records(file), record_size_limit=most)
                yield from read.records
            except Exception as error:  # It depends on where it is cut.
                self.damage = str(error) or type(error).__name__


class _Records:
    """A file's bytes, up to a record of the kind 0, which there is not: what follows is no part of
    it, such as the zeros of a file that was made longer than it is.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def read(self, size: int) -> bytes:
        """The next ``size`` bytes; a single one is the kind of a record."""
        data = self._file.read(size)
        if size == 1 and data == b"\0":
            raise ValueError("a record of the kind 0, which there is not")
        return data


def _kind(name: str) -> str:
    """The name of a type as ROS 2 has it."""
    if name.startswith("foxglove."):
        return name.replace("foxglove.", "foxglove_msgs/msg/")
    package, _, kind = name.rpartition("/")
    return f"{package}/msg/{kind}" if package and "/" not in package else name


def _decoder(encoding: str, schema: Any, kind: str) -> Any:
    if encoding == "protobuf":
        protobuf = require(
            "mcap_protobuf.decoder", "this MCAP file", "mcap-protobuf-support", "surefix[bags]"
        )
        decode = protobuf.DecoderFactory().decoder_for(encoding, schema)
        return lambda data: _as_ros(decode(data), kind)
    typesys = require("rosbags.typesys", "a bag", "rosbags", "surefix[bags]")
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    store.register(typesys.get_types_from_msg(schema.data.decode(), kind))
    decode = {"cdr": store.deserialize_cdr, "ros1": store.deserialize_ros1}[encoding]
    return lambda data: decode(data, kind)


def _as_ros(message: Any, kind: str) -> Any:
    """A message of protobuf with the fields and the stamp of ROS 2's."""
    fields = {field.name: getattr(message, field.name) for field in message.DESCRIPTOR.fields}
    if "timestamp" in fields:
        at = fields["timestamp"]
        fields["timestamp"] = SimpleNamespace(sec=at.seconds, nanosec=at.nanos)
    return SimpleNamespace(__msgtype__=kind, **fields)
