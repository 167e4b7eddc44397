"""The drive of ``surefix demo --town``: three roads with a ring and two junctions, mapped in two
seasons, and driven through in a third.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from surefix import Map, Run, match
from surefix.baselines.distances import Flags
from surefix.simulate import Town, TownDrive
from surefix.study.demo import ACCEPT

__all__ = ["BEST", "ONE_LINE", "SUMMER", "TownDemo", "drive_through"]

MOTION: Final = "any"
# Metres from place to place.
SPACING = 3.0
# The second drive of the surveyor: the leaves have begun to fall, and the sun is lower.
AUTUMN = {"season": 0.5, "light": 0.3}

BEST, ONE_LINE, SUMMER = "the town, two seasons", "one line, two seasons", "the town, summer alone"


@dataclass(frozen=True, eq=False)
class TownDemo:
    """A drive through a town, localized on three maps of it.

    Attributes
    ----------
    town : Town
    drive : TownDrive
    known : Map
        Of two seasons, with the town's segments.
    runs : dict of Run
        By the name of the map: ``BEST``, ``ONE_LINE`` and ``SUMMER``.
    """

    town: Town
    drive: TownDrive
    known: Map
    runs: dict[str, Run]

    @property
    def run(self) -> Run:
        """That on the map of the town as it is."""
        return self.runs[BEST]

    @cached_property
    def right(self) -> dict[str, Flags]:
        """Which fixes are within a place of the true one, along the road."""
        return {
            name: self.town.segments.are_near(run.place, self.drive.truth)
            for name, run in self.runs.items()
        }

    def sure(self, name: str) -> Flags:
        """Which fixes are sure."""
        said = self.runs[name].confidence
        assert said is not None
        return np.greater_equal(said, ACCEPT)

    def after_junctions(self, name: str) -> list[int]:
        """How many frames each junction took until a fix was right and sure again."""
        good = self.right[name] & self.sure(name)
        return [int(np.argmax(good[at:])) for at in self.drive.junctions]


def drive_through(places: int, size: tuple[int, int], seed: int) -> TownDemo:
    """Maps the town in two seasons, and drives through it in a third."""
    town = Town(places, size, seed)
    drive = town.drive()
    summer = Map.from_images(
        town.mapped(), positions=town.positions, origin=town.origin, thumbnails=True, progress=False
    )
    one_line = summer.add_traverse(
        town.mapped(**AUTUMN), motion="steady", label="autumn", progress=False
    )
    known = one_line.with_segments(town.segments)
    maps = {BEST: known, ONE_LINE: one_line, SUMMER: summer.with_segments(town.segments)}
    advance = drive.odometry / SPACING
    how: dict[str, Any] = {"motion": MOTION, "advance": advance, "progress": False}
    runs = {name: match(each, drive.images, **how) for name, each in maps.items()}
    return TownDemo(town, drive, known, runs)
