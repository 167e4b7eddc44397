"""A study of more distances than are held: the methods see each column once."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from surefix._core import Matcher, Trust, evaluate_trust, match_distances, recall_at
from surefix._progress import Bar
from surefix._ray import is_spread, mapped
from surefix.baselines import METHODS, Context, run_method
from surefix.baselines.distances import Distances, Flags
from surefix.baselines.methods import SEQSLAM_SPEEDS
from surefix.baselines.predictors import SupervisedPredictor, perfect_predictor
from surefix.baselines.rivals import enhance_contrast
from surefix.baselines.truth import part_of
from surefix.errors import SurefixError
from surefix.matches import Matches
from surefix.study.study import BASELINE, KS, Recall, Result, Study
from surefix.tables.columns import Columns

__all__ = ["StreamedStudy", "compare_columns", "unstreamed"]

# The side of the picture of a matrix, in pixels.
PICTURE = 1500
# Methods whose every column stands alone, and trackers by their motion.
ALONE = ("ratio", "spread")
TRACKERS: dict[str, str | None] = {
    "track_steady": "steady",
    "track_free": "free",
    "track_any": "any",
}
TRACKERS |= {"track_odometry": "any", "track": None}
PLAIN = {"sequence": None, "sequence-10": 10, "sequence-20": 20, "seqslam": None}
BY_FIXES = ("single", "masked", "gradient", "weighted")
GUIDED = ("supervised-masked", "supervised-weighted", "perfect-masked", "perfect-weighted")


def unstreamed(methods: Iterable[str]) -> list[str]:
    """The methods that need all distances at once."""
    known = {*ALONE, *TRACKERS, *PLAIN, *BY_FIXES, *GUIDED}
    return [name for name in methods if name not in known]


class Fixes:
    """The fixes of a matcher, in arrays that grow with them."""

    def __init__(self, places: int, trusted: Callable[[int, Distances], Flags] | None = None,
                 advance: Any = None, **options: Any) -> None:  # fmt: skip
        segments = options.pop("segments", None)
        self._gaps = frozenset(options.pop("gaps", ()))
        self._matcher = Matcher(places if segments is None else segments, **options)
        self._trusted, self._advance = trusted, advance
        self._rows: list[tuple[Any, ...]] = []

    def __getstate__(self) -> dict[str, Any]:
        # Out of a task, in which all columns have passed.
        return {"_rows": self._rows}

    def push(self, start: int, block: Distances) -> None:
        """Takes some columns."""
        flags = None if self._trusted is None else self._trusted(start, block)
        for index in range(block.shape[1]):
            given: dict[str, Any] = {} if flags is None else {"trusted": bool(flags[index])}
            if self._advance is not None:
                given["advance"] = float(self._advance[start + index])
            if start + index in self._gaps:
                # The advance, which counts from the query before, bridges the gap.
                self._matcher.gap(None if self._advance is None else 0.0)
            fix = self._matcher.push(block[:, index], **given)
            track = fix.track
            self._rows.append(
                (
                    fix.place,
                    fix.score,
                    fix.sequence is not None,
                    fix.trusted,
                    fix.single.place,
                    fix.single.distance,
                    fix.gradient.place,
                    fix.gradient.value,
                    0.0 if track is None else track.confidence,
                    0.0 if track is None else track.off_map,
                    fix.blank,
                )
            )

    def column(self, index: int, dtype: Any) -> npt.NDArray[Any]:
        """One number of all fixes."""
        return np.array([row[index] for row in self._rows], dtype)

    @property
    def trusted(self) -> Flags:
        """The trust flags, (m,)."""
        return self.column(3, bool)

    @property
    def blank(self) -> Flags:
        """Whether a query shows nothing, (m,)."""
        return self.column(10, bool)

    @property
    def single_place(self) -> npt.NDArray[np.int64]:
        """The nearest places, (m,)."""
        return self.column(4, np.int64)

    @property
    def single_distance(self) -> npt.NDArray[np.float32]:
        """Their distances, (m,)."""
        return self.column(5, np.float32)

    @property
    def ready(self) -> Flags:
        """Whether there is a sequence, (m,)."""
        return self.column(2, bool)

    def matches(self, name: str) -> Matches:
        """Those of the method of this name."""
        if name.endswith("masked") or name == "single":
            accepted = None if name == "single" else self.trusted
            return Matches(self.single_place, self.single_distance, accepted=accepted)
        if name == "gradient":
            return Matches(self.column(6, np.int64), -self.column(7, np.float32))
        if name in TRACKERS:
            confidence = self.column(8, np.float64)
            how: dict[str, Any] = {"confidence": confidence, "off_map": self.column(9, np.float64)}
            return Matches(self.column(0, np.int64), np.asarray(1 - confidence, np.float32), **how)
        return Matches(self.column(0, np.int64), self.column(1, np.float32), self.ready)


@dataclass(frozen=True, eq=False)
class StreamedStudy(Study):
    """A study whose distances are ``Columns``: its results are made by ``compare_columns``.

    ``thinned`` is the picture of the matrix, a row and a column of as many.
    """

    fixes: Fixes = field(kw_only=True)
    thinned: Distances = field(kw_only=True)
    recalls: tuple[float, ...] = field(kw_only=True)

    @cached_property
    def run(self) -> Any:
        """The single matches with their trust flags, as of the weighted sequence's run."""
        return self.fixes

    @cached_property
    def trust(self) -> Trust:
        """The confusion table of the trust flags."""
        # Of a road of two places: the first is right, or the second, or it is not known.
        flags = self.fixes.trusted
        D = np.stack([np.zeros(len(flags)), np.ones(len(flags))]).astype(np.float32)
        truth = np.where(self.single_judged, np.where(self.single_right, 0.0, 1.0), np.nan)
        return evaluate_trust(match_distances(D, trusted=flags), truth, 0)

    @property
    def recalls_at(self) -> tuple[float, ...]:
        """The recall at 1, 5 and 10 of the places of least distance, as far as the map has them."""
        return self.recalls

    def seen(self, queries: Any = None, places: Any = None) -> tuple[Distances, Any]:
        """As for ``Study``: the thinned matrix, or a part read again."""
        columns: Any = self.distances
        if queries is None or places is None:
            return self.thinned, _covered(columns.shape)
        (first, count), (low, height) = queries, places
        return columns.block(first, first + count)[low : low + height], (queries, places)


