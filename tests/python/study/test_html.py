"""Objects as HTML: well-formed, with the numbers that they have, and short."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

import surefix
from surefix import simulate
from surefix._colours import DARK, LIGHT
from surefix._html import POINTS

ROUTE = simulate.Route(places=40, seed=3)
MAP = surefix.Map.from_images(ROUTE.reference())
DRIVE = ROUTE.revisit()
METRES = np.stack([np.arange(40) * 3.0, np.arange(40) % 7 * 2.0], axis=1)
RUN = surefix.match(MAP, DRIVE)
TRACKED = surefix.match(MAP, DRIVE, motion="any")
TRUTH = DRIVE.truth(ROUTE.reference())
NEVER = surefix.Matches(np.zeros(4, int), np.ones(4), accepted=np.zeros(4, bool))
THINGS = {
    "map": MAP,
    "map with positions": MAP.with_positions(METRES),
    "map of segments": surefix.Map.join([MAP, MAP]),
    "run": RUN,
    "tracked run": TRACKED,
    "run of nothing": surefix.match(MAP, MAP.descriptors[:0]),
    "evaluation": surefix.evaluate(RUN, TRUTH),
    "evaluation of nothing": surefix.evaluate(NEVER, np.arange(4)),
    "alignment": surefix.align(MAP, DRIVE),
    "audit": surefix.audit(MAP, DRIVE),
    "audit of several": surefix.audit([MAP, MAP], DRIVE),
}


def rows(html: str) -> dict[str, str]:
    """The table: name to value."""
    table = ElementTree.fromstring(html).find(".//tbody")
    assert table is not None
    return {row[0].text or "": row[1].text or "" for row in table}


def points(html: str) -> int:
    return len(re.findall(r"h0", html))


@pytest.mark.parametrize("name", THINGS)
def test_it_is_well_formed_and_short(name: str) -> None:
    html = THINGS[name]._repr_html_()  # type: ignore[attr-defined]
    ElementTree.fromstring(html)
    assert len(html) < 25_000
    assert "nan" not in html.lower()
    assert re.findall(r"<(script|style|link|img)", html) == []


def test_the_numbers_are_those_of_the_object() -> None:
    run = rows(RUN._repr_html_())
    trusted = int(RUN.trusted.sum())
    assert run["queries"] == "40"
    assert run["trusted"] == f"{trusted} ({trusted / 40:.1%})"
    assert points(RUN._repr_html_()) == 40
    assert TRACKED.confidence is not None
    sure = int((TRACKED.confidence >= 0.95).sum())
    assert rows(TRACKED._repr_html_())["confidence 0.95 or more"].startswith(f"{sure} (")
    curve = surefix.evaluate(RUN, TRUTH)
    assert rows(curve._repr_html_())["area up to recall 1"] == f"{curve.auc(1.0):.3f}"
    audit = surefix.audit(MAP, DRIVE)
    assert rows(audit._repr_html_())["recall@1"] == str(audit.recall_at_1)
    assert rows(MAP._repr_html_())["places"] == "40"
    placed = MAP.with_positions(METRES)._repr_html_()
    assert rows(placed)["positions"] == "117 m x 12 m"


def test_a_long_run_is_drawn_by_some_of_its_queries() -> None:
    D = np.random.default_rng(0).random((50, 5 * POINTS)).astype(np.float32)
    html = surefix.match_distances(D)._repr_html_()
    assert points(html) == POINTS
    assert rows(html)["queries"] == f"{5 * POINTS:,}"


def test_names_are_escaped() -> None:
    evil = '<img src=x onerror="alert(1)">'
    known = surefix.Map.from_descriptors(
        np.eye(12, dtype=np.float32), recipe={"name": evil, "levels": None}
    )
    html = known._repr_html_()
    assert rows(html)["of"] == evil
    assert "<img" not in html


def test_the_hues_are_seen_on_light_and_on_dark_paper() -> None:
    def light(colour: str) -> float:
        channels = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
        return 0.05 + float(np.dot(linear, (0.2126, 0.7152, 0.0722)))

    used = set()
    for thing in THINGS.values():
        used |= set(re.findall(r"#[0-9a-f]{6}", thing._repr_html_()))  # type: ignore[attr-defined]
    assert used == {LIGHT.right, LIGHT.wrong}
    for colour in used:
        for paper in (LIGHT.paper, DARK.paper, "#111111"):
            one, other = sorted((light(colour), light(paper)))
            assert other / one > 3
