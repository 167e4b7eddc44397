"""The guard of instruction counts: the changes that it lets pass or stops, and its messages."""

import importlib.util
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

BENCHES = Path(__file__).resolve().parents[3] / "benches"


@pytest.fixture(scope="module")
def guard() -> ModuleType:
    spec = importlib.util.spec_from_file_location("instructions", BENCHES / "instructions.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_a_rise_of_three_percent_fails_and_says_from_what_to_what(guard: ModuleType) -> None:
    verdict = guard.compare({"push": 100_000, "scan": 5_000}, {"push": 103_000, "scan": 5_000})
    assert verdict.failures == ["rose: push: from 100,000 to 103,000 instructions (+3.0%)"]
    assert not verdict.notes


def test_a_rise_of_two_percent_and_a_fall_as_small_pass_in_silence(guard: ModuleType) -> None:
    for now in (102_000, 100_000, 98_000):
        assert guard.compare({"push": 100_000}, {"push": now}) == guard.Verdict([], [])


def test_a_fall_passes_and_is_reported(guard: ModuleType) -> None:
    verdict = guard.compare({"push": 100_000}, {"push": 50_000})
    assert not verdict.failures
    (note,) = verdict.notes
    assert note.startswith("fell: push: from 100,000 to 50,000 instructions (-50.0%)")
    assert "make instructions-accept" in note


def test_a_new_case_and_one_that_is_gone_ask_to_be_accepted(guard: ModuleType) -> None:
    verdict = guard.compare({"old": 7}, {"new": 8})
    assert [failure.split(":")[:2] for failure in verdict.failures] == [
        ["new", " new"],
        ["gone", " old"],
    ]


def test_another_compiler_or_target_is_no_reason_to_fail(guard: ModuleType) -> None:
    made = {"rustc": "1.90.0", "target": "x86_64-unknown-linux-gnu"}
    assert guard.difference(made, dict(made)) == ""
    why = guard.difference(made, made | {"rustc": "1.91.0"})
    assert why == "counted with rustc 1.90.0, here it is 1.91.0"


def test_the_file_comes_back_as_it_was_written(guard: ModuleType, tmp_path: Path) -> None:
    counts = guard.Counts(
        {"rustc": "1.90.0", "target": "here"}, {"avx2: a, 48 x 2051": 12, 'quoted "b"': 3}
    )
    file = tmp_path / "instructions.toml"
    file.write_text(guard.written(counts), encoding="utf-8")
    assert guard.read(file) == counts


def test_the_committed_file_names_its_compiler_and_counts_every_instruction_set_that_is_run(
    guard: ModuleType,
) -> None:
    committed = guard.read(guard.COMMITTED)
    assert set(committed.about) == {"rustc", "target"}
    assert {name.partition(":")[0] for name in committed.cases} == {isa for isa, _ in guard.RUNS}
    assert all(count > 0 for count in committed.cases.values())


def test_without_valgrind_it_is_skipped_in_one_line(tmp_path: Path) -> None:
    command = [sys.executable, str(BENCHES / "instructions.py")]
    done = subprocess.run(
        command, env={"PATH": str(tmp_path)}, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "instructions: skipped: cargo is not installed\n"


def test_an_adversary_may_cost_three_times_the_usual_push_of_its_configuration(
    guard: ModuleType,
) -> None:
    counted = {
        "L = 2; a drive": 100,
        "L = 2; still": 300,
        "L = 9; a drive": 500,
        "L = 9; ties": 900,
    }
    verdict = guard.dear(counted)
    assert not verdict.failures
    assert verdict.notes == ["4 adversaries, the dearest 3.00 times the usual push: L = 2; still"]
    verdict = guard.dear(counted | {"L = 9; ties": 1600})
    assert verdict.failures == ["dear: L = 9; ties: 3.2 times the usual push, 1,600 instructions"]
