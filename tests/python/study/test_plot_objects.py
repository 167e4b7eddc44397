"""``plot`` of runs, alignments, evaluations, audits, trust tables and maps: figures in one line."""

import inspect
import io
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surefix

pytest.importorskip("matplotlib")

import matplotlib
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from PIL import Image

from surefix import SurefixFileError, SurefixValueError, plot
from surefix.plot import objects
from surefix.plot.axes import end_at_tick

matplotlib.use("Agg")

N, M = 60, 50
TRUTH = np.arange(5, 5 + M)
RANDOM = np.random.default_rng(2)
D = RANDOM.random((N, M)).astype(np.float32)
D[TRUTH, np.arange(M)] *= 0.4
RUN = surefix.match_distances(D, motion="steady")
WINDOWED = surefix.match_distances(D, sequence_length=4)
ALIGNMENT = surefix.align(D, motion="steady")
CURVE = surefix.evaluate(WINDOWED, TRUTH)
TRUST = surefix.evaluate_trust(WINDOWED, TRUTH)
AUDIT = surefix.audit([D, D[:, ::-1].copy()], motion="steady")
METRES = np.stack([np.arange(N) * 3.0, np.zeros(N)], axis=1)
MAP = surefix.Map.from_descriptors(
    RANDOM.random((N, 16)).astype(np.float32), positions=METRES, breaks=[20]
)
THINGS: dict[str, Callable[..., Axes]] = {
    "run": RUN.plot,
    "alignment": ALIGNMENT.plot,
    "evaluation": CURVE.plot,
    "trust": TRUST.plot,
    "audit": AUDIT.plot,
    "map": MAP.plot,
}


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    pyplot.close("all")
    yield
    pyplot.close("all")


def labels(ax: Axes) -> list[str]:
    legend = ax.get_legend()
    return [] if legend is None else [text.get_text() for text in legend.get_texts()]


@pytest.mark.parametrize("name", THINGS)
def test_one_line_draws_and_saves(name: str, tmp_path: Path) -> None:
    ax = THINGS[name]()
    figure = ax.figure
    assert isinstance(figure, Figure)
    assert figure.number in pyplot.get_fignums()  # type: ignore[attr-defined]
    figure.savefig(tmp_path / "it.png")
    with Image.open(tmp_path / "it.png") as picture:
        assert len(np.unique(np.asarray(picture.convert("L")))) > 9
    plot.png(ax, tmp_path / "it.png", size=(4, 3))
    with Image.open(tmp_path / "it.png") as picture:
        assert picture.size == (600, 450)
    assert not pyplot.get_fignums()


@pytest.mark.parametrize("name", THINGS)
def test_given_axes_are_drawn_on_and_no_figure_is_made(name: str) -> None:
    ax = Figure().add_subplot()
    assert THINGS[name](ax=ax) is ax
    assert ax.has_data()
    assert not pyplot.get_fignums()


def test_every_figure_of_the_module_can_make_its_own() -> None:
    drawing = [
        one
        for name in plot.__all__
        if inspect.isfunction(one := getattr(plot, name))
        and inspect.signature(one).return_annotation is Axes
    ]
    assert len(drawing) > 14
    for one in drawing:
        assert inspect.signature(one).parameters["ax"].default is None, one
        assert "ax : Axes, optional" in (one.__doc__ or ""), one


def test_a_new_figure_has_the_colours_of_its_theme() -> None:
    ax = RUN.plot(theme=plot.DARK)
    assert to_hex(ax.figure.get_facecolor()) == to_hex(ax.get_facecolor()) == plot.DARK.paper
    assert to_hex(ax.xaxis.label.get_color()) == plot.DARK.ink


def test_a_figure_that_cannot_be_drawn_is_closed() -> None:
    with pytest.raises(SurefixValueError, match="segments"):
        plot.plan(np.zeros((5, 2)), surefix.Segments(6))
    assert not pyplot.get_fignums()


def test_the_run_says_trust_without_a_truth_and_right_or_wrong_with_one() -> None:
    trusted = int(RUN.trusted.sum())
    assert labels(RUN.plot()) == [f"trusted ({trusted})", f"untrusted ({M - trusted})"]
    ax = RUN.plot(TRUTH)
    right = np.abs(RUN.place - TRUTH) <= 1
    assert labels(ax)[0] == f"trusted, right ({int((right & RUN.trusted).sum())})"
    np.testing.assert_array_equal(ax.images[0].get_array(), D)
    drawn = sum(len(np.asarray(marks.get_offsets())) for marks in ax.collections)
    assert drawn == M


