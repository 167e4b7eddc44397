"""The times of the frames that were read."""

from collections.abc import Generator
from contextlib import closing

from surefix.frames.frame import Shot
from surefix.frames.sampling import Derived


class Noted(Derived):
    """All frames of a source; ``times`` are those of the newest iteration that came to its end,
    ``clocks`` those of the odometry's clock, and ``names`` their names.
    """

    times: tuple[float | None, ...] = ()
    clocks: tuple[float | None, ...] = ()
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
        times, clocks, names = list[float | None](), list[float | None](), list[str]()
        with closing(self.source.shots()) as shots:
            for shot in shots:
                times.append(shot.time)
                clocks.append(shot.time if shot.clock is None else shot.clock)
                names.append(shot.name)
                yield shot
        self.times, self.clocks, self.names = tuple(times), tuple(clocks), tuple(names)
