"""Metres on a plane, a frame every few metres, the nearest place: against formulae written
another way.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

import surefix
from surefix.datasets import local_metres, pair_by_position, subsample
from surefix.tables.metres import interpolate

A, E2 = 6378137.0, 6.69437999014e-3  # WGS84, as tabulated


def earth_centred(latitude: float, longitude: float) -> npt.NDArray[np.float64]:
    lat, lon = math.radians(latitude), math.radians(longitude)
    n = A / math.sqrt(1 - E2 * math.sin(lat) ** 2)
    across = n * math.cos(lat)
    return np.array([across * math.cos(lon), across * math.sin(lon), n * (1 - E2) * math.sin(lat)])


def haversine(latitude: npt.NDArray[np.float64], longitude: npt.NDArray[np.float64]) -> float:
    """Between two points, on the sphere that fits the ellipsoid in their direction (Euler's
    radius).
    """
    lat, lon = np.radians(latitude), np.radians(longitude)
    half = (
        np.sin((lat[1] - lat[0]) / 2) ** 2
        + np.cos(lat[0]) * np.cos(lat[1]) * np.sin((lon[1] - lon[0]) / 2) ** 2
    )
    bearing = math.atan2((lon[1] - lon[0]) * math.cos(lat.mean()), lat[1] - lat[0])
    under = 1 - E2 * math.sin(lat.mean()) ** 2
    meridian, vertical = A * (1 - E2) / under**1.5, A / math.sqrt(under)
    radius = 1 / (math.cos(bearing) ** 2 / meridian + math.sin(bearing) ** 2 / vertical)
    return float(2 * radius * math.asin(math.sqrt(half)))


@pytest.mark.parametrize(
    "centre", [(51.76, -1.26), (48.19, 11.61), (0.0, 0.0), (-27.47, 153.02), (67.28, 14.4)]
)
def test_distances_are_those_on_the_ellipsoid(centre: tuple[float, float]) -> None:
    random = np.random.default_rng(1)
    for _ in range(50):
        lat = centre[0] + random.uniform(-0.01, 0.01, 2)
        lon = centre[1] + random.uniform(-0.01, 0.01, 2)
        east, north = np.diff(local_metres(lat, lon), axis=0)[0]
        chord = np.linalg.norm(earth_centred(lat[1], lon[1]) - earth_centred(lat[0], lon[0]))
        assert math.hypot(east, north) == pytest.approx(chord, rel=1e-3)
        assert math.hypot(east, north) == pytest.approx(haversine(lat, lon), rel=1e-3)
        assert (
            np.sign([east, north]).tolist() == np.sign([lon[1] - lon[0], lat[1] - lat[0]]).tolist()
        )


def test_a_common_origin_puts_two_traverses_on_one_plane() -> None:
    lat, lon = np.array([51.75, 51.76, 51.77]), np.array([-1.27, -1.26, -1.25])
    whole = local_metres(lat, lon, (51.76, -1.26))
    np.testing.assert_array_equal(local_metres(lat[1:], lon[1:], (51.76, -1.26)), whole[1:])
    np.testing.assert_allclose(whole[1], 0, atol=1e-9)
    np.testing.assert_allclose(local_metres(lat, lon).mean(axis=0), 0, atol=1e-6)


def test_the_date_line_is_no_edge() -> None:
    metres = local_metres([-17.0, -17.0], [179.999, -179.999])
    assert metres[1, 0] - metres[0, 0] == pytest.approx(
        0.002 * 111320 * math.cos(math.radians(17)), rel=2e-3
    )


@pytest.mark.parametrize(
    ("latitude", "longitude", "said"),
    [
        ([91.0], [0.0], "row 0"),
        ([0.0, math.nan], [0.0, 0.0], "row 1"),
        ([0.0], [361.0], "longitude"),
        ([0.0], [0.0, 1.0], "got 2 and 1"),
        ([], [], "at least one"),
        ([[0.0]], [[0.0]], r"\(n,\)"),
    ],
)
def test_degrees_off_the_globe_are_named(
    latitude: list[float], longitude: list[float], said: str
) -> None:
    with pytest.raises(surefix.SurefixValueError, match=said):
        local_metres(latitude, longitude)


def test_a_subsample_is_spaced_and_leaves_no_hole() -> None:
    random = np.random.default_rng(2)
    steps = random.uniform(0, 0.8, 500)
    along = np.cumsum(steps)
    positions = np.stack([along, np.zeros(500)], axis=1)
    kept = subsample(positions, 2.0)
    apart = np.diff(along[kept])
    assert kept[0] == 0
    assert (apart >= 2.0).all()
    assert (apart < 2.0 + 0.8).all()
    np.testing.assert_array_equal(subsample(positions, 0), np.arange(500))


def test_a_standstill_with_a_noisy_receiver_is_one_frame() -> None:
    noise = np.random.default_rng(3).uniform(-0.1, 0.1, (1000, 2))
    assert subsample(noise, 1.0).tolist() == [0]
    assert subsample(np.zeros((0, 2)), 1.0).tolist() == []


@pytest.mark.parametrize("axes", [(2, 2), (3, 3), (2, 3), (3, 2)])
def test_the_nearest_place_is_the_one_that_a_loop_finds(axes: tuple[int, int]) -> None:
    random = np.random.default_rng(4)
    references, queries = random.uniform(0, 50, (70, axes[0])), random.uniform(0, 50, (40, axes[1]))
    shared = min(axes)
    for query, place in zip(queries, pair_by_position(references, queries, 6.0), strict=True):
        distances = [math.dist(query[:shared], reference[:shared]) for reference in references]
        best = min(range(70), key=distances.__getitem__)
        assert place == (best if distances[best] <= 6.0 else -1)


def test_pairing_in_chunks_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(5)
    references, queries = random.uniform(0, 50, (70, 2)), random.uniform(0, 50, (40, 2))
    whole = pair_by_position(references, queries, 6.0)
    monkeypatch.setattr("surefix.tables.metres._DISTANCES_AT_ONCE", 71 * 3)
    np.testing.assert_array_equal(pair_by_position(references, queries, 6.0), whole)


def test_ties_go_to_the_lowest_index_and_the_tolerance_is_within() -> None:
    assert pair_by_position([[0, 0], [2, 0], [0, 0]], [[1, 0], [0, 0], [5, 0]], 1.0).tolist() == [
        0,
        0,
        -1,
    ]
    assert pair_by_position([[0, 0]], [[3, 4]], 5.0).tolist() == [0]
    assert pair_by_position(np.zeros((0, 2)), [[3, 4]], 5.0).tolist() == [-1]
    far = 1e7  # UTM: differences are taken before squares
    assert pair_by_position([[far, far], [far + 1e-3, far]], [[far + 1e-3, far]], 1.0).tolist() == [
        1
    ]


@pytest.mark.parametrize(
    "call",
    [
        lambda: pair_by_position([[0.0]], [[0.0, 0.0]], 1),
        lambda: pair_by_position([[0.0, math.inf]], [[0.0, 0.0]], 1),
        lambda: pair_by_position([[0.0, 0.0]], [[0.0, 0.0]], -1),
        lambda: subsample([[0.0, 0.0]], math.nan),
        lambda: subsample([0.0, 0.0], 1),
    ],
)
def test_what_is_no_position_is_refused(call: object) -> None:
    assert callable(call)
    with pytest.raises(surefix.SurefixValueError):
        call()


def test_interpolation_in_time_keeps_nanoseconds_apart() -> None:
    start = 1_600_000_000_000_000_001  # a float64 would round this to a multiple of 256
    stamps = start + np.array([0, 100, 1000])
    at = start + np.array([-1, 0, 25, 100, 150, 1000, 1001])
    positions, known = interpolate(
        at, stamps, np.array([[0.0, 0.0], [4.0, 8.0], [10.0, 20.0]]), 200
    )
    assert known.tolist() == [False, True, True, True, False, True, False]
    np.testing.assert_allclose(positions[known], [[0, 0], [1, 2], [4, 8], [10, 20]])
