"""Positions on a plane that is known: origins, degrees, and where a fix is."""

import copy
import pickle

import numpy as np
import numpy.typing as npt
import pytest

import surefix
from surefix import Map, SurefixValueError
from surefix.datasets import local_metres

RNG = np.random.default_rng(5)
ROWS = RNG.standard_normal((20, 16)).astype(np.float32)


def apart(one: npt.NDArray[np.float64], other: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return np.abs((np.asarray(one) - other + 180) % 360 - 180)


@pytest.mark.parametrize("origin", [(51.5, -0.1), (-33.9, 179.999), (0.0, -180.0), (78.2, 15.6)])
def test_degrees_come_back_from_local_metres(origin: tuple[float, float]) -> None:
    latitude = origin[0] + RNG.uniform(-0.2, 0.2, 20)
    longitude = origin[1] + RNG.uniform(-0.2, 0.2, 20)
    metres = local_metres(latitude, longitude, origin)
    route = Map.from_descriptors(ROWS, positions=metres, origin=origin)
    assert route.origin == origin
    assert route.plane is None
    assert np.abs(route.degrees[:, 0] - latitude).max() < 1e-9
    assert apart(route.degrees[:, 1], longitude).max() < 1e-9
    again = pickle.loads(pickle.dumps(route))
    assert np.array_equal(again.degrees, route.degrees)


def test_joined_maps_lie_on_the_plane_of_the_first() -> None:
    latitude, longitude = np.linspace(10, 10.02, 20), np.linspace(179.99, 180.01, 20)
    maps = []
    for part in (slice(0, 12), slice(12, 20)):
        here = latitude[part], longitude[part]
        origin = (here[0][0], here[1][-1])
        metres = np.column_stack([local_metres(*here, origin), np.arange(len(here[0]))])
        maps.append(Map.from_descriptors(ROWS[part], positions=metres, origin=origin))
    joined = Map.join(maps)
    assert joined.origin == maps[0].origin
    expected = local_metres(latitude, longitude, maps[0].origin)
    assert np.abs(joined.positions[:, :2] - expected).max() < 1e-6
    assert np.array_equal(joined.positions[12:, 2], np.arange(8))
    assert apart(joined.degrees[:, 1], longitude).max() < 1e-9
    other = maps[1].with_positions(maps[1].positions)
    assert (other.origin, other.plane, other.degrees) == (None, None, None)
    with pytest.raises(SurefixValueError, match="around an origin, got positions of 3 coordinates"):
        Map.join([maps[0], other])
    named = maps[1].with_positions(maps[1].positions, origin="UTM 55S")
    assert (named.plane, named.origin) == ("UTM 55S", None)
    with pytest.raises(SurefixValueError, match="on the plane UTM 55S"):
        Map.join([maps[0], named])


def test_a_fix_a_run_and_an_alignment_have_positions() -> None:
    metres = np.column_stack([np.arange(20) * 3.0, np.arange(20) * -1.5])
    route = Map.from_descriptors(ROWS, positions=metres, origin=(51.5, -0.1))
    localizer = surefix.Localizer(route, motion="free")
    fixes = [localizer.push(row) for row in ROWS]
    run = surefix.match(route, ROWS, motion="free")
    assert fixes == list(run)
    assert np.array_equal(run.positions, metres[run.place])
    assert np.array_equal(run.degrees, route.degrees[run.place])
    position = fixes[7].position
    assert position.metres == tuple(metres[fixes[7].place])
    assert position.degrees == tuple(route.degrees[fixes[7].place])
    assert repr(position).startswith("Position(metres=(")
    for thing in (fixes[7], position, copy.copy(fixes[7])):
        assert pickle.loads(pickle.dumps(thing)) == thing
    assert np.array_equal(pickle.loads(pickle.dumps(run)).degrees, run.degrees)
    alignment = surefix.align(route, ROWS)
    assert np.array_equal(alignment.degrees, route.degrees[alignment.place])
    # Without an origin, and without positions.
    plain = route.with_positions(metres)
    run = surefix.match(plain, ROWS)
    assert run.degrees is None
    assert run[3].position.degrees is None
    bare = Map.from_descriptors(ROWS)
    assert surefix.match(bare, ROWS).positions is None
    assert surefix.match(bare, ROWS)[3].position is None
    assert surefix.match_distances(1 - np.eye(5, dtype=np.float32))[2].position is None
    # Of several maps, the first that has positions.
    run = surefix.match([bare, route], [ROWS, ROWS])
    assert np.array_equal(run.positions, metres[run.place])


def test_maps_of_different_segments_are_not_fused() -> None:
    one = Map.from_descriptors(ROWS)
    two = Map.from_descriptors(ROWS, breaks=[5])
    with pytest.raises(SurefixValueError, match="maps of the same segments"):
        surefix.Localizer([one, two])


def test_thumbnails_are_set_and_taken() -> None:
    route = Map.from_descriptors(ROWS)
    assert route.thumbnails is None
    assert route.thumbnail(3) is None
    pictures = RNG.integers(0, 255, (20, 5, 8), np.uint8)
    route = route.with_thumbnails(pictures)
    assert np.array_equal(route.thumbnails, pictures)
    assert np.array_equal(route.cut(4, 9).thumbnails, pictures[4:9])
    assert np.array_equal(route.keep([1, 7, 18]).thumbnails, pictures[[1, 7, 18]])
    assert np.array_equal(Map.join([route, route]).thumbnails, np.concatenate([pictures] * 2))
    assert np.array_equal(Map.from_bytes(route.to_bytes()).thumbnails, pictures)
    for wrong in (pictures[:19], pictures[0], pictures.astype(np.float32)):
        with pytest.raises(SurefixValueError, match="thumbnails"):
            route.with_thumbnails(wrong)
    with pytest.raises(SurefixValueError, match="a place from 0 to 19"):
        route.thumbnail(20)
