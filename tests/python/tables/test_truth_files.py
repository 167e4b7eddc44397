"""Truth files as people have them, made by pandas, NumPy and json."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surefix
from surefix.tables.truth import read_position_truth, read_truth

pandas = pytest.importorskip("pandas")

PLACES = 10
TRUTH = [3, 4, -1, 0, 7]
QUERIES = len(TRUTH)


def frame() -> Any:
    """A table whose places are floats, as those of a column with a hole."""
    return pandas.DataFrame({"query": range(QUERIES), "reference": np.array(TRUTH, float)})


def objects(items: list[Any]) -> np.ndarray:
    array = np.empty(len(items), object)
    array[:] = items
    return array


def numbered(lists: list[list[int]]) -> np.ndarray:
    """As AnyLoc's ground_truth_new.npy: each query's number and its places."""
    array = np.empty((len(lists), 2), object)
    for query, places in enumerate(lists):
        array[query] = [query, places]
    return array


ONE: dict[str, Callable[[Path], object]] = {
    "an index column.csv": lambda p: frame().to_csv(p),
    "upper case.CSV": lambda p: frame().to_csv(p, index=False),
    "semicolons.csv": lambda p: frame().to_csv(p, index=False, sep=";", decimal=","),
    "tabs.tsv": lambda p: frame().to_csv(p, sep="\t"),
    "the other order.csv": lambda p: frame()[["reference", "query"]].to_csv(p, index=False),
    "shuffled.csv": lambda p: frame().sample(frac=1, random_state=1).to_csv(p, index=False),
    "a series.csv": lambda p: pandas.Series(TRUTH).to_csv(p),
    "a named series.csv": lambda p: frame().reference.to_csv(p),
    "query as index.csv": lambda p: frame().set_index("query").to_csv(p),
    "other names.csv": lambda p: p.write_text(
        "Query_ID, Database Index\n" + "".join(f"{q}, {t}\n" for q, t in enumerate(TRUTH))
    ),
    "names of images.csv": lambda p: p.write_text(
        "image,place\n" + "".join(f"{q}.png,{t}\n" for q, t in enumerate(TRUTH))
    ),
    "floats.txt": lambda p: np.savetxt(p, TRUTH),
    "two columns.txt": lambda p: np.savetxt(p, np.c_[range(QUERIES), TRUTH], fmt="%d"),
    "utf-16.txt": lambda p: p.write_text(
        "query\treference\n" + "".join(f"{q}\t{t}\n" for q, t in enumerate(TRUTH)), "utf-16"
    ),
    "column.npy": lambda p: np.save(p, np.array(TRUTH)[:, None]),
    "row.npy": lambda p: np.save(p, np.array(TRUTH)[None]),
    "float.npy": lambda p: np.save(p, np.array(TRUTH, np.float32)),
    "pairs.npy": lambda p: np.save(p, np.c_[range(QUERIES), TRUTH]),
    "an archive.npz": lambda p: np.savez(p, TRUTH),
    "a named one.npz": lambda p: np.savez(p, ground_truth=TRUTH, more=1),
    "objects.npy": lambda p: np.save(p, objects(TRUTH)),
    "list.json": lambda p: p.write_text(json.dumps(TRUTH)),
    "keys.json": lambda p: p.write_text(json.dumps(dict(enumerate(TRUTH)))),
}


@pytest.mark.parametrize("name", ONE)
def test_a_place_a_query(name: str, tmp_path: Path) -> None:
    ONE[name](tmp_path / name)
    read = read_truth(tmp_path / name, PLACES, QUERIES)
    assert (read.dtype, read.tolist()) == (np.int64, TRUTH)


LISTS = [[1, 2], [3], [], [4, 5, 6], [0]]
SEVERAL: dict[str, Callable[[Path], object]] = {
    "lists.npy": lambda p: np.save(p, objects(LISTS)),
    "arrays.npy": lambda p: np.save(p, objects([np.array(each, np.int32) for each in LISTS])),
    "numbered.npy": lambda p: np.save(p, numbered(LISTS)),
    "lists.npz": lambda p: np.savez(p, objects(LISTS)),
    "lists.json": lambda p: p.write_text(json.dumps(LISTS)),
    "filled up.npy": lambda p: np.save(
        p, np.array([each + [-1] * (3 - len(each)) for each in LISTS])
    ),
    "transposed.npy": lambda p: np.save(p, cells().T),
    "matrix.csv": lambda p: np.savetxt(p, cells(), fmt="%d", delimiter=","),
}


def cells() -> np.ndarray:
    matrix = np.zeros((PLACES, QUERIES), np.int8)
    for query, places in enumerate(LISTS):
        matrix[places, query] = 1
    return matrix


@pytest.mark.parametrize("name", SEVERAL)
def test_several_places_a_query(name: str, tmp_path: Path) -> None:
    SEVERAL[name](tmp_path / name)
    np.testing.assert_array_equal(read_truth(tmp_path / name, PLACES, QUERIES), cells())


class Evil:
    def __init__(self, file: Path) -> None:
        self.file = file

    def __reduce__(self) -> tuple[Any, ...]:
        return os.system, (f"touch {self.file}",)


def test_a_pickle_runs_nothing(tmp_path: Path) -> None:
    array = np.empty(QUERIES, object)
    array[0] = Evil(tmp_path / "done")
    np.save(tmp_path / "evil.npy", array)
    with pytest.raises(surefix.SurefixValueError, match="system, which is not read"):
        read_truth(tmp_path / "evil.npy", PLACES, QUERIES)
    assert not (tmp_path / "done").exists()
    whole = (tmp_path / "evil.npy").read_bytes()
    (tmp_path / "cut.npy").write_bytes(whole[:-9])
    with pytest.raises(surefix.SurefixValueError, match=r"cut\.npy"):
        read_truth(tmp_path / "cut.npy", PLACES, QUERIES)


def test_a_place_that_is_not_known_is_left_out(tmp_path: Path) -> None:
    table = frame()
    table.loc[1, "reference"] = np.nan
    table.to_csv(tmp_path / "truth.csv", index=False, na_rep="nan")
    np.save(tmp_path / "truth.npy", table.reference.to_numpy())
    matches = surefix.Matches(place=[3, 9, 9, 0, 7], score=[0.1, 0.2, 0.3, 0.4, 0.5])
    for name in ("truth.csv", "truth.npy"):
        truth = read_truth(tmp_path / name, PLACES, QUERIES)
        curve = surefix.evaluate(matches, truth, 0)
        assert (curve.correct, curve.judged) == (3, 4)
    # The same by its own matrix of cells to ignore.
    ignored = np.zeros((PLACES, QUERIES), int)
    ignored[[3, 0, 7], [0, 3, 4]] = 1
    ignored[:, 1] = -1
    other = surefix.evaluate(matches, ignored, 0)
    np.testing.assert_array_equal(curve.precision, other.precision)
    np.testing.assert_array_equal(curve.recall, other.recall)


REFUSED: dict[str, tuple[Callable[[Path], object], str]] = {
    "part.npy": (
        lambda p: np.save(p, np.array([0.5, 1, 2, 3, 4])),
        "whole numbers, got 0.5 in row",
    ),
    "from 1.npy": (lambda p: np.save(p, np.array([1, 2, 3, 4, 10])), "seem to count from 1"),
    "from 1.csv": (
        lambda p: p.write_text("query,reference\n1,1\n2,2\n3,3\n4,4\n5,5\n"),
        "row 6, column query.*seem to count from 1",
    ),
    "short.json": (lambda p: p.write_text("[1, 2]"), "an item for each of the 5 queries, got 2"),
    "words.json": (lambda p: p.write_text('["a", 1, 2, 3, 4]'), "got 'a' for query 0"),
    "no json.json": (lambda p: p.write_text("[1, 2"), "a list in JSON"),
    "far.json": (lambda p: p.write_text("[[1, 99], 1, 2, 3, 4]"), "got 99 for query 0"),
    "images.npy": (lambda p: np.save(p, np.zeros((5, 4, 4), np.uint8)), r"uint8 \(5, 4, 4\)"),
    "several.npz": (lambda p: np.savez(p, a=1, b=2), "one array, or one of truth.*got a, b"),
    "empty.csv": (lambda p: p.write_text(""), "rows of query,reference, got none"),
    "columns.csv": (lambda p: p.write_text("a,b\n0,1\n"), "row 1: expected the columns query"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_truth_is_named(name: str, tmp_path: Path) -> None:
    write, words = REFUSED[name]
    write(tmp_path / name)
    with pytest.raises(surefix.SurefixValueError, match=words) as error:
        read_truth(tmp_path / name, PLACES, QUERIES)
    assert name in str(error.value)


def test_patch_netvlads_archive_is_positions(tmp_path: Path) -> None:
    there, here = np.arange(20.0).reshape(10, 2), np.arange(10.0).reshape(5, 2)
    np.savez(tmp_path / "gt.npz", utmDb=there, utmQ=here, posDistThr=25)
    read = read_position_truth(tmp_path / "gt.npz")
    assert read is not None
    np.testing.assert_array_equal(read.places, there)
    np.testing.assert_array_equal(read.queries, here)
    assert read.metres == 25
