"""``surefix compare``: runs, methods or descriptors in one table, with intervals."""

import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from surefix import Comparison
from surefix._extra import drawing
from surefix._ray import mapped
from surefix._terminal import Console, say
from surefix._words import plain
from surefix.baselines import METHODS
from surefix.cli import inputs
from surefix.cli.flags import documented, with_options, with_ray
from surefix.cli.inputs import check_not_read, refuse
from surefix.cli.judging import Judging, TruthOptions
from surefix.cli.networks import Model, ModelOptions, Weights
from surefix.cli.where import GAP, PositionGap
from surefix.comparing import SAMPLES, UPTO, compare_judged
from surefix.comparison import SAME, UNSURE, write_whole
from surefix.errors import check_folder
from surefix.judged import Judged
from surefix.study.study import Recall
from surefix.tables.reports import chosen, is_report, labels, read_report

WRITTEN = (".csv", ".html", ".json", ".md")
FIXES = (".csv", ".jsonl", ".ndjson")


@with_ray
@documented
@with_options(floor="global", names={"tolerance": "agreement"})
def compare_(
    runs: list[str],
    against: str | None = None,
    method: list[str] | None = None,
    out: Annotated[Path | None, typer.Option("--out", "-o")] = None,
    unpaired: bool = False,
    truth: str | None = None,
    positions: Path | None = None,
    query_positions: str | None = None,
    position_gap: PositionGap = GAP,
    tolerance: Annotated[float | None, typer.Option(min=0)] = None,
    queries: list[str] | None = None,
    recall: Recall | None = None,
    upto: Annotated[float, typer.Option(min=0.001, max=1)] = UPTO,
    samples: Annotated[int, typer.Option(min=10, max=1_000_000)] = SAMPLES,
    similarity: bool = False,
    model: Model = None,
    weights: Weights = None,
    *,
    options: dict[str, Any],
    topic: inputs.Topic = None,
    stride: inputs.Stride = 1,
    every: inputs.Every = None,
    metres: inputs.Metres = None,
    odometry: inputs.Odometry = None,
    order: inputs.Order = "name",
    strict: inputs.Strict = False,
    crop: inputs.Crop = False,
    spreadsheet: inputs.Spreadsheet = False,
) -> None:
    """Compare runs, methods or descriptors: one table, with intervals of each difference.

    Parameters
    ----------
    runs: Folders that `surefix eval -o` wrote; fixes of `surefix run -o`, .csv or .jsonl, with a
        --truth; maps, or .npy of distances, with a --truth, and maps with --queries. A path may
        have a name before it: NAME=PATH.
    against: The baseline, by its name in the table; the first one by default.
    method: The method, once each. Of one report, all by default; of several, weighted; of maps and
        distances, weighted.
    out: The file to write: .csv, .html, .json or .md. Without, a table on a terminal, and CSV in a
        pipe.
    unpaired: The runs are of different queries, such as another day's: compare them as a whole.
    truth: Of fixes, maps and distances: where each query was, as for `surefix eval`.
    positions: In place of --truth: metres of each place, as for `surefix eval`.
    query_positions: In place of --truth: those of each query, as for `surefix eval`.
    tolerance: The greatest distance from the truth of a right match: in places, 1 by default; with
        positions in metres.
    queries: Of maps: the drive, as for `surefix eval`; or once for each map, as for maps of ready
        descriptors.
    recall: The queries that recall is a share of: correct by default; of reports their own.
    upto: Areas are up to this recall.
    samples: Bootstrap samples.
    similarity: The .npy hold similarities s: the distances are 1 - s.
    """
    refuse(out is not None and out.suffix not in WRITTEN, f"--out: {_expected(out)}")
    expected = "RUNS: expected two or more to compare, or one report of several methods"
    names, runs = _named(runs)
    kinds = [_kind(run) for run in runs]
    refuse(len(runs) == 1 and kinds != ["report"], f"{expected}, got {runs[0]}")
    others = [run for run, kind in zip(runs, kinds, strict=True) if kind != "report"]
    reading = [*others, truth, positions, query_positions, odometry, *(queries or ())]
    reading += [model, weights]
    if out is not None:
        check_not_read(out, reading)
        check_folder(out, "cannot write the comparison")
    by_position = query_positions is not None
    given = truth is not None or by_position or positions is not None
    refuse(not others and given, "--truth: expected none with reports, which hold their own")
    neither = truth is None and not by_position
    expected = f"expected it, or --query-positions, to judge {', '.join(others[:3])}; got neither"
    refuse(bool(others) and neither, f"--truth: {expected}")
    both = truth is not None and (by_position or positions is not None)
    refuse(both, "--truth: expected it or positions, got both")
    expected = "--tolerance: expected how many metres from the truth are right, got none"
    refuse(by_position and tolerance is None, expected)
    _check_methods(kinds, method or ())
    _check_queries(runs, kinds, queries or ())
    write_page = _writer() if out is not None and out.suffix == ".html" else None
    where = TruthOptions(truth, positions, query_positions, tolerance, position_gap)
    sampling: dict[str, Any] = {"topic": topic, "stride": stride, "every": every}
    sampling |= {"metres": metres, "odometry": odometry}
    sampling |= {"order": order, "strict": strict, "crop": crop}
    named = ModelOptions(model, weights)
    make = Judging(where, recall or "correct", method or ("weighted",), options, named, similarity)

    places = iter((queries or []) * (kinds.count("map") if len(queries or ()) == 1 else 1))
    jobs = [
        (run, kind, next(places) if kind == "map" else None, sampling)
        for run, kind in zip(runs, kinds, strict=True)
    ]
    reports = dict(zip(names, mapped(_judged, make, jobs), strict=True))
    judged = chosen(reports, method or ())
    known = [each.name for each in judged]
    against = None if against is None else plain(against)
    unknown = against is not None and against not in known
    refuse(unknown, f"--against: expected one of {', '.join(known)}, got {against!r}")
    console = Console(stderr=True, force_terminal=sys.stderr.isatty())
    with console.status("Drawing the queries anew"):
        comparison = compare_judged(judged, against, not unpaired, recall, upto, samples)
    for note in comparison.notes:
        say(f"Note: {note}", file=sys.stderr)
    if out is None and not sys.stdout.isatty():
        sys.stdout.write(comparison.csv(spreadsheet))
        return
    if sys.stdout.isatty():
        _print(comparison)
    if out is not None:
        if write_page is not None:
            write_page(comparison, out)
        else:
            texts: dict[str, Callable[[], str]] = {
                ".csv": partial(comparison.csv, spreadsheet),
                ".json": comparison.json,
                ".md": comparison.markdown,
            }
            write_whole(out, texts[out.suffix]())
        say(f"Made {out}: {len(comparison)} runs against {comparison.against}")


