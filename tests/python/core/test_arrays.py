"""Things that count as arrays, and the memory that they may lie in."""

import threading
import time
from typing import Any

import numpy as np
import pandas as pd
import pytest

import surefix

RNG = np.random.default_rng(3)
ROWS = RNG.standard_normal((20, 16)).astype(np.float32)


class OnlyArray:
    """Speaks ``__array__`` and nothing else."""

    def __init__(self, array: np.ndarray[Any, Any]) -> None:
        self.array = array

    def __array__(self, *args: Any, **kwargs: Any) -> np.ndarray[Any, Any]:
        return np.asarray(self.array, *args, **kwargs)


class OnlyDlpack:
    """Speaks DLPack and nothing else."""

    def __init__(self, array: np.ndarray[Any, Any]) -> None:
        self.array = array

    def __dlpack__(self, *args: Any, **kwargs: Any) -> Any:
        return self.array.__dlpack__(*args, **kwargs)

    def __dlpack_device__(self) -> Any:
        return self.array.__dlpack_device__()


@pytest.mark.parametrize(
    "wrap", [OnlyArray, OnlyDlpack, np.asfortranarray, lambda a: np.repeat(a, 2, 0)[::2]]
)
def test_anything_that_is_an_array_inside_is_one(wrap: Any) -> None:
    plain = surefix.Map.from_descriptors(ROWS, metric="euclidean")
    wrapped = surefix.Map.from_descriptors(wrap(ROWS), metric="euclidean")
    np.testing.assert_array_equal(plain.descriptors, wrapped.descriptors)
    query = np.ascontiguousarray(ROWS[3])
    np.testing.assert_array_equal(plain.distances(wrap(query)), plain.distances(query))
    D = RNG.random((12, 30), np.float32)
    expected, got = surefix.match_distances(D), surefix.match_distances(wrap(D))
    np.testing.assert_array_equal(expected.score, got.score)


@pytest.mark.parametrize(
    "wrap",
    [
        lambda a: a.tolist(),
        list,
        tuple,
        pd.DataFrame,
        lambda a: a.astype(">f4"),
        lambda a: np.ma.masked_array(a),
    ],
    ids=["lists of numbers", "rows", "tuple", "pandas", "big-endian", "no mask"],
)
def test_what_numpy_pandas_and_python_hand_over(wrap: Any) -> None:
    plain = surefix.Map.from_descriptors(ROWS, metric="euclidean")
    given = surefix.Map.from_descriptors(wrap(ROWS), metric="euclidean")
    np.testing.assert_array_equal(plain.descriptors, given.descriptors)
    expected, got = surefix.match(plain, ROWS), surefix.match(plain, wrap(ROWS))
    assert list(expected) == list(got)


@pytest.mark.parametrize("wrap", [list, tuple, np.ndarray.tolist, pd.Series])
def test_one_query_as_python_hands_it_over(wrap: Any) -> None:
    plain = surefix.Map.from_descriptors(ROWS, metric="euclidean")
    assert surefix.Localizer(plain).push(wrap(ROWS[7])).place == 7


@pytest.mark.parametrize(
    "truth", [range(20), list(range(20)), pd.Series(range(20)), np.arange(20, dtype=">i2")]
)
def test_a_truth_as_python_hands_it_over(truth: Any) -> None:
    run = surefix.match(surefix.Map.from_descriptors(ROWS), ROWS)
    assert surefix.evaluate(run, truth).max_recall == 1


def test_numbers_that_a_mask_hides_are_refused() -> None:
    hidden = np.ma.masked_array(ROWS, np.eye(20, 16))
    plain = surefix.Map.from_descriptors(ROWS)
    for call in (
        lambda: surefix.Map.from_descriptors(hidden),
        lambda: surefix.match(plain, hidden),
        lambda: surefix.Localizer(plain).push(hidden[3]),
        lambda: surefix.match_distances(hidden),
    ):
        with pytest.raises(surefix.SurefixValueError, match=r"hides \d+ numbers"):
            call()


def test_ragged_lists_say_so() -> None:
    with pytest.raises(surefix.SurefixValueError, match="cannot be read as a NumPy array"):
        surefix.Map.from_descriptors([[1.0, 2.0], [3.0]])


