"""Several techniques on one route: one push, the evidence of all."""

import numpy as np
import pytest

import surefix
from surefix.simulate import Route


class Columns:
    """A learned descriptor of a few lines: the means of an image's columns."""

    name = "columns"

    @property
    def recipe(self):
        return {"name": self.name}

    def describe(self, images):
        means = [np.asarray(image, np.float32).mean(axis=(0, 2)) for image in images]
        return np.stack([(row - row.mean()) / row.std() for row in means])


@pytest.fixture(scope="module")
def road():
    route = Route(places=60, size=(96, 48))
    return route.reference(), route.revisit(lateral_offset=0.6)


@pytest.fixture(scope="module")
def maps(road):
    summer = np.stack(list(road[0]))
    return [surefix.Map.from_images(summer), surefix.Map.from_images(summer, Columns())]


def test_one_image_is_pushed_to_all_maps_and_the_batch_is_the_stream(maps, road):
    winter = np.stack(list(road[1]))
    options = {"motion": "any", "sequence_length": 3}
    localizer = surefix.Localizer(maps, descriptor=[None, Columns()], **options)
    assert [len(each) for each in localizer.maps] == [60, 60]
    stream = [localizer.push(image, advance=1.0) for image in winter]
    advance = np.ones(len(winter))
    run = surefix.match(maps, winter, descriptor=[None, Columns()], advance=advance, **options)
    assert list(run) == stream

    # The same by ready descriptors, one list for each map, and by matrices.
    sad = np.stack([maps[0].descriptor.describe(image) for image in winter])
    rows = [sad, Columns().describe(winter)]
    ready = surefix.match(maps, rows, advance=advance, **options)
    assert list(ready) == stream
    matrices = [
        np.stack([each.distances(row) for row in of_map], axis=1)
        for each, of_map in zip(maps, rows, strict=True)
    ]
    by_matrix = surefix.match_distances(matrices, floor="running", advance=advance, **options)
    assert list(by_matrix) == stream

    # A list has an input for each map.
    localizer.reset()
    assert localizer.push([winter[0], rows[1][0]], advance=1.0) == stream[0]


def test_it_goes_on_from_a_snapshot_of_the_same_maps_only(maps, road):
    winter = np.stack(list(road[1]))
    whole = surefix.Localizer(maps, descriptor=Columns(), motion="free")
    for image in winter[:20]:
        whole.push(image)
    blob = whole.snapshot()
    restored = surefix.Localizer.restore(maps, blob, descriptor=Columns(), motion="free")
    assert [restored.push(image) for image in winter[20:]] == [
        whole.push(image) for image in winter[20:]
    ]
    for others in (maps[0], maps[::-1], [maps[0], maps[0]]):
        with pytest.raises(surefix.SurefixValueError, match="another map"):
            surefix.Localizer.restore(others, blob)


def test_the_global_floor_is_that_of_the_fused_matrix(maps, road):
    winter = np.stack(list(road[1]))
    first = surefix.match(maps, winter, descriptor=Columns())
    lowest = float(first.single_distance.min())
    by_number = surefix.match(maps, winter, descriptor=Columns(), floor=lowest)
    assert list(surefix.match(maps, winter, descriptor=Columns(), floor="global")) == list(
        by_number
    )


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda maps: surefix.Localizer([]), "expected 1 to 32 maps, got 0"),
        (lambda maps: surefix.Localizer([maps[0], 7]), "expected a surefix.Map"),
        (
            lambda maps: surefix.Localizer(
                [maps[0], surefix.Map.from_descriptors(np.eye(5, dtype=np.float32))]
            ),
            "places of a map, as of the first: expected 60 values, got 5",
        ),
        (
            lambda maps: surefix.Localizer(maps, descriptor=[Columns()]),
            "expected 2 entries, one for each map, got 1",
        ),
        (
            lambda maps: surefix.Localizer(maps).push([np.zeros((48, 96, 3), np.uint8)] * 3),
            "expected one input for each of 2 maps, got 3",
        ),
        (
            lambda maps: surefix.match_distances(
                [np.ones((4, 3), np.float32), np.ones((4, 2), np.float32)]
            ),
            "distances of several techniques",
        ),
    ],
)
def test_what_does_not_fit_is_refused_in_words(maps, call, words):
    with pytest.raises(surefix.SurefixValueError, match=words.replace("(", r"\(")):
        call(maps)


def test_as_many_grey_images_as_maps_are_images() -> None:
    images = np.random.default_rng(0).integers(0, 255, (6, 48, 96), np.uint8)
    small = surefix.Sad(size=(32, 16))
    maps = [surefix.Map.from_images(images), surefix.Map.from_images(images, small)]
    run = surefix.match(maps, [images[2], images[3]])
    assert run.single_place.tolist() == [2, 3]
    rows = [each.descriptors[3:5] for each in maps]
    assert surefix.match(maps, rows).single_place.tolist() == [3, 4]


def test_weights_of_techniques(maps, road):
    winter = np.stack(list(road[1]))
    rows = [[maps[0].descriptor.describe(image) for image in winter], Columns().describe(winter)]
    D = [
        np.stack([each.distances(row) for row in of_map], axis=1)
        for each, of_map in zip(maps, rows, strict=True)
    ]
    options = {"motion": "any", "sequence_length": 3}
    equal = list(surefix.match_distances(D, **options))
    assert list(surefix.match_distances(D, technique_weights=[3, 3], **options)) == equal
    # A technique of weight 0 is as good as none, and one that comes twice as one of twice the weight.
    alone = surefix.match_distances([D[0], D[0]], **options)
    only = surefix.match_distances(D, technique_weights=[1, 0], **options)
    assert only.single_place.tolist() == alone.single_place.tolist()
    np.testing.assert_allclose(only.single_distance, alone.single_distance, rtol=1e-5)
    twice = surefix.match_distances([D[0], D[0], D[1]], sequence_length=3)
    weighted = surefix.match_distances(D, technique_weights=[2, 1], sequence_length=3)
    np.testing.assert_allclose(weighted.single_distance, twice.single_distance, rtol=1e-5)
    assert weighted.place.tolist() == twice.place.tolist()
    # The evidence of one technique is that of a track without fusion.
    track = surefix.match(maps[0], winter, **options)
    assert only.place.tolist() == track.place.tolist()
    np.testing.assert_allclose(only.confidence, track.confidence, rtol=1e-6)

    for weights, words in (
        ([1, 1, 1], "expected one of each of 2 techniques, got 3"),
        ([0, 0], "one of them above 0"),
        ([-1, 1], "numbers from 0 to"),
        ([np.nan, 1], "numbers from 0 to"),
        ("ab", "a sequence of numbers, one a technique"),
    ):
        with pytest.raises(surefix.SurefixValueError, match=words):
            surefix.Localizer(maps, technique_weights=weights)
    with pytest.raises(surefix.SurefixValueError, match="one of each of 1 techniques, got 2"):
        surefix.Localizer(maps[0], technique_weights=[1, 1])
