"""Places with several rows: exact against NumPy, kept in files, and refused if they do not fit."""

import copy
import pickle

import numpy as np
import numpy.typing as npt
import pytest

import surefix
from surefix.post import Normalize, Standardize
from surefix.simulate import Route

Float32 = npt.NDArray[np.float32]


def on_one_mean(first: Float32, others: list[tuple[npt.NDArray[np.int64], Float32]]) -> Float32:
    """The distances of places, (n, m), by those to the rows of each traverse: method 1.14."""
    least = first.astype(np.float64)
    for places, rows in others:
        apart = first[places].astype(np.float64) - rows.astype(np.float64)
        # Summed one by one, as the method says.
        shift = apart.cumsum(axis=0)[-1] / len(places)
        least[places] = np.minimum(least[places], (rows + shift).astype(np.float32))
    return least.astype(np.float32)


def columns(route: surefix.Map, queries: Float32) -> Float32:
    return np.stack([route.distances(query) for query in queries], axis=1)


@pytest.mark.parametrize("metric", ["cosine", "euclidean", "manhattan"])
@pytest.mark.parametrize("dtype", [np.float32, np.uint8])
def test_distances_are_those_of_the_oracle(metric: str, dtype: type) -> None:
    rng = np.random.default_rng(3)

    def drive(count: int) -> npt.NDArray[np.generic]:
        return rng.integers(1, 250, (count, 32)).astype(dtype)

    rows, queries = [drive(count) for count in (40, 40, 25)], drive(12)
    maps = [surefix.Map.from_descriptors(each, metric) for each in rows]
    alignments = [surefix.align(maps[0], each, motion="any") for each in rows]
    both = maps[0]
    others = []
    for label, route, alignment in zip("bc", maps[1:], alignments[1:], strict=True):
        both = both.add_traverse(route, alignment, least=0.0, label=label)
        sure = {}
        for query, place in enumerate(alignment.place.tolist()):
            best = sure.get(place)
            if best is None or alignment.confidence[query] > alignment.confidence[best]:
                sure[place] = query
        kept = sorted(sure)
        assert both.traverses[-1].places.tolist() == kept
        own = columns(route, queries)[[sure[place] for place in kept]]
        others.append((np.array(kept), own))
    expected = on_one_mean(columns(maps[0], queries), others)
    np.testing.assert_array_equal(columns(both, queries), expected)
    run = surefix.match(both, queries, motion="any", progress=False)
    told = surefix.match_distances(expected, floor="running", motion="any")
    localizer = surefix.Localizer(both, motion="any")
    for query, place, confidence in zip(queries, told.place, told.confidence, strict=True):
        fix = localizer.push(query)
        assert (fix.place, fix.confidence) == (place, confidence)
    np.testing.assert_array_equal(run.place, told.place)
    np.testing.assert_array_equal(run.confidence, told.confidence)


@pytest.fixture(scope="module")
def road() -> Route:
    return Route(places=60, size=(96, 48), seed=4)


@pytest.fixture(scope="module")
def summer(road: Route) -> surefix.Map:
    return surefix.Map.from_images(road.reference(), progress=False).with_label("summer")


def test_a_drive_is_aligned_and_kept_with_the_map(road: Route, summer: surefix.Map) -> None:
    winter = road.traverse(season=0.9, light=0.3, seed=2)
    both = summer.add_traverse(winter, label="winter", progress=False)
    alignment = surefix.align(summer, winter, progress=False)
    assert len(both) == 60
    assert [one.label for one in both.traverses] == ["summer", "winter"]
    assert both.traverses[0].rows == 60
    assert both.traverses[1].rows > 50
    sure = set(alignment.place[alignment.confidence >= 0.9].tolist())
    assert set(both.traverses[1].places.tolist()) == sure
    again = pickle.loads(pickle.dumps(both))
    assert again.traverses == both.traverses == copy.copy(both).traverses
    assert pickle.loads(pickle.dumps(both.traverses[1])) == both.traverses[1]
    described = surefix.Map.from_images(winter, progress=False)
    same = summer.add_traverse(described, alignment, label="winter")
    assert same.to_bytes() == both.to_bytes()
    assert summer.add_traverse(described).traverses[1].label == "1"
    assert both.without_traverse(1).to_bytes() == summer.to_bytes()
    query = road.traverse(season=0.9, light=0.3, seed=3)[30]
    assert surefix.Localizer(both).push(query).place in range(28, 33)


def test_what_does_not_fit_is_refused(road: Route, summer: surefix.Map) -> None:
    winter = road.traverse(season=0.9)
    alignment = surefix.align(summer, winter, progress=False)
    shorter = surefix.Map.from_images(winter, progress=False).slice(0, 40)
    other = surefix.align(summer.slice(0, 50), winter, progress=False)
    ready = surefix.Map.from_descriptors(np.eye(60, dtype=np.float32))

    def refused(message: str, *given: object, **options: object) -> None:
        with pytest.raises(surefix.SurefixValueError, match=message):
            summer.add_traverse(*given, **options)  # type: ignore[arg-type]

    refused("expected one of 40 images, got 60", shorter, alignment)
    refused("expected one with this map, of 60 places, got 50", winter, other, progress=False)
    refused("expected SAD descriptors", ready)
    refused("expected SAD descriptors", ready, alignment)
    refused("expected surefix.Alignment", winter, np.arange(60))
    refused("expected a number from 0 to 1, got 2", winter, alignment, least=2.0)
    both = summer.add_traverse(winter, alignment, progress=False)
    refused("expected a map of one drive", both, alignment)
    unsure = surefix.align(np.ones((60, 60), np.float32))
    refused("place is sure", winter, unsure, progress=False)
    with pytest.raises(surefix.SurefixValueError, match="got 0"):
        summer.without_traverse(0)
    assert len(summer.traverses) == 1


def test_descriptors_go_through_the_map_s_post_processing() -> None:
    rng = np.random.default_rng(5)
    rows = rng.standard_normal((50, 24), np.float32)
    again = rows + 0.1 * rng.standard_normal((50, 24), np.float32)
    first = surefix.Map.from_descriptors(rows, post=[Standardize(), Normalize()])
    both = first.add_traverse(again, motion="steady")
    assert both.traverses[1].rows > 45
    with pytest.raises(surefix.SurefixValueError, match="post-processing"):
        first.add_traverse(surefix.Map.from_descriptors(rows, post=first.post))