def test_fields_of_packed_structures_and_unaligned_memory_are_read_right() -> None:
    packed = np.zeros((6, 9), dtype=[("d", "f4"), ("x", "u1")])
    packed["d"] = RNG.random((6, 9), np.float32)
    plain = packed["d"].copy()
    unaligned = np.frombuffer(b"." + plain.tobytes(), np.float32, offset=1).reshape(6, 9)
    turned = packed["d"][::-1, ::-1]
    for odd, even in ((packed["d"], plain), (turned, turned.copy()), (unaligned, plain)):
        got, expected = surefix.match_distances(odd), surefix.match_distances(even)
        np.testing.assert_array_equal(got.score, expected.score)
        np.testing.assert_array_equal(surefix.Map.from_descriptors(odd).descriptors, even)
        matcher = surefix.Matcher(6)
        assert matcher.push(odd[:, 2]) == surefix.Matcher(6).push(even[:, 2])


def test_torch_tensors_are_arrays() -> None:
    torch = pytest.importorskip("torch", reason="torch is not installed")
    plain = surefix.Map.from_descriptors(ROWS, metric="cosine")
    tensors = surefix.Map.from_descriptors(torch.from_numpy(ROWS), metric="cosine")
    np.testing.assert_array_equal(plain.descriptors, tensors.descriptors)
    with pytest.raises(surefix.SurefixValueError, match="requires grad"):
        plain.distances(torch.ones(16, requires_grad=True))


@pytest.mark.parametrize("dtype", [np.float32, np.float16, np.int8, np.uint8])
@pytest.mark.parametrize("metric", ["cosine", "euclidean", "manhattan"])
def test_distances_are_those_of_numpy_for_every_type(dtype: Any, metric: str) -> None:
    rows = (RNG.random((9, 300)) * 100 + 1).astype(dtype)
    route = surefix.Map.from_descriptors(rows, metric=metric)
    assert (route.dtype, route.metric, len(route), route.dim) == (np.dtype(dtype), metric, 9, 300)
    wide = rows.astype(np.float64)
    for query in (rows[4], (rows[4] + np.float32(0.25)).astype(np.float32)):
        q = query.astype(np.float64)
        expected = {
            "manhattan": np.abs(wide - q).mean(1),
            "euclidean": np.sqrt(((wide - q) ** 2).sum(1)),
            "cosine": 1 - wide @ q / (np.linalg.norm(wide, axis=1) * np.linalg.norm(q)),
        }[metric]
        np.testing.assert_allclose(route.distances(query), expected, rtol=2e-7, atol=1e-7)


@pytest.mark.parametrize(
    ("array", "words", "of_several"),
    [
        (np.zeros(16), ["float32", "float64", ".astype(np.float32)"], None),
        (np.zeros(16, np.int32), ["int32", ".astype"], None),
        (np.zeros(16, np.complex64), ["complex64"], None),
        # A map takes several at once.
        (np.zeros((4, 4), np.float32), ["(4, 4)"], ["each row", "16", "got 4"]),
        ({0.0}, ["set", "__array__"], ["descriptors (m, 16)", "got set"]),
        (None, ["NoneType"], None),
    ],
)
def test_a_wrong_array_is_refused_with_what_came_and_how_to_convert(
    array: Any, words: list[str], of_several: list[str] | None
) -> None:
    route = surefix.Map.from_descriptors(ROWS)
    matcher = surefix.Matcher(16)
    for refuse, expected in ((route.distances, of_several or words), (matcher.push, words)):
        with pytest.raises(surefix.SurefixValueError) as caught:
            refuse(array)
        assert all(word in str(caught.value) for word in expected), caught.value
    assert matcher.frames == 0


def test_a_query_of_another_byte_type_than_the_map_is_refused() -> None:
    route = surefix.Map.from_descriptors(np.ones((3, 4), np.uint8), metric="manhattan")
    with pytest.raises(
        surefix.SurefixValueError, match=r"float32 or the map's own uint8, got int8"
    ):
        route.distances(np.ones(4, np.int8))


def test_big_endian_and_read_only_arrays_are_read_right() -> None:
    route = surefix.Map.from_descriptors(ROWS)
    query = ROWS[2].copy()
    query.flags.writeable = False
    np.testing.assert_array_equal(route.distances(query), route.distances(ROWS[2]))
    swapped = ROWS[2].astype(">f4")
    np.testing.assert_array_equal(route.distances(swapped), route.distances(ROWS[2]))


