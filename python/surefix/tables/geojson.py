"""GeoJSON (RFC 7946): the roads of a map as lines, fixes as points."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._core import Segment

Float64 = npt.NDArray[np.float64]
Feature = dict[str, Any]
# Of degrees: a centimetre.
DIGITS = 7
HALF = 180.0


def point(degrees: Sequence[float] | None, properties: dict[str, Any]) -> Feature:
    """A point at a latitude and longitude; without a place if these are not known."""
    shape = None if degrees is None else {"type": "Point", "coordinates": _lon_lat([degrees])[0]}
    return {"type": "Feature", "geometry": shape, "properties": properties}


def roads(
    degrees: Float64,
    segments: Iterable[Segment],
    properties: Sequence[dict[str, Any]] | None = None,
) -> dict[str, Any]:
    """A line for each segment, a point for one of a single place; closed ones end at their first. A
    line across the meridian of 180 degrees is cut there.

    ``degrees`` are the places' latitudes and longitudes, (n, 2); ``properties`` are further ones
    of each segment.
    """
    features = []
    for index, road in enumerate(segments):
        given: dict[str, Any] = {"segment": index, "first": road.start, "last": road.end - 1}
        given |= {"closed": road.closed} | (properties[index] if properties else {})
        if road.end - road.start == 1:
            features.append(point(degrees[road.start].tolist(), given))
            continue
        line = _lon_lat(degrees[road.start : road.end].tolist())
        line += line[:1] if road.closed else []
        pieces = cut(line)
        shape: Feature = {"type": "LineString", "coordinates": pieces[0]}
        if len(pieces) > 1:
            shape = {"type": "MultiLineString", "coordinates": pieces}
        features.append({"type": "Feature", "geometry": shape, "properties": given})
    return {"type": "FeatureCollection", "features": features}


def cut(line: list[list[float]]) -> list[list[list[float]]]:
    """A line of longitudes and latitudes in pieces that do not cross the meridian of 180 degrees
    (RFC 7946, 3.1.9).
    """
    pieces = [line[:1]]
    for (lon, lat), (to, at) in pairwise(line):
        if abs(to - lon) > HALF:
            side = math.copysign(HALF, lon)
            share = (side - lon) / (to + 2 * side - lon)
            middle = round(lat + share * (at - lat), DIGITS)
            # A place at 180 degrees itself is written once.
            pieces[-1] += [[side, middle]] if [side, middle] != [lon, lat] else []
            pieces.append([[-side, middle]] if [-side, middle] != [to, at] else [])
        pieces[-1].append([to, at])
    return [piece for piece in pieces if len(piece) > 1] or [line]


def _lon_lat(degrees: Sequence[Sequence[float]]) -> list[list[float]]:
    return [[round(lon, DIGITS), round(lat, DIGITS)] for lat, lon in degrees]
