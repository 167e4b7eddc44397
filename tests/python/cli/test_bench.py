"""``surefix bench``: wrong answers are errors, the rival is the method, and the page is the
generator's.
"""

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import oracle
from commands import surefix_
from html_reader import read
from surefix import Matcher, SurefixValueError, _core
from surefix.bench import Contender, Group, Line, Reach, Result, Rivals, Settings, measure
from surefix.bench.document import BEGIN, END, markdown, replace_part
from surefix.bench.facts import caches
from surefix.bench.line import level, times
from surefix.bench.memory import Bandwidth, shortage
from surefix.bench.page import write_folder
from surefix.bench.push import drive
from surefix.bench.step import ArrayMatcher, same_fixes, summary
from surefix.bench.table import HEADER, LIMITS, TITLES, cells, missed, slower, wrong

PAGE = Path(__file__).resolve().parents[3] / "docs" / "performance.md"
QUICK = Settings(quick=True)


def line(*rivals: Contender, answer: Any = 7) -> Line:
    def agrees(ours: Any, theirs: Any) -> str:
        return "" if ours == theirs else f"{ours} is not {theirs}"

    return Line("push", "a work", Contender("surefix", lambda: answer), rivals, agrees, 4096)


def result(ours: float, theirs: float, reach: Reach | None = None, name: str = "rival") -> Result:
    work = line(Contender(name, lambda: 7, reach=reach)).bare()
    return Result(work, {"surefix": ours, name: theirs}, 1e9)


def test_a_rivals_wrong_answer_is_an_error_and_no_victory() -> None:
    found = measure(line(Contender("liar", lambda: 8, reach=times(1))), QUICK, 1e9)
    (row,) = found.rows
    assert row.problem == "7 is not 8"
    assert row.met is None
    assert cells(row)[-1] == "ERROR"
    assert list(wrong([found])) == ["a work, beside liar: 7 is not 8"]


def test_a_rival_that_fails_is_an_error_too_and_the_others_are_still_measured() -> None:
    def fails() -> None:
        raise ZeroDivisionError("of course")

    found = measure(line(Contender("broken", fails), Contender("sound", lambda: 7)), QUICK, 1e9)
    broken, sound = found.rows
    assert "ZeroDivisionError: of course" in broken.problem
    assert sound.problem == ""
    assert sound.theirs > 0


def test_a_contender_with_a_share_of_the_work_or_a_clock_of_its_own() -> None:
    tenth = Contender("tenth", lambda: 7, clock=lambda: 2.0, scale=10)
    clock = Contender("clock", lambda: 7, clock=lambda: 3.0)
    assert [row.theirs for row in measure(line(tenth, clock), QUICK, 1e9).rows] == [20.0, 3.0]


def test_what_is_reached_and_what_is_not() -> None:
    assert [
        row.met for row in (*result(1, 30, times(30)).rows, *result(1, 29, times(30)).rows)
    ] == [True, False]
    assert result(1, 0.98, level()).rows[0].met, "level is within the noise"
    assert not result(1, 0.9, level()).rows[0].met
    assert result(1, 30).rows[0].met is None
    assert list(missed([result(1, 29, times(30))])) == [
        "a work: 29.0 x beside rival, where 30 x or better (30.0 x) is to be reached"
    ]


def test_slower_is_said_of_rivals_and_not_of_surefix_itself() -> None:
    assert len(list(slower([result(2, 1)]))) == 1
    assert not list(slower([result(1, 2)]))
    assert not list(slower([result(2, 1, name="surefix, L = 2")]))


def test_the_limit_is_bytes_over_bandwidth() -> None:
    assert result(1, 1).limit == pytest.approx(4096 / 1e9)


def test_memory_is_read_at_some_speed_by_one_thread_and_by_two() -> None:
    bandwidth = Bandwidth(quick=True)
    for threads in (1, 2):
        assert 1e8 < bandwidth(1 << 20, threads) < 1e13
    assert len(bandwidth.known) == 2
    assert shortage(1 << 60) != ""
    assert shortage(1) == ""


@pytest.mark.parametrize("length", [1, 2, 3, 7])
def test_the_rival_of_a_push_is_the_method(length: int) -> None:
    pytest.importorskip("scipy.signal")
    rivals = Rivals.find()
    for places in (9, 60, 200):
        columns = [
            *drive(places, 30),
            *np.random.default_rng(places).random((30, places), np.float32),
        ]
        rival, ours = (
            ArrayMatcher(rivals["scipy.signal"], places, length),
            Matcher(places, sequence_length=length),
        )
        answers = [rival.push(column) for column in columns]
        assert same_fixes([summary(ours.push(column)) for column in columns], answers) == ""
        run = oracle.match(
            np.stack(columns, axis=1), oracle.Options(sequence_length=length, floor="running")
        )
        assert [place for place, _, _ in answers] == list(run.place)
        assert [trusted for _, _, trusted in answers] == list(run.trusted)


def test_fixes_that_differ_in_place_trust_or_score_differ() -> None:
    ours = [(3, 0.5, True)]
    assert same_fixes(ours, [(3, 0.5 + 1e-7, True)]) == ""
    for other in ((4, 0.5, True), (3, 0.5, False), (3, 0.51, True)):
        assert "query 0" in same_fixes(ours, [other])


