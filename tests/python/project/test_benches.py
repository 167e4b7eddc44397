"""The comparison with rivals: the rival is the method, and the page is the generator's. The soak."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import oracle
import page
from surefix import Matcher
from work import caches, equal, same_best, same_distances, same_fixes, shortage, summary

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "docs" / "performance.md"


def result(seconds: float, *, ours: bool = False, **more: Any) -> dict[str, Any]:
    about = {
        "section": "Distances to fix", "name": "surefix" if ours else "rival", "ours": ours,
        "target": None, "scale": 1, "read": 2e6, "memory": 1e9, "quick": False,
    }  # fmt: skip
    return {"group": "a work", "stats": {"median": seconds}, "extra_info": about | more}


def results(*each: dict[str, Any], missing: tuple[str, ...] = ()) -> dict[str, Any]:
    facts = {"machine": "Maker(R) Processor"}
    return {"benchmarks": list(each), "facts": facts, "skipped": [], "missing": missing}


def rows(ours: float, theirs: float, **more: Any) -> list[page.Row]:
    return page.rows(results(result(theirs, **more), result(ours, ours=True)))


@pytest.mark.parametrize("length", [1, 2, 3, 7])
def test_the_rival_of_a_push_is_the_method(length: int) -> None:
    pytest.importorskip("scipy.signal")
    from rival import ArrayMatcher

    for places in (9, 60, 200):
        rng = np.random.default_rng(places)
        columns = rng.random((60, places), np.float32)
        columns[np.arange(30), (places // 3 + np.arange(30)) % places] *= 0.2
        rival, ours = ArrayMatcher(places, length), Matcher(places, sequence_length=length)
        answers = [rival.push(column) for column in columns]
        assert same_fixes([summary(ours.push(column)) for column in columns], answers) == ""
        options = oracle.Options(sequence_length=length, floor="running")
        run = oracle.match(columns.T, options)
        assert [place for place, _, _ in answers] == list(run.place)
        assert [trusted for _, _, trusted in answers] == list(run.trusted)


def test_answers_that_differ_are_said_to() -> None:
    ours = [(3, 0.5, True)]
    assert same_fixes(ours, [(3, 0.5 + 1e-7, True)]) == ""
    for other in ((4, 0.5, True), (3, 0.5, False), (3, 0.51, True)):
        assert "query 0" in same_fixes(ours, [other])
    assert same_distances(1e-3)([1, 2], [1, 2.001]) == ""
    assert "place 1" in same_distances(1e-3)([1, 2], [1, 2.1])
    assert "2 distances" in same_distances(1e-3)([1, 2], [1])
    assert same_best(1e-3)([3, 1], (1, 1.0)) == ""
    assert "place 1" in same_best(1e-3)([3, 1], (0, 1.0))
    assert equal(7, 8) == "7 is not 8"


def test_a_ratio_is_held_to_its_target_and_quick_sizes_to_none() -> None:
    target = [30, "30 x or better"]
    met, missed = rows(1, 30, target=target), rows(1, 29, target=target)
    assert [met[0].met, missed[0].met, rows(1, 30)[0].met] == [True, False, None]
    assert rows(1, 29, target=target, quick=True)[0].met is None
    assert page.missed(met) == []
    assert page.missed(missed) == ["a work: 29.0 x beside rival; the target is 30 x or better"]
    assert rows(1, 2, scale=10)[0].ratio == 20, "a rival that does a tenth of the work"


def test_slower_is_said_of_rivals_and_not_of_surefix_itself() -> None:
    assert page.slower(rows(2, 1)) == ["a work: rival takes 1.00 s, surefix 2.00 s (0.50 x)"]
    assert page.slower(rows(1, 2)) == []
    assert page.slower(rows(2, 1, name="surefix, L = 2")) == []


def test_the_limit_is_bytes_over_the_memorys_speed() -> None:
    (cells,) = page.limits(results(result(4e-3, ours=True), result(1)))
    assert cells == ("a work", "4.00 ms", "2.00 MB", "1 GB/s", "2.00 ms", "50%")


def test_the_page_names_rivals_that_are_missing() -> None:
    made = page.markdown(results(result(1, ours=True), result(2), missing=("SciPy",)))
    assert "## Rivals that were not installed\n\n- SciPy.\n" in made
    assert "| a work | 1.00 s | rival | 2.00 s | 2.00 x |  |  |" in made


def test_a_part_of_a_page_is_replaced_between_its_marks_and_nothing_else(tmp_path: Path) -> None:
    first, last = (mark.format("Maker") for mark in (page.BEGIN, page.END))
    other = "\n".join(mark.format("Other") for mark in (page.BEGIN, page.END))
    text = f"before\n{first}\nold\n{last}\n{other}\n"
    (tmp_path / "page.md").write_text(text, encoding="utf-8")
    data = results(result(1, ours=True), result(2))
    (tmp_path / "results.json").write_text(json.dumps(data), encoding="utf-8")
    for _ in range(2):
        page.main(str(tmp_path / "results.json"), str(tmp_path / "page.md"))
        text = (tmp_path / "page.md").read_text(encoding="utf-8")
        assert text == f"before\n{first}\n\n{page.markdown(data)}\n{last}\n{other}\n"
    for wrong in ("no marks", f"{last}{first}", text + first):
        with pytest.raises(ValueError, match="expected the lines"):
            page.replaced(wrong, "new", first, last)


@pytest.mark.parametrize("maker", ["AMD", "Intel"])
def test_the_committed_page_has_the_generators_shape(maker: str) -> None:
    begin, end = (mark.format(maker) for mark in (page.BEGIN, page.END))
    part = PAGE.read_text(encoding="utf-8").partition(begin)[2].partition(end)[0]
    made = page.markdown(results(result(1, ours=True), result(2))).replace("Maker", maker)
    headings = [line for line in made.splitlines() if line.startswith(("## ", "### "))]
    assert [line for line in part.splitlines() if line.startswith(("## ", "### "))] == headings
    tables = [table.splitlines() for table in part.split("\n\n") if table.startswith("| work |")]
    heads = [f"| {' | '.join(header)} |" for header in (page.HEADER, page.LIMITS)]
    assert {table[0] for table in tables} == set(heads)
    assert all(row.count("|") == table[0].count("|") for table in tables for row in table)


def test_caches_and_free_memory_are_said_if_the_system_tells_them(tmp_path: Path) -> None:
    known = [(1, "Data", "48K"), (1, "Instruction", "32K"), (2, "Unified", "2048K")]
    for index, facts in enumerate(known):
        folder = tmp_path / f"index{index}"
        folder.mkdir()
        for name, value in zip(("level", "type", "size"), facts, strict=True):
            (folder / name).write_text(f"{value}\n", encoding="ascii")
    assert caches(tmp_path) == "L1 48K, L2 2048K"
    assert caches(tmp_path / "missing") == "unknown"
    assert "GB are free" in shortage(1 << 60)
    assert shortage(1) == ""


@pytest.mark.skipif(sys.platform != "linux", reason="memory in use is read from /proc")
def test_pushes_from_python_are_those_of_a_batch_and_keep_no_memory() -> None:
    soak = [sys.executable, ROOT / "benches" / "python" / "soak.py", "Python", "--pushes", "4000"]
    row = subprocess.run(soak, check=True, stdout=subprocess.PIPE, text=True).stdout
    assert row.startswith("| Python | 4000 |")
    assert row.endswith(" 1000 | \n")
