"""Positions out of ``surefix run`` and ``align``: trajectories, MCAP; and a bag's GPS as the truth."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from mcap.reader import make_reader
from PIL import Image
from rosbags.typesys import Stores, get_typestore

import surefix
from commands import surefix_
from recordings import Bag
from surefix.datasets import local_metres, write_track
from surefix.frames import BagFrames, Odometry
from surefix.simulate import Route
from surefix.tables.fix_files import created, open_writer, rows_of

N, START = 50, 1_700_000_000.0
# Of the second drive, these frames are of another road: they are on no map.
LOST = range(22, 44)
Float64 = npt.NDArray[np.float64]


def degrees() -> Float64:
    """A road of 3 m a place that bends from the north to the east."""
    angle = np.linspace(0, np.pi / 2, N)
    north, east = np.cumsum(3 * np.cos(angle)), np.cumsum(3 * np.sin(angle))
    return np.stack([48.1 + north / 111_200, 11.5 + east / 74_300], axis=1)


@pytest.fixture(scope="module")
def road(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two drives as bags with GPS, a map of the first, and the second's fixes in all formats."""
    folder = tmp_path_factory.mktemp("road")
    route = Route(places=N, size=(64, 32), seed=3)
    other = Route(places=N, size=(64, 32), seed=8).reference()
    for name, drive, kind in (
        ("monday.bag", route.reference(), "ros1"),
        ("tuesday", route.revisit(), "mcap"),
    ):
        with Bag(folder, kind, name) as bag:
            for index, (latitude, longitude) in enumerate(degrees()):
                at = START + index / 4
                lost = name == "tuesday" and index in LOST
                bag.image("/camera", other[index] if lost else drive[index], at)
                fix = latitude, longitude, 0.0, 0
                bag.pose("/fix", "sensor_msgs/msg/NavSatFix", fix, at)
    build = "--metres", 1, "--odometry", "/fix"
    surefix_("map", "build", folder / "monday.bag", *build, "-o", folder / "map")
    for ending in ("csv", "tum", "kitti", "mcap"):
        run(folder, "-o", folder / f"fixes.{ending}")
    return folder


def run(road: Path, *more: Any, code: int = 0) -> Any:
    given = road / "map", road / "tuesday", "--motion", "steady", "--sequence-length", 3
    return surefix_("run", *given, *more, code=code)


def fixes(file: Path) -> list[dict[str, str]]:
    with file.open() as text:
        return list(csv.DictReader(text))


def lost(rows: list[dict[str, str]]) -> list[bool]:
    return [float(row["off_map"]) >= 0.5 for row in rows]


def test_trajectories_have_the_places_and_the_headings_of_the_route(road: Path) -> None:
    rows, known = fixes(road / "fixes.csv"), surefix.Map.open(road / "map")
    assert known.positions is not None
    at = np.array([[float(row["x"]), float(row["y"]), 0] for row in rows])
    on = ~np.array(lost(rows))
    tum, kitti = np.loadtxt(road / "fixes.tum"), np.loadtxt(road / "fixes.kitti")
    np.testing.assert_allclose(tum[:, 0], [float(row["time"]) for row in np.array(rows)[on]])
    np.testing.assert_allclose(tum[:, 1:4], at[on], atol=1e-4)
    # KITTI has a row for each frame.
    np.testing.assert_allclose(kitti.reshape(-1, 3, 4)[:, :, 3], at, atol=1e-4)
    around = np.gradient(known.positions, axis=0)
    heading = np.arctan2(around[:, 1], around[:, 0])[[int(row["place"]) for row in rows]]
    assert heading.max() - heading.min() > 1.4, "a road that bends"
    np.testing.assert_allclose(2 * np.arctan2(tum[:, 6], tum[:, 7]), heading[on], atol=0.02)
    turned = kitti.reshape(-1, 3, 4)[:, :, :3]
    np.testing.assert_allclose(np.arctan2(turned[:, 1, 0], turned[:, 0, 0]), heading, atol=0.02)
    np.testing.assert_allclose(turned @ turned.transpose(0, 2, 1), [np.eye(3)] * N, atol=1e-6)
    # Read again as odometry, the robot drives forward.
    for file in ("fixes.tum", "fixes.kitti"):
        along = Odometry.from_file(road / file).along
        assert along is not None
        assert (np.diff(along[4:20]) > 0).all()


