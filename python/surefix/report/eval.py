"""The report of ``surefix eval``: one page, its pictures, and its numbers."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from surefix._words import plural
from surefix.report import figures, sections
from surefix.report.album import Album
from surefix.report.explore import explorer, scripts
from surefix.report.figures import Images
from surefix.report.page import write
from surefix.report.scene import of_study
from surefix.report.tables import write_drives, write_tables
from surefix.study import Study

__all__ = ["FILES", "write_report"]

FILES = {
    "report.html": "this page; it needs no other file",
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

SAID = {
    "scenarios.csv": "a line for each method on each drive",
    "reliability.csv": "confidence against the share that is right",
}
# Not every report has these, nor the mistakes.
MORE = re.compile(r"(precision_recall_\d+|reliability(_.+)?)\.png|scenarios\.csv|reliability\.csv")


def _blocks(study: Study) -> str:
    """How long the blocks of the methods' intervals are, in words."""
    blocks = [block for result in study.results if (block := result.curve.block) is not None]
    if not blocks:
        return "a query each, as no method ever changes between right and wrong"
    low, high = min(blocks), max(blocks)
    return plural(low, "query", "queries") if low == high else f"{low} to {high} queries"


def write_report(
    study: Study,
    folder: Path,
    command: str = "",
    *,
    title: str = "",
    queries: Images = None,
    references: Images = None,
    album: Album | None = None,
    query_names: Sequence[str] | None = None,
    place_names: Sequence[str] | None = None,
    along: NDArray[np.float64] | None = None,
    scenarios: Sequence[Study] = (),
    drive: str | None = None,
    spreadsheet: bool = False,
) -> Path:
    """Writes the page and all that belongs to it into ``folder``; returns the path of the page.

    Parameters
    ----------
    study : Study
    folder : Path
    command : str
        The command that makes this report again.
    title : str
        The drive and its map, by default how many queries and places they have.
    queries, references : sequences of uint8 images, or some of them by number, optional
        Small copies of them are kept on the page; the worst mistakes are drawn as they are.
    album : Album, optional
        Small copies of the queries, if ``queries`` are those of the mistakes alone.
    query_names, place_names : sequences of str, optional
    along : array of float64, shape (m,), optional
        The way along the drive at which each query was taken, in metres, ascending.
    scenarios : sequence of Study
        The same methods on drives made of this one.
    drive : str, optional
        Its mark (``surefix.tables.reports.drive_of``), for ``surefix compare``.
    spreadsheet : bool
        Write the tables for a spreadsheet: text that would be a formula there gets a ``'`` before
        it.

    Raises
    ------
    SurefixFileError
        If a file cannot be written; an earlier report is whole then.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from surefix.baselines import Context
    >>> from surefix.report import write_report
    >>> from surefix.study import Study
    >>> study = Study(1 - np.eye(30, dtype=np.float32), Context(truth=np.arange(30)))
    >>> folder = Path(tempfile.mkdtemp())
    >>> write_report(study, folder, title="winter on summer").name
    'report.html'
    """
    says = any(result.matches.confidence is not None for result in study.results)
    drives = [study, *scenarios] if says or scenarios else []
    diagrams = figures.reliability(drives)
    curves, c = figures.curves(study), study.context
    mistakes = figures.mistakes(study, queries, references)
    extra = {name: "more of the curves" for name in curves if name not in FILES}
    extra |= dict.fromkeys(mistakes, "mistakes, as images side by side")
    extra |= dict.fromkeys(diagrams, "confidence against the share that is right")
    extra |= SAID if drives else {}
    n, m = study.distances.shape
    made = sections.made(
        ("Distances", f"{plural(n, 'place')} by {plural(m, 'query', 'queries')}, float32"),
        ("Sequences", f"length {c.sequence_length}, weight {c.weight:g}, floor {c.floor}"),
        (
            "Trusted means",
            f"within {c.tolerance} of each other, gradients of {c.smoothing} queries summed "
            f"({c.gradient})",
        ),
        (
            "Intervals",
            f"95 %, {study.samples} samples of blocks as long as errors last, "
            f"{_blocks(study)}, seed 0",
        ),
        *(FILES | extra).items(),
    )

    def write_all(inside: Path) -> None:
        write_tables(study, inside, query_names, drive, spreadsheet)
        if drives:
            write_drives(drives, inside, spreadsheet)

    # Left beside the new files, those of an earlier report would look new.
    old = [path.name for path in folder.glob("*") if MORE.fullmatch(path.name)]
    scene = of_study(
        study,
        queries=queries if album is None else album,
        references=references,
        query_names=query_names,
        place_names=place_names,
    )
    files = figures.numbers(study) | curves | mistakes | figures.matrix(study)
    files |= {"trust.png": figures.trust(study), "route.png": figures.strip(study, along)}
    return write(
        folder,
        title or f"{plural(m, 'query', 'queries')} on {plural(n, 'place')}",
        (*sections.lead(study), *([sections.on_average(drives)] if scenarios else ())),
        (),
        sections.tiles(study),
        (
            explorer(scene),
            *sections.methods(study, study.shown),
            *(sections.drives(drives, diagrams) if drives else ()),
            sections.trust(study),
            sections.route(study),
            sections.mistakes(study, query_names, place_names),
            made,
        ),
        write_all,
        {*FILES, "mistakes.png", "trusted_mistakes.png", *old},
        files=files,
        identity=sections.identity("How well does it know where it is?"),
        command=command,
        scripts=scripts(),
    )
