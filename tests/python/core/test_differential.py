"""Stream = batch = oracle, on 10,000 generated matrices, and options that must not change an answer.

All are equal bit for bit, scores too: the sums are defined down to the order of additions.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import pytest

import oracle
import surefix
from oracle import Array, Options, Road

SEEDS = range(20)
# On roads: with make test-long as many.
ROADS = SEEDS if "LONG" in os.environ else range(5)
CASES_PER_SEED = 500
CASES_RUN: dict[int, int] = {}

EXACT = (
    "place",
    "trusted",
    "blank",
    "anchors",
    "ready",
    "speed",
    "single_place",
    "single_distance",
    "gradient_place",
    "gradient_value",
    "segment",
    "segment_place",
)


# Generated matrices, one function a kind, (n, m) float32.


def random_floats(rng: np.random.Generator, n: int, m: int) -> Array:
    return rng.random((n, m))


def small_integers(rng: np.random.Generator, n: int, m: int) -> Array:
    """Ties everywhere: between places, between diagonals, between speeds."""
    return rng.integers(0, int(rng.integers(2, 6)), (n, m))


def constant_columns(rng: np.random.Generator, n: int, m: int) -> Array:
    return np.broadcast_to(rng.integers(0, 4, m) + rng.random(), (n, m))


def all_equal(rng: np.random.Generator, n: int, m: int) -> Array:
    return np.full((n, m), rng.normal())


def negative(rng: np.random.Generator, n: int, m: int) -> Array:
    return rng.normal(-3.0, 2.0, (n, m))


def extreme(rng: np.random.Generator, n: int, m: int) -> Array:
    """Far from 1, and far from overflow and from subnormals."""
    return rng.normal(size=(n, m)) * 10.0 ** rng.integers(-25, 26)


def wild(rng: np.random.Generator, n: int, m: int) -> Array:
    """From 1e-30 to 1e30 side by side: another order of additions gives another sum."""
    return rng.normal(size=(n, m)) * 10.0 ** rng.integers(-30, 31, (n, m))


def planted_diagonal(rng: np.random.Generator, n: int, m: int) -> Array:
    """A route: one dark diagonal of some speed and start, with noise."""
    D = rng.uniform(0.5, 1.5, (n, m))
    speed, start = rng.choice([0.5, 1.0, 1.5]), rng.integers(0, n)
    for j in range(m):
        D[int(start + speed * j) % n, j] = rng.uniform(0.0, 0.7)
    return D


KINDS = (
    random_floats,
    small_integers,
    constant_columns,
    all_equal,
    negative,
    extreme,
    wild,
    planted_diagonal,
)


@dataclass(frozen=True)
class Case:
    kind: str
    D: Array
    options: Options
    trusted: Array | None
    gaps: Array
    route: list[Road] | None = None


def cut(rng: np.random.Generator, n: int) -> list[Road]:
    """1.14: `n` places in segments of 1 to 40, about half of the longer ones closed."""
    most = int(rng.choice([n, 1, 3, 8, 40]))
    breaks = np.cumsum(rng.integers(1, most + 1, n))
    closed = np.flatnonzero(rng.random(n + 1) < 0.5)
    route = oracle.roads(n, [int(b) for b in breaks[breaks < n]], [int(c) for c in closed])
    return [replace(road, closed=road.closed and len(road) > 2) for road in route]


def segments_of(n: int, route: list[Road] | None) -> surefix.Segments:
    """The library's segments of a route."""
    route = route or [Road(0, n)]
    closed = [number for number, road in enumerate(route) if road.closed]
    return surefix.Segments(n, breaks=[road.first for road in route[1:]], closed=closed)


