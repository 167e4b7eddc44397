"""Images of more than 8 bits: one range for a map and all its queries."""

from pathlib import Path
from typing import ClassVar

import av
import cv2
import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

import surefix
from commands import surefix_
from surefix.frames import VideoFrames, in_8_bits
from surefix.frames.levels import Clipping, measured
from surefix.simulate import Route

PLACES = 60
UInt16 = npt.NDArray[np.uint16]


def deep_drive(bits: int, bottom: int = 0, *, revisit: bool = False) -> UInt16:
    """A drive of the generated road, in ``bits`` bits from ``bottom`` on, (n, H, W)."""
    route = Route(places=PLACES, size=(96, 48))
    drive = route.revisit() if revisit else route.reference()
    grey = np.stack([np.asarray(Image.fromarray(drive[i]).convert("L")) for i in range(PLACES)])
    scaled: UInt16 = (bottom + grey * ((2**bits - 1) / 255)).round().astype(np.uint16)
    return scaled


def right(run: surefix.Run) -> float:
    """The share of queries whose place is right."""
    return float((np.abs(run.place - np.arange(PLACES)) <= 1).mean())


def oracle(image: UInt16, low: int, high: int) -> npt.NDArray[np.uint8]:
    """The definition in floating point."""
    share = (image.astype(np.float64).clip(low, high) - low) / (high - low)
    return np.floor(255 * share + 0.5).astype(np.uint8)


@pytest.mark.parametrize("levels", [(0, 65535), (7000, 7510), (0, 1), (3, 4094)])
def test_levels_are_what_their_definition_says(levels: tuple[int, int]) -> None:
    every = np.arange(65536, dtype=np.uint16).reshape(256, 256)
    expected = oracle(every, *levels)
    assert np.array_equal(in_8_bits(every, levels), expected)
    # And so does the descriptor, in Rust: the picture at its own size.
    sad = surefix.Sad((256, 256), levels=levels)
    assert np.array_equal(sad.thumbnail(every), expected)
    colour = np.stack([every, every, every], axis=2)
    assert np.array_equal(sad.thumbnail(colour), expected)


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
@pytest.mark.parametrize("ending", ["png", "tif", "pgm"])
def test_a_drive_of_any_depth_is_as_good_as_one_of_8_bits(
    tmp_path: Path, bits: int, ending: str
) -> None:
    known = surefix.Map.from_images(deep_drive(bits).astype(np.uint16))
    low, high = known.levels or (0, 0)
    assert 0 <= low < 2**bits / 4
    assert 2**bits / 2 < high < 2**bits
    query = deep_drive(bits, revisit=True)
    for index, image in enumerate(query):
        if ending == "pgm":
            # Of 16 bits: the greatest sample of a netpbm file says its scale.
            data = image.astype(">u2").tobytes()
            head = f"P5 {image.shape[1]} {image.shape[0]} 65535\n".encode()
            (tmp_path / f"{index}.pgm").write_bytes(head + data)
        else:
            assert cv2.imwrite(str(tmp_path / f"{index}.{ending}"), image)
    shallow = surefix.match(
        surefix.Map.from_images(deep_drive(8).astype(np.uint8)),
        deep_drive(8, revisit=True).astype(np.uint8),
    )
    by_files, by_array = surefix.match(known, tmp_path), surefix.match(known, query)
    localizer = surefix.Localizer(known)
    pushed = [localizer.push(image).place for image in query]
    assert by_files.place.tolist() == by_array.place.tolist() == pushed
    assert right(by_files) >= right(shallow) - 0.05


def test_a_narrow_range_far_from_0_is_seen() -> None:
    """A thermal camera: 200 levels about 7300, in hundredths of a kelvin above some offset."""
    known = surefix.Map.from_images(deep_drive(8, 7200))
    assert right(surefix.match(known, deep_drive(8, 7200, revisit=True))) > 0.8
    # Levels given: the same map as one of these levels measured.
    low, high = known.levels or (0, 0)
    given = surefix.Map.from_images(deep_drive(8, 7200), levels=(low, high))
    assert given.to_bytes() == known.to_bytes()
    assert known.descriptor == surefix.Sad(levels=(low, high))


