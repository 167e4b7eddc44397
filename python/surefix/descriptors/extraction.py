"""Describes all images of a drive: batch by batch, with a bar, and a cache to resume from."""

import hashlib
import logging
import os
from collections import deque
from collections.abc import Generator, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from itertools import chain, islice
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from surefix._core import Sad
from surefix._progress import Bar, Progress, terminal_bar
from surefix._ray import mapped
from surefix.descriptors.cache import ANEW, Cache
from surefix.descriptors.descriptor import (
    Descriptor,
    checked_batch,
    checked_image,
    checked_rows,
    require_descriptor,
)
from surefix.errors import SurefixValueError, check_folder, mismatch, refusal
from surefix.frames.frame import Frames, IteratedFrames, Shot
from surefix.frames.images import frames_of
from surefix.frames.levels import in_8_bits
from surefix.frames.pillow import pixels_of

if TYPE_CHECKING:
    from surefix._core import Traverse

LOG = logging.getLogger("surefix")
BATCH = 8
# Bytes that tell one image from another: 2^-64 is the chance that two agree by accident.
DIGEST = 8
# Vectors of at most 8 numbers are points, and the origin is a point too.
POINT = 8
SAD = Sad()
THREADS = min(4, os.cpu_count() or 1)
Rows = npt.NDArray[np.float32]
# The name, digest and pixels of an image.
Loaded = tuple[str, bytes, npt.NDArray[np.uint8]]
# The names, digests and vectors of a batch.
Part = tuple[list[str], list[bytes], Rows]


