"""The scan of learned descriptors: euclidean and cosine distances of floats, halves and signed
bytes.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from surefix import Map
from surefix.bench.agreement import same_best, same_distances
from surefix.bench.line import Contender, Line, Reach, Settings, Skipped, level, times
from surefix.bench.memory import shortage
from surefix.bench.rivals import Rivals

__all__ = ["DIM", "lines"]

DIM = 4096
# Rivals sum in float32, and NumPy's product is subtracted from the lengths.
FLOATS = 1e-4
# i8 rows keep the numbers to a 32nd, and cut them at 4.
STEPS = 32
CUT = 5e-3


def lines(settings: Settings, rivals: Rivals) -> Iterator[Line | Skipped]:
    """At a size that the caches hold and at one that they do not."""
    for places in (1800, 4_000 if settings.quick else 50_000):
        # The rows, the map's own, and faiss's, of 4 bytes a number.
        if why := shortage(3 * 4 * places * DIM):
            yield Skipped("float", f"f32, {places:,} x {DIM:,}", why)
            continue
        rng = np.random.default_rng(places)
        rows = rng.standard_normal((places, DIM), np.float32)
        query = rows[places // 3] + rng.standard_normal(DIM, np.float32)
        # On what the caches hold, BLAS has half the work: a product where a difference and a square
        # are asked for.
        held = level() if places > 1800 else None
        yield _euclidean(rows, query, rivals, held)
        yield from _narrow(rows, query, held is not None)
        rows /= np.linalg.norm(rows, axis=1, keepdims=True)
        query /= np.linalg.norm(query)
        yield _cosine(rows, query, rivals, held)


def _euclidean(rows: Any, query: Any, rivals: Rivals, reach: Reach | None) -> Line:
    known = Map.from_descriptors(rows, metric="euclidean")
    squares = np.einsum("ij,ij->i", rows, rows)

    def product() -> Any:
        return np.sqrt(np.maximum(squares - 2 * (rows @ query) + query @ query, 0))

    others = [Contender("NumPy (BLAS product, expanded)", product, reach=reach)]
    if faiss := rivals["faiss"]:
        others.append(_faiss(faiss.IndexFlatL2(DIM), rows, query, np.sqrt))
    if simsimd := rivals["simsimd"]:
        others.append(Contender("simsimd cdist", _simsimd(simsimd, rows, query, "euclidean")))
    return _line("f32 euclidean", known, query, others)


def _cosine(rows: Any, query: Any, rivals: Rivals, reach: Reach | None) -> Line:
    known = Map.from_descriptors(rows, metric="cosine")
    others = [Contender("NumPy (BLAS product)", lambda: 1 - rows @ query, reach=reach)]
    if faiss := rivals["faiss"]:
        others.append(_faiss(faiss.IndexFlatIP(DIM), rows, query, lambda product: 1 - product))
    if simsimd := rivals["simsimd"]:
        others.append(Contender("simsimd cdist", _simsimd(simsimd, rows, query, "cosine")))
    return _line("f32 cosine", known, query, others)


def _line(what: str, known: Map, query: Any, others: Sequence[Contender]) -> Line:
    places, dim = len(known), known.dim
    ours = Contender("surefix", lambda: known.distances(query))
    read = places * dim * known.dtype.itemsize
    return Line(
        "float",
        f"{what}, {places:,} x {dim:,}",
        ours,
        others,
        lambda a, b: same_distances(a, b, FLOATS),
        read,
    )


def _narrow(rows: Any, query: Any, held: bool) -> Iterator[Line]:
    """Halves and bytes, beside the floats that they stand for."""
    places, dim = rows.shape
    wide = Map.from_descriptors(rows, metric="euclidean")

    def line(what: str, convert: Callable[[Any], Any], unit: float, factor: float) -> Line:
        known, own_query = Map.from_descriptors(convert(rows), metric="euclidean"), convert(query)
        floats = Contender(
            "surefix, f32 rows",
            lambda: wide.distances(query),
            reach=times(factor) if held else None,
        )
        ours = Contender(f"surefix, {what} rows", lambda: known.distances(own_query))
        work = f"{what} euclidean, {places:,} x {dim:,}"
        read = places * dim * known.dtype.itemsize
        return Line(
            "float", work, ours, (floats,), lambda a, b: same_distances(a / unit, b, CUT), read
        )

    yield line("f16", lambda numbers: numbers.astype(np.float16), 1, 1.8)
    yield line("i8", _as_bytes, STEPS, 3.3)


def _as_bytes(numbers: Any) -> Any:
    scaled = numbers * np.float32(STEPS)
    np.rint(scaled, out=scaled)
    return np.clip(scaled, -127, 127, out=scaled).astype(np.int8)


def _faiss(index: Any, rows: Any, query: Any, distance: Callable[[Any], Any]) -> Contender:
    index.add(rows)

    def call() -> tuple[int, float]:
        found, where = index.search(query[None], 1)
        return int(where[0, 0]), float(distance(found[0, 0]))

    name = f"faiss {type(index).__name__}, the best only"
    return Contender(name, call, agrees=lambda ours, theirs: same_best(ours, theirs, FLOATS))


def _simsimd(simsimd: Any, rows: Any, query: Any, metric: str) -> Callable[[], Any]:
    return lambda: simsimd.cdist(query[None], rows, metric=metric)
