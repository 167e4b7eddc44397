"""A study of columns says what one of the whole matrix says."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surefix
from commands import surefix_
from surefix.baselines import METHODS, Context
from surefix.cli.drives import MapColumns
from surefix.study import compare
from surefix.study import streamed as streaming
from surefix.study.streamed import compare_columns, unstreamed
from surefix.tables import columns as sizes
from surefix.tables.columns import Columns, MatrixColumns

PLACES, QUERIES = 90, 120
STREAMED = [name for name in METHODS if not unstreamed([name])]


class Held(Columns):
    def __init__(self, D: np.ndarray) -> None:
        self.D, self.shape = D, D.shape

    @property
    def width(self) -> int:
        return 17

    def block(self, start: int, stop: int) -> np.ndarray:
        return np.asfortranarray(self.D[:, start:stop])


def distances() -> np.ndarray:
    D = np.random.default_rng(0).random((PLACES, QUERIES), np.float32) + np.float32(0.2)
    D[np.arange(PLACES), np.arange(PLACES)] *= np.float32(0.7)
    return D


def truths() -> list[tuple[Any, float]]:
    places = np.concatenate([np.arange(PLACES), np.full(QUERIES - PLACES, -1)]).astype(float)
    places[5] = np.nan
    there = np.stack([np.arange(PLACES), np.zeros(PLACES)], axis=1)
    here = np.stack([np.arange(QUERIES), np.zeros(QUERIES)], axis=1)
    here[7] = np.nan
    cells = np.eye(PLACES, QUERIES, dtype=np.int8)
    cells[:, 3] = -1
    return [(places, 1), ((there, here), 2.0), (cells, 1)]


@pytest.mark.parametrize("kind", range(3))
@pytest.mark.parametrize("floor", ["global", "running", 0.1])
def test_every_method_gives_the_same_to_the_bit(
    kind: int, floor: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("sklearn")
    monkeypatch.setattr(streaming, "PICTURE", 30)
    D, (truth, tolerance) = distances(), truths()[kind]
    context = Context(
        truth=truth,
        truth_tolerance=tolerance,
        floor=floor,
        sequence_length=5,
        advance=np.ones(QUERIES),
        calibration=(D, np.arange(QUERIES) % PLACES),
        motion=surefix.Motion("free", pace=1.5),
        gaps=[11, 40],
    )
    whole, study = compare(D, STREAMED, context), compare_columns(Held(D), STREAMED, context)
    for name in STREAMED:
        for field in ("place", "score", "ready", "accepted", "confidence", "off_map"):
            one, other = (getattr(each[name].matches, field) for each in (whole, study))
            assert (one is None) == (other is None)
            np.testing.assert_array_equal(one, other)
        assert whole[name].area == study[name].area
    assert repr(whole.trust) == repr(study.trust)
    assert study.recalls_at == pytest.approx(whole.recalls_at)
    picture, covers = study.seen()
    np.testing.assert_array_equal(picture, D[::3, ::4])
    assert covers == ((0, 120), (0, 90))
    np.testing.assert_array_equal(study.seen((10, 4), (20, 5))[0], D[20:25, 10:14])


def test_a_method_that_needs_all_is_refused() -> None:
    assert unstreamed(METHODS) == ["topological", "fused"]
    with pytest.raises(surefix.SurefixError, match="topological: needs all distances at once"):
        compare_columns(Held(distances()), ["topological"], Context(truth=np.full(QUERIES, -1)))


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.float16])
def test_columns_of_a_file_are_those_of_the_array(order: Any, dtype: Any, tmp_path: Path) -> None:
    D = np.asarray(distances(), dtype, order=order)
    np.save(tmp_path / "D.npy", D)
    for similarity, expected in ((False, D), (True, 1 - D.astype(np.float64))):
        read = MatrixColumns(tmp_path / "D.npy", similarity)
        assert read.shape == D.shape
        np.testing.assert_array_equal(read.block(3, 50), expected[:, 3:50].astype(np.float32))
    D[8, 40] = np.nan
    np.save(tmp_path / "D.npy", D)
    with pytest.raises(surefix.SurefixValueError, match="got nan at place 8, query 40"):
        MatrixColumns(tmp_path / "D.npy").block(30, 50)


@pytest.mark.parametrize("post", [None, [surefix.post.Standardize("running")]])
def test_columns_of_a_map_are_its_distances(post: Any) -> None:
    rng = np.random.default_rng(2)
    rows = rng.normal(size=(40, 8)).astype(np.float32)
    seen = rng.normal(size=(30, 8)).astype(np.float32)
    route = surefix.Map.from_descriptors(rows, post=post)
    columns = MapColumns(route, seen)
    localizer = surefix.Localizer(route, sequence_length=1)
    expected = []
    for each in seen:
        localizer.push(each)
        expected.append(localizer.distances)
    D = np.stack(expected, axis=1)
    for start, stop in ((0, 10), (10, 30), (0, 5), (20, 25)):
        np.testing.assert_array_equal(columns.block(start, stop), D[:, start:stop])


@pytest.mark.slow
def test_the_command_says_the_same_of_columns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    np.save(tmp_path / "D.npy", distances())
    np.save(tmp_path / "truth.npy", truths()[0][0])
    given = ("eval", tmp_path / "D.npy", "--truth", tmp_path / "truth.npy", "-o")
    held = surefix_(*given, tmp_path / "held")
    monkeypatch.setattr(sizes, "HELD", 1000)
    monkeypatch.setattr(sizes, "BLOCK", 4000)
    again = surefix_(*given, tmp_path / "streamed")
    assert held.stdout.splitlines()[1:-1] == again.stdout.splitlines()[1:-1]
    for name in ("methods.csv", "fixes.csv", "curves.csv", "drive.csv"):
        texts = [(tmp_path / each / name).read_text() for each in ("held", "streamed")]
        assert texts[0] == texts[1]


LIMITED = """
import resource, sys
limit = int(sys.argv.pop(1))
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
from surefix.cli import main
main()
"""


def limited(limit: int, *arguments: object) -> subprocess.CompletedProcess[str]:
    """The command with this many bytes of address space."""
    command = [sys.executable, "-c", LIMITED, str(limit), *map(str, arguments)]
    # A pool of threads takes address space of its own.
    one = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    return subprocess.run(command, capture_output=True, text=True, check=False, env=one)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="a limit of the address space")
def test_a_matrix_larger_than_the_memory_is_judged(tmp_path: Path) -> None:
    # 1 GB of distances in 0.83 GB, as 30,000 x 20,000 in 2 GB; some 0.4 GB are the libraries'.
    n, m = 20_000, 12_500
    D = np.lib.format.open_memmap(tmp_path / "D.npy", "w+", np.float32, (n, m))
    row = np.random.default_rng(0).random(m, np.float32) + np.float32(0.5)
    truth = np.linspace(0, n - 1, m).astype(int)
    for place in range(n):
        D[place] = np.roll(row, place * 7)
    D[truth, np.arange(m)] = 0.1
    del D
    np.save(tmp_path / "truth.npy", truth)
    given = ("eval", tmp_path / "D.npy", "--truth", tmp_path / "truth.npy", "-o", tmp_path / "out")
    done = limited(830_000_000, *given, "--method", "single")
    assert done.returncode == 0, done.stderr
    assert (
        f"single: area up to recall 0.2 is 1.000 (1.000 to 1.000), {m} of {m} right" in done.stdout
    )
    # What needs it whole says what is lacking, and whose limit it is.
    refused = limited(830_000_000, *given, "--method", "topological")
    assert refused.returncode == 1
    assert "Traceback" not in refused.stderr
    for words in ("20000 x 12500 distances, for topological", "needs 3.0 GB", "ulimit -v"):
        assert words in refused.stderr


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="a limit of the address space")
def test_no_memory_is_no_traceback(tmp_path: Path) -> None:
    D = np.lib.format.open_memmap(tmp_path / "D.npy", "w+", np.float32, (20_000, 12_500))
    del D
    done = limited(830_000_000, "align", tmp_path / "D.npy", "-o", tmp_path / "truth.csv")
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "needs 1.0 GB" in done.stderr
    assert "ulimit -v" in done.stderr
