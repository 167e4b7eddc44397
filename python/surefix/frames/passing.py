"""Frames that cannot be read are passed over."""

import logging
from collections.abc import Generator, Iterable
from contextlib import closing
from dataclasses import replace
from functools import partial
from typing import Any

from surefix.errors import SurefixValueError
from surefix.frames.frame import Frame, Shot, added
from surefix.frames.sampling import Derived

LOG = logging.getLogger("surefix")


class SkipBad(Derived):
    """The frames of a source without those that cannot be decoded, such as half a file.

    The logger ``surefix`` names each, on stderr by default. It counts as dropped before the next
    frame (``Frame.dropped``). If all are bad, the first one's error is raised.

    Attributes
    ----------
    bad : list of str
        Why each one was passed over, in the newest iteration so far.

    Examples
    --------
    >>> import surefix                                                           # doctest: +SKIP
    >>> for frame in surefix.frames.open("photos/", skip_bad=True):              # doctest: +SKIP
    ...     fix = localizer.push(frame.image)
    """

    def __init__(self, source: Iterable[Frame]) -> None:
        super().__init__(source)
        self._estimate = self.source.estimate
        # A bad frame shows when it is read, which is when its turn comes.
        self.parallel = False
        self.bad: list[str] = []
        self._seen = 0

    @property
    def total(self) -> int | None:
        """The number of frames of the source, with the bad ones."""
        total = super().total
        return self._seen if total is None else total

    def shots(self) -> Generator[Shot, None, None]:
        """Those that can be decoded, already decoded."""
        self.bad, self._seen = [], 0
        first: SurefixValueError | None = None
        lost, gap, some = 0, False, False
        moved: float | None = 0.0
        with closing(self.source.shots()) as shots:
            for shot in shots:
                number = self._seen if shot.number is None else shot.number
                self._seen += 1
                lost, gap = lost + shot.dropped, gap or shot.gap
                moved = added(moved, shot.advance)
                try:
                    image = shot.read()
                except SurefixValueError as error:
                    first = first or error
                    self.bad.append(str(error))
                    LOG.warning("Passed over: %s", error)
                    lost += 1
                    continue
                some = True
                given: dict[str, Any] = {"dropped": lost, "gap": gap, "advance": moved}
                yield replace(shot, read=partial(_same, image), path=None, number=number, **given)
                lost, gap, moved = 0, False, 0.0
        if first is not None and not some:
            raise first


def _same(image: Any) -> Any:
    return image
