"""The SAD descriptor (1.7) against Pillow and the oracle: generated images, files, real ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import oracle
import real_data
import surefix
from oracle import Array

# (height, width): odd sides, one side only, upscaling, the thumbnail's own size, a strip
SHAPES = [
    (120, 160),
    (541, 959),
    (33, 65),
    (7, 5),
    (32, 200),
    (15, 640),
    (32, 64),
    (1, 1),
    (300, 3),
]


def scene(height: int, width: int, seed: int, channels: int = 3) -> Array:
    """A generated image with smooth light, hard edges and a little noise, as photographs have."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0 : 1 : height * 1j, 0 : 1 : width * 1j][..., None]
    phase, pitch = rng.uniform(0, 6, (2, channels))
    light = 128 + 60 * np.sin(9 * x * pitch / 6 + phase) * np.cos(7 * y * pitch / 6)
    edges = 40.0 * ((x * rng.uniform(3, 9, channels)).astype(int) % 2)
    image = light + edges + rng.normal(0, 3, (height, width, channels))
    image = np.clip(image, 0, 255).astype(np.uint8)
    return image[..., 0] if channels == 1 else image


def pillow_thumbnail(image: Image.Image, size: tuple[int, int] = (64, 32)) -> Array:
    return np.asarray(image.convert("L").resize(size, Image.Resampling.BILINEAR))


def assert_within_one_level(got: Array, want: Array) -> None:
    assert got.dtype == np.uint8
    assert got.shape == want.shape
    apart = np.abs(got.astype(int) - want.astype(int))
    assert apart.max() <= 1, f"{apart.max()} levels apart at {np.argwhere(apart == apart.max())[0]}"


