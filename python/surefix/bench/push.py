"""``Matcher.push``: everything after the distances."""

from collections.abc import Callable, Iterator
from itertools import cycle
from typing import Any

import numpy as np

from surefix import Matcher
from surefix._core import bench_latency
from surefix.bench.line import Contender, Line, Reach, Settings, Skipped, times
from surefix.bench.rivals import Rivals
from surefix.bench.step import ArrayMatcher, Floats, same_fixes, summary

__all__ = ["lines", "read_by_push"]

COLUMNS = 16
# Much longer than the longest sequence, so that its jump back to the start is in few windows.
LONG = 1000
FLOAT = 4


def drive(places: int, queries: int = COLUMNS) -> list[Floats]:
    """Distances of a drive: noise, and a dip at the true place, which is one further with each
    query.
    """
    rng = np.random.default_rng(places)
    columns = 0.5 + rng.random((queries, places), np.float32)
    columns[np.arange(queries), (places // 3 + np.arange(queries)) % places] *= 0.2
    return list(columns)


def long_drive(places: int, queries: int) -> list[Floats]:
    """The same, as long as one likes in the memory of one query: each is the one before it, a place
    further.
    """
    noise = np.float32(0.5) + np.random.default_rng(places).random(places + queries, np.float32)
    noise[queries + places // 3] *= 0.2
    return [noise[queries - query : queries - query + places] for query in range(queries)]


def read_by_push(places: int, length: int) -> int:
    """The bytes that a push cannot do without.

    The distances are read and kept, two gradients read and a third kept, and older columns read:
    two at the most, as sums can stand in for more.
    """
    return places * FLOAT * (2 + 3 + min(length - 1, 2))


def _pushed(push: Callable[[Floats], Any], columns: list[Floats]) -> Callable[[], Any]:
    """Pushes the next column, round and round."""
    following = cycle(columns)
    return lambda: push(next(following))


def _ours(
    name: str, places: int, length: int, columns: list[Floats], reach: Reach | None = None
) -> Contender:
    def answer() -> Any:
        fresh = Matcher(places, sequence_length=length)
        return [summary(fresh.push(column)) for column in columns]

    # Over and over from the window's filling on, so that what is timed is a full window.
    matcher = Matcher(places, sequence_length=length)
    for column in cycle(columns):
        if matcher.push(column).sequence is not None:
            break
    return Contender(name, _pushed(matcher.push, columns), answer, reach=reach)


def lines(settings: Settings, rivals: Rivals) -> Iterator[Line | Skipped]:
    """Against NumPy and SciPy, against a clock, and long sequences against short ones."""
    signal = rivals["scipy.signal"]
    for places, factor in ((1800, 30.0), (10_000 if settings.quick else 100_000, 50.0)):
        work = f"Matcher.push, n = {places:,}, L = 3"
        if signal is None:
            yield Skipped("push", work, "SciPy is not installed")
            continue
        columns = drive(places)

        def answer(places: int = places, columns: list[Floats] = columns) -> Any:
            fresh = ArrayMatcher(signal, places, 3)
            return [fresh.push(column) for column in columns]

        rival = ArrayMatcher(signal, places, 3)
        other = Contender(
            "NumPy + SciPy", _pushed(rival.push, columns), answer, reach=times(factor)
        )
        yield Line(
            "push",
            work,
            _ours("surefix", places, 3, columns),
            (other,),
            same_fixes,
            read_by_push(places, 3),
        )
    yield _in_rust(1800, settings)
    yield _long_against_short(1800, Reach(1 / 1.5, "at most 1.5 x its time"))
    # What the sums of a long window on a long route cost is the memory's doing: shown, and nothing
    # promised.
    yield _long_against_short(10_000 if settings.quick else 100_000, None)


def _in_rust(places: int, settings: Settings) -> Line:
    """A push without Python around it, against the clock."""
    pushes = 2_000 if settings.quick else 50_000

    def seconds() -> float:
        return float(np.median(bench_latency(places, 3, pushes)[0])) * 1e-9

    ours = Contender("surefix, in Rust", lambda: None, clock=seconds)
    reach = Reach(1.0, "at most 2 ns a place")
    other = Contender("2 ns a place", lambda: None, reach=reach, clock=lambda: 2e-9 * places)
    work = f"Matcher::push in Rust, n = {places:,}, L = 3"
    return Line("push", work, ours, (other,), lambda _ours, _theirs: "", read_by_push(places, 3))


def _long_against_short(places: int, reach: Reach | None) -> Line:
    """L = 100 beside L = 2. Their answers are no rivals': each is checked against the whole matrix
    elsewhere.
    """
    columns = long_drive(places, LONG)
    short = _ours("surefix, L = 2", places, 2, columns, reach)
    work = f"Matcher.push, n = {places:,}, L = 100"
    long = _ours("surefix, L = 100", places, 100, columns)
    # While the long window fills, both see the same single matches, and so trust the same.
    return Line("push", work, long, (short,), _same_trust, read_by_push(places, 100))


def _same_trust(ours: Any, theirs: Any) -> str:
    wrong = [query for query, (a, b) in enumerate(zip(ours, theirs, strict=True)) if a[2] != b[2]]
    return f"query {wrong[0]}: one is trusted and the other is not" if wrong else ""
