"""A piece of work that surefix and its rivals do, and how their answers are compared."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

from surefix import Fix

# Two runs of one thing differ by 3 %: a rival that surefix is to be level with may be that much
# faster.
LEVEL = 0.97, "level or better"
# Memory that is left to the rest of the machine.
SPARE = 1 << 30
# Place, score, trusted.
Answer = tuple[int, float, bool]


def times(factor: float) -> tuple[float, str]:
    """The target of a ratio."""
    return factor, f"{factor:g} x or better"


@dataclass(frozen=True)
class Entrant:
    """One way to do the work.

    `call` is timed. `answer`, by default one call, is compared by `agrees`, by default the work's
    own. `target` is the least ratio, and the same in words. `scale` multiplies the time of a known
    share of the work.
    """

    call: Callable[[], Any]
    answer: Callable[[], Any] | None = None
    agrees: Callable[[Any, Any], str] | None = None
    target: tuple[float, str] | None = None
    scale: float = 1.0


@dataclass(frozen=True)
class Work:
    """A piece of work with its entrants, of which surefix is the first.

    `agrees` says how two answers differ, or nothing. `read` is the bytes that must be read.
    """

    name: str
    entrants: dict[str, Entrant]
    agrees: Callable[[Any, Any], str]
    read: int
    threads: int = 1

    def check(self, name: str) -> None:
        """Compares the answer with that of surefix."""
        rival, ours = self.entrants[name], next(iter(self.entrants.values()))
        if rival is not ours:
            problem = (rival.agrees or self.agrees)(
                *((each.answer or each.call)() for each in (ours, rival))
            )
            assert not problem, f"{self.name}, {name}: {problem}"


def pushing(fresh: Callable[[], Callable[[Any], Any]], queries: Sequence[Any], **more: Any) -> Any:
    """An entrant that pushes the queries in turn; `fresh` makes a new push."""
    push, following = fresh(), cycle(queries)
    for query in queries:
        push(query)

    def answer() -> list[Answer]:
        push = fresh()
        return [summary(push(query)) for query in queries]

    return Entrant(lambda: push(next(following)), answer, **more)


def summary(fix: Fix | Answer) -> Answer:
    """The place, score and trust of a fix."""
    return fix if isinstance(fix, tuple) else (fix.place, fix.score, fix.trusted)


def read_by_push(places: int, length: int) -> int:
    """The bytes of the columns that a push reads: distances twice, three gradients, older ones."""
    return places * 4 * (2 + 3 + min(length - 1, 2))


def same_fixes(ours: Sequence[Answer], theirs: Sequence[Answer], tolerance: float = 1e-4) -> str:
    """Places and trust must be the same, scores within float32's rounding of a sum."""
    for query, (mine, other) in enumerate(zip(ours, theirs, strict=True)):
        close = abs(mine[1] - other[1]) <= tolerance * max(1e-3, abs(other[1]))
        if mine[0] != other[0] or mine[2] != other[2] or not close:
            return f"query {query}: surefix says {mine}, the rival {other}"
    return ""


def same_trust(ours: Sequence[Answer], theirs: Sequence[Answer]) -> str:
    """The single matches are the same for every sequence length, and so is their trust."""
    differ = [query for query, (a, b) in enumerate(zip(ours, theirs, strict=True)) if a[2] != b[2]]
    return f"query {differ[0]}: one is trusted and the other is not" if differ else ""


def equal(ours: Any, theirs: Any) -> str:
    """Equal to the last bit."""
    return "" if ours == theirs else f"{ours} is not {theirs}"


def same_distances(tolerance: float) -> Callable[[Any, Any], str]:
    """Each distance within a share of the largest."""

    def agrees(ours: Any, theirs: Any) -> str:
        ours, theirs = np.asarray(ours, np.float64).ravel(), np.asarray(theirs, np.float64).ravel()
        if ours.shape != theirs.shape:
            return f"surefix gives {ours.size} distances, the rival {theirs.size}"
        off = np.abs(ours - theirs) - tolerance * np.abs(theirs).max(initial=0.0)
        worst = int(off.argmax())
        if off[worst] <= 0:
            return ""
        return f"place {worst}: surefix says {ours[worst]:.9g}, the rival {theirs[worst]:.9g}"

    return agrees


def same_best(tolerance: float) -> Callable[[Any, Any], str]:
    """A rival's nearest place and its distance, beside surefix's distances of all places."""

    def agrees(ours: Any, theirs: tuple[int, float]) -> str:
        place, distance = int(np.argmin(ours)), float(np.min(ours))
        if place == theirs[0] and abs(distance - theirs[1]) <= tolerance * max(distance, 1e-3):
            return ""
        return f"surefix finds place {place} at {distance:.9g}, the rival {theirs}"

    return agrees


def shortage(needed: int) -> str:
    """Why there is not enough memory; empty if there is, or if the system does not tell."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        free = next(int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    except (OSError, StopIteration, ValueError):
        return ""
    if needed + SPARE <= free * 1024:
        return ""
    return f"it needs {needed / 1e9:.1f} GB of memory, and {free / 1e6:.1f} GB are free"


def caches(folder: Path = Path("/sys/devices/system/cpu/cpu0/cache")) -> str:
    """The sizes of the first core's caches, if the system tells them."""

    def found() -> Iterator[str]:
        for index in sorted(folder.glob("index*")):
            level, kind, size = (
                (index / name).read_text(encoding="ascii").strip()
                for name in ("level", "type", "size")
            )
            if kind != "Instruction":
                yield f"L{level} {size}"

    try:
        return ", ".join(found()) or "unknown"
    except (OSError, UnicodeDecodeError, ValueError):
        return "unknown"
