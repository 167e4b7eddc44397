"""``surefix.plot``: a figure draws its input, nothing is cut off, and the lines can
be told apart.
"""

import io
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surefix

pytest.importorskip("matplotlib")

from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

from surefix import Segments, SurefixValueError, plot
from surefix.plot.theme import LOOKS, looks
from surefix.study import reliability

M, N = 60, 50


def curve(seed: int, right: float = 0.7) -> surefix.Evaluation:
    random = np.random.default_rng(seed)
    truth = random.integers(0, N, M)
    place = np.where(random.random(M) < right, truth, (truth + 9) % N)
    return surefix.evaluate(surefix.Matches(place, random.random(M)), truth)


CURVES = {f"method {k}": curve(k) for k in range(LOOKS)}
DIAGRAMS = {
    "honest": reliability(np.arange(100) / 100, np.arange(100) % 10 >= 5),
    "never asked": reliability([], []),
}
NEVER = surefix.evaluate(
    surefix.Matches(np.zeros(4, int), np.ones(4), accepted=np.zeros(4, bool)), np.arange(4)
)
TRUST = surefix.evaluate_trust(
    surefix.match_distances(1 - np.eye(9, dtype=np.float32)), np.arange(9)
)
GREY, COLOUR = np.full((20, 40), 90, np.uint8), np.full((30, 30, 3), (200, 10, 10), np.uint8)
EXAMPLES = [
    plot.Example(
        [("query 3", GREY), ("matched to place 4", COLOUR), ("true place 9", None)],
        f"{k} places off",
    )
    for k in range(3)
]


def matrix(ax: Axes, **options: Any) -> Axes:
    D = np.random.default_rng(1).random((N, M)).astype(np.float32)
    run = surefix.match_distances(D)
    truth = np.arange(M) % N
    return plot.distance_matrix(
        D, run.place, run.trusted, plot.is_right(run.place, truth), truth=truth, **options, ax=ax
    )


def strip(ax: Axes, count: int = M, **options: Any) -> Axes:
    right, shown = np.arange(count) % 3 > 0, np.arange(count) % 5 > 0
    return plot.route_strip(
        np.arange(count) * 2.0, [("one", right, shown), ("two", ~right, shown)], **options, ax=ax
    )


def aligned(ax: Axes, **options: Any) -> Axes:
    D = np.random.default_rng(1).random((N, M)).astype(np.float32)
    found = surefix.align(D, motion="free")
    return plot.aligned_track(D, found.place, found.confidence, found.off_map, **options, ax=ax)


W = np.linspace(0, 1, 11)
PLAN = np.stack([np.cos(np.arange(9)), np.sin(np.arange(9))], axis=1)
FIGURES: dict[str, Callable[[Axes, plot.Theme], Axes]] = {
    "aligned_track": lambda ax, t: aligned(ax, theme=t),
    "precision_recall": lambda ax, t: plot.precision_recall(
        CURVES, trusted=(0.3, 0.9), theme=t, ax=ax
    ),
    "precision_recall_of_nothing": lambda ax, t: plot.precision_recall(
        {"never": NEVER}, theme=t, ax=ax
    ),
    "reliability": lambda ax, t: plot.reliability(DIAGRAMS, theme=t, ax=ax),
    "distance_matrix": lambda ax, t: matrix(ax, theme=t),
    "distance_matrix_close": lambda ax, t: matrix(ax, queries=(3, 12), places=(0, 12), theme=t),
    "route_strip": lambda ax, t: strip(ax, gap=(10, 40), theme=t),
    "route_strip_of_one": lambda ax, t: strip(ax, 1, gap=(-0.5, 0.5), theme=t),
    "confidence": lambda ax, t: plot.confidence(
        W, 1 - W, W > 0.3, stretches=[("off the map", range(3))], theme=t, ax=ax
    ),
    "weight_sweep": lambda ax, t: plot.weight_sweep(
        W, {"good": (W, W / 2, W), "poor": 1 - W}, theme=t, ax=ax
    ),
    "ablation": lambda ax, t: plot.ablation(
        range(2, 10), {f"{k}": np.full(8, k / 9) for k in range(8)}, theme=t, ax=ax
    ),
    "false_positives": lambda ax, t: plot.false_positives(
        {"a": 0, "b": 1234, "never": None}, theme=t, ax=ax
    ),
    "false_positives_of_none": lambda ax, t: plot.false_positives({"never": None}, theme=t, ax=ax),
    "execution_time": lambda ax, t: plot.execution_time(
        [10, 100, 1e5], {"all": [1, 5, 4e3]}, theme=t, ax=ax
    ),
    "auc_intervals": lambda ax, t: plot.auc_intervals(
        {"plain": (0.5, 0.2, 0.7), "sure": (1, 1, 1), "none": (0, 0, 0)},
        baseline="plain",
        theme=t,
        ax=ax,
    ),
    "trust_table": lambda ax, t: plot.trust_table(TRUST, theme=t, ax=ax),
    "plan": lambda ax, t: plot.plan(
        PLAN,
        Segments(9, breaks=[5], closed=[0], links=[(4, 5)]),
        place=np.array([0, 4, 8]),
        right=np.array([True, False, True]),
        names=("ring", "road"),
        theme=t,
        ax=ax,
    ),
    "plan_of_one_road": lambda ax, t: plot.plan(PLAN, theme=t, ax=ax),
    "examples": lambda ax, t: plot.examples(EXAMPLES, theme=t, ax=ax),
    "montage": lambda ax, t: plot.montage(
        [plot.Column(o, 3, [plot.Pair(GREY, GREY, "a\nb")] * 2) for o in plot.Outcome],
        rows=2,
        theme=t,
        ax=ax,
    ),
}


