"""Descriptors in a database that grows as they are made: an interruption costs at most a batch.

SQLite makes each batch whole or absent, even if the process is killed, and lets several processes
use one file. A row has a checksum: a row that the disk damaged, and those after it, are made again.
"""

import json
import sqlite3
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix.descriptors.descriptor import same_vectors
from surefix.errors import SurefixFileError, SurefixValueError, mismatch

# In the header of the file, so that no other database is taken for a cache.
APPLICATION = 0x53464458
# In seconds: the wait for another process to end its batch.
TIMEOUT = 60.0
ANEW = "name another file, or delete this one to begin anew"


class Cache:
    """The vectors of one descriptor for images in order; a file made by another is refused."""

    def __init__(self, path: Path, name: str, recipe: Mapping[str, object]) -> None:
        self.path = path
        self.dim: int | None = None
        self.rows = 0
        # The row that ``expect`` looks at next.
        self.checked = 0
        self._file: sqlite3.Connection | None = None
        try:
            self._maker = json.dumps({"name": name, "recipe": dict(recipe)})
        except (TypeError, ValueError) as error:
            got = f"one that it cannot: {error}"
            raise mismatch(name, "a recipe that JSON can hold", got) from None
        if path.exists():
            try:
                self._open()
            except BaseException:
                self.close()
                raise

    def close(self) -> None:
        """Closes the file."""
        if self._file is not None:
            self._file.close()

    def expect(self, name: str, digest: bytes) -> None:
        """Checks that the next row is of this image."""
        with self._access() as file:
            self._check(file, self.checked, name, digest)
        self.checked += 1

    def append(
        self, names: Sequence[str], digests: Sequence[bytes], vectors: npt.NDArray[np.float32]
    ) -> None:
        """Adds the vectors of some images, all of them or none."""
        if self._file is None:
            self._open()
            # Another process may have begun meanwhile. Its rows stay, and are checked below.
            self.rows = 0
        if self.dim is None:
            self.dim = vectors.shape[1]
        if vectors.shape[1] != self.dim:
            expected = f"vectors of {self.dim} numbers as in the cache"
            raise mismatch(self.path, expected, vectors.shape[1])
        records = enumerate(zip(names, digests, vectors, strict=True), self.rows)
        with self._access() as file:
            for row, (name, digest, vector) in records:
                body = vector.astype("<f4").tobytes()
                record = (row, digest, body, _checksum(row, digest, body))
                file.execute("INSERT OR IGNORE INTO vectors VALUES (?, ?, ?, ?)", record)
                self._check(file, row, name, digest)
        self.rows += len(digests)

    def result(self) -> npt.NDArray[np.float32]:
        """All vectors, (n, dim), read-only."""
        assert self.dim is not None
        result = np.empty((self.rows, self.dim), np.float32)
        with self._access() as file:
            for row, body in file.execute("SELECT row, vector FROM vectors ORDER BY row"):
                if row < self.rows:
                    result[row] = np.frombuffer(body, "<f4")
        result.flags.writeable = False
        return result

    def _open(self) -> None:
        """Makes the tables if the file is empty; else counts the rows that are whole."""
        try:
            self._file = sqlite3.connect(self.path, TIMEOUT)
        except sqlite3.Error as error:
            raise SurefixFileError(f"{self.path}: cannot open the cache: {error}") from None
        with self._access() as file:
            # Before anything is read: of two processes that begin, one makes the tables.
            file.execute("BEGIN IMMEDIATE")
            (application,) = file.execute("PRAGMA application_id").fetchone()
            if not file.execute("SELECT 1 FROM sqlite_master").fetchone():
                file.execute(f"PRAGMA application_id = {APPLICATION}")
                file.execute("CREATE TABLE maker (maker TEXT)")
                file.execute("INSERT INTO maker VALUES (?)", (self._maker,))
                fields = "row INTEGER PRIMARY KEY, digest BLOB, vector BLOB, checksum INTEGER"
                file.execute(f"CREATE TABLE vectors ({fields})")
            elif application != APPLICATION:
                raise self._no_cache("another database")
            (state,) = file.execute("PRAGMA quick_check(1)").fetchone()
            if state != "ok":
                raise self._no_cache(f"a damaged one ({state})")
            self._check_maker(file.execute("SELECT maker FROM maker").fetchone())
            for row, digest, body, checksum in file.execute("SELECT * FROM vectors ORDER BY row"):
                if row != self.rows or checksum != _checksum(row, digest, body):
                    break
                self.dim, self.rows = len(body) // 4, self.rows + 1
            file.execute("DELETE FROM vectors WHERE row >= ?", (self.rows,))

    @contextmanager
    def _access(self) -> Iterator[sqlite3.Connection]:
        """The file, in one transaction."""
        assert self._file is not None
        try:
            with self._file:
                yield self._file
        except sqlite3.OperationalError as error:
            raise SurefixFileError(f"{self.path}: cannot use the cache: {error}") from None
        except sqlite3.Error as error:
            raise self._no_cache(f"another kind of file, or a damaged one ({error})") from None

    def _check(self, file: sqlite3.Connection, row: int, name: str, digest: bytes) -> None:
        found = file.execute("SELECT digest FROM vectors WHERE row = ?", (row,)).fetchone()
        if found != (digest,):
            got = f"one whose record {row} is not of {name} as it is now; {ANEW}"
            raise mismatch(self.path, "the cache of these images", got)

    def _no_cache(self, got: str) -> SurefixValueError:
        return mismatch(self.path, "a cache of descriptors", f"{got}; {ANEW}")

    def _check_maker(self, row: Any) -> None:
        ours = json.loads(self._maker)
        try:
            theirs = json.loads(row[0])
            first, second = ours["recipe"], dict(theirs["recipe"])
        except (TypeError, ValueError, KeyError) as error:
            raise self._no_cache(f"a damaged one: {error}") from None
        if same_vectors({**first, "name": ours["name"]}, {**second, "name": theirs["name"]}):
            return
        differing = [key for key in {**first, **second} if first.get(key) != second.get(key)]
        difference = "".join(
            f", whose {key} is {second.get(key)!r}, not {first.get(key)!r}"
            for key in differing[:1]
            if ours["name"] == theirs["name"]
        )
        got = f"one of {theirs['name']}{difference}; {ANEW}"
        raise mismatch(self.path, f"a cache of {ours['name']}", got)


def _checksum(row: int, digest: Any, body: Any) -> int:
    try:
        return zlib.crc32(body, zlib.crc32(digest, row))
    except TypeError:
        return -1