def assert_described(got: Array, thumbnail: Array, patch: int = 8) -> None:
    """`got` is the u8 descriptor of exactly this thumbnail; if 128 + 32 z is within 1e-4 of a
    half, it may round to either side.
    """
    z = oracle.normalise(thumbnail, patch, "f32").astype(np.float64)
    want = oracle.normalise(thumbnail, patch)
    assert got.dtype == np.uint8
    assert got.shape == want.shape
    apart = np.abs(got.astype(int) - want.astype(int))
    level = 128 + 32 * z
    on_a_half = np.abs(level - np.floor(level) - 0.5) < 1e-4
    assert (apart <= on_a_half).all(), f"wrong at {np.flatnonzero(apart > on_a_half)[:5]}"


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("channels", [1, 3])
def test_thumbnail_is_pillows_and_the_descriptor_is_its_tiles(
    shape: tuple[int, int], channels: int
) -> None:
    """1.7: grey and resize within one level of Pillow, then the tiles exactly, u8 and f32."""
    image = scene(*shape, seed=shape[0], channels=channels)
    sad = surefix.Sad(size=(64, 32), patch=8, dtype="u8")
    thumbnail = np.asarray(sad.thumbnail(image))
    assert_within_one_level(thumbnail, pillow_thumbnail(Image.fromarray(image)))
    assert_described(np.asarray(sad.describe(image)), thumbnail)
    as_f32 = np.asarray(surefix.Sad(size=(64, 32), patch=8, dtype="f32").describe(image))
    assert as_f32.dtype == np.float32
    np.testing.assert_allclose(as_f32, oracle.normalise(thumbnail, 8, "f32"), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("seed", range(40))
def test_descriptor_of_an_image_of_the_thumbnails_size(seed: int) -> None:
    """1.7 without a resize: integers from end to end, so the whole chain is the oracle's."""
    rng = np.random.default_rng(seed)
    span = int(rng.integers(1, 256))  # low spans make tiles of std < 1 grey level
    base = rng.integers(0, 256 - span + 1)
    image = rng.integers(base, base + span, (32, 64, 3)).astype(np.uint8)
    image[:8, :8] = base + rng.integers(0, 2, (8, 8, 1))  # std at most 0.5: a flat tile
    sad = surefix.Sad(size=(64, 32), patch=8, dtype="u8")
    np.testing.assert_array_equal(sad.thumbnail(image), oracle.grey(image))
    described = np.asarray(sad.describe(image))
    assert_described(described, oracle.grey(image))
    assert (described.reshape(32, 64)[:8, :8] == 128).all()


@pytest.mark.parametrize(
    ("size", "patch"), [((64, 64), 16), ((32, 16), 4), ((8, 24), 8), ((48, 32), 2), ((64, 32), 1)]
)
def test_other_sizes_and_patches(size: tuple[int, int], patch: int) -> None:
    """1.7: `size` is (width, height), and rows run over the image; a tile of one pixel is flat."""
    image = scene(90, 131, seed=5)
    sad = surefix.Sad(size=size, patch=patch, dtype="u8")
    thumbnail = np.asarray(sad.thumbnail(image))
    assert_within_one_level(thumbnail, pillow_thumbnail(Image.fromarray(image), size))
    assert_described(np.asarray(sad.describe(image)), thumbnail, patch)


@pytest.mark.parametrize(("size", "patch"), [((64, 30), 8), ((60, 32), 8), ((64, 32), 0)])
def test_sides_must_divide(size: tuple[int, int], patch: int) -> None:
    """1.7: "the sides must divide"."""
    with pytest.raises(surefix.SurefixError):
        surefix.Sad(size=size, patch=patch)


def test_layout_of_an_image_changes_nothing() -> None:
    """A cropped, flipped or Fortran-ordered view is the image it shows."""
    whole = scene(120, 160, seed=6)
    sad = surefix.Sad()
    for view in (
        whole[10:100, 20:141],
        whole[::-1, ::-1],
        np.asfortranarray(whole),
        whole[..., ::-1],
    ):
        np.testing.assert_array_equal(sad.describe(view), sad.describe(np.ascontiguousarray(view)))


@pytest.mark.parametrize("dtype", ["u8", "f32"])
def test_distances_are_in_units_of_z(dtype: str) -> None:
    """1.6 and 1.7: a map of SAD descriptors, mean absolute difference in `z` for both dtypes."""
    images = [scene(60, 100, seed=s) for s in range(9)]
    sad = surefix.Sad(dtype=dtype)
    route = surefix.Map.from_images(images[:8], descriptor=sad)
    query = np.asarray(sad.describe(images[8]))
    rows = np.stack([np.asarray(sad.describe(image)) for image in images[:8]])
    got = np.asarray(route.distances(query))
    np.testing.assert_allclose(got, oracle.sad_distances(query, rows), rtol=1e-6)
    assert route.distances(rows[3])[3] == 0.0


def check_file(path: Path) -> None:
    """The library's own decoder and resize against Pillow's, on one file."""
    sad = surefix.Sad(size=(64, 32), patch=8, dtype="u8")
    image = np.asarray(surefix.read_image(path))
    with Image.open(path) as pillow:
        assert image.dtype == np.uint8
        assert image.shape == np.asarray(pillow).shape
        want = pillow_thumbnail(pillow)
    assert_within_one_level(np.asarray(sad.thumbnail(image)), want)
    # One level in a tile moves z by a share of 1 / std; over an image it all but averages out.
    apart = oracle.sad_distances(np.asarray(sad.describe(image)), oracle.normalise(want)[None])[0]
    assert apart < 0.05


SAVED: dict[str, dict[str, Any]] = {
    "png": {},
    "jpeg_444": {"quality": 95, "subsampling": 0},
    "jpeg_420": {"quality": 85, "subsampling": 2},
}


@pytest.mark.parametrize("saved", SAVED)
@pytest.mark.parametrize("shape", [(480, 640), (121, 163), (17, 23)])
@pytest.mark.parametrize("channels", [1, 3])
def test_files_that_pillow_wrote(
    tmp_path: Path, saved: str, shape: tuple[int, int], channels: int
) -> None:
    """1.7 from a file: downscaling, odd sides, upscaling; PNG and JPEG; grey and RGB."""
    options = {} if channels == 1 else SAVED[saved]
    path = tmp_path / f"image.{saved.split('_')[0]}"
    image = scene(*shape, seed=shape[1], channels=channels)
    Image.fromarray(image).save(path, **options)
    check_file(path)
    if saved == "png":
        np.testing.assert_array_equal(surefix.read_image(path), image)


@pytest.mark.parametrize(
    "folder",
    ["gardens_point/day_left", "gardens_point/day_right", "corridor/reference", "corridor/query"],
)
def test_real_images(folder: str) -> None:
    """1.7 on photographs: every tenth frame of the real traverses."""
    paths = sorted((real_data.folder() / folder).glob("*.jpg"))[::10]
    assert len(paths) >= 10
    for path in paths:
        check_file(path)
