"""The route as it lies in rerun: on a map of the world, in plan, or in space."""

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from surefix import Map
from surefix.live.view import rgb
from surefix.tables.geojson import cut
from surefix.tables.utm import map_degrees

__all__ = ["Ground", "Kind"]

# Its view: with degrees, with two coordinates, with three.
Kind = Literal["map", "plan", "space"]


class Ground:
    """Lines and points at the positions of places, as rerun's archetypes.

    Positions in metres are drawn from the map's first, which keeps a national grid exact; of two
    coordinates, the second is drawn upwards.
    """

    # The most places of the route that are drawn.
    PLACES = 20_000
    # The points of the view that the route may fill: high and wide.
    SHOWN = 180, 380

    def __init__(self, rr: Any, route: Map) -> None:
        where, degrees = route.positions, map_degrees(route)
        assert where is not None
        self.rr, self.segments = rr, route.segments
        self.kind: Kind = "plan" if where.shape[1] == 2 else "space"
        self.at: NDArray[Any] = (where - where[0]).astype(np.float32)
        if degrees is not None:
            self.kind, self.at = "map", degrees
        elif self.kind == "plan":
            self.at[:, 1] *= -1

    @property
    def zoom(self) -> float | None:
        """The zoom of a map of the world that shows the whole route in a part of a window."""
        if self.kind != "map":
            return None
        latitude, longitude = self.at.T
        shrunk = np.cos(np.radians(np.median(latitude)))
        # Of a route on both sides of the meridian of 180 degrees.
        longitude = np.unwrap(longitude, period=360)
        high, wide = np.ptp(latitude) / shrunk, np.ptp(longitude)
        least = max(high / self.SHOWN[0], wide / self.SHOWN[1], 1e-7)
        # At zoom 0, the 360 degrees of the equator are 256 points wide.
        return float(np.log2(360 / 256 / least))

    def lines(self, colour: str, width: float) -> Any:
        """A line for each segment: the route, with its breaks."""
        step, drawn = -(-len(self.at) // self.PLACES), []
        for road in self.segments:
            line = self.at[road.start : road.end]
            # Its last place is drawn, whatever the step.
            line = np.concatenate([line[:-1:step], line[-1:]])
            drawn.append(np.concatenate([line, line[:1]]) if road.closed else line)
        style = {"colors": rgb(colour), "radii": self.rr.Radius.ui_points(width)}
        if self.kind == "map":
            cuts = [piece for line in drawn for piece in cut(line[:, ::-1].tolist())]
            flipped = [[at[::-1] for at in piece] for piece in cuts]
            return self.rr.GeoLineStrings(lat_lon=flipped, **style)
        return (self.rr.LineStrips2D if self.kind == "plan" else self.rr.LineStrips3D)(
            drawn, **style
        )

    def starts(self, colour: str, size: float) -> Any:
        """The first place of each segment, of several; else None."""
        first = [road.start for road in self.segments]
        return self.points(first, colour, size) if len(first) > 1 else None

    def points(self, places: list[int], colour: str, size: float) -> Any:
        """Some places."""
        style = {"colors": rgb(colour), "radii": self.rr.Radius.ui_points(size)}
        at = self.at[places]
        if self.kind == "map":
            return self.rr.GeoPoints(lat_lon=at, **style)
        return (self.rr.Points2D if self.kind == "plan" else self.rr.Points3D)(at, **style)
