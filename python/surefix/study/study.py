"""A study: distances with a truth, and the methods that are run on them and judged."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from surefix._core import (
    Evaluation,
    Run,
    Trust,
    evaluate,
    evaluate_trust,
    match_distances,
    recall_at,
)
from surefix._ray import hold, mapped
from surefix.baselines import Context, run_method
from surefix.baselines.distances import Distances, Flags, Floats, Places
from surefix.baselines.truth import Truth, by_metres, first_true_places, right_matches
from surefix.contradicting import known_queries
from surefix.matches import Matches
from surefix.study.confidence import (
    Reliability,
    frames_to_notice,
    frames_to_relocalise,
    reliability,
    roc_area,
)
from surefix.study.scenarios import RECORDED, scenario

__all__ = [
    "BASELINE",
    "KS",
    "UPTO",
    "Estimate",
    "Recall",
    "Result",
    "Study",
    "compare",
    "run_methods",
]

BASELINE, WEIGHTED = "sequence", "weighted"
# The paper's areas are up to this recall.
UPTO = 0.2
KS = (1, 5, 10)

Recall = Literal["correct", "place_exists", "rejected"]

Estimate = tuple[float, float, float]
"""A value, and the low and the high end of its 95 % interval, by a bootstrap over blocks of
queries."""


Window = tuple[int, int]
"""The first of some consecutive places or queries, and their number."""

Seen = tuple[Distances, tuple[Window, Window] | None]


@dataclass(frozen=True, eq=False)
class Result:
    """The matches of one method, judged by the truth of its study."""

    study: "Study"
    name: str
    matches: Matches

    @cached_property
    def curve(self) -> Evaluation:
        """The precision-recall curve."""
        s = self.study
        return evaluate(self.matches, s.truth, s.tolerance, s.recall)

    @cached_property
    def area(self) -> Estimate:
        """The area under the curve up to recall 0.2."""
        return self.curve.auc(UPTO), *self.curve.auc_interval(UPTO, samples=self.study.samples)

    @cached_property
    def difference(self) -> Estimate:
        """The area minus that of the plain sequence."""
        plain, samples = self.study.baseline.curve, self.study.samples
        interval = self.curve.auc_difference_interval(plain, UPTO, samples=samples)
        return self.curve.auc(UPTO) - plain.auc(UPTO), *interval

    @property
    def outcome(self) -> Literal["wins", "loses", "level"]:
        """Against the plain sequence: level, unless the interval of the difference excludes 0."""
        _, low, high = self.difference
        return "wins" if low > 0 else "loses" if high < 0 else "level"

    @cached_property
    def right(self) -> Flags:
        """Which matches are right, shape (m,)."""
        return self.study.right(self.matches.place)[0]

    @cached_property
    def judged(self) -> Flags:
        """Which matches were judged: ready, and not ignored by the truth."""
        assert self.matches.ready is not None
        return self.study.right(self.matches.place)[1] & self.matches.ready

    @property
    def accepted(self) -> Flags:
        """Which matches the method does not refuse at any score."""
        assert self.matches.accepted is not None
        return self.matches.accepted

    @property
    def right_share(self) -> float:
        """The share of right matches among all queries on the map, those of a warm-up too."""
        on = self.study.true_place >= 0
        return float(self.right[on].mean()) if on.any() else float("nan")

    @cached_property
    def reliability(self) -> Reliability | None:
        """The confidence against the share that is right, over the judged; None without one."""
        said, judged = self.matches.confidence, self.judged
        return None if said is None else reliability(said[judged], self.right[judged])

    @cached_property
    def off_map_area(self) -> float:
        """The area under the ROC curve of the queries off the map, found by the probability that
        the method gives, or else by its score.
        """
        by = self.matches.score if self.matches.off_map is None else self.matches.off_map
        return roc_area(by[self.judged], self.study.off_map[self.judged])

    @cached_property
    def noticed(self) -> Floats | None:
        """``frames_to_notice``, a number for each stretch off the map; None without confidence."""
        said, off = self.matches.confidence, self.matches.off_map
        if said is None:
            return None
        doubt = 1 - said if off is None else np.maximum(off, 1 - said)
        return frames_to_notice(doubt, self.study.off_map)

    @cached_property
    def relocalised(self) -> Floats:
        """``frames_to_relocalise``, a number for each kidnap and each return to the map."""
        s, said = self.study, self.matches.confidence
        return frames_to_relocalise(self.right, s.off_map, s.jumps, confidence=said)


@dataclass(frozen=True, eq=False)
class Study:
    """Distances whose truth is known, and the results of methods on them.

    Parameters
    ----------
    distances : array of float32, shape (n, m)
    context : Context
        The options and the truth of all methods.
    recall : {"correct", "place_exists", "rejected"}
        The convention of every curve.
    samples : int
        Bootstrap samples of an interval.
    names : sequence of str
        The methods, in the order of the table.
    scenario : str
        A key of ``SCENARIOS``: how the drive was made.
    jumps : sequence of int
        The first query after each kidnap.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.baselines import Context
    >>> from surefix.study import Study
    >>> study = Study(1 - np.eye(9, dtype=np.float32), Context(truth=np.arange(9)))
    >>> study["weighted"].curve.max_recall
    1.0
    """

    distances: Distances
    context: Context
    recall: Recall = "correct"
    samples: int = 1000
    names: Sequence[str] = (BASELINE, WEIGHTED)
    scenario: str = RECORDED
    jumps: Sequence[int] = ()
    _made: dict[str, Result] = field(default_factory=dict, init=False, repr=False)

    def __len__(self) -> int:
        """The number of queries."""
        return int(self.distances.shape[1])

    def __getitem__(self, name: str) -> Result:
        """The result of the method of this name, run when it is first asked for."""
        if name not in self._made:
            matches = run_method(name, self.distances, self.context)
            self._made[name] = Result(self, name, matches)
        return self._made[name]

    def take(self, name: str, matches: Matches, area: Estimate, difference: Estimate) -> Result:
        """The result of the method of this name, of its parts."""
        result = self._made.setdefault(name, Result(self, name, matches))
        vars(result).update(area=area, difference=difference)
        return result

    def at(self, **options: Any) -> "Study":
        """The same with other options of the context, as ``sequence_length`` or ``trusted``."""
        return replace(self, context=replace(self.context, **options))

    def driven(self, name: str, seed: int = 0, **options: Any) -> "Study":
        """The same methods on another drive, made of this one by ``surefix.study.scenario``."""
        drive = scenario(name, self.distances, self.true_place, seed, **options)
        truth: Truth = drive.truth
        if by_metres(self.truth):
            places, queries = self._positions
            truth = places[drive.rows], queries[drive.columns]
        elif (cells := np.asarray(self.truth)).ndim == 2:
            truth = cells[np.ix_(drive.rows, drive.columns)]
        where = self.context.positions
        where = None if where is None else np.asarray(where)[drive.rows]
        along = self.context.segments
        others = self.context.techniques
        if others is not None:
            others = [np.asfortranarray(D[np.ix_(drive.rows, drive.columns)]) for D in others]
        context = replace(
            self.context,
            truth=truth,
            positions=where,
            segments=None if along is None else along.keep(drive.rows),
            advance=drive.advance,
            techniques=others,
            gaps=(),
        )
        jumps = drive.jumps.tolist()
        return replace(
            self, distances=drive.distances, context=context, scenario=name, jumps=jumps
        )  # fmt: skip

    @property
    def off_map(self) -> Flags:
        """Which queries have no true place, shape (m,); not those whose place is not known."""
        return (self.true_place < 0) & known_queries(self.truth)

    @property
    def results(self) -> list[Result]:
        """In the order of the table."""
        return [self[name] for name in self.names]

    @property
    def baseline(self) -> Result:
        """The plain sequence."""
        return self[BASELINE]

    @property
    def shown(self) -> Result:
        """The method of the pictures: the weighted sequence if it is among them, else the last."""
        return self[WEIGHTED if WEIGHTED in self.names else self.names[-1]]

    @property
    def truth(self) -> Truth:
        """As ``surefix.evaluate`` takes it."""
        assert self.context.truth is not None
        return self.context.truth

    @property
    def tolerance(self) -> float:
        """The distance from the truth that is still right: places, or metres by position."""
        return self.context.truth_tolerance

    @property
    def by_position(self) -> bool:
        """Whether the truth is positions in metres."""
        return by_metres(self.truth)

    @property
    def correct_means(self) -> str:
        """When a match is correct, in words."""
        places = "place" if self.tolerance == 1 else "places"
        return f"within {self.tolerance:g} {'m' if self.by_position else places}"

    @cached_property
    def run(self) -> Run:
        """The weighted sequence, with the single matches and their trust flags."""
        return match_distances(self.distances, trusted=self.context.trusted, **self.context.options)

    @cached_property
    def trust(self) -> Trust:
        """The confusion table of the trust flags."""
        return evaluate_trust(self.run, self.truth, self.tolerance)

    @cached_property
    def recalls_at(self) -> Sequence[float]:
        """The recall at 1, 5 and 10 of the places of least distance, as far as the map has them."""
        ks = [k for k in KS if k <= len(self.distances)]
        return recall_at(self.distances, self.truth, ks, self.tolerance)

    def seen(self, queries: Window | None = None, places: Window | None = None) -> Seen:
        """Distances for a picture, of the whole or of a part, and the queries and places that they
        cover, None for all.
        """
        return self.distances, None

    def right(self, place: Places) -> tuple[Flags, Flags]:
        """Which of these matches are right, and which the truth judges, each of shape (m,)."""
        return right_matches(place, len(self.distances), self.truth, self.tolerance)

    @cached_property
    def single_right(self) -> Flags:
        """Which single matches, the subject of the trust flags, are right."""
        return self.right(self.run.single_place)[0]

    @cached_property
    def single_judged(self) -> Flags:
        """Which single matches the truth judges."""
        return self.right(self.run.single_place)[1]

    @cached_property
    def true_place(self) -> Places:
        """A true place of each query, (m,): the nearest or first of several, -1 for none, and if it
        is not known.
        """
        return first_true_places(self.truth, self.tolerance)

    def off(self, query: int, place: int) -> str:
        """The distance of a match from the truth, in words."""
        if self.by_position:
            places, queries = self._positions
            return f"{float(np.linalg.norm(places[place] - queries[query])):.0f} m off"
        true = int(self.true_place[query])
        return "not on the map" if true < 0 else f"{abs(place - true)} places off"

    @property
    def _positions(self) -> tuple[Floats, Floats]:
        places, queries = (np.asarray(positions, np.float64) for positions in self.truth)
        return places, queries

    def mistakes(self, count: int) -> list[int]:
        """Queries whose match by the shown method is wrong, the best scores first."""
        shown = self.shown
        wrong = np.flatnonzero(shown.judged & shown.accepted & ~shown.right)
        order = np.argsort(shown.matches.score[wrong], kind="stable")
        return [int(query) for query in wrong[order][:count]]

    def trusted_mistakes(self, count: int) -> list[int]:
        """Queries with a trusted, wrong single match, the nearest first, without ``mistakes``."""
        wrong = self.run.trusted & self.single_judged & ~self.single_right
        for query in self.mistakes(count):
            wrong[query] &= self.run.single_place[query] != self.shown.matches.place[query]
        order = np.argsort(self.run.single_distance, kind="stable")
        return [int(query) for query in order[wrong[order]][:count]]


def compare(
    D: Distances,
    methods: Iterable[str],
    context: Context,
    recall: Recall = "correct",
    done: Callable[[Result], object] = lambda result: None,
) -> Study:
    """Matches by each method and judges the matches by the truth of ``context``.

    The plain sequence is always among the methods, as the others are compared to it.

    Parameters
    ----------
    D : array of float32, shape (n, m)
    methods : iterable of str
        Names of ``surefix.baselines.METHODS``.
    context : Context
        With a truth.
    recall : {"correct", "place_exists", "rejected"}
    done : callable
        Called with each result as soon as it is there.

    Raises
    ------
    SurefixError
        As ``surefix.baselines.run_method`` and ``surefix.evaluate``.
    """
    names = list(dict.fromkeys(methods))
    names = names if BASELINE in names else [BASELINE, *names]
    return run_methods(Study(D, context, recall, names=names), done)


def run_methods(study: Study, done: Callable[[Result], object] = lambda result: None) -> Study:
    """The study with the results of all its methods, each made by a task of its own."""
    study = hold(study)
    for name, found in zip(study.names, mapped(found_by, study, study.names), strict=True):
        done(study.take(name, *found))
    return study


def found_by(study: Study, name: str) -> tuple[Matches, Estimate, Estimate]:
    """A method's matches, and its intervals, which are the slow part."""
    result = study[name]
    return result.matches, result.area, result.difference
