"""The interactive report, in a real browser: what one touches is what is shown, and its numbers are
those of the curves.
"""

import base64
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surefix
from surefix._words import plain
from surefix.baselines import Context
from surefix.study import Study

pytest.importorskip("matplotlib")
pytest.importorskip("bokeh")

from html_reader import read
from surefix.plot.theme import DARK, LIGHT
from surefix.report import album as albums
from surefix.report.album import Album, fit
from surefix.report.explore import explorer, scripts
from surefix.report.page import Section, Table, page
from surefix.report.run import Recorder, write_run
from surefix.report.scene import SIDE, Scene, of_study, thinned

N, M, OFF = 90, 100, range(60, 70)
METHODS = ("sequence", "weighted", "single", "masked", "track_any")
EVIL = '</script><img src=x onerror="window.hurt=1">&amp;\'\u2028'


def images(count: int, hue: int) -> np.ndarray:
    """Images that differ from each other, (count, 24, 48, 3)."""
    drawn = np.zeros((count, 24, 48, 3), np.uint8)
    for k in range(count):
        drawn[k, :, :, hue] = 2 * k
        drawn[k, :, k % 48 :, 1] = 120
    return drawn


def study() -> Study:
    """A drive with ten queries off the map, and distances of which some mislead."""
    random = np.random.default_rng(5)
    truth = np.clip(np.arange(M), 0, N - 1)
    truth[OFF.start : OFF.stop] = -1
    D = random.random((N, M)).astype(np.float32)
    on = np.flatnonzero(truth >= 0)
    D[truth[on], on] -= random.uniform(0, 0.6, len(on)).astype(np.float32)
    angle = np.linspace(0, 4, N)
    where = np.c_[300 * np.cos(angle), 300 * np.sin(angle)]
    return Study(D, Context(truth=truth, positions=where), names=METHODS)


@pytest.fixture(scope="module")
def drive() -> Study:
    return study()


def names() -> list[str]:
    return [EVIL, *(f"{k:03}.jpg" for k in range(1, M))]


@pytest.fixture(scope="module")
def scene(drive: Study) -> Scene:
    given: Any = {"queries": images(M, 0), "references": images(N, 2)}
    return of_study(drive, query_names=names(), place_names=names()[:N], **given)


