"""Video files as streams."""

from pathlib import Path

import cv2
import numpy as np
import pytest

import surefix
from recordings import pictures, write_video
from surefix.frames import Frame, VideoFrames
from surefix.frames import open as frames_open

IMAGES = pictures(30)


@pytest.fixture(scope="module")
def lossless(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_video(tmp_path_factory.mktemp("videos") / "drive.mkv", IMAGES)


@pytest.mark.parametrize("sound", [0.0, 4.0])
@pytest.mark.parametrize("stamps", [None, [index * index for index in range(20)]])
@pytest.mark.parametrize(
    ("name", "codec"),
    [
        ("a.mp4", "libx264"),
        ("a.mov", "mpeg4"),
        ("a.mkv", "libx264"),
        ("a.avi", "mpeg4"),
        ("a.wmv", "wmv2"),
        ("a.ts", "libx264"),
    ],
)
def test_a_whole_video_is_never_taken_for_a_damaged_one(
    tmp_path: Path, name: str, codec: str, stamps: list[int] | None, sound: float
) -> None:
    images = pictures(20, 96, 128)
    path = write_video(
        tmp_path / name, images, codec=codec, pixels="yuv420p", rate=25, stamps=stamps, sound=sound
    )
    times = [frame.time for frame in VideoFrames(path) if frame.time is not None]
    expected = np.arange(20) if stamps is None else np.array(stamps)
    assert len(times) == 20
    # A transport stream does not begin at 0; some count in thousandths; with sound, an AVI begins
    # with an empty frame.
    if not (sound and name == "a.avi"):
        assert np.allclose(np.array(times) - times[0], expected / 25, atol=2e-3)


def until_damage(path: Path) -> tuple[list[Frame], str]:
    """The frames before the error, and its message."""
    seen: list[Frame] = []
    try:
        for frame in VideoFrames(path):
            seen.append(frame)
    except surefix.SurefixValueError as error:
        return seen, str(error)
    raise AssertionError(f"{path}: all is well, {len(seen)} frames")


def test_pixels_and_times_are_those_that_were_written(lossless: Path) -> None:
    stream = frames_open(lossless)
    assert isinstance(stream, VideoFrames)
    assert stream.estimate == 30
    for _ in range(2):
        frames = list(stream)
        assert [frame.name for frame in frames] == [str(index) for index in range(30)]
        assert all(
            (frame.image == image).all() for frame, image in zip(frames, IMAGES, strict=True)
        )
        assert np.allclose([frame.time for frame in frames], np.arange(30) / 10, atol=1e-9)


def test_a_localizer_takes_whatever_is_named(lossless: Path, tmp_path: Path) -> None:
    route = surefix.Map.from_images(IMAGES, progress=False)
    expected = list(surefix.Localizer(route).stream(IMAGES))
    assert list(surefix.Localizer(route).stream(lossless)) == expected
    assert list(surefix.Localizer(route).stream(str(lossless))) == expected
    np.save(tmp_path / "images.npy", np.stack(IMAGES))
    np.save(tmp_path / "vectors.npy", route.descriptors)
    assert list(surefix.Localizer(route).stream(tmp_path / "images.npy")) == expected
    vectors = surefix.Map.from_descriptors(route.descriptors, "manhattan")
    fixes = surefix.Localizer(vectors).stream(tmp_path / "vectors.npy")
    assert [fix.place for fix in fixes] == [fix.place for fix in expected]
    for nowhere in ("nowhere", "nowhere.mp4", "nowhere.bag"):
        with pytest.raises(surefix.SurefixFileError, match=nowhere):
            list(surefix.Localizer(route).stream(tmp_path / nowhere))
    with pytest.raises(
        surefix.SurefixValueError, match="expected a folder of images, a pattern, or a file"
    ):
        surefix.Localizer(route).stream(__file__)


def test_a_lossy_video_is_decoded_as_opencv_does(tmp_path: Path) -> None:
    path = write_video(tmp_path / "drive.mp4", IMAGES, codec="libx264", pixels="yuv420p")
    capture = cv2.VideoCapture(str(path))
    count = 0
    for frame in VideoFrames(path):
        there, image = capture.read()
        assert there
        # Two converters from YUV: they round differently.
        assert np.abs(frame.image.astype(int) - image[..., ::-1]).mean() < 2
        count += 1
    assert not capture.read()[0]
    assert count == len(IMAGES)


def test_a_frame_every_so_often(lossless: Path) -> None:
    assert [frame.name for frame in frames_open(lossless, stride=7)] == ["0", "7", "14", "21", "28"]
    assert [frame.name for frame in frames_open(lossless, every=0.75)] == ["0", "8", "15", "23"]


def test_a_variable_rate_keeps_its_times_and_shows_its_gap(tmp_path: Path) -> None:
    stamps = [0, 1, 2, 30, 31, 32]
    path = write_video(tmp_path / "pause.mkv", IMAGES[:6], stamps=stamps)
    frames = list(frames_open(path, gap=1.0))
    assert np.allclose([frame.time for frame in frames], np.array(stamps) / 10, atol=1e-3)
    assert [frame.gap for frame in frames] == [False, False, False, True, False, False]


@pytest.mark.parametrize(("rotation", "quarters"), [(90, 1), (-90, -1), (180, 2)])
def test_a_video_is_turned_upright(tmp_path: Path, rotation: int, quarters: int) -> None:
    plain = write_video(tmp_path / "plain.mp4", IMAGES[:3], codec="libx264", pixels="yuv420p")
    turned = write_video(
        tmp_path / "turned.mp4", IMAGES[:3], codec="libx264", pixels="yuv420p", rotation=rotation
    )
    for straight, frame in zip(VideoFrames(plain), VideoFrames(turned), strict=True):
        assert np.array_equal(frame.image, np.rot90(straight.image, quarters))
    # OpenCV turns too, by its own reading of the file.
    there, image = cv2.VideoCapture(str(turned)).read()
    assert there
    assert np.abs(next(iter(VideoFrames(turned))).image.astype(int) - image[..., ::-1]).mean() < 2


@pytest.mark.parametrize(
    ("name", "codec", "pixels"),
    [
        ("cut.mkv", "ffv1", "bgr0"),
        ("cut.mkv", "libx264", "yuv420p"),
        ("cut.avi", "mjpeg", "yuvj420p"),
    ],
)
@pytest.mark.parametrize("share", [0.3, 0.5, 0.66, 0.9])
def test_a_video_that_was_cut_short_says_where(
    tmp_path: Path, name: str, codec: str, pixels: str, share: float
) -> None:
    path = write_video(tmp_path / name, pictures(30, seed=2), codec=codec, pixels=pixels)
    whole = {
        round(frame.time, 3): frame.image for frame in VideoFrames(path) if frame.time is not None
    }
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    seen, message = until_damage(path)
    assert f"{name}, frame {len(seen)}: a damaged video" in message
    assert all(
        (frame.image == whole[round(frame.time, 3)]).all()
        for frame in seen
        if frame.time is not None
    )
    assert 0 < len(seen) < 30


def test_a_damaged_frame_is_named_and_those_before_it_are_given(
    lossless: Path, tmp_path: Path
) -> None:
    data = bytearray(lossless.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 60] = b"\xff" * 60
    bad = tmp_path / "bad.mkv"
    bad.write_bytes(data)
    seen, message = until_damage(bad)
    assert f"bad.mkv, frame {len(seen)}: a damaged video" in message
    assert 0 < len(seen) < 30
    assert all((frame.image == image).all() for frame, image in zip(seen, IMAGES, strict=False))


@pytest.mark.parametrize(
    ("content", "kind", "words"),
    [
        (None, surefix.SurefixFileError, "no such file"),
        (b"", surefix.SurefixValueError, "expected a video"),
        (b"hello", surefix.SurefixValueError, "expected a video"),
    ],
)
def test_what_is_no_video_is_refused(
    tmp_path: Path, content: bytes | None, kind: type[Exception], words: str
) -> None:
    path = tmp_path / "drive.mp4"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(kind, match=words) as refused:
        frames_open(path)
    assert "drive.mp4" in str(refused.value)


def test_an_mp4_whose_index_was_never_written_is_no_video(tmp_path: Path) -> None:
    path = write_video(tmp_path / "drive.mp4", IMAGES, codec="libx264", pixels="yuv420p")
    path.write_bytes(path.read_bytes()[:-2000])
    with pytest.raises(surefix.SurefixValueError, match=r"drive\.mp4: expected a video"):
        frames_open(path)


def test_sound_alone_is_no_video(tmp_path: Path) -> None:
    import av

    path = tmp_path / "sound.mp4"
    with av.open(str(path), "w") as container:
        track = container.add_stream("aac", rate=44100, layout="mono")
        frame = av.AudioFrame.from_ndarray(
            np.zeros((1, 1024), np.float32), format="fltp", layout="mono"
        )
        frame.sample_rate, frame.pts = 44100, 0
        container.mux(track.encode(frame))
        container.mux(track.encode())
    with pytest.raises(surefix.SurefixValueError, match="no picture track"):
        frames_open(path)
