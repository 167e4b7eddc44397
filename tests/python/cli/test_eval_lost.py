"""The truth and the positions of a drive whose recording has frames that do not come."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

import surefix
from commands import surefix_
from recordings import Bag, packets, write_video
from surefix.frames import BagFrames, SkipBad, Stride, VideoFrames
from surefix.simulate import Route

pytest.importorskip("matplotlib")
pytest.importorskip("bokeh")

pytestmark = pytest.mark.usefixtures("undrawn")

N, LOST = 40, 17
DAY = 86_400
ROAD: list[npt.NDArray[np.uint8]] = [
    np.asarray(image) for image in Route(places=N, size=(64, 32), seed=3).reference()
]
KINDS = ("short", "png", "old", "copy")


def bag_of(folder: Path, kind: str) -> Path:
    """A bag with one message that does not come: too short, half a picture, too old, a copy."""
    with Bag(folder, "ros1", f"{kind}.bag") as bag:
        for at, image in enumerate(ROAD):
            time, lost = 1_700_000_000 + at / 8, at == LOST and kind != "whole"
            if kind == "png":
                file = folder / "one.png"
                Image.fromarray(image).save(file)
                data = file.read_bytes()
                bag.compressed("/camera", data[:60] if lost else data, "png", time)
            elif kind == "short" and lost:
                bag.image("/camera", image[:-3], time, size=image.shape[:2], step=3 * 64)
            elif kind == "copy" and lost:
                bag.image("/camera", image, time - 1 / 8, recorded=time)
            else:
                stamp = time - DAY if lost else time
                bag.image("/camera", image, stamp, recorded=time)
    return bag.path


@pytest.fixture(scope="module")
def road(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map of the whole drive, and its bags, each with a message that does not come."""
    folder = tmp_path_factory.mktemp("lost")
    for kind in ("whole", *KINDS):
        bag_of(folder, kind)
    way = np.stack([np.arange(N) * 2.0, np.zeros(N)], axis=1)
    np.save(folder / "way.npy", way)
    how = ("--positions", folder / "way.npy", "-o", folder / "map.safetensors")
    surefix_("map", "build", folder / "whole.bag", *how)
    return folder


def judged(road: Path, queries: Path, *truth: object, tolerance: float = 0) -> tuple[str, str]:
    """The line of the method single, and what is said beside it."""
    how = ("--tolerance", tolerance, "--method", "single", "-o", road / "report")
    done = surefix_("eval", road / "map.safetensors", queries, *truth, *how)
    line = next(line for line in done.stdout.splitlines() if line.startswith("single"))
    return line.rpartition(", ")[2], done.stderr + done.stdout.splitlines()[-1]


@pytest.mark.parametrize("kind", KINDS)
def test_a_truth_has_a_row_for_each_message_or_for_each_that_came(road: Path, kind: str) -> None:
    bag, came = road / f"{kind}.bag", np.delete(np.arange(N), LOST)
    np.save(road / "all.npy", np.arange(N))
    np.save(road / "came.npy", came)
    rows = "\n".join(f"{query},{query}" for query in range(N))
    (road / "all.csv").write_text(f"query,reference\n{rows}\n")
    right = "39 of 39 right"
    for truth in ("identity", road / "all.npy", road / "all.csv"):
        line, said = judged(road, bag, "--truth", truth)
        assert line == right
        assert f"1 frame of {N} did not come ({LOST}); its row is left out" in said
    line, said = judged(road, bag, "--truth", road / "came.npy")
    assert line == right
    assert f"1 frame of {N} did not come ({LOST}); a row for each of the 39 that came" in said
    # The last line names what is missing.
    last = said.splitlines()[-1]
    assert f"message {LOST}" in last if kind in ("short", "png") else "1 message left out" in last
    where = np.load(road / "way.npy")
    for name, positions in (("all", where), ("came", where[came])):
        np.save(road / f"where_{name}.npy", positions)
        given = ("--query-positions", road / f"where_{name}.npy")
        assert judged(road, bag, *given, tolerance=1)[0] == right
    np.save(road / "short.npy", np.arange(N - 2))
    how = ("--truth", road / "short.npy", "-o", road / "report")
    done = surefix_("eval", road / "map.safetensors", bag, *how, code=1)
    assert "(39 of 40 frames of the recording came)" in " ".join(done.stderr.split())


