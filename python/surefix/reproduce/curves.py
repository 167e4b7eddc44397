"""Precision-recall curves: of the sequences, of the single frames, and against the perfect
prediction.
"""

from collections.abc import Mapping, Sequence

from surefix import plot
from surefix._core import Evaluation, evaluate
from surefix.baselines import (
    SupervisedPredictor,
    masked_single_frame,
    maximum_gradient,
    single_frame,
)
from surefix.errors import SurefixError
from surefix.matches import Matches
from surefix.report.page import Picture
from surefix.reproduce.case import UPTO, Case, Settings
from surefix.reproduce.comparison import Cell, Comparison, drawn, stem
from surefix.reproduce.table import Row

__all__ = ["perfect_prediction", "sequences", "single_frames"]

HEADER = ("dataset", "technique", "curve", "recall", "precision", "threshold", "false_positives")
PERFECT_LENGTH = 3


def sequences(rows: Sequence[Row], settings: Settings) -> Comparison:
    """The two curves behind each row of Table I."""
    curves = [(row.case, {"weighted": row.weighted, "unweighted": row.unweighted}) for row in rows]
    return _comparison(
        "precision_recall",
        "Precision and recall of the sequences",
        (
            "The curves behind Table I: every score is a threshold once. The shaded part is what the areas are taken "
            "over. Beyond it the two may cross: an area up to recall 0.2 says nothing of that.",
        ),
        curves,
        settings,
    )


def single_frames(cases: Sequence[Case], settings: Settings) -> Comparison:
    """Single frames: by the distance, by the gradient, and masked by the two predictions."""
    curves, points = [], []
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
        evaluated = {
            name: _evaluate_from(case, begin, matches, settings)
            for name, matches in methods.items()
        }
        curves.append((case, evaluated))
        points.append(f"{case.name}: {_ranked(evaluated)}.")
    return _comparison(
        "single_frame",
        "Single frames",
        (
            "No sequence: one query at a time. By the distance alone; by the greatest gradient alone; and by the "
            "distance with the matches refused that a prediction does not trust. The unsupervised prediction needs "
            "nothing. The supervised one (Carson, Ford and Milford, RA-L 2022) learns from the first third of each "
            "case's queries with their truth, so the curves are of the other two thirds, all of them of the same.",
            "A mask cannot add correct matches: its curve ends where it refuses the rest.",
        ),
        curves,
        settings,
        points,
    )


def perfect_prediction(cases: Sequence[Case], settings: Settings) -> Comparison:
    """Sequences of three, weighted by the prediction and by a perfect one."""
    curves, points = [], []
    for case in cases:
        evaluated = {
            "weighted by the prediction": case.evaluate(case.weighted(PERFECT_LENGTH), settings),
            "weighted by a perfect prediction": case.evaluate(
                case.weighted(PERFECT_LENGTH, trusted=case.right()), settings
            ),
            "unweighted": case.evaluate(case.unweighted(PERFECT_LENGTH), settings),
        }
        curves.append((case, evaluated))
        points.append(f"{case.name}: {_ranked(evaluated)}.")
    return _comparison(
        "perfect_prediction",
        f"Weighted sequences against the perfect prediction, L = {PERFECT_LENGTH}",
        (
            "The perfect prediction is told the truth: it trusts exactly the single matches that are right. It is the "
            "most that a better predictor could add. What remains to be gained is the distance between its curve and "
            "the prediction's.",
        ),
        curves,
        settings,
        points,
    )


def _supervised(case: Case, begin: int) -> Matches:
    predictor = SupervisedPredictor()
    predictor.fit(case.D[:, :begin], case.truth_before(begin), case.tolerance)
    return masked_single_frame(case.D, trusted=predictor.predict(case.D))


def _evaluate_from(case: Case, begin: int, matches: Matches, settings: Settings) -> Evaluation:
    """The curve of the queries from ``begin`` on."""
    part = Matches(
        matches.place[begin:],
        matches.score[begin:],
        None if matches.ready is None else matches.ready[begin:],
        None if matches.accepted is None else matches.accepted[begin:],
    )
    return evaluate(part, case.truth_from(begin), case.tolerance, settings.recall)


def _ranked(curves: Mapping[str, Evaluation]) -> str:
    """The areas, the best first."""
    ranked = sorted(curves.items(), key=lambda item: -item[1].auc(UPTO))
    return ", ".join(f"{name} {_area(curve)}" for name, curve in ranked)


def _area(curve: Evaluation) -> str:
    end = f" (it ends at recall {curve.max_recall:.2f})" if curve.max_recall < UPTO else ""
    return f"{curve.auc(UPTO):.3f}{end}"


def _comparison(
    name: str,
    title: str,
    paragraphs: Sequence[str],
    curves: Sequence[tuple[Case, Mapping[str, Evaluation]]],
    settings: Settings,
    points: Sequence[str] = (),
) -> Comparison:
    rows: list[Sequence[Cell]] = []
    for case, evaluated in curves:
        for method, curve in evaluated.items():
            columns = (curve.recall, curve.precision, curve.thresholds, curve.false_positives)
            numbers = zip(*(column.tolist() for column in columns), strict=True)
            rows += [(case.dataset, case.technique, method, *point) for point in numbers]
    pictures = {
        stem(name, case.dataset, case.technique): _picture(case, evaluated, settings)
        for case, evaluated in curves
    }
    return Comparison(name, title, paragraphs, HEADER, rows, pictures, points=points)


def _picture(case: Case, curves: Mapping[str, Evaluation], settings: Settings) -> Picture:
    return drawn(
        lambda ax, theme: plot.precision_recall(
            ax, curves, upto=UPTO, recall=settings.recall, theme=theme
        ),
        f"Precision-recall curves of {case.name}. Area up to recall {UPTO:g}: {_ranked(curves)}.",
        case.name,
    )
