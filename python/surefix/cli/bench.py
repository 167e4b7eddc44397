"""``surefix bench``: how fast it is here, beside the rivals that are installed; and how evenly it
takes its time.
"""

import shlex
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from surefix import SurefixFileError
from surefix._core import bench_image_latency, bench_latency
from surefix.bench import Group, Result, Rivals, Settings, Skipped, run
from surefix.machine import machine

__all__ = ["bench", "latency"]

QUANTILES = (0.5, 0.99, 0.999, 1.0)
# Fewer images: each takes as long as many pushes of distances.
PUSHES, IMAGES = 1_000_000, 20_000


def bench(
    context: typer.Context,
    only: Annotated[
        list[Group] | None,
        typer.Option("--only", help="Only the lines of this group. May be given again."),
    ] = None,
    quick: Annotated[
        bool,
        typer.Option(
            "--quick",
            help="Small sizes and few rounds: to see that it works and that answers agree.",
        ),
    ] = False,
    threads: Annotated[
        int,
        typer.Option("--threads", min=1, help="How many threads surefix and its rivals may use."),
    ] = 1,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            help="A folder to write: tables as Markdown and CSV, a page and a picture.",
        ),
    ] = None,
    docs: Annotated[
        Path | None,
        typer.Option(
            "--docs", help="A Markdown page to renew, between its two marks, with its picture."
        ),
    ] = None,
) -> None:
    """Measure how fast it is here, side by side with the rivals that are installed, every answer
    checked.
    """
    if context.invoked_subcommand is not None:
        return
    from surefix.bench.facts import facts
    from surefix.bench.table import missed, slower, wrong

    rivals, settings = Rivals.find(), Settings(quick, threads)
    about = facts(settings, rivals)
    for name, value in about:
        print(f"{name}: {value}")
    for sentence in rivals.missing:
        print(sentence)
    if (out or docs) and find_spec("matplotlib") is None:
        print(
            "matplotlib is not installed, so tables are written and no picture: pip install 'surefix[plot]'"
        )
    # Before the minutes that it takes.
    _make_folder(out)
    results: list[Result | Skipped] = []
    with Console(stderr=True, force_terminal=sys.stderr.isatty()).status("") as status:
        for result in run(settings, rivals, only or [], status.update):
            results.append(result)
    _print_table(results)
    for sentence in missed(results):
        print(f"Not reached: {sentence}")
    problems = list(wrong(results))
    print(
        f"{len(list(missed(results)))} figures not reached, {len(list(slower(results)))} rivals faster, "
        f"{len(problems)} answers differ"
    )
    for sentence in problems:
        print(f"surefix: answers differ: {sentence}", file=sys.stderr)
    _write(results, about, rivals, out, docs)
    if problems:
        raise typer.Exit(1)


def _print_table(results: list[Result | Skipped]) -> None:
    from surefix.bench.table import HEADER, cells, limit_cells

    table = Table(box=None, header_style="dim", padding=(0, 2, 0, 0))
    for name in (*HEADER[:-1], "of limit", HEADER[-1]):
        numbers = name in ("surefix", "its time", "ratio", "of limit")
        # On a narrow terminal words are wrapped, numbers are not.
        table.add_column(name, justify="right" if numbers else "left", no_wrap=numbers or not name)
    styles = {"met": "green", "MISSED": "yellow", "ERROR": "bold red"}
    for result in results:
        if isinstance(result, Skipped):
            table.add_row(Text(result.work), "", Text(f"not measured: {result.why}", "dim"))
            continue
        for index, row in enumerate(result.rows):
            work, ours, *rest, verdict = cells(row)
            first = (Text(work), ours) if index == 0 else ("", "")
            share = limit_cells(result)[-1] if index == 0 else ""
            table.add_row(*first, *map(Text, rest), share, Text(verdict, styles.get(verdict, "")))
    # In a pipe a line is as long as it is.
    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=240)
    console.print(table)


def _make_folder(out: Path | None) -> None:
    try:
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SurefixFileError(
            f"{out}: cannot make the output folder: {error.strerror or error}"
        ) from None


def _write(
    results: list[Result | Skipped], about: Sequence[tuple[str, str]], rivals: Rivals, out: Path | None,
    docs: Path | None,
) -> None:  # fmt: skip
    from surefix.bench.document import markdown, replace_part
    from surefix.bench.page import write_folder, write_picture

    if docs is not None:
        image = Path("images") / f"{docs.stem}.png"
        shown = write_picture(docs.parent / image, results)
        replace_part(
            docs, markdown(results, about, rivals.missing, image.as_posix() if shown else None)
        )
        print(f"Renewed {docs}")
    if out is not None:
        try:
            made = write_folder(
                out, results, about, rivals.missing, shlex.join(["surefix", *sys.argv[1:]])
            )
        except OSError as error:
            raise SurefixFileError(
                f"{out}: cannot write the results: {error.strerror or error}"
            ) from None
        print(f"Made {', '.join(str(file) for file in made)}")


def latency(
    places: Annotated[int, typer.Option("--places", "-n", min=2, help="Places on the map.")] = 1800,
    sequence_length: Annotated[
        int, typer.Option("--sequence-length", "-L", min=1, help="Queries a sequence.")
    ] = 2,
    pushes: Annotated[
        int | None,
        typer.Option(
            min=1, help=f"How many pushes: by default {PUSHES:,}, and {IMAGES:,} with --image."
        ),
    ] = None,
    image: Annotated[
        bool,
        typer.Option(
            "--image", help="Push 640 x 480 RGB images on a SAD map in place of distances."
        ),
    ] = False,
) -> None:
    """Time pushes one by one in Rust, and count what they allocate, which must be nothing."""
    count = pushes or (IMAGES if image else PUSHES)
    what = "images, 640 x 480 RGB" if image else "distances"
    print(
        f"{count:,} pushes of {what}, n = {places:,}, L = {sequence_length}, one by one in Rust, on {machine()}"
    )
    measure = bench_image_latency if image else bench_latency
    with Console(stderr=True, force_terminal=sys.stderr.isatty()).status("Pushing"):
        took, allocations = measure(places, sequence_length, count)
    for quantile, nanoseconds in zip(QUANTILES, np.quantile(took, QUANTILES), strict=True):
        name = "max" if quantile == 1 else f"p{100 * quantile:g}"
        print(f"{name:<12}{nanoseconds / 1000:>10.2f} us{nanoseconds / places:>10.2f} ns a place")
    print(f"allocations {allocations:>10,}")
    if allocations:
        print("surefix: expected no allocation in a push", file=sys.stderr)
        raise typer.Exit(1)
