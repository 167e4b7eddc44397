"""The files of a map: opened whole but for their rows, and the rows that a shard needs.

A file of this machine is mapped into memory. Of a file in an object store, everything but the rows
is fetched into a sparse local file of the same layout, which is mapped; a shard fetches its own
rows, too.
"""

import hashlib
import json
import tempfile
from collections.abc import Iterable, Iterator
from os import PathLike, fspath
from pathlib import Path
from typing import Any, NamedTuple

from surefix._core import Map
from surefix._extra import require
from surefix.errors import SurefixError, SurefixFileError, mismatch

__all__ = ["Source", "sources"]

# docs/reference/map-file.md.
MAX_HEADER = 8 << 20
ROWS = ("descriptors", "traverse.rows")
PICTURES = "thumbnails"
# Bytes of one request, and of the ends by which a file without a checksum is known.
PIECE = 16 << 20
ENDS = 1 << 20

Ranges = Iterable[tuple[int, int]]


def sources(given: object) -> "list[Source]":
    """A source for each file."""
    names = [given] if isinstance(given, (str, PathLike)) else given
    expected = "a Map, or the path or URL of a map's file, or several of them"
    if not isinstance(names, Iterable):
        raise mismatch("map", expected, type(given).__name__)
    found = list(names)
    if not found:
        raise mismatch("map", expected, "none")
    for name in found:
        if not isinstance(name, (str, PathLike)):
            raise mismatch("map", expected, type(name).__name__)
    return [
        _InStore(fspath(n)) if "://" in fspath(n) else Source(str(Path(n).absolute()))
        for n in found
    ]


class _Head(NamedTuple):
    """The file's length, the byte at which its tensors begin, their entries, whether its rows need
    norms, and its identity.
    """

    size: int
    base: int
    entries: dict[str, Any]
    cosine: bool
    identity: str


class Source:
    """A map's file on this machine, by its name."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._known: _Head | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.name,)

    def identity(self) -> str:
        """The same for the same file on another machine, if it has a checksum; without, as far as
        length, header and both ends say.
        """
        return self._head().identity

    def open(self, places: Ranges = ()) -> Map:
        """The map, mapped into memory. Only the rows of these places may be read."""
        return Map.open(self.name, mmap=True)

    def _size(self) -> int:
        try:
            return Path(self.name).stat().st_size
        except OSError as error:
            raise self._refused(error) from None

    def _read(self, start: int, stop: int) -> bytes:
        try:
            with open(self.name, "rb") as file:
                file.seek(start)
                return file.read(stop - start)
        except OSError as error:
            raise self._refused(error) from None

    def _refused(self, error: Exception) -> SurefixFileError:
        why = getattr(error, "strerror", None) or error
        return SurefixFileError(f"{self.name}: cannot read the map: {why}")

    def _bytes(self, start: int, stop: int) -> bytes:
        data = self._read(start, stop)
        if len(data) != stop - start:
            raise mismatch(f"{self.name}: bytes {start} to {stop}", stop - start, len(data))
        return data

    def _head(self) -> _Head:
        if self._known is None:
            size = self._size()
            length = int.from_bytes(self._bytes(0, 8), "little") if size >= 8 else size
            if length > min(MAX_HEADER, size - 8):
                raise mismatch(self.name, "a surefix map", f"a file of {size} bytes")
            raw = self._bytes(8, 8 + length)
            try:
                entries = json.loads(raw)
                cosine = json.loads(entries.pop("__metadata__")["surefix"])["metric"] == "cosine"
            except (AttributeError, KeyError, TypeError, ValueError):
                raise mismatch(self.name, "a surefix map", "another file") from None
            sure = "checksum" in entries
            ends = (self._bytes(size - 8, size),) if sure else self._ends(size)
            digest = hashlib.sha256(b"".join([str(size).encode(), raw, *ends])).hexdigest()
            self._known = _Head(size, 8 + length, entries, cosine, digest)
        return self._known

    def _ends(self, size: int) -> tuple[bytes, bytes]:
        short = min(ENDS, size)
        return self._bytes(0, short), self._bytes(size - short, size)


class _InStore(Source):
    """A map's file in an object store, by a URL that fsspec knows."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        what = f"{name}: an object store"
        fsspec = require("fsspec", what, "fsspec", "surefix[ray]")
        try:
            self._files, self._path = fsspec.core.url_to_fs(name)
        # A protocol that it does not know, or whose package is missing.
        except (ImportError, ValueError) as error:
            raise SurefixError(f"{name}: {error}") from None

    def open(self, places: Ranges = ()) -> Map:
        head = self._head()
        self._check(head)
        # The mapping keeps it once its name is gone: nothing is left of a process that dies.
        with tempfile.NamedTemporaryFile(prefix="surefix-shard-") as file:
            file.truncate(head.size)
            # The rows' places are known once the rest is there.
            self._fetch(file, self._beside(head))
            places = list(places)
            if places:
                self._fetch(file, self._rows(head, places, Map.open(file.name, mmap=True)))
            return Map.open(file.name, mmap=True)

    def _check(self, head: _Head) -> None:
        """Refuses a file whose rows would all have to be read to open it."""
        wanted = ["blank", *(["norms"] if head.cosine else [])]
        if ROWS[1] in head.entries:
            wanted += [f"traverse.{name}" for name in wanted]
        for name in wanted:
            if name not in head.entries:
                expected = f'the tensor "{name}", as Map.save writes it'
                raise mismatch(self.name, expected, "none: save it anew")

    def _beside(self, head: _Head) -> Iterator[tuple[int, int]]:
        """The bytes of the header, and of all tensors but rows and pictures."""
        yield 0, head.base
        for name, entry in head.entries.items():
            if name not in (*ROWS, PICTURES):
                start, stop = entry["data_offsets"]
                yield head.base + start, head.base + stop

    def _rows(self, head: _Head, places: Ranges, route: Map) -> Iterator[tuple[int, int]]:
        """The bytes of the rows of these places, of all traverses."""
        start, stop = head.entries[ROWS[0]]["data_offsets"]
        width = (stop - start) // len(route)
        at = head.base + start
        for low, high in places:
            yield at + low * width, at + high * width
        further = route.traverses[1:]
        at = head.base + head.entries[ROWS[1]]["data_offsets"][0] if further else 0
        for traverse in further:
            for span in places:
                low, high = (int(row) for row in traverse.places.searchsorted(span))
                yield at + low * width, at + high * width
            at += traverse.rows * width

    def _fetch(self, file: Any, spans: Iterable[tuple[int, int]]) -> None:
        for start, stop in spans:
            for at in range(start, stop, PIECE):
                file.seek(at)
                file.write(self._bytes(at, min(at + PIECE, stop)))
        file.flush()

    def _size(self) -> int:
        try:
            return int(self._files.size(self._path))
        # Stores raise what their clients raise.
        except Exception as error:
            raise self._refused(error) from None

    def _read(self, start: int, stop: int) -> bytes:
        try:
            return bytes(self._files.cat_file(self._path, start=start, end=stop))
        except Exception as error:
            raise self._refused(error) from None


def joined(maps: list[Map]) -> Map:
    """Several files' maps as one."""
    return maps[0] if len(maps) == 1 else Map.join(maps)


def places_of(counts: Iterable[int], places: Ranges) -> list[list[tuple[int, int]]]:
    """Ranges of places of the joined map as ranges of each file's."""
    found, first = [], 0
    ranges = list(places)
    for count in counts:
        own = [(max(a, first) - first, min(b, first + count) - first) for a, b in ranges]
        found.append([(a, b) for a, b in own if a < b])
        first += count
    return found