def test_a_run_draws_fixes_of_full_windows_and_single_matches_of_all_queries() -> None:
    def drawn(ax: Axes) -> dict[int, int]:
        at = np.concatenate([np.asarray(marks.get_offsets()) for marks in ax.collections])
        return {int(query): int(place) for query, place in at}

    fixes = drawn(WINDOWED.plot(TRUTH))
    assert fixes == {j: int(WINDOWED.place[j]) for j in range(3, M)}
    singles = drawn(WINDOWED.plot(TRUTH, single=True))
    assert singles == {j: int(WINDOWED.single_place[j]) for j in range(M)}


@pytest.mark.parametrize(
    "truth",
    [
        TRUTH,
        TRUTH.astype(float),
        (np.arange(N)[:, None] == TRUTH).astype(np.int8),
        (METRES, METRES[TRUTH]),
    ],
    ids=["places", "floats", "cells", "metres"],
)
def test_every_kind_of_truth_is_judged_as_by_evaluate(truth: Any) -> None:
    tolerance = 3.5 if isinstance(truth, tuple) else 1
    curve = surefix.evaluate(WINDOWED, truth, tolerance)
    ax = WINDOWED.plot(truth, tolerance=tolerance)
    right = [int(name.split("(")[1][:-1]) for name in labels(ax) if ", right" in name]
    assert sum(right) == curve.correct


def test_queries_that_the_truth_ignores_are_not_drawn() -> None:
    truth = TRUTH.astype(float)
    truth[10:30] = np.nan
    ax = RUN.plot(truth)
    assert sum(len(np.asarray(marks.get_offsets())) for marks in ax.collections) == M - 20


def test_a_close_up_has_its_part_of_the_distances_and_the_true_path() -> None:
    ax = RUN.plot(TRUTH, queries=(10, 15), places=(12, 20))
    np.testing.assert_array_equal(ax.images[0].get_array(), D[12:32, 10:25])
    assert list(ax.images[0].get_extent()) == [9.5, 24.5, 11.5, 31.5]
    (path,) = (line for line in ax.lines if len(np.asarray(line.get_xdata())) == M)
    np.testing.assert_array_equal(path.get_ydata(), TRUTH)
    assert to_hex(path.get_color()) == plot.LIGHT.truth
    assert labels(ax)[-1] == "true path"


def test_a_large_matrix_is_drawn_by_the_least_of_its_parts() -> None:
    large = RANDOM.random((objects.PICTURE * 2 + 1, 40)).astype(np.float32)
    part, (queries, places) = objects.part_of(large)
    assert part.shape == (1001, 40)
    assert (queries, places) == ((0, 40), (0, 3003))
    np.testing.assert_array_equal(part[5], large[15:18].min(axis=0))
    assert objects.part_of(large, (3, 4), (7, 9))[0].shape == (9, 4)


def test_the_confidence_is_drawn_if_there_is_one() -> None:
    ax = RUN.plot(TRUTH, kind="confidence")
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), RUN.confidence)
    with pytest.raises(SurefixValueError, match=r"expected a run with motion, .*got Run"):
        WINDOWED.plot(kind="confidence")
    with pytest.raises(SurefixValueError, match='kind: expected "matrix" or "confidence", got'):
        RUN.plot(kind="pie")  # type: ignore[arg-type]


def test_a_truth_of_another_length_is_refused_before_a_figure_is_made() -> None:
    with pytest.raises(SurefixValueError, match="truth: expected 50 values, got 49"):
        RUN.plot(TRUTH[1:])
    assert not pyplot.get_fignums()


@pytest.mark.parametrize("name", THINGS)
@pytest.mark.parametrize("ax", [3, "axes", Figure()], ids=["number", "text", "figure"])
def test_what_is_no_axes_is_refused(name: str, ax: Any) -> None:
    with pytest.raises(SurefixValueError, match="ax: expected matplotlib's Axes, or None, got"):
        THINGS[name](ax=ax)


