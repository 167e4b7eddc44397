"""The interactive part of a report: Bokeh's figures, the controls, and the script that joins them.

Bokeh's script lies in the page, so that the page needs no network: 1.3 MB without its widgets and
tables, which the page does not use. (Plotly's smallest bundle has about 1 MB, but draws a cell of a
heat map at a time, and sends numbers as text; Vega does not draw an image of a million cells.)
"""

import json
from collections.abc import Mapping, Sequence
from functools import cache
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np
from bokeh.core.properties import value
from bokeh.embed import json_item
from bokeh.models import (
    ColumnDataSource,
    CustomJSTickFormatter,
    LinearColorMapper,
    PanTool,
    Span,
    WheelZoomTool,
)
from bokeh.plotting import figure
from bokeh.resources import Resources
from numpy.typing import NDArray

from surefix.plot.outcome import Outcome
from surefix.plot.theme import DARK, LIGHT, LOOKS, Theme
from surefix.report.album import Album, fit
from surefix.report.page import Section
from surefix.report.scene import Answers, Scene

__all__ = ["explorer", "scripts"]

# As in the matrix of the still figures: these percentiles are the ends of the tones.
TONES = (0.5, 60)
LEVELS = 255
FONT = "system-ui, sans-serif"
# Before the name of a method: how its curve is drawn.
LINE = '<svg width="26" height="8" aria-hidden="true"><line x2="26" y1="4" y2="4"/></svg> '


def explorer(scene: Scene, *more: str) -> Section:
    """The section of the page: its markup, with the data inside, below some words and ``more``."""
    fit((scene.queries, scene.references))
    figures = {"matrix": _matrix(scene), "strip": _strip(scene), "profile": _profile(scene)}
    if any(each.curve is not None for each in scene.methods):
        figures["curve"] = _curve()
    if scene.positions is not None:
        figures["plan"] = _plan(scene)
    items = [json_item(fig, f"explorer-figure-{name}") for name, fig in figures.items()]
    data = _data(scene) | {"items": items, "figures": list(figures)}
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    # No text in it can end the element.
    text = text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
    html = _markup(scene, figures)
    return Section(
        "Query by query",
        (_words(scene), *more),
        html=f'{html}<script type="application/json" id="explorer-data">{text}</script>\n',
    )


@cache
def scripts() -> str:
    """The elements that run the sections of a page; they come last in its body."""
    own = files("surefix.report").joinpath("explore.js").read_text(encoding="utf-8")
    bokeh = Resources(mode="inline", components=["bokeh"], log_level="error").render_js()
    return f"{bokeh}\n<script>\n{own}</script>\n"


def _words(scene: Scene) -> str:
    (down, across), (rows, columns) = scene.block, scene.picture.shape
    cells = (
        "a cell of the matrix is one distance"
        if down == across == 1
        else f"a cell of the matrix, {rows} by {columns}, is the least of {down} by {across} "
        "distances"
    )
    marks = (
        "Blue is right, orange is wrong; bold is trusted, thin is not; what the threshold refuses "
        "is faint. "
        if scene.judged
        else "Green is trusted, grey is not; what the threshold refuses is faint. "
    )
    return (
        "Point at the matrix or the strip, tap them, or use the arrow keys, to see a query beside "
        f"the place it was matched to. {marks}The stronger a tone, the nearer: {cells}."
    )


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


def _here(fig: Any, name: str, dimension: str) -> None:
    """A line at the chosen query, or at one of its places."""
    fig.add_layout(Span(name=name, dimension=dimension, line_width=1, level="overlay"))


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
    low, high = _range(scene)
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
    _here(fig, "here", "height")
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
    fig.xaxis.visible = False
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
    fig.segment(
        "x0", "y", "x1", "y", source=_source("x0", "x1", "y"), line_width=1, name="middles"
    )
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
    _here(fig, "here", "height")
    return fig


def _profile(scene: Scene) -> Any:
    low, high = _range(scene)
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
        _here(fig, name, "height")
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
    fig.scatter(
        "x", "y", source=_source("x", "y"), size=11, line_width=2, name="point"
    )
    return fig