def test_hot_and_dead_pixels_do_not_set_the_range() -> None:
    drive = deep_drive(12)
    plain = surefix.Map.from_images(drive).levels
    drive[:, 5, 7], drive[:, 9, 11] = 65535, 0
    assert surefix.Map.from_images(drive).levels == plain
    assert plain == measured(drive[np.arange(32) * (PLACES - 1) // 31])


def test_levels_go_with_the_file_and_every_way_to_make_a_map(tmp_path: Path) -> None:
    drive = deep_drive(12)
    known = surefix.Map.from_images(drive)
    known.save(tmp_path / "saved")
    surefix.Map.build(tmp_path / "built", drive)
    assert (tmp_path / "saved").read_bytes() == (tmp_path / "built").read_bytes()
    surefix.Map.append(tmp_path / "built", drive)
    longer = surefix.Map.open(tmp_path / "built")
    assert longer.levels == known.levels
    assert np.array_equal(longer.descriptors[PLACES:], known.descriptors)
    with pytest.raises(surefix.SurefixValueError, match="levels"):
        known.extended(surefix.Map.from_images(drive, levels=(0, 9)))


def test_a_map_of_8_bits_has_no_levels_and_stays() -> None:
    drive = deep_drive(8).astype(np.uint8)
    known = surefix.Map.from_images(drive)
    assert known.levels is None
    assert "levels" not in repr(known.descriptor)
    # Deep queries, of which a 257th is what the map has.
    sixteen = drive.astype(np.uint16) * 257
    assert surefix.match(known, sixteen).place.tolist() == list(range(PLACES))


@pytest.mark.parametrize("levels", [(5, 5), (9, 3), (-1, 4), (0, 65536), "ab", 7])
def test_levels_that_are_none_are_refused(levels: object) -> None:
    for act in (
        lambda: surefix.Sad(levels=levels),  # type: ignore[arg-type]
        lambda: surefix.Map.from_images(deep_drive(8), levels=levels),  # type: ignore[arg-type]
        lambda: in_8_bits(np.zeros((2, 2), np.uint16), levels),
    ):
        with pytest.raises(surefix.SurefixValueError, match="levels"):
            act()


class Rows:
    """A learned descriptor: the mean of each row."""

    name = "rows"
    recipe: ClassVar = {"name": "rows"}

    def describe(self, images: list[npt.NDArray[np.uint8]]) -> npt.NDArray[np.float32]:
        assert all(image.dtype == np.uint8 for image in images)
        return np.stack([image.reshape(48, -1).mean(axis=1) for image in images]).astype(np.float32)


def test_a_learned_descriptor_is_given_8_bits_by_the_map_s_levels(tmp_path: Path) -> None:
    drive = deep_drive(12)
    known = surefix.Map.from_images(drive, Rows(), metric="euclidean", progress=False)
    assert known.image_size == (96, 48)
    low, high = known.levels or (0, 0)
    expected = Rows().describe([oracle(image, low, high) for image in drive])
    assert np.allclose(known.descriptors, expected)
    localizer = surefix.Localizer(known, descriptor=Rows())
    assert [localizer.push(image).place for image in drive[:9]] == list(range(9))
    known.save(tmp_path / "m")
    surefix.Map.append(tmp_path / "m", drive, Rows(), progress=False)
    assert np.allclose(surefix.Map.open(tmp_path / "m").descriptors[PLACES:], expected)


@pytest.mark.parametrize("pixels", ["gray10le", "gray12le", "gray16le"])
def test_deep_grey_video_keeps_its_samples(tmp_path: Path, pixels: str) -> None:
    bits = int(pixels[4:6])
    images = deep_drive(bits)[:6]
    with av.open(str(tmp_path / "a.mkv"), "w") as container:
        track = container.add_stream("ffv1", rate=10)
        track.height, track.width, track.pix_fmt = 48, 96, pixels
        for image in images:
            frame = av.VideoFrame.from_ndarray(image, format=pixels)
            container.mux(track.encode(frame))
        container.mux(track.encode())
    read = [frame.image for frame in VideoFrames(tmp_path / "a.mkv")]
    assert all(image.dtype == np.uint16 for image in read)
    # FFmpeg widens the samples to 16 bits.
    low, high = (np.min(images), np.max(images))
    widened = [np.min(read), np.max(read)]
    assert np.allclose(widened, np.array([low, high], float) * 65535 / (2**bits - 1), atol=70)
    surefix_("map", "build", tmp_path / "a.mkv", "-o", tmp_path / "m")
    assert surefix.Map.open(tmp_path / "m").levels is not None


def test_the_command_line_measures_takes_and_says_levels(tmp_path: Path) -> None:
    for name, revisit in (("map", False), ("drive", True)):
        (tmp_path / name).mkdir()
        for index, image in enumerate(deep_drive(12, revisit=revisit)):
            Image.fromarray(image).save(tmp_path / name / f"{index}.png")
    known = tmp_path / "m"
    surefix_("map", "build", tmp_path / "map", "-o", known)
    assert surefix.Map.open(known).levels == surefix.Map.from_images(tmp_path / "map").levels
    assert "levels" in surefix_("map", "info", known).stdout
    done = surefix_("run", known, tmp_path / "drive", "--motion", "none")
    assert "Warning" not in done.stderr
    surefix_("map", "build", tmp_path / "map", "-o", known, "--levels", 0, 900)
    assert surefix.Map.open(known).levels == (0, 900)
    done = surefix_("run", known, tmp_path / "drive")
    assert "outside of the map's levels, 0 to 900" in done.stderr
    wrong = surefix_("map", "build", tmp_path / "map", "-o", known, "--levels", 9, 3, code=2)
    assert "levels" in wrong.stderr
    surefix_(
        "eval", known, tmp_path / "drive", "--truth", "identity", "-o", tmp_path / "r",
        "--method", "single",
    )  # fmt: skip


def test_deep_queries_on_a_map_of_8_bits_are_warned_of() -> None:
    clipping = Clipping(None)
    for image in deep_drive(10):
        clipping.add(image)
    assert "16 bits" in (clipping.warning or "")
    for full in deep_drive(16):
        clipping = Clipping(None)
        clipping.add(full)
    assert clipping.warning is None


def test_pillow_s_deep_and_odd_modes() -> None:
    sad = surefix.Sad(levels=(0, 4095))
    image = deep_drive(12)[0]
    for given in (Image.fromarray(image), Image.fromarray(image.astype(np.int32))):
        assert np.array_equal(sad.describe(given), sad.describe(image))  # type: ignore[arg-type]
    shallow = deep_drive(8)[0].astype(np.uint8)
    palette = Image.fromarray(np.stack([shallow] * 3, axis=2)).convert("RGBA")
    assert np.array_equal(sad.describe(palette), sad.describe(shallow))  # type: ignore[arg-type]
    with pytest.raises(surefix.SurefixValueError, match="mode F"):
        sad.describe(Image.fromarray(image.astype(np.float32)))  # type: ignore[arg-type]


def test_samples_that_cannot_be_read_say_what_can(tmp_path: Path) -> None:
    grey = np.random.default_rng(0).random((8, 9)).astype(np.float32)
    byte = Image.fromarray((255 * grey).astype(np.uint8))
    for name, image, words in (
        ("floats", Image.fromarray(grey), "scale"),
        ("long", Image.fromarray((65535 * grey).astype(np.int32)), "scale"),
        ("palette", byte.convert("P"), "save it as RGB"),
    ):
        image.save(tmp_path / f"{name}.tif")
        with pytest.raises(surefix.SurefixValueError, match=rf"{name}\.tif.*{words}"):
            surefix.read_image(tmp_path / f"{name}.tif")
    # RGB floats from 0 to 1.
    assert cv2.imwrite(str(tmp_path / "rgb.tif"), np.stack([grey] * 3, axis=2))
    read = surefix.read_image(tmp_path / "rgb.tif")
    assert np.abs(read[..., 0] / 65535 - grey).max() < 1e-4
