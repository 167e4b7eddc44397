"""Positions as people have them, and positions that are none."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from PIL import Image

import surefix
from surefix.cli.where import Places, Queries, Where, by_positions, by_truth
from surefix.datasets import local_metres
from surefix.tables.positions import read_positions

pandas = pytest.importorskip("pandas")

N = 60
ALONG = np.arange(N) * 5.0
# A road of 300 m that bends, in metres, and as degrees near Oxford.
PLANE = np.stack([ALONG, 0.001 * ALONG**2], axis=1)
DEGREES = np.stack([51.76 + PLANE[:, 1] / 111_260, -1.26 + PLANE[:, 0] / 69_000], axis=1)
# Nordland's: 3.5 degrees.
NORTH = np.stack([59.91 + np.arange(N) * 0.0593, 10.75 + 0.01 * np.sin(np.arange(N))], axis=1)
NAN = float("nan")


def table(path: Path, values: np.ndarray, header: str = "latitude,longitude", **more: Any) -> Path:
    columns = dict(zip(header.split(","), values.T, strict=True)) | more
    pandas.DataFrame(columns).to_csv(path, index=False, na_rep=more.pop("na", ""))
    return path


def compared(
    places: Path, queries: Path, tolerance: float = 4.0, gap: float = 2.0, **drive: Any
) -> Where:
    count = drive.pop("count", N)
    return by_positions(places, queries, Places(N), Queries(count, **drive), tolerance, gap)


HEADERS = {
    "latitude,longitude": DEGREES,
    "lat,lon": DEGREES,
    "lat,lng": DEGREES,
    "Latitude [deg],Longitude [deg]": DEGREES,
    "field.latitude,field.longitude": DEGREES,
    "lon,lat": DEGREES[:, ::-1],
    "x,y": PLANE,
    "easting,northing": PLANE,
    "northing,easting": PLANE[:, ::-1],
    "utm_east,utm_north": PLANE,
    "UTM Easting (m),UTM Northing (m)": PLANE,
}


@pytest.mark.parametrize("header", HEADERS)
def test_a_header_names_the_columns(header: str, tmp_path: Path) -> None:
    for separator, ending in ((",", ".csv"), (";", ".CSV"), ("\t", ".txt")):
        path = tmp_path / f"gps{ending}"
        rows = pandas.DataFrame(HEADERS[header], columns=header.split(","))
        rows.assign(more=1.5).to_csv(path, sep=separator)
        read = read_positions(path)
        expected = DEGREES if read.degrees else PLANE
        assert read.degrees == ("lat" in header.lower())
        np.testing.assert_allclose(read.values, expected, rtol=1e-12)


def test_decimal_commas(tmp_path: Path) -> None:
    rows = pandas.DataFrame(DEGREES, columns=["lat", "lon"])
    rows.to_csv(tmp_path / "gps.csv", sep=";", decimal=",", index=False)
    np.testing.assert_allclose(read_positions(tmp_path / "gps.csv").values, DEGREES, rtol=1e-12)


def test_trajectories(tmp_path: Path) -> None:
    times = 1.7e9 + np.arange(N)
    turn = np.tile([0.0, 0, 0, 1], (N, 1))
    xyz = np.c_[PLANE, np.zeros(N)]
    np.savetxt(tmp_path / "tum.txt", np.c_[times, xyz, turn], fmt="%.6f")
    poses = np.tile(np.eye(3, 4), (N, 1, 1))
    poses[:, :, 3] = xyz
    np.savetxt(tmp_path / "kitti.txt", poses.reshape(N, 12))
    header = "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], "
    rows = "".join(
        f"{int(time)}000000000,{x:.4f},{y:.4f},{z:.4f},1,0,0,0\n"
        for time, (x, y, z) in zip(times, xyz, strict=True)
    )
    (tmp_path / "euroc.csv").write_text(header + "q_RS_y [], q_RS_z []\n" + rows)
    for name, timed in (("tum.txt", True), ("kitti.txt", False), ("euroc.csv", True)):
        read = read_positions(tmp_path / name)
        np.testing.assert_allclose(read.values, xyz, atol=1e-4)
        assert (read.times is not None) == timed
        if read.times is not None:
            np.testing.assert_allclose(read.times, times)


def test_positions_in_the_names_of_images(tmp_path: Path) -> None:
    for folder, shift in (("db", 0.0), ("q", 1.0)):
        (tmp_path / folder).mkdir()
        for east, north in np.add(PLANE, [500_000 + shift, 4_500_000]):
            name = f"@{east:.2f}@{north:.2f}@10@S@37.1@-122.2@id@@0@@@@201311@@.jpg"
            Image.new("L", (8, 8)).save(tmp_path / folder / name)
    names = [Path(each).name for each in surefix.find_images(str(tmp_path / "q"))]
    found = compared(tmp_path / "db", tmp_path / "q", names=names)
    there, here = found.truth
    assert sorted(np.asarray(there)[:, 0]) == pytest.approx(PLANE[:, 0] + 500_000, abs=0.01)
    east = [float(name.split("@")[1]) for name in names]
    np.testing.assert_allclose(np.asarray(here)[:, 0], east)
    # A map holds the names of its images.
    mapped = [Path(each).name for each in surefix.find_images(str(tmp_path / "db"))]
    by_map = by_positions(None, tmp_path / "q", Places(N, None, mapped), Queries(N, names), 4.0)
    np.testing.assert_array_equal(by_map.truth[0], there)


def test_a_name_column_puts_rows_in_the_order_of_the_images(tmp_path: Path) -> None:
    names = [f"{number}.png" for number in range(N)]
    table(tmp_path / "map.csv", PLANE, "x,y")
    order = np.random.default_rng(0).permutation(N)[:50]
    rows = {"filename": [f"photos/{names[index]}" for index in order]}
    table(tmp_path / "q.csv", PLANE[order], "x,y", **rows)
    _, here = compared(tmp_path / "map.csv", tmp_path / "q.csv", names=names).truth
    lacking = np.setdiff1d(np.arange(N), order)
    assert np.isnan(np.asarray(here)[lacking]).all()
    np.testing.assert_allclose(np.asarray(here)[order], PLANE[order])


@pytest.mark.parametrize("empty", ["", "nan", "NaN", "None"])
def test_a_query_that_is_not_known_is_left_out_and_counted(
    empty: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table(tmp_path / "map.csv", DEGREES)
    rows = [f"{lat},{lon}" for lat, lon in DEGREES]
    rows[7:10] = [f"{empty},{empty}"] * 3
    (tmp_path / "q.csv").write_text("latitude,longitude\n" + "\n".join(rows) + "\n")
    found = compared(tmp_path / "map.csv", tmp_path / "q.csv")
    assert "3 queries of 60 without a known place, left out" in capsys.readouterr().err
    matches = surefix.Matches(place=np.arange(N), score=np.linspace(0, 1, N))
    curve = surefix.evaluate(matches, found.truth, found.tolerance)
    assert (curve.correct, curve.judged) == (57, 57)
    assert np.isfinite(found.along).all()
    # Places must be known.
    with pytest.raises(surefix.SurefixValueError, match="position for each place, got none for 3"):
        compared(tmp_path / "q.csv", tmp_path / "map.csv")


def test_python_arrays_may_have_unknown_queries_but_no_unknown_places() -> None:
    here = PLANE.copy()
    here[5, 0] = NAN
    matches = surefix.Matches(place=np.arange(N), score=np.linspace(0, 1, N))
    assert surefix.evaluate(matches, (PLANE, here), 2).judged == N - 1
    assert surefix.baselines.perfect_predictor(
        1 - np.eye(N, dtype=np.float32), (PLANE, here), 2
    ).tolist() == [query != 5 for query in range(N)]
    with pytest.raises(surefix.SurefixValueError):
        surefix.evaluate(matches, (here, PLANE), 2)
    here[5] = np.inf
    with pytest.raises(surefix.SurefixValueError):
        surefix.evaluate(matches, (PLANE, here), 2)


class TestDegreesThatDoNotSaySo:
    @pytest.mark.parametrize("route", ["short", "long", "with 0,0", "short .npy"])
    def test_are_found_whatever_the_length(self, route: str, tmp_path: Path) -> None:
        values = (NORTH if route == "long" else DEGREES).copy()
        if route == "with 0,0":
            values[20] = 0
        for name, shift in (("map", 0.0), ("q", 0.5 if route == "long" else 0.005)):
            if route == "short .npy":
                np.save(tmp_path / f"{name}.npy", values + shift)
            else:
                np.savetxt(tmp_path / f"{name}.csv", values + shift, delimiter=",", fmt="%.7f")
        ending = "npy" if "npy" in route else "csv"
        with pytest.raises(surefix.SurefixValueError, match="look like latitude and longitude"):
            compared(tmp_path / f"map.{ending}", tmp_path / f"q.{ending}")

    def test_a_tolerance_that_tells_nothing_apart_stops(self, tmp_path: Path) -> None:
        # Nothing else gives it away: whole degrees, around 0.
        plain = np.round((PLANE - PLANE.mean(axis=0)) / 100, 1)
        for name in ("map", "q"):
            np.savetxt(tmp_path / f"{name}.csv", plain, delimiter=",", fmt="%.1f")
        with pytest.raises(surefix.SurefixValueError, match="are these degrees or kilometres"):
            compared(tmp_path / "map.csv", tmp_path / "q.csv")

    def test_a_yard_in_metres_is_none(self, tmp_path: Path) -> None:
        turns = np.linspace(0, 6, N)
        yard = np.stack([40 + 12 * np.cos(turns), 30 + 9 * np.sin(turns)], axis=1)
        np.save(tmp_path / "yard.npy", yard)
        assert compared(tmp_path / "yard.npy", tmp_path / "yard.npy", tolerance=1).by_position


class TestAReceiverWithoutAFix:
    def test_is_not_known_with_a_remark(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        lost = DEGREES.copy()
        lost[[0, 30, 31]] = 0
        table(tmp_path / "map.csv", DEGREES)
        table(tmp_path / "q.csv", lost)
        _, here = compared(tmp_path / "map.csv", tmp_path / "q.csv").truth
        assert np.flatnonzero(np.isnan(np.asarray(here)).any(axis=1)).tolist() == [0, 30, 31]
        said = capsys.readouterr().err
        assert "3 rows of 0,0 taken as not known (a receiver without a fix)" in said
        with pytest.raises(surefix.SurefixValueError, match=r"none for 3 of 60.*0,0"):
            compared(tmp_path / "q.csv", tmp_path / "map.csv")

    def test_in_metres_too_but_a_drive_may_start_there(self, tmp_path: Path) -> None:
        table(tmp_path / "map.csv", PLANE, "x,y")
        assert read_positions(tmp_path / "map.csv").known.all()
        utm = np.add(PLANE, [620_000, 5_700_000])
        utm[9] = 0
        table(tmp_path / "utm.csv", utm, "easting,northing")
        assert np.flatnonzero(~read_positions(tmp_path / "utm.csv").known).tolist() == [9]
        # A receiver's own frame, far out: there and back.
        far = PLANE + 150
        far[40] = 0
        table(tmp_path / "far.csv", far, "x,y")
        assert np.flatnonzero(~read_positions(tmp_path / "far.csv").known).tolist() == [40]


def feet(values: np.ndarray) -> np.ndarray:
    return values / 0.3048


APART: dict[str, tuple[np.ndarray, np.ndarray, str, str]] = {
    "swapped": (
        DEGREES,
        DEGREES[:, ::-1],
        "latitude,longitude",
        "latitude and longitude are swapp",
    ),
    "the sign": (DEGREES, DEGREES * [1, -1], "latitude,longitude", "sign of the longitude"),
    "axes": (
        np.add(PLANE, [0, 900]),
        np.add(PLANE[:, ::-1], [900, 0]),
        "x,y",
        "x and y are swapped",
    ),
    "kilometres": (PLANE + 9000, PLANE / 1000 + 9, "x,y", "in kilometres the queries"),
    "feet": (PLANE + 9000, feet(PLANE + 9000), "x,y", "in feet the queries"),
    "origins": (PLANE, np.add(PLANE, [3000, -200]), "x,y", "moved by -3000.0, 200.0 they fit"),
    "elsewhere": (DEGREES, np.add(DEGREES, [7, 0]), "latitude,longitude", "778"),
}


@pytest.mark.parametrize("name", APART)
def test_no_query_near_any_place_stops_with_the_numbers(name: str, tmp_path: Path) -> None:
    there, here, header, fit = APART[name]
    table(tmp_path / "map.csv", there, header)
    table(tmp_path / "q.csv", here, header)
    with pytest.raises(surefix.SurefixValueError) as error:
        compared(tmp_path / "map.csv", tmp_path / "q.csv")
    said = str(error.value)
    for words in ("expected a query within 4 m of a place", "the tolerance is 4 m", "places: "):
        assert words in said
    assert fit in said, said


def test_one_wrong_fix_moves_no_origin_and_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = DEGREES.copy()
    wrong[11] = [-30.0, 140.0]
    table(tmp_path / "map.csv", wrong)
    table(tmp_path / "q.csv", DEGREES)
    there, here = (
        np.asarray(each) for each in compared(tmp_path / "map.csv", tmp_path / "q.csv").truth
    )
    origin = tuple(np.median(DEGREES, axis=0))
    exact = local_metres(*DEGREES.T, origin)
    apart = np.delete(there, 11, 0)
    np.testing.assert_allclose(
        np.diff(apart, axis=0), np.diff(np.delete(exact, 11, 0), axis=0), atol=0.01
    )
    np.testing.assert_allclose(np.diff(here, axis=0), np.diff(exact, axis=0), atol=0.01)
    said = capsys.readouterr().err
    assert "1 position far from all others" in said
    assert "row 11" in said


class TestByTime:
    def test_positions_at_1_hz_and_frames_at_5(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        seconds = np.arange(0, 30)
        way = np.interp(seconds, np.arange(N) / 2, ALONG)
        gps = np.stack([way, 0.001 * way**2], axis=1)
        keep = (seconds < 10) | (seconds > 15)
        table(tmp_path / "map.csv", PLANE, "x,y")
        frames = np.arange(0, 29, 0.2)
        for unit, start in ((1, 0.0), (1, 1.7e9), (1000, 1.7e9), (10**9, 1.7e9)):
            stamps = np.round((seconds + start) * unit).astype(np.int64)
            table(tmp_path / "gps.csv", gps[keep], "x,y", timestamp=stamps[keep])
            found = compared(
                tmp_path / "map.csv",
                tmp_path / "gps.csv",
                tolerance=8,
                count=len(frames),
                times=(frames + start).tolist(),
            )
            here = np.asarray(found.truth[1])
            # Between seconds 9 and 16 there are none, and the gap is more than 2 s.
            hole = (frames > 9 + 1e-3) & (frames < 16 - 1e-3)
            np.testing.assert_array_equal(np.isnan(here).any(axis=1), hole)
            np.testing.assert_allclose(
                here[~hole, 0], np.interp(frames[~hole], seconds, gps[:, 0]), atol=1e-3
            )
            assert "34 queries of 145 without a known place" in capsys.readouterr().err

    def test_the_gap_is_an_option(self, tmp_path: Path) -> None:
        table(tmp_path / "map.csv", PLANE, "x,y")
        table(tmp_path / "gps.csv", PLANE[::10], "x,y", time=np.arange(6) * 5.0)
        drive = {"count": 51, "times": np.arange(0, 25.5, 0.5).tolist()}
        paths = tmp_path / "map.csv", tmp_path / "gps.csv"
        few, all_ = (compared(*paths, tolerance=8, gap=gap, **drive) for gap in (2, 5))
        assert np.isfinite(np.asarray(few.truth[1])[:, 0]).sum() == 6
        assert np.isfinite(np.asarray(all_.truth[1])).all()

    def test_iso_times_and_another_clock(self, tmp_path: Path) -> None:
        table(tmp_path / "map.csv", PLANE, "x,y")
        stamps = pandas.date_range("2024-05-01T12:00:00Z", periods=30, freq="1s")
        iso = stamps.strftime("%Y-%m-%dT%H:%M:%SZ")
        table(tmp_path / "gps.csv", PLANE[::2], "x,y", time=iso)
        start = stamps[0].timestamp()
        paths = tmp_path / "map.csv", tmp_path / "gps.csv"
        times = (start + np.arange(0, 29, 0.5)).tolist()
        found = compared(*paths, tolerance=8, count=58, times=times)
        np.testing.assert_allclose(np.asarray(found.truth[1]), PLANE[:58], atol=0.03)
        with pytest.raises(surefix.SurefixValueError, match=r"0\.000 to 28\.500 s: two clocks"):
            compared(*paths, count=58, times=np.arange(0, 29, 0.5).tolist())
        with pytest.raises(surefix.SurefixValueError, match="queries with times"):
            compared(*paths, count=58)


def test_patch_netvlads_tolerance_is_its_own(tmp_path: Path) -> None:
    np.savez(tmp_path / "gt.npz", utmDb=PLANE, utmQ=PLANE[::2], posDistThr=25)
    found = by_truth(str(tmp_path / "gt.npz"), Places(N), Queries(30), None)
    assert (found.by_position, found.tolerance) == (True, 25)
    assert by_truth(str(tmp_path / "gt.npz"), Places(N), Queries(30), 3.5).tolerance == 3.5


REFUSED: dict[str, tuple[Callable[[Path], object], str]] = {
    "inf.npy": (lambda p: np.save(p, np.where(PLANE == 50, np.inf, PLANE)), "finite numbers"),
    "wide.csv": (lambda p: np.savetxt(p, np.ones((3, 5)), delimiter=","), "got 5 values"),
    "words.csv": (
        lambda p: p.write_text("x,y\n1,2\n3,here\n"),
        "row 3: expected y, a finite number",
    ),
    "zones.csv": (
        lambda p: p.write_text("easting,northing,zone\n1,2,32\n3,4,33\n"),
        "one UTM zone, got the zones 32, 33",
    ),
    "swapped.csv": (
        lambda p: p.write_text("lat,lon\n139.7,35.6\n139.8,35.6\n"),
        "latitude and longitude swapped",
    ),
    "empty.csv": (lambda p: p.write_text("# nothing\n"), "2 or 3 numbers a place"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_position_is_named(name: str, tmp_path: Path) -> None:
    write, words = REFUSED[name]
    write(tmp_path / name)
    with pytest.raises(surefix.SurefixValueError, match=words) as error:
        read_positions(tmp_path / name)
    assert name in str(error.value)


def test_arrays_of_another_unit_are_warned_of() -> None:
    matches = surefix.Matches(place=np.arange(N)[::-1], score=np.linspace(0, 1, N))
    with pytest.warns(UserWarning, match=r"all places lie within .* m, the tolerance is 4 m"):
        surefix.evaluate(matches, (NORTH, NORTH + 0.5), 4)
    with pytest.warns(UserWarning, match="no query is within the tolerance of 4 m of a place"):
        surefix.evaluate(matches, (PLANE, PLANE + 1e6), 4)
    assert surefix.evaluate(matches, (PLANE, PLANE), 4).judged == N


def test_a_small_unit_about_a_common_origin_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table(tmp_path / "metres.csv", PLANE, "x,y")
    table(tmp_path / "km.csv", PLANE / 1000, "x,y")
    compared(tmp_path / "metres.csv", tmp_path / "km.csv")
    assert "in kilometres the queries of" in capsys.readouterr().err
    with pytest.raises(surefix.SurefixValueError, match="all places lie within it of each other"):
        compared(tmp_path / "km.csv", tmp_path / "metres.csv")


def test_a_tolerance_or_a_truth_that_settles_everything_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(typer.BadParameter, match="expected less than the 60 places"):
        by_truth("identity", Places(N), Queries(N), 60)
    np.save(tmp_path / "none.npy", np.full(N, -1))
    by_truth(str(tmp_path / "none.npy"), Places(N), Queries(N), 1)
    assert "no query has a place, so that no match can be right" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["positions", "places"])
def test_all_that_takes_a_truth_leaves_unknown_queries_out(kind: str) -> None:
    places = 300
    D = np.random.default_rng(0).random((places, places), np.float32) + np.float32(0.5)
    D[np.arange(places), np.arange(places)] -= np.float32(0.4)
    truth: Any = np.arange(places, dtype=float)
    truth[40:60] = NAN
    tolerance: float = 1
    if kind == "positions":
        there = np.stack([np.arange(places) * 2.0, np.zeros(places)], axis=1)
        here = there.copy()
        here[40:60] = NAN
        truth, tolerance = (there, here), 3.0
    run = surefix.match_distances(D)
    trust = surefix.evaluate_trust(run, truth, tolerance)
    total = trust.true_positives + trust.false_positives
    assert total + trust.true_negatives + trust.false_negatives == places - 20
    known = np.delete(np.arange(places), range(40, 60))
    hit = surefix.recall_at(D, truth, [1], tolerance)[0]
    near = np.abs(D.argmin(0) - np.arange(places)) <= 1
    assert hit == pytest.approx(near[known].mean())
    threshold = surefix.calibrate(run, truth, wrong=0.2, tolerance=tolerance)
    assert threshold.accepted <= places - 20
    alignment = surefix.align(D, motion="steady")
    assert surefix.contradictions(alignment, truth, tolerance) == []
    tuned = surefix.tune(D, None, truth, tolerance=tolerance, wrong=0.2)
    judged = int(tuned.settings.measured["judged"].split()[0])
    assert judged <= places // 2 - 20


def test_gpx_and_times_without_a_header(tmp_path: Path) -> None:
    points = "".join(
        f'<trkpt lat="{lat:.7f}" lon="{lon:.7f}"><ele>90</ele>'
        f"<time>2024-05-01T12:00:{second:02}Z</time></trkpt>"
        for second, (lat, lon) in enumerate(DEGREES)
    )
    head = '<?xml version="1.0" encoding="UTF-8"?><gpx xmlns="http://www.topografix.com/GPX/1/1">'
    (tmp_path / "log.gpx").write_text(f"{head}<trk><trkseg>{points}</trkseg></trk></gpx>")
    read = read_positions(tmp_path / "log.gpx")
    assert read.degrees
    np.testing.assert_allclose(read.values, DEGREES, atol=1e-7)
    assert read.times is not None
    assert np.diff(read.times).tolist() == [1.0] * (N - 1)
    (tmp_path / "cut.gpx").write_text(head)
    with pytest.raises(surefix.SurefixValueError, match="a GPX file"):
        read_positions(tmp_path / "cut.gpx")
    times = 1.7e9 + np.arange(N)
    for rows in (np.c_[times, PLANE], np.c_[times, PLANE, np.ones(N)]):
        np.savetxt(tmp_path / "log.txt", rows)
        read = read_positions(tmp_path / "log.txt")
        assert read.times is not None
        np.testing.assert_allclose(read.values[:, :2], PLANE)
        np.testing.assert_allclose(read.times, times)


class TestRowsWithoutAFix:
    """A receiver without a fix says 0,0 or -1,-1."""

    @staticmethod
    def lost(folder: Path, header: str, rows: np.ndarray) -> list[int]:
        """The rows that are not known."""
        np.savetxt(folder / "at.csv", rows, delimiter=",", header=header, comments="", fmt="%.7f")
        return np.flatnonzero(~read_positions(folder / "at.csv").known).tolist()

    def test_in_degrees_all(self, tmp_path: Path) -> None:
        rows = np.stack([51.76 + np.arange(30) * 9e-5, -1.26 + np.arange(30) * 1e-5], axis=1)
        rows[[0, 1, 7]], rows[[20, 29]] = -1, 0
        assert self.lost(tmp_path, "lat,lon", rows) == [0, 1, 7, 20, 29]

    @pytest.mark.parametrize("value", [0, -1])
    @pytest.mark.parametrize("at", [range(12), range(10, 14)])
    def test_in_metres_those_repeated_before_a_jump(
        self, tmp_path: Path, value: int, at: range
    ) -> None:
        rows = np.stack([np.arange(60) * 5.0, np.zeros(60)], axis=1)
        rows[at] = value
        assert self.lost(tmp_path, "x,y", rows) == [*at]

    @pytest.mark.parametrize("origin", [0, -1])
    @pytest.mark.parametrize("still", [1, 2, 15])
    def test_a_drive_that_starts_there_stays(self, tmp_path: Path, origin: int, still: int) -> None:
        way = np.concatenate([np.zeros(still), np.arange(1, 60) * 0.5])
        rows = np.stack([way, 0 * way], axis=1) + origin
        assert self.lost(tmp_path, "x,y", rows) == []
