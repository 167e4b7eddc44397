"""The pages of ``surefix run --report``, and ``--open``."""

import json
import os
import re
import webbrowser
from pathlib import Path

import numpy as np
import pytest

import surefix
from surefix.simulate import Route

pytest.importorskip("matplotlib")
pytest.importorskip("bokeh")

from commands import surefix_, surefix_process
from html_reader import read
from surefix.cli.pages import title_of

PLACES = 30


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drives")
    route = Route(places=PLACES, size=(64, 32), seed=2)
    reference, revisit = route.reference(), route.revisit()
    for name, drive in (("summer", reference), ("winter", revisit)):
        np.save(folder / f"{name}.npy", np.stack([drive[index] for index in range(PLACES)]))
    where = np.c_[reference.positions, reference.positions]
    for name, more in (("route", {}), ("placed", {"positions": where, "thumbnails": True})):
        surefix.Map.from_images(reference, surefix.Sad(), **more).save(
            folder / f"{name}.safetensors"
        )
    return folder


def data(page: Path) -> dict[str, object]:
    text = page.read_text(encoding="utf-8")
    found = re.search(r'<script type="application/json" id="explorer-data">(.*?)</script>', text)
    assert found is not None
    return dict(json.loads(found[1]))


def test_a_run_has_its_page_and_the_fixes_are_the_same(
    drives: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(drives)
    how = ("run", "route.safetensors", "winter.npy")
    page, fixes, plain = tmp_path / "run.html", tmp_path / "fixes.csv", tmp_path / "plain.csv"
    said = surefix_(*how, "--references", "summer.npy", "--report", page, "-o", fixes)
    assert f"Made {page}" in said.stderr.splitlines()
    surefix_(*how, "-o", plain)
    rows = [file.read_text().splitlines() for file in (fixes, plain)]
    at = rows[0][0].split(",").index("latency_us")
    same = [[line.split(",")[:at] + line.split(",")[at + 1 :] for line in each] for each in rows]
    assert same[0] == same[1]
    reader = read(page.read_text(encoding="utf-8"))
    assert "winter.npy on route.safetensors" in reader.text
    assert "surefix run route.safetensors winter.npy --references" in reader.text
    shown = data(page)
    assert (shown["queries"], shown["places"], shown["judged"]) == (PLACES, PLACES, False)
    assert shown["methods"] == ["track", "sequence", "single"]
    assert "plan" not in shown["figures"]
    queries, places = shown["images"]
    assert queries["numbers"] == list(range(PLACES))
    assert len(places["files"]) == len(places["numbers"]) > 0
    trusted = sum(
        line.split(",")[rows[0][0].split(",").index("trusted")] == "true" for line in rows[0]
    )
    assert reader.ids["trusted"] == f"{100 * trusted / PLACES:.1f} %"


def test_a_map_with_positions_and_thumbnails_has_a_plan_and_the_places(
    drives: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(drives)
    page = tmp_path / "run.html"
    surefix_("run", "placed.safetensors", "winter.npy", "--motion", "none", "--report", page)
    shown = data(page)
    assert "plan" in shown["figures"]
    assert shown["methods"] == ["sequence", "single"]
    assert shown["images"][1]["files"]


@pytest.mark.parametrize(
    ("name", "code", "words"),
    [
        ("page.pdf", 2, "expected a name that ends in .html"),
        ("no/page.html", 1, "a folder that exists"),
    ],
)
def test_a_page_that_cannot_be_is_refused_before_the_run(
    drives: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, code: int, words: str
) -> None:
    monkeypatch.chdir(drives)
    kept = tmp_path / "fixes.csv"
    kept.write_text("old")
    how = ("run", "route.safetensors", "winter.npy", "--report", tmp_path / name, "-o", kept)
    assert words in " ".join(surefix_(*how, code=code).stderr.replace("│", " ").split())
    assert kept.read_text() == "old"


@pytest.mark.parametrize("there", [True, False])
def test_open_opens_the_page_and_without_a_browser_says_where_it_is(
    drives: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: bool
) -> None:
    monkeypatch.chdir(drives)
    opened: list[str] = []

    def browse(url: str) -> bool:
        opened.append(url)
        return there

    monkeypatch.setattr(webbrowser, "open", browse)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    said = surefix_("run", "route.safetensors", "winter.npy", "-o", tmp_path / "f.csv", "--open")
    made = next(line for line in said.stderr.splitlines() if line.startswith("Made "))
    page = Path(made.removeprefix("Made "))
    assert page.parent.parent == tmp_path
    assert opened == [page.as_uri()]
    assert (f"--open: no browser is known here; open {page}" in said.stderr) != there


@pytest.mark.slow
def test_without_bokeh_one_line_says_how_to_install_it(drives: Path, tmp_path: Path) -> None:
    missing = 'raise ModuleNotFoundError("No module named \'bokeh\'", name="bokeh")\n'
    (tmp_path / "bokeh.py").write_text(missing)
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    how = ("run", drives / "route.safetensors", drives / "winter.npy")
    said = surefix_process(*how, "--report", tmp_path / "run.html", code=1, PYTHONPATH=path)
    assert 'pip install "surefix[report]"' in said.stderr
    assert said.stderr.splitlines()[0].startswith("surefix: the report takes Bokeh")
    surefix_process(*how, "-o", tmp_path / "fixes.csv", PYTHONPATH=path)


def test_a_title_names_the_drive_and_the_map() -> None:
    assert title_of("tuesday/", "monday.safetensors") == "tuesday on monday.safetensors"
    assert title_of(None, "D.npy") == "D.npy"
    assert title_of("/a/b/c/d.mp4", "m/n") == "c/d.mp4 on m/n"
