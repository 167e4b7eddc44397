"""The distances of maps, runs and alignments: those that the method saw, to the last bit."""

import copy
import gc
import pickle
import weakref
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import surefix
import tiny_network
from surefix import SurefixValueError, post, simulate
from surefix.descriptors import Onnx

ROUTE = simulate.Route(places=50, seed=3)
MAP = surefix.Map.from_images(ROUTE.reference())
DRIVE = ROUTE.revisit()
RANDOM = np.random.default_rng(0)
ROWS = RANDOM.standard_normal((40, 16)).astype(np.float32)
SEEN = ROWS[3:30] + RANDOM.standard_normal((27, 16)).astype(np.float32)
VECTORS = surefix.Map.from_descriptors(ROWS)


def one_by_one(known: surefix.Map, queries: np.ndarray) -> np.ndarray:
    """The distances that a localizer saw of each query."""
    localizer = surefix.Localizer(known)
    columns = []
    for query in queries:
        localizer.push(query)
        columns.append(localizer.distances)
    return np.stack(columns, axis=1)


@pytest.mark.parametrize(
    "known",
    [
        VECTORS,
        surefix.Map.from_descriptors(ROWS, metric="euclidean"),
        VECTORS.with_screen("i8"),
        surefix.Map.from_descriptors(ROWS, post=[post.Standardize("running")]),
    ],
    ids=["cosine", "euclidean", "screen", "running statistics"],
)
def test_a_run_has_the_distances_that_a_localizer_saw(known: surefix.Map) -> None:
    run = surefix.match(known, SEEN)
    assert run.distances.dtype == np.float32
    np.testing.assert_array_equal(run.distances, one_by_one(known, SEEN))
    np.testing.assert_array_equal(run.distances.min(axis=0), run.single_distance)
    np.testing.assert_array_equal(run.distances, surefix.align(known, SEEN).distances)


def test_images_are_described_once_and_give_the_maps_own_distances() -> None:
    run = surefix.match(MAP, DRIVE)
    each = [MAP.distances(MAP.descriptor.describe(image)) for image in DRIVE]  # type: ignore[union-attr]
    np.testing.assert_array_equal(run.distances, np.stack(each, axis=1))
    assert run.distances is run.distances
    with pytest.raises(ValueError, match="read-only"):
        run.distances[0, 0] = 1


def test_distances_that_were_given_are_neither_copied_nor_open_to_writing() -> None:
    D = RANDOM.random((30, 20)).astype(np.float32)
    for run in (surefix.match_distances(D), surefix.align(D)):
        assert np.shares_memory(run.distances, D)
        assert not run.distances.flags.writeable
    assert D.flags.writeable


def test_several_techniques_give_the_fused_distances_of_both_kinds() -> None:
    other = surefix.Map.from_descriptors(ROWS, metric="manhattan")
    run = surefix.match([VECTORS, other], [SEEN, SEEN])
    np.testing.assert_array_equal(run.distances.min(axis=0), run.single_distance)
    np.testing.assert_array_equal(run.distances.argmin(axis=0), run.single_place)
    matrices = [VECTORS.distances(SEEN), other.distances(SEEN)]
    np.testing.assert_array_equal(surefix.match_distances(matrices).distances, run.distances)
    np.testing.assert_array_equal(surefix.align(matrices).distances, run.distances)


def test_no_query_gives_no_column() -> None:
    run = surefix.match(VECTORS, SEEN[:0])
    assert run.distances.shape == (40, 0)
    assert VECTORS.distances(SEEN[:0]).shape == (40, 0)


def test_a_pickle_is_small_and_says_that_it_has_no_distances() -> None:
    D = RANDOM.random((400, 300)).astype(np.float32)
    for made, name in ((surefix.match_distances(D), "run"), (surefix.align(D), "alignment")):
        again = pickle.loads(pickle.dumps(made))
        assert len(pickle.dumps(made)) < D.nbytes / 2
        np.testing.assert_array_equal(again.place, made.place)
        with pytest.raises(SurefixValueError, match=f"expected an? {name} of this process"):
            again.distances  # noqa: B018
        assert copy.copy(made) is made
        assert copy.deepcopy(made).distances is made.distances


