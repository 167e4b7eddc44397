"""Maps of several segments: made, joined, cut, thinned and made longer."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

import surefix
from surefix import Map, Segments, SurefixValueError

RNG = np.random.default_rng(3)
ROWS = RNG.standard_normal((60, 16)).astype(np.float32)
IMAGES = RNG.integers(0, 255, (40, 36, 64), np.uint8)


def made(start: int = 0, stop: int = 60, **options: Any) -> Map:
    names = [f"{place}.png" for place in range(start, stop)]
    metres = np.column_stack([np.arange(start, stop) * 2.0, np.zeros(stop - start)])
    return Map.from_descriptors(ROWS[start:stop], positions=metres, names=names, **options)


def test_a_map_is_made_with_segments() -> None:
    route = made(breaks=[20, 35], closed=[1])
    assert route.segments.breaks.tolist() == [20, 35]
    assert [segment.closed for segment in route.segments] == [False, True, False]
    assert all(segment.closed for segment in made(breaks=[20], closed=True).segments)
    segments = Segments(60, breaks=[20, 35], closed=[1], links=[(19, 40)])
    assert np.array_equal(route.with_segments(segments).segments.links, [[19, 40]])
    again = Map.from_bytes(route.with_segments(segments).to_bytes())
    assert repr(again.segments) == "Segments(60 places, 3 segments, 1 closed, 1 links)"
    with pytest.raises(SurefixValueError, match="segments: places: expected 60 values, got 59"):
        route.with_segments(Segments(59))
    with pytest.raises(SurefixValueError, match="segments"):
        route.with_segments([20, 35])


class Unread:
    """Images that must not be asked for."""

    def __len__(self) -> int:
        return 40

    def __getitem__(self, index: int) -> npt.NDArray[np.uint8]:
        raise AssertionError(f"image {index} was read")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"breaks": [40]}, "option `breaks`: expected places in ascending order"),
        ({"breaks": [9, 3]}, "got 3 after 9"),
        ({"closed": [1]}, "option `closed`"),
        ({"breaks": [38], "closed": True}, "at least 3 places"),
        ({"origin": (51, 0)}, "origin: expected positions beside it"),
        ({"positions": np.zeros((40, 2)), "origin": (91, 0)}, "option `origin`"),
        ({"positions": np.zeros((40, 2)), "origin": 7}, "option `origin`"),
        ({"positions": np.zeros((39, 2))}, "positions: expected 40 values, got 39"),
        ({"thumbnails": (0, 3)}, "thumbnails"),
        ({"thumbnails": "yes"}, "thumbnails"),
    ],
)
def test_what_does_not_fit_is_refused_before_an_image_is_read(
    options: dict[str, Any], message: str, tmp_path: Path
) -> None:
    with pytest.raises(SurefixValueError, match=message):
        Map.from_images(Unread(), **options)
    with pytest.raises(SurefixValueError, match=message):
        Map.build(tmp_path / "map", Unread(), **options)
    assert not list(tmp_path.iterdir())


def test_joined_and_appended_maps_are_the_map_made_at_once(tmp_path: Path) -> None:
    whole = made(breaks=[20, 30], closed=[1])
    parts = [made(0, 20), made(20, 30, closed=True), made(30, 60)]
    joined = Map.join(iter(parts))
    assert joined.to_bytes() == whole.to_bytes()
    path = tmp_path / "map"
    parts[0].save(path)
    for part in parts[1:]:
        Map.append(path, part, new_segment=True)
    assert path.read_bytes() == whole.to_bytes()
    assert (
        parts[0]
        .extended(parts[1], new_segment=True)
        .extended(parts[2], new_segment=True)
        .to_bytes()
        == whole.to_bytes()
    )
    assert made(0, 20).extended(made(20, 60)).to_bytes() == made().to_bytes()
    for part, segment in zip(parts, whole.segments, strict=True):
        assert whole.cut(segment.start, segment.end).to_bytes() == part.to_bytes()
    before = path.read_bytes()
    with pytest.raises(SurefixValueError, match="a new segment, as their first segment is closed"):
        Map.append(path, parts[1])
    with pytest.raises(SurefixValueError, match="map 1: cannot append"):
        Map.join([parts[0], Map.from_descriptors(ROWS)])
    for wrong in (parts[0], 7, [parts[0], "map"]):
        with pytest.raises(SurefixValueError, match="maps: expected an iterable of"):
            Map.join(wrong)
    assert path.read_bytes() == before


def test_built_maps_are_those_made_of_images(tmp_path: Path) -> None:
    path = tmp_path / "map"
    options = {"breaks": [10, 25], "closed": [0], "thumbnails": True}
    metres = RNG.standard_normal((40, 2))
    options |= {"positions": metres, "origin": (-27.5, 153.0)}
    whole = Map.from_images(IMAGES, **options)
    assert whole.thumbnails.shape == (40, 54, 96)
    assert np.array_equal(whole.thumbnails[7], whole.thumbnail(7))
    expected = surefix.Sad((96, 54), patch=1).thumbnail(IMAGES[7])
    assert np.array_equal(whole.thumbnail(7), expected)
    Map.build(path, IMAGES, **options)
    assert path.read_bytes() == whole.to_bytes()
    options |= {"breaks": [10], "positions": metres[:25]}
    Map.build(path, IMAGES[:25], **options)
    Map.append(path, IMAGES[25:], positions=metres[25:], new_segment=True)
    assert path.read_bytes() == whole.to_bytes()


def test_places_are_kept_one_by_one_or_by_distance() -> None:
    route = made(breaks=[20], closed=[1])
    places = [*range(0, 20, 3), *range(20, 60, 4)]
    kept = route.keep(places)
    assert np.array_equal(kept.descriptors, ROWS[places])
    assert kept.names == [f"{place}.png" for place in places]
    assert np.array_equal(kept.positions, route.positions[places])
    assert kept.segments.breaks.tolist() == [7]
    assert kept.segments[1].closed
    query = ROWS[5] + 0.5
    assert np.array_equal(kept.distances(query), route.distances(query)[places])
    thin = route.thin(5.0)
    assert thin.to_bytes() == route.keep([*range(0, 20, 3), *range(20, 60, 3)]).to_bytes()
    for wrong, message in (([3, 2], "got 2 after 3"), ([0, 60], "got 60"), ([4], "at least 2")):
        with pytest.raises(SurefixValueError, match=message):
            route.keep(wrong)
    with pytest.raises(SurefixValueError, match="convert a mask with"):
        route.keep(np.ones(60, bool))
    with pytest.raises(SurefixValueError, match="a map with positions"):
        Map.from_descriptors(ROWS).thin(1.0)
    with pytest.raises(SurefixValueError, match="a distance of 0 or more"):
        route.thin(-1)


def test_thinned_as_by_subsample() -> None:
    metres = np.cumsum(RNG.uniform(0, 2, (60, 3)), axis=0)
    route = Map.from_descriptors(ROWS, positions=metres)
    expected = surefix.datasets.subsample(metres, 4.0)
    assert route.thin(4.0).to_bytes() == route.keep(expected).to_bytes()


def test_a_tunnel_is_a_break_with_a_link() -> None:
    images = IMAGES.copy()
    images[5:7] = 0
    images[20:30] = 0
    route = Map.from_images(images, skip_blank=True)
    assert len(route) == 28
    assert route.segments.breaks.tolist() == [18]
    assert route.segments.links.tolist() == [[17, 18]]


def test_bad_images_do_not_move_breaks(tmp_path: Path) -> None:
    paths = []
    for index, image in enumerate(IMAGES[:12]):
        paths.append(tmp_path / f"{index:02}.png")
        write_png(paths[-1], image)
    paths[3].write_bytes(b"no image")
    options = {"skip_bad": True, "breaks": [3, 8], "thumbnails": (32, 18)}
    route = Map.from_images(paths, **options, positions=np.ones((12, 2)), origin="UTM 55S")
    assert route.segments.breaks.tolist() == [3, 7]
    assert (len(route), route.thumbnails.shape, route.plane) == (11, (11, 18, 32), "UTM 55S")


def write_png(path: Path, image: npt.NDArray[np.uint8]) -> None:
    Image.fromarray(image).save(path)


class Brightness:
    """A learned descriptor, of a kind."""

    name = "brightness"
    recipe = {"name": "brightness"}  # noqa: RUF012
    batch = 4

    def describe(self, images: list[Any]) -> npt.NDArray[np.float32]:
        grid = [image[:: image.shape[0] // 4, :: image.shape[1] // 4] for image in images]
        return np.array([part[:4, :4].ravel() for part in grid], np.float32)


def test_learned_maps_have_segments_and_thumbnails_too(tmp_path: Path) -> None:
    sad = Map.from_images(IMAGES, thumbnails=True)
    options = {"breaks": [10, 25], "thumbnails": True}
    options |= {"positions": np.ones((40, 2)), "origin": (51.5, 0.0), "progress": False}
    whole = Map.from_images(IMAGES, Brightness(), **options)
    assert whole.segments.breaks.tolist() == [10, 25]
    assert np.array_equal(whole.thumbnails, sad.thumbnails)
    assert whole.origin == (51.5, 0.0)
    cached = Map.from_images(IMAGES, Brightness(), **options, cache=tmp_path / "cache")
    again = Map.from_images(IMAGES, Brightness(), **options, cache=tmp_path / "cache")
    assert cached.to_bytes() == again.to_bytes() == whole.to_bytes()
    path = tmp_path / "map"
    options |= {"breaks": [10], "positions": np.ones((25, 2))}
    Map.from_images(IMAGES[:25], Brightness(), **options).save(path)
    more = {"positions": np.ones((15, 2)), "progress": False, "new_segment": True}
    Map.append(path, IMAGES[25:], Brightness(), **more)
    assert np.array_equal(Map.open(path).thumbnails, whole.thumbnails)
    assert path.read_bytes() == whole.to_bytes()
    wrong: list[dict[str, Any]] = [
        {"breaks": [50]},
        {"origin": (51.5, 0.0)},
        {"thumbnails": "yes"},
        {"thumbnails": (0, 3)},
    ]
    for refused in wrong:
        with pytest.raises(SurefixValueError, match=next(iter(refused))):
            Map.from_images(Unread(), Brightness(), **refused)


def test_a_cache_of_files_gives_the_same_thumbnails(tmp_path: Path) -> None:
    paths = [tmp_path / f"{index:02}.png" for index in range(10)]
    for path, image in zip(paths, IMAGES, strict=False):
        write_png(path, image)
    options = {"thumbnails": True, "cache": tmp_path / "cache", "progress": False}
    one, other = (Map.from_images(paths, Brightness(), **options) for _ in range(2))
    assert np.array_equal(one.thumbnails, other.thumbnails)
    assert one.thumbnails.shape == (10, 54, 96)
