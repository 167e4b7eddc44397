"""Scenarios: other drives made of the distances of a recorded one, whose truth is known.

A recorded pair mostly has one query a place, at an even speed, all of it on the map. A robot stops,
changes its speed, leaves the map, and is carried elsewhere. Each scenario walks along the recorded
queries at a speed of its own, and may take away rows of the map. A query that shows no new place is
its recorded frame once more, with the same distances: the noise of a camera at rest is not there.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from surefix.baselines.distances import Distances, Floats, Places, number
from surefix.errors import mismatch

__all__ = ["RECORDED", "SCENARIOS", "Drive", "Scenario", "scenario"]

RECORDED = "recorded"
# Queries from one random speed to the next, and moving queries for one stop.
KNOT, STOP = 12, 20

Steps: TypeAlias = Callable[[float, Floats | None, np.random.Generator], Floats]


@dataclass(frozen=True, eq=False)
class Drive:
    """Distances along a drive, and its truth.

    Parameters
    ----------
    distances : array of float32, shape (n, m)
    truth : array of int64, shape (m,)
        The true place of each query, a row of ``distances``; -1 if the map has none.
    advance : array of float64, shape (m,)
        Places moved since the query before, 0 for the first. If a stretch of the map is missing,
        its places count; on a thinned map its places do. A kidnap is not in it.
    name : str
        The scenario.
    rows : array of int64, shape (n,)
        The recorded place of each row.
    columns : array of int64, shape (m,)
        The recorded query of each column.
    jumps : array of int64
        The first query after each kidnap.
    """

    distances: Distances
    truth: Places
    advance: Floats
    name: str
    rows: Places
    columns: Places
    jumps: Places


@dataclass(frozen=True)
class Scenario:
    """A scenario in a line, and how it differs from the recorded drive.

    Parameters
    ----------
    description : str
    steps : callable, optional
        Gives places moved before each query; by default the recorded queries stay as they are.
    missing, kidnap : bool
        A fifth of the map is missing, in one stretch; the drive is cut and its pieces swapped.
    thin : int
        One row in this many stays.
    """

    description: str
    steps: Steps | None = field(default=None, repr=False)
    missing: bool = False
    kidnap: bool = False
    thin: int = 1


def scenario(
    name: str,
    D: Distances,
    truth: npt.ArrayLike,
    seed: int = 0,
    *,
    profile: npt.ArrayLike | None = None,
    spacing: float | None = None,
    scale_error: float = 0.0,
    noise: float = 0.0,
) -> Drive:
    """A drive made of a recorded one.

    Parameters
    ----------
    name : str
        A key of ``SCENARIOS``.
    D : array of float32, shape (n, m)
        The recorded distances between places and queries.
    truth : array, shape (m,)
        The true place of each query, -1 or NaN for none. Between two known places the robot is
        taken to move evenly, and before the first and after the last at its median speed.
    seed : int
        The same seed gives the same drive.
    profile : array, shape (k,), optional
        Speeds in m/s, one a second, for "profile": the drive starts at a random second of it, and
        after its end it begins again.
    spacing : float, optional
        Metres from one place of the map to the next, for "profile". Queries are taken at the rate
        that gives one a place at the profile's median speed, stops aside. By default once a second.
    scale_error, noise : float
        Of the odometry: ``advance`` is too large by this share, and each step has a normal error
        whose deviation is this share of it. Both 0 give the true ``advance``.

    Returns
    -------
    Drive

    Raises
    ------
    SurefixValueError
        For an unknown name, "profile" without speeds, a truth that does not fit the distances or
        knows fewer than two places, and a drive too short for the scenario.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.study import scenario
    >>> D = 1 - np.eye(50, dtype=np.float32)
    >>> drive = scenario("missing", D, np.arange(50))
    >>> drive.distances.shape, int((drive.truth < 0).sum())
    ((40, 50), 10)
    """
    plan = SCENARIOS.get(name)
    if plan is None:
        raise mismatch("scenario", f"one of {', '.join(SCENARIOS)}", repr(name))
    D = np.asarray(D)
    if D.ndim != 2 or min(D.shape) < 10:
        raise mismatch("distances", "at least 10 places and 10 queries", f"the shape {D.shape}")
    places = _along(truth, *D.shape)
    scale_error, noise = number("scale_error", scale_error, -1), number("noise", noise, 0)
    # The same drive with any odometry.
    rng, wheels = (np.random.default_rng((seed, stream)) for stream in (0, 1))

    # The recorded query that is nearest to each position of the walk.
    columns = np.arange(D.shape[1])
    if plan.steps is not None:
        speeds = None if name != "profile" else _per_query(profile, spacing)
        way = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(places)))))
        walk = np.cumsum(np.concatenate(([0.0], plan.steps(float(way[-1]), speeds, rng))))
        walk = walk[walk <= way[-1]]
        columns = np.searchsorted((way[1:] + way[:-1]) / 2, walk)
        if len(columns) < 4:
            got = f"{way[-1]:g} places, {len(columns)} queries"
            raise mismatch(f"scenario {name}", "a route for at least 4 queries", got)

    # A piece's first query keeps the advance that it had before the pieces were swapped; the first
    # of all has that of the second.
    steps = np.diff(places[columns]) / plan.thin
    advance = np.concatenate((steps[:1], steps))
    order, jumps = _swapped(len(columns), rng) if plan.kidnap else (np.arange(len(columns)), [])
    columns, advance = columns[order], advance[order]
    advance *= (1 + scale_error) * (1 + noise * wheels.standard_normal(len(advance)))
    advance[0] = 0

    rows = np.arange(0, len(D), plan.thin)
    if plan.missing:
        stretch = len(rows) // 5
        first = int(rng.integers(len(rows) - stretch + 1))
        rows = np.delete(rows, slice(first, first + stretch))
    known = np.asarray(truth, np.float64)[columns]
    return Drive(
        np.asfortranarray(D[np.ix_(rows, columns)]),
        _renumbered(known, rows, plan.thin - 1),
        advance,
        name,
        rows,
        columns,
        np.asarray(jumps, np.int64),
    )


def _along(truth: npt.ArrayLike, places: int, queries: int) -> Floats:
    """The place of each recorded query, in between if the truth has none, shape (m,)."""
    given = np.asarray(truth, np.float64)
    if given.shape != (queries,):
        raise mismatch("truth", f"a place a query, ({queries},)", f"the shape {given.shape}")
    known = np.flatnonzero(given >= 0)
    if known.size and given[known].max() >= places:
        query = int(known[np.argmax(given[known])])
        raise mismatch("truth", f"places from 0 to {places - 1}", f"{given[query]:g} at {query}")
    if len(np.unique(given[known])) < 2:
        raise mismatch("truth", "queries at two places or more", "fewer")
    at = np.arange(queries)
    found = np.interp(at, known, given[known])
    speed = float(np.median(np.diff(given[known]) / np.diff(known)))
    found += speed * (np.minimum(at - known[0], 0) + np.maximum(at - known[-1], 0))
    return found


def _renumbered(truth: Floats, rows: Places, reach: int) -> Places:
    """The row nearest to each true place, -1 for none within ``reach``."""
    nearest = np.searchsorted((rows[1:] + rows[:-1]) / 2, truth)
    there = np.abs(rows[nearest] - truth) <= reach
    return np.where((truth >= 0) & there, nearest, -1)


def _swapped(queries: int, rng: np.random.Generator) -> tuple[Places, Places]:
    """The queries in three or four pieces, none followed by its successor, and their starts."""
    jumps = int(rng.integers(2, 4))
    parts = np.arange(1, jumps + 1) + rng.uniform(-0.25, 0.25, jumps)
    pieces = np.split(np.arange(queries), (parts * queries / (jumps + 1)).astype(int))
    order = rng.permutation(jumps + 1)
    while (np.diff(order) == 1).any():
        order = rng.permutation(jumps + 1)
    lengths = [len(pieces[piece]) for piece in order]
    return np.concatenate([pieces[piece] for piece in order]), np.cumsum(lengths)[:-1]


def _per_query(profile: npt.ArrayLike | None, spacing: float | None) -> Floats:
    """Places moved before each query, from speeds in m/s, one a second."""
    if profile is None:
        raise mismatch("scenario profile", "speeds in m/s, one a second", "none")
    speeds = np.asarray(profile, np.float64)
    if speeds.ndim != 1 or not np.isfinite(speeds).all() or not (speeds > 0).any():
        raise mismatch("profile", "finite speeds (k,), some above 0", f"the shape {speeds.shape}")
    if (speeds < 0).any():
        row = int(np.argmin(speeds))
        raise mismatch("profile", "speeds of 0 or more", f"{speeds[row]:g} in row {row}")
    usual = float(np.median(speeds[speeds > 0]))
    metres = usual if spacing is None else number("spacing", spacing, 1e-9)
    seconds = np.arange(0, len(speeds) + 1e-9, metres / usual)
    way = np.interp(seconds, np.arange(len(speeds) + 1), np.concatenate(([0], np.cumsum(speeds))))
    if way[-1] <= 0:
        raise mismatch("profile", f"a way longer than the spacing, {metres:g} m", f"{way[-1]:g} m")
    moved: Floats = np.diff(way) / metres
    return moved


def _varied(way: float, _: Floats | None, rng: np.random.Generator) -> Floats:
    """Speeds from 0 to 2 places a query, linear from one random speed to the next."""
    queries = int(3 * way) + 10 * KNOT
    knots = rng.uniform(0, 2, queries // KNOT + 2)
    moving = np.interp(np.arange(queries) / KNOT, np.arange(len(knots)), knots)
    return _stopping(moving[np.cumsum(moving) <= way], rng)


def _profiled(way: float, speeds: Floats | None, rng: np.random.Generator) -> Floats:
    assert speeds is not None
    rounds = int(way / speeds.sum()) + 2
    return np.tile(np.roll(speeds, -int(rng.integers(len(speeds)))), rounds)


def _steady(places: float) -> Steps:
    def steps(way: float, _: Floats | None, rng: np.random.Generator) -> Floats:
        return _stopping(np.full(int(way / places), places), rng)

    return steps


def _stopping(moving: Floats, rng: np.random.Generator) -> Floats:
    """The same with stops at random, a third of the time."""
    stops = len(moving) // STOP + 1
    lengths = rng.multinomial(len(moving) // 2, np.full(stops, 1 / stops))
    at = rng.integers(len(moving) + 1, size=stops)
    return np.insert(moving, np.repeat(at, lengths), 0.0)


_STOPS = "with stops for a third of the time"
SCENARIOS: Mapping[str, Scenario] = MappingProxyType(
    {
        RECORDED: Scenario("the drive as it was recorded"),
        "speeds": Scenario(f"0 to 2 places a query, {_STOPS}", _varied),
        "profile": Scenario("the speeds of a real drive", _profiled),
        "missing": Scenario("a fifth of the map is missing, in one stretch", missing=True),
        "kidnap": Scenario("carried elsewhere, two or three times", kidnap=True),
        "all": Scenario(
            "speeds, missing and kidnap at once", _varied, missing=True, kidnap=True
        ),
        "rate-1/3": Scenario(f"3 queries a place, {_STOPS}", _steady(1), thin=3),
        "rate-1/2": Scenario(f"2 queries a place, {_STOPS}", _steady(1), thin=2),
        "rate-2": Scenario(f"2 places a query, {_STOPS}", _steady(2)),
        "rate-3": Scenario(f"3 places a query, {_STOPS}", _steady(3)),
        "rate-5": Scenario(f"5 places a query, {_STOPS}", _steady(5)),
    }
)  # fmt: skip