def generate(rng: np.random.Generator, segments: bool = False) -> Case:
    """One matrix, its options, and sometimes a predictor from outside."""
    kind = KINDS[rng.integers(len(KINDS))]
    n = int(rng.integers(2, 9) if rng.random() < 0.3 else rng.integers(2, 65))
    m = int(rng.integers(1, 71) if rng.random() < 0.25 else rng.integers(1, 13))
    D = kind(rng, n, m).astype(np.float32)
    route = cut(rng, n) if segments else None
    most = n
    if route is not None and not any(road.closed for road in route):
        most = max(len(road) for road in route)
    length = int(
        rng.integers(1, most + 1) if rng.random() < 0.4 else rng.integers(1, min(most, 6) + 1)
    )
    choice = rng.random()
    speeds = (1.0,) if choice < 0.5 else tuple(rng.permutation([0.0, 0.5, 0.9, 1.0, 1.1, 1.5]))
    speeds = speeds[: int(rng.integers(1, 5))]
    fitting = tuple(float(v) for v in speeds if oracle.steps_back(v, length - 1) < most) or (1.0,)
    floor: oracle.Floor = ("running", "global", "fixed")[rng.integers(3)]
    if floor == "fixed":
        floor = float(np.float32(rng.choice([D.min() - 1.0, D.mean(), D.max() + 1.0, 0.0])))
    options = Options(
        sequence_length=length,
        weight=float(rng.choice([0.0, rng.random(), 0.99, 1.0])),
        tolerance=int(rng.integers(0, 4)),
        smoothing=int(n + rng.integers(1, 6) if rng.random() < 0.1 else rng.integers(1, 8)),
        gradient=("halved", "unhalved")[rng.integers(2)],
        floor=floor,
        speeds=fitting,
    )
    trusted = rng.random(m) < 0.5 if rng.random() < 0.2 else None
    # None, a few or many, in any order, some twice; and so that long windows fill up between them.
    one_in = rng.choice([2, 5, 2 * length, 10 * length])
    gaps = np.flatnonzero(rng.random(m) < 1 / one_in) if rng.random() < 0.5 else np.arange(0)
    gaps = rng.permutation(np.concatenate([gaps, gaps[:2]]))
    return Case(kind.__name__, D, options, trusted, gaps, route)


# The two doors of the library, in the words of `oracle.Run`.


def batch(
    D: Array,
    options: Options,
    trusted: Array | None = None,
    gaps: Array | None = None,
    route: list[Road] | None = None,
) -> oracle.Run:
    segments = segments_of(len(D), route) if route else None
    run = surefix.match_distances(
        D, trusted=trusted, gaps=gaps, segments=segments, **asdict(options)
    )
    return oracle.Run(*(np.asarray(getattr(run, name)) for name in oracle.Run.__annotations__))


def matcher(D: Array, options: Options, route: list[Road] | None = None) -> Any:
    """A stream cannot know the global minimum: it is told, as a fixed floor (1.4)."""
    if options.floor == "global":
        least = float(oracle.floors(D, "global").min(initial=np.inf))
        options = replace(options, floor=least if np.isfinite(least) else "running")
    return surefix.Matcher(segments_of(len(D), route) if route else len(D), **asdict(options))


def row(fix: Any) -> tuple[Any, ...]:
    """One fix in the order of `oracle.Run`."""
    sequence = fix.sequence
    return (
        fix.place,
        fix.score,
        fix.trusted,
        0 if sequence is None else sequence.anchors,
        sequence is not None,
        np.nan if sequence is None else sequence.speed,
        fix.single.place,
        fix.single.distance,
        fix.gradient.place,
        fix.gradient.value,
        fix.blank,
        fix.segment,
        fix.segment_place,
    )


def stream(
    D: Array,
    options: Options,
    trusted: Array | None = None,
    gaps: Array | None = None,
    cut: int = -1,
    route: list[Road] | None = None,
) -> oracle.Run:
    """Pushed column by column; before column `cut`, it is saved and restored."""
    live = matcher(D, options, route)
    rows = []
    for j, column in enumerate(D.T.copy()):
        if gaps is not None and j in gaps:
            live.gap()
        if j == cut:
            live = surefix.Matcher.restore(live.snapshot())
        fix = live.push(column) if trusted is None else live.push(column, trusted=bool(trusted[j]))
        assert fix.frame == j
        if fix.sequence is not None:
            assert (fix.place, fix.score) == (fix.sequence.place, fix.sequence.score)
        rows.append(row(fix))
    assert live.segments == segments_of(len(D), route)
    return oracle.Run(*(np.asarray(values) for values in zip(*rows, strict=True)))


def assert_same(got: oracle.Run, want: oracle.Run, what: object, score_rtol: float) -> None:
    """Every value equal (NaN speeds too), the score within `score_rtol` of itself."""
    for name in EXACT:
        g, w = getattr(got, name), getattr(want, name)
        if not np.array_equal(g, w, equal_nan=name == "speed"):
            pytest.fail(f"{name}: got {g}, want {w}\nin {what}")
    if got.score.shape != want.score.shape or not np.allclose(
        got.score, want.score, rtol=score_rtol, atol=0.0
    ):
        pytest.fail(f"score: got {got.score}, want {want.score}\nin {what}")


