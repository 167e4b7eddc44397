"""Prints the results of `benches/python`, or puts them into a page: RESULTS.json [PAGE.md]"""

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

# A page has a part for each maker of processors.
BEGIN = "<!-- begin: made by make performance on {} -->"
END = "<!-- end: made by make performance on {} -->"
HEADER = ("work", "surefix", "beside", "its time", "ratio", "to reach", "")
LIMITS = ("work", "surefix", "bytes", "read here at", "limit", "of the limit's speed")


class Row(NamedTuple):
    """A rival beside surefix. `ours` and `theirs` are medians in seconds."""

    section: str
    work: str
    ours: float
    rival: str
    theirs: float
    target: tuple[float, str] | None

    @property
    def ratio(self) -> float:
        return self.theirs / self.ours

    @property
    def met(self) -> bool | None:
        return None if self.target is None else self.ratio >= self.target[0]


def rows(results: dict[str, Any]) -> list[Row]:
    """A row for each rival of each work."""
    ours = {each["group"]: each["stats"]["median"] for each in own(results)}
    found = []
    for each in results["benchmarks"]:
        about, work = each["extra_info"], each["group"]
        if about["ours"] or work not in ours:
            continue
        # Targets hold for the sizes of real maps.
        target = None if about["quick"] else about["target"]
        theirs = each["stats"]["median"] * about["scale"]
        found.append(Row(about["section"], work, ours[work], about["name"], theirs, target))
    return found


def own(results: dict[str, Any]) -> list[dict[str, Any]]:
    """The results of surefix."""
    return [each for each in results["benchmarks"] if each["extra_info"]["ours"]]


def maker(results: dict[str, Any]) -> str:
    """Of the processor, as its name begins."""
    word: str = results["facts"]["machine"].split()[0]
    return word.partition("(")[0]


def markdown(results: dict[str, Any]) -> str:
    """The machine, a table for each section, the limits, and the works at which it is slower."""
    return "\n".join(_parts(results, rows(results)))


def _parts(results: dict[str, Any], found: Sequence[Row]) -> Iterator[str]:
    yield f"## On {maker(results)}\n"
    yield table(("", ""), list(results["facts"].items()))
    yield "### Beside the rivals\n"
    yield (
        "Medians. The ratio is the other's time over that of surefix: below 1 surefix is slower.\n"
    )
    for section in dict.fromkeys(row.section for row in found):
        yield f"#### {section}\n"
        yield table(HEADER, [cells(row) for row in found if row.section == section])
    yield from (f"Not measured: {reason}.\n" for reason in results["skipped"])
    yield "### Beside the memory\n"
    yield (
        "The limit is the time that NumPy takes to read the bytes that the work must read, in its\n"
        "fastest round. More than 100 % means that the kernel reads faster than NumPy.\n"
    )
    yield table(LIMITS, list(limits(results)))
    yield "### Where surefix is slower\n"
    yield points(slower(found), "Beside none of the rivals above.")
    yield "### Targets that are not reached\n"
    none = "All are reached." if any(row.target for row in found) else "None is set at these sizes."
    yield points(missed(found), none)
    if results["missing"]:
        yield "### Rivals that were not installed\n"
        yield points(results["missing"], "")


def cells(row: Row) -> tuple[str, ...]:
    """The cells under `HEADER`."""
    verdict = {True: "met", False: "MISSED", None: ""}[row.met]
    words = row.target[1] if row.target else ""
    theirs = duration(row.theirs)
    return row.work, duration(row.ours), row.rival, theirs, factor(row.ratio), words, verdict


def limits(results: dict[str, Any]) -> Iterator[tuple[str, ...]]:
    """The cells under `LIMITS`. Works of less than a megabyte are not limited by the memory."""
    for each in own(results):
        about, ours = each["extra_info"], each["stats"]["median"]
        if about["read"] < 1e6:
            continue
        limit = about["read"] / about["memory"]
        size, speed = f"{about['read'] / 1e6:,.2f} MB", f"{about['memory'] / 1e9:.0f} GB/s"
        yield each["group"], duration(ours), size, speed, duration(limit), f"{limit / ours:.0%}"


def slower(found: Sequence[Row]) -> list[str]:
    """A sentence for each rival, other than surefix itself, that is faster."""
    return [
        f"{row.work}: {row.rival} takes {duration(row.theirs)}, surefix {duration(row.ours)} "
        f"({factor(row.ratio)})"
        for row in found
        if row.ratio < 1 and not row.rival.startswith("surefix")
    ]


def missed(found: Sequence[Row]) -> list[str]:
    """A sentence for each target that is not reached."""
    return [
        f"{row.work}: {factor(row.ratio)} beside {row.rival}; the target is {row.target[1]}"
        for row in found
        if row.target and not row.met
    ]


def points(sentences: Sequence[str], otherwise: str) -> str:
    return "".join(f"- {sentence}.\n" for sentence in sentences) or f"{otherwise}\n"


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def duration(seconds: float) -> str:
    """Three digits and a unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= size:
            return f"{three(seconds / size)} {unit}"
    return f"{three(seconds * 1e9)} ns"


def factor(ratio: float) -> str:
    return f"{three(ratio)} x"


def three(number: float) -> str:
    return f"{number:.{0 if number >= 100 else 1 if number >= 10 else 2}f}"


def replaced(page: str, part: str, first: str, last: str) -> str:
    """The page with `part` between its marks."""
    before, begin, rest = page.partition(first)
    _old, end, after = rest.partition(last)
    if not (begin and end) or first in after or last in before + after:
        raise ValueError(f"expected the lines {first} and {last} once each, in this order")
    return f"{before}{begin}\n\n{part}\n{end}{after}"


def main(data: str, page: str | None = None) -> None:
    """Prints the part, or renews the page."""
    results = json.loads(Path(data).read_text(encoding="utf-8"))
    part = markdown(results)
    if page is None:
        print(part)
    else:
        marks = (mark.format(maker(results)) for mark in (BEGIN, END))
        text = replaced(Path(page).read_text(encoding="utf-8"), part, *marks)
        Path(page).write_text(text, encoding="utf-8")
        print(f"Renewed {page}")


if __name__ == "__main__":
    main(*sys.argv[1:])
