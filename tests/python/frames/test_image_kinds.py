"""Image files and arrays of less common kinds: none is taken otherwise than it is meant."""

import io
import os
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import tifffile
from PIL import Image

import surefix
from commands import surefix_
from surefix._core import decode_image, image_files
from surefix.descriptors.descriptor import checked_image
from surefix.frames import ImageFrames, foreign
from surefix.frames import open as frames_open
from surefix.frames.images import frames_of
from surefix.simulate import Route

ORIENTATION = 0x112


def scene(seed: int = 0) -> npt.NDArray[np.uint8]:
    blocks = np.random.default_rng(seed).integers(0, 256, (4, 6, 3), np.uint8)
    return blocks.repeat(8, axis=0).repeat(8, axis=1)


def write_counted(folder: Path, numbers: list[int]) -> None:
    folder.mkdir()
    for number in numbers:
        Image.fromarray(scene(number)).save(folder / f"IMG_{number:04}.jpg")


def test_a_counter_that_wraps_is_said(tmp_path: Path) -> None:
    write_counted(tmp_path / "photos", [*range(9990, 10000), *range(1, 20)])
    made = surefix_("map", "build", tmp_path / "photos", "-o", tmp_path / "m.safetensors")
    assert "may have wrapped between IMG_9999 and IMG_0001" in made.stdout.replace("\n", " ")
    assert not any("wrapped" in each for each in image_files(tmp_path / "photos", "time")[1])


PAGES = [Image.fromarray(scene(seed)) for seed in range(3)]


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("a.tif", {}),
        ("a.tiff", {"big_tiff": True}),
        ("a.png", {}),
        ("a.webp", {"lossless": True}),
    ],
)
def test_of_a_file_of_several_images_the_first_is_taken_and_said(
    tmp_path: Path, name: str, options: dict[str, Any]
) -> None:
    PAGES[0].save(tmp_path / name, save_all=True, append_images=PAGES[1:], **options)
    PAGES[0].save(tmp_path / f"single-{name}", **options)
    frames = ImageFrames(tmp_path)
    assert frames.remarks == ["1 file holds several images: the first of it is taken"]
    assert np.array_equal(frames.images[0], scene(0))
    PAGES[1].save(tmp_path / f"b-{name}", save_all=True, append_images=PAGES[2:], **options)
    said = "2 files hold several images: the first of each is taken"
    assert ImageFrames(tmp_path).remarks[0] == said


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("big", [False, True])
def test_smaller_copies_in_a_tiff_are_no_other_images(
    tmp_path: Path, order: Any, big: bool
) -> None:
    path = tmp_path / "a.tif"
    with tifffile.TiffWriter(path, byteorder=order, bigtiff=big) as file:
        file.write(scene())
        file.write(scene()[::2, ::2], subfiletype=1)
    assert ImageFrames(tmp_path).remarks == []
    with tifffile.TiffWriter(path, byteorder=order, bigtiff=big) as file:
        file.write(scene())
        file.write(scene()[::2, ::2], subfiletype=1)
        file.write(scene())
    assert "several images" in ImageFrames(tmp_path).remarks[0]


def test_heic_is_read_wherever_a_path_is_taken(tmp_path: Path) -> None:
    pillow_heif = pytest.importorskip("pillow_heif")
    foreign.endings()
    drive = Route(places=12, size=(96, 48)).reference()
    route = [np.asarray(drive[index]) for index in range(12)]
    known = surefix.Map.from_images(route)
    paths = []
    for index, image in enumerate(route):
        path = tmp_path / f"{index}.heic"
        Image.fromarray(image).save(path, "heif", quality=95)
        paths.append(path)
    read = surefix.read_image(paths[0])
    assert read.shape == (*route[0].shape[:2], 3)
    inside = pillow_heif.open_heif(paths[0])
    with Image.open(paths[3]) as opened:
        assert type(opened).__module__.startswith("pillow_heif")
        for query in (paths[3], str(paths[3]), opened, inside[0].to_pillow()):
            assert surefix.Localizer(known).push(query).place in (0, 3)
    streamed = [fix.place for fix in surefix.Localizer(known).stream(tmp_path)]
    assert streamed == list(range(12))
    assert len(surefix.Map.from_images(paths)) == 12
    (tmp_path / "bad.heic").write_bytes(b"nothing")
    with pytest.raises(surefix.SurefixValueError, match=r"bad\.heic"):
        surefix.read_image(tmp_path / "bad.heic")
    with pytest.raises(surefix.SurefixFileError, match=r"none\.heic"):
        surefix.read_image(tmp_path / "none.heic")


def of_long(exif: bytes) -> bytes:
    """An EXIF block whose orientation is a LONG."""
    (short,) = (exif.index(struct.pack(order + "HHI", ORIENTATION, 3, 1)) for order in "<")
    return exif[:short] + struct.pack("<HHII", ORIENTATION, 4, 1, 6) + exif[short + 12 :]


def exif_block() -> bytes:
    exif = Image.Exif()
    exif.endian = "<"
    exif[ORIENTATION] = 6
    return exif.tobytes()


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def saved(kind: str, exif: bytes | None) -> bytes:
    memory = io.BytesIO()
    more = {} if exif is None else {"exif": exif}
    Image.fromarray(np.ascontiguousarray(np.rot90(scene()))).save(memory, kind, **more)  # type: ignore[arg-type]
    return memory.getvalue()