def _named(runs: Sequence[str]) -> tuple[list[str], list[str]]:
    """The names of the runs, and their paths."""
    given, paths = [], []
    for run in runs:
        name, equals, path = run.partition("=")
        named = bool(name and equals) and not Path(run).exists()
        # Of a report's table, the folder.
        place = Path(path if named else run)
        report = place.is_file() and is_report(place)
        paths.append(str(place.parent if report else place))
        given.append(name if named else "")
    # They stand in tables and pictures.
    names = [plain(name or short) for name, short in zip(given, labels(paths), strict=True)]
    for name in names:
        expected = "RUNS: expected a name each, as NAME=PATH,"
        refuse(names.count(name) > 1, f"{expected} got {name} twice")
    return names, paths


def _judged(make: Judging, job: tuple[str, str, str | None, dict[str, Any]]) -> Sequence[Judged]:
    """What a run is compared by."""
    run, kind, drive, sampling = job
    if kind == "report":
        return read_report(Path(run))
    return [make.fixes(run)] if kind == "fixes" else make.drive(run, drive, sampling)


def _kind(run: str) -> str:
    """What an argument is: report, fixes, distances or map."""
    path = Path(run)
    if not path.exists():
        expected = "expected the folder of a report, fixes, a map or a .npy of distances"
        raise typer.BadParameter(f"RUNS: {run}: {expected}, got nothing there")
    if is_report(path):
        return "report"
    if path.suffix.lower() in FIXES:
        return "fixes"
    return "distances" if path.suffix == ".npy" else "map"


def _check_methods(kinds: Sequence[str], methods: Sequence[str]) -> None:
    made = [kind for kind in kinds if kind in ("map", "distances")]
    for name in methods if made else ():
        expected = f"--method: expected one of {', '.join(METHODS)}, got {name!r}"
        refuse(name not in METHODS, expected)
        needs = METHODS[name].needs
        expected = "expected one that needs the distances alone; compare reports of surefix eval"
        refuse(needs not in (None, "truth"), f"--method {name}: {expected}")


def _check_queries(runs: Sequence[str], kinds: Sequence[str], queries: Sequence[str]) -> None:
    maps = [run for run, kind in zip(runs, kinds, strict=True) if kind == "map"]
    refuse(bool(queries) and not maps, "--queries: expected maps to match them to, got none")
    expected = f"--queries: expected the drive to match to {', '.join(maps[:3])}, got none"
    refuse(bool(maps) and not queries, expected)
    expected = f"--queries: expected it once, or once for each of {len(maps)} maps"
    refuse(len(queries) not in (0, 1, len(maps)), f"{expected}, got {len(queries)}")


def _expected(out: Path | None) -> str:
    return f"expected a name that ends in {', '.join(WRITTEN[:-1])} or {WRITTEN[-1]}, got {out}"


def _writer() -> Any:
    """What writes the page."""
    drawing("a page")
    # Not at the top: matplotlib is an extra, and slow to import.
    from surefix.report.compare import write_page

    return write_page


def _print(comparison: Comparison) -> None:
    """Both tables; better and worse stand out."""
    console = Console()
    header, rows = comparison.table()
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for name in header:
        table.add_column(name, header_style="bold", overflow="fold")
    for row in rows:
        table.add_row(*row)
    console.print(comparison.how)
    console.print()
    console.print(table)
    console.print()
    for line, said in comparison.lines():
        style = {UNSURE: "dim", SAME: "dim"}.get(said, "bold")
        console.print(line, style=style, soft_wrap=True)
