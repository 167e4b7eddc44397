"""Gaps from Python: streams whose frames count the lost ones, long windows, and refusals."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from PIL import Image
from test_differential import assert_same, batch, stream

import oracle
import surefix
from oracle import Array, Options


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame of a source, with the attributes that a localizer reads."""

    image: Any
    dropped: Any = 0
    gap: Any = False


@pytest.fixture(scope="module")
def images() -> Array:
    return np.random.default_rng(0).integers(0, 256, (12, 48, 96), dtype=np.uint8)


@pytest.fixture(scope="module")
def route(images: Array) -> surefix.Map:
    return surefix.Map.from_images(images)


def ready(fixes: Iterable[surefix.Fix]) -> list[bool]:
    return [fix.sequence is not None for fix in fixes]


@pytest.mark.parametrize("seed", range(12))
def test_long_windows_fill_up_again_after_a_gap(seed: int) -> None:
    """1.5: windows of up to 100 queries, whose sums slide, in runs that a batch cuts into
    pieces.
    """
    rng = np.random.default_rng(seed)
    length = int(rng.integers(9, 101))
    n, m = length + int(rng.integers(0, 40)), 3 * length + int(rng.integers(100, 400))
    D = (rng.normal(size=(n, m)) * 10.0 ** rng.integers(-30, 31, (n, m))).astype(np.float32)
    speeds = (1.0,) if seed % 3 else (0.5, 1.0)
    smoothing = int(rng.choice([1, 3, 40]))
    options = Options(sequence_length=length, speeds=speeds, smoothing=smoothing, floor="running")
    gaps = rng.integers(0, m, int(rng.integers(1, 4)))
    trusted = rng.random(m) < 0.2
    want = oracle.match(D, options, trusted, gaps)
    assert_same(batch(D, options, trusted, gaps), want, seed, score_rtol=0.0)
    after = int(gaps.max()) + int(rng.integers(0, length))
    assert_same(stream(D, options, trusted, gaps, cut=after), want, seed, score_rtol=0.0)
    assert want.ready.any()
    assert not want.ready[max(gaps) : max(gaps) + length - 1].any()


@pytest.mark.parametrize(
    "lost", [Frame(0, dropped=1), Frame(0, gap=True), Frame(0, dropped=7, gap=True)]
)
def test_a_stream_breaks_where_a_frame_says_that_some_were_lost(
    lost: Frame, images: Array, route: surefix.Map
) -> None:
    """The same fixes as with ``gap`` called by hand before that frame."""
    order = [0, 1, 2, 6, 7, 8]
    options: dict[str, Any] = {"sequence_length": 3, "smoothing": 4}
    said = [Frame(images[i], lost.dropped, lost.gap) if i == 6 else Frame(images[i]) for i in order]
    fixes = list(surefix.Localizer(route, **options).stream(said))
    by_hand = surefix.Localizer(route, **options)
    for i, fix in zip(order, fixes, strict=True):
        if i == 6:
            by_hand.gap()
        assert by_hand.push(images[i]) == fix
    assert ready(fixes) == [False, False, True, False, False, True]
    assert [fix.place for fix in fixes] == order
    unsaid = list(surefix.Localizer(route, **options).stream(images[order]))
    assert ready(unsaid) == [False, False, True, True, True, True]


def test_frames_of_all_kinds_can_be_mixed(
    images: Array, route: surefix.Map, tmp_path: Path
) -> None:
    """Arrays, paths, frames of arrays and frames of paths; the numbers of NumPy as good as
    Python's.
    """
    paths = [tmp_path / f"{i}.png" for i in (2, 3)]
    for i, path in zip((2, 3), paths, strict=True):
        Image.fromarray(images[i]).save(path)
    frames = [
        images[0],
        Frame(images[1], np.int64(0), np.bool_(False)),
        str(paths[0]),
        Frame(paths[1]),
        Frame(images[4], np.int64(2), np.bool_(False)),
        images[5],
    ]
    fixes = list(surefix.Localizer(route).stream(frames))
    assert [fix.place for fix in fixes] == [0, 1, 2, 3, 4, 5]
    assert ready(fixes) == [False, True, True, True, False, True]


def test_frames_of_descriptors_are_pushed_as_such() -> None:
    rows = np.eye(6, dtype=np.float32)
    frames = [Frame(rows[0]), Frame(rows[1]), Frame(rows[4], gap=True), Frame(rows[5])]
    fixes = list(surefix.Localizer(surefix.Map.from_descriptors(rows)).stream(frames))
    assert ([fix.place for fix in fixes], ready(fixes)) == (
        [0, 1, 4, 5],
        [False, True, False, True],
    )