def _steps(shape: tuple[int, int]) -> tuple[int, int]:
    n, m = shape
    return -(-n // PICTURE), -(-m // PICTURE)


def _covered(shape: tuple[int, int]) -> Any:
    """The queries and the places that the thinned matrix covers, its last ones in full."""
    (n, m), (down, across) = shape, _steps(shape)
    return (0, -(-m // across) * across), (0, -(-n // down) * down)


def compare_columns(
    columns: Columns,
    methods: Iterable[str],
    context: Context,
    recall: Recall = "correct",
    done: Callable[[Result], object] = lambda result: None,
    progress: Any = None,
) -> StreamedStudy:
    """As ``compare``, of columns: they are read once, and once more for the floor "global".

    Raises
    ------
    SurefixError
        As ``compare``; for a method that needs all distances at once.
    """
    names = [*dict.fromkeys(methods)]
    names = names if BASELINE in names else [BASELINE, *names]
    refused = unstreamed(names)
    if refused:
        raise SurefixError(f"method {refused[0]}: needs all distances at once")
    assert context.truth is not None
    m = columns.shape[1]
    options: dict[str, Any] = {**context.options}
    bar = Bar(progress, 2 * m if options["floor"] == "global" else m, 2 * m)
    passed = 0
    if options["floor"] == "global":
        least = np.inf
        for _, block in columns.blocks():
            lows = block.min(axis=0)
            # A column that says nothing does not lower the floor.
            said = lows < block.max(axis=0)
            least = min(least, float(lows[said].min(initial=np.inf)))
            passed += block.shape[1]
            bar.show(passed)
        options["floor"] = least if np.isfinite(least) else "running"
    asked = _Asked(columns, context, options, progress)
    # A task reads all columns once: those of one method each, and those that share their fixes.
    alone = [(name,) for name in names if name not in BY_FIXES] if is_spread() else []
    together = tuple(name for name in names if (name,) not in alone)
    first, *others = mapped(_passed, asked, [(together, passed), *((each, None) for each in alone)])
    matches = first.matches.copy()
    for other in others:
        matches |= other.matches
    study = StreamedStudy(
        columns,  # type: ignore[arg-type]
        context,
        recall,
        names=names,
        fixes=first.base,
        thinned=first.picture,
        recalls=first.recalls,
    )
    for name in names:
        study._made[name] = Result(study, name, matches[name])
    for result in study.results:
        _ = result.area, result.difference
        done(result)
    return study


@dataclass(frozen=True)
class _Asked:
    """What methods are run on."""

    columns: Columns
    context: Context
    options: dict[str, Any]
    progress: Any

    def __reduce__(self) -> tuple[Any, ...]:
        # A bar stays where it is seen.
        return _Asked, (self.columns, self.context, self.options, None)


class _Passed(NamedTuple):
    """What was seen while all columns passed."""

    matches: dict[str, Matches]
    base: Fixes
    picture: Distances
    recalls: tuple[float, ...]


def _passed(asked: _Asked, job: tuple[Sequence[str], int | None]) -> _Passed:
    """The matches of some methods; ``passed`` columns were read before, None if others tell of the
    drive.
    """
    columns, context, options = asked.columns, asked.context, asked.options
    (names, passed), (n, m) = job, columns.shape
    tells = passed is not None
    assert context.truth is not None
    bar = Bar(asked.progress, 2 * m if passed else m, 2 * m)
    base = Fixes(n, **options)
    streams: dict[str, Fixes] = {}
    parts: dict[str, list[Matches]] = {name: [] for name in names if name in ALONE}
    for name in names:
        if name not in parts:
            streams[name] = base if name in BY_FIXES else _stream(name, n, context, options)
    down, across = _steps((n, m))
    picture = np.empty((-(-n // down), -(-m // across)), np.float32)
    ks = [k for k in KS if k <= n]
    found, known = np.zeros(len(ks)), 0
    all_ = [*([base] if tells else []), *streams.values()]
    distinct = list({id(each): each for each in all_}.values())
    contrast = streams.get("seqslam")
    for start, block in columns.blocks():
        stop = start + block.shape[1]
        for each in distinct:
            own = enhance_contrast(block, context.contrast) if each is contrast else block
            each.push(start, own)
        for name, each_part in parts.items():
            each_part.append(run_method(name, block, context))
        if tells:
            shown = np.arange(-(-start // across) * across, stop, across)
            picture[:, shown // across] = block[::down, shown - start]
            truth = part_of(context.truth, start, stop)
            share = recall_at(block, truth, ks, context.truth_tolerance)
            here = Study(block, Context(truth=truth, truth_tolerance=context.truth_tolerance))
            count = int((here.true_place >= 0).sum())
            found, known = found + np.array(share) * count, known + count
        bar.show((passed or 0) + stop)
    bar.end((passed or 0) + m)
    recalls = tuple((np.round(found) / max(known, 1)).tolist())
    matches = {
        name: _joined(parts[name]) if name in parts else streams[name].matches(name)
        for name in names
    }
    return _Passed(matches, base, picture, recalls)


def _stream(name: str, places: int, context: Context, options: dict[str, Any]) -> Fixes:
    """What the method of this name pushes its columns into."""
    if name in TRACKERS:
        advance = context.advance if name in ("track_odometry", "track") else None
        motion = TRACKERS[name] or context.motion
        how: dict[str, Any] = {"motion": motion, "tolerance": context.tolerance}
        return Fixes(places, advance=advance, sequence_length=1, **how, **context.roads)
    if name in PLAIN:
        length = PLAIN[name]
        changed: dict[str, Any] = {"weight": 0.0, "floor": "running"}
        changed |= {} if length is None else {"sequence_length": min(length, places)}
        if name == "seqslam":
            changed["gaps"] = ()
            changed |= {} if context.speeds else {"speeds": list(SEQSLAM_SPEEDS)}
        return Fixes(places, **options | changed)
    if METHODS[name].needs == "truth":
        assert context.truth is not None
        known = context.truth

        def right(start: int, block: Distances) -> Flags:
            truth = part_of(known, start, start + block.shape[1])
            return perfect_predictor(block, truth, context.truth_tolerance)

        return Fixes(places, right, **options)
    assert context.calibration is not None
    predictor = SupervisedPredictor().fit(*context.calibration, context.calibration_tolerance)
    return Fixes(places, lambda _, block: predictor.predict(block), **options)


def _joined(parts: list[Matches]) -> Matches:
    fields = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("place", "score", "ready", "accepted")
    }
    return Matches(**fields)
