"""The images to describe, from wherever they come, decoded a few ahead and never all at once."""

import hashlib
import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from surefix._core import Traverse, find_images, read_image
from surefix.datasets.images import Images
from surefix.descriptors.descriptor import checked_image
from surefix.errors import SurefixFileError, SurefixValueError

__all__ = ["DIGEST", "Item", "Loaded", "Source"]

# Bytes that tell one image from another: 2^-64 is the chance that two agree by accident.
DIGEST = 8
THREADS = min(4, os.cpu_count() or 1)


@dataclass(frozen=True, slots=True)
class Item:
    """One image that is to be described: what it is called, how to get it, and what tells it from
    others.
    """

    name: str
    load: Callable[[], npt.NDArray[np.uint8]]
    # Without the pixels where the file's name, size and time say it; else the pixels are read for
    # it.
    digest: Callable[[], bytes]


class Loaded(NamedTuple):
    """An image that is there; without its digest, where nobody asked for it."""

    name: str
    image: npt.NDArray[np.uint8]
    digest: bytes


class Source:
    """Images in route order: a folder, a pattern, paths, arrays, a data set's images, a traverse,
    or a generator.

    ``count`` is how many there are, None where only the end tells. A stream's frames (anything with
    ``.image``) are taken by their images.

    Raises
    ------
    SurefixError
        Where there is no such folder, or it is nothing of these.
    """

    def __init__(self, images: Any) -> None:
        if isinstance(images, Images) and images.paths is not None:
            images = images.paths
        if isinstance(images, (str, os.PathLike)):
            images = find_images(images)
        if isinstance(images, np.ndarray) and (
            images.ndim not in (3, 4) or (images.ndim == 3 and images.shape[2] == 3)
        ):
            expected = "(n, H, W) or (n, H, W, 3), one image a place"
            raise SurefixValueError(f"images: expected {expected}, got the shape {images.shape}")
        counted = hasattr(images, "__len__") and hasattr(images, "__getitem__")
        if not counted and not hasattr(images, "__iter__"):
            expected = "a folder, a pattern, or images or paths one after the other"
            raise SurefixValueError(f"images: expected {expected}, got {type(images).__name__}")
        self._images = images
        self.count: int | None = len(images) if counted else None
        if self.count == 0:
            raise SurefixValueError("images: expected at least one, got none")
        # Our own kinds may be read by several threads at once; nothing is known of anybody else's.
        self._by_threads = isinstance(images, (Images, Traverse, np.ndarray))

    def items(self) -> Iterator[Item]:
        """The images one after the other, none of them read."""
        names = self._images.names if isinstance(self._images, Images) else None
        if self.count is None:
            for index, thing in enumerate(self._images):
                yield _item(thing, index)
            return
        for index in range(self.count):
            if self._by_threads:
                yield _by_index(self._images, index, str(index) if names is None else names[index])
            else:
                yield _item(self._images[index], index)

    def batches(
        self, size: int, items: Iterator[Item] | None = None, digests: bool = False
    ) -> Iterator[list[Loaded]]:
        """Loaded images, ``size`` at a time; while one batch is used, the next is read by a few
        threads.

        No more than two batches are held, if whoever takes a batch lets it go before asking for the
        next.
        """
        waiting: deque[Future[Loaded]] = deque()
        items = self.items() if items is None else items
        with ThreadPoolExecutor(THREADS, thread_name_prefix="surefix-read") as pool:
            try:
                while True:
                    free = 2 * size - len(waiting)
                    waiting.extend(
                        pool.submit(_load, item, digests) for item in islice(items, free)
                    )
                    batch = [waiting.popleft().result() for _ in range(min(size, len(waiting)))]
                    if not batch:
                        return
                    yield batch
                    del batch
            finally:
                for future in waiting:
                    future.cancel()


def _load(item: Item, digests: bool) -> Loaded:
    image = checked_image(item.load(), f"image {item.name}")
    return Loaded(item.name, image, item.digest() if digests else b"")


def _by_index(images: Any, index: int, name: str) -> Item:
    def load() -> npt.NDArray[np.uint8]:
        return np.asarray(images[index])

    return Item(name, load, lambda: _digest_of_pixels(load()))


def _item(thing: Any, index: int) -> Item:
    if isinstance(thing, (str, os.PathLike)):
        path = Path(thing)
        return Item(path.name, lambda: read_image(path), lambda: _digest_of_file(path))
    image = getattr(thing, "image", thing)
    return Item(str(index), lambda: image, lambda: _digest_of_pixels(image))


def _digest_of_file(path: Path) -> bytes:
    try:
        facts = path.stat()
    except OSError as error:
        raise SurefixFileError(
            f"{path}: cannot read the image: {error.strerror or error}"
        ) from None
    text = f"{path.name}\0{facts.st_size}\0{facts.st_mtime_ns}"
    return hashlib.blake2b(text.encode("utf-8", "surrogateescape"), digest_size=DIGEST).digest()


def _digest_of_pixels(image: Any) -> bytes:
    array = np.ascontiguousarray(image)
    state = hashlib.blake2b(f"{array.dtype}{array.shape}".encode(), digest_size=DIGEST)
    state.update(array.data)
    return state.digest()
