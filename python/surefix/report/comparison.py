"""Methods compared on one drive: their matches, their curves, and what separates them from the
plain sequence.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from surefix import (
    Evaluation,
    Matches,
    Run,
    Trust,
    evaluate,
    evaluate_trust,
    match_distances,
    recall_at,
)
from surefix.baselines import METHODS, Context, run_method
from surefix.baselines.truth import Truth, by_metres, right_matches
from surefix.plot.bars import Estimate

__all__ = ["BASELINE", "KS", "UPTO", "Comparison", "Result", "compare"]

BASELINE = "sequence"
WEIGHTED = "weighted"
UPTO = 0.2
KS = (1, 5, 10)


@dataclass(frozen=True, eq=False)
class Result:
    """What one method made of the drive.

    Attributes
    ----------
    matches : Matches
    right, judged : arrays of bool, shape (m,)
        Which matches are right; and which were judged at all: ready, and not ignored by the truth.
    area, difference : (value, low, high)
        The area under the curve up to recall 0.2, and how far it lies above the plain sequence's,
        with the 95 % intervals of a bootstrap over blocks of queries.
    """

    name: str
    matches: Matches
    curve: Evaluation
    right: NDArray[np.bool_]
    judged: NDArray[np.bool_]
    area: Estimate
    difference: Estimate

    @property
    def description(self) -> str:
        """The method in a few words."""
        return METHODS[self.name].description

    @property
    def accepted(self) -> NDArray[np.bool_]:
        """Which matches the method does not refuse whatever their score, shape (m,)."""
        assert self.matches.accepted is not None
        return self.matches.accepted


@dataclass(frozen=True, eq=False)
class Comparison:
    """A drive with its truth, and the results of the methods, the plain sequence among them.

    Attributes
    ----------
    distances : array of float32, shape (n, m)
    context : Context
        The options and the truth that all methods had.
    recall : {"correct", "place_exists", "rejected"}
        The convention of every curve.
    run : Run
        The weighted sequence, with the trust flags of the consensus.
    results : sequence of Result
        In the order of the table.
    """

    distances: NDArray[np.float32]
    context: Context
    recall: str
    run: Run
    trust: Trust
    recalls_at: Sequence[float]
    results: Sequence[Result]

    def __len__(self) -> int:
        return len(self.run)

    @property
    def truth(self) -> Truth:
        """As ``surefix.evaluate`` takes it."""
        assert self.context.truth is not None
        return self.context.truth

    @cached_property
    def baseline(self) -> Result:
        """The plain sequence."""
        return next(result for result in self.results if result.name == BASELINE)

    @cached_property
    def shown(self) -> Result:
        """The method that the pictures are of: the weighted sequence where it was asked for, else
        the last one.
        """
        return next(
            (result for result in self.results if result.name == WEIGHTED), self.results[-1]
        )

    @property
    def by_position(self) -> bool:
        """Whether the truth is positions in metres."""
        return by_metres(self.truth)

    @cached_property
    def single_right(self) -> NDArray[np.bool_]:
        """Which single matches, of which the trust flags speak, are right."""
        return right_matches(
            self.run.single_place, len(self.distances), self.truth, self.context.truth_tolerance
        )[0]

    @cached_property
    def single_judged(self) -> NDArray[np.bool_]:
        """Of which single matches the truth says anything."""
        return right_matches(
            self.run.single_place, len(self.distances), self.truth, self.context.truth_tolerance
        )[1]

    @cached_property
    def true_place(self) -> NDArray[np.int64]:
        """A true place of each query, shape (m,): the nearest or the first where there are several,
        -1 where none.
        """
        if by_metres(self.truth):
            places, queries = (np.asarray(positions, np.float64) for positions in self.truth)
            found = np.full(len(queries), -1, np.int64)
            for query, here in enumerate(queries):
                apart = np.sqrt(((places - here) ** 2).sum(axis=1))
                nearest = int(np.argmin(apart))
                if apart[nearest] <= self.context.truth_tolerance:
                    found[query] = nearest
            return found
        truth = np.asarray(self.truth)
        if truth.ndim == 1:
            return truth.astype(np.int64)
        return np.where((truth == 1).any(axis=0), np.argmax(truth == 1, axis=0), -1).astype(
            np.int64
        )

    def off(self, query: int, place: int) -> str:
        """How far a match is from the truth, in words."""
        if by_metres(self.truth):
            places, queries = (np.asarray(positions, np.float64) for positions in self.truth)
            return f"{float(np.linalg.norm(places[place] - queries[query])):.0f} m off"
        true = int(self.true_place[query])
        return "not on the map" if true < 0 else f"{abs(place - true)} places off"

    def mistakes(self, count: int) -> list[int]:
        """Queries whose match by the shown method is wrong, the best scores first."""
        shown = self.shown
        wrong = np.flatnonzero(shown.judged & shown.accepted & ~shown.right)
        return [
            int(query)
            for query in wrong[np.argsort(shown.matches.score[wrong], kind="stable")][:count]
        ]

    def trusted_mistakes(self, count: int) -> list[int]:
        """Queries whose single match is trusted and wrong, the least distances first; none that
        ``mistakes`` gives.
        """
        wrong = self.run.trusted & self.single_judged & ~self.single_right
        for query in self.mistakes(count):
            wrong[query] &= self.run.single_place[query] != self.shown.matches.place[query]
        order = np.argsort(self.run.single_distance, kind="stable")
        return [int(query) for query in order[wrong[order]][:count]]


def compare(
    D: NDArray[np.float32],
    methods: Iterable[str],
    context: Context,
    recall: str = "correct",
    done: Callable[[Result], object] = lambda result: None,
) -> Comparison:
    """Matches by each method and holds it against the truth of ``context``.

    The plain sequence is always among them, as the others are compared to it.

    Parameters
    ----------
    D : array of float32, shape (n, m)
    methods : iterable of str
        Names of ``surefix.baselines.METHODS``.
    context : Context
        With a truth.
    recall : {"correct", "place_exists", "rejected"}
    done : callable
        Told each result when it is there.

    Raises
    ------
    SurefixError
        As ``surefix.baselines.run_method`` and ``surefix.evaluate``.
    """
    names = list(dict.fromkeys(methods))
    if BASELINE not in names:
        names.insert(0, BASELINE)
    truth, tolerance = context.truth, context.truth_tolerance
    assert truth is not None
    run = match_distances(
        D,
        floor=context.floor,
        sequence_length=context.sequence_length,
        weight=context.weight,
        tolerance=context.tolerance,
        smoothing=context.smoothing,
        gradient=context.gradient,
        speeds=[1.0] if context.speeds is None else list(context.speeds),
    )
    plain = evaluate(run_method(BASELINE, D, context), truth, tolerance, recall)
    results = []
    for name in names:
        matches = run_method(name, D, context)
        curve = evaluate(matches, truth, tolerance, recall)
        right, said = right_matches(matches.place, len(D), truth, tolerance)
        assert matches.ready is not None
        area = curve.auc(UPTO)
        difference = area - plain.auc(UPTO), *curve.auc_difference_interval(plain, UPTO)
        interval = area, *curve.auc_interval(UPTO)
        result = Result(name, matches, curve, right, said & matches.ready, interval, difference)
        results.append(result)
        done(result)
    ks = [k for k in KS if k <= len(D)]
    return Comparison(
        distances=D,
        context=context,
        recall=recall,
        run=run,
        trust=evaluate_trust(run, truth, tolerance),
        recalls_at=recall_at(D, truth, ks, tolerance),
        results=results,
    )