@pytest.fixture(scope="module")
def file(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    rows = [("a wrong one", "9")]
    table = Table("mistakes", "Mistakes.", ("query", "off by"), rows, shows=[("single", 7)])
    sections = (explorer(scene), Section("Mistakes", (), tables=(table,)))
    text = page(EVIL, (EVIL,), (), (), sections, identity="here", command=EVIL, scripts=scripts())
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    play = pytest.importorskip("playwright.sync_api").sync_playwright
    found = (shutil.which(name) for name in ("chromium", "google-chrome", "chromium-browser"))
    path = next(filter(None, found), None)
    if path is None:
        pytest.skip("no Chromium: looked for chromium, google-chrome, chromium-browser")
    with play() as playwright:
        opened = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield opened
        opened.close()


class Tab:
    """A page in the browser, and what it complained about."""

    def __init__(self, browser: Any, file: Path, width: int = 1280, **how: Any) -> None:
        self.context = browser.new_context(viewport={"width": width, "height": 900}, **how)
        self.page = self.context.new_page()
        self.errors: list[str] = []
        self.asked: list[str] = []
        self.page.on("console", lambda said: said.type != "log" and self.errors.append(said.text))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(file.as_uri())
        self.page.wait_for_selector("#explorer[data-ready]")

    def text(self, name: str) -> str:
        return str(self.page.locator(f"#explorer-{name}").inner_text())

    def query(self) -> int:
        return int(self.text("pair-title").removeprefix("Query "))

    def source(self, name: str) -> str:
        return str(self.page.locator(f"#explorer-image-{name} img").get_attribute("src"))

    def at(self, name: str, query: int, height: float = 0.5) -> tuple[float, float]:
        """The middle of a query's column on the screen."""
        self.page.locator(f"#explorer-figure-{name}").scroll_into_view_if_needed()
        box = self.page.locator(f"#explorer-figure-{name}").bounding_box()
        left = 36 + 8 * len(str(N))
        across = box["width"] - left - 8
        return box["x"] + left + across * (query + 0.5) / M, box["y"] + box["height"] * height

    def slide(self, name: str, value: int) -> None:
        self.page.locator(f"#explorer-{name}").evaluate(
            "(slider, value) => { slider.value = value; slider.dispatchEvent(new Event('input')); }",
            value,
        )

    def fits(self) -> bool:
        return bool(self.page.evaluate("document.documentElement.scrollWidth <= innerWidth"))

    def close(self) -> None:
        assert self.errors == []
        assert all(url.startswith(("file:", "data:", "blob:")) for url in self.asked)
        self.context.close()


@pytest.fixture
def tab(browser: Any, file: Path) -> Iterator[Tab]:
    opened = Tab(browser, file)
    yield opened
    opened.close()


def data_uri(album: Album, number: int) -> str:
    encoded = base64.b64encode(album.files[album.numbers.index(number)]).decode()
    return f"data:image/jpeg;base64,{encoded}"


def shows(tab: Tab, drive: Study, scene: Scene, query: int, method: str = "weighted") -> None:
    """The pair of images of a query, its verdict, and its numbers."""
    result = drive[method]
    place = int(result.matches.place[query])
    assert tab.query() == query
    assert tab.source("query") == data_uri(scene.queries, query)
    assert tab.source("match") == data_uri(scene.references, place)
    right, true = bool(result.right[query]), int(drive.true_place[query])
    assert tab.text("verdict").startswith("right" if right else "wrong")
    shown = tab.page.locator("#explorer-image-true").is_visible()
    assert shown == (not right and true >= 0)
    if shown:
        assert tab.source("true") == data_uri(scene.references, true)
    trusted = "trusted" if drive.run.trusted[query] else "not trusted"
    assert f", {trusted}" in tab.text("verdict")
    score = float(tab.page.locator("#explorer-fact-score dd").inner_text())
    assert score == pytest.approx(float(result.matches.score[query]), rel=1e-3)


@pytest.mark.slow
def test_pointing_at_a_query_shows_its_pair_and_a_tap_pins_it(
    tab: Tab, drive: Study, scene: Scene
) -> None:
    for figure, query in (("matrix", 20), ("strip", 83), ("matrix", 65)):
        tab.page.mouse.move(*tab.at(figure, query))
        shows(tab, drive, scene, query)
    assert tab.text("cell").startswith("query 65, place ")
    tab.page.mouse.click(*tab.at("matrix", 40))
    tab.page.mouse.move(*tab.at("matrix", 41))
    assert tab.query() == 40


@pytest.mark.slow
def test_on_a_phone_a_tap_shows_the_pair_and_a_finger_scrolls(
    browser: Any, file: Path, drive: Study, scene: Scene
) -> None:
    tab = Tab(browser, file, 390, has_touch=True, is_mobile=True)
    tab.page.touchscreen.tap(*tab.at("matrix", 70))
    assert tab.page.locator("#explorer-image-query").is_visible()
    shows(tab, drive, scene, tab.query())
    assert abs(tab.query() - 70) <= 1
    tab.page.touchscreen.tap(*tab.at("strip", 30))
    assert abs(tab.query() - 30) <= 1
    # Bokeh's canvas does not hold the finger back.
    events = (
        "document.querySelector('#explorer-figure-matrix > *')"
        ".shadowRoot.querySelector('.bk-Canvas').shadowRoot.querySelector('.bk-events')"
    )
    assert tab.page.evaluate(f"getComputedStyle({events}).touchAction") == "auto"
    assert tab.fits()
    tab.close()


@pytest.mark.slow
def test_keys_choose_queries_and_zoom(tab: Tab, drive: Study, scene: Scene) -> None:
    tab.page.locator("#explorer-figure-matrix").focus()
    tab.page.keyboard.press("Home")
    assert (tab.query(), tab.text("verdict")) == (0, "no answer yet")
    for key, query in (("ArrowRight", 1), ("Shift+ArrowRight", 11), ("End", M - 1)):
        tab.page.keyboard.press(key)
        shows(tab, drive, scene, query)
    tab.page.keyboard.press("Home")
    wrong = np.flatnonzero(drive["weighted"].judged & ~drive["weighted"].right)
    tab.page.keyboard.press("n")
    shows(tab, drive, scene, int(wrong[wrong > 0][0]))
    tab.page.locator("#explorer-query").focus()
    before = tab.query()
    tab.page.keyboard.press("ArrowRight")
    assert tab.query() == before + 1
    said = tab.page.locator("#explorer-query").get_attribute("aria-valuetext")
    assert said.startswith(f"query {before + 1}")
    width = (
        "Bokeh.documents[0].roots()[0].x_range.end - Bokeh.documents[0].roots()[0].x_range.start"
    )
    whole = tab.page.evaluate(width)
    tab.page.locator("#explorer-nearer").click()
    assert tab.page.evaluate(width) == pytest.approx(whole / 2)
    strip = width.replace("documents[0]", "documents[1]")
    assert tab.page.evaluate(strip) == pytest.approx(whole / 2)
    tab.page.locator("#explorer-whole").click()
    assert tab.page.evaluate(width) == pytest.approx(whole)


@pytest.mark.slow
def test_the_wheel_scrolls_the_page_and_with_ctrl_it_zooms_and_a_drag_moves(tab: Tab) -> None:
    x, y = tab.at("matrix", 50)
    span = "(({start, end}) => [start, end])(Bokeh.documents[0].roots()[0].x_range)"
    whole = tab.page.evaluate(span)
    tab.page.mouse.move(x, y)
    before = tab.page.evaluate("scrollY")
    tab.page.mouse.wheel(0, 60)
    tab.page.wait_for_function(f"scrollY > {before}")
    assert tab.page.evaluate(span) == whole
    x, y = tab.at("matrix", 50)
    tab.page.mouse.move(x, y)
    tab.page.keyboard.down("Control")
    tab.page.mouse.wheel(0, -240)
    tab.page.keyboard.up("Control")
    tab.page.wait_for_function(f"{span}[1] - {span}[0] < {whole[1] - whole[0] - 5}")
    low, high = tab.page.evaluate(span)
    tab.page.mouse.down()
    tab.page.mouse.move(x - 60, y, steps=4)
    tab.page.mouse.up()
    tab.page.wait_for_function(f"{span}[0] > {low}")
    assert tab.page.evaluate(f"{span}[1] - {span}[0]") == pytest.approx(high - low)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["weighted", "masked", "track_any"])
