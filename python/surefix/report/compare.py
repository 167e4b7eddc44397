"""The page of a comparison."""

import shlex
import sys
from collections import Counter
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from surefix import Comparison, plot
from surefix._words import plural
from surefix.comparison import UNSURE, signed, write_whole
from surefix.judged import FIGURES
from surefix.plot.theme import LOOKS, Theme
from surefix.report import sections
from surefix.report.multiples import multiples
from surefix.report.page import Section, Table, Tile, page

__all__ = ["page_of", "write_page"]


def write_page(comparison: Comparison, path: Path) -> None:
    """Writes the page of a comparison, one file.

    Raises
    ------
    SurefixFileError
        If it cannot be written; an older one is then as it was.
    """
    write_whole(path, page_of(comparison, shlex.join(["surefix", *sys.argv[1:]])))


def page_of(comparison: Comparison, command: str) -> str:
    """The page as text; ``command`` makes it again."""
    others = [run.name for run in comparison.runs if run.name != comparison.against]
    named = ", ".join(others) if len(others) <= 3 else plural(len(others), "run")
    parts = (
        _figures(comparison),
        _differences(comparison),
        _curves(comparison),
        _made(comparison, command),
    )
    title = f"{named} against {comparison.against}"
    identity = sections.identity("Which one is better?")
    return page(
        title, _lead(comparison), (), _tiles(comparison), parts, contents=True, identity=identity
    )


def _lead(comparison: Comparison) -> list[str]:
    """How they were compared, and a sentence for each run that is better or worse in something."""
    said = [comparison.how]
    for run in comparison.runs:
        parts = []
        for word in ("better", "worse"):
            which = [f for f in comparison.figures if run.verdict(f) == word]
            some = (f"{comparison.heading(f)} ({run.differences[f]:+.3f})" for f in which)
            parts += [f"{word} in {', '.join(some)}"] if which else []
        said += [f"{run.name} is {'; '.join(parts)}."] if parts else []
    return said if len(said) > 1 else [*said, "The drive does not tell any of them apart."]


def _tiles(comparison: Comparison) -> tuple[Tile, ...]:
    verdicts = [run.verdict(figure) for run in comparison.runs for figure in comparison.figures]
    counts = Counter(filter(None, verdicts))
    note = f"of {plural(counts.total(), 'difference')}"
    return tuple(
        Tile(name, str(counts[word]), label, note)
        for name, word, label in (
            ("better", "better", "better, the interval above 0"),
            ("worse", "worse", "worse, the interval below 0"),
            ("unsure", UNSURE, "the drive does not tell"),
        )
    )


def _figures(comparison: Comparison) -> Section:
    header, _ = comparison.table()
    rows = [
        (
            run.name,
            *(
                str(run.figures[f])
                if f in run.figures and run.figures[f] == run.figures[f]
                else "-"
                for f in comparison.figures
            ),
        )
        for run in comparison.runs
    ]
    caption = f"Each with its own 95 % interval; {comparison.against} is the baseline."
    text = (
        "Whether two differ is told by the interval of their difference, below: two intervals here "
        "may overlap, and the runs still differ for sure, as both have the same hard queries."
    )
    table = Table("figures", caption, header, rows, sorts=True)
    return Section("The figures", (text,) if comparison.paired else (), tables=(table,))


def _differences(comparison: Comparison) -> Section:
    header, rows = comparison.differences()
    others = [run for run in comparison.runs if run.name != comparison.against]
    figures = comparison.telling
    alt = "; ".join(
        f"{run.name}, {comparison.heading(figure)} {' ('.join(signed(run.differences[figure]))})"
        for figure in figures
        for run in others
        if run.verdict(figure)
    )
    forest = multiples(
        [comparison.heading(figure) for figure in figures],
        lambda ax, index, theme: _forest(ax, comparison, figures[index], theme),
        f"Differences to {comparison.against} with their intervals: {alt}.",
        x=f"difference to {comparison.against}: right of the line is better",
        y="",
        columns=(3, 1),
        heights=(0.5 + 0.26 * len(others),) * 2,
    )
    caption = "If the interval holds 0, the drive does not tell which is better."
    table = Table("differences", caption, header, rows, sorts=True)
    return Section(
        f"Differences to {comparison.against}", (), {"differences.png": forest}, tables=(table,)
    )


def _forest(ax: Axes, comparison: Comparison, figure: str, theme: Theme) -> None:
    others = [run for run in comparison.runs if run.name != comparison.against]
    ax.axvline(0, color=theme.muted, linewidth=1)
    for row, run in enumerate(others):
        found, said = run.differences.get(figure), run.verdict(figure)
        if found is None or not said:
            continue
        colour = {"better": theme.trusted_right, "worse": theme.trusted_wrong}.get(
            said, theme.muted
        )
        mark = {"better": "o", "worse": "X"}.get(said, "|")
        line: Any = {"linewidth": 2.2, "solid_capstyle": "butt"}
        ax.plot([found.low, found.high], [row, row], color=colour, **line)
        ax.plot(float(found), row, mark, color=colour, markersize=7, markeredgecolor=theme.paper
                if said in ("better", "worse") else colour)  # fmt: skip
    ax.set_yticks(range(len(others)), labels=[run.name for run in others])
    ax.set_ylim(len(others) - 0.5, -0.5)
    ax.tick_params(axis="y", length=0, labelcolor=theme.ink)
    ax.grid(axis="x", linewidth=0.8)
    ax.set_axisbelow(True)


def _curves(comparison: Comparison) -> Section:
    curves = {each.name: each.curve for each in comparison.judged}
    areas = ", ".join(f"{name} {curve.auc(comparison.upto):.3f}" for name, curve in curves.items())
    alt = f"Precision-recall curves. Areas up to recall {comparison.upto:g}: {areas}."
    how: dict[str, Any] = {"upto": comparison.upto, "recall": comparison.recall}
    if len(curves) <= LOOKS:
        picture = multiples(
            [""],
            lambda ax, index, theme: plot.precision_recall(curves, ax=ax, theme=theme, **how),
            alt,
            x="recall",
            y="precision",
            heights=(4.6, 3.2),
        )
        return Section("Precision and recall", (), {"precision_recall.png": picture})
    # More than can be told apart: each beside the baseline.
    others = [name for name in curves if name != comparison.against]

    def draw(ax: Axes, index: int, theme: Theme) -> None:
        pair = {"the run": curves[others[index]], comparison.against: curves[comparison.against]}
        plot.precision_recall(pair, ax=ax, theme=theme, **how)

    picture = multiples(others, draw, alt, x="recall", y="precision")
    return Section("Precision and recall", (), {"precision_recall.png": picture})


def _made(comparison: Comparison, command: str) -> Section:
    told = sum(bool(run.verdict(f)) for run in comparison.runs for f in comparison.figures)
    luck = f"one in twenty misses by chance, so about {told / 20:.1f} of these {told}"
    intervals = "95 %, by a bootstrap over blocks of consecutive queries, as long as errors last"
    pairs = (
        "the same queries are drawn for a run and the baseline"
        if comparison.paired
        else "of two drives: made of the two intervals (Zou and Donner 2008)"
    )
    facts = (
        *((comparison.heading(figure), FIGURES[figure]) for figure in comparison.figures),
        (f"recall \u201c{comparison.recall}\u201d", sections.RECALLS[comparison.recall]),
        ("intervals", intervals),
        ("differences", f"{pairs}; {luck}"),
        ("made with", command),
    )
    return Section("How this was made", (), facts=facts)
