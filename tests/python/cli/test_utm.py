"""Maps whose positions are of a UTM zone: their degrees, and truths in degrees."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import surefix
from commands import surefix_
from surefix.simulate import Route
from surefix.tables import utm
from surefix.tables.positions import Positions, on_one_plane
from surefix.tables.utm import map_degrees, utm_metres

pytest.importorskip("pyproj", reason='pyproj is not installed: pip install "surefix[gps]"')

N = 30
# The CN Tower: 43 degrees 38' 33.24" N, 79 degrees 23' 13.7" W is 630,084 m east and 4,833,438 m
# north in the zone 17T (as Wikipedia has it).
TOWER = 43 + 38 / 60 + 33.24 / 3600, -(79 + 23 / 60 + 13.7 / 3600)
EAST, NORTH = 630_084, 4_833_438


@pytest.fixture(scope="module")
def road(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive as images named by their positions, a map of it, and another with a table of GPS."""
    folder = tmp_path_factory.mktemp("road")
    route = Route(places=N, size=(64, 32), seed=3)
    for name, drive in (("monday", route.reference()), ("tuesday", route.revisit())):
        (folder / name).mkdir()
        for index in range(N):
            at = f"@{EAST + 3 * index}.0@{NORTH}.0@17@T@@@@@@@@@@@"
            file = f"{at}.png" if name == "monday" else f"{index:03}.png"
            Image.fromarray(drive[index]).save(folder / name / file)
    surefix_(
        "map", "build", folder / "monday", "--positions", folder / "monday", "-o", folder / "map"
    )
    degree = np.cos(np.radians(TOWER[0])) * 111_320
    rows = [f"{TOWER[0]:.9f},{TOWER[1] + 3 * index / degree:.9f}" for index in range(N)]
    (folder / "gps.csv").write_text("\n".join(["latitude,longitude", *rows]) + "\n")
    return folder


def test_a_place_has_its_degrees(road: Path, tmp_path: Path) -> None:
    known = surefix.Map.open(road / "map")
    assert known.plane == "UTM 17T"
    degrees = map_degrees(known)
    assert degrees is not None
    # To half a metre, as the tower's metres are rounded.
    assert degrees[0] == pytest.approx(TOWER, abs=5e-6)
    np.testing.assert_allclose(utm_metres(degrees, "17T"), known.positions, atol=1e-3)
    surefix_("run", road / "map", road / "tuesday", "-o", tmp_path / "f.geojson")
    features = json.loads((tmp_path / "f.geojson").read_text())["features"]
    for each in features:
        place = each["properties"]["place"]
        assert each["geometry"]["coordinates"] == pytest.approx(degrees[place][::-1], abs=1e-7)
    surefix_("map", "info", road / "map", "--geojson", tmp_path / "r.geojson")
    (line,) = json.loads((tmp_path / "r.geojson").read_text())["features"]
    assert line["geometry"]["coordinates"][0] == pytest.approx(TOWER[::-1], abs=5e-6)


def test_degrees_are_brought_into_the_zone_of_the_map(road: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    given = "--query-positions", road / "gps.csv", "--tolerance", 3, "--method", "single"
    surefix_("eval", road / "map", road / "tuesday", *given, "-o", tmp_path / "report")
    with (tmp_path / "report" / "fixes.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["method"] == "single"]
    assert [int(row["true_place"]) for row in rows] == list(range(N))
    # (The grid is turned by a degree there.) So does a map grow.
    (tmp_path / "map").write_bytes((road / "map").read_bytes())
    more = "--positions", road / "gps.csv"
    surefix_("map", "append", tmp_path / "map", road / "tuesday", *more)
    where = surefix.Map.open(tmp_path / "map").positions
    assert where is not None
    assert np.linalg.norm(where[N:] - where[:N], axis=1).max() < 2.5


def test_south_of_the_equator_and_zones_that_say_too_little() -> None:
    sydney = np.array([[-33.8568, 151.2153], [np.nan, np.nan]])
    (east, north), lost = utm_metres(sydney, "56H")
    assert np.isnan(lost).all()
    # Counted from 10,000 km south of the equator.
    assert (east, north) == pytest.approx((334_900, 6_252_290), abs=150)
    for zone in ("56", "61U", "0U", "33I", "north"):
        with pytest.raises(surefix.SurefixValueError, match="such as 33U, got"):
            utm_metres(sydney, zone)
    metres = Positions("the map", np.array([[EAST, NORTH], [EAST + 3.0, NORTH]]), zone="17")
    with pytest.raises(surefix.SurefixValueError, match="the letter of its band"):
        on_one_plane(metres, Positions("gps", np.array([TOWER]), degrees=True))


def test_without_pyproj_only_what_needs_it_says_so(
    road: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = surefix.Map.open(road / "map")
    monkeypatch.setattr(utm, "find_spec", lambda name: None)
    monkeypatch.setitem(__import__("sys").modules, "pyproj", None)
    assert map_degrees(known) is None
    with pytest.raises(surefix.SurefixError, match=r"takes pyproj.*surefix\[gps\]"):
        map_degrees(known, asked=True)
