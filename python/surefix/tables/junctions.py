"""How roads meet, by their positions: closed ones, laps that overlap, and links."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from surefix._core import Segment
from surefix.tables.breaks import usual_step
from surefix.tables.metres import nearest

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

# A closed road: its fewest places, the gap between its ends and its least extent, in usual steps,
# and the greatest turn between its ends, in degrees.
FEWEST, GAP, EXTENT, BEND = 20, 1.5, 5, 60.0
# A heading is taken over about two usual steps, which a bend shortens, and 64 places at most.
BASE, WINDOW = 1.8, 64
# The places of a second lap lie within this many usual steps of the first; most of them do.
NEAR, MOST = 3, 0.8
# In degrees: a vehicle turns into another road by no more.
TURN = 120.0


class Ends(NamedTuple):
    """How the ends of a road lie: whether they meet, and the metres between them; or the place at
    which a second lap begins, 0 if there is none.
    """

    closed: bool
    apart: float
    again: int


def ends_of(positions: Float64) -> Ends:
    """Whether a road of these places is closed: it has 20 or more, its ends lie within 1.5 usual
    steps and head the same way within 60 degrees, and it leads at least 5 usual steps away.
    """
    road, step = positions[:, :2], usual_step(positions)
    away = np.linalg.norm(road - road[0], axis=1)
    apart = float(away[-1])
    none = Ends(False, apart, 0)
    if len(road) < FEWEST or not step or away.max() < EXTENT * step:
        return none
    left = max(int(np.argmax(away >= EXTENT * step)), FEWEST - 1)
    back = np.flatnonzero(away[left:] <= GAP * step) + left
    first = heading(road, 0, BASE * step)
    back = np.array(
        [at for at in back if _turn(first, heading(road, int(at), BASE * step)) <= BEND]
    )
    if not len(back):
        return none
    # Of those in a row, that of the first pass which is nearest.
    passes = np.split(back, np.flatnonzero(np.diff(back) > 1) + 1)
    again = int(passes[0][np.argmin(away[passes[0].astype(np.int64)])])
    if len(road) - again <= 2:
        return Ends(True, apart, 0)
    _, off = nearest(road[:again], road[again:])
    if np.mean(off <= NEAR * step) >= MOST:
        return Ends(False, apart, again)
    return Ends(back[-1] == len(road) - 1, apart, 0)


def heading(road: Float64, at: int, far: float) -> float:
    """The direction of a road at one of its places, in degrees from x to y, over ``far`` metres
    before and after it; NaN if it leads nowhere.
    """
    ends = []
    for side in (road[max(at - WINDOW, 0) : at][::-1], road[at + 1 : at + 1 + WINDOW]):
        reached = np.linalg.norm(side - road[at], axis=1) >= far
        ends.append(side[np.argmax(reached)] if reached.any() else road[at])
    way = ends[1] - ends[0]
    return float(np.degrees(np.arctan2(way[1], way[0]))) if way.any() else float("nan")


def found_links(
    positions: Float64, roads: Sequence[Segment], within: float
) -> list[tuple[int, int]]:
    """The links between roads whose places lie within some metres.

    From the last place of each open road to the nearest place of each pass of another, or of its
    own at least 20 places away; and from the nearest place of each such pass to the first place of
    an open road. A vehicle must be able to turn from one to the other: by at most 120 degrees, and
    the second must not lie behind the first by more than that.
    """
    plane, cells = positions[:, :2], _Cells(positions[:, :2], within)
    starts = np.array([road.start for road in roads])
    usual = [usual_step(positions[road.start : road.end]) for road in roads]

    def directed(place: int) -> float:
        index = int(np.searchsorted(starts, place, side="right")) - 1
        road, far = roads[index], BASE * usual[index]
        return heading(plane[road.start : road.end], place - road.start, far)

    def fits(start: int, end: int) -> bool:
        ahead = directed(start)
        if not _turn(ahead, directed(end)) <= TURN:
            return False
        way = plane[end] - plane[start]
        index = int(np.searchsorted(starts, start, side="right")) - 1
        if np.linalg.norm(way) <= usual[index] / 2:
            return True
        return _turn(ahead, float(np.degrees(np.arctan2(way[1], way[0])))) <= TURN

    found: list[tuple[int, int]] = []
    for road in roads:
        if road.closed:
            continue
        last = road.end - 1
        for run in _runs(cells.near(last), road, last, starts):
            fitting = [place for place in run if fits(last, place)]
            if fitting:
                found.append((last, _nearest(plane, last, fitting)))
        for run in _runs(cells.near(road.start), road, road.start, starts):
            fitting = [place for place in run if fits(place, road.start)]
            if fitting:
                found.append((_nearest(plane, road.start, fitting), road.start))
    # Two roads that meet once have one link, the shortest.
    kept: list[tuple[int, int]] = []
    for link in sorted({*found}, key=lambda link: (_apart(plane, link), link)):
        if not any(_same(link, other, roads, starts) for other in kept):
            kept.append(link)
    return sorted(kept)


def _runs(near: Int64, road: Segment, place: int, starts: Int64) -> Iterator[list[int]]:
    """The passes of other roads among some places in order, and those of its own far from it."""
    own = (near >= road.start) & (near < road.end) & (np.abs(near - place) < FEWEST)
    left = near[~own]
    index = np.searchsorted(starts, left, side="right")
    new = (np.diff(left) > 1) | (np.diff(index) > 0)
    for run in np.split(left, np.flatnonzero(new) + 1):
        if len(run):
            yield run.tolist()


def _apart(plane: Float64, link: tuple[int, int]) -> float:
    return float(np.linalg.norm(plane[link[1]] - plane[link[0]]))


def _same(
    one: tuple[int, int], other: tuple[int, int], roads: Sequence[Segment], starts: Int64
) -> bool:
    """Whether two links join the same roads at the same junction."""
    for place, near in zip(one, other, strict=True):
        index, of = np.searchsorted(starts, (place, near), side="right") - 1
        road, apart = roads[index], abs(place - near)
        apart = min(apart, road.end - road.start - apart) if road.closed else apart
        if index != of or apart >= FEWEST:
            return False
    return True


def _nearest(plane: Float64, place: int, among: list[int]) -> int:
    return among[int(np.argmin(np.linalg.norm(plane[among] - plane[place], axis=1)))]


def _turn(one: float, other: float) -> float:
    """Between two headings, from 0 to 180 degrees; 0 if one is not known."""
    turn = abs((other - one + 180) % 360 - 180)
    return 0.0 if np.isnan(turn) else turn


class _Cells:
    """Points by the square that they lie in, to find those within a distance."""

    def __init__(self, points: Float64, within: float) -> None:
        self.points, self.within = points, within
        self.cell = np.floor(points / within).astype(np.int64)
        order = np.lexsort(self.cell.T)
        sorted_ = self.cell[order]
        new = np.flatnonzero((np.diff(sorted_, axis=0) != 0).any(axis=1)) + 1
        parts = np.split(order, new)
        self.of = {tuple(self.cell[part[0]].tolist()): part for part in parts if len(part)}

    def near(self, place: int) -> Int64:
        """The places within the distance of one, in order; itself too."""
        x, y = self.cell[place].tolist()
        around = [(x + i, y + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        found = np.concatenate([self.of[cell] for cell in around if cell in self.of])
        off = np.linalg.norm(self.points[found] - self.points[place], axis=1)
        return np.sort(found[off <= self.within])