def test_an_mcap_has_the_poses_at_the_times_of_the_frames(road: Path) -> None:
    rows, store = fixes(road / "fixes.csv"), get_typestore(Stores.ROS2_HUMBLE)
    read: dict[str, list[Any]] = {}
    with (road / "fixes.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            assert schema is not None
            if channel.message_encoding == "cdr":
                # As its own definition in the file says.
                assert schema.encoding == "ros2msg"
                content = store.deserialize_cdr(message.data, schema.name)
                stamp = content.header.stamp
                assert stamp.sec * 10**9 + stamp.nanosec == message.log_time
            else:
                content = json.loads(message.data)
            read.setdefault(channel.topic, []).append((message.log_time, content))
    assert set(read) == {"/surefix/pose", "/surefix/navsat", "/surefix/fix", "/surefix/route"}
    taken = [round(frame.time * 1e9) for frame in BagFrames(road / "tuesday") if frame.time]
    assert [at for at, _ in read["/surefix/fix"]] == taken
    for (_, said), row in zip(read["/surefix/fix"], rows, strict=True):
        assert str(said["place"]) == row["place"]
        assert str(said["confidence"]) == row["confidence"]
    for (_, fix), row, off in zip(read["/surefix/navsat"], rows, lost(rows), strict=True):
        assert fix.latitude == pytest.approx(float(row["latitude"]), abs=1e-9)
        assert fix.longitude == pytest.approx(float(row["longitude"]), abs=1e-9)
        assert (fix.status.status, fix.position_covariance_type) == (-1 if off else 0, 1)
    on = [index for index, off in enumerate(lost(rows)) if not off]
    assert [at for at, _ in read["/surefix/pose"]] == [taken[index] for index in on]
    ((at, route),) = read["/surefix/route"]
    places = surefix.Map.open(road / "map").positions
    assert at == taken[0]
    np.testing.assert_allclose([[each.position.x, each.position.y] for each in route.poses], places)

    # The covariance is that of the belief about the place, and of a place itself.
    known = surefix.Map.open(road / "map")
    localizer = surefix.Localizer(known, motion="steady", sequence_length=3)
    assert known.positions is not None
    spacing = np.median(np.linalg.norm(np.diff(known.positions, axis=0), axis=1))
    found = iter(read["/surefix/pose"])
    spreads = []
    for index, frame in enumerate(BagFrames(road / "tuesday")):
        fix = localizer.push(frame.image)
        if index not in on:
            continue
        pose = next(found)[1].pose
        belief = localizer.belief
        assert belief is not None
        here = known.positions[fix.place]
        assert [pose.pose.position.x, pose.pose.position.y] == pytest.approx(here)
        about = pose.covariance.reshape(6, 6)
        moment = np.zeros((2, 2))
        for chance, there in zip(belief / belief.sum(), known.positions, strict=True):
            moment += chance * np.outer(there - here, there - here)
        # If it is perhaps off the map, it may be anywhere on the route.
        away = fix.off_map is not None and fix.off_map > 0.2
        extent = np.linalg.norm(np.ptp(known.positions, axis=0)) * away
        expected = moment + np.eye(2) * (spacing**2 / 12 + extent**2)
        np.testing.assert_allclose(about[:2, :2], expected, rtol=1e-6)
        assert np.linalg.eigvalsh(about).min() > 0
        assert about[2, 2] >= 1e6
        spreads.append(np.trace(about[:2, :2]))
    assert max(spreads) > 100 * min(spreads), "a belief that is narrow at times"


def test_an_mcap_is_read_as_positions_again(road: Path) -> None:
    rows = fixes(road / "fixes.csv")
    on = [row for row, off in zip(rows, lost(rows), strict=True) if not off]
    poses = Odometry.from_bag(road / "fixes.mcap", "/surefix/pose")
    at = [[float(row["x"]), float(row["y"])] for row in on]
    np.testing.assert_allclose(poses.positions[:, :2], at, atol=1e-4)
    located = Odometry.from_bag(road / "fixes.mcap", "/surefix/navsat")
    assert located.degrees is not None
    assert len(located.degrees) == len(on)


def test_an_alignment_and_a_run_are_written_alike(road: Path, tmp_path: Path) -> None:
    known = surefix.Map.open(road / "map")
    frames = list(BagFrames(road / "tuesday"))
    images, times = [frame.image for frame in frames], [frame.time or 0.0 for frame in frames]
    queries = np.stack([surefix.Sad().describe(image) for image in images])
    how: Any = {"motion": "steady"}
    alignment = surefix.align(known, queries, **how)
    given = road / "map", road / "tuesday", "--motion", "steady"
    for ending in ("tum", "kitti", "mcap", "json"):
        surefix_("align", *given, "-o", tmp_path / f"a.{ending}")
    for ending in ("tum", "kitti"):
        write_track(tmp_path / f"b.{ending}", alignment, known, times)
        same = (tmp_path / f"{name}.{ending}" for name in "ab")
        assert len({file.read_text() for file in same}) == 1
    rows = [json.loads(line) for line in (tmp_path / "a.json").read_text().splitlines()]
    assert alignment.degrees is not None
    np.testing.assert_allclose(
        [row["latitude"] for row in rows], alignment.degrees[:, 0], atol=1e-9
    )
    assert [row["segment_place"] for row in rows] == alignment.place.tolist()
    # Without a belief, the covariance is not known: 0, as in ROS.
    with (tmp_path / "a.mcap").open("rb") as file:
        _, _, message = next(iter(make_reader(file).iter_messages(topics=["/surefix/pose"])))
    store = get_typestore(Stores.ROS2_HUMBLE)
    pose: Any = store.deserialize_cdr(message.data, "geometry_msgs/msg/PoseWithCovarianceStamped")
    assert not pose.pose.covariance.any()

    run_ = surefix.match(known, queries, **how, sequence_length=3)
    write_track(tmp_path / "r.tum", run_, known, times)
    assert (tmp_path / "r.tum").read_text() == (road / "fixes.tum").read_text()
    write_track(tmp_path / "r.csv", run_, known)
    for row, other in zip(fixes(tmp_path / "r.csv"), fixes(road / "fixes.csv"), strict=True):
        assert all(row[name] == other[name] for name in ("place", "latitude", "x", "segment"))
    write_track(tmp_path / "r.geojson", run_, known)
    features = json.loads((tmp_path / "r.geojson").read_text())["features"]
    assert [each["geometry"] is None for each in features] == lost(fixes(road / "fixes.csv"))


def test_without_motion_a_trusted_fix_is_right_within_a_place(road: Path, tmp_path: Path) -> None:
    how = "--motion", "none", "-o"
    given = road / "map", road / "tuesday"
    surefix_("run", *given, *how, tmp_path / "f.csv")
    surefix_("run", *given, *how, tmp_path / "f.mcap")
    store, spreads = get_typestore(Stores.ROS2_HUMBLE), []
    with (tmp_path / "f.mcap").open("rb") as file:
        for _, _, message in make_reader(file).iter_messages(topics=["/surefix/pose"]):
            kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
            pose: Any = store.deserialize_cdr(message.data, kind)
            spreads.append(np.sqrt(pose.pose.covariance[0]))
    trusted = [row["trusted"] == "true" for row in fixes(tmp_path / "f.csv")]
    assert 5 < sum(trusted) < N - 5
    for spread, sure in zip(spreads, trusted, strict=True):
        assert spread == pytest.approx(3 / np.sqrt(12), rel=0.01) if sure else spread > 100


def test_a_fix_off_the_map_has_no_pose(road: Path, tmp_path: Path) -> None:
    known = surefix.Map.open(road / "map")
    run_ = surefix.match(known, known.descriptors, motion="steady", sequence_length=3)
    rows = rows_of(run_, known, np.arange(N) / 4)
    for index in (3, 4, 20):
        rows[index]["off_map"] = 0.7
    left = [index for index in range(len(rows)) if index not in (3, 4, 20)]
    for form in ("tum", "kitti", "geojson", "mcap"):
        path = tmp_path / form
        with created(path, form) as file, open_writer(file, form, known) as write:  # type: ignore
            for row in rows:
                write(row)
    assert np.loadtxt(tmp_path / "tum")[:, 0].tolist() == [index / 4 for index in left]
    assert len(np.loadtxt(tmp_path / "kitti")) == len(rows)
    features = json.loads((tmp_path / "geojson").read_text())["features"]
    assert [k for k, each in enumerate(features) if each["geometry"]] == left
    with (tmp_path / "mcap").open("rb") as file:
        read = [
            (channel.topic, message) for _, channel, message in make_reader(file).iter_messages()
        ]
    times = {topic: [m.log_time / 1e9 for name, m in read if name == topic] for topic, _ in read}
    assert times["/surefix/pose"] == [index / 4 for index in left]
    assert len(times["/surefix/fix"]) == len(times["/surefix/navsat"]) == len(rows)
    store, status = get_typestore(Stores.ROS2_HUMBLE), []
    for topic, message in read:
        if topic == "/surefix/navsat":
            fix: Any = store.deserialize_cdr(message.data, "sensor_msgs/msg/NavSatFix")
            status.append(fix.status.status)
    assert [k for k, each in enumerate(status) if each == 0] == left


def test_an_mcap_that_ends_early_can_be_read(road: Path, tmp_path: Path) -> None:
    known = surefix.Map.open(road / "map")
    rows = rows_of(surefix.match(known, known.descriptors), known, np.arange(N) / 4)

    kept: list[Path] = []
    with_name = lambda name, earlier: kept.append(name)  # noqa: E731

    def interrupted() -> None:
        with (
            created(tmp_path / "a", "mcap", with_name) as file,
            open_writer(file, "mcap", known) as write,
        ):
            for row in rows[:7]:
                write(row)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert kept == [tmp_path / "a.part"]
    with kept[0].open("rb") as file:
        assert len(list(make_reader(file).iter_messages(topics=["/surefix/fix"]))) == 7


WRONG: dict[str, tuple[Any, str]] = {
    "no times": ({"path": "a.tum"}, "TUM: expected queries with times"),
    "few times": ({"path": "a.tum", "times": [1.0]}, "a time for each of the 5 queries"),
    "no time": ({"path": "a.tum", "times": [0, 1, np.nan, 3, 4]}, "nan of query 2"),
    "another ending": ({"path": "a.doc"}, "path: expected a name that ends in .csv, .json"),
    "another format": ({"path": "a", "form": "doc"}, "form: expected one of csv, json"),
    "metres only": ({"path": "a.geojson"}, "latitudes and longitudes, got metres only"),
    "no positions": (
        {"path": "a.kitti", "positions": None},
        "KITTI: expected a map with positions",
    ),
    "no folder": ({"path": "none/a.csv"}, "cannot write the fixes"),
    "words": ({"path": "a.tum", "times": list("abcde")}, "times: expected seconds as numbers"),
    "before 1970": ({"path": "a.mcap", "times": [-1, 0, 1, 2, 3]}, "from 0 to 2147483647 for MCAP"),
    "after 2038": ({"path": "a.mcap", "times": [0, 1, 2, 3, 3e9]}, "from 0 to 2147483647 for MCAP"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_track_that_cannot_be_written_leaves_no_file(name: str, tmp_path: Path) -> None:
    given, words = WRONG[name]
    positions = given.get("positions", [[3.0 * place, 0] for place in range(5)])
    known = surefix.Map.from_descriptors(np.eye(5, dtype=np.float32), positions=positions)
    found = surefix.match(known, np.eye(5, dtype=np.float32), sequence_length=2)
    path = tmp_path / given["path"]
    for older in (False, True)[: 1 + path.parent.exists()]:
        if older:
            path.write_text("older")
        with pytest.raises(surefix.SurefixError, match=words):
            write_track(path, found, known, given.get("times"), given.get("form"))
        assert [*tmp_path.iterdir()] == [path] * older
        assert not older or path.read_text() == "older"


@pytest.mark.parametrize("ending", ["json", "geojson"])
def test_json_has_no_nan(ending: str, tmp_path: Path) -> None:
    where = [[3.0 * place, 0] for place in range(5)]
    rows = np.eye(5, dtype=np.float32)
    known = surefix.Map.from_descriptors(rows, positions=where, origin=(48.0, 11.0))
    # A query whose sequence is not full has no speed yet.
    found = surefix.match(known, rows, sequence_length=3)
    assert np.isnan(found.speed[0])
    write_track(tmp_path / f"a.{ending}", found, known)

    def refused(word: str) -> None:
        raise AssertionError(word)

    text = (tmp_path / f"a.{ending}").read_text()
    for each in [text] if ending == "geojson" else text.splitlines():
        json.loads(each, parse_constant=refused)


def test_images_named_by_their_times_have_these(road: Path, tmp_path: Path) -> None:
    (tmp_path / "photos").mkdir()
    for frame in BagFrames(road / "tuesday"):
        assert frame.time is not None
        Image.fromarray(frame.image).save(tmp_path / "photos" / f"{frame.time * 1e9:.0f}.png")
    given = road / "map", tmp_path / "photos", "--motion", "steady", "--sequence-length", 3
    surefix_("run", *given, "-o", tmp_path / "f.tum")
    np.testing.assert_allclose(np.loadtxt(tmp_path / "f.tum"), np.loadtxt(road / "fixes.tum"))


def test_the_command_line_says_what_a_format_needs(road: Path, tmp_path: Path) -> None:
    np.save(tmp_path / "queries.npy", np.zeros((3, 32, 64), np.uint8))
    out = tmp_path / "f.tum"
    done = surefix_("run", road / "map", tmp_path / "queries.npy", "-o", out, code=2)
    assert "TUM: expected queries with times" in " ".join(done.stderr.replace("│", " ").split())
    assert not out.exists()
    done = run(road, "--format", "mcap", code=2)
    assert "--format mcap: expected --out FILE" in done.stderr


def test_the_gps_of_a_bag_is_its_truth(road: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    given = road / "map", road / "tuesday", "--metres", 1, "--odometry", "/fix"
    how = "--tolerance", 4, "--method", "single"
    said = surefix_("eval", *given, *how, "-o", tmp_path / "a")
    assert "--query-positions: /fix, as --odometry" in said.stderr
    named = surefix_("eval", *given, "--query-positions", "/fix", *how, "-o", tmp_path / "b")
    assert "as --odometry" not in named.stderr
    rows = fixes(tmp_path / "a" / "fixes.csv")
    assert rows == fixes(tmp_path / "b" / "fixes.csv")
    rows = [row for row in rows if row["method"] == "single"]
    # The second bag's degrees are on the map's own plane: frame i is at place i.
    assert [int(row["true_place"]) for row in rows] == list(range(len(rows)))
    done = surefix_("eval", *given, "-o", tmp_path / "c", code=2)
    assert "expected how many metres" in " ".join(done.stderr.replace("│", " ").split())


def test_fixes_with_both_are_compared_in_degrees(road: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    # The map's metres in the file are about its own origin, which the file does not say.
    given = road / "map", road / "tuesday", "--query-positions", road / "fixes.csv"
    how = "--tolerance", 4, "--method", "single", "-o", tmp_path / "a"
    surefix_("eval", *given, *how)
    rows = [row for row in fixes(tmp_path / "a" / "fixes.csv") if row["method"] == "single"]
    places = [int(row["true_place"]) for row in rows]
    assert places == [int(row["place"]) for row in fixes(road / "fixes.csv")]


def test_metres_agree_with_proj() -> None:
    pyproj = pytest.importorskip("pyproj", reason="pyproj is not installed: pip install pyproj")
    rng = np.random.default_rng(1)
    for latitude, longitude in ((48.1, 11.5), (0.0, 179.999), (-69.0, -30.0)):
        about = pyproj.Proj(proj="aeqd", lat_0=latitude, lon_0=longitude, ellps="WGS84")
        lat = latitude + rng.uniform(-0.02, 0.02, 200)
        lon = longitude + rng.uniform(-0.02, 0.02, 200) / np.cos(np.radians(latitude))
        exact = np.stack(about((lon + 180) % 360 - 180, lat), axis=1)
        metres = local_metres(lat, (lon + 180) % 360 - 180, (latitude, longitude))
        # Within 3 km of the origin: half a thousandth of the way.
        assert np.linalg.norm(metres - exact, axis=1).max() < 5
