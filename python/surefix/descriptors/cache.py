"""Descriptors in a file that grows as they are made, so that an interruption costs no more than a
batch.

The file is a header and then one record an image: the vector, eight bytes that tell the image from
others, and a checksum over both and the record's number. A record that was torn when the writer
died, or that the disk lost, does not pass its checksum, and it and what follows it are made again.
"""

import contextlib
import json
import os
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from surefix.descriptors.recipe import same_vectors
from surefix.descriptors.source import DIGEST, Item
from surefix.errors import SurefixFileError, SurefixValueError

__all__ = ["Cache"]

MAGIC = b"surefix descriptors 1\n"
# The header's length, in text of this many bytes, follows the first line.
LENGTH = 12
# Words after the vector: two of the image's digest, one of the checksum.
WORDS = DIGEST // 4 + 1
LONGEST_HEADER = 100_000_000


class Cache:
    """The file of one descriptor's vectors, open for writing by one process.

    Parameters
    ----------
    path : path
    name, recipe
        Of the descriptor; a file made by another is refused.

    Raises ------ SurefixValueError Where the file is no cache, is one of another descriptor, or is
    written to by another process. SurefixFileError Where the operating system refuses it.
    """

    def __init__(self, path: Path, name: str, recipe: Mapping[str, object]) -> None:
        self.path = path
        self.dim: int | None = None
        self.rows = 0
        # The record that ``expect`` looks at next.
        self.checked = 0
        self._offset = 0
        try:
            self._maker = json.loads(json.dumps({"name": name, "recipe": dict(recipe)}))
        except (TypeError, ValueError) as error:
            raise SurefixValueError(
                f"{name}: expected a recipe that JSON can hold, got one that it cannot: {error}"
            ) from None
        try:
            self._file: BinaryIO = open(path, "r+b" if path.exists() else "x+b")  # noqa: SIM115 (closed by close)
        except OSError as error:
            raise SurefixFileError(
                f"{path}: cannot open the cache: {error.strerror or error}"
            ) from None
        try:
            self._lock()
            if os.path.getsize(path):
                self._read()
        except BaseException:
            self._file.close()
            raise

    def close(self) -> None:
        """Lets the file go; one that nothing was written to is taken away."""
        self._file.close()
        if self.dim is None:
            self.path.unlink(missing_ok=True)

    def expect(self, items: Sequence[Item]) -> None:
        """Checks that the next records are of these images, in this order.

        Raises
        ------
        SurefixValueError
            Where one is of another image, or of the same file as it was before it was changed.
        """
        for item in items:
            if item.digest() != self._digest(self.checked):
                raise SurefixValueError(
                    f"{self.path}: expected the cache of these images, got one whose record {self.checked} is not of "
                    f"{item.name} as it is now; name another file, or delete this one to begin anew"
                )
            self.checked += 1

    def append(self, digests: Sequence[bytes], vectors: npt.NDArray[np.float32]) -> None:
        """Adds the vectors of some images; after it the operating system has them, whatever happens
        to the process.
        """
        if self.dim is None:
            self.dim = vectors.shape[1]
            header = json.dumps({"dim": self.dim, **self._maker}).encode()
            self._write(MAGIC + f"{len(header):<{LENGTH - 1}}\n".encode() + header)
            self._write(b" " * (-self._file.tell() % 64))
            self._offset = self._file.tell()
        elif vectors.shape[1] != self.dim:
            raise SurefixValueError(
                f"{self.path}: expected vectors of {self.dim} numbers as in the cache, got {vectors.shape[1]}"
            )
        records = []
        for row, (digest, vector) in enumerate(zip(digests, vectors, strict=True), self.rows):
            body = vector.astype("<f4").tobytes() + digest
            records.append(body + _checksum(body, row))
        self._write(b"".join(records))
        self.rows += len(digests)

    def result(self) -> npt.NDArray[np.float32]:
        """All vectors, (n, dim), memory-mapped and read-only."""
        assert self.dim is not None
        shape = (self.rows, self.dim + WORDS)
        mapped = np.memmap(self.path, dtype="<f4", mode="r", offset=self._offset, shape=shape)
        return mapped[:, : self.dim]

    def _read(self) -> None:
        header = self._header()
        # A writer that died before it had written the header has left nothing else.
        if header is None:
            self._restart(0)
            return
        theirs = {"name": header.get("name"), "recipe": header.get("recipe")}
        if not _same_maker(self._maker, theirs):
            raise SurefixValueError(
                f"{self.path}: expected a cache of {self._maker['name']}, got one of {theirs['name']}"
                f"{_difference(self._maker, theirs)}; name another file, or delete this one to begin anew"
            )
        dim = header.get("dim")
        if not isinstance(dim, int) or dim < 1:
            raise SurefixValueError(
                f"{self.path}: expected a cache of descriptors, got a header with the dim {dim!r}"
            )
        self.dim = dim
        self._offset = self._file.tell() + -self._file.tell() % 64
        self.rows = self._whole_records()
        self._restart(self._offset + self.rows * self._stride)

    def _header(self) -> dict[str, object] | None:
        start = self._file.read(len(MAGIC))
        if not start or not MAGIC.startswith(start):
            raise SurefixValueError(
                f"{self.path}: expected a cache of descriptors, got another kind of file"
            )
        length = self._file.read(LENGTH)
        if start != MAGIC or len(length) < LENGTH:
            return None
        size = int(length) if length.strip().isdigit() else -1
        if not 0 < size <= LONGEST_HEADER:
            raise SurefixValueError(
                f"{self.path}: expected a cache of descriptors, got a damaged header"
            )
        text = self._file.read(size)
        if len(text) < size:
            return None
        try:
            header = json.loads(text)
        except ValueError as error:
            raise SurefixValueError(
                f"{self.path}: expected a cache of descriptors, got a damaged header: {error}"
            ) from None
        if not isinstance(header, dict):
            raise SurefixValueError(
                f"{self.path}: expected a cache of descriptors, got a damaged header"
            )
        return header

    def _whole_records(self) -> int:
        self._file.seek(self._offset)
        row = 0
        while len(record := self._file.read(self._stride)) == self._stride:
            if record[-4:] != _checksum(record[:-4], row):
                break
            row += 1
        return row

    @property
    def _stride(self) -> int:
        assert self.dim is not None
        return 4 * (self.dim + WORDS)

    def _digest(self, row: int) -> bytes:
        self._file.seek(self._offset + (row + 1) * self._stride - 4 * WORDS)
        digest = self._file.read(DIGEST)
        self._file.seek(0, os.SEEK_END)
        return digest

    def _restart(self, size: int) -> None:
        self._file.truncate(size)
        self._file.seek(size)

    def _write(self, data: bytes) -> None:
        try:
            self._file.write(data)
            self._file.flush()
        except OSError as error:
            raise SurefixFileError(
                f"{self.path}: cannot write the cache: {error.strerror or error}"
            ) from None

    def _lock(self) -> None:
        # Where there are no such locks, as on Windows, nothing keeps two processes apart.
        with contextlib.suppress(ModuleNotFoundError):
            import fcntl

            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise SurefixValueError(
                    f"{self.path}: another process is writing to this cache"
                ) from None


def _checksum(body: bytes, row: int) -> bytes:
    return zlib.crc32(body, zlib.crc32(row.to_bytes(8, "little"))).to_bytes(4, "little")


def _same_maker(ours: dict[str, object], theirs: dict[str, object]) -> bool:
    first, second = ours["recipe"], theirs["recipe"]
    if not isinstance(first, dict) or not isinstance(second, dict):
        return ours == theirs
    return same_vectors({**first, "name": ours["name"]}, {**second, "name": theirs["name"]})


def _difference(ours: dict[str, object], theirs: dict[str, object]) -> str:
    first, second = ours["recipe"], theirs["recipe"]
    if (
        ours["name"] != theirs["name"]
        or not isinstance(first, dict)
        or not isinstance(second, dict)
    ):
        return ""
    keys = [key for key in {**first, **second} if first.get(key) != second.get(key)]
    return "".join(
        f", whose {key} is {second.get(key)!r}, not {first.get(key)!r}" for key in keys[:1]
    )
