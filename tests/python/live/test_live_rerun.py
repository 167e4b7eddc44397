"""A drive that is saved for rerun agrees with the fixes: read back by rerun's own reader."""

from __future__ import annotations

import csv
import os
import re
import sys
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

import surefix
from commands import surefix_
from rerun_reader import Recording
from surefix.frames import Frame
from surefix.live import RerunView
from surefix.live.ground import Ground
from surefix.live.matrix import PALETTE
from surefix.simulate import Route

pytest.importorskip("rerun", reason='rerun is not installed: pip install "surefix[live]"')

PLACES = 60
EPOCH = 1_700_000_000.25


@dataclass
class Drive:
    """A drive along the generated route, as it was and as it was recorded."""

    recording: Recording
    route: surefix.Map
    queries: list[NDArray[np.uint8]]
    references: list[NDArray[np.uint8]]
    fixes: list[surefix.Fix]
    distances: list[NDArray[np.float32]]


def record(
    path: Path, route: surefix.Map, frames: list[Any], motion: Any = None, **options: Any
) -> tuple[list[Any], list[Any]]:
    """Push all frames and save them."""
    localizer = surefix.Localizer(route, sequence_length=3, motion=motion)
    fixes, distances = [], []
    with RerunView(route, save=path, **options) as view:
        for index, frame in enumerate(frames):
            fix = localizer.push(getattr(frame, "image", frame))
            view.update(frame, fix, localizer, latency_us=100.0 + index)
            fixes.append(fix)
            distances.append(localizer.distances)
    return fixes, distances


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Drive:
    """Frames with times and names, one of them after two that were dropped; a map with positions
    and its images.
    """
    folder = tmp_path_factory.mktemp("drive")
    generated = Route(places=PLACES, size=(96, 48))
    reference, revisit = generated.reference(), generated.revisit()
    (folder / "summer").mkdir()
    for place in range(PLACES):
        Image.fromarray(reference[place]).save(folder / "summer" / f"{place:03}.png")
    positions = np.c_[500_000 + 3.0 * np.arange(PLACES), 4e6 + np.arange(PLACES) ** 1.5]
    route = surefix.Map.from_images(str(folder / "summer"), positions=positions)
    queries = [revisit[place] for place in range(PLACES)]
    frames = [
        Frame(image, EPOCH + 0.5 * index, f"winter {index}", dropped=2 if index == 30 else 0)
        for index, image in enumerate(queries)
    ]
    path = folder / "drive.rrd"
    fixes, distances = record(path, route, frames, references=folder / "summer", columns=20)
    references = [np.asarray(reference[place]) for place in range(PLACES)]
    return Drive(Recording(path), route, queries, references, fixes, distances)


def test_every_number_of_every_fix_is_in_the_recording(drive: Drive) -> None:
    assert len({fix.trusted for fix in drive.fixes}) == 2, (
        "a drive with trusted and untrusted fixes"
    )
    for fix in drive.fixes:
        row = {
            name: value[0]
            for name, value in drive.recording.logged["fix"][fix.frame].items()
            if type(value) is list
        }
        sequence = fix.sequence
        assert (
            np.isnan(row.pop("speed")) if sequence is None else row.pop("speed") == sequence.speed
        )
        assert row == {
            "query": f"winter {fix.frame}",
            "place": fix.place,
            "score": fix.score,
            "trusted": fix.trusted,
            "ready": sequence is not None,
            "anchors": -1 if sequence is None else sequence.anchors,
            "single_place": fix.single.place,
            "single_distance": fix.single.distance,
            "gradient_place": fix.gradient.place,
            "gradient_value": fix.gradient.value,
            "latency_us": 100.0 + fix.frame,
            "dropped": 2 if fix.frame >= 30 else 0,
        }


def test_curves_are_those_of_the_fixes_and_trust_parts_the_track(drive: Drive) -> None:
    scalars = drive.recording.scalars
    assert scalars("score") == {fix.frame: fix.score for fix in drive.fixes}
    assert scalars("latency_us") == {fix.frame: 100.0 + fix.frame for fix in drive.fixes}
    assert scalars("place/trusted") == {fix.frame: fix.place for fix in drive.fixes if fix.trusted}
    assert scalars("place/untrusted") == {
        fix.frame: fix.place for fix in drive.fixes if not fix.trusted
    }


