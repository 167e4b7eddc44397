"""Matches with the verdict of a truth, and the figures that runs are compared by."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from surefix._core import Evaluation, Run, Segments, block_length, evaluate
from surefix.auditing import drawn_blocks
from surefix.baselines.truth import Truth, by_metres, first_true_places, right_matches
from surefix.errors import mismatch
from surefix.matches import Matches

__all__ = ["FIGURES", "HEADINGS", "RECALLS", "Judged", "SingleMatches", "redrawn"]

Floats: TypeAlias = npt.NDArray[np.float64]
Flags: TypeAlias = npt.NDArray[np.bool_]
Figures: TypeAlias = Callable[[npt.NDArray[Any]], dict[str, npt.NDArray[np.float64]]]
Recall: TypeAlias = Literal["correct", "place_exists", "rejected"]

FIGURES: Mapping[str, str] = MappingProxyType(
    {
        "right": "right matches, of the queries on the map",
        "area": "area under the precision-recall curve",
        "recall_at_full_precision": "largest recall at which all accepted matches are right",
        "trusted_precision": "right ones, of the trusted single matches",
        "trusted_recall": "trusted ones, of the right single matches",
        "off_map_roc": "area under the ROC curve of the queries off the map",
    }
)
"""The figures of a comparison, and what each is; of all of them more is better."""

HEADINGS: Mapping[str, str] = MappingProxyType(
    {
        "right": "right",
        "area": "area",
        "recall_at_full_precision": "recall at precision 1",
        "trusted_precision": "trust precision",
        "trusted_recall": "trust recall",
        "off_map_roc": "off-map ROC",
    }
)
"""The same in a few words."""

RECALLS: tuple[Recall, ...] = ("correct", "place_exists", "rejected")

# Numbers of a block of samples that are held at once.
HELD = 1 << 22


@dataclass(frozen=True, eq=False)
class SingleMatches:
    """The trust flags, and the verdict on the single matches that they speak of."""

    trusted: Flags
    right: Flags
    judged: Flags


@dataclass(frozen=True, eq=False)
class Judged:
    """The matches of one run or method, judged by a truth; one row a query.

    Parameters
    ----------
    name : str
    score : array of float32, shape (m,)
        Of each match; less is better.
    ready, accepted, right, judged : arrays of bool, shape (m,)
        Whether there is a match, is not refused at any score, is right, and whether the truth says.
    true_place : array of int64, shape (m,)
        -1 for none, or if it is not known.
    single : SingleMatches, or None
    off_map : array of float64, shape (m,), or None
        The probability to be off the map.
    queries : sequence of str, or None
        The names of the queries.
    drive : str, or None
        Another one for other files of the same names.
    recall : {"correct", "place_exists", "rejected"}
    """

    name: str
    score: npt.NDArray[np.float32]
    ready: Flags
    accepted: Flags
    right: Flags
    judged: Flags
    true_place: npt.NDArray[np.int64]
    single: SingleMatches | None = None
    off_map: Floats | None = None
    queries: Sequence[str] | None = None
    recall: Recall = "correct"
    drive: str | None = None

    @classmethod
    def by_truth(
        cls,
        name: str,
        matches: Run | Matches,
        truth: Truth,
        tolerance: float = 1,
        recall: Recall = "correct",
        queries: Sequence[str] | None = None,
        run: Any = None,
        segments: Segments | None = None,
        drive: str | None = None,
    ) -> "Judged":
        """The matches judged; ``run`` has the trust flags of matches that are no run, and
        ``segments`` say how the places follow each other.
        """
        if isinstance(matches, Run):
            run, segments = matches, matches.segments
        if not isinstance(matches, Run | Matches):
            kinds = "a surefix.Run or surefix.Matches"
            raise mismatch(f"runs, {name}", kinds, type(matches).__name__)

        def judge(place: npt.NDArray[np.int64]) -> tuple[Flags, Flags]:
            right, judged = right_matches(place, _places(place, truth, segments), truth, tolerance)
            if segments is not None and not by_metres(truth) and np.asarray(truth).ndim == 1:
                right = segments.are_near(place, true_place, int(tolerance)) & judged
            return right, judged

        true_place = first_true_places(truth, tolerance)
        place = np.asarray(matches.place, np.int64)
        right, judged = judge(place)
        accepted = getattr(matches, "accepted", None)
        single = None
        if run is not None:
            verdicts = judge(np.asarray(run.single_place, np.int64))
            single = SingleMatches(np.asarray(run.trusted), *verdicts)
        ready = np.asarray(matches.ready, bool)
        return cls(
            name,
            np.asarray(matches.score, np.float32),
            ready,
            np.ones(len(place), bool) if accepted is None else accepted,
            right,
            judged & ready,
            true_place,
            single,
            matches.off_map,
            queries,
            recall,
            drive,
        )

    def __len__(self) -> int:
        """The number of queries."""
        return len(self.right)

    @property
    def exists(self) -> Flags:
        """Which queries are on the map."""
        return self.true_place >= 0

    @cached_property
    def curve(self) -> Evaluation:
        """The precision-recall curve."""
        # All matches are of place 0; a right one is there, and a wrong one elsewhere or nowhere.
        truth = np.where(self.right, 0, np.where(self.exists, 1, -1))
        place = np.zeros(len(self), np.int64)
        matches = Matches(place, self.score, self.judged, self.accepted)
        return evaluate(matches, truth, 0, self.recall)

    @property
    def parts(self) -> list[tuple[int, Figures]]:
        """The figures but the area, in parts: how many queries errors last, and a function of how
        often each query is drawn, ``times`` (k, m), that gives each figure (k,); NaN if there is
        nothing that it is a share of.
        """
        lasts = _lasts(~self.right[self.judged])
        found: list[tuple[int, Figures]] = [(lasts, self._of_matches)]
        if (single := self.single) is not None:
            found.append((_lasts(~single.right[single.judged]), self._of_trust))
        return found

    def _of_matches(self, times: npt.NDArray[Any]) -> dict[str, Floats]:
        found = {"right": _share(times, self.right & self.exists, self.exists)}
        found["recall_at_full_precision"] = self._flawless(times)
        if (self.judged & ~self.exists).any():
            found["off_map_roc"] = self._off_map(times)
        return found

    def _of_trust(self, times: npt.NDArray[Any]) -> dict[str, Floats]:
        single = self.single
        assert single is not None
        both = single.trusted & single.right
        return {
            "trusted_precision": _share(times, both, single.trusted & single.judged),
            "trusted_recall": _share(times, both, single.right),
        }

    @cached_property
    def _by_score(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """The judged queries, the best score first, and the first of each distinct score."""
        which = np.flatnonzero(self.judged)
        return _grouped(which, self.score)

    def _flawless(self, times: npt.NDArray[Any]) -> Floats:
        """The largest recall at which all accepted matches are right."""
        order, firsts = self._by_score
        if not len(order):
            return np.full(len(times), np.nan)
        drawn = times[:, order]
        right, accepted = self.right[order], self.accepted[order]
        # Equal scores enter together.
        wrong = np.add.reduceat(drawn * (accepted & ~right), firsts, axis=1).cumsum(axis=1)
        found = np.add.reduceat(drawn * (accepted & right), firsts, axis=1).cumsum(axis=1)
        most = np.where(wrong == 0, found, 0).max(axis=1)
        among = {"correct": right, "place_exists": self.exists[order]}
        of = drawn @ among.get(self.recall, np.ones(len(order), bool)).astype(np.float64)
        return np.where(of > 0, most / np.maximum(of, 1), 0.0)

    def _off_map(self, times: npt.NDArray[Any]) -> Floats:
        """How often a query off the map has the higher score of two, ties half."""
        by = self.score if self.off_map is None else self.off_map
        order, firsts = _grouped(np.flatnonzero(self.judged), by)
        drawn, away = times[:, order].astype(np.float64), ~self.exists[order]
        on = np.add.reduceat(drawn * ~away, firsts, axis=1)
        off = np.add.reduceat(drawn * away, firsts, axis=1)
        below = on.cumsum(axis=1) - on / 2
        pairs = on.sum(axis=1) * off.sum(axis=1)
        return np.where(
            pairs > 0, (off * below).sum(axis=1) / np.where(pairs > 0, pairs, 1), np.nan
        )


def redrawn(queries: int, block: int, samples: int) -> Iterator[npt.NDArray[np.int32]]:
    """How often each query is drawn, (k, queries) at a time, in drives made of blocks of
    consecutive ones (the first follows on the last), as neighbours err together.
    """
    starts, lengths = drawn_blocks(queries, min(block, queries), samples)
    step = max(1, HELD // queries)
    for first in range(0, samples, step):
        part = starts[first : first + step]
        edges = np.zeros((len(part), 2 * queries + 1), np.int32)
        rows = np.arange(len(part))[:, None]
        np.add.at(edges, (rows, part), 1)
        np.add.at(edges, (rows, part + lengths), -1)
        along = edges.cumsum(axis=1, dtype=np.int32)
        yield along[:, :queries] + along[:, queries:-1]


def _lasts(errors: Flags) -> int:
    return block_length(np.float32(errors)) or 1


def _grouped(
    which: npt.NDArray[np.int64], by: npt.NDArray[Any]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    order = which[np.argsort(by[which], kind="stable")]
    values = by[order]
    return order, np.flatnonzero(np.concatenate(([True], values[1:] != values[:-1])))


def _share(times: npt.NDArray[Any], part: Flags, whole: Flags) -> Floats:
    # Sums of whole numbers, exact as floats.
    some, all_ = (times @ flags.astype(np.float64) for flags in (part, whole))
    return np.where(all_ > 0, some / np.maximum(all_, 1), np.nan)


def _places(place: npt.NDArray[np.int64], truth: Truth, segments: Segments | None) -> int:
    """The number of places, as far as it is known: of matches alone, by the truth."""
    if segments is not None:
        return segments.places
    if by_metres(truth):
        return len(np.asarray(truth[0]))
    known = np.asarray(truth)
    if known.ndim == 2:
        return len(known)
    return int(max([*place, *known[np.isfinite(known)], 0])) + 1