def test_frames_are_asked_for_one_at_a_time(images: Array, route: surefix.Map) -> None:
    asked = []

    def source() -> Iterator[Frame]:
        for i in range(5):
            asked.append(i)
            yield Frame(images[i])

    fixes = surefix.Localizer(route).stream(source())
    assert asked == []
    next(fixes)
    next(fixes)
    assert asked == [0, 1]


@pytest.mark.parametrize(
    ("frame", "said"),
    [
        (Frame(0, dropped=-1), "frame: dropped: expected a whole number of 0 or more, got -1"),
        (Frame(0, dropped=None), "frame: dropped: expected a whole number of 0 or more, got None"),
        (Frame(0, gap="no"), "frame: gap: expected True or False, got 'no'"),
        (Frame({1, 2}), "frame: expected a NumPy array"),
        (object(), "frame: expected a NumPy array"),
    ],
)
def test_a_frame_that_is_none_is_refused_by_name(
    frame: Any, said: str, images: Array, route: surefix.Map
) -> None:
    """And the localizer goes on as if it had never come."""
    localizer = surefix.Localizer(route)
    fixes = localizer.stream(images[:2])
    next(fixes)
    with pytest.raises(surefix.SurefixValueError) as refused:
        next(localizer.stream([frame]))
    assert said in str(refused.value)
    assert next(fixes).sequence is not None


def test_a_gap_holds_where_the_image_after_it_is_refused(images: Array, route: surefix.Map) -> None:
    """The frames were lost, whatever the next one is."""
    localizer = surefix.Localizer(route)
    list(localizer.stream(images[:3]))
    with pytest.raises(surefix.SurefixValueError):
        next(localizer.stream([Frame(images[3].astype(np.float64), dropped=1)]))
    fix = localizer.push(images[4])
    assert (fix.frame, fix.sequence) == (3, None)


def test_a_batch_of_images_or_descriptors_has_gaps_like_the_stream(
    images: Array, route: surefix.Map
) -> None:
    for queries in (images, np.stack([surefix.Sad().describe(image) for image in images])):
        run = surefix.match(route, queries, gaps=np.array([9, 4]), sequence_length=3)
        localizer = surefix.Localizer(route, sequence_length=3)
        for j, query in enumerate(queries):
            if j in (4, 9):
                localizer.gap()
            assert localizer.push(query) == run[j]
        assert_array_equal(run.ready, [j in (2, 3, 6, 7, 8, 11) for j in range(12)])
        assert_array_equal(run.anchors[~run.ready], 0)
        assert np.isnan(run.speed[~run.ready]).all()


@pytest.mark.parametrize("gaps", [[], (), np.array([], np.int64), None])
def test_no_gaps_are_none(gaps: Any) -> None:
    D = np.random.default_rng(1).random((9, 12)).astype(np.float32)
    assert_same(batch(D, Options(), gaps=gaps), batch(D, Options()), gaps, score_rtol=0.0)


@pytest.mark.parametrize(
    ("gaps", "said"),
    [
        ([3, 12], "option `gaps`: expected indices of queries, from 0 to 11, got 12"),
        ([3, -1], "option `gaps`: expected indices of queries, from 0, got -1"),
        (np.array([0.0, 3.0]), "gaps: expected whole numbers, got float64"),
        (
            [True, False],
            "gaps: expected indices of queries, got bool; convert a mask with np.flatnonzero(mask)",
        ),
        ([[1], [2]], "gaps: expected an array of 1 dimension(s), got the shape (2, 1)"),
        ("3", "gaps: expected a NumPy array"),
    ],
)
def test_gaps_that_are_none_are_refused_by_name(
    gaps: Any, said: str, images: Array, route: surefix.Map
) -> None:
    D = np.random.default_rng(1).random((9, 12)).astype(np.float32)
    for refuse in (
        lambda: surefix.match_distances(D, gaps=gaps),
        lambda: surefix.match(route, images, gaps=gaps),
    ):
        with pytest.raises(surefix.SurefixValueError) as refused:
            refuse()
        assert said in str(refused.value)


def test_a_table_of_fixes_says_where_it_warmed_up(tmp_path: Path) -> None:
    D = np.random.default_rng(2).random((9, 8)).astype(np.float32)
    run = surefix.match_distances(D, gaps=[5], **asdict(Options(sequence_length=3)))
    run.to_csv(tmp_path / "run.csv")
    names, *lines = (line.split(",") for line in (tmp_path / "run.csv").read_text().splitlines())
    assert [line[names.index("ready")] == "true" for line in lines] == run.ready.tolist()
    assert run.ready.tolist() == [False, False, True, True, True, False, False, True]
