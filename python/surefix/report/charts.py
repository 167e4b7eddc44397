"""The figures of an interactive report, by Bokeh: the distances, and the data of which the page's
script draws all else.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from bokeh.core.properties import value
from bokeh.models import (
    ColumnDataSource,
    CustomJSTickFormatter,
    LinearColorMapper,
    PanTool,
    WheelZoomTool,
)
from bokeh.models.annotations import Span
from bokeh.plotting import figure
from numpy.typing import NDArray

from surefix.report.scene import Answers, Scene

__all__ = ["LEVELS", "figures", "span"]

# As in the matrix of the still figures: these percentiles are the ends of the tones.
TONES = (0.5, 60)
# The steps of a tone: a distance takes a byte.
LEVELS = 255
# With more segments, their lines would hide the rest.
LINES = 50
FONT = "system-ui, sans-serif"


def figures(scene: Scene) -> Mapping[str, Any]:
    """Every figure of a scene, by its name."""
    drawn = {"matrix": _matrix(scene), "strip": _strip(scene), "profile": _profile(scene)}
    if any(each.curve is not None for each in scene.methods):
        drawn["curve"] = _curve()
    if scene.positions is not None:
        drawn["plan"] = _plan(scene)
    return drawn


def _left(scene: Scene) -> int:
    """The space left of the axes of figures that lie below each other, in pixels."""
    return 36 + 8 * len(str(scene.places))


def _figure(name: str, height: int, label: str = "", left: int = 46, **options: Any) -> Any:
    """An empty figure without toolbar; the wheel zooms if Ctrl is held, so that a page scrolls."""
    wheel = WheelZoomTool(modifiers="ctrl")
    fig = figure(
        name=name,
        height=height,
        sizing_mode="stretch_width",
        toolbar_location=None,
        tools=[PanTool(), wheel],
        active_scroll=wheel,
        min_border_left=left,
        min_border_right=8,
        min_border_top=6,
        background_fill_color=None,
        border_fill_color=None,
        outline_line_color=None,
        x_axis_label=label,
        **options,
    )
    for axis in fig.axis:
        axis.update(
            axis_label_text_font_style="normal",
            axis_label_text_font=FONT,
            major_label_text_font=FONT,
            axis_label_text_font_size="12px",
            major_label_text_font_size="12px",
            axis_label_standoff=4,
            minor_tick_line_color=None,
            major_tick_in=0,
            major_tick_out=4,
        )
    fig.grid.grid_line_color = None
    return fig


def _source(*columns: str) -> ColumnDataSource:
    return ColumnDataSource({name: [] for name in columns})


def _here(fig: Any, name: str) -> None:
    """A line at the chosen query, or at one of its places."""
    fig.add_layout(Span(name=name, dimension="height", line_width=1, level="overlay"))


def _marks(fig: Any) -> None:
    """A mark for each match of the method that is shown."""
    marks = _source("x", "y", "color", "fill", "alpha", "size", "marker")
    fig.scatter(
        "x",
        "y",
        source=marks,
        marker="marker",
        size="size",
        line_color="color",
        fill_color="fill",
        alpha="alpha",
        line_width=1.3,
        name="marks",
    )


def _ring(fig: Any) -> None:
    """Rings around the chosen query's match, and its true place."""
    ring = _source("x", "y", "size", "color")
    fig.scatter(
        "x",
        "y",
        source=ring,
        size="size",
        fill_color=None,
        line_color="color",
        line_width=2.2,
        name="ring",
    )


def _matrix(scene: Scene) -> Any:
    rows, columns = scene.picture.shape
    (down, across), m = scene.block, len(scene)
    fig = _figure(
        "matrix",
        440,
        left=_left(scene),
        x_range=(-0.5, m - 0.5),
        y_range=(-0.5, scene.places - 0.5),
        y_axis_label="place",
    )
    low, high = span(scene)
    near, far = np.percentile(scene.picture, TONES)
    scaled = (LEVELS / (high - low)) * (np.array([near, far]) - low)
    # The script gives the colours of the theme.
    ends = float(scaled[0]), float(max(scaled[1], scaled[0] + 1))
    tones = LinearColorMapper(palette=["#000000"], low=ends[0], high=ends[1])
    fig.image(
        image=[_levels(scene)],
        x=-0.5,
        y=-0.5,
        dw=columns * across,
        dh=rows * down,
        color_mapper=tones,
        name="tones",
    )
    if scene.true_place is not None:
        fig.line("x", "y", source=_source("x", "y"), name="truth", line_width=1, line_alpha=0.6)
    starts = [] if scene.segments is None else [each.start - 0.5 for each in scene.segments][1:]
    if 0 < len(starts) <= LINES:
        fig.hspan(y=starts, line_width=0.6, name="breaks")
    _marks(fig)
    _here(fig, "here")
    _ring(fig)
    fig.xaxis.visible = False
    fig.yaxis.ticker.min_interval = 1
    fig.min_border_bottom = 4
    fig.tags = _vectors(scene)
    return fig


