"""The progress bar that the library shows by itself, on a terminal only."""

import sys
from collections.abc import Callable

from surefix.errors import SurefixError

Progress = Callable[[int, int], bool | None]


def terminal_bar(label: str) -> Callable[[int, int], None] | None:
    """A callback ``(done, total)`` that draws a bar on stderr; None if stderr is no terminal."""
    if sys.stderr is None or not sys.stderr.isatty():
        return None
    from rich import progress as rich

    from surefix._terminal import Console

    columns = ("{task.description}", rich.BarColumn(), rich.MofNCompleteColumn())
    console = Console(stderr=True)
    progress = rich.Progress(*columns, rich.TimeRemainingColumn(), console=console, transient=True)
    task = progress.add_task(label)

    def report(done: int, total: int) -> None:
        if not progress.live.is_started:
            progress.start()
        progress.update(task, completed=done, total=total)
        if done >= total:
            progress.stop()

    return report


class Bar:
    """Reports by a callback, if there is one; a total that is unknown is one more than is done."""

    def __init__(self, report: Progress | None, total: int | None, estimate: int | None) -> None:
        self.report, self.total, self.estimate = report, total, estimate or 0

    def show(self, done: int) -> None:
        total = max(self.estimate, done + 1) if self.total is None else self.total
        if self.report is not None and self.report(done, total) is False:
            raise SurefixError(f"stopped after {done} of {total}")

    def end(self, done: int) -> None:
        """The last call, if the total was unknown."""
        if self.report is not None and self.total is None:
            self.report(done, done)
