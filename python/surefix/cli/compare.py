"""``surefix compare``: runs, methods or descriptors in one table, with intervals."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from surefix import Comparison, SurefixError, SurefixValueError, match_distances
from surefix.baselines import METHODS, Context, run_method
from surefix.cli import inputs
from surefix.cli.drives import distances_of, open_map, truth_without
from surefix.cli.flags import documented, with_options
from surefix.cli.inputs import check_not_read, refuse
from surefix.cli.networks import Model, ModelOptions, Weights
from surefix.cli.recorded import open_drive
from surefix.cli.where import (
    GAP,
    Places,
    PositionGap,
    Queries,
    Where,
    by_positions,
    by_truth,
)
from surefix.comparing import SAMPLES, UPTO, compare_judged
from surefix.comparison import SAME, UNSURE, write_whole
from surefix.errors import check_folder
from surefix.judged import Judged
from surefix.machine import room_for
from surefix.study.study import Recall
from surefix.tables.columns import is_held
from surefix.tables.npy import read_npy
from surefix.tables.positions import read_positions
from surefix.tables.reports import chosen, drive_of, is_report, labels, read_fixes, read_report
from surefix.tables.truth import KEYS

WRITTEN = (".csv", ".html", ".json", ".md")
FIXES = (".csv", ".jsonl", ".ndjson")
# More places than any map has: that of fixes is not known.
MANY = 1 << 31


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
    where = _Where(truth, positions, query_positions, tolerance, position_gap)
    sampling: dict[str, Any] = {"topic": topic, "stride": stride, "every": every}
    sampling |= {"metres": metres, "odometry": odometry}
    sampling |= {"order": order, "strict": strict, "crop": crop}
    named = ModelOptions(model, weights)
    make = _Maker(where, recall or "correct", method or ("weighted",), options, named, similarity)

    reports: dict[str, Sequence[Judged]] = {}
    places = iter((queries or []) * (kinds.count("map") if len(queries or ()) == 1 else 1))
    for name, run, kind in zip(names, runs, kinds, strict=True):
        if kind == "report":
            reports[name] = read_report(Path(run))
        elif kind == "fixes":
            reports[name] = [make.fixes(run)]
        else:
            drive = next(places) if kind == "map" else None
            reports[name] = make.drive(run, drive, sampling)
    judged = chosen(reports, method or ())
    known = [each.name for each in judged]
    unknown = against is not None and against not in known
    refuse(unknown, f"--against: expected one of {', '.join(known)}, got {against!r}")
    console = Console(stderr=True, force_terminal=sys.stderr.isatty())
    with console.status("Drawing the queries anew"):
        comparison = compare_judged(judged, against, not unpaired, recall, upto, samples)
    for note in comparison.notes:
        print(f"Note: {note}", file=sys.stderr)
    if out is None and not sys.stdout.isatty():
        sys.stdout.write(comparison.csv())
        return
    if sys.stdout.isatty():
        _print(comparison)
    if out is not None:
        if write_page is not None:
            write_page(comparison, out)
        else:
            texts = {".csv": comparison.csv, ".json": comparison.json, ".md": comparison.markdown}
            write_whole(out, texts[out.suffix]())
        print(f"Made {out}: {len(comparison)} runs against {comparison.against}")


@dataclass(frozen=True)
class _Where:
    """The truth of the options."""

    truth: str | None
    positions: Path | None
    query_positions: str | None
    tolerance: float | None
    gap: float

    def of(self, places: Places, queries: Queries) -> Where:
        if self.truth is not None:
            return by_truth(self.truth, places, queries, self.tolerance)
        assert self.query_positions is not None
        assert self.tolerance is not None
        paths = self.positions, self.query_positions
        return by_positions(*paths, places, queries, self.tolerance, self.gap)

    def places_of_fixes(self, queries: int) -> Places:
        """Those of a map that is not there: as many as the truth says."""
        if self.query_positions is not None:
            expected = "--positions: expected those of the places, as fixes have none"
            refuse(self.positions is None, expected)
            assert self.positions is not None
            return Places(len(read_positions(self.positions, role="places").values))
        path = Path(str(self.truth))
        if path.suffix.lower() in (".npy", ".npz"):
            array = read_npy(path, "the truth", keys=KEYS, objects=True)
            if array.ndim == 2 and array.shape[1] == queries and array.shape[0] > 2:
                return Places(len(array))
        return Places(MANY)


@dataclass(frozen=True, eq=False)
class _Maker:
    """Makes the matches of a file, judged."""

    where: _Where
    recall: Recall
    methods: Sequence[str]
    options: dict[str, Any]
    model: ModelOptions
    similarity: bool

    def fixes(self, file: str) -> Judged:
        """The fixes of a run."""
        read = read_fixes(Path(file))
        places = self.where.places_of_fixes(len(read.matches))
        at = self.where.of(places, Queries(len(read.matches), read.queries, read.times))
        how = (at.truth, at.tolerance, self.recall, read.queries, read)
        return Judged.by_truth("", read.matches, *how)

    def drive(self, route: str, queries: str | None, sampling: dict[str, Any]) -> list[Judged]:
        """The methods on a map and a drive, or on distances."""
        learned = queries is not None and open_map(route).descriptor is None
        model = self.model if learned else ModelOptions()
        drive = open_drive(route, queries, (), self.similarity, model, **sampling)
        count = len(drive.rows[0]) if drive.maps else drive.rows[0].shape[1]
        if not is_held(drive.places, count):
            size = f"{drive.places} x {count} distances, of {route}"
            room_for(2 * 4 * drive.places * count, size)
        mapped = Places.of(drive.maps[0]) if drive.maps else Places(drive.places)
        recorded = drive.numbers, drive.total
        driven = Queries(count + len(drive.bad), drive.seen, drive.times, drive.bag, *recorded)
        at = self.where.of(mapped, driven)
        truth = truth_without(at.truth, drive.bad)
        D = distances_of(drive.maps[0], drive.rows[0]) if drive.maps else drive.rows[0]
        segments = drive.maps[0].segments if drive.maps else None
        context = Context(truth=truth, truth_tolerance=at.tolerance, segments=segments)
        context = replace(context, positions=mapped.positions, **self.options)
        try:
            run = match_distances(D, **context.options)
        except SurefixValueError as error:
            if str(error).startswith("option"):
                raise typer.BadParameter(f"{route}: {error}") from None
            raise
        # Ready descriptors are other files for each map.
        mark = None if drive.queries is None else drive_of(drive.files)
        how = (truth, at.tolerance, self.recall, drive.queries, run, segments, mark)
        return [Judged.by_truth(name, run_method(name, D, context), *how) for name in self.methods]


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
    names = [name or short for name, short in zip(given, labels(paths), strict=True)]
    for name in names:
        expected = "RUNS: expected a name each, as NAME=PATH,"
        refuse(names.count(name) > 1, f"{expected} got {name} twice")
    return names, paths


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
    try:
        # Not at the top: matplotlib is an extra, and slow to import.
        from surefix.report.compare import write_page
    except ModuleNotFoundError as error:
        raise SurefixError(str(error)) from None
    return write_page


def _print(comparison: Comparison) -> None:
    """Both tables; better and worse stand out."""
    console = Console(highlight=False)
    header, rows = comparison.table()
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for name in header:
        table.add_column(name, header_style="bold", overflow="fold")
    for row in rows:
        table.add_row(*row)
    console.print(comparison.how, "\n", markup=False)
    console.print(table)
    console.print()
    for line, said in comparison.lines():
        style = {UNSURE: "dim", SAME: "dim"}.get(said, "bold")
        console.print(line, style=style, markup=False, soft_wrap=True)