def test_a_run_lets_go_of_what_it_was_made_of() -> None:
    class Matrix(np.ndarray):
        """An array that a weak reference can point to."""

    D = RANDOM.random((30, 20)).astype(np.float32).view(Matrix)
    there = weakref.ref(D)
    run = surefix.match_distances(D)
    del D
    assert run.distances.shape == (30, 20)
    del run
    gc.collect()
    assert there() is None


# Of Map.distances.


def test_many_queries_are_columns_of_one_query_each() -> None:
    running = surefix.Map.from_descriptors(ROWS, post=[post.Standardize("running")])
    for known in (VECTORS, running):
        each = np.stack([known.distances(query) for query in SEEN], axis=1)
        np.testing.assert_array_equal(known.distances(SEEN), each)
        np.testing.assert_array_equal(known.distances(list(SEEN)), each)


def test_one_image_or_many_in_every_form(tmp_path: Path) -> None:
    images = [DRIVE[j] for j in range(6)]
    want = np.stack([MAP.distances(MAP.descriptor.describe(i)) for i in images], axis=1)  # type: ignore[union-attr]
    for j, image in enumerate(images):
        Image.fromarray(image).save(tmp_path / f"{j}.png")
    for many in (images, np.stack(images), tmp_path, sorted(tmp_path.glob("*.png"))):
        np.testing.assert_array_equal(MAP.distances(many), want)
    for one in (images[2], Image.fromarray(images[2]), tmp_path / "2.png", str(tmp_path / "2.png")):
        np.testing.assert_array_equal(MAP.distances(one), want[:, 2])
    grey = np.asarray(Image.fromarray(images[2]).convert("L"))
    described = MAP.descriptor.describe(grey)  # type: ignore[union-attr]
    np.testing.assert_array_equal(MAP.distances(grey), MAP.distances(described))


def test_a_learned_map_takes_images_with_its_descriptor(tmp_path: Path) -> None:
    network = Onnx(tiny_network.save(tmp_path / "tiny.onnx"), output="mean", size=(20, 12))
    images = RANDOM.integers(0, 256, (5, 12, 20, 3), np.uint8)
    known = surefix.Map.from_images(list(images), descriptor=network)
    D = known.distances(list(images[:3]), descriptor=network)
    assert D.argmin(axis=0).tolist() == [0, 1, 2]
    np.testing.assert_array_equal(known.distances(images[1], descriptor=network), D[:, 1])
    with pytest.raises(SurefixValueError, match=r"expected descriptors \(m, .*, or descriptor="):
        known.distances(list(images[:3]))


def test_a_bad_query_is_named() -> None:
    bad = SEEN.copy()
    bad[5, 2] = np.nan
    with pytest.raises(
        SurefixValueError, match="queries: expected finite numbers, got NaN at row 5"
    ):
        VECTORS.distances(bad)
    with pytest.raises(SurefixValueError, match=r"each row: expected 16 .*, got 9"):
        VECTORS.distances(SEEN[:, :9])
    with pytest.raises(SurefixValueError, match=r"expected 16 .*, got 9"):
        VECTORS.distances(SEEN[0, :9])
    small = surefix.Map.from_descriptors(ROWS[:, :4])
    none = SEEN[:, :4].copy()
    none[7] = 0
    with pytest.raises(SurefixValueError, match="7"):
        small.distances(none)
    with pytest.raises(SurefixValueError, match="float64"):
        VECTORS.distances(SEEN.astype(np.float64))


def test_progress_is_told_and_can_stop_the_work() -> None:
    told: list[tuple[int, int]] = []
    many = np.repeat(SEEN, 5, axis=0)
    VECTORS.distances(many, progress=lambda done, total: told.append((done, total)))
    assert told[-1] == (len(many), len(many))
    with pytest.raises(surefix.SurefixError, match="of 135"):
        VECTORS.distances(many, progress=lambda done, total: done < 64)
