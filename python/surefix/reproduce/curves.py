"""Precision-recall curves: sequences, single frames, and against the perfect prediction."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from surefix import plot
from surefix._core import Evaluation, evaluate
from surefix.baselines import (
    SupervisedPredictor,
    masked_single_frame,
    maximum_gradient,
    single_frame,
)
from surefix.baselines.truth import Truth, by_metres
from surefix.errors import SurefixError
from surefix.matches import Matches
from surefix.report.page import Table
from surefix.reproduce.case import Case, Settings
from surefix.reproduce.exhibit import Cell, Exhibit, pictured
from surefix.study import UPTO

__all__ = ["perfect_prediction", "sequences", "single_frames"]

PERFECT_LENGTH = 3

Curves = Mapping[str, Evaluation]


def sequences(cases: Sequence[Case], settings: Settings) -> Exhibit:
    """The two curves behind each row of Table I."""
    curves = {}
    for case in cases:
        plain, weighted = case.study(settings).results
        curves[case] = {"weighted": weighted.curve, "unweighted": plain.curve}
    return _exhibit(
        "precision_recall",
        "Precision and recall of the sequences",
        (
            "The curves behind Table I: every score is a threshold once. The shaded part is that "
            "of the areas. Beyond it the two may cross: an area up to recall 0.2 says nothing of "
            "that.",
        ),
        curves,
        settings,
        (),
    )


def single_frames(cases: Sequence[Case], settings: Settings) -> Exhibit:
    """Single frames: by the distance, by the gradient, and masked by the two predictions."""
    curves: dict[Case, Curves] = {}
    points: list[str] = []
    for case in cases:
        begin = case.D.shape[1] // 3
        methods = {
            "distance, masked by the prediction": masked_single_frame(case.D),
            "distance": single_frame(case.D),
            "gradient alone": maximum_gradient(case.D),
        }
        try:
            methods["distance, masked by the supervised predictor"] = _supervised(case, begin)
        except SurefixError as error:
            points.append(f"{case.name}: no supervised curve, {error}.")
        curves[case] = {
            name: _evaluate_from(case, begin, matches, settings)
            for name, matches in methods.items()
        }
    return _exhibit(
        "single_frame",
        "Single frames",
        (
            "No sequence: one query at a time. By the distance alone; by the greatest gradient "
            "alone; and by the distance with the matches refused that a prediction does not trust. "
            "The unsupervised prediction needs nothing. The supervised one (Carson, Ford and "
            "Milford, RA-L 2022) learns from the first third of each case's queries with their "
            "truth, so all curves are of the other two thirds.",
            "A mask cannot add correct matches: its curve ends when it refuses the rest.",
        ),
        curves,
        settings,
        points,
    )


def perfect_prediction(cases: Sequence[Case], settings: Settings) -> Exhibit:
    """Sequences of three, weighted by the prediction and by a perfect one."""
    curves: dict[Case, Curves] = {}
    for case in cases:
        study = case.study(settings).at(sequence_length=PERFECT_LENGTH)
        plain, weighted = study.results
        curves[case] = {
            "weighted by the prediction": weighted.curve,
            "unweighted": plain.curve,
            "weighted by a perfect prediction": study["perfect-weighted"].curve,
        }
    return _exhibit(
        "perfect_prediction",
        f"Weighted sequences against the perfect prediction, L = {PERFECT_LENGTH}",
        (
            "The perfect prediction is told the truth: it trusts exactly the single matches that "
            "are right. It is the most that a better predictor could add. The distance between its "
            "curve and the prediction's remains to be gained.",
        ),
        curves,
        settings,
        (),
    )


def _sliced(truth: Truth, queries: slice) -> Truth:
    """The truth of some of the queries."""
    if by_metres(truth):
        return truth[0], np.asarray(truth[1])[queries]
    return np.asarray(truth)[..., queries]


def _supervised(case: Case, begin: int) -> Matches:
    predictor = SupervisedPredictor()
    predictor.fit(case.D[:, :begin], _sliced(case.truth, slice(0, begin)), case.tolerance)
    return masked_single_frame(case.D, trusted=predictor.predict(case.D))


def _evaluate_from(case: Case, begin: int, matches: Matches, settings: Settings) -> Evaluation:
    """The curve of the queries from ``begin`` on."""
    part = Matches(
        matches.place[begin:],
        matches.score[begin:],
        None if matches.ready is None else matches.ready[begin:],
        None if matches.accepted is None else matches.accepted[begin:],
    )
    truth = _sliced(case.truth, slice(begin, None))
    return evaluate(part, truth, case.tolerance, settings.recall)


def _ranked(curves: Curves) -> str:
    """The areas, the best first."""
    ranked = sorted(curves.items(), key=lambda item: -item[1].auc(UPTO))
    return ", ".join(f"{name} {_area(curve)}" for name, curve in ranked)


def _area(curve: Evaluation) -> str:
    end = f" (it ends at recall {curve.max_recall:.2f})" if curve.max_recall < UPTO else ""
    return f"{curve.auc(UPTO):.3f}{end}"


def _exhibit(
    name: str,
    title: str,
    paragraphs: Sequence[str],
    curves: Mapping[Case, Curves],
    settings: Settings,
    points: Sequence[str],
) -> Exhibit:
    rows: list[Sequence[Cell]] = []
    methods: dict[str, None] = {}
    for case, named in curves.items():
        methods |= dict.fromkeys(named)
        for method, curve in named.items():
            columns = (curve.recall, curve.precision, curve.thresholds, curve.false_positives)
            numbers = zip(*(column.tolist() for column in columns), strict=True)
            rows += [(case.dataset, case.technique, method, *point) for point in numbers]
    options: Any = {"upto": UPTO, "recall": settings.recall}
    pictures = pictured(
        name,
        list(curves),
        lambda ax, case, theme: plot.precision_recall(curves[case], ax=ax, theme=theme, **options),
        lambda case: f"area up to recall {UPTO:g}: {_ranked(curves[case])}",
        x=f"recall (\u201c{settings.recall}\u201d)",
        y="precision",
    )
    lines = [
        (case.name, *(_area(named[method]) if method in named else "\u2013" for method in methods))
        for case, named in curves.items()
    ]
    caption = f"Area up to recall {UPTO:g}"
    table = Table(name.replace("_", "-"), caption, ("case", *methods), lines, sorts=True)
    header = "dataset,technique,curve,recall,precision,threshold,false_positives"
    return Exhibit(
        title,
        paragraphs,
        pictures,
        # Table I has those of the sequences.
        tables=() if name == "precision_recall" else (table,),
        points=points,
        name=name,
        header=header,
        rows=rows,
    )
