"""The times of the frames that were read."""

from collections.abc import Generator
from contextlib import closing

from surefix.frames.frame import Shot
from surefix.frames.sampling import Derived


class Noted(Derived):
    """All frames of a source; ``times`` are those of the newest iteration that came to its end,
    and ``names`` their names.
    """

    times: tuple[float | None, ...] = ()
    names: tuple[str, ...] = ()

    @property
    def estimate(self) -> int | None:
        """That of the source."""
        return self.source.estimate

    @property
    def count(self) -> int | None:
        """That of the source."""
        return self.source.count

    def shots(self) -> Generator[Shot, None, None]:
        """All, noted."""
        times, names = list[float | None](), list[str]()
        with closing(self.source.shots()) as shots:
            for shot in shots:
                times.append(shot.time)
                names.append(shot.name)
                yield shot
        self.times, self.names = tuple(times), tuple(names)