@pytest.mark.parametrize("measure_", [_core.bench_latency, _core.bench_image_latency])
def test_every_push_is_timed_and_none_allocates(measure_: Callable[..., Any]) -> None:
    took, allocations = measure_(50, 3, 40)
    assert took.shape == (40,)
    assert took.dtype == np.uint64
    assert (took > 0).all()
    assert allocations == 0


def test_latency_refuses_what_a_matcher_refuses() -> None:
    with pytest.raises(SurefixValueError, match="sequence_length"):
        _core.bench_latency(10, 11, 5)


def test_latency_says_quantiles_and_allocations() -> None:
    for extra in ((), ("--image",)):
        done = surefix_("bench", "latency", "--places", 60, "--pushes", 200, *extra)
        assert done.returncode == 0, done.stderr
        said, *rows = done.stdout.splitlines()
        assert said.startswith("200 pushes of ")
        assert [row.split()[0] for row in rows] == ["p50", "p99", "p99.9", "max", "allocations"]
        assert rows[-1].split()[1] == "0"


@pytest.mark.parametrize(
    "arguments", [("--only", "nothing"), ("--threads", 0), ("latency", "--places", 1)]
)
def test_bad_usage_is_2(arguments: tuple[object, ...]) -> None:
    assert surefix_("bench", *arguments, code=None).returncode == 2


def test_a_map_too_short_for_the_sequence_is_1() -> None:
    done = surefix_("bench", "latency", "--places", 10, "-L", 11, code=None)
    assert done.returncode == 1
    assert done.stderr.startswith("surefix: ")


def test_help_has_an_example() -> None:
    for command in (("bench",), ("bench", "latency")):
        assert "Example: surefix bench" in surefix_(*command, "--help").stdout


def test_one_group_quickly_with_its_folder(tmp_path: Path) -> None:
    done = surefix_(
        "bench", "--quick", "--only", "push", "--only", "image", "--out", tmp_path / "out"
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert "machine: " in done.stdout
    assert "instruction set: " in done.stdout
    assert "Matcher.push, n = 1,800, L = 100" in done.stdout
    assert "u8 SAD" not in done.stdout
    assert "MISSED" not in done.stdout, "quick sizes are held to nothing"
    with (tmp_path / "out" / "bench.csv").open(encoding="utf-8", newline="") as file:
        assert {row["group"] for row in csv.DictReader(file)} == {"push", "image"}
    assert "| surefix |" in (tmp_path / "out" / "bench.md").read_text(encoding="utf-8")


def test_the_page_holds_every_rival_and_every_problem(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    results = [
        result(1e-3, 2e-3, times(3)),
        replace(result(1, 1), problems={"rival": "7 is not 8"}),
    ]
    made = write_folder(
        tmp_path, results, [("machine", "this one")], ["SciPy is not installed"], "surefix bench"
    )
    assert {file.name for file in made} == {"bench.csv", "bench.md", "bench.html", "speed.png"}
    reader = read((tmp_path / "bench.html").read_text(encoding="utf-8"))
    for words in ("7 is not 8", "this one", "SciPy is not installed", "3 x or better"):
        assert words in reader.text


def test_a_part_of_a_page_is_replaced_between_its_marks_and_nothing_else(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n", encoding="utf-8")
    for _ in range(2):
        replace_part(page, "new\n")
        assert page.read_text(encoding="utf-8") == f"before\n{BEGIN}\n\nnew\n\n{END}\nafter\n"
    page.write_text("no marks", encoding="utf-8")
    with pytest.raises(SurefixValueError, match="expected the lines"):
        replace_part(page, "new")
    assert page.read_text(encoding="utf-8") == "no marks"


def test_the_committed_page_has_the_generators_shape() -> None:
    part = PAGE.read_text(encoding="utf-8").partition(BEGIN)[2].partition(END)[0]
    made = markdown([result(1, 2)], [("machine", "this one")], [], None)
    headings = [heading for heading in made.splitlines() if heading.startswith("## ")]
    assert [text for text in part.splitlines() if text.startswith("## ")][
        : len(headings)
    ] == headings
    assert [title for title in TITLES.values() if f"### {title}\n" in part] == list(TITLES.values())
    tables = [table.splitlines() for table in part.split("\n\n") if table.startswith("| work |")]
    heads = ["| " + " | ".join(header) + " |" for header in (HEADER, LIMITS)]
    assert {table[0] for table in tables} == set(heads)
    assert all(row.count("|") == table[0].count("|") for table in tables for row in table)
    assert set(TITLES) == set(Group)


def test_caches_are_named_where_the_system_tells_them(tmp_path: Path) -> None:
    known = [(1, "Data", "48K"), (1, "Instruction", "32K"), (2, "Unified", "2048K")]
    for index, (number, kind, size) in enumerate(known):
        folder = tmp_path / f"index{index}"
        folder.mkdir()
        for name, value in (("level", number), ("type", kind), ("size", size)):
            (folder / name).write_text(f"{value}\n", encoding="ascii")
    assert caches(tmp_path) == "L1 48K, L2 2048K"
    assert caches(tmp_path / "missing") == "not told by the system"
