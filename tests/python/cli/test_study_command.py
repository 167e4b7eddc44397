"""``surefix study``: the figures are those of ``surefix compare``, each is computed once, and what is
wrong with a study is said with its line.
"""

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from commands import surefix_

pyarrow = pytest.importorskip("pyarrow.parquet", exc_type=ModuleNotFoundError)

N = 30
STUDY = """\
methods = ["sequence", "weighted", "track"]
samples = 50

[[route]]
name = "river"
references = "monday"
queries = "tuesday"
truth = "identity"

[[descriptor]]
name = "sad"

[[descriptor]]
name = "noise"
file = "{route}-noise.npy"

[settings]
sequence_length = [2, 4]
motion = ["none", "free", {kind = "steady", pace = 1.0}]
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder: a study, two drives of images, and distances that say nothing."""
    random = np.random.default_rng(0)
    for day in ("monday", "tuesday"):
        (tmp_path / day).mkdir()
    for k in range(N):
        scene = random.integers(0, 256, (32, 64))
        noise = random.integers(0, 256, scene.shape)
        for day, share in (("monday", 0.0), ("tuesday", 0.85)):
            mixed = ((1 - share) * scene + share * noise).astype(np.uint8)
            Image.fromarray(mixed).save(tmp_path / day / f"{k:03}.png")
    np.save(tmp_path / "river-noise.npy", random.random((N, N)).astype(np.float32))
    (tmp_path / "study.toml").write_text(STUDY)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def table(out: str = "study") -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = pyarrow.read_table(f"{out}/results.parquet").to_pylist()
    return rows


def test_the_figures_are_those_of_compare(folder: Path) -> None:
    done = surefix_("study", "study.toml")
    rows = table()
    # A track has a motion; the others have none, and are evaluated once for all of them.
    assert len(rows) == 2 * 2 * (2 + 2)
    assert done.stdout.endswith("Made study/results.parquet: 16 evaluations\n")
    surefix_("map", "build", "monday", "-o", "sad.safetensors")
    methods = [f"--method={name}" for name in ("sequence", "weighted", "track_free")]
    given = ["sad.safetensors", "river-noise.npy", "--queries=tuesday", "--truth=identity"]
    more = ["--samples=50", "-L", 4]
    found = {}
    for method, name in zip(methods, ("sequence", "weighted", "track"), strict=True):
        said = surefix_("compare", *given, method, *more).stdout
        for line in csv.DictReader(io.StringIO(said)):
            found[line["run"], name, line["figure"]] = line
    compared = 0
    for row in rows:
        name = {"sad": "sad", "noise": "river-noise"}[row["descriptor"]]
        if row["sequence_length"] == 4 and row["motion"] in (None, "free"):
            for figure in ("area", "right", "trusted_recall"):
                own = found[name, row["method"], figure]
                ends = [row[f"{figure}{end}"] for end in ("", "_low", "_high")]
                assert ends == [float(own[end]) for end in ("value", "low", "high")], (row, figure)
                compared += 1
    assert compared == 2 * 3 * 3
    printed = [line.split()[0] for line in done.stdout.splitlines()]
    assert printed == ["descriptor", *["sad"] * 8, *["noise"] * 8, "Made"]


