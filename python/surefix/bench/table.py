"""Results in words and numbers: the same cells for the terminal, for Markdown and for the page."""

from collections.abc import Iterator, Sequence

from surefix.bench.line import Result, Row, Skipped
from surefix.bench.run import Group

__all__ = [
    "HEADER", "LIMITS", "TITLES", "cells", "duration", "factor", "limit_cells", "markdown_table", "missed", "slower",
    "verdict", "wrong",
]  # fmt: skip

HEADER = ("work", "surefix", "beside", "its time", "ratio", "to reach", "")
LIMITS = ("work", "surefix", "bytes", "read here at", "limit", "of the limit's speed")
TITLES = {
    Group.push: "Distances to fix",
    Group.sad: "Distances of SAD descriptors",
    Group.float: "Distances of learned descriptors",
    Group.learned: "Learned descriptor to fix",
    Group.threads: "Two threads",
    Group.scale: "A million places",
    Group.image: "Image to fix",
}


def duration(seconds: float) -> str:
    """A time in three digits."""
    if seconds != seconds:
        return "\u2013"
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= size:
            return f"{_three(seconds / size)} {unit}"
    return f"{_three(seconds * 1e9)} ns"


def factor(ratio: float) -> str:
    """How many times faster surefix is."""
    return "\u2013" if ratio != ratio else f"{_three(ratio)} x"


def _three(number: float) -> str:
    digits = 0 if number >= 100 else 1 if number >= 10 else 2
    return f"{number:.{digits}f}"


def verdict(row: Row) -> str:
    """What came of it, in a word."""
    if row.problem:
        return "ERROR"
    return {True: "met", False: "MISSED", None: ""}[row.met]


def cells(row: Row) -> tuple[str, ...]:
    """A rival beside surefix: the cells under ``HEADER``."""
    reach = row.rival.reach.words if row.rival.reach else "\u2013"
    times = duration(row.ours), row.rival.name, duration(row.theirs), factor(row.ratio)
    return (row.line.work, *times, reach, verdict(row))


def limit_cells(result: Result) -> tuple[str, ...]:
    """How far a line is from what the memory allows: the cells under ``LIMITS``."""
    share = result.limit / result.ours
    return (
        result.line.work,
        duration(result.ours),
        f"{result.line.read / 1e6:,.2f} MB",
        f"{result.bandwidth / 1e9:.0f} GB/s",
        duration(result.limit),
        f"{share:.0%}",
    )


def wrong(results: Sequence[Result | Skipped]) -> Iterator[str]:
    """A sentence for each answer that differs."""
    for row in _rows(results):
        if row.problem:
            yield f"{row.line.work}, beside {row.rival.name}: {row.problem}"


def slower(results: Sequence[Result | Skipped]) -> Iterator[str]:
    """A sentence for each rival that is faster."""
    for row in _rows(results):
        if not row.problem and not row.is_itself and row.ratio < 1:
            yield (
                f"{row.line.work}: {row.rival.name} takes {duration(row.theirs)}, surefix {duration(row.ours)} "
                f"({factor(row.ratio)})"
            )


def missed(results: Sequence[Result | Skipped]) -> Iterator[str]:
    """A sentence for each figure that was to be reached and is not."""
    for row in _rows(results):
        if row.met is False and row.rival.reach:
            yield (
                f"{row.line.work}: {factor(row.ratio)} beside {row.rival.name}, where {row.rival.reach.words} "
                f"({factor(row.rival.reach.least)}) is to be reached"
            )


def _rows(results: Sequence[Result | Skipped]) -> Iterator[Row]:
    for result in results:
        if isinstance(result, Result):
            yield from result.rows


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines
    )
