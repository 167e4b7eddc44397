"""surefix beside itself: on two threads, and on a map of a million places."""

from collections.abc import Callable, Iterator
from itertools import cycle
from typing import Any

import numpy as np

from surefix import Localizer, Map
from surefix.bench.agreement import same_numbers
from surefix.bench.bytes_scan import DIM
from surefix.bench.line import Contender, Line, Reach, Settings, Skipped, level, times
from surefix.bench.localizing import answers, localizer
from surefix.bench.memory import shortage
from surefix.bench.push import read_by_push
from surefix.bench.rivals import Rivals

__all__ = ["scale_lines", "thread_lines"]

LENGTH = 2
QUERIES = 6


def thread_lines(settings: Settings, rivals: Rivals) -> Iterator[Line | Skipped]:
    """Two threads beside one where the map is larger than the cache, and what is chosen where it is
    not.
    """
    for places, threads, reach in (
        (20_000 if settings.quick else 100_000, 2, times(1.7)),
        (1800, None, level()),
    ):
        chosen = "two threads" if threads else "threads chosen by size"
        work = f"u8 SAD push, {places:,} x {DIM:,}, {chosen}"
        if why := shortage(2 * places * DIM):
            yield Skipped("threads", work, why)
            continue
        known, queries = _map(places)
        one = _contender("surefix, one thread", known, 1, queries, reach)
        read = places * DIM + read_by_push(places, LENGTH)
        ours = _contender(f"surefix, {chosen}", known, threads, queries)
        yield Line("threads", work, ours, (one,), same_numbers, read, threads or 1)


def scale_lines(settings: Settings, rivals: Rivals) -> Iterator[Line | Skipped]:
    """A place's cost on a map of a million, beside one of a tenth."""
    large = 50_000 if settings.quick else 1_000_000
    small = large // 10
    work = f"u8 SAD push, {large:,} x {DIM:,}, a place's cost"
    if why := shortage(2 * (large + small) * DIM):
        yield Skipped("scale", work, why)
        return
    known, queries = _map(large)
    part, some = _map(small)
    reach = Reach(1 / 1.3, "at most 1.3 x its cost")
    other = _contender(
        f"surefix, {small:,} places", part, settings.threads, some, reach, scale=large / small
    )
    ours = _contender(f"surefix, {large:,} places", known, settings.threads, queries)
    read = large * DIM + read_by_push(large, LENGTH)
    yield Line("scale", work, ours, (other,), _same_drive(large, small), read, settings.threads)


def _same_drive(large: int, small: int) -> Callable[[Any, Any], str]:
    """Two drives, each along its own map: both must be found."""

    def agrees(ours: Any, theirs: Any) -> str:
        for answer, places in ((ours, large), (theirs, small)):
            found = [place for place, _score, _trusted in answer]
            if found != list(range(places // 3, places // 3 + QUERIES)):
                return f"{places:,} places: expected {QUERIES} in a row from {places // 3} on, got {found}"
        return ""

    return agrees


def _map(places: int) -> tuple[Map, list[Any]]:
    """A route of random bytes, and a drive along a part of it, a third of its bytes spoilt."""
    rng = np.random.default_rng(places)
    rows = rng.integers(0, 256, (places, DIM), np.uint8)
    drive = rows[places // 3 : places // 3 + QUERIES].copy()
    drive[:, ::3] = rng.integers(0, 256, drive[:, ::3].shape, np.uint8)
    return Map.from_descriptors(rows, metric="manhattan"), list(drive)


def _contender(
    name: str,
    known: Map,
    threads: int | None,
    queries: list[Any],
    reach: Reach | None = None,
    scale: float = 1.0,
) -> Contender:
    def fresh() -> Localizer:
        return localizer(known, threads, sequence_length=LENGTH)

    push, following = fresh().push, cycle(queries)
    for query in queries[:LENGTH]:
        push(query)
    return Contender(
        name, lambda: push(next(following)), answers(fresh, queries), reach=reach, scale=scale
    )
