"""Streams of frames: files, arrays, and sources that pass frames over."""

import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import surefix
from recordings import pictures
from surefix.frames import Every, Frame, Frames, Gaps, ImageFrames, KeepNewest, Stride, VideoFrames
from surefix.frames import open as frames_open

BLACK = np.zeros((4, 6), np.uint8)


def frames(times: Iterable[float | None], dropped: Iterable[int] = ()) -> list[Frame]:
    lost = list(dropped)
    return [Frame(BLACK, time, str(i), lost[i] if lost else 0) for i, time in enumerate(times)]


def names(stream: Iterable[Frame]) -> list[int]:
    return [int(frame.name) for frame in stream]


def test_a_folder_comes_in_the_order_of_counting(tmp_path: Path) -> None:
    images = pictures(12)
    for index, image in enumerate(images):
        Image.fromarray(image).save(tmp_path / f"frame{index}.png")
    for place in (tmp_path, tmp_path / "*.png"):
        stream = frames_open(place)
        assert isinstance(stream, ImageFrames)
        assert (len(stream), stream.timed, stream.live) == (12, False, False)
        for _ in range(2):
            read = list(stream)
            assert [frame.name for frame in read] == [f"frame{index}.png" for index in range(12)]
            assert all(
                (frame.image == image).all() for frame, image in zip(read, images, strict=True)
            )
            assert {(frame.time, frame.dropped, frame.gap) for frame in read} == {(None, 0, False)}
    chosen = [tmp_path / f"frame{index}.png" for index in (3, 11, 2)]
    assert [frame.name for frame in frames_open(chosen)] == [
        "frame3.png",
        "frame11.png",
        "frame2.png",
    ]


def test_an_image_is_read_when_it_is_wanted(tmp_path: Path) -> None:
    Image.fromarray(BLACK).save(tmp_path / "0.png")
    (tmp_path / "1.png").write_bytes(b"none")
    Image.fromarray(BLACK).save(tmp_path / "2.png")
    assert [frame.name for frame in frames_open(tmp_path, stride=2)] == ["0.png", "2.png"]
    stream = iter(frames_open(tmp_path))
    assert next(stream).name == "0.png"
    with pytest.raises(surefix.SurefixValueError, match=r"1\.png"):
        next(stream)


def test_an_array_is_a_stream_of_its_rows(tmp_path: Path) -> None:
    rows = np.random.default_rng(0).normal(size=(5, 7)).astype(np.float32)
    np.save(tmp_path / "rows.npy", rows)
    stream = frames_open(tmp_path / "rows.npy")
    assert isinstance(stream, ImageFrames)
    assert np.array_equal(np.stack([frame.image for frame in stream]), rows)
    assert names(frames_open(tmp_path / "rows.npy", stride=3)) == [0, 3]
    assert len(frames_open(tmp_path / "rows.npy", stride=3)) == 2


@pytest.mark.parametrize("seed", range(40))
def test_a_frame_every_so_many_seconds_is_the_nearest_to_each_tick(seed: int) -> None:
    generator = np.random.default_rng(seed)
    # Whole sixteenths are exact, so that both sides divide alike.
    times = 1000 + np.cumsum(generator.integers(1, 10, 90)) / 16
    seconds = generator.integers(21, 64) / 16
    # The last if one more frame, as far on, would not be nearer.
    until = times[-1] + (times[-1] - times[-2]) / 2
    ticks = np.arange(times[0], until, seconds)
    # Of two as near, the later.
    nearest = len(times) - 1 - np.abs(times[::-1, None] - ticks).argmin(axis=0)
    assert names(Every(frames(times.tolist()), seconds)) == nearest.tolist()


def test_a_clock_that_jitters_gives_all_frames() -> None:
    for seed in range(20):
        for start in (0.0, 1.7e9):
            jitter = np.random.default_rng(seed).uniform(-0.005, 0.005, 100)
            times = start + np.arange(100) / 10 + jitter
            assert names(Every(frames(times.tolist()), 0.1)) == [*range(100)]
            # Every other one, evenly.
            half = names(Every(frames(times.tolist()), 0.2))
            assert half == [*range(0, 100, 2)]


