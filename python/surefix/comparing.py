"""Runs, methods or descriptors beside each other on the same queries, with intervals."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from surefix._core import Run, Segments
from surefix._ray import mapped
from surefix.auditing import Estimate
from surefix.baselines.truth import Truth
from surefix.comparison import Compared, Comparison, Estimates
from surefix.errors import mismatch
from surefix.judged import Judged, Recall, redrawn
from surefix.matches import Matches
from surefix.tables.reports import chosen, labels, read_report

__all__ = ["compare", "compare_judged", "estimates"]

UPTO, SAMPLES = 0.2, 1000
ENDS = (0.025, 0.975)


def compare(
    runs: Mapping[str, Run | Matches] | Sequence[str | Path],
    truth: Truth | None = None,
    tolerance: float = 1,
    *,
    against: str | None = None,
    methods: Sequence[str] = (),
    paired: bool = True,
    recall: Recall | None = None,
    upto: float = UPTO,
    samples: int = SAMPLES,
    segments: Segments | None = None,
) -> Comparison:
    """Compares runs on one drive, with 95 % intervals of each figure and of each difference.

    Intervals are of a bootstrap over blocks of consecutive queries, as long as errors last. The
    same queries are drawn for a run and for the baseline, so that a stretch that is hard for both
    does not widen the interval.

    Parameters
    ----------
    runs : mapping of a name to a Run or Matches; or a sequence of paths
        Runs of the same queries, in one order; or the folders that ``surefix eval`` wrote.
    truth, tolerance
        As for ``evaluate``; none with folders, which hold their own.
    against : str, optional
        The name of the baseline; the first run by default.
    methods : sequence of str
        Of the folders: the methods to compare. By default all of one folder; of several, the
        weighted sequence, or else the first method that all have.
    paired : bool
        False for runs of other queries, such as another drive's: the interval of a difference is
        then made of the two intervals (Zou and Donner 2008).
    recall : {"correct", "place_exists", "rejected"}, optional
        As for ``evaluate``; by default "correct", and of folders their own.
    upto : float
        The recall up to which areas are taken.
    samples : int
        Bootstrap samples.
    segments : Segments, optional
        As for ``evaluate``.

    Returns
    -------
    Comparison

    Raises
    ------
    SurefixValueError
        For fewer than two runs, other queries, two conventions of recall, a truth that does not
        fit, or a folder that is no report.
    SurefixFileError
        If a file of a folder cannot be read.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> distances = 1 - np.eye(40, dtype=np.float32)
    >>> runs = {f"L={k}": surefix.match_distances(distances, sequence_length=k) for k in (1, 9)}
    >>> comparison = surefix.compare(runs, np.arange(40))
    >>> comparison["L=9"].verdict("trusted_precision")
    'the same'
    """
    if isinstance(runs, Mapping):
        if truth is None:
            raise mismatch("truth", "one, as for surefix.evaluate", None)
        how = recall or "correct"
        judged = [
            Judged.by_truth(name, run, truth, tolerance, how, segments=segments)
            for name, run in runs.items()
        ]
    else:
        if truth is not None:
            raise mismatch("truth", "none with folders, which hold their own", "one")
        if isinstance(runs, str | Path):
            raise mismatch("runs", "a mapping of runs, or a list of folders", repr(runs))
        read = [read_report(Path(path)) for path in runs]
        judged = chosen(dict(zip(labels(runs), read, strict=True)), methods)
    return compare_judged(judged, against, paired, recall, upto, samples)


def compare_judged(
    judged: Sequence[Judged],
    against: str | None = None,
    paired: bool = True,
    recall: Recall | None = None,
    upto: float = UPTO,
    samples: int = SAMPLES,
) -> Comparison:
    """The comparison of matches that are judged already; as for ``compare``."""
    if len(judged) < 2:
        raise mismatch("runs", "two or more to compare", len(judged))
    names = [each.name for each in judged]
    for name in names:
        if names.count(name) > 1:
            raise mismatch("runs", "a name each", f"{name} twice")
    if against is not None and against not in names:
        raise mismatch("against", f"one of {', '.join(names)}", repr(against))
    if recall is not None:
        judged = [replace(each, recall=recall) for each in judged]
    base = judged[0 if against is None else names.index(against)]
    for each in judged:
        if each.recall != base.recall:
            got = f"{each.recall!r}, and {base.recall!r} of {base.name}: give recall"
            raise mismatch(f"{each.name}, recall", "one convention", got)
        if paired:
            _check_same(each, base)
    how = upto, samples
    own = dict(zip(names, mapped(_own, how, judged), strict=True))
    others = [(each, own[each.name]) for each in judged if each is not base]
    apart = mapped(_apart, (base, own[base.name], paired, how), others)
    runs = [
        Compared(each.name, own[each.name], {} if each is base else next(apart)) for each in judged
    ]
    counts = tuple(len(each) for each in judged)
    return Comparison(tuple(runs), base.name, paired, counts, upto, base.recall, tuple(judged))


def _check_same(one: Judged, base: Judged) -> None:
    """Refuses other queries than the baseline's."""
    same = len(one) == len(base)
    if one.queries is not None and base.queries is not None:
        same = same and [*one.queries] == [*base.queries]
        if same and None not in (one.drive, base.drive) and one.drive != base.drive:
            got = "other files of the same names; compare them with --unpaired (paired=False)"
            raise mismatch(one.name, f"the drive of {base.name}", got)
    elif same:
        # Without names the truth must tell; of another map, other places are the same queries.
        same = bool((one.true_place == base.true_place).all())
    if not same:
        expected = f"the queries of {base.name}, {_said(base)}"
        more = "compare drives of different queries with --unpaired (paired=False)"
        raise mismatch(one.name, expected, f"{_said(one)}; {more}")