@pytest.mark.parametrize("kind", KINDS)
def test_tune_and_map_build_take_the_same(road: Path, kind: str, tmp_path: Path) -> None:
    bag, out = road / f"{kind}.bag", tmp_path / "route.toml"
    done = surefix_(
        "tune", road / "map.safetensors", bag, "--truth", "identity", "--tolerance", 0, "-o", out
    )
    assert f"1 frame of {N} did not come ({LOST}); its row is left out" in done.stderr
    made = tmp_path / "map.safetensors"
    surefix_("map", "build", bag, "--positions", road / "way.npy", "-o", made)
    where = np.delete(np.load(road / "way.npy"), LOST, axis=0)
    assert np.array_equal(surefix.Map.open(made).positions, where)
    # Of a map that lacks the same frame, each frame that came is the next place.
    how = ("--truth", "identity", "--tolerance", 0, "--method", "single", "-o", road / "report")
    done = surefix_("eval", made, bag, *how)
    assert "39 of 39 right" in done.stdout
    assert "a row for each of the 39 that came" in done.stderr


def test_a_video_in_a_bag_without_its_first_key_frame(road: Path) -> None:
    pytest.importorskip("av")
    with Bag(road, "mcap", "video_mcap") as bag:
        for number, data in packets(ROAD):
            # The messages come, but the key frame is no picture.
            time = 1_700_000_000 + number / 8
            data = b"\0\0\1\x09\x10" if number == 0 else data
            bag.video("/camera", data, "h264", time, "CompressedVideo", time)
    line, said = judged(road, bag.path, "--truth", "identity", tolerance=1)
    assert line == "30 of 30 right"
    assert "10 frames of 40 did not come (0, 1, 2 and 7 more); their rows are left out" in said
    assert "10 messages before the first key frame left out" in said.splitlines()[-1]


def test_a_damaged_video(road: Path) -> None:
    file = write_video(road / "drive.mov", ROAD, codec="png", pixels="rgb24")
    data = bytearray(file.read_bytes())
    starts = [at for at in range(len(data)) if data[at : at + 8] == b"\x89PNG\r\n\x1a\n"]
    assert len(starts) == N
    data[starts[LOST] : starts[LOST] + 200] = bytes(200)
    file.write_bytes(data)
    line, said = judged(road, file, "--truth", "identity")
    assert line == "39 of 39 right"
    assert f"1 frame of {N} did not come ({LOST})" in said
    assert f"frame {LOST}: a damaged video" in said.splitlines()[-1]


def test_images_that_are_cut_keep_their_rows(road: Path) -> None:
    folder = road / "images"
    folder.mkdir()
    for at, image in enumerate(ROAD):
        Image.fromarray(image).save(folder / f"{at:03}.png")
    bad = folder / f"{LOST:03}.png"
    bad.write_bytes(bad.read_bytes()[:60])
    line, _ = judged(road, folder, "--truth", "identity", "--crop")
    assert line == "39 of 39 right"


def test_the_frames_know_their_row(road: Path) -> None:
    frames = SkipBad(BagFrames(road / "png.bag"))
    numbers = [shot.number for shot in frames.shots()]
    assert numbers == [number for number in range(N) if number != LOST]
    assert frames.total == N
    # Those that are chosen are counted anew, with the bad ones among them.
    some = SkipBad(Stride(BagFrames(road / "png.bag"), LOST))
    assert [shot.number for shot in some.shots()] == [0, 2]
    assert some.total == 3
    video = VideoFrames(write_video(road / "whole.mkv", ROAD))
    assert [shot.number for shot in video.shots()] == [*range(N)]
    assert video.total == N
