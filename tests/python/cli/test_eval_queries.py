"""``surefix eval``: its queries are whatever ``surefix run`` localizes, and it judges the same
fixes.
"""

import csv
import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")
pytest.importorskip("bokeh")

from PIL import Image

import surefix
import tiny_network
from commands import surefix_
from recordings import Bag, write_video
from surefix import cli
from surefix.descriptors import Onnx, extract
from surefix.post import Normalize, Standardize
from surefix.simulate import Route

Run = Callable[..., tuple[int, str]]
PLACES = 40
OPTIONS = ("--truth", "identity", "--method", "weighted", "--floor", "running")


def network(folder: Path) -> Onnx:
    return Onnx(folder / "tiny.onnx", "map", (32, 16))


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drives")
    tiny_network.save(folder / "tiny.onnx")
    route = Route(places=PLACES, size=(64, 32))
    summer, winter = list(route.reference()), list(route.revisit())
    for name, drive in (("summer", summer), ("winter", winter)):
        (folder / name).mkdir()
        for index, image in enumerate(drive):
            Image.fromarray(image).save(folder / name / f"{index:03}.png")
    write_video(folder / "winter.mkv", winter)
    with Bag(folder, "mcap") as bag:
        for index, image in enumerate(winter):
            bag.image("/front", image, index / 10)
            bag.image("/back", summer[index], index / 10)
    surefix.Map.from_images(summer, progress=False).save(folder / "sad.safetensors")
    surefix.Map.from_images(summer[::3], progress=False).save(folder / "third.safetensors")
    for name, statistics in (("own", "references"), ("running", "running")):
        post = [Standardize(statistics), Normalize()]  # type: ignore[arg-type]
        learned = surefix.Map.from_images(
            folder / "summer", network(folder), post=post, progress=False
        )
        learned.save(folder / f"{name}.safetensors")
    rows = extract(folder / "winter", network(folder), progress=False)
    np.save(folder / "winter.npy", rows)
    surefix.Map.from_descriptors(rows).save(folder / "ready.safetensors")
    surefix.Map.from_descriptors(rows, recipe={"name": "strips"}).save(
        folder / "strips.safetensors"
    )
    gone = {"name": "onnx:gone/map", "file": "gone.onnx", "sha256": 64 * "0"}
    recipe = dict(network(folder).recipe) | gone
    surefix.Map.from_descriptors(rows, recipe=recipe).save(folder / "lost.safetensors")
    np.save(folder / "D.npy", np.random.default_rng(3).random((PLACES, PLACES)).astype(np.float32))
    return folder


