"""GeoJSON (RFC 7946): the roads of a map as lines, fixes as points."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._core import Segment

Float64 = npt.NDArray[np.float64]
Feature = dict[str, Any]
# Of degrees: a centimetre.
DIGITS = 7


def point(degrees: Sequence[float] | None, properties: dict[str, Any]) -> Feature:
    """A point at a latitude and longitude; without a place if these are not known."""
    shape = None if degrees is None else {"type": "Point", "coordinates": _lon_lat([degrees])[0]}
    return {"type": "Feature", "geometry": shape, "properties": properties}


def roads(
    degrees: Float64,
    segments: Iterable[Segment],
    properties: Sequence[dict[str, Any]] | None = None,
) -> dict[str, Any]:
    """A line for each segment, a point for one of a single place; closed ones end at their first.

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
        shape = {"type": "LineString", "coordinates": line}
        features.append({"type": "Feature", "geometry": shape, "properties": given})
    return {"type": "FeatureCollection", "features": features}


def _lon_lat(degrees: Sequence[Sequence[float]]) -> list[list[float]]:
    return [[round(lon, DIGITS), round(lat, DIGITS)] for lat, lon in degrees]
