"""The numbers of a comparison as tables: on the page, and as CSV."""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

from surefix.report.comparison import BASELINE, KS, UPTO, Comparison, Result
from surefix.report.page import Table
from surefix.report.verdict import outcome

__all__ = ["Names", "methods", "worst", "write_curves", "write_fixes", "write_methods"]

Names = Sequence[str] | None

METHOD_COLUMNS = (
    *(
        "method",
        "recall_convention",
        "auc",
        "auc_low",
        "auc_high",
        "difference",
        "difference_low",
        "difference_high",
    ),
    *(
        "verdict",
        "max_recall",
        "recall_at_full_precision",
        "false_positives",
        "best_f1",
        "best_f1_threshold",
    ),
    *("correct", "judged"),
)
FIX_COLUMNS = (
    *(
        "method",
        "query",
        "name",
        "place",
        "score",
        "ready",
        "accepted",
        "judged",
        "right",
        "true_place",
        "trusted",
    ),
)

PERCENT = f"{100 * UPTO:g} %"


def methods(comparison: Comparison) -> Table:
    """Every method, none left out."""
    header = (
        "method",
        f"AUC to {PERCENT} recall (95 % interval)",
        "difference to the plain sequence (95 % interval)",
        "verdict",
        "largest recall",
        "recall at 100 % precision",
        f"false positives at {PERCENT} recall",
        "best F1",
        "matches right",
    )
    caption = f'Recall is "{comparison.recall}". The plain sequence is the method "{BASELINE}".'
    return Table(
        "methods", caption, header, [_row(comparison, result) for result in comparison.results]
    )


def _row(comparison: Comparison, result: Result) -> Sequence[str]:
    area, low, high = result.area
    difference, below, above = result.difference
    false = result.curve.false_positives_at(UPTO)
    plain = result is comparison.baseline
    return (
        result.name,
        f"{area:.3f} {_span(f'{low:.3f}', f'{high:.3f}')}",
        "-" if plain else f"{difference:+.3f} {_span(f'{below:+.3f}', f'{above:+.3f}')}",
        "the baseline" if plain else _so(outcome(result)),
        f"{result.curve.max_recall:.3f}",
        f"{result.curve.recall_at_precision(1.0):.3f}",
        "never there" if false is None else str(false),
        f"{result.curve.best_f1:.3f}",
        f"{result.curve.correct} of {result.curve.judged}",
    )


def _span(low: str, high: str) -> str:
    """An interval that is not broken into two lines."""
    return f"({low}\N{NO-BREAK SPACE}to\N{NO-BREAK SPACE}{high})"


def _so(word: str) -> str:
    return {"the drive does not tell": "cannot be told apart", "the same": "is the same"}.get(
        word, word
    )


def worst(comparison: Comparison, names: Names, places: Names, count: int) -> Sequence[Table]:
    """The mistakes with the best scores, and the trusted ones."""
    shown, run = comparison.shown, comparison.run
    header = ("query", "matched to place", "true place", "off by", "score", "trusted")
    rows = [
        _mistake(
            comparison,
            names,
            places,
            query,
            int(shown.matches.place[query]),
            float(shown.matches.score[query]),
        )
        for query in comparison.mistakes(count)
    ]
    trusted = [
        _mistake(
            comparison,
            names,
            places,
            query,
            int(run.single_place[query]),
            float(run.single_distance[query]),
        )
        for query in comparison.trusted_mistakes(count)
    ]
    caption = "Single matches that are trusted and wrong, the nearest first; those above are not repeated."
    first = Table(
        "mistakes", f"Wrong matches of {shown.name}, the best scores first.", header, rows
    )
    second = Table("trusted-mistakes", caption, header, trusted)
    return tuple(table for table in (first, second) if table.rows)


def _mistake(
    comparison: Comparison, names: Names, places: Names, query: int, place: int, score: float
) -> Sequence[str]:
    true = int(comparison.true_place[query])
    return (
        _named(query, names),
        _named(place, places),
        "none" if true < 0 else _named(true, places),
        comparison.off(query, place).removesuffix(" off"),
        f"{score:.4g}",
        "yes" if comparison.run.trusted[query] else "no",
    )


def _named(index: int, names: Names) -> str:
    return (
        str(index) if names is None or names[index] == str(index) else f"{index} ({names[index]})"
    )


def write_methods(comparison: Comparison, path: Path) -> None:
    """A line for each method."""
    t = comparison.trust
    at = {f"recall_at_{k}": value for k, value in zip(KS, comparison.recalls_at, strict=False)}
    rows = (
        (
            result.name,
            comparison.recall,
            *result.area,
            *result.difference,
            outcome(result),
            result.curve.max_recall,
            result.curve.recall_at_precision(1.0),
            "" if (false := result.curve.false_positives_at(UPTO)) is None else false,
            result.curve.best_f1,
            _number(result.curve.best_f1_threshold),
            result.curve.correct,
            result.curve.judged,
        )
        for result in comparison.results
    )
    _write(path, METHOD_COLUMNS, rows)
    flags = {
        "trusted_right": t.true_positives,
        "trusted_wrong": t.false_positives,
        "untrusted_right": t.false_negatives,
        "untrusted_wrong": t.true_negatives,
        "trust_precision": t.precision,
        "trust_recall": t.recall,
        "share_trusted": t.share_trusted,
    }
    _write(path.with_name("drive.csv"), ("quantity", "value"), (at | flags).items())


def write_curves(comparison: Comparison, path: Path) -> None:
    """A line for each point of each curve."""
    rows = (
        (result.name, threshold, recall, precision, false)
        for result in comparison.results
        for threshold, recall, precision, false in zip(
            result.curve.thresholds,
            result.curve.recall,
            result.curve.precision,
            result.curve.false_positives,
            strict=True,
        )
    )
    _write(path, ("method", "threshold", "recall", "precision", "false_positives"), rows)


def write_fixes(comparison: Comparison, path: Path, names: Names) -> None:
    """A line for each query of each method."""
    rows = (
        (
            result.name,
            query,
            "" if names is None else names[query],
            result.matches.place[query],
            result.matches.score[query],
            *(_flag(flag) for flag in flags),
            comparison.true_place[query],
            _flag(comparison.run.trusted[query]),
        )
        for result in comparison.results
        for query, flags in enumerate(
            zip(result.matches.ready, result.accepted, result.judged, result.right, strict=True)  # type: ignore[arg-type]
        )
    )
    _write(path, FIX_COLUMNS, rows)


def _flag(value: object) -> str:
    return "true" if value else "false"


def _number(value: float) -> object:
    return value if value == value and abs(value) != float("inf") else ""


def _write(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)
