"""Images that are stored turned or mirrored, in every container, still or moving."""

import io
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

import surefix
from commands import surefix_
from recordings import write_video
from surefix.frames import VideoFrames
from surefix.frames.images import frames_of
from surefix.simulate import Route

UInt8 = npt.NDArray[np.uint8]
ORIENTATION = 0x112
# How a picture is stored that the orientation turns back, by the EXIF standard: where its row 0 and
# its column 0 lie.
STORED = {
    1: lambda image: image,
    2: lambda image: image[:, ::-1],
    3: lambda image: image[::-1, ::-1],
    4: lambda image: image[::-1],
    5: lambda image: image.swapaxes(0, 1),
    6: lambda image: image[::-1].swapaxes(0, 1)[::-1, ::-1],
    7: lambda image: image[::-1, ::-1].swapaxes(0, 1),
    8: lambda image: image[::-1].swapaxes(0, 1),
}
# The rotation and mirroring of a display matrix: a b c d, where (x, y) goes to (ax + cy, bx + dy).
MATRICES = {
    1: (1, 0, 0, 1),
    2: (-1, 0, 0, 1),
    3: (-1, 0, 0, -1),
    4: (1, 0, 0, -1),
    5: (0, 1, 1, 0),
    6: (0, 1, -1, 0),
    7: (0, -1, -1, 0),
    8: (0, -1, 1, 0),
}


def picture(seed: int = 0) -> UInt8:
    """A scene of 48 x 32 pixels without any symmetry."""
    blocks = np.random.default_rng(seed).integers(0, 256, (4, 6, 3), np.uint8)
    return blocks.repeat(8, axis=0).repeat(8, axis=1)


def stored(image: UInt8, orientation: int) -> tuple[Image.Image, Image.Exif]:
    """As a camera stores it."""
    exif = Image.Exif()
    exif[ORIENTATION] = orientation
    return Image.fromarray(np.ascontiguousarray(STORED[orientation](image))), exif


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("ending", ["jpg", "png", "webp", "tif", "jfif"])
@pytest.mark.parametrize("grey", [False, True])
def test_every_orientation_of_every_container_is_turned_back(
    tmp_path: Path, ending: str, orientation: int, grey: bool
) -> None:
    scene = picture()
    image, exif = stored(scene, orientation)
    kind = {"jfif": "jpeg", "jpg": "jpeg", "tif": "tiff"}.get(ending, ending)
    options = {"jpeg": {"quality": 100, "subsampling": 0}, "webp": {"lossless": True}}
    path = tmp_path / f"a.{ending}"
    mode = "L" if grey else "RGB"
    image.convert(mode).save(path, kind, exif=exif, **options.get(kind, {}))
    read = surefix.read_image(path)
    expected = np.asarray(Image.fromarray(scene).convert(mode))
    if kind == "webp" and grey:
        expected = np.asarray(Image.fromarray(scene).convert("L").convert("RGB"))
    assert read.shape == expected.shape
    assert np.abs(read.astype(int) - expected).max() <= (6 if kind == "jpeg" else 0)
    assert np.array_equal(surefix.frames.image_of(_message(path)), read)


def _message(path: Path) -> object:
    from types import SimpleNamespace

    data = np.frombuffer(path.read_bytes(), np.uint8)
    header = SimpleNamespace(frame_id="", stamp=SimpleNamespace(sec=0, nanosec=0))
    return SimpleNamespace(format="jpeg", data=data, header=header)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_an_image_of_pillow_is_turned_back_when_it_is_pushed(orientation: int) -> None:
    scene = picture()
    image, exif = stored(scene, orientation)
    memory = io.BytesIO()
    image.save(memory, "png", exif=exif)
    sad = surefix.Sad()
    assert np.array_equal(sad.describe(Image.open(memory)), sad.describe(scene))  # type: ignore[arg-type]
    frames = frames_of([Image.open(memory)] * 2)
    assert all(np.array_equal(shot.read(), scene) for shot in frames.shots())
    known = surefix.Map.from_images([Image.open(memory)] * 2)
    assert np.array_equal(known.descriptors[1], sad.describe(scene))


@pytest.mark.parametrize("orientation", range(2, 9))
def test_an_orientation_in_xmp_alone_counts(tmp_path: Path, orientation: int) -> None:
    scene = picture()
    image, _ = stored(scene, orientation)
    xmp = (
        '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-'
        'syntax-ns#"><rdf:Description xmlns:tiff="http://ns.adobe.com/tiff/1.0/" '
        f'tiff:Orientation="{orientation}"/></rdf:RDF></x:xmpmeta>'
    )
    image.save(tmp_path / "a.webp", lossless=True, xmp=xmp.encode())
    assert np.array_equal(surefix.read_image(tmp_path / "a.webp"), scene)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_every_orientation_of_a_video_is_turned_back(tmp_path: Path, orientation: int) -> None:
    scene = picture()
    turned = np.ascontiguousarray(STORED[orientation](scene))
    path = write_video(tmp_path / "a.mp4", [turned] * 3, codec="libx264rgb", pixels="rgb24")
    data = bytearray(path.read_bytes())
    # The matrix of the track's header, version 0.
    at = data.find(b"tkhd") + 4 + 4 + 20 + 8 + 8
    a, b, c, d = (value << 16 for value in MATRICES[orientation])
    data[at : at + 36] = np.array([a, b, 0, c, d, 0, 0, 0, 1 << 30], ">i4").tobytes()
    path.write_bytes(data)
    for frame in VideoFrames(path):
        assert frame.image.shape == scene.shape
        assert np.abs(frame.image.astype(int) - scene).mean() < 12


def test_a_drive_whose_photos_are_turned_is_the_upright_one(tmp_path: Path) -> None:
    route = Route(places=40, size=(96, 48))
    for name, drive in (("map", route.reference()), ("turned", route.revisit())):
        (tmp_path / name).mkdir()
        for index in range(40):
            image = np.asarray(drive[index])
            turned, exif = stored(image, index % 8 + 1 if name == "turned" else 1)
            turned.save(tmp_path / name / f"{index}.png", exif=exif)
    surefix_("map", "build", tmp_path / "map", "-o", tmp_path / "m")
    known = surefix.Map.open(tmp_path / "m")
    run = surefix.match(known, tmp_path / "turned")
    upright = surefix.match(known, route.revisit())
    assert run.place.tolist() == upright.place.tolist()