@pytest.fixture
def run(
    drives: Path, undrawn: None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Run:
    """The command line in this process; its exit code and its errors."""

    def run(*arguments: object) -> tuple[int, str]:
        monkeypatch.chdir(drives)
        monkeypatch.setattr(sys, "argv", ["surefix", "eval", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            cli.main()
        said = capsys.readouterr()
        assert "Traceback" not in said.err
        return int(end.value.code or 0), re.sub(r"[\s│╭╮╰╯─]+", " ", said.err)

    return run


def fixes(folder: Path, method: str = "weighted") -> list[dict[str, str]]:
    with (folder / "fixes.csv").open(newline="", encoding="utf-8") as file:
        return [row for row in csv.DictReader(file) if row["method"] == method]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["own", "running"])
def test_a_map_by_a_network_is_judged_by_the_fixes_of_a_run(
    drives: Path, tmp_path: Path, run: Run, name: str
) -> None:
    route = surefix.Map.open(drives / f"{name}.safetensors")
    expected = surefix.match(route, drives / "winter", descriptor=network(drives), progress=False)
    cache = tmp_path / "winter.cache"
    model = ("--model", "tiny.onnx", "--cache", cache)
    # The network, and its cached vectors; a recording; its vectors, as ready descriptors.
    for out, queries, options in (
        ("first", "winter", model),
        ("again", "winter", model),
        ("video", "winter.mkv", model[:2]),
        ("ready", "winter.npy", ()),
    ):
        assert run(f"{name}.safetensors", queries, *options, *OPTIONS, "-o", tmp_path / out) == (
            0,
            "",
        )
        rows = fixes(tmp_path / out)
        assert [int(row["place"]) for row in rows] == expected.place.tolist()
        ready = [index for index, row in enumerate(rows) if row["ready"] == "true"]
        assert ready == np.flatnonzero(expected.ready).tolist()
        np.testing.assert_array_equal(
            [np.float32(rows[index]["score"]) for index in ready],
            expected.score[ready],
            err_msg=out,
        )
        assert [row["trusted"] == "true" for row in rows] == expected.trusted.tolist()
    assert cache.exists()


def test_odometry_moves_the_track(drives: Path, tmp_path: Path, run: Run) -> None:
    # The third map's places are 9 m apart, and the drive goes on 3 m a frame, but for a stop.
    driven = 3 * np.minimum(np.arange(PLACES), 30)
    lines = [f"{index / 10},{metres}" for index, metres in enumerate(driven)]
    (tmp_path / "wheels.csv").write_text("\n".join(["time,distance", *lines]))
    np.save(tmp_path / "truth.npy", np.arange(PLACES) // 3)
    route = surefix.Map.open(drives / "third.safetensors")
    D = np.stack([route.distances(route.descriptor.describe(surefix.read_image(path))) for path in sorted((drives / "winter").iterdir())], axis=1)  # type: ignore[union-attr]  # fmt: skip
    advance = np.diff(driven, prepend=0) / 9
    expected = surefix.match_distances(D, motion="any", advance=advance, sequence_length=1)
    given = ["third.safetensors", "winter.mkv", "--truth", tmp_path / "truth.npy"]
    given += ["--odometry", tmp_path / "wheels.csv", "-o", tmp_path / "out"]
    for scale in (["--spacing", 9], ["--places-per-metre", 1 / 9]):
        assert run(*given, *scale) == (0, "")
        rows = fixes(tmp_path / "out", "track_odometry")
        assert [int(row["place"]) for row in rows] == expected.place.tolist()
        assert len(fixes(tmp_path / "out", "sequence")) == PLACES
    code, said = run(*given)
    assert (code, "expected a map with positions, --spacing or" in said) == (2, True)
    (tmp_path / "wheels.csv").write_text("\n".join(["time,distance", *lines[:-2]]))
    code, said = run(*given, "--spacing", 9)
    assert (code, "positions at the times of all frames, got none for 2 frames" in said) == (
        2,
        True,
    )
    code, said = run(*given[:4], "--places-per-metre", 1)
    assert (code, "--places-per-metre: expected --odometry too" in said) == (2, True)


@pytest.mark.slow
def test_a_recording_is_evaluated_as_its_frames_in_a_folder_are(
    drives: Path, tmp_path: Path, run: Run
) -> None:
    np.save(tmp_path / "truth.npy", np.arange(PLACES)[::-1])
    options = ("--truth", tmp_path / "truth.npy", "--references", "summer", "--method", "single")
    for out, queries in (
        ("folder", ["winter"]),
        ("video", ["winter.mkv"]),
        ("bag", ["drive_mcap", "--topic", "/front"]),
    ):
        code, said = run("sad.safetensors", *queries, *options, "-o", tmp_path / out)
        # The truth is the other way round, so that there are mistakes to draw.
        assert (code, "is one of them in the other direction?" in said) == (0, True)
    folder = tmp_path / "folder"
    for out in (tmp_path / "video", tmp_path / "bag"):
        for row, expected in zip(fixes(out, "single"), fixes(folder, "single"), strict=True):
            assert row == expected | {"name": row["query"]}
        assert (out / "mistakes.png").read_bytes() == (folder / "mistakes.png").read_bytes()


@pytest.mark.slow
def test_some_frames_of_a_recording_are_the_queries(tmp_path: Path, run: Run) -> None:
    assert run("third.safetensors", "winter.mkv", "--stride", 3, *OPTIONS, "-o", tmp_path) == (
        0,
        "",
    )
    assert [row["name"] for row in fixes(tmp_path)] == [str(index) for index in range(0, PLACES, 3)]


@pytest.mark.slow
def test_a_recording_has_the_pictures_of_ready_distances(tmp_path: Path, run: Run) -> None:
    for out, queries in (("folder", "winter"), ("video", "winter.mkv")):
        assert run("D.npy", queries, *OPTIONS, "-o", tmp_path / out)[0] == 0
    pictures = [(tmp_path / out / "mistakes.png").read_bytes() for out in ("folder", "video")]
    assert pictures[0] == pictures[1]


MODEL = ("--model", "tiny.onnx")
MISTAKES: dict[str, tuple[tuple[object, ...], int, str]] = {
    "a model that is lost": (
        ("lost.safetensors", "winter"),
        2,
        "expected the ONNX file gone.onnx, which lost.safetensors was made with; it lies neither",
    ),
    "a model that is lost, a video": (
        ("lost.safetensors", "winter.mkv"),
        2,
        "add --model FILE",
    ),
    "a model of no use": (
        ("sad.safetensors", "winter", *MODEL),
        2,
        "got sad.safetensors, which names none",
    ),
    "a model and ready descriptors": (
        ("own.safetensors", "winter.npy", *MODEL),
        2,
        "--model: expected images, got the",
    ),
    "a model and distances": (
        ("D.npy", *MODEL),
        2,
        "--model, --save-map: expected a map or images, got the distances D.npy",
    ),
    "another network": (("strips.safetensors", "winter", *MODEL), 2, "got a map by 'strips'"),
    "no file": (
        ("own.safetensors", "winter", "--model", "no.onnx"),
        1,
        "no.onnx: cannot read the model",
    ),
    "a cache alone": (
        ("sad.safetensors", "winter", "--cache", "c"),
        2,
        "--cache: expected images for a network, as --model is",
    ),
    "images for descriptors": (
        ("ready.safetensors", "winter"),
        1,
        "as this map holds ready descriptors; got images",
    ),
    "images for strips": (
        ("strips.safetensors", "winter"),
        1,
        "by 'strips', neither an ONNX file nor a model of `surefix models`; got images",
    ),
    "ticks of images without times": (
        ("sad.safetensors", "winter", "--every", 2),
        2,
        "expected a video or a bag, got winter",
    ),
    "a stride of nothing": (("D.npy", "--stride", 2), 2, "expected a video or a bag, got none"),
    "two topics": (("sad.safetensors", "drive_mcap"), 1, "/back"),
    "no video": (
        ("sad.safetensors", "gone.mkv"),
        1,
        "gone.mkv: cannot read the video: there is no such file",
    ),
    "descriptors beside distances": (
        ("D.npy", "winter.npy"),
        1,
        "winter.npy: expected uint8 images",
    ),
    "few frames": (("D.npy", "winter.mkv", "--stride", 2), 1, "got 20 images for 40 queries"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_gets_one_clear_message(name: str, tmp_path: Path, run: Run) -> None:
    arguments, code, words = MISTAKES[name]
    out = tmp_path / "out"
    ended, said = run(*arguments, "--truth", "identity", "-o", out)
    assert (ended, words in said) == (code, True), said
    assert not out.exists()


def test_a_drive_is_judged_with_the_settings_and_the_gaps_that_it_runs_with(
    drives: Path, tmp_path: Path, run: Run
) -> None:
    rng = np.random.default_rng(5)
    taken = np.r_[0:12, 20:PLACES]
    with Bag(tmp_path, "mcap") as bag:
        for index in taken:
            image = surefix.read_image(drives / "winter" / f"{index:03}.png")
            noisy = np.clip(image + rng.integers(-30, 30, image.shape), 0, 255)
            bag.image("/front", noisy.astype(np.uint8), index / 10)
    settings = surefix.Settings(sequence_length=3, motion=surefix.Motion("free", pace=1.5))
    settings.save(tmp_path / "route.toml")
    np.save(tmp_path / "truth.npy", taken)
    given = ["sad.safetensors", tmp_path / "drive_mcap", "--config", tmp_path / "route.toml"]
    given += ["--gap", 0.5]
    done = surefix_("run", drives / given[0], *given[1:])
    expected = list(csv.DictReader(done.stdout.splitlines()))
    assert [row["gap"] for row in expected].count("true") == 1
    assert run(*given, "--truth", tmp_path / "truth.npy", "-o", tmp_path / "out") == (0, "")
    tracked, weighted = (fixes(tmp_path / "out", name) for name in ("track", "weighted"))
    assert [row["place"] for row in tracked] == [row["place"] for row in expected]
    assert [row["place"] for row in weighted] == [
        row["sequence_place"] or row["single_place"] for row in expected
    ]
    for row, other in zip(weighted, expected, strict=True):
        assert row["ready"] == other["ready"]
        assert row["trusted"] == other["trusted"]
        if row["ready"] == "true":
            assert float(row["score"]) == pytest.approx(float(other["sequence_score"]), rel=1e-6)


def test_the_trackers_motion_is_that_of_the_flag(drives: Path, tmp_path: Path, run: Run) -> None:
    given = ("D.npy", "--truth", "identity", "-o", tmp_path)
    D = np.load(drives / "D.npy")
    assert run(*given, "--motion", "steady") == (0, "")
    run_ = surefix.match_distances(D, motion="steady", sequence_length=1)
    assert [int(row["place"]) for row in fixes(tmp_path, "track")] == run_.place.tolist()
    assert run(*given, "--fuse", "D.npy", "--technique-weights", "1,0.25") == (0, "")
    run_ = surefix.match_distances([D, D], motion="any", technique_weights=[1, 0.25])
    assert [int(row["place"]) for row in fixes(tmp_path, "fused")] == run_.place.tolist()
    code, said = run(*given, "--method", "track")
    assert (code, "--method track: expected --motion or --config" in said) == (2, True)
    code, said = run(*given, "--gap", 1)
    assert (code, "--gap: expected a video or a bag, got none" in said) == (2, True)
