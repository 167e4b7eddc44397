"""``surefix align``: a truth for ``surefix eval``."""

from pathlib import Path

import numpy as np
import pytest

import surefix
from commands import surefix_


@pytest.fixture
def distances(tmp_path: Path) -> Path:
    rng = np.random.default_rng(0)
    np.save(tmp_path / "D.npy", (rng.normal(0, 0.3, (50, 50)) - np.eye(50)).astype(np.float32))
    return tmp_path / "D.npy"


def test_its_file_is_the_truth_of_an_eval(distances: Path, tmp_path: Path) -> None:
    truth = tmp_path / "truth.csv"
    done = surefix_("align", distances, "--motion", "steady", "--least", 0.9, "-o", truth)
    alignment = surefix.align(np.load(distances), motion="steady")
    expected = tmp_path / "expected.csv"
    alignment.to_csv(expected, 0.9)
    assert truth.read_text() == expected.read_text()
    sure = int((alignment.confidence >= 0.9).sum())
    assert 0 < sure < 50
    assert f"50 queries, {sure} with a reference of confidence 0.9 or more" in done.stderr
    pytest.importorskip("matplotlib")
    report = ("--truth", truth, "--method", "single", "-o", tmp_path / "report")
    assert "single: area" in surefix_("eval", distances, *report).stdout


def test_a_map_and_its_queries_are_aligned(tmp_path: Path) -> None:
    rows = np.random.default_rng(1).normal(size=(40, 12)).astype(np.float32)
    surefix.Map.from_descriptors(rows).save(tmp_path / "route.safetensors")
    np.save(tmp_path / "queries.npy", rows[3:30] + np.float32(0.1))
    route, queries = tmp_path / "route.safetensors", tmp_path / "queries.npy"
    surefix_("align", route, queries, "-o", tmp_path / "truth.csv")
    table = np.genfromtxt(tmp_path / "truth.csv", delimiter=",", names=True)
    assert np.abs(table["place"] - np.arange(3, 30)).max() <= 1


MISTAKES = {
    "no queries": (["route.safetensors"], 2, "expected images or descriptors, got none"),
    "queries too many": (["D.npy", "photos"], 2, "expected none with distances"),
    "an unknown motion": (["D.npy", "--motion", "fast"], 2, "option `motion`"),
    "no table": (["D.npy", "-o", "truth.txt"], 2, "ends in .csv"),
    "similarities of a map": (["route.safetensors", "q", "--similarity"], 2, "--similarity"),
    "no file": (["none.npy"], 1, "none.npy"),
    "no folder": (["D.npy", "-o", "none/t.csv"], 1, "surefix: none/t.csv: cannot write the CSV"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_gets_one_message(
    name: str, distances: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given, code, words = MISTAKES[name]
    rows = np.eye(4, dtype=np.float32)
    surefix.Map.from_descriptors(rows).save(tmp_path / "route.safetensors")
    monkeypatch.chdir(tmp_path)
    assert words in surefix_("align", *given, code=code).stderr


def test_an_audit_says_its_estimates_in_words(distances: Path) -> None:
    done = surefix_("audit", distances, "--motion", "steady")
    found = surefix.audit(np.load(distances), motion="steady")
    assert f"Single matches right: {found.recall_at_1} of 50 queries" in done.stdout
    assert f"Trusted matches right: {found.trusted_precision} of" in done.stdout
    assert "Do not rely" not in done.stdout
    rng = np.random.default_rng(0)
    np.save(distances, rng.random((50, 50)).astype(np.float32))
    assert "Do not rely on it" in surefix_("audit", distances).stdout
    assert "option `motion`" in surefix_("audit", distances, "--motion", "x", code=2).stderr
