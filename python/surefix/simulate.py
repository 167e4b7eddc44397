"""A generated route, seen in two conditions, by drives that can stop, reverse, leave the map and
come back; and a town of three roads: for demos, tests and trying things out without any data.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._core import Route, Segments, Traverse
from surefix.errors import mismatch

__all__ = ["Route", "Town", "TownDrive", "Traverse"]

_SPACING = 3.0
_LEAST = 40
# Where it lies, degrees: at sea, so that it is no real town.
_ORIGIN = (48.0, -30.0)


@dataclass(frozen=True, eq=False)
class TownDrive:
    """A drive through a town.

    Attributes
    ----------
    images : list of array of uint8, shape (H, W, 3)
        Frame by frame.
    truth : array of int64, shape (m,)
        The place of each.
    junctions : tuple of int
        The frames that are the first on another road, or on another lap.
    odometry : array of float64, shape (m,)
        The metres since the frame before, by wheels that count 2 % too much, with 5 % of noise.
    """

    images: list[npt.NDArray[np.uint8]]
    truth: npt.NDArray[np.int64]
    junctions: tuple[int, ...]
    odometry: npt.NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.images)


class Town:
    """A generated town: a closed ring, a road that leads into it, and one that leads out.

    Its places lie in three segments: the ring, closed; the road in, whose end is linked to the
    ring's first place; and the road out, which begins halfway round the ring.

    Parameters
    ----------
    places : int
        Of all roads together, at least 40.
    size : (int, int)
        Width and height of a frame, in pixels.
    seed : int
        Another seed has other scenery.

    Attributes
    ----------
    segments : Segments
    names : tuple of str
        A name for each segment.
    positions : array of float64, shape (n, 2)
        Metres east and north of ``origin``, a place every 3 m.
    origin : (float, float)
        Latitude and longitude.

    Raises
    ------
    SurefixValueError
        For fewer than 40 places, and as for ``Route``.

    Examples
    --------
    >>> from surefix.simulate import Town
    >>> town = Town(places=60, size=(64, 32))
    >>> list(town.segments)
    [Segment(0, 20, closed=True), Segment(20, 44), Segment(44, 60)]
    >>> town.segments.links.tolist()
    [[10, 44], [43, 0]]
    """

    names = ("the ring", "the road in", "the road out")
    origin = _ORIGIN

    def __init__(self, places: int = 300, size: tuple[int, int] = (160, 80), seed: int = 1) -> None:
        if places < _LEAST:
            raise mismatch("places", f"at least {_LEAST} of a town", places)
        ring, road_in = places // 3, places * 2 // 5
        self._lengths = (ring, road_in, places - ring - road_in)
        self._roads = [
            Route(places=length, size=size, spacing=_SPACING, seed=seed + 1000 * road)
            for road, length in enumerate(self._lengths)
        ]
        begin_in, begin_out = ring, ring + road_in
        links = [(begin_out - 1, 0), (ring // 2, begin_out)]
        self.segments = Segments(places, [begin_in, begin_out], [0], links)
        self.positions = self._laid_out()

    def _laid_out(self) -> npt.NDArray[np.float64]:
        ring, road_in, road_out = (np.arange(length) for length in self._lengths)
        radius = _SPACING * len(ring) / (2 * np.pi)
        angle = np.pi + 2 * np.pi * ring / len(ring)
        # The road in meets the ring at its westernmost place, and the road out leaves it opposite.
        turn = np.linspace(0, 1.2, len(road_in)), np.linspace(0, 1.2, len(road_out))
        steps_in, steps_out = (
            _SPACING * np.stack([np.cos(bent), np.sin(bent)], axis=1) for bent in turn
        )
        return np.concatenate(
            [
                np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1),
                np.array([-radius, 0.0]) - np.cumsum(steps_in, axis=0)[::-1],
                np.cumsum(steps_out, axis=0) + np.array([radius, 0.0]),
            ]
        )

    def mapped(self, **conditions: Any) -> list[npt.NDArray[np.uint8]]:
        """An image of each place, in the order of the places, as the surveyor's drive sees it.

        Parameters
        ----------
        **conditions
            As for ``Route.traverse``; on a summer noon by default.
        """
        drives = [road.traverse(**conditions) for road in self._roads]
        return [image for drive in drives for image in _frames(drive)]

    def drive(self, **conditions: Any) -> TownDrive:
        """A drive along the road in, one and a half times round the ring, and along the road out.

        Parameters
        ----------
        **conditions
            As for ``Route.revisit``: another season, light, lane and traffic by default.
        """
        ring, road_in, road_out = 0, 1, 2
        half = self._lengths[ring] // 2 + 1
        legs = [(road_in, None, 0), (ring, None, 1), (ring, half, 2), (road_out, None, 3)]
        images: list[npt.NDArray[np.uint8]] = []
        truth: list[int] = []
        junctions: list[int] = []
        for road, until, seed in legs:
            route = self._roads[road]
            seen: dict[str, Any] = {"speed_jitter": 0.0, "seed": seed, **conditions}
            drive = route.revisit(**seen)
            at = drive.truth(route.reference())[:until]
            junctions.append(len(images))
            images += _frames(drive)[: len(at)]
            truth += (self.segments[road].start + at).tolist()
        noise = 1 + 0.05 * np.random.default_rng(0).standard_normal(len(images))
        odometry = _SPACING * 1.02 * noise
        odometry[0] = 0
        return TownDrive(images, np.array(truth, np.int64), tuple(junctions[1:]), odometry)


def _frames(drive: Traverse) -> list[npt.NDArray[np.uint8]]:
    return [drive[frame] for frame in range(len(drive))]
