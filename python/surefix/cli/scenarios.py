"""``surefix eval --scenario``: its options, and its tables in a terminal."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from surefix._terminal import say
from surefix.baselines import METHODS
from surefix.cli.inputs import refuse
from surefix.errors import mismatch
from surefix.study.scenarios import SCENARIOS
from surefix.tables.rows import decimal, rows

if TYPE_CHECKING:
    from surefix.study import Study

__all__ = ["METHODS_OF_DRIVES", "check_method", "chosen", "print_drives", "read_speeds"]

EVERY, PROFILE = "every", "profile"
METHODS_OF_DRIVES = (
    "sequence", "sequence-10", "sequence-20", "topological", "track_steady", "track_free",
    "track_any", "track_odometry",
)  # fmt: skip


def chosen(scenarios: Iterable[str], speeds: Path | None) -> Sequence[str]:
    """The names of scenarios, once each; ``every`` is all for which there is data."""
    names: list[str] = []
    for name in scenarios:
        expected = f"--scenario: expected {EVERY} or one of {', '.join(SCENARIOS)}, got {name!r}"
        refuse(name != EVERY and name not in SCENARIOS, expected)
        names += SCENARIOS if name == EVERY else [name]
        expected = "--scenario profile: expected --speed-profile, a file of speeds"
        refuse(name == PROFILE and speeds is None, expected)
    refuse(speeds is not None and PROFILE not in names, "--speed-profile: expected --scenario too")
    return [name for name in dict.fromkeys(names) if name != PROFILE or speeds is not None]


def check_method(name: str, scenarios: Sequence[str], odometry: str | None) -> None:
    """Refuses a method that needs odometry if no drive has it."""
    expected = f"--method {name}: expected --odometry, or --scenario, which makes it of the truth"
    refuse(METHODS[name].needs == "advance" and not scenarios and odometry is None, expected)


def read_speeds(path: Path) -> npt.NDArray[np.float64]:
    """Speeds in m/s, a row a second; a first row that begins with no number is a heading."""
    speeds = []
    for count, (row, cells) in enumerate(rows(path, ",")):
        try:
            float(cells[0])
        except ValueError:
            if count == 0:
                continue
        if len(cells) != 1:
            raise mismatch(f"{path}, row {row}", "one speed in m/s", f"{len(cells)} cells")
        speeds.append(decimal(cells[0], path, row, "a speed in m/s"))
    if not speeds:
        raise mismatch(path, "speeds", "none")
    return np.array(speeds)


def print_drives(drives: Sequence["Study"]) -> None:
    """A table for each drive, and one of all of them, in plain columns."""
    from surefix.report.tables import drive, every

    for table in (*map(drive, drives), *([every(drives)] if len(drives) > 1 else ())):
        # Headings are broken into lines, so that ten drives fit 100 columns too.
        narrow = 9 if len(table.header) < 10 else 5
        columns = []
        for heading, *cells in zip(table.header, *table.rows, strict=True):
            width = max(narrow, *map(len, cells))
            columns.append((wrap(heading, width, break_long_words=False), cells))
        deepest = max(len(heading) for heading, _ in columns)
        filled = [[*[""] * (deepest - len(top)), *top, *cells] for top, cells in columns]
        widths = [max(map(len, column)) for column in filled]
        say("", table.caption)
        for name, *others in zip(*filled, strict=True):
            padded = (cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True))
            say("  ".join((name.ljust(widths[0]), *padded)))
