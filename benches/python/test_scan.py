"""Distances to every place: bytes, floats, and the narrower types that stand for floats."""

from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

from surefix import Map
from work import LEVEL, Entrant, Work, same_best, same_distances, times

BYTES, DIM = 2048, 4096
# One rounding of the mean to float32; sums in float32; i8 rows keep a 32nd, and are cut at 4.
ROUNDING, FLOATS, CUT, STEPS = 1e-6, 1e-4, 5e-3, 32
LARGE = [False, True]


@pytest.fixture(scope="module", params=LARGE)
def sad(request: Any, quick: bool, enough_memory: Any) -> Work:
    places = (10_000 if quick else 100_000) if request.param else 1800
    name = f"u8 SAD, {places:,} x {BYTES:,}"
    enough_memory(name, 5 * places * BYTES)
    rng = np.random.default_rng(places)
    rows = rng.integers(0, 256, (places, BYTES), np.uint8)
    query = rows[places // 3].copy()
    query[::3] = rng.integers(0, 256, query[::3].size, np.uint8)
    known = Map.from_descriptors(rows, metric="manhattan")

    def arrays() -> Any:
        # Without a sign, the difference of bytes is that of the larger and the smaller.
        difference = np.maximum(rows, query) - np.minimum(rows, query)
        return difference.sum(axis=1, dtype=np.uint32) / np.float32(BYTES)

    entrants = {"surefix": Entrant(lambda: known.distances(query)), "NumPy": Entrant(arrays)}
    if find_spec("cv2"):
        cv2 = import_module("cv2")

        def best() -> tuple[int, float]:
            # OpenCV sorts all that it gives to Python: the best one alone costs it least.
            distance, index = cv2.batchDistance(
                query[None], rows, cv2.CV_32S, normType=cv2.NORM_L1, K=1
            )
            return int(index[0, 0]), float(distance[0, 0]) / BYTES

        entrants["OpenCV batchDistance, the best only"] = Entrant(
            best, agrees=same_best(ROUNDING), target=LEVEL
        )
    return Work(name, entrants, same_distances(ROUNDING), places * BYTES)


@pytest.mark.parametrize("name", ["surefix", "NumPy", "OpenCV batchDistance, the best only"])
def test_sad(sad: Work, name: str, measure: Any) -> None:
    """Distances of SAD descriptors"""
    measure(sad, name)


@pytest.fixture(scope="module", params=LARGE)
def floats(request: Any, quick: bool, enough_memory: Any) -> Any:
    places = (4_000 if quick else 50_000) if request.param else 1800
    enough_memory(f"f32, {places:,} x {DIM:,}", 5 * 4 * places * DIM)
    rng = np.random.default_rng(places)
    rows = rng.standard_normal((places, DIM), np.float32)
    return rows, rows[places // 3] + rng.standard_normal(DIM, np.float32)


@pytest.fixture(scope="module", params=["euclidean", "cosine"])
def plain(request: Any, floats: Any) -> Iterator[Work]:
    metric, (rows, query) = request.param, floats
    if metric == "cosine":
        rows = rows / np.linalg.norm(rows, axis=1, keepdims=True)
        query = query / np.linalg.norm(query)
    places = len(rows)
    known = Map.from_descriptors(rows, metric=metric)
    squares = np.einsum("ij,ij->i", rows, rows)

    def product() -> Any:
        if metric == "cosine":
            return 1 - rows @ query
        return np.sqrt(np.maximum(squares - 2 * (rows @ query) + query @ query, 0))

    # In the cache, BLAS has half the work: a product instead of a difference and a square.
    target = LEVEL if places > 1800 else None
    entrants = {
        "surefix": Entrant(lambda: known.distances(query)),
        "NumPy (BLAS product)": Entrant(product, target=target),
    }
    if find_spec("faiss"):
        faiss = import_module("faiss")
        index = {"euclidean": faiss.IndexFlatL2, "cosine": faiss.IndexFlatIP}[metric](DIM)
        index.add(rows)

        def best() -> tuple[int, float]:
            found, where = index.search(query[None], 1)
            value = float(found[0, 0])
            return int(where[0, 0]), np.sqrt(value) if metric == "euclidean" else 1 - value

        entrants["faiss IndexFlat, the best only"] = Entrant(best, agrees=same_best(FLOATS))
    if find_spec("simsimd"):
        simsimd = import_module("simsimd")
        entrants["simsimd cdist"] = Entrant(lambda: simsimd.cdist(query[None], rows, metric=metric))
    name = f"f32 {metric}, {places:,} x {DIM:,}"
    return Work(name, entrants, same_distances(FLOATS), rows.nbytes)


@pytest.mark.parametrize(
    "name",
    ["surefix", "NumPy (BLAS product)", "faiss IndexFlat, the best only", "simsimd cdist"],
)
def test_floats(plain: Work, name: str, measure: Any) -> None:
    """Distances of learned descriptors"""
    measure(plain, name)


@pytest.fixture(scope="module", params=["f16", "i8"])
def narrow(request: Any, floats: Any, quick: bool) -> Work:
    rows, query = floats
    places, to_bytes = len(rows), request.param == "i8"

    def convert(numbers: Any) -> Any:
        if not to_bytes:
            return numbers.astype(np.float16)
        return np.clip(np.rint(numbers * np.float32(STEPS)), -127, 127).astype(np.int8)

    known, own = Map.from_descriptors(convert(rows), metric="euclidean"), convert(query)
    wide = Map.from_descriptors(rows, metric="euclidean")
    unit, factor = (STEPS, 3.3) if to_bytes else (1, 1.8)
    target = times(factor) if places > 1800 else None
    entrants = {
        f"surefix, {request.param} rows": Entrant(lambda: known.distances(own)),
        "surefix, f32 rows": Entrant(lambda: wide.distances(query), target=target),
    }
    agrees = same_distances(CUT)
    return Work(
        f"{request.param} euclidean, {places:,} x {DIM:,}",
        entrants,
        lambda ours, theirs: agrees(ours / unit, theirs),
        places * DIM * known.dtype.itemsize,
    )


@pytest.mark.parametrize("nth", [0, 1])
def test_narrow(narrow: Work, nth: int, measure: Any) -> None:
    """Rows of fewer bytes"""
    measure(narrow, list(narrow.entrants)[nth])
