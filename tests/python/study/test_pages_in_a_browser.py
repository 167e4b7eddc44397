"""Pages with contents and tables that sort, in a real browser, wide and narrow, light and dark."""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surefix

pytest.importorskip("matplotlib")

from surefix.plot.theme import LIGHT
from surefix.report import multiples as module
from surefix.report.compare import page_of
from surefix.report.multiples import forest, multiples
from surefix.report.page import Section, Table, page

ROWS = [
    ("corridor, SAD", "0.488 (0.1 to 0.9)", "-0.126"),
    ("<Nordland>", "\u2013", "+0.051"),
    ("Gardens Point", "1,000.5", "+0.3"),
    ("AlexNet", "0.866", "\u2013"),
]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    api = pytest.importorskip("playwright.sync_api")
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        pytest.skip("no Chromium on this machine")
    arguments = ["--no-sandbox"] if os.geteuid() == 0 else []
    with api.sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=program, args=arguments)


@pytest.fixture(scope="module")
def table_page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    table = Table("areas", "Areas", ("case", "area", "difference"), ROWS, sorts=True)
    parts = (Section("The areas & more", ("Words.",), tables=(table,)), Section("The end", ()))
    file = tmp_path_factory.mktemp("page") / "page.html"
    file.write_text(page("Areas", (), (), (), parts, contents=True), encoding="utf-8")
    return file


def column(view: Any, index: int) -> list[str]:
    cells = view.locator(f"#areas tbody tr > :nth-child({index})")
    return [str(text) for text in cells.all_inner_texts()]


@pytest.mark.slow
def test_a_press_on_a_heading_sorts_and_the_next_turns_it_round(
    browser: Any, table_page: Path
) -> None:
    view = browser.new_page()
    errors: list[str] = []
    view.on("pageerror", lambda error: errors.append(str(error)))
    view.goto(table_page.as_uri())
    names = [row[0] for row in ROWS]
    assert column(view, 1) == names
    heading = view.get_by_role("button", name="area")
    heading.click()
    # The largest first, a cell without a number last, and rows stay whole.
    assert column(view, 1) == [names[2], names[3], names[0], names[1]]
    assert column(view, 3) == ["+0.3", "\u2013", "-0.126", "+0.051"]
    assert view.locator("#areas th[aria-sort]").get_attribute("aria-sort") == "descending"
    # By the keyboard.
    heading.press("Enter")
    assert column(view, 1) == [names[0], names[3], names[2], names[1]]
    assert view.locator("#areas th[aria-sort]").get_attribute("aria-sort") == "ascending"
    view.get_by_role("button", name="case").click()
    assert column(view, 1) == ["<Nordland>", "AlexNet", "corridor, SAD", "Gardens Point"]
    assert view.locator("#areas th[aria-sort]").count() == 1
    view.get_by_role("link", name="The areas & more").click()
    assert view.evaluate("document.querySelector(':target h2').textContent") == "The areas & more"
    assert not errors
    view.close()


@pytest.mark.slow
def test_headings_that_sort_stand_above_their_columns_and_are_printed(
    browser: Any, table_page: Path
) -> None:
    view = browser.new_page()
    view.goto(table_page.as_uri())
    heading = view.get_by_role("button", name="area")
    cell = view.locator("#areas tbody tr:first-child > :nth-child(2)")
    start = "x => { const r = document.createRange(); r.selectNodeContents(x); return r.getBoundingClientRect().x }"
    assert abs(heading.evaluate(start) - cell.evaluate(start)) < 1
    view.emulate_media(media="print")
    assert heading.is_visible()


@pytest.mark.slow
def test_without_scripts_the_table_is_as_it_was_written(browser: Any, table_page: Path) -> None:
    context = browser.new_context(java_script_enabled=False)
    view = context.new_page()
    view.goto(table_page.as_uri())
    assert [row[0] for row in ROWS] == column(view, 1)
    assert view.locator("button").count() == 0
    context.close()


@pytest.mark.slow
@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_comparison_fits_and_its_pictures_are_those_of_the_width(
    browser: Any, tmp_path: Path, width: int, scheme: str
) -> None:
    random = np.random.default_rng(0)
    D = random.random((50, 50)).astype(np.float32)
    near = D - 0.4 * np.eye(50, dtype=np.float32)
    runs = {f"L={k}": surefix.match_distances(near, sequence_length=k) for k in (1, 2, 5, 9)}
    file = tmp_path / "page.html"
    comparison = surefix.compare(runs, np.arange(50), samples=50)
    file.write_text(page_of(comparison, "surefix compare " + "a" * 200), encoding="utf-8")
    context = browser.new_context(viewport={"width": width, "height": 800}, color_scheme=scheme)
    view = context.new_page()
    problems: list[str] = []
    view.on("pageerror", lambda error: problems.append(str(error)))
    view.on("console", lambda said: problems.append(said.text))
    view.goto(file.as_uri())
    assert view.evaluate("document.documentElement.scrollWidth") == width
    for image in view.locator("img").all():
        shown = image.evaluate("e => [e.clientWidth, e.naturalWidth, e.parentNode.clientWidth]")
        # Of a phone's picture at 3.9 inches, of the page's at 10.4, at 150 dots an inch.
        assert shown[1] == (585 if width == 390 else 1560)
        assert 0.6 < shown[0] / shown[1] <= 1
        corner = image.evaluate(
            "async e => { await e.decode(); const c = document.createElement('canvas');"
            "const p = c.getContext('2d'); p.drawImage(e, 0, 0); return p.getImageData(1, 1, 1, 1).data[0] }"
        )
        assert (corner > 128) == (scheme == "light")
    assert not problems
    context.close()


def test_a_picture_of_panels_says_which_line_is_which_once(monkeypatch: Any) -> None:
    drawn: list[tuple[int, list[str]]] = []

    def legend(figure: Any, handles: dict[str, Any], columns: int) -> None:
        drawn.append((len([ax for ax in figure.axes if ax.get_visible()]), list(handles)))

    monkeypatch.setattr(module, "_legend", legend)

    def draw(ax: Any, index: int, theme: Any) -> None:
        ax.plot([0, 1], [0, index], label=f"one: area {index}")
        if index:
            ax.plot([0, 1], [1, index], label="two")

    picture = multiples([f"case {k}" for k in range(7)], draw, "alt", x="x", y="y")
    assert picture.narrow is not None
    wide, narrow = picture.light, picture.narrow(LIGHT)
    assert drawn == [(7, ["one", "two"])] * 2
    assert wide != narrow


def test_a_forest_takes_a_value_that_there_is_not() -> None:
    rows = {
        "a": {"plain": (0.5, 0.4, 0.6), "weighted": (None, None, None)},
        "b": {"plain": (3, None, None), "weighted": (1, None, None)},
    }
    picture = forest(rows, "alt", x="x", limits=(0, None), none="never there")
    assert picture.light.startswith(b"\x89PNG")
    assert picture.size[0] == 1560
