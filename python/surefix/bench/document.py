"""Results as a part of a Markdown page, between two marks: nothing in it is typed."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from surefix.bench.line import Result, Skipped
from surefix.bench.table import (
    HEADER,
    LIMITS,
    TITLES,
    cells,
    limit_cells,
    markdown_table,
    missed,
    slower,
    wrong,
)
from surefix.errors import SurefixFileError, SurefixValueError

__all__ = ["BEGIN", "END", "markdown", "replace_part"]

BEGIN = "<!-- begin: made by surefix bench -->"
END = "<!-- end: made by surefix bench -->"


def markdown(
    results: Sequence[Result | Skipped],
    facts: Sequence[tuple[str, str]],
    missing: Sequence[str],
    picture: str | None,
) -> str:
    """The whole part: the machine, a table for each group, the limits, and where surefix is
    slower.
    """
    return "\n".join(_parts(results, facts, missing, picture))


def _parts(
    results: Sequence[Result | Skipped],
    facts: Sequence[tuple[str, str]],
    missing: Sequence[str],
    picture: str | None,
) -> Iterator[str]:
    yield "## The machine\n"
    yield markdown_table(("", ""), facts)
    yield "## Beside the rivals\n"
    yield (
        "Medians. The ratio says how many times faster surefix is; below 1 it is slower. Against itself it is the "
        "other's time over that of the line.\n"
    )
    if picture:
        yield f"![Each ratio as a point on a logarithmic scale, with what is to be reached]({picture})\n"
    for group, title in TITLES.items():
        measured = [
            result
            for result in results
            if isinstance(result, Result) and result.line.group == group
        ]
        skipped = [
            result for result in results if isinstance(result, Skipped) and result.group == group
        ]
        if measured or skipped:
            yield f"### {title}\n"
        if measured:
            yield markdown_table(HEADER, [cells(row) for result in measured for row in result.rows])
        yield from (f"Not measured: {line.work}: {line.why}.\n" for line in skipped)
    yield "## Beside the memory\n"
    yield (
        "The limit is the time that plain code takes to read the bytes that the work must read, at the speed measured "
        "for so many bytes, in the fastest round. More than 100 % means that the kernel reads better than that code.\n"
    )
    measured = [result for result in results if isinstance(result, Result)]
    yield markdown_table(LIMITS, [limit_cells(result) for result in measured])
    yield "## Where surefix is slower\n"
    yield _listed(slower(results), "Than none of the rivals above.")
    yield "## What is not reached\n"
    yield _listed(missed(results), "All that was to be reached is.")
    if problems := list(wrong(results)):
        yield "## Answers that differ\n"
        yield _listed(problems, "")
    if missing:
        yield "## Rivals that were not here\n"
        yield _listed(missing, "")


def _listed(points: Iterator[str] | Sequence[str], otherwise: str) -> str:
    return "".join(f"- {point}.\n" for point in points) or f"{otherwise}\n"


def replace_part(page: Path, part: str) -> None:
    """Puts the part between the marks of a page.

    Raises
    ------
    SurefixValueError
        Where the page has not both marks, once each and in order.
    SurefixFileError
        Where it cannot be read or written.
    """
    try:
        text = page.read_text(encoding="utf-8")
        begin, end = text.find(BEGIN), text.find(END)
        if not 0 <= begin < end or text.count(BEGIN) != 1 or text.count(END) != 1:
            raise SurefixValueError(
                f"{page}: expected the lines {BEGIN} and {END} once each, in this order"
            )
        page.write_text(f"{text[: begin + len(BEGIN)]}\n\n{part}\n{text[end:]}", encoding="utf-8")
    except OSError as error:
        if isinstance(error, SurefixFileError):
            raise
        raise SurefixFileError(
            f"{page}: cannot be read and written: {error.strerror or error}"
        ) from None