def _plan(scene: Scene) -> Any:
    fig = _figure("plan", 340, "east (m)", match_aspect=True)
    fig.yaxis.axis_label = "north (m)"
    east, north = _roads(scene)
    fig.line(east, north, line_width=1.2, name="road")
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
    # From where it says it is, to where it was.
    fig.line("x", "y", source=_source("x", "y"), line_width=1.6, line_dash=[4, 3], name="error")
    fig.scatter(
        "x",
        "y",
        source=_source("x", "y", "size", "color"),
        size="size",
        fill_color=None,
        line_color="color",
        line_width=2.2,
        name="ring",
    )
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


def _range(scene: Scene) -> tuple[float, float]:
    low, high = np.percentile(scene.picture, (0, 99.9))
    return float(low), float(high if high > low else low + 1)


def _levels(scene: Scene) -> NDArray[np.uint8]:
    low, high = _range(scene)
    scaled = np.clip((scene.picture - low) * (LEVELS / (high - low)), 0, LEVELS)
    return np.round(scaled).astype(np.uint8)


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


def _data(scene: Scene) -> dict[str, Any]:
    low, high = _range(scene)
    steps = np.abs(np.diff(scene.true_place)) if scene.true_place is not None else np.zeros(1)
    return {
        "queries": len(scene),
        "places": scene.places,
        "rows": scene.picture.shape[0],
        "columns": scene.picture.shape[1],
        "block": scene.block,
        "low": low,
        "step": (high - low) / LEVELS,
        "chosen": scene.chosen,
        "judged": scene.judged,
        "methods": [method.name for method in scene.methods],
        "on": [k < LOOKS for k in range(len(scene.methods))],
        # The line of the truth does not bridge a longer step.
        "jump": 10 + 5 * int(np.median(steps)) if len(steps) else 10,
        "queryNames": _names(scene.query_names),
        "placeNames": _names(scene.place_names),
        "images": [_images(scene.queries), _images(scene.references)],
        "themes": [_theme(theme, len(scene.methods)) for theme in (LIGHT, DARK)],
    }


def _names(names: Sequence[str] | None) -> list[str] | None:
    return None if names is None else [str(name) for name in names]


def _images(album: Album) -> Mapping[str, Any]:
    return {"numbers": album.numbers, "files": album.texts()}


def _theme(theme: Theme, methods: int) -> Mapping[str, Any]:
    """Colours by their meaning, as in every figure, and the lines of the methods."""
    names = ("paper", "ink", "muted", "grid", "trusted", *(each.name.lower() for each in Outcome))
    colours = {name: getattr(theme, name) for name in names}
    shades = theme.distance_map(np.linspace(0, 1, 256), bytes=True)
    return colours | {
        "right": theme.trusted_right,
        "wrong": theme.trusted_wrong,
        "tones": [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue, _ in shades],
        "lines": [_line(theme, k) for k in range(methods)],
    }