@pytest.mark.parametrize("theme", [plot.LIGHT, plot.DARK], ids=["light", "dark"])
@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_returns_its_axis_and_is_not_cut_off(name: str, theme: plot.Theme) -> None:
    drawn: list[tuple[Axes, Axes]] = []

    def draw(ax: Axes, theme: plot.Theme) -> None:
        drawn.append((ax, FIGURES[name](ax, theme)))

    picture = np.asarray(
        Image.open(io.BytesIO(plot.png(draw, size=(6.8, 5.0), theme=theme))).convert("RGB")
    )
    assert drawn[0][0] is drawn[0][1]
    assert picture.shape == (750, 1020, 3)
    paper = np.round(255 * np.array(to_rgb(theme.paper))).astype(np.uint8)
    for side in (picture[:2], picture[-2:], picture[:, :2], picture[:, -2:]):
        assert (side == paper).all()
    assert (picture != paper).any(axis=2).mean() > 0.01


NAMED = [
    name for name in FIGURES if name.split("_of_")[0] not in ("examples", "montage", "trust_table")
]


@pytest.mark.parametrize("name", NAMED)
def test_both_axes_say_what_they_are(name: str) -> None:
    ax = FIGURES[name](Figure().add_subplot(), plot.LIGHT)
    assert ax.get_xlabel()
    rows = [label.get_text() for label in ax.get_yticklabels()]
    assert ax.get_ylabel() or any(rows) or "route_strip" in name


def test_the_curve_drawn_is_the_curve_given() -> None:
    ax = plot.precision_recall(CURVES, ax=Figure().add_subplot())
    assert len(ax.lines) == LOOKS
    for line, (name, given) in zip(ax.lines, CURVES.items(), strict=True):
        x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
        assert x[0] == 0
        assert x[1:].tolist() == given.recall.tolist()
        assert y[1:].tolist() == given.precision.tolist()
        assert str(line.get_label()) == f"{name}: area up to recall 0.2 is {given.auc(0.2):.2f}"


def test_the_diagram_drawn_is_the_diagram_given() -> None:
    ax = plot.reliability(DIAGRAMS, ax=Figure().add_subplot())
    honest = DIAGRAMS["honest"]
    drawn = ax.lines[1].get_xydata()
    np.testing.assert_allclose(drawn, np.c_[honest.said, honest.right])
    assert ax.lines[1].get_label() == f"honest: off by {honest.error:.3f}"
    sizes = ax.collections[0].get_sizes()
    np.testing.assert_allclose(np.corrcoef(sizes, honest.count), 1)


def test_a_curve_that_ends_early_says_so_and_one_of_nothing_keeps_its_name() -> None:
    labels = plot.precision_recall(
        {"never": NEVER}, ax=Figure().add_subplot()
    ).get_legend_handles_labels()[1]
    assert labels == ["never: area up to recall 0.2 is 0.00, it ends at recall 0.00"]