def test_the_slider_gives_the_curve_to_the_last_bit(tab: Tab, drive: Study, method: str) -> None:
    tab.page.locator(f"#explorer-pick-{METHODS.index(method)}").check()
    result = drive[method]
    curve, matches = result.curve, result.matches
    for k in {1, 2, len(curve.thresholds) // 3, len(curve.thresholds) // 2, len(curve.thresholds)}:
        tab.slide("threshold", k)
        exact = [
            float(tab.page.locator(f"#explorer-{name}").get_attribute("data-exact"))
            for name in ("precision", "recall")
        ]
        assert exact == [curve.precision[k - 1], curve.recall[k - 1]]
        taken = matches.ready & matches.accepted & (matches.score <= curve.thresholds[k - 1])
        assert int(tab.text("accepted")) == taken.sum()
        assert int(tab.text("wrong")) == curve.false_positives[k - 1]
        # The marks of the matrix: one a ready match, those that are refused are faint.
        marks = "Bokeh.documents[0].roots()[0].select_one('marks').data_source.data.alpha"
        alphas = np.array(tab.page.evaluate(f"Array.from({marks})"))
        assert (len(alphas), (alphas == 1).sum()) == (matches.ready.sum(), taken.sum())
    tab.slide("threshold", 0)
    assert (tab.text("precision"), tab.text("accepted")) == ("none", "0")


@pytest.mark.slow
def test_methods_are_switched_on_and_off_and_a_row_of_a_table_shows_its_query(
    tab: Tab, drive: Study, scene: Scene
) -> None:
    curves = "Bokeh.documents[3].roots()[0].select_one('curves').data_source.data.xs.length"
    assert tab.page.evaluate(curves) == len(METHODS)
    tab.page.locator("#explorer-methods input[type=checkbox]").nth(0).uncheck()
    assert tab.page.evaluate(curves) == len(METHODS) - 1
    rows = "Bokeh.documents[1].roots()[0].select_one('names').data_source.data.text"
    assert "sequence" not in tab.page.evaluate(rows)
    tab.page.locator("#mistakes button").click()
    shows(tab, drive, scene, 7, "single")


@pytest.mark.slow
def test_the_plan_shows_the_same_query_and_its_error(tab: Tab, drive: Study) -> None:
    result, where = drive["weighted"], np.asarray(drive.context.positions)
    wrong = np.flatnonzero(result.judged & ~result.right & (drive.true_place >= 0))
    query = int(wrong[3])
    tab.slide("query", query)
    plan = "Bokeh.documents[4].roots()[0]"
    for name in ("ring", "error"):
        data = tab.page.evaluate(
            f"(({{x, y}}) => [[...x], [...y]])({plan}.select_one('{name}').data_source.data)"
        )
        ends = where[[result.matches.place[query], drive.true_place[query]]]
        assert pytest.approx(ends, abs=1e-3) == np.array(data).T
    # A query that the tracker believes off the map is a square.
    tab.page.locator(f"#explorer-pick-{METHODS.index('track_any')}").check()
    off = drive["track_any"].matches.off_map
    assert off is not None
    marks = tab.page.evaluate(f"[...{plan}.select_one('marks').data_source.data.marker]")
    assert marks.count("square") == (off.astype(np.float32) >= 0.5).sum()


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_light_and_dark_by_the_system_and_by_the_switch(
    browser: Any, file: Path, scheme: Any
) -> None:
    tab = Tab(browser, file, color_scheme=scheme)
    label = "Bokeh.documents[0].roots()[0].left[0].major_label_text_color"
    ground = "getComputedStyle(document.body).backgroundColor"
    first = DARK if scheme == "dark" else LIGHT
    assert tab.page.evaluate(label) == first.muted
    page_of = {"light": "rgb(243, 245, 247)", "dark": "rgb(14, 18, 22)"}
    assert tab.page.evaluate(ground) == page_of[scheme]
    tab.page.locator("#explorer-theme").click()
    other = "light" if scheme == "dark" else "dark"
    assert tab.page.evaluate(ground) == page_of[other]
    assert tab.page.evaluate(label) == (LIGHT if scheme == "dark" else DARK).muted
    assert tab.fits()
    tab.close()


@pytest.mark.slow
def test_on_paper_it_is_light_and_has_no_controls(tab: Tab) -> None:
    tab.page.locator("#explorer-theme").click()
    assert tab.page.pdf().startswith(b"%PDF")
    assert tab.page.evaluate("document.documentElement.dataset.theme") == "dark"
    tab.page.emulate_media(media="print")
    for name, seen in (("image-query", True), ("figure-matrix", True), ("threshold", False)):
        assert tab.page.locator(f"#explorer-{name}").is_visible() == seen


@pytest.mark.slow
def test_a_name_is_text_and_never_markup(tab: Tab, file: Path) -> None:
    tab.page.locator("#explorer-figure-matrix").focus()
    tab.page.keyboard.press("Home")
    shown = tab.page.locator("#explorer-image-query figcaption span").evaluate("e => e.textContent")
    assert shown == plain(EVIL)
    assert tab.page.evaluate("window.hurt === undefined")
    assert EVIL not in file.read_text(encoding="utf-8")
    read(file.read_text(encoding="utf-8"))


@pytest.mark.slow
def test_a_run_without_truth_says_nothing_of_right_or_wrong(browser: Any, tmp_path: Path) -> None:
    D = study().distances
    run = surefix.match_distances(D, motion="any")
    places = surefix.Map.from_descriptors(np.eye(N, dtype=np.float32))
    path = write_run(run, tmp_path / "run.html", places, D, queries=images(M, 0))
    tab = Tab(browser, path)
    tab.page.mouse.move(*tab.at("matrix", 50))
    assert tab.query() == 50
    assert tab.text("verdict") in ("trusted", "not trusted")
    assert tab.page.locator("#explorer-precision, #explorer-figure-plan").count() == 0
    said = float(tab.page.locator("#explorer-fact-confidence dd").inner_text())
    assert run.confidence is not None
    assert said == pytest.approx(run.confidence[50], abs=6e-4)
    tab.slide("threshold", 40)
    assert int(tab.text("accepted")) == (run.score <= np.unique(run.score)[39]).sum()
    assert not re.search(r"\b(right|wrong)\b", tab.text("methods"))
    tab.close()


def test_a_run_of_one_query_has_whole_numbers_on_axes_that_line_up(
    browser: Any, tmp_path: Path
) -> None:
    D = np.array([[0.1], [0.9]], np.float32)
    places = surefix.Map.from_descriptors(np.eye(2, dtype=np.float32))
    run = surefix.match_distances(D, sequence_length=1)
    tab = Tab(browser, write_run(run, tmp_path / "run.html", places, D))
    code = """Object.fromEntries(Bokeh.index.roots.filter(view => view.frame).map(view =>
        [view.model.name, [view.frame.bbox.left, view.frame.bbox.right]]))"""
    ends = tab.page.evaluate(code)
    assert ends["matrix"] == ends["strip"]
    tab.close()


def test_the_colours_of_words_are_those_of_the_figures() -> None:
    style = (Path(albums.__file__).parent / "page.css").read_text(encoding="utf-8")
    for name in ("right", "wrong"):
        light, *dark = re.findall(rf"--{name}: (#\w+);", style)
        assert (light, {*dark}) == (
            getattr(LIGHT, f"trusted_{name}"),
            {getattr(DARK, f"trusted_{name}")},
        )


@pytest.mark.slow
def test_a_thousand_queries_and_places_have_less_than_10_mb() -> None:
    """Of noise, which JPEG packs worst."""
    random = np.random.default_rng(0)
    side = 1000
    D = random.random((side, side), np.float32)
    noise = random.integers(0, 256, (40, 120, 160, 3), np.uint8)
    given: Any = {number: noise[number % 40] for number in range(side)}
    many = Study(D, Context(truth=np.arange(side)), names=("sequence", "weighted", "single"))
    scene = of_study(many, queries=given, references=given)
    assert len(scene.queries) == side
    text = page("noise", (), (), (), (explorer(scene),), scripts=scripts())
    assert len(text.encode()) < 10_000_000


def test_an_album_keeps_every_second_image_of_a_drive_that_is_too_long(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(albums, "MOST", 10)
    album = Album()
    for number in range(45):
        album.add(number, np.full((4, 8), number, np.uint8))
    assert album.numbers == list(range(0, 45, 8))
    before = sum(map(len, album.files))
    fit([album], before)
    assert sum(map(len, album.files)) == before


def test_the_picture_of_a_large_matrix_is_the_least_of_each_block() -> None:
    D = np.random.default_rng(1).random((2 * SIDE + 5, 7)).astype(np.float32)
    picture, (down, across) = thinned(D)
    assert (down, across) == (3, 1)
    for row in range(len(picture)):
        assert (picture[row] == D[3 * row : 3 * row + 3].min(axis=0)).all()


def test_a_long_run_is_kept_in_bounded_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("surefix.report.run.SIDE", 20)
    D = np.random.default_rng(2).random((6, 333)).astype(np.float32)
    places = surefix.Map.from_descriptors(np.eye(6, dtype=np.float32))
    recorder, matcher = Recorder(places), surefix.Matcher(6)
    for j in range(D.shape[1]):
        recorder.add(matcher.push(D[:, j]), D[:, j], str(j))
        assert len(recorder._columns) <= 41
    scene = recorder.scene()
    across = scene.block[1]
    for column in range(scene.picture.shape[1]):
        block = D[:, column * across : (column + 1) * across]
        assert (scene.picture[:, column] == block.min(axis=1)).all()
    assert len(scene) == 333