def test_what_is_there_is_not_evaluated_again(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from importlib import import_module

    study = import_module("surefix.cli.study")
    evaluate, done = study.evaluate, []

    def counted(asked: Any, job: Any) -> dict[str, Any]:
        if len(done) == 5:
            raise KeyboardInterrupt
        done.append((job.evaluation.descriptor.name, job.evaluation.method))
        row: dict[str, Any] = evaluate(asked, job)
        return row

    monkeypatch.setattr(study, "evaluate", counted)
    stopped = surefix_("study", "study.toml", "-o", "one", code=130)
    made, *end = stopped.stderr.splitlines()
    assert made.startswith("monday: a map of 30 places, kept in one/ready/")
    assert end == ["5 rows kept: the same command goes on", "surefix: interrupted"]
    assert not Path("one/results.parquet").exists()
    monkeypatch.setattr(study, "evaluate", evaluate)
    surefix_("study", "study.toml", "-o", "two")
    done.append(("", ""))
    monkeypatch.setattr(study, "evaluate", counted)
    surefix_("study", "study.toml", "-o", "one")
    assert len(done) == 6 + 11
    assert table("one") == table("two")
    # Nothing is left to do; another setting and a changed file are.
    surefix_("study", "study.toml", "-o", "one")
    assert len(done) == 17
    longer = STUDY.replace("[2, 4]", "[2, 4, 6]").replace('"river"', '"the river"')
    Path("study.toml").write_text(longer.replace("{route}", "river"))
    surefix_("study", "study.toml", "-o", "one")
    # The file of the distances has another name in the study, so that all of its are new.
    assert len(done) == 17 + 4 + 12
    Image.new("L", (64, 32)).save("tuesday/029.png")
    surefix_("study", "study.toml", "-o", "one")
    assert len(done) == 17 + 4 + 12 + 12
    assert {name for name, _ in done[-12:]} == {"sad"}
    assert len(table("one")) == 24


def test_an_evaluation_that_fails_leaves_the_others(folder: Path) -> None:
    short = np.random.default_rng(1).random((3, 40)).astype(np.float32)
    np.save("short.npy", short)
    text = STUDY.replace("{route}-noise", "short").replace('"identity"', '"truth.npy"')
    np.save("truth.npy", np.arange(N))
    Path("study.toml").write_text(text)
    done = surefix_("study", "study.toml", code=1)
    (_, error) = done.stderr.splitlines()
    first = "the first, river, noise, sequence: "
    assert error.startswith(f"surefix: study.toml: 8 of 16 evaluations failed; {first}")
    rows = table()
    failed = [row for row in rows if row["error"]]
    assert {row["descriptor"] for row in failed} == {"noise"}
    assert all(row["area"] is None for row in failed)
    assert all(row["area"] is not None for row in rows if not row["error"])
    # Mended, it is done without the others.
    np.save("short.npy", np.load("river-noise.npy"))
    surefix_("study", "study.toml")
    assert not any(row["error"] for row in table())


def changed(old: str, new: str) -> str:
    assert old in STUDY
    return STUDY.replace(old, new, 1)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("methods = [", "study.toml: expected TOML: Invalid value (at end of document)"),
        (changed("samples = 50", "sample = 50"), "study.toml, line 2, sample: expected one of route, "
         "descriptor, settings, methods, recall, upto, samples, got 'sample'"),
        (changed("samples = 50", "samples = 5"), "study.toml, line 2, samples: expected 10 to 1000000, got 5"),
        (changed('truth = "identity"', "truth = 3"), "study.toml, line 8, route.truth: expected a string, got 3"),
        (changed('truth = "identity"\n', ""), "study.toml, line 4, route.truth: expected it, or "
         "query_positions, got neither"),
        (changed('"monday"', '"sunday"'), "study.toml, line 6, route.references: expected a file or a "
         "folder, got sunday, which is not there"),
        (changed('references = "monday"\n', ""), "study.toml, line 4, route.references: expected the "
         "images that 'sad' describes, got none"),
        (changed('"noise"', '"sad"'), "study.toml, line 14, descriptor.name: expected a name each, got "
         "'sad' twice"),
        (changed("[2, 4]", "[2, 0]"), "study.toml, line 18, settings.sequence_length: expected a "
         "whole number from 1 to 10000 (the number of places), got 0"),
        (changed("[2, 4]", "[2, 0.5]"), "study.toml, line 18, settings.sequence_length: expected a whole "
         "number, got 0.5"),
        (changed("pace = 1.0", "pase = 1.0"), "study.toml, line 19, settings.motion: expected options of "
         "surefix.Motion, got {'kind': 'steady', 'pase': 1.0}"),
        (changed('"track"]', '"tracks"]'), "study.toml, line 1, methods: expected some of single, "),
        (changed('"track"]', '"fused"]'), "study.toml, line 1, methods: expected methods that need the "
         "distances alone, got 'fused'"),
        (changed("[settings]", "[setting]"), "study.toml, line 17, setting: expected one of route, "),
        ("", "study.toml, route: expected tables [[route]], at least one, got none"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_with_its_line(folder: Path, text: str, said: str) -> None:
    Path("study.toml").write_text(text)
    done = surefix_("study", "study.toml", code=1)
    assert done.stderr.startswith(f"surefix: {said}")
    assert done.stderr.count("\n") == 1
    assert not Path("study").exists()


def test_other_files_are_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert surefix_("study", "none.toml", code=1).stderr == (
        "surefix: none.toml: cannot read the study: No such file or directory\n"
    )
    Path("study/rows").mkdir(parents=True)
    Path("study/rows/a.parquet").write_bytes(b"PAR1 of something else")
    done = surefix_("study", "study.toml", code=1)
    assert done.stderr.startswith("surefix: study/rows/a.parquet: expected rows of a study, got ")
    monkeypatch.setitem(__import__("sys").modules, "pyarrow.parquet", None)
    done = surefix_("study", "study.toml", "-o", "other", code=1)
    assert 'pip install "surefix[study]"' in done.stderr
