"""The rows that a shard fetches of a file in an object store."""

from pathlib import Path

import numpy as np
import pytest
from shard_maps import road, saved

import surefix
from surefix import SurefixError, SurefixFileError, SurefixValueError
from surefix.distributed.sources import places_of, sources

fsspec = pytest.importorskip("fsspec")


def stored(route: surefix.Map, name: str) -> str:
    """The URL of a map in the memory of this process."""
    fsspec.filesystem("memory").pipe_file(f"/{name}", route.to_bytes())
    return f"memory://{name}"


def test_rows_are_those_asked_for_and_else_zeros() -> None:
    route = road()
    for metric in ("euclidean", "cosine"):
        there = surefix.Map.from_descriptors(route.descriptors, metric=metric)
        (source,) = sources(stored(there, f"{metric}.safetensors"))
        assert not source.open().descriptors.any()
        opened = source.open([(10, 20), (5000, 9000)])
        assert opened.metric == metric
        rows = opened.descriptors
        for start, stop in ((10, 20), (5000, 9000)):
            assert np.array_equal(rows[start:stop], there.descriptors[start:stop])
            rows[start:stop] = 0
        assert not rows.any()


def test_all_but_the_rows_is_there() -> None:
    route = road()
    opened = sources(stored(route, "road.safetensors"))[0].open()
    assert opened.segments == route.segments
    assert np.array_equal(opened.positions, route.positions)


def test_rows_of_all_traverses() -> None:
    rng = np.random.default_rng(0)
    first = surefix.Map.from_descriptors(rng.random((50, 4), np.float32), metric="euclidean")
    more = rng.random((30, 4), np.float32)
    alignment = surefix.align(first, first.descriptors[10:40], motion="steady")
    both = first.add_traverse(more, alignment, least=0.0)
    (source,) = sources(stored(both, "both.safetensors"))
    opened = source.open([(5, 25)])
    covered = both.traverses[1].places
    assert 0 < ((covered >= 5) & (covered < 25)).sum() < len(covered)
    query = rng.random((1, 4), np.float32)
    there, wanted = (route.slice(5, 25).distances(query) for route in (opened, both))
    assert np.array_equal(there, wanted)


def test_a_file_is_known_by_its_bytes(tmp_path: Path) -> None:
    route = road()
    file = saved(tmp_path, route)
    known = sources(file)[0].identity()
    assert sources(stored(route, "same.safetensors"))[0].identity() == known
    rows = route.descriptors
    rows[4000] += 1
    other = surefix.Map.from_descriptors(rows, metric="euclidean", positions=route.positions)
    other.with_segments(route.segments).save(file)
    assert sources(file)[0].identity() != known


def test_places_of_joined_files() -> None:
    ranges = [(0, 3), (8, 14), (19, 20)]
    assert places_of([10, 5, 5], ranges) == [[(0, 3), (8, 10)], [(0, 4)], [(4, 5)]]


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("memory://none.safetensors", "cannot read the map"),
        ("nowhere://a/b", "nowhere"),
    ],
)
def test_files_that_are_not_there(name: str, said: str) -> None:
    with pytest.raises(SurefixError, match=said):
        sources(name)[0].open()


def test_other_files(tmp_path: Path) -> None:
    for data in (b"", b"abc", b"\xff" * 100, (2).to_bytes(8, "little") + b"[]" + b"0" * 20):
        (tmp_path / "other").write_bytes(data)
        with pytest.raises(SurefixValueError, match="expected a surefix map"):
            sources(tmp_path / "other")[0].identity()
    with pytest.raises(SurefixFileError, match="cannot read the map"):
        sources(tmp_path / "absent")[0].identity()


def test_a_map_without_what_it_takes_to_open_it_in_part(tmp_path: Path) -> None:
    numpy = pytest.importorskip("safetensors.numpy")
    entry = (
        '{"format":"surefix-map","version":1,"metric":"euclidean","descriptor":{"kind":"ready"}}'
    )
    rows = {"descriptors": np.ones((5, 3), np.float32)}
    numpy.save_file(rows, tmp_path / "bare", metadata={"surefix": entry})
    with pytest.raises(SurefixValueError, match='expected the tensor "blank"'):
        sources(f"file://{tmp_path / 'bare'}")[0].open()