@pytest.mark.parametrize(
    "seed", [seed if seed < 3 else pytest.param(seed, marks=pytest.mark.slow) for seed in SEEDS]
)
def test_stream_and_batch_equal_the_oracle(seed: int) -> None:
    """Sections 1.1 to 1.5, whole, on generated matrices of every kind and every option, with
    gaps.
    """
    rng = np.random.default_rng(seed)
    ready = anchors = slower = again = 0
    for number in range(CASES_PER_SEED):
        case = generate(rng)
        cut = int(rng.integers(case.D.shape[1])) if rng.random() < 0.3 else -1
        want = oracle.match(case.D, case.options, case.trusted, case.gaps)
        as_batch = batch(case.D, case.options, case.trusted, case.gaps)
        as_stream = stream(case.D, case.options, case.trusted, case.gaps, cut)
        what = (seed, number, case)
        assert_same(as_batch, want, what, score_rtol=0.0)
        assert_same(as_stream, as_batch, what, score_rtol=0.0)
        CASES_RUN[seed] = number + 1
        ready += int(want.ready.sum())
        anchors += int(want.anchors.sum())
        slower += int((want.ready & (want.speed != case.options.speeds[0])).sum())
        again += int(want.ready[case.gaps.min() :].sum()) if len(case.gaps) else 0
    assert min(ready, anchors, slower, again) > 200, "the generator stopped reaching the sequence"


@pytest.mark.parametrize(
    "seed", [seed if seed < 1 else pytest.param(seed, marks=pytest.mark.slow) for seed in ROADS]
)
def test_segments_and_closed_ones_equal_the_oracle(seed: int) -> None:
    """1.14: the same on routes of segments, short and long, open and closed."""
    rng = np.random.default_rng(1000 + seed)
    ready = anchors = around = 0
    for number in range(CASES_PER_SEED):
        case = generate(rng, segments=True)
        assert case.route is not None
        cut = int(rng.integers(case.D.shape[1])) if rng.random() < 0.3 else -1
        want = oracle.match(case.D, case.options, case.trusted, case.gaps, case.route)
        as_batch = batch(case.D, case.options, case.trusted, case.gaps, case.route)
        as_stream = stream(case.D, case.options, case.trusted, case.gaps, cut, case.route)
        what = (seed, number, case)
        assert_same(as_batch, want, what, score_rtol=0.0)
        assert_same(as_stream, as_batch, what, score_rtol=0.0)
        ready += int(want.ready.sum())
        anchors += int(want.anchors.sum())
        for place, speed in zip(
            want.segment_place[want.ready], want.speed[want.ready], strict=True
        ):
            around += bool(place < oracle.steps_back(speed, case.options.sequence_length - 1))
    assert min(ready, anchors, around) > 200, "the generator stopped reaching the seams"


@pytest.mark.parametrize("pieces", [False, True])
def test_a_long_drive_in_segments_is_matched_in_pieces(pieces: bool) -> None:
    """A batch that is cut into pieces equals the oracle, across breaks and seams."""
    rng = np.random.default_rng(3)
    n, m = 60, 700 if pieces else 30
    D = rng.random((n, m)).astype(np.float32)
    D[np.arange(m) % 25, np.arange(m)] -= 0.5
    route, options = oracle.roads(n, [25, 26], [0, 2]), Options(sequence_length=4, smoothing=40)
    want = oracle.match(D, options, None, [300] if pieces else [], route)
    gaps = np.array([300] if pieces else [], np.int64)
    assert_same(batch(D, options, None, gaps, route), want, pieces, score_rtol=0.0)
    assert_same(stream(D, options, None, gaps, -1, route), want, pieces, score_rtol=0.0)


def test_ten_thousand_cases_were_run() -> None:
    """The figure the project states, counted and not only configured."""
    if set(CASES_RUN) != set(SEEDS):
        pytest.skip("only some of the seeds ran in this process")
    assert sum(CASES_RUN.values()) >= 10_000


