"""All lines, one after the other: checked first, then timed."""

from collections.abc import Callable, Collection, Iterator
from enum import StrEnum
from typing import Any

from surefix.bench import bytes_scan, float_scan, image, learned, push, size
from surefix.bench.clock import interleaved
from surefix.bench.line import Contender, Line, Result, Settings, Skipped
from surefix.bench.memory import Bandwidth
from surefix.bench.rivals import Rivals

__all__ = ["GROUPS", "Group", "measure", "run"]


class Group(StrEnum):
    """The lines that belong together."""

    push = "push"
    sad = "sad"
    float = "float"
    learned = "learned"
    threads = "threads"
    scale = "scale"
    image = "image"


GROUPS: dict[Group, Callable[[Settings, Rivals], Iterator[Line | Skipped]]] = {
    Group.push: push.lines,
    Group.sad: bytes_scan.lines,
    Group.float: float_scan.lines,
    Group.learned: learned.lines,
    Group.threads: size.thread_lines,
    Group.scale: size.scale_lines,
    Group.image: image.lines,
}


def run(
    settings: Settings, rivals: Rivals, only: Collection[Group], say: Callable[[str], None]
) -> Iterator[Result | Skipped]:
    """The result of each line as it comes; ``say`` hears what is being measured."""
    bandwidth = Bandwidth(settings.quick)
    with rivals.limited(settings.threads):
        for group, lines in GROUPS.items():
            if only and group not in only:
                continue
            say(f"{group}: making the data")
            for line in lines(settings, rivals):
                if isinstance(line, Skipped):
                    yield line
                    continue
                say(line.work)
                # What is to be reached is said of the sizes that users have, not of quick ones.
                line = line.unheld() if settings.quick else line
                result = measure(line, settings, bandwidth(line.read, line.threads))
                # Its data go before those of the next are made.
                del line
                yield result
                say(f"{group}: making the data")


def measure(line: Line, settings: Settings, bandwidth: float) -> Result:
    """Checks the answers, and times all contenders by turns. A rival that fails or answers
    otherwise is said.
    """
    contenders = [line.ours, *line.rivals]
    mine = _answer(line.ours)
    problems = {}
    for rival in line.rivals:
        try:
            wrong = (rival.agrees or line.agrees)(mine, _answer(rival))
        except Exception as error:
            # Whatever a rival raises is what went wrong with it.
            wrong = f"{type(error).__name__}: {error}"
            contenders.remove(rival)
        if wrong:
            problems[rival.name] = wrong
    took = interleaved(
        [contender.call for contender in contenders],
        settings.seconds,
        settings.rounds,
        [contender.clock for contender in contenders],
    )
    seconds = {
        contender.name: each * contender.scale
        for contender, each in zip(contenders, took, strict=True)
    }
    for rival in line.rivals:
        seconds.setdefault(rival.name, float("nan"))
    return Result(line.bare(), seconds, bandwidth, problems)


def _answer(contender: Contender) -> Any:
    return (contender.answer or contender.call)()
