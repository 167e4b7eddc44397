"""Positions in degrees: into the map with their origin, and out again; thumbnails."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

import surefix
from commands import surefix_
from recordings import Bag
from surefix.simulate import Route
from surefix.tables.geojson import roads

pytestmark = pytest.mark.usefixtures("undrawn")

N = 40
UInt8 = npt.NDArray[np.uint8]
LATITUDE, LONGITUDE = 48.1, 11.5


def degrees(count: int = N, start: int = 0) -> npt.NDArray[np.float64]:
    """A road to the north-east: about 3 m a place."""
    way = np.arange(start, start + count)
    return np.stack([LATITUDE + way * 2e-5, LONGITUDE + way * 2e-5], axis=1)


@pytest.fixture(scope="module")
def road(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive and another as bags with GPS, the second of a part; and as images with a table."""
    folder = tmp_path_factory.mktemp("road")
    route = Route(places=N, size=(64, 32), seed=3)
    for name, drive, part in (
        ("monday", route.reference(), range(N)),
        ("tuesday", route.revisit(), range(15, N)),
    ):
        (folder / name).mkdir()
        with Bag(folder, "ros1", f"{name}.bag") as bag:
            for index in part:
                at = 100 + index / 4
                bag.image("/camera", drive[index], at)
                fix = *degrees(1, index)[0].tolist(), 0.0, 0
                bag.pose("/fix", "sensor_msgs/msg/NavSatFix", fix, at)
                Image.fromarray(drive[index]).save(folder / name / f"{index:03}.png")
        rows = [f"{lat:.9f},{lon:.9f}" for lat, lon in degrees(len(part), part[0])]
        (folder / f"{name}.csv").write_text("\n".join(["latitude,longitude", *rows]) + "\n")
    given = "--positions", folder / "monday.csv", "--thumbnails"
    surefix_("map", "build", folder / "monday", *given, "-o", folder / "map")
    return folder


def test_degrees_of_a_table_are_kept_with_their_origin(road: Path) -> None:
    known = surefix.Map.open(road / "map")
    assert known.origin == pytest.approx(np.median(degrees(), axis=0), abs=1e-9)
    assert known.degrees == pytest.approx(degrees(), abs=1e-8)
    shown = surefix_("map", "info", road / "map").stdout
    assert "2 coordinates a place, metres east and north of 48.1004, 11.5004 (WGS84)" in shown
    facts = json.loads(surefix_("map", "info", road / "map", "--json").stdout)
    assert facts["origin"] == list(known.origin or ())
    assert facts["thumbnails"] == [48, 96]


def test_degrees_of_a_bag_are_kept_with_their_origin(road: Path, tmp_path: Path) -> None:
    sampled = "--metres", 3, "--odometry", "/fix"
    surefix_("map", "build", road / "monday.bag", *sampled, "-o", tmp_path / "map")
    known = surefix.Map.open(tmp_path / "map")
    assert known.origin is not None
    assert known.degrees is not None
    assert known.degrees[0] == pytest.approx(degrees()[0], abs=1e-7)


def test_a_map_grows_on_its_own_plane(road: Path, tmp_path: Path) -> None:
    out = tmp_path / "map"
    first, second = tmp_path / "first.csv", tmp_path / "second.csv"
    lines = (road / "monday.csv").read_text().splitlines()
    first.write_text("\n".join(lines[:21]))
    second.write_text("\n".join([lines[0], *lines[21:]]))
    images = road / "monday" / "0[01]?.png", road / "monday" / "0[23]?.png"
    surefix_("map", "build", images[0], "--positions", first, "-o", out)
    surefix_("map", "append", out, images[1], "--positions", second)
    assert surefix.Map.open(out).degrees == pytest.approx(degrees(), abs=1e-8)
    # The same by the GPS of a bag.
    sampled = "--metres", 1, "--odometry", "/fix"
    surefix_("map", "build", road / "monday.bag", *sampled, "-o", out)
    origin = surefix.Map.open(out).origin
    surefix_("map", "append", out, road / "tuesday.bag", *sampled)
    known = surefix.Map.open(out)
    assert known.origin == origin
    assert known.degrees is not None
    assert known.degrees[N:] == pytest.approx(degrees(25, 15), abs=1e-7)


def test_degrees_do_not_go_onto_a_plane_of_which_nothing_is_known(
    road: Path, tmp_path: Path
) -> None:
    out = tmp_path / "map"
    np.save(tmp_path / "metres.npy", np.arange(2.0 * N).reshape(N, 2))
    surefix_("map", "build", road / "monday", "--positions", tmp_path / "metres.npy", "-o", out)
    before = out.read_bytes()
    given = (
        [road / "tuesday", "--positions", road / "tuesday.csv"],
        [road / "tuesday.bag", "--metres", 1, "--odometry", "/fix"],
    )
    for arguments in given:
        done = surefix_("map", "append", out, *arguments, code=1)
        assert "expected metres, as the map's, which has no origin, got degrees" in done.stderr
    assert out.read_bytes() == before


