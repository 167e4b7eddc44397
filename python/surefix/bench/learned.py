"""Learned descriptors on a long route: the whole push, from a float32 descriptor to the fix."""

from collections.abc import Iterator
from itertools import cycle
from typing import Any

import numpy as np

from surefix import Localizer, Map
from surefix.bench.agreement import same_numbers
from surefix.bench.line import Contender, Line, Reach, Settings, Skipped, times
from surefix.bench.localizing import answers, localizer
from surefix.bench.memory import shortage
from surefix.bench.push import read_by_push
from surefix.bench.rivals import Rivals
from surefix.bench.step import ArrayMatcher, same_fixes

__all__ = ["lines", "route"]

DIM = 4096
LENGTH = 3
# A drive long enough that its jump back to the start is one push of many.
QUERIES = 32
# How alike two neighbouring places are, and a place and its query.
ALONG, ACROSS = 0.95, 0.7


def lines(settings: Settings, rivals: Rivals) -> Iterator[Line | Skipped]:
    """BLAS product and SciPy step beside a screen of i8 rows; and a map for which the screen does
    not pay.
    """
    places = 4_000 if settings.quick else 100_000
    work = f"learned descriptors, {places:,} x {DIM:,}, whole push"
    # The rows, the map's own, and a quarter more for the screen.
    needed = 9 * places * DIM
    if rivals["scipy.signal"] is None:
        yield Skipped("learned", work, "SciPy is not installed")
    elif why := shortage(needed):
        yield Skipped("learned", work, why)
    else:
        yield _along_a_route(work, places, settings, rivals["scipy.signal"])
    places = 4_000 if settings.quick else 25_000
    work = f"places that no screen tells apart, {places:,} x {DIM:,}, whole push"
    if why := shortage(needed):
        yield Skipped("learned", work, why)
    else:
        yield _look_alikes(work, places, settings)


def _along_a_route(work: str, places: int, settings: Settings, signal: Any) -> Line:
    rows, queries = route(places, DIM, QUERIES)
    plain = Map.from_descriptors(rows, metric="cosine")

    def arrays() -> Any:
        matcher = ArrayMatcher(signal, places, LENGTH)
        return lambda query: matcher.push(1 - rows @ query)

    def rival_answer() -> Any:
        push = arrays()
        return [push(query) for query in queries]

    others = (
        Contender(
            "BLAS product + SciPy step", _round(arrays(), queries), rival_answer, reach=times(2.5)
        ),
        _contender("surefix, without the screen", plain, settings, queries, exact=True),
    )
    read = places * DIM + read_by_push(places, LENGTH)
    ours = _contender("surefix, screen of i8 rows", plain.with_screen("i8"), settings, queries)
    return Line("learned", work, ours, others, same_fixes, read, settings.threads)


def _look_alikes(work: str, places: int, settings: Settings) -> Line:
    """Two places again and again with next to no difference: the screen has to give up, and that
    must cost little.
    """
    rng = np.random.default_rng(places)
    rows = np.float32(1e-5) * rng.standard_normal((places, DIM), np.float32)
    for start, place in enumerate(rng.standard_normal((2, DIM), np.float32)):
        rows[start::2] += place
    queries = list(
        rows[:QUERIES] + np.float32(1e-5) * rng.standard_normal((QUERIES, DIM), np.float32)
    )
    plain = Map.from_descriptors(rows, metric="cosine")
    reach = Reach(1 / 1.1, "at most 1.1 x its time")
    other = _contender("surefix, without the screen", plain, settings, queries, reach, exact=True)
    ours = _contender("surefix, screen of i8 rows", plain.with_screen("i8"), settings, queries)
    read = places * DIM * 4 + read_by_push(places, LENGTH)
    return Line("learned", work, ours, (other,), same_numbers, read, settings.threads)


def route(places: int, dim: int, queries: int) -> tuple[Any, list[Any]]:
    """Descriptors of unit length along a route, neighbours alike, and those of a second drive over
    a part of it.
    """
    rng = np.random.default_rng(places)
    rows = np.empty((places, dim), np.float32)
    before = rng.standard_normal(dim, np.float32)
    for start in range(0, places, 1024):
        block = rows[start : start + 1024]
        rng.standard_normal(dtype=np.float32, out=block)
        block *= np.float32(np.sqrt(1 - ALONG**2))
        for row in block:
            row += np.float32(ALONG) * before
            before = row
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    drive = []
    for place in range(places // 3, places // 3 + queries):
        query = ACROSS * rows[place] + np.sqrt((1 - ACROSS**2) / dim) * rng.standard_normal(dim)
        drive.append((query / np.linalg.norm(query)).astype(np.float32))
    return rows, drive


def _contender(
    name: str,
    known: Map,
    settings: Settings,
    queries: list[Any],
    reach: Reach | None = None,
    *,
    exact: bool = False,
) -> Contender:
    def fresh() -> Localizer:
        return localizer(known, settings.threads, sequence_length=LENGTH)

    agrees = same_numbers if exact else None
    return Contender(
        name, _round(fresh().push, queries), answers(fresh, queries), reach=reach, agrees=agrees
    )


def _round(push: Any, queries: list[Any]) -> Any:
    following = cycle(queries)
    # The window is full then, and a screen knows whether it pays.
    for query in queries:
        push(query)
    return lambda: push(next(following))
