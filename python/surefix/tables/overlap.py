"""Whether the positions of places and of queries belong together, and how they would."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from surefix._words import plural
from surefix.errors import SurefixValueError, mismatch
from surefix.tables.metres import nearest, places_per_metre
from surefix.tables.positions import Positions, on_one_plane

Float64 = npt.NDArray[np.float64]

FOOT = 0.3048
# Of the places that a random match would be right at: all but a few, and many.
ALL, MANY = 0.9, 0.25
# Queries and places that this share is counted on.
SAMPLE = 400
# Fewer queries near a place than this share are worth a word.
FEW = 0.1
# Queries of a drive whose extent says something, and how much smaller than the map's is small.
ENOUGH, SMALL = 20, 50
# A fit has queries at this many places.
SEVERAL = 4
# A place this many extents of the others away is a wrong fix.
LOST = 10


def check_overlap(
    references: Positions, queries: Positions, tolerance: float, *, compared: bool = True
) -> tuple[Float64, Float64, list[str]]:
    """Both in metres on one plane, and warnings: places far from all others, few queries near one.

    ``queries`` may have times and any number of rows. With ``compared`` false, only the plane is
    made.

    Raises
    ------
    SurefixValueError
        If no query is known, or within the tolerance of a place; or if almost any match would be
        right. The error has the numbers, and says what would fit.
    """
    there, here = on_one_plane(references, queries)
    warnings = [*references.notes, *queries.notes]
    if not compared:
        return there, here, warnings
    known = here[np.isfinite(here).all(axis=1)]
    if not len(known):
        raise mismatch(queries.source, "the position of a query", "none that is known")
    warnings += _lost(references.source, there)
    _, apart = nearest(there, known)
    near = apart <= tolerance
    numbers = (
        f"the nearest place is {_metres(float(np.median(apart)))} away in the middle of the "
        f"queries, {_metres(float(apart.min()))} at best; the tolerance is {_metres(tolerance)}; "
        f"places: {_extent(there)}; queries: {_extent(known)}"
    )
    if not near.any():
        fit = _better(references, queries, tolerance)
        fit = f"; {fit}" if fit else ""
        expected = f"a query within {tolerance:g} m of a place"
        raise mismatch(f"{queries.source} and {references.source}", expected, f"{numbers}{fit}")
    by_chance = _by_chance(there, known, tolerance)
    span, driven = (float(np.linalg.norm(np.ptp(each, axis=0))) for each in (there, known))
    alike = len(there) > 2 and span <= tolerance
    if by_chance >= ALL or alike:
        share = f"a random match would be right for {by_chance:.0%} of the queries"
        means = "all places lie within it of each other" if alike else share
        hint = "" if references.said and queries.said else "; are these degrees or kilometres?"
        where = f"{queries.source} and {references.source}"
        raise SurefixValueError(
            f"{where}: expected a tolerance that tells places apart: {means}. "
            f"The tolerance is {_metres(tolerance)}; places: {_extent(there)}{hint}"
        )
    if by_chance >= MANY:
        warnings.append(
            f"a random match would be right for {by_chance:.0%} of the queries: the tolerance of "
            f"{_metres(tolerance)} is large beside the route ({_extent(there)}); are the positions "
            "in metres?"
        )
    # Near the origin that both share, all of a small unit is near a place.
    if len(known) >= ENOUGH and driven * SMALL < span:
        fit = _better(references, queries, tolerance)
        if fit:
            warnings.append(f"places: {_extent(there)}; queries: {_extent(known)}; {fit}")
    if near.mean() < FEW:
        fit = _better(references, queries, tolerance)
        fit = f"; {fit}" if fit else ""
        few = plural(int(near.sum()), "query", "queries")
        warnings.append(f"only {few} of {len(known)} within the tolerance: {numbers}{fit}")
    return there, here, warnings


def _by_chance(there: Float64, here: Float64, tolerance: float) -> float:
    """The share of the pairs of a place and a query that are within the tolerance."""
    some = [
        each[np.unique(np.linspace(0, len(each) - 1, SAMPLE).astype(int))] for each in (there, here)
    ]
    axes = min(each.shape[1] for each in some)
    there, here = (each[:, :axes] for each in some)
    apart = np.sqrt(((there[:, None] - here[None]) ** 2).sum(axis=2))
    return float((apart <= tolerance).mean()) if len(there) > 2 else 0.0


def _lost(source: str, there: Float64) -> list[str]:
    """A warning of places far from all others."""
    middle = np.median(there, axis=0)
    away = np.linalg.norm(there - middle, axis=1)
    usual = float(np.quantile(away, 0.8))
    lost = np.flatnonzero(away > max(LOST * usual, 1.0))
    if not len(lost) or not usual:
        return []
    first = f"the first is row {lost[0]}, {_metres(float(away[lost[0]]))} from their middle"
    what = f"{plural(len(lost), 'position')} far from all others ({_metres(usual)}): a wrong fix?"
    return [f"{source}: {what} {first}"]


def _better(references: Positions, queries: Positions, tolerance: float) -> str:
    """What would bring most queries near a place, in words; empty if nothing does."""
    there, _ = on_one_plane(references, references)
    if len(there) < 2 or not np.ptp(there, axis=0).any():
        return ""
    within = max(tolerance, 3 / places_per_metre(there[:, :2]))
    # A move of the middle onto the other is no fit if that is all it takes.
    within = min(within, float(np.linalg.norm(np.ptp(there, axis=0))) / 10)
    for words, other in _alternatives(references, queries):
        try:
            plane, here = on_one_plane(references, other)
        except SurefixValueError:
            continue
        known = here[np.isfinite(here).all(axis=1)]
        place, apart = nearest(plane, known)
        # In a wrong unit all may fall onto one place.
        several = len(np.unique(place)) >= min(SEVERAL, len(known))
        if len(known) and several and np.median(apart) <= within:
            return words
    return ""


def _alternatives(references: Positions, queries: Positions) -> Iterator[tuple[str, Positions]]:
    values = queries.values

    def to(changed: Float64) -> Positions:
        return replace(queries, values=changed, notes=())

    names = "latitude and longitude" if queries.degrees else "x and y"
    swapped = np.concatenate([values[:, 1::-1], values[:, 2:]], axis=1)
    on_globe = not queries.degrees or np.nanmax(np.abs(swapped[:, 0])) <= 90
    if on_globe:
        yield (
            f"{names} are swapped in one of them: with them exchanged the queries fit",
            to(swapped),
        )
    if queries.degrees:
        yield "the sign of the longitude differs", to(values * [1, -1])
        return
    for words, factor in (
        (f"in kilometres the queries of {queries.source} would fit", 1000.0),
        (f"in kilometres the places of {references.source} would fit", 0.001),
        (f"in feet the queries of {queries.source} would fit", FOOT),
        (f"in feet the places of {references.source} would fit", 1 / FOOT),
        (f"in millimetres the queries of {queries.source} would fit", 0.001),
    ):
        yield words, to(values * factor)
    axes = min(values.shape[1], references.values.shape[1])
    middles = [np.nanmedian(each.values[:, :axes], axis=0) for each in (references, queries)]
    shift = middles[0] - middles[1]
    moved = values[:, :axes] + shift
    by = ", ".join(f"{step:.1f}" for step in shift)
    yield f"moved by {by} they fit: give both drives one origin", to(moved)


def _metres(value: float) -> str:
    if value >= 10_000:
        return f"{value / 1000:,.1f} km"
    return f"{value:,.0f} m" if value >= 100 else f"{value:.3g} m"


def _extent(values: Float64) -> str:
    """From where to where, in words."""
    low, high = np.nanmin(values, axis=0), np.nanmax(values, axis=0)
    spans = (f"{a:.6g} to {b:.6g}" for a, b in zip(low, high, strict=True))
    return " and ".join(list(spans)[:2]) + " m"
