"""How many wrong matches are accepted by 20 % recall."""

from collections.abc import Sequence
from textwrap import fill

from surefix import plot
from surefix.report.page import Picture
from surefix.reproduce.case import UPTO, Settings
from surefix.reproduce.comparison import Comparison, drawn
from surefix.reproduce.table import LABEL, LENGTH, Row

__all__ = ["compare"]

# More in one picture cannot be read.
ROWS_A_PICTURE = 8


def compare(rows: Sequence[Row], settings: Settings) -> Comparison:
    """The counts behind each row of Table I."""
    counts = [
        (row, row.unweighted.false_positives_at(UPTO), row.weighted.false_positives_at(UPTO))
        for row in rows
    ]
    fewer = [
        row
        for row, before, after in counts
        if before is not None and after is not None and after < before
    ]
    more = [
        row
        for row, before, after in counts
        if before is not None and after is not None and after > before
    ]
    same = [row for row, before, after in counts if before is not None and before == after]
    rest = len(counts) - len(fewer) - len(more) - len(same)
    named = [(row.case.name, before, after) for row, before, after in counts]
    starts = range(0, len(counts), ROWS_A_PICTURE)
    return Comparison(
        "false_positives",
        "False positives at 20 % recall",
        (
            f"The wrong matches that are accepted by the time that recall {UPTO:g} is reached (L = {LENGTH}, recall is "
            f"\u201c{settings.recall}\u201d). Weighting makes them fewer in {len(fewer)}, more in {len(more)} and "
            f"leaves them as many in {len(same)} of {len(counts)} rows; in {rest} a curve ends before that recall.",
        ),
        (
            "dataset",
            "technique",
            "unweighted",
            "weighted",
            "correct_unweighted",
            "correct_weighted",
        ),
        [
            (
                row.case.dataset,
                row.case.technique,
                before,
                after,
                row.unweighted.correct,
                row.weighted.correct,
            )
            for row, before, after in counts
        ],
        {
            f"false_positives_{number}" if number > 1 else "false_positives": _picture(
                counts[start:][:ROWS_A_PICTURE]
            )
            for number, start in enumerate(starts, 1)
        },
        points=[
            f"{row}: {_count(before)} unweighted, {_count(after)} weighted."
            for row, before, after in named
        ],
    )


def _count(count: int | None) -> str:
    return "recall not reached" if count is None else str(count)


def _picture(counts: Sequence[tuple[Row, int | None, int | None]]) -> Picture:
    bars: dict[str, int | None] = {}
    for row, before, after in counts:
        bars[f"{row.case.name}: unweighted"], bars[f"{row.case.name}: weighted"] = before, after
    text = ", ".join(f"{name} {_count(count)}" for name, count in bars.items())
    lines = {fill(name, LABEL): count for name, count in bars.items()}
    return drawn(
        lambda ax, theme: plot.false_positives(ax, lines, recall=UPTO, theme=theme),
        f"Wrong matches accepted by recall {UPTO:g}: {text}.",
        size=(8.6, 1.0 + 0.36 * len(bars)),
    )
