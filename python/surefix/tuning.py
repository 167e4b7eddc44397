"""Settings and a threshold for a route, chosen on a calibration drive."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._core import Evaluation, Map, Settings, calibrate
from surefix._ray import hold, mapped
from surefix.auditing import Estimate
from surefix.contradicting import Contradiction
from surefix.motion import Motion
from surefix.settings_search import Drive, Known, Search

__all__ = ["Trial", "Tuned", "tune"]


@dataclass(frozen=True)
class Trial:
    """A setting that ``tune`` has tried.

    Attributes
    ----------
    name : str
        The setting in words: "any", "steady, pace 2", "no track, L=10".
    options : dict
        The options of ``Settings``.
    area : Estimate
        Under the whole precision-recall curve, with the recall of all queries on the map
        (``"place_exists"``).
    difference : Estimate
        Its area less that of the first trial.
    chosen : bool
        Whether it is the one of the settings.
    """

    name: str
    options: dict[str, Any]
    area: Estimate
    difference: Estimate
    chosen: bool = False


@dataclass(frozen=True, eq=False)
class Tuned:
    """The settings of a route, by ``tune``.

    Attributes
    ----------
    settings : Settings
        The options and the threshold, with the maps that they are for, and in ``measured`` how they
        were found. ``settings.save("route.toml")`` is for ``surefix run --config``.
    trials : list of Trial
        All settings that were tried; the first is that of the given motion, with defaults.
    contradictions : list of Contradiction
        Where a given truth disagrees with an alignment that is sure of itself: the truth may be
        wrong.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> tuned = surefix.tune(1 - np.eye(300, dtype=np.float32), wrong=0.1)
    >>> tuned.chosen.name, tuned.settings.threshold.score is not None
    ('any', True)
    """

    settings: Settings
    trials: list[Trial]
    contradictions: list[Contradiction] = field(default_factory=list)

    @property
    def chosen(self) -> Trial:
        """The trial of the settings."""
        return next(trial for trial in self.trials if trial.chosen)

    def __repr__(self) -> str:
        """The choice and the promise in a line."""
        chosen = self.chosen
        of = f"{chosen.name}, area {chosen.area}, of {len(self.trials)} settings"
        promise = None if self.settings.threshold is None else self.settings.threshold.promise
        return f"Tuned({of}; {promise})"


def tune(
    map: Any,
    queries: Any = None,
    truth: Any = None,
    *,
    advance: npt.ArrayLike | None = None,
    gaps: list[int] | None = None,
    tolerance: float = 1,
    wrong: float = 0.05,
    sure: float = 0.95,
    motion: Motion | str = "any",
    descriptor: Any = None,
    progress: Any = None,
) -> Tuned:
    """Chooses the settings for a route on a drive along it, and a threshold with a promise.

    Settings are compared by the area under the precision-recall curve, one option after the other,
    from the default of ``surefix run``: the motion and its pace, or no track and a sequence of some
    length and weight; then the weights of several techniques. A setting is changed only if its area
    is larger beyond an interval, of a bootstrap over blocks, that holds for all trials together.

    If one is changed, they were chosen on the first half of the drive, and the threshold
    (``calibrate``) is of the second; else it is of the whole drive.

    An alignment is the tracker's own, with the motion that it was given. So it chooses no motion,
    only weights and the threshold; the motion takes a truth, or is given.

    Parameters
    ----------
    map : Map; or array of float32, shape (n, m); or a list of maps or of arrays
        The route; or distances, where ``distances[i, j]`` is between place ``i`` and query ``j``.
        Several techniques are fused, as by ``Localizer``.
    queries : array, images or a list, optional
        As for ``match``; none with distances.
    truth : array or pair of arrays, or Alignment, optional
        Where each query really was: as for ``evaluate``, or an alignment of the same drive. By
        default the drive is aligned (``align``).
    advance, gaps, descriptor, progress
        As for ``align``.
    tolerance : float
        A match is right within this many places; metres if the truth is positions.
    wrong, sure : float
        The promise: at most the share ``wrong`` of the accepted fixes is wrong, with probability
        ``sure``.
    motion : {"any", "steady", "free"} or Motion
        How the robot moved, if nothing better is found: of the alignment, and of the first trial.

    Returns
    -------
    Tuned

    Raises
    ------
    SurefixValueError
        As for ``match``, ``align`` and ``calibrate``; if the first half of the drive has no query
        of a known place.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> rows = np.random.default_rng(0).normal(size=(400, 16)).astype(np.float32)
    >>> seen = rows + np.random.default_rng(1).normal(size=rows.shape).astype(np.float32)
    >>> route = surefix.Map.from_descriptors(rows)
    >>> tuned = surefix.tune(route, seen, np.arange(400), wrong=0.1)
    >>> tuned.chosen.name, tuned.settings.threshold.accepted > 200
    ('any', True)
    """
    drive = hold(Drive.of(map, queries, descriptor, progress, advance, gaps))
    known = Known.of(drive, truth, tolerance, motion, progress)
    search = Search(drive, known, motion, progress)
    name, options = search.settings[search.best]
    trials = _trials(search)
    # What settings were chosen on says too much good of them.
    changed = search.best > 0
    part = ~known.first_half if changed else np.ones(drive.queries, bool)
    truth = known.truth if known.alignment is None else known.alignment
    promise: dict[str, Any] = {"wrong": wrong, "sure": sure, "tolerance": tolerance}
    promise |= {"metres": _metres(drive, known, part), "only": part}
    threshold = calibrate(drive.matched(options), truth, **promise)
    measured = {
        "route": f"{len(drive.techniques[0])} places",
        "queries": f"{drive.queries}",
        "truth": known.kind,
        "right_within": _within(known, tolerance),
        "chosen": f"{name}, of {len(trials)} tried",
        "judged": f"{search.queries} queries of the first half",
        "area": str(trials[search.best].area),
        "area_of_default": str(trials[0].area),
        "calibrated_on": "the second half" if changed else "the whole drive",
        "promise": threshold.promise,
    }
    maps = None if queries is None else drive.techniques
    settings = Settings(threshold=threshold, maps=maps, measured=measured, **options)
    return Tuned(settings, trials, known.contradictions)


def _trials(search: Search) -> list[Trial]:
    found = zip(search.settings, mapped(_figures, search.curves[0], search.curves), strict=True)
    return [
        Trial(name, options, *figures, index == search.best)
        for index, ((name, options), figures) in enumerate(found)
    ]


def _figures(default: Evaluation, curve: Evaluation) -> tuple[Estimate, Estimate]:
    """The area, and how much more it is than that of the default."""
    area = Estimate(curve.auc(1.0), *curve.auc_interval(1.0))
    apart = curve.auc_difference_interval(default, 1.0)
    return area, Estimate(curve.auc(1.0) - default.auc(1.0), *apart)


def _within(known: Known, tolerance: float) -> str:
    """What counts as right, which the promise and the probabilities are about."""
    unit = "metre" if isinstance(known.truth, tuple) else "place"
    return f"{tolerance:g} {unit}{'' if tolerance == 1 else 's'}"


def _metres(drive: Drive, known: Known, part: npt.NDArray[np.bool_]) -> float | None:
    """The length of the drive; None if the map has no positions."""
    if isinstance(known.truth, tuple):
        way = np.asarray(known.truth[1], np.float64)[part & known.kept]
    else:
        first = drive.techniques[0]
        where = first.positions if isinstance(first, Map) else None
        if where is None:
            return None
        way = where[known.places[part & (known.places >= 0)]]
    return float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
