"""Positions in planar metres: from degrees, along a path, at a time, and the nearest place."""

import numpy as np
import numpy.typing as npt

from surefix.errors import SurefixValueError, mismatch

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

_SEMI_MAJOR = 6_378_137.0  # WGS84
_FLATTENING = 1 / 298.257_223_563
_DISTANCES_AT_ONCE = 4_000_000


def local_metres(
    latitude: npt.ArrayLike, longitude: npt.ArrayLike, origin: tuple[float, float] | None = None
) -> Float64:
    """Latitude and longitude as metres east and north of an origin, on a local plane.

    East is ``N cos(lat0) (lon - lon0)``, north ``M (lat - lat0)``, with the WGS84 radii of
    curvature ``M`` (meridian) and ``N`` (prime vertical) at the origin's latitude: an
    equirectangular projection. For a route of 10 km at 50 degrees its distances are right within
    0.1 %. Give both traverses of a route the same origin, else they are not on one plane.

    Parameters
    ----------
    latitude, longitude : array, shape (n,)
        In degrees, WGS84.
    origin : (latitude, longitude), optional
        In degrees; the median of all by default.

    Returns
    -------
    array of float64, shape (n, 2): east, north

    Raises
    ------
    SurefixValueError
        For two lengths, no point, or a value that is not finite or not on the globe: the error
        names its row.

    Examples
    --------
    >>> from surefix.datasets import local_metres
    >>> local_metres([51.76, 51.761], [-1.26, -1.26], origin=(51.76, -1.26)).round(2).tolist()
    [[0.0, 0.0], [0.0, 111.26]]
    """
    lat, lon = _degrees(latitude, "latitude", 90), _degrees(longitude, "longitude", 360)
    if len(lat) != len(lon):
        got = f"{len(lon)} and {len(lat)}"
        raise SurefixValueError(f"expected as many longitudes as latitudes, got {got}")
    if origin is None:
        if not len(lat):
            raise mismatch("latitude", "at least one point, or an origin", "none")
        origin = centre(lat, lon)
    lat0 = _degrees([origin[0]], "origin latitude", 90)[0]
    lon0 = _degrees([origin[1]], "origin longitude", 540)[0]
    eccentricity2 = _FLATTENING * (2 - _FLATTENING)
    denominator = 1 - eccentricity2 * np.sin(np.radians(lat0)) ** 2
    meridian = _SEMI_MAJOR * (1 - eccentricity2) / denominator**1.5
    prime_vertical = _SEMI_MAJOR / denominator**0.5
    east = prime_vertical * np.cos(np.radians(lat0)) * np.radians(_turned(lon - lon0))
    north = meridian * np.radians(lat - lat0)
    return np.stack([east, north], axis=1)


def centre(latitude: Float64, longitude: Float64) -> tuple[float, float]:
    """The median of some points, in degrees: a wrong fix among them does not move it. They may lie
    on both sides of the date line.
    """
    turned = _turned(longitude - longitude[0])
    return float(np.median(latitude)), float(longitude[0] + np.median(turned))


def subsample(positions: npt.ArrayLike, metres: float) -> Int64:
    """The indices of the first frame, and of each at least ``metres`` from the last one kept.

    The distance is straight from the last kept frame, not summed over the frames between, so that a
    receiver's noise does not add up to a path while the vehicle stands still.

    Parameters
    ----------
    positions : array, shape (n, 2) or (n, 3), in metres
    metres : float
        0 keeps all frames.

    Raises
    ------
    SurefixValueError
        For positions of another shape or not finite, or a negative distance.

    Examples
    --------
    >>> from surefix.datasets import subsample
    >>> subsample([[0, 0], [0.4, 0], [1.1, 0], [1.2, 0], [2.2, 0]], 1.0).tolist()
    [0, 2, 4]
    """
    points = _points(positions, "positions")
    if not (np.isfinite(metres) and metres >= 0):
        raise mismatch("metres", "a distance of 0 or more", metres)
    kept: list[int] = []
    last: list[float] = []
    for index, point in enumerate(points.tolist()):
        if not kept or sum((a - b) ** 2 for a, b in zip(point, last, strict=True)) >= metres**2:
            kept.append(index)
            last = point
    return np.array(kept, dtype=np.int64)


def places_per_metre(positions: npt.ArrayLike) -> float:
    """The number of places that a robot passes in a metre: 1 / the median distance from one place
    to the next. Places at the same position as the one before are left out.

    Parameters
    ----------
    positions : array, shape (n, 2) or (n, 3)
        Of the places in route order, in planar metres, as of ``Map.positions``.

    Raises
    ------
    SurefixValueError
        For positions of another shape or not finite, or if all are the same.

    Examples
    --------
    >>> from surefix.datasets import places_per_metre
    >>> places_per_metre([[0, 0], [2, 0], [4, 0], [4, 2]])
    0.5
    """
    points = _points(positions, "positions")
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if not steps.any():
        raise mismatch("positions", "two places or more at different positions", len(points))
    return 1 / float(np.median(steps[steps > 0]))


