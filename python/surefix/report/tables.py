"""The numbers of a study as tables: on the page, and as CSV."""

from collections.abc import Iterable, Sequence
from itertools import chain
from pathlib import Path
from typing import TypeAlias

import numpy as np

from surefix._words import plural
from surefix.baselines.distances import Floats
from surefix.report.page import Table
from surefix.study import BASELINE, KS, SCENARIOS, UPTO, Result, Study
from surefix.tables.csv_rows import row_writer

__all__ = [
    "MISTAKES",
    "Names",
    "areas",
    "count",
    "drive",
    "every",
    "methods",
    "named",
    "worst",
    "write_csv",
    "write_drives",
    "write_tables",
]

# How many of the worst mistakes of each kind are shown.
MISTAKES = 6

Names = Sequence[str] | None
Events: TypeAlias = tuple[float | None, int | None, int | None]

METHOD_COLUMNS = (
    "method,recall_convention,auc,auc_low,auc_high,difference,difference_low,difference_high,"
    "verdict,max_recall,recall_at_full_precision,false_positives,best_f1,best_f1_threshold,"
    "correct,judged"
)
DRIVE_COLUMNS = (
    "scenario,method,area,recall_at_full_precision,right,calibration_error,off_map_roc,"
    "frames_to_notice,noticed,left,frames_to_relocalise,relocalised,lost"
)
FIX_COLUMNS = (
    "method,query,name,place,score,ready,accepted,judged,right,true_place,trusted,single_right,"
    "confidence,off_map"
)


def methods(study: Study) -> Table:
    """Every method, none left out."""
    percent = f"{100 * UPTO:g} %"
    header = (
        "method", f"AUC to {percent} recall (95 % interval)",
        "difference to the plain sequence (95 % interval)", "verdict", "largest recall",
        "recall at 100 % precision", f"false positives at {percent} recall", "best F1",
        "matches right",
    )  # fmt: skip
    # Not broken into two lines.
    interval = "({:.3f}\u00a0to\u00a0{:.3f})"
    signed = "({:+.3f}\u00a0to\u00a0{:+.3f})"
    rows = []
    for result in study.results:
        (area, *ends), (difference, *apart) = result.area, result.difference
        curve, plain = result.curve, result is study.baseline
        row = (
            result.name,
            f"{area:.3f} {interval.format(*ends)}",
            "-" if plain else f"{difference:+.3f} {signed.format(*apart)}",
            "the baseline" if plain else result.outcome,
            f"{curve.max_recall:.3f}",
            f"{curve.recall_at_precision(1.0):.3f}",
            count(curve.false_positives_at(UPTO)),
            f"{curve.best_f1:.3f}",
            f"{curve.correct} of {curve.judged}",
        )
        rows.append(row)
    caption = f'Recall is "{study.recall}". The plain sequence is the method "{BASELINE}".'
    return Table("methods", caption, header, rows)


def drive(study: Study) -> Table:
    """Every method on one drive: how good, how honest, and how soon it notices and finds back."""
    header = (
        "method", "area to 100 % recall", "recall at 100 % precision", "right", "confidence off by",
        "off-map ROC area", "frames to notice", "frames to find back",
    )  # fmt: skip
    rows = [
        (name, *map(_shown, numbers), *map(_said, events))
        for name, numbers, events in map(_tracked, study.results)
    ]
    # Columns that say nothing are left out, as of a drive that never leaves the map.
    columns = [each for each in zip(header, *rows, strict=True) if {*each[1:]} != {"-"}]
    header, *rows = zip(*columns, strict=True)
    what = SCENARIOS[study.scenario].description
    size = (
        f"{plural(len(study), 'query', 'queries')}, {int(study.off_map.sum())} of them off the map"
    )
    return Table(f"drive-{stem(study)}", f"{study.scenario}: {what}; {size}", header, rows)


def areas(studies: Sequence[Study]) -> Floats:
    """The areas to recall 1, (drives, methods)."""
    return np.array([[each.curve.auc(1.0) for each in study.results] for study in studies])


def every(studies: Sequence[Study]) -> Table:
    """Every method on every drive, a number each."""
    rows = [
        (result.name, *map(_shown, (*own, np.mean(own))))
        for result, own in zip(studies[0].results, areas(studies).T, strict=True)
    ]
    header = ("method", *(study.scenario.replace("-", " ") for study in studies), "mean")
    return Table("drives", "Area to 100 % recall, drive by drive.", header, rows)


def stem(study: Study) -> str:
    """The scenario's name as part of a file's."""
    return study.scenario.replace("/", "-")


def _tracked(result: Result) -> tuple[str, list[float | None], list[Events]]:
    """The method, its numbers, and its events of both kinds."""
    diagram, curve = result.reliability, result.curve
    error = None if diagram is None else diagram.error
    quality = curve.auc(1.0), curve.recall_at_precision(1.0), result.right_share, error
    events = [_events(frames) for frames in (result.noticed, result.relocalised)]
    return result.name, [*quality, result.off_map_area], events


def _events(frames: Floats | None) -> Events:
    """The median, infinity for never; how many ended; and how many there were."""
    if frames is None or not len(frames):
        return None, None, None
    return float(np.median(frames)), int(np.isfinite(frames).sum()), len(frames)


def _shown(number: float | None) -> str:
    return "-" if number is None or np.isnan(number) else f"{number:.3f}"


