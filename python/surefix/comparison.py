"""A comparison of runs as a table: printed, as CSV, JSON, Markdown and HTML."""

import io
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from surefix._saving import save
from surefix._words import columns, escaped, plural
from surefix.auditing import Estimate
from surefix.judged import FIGURES, HEADINGS, Judged, Recall
from surefix.tables.csv_rows import row_writer

__all__ = ["BASELINE", "UNSURE", "Compared", "Comparison", "Estimates", "signed", "write_whole"]

COLUMNS = (
    "run", "figure", "value", "low", "high", "difference", "difference_low", "difference_high",
    "verdict",
)  # fmt: skip
BASELINE, SAME, UNSURE = "the baseline", "the same", "the drive does not tell"

Estimates: TypeAlias = Mapping[str, Estimate]


@dataclass(frozen=True, eq=False)
class Compared:
    """One run of a ``Comparison``: its figures with their 95 % intervals, by name.

    Attributes
    ----------
    name : str
    figures : mapping of a figure to an Estimate
        Those that the run has of "right", "area", "recall_at_full_precision", "trusted_precision",
        "trusted_recall" and "off_map_roc".
    differences : mapping of a figure to an Estimate
        The figure less the baseline's; empty for the baseline itself.
    """

    name: str
    figures: Estimates
    differences: Estimates

    def verdict(self, figure: str) -> str:
        """Against the baseline: "better" or "worse"; "the drive does not tell" if the interval of
        the difference holds 0; "the same" if no sample differs. Empty without a difference.
        """
        found = self.differences.get(figure)
        if found is None or math.isnan(found):
            return ""
        if found == found.low == found.high == 0:
            return SAME
        if found.low > 0 or found.high < 0:
            return "better" if found.low > 0 else "worse"
        return UNSURE


