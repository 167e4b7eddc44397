"""The search of ``tune``: settings compared on the first half of a drive whose truth is known."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from surefix._core import (
    Alignment,
    Evaluation,
    Map,
    Run,
    Settings,
    align,
    described,
    evaluate,
    match,
    match_distances,
)
from surefix._progress import Bar, terminal_bar
from surefix._ray import mapped
from surefix.contradicting import Contradiction, contradictions, known_queries, true_places
from surefix.errors import mismatch
from surefix.matches import Matches
from surefix.motion import Motion

Flags: TypeAlias = npt.NDArray[np.bool_]
Setting: TypeAlias = tuple[str, dict[str, Any]]

LENGTHS = (2, 5, 10, 20)
WEIGHTS = (0.0, 0.9, 1.0)
# Of a sequence whose warm-up leaves out more than this share of the queries, too little is judged.
WARM_UP = 0.2
# An alignment that is less sure of a query does not count as its truth.
SURE = 0.5
KINDS: tuple[Literal["any", "steady", "free"], ...] = ("any", "steady", "free")
# The queries over which the pace is taken; and how near to 1 it counts as 1.
ALONG, NEAR = 10, 0.15
# The probability that all choices together are right, and the samples of the bootstrap for it.
LEVEL, SAMPLES = 0.95, 5000
# Of fewer blocks a bootstrap tells nothing: all of its drives are nearly the same.
BLOCKS = 8


@dataclass(frozen=True, eq=False)
class Drive:
    """The maps and the queries' descriptors, or the distances, and the odometry."""

    techniques: list[Any]
    rows: Any
    queries: int
    advance: npt.ArrayLike | None
    gaps: list[int] | None

    @classmethod
    def of(
        cls, map: Any, queries: Any, descriptor: Any, progress: Any, advance: Any, gaps: Any
    ) -> "Drive":
        """Images are described once, for all trials."""
        techniques = list(map) if isinstance(map, (list, tuple)) else [map]
        if not techniques:
            raise mismatch("map", "a map or distances, or a list of them", "an empty list")
        if queries is not None:
            rows: list[Any] = [*described(techniques, queries, descriptor, progress)]
            given = rows if len(techniques) > 1 else rows[0]
            return cls(techniques, given, len(rows[0]), advance, gaps)
        if any(isinstance(each, Map) for each in techniques):
            raise mismatch("queries", "images or descriptors", "none")
        shape = np.shape(techniques[0])
        return cls(techniques, None, shape[-1] if len(shape) == 2 else 0, advance, gaps)

    def aligned(self, motion: Motion | str, tolerance: float, progress: Any) -> Alignment:
        """By all techniques."""
        how: dict[str, Any] = {"motion": motion, "tolerance": tolerance, "progress": progress}
        how |= {"advance": self.advance, "gaps": self.gaps}
        given = (self.techniques,) if self.rows is None else (self.techniques, self.rows)
        return align(*given, **how)

    def matched(self, options: dict[str, Any]) -> Run:
        """The fixes of a localizer with these options."""
        how: dict[str, Any] = {"gaps": self.gaps, "config": Settings(**options)}
        # Without a track there is nothing that odometry would move.
        if options["motion"] is not None:
            how["advance"] = self.advance
        if self.rows is None:
            return match_distances(self.techniques, **how)
        return match(self.techniques, self.rows, progress=False, **how)


@dataclass(frozen=True, eq=False)
class Known:
    """Where each query was: by a truth, or by an alignment."""

    kind: str
    truth: Any
    tolerance: float
    alignment: Alignment | None
    places: npt.NDArray[np.int64]
    kept: Flags
    contradictions: list[Contradiction]

    @classmethod
    def of(
        cls, drive: Drive, truth: Any, tolerance: float, motion: Motion | str, progress: Any
    ) -> "Known":
        """The truth or the alignment, or one that is made."""
        given, in_metres = isinstance(truth, Alignment), isinstance(truth, tuple)
        within = 1 if in_metres else tolerance
        aligned = truth if given else drive.aligned(motion, within, progress)
        if len(aligned) != drive.queries:
            raise mismatch("truth", f"an alignment of {drive.queries} queries", len(aligned))
        if truth is None or given:
            kind = "an alignment" if given else f"an alignment, motion {_named(motion)}"
            kept = aligned.confidence >= SURE
            places = np.where(kept, aligned.place, -1)
            return cls(kind, aligned.place, tolerance, aligned, places, kept, [])
        kind = "positions" if in_metres else "places" if np.ndim(truth) == 1 else "a matrix"
        places = true_places(aligned, truth, tolerance)
        found = contradictions(aligned, truth, tolerance)
        return cls(kind, truth, tolerance, None, places, known_queries(truth), found)

    @property
    def first_half(self) -> Flags:
        """The queries that settings are chosen on."""
        return np.arange(len(self.kept)) < len(self.kept) // 2

    def pace(self, gaps: list[int] | None) -> float:
        """The median of the places a query in the first half; 1 if it is unknown or about that."""
        there = np.where(self.first_half, self.places, -1)
        starts = np.zeros(len(there), int)
        starts[np.asarray(gaps or [], int)] = 1
        stretch = np.cumsum(starts)
        both = (there[:-ALONG] >= 0) & (there[ALONG:] >= 0)
        both &= stretch[:-ALONG] == stretch[ALONG:]
        if not both.any():
            return 1.0
        pace = float(np.median(np.abs(there[ALONG:] - there[:-ALONG])[both])) / ALONG
        return 1.0 if abs(pace - 1) < NEAR or pace < 1 / ALONG else round(pace, 2)