def test_a_zone_of_names_is_the_maps_plane(tmp_path: Path) -> None:
    images = Route(places=6, size=(64, 32)).reference()
    for zone in ("55", "56"):
        (tmp_path / zone).mkdir()
        for index, image in enumerate(images):
            name = f"@{500000 + 3 * index}@{6000000}@{zone}@S@-35.1@149.1@{index}@.jpg"
            Image.fromarray(image).save(tmp_path / zone / name)
    out = tmp_path / "map"
    given = "--positions", tmp_path / "55"
    surefix_("map", "build", tmp_path / "55", *given, "-o", out)
    assert surefix.Map.open(out).plane == "UTM 55S"
    assert "in metres of UTM 55S" in surefix_("map", "info", out).stdout
    other = tmp_path / "56", "--positions", tmp_path / "56"
    done = surefix_("map", "append", out, *other, code=1)
    assert "expected zone 55S, as the map's, got 56S" in done.stderr


def test_the_queries_degrees_come_onto_the_maps_plane(road: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    for drive, where in (
        (road / "tuesday", road / "tuesday.csv"),
        (road / "tuesday.bag", "/fix"),
    ):
        given = drive, "--query-positions", where, "--tolerance", 1
        surefix_("eval", road / "map", *given, "--method", "sequence", "-o", tmp_path / "r")
        with (tmp_path / "r" / "fixes.csv").open() as file:
            rows = [row for row in csv.DictReader(file) if row["method"] == "sequence"]
        truth = [int(row["true_place"]) for row in rows]
        assert truth == list(range(15, N))


def test_fixes_have_positions_and_degrees(road: Path, tmp_path: Path) -> None:
    out = tmp_path / "fixes.csv"
    surefix_("run", road / "map", road / "tuesday", "-o", out)
    known = surefix.Map.open(road / "map")
    assert known.positions is not None
    assert known.degrees is not None
    with out.open() as file:
        rows = [*csv.DictReader(file)]
    for row in rows:
        place = int(row["place"])
        at = float(row["x"]), float(row["y"])
        assert at == pytest.approx(tuple(known.positions[place]), abs=1e-4)
        where = float(row["latitude"]), float(row["longitude"])
        assert where == pytest.approx(tuple(known.degrees[place]), abs=1e-8)
        assert (row["segment"], row["segment_place"]) == ("0", row["place"])


def test_fixes_of_several_segments_say_which(road: Path, tmp_path: Path) -> None:
    out, route = tmp_path / "fixes.csv", tmp_path / "map"
    surefix_("map", "build", road / "monday", "--break", 20, "-o", route)
    surefix_("run", route, road / "tuesday", "-o", out)
    with out.open() as file:
        rows = [*csv.DictReader(file)]
    assert "x" not in rows[0]
    for row in rows:
        segment, place = int(row["segment"]), int(row["segment_place"])
        assert 20 * segment + place == int(row["place"])


def test_a_route_and_fixes_as_geojson(road: Path, tmp_path: Path) -> None:
    route, fixes = tmp_path / "route.geojson", tmp_path / "fixes.geojson"
    surefix_("map", "info", road / "map", "--geojson", route)
    made = json.loads(route.read_text())
    (line,) = made["features"]
    assert line["properties"] == {"segment": 0, "first": 0, "last": N - 1, "closed": False}
    found = np.array(line["geometry"]["coordinates"])
    assert found[:, ::-1] == pytest.approx(degrees(), abs=1e-6)
    surefix_("run", road / "map", road / "tuesday", "-o", fixes)
    points = json.loads(fixes.read_text())["features"]
    assert len(points) == 25
    for each in points:
        assert each["geometry"]["type"] == "Point"
        said = each["properties"]
        at = [said["longitude"], said["latitude"]]
        assert each["geometry"]["coordinates"] == pytest.approx(at, abs=1e-6)
    same = surefix_("run", road / "map", road / "tuesday", "--format", "geojson").stdout
    assert len(json.loads(same)["features"]) == 25


def test_geojson_needs_degrees(road: Path, tmp_path: Path) -> None:
    plain = tmp_path / "map"
    surefix_("map", "build", road / "monday", "-o", plain)
    out = tmp_path / "out.geojson"
    for arguments in (
        ["map", "info", plain, "--geojson", out],
        ["run", plain, road / "tuesday", "-o", out],
    ):
        done = surefix_(*arguments, code=2, COLUMNS="300")
        words = " ".join(done.stderr.split())
        assert "expected a map that knows its latitudes and longitudes, got none" in words
        assert "--positions or --odometry of degrees" in words
        assert not out.exists()
    done = surefix_("map", "info", road / "map", "--geojson", road / "map", code=2, COLUMNS="300")
    assert "is the map; name another file" in done.stderr
    surefix_("map", "info", road / "map", "--geojson", tmp_path / "no" / "x", code=1)


@pytest.mark.parametrize("place", ["monday", "monday.bag"])
def test_views_show_the_maps_thumbnails(place: str, road: Path, tmp_path: Path) -> None:
    from surefix.live.view import References

    out = tmp_path / "map"
    surefix_("map", "build", road / place, "--thumbnails", "-o", out)
    known = surefix.Map.open(out)
    shown = References(known)
    assert shown
    for at in (0, N - 1):
        small = shown.image(at)
        assert small is not None
        assert np.array_equal(small, known.thumbnail(at))
    surefix_("map", "append", out, road / "tuesday.bag")
    longer = surefix.Map.open(out)
    assert longer.thumbnail(len(longer) - 1) is not None


def test_ready_descriptors_have_no_thumbnails(tmp_path: Path) -> None:
    np.save(tmp_path / "rows.npy", np.eye(8, dtype=np.float32))
    given: tuple[Any, ...] = tmp_path / "rows.npy", "--thumbnails", "-o", tmp_path / "map"
    done = surefix_("map", "build", *given, code=2, COLUMNS="300")
    assert "--thumbnails: expected images, got the ready descriptors" in done.stderr


def test_the_plane_of_metres_is_named_by_hand(road: Path, tmp_path: Path) -> None:
    np.save(tmp_path / "metres.npy", np.stack([3.0 * np.arange(N), np.zeros(N)], axis=1))
    given = "map", "build", road / "monday", "-o", tmp_path / "map"
    metres = "--positions", tmp_path / "metres.npy"
    surefix_(*given, *metres, "--plane", "UTM 32U")
    assert surefix.Map.open(tmp_path / "map").plane == "UTM 32U"
    assert "in metres of UTM 32U" in surefix_("map", "info", tmp_path / "map").stdout
    surefix_(*given, *metres, "--plane", "-27.47,153.02")
    route = surefix.Map.open(tmp_path / "map")
    assert (route.plane, route.origin) == (None, (-27.47, 153.02))
    assert route.degrees is not None
    assert route.degrees[0] == pytest.approx([-27.47, 153.02])
    for wrong, why in (
        (("--plane", "x"), "--plane: expected --positions too, in metres"),
        (("--positions", road / "monday.csv", "--plane", "x"), "metres that name no plane"),
        ((*metres, "--plane", " "), "expected a name, or LATITUDE,LONGITUDE, got none"),
        ((*metres, "--plane", "95,1"), "a latitude from -90 to 90 and a longitude, got 95,1"),
    ):
        said = surefix_(*given, *wrong, code=2).stderr
        assert why in " ".join(said.replace("│", " ").split())


def test_lines_across_180_degrees_are_cut() -> None:
    """As RFC 7946, 3.1.9, has them."""
    longitude = [179.998, 179.999, -179.999, -179.998, 179.997]
    degrees_ = np.stack([np.arange(5) / 100, longitude], axis=1)
    segments = surefix.Segments(5)
    (line,) = roads(degrees_, segments)["features"]
    assert line["geometry"] == {
        "type": "MultiLineString",
        "coordinates": [
            [[179.998, 0.0], [179.999, 0.01], [180.0, 0.015]],
            [[-180.0, 0.015], [-179.999, 0.02], [-179.998, 0.03], [-180.0, 0.034]],
            [[180.0, 0.034], [179.997, 0.04]],
        ],
    }
    # A place on the meridian itself belongs to both pieces.
    degrees_ = np.array([[0.0, 179.999], [0.01, -180.0], [0.02, -179.999]])
    (line,) = roads(degrees_, surefix.Segments(3))["features"]
    assert line["geometry"]["coordinates"] == [
        [[179.999, 0.0], [180.0, 0.01]],
        [[-180.0, 0.01], [-179.999, 0.02]],
    ]
    (line,) = roads(np.array([[0.0, 180.0], [0.02, -179.999]]), surefix.Segments(2))["features"]
    coordinates = [[-180.0, 0.0], [-179.999, 0.02]]
    assert line["geometry"] == {"type": "LineString", "coordinates": coordinates}