def late_exif(block: bytes) -> bytes:
    plain = saved("png", None)
    end = plain.index(b"IEND") - 4
    return plain[:end] + chunk(b"eXIf", block.removeprefix(b"Exif\0\0")) + plain[end:]


@pytest.mark.parametrize(
    "data",
    [
        lambda: late_exif(exif_block()),
        lambda: late_exif(of_long(exif_block())),
        lambda: saved("png", of_long(exif_block())),
        lambda: saved("webp", of_long(exif_block())),
        lambda: saved("jpeg", of_long(exif_block())),
    ],
    ids=["late", "late, long", "png, long", "webp, long", "jpeg, long"],
)
def test_an_orientation_that_pillow_reads_is_read(data: Callable[[], bytes]) -> None:
    with Image.open(io.BytesIO(data())) as opened:
        opened.load()
        assert opened.getexif()[ORIENTATION] == 6
    read = decode_image(data())
    assert read.shape == scene().shape
    assert np.abs(read.astype(int) - scene()).mean() < 12


def grey_stack(count: int = 12) -> npt.NDArray[np.uint8]:
    return np.stack([np.asarray(Image.fromarray(each).convert("L")) for each in rgb_stack(count)])


def rgb_stack(count: int = 12) -> npt.NDArray[np.uint8]:
    noise = np.random.default_rng(5).integers(0, 256, (count, 8, 16, 3), np.uint8)
    return noise.repeat(8, axis=1).repeat(8, axis=2)


@pytest.mark.parametrize("kind", ["big-endian", "one channel", "alpha", "deep alpha, big-endian"])
def test_arrays_of_other_layouts_hold_the_same_images(tmp_path: Path, kind: str) -> None:
    grey, rgb = grey_stack(), rgb_stack()
    alpha = np.random.default_rng(1).integers(0, 256, (*rgb.shape[:3], 1), np.uint8)
    deep = rgb.astype(np.uint16) * 200
    given, plain = {
        "big-endian": ((grey.astype(np.uint16) * 257).astype(">u2"), grey.astype(np.uint16) * 257),
        "one channel": (grey[..., None], grey),
        "alpha": (np.concatenate([rgb, alpha], axis=3), rgb),
        "deep alpha, big-endian": (np.concatenate([deep, alpha], axis=3).astype(">u2"), deep),
    }[kind]
    expected = surefix.Map.from_images(plain)
    assert np.array_equal(surefix.Map.from_images(given).descriptors, expected.descriptors)
    assert np.array_equal(surefix.Map.from_images(list(given)).descriptors, expected.descriptors)
    np.save(tmp_path / "given.npy", given)
    opened = frames_open(tmp_path / "given.npy")
    for index, (frame, other) in enumerate(zip(opened, frames_of(given), strict=True)):
        for image in (frame.image, other.image, checked_image(given[index], "image")):
            wanted = plain[index]
            if image.dtype == np.uint16:
                assert np.array_equal(image, wanted)
            else:
                assert image.shape == wanted.shape
    fixes = [surefix.Localizer(expected).push(image).place for image in given]
    assert fixes == list(range(len(plain)))
    made = surefix_("map", "build", tmp_path / "given.npy", "-o", tmp_path / "m.safetensors")
    assert made.returncode == 0, made.stderr
    assert np.array_equal(
        surefix.Map.open(tmp_path / "m.safetensors").descriptors, expected.descriptors
    )


@pytest.mark.parametrize("shape", [(32, 48, 4), (32, 48, 1), (32, 48, 3)])
def test_one_image_is_no_route(shape: tuple[int, ...]) -> None:
    image = np.zeros(shape, np.uint8)
    for build in (surefix.Map.from_images, frames_of):
        with pytest.raises(surefix.SurefixValueError, match="one image a place"):
            build(image)


def test_names_that_are_no_utf8_are_taken(tmp_path: Path) -> None:
    folder = tmp_path / "photos"
    folder.mkdir()
    for index in range(3):
        path = os.fsencode(folder) + b"/caf\xe9" + str(index).encode() + b".png"
        try:
            Image.fromarray(scene(index)).save(os.fsdecode(path))
        except OSError:
            pytest.skip("this file system takes UTF-8 alone")
    made = surefix_("map", "build", folder, "-o", tmp_path / "m.safetensors")
    assert made.returncode == 0, made.stderr
    assert "passed over" not in made.stderr + made.stdout
    assert surefix.Map.open(tmp_path / "m.safetensors").names == ImageFrames(folder).images.names


def test_floats_beyond_1_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, scene().astype(np.float32), photometric="rgb")
    with pytest.raises(surefix.SurefixValueError, match=r"floats of \d+ to \d+; .*scale them"):
        surefix.read_image(path)
    share = (scene() / 255).astype(np.float32)
    # Resampling overshoots a little here and there.
    share[0, 0] = 1.02, -0.02, 1
    tifffile.imwrite(path, share, photometric="rgb")
    wanted = np.rint(np.clip(share, 0, 1) * 65535)
    assert np.abs(surefix.read_image(path).astype(int) - wanted).max() <= 1
