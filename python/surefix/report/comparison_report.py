"""The report of a comparison: one page, its pictures, and what they were made from."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from surefix import __version__
from surefix._words import counted
from surefix.report import comparison_pictures as pictures
from surefix.report import comparison_sections as sections
from surefix.report import comparison_tables as tables
from surefix.report.comparison import Comparison
from surefix.report.page import Picture, Section, page
from surefix.report.staged import PAGE, staged

__all__ = ["FILES", "write_comparison"]

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

# What not every comparison has.
MISTAKES = ("mistakes.png", "trusted_mistakes.png")
MORE = re.compile(r"precision_recall_\d+\.png")


def write_comparison(
    comparison: Comparison,
    folder: Path,
    command: str,
    *,
    queries: pictures.Images = None,
    references: pictures.Images = None,
    query_names: Sequence[str] | None = None,
    place_names: Sequence[str] | None = None,
    along: NDArray[np.float64] | None = None,
) -> Path:
    """Writes the page and all that belongs to it into ``folder``; returns the path of the page.

    Parameters
    ----------
    command : str
        What makes this comparison again.
    queries, references : sequences of uint8 images, or those of the mistakes by their numbers, optional
        For the pictures side by side.
    query_names, place_names : sequences of str, optional
    along : array of float64, shape (m,), optional
        How far along the drive each query was taken, in metres, ascending.

    Raises
    ------
    OSError
        Where a file cannot be written.
    """
    with staged(folder, _old(folder)) as inside:
        tables.write_methods(comparison, inside / "methods.csv")
        tables.write_curves(comparison, inside / "curves.csv")
        tables.write_fixes(comparison, inside / "fixes.csv", query_names)
        curves = pictures.curves(comparison)
        drawn: dict[str, Picture | None] = {
            "precision_recall.png": curves[0],
            **{
                f"precision_recall_{k}.png": picture
                for k, picture in enumerate(curves[1:], start=2)
            },
            "auc.png": pictures.intervals(comparison),
            "false_positives.png": pictures.false(comparison),
            "trust.png": pictures.trust(comparison),
            "distance_matrix.png": pictures.matrix(comparison),
            "close_up.png": pictures.close_up(comparison),
            "route.png": pictures.strip(comparison, along),
            "mistakes.png": pictures.mistakes(comparison, queries, references),
            "trusted_mistakes.png": pictures.trusted_mistakes(comparison, queries, references),
        }
        made = {name: picture for name, picture in drawn.items() if picture is not None}
        for name, picture in made.items():
            (inside / name).write_bytes(picture.light)
        wrong = [made[name] for name in MISTAKES if name in made]
        files = FILES | {
            name: "mistakes, as images side by side" for name in made if name not in FILES
        }
        files |= {
            name: "more of the curves" for name in made if name.startswith("precision_recall_")
        }
        text = page(
            "How well does it know where it is?",
            sections.lead(comparison),
            (),
            sections.tiles(comparison),
            (
                sections.methods(comparison, made["auc.png"], made["false_positives.png"]),
                sections.words(comparison),
                sections.curves(comparison, curves),
                sections.trust(comparison, made["trust.png"]),
                sections.matrix(comparison, made["distance_matrix.png"], made["close_up.png"]),
                sections.route(comparison, made["route.png"]),
                sections.mistakes(comparison, wrong, query_names, place_names, pictures.MISTAKES),
                _made(comparison, command, files),
            ),
        )
        (inside / PAGE).write_text(text, encoding="utf-8")
    return folder / PAGE


def _old(folder: Path) -> set[str]:
    """The names of an earlier comparison's files: beside those of this they would be taken for its
    own.
    """
    more = {
        path.name for path in folder.glob("precision_recall_*.png") if MORE.fullmatch(path.name)
    }
    return {*FILES, *MISTAKES, *more}


def _made(comparison: Comparison, command: str, files: dict[str, str]) -> Section:
    c = comparison.context
    n, m = comparison.distances.shape
    rows = (
        ("Made with", f"surefix {__version__}: {command}"),
        ("Distances", f"{counted(n, 'place')} by {counted(m, 'query', 'queries')}, float32"),
        ("Sequences", f"length {c.sequence_length}, weight {c.weight:g}, floor {c.floor}"),
        (
            "Trusted means",
            f"within {c.tolerance} of each other, gradients of {c.smoothing} queries summed ({c.gradient})",
        ),
        (
            "Intervals",
            "95 %, 1000 samples of blocks as long as the root of the number of queries, seed 0",
        ),
        *((result.name, result.description) for result in comparison.results),
        *files.items(),
    )
    return Section("How this was made", ("So that it can be checked, and done again.",), (), rows)
