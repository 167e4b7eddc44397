"""The comparison behind ``surefix eval``: its verdicts, the worst mistakes, and drives at the
edge.
"""

import re
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")
pytest.importorskip("bokeh")

from html_reader import Reader, read
from real_data import folder as real_data
from surefix import SurefixValueError
from surefix.baselines import Context
from surefix.report import figures
from surefix.report.eval import FILES, write_report
from surefix.study import Study, compare, verdict
from surefix.tables.reports import REPLACING, read_report

METHODS = ("sequence", "weighted", "single", "masked")


def written(
    folder: Path, D: np.ndarray, truth: np.ndarray, tolerance: float = 1, **options: object
) -> Reader:
    context = Context(truth=truth, truth_tolerance=tolerance, **options)  # type: ignore[arg-type]
    folder.mkdir(exist_ok=True)
    write_report(compare(D, METHODS, context), folder, "command")
    for file in folder.glob("*.csv"):
        assert not re.search(r"\b(nan|inf)\b", file.read_text(), re.IGNORECASE), file.name
    page = read((folder / "report.html").read_text(encoding="utf-8"))
    assert not re.search(r"\b(nan|inf)\b", page.text, re.IGNORECASE)
    return page


RANDOM = np.random.default_rng(3).random((12, 9)).astype(np.float32)
# The least is at place 0, the sharpest dip at place 8.
DIPPED = np.array([[0, 0.1, 0.4, 0.6, 0.7, 0.8, 0.9, 0.9, 0.3, 0.9, 0.9, 0.9]], np.float32).T
CORNERS: dict[str, tuple[np.ndarray, np.ndarray]] = {
    "no query on the map": (RANDOM, np.full(9, -1)),
    "nothing correct": (1 - np.eye(12, dtype=np.float32), (np.arange(12) + 6) % 12),
    "nothing trusted": (np.tile(DIPPED, (1, 9)), np.arange(9)),
    "all distances equal": (np.ones((12, 9), np.float32), np.arange(9)),
    "one query, and no sequence": (RANDOM[:, :1], np.array([4])),
    "everything ignored": (RANDOM, np.full((12, 9), -1)),
    "two places": (RANDOM[:2], np.arange(9) % 2),
}


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@pytest.mark.usefixtures("light_only")
@pytest.mark.parametrize("name", CORNERS)
def test_at_a_corner_the_report_holds_no_nan(name: str, tmp_path: Path) -> None:
    page = written(tmp_path / "report", *CORNERS[name])
    if name == "one query, and no sequence":
        assert "no query was judged" in page.text
        assert "1 query on a map of 12 places; 1 of them has a true place." in page.text
        assert "12 places by 1 query, float32" in page.text
        assert "1 queries" not in page.text
    if name == "nothing correct":
        assert page.ids["area"] == "0.000"
        assert page.ids["trusted-right"] == "0.0 %"
    if name == "nothing trusted":
        assert page.ids["trusted"] == "0.0 %"


@pytest.mark.usefixtures("undrawn")
def test_an_older_report_in_the_folder_leaves_nothing_that_looks_new(tmp_path: Path) -> None:
    for name in ("mistakes.png", "precision_recall_2.png", "mine.png"):
        (tmp_path / name).write_bytes(b"old")
    written(tmp_path, RANDOM, np.arange(9))
    assert {file.name for file in tmp_path.glob("*.png")} == {
        n for n in FILES if n.endswith(".png")
    } | {"mine.png"}


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("where", ["curves", "strip"])
def test_a_report_that_was_stopped_leaves_the_older_one_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str
) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    (tmp_path / "precision_recall_mine.png").write_bytes(b"mine")
    written(tmp_path, RANDOM, np.arange(9))
    before = contents(tmp_path)
    monkeypatch.setattr(figures, where, stop)
    with pytest.raises(KeyboardInterrupt):
        written(tmp_path, RANDOM, np.arange(9) % 3)
    assert contents(tmp_path) == before
    assert before["precision_recall_mine.png"] == b"mine"


@pytest.mark.usefixtures("undrawn")
def test_a_report_stopped_while_its_files_are_replaced_is_refused_until_it_is_made_again(
    tmp_path: Path,
) -> None:
    """Beside other files they are replaced one by one (``tests/stopped`` stops that)."""
    (tmp_path / "mine.txt").write_bytes(b"mine")
    written(tmp_path, RANDOM, np.arange(9))
    assert len(read_report(tmp_path)) == 4
    (tmp_path / REPLACING).touch()
    with pytest.raises(SurefixValueError, match="stopped while its files were replaced"):
        read_report(tmp_path)
    written(tmp_path, RANDOM, np.arange(9))
    assert len(read_report(tmp_path)) == 4
    assert (tmp_path / "mine.txt").read_bytes() == b"mine"


def comparison(seed: int, weighted: float) -> Study:
    """A drive on which the weighted sequence has a predictor of such worth."""
    random = np.random.default_rng(seed)
    D = random.random((60, 200)).astype(np.float32)
    truth = np.arange(200) % 60
    D[truth, np.arange(200)] -= weighted
    return compare(D, METHODS, Context(truth=truth))


def test_the_verdict_is_that_of_the_interval() -> None:
    for seed, worth in ((1, 0.05), (2, 0.25), (3, 0.6)):
        given = comparison(seed, worth)
        for result in given.results:
            difference, low, high = result.difference
            words = verdict(result)
            assert (result.outcome == "wins") == (low > 0)
            assert (result.outcome == "loses") == (high < 0)
            assert (result.outcome == "level") == (low <= 0 <= high)
            assert ("wins over" in words) == (low > 0)
            assert ("loses to" in words) == (high < 0)
            if result is not given.baseline:
                assert ("is level with" in words) == (low <= 0 <= high)
            assert difference == result.curve.auc(0.2) - given.baseline.curve.auc(0.2)


def test_the_worst_mistakes_are_wrong_and_none_wrong_has_a_better_score() -> None:
    given = comparison(2, 0.25)
    shown = given.shown
    assert shown.name == "weighted"
    wrong = np.flatnonzero(shown.judged & ~shown.right)
    found = given.mistakes(6)
    assert sorted(shown.matches.score[wrong])[:6] == [shown.matches.score[query] for query in found]
    assert set(found) <= set(wrong.tolist())
    trusted = given.trusted_mistakes(6)
    assert all(given.run.trusted[query] and not given.single_right[query] for query in trusted)


REAL = {
    "NetVLAD": ("corridor/matrices/NetVLAD_similarity_ref_x_query.npy", (0.982, 0.923)),
    "denseVLAD": ("corridor/matrices/denseVLAD_similarity_ref_x_query.npy", None),
}


@pytest.mark.parametrize("name", REAL)
def test_a_real_matrix_of_similarities(name: str) -> None:
    file, areas = REAL[name]
    D = 1 - np.load(real_data() / file)
    given = compare(D, ("sequence", "weighted"), Context(truth=np.arange(D.shape[1])))
    assert len(given.results) == 2
    if areas is not None:
        assert [result.area[0] for result in given.results] == pytest.approx(areas, abs=2e-3)
