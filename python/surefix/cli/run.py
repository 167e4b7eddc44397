"""``surefix run``: localize along a route, frame by frame, as a robot would."""

import sys
import time
from enum import StrEnum
from pathlib import Path
from typing import Annotated, TextIO

import numpy as np
import typer

from surefix import Localizer, Map, SurefixFileError, SurefixValueError
from surefix.cli.fixes import CsvFixes, FixRow, JsonFixes, LiveFixes
from surefix.cli.frames import Frames

__all__ = ["run"]


class Format(StrEnum):
    """How fixes are written."""

    csv = "csv"
    json = "json"


class Screen(StrEnum):
    """The numbers of a screen."""

    i8 = "i8"


class Gradient(StrEnum):
    """Which form of Eq. 1."""

    halved = "halved"
    unhalved = "unhalved"


def _floor(text: str) -> str | float:
    if text == "running":
        return text
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(f'--floor: expected "running" or a number, got {text!r}') from None


def _speeds(text: str) -> list[float]:
    try:
        return [float(speed) for speed in text.split(",")]
    except ValueError:
        raise typer.BadParameter(f"--speeds: expected numbers with commas, such as 0.9,1,1.1, got {text!r}") from None


def run(
    route: Annotated[Path, typer.Argument(help="The map, from `surefix map build`.")],
    queries: Annotated[
        str, typer.Argument(help="A folder of images, a pattern, or a .npy of images or of descriptors.")
    ],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Write the fixes to this file.")] = None,
    form: Annotated[
        Format | None,
        typer.Option("--format", help="A line a fix, as CSV or JSON; by the file's ending, else CSV."),
    ] = None,
    sequence_length: Annotated[
        int,
        typer.Option("--sequence-length", "-L", help="Queries a sequence, from 1 to the number of places."),
    ] = 2,
    weight: Annotated[
        float, typer.Option("--weight", "-w", help="How far a trusted match is drawn to the floor, 0 to 1.")
    ] = 0.99,
    tolerance: Annotated[int, typer.Option(help="Places between minimum and gradient peak of a trusted match.")] = 1,
    smoothing: Annotated[int, typer.Option(help="Gradients summed, 1 or more; 1 for queries in any order.")] = 3,
    gradient: Annotated[Gradient, typer.Option(help="Eq. 1 as printed, or as in the authors' code.")] = Gradient.halved,
    floor: Annotated[str, typer.Option(help='What trusted matches are drawn to: "running" or a number.')] = "running",
    speeds: Annotated[str, typer.Option(help="Slopes to try, in places a query.")] = "1.0",
    screen: Annotated[
        Screen | None,
        typer.Option(help="Scan a copy of float32 descriptors in bytes: faster on a large map, the same answers."),
    ] = None,
) -> None:
    """Localize along a route: a fix for each query, as it comes."""
    places = Map.open(route)
    frames = Frames(queries)
    try:
        localizer = Localizer(
            places.with_screen("i8") if screen else places,
            sequence_length=sequence_length,
            weight=weight,
            tolerance=tolerance,
            smoothing=smoothing,
            gradient=gradient.value,
            floor=_floor(floor),
            speeds=_speeds(speeds),
        )
    except SurefixValueError as error:
        raise typer.BadParameter(str(error)) from None
    if out is not None and (frames.holds(out) or (out.exists() and out.samefile(route))):
        raise typer.BadParameter(f"--out: {out} is what is read here; name another file")
    names = places.names
    rows: list[FixRow] = []
    file = None if out is None else _create(out)
    try:
        with _writer(file, _format(form, out), len(frames)) as writer:
            for query, frame in frames:
                start = time.perf_counter_ns()
                fix = localizer.push(frame)
                latency = (time.perf_counter_ns() - start) / 1000
                row = FixRow(query, fix, names[fix.place] if names else None, latency)
                writer.write(row)
                rows.append(row)
    finally:
        # What came before a frame that cannot be read is kept, and said.
        if file is not None:
            file.close()
        print(_summary(rows, out), file=sys.stderr)


def _create(out: Path) -> TextIO:
    try:
        return out.open("w", encoding="utf-8", newline="")
    except OSError as error:
        raise SurefixFileError(f"{out}: cannot write the fixes: {error.strerror}") from None


def _format(form: Format | None, out: Path | None) -> Format:
    if form is not None:
        return form
    return Format.json if out is not None and out.suffix in (".json", ".jsonl", ".ndjson") else Format.csv


def _writer(file: TextIO | None, form: Format, total: int) -> "CsvFixes | JsonFixes | LiveFixes":
    lines = CsvFixes if form is Format.csv else JsonFixes
    if sys.stdout.isatty():
        return LiveFixes(total, None if file is None else lines(file))
    if file is not None:
        return lines(file)
    return lines(sys.stdout)


def _summary(rows: list[FixRow], out: Path | None) -> str:
    if not rows:
        return "0 fixes: there were no queries"
    trusted = sum(row.fix.trusted for row in rows)
    p50, p99, p999 = np.percentile([row.latency_us for row in rows], (50, 99, 99.9))
    where = "" if out is None else f", in {out}"
    return (
        f"{len(rows)} fixes, {trusted} trusted ({trusted / len(rows):.0%}), "
        f"latency p50 {p50:.0f} us, p99 {p99:.0f} us, p99.9 {p999:.0f} us{where}"
    )
