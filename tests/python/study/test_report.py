"""``surefix.report``: pages, outcomes, and drives at the edge."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import surefix
from surefix.simulate import Route, Traverse

pytest.importorskip("matplotlib")
pytest.importorskip("bokeh")

from matplotlib.axes import Axes

from html_reader import Reader, read
from surefix.baselines import Context
from surefix.cli.demo import legs
from surefix.plot import Outcome, outcomes
from surefix.plot.bars import spans
from surefix.plot.curves import precision_recall
from surefix.plot.images import spread
from surefix.plot.outcome import longest_gap
from surefix.report import figures
from surefix.report.demo import write_report
from surefix.report.page import Picture, Section, Tile, page
from surefix.study import Study
from surefix.study.demo import Demo


@pytest.fixture(scope="module")
def drives() -> tuple[Traverse, Traverse]:
    """Frame 7 is the stop's, 11 and 12 are off the map."""
    route = Route(places=20, size=(32, 16))
    return route.reference(), route.revisit(legs=legs(20))


def demo(
    drives: tuple[Traverse, Traverse],
    D: np.ndarray,
    trusted: np.ndarray,
    length: int = 2,
    **fixes: np.ndarray,
) -> Demo:
    """A demo of these distances, with the trust flags of another predictor; ``fixes`` replaces
    parts of what the tracker said.
    """
    truth, D = drives[1].truth(drives[0]), D.astype(np.float32)
    context = Context(
        sequence_length=length,
        floor="running",
        truth=truth,
        trusted=trusted,
        advance=drives[1].odometry() / 3,
    )
    options = context.options | {"motion": "steady"}
    run = surefix.match_distances(D, advance=context.advance, trusted=trusted, **options)
    names = ["place", "score", "trusted", "confidence", "off_map", "single_place", "to_csv"]
    given = SimpleNamespace(**{name: getattr(run, name) for name in names} | fixes)
    return Demo(Study(D, context), given, *drives, 1, np.full(21, 1e-3))


def written(given: Demo, folder: Path) -> Reader:
    return read(write_report(given, folder, "command", []).read_text(encoding="utf-8"))


@pytest.mark.usefixtures("light_only")
@pytest.mark.parametrize("trusted", [False, True])
def test_a_drive_that_trusts_no_fix_or_every_fix_has_its_report_too(
    drives: tuple[Traverse, Traverse], tmp_path: Path, trusted: bool
) -> None:
    places, sad = surefix.Map.from_images(drives[0], surefix.Sad()), surefix.Sad()
    D = np.stack([places.distances(sad.describe(frame)) for frame in drives[1]], axis=1)
    confidence = np.full(21, float(trusted))
    given = demo(drives, D, np.full(21, trusted), confidence=confidence)
    shown = written(given, tmp_path).ids
    assert shown["sure"] == ("100.0 %" if trusted else "0.0 %")
    assert shown["sure-off-map"] == ("2" if trusted else "0")
    assert (shown["trusted-right"] == "none") == (shown["sure-right"] == "none") == (not trusted)


@pytest.mark.usefixtures("undrawn")
def test_one_of_a_kind_is_in_the_singular(
    drives: tuple[Traverse, Traverse], tmp_path: Path
) -> None:
    place = drives[1].truth(drives[0])
    D = np.ones((20, 21))
    D[place, np.arange(21)] = 0
    # Two fixes are wrong, those off the map: one of them is trusted, and one is sure. Of the right
    # ones, all but one each.
    trusted, confidence = np.ones(21, np.bool_), np.ones(21)
    trusted[[12, 15]], confidence[[11, 3]] = False, 0.4
    place[place < 0] = 0
    given = demo(drives, D, trusted, 1, place=place, confidence=confidence)
    text = written(given, tmp_path).text
    assert "is sent to a wrong place 2 times in 21. With it, 2 times; if" in text
    assert "acts on the sure fixes only, 1 time. The price: 1 right fix is held back, and" in text
    assert "stood still for 1 frame, took a detour of 2 frames off the map" in text
    assert "1 frame after the drive left the map, the confidence was below 0.5, and 1 frame" in text
    assert "1 of the 19 trusted fixes of this drive is wrong." in text
    assert "1 of the 2 untrusted ones is right." in text