class Search:
    """One option after the other, from the default with the given motion.

    Attributes
    ----------
    settings, curves
        Those that were tried; the first is the default.
    best : int
        Which of them is chosen.
    """

    def __init__(self, drive: Drive, known: Known, motion: Motion | str, progress: Any) -> None:
        self.drive, self.known = drive, known
        self.settings: list[Setting] = []
        self.curves: list[Evaluation] = []
        self.best = 0
        self._first: list[Setting] = [(_named(motion), {"motion": motion})]
        # An alignment is made with a motion, and would choose its own.
        if known.alignment is None:
            self._first += _motions(drive, known, motion)
        weights = _weights(len(drive.techniques))
        # The most that there can be: the second step depends on the first.
        more = len(WEIGHTS) if known.alignment is None else 0
        self.count = len(self._first) + more + len(weights)
        report = terminal_bar("Tuning") if progress is None else progress or None
        self._bar, self._done = Bar(report, self.count, None), 0

        runs = self._runs(self._first)
        half = known.first_half & known.kept
        self._judged = half
        fair = []
        # All are judged on the same queries, whatever their warm-up.
        for setting, run in runs:
            assert run.ready is not None
            ready = self._judged & run.ready
            if ready.sum() >= (1 - WARM_UP) * half.sum():
                fair.append((setting, run))
                self._judged = ready
        if not self._judged.any():
            known_by = "known" if known.alignment is None else "one that the alignment is sure of"
            raise mismatch("queries", f"some in the first half whose place is {known_by}", "none")
        self._step(fair)
        self._step(self._runs(_details(self.settings[self.best])))
        name, options = self.settings[self.best]
        by_weight = [
            (f"{name}, weights {','.join(map('{:g}'.format, each))}", {"technique_weights": each})
            for each in weights
        ]
        self._step(self._runs([(name, options | more) for name, more in by_weight]))
        self._bar.show(self.count)

    @property
    def queries(self) -> int:
        """How many all settings were judged on."""
        return int(self._judged.sum())

    def _runs(self, settings: list[Setting]) -> Iterator[tuple[Setting, Matches]]:
        runs = mapped(_matches, self.drive, [options for _, options in settings])
        for setting in settings:
            self._bar.show(self._done)
            self._done += 1
            yield setting, next(runs)

    def _step(self, runs: Any) -> None:
        """Goes on from the best of those that beat the present one."""
        before = self.best
        for setting, run in runs:
            found = Matches(run.place, run.score, run.ready & self._judged)
            known = self.known
            self.settings.append(setting)
            self.curves.append(evaluate(found, known.truth, known.tolerance, recall="place_exists"))
            now = len(self.curves) - 1
            if now and self._beats(now, before) and self._area(now) > self._area(self.best):
                self.best = now

    def _area(self, trial: int) -> float:
        return self.curves[trial].auc(1.0)

    def _beats(self, trial: int, other: int) -> bool:
        """Whether the area is larger beyond an interval that holds for all trials together."""
        one, two = self.curves[trial], self.curves[other]
        block = max(one.block or 1, two.block or 1)
        if self._area(trial) <= self._area(other) or one.judged < BLOCKS * block:
            return False
        level = 1 - (1 - LEVEL) / self.count
        low, _ = one.auc_difference_interval(two, 1.0, level=level, samples=SAMPLES)
        return low > 0


def _matches(drive: Drive, options: dict[str, Any]) -> Matches:
    run = drive.matched(options)
    return Matches(run.place, run.score, run.ready)


def _named(motion: Motion | str) -> str:
    return motion if isinstance(motion, str) else "as given"


def _motions(drive: Drive, known: Known, but: Motion | str) -> list[Setting]:
    """Other motions, also at the pace of the drive; and none."""
    kinds = [kind for kind in KINDS if kind != but]
    found: list[Setting] = [(kind, {"motion": kind}) for kind in kinds]
    # Odometry tells the pace.
    pace = 1.0 if drive.advance is not None else known.pace(drive.gaps)
    if pace != 1:
        for kind in KINDS:
            found.append((f"{kind}, pace {pace:g}", {"motion": Motion(kind, pace=pace)}))
    for length in LENGTHS:
        if length <= len(drive.techniques[0]):
            options = {"motion": None, "sequence_length": length}
            found.append((f"no track, L={length}", options))
    return found


def _details(now: Setting) -> list[Setting]:
    """Of a sequence, the weight of trusted matches. How much evidence counts in a track is not
    tried: what was chosen so lost more on the other half of the drives than it gained.
    """
    name, options = now
    if options["motion"] is not None:
        return []
    return [(f"{name}, w={weight:g}", options | {"weight": weight}) for weight in WEIGHTS]


def _weights(techniques: int) -> list[tuple[float, ...]]:
    """Each technique left out, and each with twice the weight; of one, nothing."""
    if techniques == 1:
        return []
    return [
        tuple(weight if each == other else 1.0 for each in range(techniques))
        for weight in (0.0, 2.0)
        for other in range(techniques)
    ]
