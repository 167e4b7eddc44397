"""``surefix study``: methods, settings, descriptors and routes, each with each, in one table."""

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from surefix import SurefixError
from surefix._progress import terminal_bar
from surefix._ray import completed
from surefix._terminal import say
from surefix._words import plural
from surefix.cli.audit import print_columns
from surefix.cli.evaluations import Asked, Job, evaluate, identity, make_ready, pair_of
from surefix.cli.flags import documented, with_ray
from surefix.errors import refusal
from surefix.judged import FIGURES
from surefix.study.plan import Evaluation, Plan
from surefix.study.plan_file import read_plan
from surefix.tables.results import Rows, write_table

# Lines of the table that is printed.
SHOWN = 20


@with_ray
@documented
def study_(file: Path, out: Annotated[Path, typer.Option("--out", "-o")] = Path("study")) -> None:
    """Evaluate methods with many settings, descriptors and routes: one table of figures.

    What was evaluated before is not evaluated again, unless its files or its settings are others:
    after an interruption, the same command goes on.

    Parameters
    ----------
    file: The study, a .toml.
    out: The folder to write: results.parquet, a row an evaluation, and what the next run goes on
        from.
    """
    plan = read_plan(file)
    for folder in (out / "rows", out / "ready"):
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise refusal(folder, "cannot make the folder", error) from None
    rows = Rows(out / "rows")
    pairs: dict[tuple[str, str], str] = {}
    jobs: list[tuple[str, Job]] = []
    for each in plan:
        names = each.route.name, each.descriptor.name
        pair = pairs.get(names) or pairs.setdefault(names, pair_of(each))
        job = Job(pair, each)
        jobs.append((identity(job, plan), job))
    left = [job for job in jobs if job[0] not in rows.known]
    try:
        failed = _run(plan, left, rows, out / "ready")
    finally:
        rows.flush()
        if sys.exception() is not None:
            kept = plural(len(rows.known), "row")
            say(f"{kept} kept: the same command goes on", file=sys.stderr)
    types = _types(plan)
    table = [
        _row(types, job.evaluation, rows.known.get(name), failed.get(name)) for name, job in jobs
    ]
    write_table(out / "results.parquet", table, types)
    _print(plan, table)
    say(f"Made {out / 'results.parquet'}: {plural(len(table), 'evaluation')}")
    if failed:
        name, why = next(iter(failed.items()))
        first = dict(jobs)[name].evaluation
        which = f"{first.route.name}, {first.descriptor.name}, {first.method}"
        count = f"{len(failed)} of {plural(len(table), 'evaluation')} failed"
        raise SurefixError(f"{file}: {count}; the first, {which}: {why}")


def _run(plan: Plan, jobs: Sequence[tuple[str, Job]], rows: Rows, folder: Path) -> dict[str, str]:
    """Evaluates the jobs; the errors, by the mark of the row."""
    asked = Asked(folder, plan.recall, plan.upto, plan.samples)
    firsts = [*{job.pair: job for _, job in jobs}.values()]
    bar = terminal_bar("Describing")
    unready: dict[str, str] = {}
    for done, (at, why) in enumerate(completed(make_ready, asked, firsts), 1):
        if why is not None:
            unready[firsts[at].pair] = why
        if bar is not None:
            bar(done, len(firsts))
    failed = {name: unready[job.pair] for name, job in jobs if job.pair in unready}
    left = [(name, job) for name, job in jobs if name not in failed]
    bar = terminal_bar("Evaluating")
    for done, (at, row) in enumerate(completed(evaluate, asked, [job for _, job in left]), 1):
        name = left[at][0]
        if "error" in row:
            failed[name] = row["error"]
        else:
            rows.add(name, row)
        if bar is not None:
            bar(done, len(left))
    return failed


def _types(plan: Plan) -> dict[str, str]:
    """The columns of the table."""
    types = dict.fromkeys(("route", "descriptor", "method"), "string")
    for key, values in plan.settings.items():
        kinds = {type(value) for value in values}
        types[key] = "int64" if kinds == {int} else "double" if kinds <= {int, float} else "string"
    types |= dict.fromkeys(("places", "queries"), "int64")
    figures = [f"{name}{end}" for name in FIGURES for end in ("", "_low", "_high")]
    return types | dict.fromkeys(figures, "double") | {"error": "string"}


def _row(
    types: dict[str, str], evaluation: Evaluation, known: dict[str, Any] | None, error: str | None
) -> dict[str, Any]:
    """A row of the table."""
    row = {**evaluation.settings, **(known or {}), "error": error}
    row |= {"route": evaluation.route.name, "descriptor": evaluation.descriptor.name}
    row |= {"method": evaluation.method}
    row = {key: row.get(key) for key in types}
    texts = [key for key in evaluation.settings if types[key] == "string"]
    return row | {key: str(row[key]) for key in texts}


def _print(plan: Plan, table: Sequence[dict[str, Any]]) -> None:
    """The means over the routes, the best first."""
    varied = [key for key, values in plan.settings.items() if len(values) > 1]
    keys = ["descriptor", "method", *varied]
    groups: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for row in table:
        if row["area"] is not None:
            groups.setdefault(tuple(row[key] for key in keys), []).append(row)
    lines = []
    for name, found in groups.items():
        means = [math.fsum(row[key] for row in found) / len(found) for key in ("area", "right")]
        lines.append((means, ["" if each is None else str(each) for each in name], len(found)))
    lines.sort(key=lambda line: line[0], reverse=True)
    header = (*keys, "routes", "area", "right")
    shown = [(*name, str(n), *(f"{mean:.3f}" for mean in means)) for means, name, n in lines]
    print_columns([header, *shown[:SHOWN]])
    more = len(shown) - SHOWN
    if more > 0:
        say(f"and {more} more, with smaller areas")
