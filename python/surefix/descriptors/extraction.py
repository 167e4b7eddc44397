"""Describes all images of a drive: batch by batch, with a bar, and so that it can go on where it
was interrupted.
"""

import os
from collections.abc import Callable, Iterable, Iterator
from itertools import chain, islice
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from surefix._progress import terminal_bar
from surefix.descriptors.cache import Cache
from surefix.descriptors.descriptor import Descriptor, checked_rows, require_descriptor
from surefix.descriptors.source import Loaded, Source
from surefix.errors import SurefixError, SurefixFileError, SurefixValueError

if TYPE_CHECKING:
    from surefix._core import Traverse

__all__ = ["extract"]

BATCH = 8
Progress = Callable[[int, int], bool | None]
Rows = npt.NDArray[np.float32]


def extract(
    images: "str | PathLike[str] | Iterable[Any] | npt.NDArray[np.uint8] | Traverse",
    descriptor: Descriptor,
    *,
    batch: int | None = None,
    cache: str | PathLike[str] | None = None,
    progress: Progress | Literal[False] | None = None,
) -> Rows:
    """Describes images one batch after the other.

    Parameters ---------- images As for ``Map.from_images``: a folder, a pattern like
    ``route/*.png``, paths, uint8 arrays (H, W) or (H, W, 3), a data set's images or a generated
    traverse; and a generator of any of these, or of a stream's frames. They are read a few ahead;
    no more than two batches are held. descriptor : Descriptor batch : int, optional Images a call
    of ``describe``; the descriptor's own ``batch`` by default, else 8. cache : path, optional A
    file that the vectors are added to as they are made. Where a run was interrupted, however hard,
    the next one goes on from the last whole vector; where all is there, nothing is described again.
    Files count as the same by name, size and time, arrays by their pixels. More images at the end
    go on with the same file. progress : callable, optional Called as ``progress(done, total)``
    after each batch; False from it stops. None is a bar on a terminal, False is nothing. Where
    nobody knows the total, it is one more than what is done.

    Returns
    -------
    array of float32, shape (n, dim)
        Memory-mapped and read-only where there is a cache.

    Raises ------ SurefixValueError Where an image or what the descriptor makes of it is not what it
    must be, or the cache is of another descriptor or of other images; it is then left as it is.
    SurefixFileError Where a file cannot be read or written. SurefixError Where ``progress`` stopped
    it. What is in the cache stays there.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.descriptors import extract
    >>> class Brightness:
    ...     name = "brightness"
    ...     recipe = {"name": "brightness"}
    ...     def describe(self, images):
    ...         return np.array([[image.mean(), image.std()] for image in images], np.float32)
    >>> images = np.arange(5 * 4 * 6, dtype=np.uint8).reshape(5, 4, 6)
    >>> extract(images, Brightness(), batch=2).shape
    (5, 2)
    """
    descriptor = require_descriptor(descriptor)
    size = batch if batch is not None else getattr(descriptor, "batch", BATCH)
    if not isinstance(size, int) or size < 1:
        raise SurefixValueError(f"batch: expected a whole number of at least 1, got {size!r}")
    source = Source(images)
    bar = _Bar(terminal_bar("Describing") if progress is None else progress or None, source.count)
    if cache is None:
        return _collect(_described(source.batches(size), descriptor), source.count, bar)
    path = Path(os.fspath(cache))
    if not path.absolute().parent.is_dir():
        raise SurefixFileError(
            f"{path}: cannot write the cache: there is no folder {path.absolute().parent}"
        )
    kept = Cache(path, descriptor.name, descriptor.recipe)
    try:
        if source.count is not None and kept.rows > source.count:
            raise SurefixValueError(
                f"{path}: expected the cache of these {source.count} images, got one of {kept.rows}; "
                "name another file, or delete this one to begin anew"
            )
        items = source.items()
        known = kept.rows
        for checked in iter(lambda: list(islice(items, min(size, known - kept.checked))), []):
            kept.expect(checked)
        if kept.checked < known:
            raise SurefixValueError(
                f"{path}: expected the cache of these {kept.checked} images, got one of {known}; "
                "name another file, or delete this one to begin anew"
            )
        bar.show(kept.rows)
        for described in _described(source.batches(size, items, digests=True), descriptor):
            kept.append(described.digests, described.rows)
            bar.show(kept.rows)
        if kept.rows == 0:
            raise SurefixValueError("images: expected at least one, got none")
        bar.end(kept.rows)
        return kept.result()
    finally:
        kept.close()


class _Described(NamedTuple):
    names: list[str]
    digests: list[bytes]
    rows: Rows


def _described(batches: Iterator[list[Loaded]], descriptor: Descriptor) -> Iterator[_Described]:
    for batch in batches:
        names = [loaded.name for loaded in batch]
        digests = [loaded.digest for loaded in batch]
        try:
            vectors = descriptor.describe([loaded.image for loaded in batch])
        except SurefixValueError as error:
            raise SurefixValueError(f"images {names[0]} to {names[-1]}: {error}") from None
        rows = checked_rows(
            vectors, len(batch), descriptor.name, [f"image {name}" for name in names]
        )
        # The next batch is not read before this one is gone.
        del batch
        yield _Described(names, digests, rows)


def _collect(described: Iterator[_Described], count: int | None, bar: "_Bar") -> Rows:
    first = next(described, None)
    if first is None:
        raise SurefixValueError("images: expected at least one, got none")
    dim = first.rows.shape[1]
    # Twice as long whenever it is full, where nobody knows how many will come.
    rows = np.empty((count or 2 * len(first.names), dim), np.float32)
    done = 0
    for names, _, vectors in chain([first], described):
        if vectors.shape[1] != dim:
            raise SurefixValueError(
                f"image {names[0]}: expected a vector of {dim} numbers as before, got {vectors.shape[1]}"
            )
        if done + len(names) > len(rows):
            rows = np.concatenate([rows, np.empty((max(len(rows), len(names)), dim), np.float32)])
        rows[done : done + len(names)] = vectors
        done += len(names)
        bar.show(done)
    bar.end(done)
    return rows[:done]


class _Bar:
    def __init__(self, report: Progress | None, total: int | None) -> None:
        self.report, self.total = report, total

    def show(self, done: int) -> None:
        total = done + 1 if self.total is None else self.total
        if self.report is not None and self.report(done, total) is False:
            raise SurefixError(f"stopped after {done} of {total}")

    def end(self, done: int) -> None:
        """The last word, where only the end tells how many there were."""
        if self.report is not None and self.total is None:
            self.report(done, done)
