"""Positions of a UTM zone as degrees, and back, by PROJ."""

import re
from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._core import Map
from surefix._extra import require
from surefix.errors import mismatch

Float64 = npt.NDArray[np.float64]

# A map's plane is this and the zone.
UTM = "UTM "
# The zone's number and its band of latitude; those from N on lie in the north.
_ZONE = re.compile(r"0*([1-9]|[1-5]\d|60)([C-HJ-NP-X])", re.IGNORECASE)


def zone_of(route: Map) -> str | None:
    """The UTM zone of a map's positions, such as "33U", if it is known."""
    plane = route.plane
    return plane.removeprefix(UTM) if plane is not None and plane.startswith(UTM) else None


def map_degrees(route: Map, asked: bool = False) -> Float64 | None:
    """The latitude and longitude of each place, (n, 2); None if they are not known. Those of a UTM
    zone take pyproj: without it they are None, or, if they are ``asked`` for, an error.
    """
    zone, where = zone_of(route), route.positions
    lacking = zone is None or where is None or not _ZONE.fullmatch(zone)
    if lacking or not (asked or find_spec("pyproj")):
        return route.degrees
    assert zone is not None
    assert where is not None
    longitude, latitude = _projection(zone)(where[:, 0], where[:, 1], inverse=True)
    return np.stack([latitude, longitude], axis=1)


def utm_metres(degrees: Float64, zone: str) -> Float64:
    """Latitudes and longitudes as easting and northing in a zone; NaN stays NaN."""
    known = np.isfinite(degrees).all(axis=1)
    metres = np.full((len(degrees), 2), np.nan)
    latitude, longitude = degrees[known].T
    metres[known] = np.stack(_projection(zone)(longitude, latitude), axis=1)
    return metres


def _projection(zone: str) -> Any:
    """From longitude and latitude to easting and northing."""
    found = _ZONE.fullmatch(zone)
    if found is None:
        raise mismatch("the UTM zone", "a number and the letter of its band, such as 33U", zone)
    module = require("pyproj", "degrees of a UTM zone", "pyproj", "surefix[gps]")
    south = found[2].upper() < "N"
    return module.Proj(proj="utm", zone=int(found[1]), south=south, ellps="WGS84")