@pytest.mark.parametrize("rate", [9.95, 9.99, 10.01, 10.05])
def test_a_camera_a_little_slower_or_faster_than_the_ticks_loses_no_more_than_it_must(
    rate: float,
) -> None:
    for seed in range(10):
        jitter = np.random.default_rng(seed).uniform(-0.005, 0.005, 3000)
        times = np.arange(3000) / rate + jitter
        taken = names(Every(frames(times.tolist()), 0.1))
        # As many as there are ticks, if there are frames for them.
        assert len(taken) == pytest.approx(min(3000, 10 * times[-1]), abs=2)
        assert np.diff(times[taken]).max() < 0.22


def test_a_gap_begins_the_ticks_anew() -> None:
    times = [0, 0.5, 1.0, 1.5, 7.3, 7.8, 8.3, 8.8]
    assert names(Every(frames(times), 1)) == [0, 2, 4, 6]
    # Also one that the source knows of, though the clock does not show it.
    marked = [
        Frame(BLACK, time, str(index), gap=index == 3)
        for index, time in enumerate([0, 0.4, 0.8, 1.2, 1.6, 2.2])
    ]
    assert names(Every(marked, 1)) == [0, 2, 3, 5]


def test_slower_frames_than_the_ticks_are_all_taken_once() -> None:
    for period in (0.11, 0.15, 0.2, 0.37):
        times = (np.arange(200) * period).tolist()
        assert names(Every(frames(times), 0.1)) == [*range(200)]


def test_a_stream_waits_for_one_frame_at_most() -> None:
    given: list[int] = []

    def live() -> Iterator[Frame]:
        for index, time in enumerate([0.0, 0.09, 0.21, 0.3, 0.39]):
            given.append(index)
            yield Frame(BLACK, time, str(index))

    behind = [given[-1] - int(frame.name) for frame in Every(live(), 0.1)]
    assert behind == [0, 1, 0, 0, 0]


@pytest.mark.parametrize("seed", range(40))
def test_gaps_are_where_the_clock_jumps(seed: int) -> None:
    generator = np.random.default_rng(seed)
    steps = generator.choice([0.0, 0.125, 0.25, 1.0, 4.0, -0.5], 50)
    times, seconds = np.cumsum(steps), generator.choice([0.125, 0.5, 1.0])
    expected = np.flatnonzero((np.diff(times) > seconds) | (np.diff(times) < 0)) + 1
    found = [int(frame.name) for frame in Gaps(frames(times.tolist()), seconds) if frame.gap]
    assert found == expected.tolist()


@pytest.mark.parametrize("seed", range(40))
def test_what_is_missing_before_a_frame_that_is_passed_over_is_missing_before_the_next(
    seed: int,
) -> None:
    generator = np.random.default_rng(seed)
    times = np.cumsum(generator.choice([0.1, 3.0], 60, p=[0.8, 0.2]))
    dropped = generator.choice([0, 0, 2], 60)
    stride = int(generator.integers(1, 7))
    taken = list(Stride(Gaps(frames(times.tolist(), dropped.tolist()), 1.0), stride))
    gaps = np.concatenate([[False], np.diff(times) > 1])
    starts = np.arange(0, 60, stride)
    assert names(taken) == starts.tolist()
    since = [slice(max(0, start - stride + 1), start + 1) for start in starts]
    assert [frame.gap for frame in taken] == [bool(gaps[part].any()) for part in since]
    assert [frame.dropped for frame in taken] == [int(dropped[part].sum()) for part in since]


def test_what_begins_again_has_its_periods_anew() -> None:
    assert names(Every(frames([0, 1, 2, 0, 1, 2]), 2)) == [0, 2, 3, 5]


def test_a_stream_says_how_long_it_is_where_it_knows() -> None:
    assert (
        len(Stride(frames([0, 1, 2, 3, 4]), 2))
        == len(list(Stride(frames([0, 1, 2, 3, 4]), 2)))
        == 3
    )
    with pytest.raises(TypeError, match="Stride: the number of frames"):
        len(Stride(iter(frames([0, 1, 2])), 2))
    assert bool(Stride([], 2))


