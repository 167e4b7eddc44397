"""The scan of SAD descriptors: sums of absolute differences of bytes."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from surefix import Map
from surefix.bench.agreement import same_best, same_distances
from surefix.bench.line import Contender, Line, Settings, Skipped, level
from surefix.bench.memory import shortage
from surefix.bench.rivals import Rivals

__all__ = ["DIM", "lines"]

DIM = 2048
# One rounding of the mean to float32.
ROUNDING = 1e-6


def lines(settings: Settings, rivals: Rivals) -> Iterator[Line | Skipped]:
    """Every place's distance, on one thread."""
    for places in (1800, 10_000 if settings.quick else 100_000):
        work = f"u8 SAD, {places:,} x {DIM:,}"
        # The rows, the map's own, and two arrays of that size that NumPy makes on its way.
        if why := shortage(5 * places * DIM):
            yield Skipped("sad", work, why)
            continue
        yield _line(work, places, rivals)


def _line(work: str, places: int, rivals: Rivals) -> Line:
    rng = np.random.default_rng(places)
    rows = rng.integers(0, 256, (places, DIM), np.uint8)
    query = rows[places // 3].copy()
    query[::3] = rng.integers(0, 256, query[::3].size, np.uint8)
    known = Map.from_descriptors(rows, metric="manhattan")
    others = [Contender("NumPy", _numpy(rows, query))]
    if cv2 := rivals["cv2"]:
        others.append(
            Contender(
                "OpenCV batchDistance, the best only",
                _opencv(cv2, rows, query),
                reach=level(),
                agrees=lambda ours, theirs: same_best(ours, theirs, ROUNDING),
            )
        )
    ours = Contender("surefix, every place", lambda: known.distances(query))
    return Line(
        "sad", work, ours, others, lambda a, b: same_distances(a, b, ROUNDING), places * DIM
    )


def _numpy(rows: Any, query: Any) -> Callable[[], Any]:
    def call() -> Any:
        # Without a sign, the difference of bytes is that of the larger and the smaller.
        difference = np.maximum(rows, query) - np.minimum(rows, query)
        return difference.sum(axis=1, dtype=np.uint32) / np.float32(DIM)

    return call


def _opencv(cv2: Any, rows: Any, query: Any) -> Callable[[], Any]:
    # It gives no vector to Python without sorting: the best one costs it least.
    def call() -> tuple[int, float]:
        distance, index = cv2.batchDistance(
            query[None], rows, cv2.CV_32S, normType=cv2.NORM_L1, K=1
        )
        return int(index[0, 0]), float(distance[0, 0]) / DIM

    return call
