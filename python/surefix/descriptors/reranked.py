"""From a few re-ranked candidates to the distances of all places, for ``Matcher.push``."""

import os
from collections import Counter
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np
import numpy.typing as npt

from surefix.errors import mismatch
from surefix.tables.rows import read_text

# The least spread as a share of the scores' size, for float32 to tell the places apart.
SMALLEST_SPREAD = 1e-3


def reranked_distances(
    global_distances: npt.ArrayLike, candidates: npt.ArrayLike, scores: npt.ArrayLike | None = None
) -> npt.NDArray[np.float32]:
    """The distance of every place, if a second, slower method gave scores to a few candidates only.

    A candidate's distance is its score. Let ``worst`` be the greatest score and ``spread`` its
    distance from the smallest (at least a thousandth of the largest magnitude; 1 if all scores are
    0). The other places lie from ``worst + spread / 2`` to ``worst + spread``, linearly in their
    global distance: worse than every candidate, finite, and in the order of their global distances,
    as far as float32 tells them apart.

    Parameters
    ----------
    global_distances : array, shape (n,)
        By the first, fast descriptor, such as NetVLAD's; smaller is nearer.
    candidates : array of int, shape (k,)
        The re-ranked places, each once.
    scores : array, shape (k,), optional
        Of the candidates, in their order; smaller is better, as with Patch-NetVLAD. Without them
        the candidates are ranked, the best first, and their scores are 0, 1, 2 and so on.

    Returns
    -------
    array of float32, shape (n,)

    Raises
    ------
    SurefixValueError
        If the shapes do not agree, a number is not finite, or a candidate is no place or comes
        twice.

    Examples
    --------
    >>> from surefix.descriptors import reranked_distances
    >>> reranked_distances([0.5, 0.25, 0.75, 1.0], candidates=[1, 0], scores=[-0.5, -0.25])
    array([-0.25 , -0.5  , -0.125,  0.   ], dtype=float32)
    """
    coarse = _vector("global_distances", global_distances)
    chosen = np.asarray(candidates)
    if chosen.ndim != 1 or chosen.dtype.kind not in "iu" or len(chosen) == 0:
        got = f"{chosen.dtype} {chosen.shape}"
        raise mismatch("candidates", "at least one place's index, (k,)", got)
    if chosen.min() < 0 or chosen.max() >= len(coarse):
        wrong = chosen[(chosen < 0) | (chosen >= len(coarse))][0]
        raise mismatch("candidates", f"places from 0 to {len(coarse) - 1}", wrong)
    places, counts = np.unique(chosen, return_counts=True)
    if len(places) != len(chosen):
        raise mismatch("candidates", "each place once", f"{places[counts > 1][0]} twice")
    fine = np.arange(len(chosen), dtype=np.float64) if scores is None else _vector("scores", scores)
    if len(fine) != len(chosen):
        raise mismatch("scores", f"one for each of the {len(chosen)} candidates", len(fine))
    worst = float(fine.max())
    spread = max(worst - float(fine.min()), SMALLEST_SPREAD * float(np.abs(fine).max())) or 1.0
    others = np.ones(len(coarse), dtype=bool)
    others[chosen] = False
    distances = np.empty(len(coarse), dtype=np.float64)
    distances[chosen] = fine
    if others.any():
        rest = coarse[others]
        low, high = rest.min(), rest.max()
        along = (rest - low) / (high - low) if high > low else np.zeros(len(rest))
        distances[others] = worst + spread * (1 + along) / 2
    return distances.astype(np.float32)


def read_pairs(
    path: str | PathLike[str],
    references: Sequence[str | PathLike[str]],
    queries: Sequence[str | PathLike[str]],
) -> list[npt.NDArray[np.int64]]:
    """The ranked candidates of each query from a pairs file, such as
    ``PatchNetVLAD_predictions.txt``.

    Such a file (kapture's and hloc's pairs) has a line ``query, reference`` a candidate, the best
    first, or with a space between, and comments that begin with ``#``. It has no scores: give the
    candidates to ``reranked_distances`` as they are.

    Parameters
    ----------
    path : str or path
    references, queries : sequence of str or path
        The images in route order, found by the name in the file, or by the last part of it.

    Returns
    -------
    list of m arrays of int64
        The places of each query, the best first; empty for a query without a line.

    Raises
    ------
    SurefixFileError
        If the file cannot be read.
    SurefixValueError
        For a malformed line, an image that is not listed, or a pair that comes twice.
    """
    places, numbers = _Names("references", references), _Names("queries", queries)
    text = read_text(Path(path), "the pairs")
    ranked: list[dict[int, None]] = [{} for _ in queries]
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        where = f"{path}, line {number}"
        parts = [part.strip() for part in (line.split(",") if "," in line else line.split())]
        # A score after the names is passed over.
        if len(parts) < 2 or not all(parts[:2]):
            raise mismatch(where, "query, reference", repr(line.strip()))
        query, place = numbers.find(parts[0], where), places.find(parts[1], where)
        if place in ranked[query]:
            raise mismatch(where, "each pair once", f"{parts[1]} twice for {parts[0]}")
        ranked[query][place] = None
    return [np.array(list(candidates), dtype=np.int64) for candidates in ranked]


class _Names:
    """The index of an image in its list, by its whole name or by the last part of it."""

    def __init__(self, what: str, names: Sequence[str | PathLike[str]]) -> None:
        self.what = what
        whole = [os.fspath(name) for name in names]
        self.whole = {name: index for index, name in enumerate(whole)}
        last = [Path(name).name for name in whole]
        self.last = {name: index for index, name in enumerate(last)}
        # Names that several images share.
        self.shared = {name for name, count in Counter(last).items() if count > 1}

    def find(self, name: str, where: str) -> int:
        if name in self.whole:
            return self.whole[name]
        short = Path(name).name
        if short in self.last and short not in self.shared:
            return self.last[short]
        why = f"several end in {short}" if short in self.shared else "there is none of that name"
        raise mismatch(where, f"one of the {len(self.whole)} {self.what}", f"{name}: {why}")


def _vector(name: str, values: npt.ArrayLike) -> npt.NDArray[np.float64]:
    array = np.asarray(values)
    if array.ndim != 1 or len(array) == 0 or array.dtype.kind not in "fiu":
        raise mismatch(name, "numbers of one dimension", f"{array.dtype} {array.shape}")
    if not np.isfinite(array).all():
        wrong = int(np.flatnonzero(~np.isfinite(array))[0])
        raise mismatch(name, "finite numbers", f"{array[wrong]} at index {wrong}")
    return array.astype(np.float64)
