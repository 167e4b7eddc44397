"""One bad frame does not end a drive; and images of another shape than the map's."""

import csv
import io
import logging
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar

import av
import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

import surefix
from commands import surefix_
from recordings import pictures, write_video
from surefix.descriptors import extract
from surefix.frames import SkipBad, VideoFrames
from surefix.simulate import Route

PLACES = 40
BAD = (7, 20, 21)


def jpeg(image: npt.NDArray[np.uint8], **options: object) -> bytes:
    memory = io.BytesIO()
    Image.fromarray(image).save(memory, "jpeg", quality=95, **options)
    return memory.getvalue()


def noise() -> npt.NDArray[np.uint8]:
    return (
        np.random.default_rng(5).integers(0, 256, (48, 96, 3), np.uint8).repeat(2, 0).repeat(2, 1)
    )


DAMAGE: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda data: b"",
    "half": lambda data: data[: len(data) // 2],
    "half and its end": lambda data: data[: len(data) // 2] + b"\xff\xd9",
    "zeros to the end": lambda data: data[: len(data) // 2] + bytes(len(data) // 2),
    "another file": lambda data: b"<html>404</html>",
    "header only": lambda data: data[:30],
}


@pytest.mark.parametrize("damage", DAMAGE)
@pytest.mark.parametrize("form", ["jpeg", "png", "tiff", "bmp", "webp"])
def test_damage_of_every_kind_is_an_error_that_names_the_file(
    tmp_path: Path, form: str, damage: str
) -> None:
    memory = io.BytesIO()
    Image.fromarray(noise()).save(memory, form)
    path = tmp_path / "a.img"
    path.write_bytes(DAMAGE[damage](memory.getvalue()))
    if form in ("bmp", "tiff", "webp") and damage == "zeros to the end":
        return  # Raw pixels: black ones are as good as others. A decoder of WebP takes any bits.
    if form == "tiff" and damage == "half and its end":
        path.write_bytes(DAMAGE["half"](memory.getvalue()))
    with pytest.raises(surefix.SurefixValueError, match=r"a\.img"):
        surefix.read_image(path)


@pytest.mark.parametrize("grey", [False, True])
@pytest.mark.parametrize("options", [{}, {"subsampling": 0}, {"restart_marker_rows": 1}])
def test_a_picture_whose_rest_is_made_up_is_damaged(options: dict[str, int], grey: bool) -> None:
    small = Image.fromarray(np.random.default_rng(0).integers(0, 256, (30, 40, 3), np.uint8))
    scene = np.asarray(small.resize((640, 480)).convert("L" if grey else "RGB"))
    data = jpeg(scene, **options)
    half = data[: len(data) // 2]
    for rest in (b"\xff\xd9", bytes(999) + b"\xff\xd9", b"\xff" * 999 + b"\xff\xd9"):
        with pytest.raises(surefix.SurefixValueError, match="the rest of the picture is missing"):
            surefix.frames.image_of(_compressed(half + rest))


def _compressed(data: bytes) -> object:
    from types import SimpleNamespace

    header = SimpleNamespace(frame_id="", stamp=SimpleNamespace(sec=0, nanosec=0))
    return SimpleNamespace(format="jpeg", data=np.frombuffer(data, np.uint8), header=header)


@pytest.mark.parametrize("level", [0, 16, 128, 200, 255])
def test_a_plain_picture_and_one_with_bars_are_whole(tmp_path: Path, level: int) -> None:
    plain = np.full((96, 192, 3), level, np.uint8)
    barred = plain.copy()
    barred[:40] = noise()[:40]
    for index, image in enumerate((plain, barred)):
        if level == 128 and index:
            continue  # A bar of just the grey that decoders fill in.
        path = tmp_path / f"{index}.jpg"
        path.write_bytes(jpeg(image))
        assert surefix.read_image(path).shape == (96, 192, 3)


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two drives, as whole images and with some bad ones."""
    folder = tmp_path_factory.mktemp("drives")
    route = Route(places=PLACES, size=(96, 48))
    for name, drive in (("map", route.reference()), ("drive", route.revisit())):
        for kind in ("whole", "bad"):
            (folder / f"{kind}_{name}").mkdir()
            for index in range(PLACES):
                file = folder / f"{kind}_{name}" / f"{index}.png"
                Image.fromarray(drive[index]).save(file)
                if kind == "bad" and index in BAD:
                    data = file.read_bytes()
                    file.write_bytes(data[: len(data) // 2 if index != BAD[0] else 0])
    surefix_("map", "build", folder / "whole_map", "-o", folder / "m")
    return folder


LEFT = [index for index in range(PLACES) if index not in BAD]


def test_a_map_is_made_of_the_others(
    drives: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    done = surefix_("map", "build", drives / "bad_map", "-o", tmp_path / "m")
    assert done.stdout.splitlines()[-1].endswith(
        "; 3 bad frames passed over: 7.png, 20.png, 21.png"
    )
    assert [record.message.split(":")[1] for record in caplog.records].count(" image ") == 0
    assert sum("20.png" in record.message for record in caplog.records) == 1
    known, whole = surefix.Map.open(tmp_path / "m"), surefix.Map.open(drives / "m")
    assert known.names == [f"{index}.png" for index in LEFT]
    assert np.array_equal(known.descriptors, whole.descriptors[LEFT])
    stopped = surefix_("map", "build", drives / "bad_map", "-o", tmp_path / "n", "--strict", code=1)
    assert "7.png" in stopped.stderr
    assert not (tmp_path / "n").exists()


def test_positions_stay_with_their_images(drives: Path, tmp_path: Path) -> None:
    where = np.column_stack([np.arange(PLACES) * 2.0, np.zeros(PLACES)])
    with pytest.raises(surefix.SurefixValueError, match=r"7\.png"):
        surefix.Map.from_images(drives / "bad_map", positions=where)
    known = surefix.Map.from_images(drives / "bad_map", positions=where, skip_bad=True)
    assert known.positions is not None
    assert np.array_equal(known.positions, where[LEFT])
    surefix.Map.build(tmp_path / "m", drives / "bad_map", positions=where, skip_bad=True)
    assert surefix.Map.open(tmp_path / "m").to_bytes() == known.to_bytes()
    surefix.Map.append(tmp_path / "m", drives / "bad_map", positions=where, skip_bad=True)
    longer = surefix.Map.open(tmp_path / "m").positions
    assert longer is not None
    assert np.array_equal(longer[len(LEFT) :], where[LEFT])
    with pytest.raises(surefix.SurefixValueError, match="positions"):
        surefix.Map.from_images(drives / "bad_map", positions=where[:-1], skip_bad=True)


class Rows:
    """A learned descriptor: the mean of each row."""

    name = "rows"
    recipe: ClassVar = {"name": "rows"}

    def describe(self, images: list[npt.NDArray[np.uint8]]) -> npt.NDArray[np.float32]:
        return np.stack([image.reshape(48, -1).mean(axis=1) for image in images]).astype(np.float32)


def test_a_learned_map_is_made_of_the_others_too(drives: Path, tmp_path: Path) -> None:
    where = np.column_stack([np.arange(PLACES) * 2.0, np.zeros(PLACES)])
    how = {"metric": "euclidean", "progress": False, "positions": where}
    known = surefix.Map.from_images(drives / "bad_map", Rows(), skip_bad=True, **how)  # type: ignore[arg-type]
    assert known.names == [f"{index}.png" for index in LEFT]
    assert known.positions is not None
    assert np.array_equal(known.positions, where[LEFT])
    # A cache goes on behind the bad ones.
    how |= {"cache": tmp_path / "cache"}
    for _ in range(2):
        again = surefix.Map.from_images(drives / "bad_map", Rows(), skip_bad=True, **how)  # type: ignore[arg-type]
        assert np.array_equal(again.descriptors, known.descriptors)
    with pytest.raises(surefix.SurefixValueError, match=r"7\.png"):
        extract(drives / "bad_map", Rows(), progress=False)


def rows(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text().splitlines()))


def test_a_drive_goes_on_behind_a_bad_frame(drives: Path, tmp_path: Path) -> None:
    run = ("run", drives / "m", drives / "bad_drive", "-o", tmp_path / "fixes.csv")
    done = surefix_(*run)
    assert [row["query"] for row in rows(tmp_path / "fixes.csv")] == [f"{i}.png" for i in LEFT]
    assert "3 frames dropped" in done.stderr
    last = done.stderr.splitlines()[-1]
    assert last.startswith("3 bad frames passed over: ")
    assert "7.png" in last
    stopped = surefix_(*run, "--strict", code=1)
    assert "7.png" in stopped.stderr
    assert "fixes.part.csv" in stopped.stderr
    assert len(rows(tmp_path / "fixes.part.csv")) == 7
    assert len(rows(tmp_path / "fixes.csv")) == len(LEFT)


def test_a_truth_stays_with_its_queries(drives: Path, tmp_path: Path) -> None:
    def evaluated(drive: str, *more: object) -> str:
        out = tmp_path / f"report_{drive}"
        known = drives / "m"
        given = ("--truth", "identity", "--method", "single", "-o", out)
        return surefix_("eval", known, drives / drive, *given, *more).stdout

    whole, bad = evaluated("whole_drive"), evaluated("bad_drive")
    counts = [re.search(r"single: .* (\d+) of (\d+) right", text) for text in (whole, bad)]
    (right, judged), (fewer, left) = (map(int, found.groups()) for found in counts if found)
    assert judged - left == len(BAD)
    assert right >= fewer >= right - len(BAD)
    assert bad.splitlines()[-1].endswith("; 3 bad frames passed over: 7.png, 20.png, 21.png")
    # By positions, along the route.
    np.save(tmp_path / "where.npy", np.column_stack([np.arange(PLACES) * 2.0, np.zeros(PLACES)]))
    by = ("--positions", tmp_path / "where.npy", "--query-positions", tmp_path / "where.npy")
    out = ("--tolerance", 2, "--method", "single", "-o", tmp_path / "r")
    said = surefix_("eval", drives / "m", drives / "bad_drive", *by, *out).stdout
    assert f"{PLACES} places x {len(LEFT)} queries" in said
    done = surefix_("align", drives / "m", drives / "bad_drive", "-o", tmp_path / "t.csv")
    assert "3 bad frames passed over" in done.stderr
    assert len(rows(tmp_path / "t.csv")) == len(LEFT)
    tuned = (
        drives / "m",
        drives / "bad_drive",
        "-o",
        tmp_path / "route.toml",
        "--truth",
        "identity",
    )
    surefix_("tune", *tuned)


def test_if_all_are_bad_it_is_an_error(tmp_path: Path, drives: Path) -> None:
    for index in range(3):
        (tmp_path / f"{index}.png").write_bytes(b"\x89PNG")
    for command in (
        ("map", "build", tmp_path, "-o", tmp_path / "m"),
        ("run", drives / "m", tmp_path),
        ("eval", drives / "m", tmp_path, "--truth", "identity", "-o", tmp_path / "r"),
    ):
        assert "0.png" in surefix_(*command, code=1).stderr
    with pytest.raises(surefix.SurefixValueError, match=r"0\.png"):
        surefix.Map.from_images(tmp_path, Rows(), skip_bad=True, progress=False)


def test_frames_in_a_program_go_on_too(drives: Path, caplog: pytest.LogCaptureFixture) -> None:
    frames = surefix.frames.open(drives / "bad_drive", skip_bad=True)
    assert isinstance(frames, SkipBad)
    with caplog.at_level(logging.WARNING, "surefix"):
        got = list(frames)
    assert [frame.name for frame in got] == [f"{index}.png" for index in LEFT]
    assert [frame.dropped for frame in got if frame.dropped] == [1, 2]
    assert len(frames.bad) == len(caplog.records) == 3
    localizer = surefix.Localizer(surefix.Map.open(drives / "m"))
    assert len(list(localizer.stream(frames))) == len(LEFT)
    # Every second file, bad ones among them.
    strided = surefix.frames.open(drives / "bad_drive", stride=2, skip_bad=True)
    assert [frame.name for frame in strided] == [f"{i}.png" for i in range(0, PLACES, 2) if i != 20]


def packets(path: Path) -> list[tuple[int, int]]:
    """Where each packet of a video lies."""
    with av.open(str(path)) as container:
        return [(packet.pos, packet.size) for packet in container.demux(video=0) if packet.size]


def test_a_damaged_frame_of_a_video_is_passed_over(tmp_path: Path) -> None:
    path = write_video(tmp_path / "a.mkv", pictures(20), codec="mjpeg", pixels="yuvj420p")
    whole = [frame.image for frame in VideoFrames(path)]
    data = bytearray(path.read_bytes())
    position, size = packets(path)[6]
    data[position + 8 : position + size] = b"\xff" * (size - 8)
    path.write_bytes(data)
    with pytest.raises(surefix.SurefixValueError, match="frame 6: a damaged video"):
        list(VideoFrames(path))
    frames = VideoFrames(path, skip_bad=True)
    got = list(frames)
    assert [int(frame.name) for frame in got] == [i for i in range(20) if i != 6]
    assert [frame.dropped for frame in got] == [int(i == 7) for i in range(20) if i != 6]
    assert all(np.array_equal(frame.image, whole[int(frame.name)]) for frame in got)
    assert len(frames.bad) == 1


def test_what_is_made_of_a_damaged_frame_is_passed_over_too(tmp_path: Path) -> None:
    path = tmp_path / "a.mkv"
    images = pictures(20)
    with av.open(str(path), "w") as container:
        track = container.add_stream("libx264", rate=10)
        track.height, track.width, track.pix_fmt = 48, 64, "yuv420p"
        track.codec_context.gop_size = 5
        track.codec_context.options = {"x264-params": "scenecut=0"}
        for image in images:
            container.mux(track.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(track.encode())
    whole = [frame.image for frame in VideoFrames(path)]
    data = bytearray(path.read_bytes())
    position, size = packets(path)[0]
    data[position + 8 : position + size] = b"\xff" * (size - 8)
    path.write_bytes(data)
    got = list(VideoFrames(path, skip_bad=True))
    # The first five frames rest on the first.
    assert [int(frame.name) for frame in got] == list(range(5, 20))
    assert all(np.array_equal(frame.image, whole[int(frame.name)]) for frame in got)
    assert got[0].dropped == 5


@pytest.mark.parametrize("b_frames", [0, 2])
@pytest.mark.parametrize("sound", [0.0, 4.0])
def test_a_sound_flv_is_whole(tmp_path: Path, b_frames: int, sound: float) -> None:
    path = tmp_path / "a.flv"
    with av.open(str(path), "w") as container:
        track = container.add_stream("libx264", rate=10)
        track.height, track.width, track.pix_fmt = 48, 64, "yuv420p"
        track.codec_context.max_b_frames = b_frames
        silence = container.add_stream("aac", rate=44100, layout="mono") if sound else None
        for image in pictures(40):
            container.mux(track.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(track.encode())
        if silence is not None:
            samples = np.zeros((1, int(44100 * sound)), np.float32)
            frame = av.AudioFrame.from_ndarray(samples, format="fltp", layout="mono")
            frame.sample_rate, frame.pts = 44100, 0
            container.mux(silence.encode(frame))
            container.mux(silence.encode())
    assert len(list(VideoFrames(path))) == 40
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    if not sound:
        with pytest.raises(surefix.SurefixValueError, match="damaged video"):
            list(VideoFrames(path))


def test_queries_of_another_shape_are_warned_of_and_cropped(drives: Path, tmp_path: Path) -> None:
    known = drives / "m"
    assert surefix.Map.open(known).image_size == (96, 48)
    route = Route(places=PLACES, size=(96, 48))
    drive = route.revisit()
    wide = tmp_path / "wide"
    wide.mkdir()
    for index in range(PLACES):
        frame = np.pad(drive[index], ((0, 0), (20, 20), (0, 0)), mode="edge")
        Image.fromarray(frame).save(wide / f"{index}.png")
    done = surefix_("run", known, wide)
    warning = next(line for line in done.stderr.splitlines() if line.startswith("Warning"))
    assert "136 x 48" in warning
    assert "96 x 48" in warning
    for name, given in (("wide", wide), ("whole", drives / "whole_drive")):
        crop = ["--crop"] if name == "wide" else []
        done = surefix_("run", known, given, "-o", tmp_path / f"{name}.csv", *crop)
        assert "Warning" not in done.stderr
    cropped, whole = rows(tmp_path / "wide.csv"), rows(tmp_path / "whole.csv")
    assert [row["score"] for row in cropped] == [row["score"] for row in whole]
    for command in ("eval", "align"):
        more = ("--truth", "identity", "--method", "single", "-o", tmp_path / "r")
        more = more if command == "eval" else ("-o", tmp_path / "t.csv")
        assert "136 x 48" in surefix_(command, known, wide, *more).stderr
        assert "136 x 48" not in surefix_(command, known, wide, *more, "--crop").stderr
    # Another size of the same shape is no other shape.
    small = tmp_path / "small"
    small.mkdir()
    for index in range(5):
        Image.fromarray(drive[index]).resize((480, 240)).save(small / f"{index}.png")
    assert "Warning" not in surefix_("run", known, small).stderr
    ready = tmp_path / "ready.safetensors"
    surefix.Map.from_descriptors(np.eye(5, dtype=np.float32)).save(ready)
    assert "--crop" in surefix_("run", ready, small, "--crop", code=2).stderr


def test_maps_of_mixed_sizes_if_the_user_says_so(tmp_path: Path) -> None:
    for index, size in enumerate([(96, 48), (64, 48), (96, 48)]):
        noise_ = np.random.default_rng(index).integers(0, 256, size[::-1], np.uint8)
        Image.fromarray(noise_).save(tmp_path / f"{index}.png")
    done = surefix_("map", "build", tmp_path, "-o", tmp_path / "m", code=1)
    assert "96 x 48 pixels like the ones before it, got 64 x 48" in done.stderr
    surefix_("map", "build", tmp_path, "-o", tmp_path / "m", "--mixed-sizes")
    known = surefix.Map.open(tmp_path / "m")
    assert (len(known), known.image_size) == (3, None)
    assert surefix.Map.from_images(tmp_path, mixed_sizes=True).to_bytes() == known.to_bytes()
    with pytest.raises(surefix.SurefixValueError, match="64 x 48"):
        surefix.Map.from_images(tmp_path, skip_bad=True)


def test_images_of_another_shape_cannot_follow(drives: Path, tmp_path: Path) -> None:
    (tmp_path / "m").write_bytes((drives / "m").read_bytes())
    with pytest.raises(surefix.SurefixValueError, match=r"96 x 48.*48 x 48"):
        surefix.Map.append(tmp_path / "m", np.zeros((2, 48, 48), np.uint8))
    surefix.Map.append(tmp_path / "m", np.zeros((2, 48, 48), np.uint8), mixed_sizes=True)
    surefix.Map.append(tmp_path / "m", np.zeros((2, 96, 192), np.uint8))


def test_the_limit_of_a_panorama_is_surefix_s_and_can_be_raised(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", None)
    path = tmp_path / "panorama.png"
    Image.new("RGB", (2200, 1100)).save(path)
    Image.new("RGB", (2200, 1100)).save(tmp_path / "foreign.avif")
    write_video(tmp_path / "drive.mp4", pictures(2), codec="libx264", pixels="yuv420p")
    before = surefix.max_pixels()
    try:
        surefix.set_max_pixels(2_400_000)
        for name in ("panorama.png", "foreign.avif"):
            with pytest.raises(surefix.SurefixValueError) as caught:
                surefix.read_image(tmp_path / name)
            for words in (name, "2200 x 1100", "surefix", "max_pixels = 2400000", "2420000"):
                assert words in str(caught.value)
        surefix.set_max_pixels(2_420_000)
        assert surefix.read_image(path).shape == (1100, 2200, 3)
        assert surefix.read_image(tmp_path / "foreign.avif").shape == (1100, 2200, 3)
        surefix.set_max_pixels(3071)
        with pytest.raises(surefix.SurefixValueError, match="64 x 48 pixels count as 3072"):
            VideoFrames(tmp_path / "drive.mp4")
        for wrong in (0, -1, 1.5, "many"):
            with pytest.raises(surefix.SurefixValueError, match="a whole number above 0"):
                surefix.set_max_pixels(wrong)
        shutil.copy(path, tmp_path / "panorama2.png")
        command = ["map", "build", tmp_path, "-o", tmp_path / "m", "--max-pixels"]
        refused = surefix_(*command, 2_400_000, code=1)
        assert "2200 x 1100 pixels" in refused.stderr
        assert "--max-pixels" in refused.stderr
    finally:
        surefix.set_max_pixels(before)
