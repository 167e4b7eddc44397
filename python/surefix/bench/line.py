"""What is measured: a piece of work, surefix doing it, and the rivals that do it beside it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

__all__ = [
    "LEVEL",
    "Contender",
    "Line",
    "Reach",
    "Result",
    "Row",
    "Settings",
    "Skipped",
    "level",
    "times",
]

# Two runs of one thing differ by so much here: what is held to be level may be this much behind.
LEVEL = 0.97


@dataclass(frozen=True)
class Settings:
    """How much work to do: ``quick`` is to see that it works and that the answers agree, not to
    quote.
    """

    quick: bool = False
    threads: int = 1

    @property
    def seconds(self) -> float:
        """For how long a line is measured, at least."""
        return 0.15 if self.quick else 4.0

    @property
    def rounds(self) -> int:
        """How many rounds it has, at least."""
        return 3 if self.quick else 7


@dataclass(frozen=True)
class Reach:
    """What surefix is held to against a rival: how many times its speed, and the same in words."""

    least: float
    words: str


def times(factor: float) -> Reach:
    """So many times faster."""
    return Reach(factor, f"{factor:g} x or better")


def level() -> Reach:
    """As fast, within the noise."""
    return Reach(LEVEL, "level or better")


@dataclass(frozen=True)
class Contender:
    """One way of doing a line's work.

    Attributes ---------- name : str call : callable Does the work once. What it returns is the
    answer, where there is no ``answer``. answer : callable, optional What is compared, where a call
    has a state: made anew from the start. reach : Reach, optional What surefix is held to against
    it. scale : float Its time is multiplied by this, where it does a known share of the work. clock
    : callable, optional Gives the seconds of one call by a clock of its own, and is used in place
    of timing ``call``. agrees : callable, optional Says what is wrong with the answers, given
    surefix's and its own, in place of the line's own check.
    """

    name: str
    call: Callable[[], Any]
    answer: Callable[[], Any] | None = None
    reach: Reach | None = None
    scale: float = 1.0
    clock: Callable[[], float] | None = None
    agrees: Callable[[Any, Any], str] | None = None

    def bare(self) -> "Contender":
        """What it is called and held to, without the data that it works on."""
        return replace(self, call=_nothing, answer=None, clock=None, agrees=None)


@dataclass(frozen=True)
class Line:
    """A piece of work with all its contenders.

    ``agrees`` says what is wrong with a rival's answer, given surefix's and its own; nothing where
    they agree. ``read`` is how many bytes the work must read (and write) at the least.
    """

    group: str
    work: str
    ours: Contender
    rivals: Sequence[Contender]
    agrees: Callable[[Any, Any], str]
    read: int
    threads: int = 1

    def unheld(self) -> "Line":
        """The same, held to nothing."""
        return replace(self, rivals=tuple(replace(rival, reach=None) for rival in self.rivals))

    def bare(self) -> "Line":
        """The same without the data, which can be gigabytes."""
        rivals = tuple(rival.bare() for rival in self.rivals)
        return replace(self, ours=self.ours.bare(), rivals=rivals, agrees=_agreed)


def _nothing() -> None:
    return None


def _agreed(_ours: Any, _theirs: Any) -> str:
    return ""


@dataclass(frozen=True)
class Skipped:
    """A piece of work that was not done, and why."""

    group: str
    work: str
    why: str


@dataclass(frozen=True)
class Row:
    """One rival beside surefix."""

    line: Line
    rival: Contender
    ours: float
    theirs: float
    problem: str

    @property
    def ratio(self) -> float:
        """How many times faster surefix is; below 1 where it is slower."""
        return self.theirs / self.ours

    @property
    def met(self) -> bool | None:
        """Whether it is as fast as it is held to be; None where nothing is asked or the answers
        differ.
        """
        reach = self.rival.reach
        return None if reach is None or self.problem else self.ratio >= reach.least

    @property
    def is_itself(self) -> bool:
        """Whether the rival is surefix too."""
        return self.rival.name.startswith("surefix")


@dataclass(frozen=True)
class Result:
    """A line, measured: the median seconds of each contender by name, and what was wrong with an
    answer.
    """

    line: Line
    seconds: Mapping[str, float]
    bandwidth: float
    problems: Mapping[str, str] = field(default_factory=dict)

    @property
    def ours(self) -> float:
        """Seconds of surefix."""
        return self.seconds[self.line.ours.name]

    @property
    def limit(self) -> float:
        """Seconds that reading the bytes takes at the measured bandwidth, and nothing else."""
        return self.line.read / self.bandwidth

    @property
    def rows(self) -> Sequence[Row]:
        """Each rival beside surefix."""
        return [
            Row(
                self.line,
                rival,
                self.ours,
                self.seconds[rival.name],
                self.problems.get(rival.name, ""),
            )
            for rival in self.line.rivals
        ]