def _strip(scene: Scene) -> Any:
    whole = (-0.5, len(scene) - 0.5)
    fig = _figure("strip", 200, "query", _left(scene), x_range=whole, y_range=(0, 1))
    bars = _source("left", "right", "bottom", "top", "color", "alpha")
    fig.quad(
        left="left",
        right="right",
        bottom="bottom",
        top="top",
        fill_color="color",
        fill_alpha="alpha",
        line_color=None,
        source=bars,
        name="bars",
    )
    fig.segment("x0", "y", "x1", "y", source=_source("x0", "x1", "y"), line_width=1, name="middles")
    fig.text(
        "x",
        "y",
        "text",
        source=_source("x", "y", "text"),
        text_font=value(FONT),
        text_font_size="12px",
        text_baseline="middle",
        name="names",
    )
    fig.yaxis.visible = False
    fig.xaxis.ticker.min_interval = 1
    _here(fig, "here")
    return fig


def _profile(scene: Scene) -> Any:
    low, high = span(scene)
    fig = _figure(
        "profile",
        170,
        "place",
        x_range=(-0.5, scene.places - 0.5),
        y_range=(low - 0.04 * (high - low), high + 0.04 * (high - low)),
        y_axis_label="distance",
    )
    fig.line("x", "y", source=_source("x", "y"), line_width=1, name="distances")
    for name in ("match", "true"):
        _here(fig, name)
    fig.xaxis.ticker.min_interval = 1
    fig.yaxis.ticker.desired_num_ticks = 4
    return fig


def _curve() -> Any:
    fig = _figure("curve", 300, "recall", x_range=(-0.02, 1.02), y_range=(-0.02, 1.04))
    fig.yaxis.axis_label = "precision"
    fig.multi_line(
        "xs",
        "ys",
        source=_source("xs", "ys", "color", "dash", "width"),
        line_color="color",
        line_width="width",
        line_dash="dash",
        name="curves",
    )
    fig.scatter("x", "y", source=_source("x", "y"), size=11, line_width=2, name="point")
    return fig


def _plan(scene: Scene) -> Any:
    fig = _figure("plan", 340, "east (m)", match_aspect=True)
    fig.yaxis.axis_label = "north (m)"
    east, north = _roads(scene)
    fig.line(east, north, line_width=1.2, name="road")
    _marks(fig)
    # From where it says it is, to where it was.
    fig.line("x", "y", source=_source("x", "y"), line_width=1.6, line_dash=[4, 3], name="error")
    _ring(fig)
    whole = CustomJSTickFormatter(code="return Math.round(tick).toString().replace('-', '\\u2212')")
    for axis in fig.axis:
        axis.formatter, axis.ticker.desired_num_ticks = whole, 4
    return fig


def _roads(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The places in order, with a gap between segments."""
    assert scene.positions is not None
    if scene.segments is None:
        return scene.positions[:, 0], scene.positions[:, 1]
    parts = []
    for segment in scene.segments:
        rows = [*range(segment.start, segment.end), *([segment.start] if segment.closed else [])]
        parts += [scene.positions[rows], np.full((1, 2), np.nan)]
    joined = np.concatenate(parts)
    return joined[:, 0], joined[:, 1]


def span(scene: Scene) -> tuple[float, float]:
    """The distances of the first level and of the last."""
    low, high = np.percentile(scene.picture, (0, 99.9))
    return float(low), float(high if high > low else low + 1)


def _levels(scene: Scene) -> NDArray[np.uint8]:
    low, high = span(scene)
    scaled = np.clip((scene.picture - low) * (LEVELS / (high - low)), 0, LEVELS)
    return np.asarray(np.round(scaled), np.uint8)


def _vectors(scene: Scene) -> list[ColumnDataSource]:
    """What belongs to each query and to each place, and of each method its answers and its curve:
    as Bokeh keeps arrays, binary and packed.
    """
    here, there = scene.query_positions, scene.positions
    every = _columns(
        trusted=(scene.trusted, np.uint8),
        single_place=(scene.single_place, np.int32),
        single_distance=(scene.single_distance, np.float32),
        single_right=(scene.single_right, np.uint8),
        true_place=(scene.true_place, np.int32),
        true_distance=(scene.true_distance, np.float32),
        off_map=(scene.off_map, np.uint8),
        query_east=(None if here is None else here[:, 0], np.float32),
        query_north=(None if here is None else here[:, 1], np.float32),
    )
    places = _columns(
        east=(None if there is None else there[:, 0], np.float32),
        north=(None if there is None else there[:, 1], np.float32),
    )
    return [every, places, *(each for method in scene.methods for each in _answers(method))]


def _answers(method: Answers) -> tuple[ColumnDataSource, ColumnDataSource]:
    flags = method.ready, method.accepted, method.judged, method.right
    state = sum(
        np.asarray(flag, np.uint8) << bit for bit, flag in enumerate(flags) if flag is not None
    )
    own = _columns(
        place=(method.place, np.int32),
        score=(method.score, np.float32),
        state=(state, np.uint8),
        confidence=(method.confidence, np.float32),
        off_map=(method.off_map, np.float32),
        distance=(method.distance, np.float32),
    )
    curve = method.curve
    if curve is None:
        return own, _columns()
    return own, _columns(
        thresholds=(curve.thresholds, np.float32),
        recall=(curve.recall, np.float64),
        precision=(curve.precision, np.float64),
    )


def _columns(**given: tuple[Any, Any]) -> ColumnDataSource:
    arrays = {
        name: np.ascontiguousarray(values, dtype)
        for name, (values, dtype) in given.items()
        if values is not None
    }
    return ColumnDataSource(arrays)