@pytest.mark.parametrize("part", [(5, 0), (-5, 10), (45, 10), (50, 1), (1.5, 3), 5, (1, 2, 3)])
def test_a_close_up_outside_of_the_drive_is_refused(part: Any) -> None:
    with pytest.raises(SurefixValueError, match=r"queries: .* as \(first, count\) within 50, got"):
        RUN.plot(queries=part)
    with pytest.raises(SurefixValueError, match=r"places: .* within 60, got"):
        RUN.plot(places=(60, 1))


def test_curves_on_one_axis_are_told_apart() -> None:
    ax = CURVE.plot(name="one")
    CURVE.plot(name="two", ax=ax)
    both = plot.precision_recall({"one": CURVE, "two": CURVE})
    looks = [[(line.get_color(), line.get_linewidth()) for line in a.lines] for a in (ax, both)]
    assert looks[0] == looks[1]
    assert len(ax.patches) == len(both.patches) == 1
    assert labels(ax) == labels(both)
    assert labels(CURVE.plot()) == [f"area up to recall 0.2 is {CURVE.auc(0.2):.2f}"]
    np.testing.assert_array_equal(np.asarray(ax.lines[0].get_xdata())[1:], CURVE.recall)


def test_an_audit_draws_each_estimate_with_its_interval() -> None:
    ax = AUDIT.plot()
    names = [label.get_text() for label in ax.get_yticklabels()]
    assert names[0] == "fused: best match is right"
    assert names[2] == "technique 0: best match is right"
    share = AUDIT.recall_at_1
    assert np.asarray(ax.lines[0].get_xdata()).tolist() == [share.low, share.high]
    assert np.asarray(ax.lines[1].get_xdata()).tolist() == [float(share)]


def test_an_estimate_of_nothing_is_said() -> None:
    ax = plot.estimates({"trusted": (np.nan, np.nan, np.nan)})
    assert [text.get_text() for text in ax.texts] == ["none to judge"]


def test_a_map_draws_its_segments_and_fixes_and_needs_positions() -> None:
    ax = MAP.plot(place=RUN.place)
    roads = [line for line in ax.lines if line.get_marker() == "None"]
    assert [len(np.asarray(line.get_xdata())) for line in roads] == [20, 40]
    offsets = np.asarray(ax.collections[0].get_offsets())
    np.testing.assert_array_equal(offsets, METRES[RUN.place])
    bare = surefix.Map.from_descriptors(np.eye(4, dtype=np.float32))
    with pytest.raises(SurefixValueError, match=r"map: expected positions, .*got none"):
        bare.plot()


def test_the_alignment_draws_the_place_of_each_query() -> None:
    ax = ALIGNMENT.plot()
    np.testing.assert_array_equal(ax.images[0].get_array(), D)
    at = np.concatenate([np.asarray(marks.get_offsets()) for marks in ax.collections])
    at = at[np.argsort(at[:, 0])]
    np.testing.assert_array_equal(at[:, 1], ALIGNMENT.place)


def test_an_axis_ends_at_the_tick_just_behind_it() -> None:
    for count, end in ((1000, 1000), (1001, 1000.5), (930, 929.5), (100, 100)):
        ax = Figure().add_subplot()
        end_at_tick(ax.xaxis, -0.5, count - 0.5)
        assert ax.get_xlim() == (-0.5, end)


def test_a_picture_that_cannot_be_written_says_so(tmp_path: Path) -> None:
    with pytest.raises(SurefixFileError, match="cannot write the picture: there is no folder"):
        plot.png(CURVE.plot(), tmp_path / "no" / "it.png")


def test_the_bytes_are_those_of_the_file(tmp_path: Path) -> None:
    drawn = plot.png(lambda ax, theme: ax.plot([0, 1]), tmp_path / "it.png", size=(3, 2))
    assert (tmp_path / "it.png").read_bytes() == drawn
    assert Image.open(io.BytesIO(drawn)).size == (450, 300)


def test_without_matplotlib_a_plot_names_what_to_install(tmp_path: Path) -> None:
    missing = 'raise ModuleNotFoundError("No module named \'matplotlib\'", name="matplotlib")\n'
    (tmp_path / "matplotlib.py").write_text(missing)
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    code = (
        "import numpy as np, surefix\n"
        "run = surefix.match_distances(1 - np.eye(9, dtype=np.float32))\n"
        "assert '<svg' in run._repr_html_()\n"
        "run.plot()\n"
    )
    said = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": path},
        check=False,
    )
    assert said.stderr.splitlines()[-1].endswith("is not installed: pip install 'surefix[plot]'")