@pytest.mark.parametrize("theme", [plot.LIGHT, plot.DARK], ids=["light", "dark"])
def test_lines_are_told_apart_without_their_colours(theme: plot.Theme) -> None:
    without = {(str(look.dashes), look.mark) for look in looks(theme, LOOKS)}
    assert len(without) == LOOKS
    assert len({look.colour for look in looks(theme, LOOKS)}) == LOOKS
    assert all(contrast(look.colour, theme.paper) > 2 for look in looks(theme, LOOKS))


def contrast(one: str, other: str) -> float:
    """The contrast ratio of the web's accessibility guidelines."""
    light = []
    for colour in (one, other):
        channels = [
            c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(colour)
        ]
        light.append(0.05 + float(np.dot(channels, (0.2126, 0.7152, 0.0722))))
    return max(light) / min(light)


def test_more_lines_than_can_be_told_apart_are_refused() -> None:
    curves = {f"{k}": NEVER for k in range(LOOKS + 1)}
    with pytest.raises(surefix.SurefixError, match="at most 8 in one figure, got 9"):
        plot.precision_recall(curves, ax=Figure().add_subplot())


def test_sweeps_bars_and_intervals_draw_their_numbers() -> None:
    ax = plot.weight_sweep(
        W, {"good": (W**2, W**2 / 2, W), "poor": 1 - W}, ax=Figure().add_subplot()
    )
    assert np.asarray(ax.lines[0].get_ydata()).tolist() == (W**2).tolist()
    assert np.asarray(ax.lines[1].get_ydata()).tolist() == (1 - W).tolist()
    assert len(ax.collections) == 1
    ax = plot.ablation([2, 5], {"a": [0.25, 0.5]}, ax=Figure().add_subplot())
    assert np.asarray(ax.lines[0].get_xydata()).tolist() == [[2, 0.25], [5, 0.5]]
    ax = plot.execution_time([10, 1000], {"a": [1.5, 30]}, ax=Figure().add_subplot())
    assert np.asarray(ax.lines[0].get_xydata()).tolist() == [[10, 1.5], [1000, 30]]
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    ax = plot.false_positives({"a": 3, "b": None}, ax=Figure().add_subplot())
    assert [bar.get_width() for bar in ax.patches] == [3]
    assert [text.get_text() for text in ax.texts] == ["3", "never reaches recall 0.2"]
    ax = plot.auc_intervals({"a": (0.5, 0.25, 0.75)}, ax=Figure().add_subplot())
    assert np.asarray(ax.lines[0].get_xdata()).tolist() == [0.25, 0.75]
    assert np.asarray(ax.lines[1].get_xdata()).tolist() == [0.5]


def test_the_trust_table_has_the_four_counts() -> None:
    texts = [text.get_text() for text in plot.trust_table(TRUST, ax=Figure().add_subplot()).texts]
    counts = (
        TRUST.true_positives,
        TRUST.false_positives,
        TRUST.false_negatives,
        TRUST.true_negatives,
    )
    assert texts[::2] == [str(count) for count in counts]


def test_the_matrix_leaves_out_what_was_not_judged() -> None:
    judged = np.arange(M) < 7
    ax = matrix(Figure().add_subplot(), judged=judged)
    assert sum(len(np.asarray(marks.get_offsets())) for marks in ax.collections) == 7


def test_a_picture_keeps_its_tones_and_proportions() -> None:
    ax = plot.examples(EXAMPLES[:1], across=1, ax=Figure().add_subplot())
    extents = [image.get_extent() for image in ax.images]
    assert [(x1 - x0) / (y1 - y0) for x0, x1, y0, y1 in extents] == pytest.approx([2.0, 1.0])
    assert ax.images[0].get_clim() == (0, 255)


def test_without_matplotlib_one_line_says_how_to_install_it(tmp_path: Path) -> None:
    missing = 'raise ModuleNotFoundError("No module named \'matplotlib\'", name="matplotlib")\n'
    (tmp_path / "matplotlib.py").write_text(missing)
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    for module in ("surefix.plot", "surefix.report"):
        said = subprocess.run(
            [sys.executable, "-c", f"import {module}"],
            capture_output=True,
            text=True,
            env=os.environ | {"PYTHONPATH": path},
            check=False,
        )
        assert said.stderr.splitlines()[-1].endswith(
            "is not installed: pip install 'surefix[plot]'"
        )


def test_a_plan_of_another_number_of_places_is_refused() -> None:
    with pytest.raises(SurefixValueError, match="segments: expected those of 5 places, got 6"):
        plot.plan(np.zeros((5, 2)), Segments(6))