def _said(one: Judged) -> str:
    if not one.queries:
        known = one.true_place[one.true_place >= 0]
        at = f" of the places {known.min()} to {known.max()}" if len(known) else ""
        return f"{len(one)} without names{at}"
    return f"{len(one)} ({one.queries[0]} to {one.queries[-1]})"


def _own(how: tuple[float, int], one: Judged) -> Estimates:
    return estimates(one, *how)


def _apart(
    of: tuple[Judged, Estimates, bool, tuple[float, int]], job: tuple[Judged, Estimates]
) -> Estimates:
    """The differences of a run to the baseline."""
    (base, of_base, paired, how), (one, own) = of, job
    return _paired(one, base, own, of_base, *how) if paired else _unpaired(own, of_base)


def estimates(one: Judged, upto: float, samples: int) -> Estimates:
    """Each figure with its own interval."""
    found = {"area": Estimate(one.curve.auc(upto), *one.curve.auc_interval(upto, samples=samples))}
    once = np.ones((1, len(one)), np.int32)
    for block, figures in one.parts:
        drawn = _joined([figures(times) for times in redrawn(len(one), block, samples)])
        for name, value in figures(once).items():
            found[name] = _interval(float(value[0]), drawn[name])
    return found


def _paired(
    one: Judged, base: Judged, own: Estimates, of_base: Estimates, upto: float, samples: int
) -> Estimates:
    """The differences, with the same queries drawn for both."""
    ends = one.curve.auc_difference_interval(base.curve, upto, samples=samples)
    found = {"area": Estimate(own["area"] - of_base["area"], *ends)}
    for (mine, figures), (other, of_other) in zip(one.parts, base.parts, strict=False):
        # Whichever errs for longer.
        length = max(mine, other)
        drawn, against = (
            _joined([each(times) for times in redrawn(len(one), length, samples)])
            for each in (figures, of_other)
        )
        for name in drawn.keys() & against.keys():
            found[name] = _interval(own[name] - of_base[name], drawn[name] - against[name])
    return found


def _joined(
    parts: Sequence[Mapping[str, npt.NDArray[np.float64]]],
) -> dict[str, npt.NDArray[np.float64]]:
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _unpaired(own: Estimates, of_base: Estimates) -> Estimates:
    """The differences of independent figures, by their intervals (Zou and Donner 2008)."""
    found = {}
    for name in own.keys() & of_base.keys():
        a, b = own[name], of_base[name]
        low = (a - b) - math.hypot(max(a - a.low, 0), max(b.high - b, 0))
        high = (a - b) + math.hypot(max(a.high - a, 0), max(b - b.low, 0))
        found[name] = Estimate(a - b, low, high)
    return found


def _interval(value: float, drawn: npt.NDArray[np.float64]) -> Estimate:
    """The middle 95 % of the samples that have a value."""
    known = drawn[np.isfinite(drawn)]
    if math.isnan(value) or not len(known):
        return Estimate(math.nan, math.nan, math.nan)
    low, high = np.quantile(known, ENDS)
    return Estimate(value, float(low), float(high))