def test_a_frame_shows_itself_without_its_pixels() -> None:
    assert repr(Frame(BLACK, None, "a.png", gap=True)) == "Frame('a.png', 4 x 6, gap=True)"
    assert [frame.breaks for frame in (Frame(BLACK, 1.0, "a"), Frame(BLACK, 1.0, "a", 1))] == [
        False,
        True,
    ]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        *(
            (
                {"stride": stride},
                rf"stride: expected a whole number of at least 1, got {re.escape(repr(stride))}$",
            )
            for stride in (
                0,
                -2,
                1.5,
                2.0,
                1.0,
                True,
                False,
                "2",
                None,
                np.float64(2),
                float("nan"),
            )
        ),
        ({"every": 1.0}, "every: expected frames with times"),
        ({"gap": 1.0}, "gap: expected frames with times"),
        ({"metres": 1.0}, "metres: expected odometry too"),
        ({"places_per_metre": 1.0}, "places_per_metre: expected odometry too"),
        ({"odometry": "a.csv"}, "odometry: expected metres or places_per_metre too"),
        ({"topic": "/image"}, "topic: expected a bag"),
        ({"idle": 1.0}, "idle: expected follow too"),
        ({"newest": -1}, "size: expected 1 or more, got -1"),
    ],
)
def test_options_that_do_not_fit_are_refused(
    options: dict[str, float | str], words: str, tmp_path: Path
) -> None:
    Image.fromarray(BLACK).save(tmp_path / "0.png")
    with pytest.raises(surefix.SurefixValueError, match=words):
        frames_open(tmp_path, **options)  # type: ignore[arg-type]


def test_a_stride_is_a_whole_number_of_pythons_or_of_numpys() -> None:
    images = [str(index) for index in range(5)]
    for stride in (2, np.int64(2), np.uint8(2)):
        assert len(frames_open(images, stride=stride)) == 3  # type: ignore[arg-type]
    with pytest.raises(
        surefix.SurefixValueError, match=r"stride: expected a whole number of at least 1, got 1\.5$"
    ):
        Stride(frames([0, 1, 2]), 1.5)  # type: ignore[arg-type]


@pytest.mark.parametrize("seconds", [0, -1, float("nan"), float("inf")])
@pytest.mark.parametrize("kind", [Every, Gaps])
def test_seconds_are_above_0(kind: type[Every] | type[Gaps], seconds: float) -> None:
    with pytest.raises(surefix.SurefixValueError, match="expected seconds above 0"):
        kind([], seconds)


def test_frames_without_times_have_no_gaps() -> None:
    for stream in (Every(frames([None]), 1), Gaps(frames([None]), 1)):
        with pytest.raises(
            surefix.SurefixValueError,
            match="expected frames with times, as those of a video or a bag; 0 has none",
        ):
            list(stream)


def test_a_video_a_bag_or_a_camera_cannot_be_followed(tmp_path: Path) -> None:
    for name in ("a.mp4", "a.bag", "a.npy", "0", "rtsp://robot/front"):
        with pytest.raises(
            surefix.SurefixValueError, match="follow: expected a folder or a pattern"
        ):
            frames_open(name, follow=True)


def test_a_missing_package_is_named_with_its_extra(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for module, package, extra, place in (
        ("av", "PyAV", "video", "a.mp4"),
        ("rosbags.highlevel", "rosbags", "bags", "a.bag"),
        ("cv2", "OpenCV", "camera", "0"),
    ):
        monkeypatch.setitem(sys.modules, module, None)
        said = rf'takes {package}, which .*: pip install "surefix\[{extra}\]"$'
        with pytest.raises(surefix.SurefixError, match=said):
            frames_open(place)


def test_the_public_streams_are_streams() -> None:
    for kind in (ImageFrames, ImageFrames, VideoFrames, Stride, Every, Gaps, KeepNewest):
        assert issubclass(kind, Frames)


def test_what_is_optional_is_loaded_when_it_is_needed() -> None:
    imports = "import sys, surefix, surefix.cli, surefix.frames"
    loaded = imports + "; print([name for name in ('av', 'rosbags', 'cv2') if name in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", loaded], capture_output=True, text=True, check=True
    )
    assert done.stdout == "[]\n"
    bare = "import sys, surefix; print('surefix.frames' in sys.modules)"
    assert (
        subprocess.run([sys.executable, "-c", bare], capture_output=True, text=True).stdout
        == "False\n"
    )
