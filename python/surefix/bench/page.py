"""The folder that ``surefix bench --out`` writes: Markdown and CSV, and with matplotlib a picture
and a page.
"""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from surefix.bench.document import markdown
from surefix.bench.line import Result, Skipped
from surefix.bench.table import HEADER, LIMITS, TITLES, cells, limit_cells, missed, slower, wrong

__all__ = ["COLUMNS", "write_folder", "write_picture"]

COLUMNS = (
    "group",
    "work",
    "rival",
    "surefix_s",
    "rival_s",
    "ratio",
    "least_ratio",
    "bytes",
    "limit_s",
    "problem",
)


def write_folder(
    folder: Path,
    results: Sequence[Result | Skipped],
    facts: Sequence[tuple[str, str]],
    missing: Sequence[str],
    command: str,
) -> list[Path]:
    """Writes all that can be written here; returns the files.

    Raises
    ------
    OSError
        Where one cannot be written.
    """
    made = [folder / "bench.csv"]
    made[0].write_text(_csv(results), encoding="utf-8", newline="")
    shown = write_picture(folder / "speed.png", results)
    made += [folder / "speed.png"] if shown else []
    text = markdown(results, facts, missing, "speed.png" if shown else None)
    made.append(folder / "bench.md")
    made[-1].write_text(f"# How fast it is\n\nMade by `{command}`.\n\n{text}", encoding="utf-8")
    if shown:
        made.append(folder / "bench.html")
        made[-1].write_text(_html(results, facts, missing, command), encoding="utf-8")
    return made


def write_picture(file: Path, results: Sequence[Result | Skipped]) -> bool:
    """Writes the picture, where matplotlib is installed and there is something to show."""
    measured = [result for result in results if isinstance(result, Result)]
    try:
        from surefix.bench.picture import picture
    except ModuleNotFoundError:
        return False
    if not measured:
        return False
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(picture(measured).light)
    return True


def _csv(results: Sequence[Result | Skipped]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for result in results:
        if isinstance(result, Skipped):
            writer.writerow((result.group, result.work, *[""] * 7, f"not measured: {result.why}"))
            continue
        for row in result.rows:
            least = row.rival.reach.least if row.rival.reach else ""
            numbers = row.ours, row.theirs, row.ratio, least, row.line.read, result.limit
            writer.writerow((row.line.group, row.line.work, row.rival.name, *numbers, row.problem))
    return text.getvalue()


def _html(
    results: Sequence[Result | Skipped],
    facts: Sequence[tuple[str, str]],
    missing: Sequence[str],
    command: str,
) -> str:
    from surefix.bench.picture import picture
    from surefix.report.page import Section, Table, Tile, page

    measured = [result for result in results if isinstance(result, Result)]
    rows = [row for result in measured for row in result.rows]
    asked = [row for row in rows if row.met is not None]
    sections = [Section("Beside the rivals", (), (picture(measured),))]
    for group, title in TITLES.items():
        of_group = [row for row in rows if row.line.group == group]
        skipped = [
            f"Not measured: {r.work}: {r.why}."
            for r in results
            if isinstance(r, Skipped) and r.group == group
        ]
        if of_group or skipped:
            table = Table(str(group), "Medians; the ratio says how many times faster surefix is.", HEADER,
                          [cells(row) for row in of_group])  # fmt: skip
            sections.append(Section(title, (), tables=(table,) if of_group else (), points=skipped))
    limits = Table("limits", "What plain code reads here in the fastest round is the limit.", LIMITS,
                   list(map(limit_cells, measured)))  # fmt: skip
    sections += [
        Section("Beside the memory", (), tables=(limits,)),
        Section("Where surefix is slower", () if any(slower(results)) else ("Than none of these.",),
                points=list(slower(results))),
        Section("What is not reached", () if any(missed(results)) else ("All that was to be reached is.",),
                points=list(missed(results))),
    ]  # fmt: skip
    if problems := list(wrong(results)):
        sections.append(Section("Answers that differ", (), points=problems))
    if missing:
        sections.append(Section("Rivals that were not here", (), points=missing))
    sections.append(Section("Made", (), rows=[*facts, ("by", command)]))
    tiles = (
        Tile(
            "reached",
            f"{sum(row.met is True for row in asked)} of {len(asked)}",
            "figures are reached",
        ),
        Tile(
            "slower",
            str(len(list(slower(results)))),
            "rivals are faster",
            f"of {len(rows)} comparisons",
        ),
        Tile("differ", str(len(problems)), "answers differ"),
    )
    lead = (
        "surefix and its rivals side by side in one process, by turns, medians, every answer checked.",
    )
    return page("How fast it is", lead, (), tiles, sections)
