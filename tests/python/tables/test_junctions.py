"""Roads by their positions: closed ones, second laps, links; and their GeoJSON."""

import numpy as np
import numpy.typing as npt
import pytest

from surefix import Segments
from surefix.tables.geojson import point, roads
from surefix.tables.junctions import ends_of, found_links

Float64 = npt.NDArray[np.float64]


def ring(places: int, laps: float = 1, step: float = 2, noise: float = 0) -> Float64:
    turn = 2 * np.pi * np.arange(round(places * laps)) / places
    road = step * places / (2 * np.pi) * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return road + np.random.default_rng(0).normal(0, noise, road.shape)


def line(start: tuple[float, float], way: tuple[float, float], places: int) -> Float64:
    return np.array(start) + np.arange(places)[:, None] * np.array(way, np.float64)


@pytest.mark.parametrize("noise", [0, 0.2])
@pytest.mark.parametrize("places", [20, 30, 200, 2000])
def test_a_ring_is_closed_and_an_arc_is_not(places: int, noise: float) -> None:
    whole = ends_of(ring(places, noise=noise))
    assert whole.closed
    assert whole.apart < 3
    assert whole.again == 0
    assert not ends_of(ring(places, 0.8, noise=noise)).closed


def test_a_ring_of_few_places_is_not_closed_by_itself() -> None:
    assert not ends_of(ring(19)).closed


def test_other_roads_whose_ends_meet_are_not_closed() -> None:
    there = line((0, 0), (2, 0), 60)
    # There and back on the same road: the ends head opposite ways.
    assert not ends_of(np.concatenate([there, there[::-1] + np.array([0, 1])])).closed
    # A robot that stands still under a receiver's noise.
    assert not ends_of(np.random.default_rng(0).normal(0, 0.5, (500, 2))).closed
    assert not ends_of(np.zeros((50, 2))).closed
    assert not ends_of(there[:1]).closed


@pytest.mark.parametrize("laps", [1.1, 1.5, 2, 3])
@pytest.mark.parametrize("noise", [0, 0.2])
def test_a_lap_and_a_bit_says_at_which_place_a_cut_closes_it(laps: float, noise: float) -> None:
    road = ring(200, laps, noise=noise)
    found = ends_of(road)
    assert not found.closed
    assert found.again == pytest.approx(200, abs=1)
    assert ends_of(road[: found.again]).closed


def test_a_lap_that_goes_on_elsewhere_is_no_second_lap() -> None:
    road = np.concatenate([ring(100), line((32, 2), (0, 2), 100)])
    assert ends_of(road).again == 0
    assert not ends_of(road).closed


def test_links_lead_from_ends_into_roads_and_from_roads_to_starts() -> None:
    through, side = line((0, 0), (2, 0), 100), line((100, 1), (0, 2), 50)
    after = line((100, 100), (2, 0), 50)
    town = Segments(200, [100, 150])
    positions = np.concatenate([through, side, after])
    # From the middle of the first into the second; from the second's end into the third.
    assert found_links(positions, [*town], 5) == [(50, 100), (149, 150)]
    assert found_links(positions, [*town], 0.5) == []
    # A link from an end into the middle of a road.
    back = np.concatenate([through, line((60, -40), (0, 2), 20)])
    assert found_links(back, [*Segments(120, [100])], 5) == [(119, 30)]


def test_no_vehicle_turns_round_at_a_link() -> None:
    there = line((0, 0), (2, 0), 100)
    both = np.concatenate([there, there[::-1] + np.array([0, 3])])
    assert found_links(both, [*Segments(200, [100])], 5) == []
    # Nor does it go back to what lies behind it.
    behind = np.concatenate([there, line((180, 0), (2, 0), 3)])
    assert found_links(behind, [*Segments(103, [100])], 19) == [(90, 100), (102, 92)]


def test_links_of_a_closed_road_are_only_those_of_others() -> None:
    circle, out = ring(100), line((34, 0), (2, 0), 30)
    town = Segments(130, [100], closed=[0])
    links = found_links(np.concatenate([circle, out]), [*town], 5)
    assert all(end == 100 for _, end in links)
    assert len(links) == 1


def test_a_road_that_meets_itself_has_a_link() -> None:
    """Round a block and on: its end leads into its middle."""
    road = np.concatenate(
        [
            line((0, 0), (2, 0), 50),
            line((100, 0), (0, 2), 20),
            line((100, 40), (-2, 0), 20),
            line((60, 40), (0, -2), 19),
        ]
    )
    links = found_links(road, [*Segments(len(road))], 6)
    assert links == [(108, 30)]


def test_a_map_as_geojson() -> None:
    degrees = np.array([[48.1, 11.5], [48.2, 11.6], [48.3, 11.7], [48.4, 11.81234567891]])
    made = roads(degrees, [*Segments(4, [3], closed=[0])], [{"name": "ring"}, {"name": "end"}])
    assert made["type"] == "FeatureCollection"
    circle, end = made["features"]
    assert circle["geometry"]["type"] == "LineString"
    line_ = [[11.5, 48.1], [11.6, 48.2], [11.7, 48.3], [11.5, 48.1]]
    assert circle["geometry"]["coordinates"] == line_
    said = {"segment": 0, "first": 0, "last": 2, "closed": True, "name": "ring"}
    assert circle["properties"] == said
    assert end["geometry"] == {"type": "Point", "coordinates": [11.8123457, 48.4]}
    nowhere = point(None, {"frame": 3})
    assert nowhere == {"type": "Feature", "geometry": None, "properties": {"frame": 3}}