@dataclass(frozen=True, eq=False)
class Comparison:
    """Runs beside each other, by ``compare``. Printed, and in a notebook, it is a table.

    Attributes
    ----------
    runs : tuple of Compared
        In the order in which they were given.
    against : str
        The name of the baseline.
    paired : bool
        Whether all are of the same queries, and compared query by query.
    queries : tuple of int
        The number of queries of each run.
    upto : float
        Areas are up to this recall.
    recall : {"correct", "place_exists", "rejected"}
        The convention of the curves.
    judged : tuple of Judged
        The matches of each run, and their ``curve``.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> noise = np.random.default_rng(0).random((60, 60)).astype(np.float32)
    >>> near = noise - np.eye(60, dtype=np.float32)
    >>> runs = {"weak": surefix.match_distances(noise), "good": surefix.match_distances(near)}
    >>> comparison = surefix.compare(runs, np.arange(60))
    >>> comparison["good"].verdict("right")
    'better'
    """

    runs: tuple[Compared, ...]
    against: str
    paired: bool
    queries: tuple[int, ...]
    upto: float
    recall: Recall
    judged: tuple[Judged, ...]

    def __len__(self) -> int:
        """The number of runs."""
        return len(self.runs)

    def __getitem__(self, name: str) -> Compared:
        """The run of this name."""
        for run in self.runs:
            if run.name == name:
                return run
        raise KeyError(name)

    @property
    def figures(self) -> list[str]:
        """The figures that at least one run has, in order."""
        return [name for name in FIGURES if any(name in run.figures for run in self.runs)]

    @property
    def telling(self) -> list[str]:
        """The figures that are not the same for all runs; if all are, all of them."""
        others = [run for run in self.runs if run.name != self.against]
        return [
            figure for figure in self.figures if any(run.verdict(figure) != SAME for run in others)
        ] or self.figures

    def heading(self, figure: str) -> str:
        """A figure in a few words."""
        return HEADINGS[figure] + (f" to recall {self.upto:g}" if figure == "area" else "")

    @property
    def how(self) -> str:
        """How the runs were compared, in a sentence."""
        if not self.paired:
            each = ", ".join(map(str, self.queries))
            return f"Other queries each ({each}), compared as a whole with {self.against}."
        by = "numbers" if self.judged[0].queries is None else "names"
        count = plural(self.queries[0], "query", "queries")
        return f"The same {count}, by their {by}, compared query by query with {self.against}."

    @property
    def notes(self) -> list[str]:
        """What is missing of which run, and how to have it."""
        old = [each.name for each in self.judged if each.single is None]
        if not old or len(old) == len(self.judged):
            return []
        return [f"no figures of trust for {', '.join(old)}: its single matches are not known"]

    def rows(self) -> list[tuple[Any, ...]]:
        """The rows of ``to_csv``; None for an empty cell."""
        found: list[tuple[Any, ...]] = []
        for run in self.runs:
            for figure in self.figures:
                numbers = *_ends(run.figures, figure), *_ends(run.differences, figure)
                said = BASELINE if run.name == self.against else run.verdict(figure)
                found.append((run.name, figure, *numbers, said or None))
        return found

    def to_csv(self, path: str | Path, spreadsheet: bool = False) -> None:
        """Writes a row for each figure of each run, with the columns run, figure, value, low, high,
        difference, difference_low, difference_high and verdict. Numbers have all their digits. For
        a ``spreadsheet``, a name that would be a formula there gets a ``'`` before it.

        Raises
        ------
        SurefixFileError
            If the file cannot be written; an older one is then as it was.
        """
        write_whole(Path(path), self.csv(spreadsheet))

    def csv(self, spreadsheet: bool = False) -> str:
        """The same as a text."""
        file = io.StringIO()
        write = row_writer(file, spreadsheet)
        for row in (COLUMNS, *self.rows()):
            write(row)
        return file.getvalue()

    def json(self) -> str:
        """The rows as JSON, with how they were compared."""
        rows = [dict(zip(COLUMNS, row, strict=True)) for row in self.rows()]
        about = {"against": self.against, "paired": self.paired, "queries": [*self.queries]}
        about |= {"upto": self.upto, "recall": self.recall, "rows": rows}
        return json.dumps(about, indent=1, allow_nan=False) + "\n"

    def table(self) -> tuple[list[str], list[list[str]]]:
        """The headings and the rows of a table of the values."""
        header = ["run", *map(self.heading, self.figures)]
        return header, [[run.name, *(_value(run, f) for f in self.figures)] for run in self.runs]

    def differences(self) -> tuple[list[str], list[list[str]]]:
        """The headings and the rows of a table of the differences to the baseline; without figures
        that are the same for all, as those of trust are for methods on the same distances.
        """
        header = ["run", "figure", f"difference to {self.against}", "95 % interval", "verdict"]
        rows = [
            [run.name, self.heading(figure), *signed(run.differences[figure]), run.verdict(figure)]
            for run in self.runs
            for figure in self.telling
            if run.verdict(figure)
        ]
        return header, rows

    def lines(self) -> list[tuple[str, str]]:
        """The differences in plain columns, a block for each run; and the verdict of each line,
        empty of a heading.
        """
        found: list[tuple[str, str]] = []
        _, rows = self.differences()
        table: list[list[str]] = []
        for run in self.runs:
            own = [[f"  {row[1]}", *row[2:]] for row in rows if row[0] == run.name]
            heading = [f"{run.name} against {self.against}", "difference", "95 % interval", ""]
            table += [heading, *own] if own else []
        for line, row in zip(columns(table) if table else [], table, strict=True):
            # A line between two blocks.
            found += [("", "")] if found and not row[-1] else []
            found.append((line, row[-1]))
        return found

    def __str__(self) -> str:
        """Both tables in plain columns."""
        header, rows = self.table()
        parts = [[self.how], columns([header, *rows]), [line for line, _ in self.lines()]]
        return "\n\n".join("\n".join(lines) for lines in parts if lines)

    def markdown(self) -> str:
        """Both tables in Markdown."""
        parts = [self.how]
        for header, rows in (self.table(), self.differences()):
            lines = [header, ["---"] * len(header), *rows]
            # A name may hold a bar, or a line's end.
            cells = [[cell.replace("|", "\\|").split() for cell in line] for line in lines]
            lines = [[" ".join(words) for words in line] for line in cells]
            parts.append("\n".join(f"| {' | '.join(line)} |" for line in lines))
        return "\n\n".join(parts) + "\n"

    def _repr_html_(self) -> str:
        parts = [f"<p>{escaped(self.how)}</p>"]
        for header, rows in (self.table(), self.differences()):
            head = "".join(f"<th>{escaped(cell)}</th>" for cell in header)
            body = "".join(
                f"<tr>{''.join(f'<td>{escaped(cell)}</td>' for cell in row)}</tr>" for row in rows
            )
            parts.append(f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>")
        return "".join(parts)


def _ends(estimates: Estimates, figure: str) -> tuple[float | None, float | None, float | None]:
    found = estimates.get(figure)
    if found is None or math.isnan(found):
        return None, None, None
    return float(found), found.low, found.high


def _value(run: Compared, figure: str) -> str:
    found = run.figures.get(figure)
    return "-" if found is None or math.isnan(found) else f"{float(found):.3f}"


def signed(estimate: Estimate) -> tuple[str, str]:
    """A difference and its interval, to three decimals."""
    return f"{float(estimate):+.3f}", f"{estimate.low:+.3f} to {estimate.high:+.3f}"


def write_whole(path: Path, text: str) -> None:
    """Writes a file of a comparison; an older one stays whole until then.

    Raises
    ------
    SurefixFileError
        If it cannot be written.
    """
    save(path, text, "cannot write the comparison")