@pytest.mark.parametrize("seed", range(50))
def test_a_stream_told_the_global_minimum_is_the_paper_s_batch(seed: int) -> None:
    """1.4: `fixed(global minimum)` = `global`, bit for bit, if the running floor differs."""
    rng = np.random.default_rng(seed)
    D = rng.random((20, 30)).astype(np.float32)
    D[:, -1] -= 1.0  # the global minimum comes last
    options = Options(sequence_length=3, floor="global")
    whole = batch(D, options)
    assert_same(stream(D, options), whole, seed, score_rtol=0.0)
    running = batch(D, replace(options, floor="running"))
    assert not np.array_equal(running.score, whole.score)


def test_a_stream_refuses_the_global_floor() -> None:
    """1.4: `global` is for batch use."""
    with pytest.raises(surefix.SurefixError):
        surefix.Matcher(places=4, floor="global")


LAYOUTS: dict[str, Callable[[Array], Array]] = {
    "fortran": np.asfortranarray,
    "transposed": lambda D: np.ascontiguousarray(D.T).T,
    "strided": lambda D: np.repeat(np.repeat(D, 2, axis=0), 3, axis=1)[::2, ::3],
    "reversed": lambda D: np.ascontiguousarray(D[::-1, ::-1])[::-1, ::-1],
    "read_only": lambda D: np.broadcast_to(D, D.shape),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_layout_of_a_matrix_changes_nothing(layout: str) -> None:
    """The same numbers in another order of memory give the same answers, in batch and pushed."""
    D = np.random.default_rng(7).random((23, 17)).astype(np.float32)
    laid_out = LAYOUTS[layout](D)
    np.testing.assert_array_equal(laid_out, D)
    options = Options(sequence_length=4)
    want = batch(D, options)
    assert_same(batch(laid_out, options), want, layout, score_rtol=0.0)
    live = matcher(D, options)
    pushed = [live.push(laid_out[:, j]) for j in range(D.shape[1])]
    assert [fix.place for fix in pushed] == want.place.tolist()
    assert [fix.score for fix in pushed] == want.score.tolist()


BAD = {"nan": np.nan, "inf": np.inf, "minus_inf": -np.inf}


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("when", range(7))
def test_a_refused_column_leaves_the_matcher_as_it_was(bad: str, when: int) -> None:
    """`push` is atomic: before the warm-up, in it and after, under the running floor.

    The refused column would be the new floor, a new anchor and the best match, were any of it kept.
    """
    rng = np.random.default_rng(when)
    n, m, options = 12, 12, Options(sequence_length=4, smoothing=5)
    D = rng.random((n, m)).astype(np.float32)
    live, never_saw_it = matcher(D, options), matcher(D, options)
    for j in range(m):
        if j == when:
            for place in (0, n // 2, n - 1):
                column = np.full(n, -100.0, np.float32)
                column[place] = BAD[bad]
                with pytest.raises(surefix.SurefixError):
                    live.push(column)
                with pytest.raises(surefix.SurefixError):
                    live.push(column, trusted=True)
        got, want = live.push(D[:, j].copy()), never_saw_it.push(D[:, j].copy())
        assert got.frame == want.frame == j
        np.testing.assert_array_equal(row(got), row(want))


@pytest.mark.parametrize("length", [0, 11, 13])
def test_a_column_of_the_wrong_length_leaves_the_matcher_as_it_was(length: int) -> None:
    """`push` is atomic for the other thing a column can have wrong."""
    D = np.random.default_rng(8).random((12, 6)).astype(np.float32)
    live, never_saw_it = matcher(D, Options()), matcher(D, Options())
    for j in range(D.shape[1]):
        with pytest.raises(surefix.SurefixError):
            live.push(np.full(length, -100.0, np.float32))
        np.testing.assert_array_equal(
            row(live.push(D[:, j].copy())), row(never_saw_it.push(D[:, j].copy()))
        )


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("cell", [(0, 0), (5, 3), (11, 7)])
def test_batch_refuses_what_a_stream_refuses(bad: str, cell: tuple[int, int]) -> None:
    """A matrix with one cell that is no distance is no matrix of distances."""
    D = np.random.default_rng(9).random((12, 8)).astype(np.float32)
    D[cell] = BAD[bad]
    with pytest.raises(surefix.SurefixError):
        surefix.match_distances(D)


@pytest.mark.parametrize("length", [0, 7, 9])
def test_batch_refuses_trusted_of_another_length(length: int) -> None:
    """An external predictor says one word per query."""
    D = np.random.default_rng(10).random((12, 8)).astype(np.float32)
    with pytest.raises(surefix.SurefixError):
        surefix.match_distances(D, trusted=np.ones(length, bool))