def _said(events: Events) -> str:
    median, ended, every = events
    if median is None:
        return "-"
    share = f"{ended} of {every}"
    return f"{median:g} ({share})" if median < np.inf else share


def write_drives(drives: Sequence[Study], folder: Path, spreadsheet: bool = False) -> None:
    """Writes scenarios.csv and reliability.csv."""
    lines: list[Sequence[object]] = []
    bins: list[Sequence[object]] = []
    for study in drives:
        for result in study.results:
            name, numbers, events = _tracked(result)
            lines.append((study.scenario, name, *numbers, *chain(*events)))
            if (r := result.reliability) is not None:
                points = zip(r.count, r.said, r.right, strict=True)
                bins += [(study.scenario, name, *point) for point in points]
    write_csv(folder / "scenarios.csv", DRIVE_COLUMNS, lines, spreadsheet)
    header = "scenario,method,queries,said,right"
    write_csv(folder / "reliability.csv", header, bins, spreadsheet)


def count(false: int | None) -> str:
    """False positives at a recall that may never be reached."""
    return "never there" if false is None else str(false)


def worst(study: Study, names: Names, places: Names, most: int) -> Sequence[Table]:
    """The mistakes with the best scores, and the trusted ones."""
    shown, run = study.shown, study.run
    header = ("query", "matched to place", "true place", "off by", "score", "trusted")
    found = []
    for name, caption, queries, place, score in (
        (
            "mistakes",
            f"Wrong matches of {shown.name}, the best scores first.",
            study.mistakes(most),
            shown.matches.place,
            shown.matches.score,
        ),
        (
            "trusted-mistakes",
            "Single matches that are trusted and wrong, the nearest first; those above are not "
            "repeated.",
            study.trusted_mistakes(most),
            run.single_place,
            run.single_distance,
        ),
    ):
        rows = [
            (
                named(query, names),
                named(int(place[query]), places),
                "none" if study.true_place[query] < 0 else named(study.true_place[query], places),
                study.off(query, int(place[query])).removesuffix(" off"),
                f"{score[query]:.4g}",
                "yes" if run.trusted[query] else "no",
            )
            for query in queries
        ]
        if rows:
            method = shown.name if name == "mistakes" else "single"
            shows = [(method, query) for query in queries]
            found.append(Table(name, caption, header, rows, shows=shows))
    return found


def named(index: int, names: Names) -> str:
    """The index of a query or a place, and its name if it has another."""
    name = "" if names is None or names[index] == str(index) else f" ({names[index]})"
    return f"{index}{name}"


def write_tables(
    study: Study,
    folder: Path,
    names: Names,
    drive: str | None = None,
    spreadsheet: bool = False,
) -> None:
    """Writes methods.csv, drive.csv, curves.csv and fixes.csv; ``drive`` is its mark."""
    write_csv(folder / "methods.csv", METHOD_COLUMNS, map(_numbers, study.results), spreadsheet)
    t = study.trust
    quantities = {f"recall_at_{k}": at for k, at in zip(KS, study.recalls_at, strict=False)} | {
        "trusted_right": t.true_positives,
        "trusted_wrong": t.false_positives,
        "untrusted_right": t.false_negatives,
        "untrusted_wrong": t.true_negatives,
        "trust_precision": t.precision,
        "trust_recall": t.recall,
        "share_trusted": t.share_trusted,
    }
    marked: dict[str, object] = {} if drive is None else {"drive": drive}
    write_csv(folder / "drive.csv", "quantity,value", (quantities | marked).items())
    points: list[Sequence[object]] = []
    for result in study.results:
        c = result.curve
        columns = c.thresholds, c.recall, c.precision, c.false_positives
        points += [(result.name, *point) for point in zip(*columns, strict=True)]
    header = "method,threshold,recall,precision,false_positives"
    write_csv(folder / "curves.csv", header, points, spreadsheet)
    fixes = (fix for result in study.results for fix in _fixes(result, names))
    write_csv(folder / "fixes.csv", FIX_COLUMNS, fixes, spreadsheet)


def _numbers(result: Result) -> Sequence[object]:
    curve = result.curve
    threshold = curve.best_f1_threshold
    return (
        result.name,
        result.study.recall,
        *result.area,
        *result.difference,
        result.outcome,
        curve.max_recall,
        curve.recall_at_precision(1.0),
        curve.false_positives_at(UPTO),
        curve.best_f1,
        threshold if abs(threshold) < float("inf") else None,
        curve.correct,
        curve.judged,
    )


def _fixes(result: Result, names: Names) -> Iterable[Sequence[object]]:
    matches, study = result.matches, result.study
    flags = matches.ready, result.accepted, result.judged, result.right, study.run.trusted
    for query in range(len(study)):
        *four, trusted = ("true" if flag is not None and flag[query] else "false" for flag in flags)
        name = None if names is None else names[query]
        found = query, name, matches.place[query], matches.score[query]
        single = None
        if study.single_judged[query]:
            single = "true" if study.single_right[query] else "false"
        said = (None if p is None else p[query] for p in (matches.confidence, matches.off_map))
        yield result.name, *found, *four, study.true_place[query], trusted, single, *said


def write_csv(
    path: Path, header: str, rows: Iterable[Sequence[object]], spreadsheet: bool = False
) -> None:
    """A table as CSV below its first line, perhaps for a spreadsheet; numbers keep all their
    digits, None is an empty cell.
    """
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(f"{header}\n")
        write = row_writer(file, spreadsheet)
        for row in rows:
            write(row)