@pytest.mark.usefixtures("light_only")
@pytest.mark.parametrize("length", [1, 2])
def test_star_and_page_say_which_fixes_they_count(
    drives: tuple[Traverse, Traverse],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    length: int,
) -> None:
    """A trusted fix that is wrong before the first window is full counts on the page, and not for
    the star.
    """
    D = np.ones((20, 21))
    place = drives[1].truth(drives[0])
    trusted = place >= 0
    place[0] += 10
    D[place, np.arange(21)] = 0
    given = demo(drives, D, trusted, length)
    assert not given.study.shown.right[0]
    assert int(given.study.run.ready.sum()) == 22 - length
    labels: list[str] = []

    def drawn(*arguments: Any, **options: Any) -> Axes:
        ax = precision_recall(*arguments, **options)
        labels[:] = ax.get_legend_handles_labels()[1]
        return ax

    monkeypatch.setattr(figures, "precision_recall", drawn)
    text = written(given, tmp_path).text
    star = (
        "the trusted fixes of full windows alone: precision 1.000"
        if length == 2
        else "the trusted fixes alone: "
    )
    assert labels[-1].startswith(star)
    says = (
        "Curves leave out 1 fix at the start, whose window is not full yet: 1 trusted, "
        "1 trusted and wrong."
    )
    assert (says in text) == (length == 2)


def test_what_a_page_is_given_is_text_and_never_markup() -> None:
    evil = '"><script>alert(1)</script>&amp;'
    png = b"\x89PNG\r\n\x1a\n" + b"\0" * 16
    picture = Picture(lambda theme: png, evil, evil)
    text = page(
        evil,
        [evil],
        [picture],
        [Tile(evil, evil, evil, evil)],
        [Section(evil, [evil], {}, [(evil, evil)])],
    )
    reader = read(text)
    assert "script" not in reader.tags
    assert reader.images[0]["alt"] == evil
    assert reader.ids == {evil: evil}


def test_every_fix_has_one_outcome() -> None:
    right, trusted = np.array([1, 1, 0, 0], bool), np.array([1, 0, 1, 0], bool)
    masks = outcomes(right, trusted)
    assert {outcome.value: np.flatnonzero(mask).tolist() for outcome, mask in masks.items()} == {
        "trusted, right": [0],
        "untrusted, right": [1],
        "trusted, wrong": [2],
        "untrusted, wrong": [3],
    }
    assert all(outcome is Outcome.of(outcome.right, outcome.trusted) for outcome in Outcome)


def test_the_longest_gap_is_the_longest_of_all() -> None:
    random = np.random.default_rng(4)
    for _ in range(300):
        fixed = random.random(random.integers(1, 30)) < random.random()
        gap = longest_gap(fixed)
        assert not fixed[gap.start : gap.stop].any()
        words = "".join("x" if one else "." for one in fixed).split("x")
        assert len(gap) == max(map(len, words))


def test_spread_takes_different_queries_of_those_given() -> None:
    for total in range(12):
        for count in range(1, 5):
            queries = np.arange(total) * 7
            taken = spread(queries, count)
            assert len(set(taken)) == min(total, count)
            assert set(taken) <= set(queries.tolist())
            assert taken == sorted(taken)


def test_the_strip_colours_each_query_from_half_way_to_half_way() -> None:
    random = np.random.default_rng(5)
    for _ in range(100):
        edges = np.cumsum(random.random(random.integers(2, 20)))
        mask = random.random(len(edges) - 1) < 0.5
        inside = np.zeros(len(mask), bool)
        for start, length in spans(edges, mask):
            inside |= (edges[:-1] >= start - 1e-9) & (edges[1:] <= start + length + 1e-9)
        assert (inside == mask).all()
