"""From a camera's image to the fix."""

from collections.abc import Iterator
from itertools import cycle
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix import Localizer, Map, Sad
from surefix.bench.line import Contender, Line, Settings, Skipped, times
from surefix.bench.localizing import answers
from surefix.bench.push import read_by_push
from surefix.bench.rivals import Rivals
from surefix.bench.step import Answer, ArrayMatcher, same_fixes
from surefix.simulate import Route

__all__ = ["lines"]

PLACES = 1800
SIZE = 640, 480
LENGTH = 3
QUERIES = 8
SMALL = 64, 32
PATCH = 8
LEVELS = 32


class ArrayLocalizer:
    """Pillow for the image, NumPy and SciPy for the rest, as a careful user would write it."""

    def __init__(self, image: Any, signal: Any, rows: npt.NDArray[np.uint8]) -> None:
        self.image, self.rows = image, rows
        self.matcher = ArrayMatcher(signal, len(rows), LENGTH)

    def describe(self, frame: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
        """Grey, small, normalized patch by patch, a byte each."""
        image = (
            self.image.fromarray(frame).convert("L").resize(SMALL, self.image.Resampling.BILINEAR)
        )
        width, height = SMALL
        patches = np.asarray(image, np.float64).reshape(
            height // PATCH, PATCH, width // PATCH, PATCH
        )
        mean = patches.mean(axis=(1, 3), keepdims=True)
        deviation = patches.std(axis=(1, 3), keepdims=True)
        z = np.where(deviation < 1, 0, (patches - mean) / np.maximum(deviation, 1))
        # Halves away from zero.
        levels = np.trunc(LEVELS * z + np.copysign(0.5, z))
        descriptor: npt.NDArray[np.uint8] = np.clip(128 + levels, 0, 255).astype(np.uint8).ravel()
        return descriptor

    def push(self, frame: npt.NDArray[np.uint8]) -> Answer:
        """Place, score and trust of one image."""
        query = self.describe(frame)
        # The fastest of NumPy's ways, and faster than SciPy's cdist: bytes all along.
        difference = np.maximum(self.rows, query) - np.minimum(self.rows, query)
        sums = difference.sum(axis=1, dtype=np.uint32)
        return self.matcher.push((sums / (query.size * LEVELS)).astype(np.float32))


def lines(settings: Settings, rivals: Rivals) -> Iterator[Line | Skipped]:
    """A generated drive on a map of the paper's length."""
    work = f"image to fix, {SIZE[0]} x {SIZE[1]} RGB, SAD, n = {PLACES:,}"
    signal, image = rivals["scipy.signal"], rivals["PIL.Image"]
    if signal is None or image is None:
        yield Skipped("image", work, "it takes SciPy and Pillow, which are not both installed")
        return
    # The map's images are small ones: they are described as the large ones are, and drawn a hundred
    # times faster.
    known = Map.from_images(Route(places=PLACES, size=SMALL).reference(), Sad(), progress=False)
    start = PLACES // 3
    winter = Route(places=PLACES, size=SIZE).revisit()
    frames = [np.asarray(winter[start + query]) for query in range(QUERIES)]
    rows = np.asarray(known.descriptors)

    def fresh() -> Localizer:
        return Localizer(known, sequence_length=LENGTH)

    def answer() -> list[Answer]:
        rival = ArrayLocalizer(image, signal, rows)
        return [rival.push(frame) for frame in frames]

    other = Contender(
        "Pillow + NumPy + SciPy",
        _round(ArrayLocalizer(image, signal, rows).push, frames),
        answer,
        reach=times(10),
    )
    ours = Contender("surefix", _round(fresh().push, frames), answers(fresh, frames))
    read = frames[0].nbytes + rows.nbytes + read_by_push(PLACES, LENGTH)
    yield Line("image", work, ours, (other,), same_fixes, read)


def _round(push: Any, frames: list[Any]) -> Any:
    following = cycle(frames)
    for frame in frames[:LENGTH]:
        push(frame)
    return lambda: push(next(following))
