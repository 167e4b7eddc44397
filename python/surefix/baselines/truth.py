"""Which matches are right, by the same three kinds of truth as ``surefix.evaluate``."""

from typing import Any, TypeAlias, TypeGuard

import numpy as np
import numpy.typing as npt

from surefix.baselines.distances import Flags, Places, number, whole
from surefix.contradicting import known_queries
from surefix.errors import mismatch

__all__ = ["Truth", "by_metres", "first_true_places", "part_of", "right_matches"]

Truth: TypeAlias = npt.NDArray[Any] | list[int] | tuple[npt.ArrayLike, npt.ArrayLike]


def right_matches(
    place: Places, places: int, truth: Truth, tolerance: float
) -> tuple[Flags, Flags]:
    """Is each match right, (m,), and does the truth say, (m,)? If not, it is not right."""
    if by_metres(truth):
        return _by_position(place, places, truth, number("tolerance", tolerance, 0.0))
    # A tolerance in places may come as a float, as from the command line.
    if isinstance(tolerance, float):
        if not tolerance.is_integer():
            expected = "a whole number of places, 0 or more (metres only if the truth is positions)"
            raise mismatch("option `tolerance`", expected, tolerance)
        tolerance = int(tolerance)
    frames, m = whole("tolerance", tolerance, 0), len(place)
    array = np.asarray(truth)
    if array.size == 0:
        array = array.astype(np.int64)
    if array.shape == place.shape and array.dtype.kind in "iuf":
        known = known_queries(array)
        part = known & ~(np.isfinite(array) & (array == np.round(array)))
        if part.any():
            query = int(np.argmax(part))
            expected = "whole numbers: a place, -1 if there is none, NaN if it is not known"
            got = f"{array.dtype} {array.shape}: {array[query]} for query {query}"
            raise mismatch("truth", expected, got)
        whole_places = np.where(known, array, -1).astype(np.int64)
        right, _ = _by_place(place, places, whole_places, frames)
        return right, known
    if array.shape == (places, m) and array.dtype.kind in "biu":
        return _by_cell(place, array, frames)
    kinds = f"a place a query ({m},), a matrix ({places}, {m}) or a pair of positions"
    raise mismatch("truth", kinds, f"{array.dtype} {array.shape}")


def by_metres(truth: Truth) -> TypeGuard[tuple[npt.ArrayLike, npt.ArrayLike]]:
    """Whether the truth is a pair of positions; two numbers are the places of two queries."""
    return isinstance(truth, tuple) and len(truth) == 2 and np.ndim(truth[0]) > 0


def first_true_places(truth: Truth, tolerance: float) -> Places:
    """A true place of each query, (m,): the nearest or first of several, -1 for none, and if it is
    not known.
    """
    if by_metres(truth):
        places, queries = (np.asarray(positions, np.float64) for positions in truth)
        found = np.full(len(queries), -1, np.int64)
        for query, here in enumerate(queries):
            apart = np.sqrt(((places - here) ** 2).sum(axis=1))
            if apart.min() <= tolerance:
                found[query] = np.argmin(apart)
        return found
    array = np.asarray(truth)
    if array.ndim == 2:
        array = np.where((array == 1).any(axis=0), np.argmax(array == 1, axis=0), -1)
    return np.where(np.isnan(array), -1, array).astype(np.int64)


def part_of(truth: Truth, start: int, stop: int) -> Truth:
    """The truth of some consecutive queries."""
    if by_metres(truth):
        return truth[0], np.asarray(truth[1])[start:stop]
    return np.asarray(truth)[..., start:stop]


def _by_place(place: Places, places: int, truth: Places, tolerance: int) -> tuple[Flags, Flags]:
    """The true place, or -1 if there is none and every match is wrong."""
    for wrong, expected in (
        (truth < -1, "a place, or -1 for none"),
        (truth >= places, f"places from 0 to {places - 1}, or -1 for none"),
    ):
        if wrong.any():
            query = int(np.argmax(wrong))
            raise mismatch("truth", expected, f"{truth[query]} for query {query}")
    return (truth >= 0) & (np.abs(place - truth) <= tolerance), np.ones(len(place), bool)


def _by_cell(place: Places, cells: npt.NDArray[Any], tolerance: int) -> tuple[Flags, Flags]:
    """Cells of 1 (the same place), 0 (not) and -1 (ignored): right near a 1."""
    cells = cells.astype(np.int64)
    if cells.size and not np.isin(cells, (-1, 0, 1)).all():
        row, query = np.argwhere(~np.isin(cells, (-1, 0, 1)))[0]
        cell = f"{cells[row, query]} at place {row}, query {query}"
        raise mismatch("truth", "cells of 1 (the same place), 0 (not) or -1 (ignored)", cell)
    queries = np.arange(len(place))
    right = np.zeros(len(place), bool)
    for step in range(-min(tolerance, len(cells)), min(tolerance, len(cells)) + 1):
        right |= cells[np.clip(place + step, 0, len(cells) - 1), queries] == 1
    return right, right | (cells[place, queries] != -1)


def _by_position(
    place: Places, places: int, truth: tuple[npt.ArrayLike, npt.ArrayLike], metres: float
) -> tuple[Flags, Flags]:
    """A pair of positions, of the places and of the queries: right within ``metres``."""
    there, here = (np.asarray(positions, np.float64) for positions in truth)
    if there.ndim != 2 or here.ndim != 2 or there.shape[1] != here.shape[1]:
        raise mismatch("truth", "positions (n, k) and (m, k)", f"{there.shape} and {here.shape}")
    if len(there) != places or len(here) != len(place):
        expected = f"{places} positions of places and {len(place)} of queries"
        raise mismatch("truth", expected, f"{len(there)} and {len(here)}")
    apart = np.sqrt(((there[place] - here) ** 2).sum(axis=1))
    return apart <= metres, known_queries(truth)