def test_results_can_be_written_to_and_are_the_callers_own() -> None:
    route = surefix.Map.from_descriptors(ROWS)
    first = route.distances(ROWS[0])
    first[:] = -1
    assert route.distances(ROWS[0])[0] != -1
    route.descriptors[:] = 0
    np.testing.assert_array_equal(route.descriptors, ROWS)


def test_the_gil_is_released_while_rust_works() -> None:
    """Another Python thread goes on counting during one long call."""
    D = RNG.random((3000, 3000), np.float32)
    counted = 0
    done = threading.Event()

    def count() -> None:
        nonlocal counted
        while not done.is_set():
            counted += 1
            time.sleep(0)

    thread = threading.Thread(target=count)
    thread.start()
    while counted == 0:
        time.sleep(0)
    before = counted
    surefix.match_distances(D, sequence_length=20)
    after = counted
    done.set()
    thread.join()
    # A thread that waits for the GIL gets it at most once a call, when the call ends.
    assert after - before > 10


def test_a_list_of_descriptors_is_an_array_of_them() -> None:
    route = surefix.Map.from_descriptors(ROWS)
    assert (
        surefix.match(route, list(ROWS)).place.tolist() == surefix.match(route, ROWS).place.tolist()
    )


def test_a_restored_localizer_has_the_newest_distances() -> None:
    route = surefix.Map.from_descriptors(ROWS)
    localizer = surefix.Localizer(route)
    localizer.push(ROWS[3])
    again = surefix.Localizer.restore(route, localizer.snapshot())
    np.testing.assert_array_equal(again.distances, localizer.distances)
    again.reset()
    assert not again.distances.any()


def test_one_map_serves_many_threads() -> None:
    route = surefix.Map.from_descriptors(ROWS)
    expected = surefix.match(route, ROWS).place.tolist()
    results: list[list[int]] = []

    def localize() -> None:
        localizer = surefix.Localizer(route)
        results.append([localizer.push(row).place for row in ROWS])

    threads = [threading.Thread(target=localize) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == [expected] * 8


class Lazy:
    """A sequence that makes its images when asked, and remembers how many were alive at a time."""

    def __init__(self, frames: np.ndarray[Any, Any]) -> None:
        self.frames = frames
        self.asked: list[int] = []

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, index: int) -> np.ndarray[Any, Any]:
        if index == 13 and len(self.frames) == 14:
            raise RuntimeError("the disk is gone")
        self.asked.append(index)
        return self.frames[index]


def test_a_sequence_is_asked_for_one_image_at_a_time() -> None:
    frames = RNG.integers(0, 255, (200, 16, 32), np.uint8)
    lazy = Lazy(frames)
    seen: list[int] = []
    route = surefix.Map.from_images(
        lazy, progress=lambda done, total: seen.append(len(lazy.asked)) is None
    )
    np.testing.assert_array_equal(route.descriptors, surefix.Map.from_images(frames).descriptors)
    assert set(lazy.asked) == set(range(200))
    # The first image tells the size; then batches, not all at once.
    assert seen[1] < 100
    with pytest.raises(surefix.SurefixValueError, match=r"image 13: the disk is gone"):
        surefix.Map.from_images(Lazy(frames[:14]))


@pytest.mark.parametrize("raised", [KeyboardInterrupt, SystemExit, MemoryError])
def test_what_is_no_mistake_of_the_values_stays_what_it_is(raised: type[BaseException]) -> None:
    class Lazy:
        def __array__(self, *args: Any, **kwargs: Any) -> Any:
            raise raised("now")

    route = surefix.Map.from_descriptors(ROWS)
    localizer = surefix.Localizer(route)
    for call in (
        lambda: localizer.push(Lazy()),
        lambda: surefix.Map.from_descriptors(Lazy()),
        lambda: surefix.Map.from_descriptors(ROWS, positions=Lazy()),
        lambda: surefix.match(route, Lazy()),
        lambda: surefix.evaluate(surefix.match(route, ROWS), Lazy()),
    ):
        with pytest.raises(raised, match="now"):
            call()


def test_the_cause_of_a_refusal_is_kept() -> None:
    class Broken:
        def __array__(self, *args: Any, **kwargs: Any) -> Any:
            raise OSError("the disk is gone")

    with pytest.raises(surefix.SurefixValueError, match="the disk is gone") as refused:
        surefix.Map.from_descriptors(Broken())
    assert isinstance(refused.value.__cause__, OSError)
