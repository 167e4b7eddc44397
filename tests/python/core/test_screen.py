"""A map with a screen: the same answers as without, to the last bit, from fewer rows."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import real_data
import surefix
from commands import surefix_
from surefix import Localizer, Map, SurefixValueError

RNG = np.random.default_rng(11)
DIM = 512


def drives(places: int) -> tuple[Any, Any]:
    """Descriptors of unit length along a route, neighbours alike, and those of a second drive along
    it.
    """
    steps = RNG.standard_normal((places + 40, DIM))
    rows = sum(0.8**back * steps[40 - back : 40 - back + places] for back in range(40))
    rows = rows / np.linalg.norm(rows, axis=1, keepdims=True)
    queries = rows + RNG.normal(0, 1 / np.sqrt(DIM), rows.shape)
    return rows.astype(np.float32), queries.astype(np.float32)


def standardised(images: Any) -> Any:
    """Pixels as descriptors, each in units of its deviation over the drive: they cross seasons."""
    rows = images.reshape(len(images), -1).astype(np.float64)
    rows = (rows - rows.mean(axis=0)) / (rows.std(axis=0) + 1e-9)
    return (rows / np.linalg.norm(rows, axis=1, keepdims=True)).astype(np.float32)


def looked_at(route: Map, queries: Any, **options: Any) -> list[int]:
    """How many rows each query made a screened localizer look at; its fixes are those of a plain
    one.
    """
    plain, screened = Localizer(route, **options), Localizer(route.with_screen("i8"), **options)
    counts = []
    for query in queries:
        expected, fix = plain.push(query), screened.push(query)
        # The digits of a repr read back to the same bits.
        assert repr(fix) == repr(expected)
        assert plain.looked_at == len(route)
        counts.append(screened.looked_at)
    np.testing.assert_array_equal(screened.distances, plain.distances)
    assert screened.snapshot() == plain.snapshot()
    return counts


@pytest.mark.slow
@pytest.mark.parametrize("metric", ["cosine", "euclidean"])
@pytest.mark.parametrize(
    "options", [{}, {"sequence_length": 20, "speeds": [1.0, 0.9]}, {"smoothing": 1, "floor": 0.1}]
)
def test_few_rows_are_looked_at_and_the_fixes_are_the_same(
    metric: str, options: dict[str, Any]
) -> None:
    rows, queries = drives(1500)
    counts = looked_at(Map.from_descriptors(rows, metric=metric), queries[300:420], **options)
    assert np.median(counts) < 0.02 * len(rows)


@pytest.mark.slow
def test_the_batch_gives_what_the_stream_gives() -> None:
    rows, queries = drives(600)
    plain = Map.from_descriptors(rows)
    screened = plain.with_screen("i8")
    for floor in ("running", "global"):
        expected = surefix.match(plain, queries[:200], floor=floor, sequence_length=3)
        got = surefix.match(screened, queries[:200], floor=floor, sequence_length=3)
        for name in (
            "place",
            "score",
            "trusted",
            "anchors",
            "ready",
            "single_distance",
            "gradient_value",
        ):
            np.testing.assert_array_equal(getattr(got, name), getattr(expected, name))


@pytest.mark.slow
@pytest.mark.parametrize("metric", ["cosine", "euclidean"])
def test_across_the_seasons_of_a_real_route(metric: str) -> None:
    nordland = real_data.folder() / "nordland"
    summer, winter = (
        standardised(np.load(nordland / f"{season}_0000_1149.npy")) for season in ("summer", "winter")
    )  # fmt: skip
    route = Map.from_descriptors(summer, metric=metric)
    counts = looked_at(route, winter, sequence_length=3)
    assert np.median(counts) < 0.2 * len(summer)


def test_it_can_be_asked_for_from_the_start(tmp_path: Path) -> None:
    rows, _ = drives(30)
    plain = Map.from_descriptors(rows)
    assert plain.screen is None
    plain.save(tmp_path / "route.safetensors")
    for route in (
        plain.with_screen("i8"),
        Map.from_descriptors(rows, screen="i8"),
        Map.open(tmp_path / "route.safetensors", screen="i8"),
        Map.open(tmp_path / "route.safetensors", mmap=True, screen="i8"),
    ):
        assert route.screen == "i8"
        np.testing.assert_array_equal(route.distances(rows[3]), plain.distances(rows[3]))
    assert Map.open(tmp_path / "route.safetensors").screen is None, "a file knows nothing of it"


@pytest.mark.parametrize("wrong", ["u8", "", 8, True, b"i8", np.int8])
def test_another_type_is_refused(wrong: Any) -> None:
    rows, _ = drives(5)
    with pytest.raises(SurefixValueError, match=r'option `screen`: expected "i8" or None, got '):
        Map.from_descriptors(rows, screen=wrong)


def test_other_maps_are_refused() -> None:
    bytes_ = RNG.integers(1, 255, (5, 300), np.uint8)
    with pytest.raises(SurefixValueError, match=r"screen.*float32 descriptors.*uint8"):
        Map.from_descriptors(bytes_).with_screen("i8")
    with pytest.raises(SurefixValueError, match=r"screen.*cosine.*manhattan"):
        Map.from_descriptors(bytes_.astype(np.float32), metric="manhattan", screen="i8")


def test_from_the_command_line(tmp_path: Path) -> None:
    rows, queries = drives(200)
    bytes_ = RNG.integers(1, 255, (5, DIM), np.uint8)
    for name, array in (("rows", rows), ("queries", queries[50:80]), ("bytes", bytes_)):
        np.save(tmp_path / f"{name}.npy", array)
    for name in ("rows", "bytes"):
        surefix_("map", "build", tmp_path / f"{name}.npy", "-o", tmp_path / f"{name}.safetensors")

    run = "run", tmp_path / "rows.safetensors", tmp_path / "queries.npy"

    def fixes(*options: str) -> list[dict[str, str]]:
        done = surefix_(*run, "--motion", "none", *options)
        assert "unused" not in done.stderr
        rows = csv.DictReader(done.stdout.splitlines())
        return [{**row, "latency_us": ""} for row in rows]

    assert fixes("--screen", "i8") == fixes()
    said = surefix_(*run, "--screen", "i8").stderr.splitlines()
    assert said[0] == "--screen: unused, as --motion any needs all distances"
    done = surefix_(
        "run", tmp_path / "bytes.safetensors", tmp_path / "queries.npy", "--screen", "i8", code=2
    )
    assert "float32" in done.stderr
    done = surefix_(
        "run", tmp_path / "rows.safetensors", tmp_path / "queries.npy", "--screen", "u8", code=2
    )
    assert "screen" in done.stderr