def pair_by_position(
    reference_positions: npt.ArrayLike, query_positions: npt.ArrayLike, tolerance: float
) -> Int64:
    """For each query, the nearest reference within a tolerance in metres; -1 for none. Ties: the
    lowest.

    Only the position counts: if a route crosses itself or comes back along the same road, the
    nearest may be of the other pass.

    Parameters
    ----------
    reference_positions : array, shape (n, 2) or (n, 3)
    query_positions : array, shape (m, 2) or (m, 3)
        In planar metres, on the same plane. If either has no height, heights are left out of the
        distance.
    tolerance : float
        In metres.

    Returns
    -------
    array of int64, shape (m,)

    Raises
    ------
    SurefixValueError
        For positions of another shape or not finite, or a negative tolerance.

    Examples
    --------
    >>> from surefix.datasets import pair_by_position
    >>> pair_by_position([[0, 0], [10, 0], [20, 0]], [[9, 1], [60, 0]], tolerance=5).tolist()
    [1, -1]
    """
    references = _points(reference_positions, "reference_positions")
    queries = _points(query_positions, "query_positions")
    if not (np.isfinite(tolerance) and tolerance >= 0):
        raise mismatch("tolerance", "metres, 0 or more", tolerance)
    place, apart = nearest(references, queries)
    return np.where(apart <= tolerance, place, -1)


def nearest(references: Float64, queries: Float64) -> tuple[Int64, Float64]:
    """The nearest reference of each query and its distance; -1 and infinity if there is none, or if
    the query is NaN. Heights count if both have them.
    """
    place, apart = np.full(len(queries), -1, np.int64), np.full(len(queries), np.inf)
    if not len(references):
        return place, apart
    axes = min(references.shape[1], queries.shape[1])
    rows = max(1, _DISTANCES_AT_ONCE // len(references))
    for start in range(0, len(queries), rows):
        chunk = queries[start : start + rows]
        squared = np.zeros((len(chunk), len(references)))
        for axis in range(axes):
            squared += (chunk[:, None, axis] - references[None, :, axis]) ** 2
        squared[np.isnan(squared)] = np.inf
        best = np.argmin(squared, axis=1)
        least = np.sqrt(np.take_along_axis(squared, best[:, None], axis=1)[:, 0])
        place[start : start + rows] = np.where(np.isfinite(least), best, -1)
        apart[start : start + rows] = least
    return place, apart


def interpolate(
    at: Int64, stamps: Int64, positions: Float64, longest_gap: int
) -> tuple[Float64, npt.NDArray[np.bool_]]:
    """Positions at some times, linear between the known ones around each, shape (k, d), and whether
    there are two such that are at most ``longest_gap`` apart, in the unit of the ascending stamps.
    """
    after = np.clip(np.searchsorted(stamps, at, side="left"), 0, len(stamps) - 1)
    exact = stamps[after] == at
    before = np.where(exact, after, np.maximum(after - 1, 0))
    # In integers: a float64 has no room for nanoseconds since 1970.
    gap = stamps[after] - stamps[before]
    known = exact | ((stamps[before] < at) & (at < stamps[after]) & (gap <= longest_gap))
    fraction = np.where(known, (at - stamps[before]) / np.maximum(gap, 1), 0.0)[:, None]
    return positions[before] + fraction * (positions[after] - positions[before]), known


def _turned(degrees: Float64) -> Float64:
    """An angle between -180 and 180."""
    return (degrees + 180) % 360 - 180


def _degrees(values: npt.ArrayLike, what: str, limit: float) -> Float64:
    array = np.atleast_1d(np.asarray(values, dtype=np.float64))
    if array.ndim != 1:
        raise mismatch(what, "the shape (n,)", array.shape)
    wrong = np.flatnonzero(~(np.abs(array) <= limit))
    if len(wrong):
        got = array[wrong[0]]
        raise mismatch(what, f"degrees between -{limit} and {limit}", f"{got} in row {wrong[0]}")
    return array


def _points(values: npt.ArrayLike, what: str) -> Float64:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] not in (2, 3):
        raise mismatch(what, "the shape (n, 2) or (n, 3)", array.shape)
    wrong = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if len(wrong):
        raise mismatch(what, "finite metres", f"{array[wrong[0]].tolist()} in row {wrong[0]}")
    return array