def _line(theme: Theme, k: int) -> Mapping[str, Any]:
    """The look of a method's curve: no colour that says right or wrong."""
    hues = theme.ink, theme.fifth, theme.sixth, theme.muted
    dashes: Sequence[Sequence[int]] = ((), (8, 4), (2, 3), (8, 3, 2, 3))
    return {"color": hues[(k + k // 4) % 4], "dash": dashes[k % 4], "width": 1.6}


def _markup(scene: Scene, figures: Mapping[str, Any]) -> str:
    last = len(scene) - 1
    kind = "wrong" if scene.judged else "untrusted"
    labels = {
        "matrix": "Distance matrix, a column a query, a row a place. Arrow keys choose a query, "
        "plus and minus zoom, 0 shows the whole.",
        "strip": "The answers along the drive, a row a method. Arrow keys choose a query.",
        "profile": "Distances from the chosen query to each place.",
        "curve": "Precision and recall of each method, and the threshold's point.",
        "plan": "Plan of the route, with the places of all matches.",
    }
    focus = ("matrix", "strip")
    plots = {
        name: f'<div class="plot" id="explorer-figure-{name}" role="group" aria-label="{labels[name]}"'
        f"{' tabindex=0' if name in focus else ''}></div>"
        for name in figures
    }
    images = "".join(
        f'<figure id="explorer-image-{name}"><img hidden alt=""><span class="none">no image</span>'
        "<figcaption></figcaption></figure>"
        for name in ("query", "match", "true")
    )
    facts = "".join(
        f'<div id="explorer-fact-{name}"><dt>{label}</dt><dd></dd></div>'
        for name, label in (
            ("method", "method"),
            ("score", "score"),
            ("confidence", "confidence"),
            ("off", "belief to be off the map"),
            ("distance", "distance to the match"),
            ("single", "nearest"),
            ("true", "distance to the truth"),
        )
    )
    beside = "".join(
        f"<h3>{title}</h3>\n{plots[name]}\n"
        for name, title in (("curve", "Precision and recall"), ("plan", "Plan of the route"))
        if name in plots
    )
    return f"""<div class="explorer" id="explorer">
<div class="board">
<div class="pair" role="region" aria-label="The chosen query">
<h3><span id="explorer-pair-title">Query</span> <span id="explorer-verdict"></span></h3>
<div class="images">{images}</div>
</div>
<div class="views">
<div class="tools"><span id="explorer-cell"></span>
<button type="button" id="explorer-further" aria-label="Zoom out">\u2212</button>
<button type="button" id="explorer-nearer" aria-label="Zoom in">+</button>
<button type="button" id="explorer-whole">Whole</button></div>
{plots["matrix"]}
{plots["strip"]}
<div class="choose"><label for="explorer-query">Query</label>
<input type="range" id="explorer-query" min="0" max="{last}" value="0">
<button type="button" id="explorer-before">\u2039 {kind}</button>
<button type="button" id="explorer-after">{kind} \u203a</button></div>
</div>
<div class="about"><dl class="facts">{facts}</dl>
<h3>Its distances</h3>
{plots["profile"]}</div>
</div>
<div class="judge">
{_methods(scene)}<div>{beside}</div></div>
</div>
"""


def _methods(scene: Scene) -> str:
    """The table of the methods, with the threshold of the chosen one."""
    heads = ("accepted", "precision", "recall") if scene.judged else ("accepted",)
    numbers = "".join(f'<th scope="col" class="number">{head}</th>' for head in heads)
    rows = "".join(
        "<tr>"
        f'<td><input type="radio" name="method" id="explorer-pick-{k}" aria-label="Show '
        f'{escape(method.name)}"{" checked" if method.name == scene.chosen else ""}></td>'
        f'<th scope="row"><label for="explorer-pick-{k}">'
        f"{'' if method.curve is None else LINE}{escape(method.name)}</label>"
        f"<small>{escape(method.description)}</small></th>"
        + '<td class="number"></td>' * len(heads)
        + f'<td><input type="checkbox" aria-label="Compare {escape(method.name)}"'
        f"{' checked' if k < LOOKS else ''}></td></tr>\n"
        for k, method in enumerate(scene.methods)
    )
    told = (
        (("precision", "precision"), ("recall", "recall"), ("wrong", "wrong accepted"))
        if scene.judged
        else (("confidence", "mean confidence of the accepted"),)
    )
    told = (("score", "threshold"), ("accepted", "accepted"), *told)
    values = "".join(
        f'<div><dt{" id=explorer-by" if name == "score" else ""}>{label}</dt><dd id="explorer-{name}"></dd></div>' for name, label in told
    )
    return f"""<div>
<h3>Methods, and the threshold of the one that is shown</h3>
<input type="range" id="explorer-threshold" min="0" max="1" value="1" aria-label="Threshold">
<div class="ends"><span>strict</span><span>lax</span></div>
<dl class="told">{values}</dl>
<table id="explorer-methods">
<thead><tr><th scope="col">show</th><th scope="col">method</th>{numbers}
<th scope="col">on</th></tr></thead>
<tbody>
{rows}</tbody></table>
</div>
"""
