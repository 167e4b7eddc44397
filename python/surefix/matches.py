"""Matches of any method, as ``surefix.evaluate`` takes them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix.errors import mismatch


@dataclass(frozen=True, eq=False)
class Matches:
    """One match a query, of any method, for ``surefix.evaluate``.

    Parameters
    ----------
    place : array of int, shape (m,)
        The place that each query was matched to.
    score : array of float32, shape (m,)
        Of each match; less is better.
    ready : array of bool, shape (m,), optional
        False if the method had no answer yet, as in a sequence's warm-up: such queries are left
        out. All True by default.
    accepted : array of bool, shape (m,), optional
        False if the method rejects the match at any score, as a mask does: such queries still count
        towards recall. All True by default.
    confidence, off_map : arrays of float, shape (m,), optional
        What the method believes, from 0 to 1: that the match is right, and that the robot is off
        the map, if it says so.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> distances = 1 - np.eye(5, dtype=np.float32)
    >>> matches = surefix.Matches(place=distances.argmin(0), score=distances.min(0))
    >>> surefix.evaluate(matches, np.arange(5)).max_recall
    1.0
    """

    place: npt.NDArray[np.int64]
    score: npt.NDArray[np.float32]
    ready: npt.NDArray[np.bool_] | None = None
    accepted: npt.NDArray[np.bool_] | None = None
    confidence: npt.NDArray[np.float64] | None = None
    off_map: npt.NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        place, score = np.asarray(self.place), np.asarray(self.score)
        if place.ndim != 1 or (place.size and place.dtype.kind not in "iu"):
            raise mismatch("place", "whole numbers, one a query", f"{place.dtype} {place.shape}")
        if score.dtype.kind not in "fiu":
            raise mismatch("score", "numbers, one a query", score.dtype)
        fields: dict[str, Any]
        fields = {"place": place.astype(np.int64), "score": score.astype(np.float32)}
        for name in ("ready", "accepted"):
            flags = getattr(self, name)
            fields[name] = np.ones(len(place), bool) if flags is None else np.asarray(flags)
            if fields[name].dtype != np.bool_:
                raise mismatch(name, "bool, one a query", fields[name].dtype)
        for name in ("confidence", "off_map"):
            said = getattr(self, name)
            if said is not None:
                # Sums of probabilities may pass 1 by a rounding error.
                fields[name] = np.asarray(said, np.float64)
                bad = ~((fields[name] >= 0) & (fields[name] <= 1 + 1e-6))
                if bad.any():
                    query = int(np.argmax(bad))
                    got = f"{fields[name][query]} at query {query}"
                    raise mismatch(name, "probabilities from 0 to 1", got)
        for name, array in fields.items():
            if array.shape != place.shape:
                expected = f"one number a query, {place.shape}"
                raise mismatch(name, expected, f"the shape {array.shape}")
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        """The number of queries."""
        return len(self.place)