def extract(
    images: "str | PathLike[str] | Iterable[Any] | npt.NDArray[np.uint8] | Traverse",
    descriptor: Descriptor,
    *,
    batch: int | None = None,
    cache: str | PathLike[str] | None = None,
    progress: Progress | Literal[False] | None = None,
    levels: tuple[int, int] | None = None,
) -> Rows:
    """Describes images one batch after the other.

    Parameters
    ----------
    images
        As for ``Map.from_images``: a folder, a pattern like ``route/*.png``, paths, uint8 arrays
        (H, W) or (H, W, 3), a data set's images or a generated traverse; and a generator of any of
        these, or ``surefix.frames.Frames``. They are read a few ahead; no more than two batches are
        held.
    descriptor : Descriptor
    batch : int, optional
        Images a call of ``describe``; the descriptor's own ``batch`` by default, else 8.
    cache : path, optional
        A file that the vectors are added to as they are made. After an interruption of any kind,
        the next run goes on from the last whole batch; if all is there, nothing is described again.
        Files are known by name, size and time, arrays by their pixels. More images at the end go on
        with the same file. Several processes may use it.
    progress : callable, optional
        Called as ``progress(done, total)`` after each batch; False from it stops. None is a bar on
        a terminal, False is nothing. An unknown total is one more than ``done``.
    levels : (int, int), optional
        The samples of uint16 images that become black and white, such as ``Map.levels``; by default
        all 16 bits.

    Returns
    -------
    array of float32, shape (n, dim)
        Read-only if there is a cache. An image that shows nothing (``Sad.shows_nothing``) gets
        zeros, if a vector has more than 8 numbers.

    Raises
    ------
    SurefixValueError
        If an image or its vector is not as described here, or the cache is of another descriptor or
        of other images; it is then left as it is.
    SurefixFileError
        If a file cannot be read or written.
    SurefixError
        If ``progress`` stopped it. The cache keeps its vectors.

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
    return described(frames_of(images), descriptor, batch, cache, progress, levels)[0]


def described(
    frames: Frames,
    descriptor: Descriptor,
    batch: int | None = None,
    cache: str | PathLike[str] | None = None,
    progress: Progress | Literal[False] | None = None,
    levels: tuple[int, int] | None = None,
    bad: set[int] | None = None,
) -> tuple[Rows, list[Shot]]:
    """As ``extract``; and the shots that were described, each without its image. With a set
    ``bad``, those that cannot be read are passed over, the logger says so, and their indices are
    noted in it.
    """
    descriptor = require_descriptor(descriptor)
    size = checked_batch(batch if batch is not None else getattr(descriptor, "batch", BATCH))
    report = terminal_bar("Describing") if progress is None else progress or None
    bar = Bar(report, frames.count, frames.estimate)
    seen: list[Shot] = []
    load = _Loader(levels, bad)
    with closing(_shots(frames, seen)) as shots:
        if cache is None:
            batches = load.batches(shots, size, digests=False)
            rows = _collect(_vectors(batches, descriptor), frames.count, bar)
            return rows, load.readable(seen)
        path = Path(cache)
        check_folder(path, "cannot write the cache")
        recipe = dict(descriptor.recipe) | ({} if levels is None else {"levels": [*levels]})
        with closing(Cache(path, descriptor.name, recipe)) as kept:
            if frames.count is not None and kept.rows > frames.count:
                raise _too_long(path, frames.count, kept.rows)
            known = kept.rows
            while kept.checked < known and (shot := next(shots, None)) is not None:
                try:
                    kept.expect(shot.name, _digest(shot, None))
                    load.count, load.some = load.count + 1, True
                except SurefixValueError:
                    if not load.passes_over(shot):
                        raise
            if kept.checked < known:
                raise _too_long(path, kept.checked, known)
            bar.show(kept.rows)
            for part in _vectors(load.batches(shots, size, digests=True), descriptor):
                kept.append(*part)
                bar.show(kept.rows)
            if kept.rows == 0:
                raise mismatch("images", "at least one", "none")
            bar.end(kept.rows)
            return kept.result(), load.readable(seen)


def _shots(frames: Frames, seen: list[Shot]) -> Generator[Shot, None, None]:
    """The shots, also noted in ``seen``. If they cannot be read later, they are decoded here."""
    source = frames if frames.parallel else IteratedFrames(frames.frames())
    with closing(source.shots()) as shots:
        for shot in shots:
            seen.append(replace(shot, read=lambda: np.empty(0)))
            yield shot


class _UnreadableError(SurefixValueError):
    """The error of an image that cannot be read."""

    def __init__(self, reason: SurefixValueError) -> None:
        super().__init__(str(reason))
        self.reason = reason


class _Loader:
    """Reads images ahead, in 8 bits, and notes those that cannot be read."""

    def __init__(self, levels: tuple[int, int] | None, bad: set[int] | None) -> None:
        self.levels, self.skip_bad = levels, bad is not None
        # The number of shots so far, and which of them are bad.
        self.count = 0
        self.bad: set[int] = set() if bad is None else bad
        self.some = False
        self.first: SurefixValueError | None = None

    def readable(self, seen: list[Shot]) -> list[Shot]:
        """The shots that were described."""
        return [shot for index, shot in enumerate(seen) if index not in self.bad]

    def passes_over(self, shot: Shot) -> bool:
        """Whether this shot, of which the cache has no vector, cannot be read."""
        if self.skip_bad:
            try:
                shot.read()
            except SurefixValueError as error:
                self._pass_over(self.count, error)
                self.count += 1
                return True
        return False

    def batches(
        self, shots: Iterator[Shot], size: int, *, digests: bool
    ) -> Generator[list[Loaded], None, None]:
        """Loaded images, ``size`` at a time; threads read the next batch while one is used."""
        waiting: deque[tuple[int, Future[Loaded]]] = deque()
        with ThreadPoolExecutor(THREADS, thread_name_prefix="surefix-read") as pool:
            try:
                while True:
                    for shot in islice(shots, 2 * size - len(waiting)):
                        waiting.append((self.count, pool.submit(self._load, shot, digests)))
                        self.count += 1
                    if not waiting:
                        if self.first is not None and not self.some:
                            raise self.first
                        return
                    batch: list[Loaded] = []
                    while waiting and len(batch) < size:
                        index, future = waiting.popleft()
                        try:
                            batch.append(future.result())
                        except _UnreadableError as error:
                            if not self.skip_bad:
                                raise error.reason from None
                            self._pass_over(index, error.reason)
                    if batch:
                        self.some = True
                        yield batch
                    del batch
            finally:
                for _, future in waiting:
                    future.cancel()

    def _load(self, shot: Shot, digests: bool) -> Loaded:
        try:
            given = shot.read()
        except SurefixValueError as error:
            raise _UnreadableError(error) from None
        image = checked_image(in_8_bits(pixels_of(given), self.levels), f"image {shot.name}")
        return shot.name, _digest(shot, image) if digests else b"", image

    def _pass_over(self, index: int, error: SurefixValueError) -> None:
        self.first = self.first or error
        self.bad.add(index)
        LOG.warning("Passed over: %s", error)


def _digest(shot: Shot, image: npt.NDArray[np.uint8] | None) -> bytes:
    """Of the name, size and time of a file; else of the pixels, which are read if not given."""
    state = hashlib.blake2b(digest_size=DIGEST)
    if shot.path is not None:
        path = Path(shot.path)
        try:
            facts = path.stat()
        except OSError as error:
            raise refusal(path, "cannot read the image", error) from None
        text = f"{path.name}\0{facts.st_size}\0{facts.st_mtime_ns}"
        state.update(text.encode("utf-8", "surrogateescape"))
    else:
        pixels = np.ascontiguousarray(shot.read() if image is None else image)
        state.update(f"{pixels.dtype}{pixels.shape}".encode())
        state.update(pixels.data)
    return state.digest()


def _too_long(path: Path, images: int, rows: int) -> SurefixValueError:
    return mismatch(path, f"the cache of these {images} images", f"one of {rows}; {ANEW}")


def _vectors(batches: Iterator[list[Loaded]], descriptor: Descriptor) -> Iterator[Part]:
    # A network on a graphics card describes on one.
    cards = int(str(getattr(descriptor, "device", "")).startswith("cuda"))
    yield from mapped(_described, descriptor, batches, cards)


def _described(descriptor: Descriptor, batch: list[Loaded]) -> Part:
    names, digests = [name for name, _, _ in batch], [digest for _, digest, _ in batch]
    try:
        vectors = descriptor.describe([image for _, _, image in batch])
    except SurefixValueError as error:
        raise SurefixValueError(f"images {names[0]} to {names[-1]}: {error}") from None
    of = [f"image {name}" for name in names]
    rows = checked_rows(vectors, len(batch), descriptor.name, of)
    return names, digests, without_content(rows, [image for _, _, image in batch])


def without_content(rows: Rows, images: Sequence[npt.NDArray[np.uint8]]) -> Rows:
    """The vectors, zeros for images that show nothing: whatever a network makes of these, they say
    nothing. Short vectors, of which zeros may be one, stay as they are.
    """
    if rows.shape[1] <= POINT:
        return rows
    blank = [row for row, image in enumerate(images) if SAD.shows_nothing(image)]
    if not blank:
        return rows
    rows = rows.copy()
    rows[blank] = 0
    return rows


def _collect(parts: Iterator[Part], count: int | None, bar: Bar) -> Rows:
    first = next(parts, None)
    if first is None:
        raise mismatch("images", "at least one", "none")
    dim = first[2].shape[1]
    # If their number is unknown, it doubles when it is full.
    rows = np.empty((count or 2 * len(first[2]), dim), np.float32)
    done = 0
    for names, _, vectors in chain([first], parts):
        if vectors.shape[1] != dim:
            expected = f"a vector of {dim} numbers as before"
            raise mismatch(f"image {names[0]}", expected, vectors.shape[1])
        if done + len(names) > len(rows):
            rows = np.concatenate([rows, np.empty((max(len(rows), len(names)), dim), np.float32)])
        rows[done : done + len(names)] = vectors
        done += len(names)
        bar.show(done)
    bar.end(done)
    return rows[:done]
