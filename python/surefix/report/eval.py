"""The report of ``surefix eval``: one page, its pictures, and its numbers."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from surefix._words import plural
from surefix.report import figures, sections
from surefix.report.figures import Images
from surefix.report.page import Picture, page, write
from surefix.report.tables import write_tables
from surefix.study import Study

__all__ = ["FILES", "write_report"]

FILES = {
    "report.html": "this page, with its pictures inside",
    "precision_recall.png": "the curves",
    "auc.png": "the areas with their intervals",
    "false_positives.png": "wrong matches accepted by recall 0.2",
    "trust.png": "the confusion table of the trust flag",
    "distance_matrix.png": "the matrix with every match",
    "close_up.png": "a part of it, cell by cell",
    "route.png": "right and wrong along the route",
    "methods.csv": "a line for each method: its numbers",
    "drive.csv": "recall at 1, 5 and 10, and the trust flag",
    "curves.csv": "a line for each point of each curve",
    "fixes.csv": "a line for each query of each method",
}

# Not every report has these.
MISTAKES = ("mistakes.png", "trusted_mistakes.png")
MORE = re.compile(r"precision_recall_\d+\.png")


def write_report(
    study: Study,
    folder: Path,
    command: str,
    *,
    queries: Images = None,
    references: Images = None,
    query_names: Sequence[str] | None = None,
    place_names: Sequence[str] | None = None,
    along: NDArray[np.float64] | None = None,
) -> Path:
    """Writes the page and all that belongs to it into ``folder``; returns the path of the page.

    Parameters
    ----------
    study : Study
    folder : Path
    command : str
        The command that makes this report again.
    queries, references : sequences of uint8 images, or those of the mistakes by number, optional
        For the pictures side by side.
    query_names, place_names : sequences of str, optional
    along : array of float64, shape (m,), optional
        The way along the drive at which each query was taken, in metres, ascending.
    """
    curves = figures.curves(study)
    drawn: dict[str, Picture | None] = {
        "precision_recall.png": curves[0],
        **{f"precision_recall_{k}.png": picture for k, picture in enumerate(curves[1:], start=2)},
        "auc.png": figures.intervals(study),
        "false_positives.png": figures.false(study),
        "trust.png": figures.trust(study),
        "distance_matrix.png": figures.matrix(study),
        "close_up.png": figures.close_up(study),
        "route.png": figures.strip(study, along),
        "mistakes.png": figures.mistakes(study, queries, references),
        "trusted_mistakes.png": figures.trusted_mistakes(study, queries, references),
    }
    made = {name: picture for name, picture in drawn.items() if picture is not None}
    wrong = [made[name] for name in MISTAKES if name in made]
    extra = {
        name: "mistakes, as images side by side" if name in MISTAKES else "more of the curves"
        for name in made
        if name not in FILES
    }
    c = study.context
    n, m = study.distances.shape
    text = page(
        "How well does it know where it is?",
        sections.lead(study),
        (),
        sections.tiles(study),
        (
            sections.methods(study, made["auc.png"], made["false_positives.png"]),
            sections.words(study),
            sections.curves(study, curves),
            sections.trust(study, made["trust.png"]),
            sections.matrix(study, made["distance_matrix.png"], made["close_up.png"]),
            sections.route(study, made["route.png"]),
            sections.mistakes(study, wrong, query_names, place_names),
            sections.made(
                (
                    "Distances",
                    f"{plural(n, 'place')} by {plural(m, 'query', 'queries')}, float32",
                ),
                ("Sequences", f"length {c.sequence_length}, weight {c.weight:g}, floor {c.floor}"),
                (
                    "Trusted means",
                    f"within {c.tolerance} of each other, gradients of {c.smoothing} queries "
                    f"summed ({c.gradient})",
                ),
                (
                    "Intervals",
                    f"95 %, {study.samples} samples of blocks as long as the root of the number "
                    "of queries, seed 0",
                ),
                *((result.name, result.description) for result in study.results),
                *(FILES | extra).items(),
                command=command,
            ),
        ),
    )
    return write(
        folder, text, made, lambda inside: write_tables(study, inside, query_names), _old(folder)
    )


def _old(folder: Path) -> set[str]:
    """The names of an earlier report's files: left beside the new ones, they would look new."""
    more = {path.name for path in folder.glob("precision_recall_*.png")}
    return {*FILES, *MISTAKES, *filter(MORE.fullmatch, more)}