def test_bars_are_the_distances_and_the_marks_stand_at_minimum_and_gradient_peak(
    drive: Drive,
) -> None:
    bars = drive.recording.bars
    for fix, column in zip(drive.fixes, drive.distances, strict=True):
        # Less their median, so that the least is a dip.
        distances = column - np.median(column)
        np.testing.assert_array_equal(bars("distances/all", fix.frame), distances)
        np.testing.assert_array_equal(
            bars("distances/all", fix.frame, "abscissa"), np.arange(PLACES)
        )
        for name, place in (("minimum", fix.single.place), ("gradient_peak", fix.gradient.place)):
            assert bars(f"distances/{name}", fix.frame).tolist() == [distances[place]]
            assert bars(f"distances/{name}", fix.frame, "abscissa").tolist() == [place]
        assert bars("distances/minimum", fix.frame)[0] == distances.min() < 0


def test_the_matrix_has_the_newest_columns_with_the_matched_cells_marked(drive: Drive) -> None:
    matrix = np.array(drive.distances).T
    for frame in (0, 5, 19, 20, 59):
        first = max(0, frame - 19)
        newest = matrix[:, first : frame + 1]
        near, far = newest.min(), newest.max()
        # The first place is at the bottom, as in the reports; the first queries fill it.
        levels = (255 - 255 * (newest - near) / (far - near))[::-1]
        count = frame + 1 - first
        picture = np.asarray(drive.recording.picture("matrix/distances", frame))
        wide = levels[:, [column * count // 20 for column in range(20)]]
        np.testing.assert_allclose(picture, wide, atol=0.51)
        palette = drive.recording.picture("matrix/distances", frame).getpalette()
        np.testing.assert_array_equal(np.array(palette, np.uint8).reshape(-1, 3), PALETTE)
        for name, trusted in (("trusted", True), ("untrusted", False)):
            cells = [
                ((fix.frame - first + 0.5) * 20 / count, PLACES - fix.single.place - 0.5)
                for fix in drive.fixes[first : frame + 1]
                if fix.trusted == trusted
            ]
            got = drive.recording.points(f"matrix/{name}", frame).reshape(-1, 2)
            np.testing.assert_allclose(got, np.reshape(cells, (-1, 2)), rtol=1e-6)
        (begin, end) = drive.recording.logged["matrix/queries"][frame]["Points2D:labels"]
        assert (begin, end) == (f"query {first}", str(frame))


def test_the_matrix_has_axes_and_the_breaks_of_the_route(drive: Drive, tmp_path: Path) -> None:
    places = drive.recording.static["matrix/places"]
    assert places["Points2D:labels"] == ["place 0", "10", "20", "30", "40", "50"]
    heights = [y for _, y in places["Points2D:positions"]]
    expected = np.array([PLACES - place - 0.5 for place in (0, 10, 20, 30, 40, 50)])
    np.testing.assert_allclose(heights, expected - 0.045 * PLACES, rtol=1e-6)
    assert not {"matrix/breaks", "route/starts"} & set(drive.recording.static), "one segment"
    segments = surefix.Segments(PLACES, breaks=[20, 45])
    record(tmp_path / "a.rrd", drive.route.with_segments(segments), drive.queries[:3])
    static = Recording(tmp_path / "a.rrd").static
    lines = static["matrix/breaks"]["LineStrips2D:strips"]
    # Between place 19 and place 20, counted from the bottom.
    assert [[y for _, y in line] for line in lines] == [[40, 40], [15, 15]]
    roads = static["route/places"]["LineStrips2D:strips"]
    assert [len(road) for road in roads] == [20, 25, 15]
    assert len(static["route/starts"]["Points2D:positions"]) == 3


def test_a_map_of_degrees_is_drawn_on_the_world(drive: Drive, tmp_path: Path) -> None:
    positions = np.c_[3.0 * np.arange(PLACES), np.zeros(PLACES)]
    segments = surefix.Segments(PLACES, breaks=[20], closed=[0])
    route = drive.route.with_positions(positions, origin=(48.0, 179.999)).with_segments(segments)
    fixes, _ = record(tmp_path / "a.rrd", route, drive.queries[:5])
    recording, degrees = Recording(tmp_path / "a.rrd"), route.degrees
    assert degrees is not None
    assert degrees[:, 1].min() < -179
    # The first road is closed; the second goes over the meridian of 180 degrees, and is cut there.
    lines = recording.static["route/places"]["GeoLineStrings:line_strings"]
    assert [len(line) for line in lines] == [21, 6, 36]
    np.testing.assert_allclose(lines[0], degrees[[*range(20), 0]], atol=1e-7)
    np.testing.assert_allclose(lines[1][:-1], degrees[20:25], atol=1e-7)
    np.testing.assert_allclose(lines[2][1:], degrees[25:], atol=1e-7)
    np.testing.assert_allclose([lines[1][-1], lines[2][0]], [[48, 180], [48, -180]])
    for fix in fixes:
        at = np.array(recording.logged["route/here"][fix.frame]["GeoPoints:positions"])
        np.testing.assert_allclose(at, degrees[[fix.place]])
    assert "MapView" in repr(recording.layout) or "'Map'" in repr(recording.layout)
    # 180 m at 48 degrees over 380 points.
    zoom = Ground(None, route).zoom
    assert zoom is not None
    assert 156_543 * np.cos(np.radians(48)) / 2**zoom * 380 == pytest.approx(177, rel=0.01)


def test_the_track_lies_on_the_positions_of_the_map(drive: Drive) -> None:
    assert drive.route.positions is not None
    ground = (drive.route.positions - drive.route.positions[0]) * [1, -1]
    np.testing.assert_allclose(
        drive.recording.static["route/places"]["LineStrips2D:strips"], [ground], rtol=1e-6
    )
    for fix in drive.fixes:
        for name in ("here", "trusted" if fix.trusted else "untrusted"):
            at = drive.recording.points(f"route/{name}", fix.frame)
            np.testing.assert_allclose(at, ground[[fix.place]], rtol=1e-6)
    assert set(drive.recording.logged["route/trusted"]) == {
        fix.frame for fix in drive.fixes if fix.trusted
    }


def test_images_are_those_of_the_camera_and_of_the_matched_place(drive: Drive) -> None:
    shown = None
    for fix in drive.fixes:
        seen = np.asarray(drive.recording.picture("camera", fix.frame), np.int16)
        assert np.abs(seen - drive.queries[fix.frame]).mean() < 6, "but for the JPEG's losses"
        changed = fix.place != shown
        shown = fix.place
        assert (fix.frame in drive.recording.logged["matched"]) == changed
        if changed:
            matched = np.asarray(drive.recording.picture("matched", fix.frame), np.int16)
            errors = [np.abs(matched - reference).mean() for reference in drive.references]
            assert int(np.argmin(errors)) == fix.place


def test_frames_are_on_the_timeline_of_their_stamps(drive: Drive) -> None:
    for frame, time in drive.recording.column("score", "time").items():
        assert time.timestamp() == EPOCH + 0.5 * frame


def test_the_layout_comes_with_the_recording(drive: Drive) -> None:
    said = repr(drive.recording.layout)
    for name in (
        "camera",
        "matched",
        "distances",
        "matrix",
        "route",
        "place",
        "score",
        "latency_us",
    ):
        assert f"'/{name}'" in said or f"'{name}'" in said, name


def test_frames_of_a_video_are_on_a_timeline_from_its_start_and_untimed_ones_on_none(
    tmp_path: Path,
) -> None:
    route = surefix.Map.from_descriptors(np.eye(6, dtype=np.float32))
    rows = list(np.eye(6, dtype=np.float32) + np.float32(0.1))
    record(
        tmp_path / "timed.rrd", route, [Frame(row, 0.25 * k, str(k)) for k, row in enumerate(rows)]
    )  # type: ignore[arg-type]
    timed = Recording(tmp_path / "timed.rrd")
    assert timed.column("score", "time") == {k: timedelta(seconds=0.25 * k) for k in range(6)}
    record(tmp_path / "untimed.rrd", route, rows)
    untimed = Recording(tmp_path / "untimed.rrd")
    assert all("time" not in row for row in untimed.logged["score"].values())
    assert not {"camera", "matched", "route/here"} & set(untimed.logged), (
        "descriptors have no images, the map no places"
    )


def test_positions_of_three_coordinates_are_drawn_as_they_are(tmp_path: Path) -> None:
    positions = np.random.default_rng(3).normal(size=(6, 3)) * 50 + 1e5
    route = surefix.Map.from_descriptors(np.eye(6, dtype=np.float32), positions=positions)
    fixes, _ = record(tmp_path / "a.rrd", route, list(np.eye(6, dtype=np.float32)))
    recording = Recording(tmp_path / "a.rrd")
    for fix in fixes:
        at = recording.points("route/here", fix.frame, "Points3D")
        np.testing.assert_allclose(at, (positions - positions[0])[[fix.place]], rtol=1e-6)


def test_of_a_long_route_every_minimum_is_kept_and_a_row_does_not_grow(tmp_path: Path) -> None:
    generator = np.random.default_rng(5)
    places = 100_001
    rows = generator.normal(size=(places, 4)).astype(np.float32)
    route = surefix.Map.from_descriptors(rows, metric="euclidean")
    asked = [77_777, 12, 100_000]
    fixes, distances = record(
        tmp_path / "long.rrd", route, [rows[place] + np.float32(1e-3) for place in asked]
    )
    recording = Recording(tmp_path / "long.rrd")
    for fix, given in zip(fixes, distances, strict=True):
        column = given - np.median(given)
        values = recording.bars("distances/all", fix.frame)
        groups = [column[start : start + 101] for start in range(0, places, 101)]
        np.testing.assert_array_equal(values, [group.min() for group in groups])
        assert fix.single.place == asked[fix.frame]
        assert values.argmin() == fix.single.place // 101
        assert recording.bars("distances/minimum", fix.frame, "abscissa").tolist() == [
            fix.single.place
        ]
        assert recording.picture("matrix/distances", fix.frame).size == (240, 160)


def test_a_large_image_is_made_small(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (1000, 2000, 3), np.uint8)
    grey = noise[:, :, 0].copy()
    route = surefix.Map.from_images([noise, grey, noise[::-1].copy()], progress=False)
    record(tmp_path / "a.rrd", route, [noise, grey])
    recording = Recording(tmp_path / "a.rrd")
    assert recording.picture("camera", 0).size == (400, 200)
    assert recording.picture("camera", 1).mode == "L"


def test_confidence_and_belief_are_in_the_recording(drive: Drive, tmp_path: Path) -> None:
    path = tmp_path / "a.rrd"
    fixes, _ = record(path, drive.route, drive.queries, motion="any", places_drawn=20)
    recording = Recording(path)
    localizer = surefix.Localizer(drive.route, sequence_length=3, motion="any")
    for fix, query in zip(fixes, drive.queries, strict=True):
        assert localizer.push(query) == fix
        belief = localizer.belief
        assert belief is not None
        np.testing.assert_allclose(
            recording.bars("belief", fix.frame) ** 2, belief.reshape(20, 3).sum(1), rtol=1e-6
        )
        middles = recording.bars("belief", fix.frame, "abscissa")
        np.testing.assert_array_equal(middles, np.arange(1, PLACES, 3))
        row = recording.logged["fix"][fix.frame]
        track = fix.track
        names = "confidence", "off_map", "place_low", "place_high", "speed", "place"
        assert [row[name][0] for name in names] == [
            track.confidence, track.off_map, *track.interval, track.speed, track.place,
        ]  # fmt: skip
    for name in ("confidence", "off_map"):
        said = {fix.frame: getattr(fix, name) for fix in fixes}
        assert recording.scalars(f"sure/{name}") == said
    layouts = repr(recording.layout), repr(drive.recording.layout)
    names = "belief", "sure", "score"
    assert [[bool(re.search(f"'/?{name}'", each)) for name in names] for each in layouts] == [
        [True, True, False],
        [False, False, True],
    ]
    assert not {"belief", "sure/confidence"} & set(drive.recording.logged), "without motion"


@pytest.mark.slow
def test_the_command_line_saves_what_it_prints(drive: Drive, tmp_path: Path) -> None:
    (tmp_path / "queries").mkdir()
    for index, image in enumerate(drive.queries):
        Image.fromarray(image).save(tmp_path / "queries" / f"{index:03}.png")
    drive.route.save(tmp_path / "route.safetensors")
    done = surefix_(
        "run", tmp_path / "route.safetensors", tmp_path / "queries", "--save", tmp_path / "a.rrd"
    )
    recording = Recording(tmp_path / "a.rrd")
    printed = list(csv.DictReader(done.stdout.splitlines()))
    assert len(printed) == PLACES
    for row in printed:
        saved = recording.logged["fix"][int(row["frame"])]
        assert [
            saved["query"][0],
            str(saved["place"][0]),
            str(saved["score"][0]),
            str(saved["trusted"][0]).lower(),
        ] == [
            row["query"],
            row["place"],
            row["score"],
            row["trusted"],
        ]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map and queries."""
    folder = tmp_path_factory.mktemp("files")
    rows = np.random.default_rng(1).normal(size=(8, 5)).astype(np.float32)
    np.save(folder / "queries.npy", rows)
    surefix.Map.from_descriptors(rows).save(folder / "route.safetensors")
    return folder


def test_without_a_screen_one_line_says_so_and_the_fixes_come(files: Path) -> None:
    done = surefix_("run", files / "route.safetensors", files / "queries.npy", "--live")
    assert len(done.stdout.splitlines()) == 9
    about = [line for line in done.stderr.splitlines() if "--live" in line]
    assert len(about) == 1
    assert "needs a screen, and DISPLAY names none" in about[0]
    route = surefix.Map.open(files / "route.safetensors")
    if (
        sys.platform.startswith("linux")
        and not os.environ.get("DISPLAY")
        and not os.environ.get("WAYLAND_DISPLAY")
    ):
        with pytest.raises(surefix.SurefixError, match="needs a screen"):
            RerunView(route)


REFUSED = {
    "no such folder": (
        ["--save", "nowhere/a.rrd"],
        1,
        ["nowhere/a.rrd: cannot write the recording", "there is no folder nowhere"],
    ),
    "another ending": (
        ["--save", "a.mp4"],
        2,
        ["--save: expected a name that ends in .rrd, got a.mp4"],
    ),
    "turned off": (
        ["--save", "a.rrd"],
        1,
        ["expected the environment variable RERUN to be unset or on"],
    ),
    "the map's name": (
        ["--save", "route.rrd"],
        2,
        ["--save: route.rrd is read or written here for something else"],
    ),
    "the fixes' name": (
        ["--save", "f.rrd", "-o", "f.rrd", "--format", "csv"],
        2,
        ["--save: f.rrd is that of --out; name another file"],
    ),
    "no references": (
        ["--save", "a.rrd", "--references", "."],
        1,
        ["expected images of the map in ., got none"],
    ),
    "no such references": (
        ["--save", "a.rrd", "--references", "no"],
        1,
        ["expected the folder of the map's images"],
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_a_recording_that_cannot_be_is_refused_before_anything_is_written(
    what: str, files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options, code, words = REFUSED[what]
    (tmp_path / "route.rrd").write_bytes((files / "route.safetensors").read_bytes())
    (tmp_path / "before.csv").write_text("kept")
    monkeypatch.chdir(tmp_path)
    out = [] if "-o" in options else ["-o", "before.csv"]
    switch = {"RERUN": "off"} if what == "turned off" else {}
    done = surefix_("run", "route.rrd", files / "queries.npy", *out, *options, code=code, **switch)
    said = " ".join(done.stderr.replace("│", " ").split())
    for word in words:
        assert word in said
    assert (tmp_path / "before.csv").read_text() == "kept"
    assert (tmp_path / "route.rrd").read_bytes() == (files / "route.safetensors").read_bytes()
