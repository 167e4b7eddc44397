"""The interactive part of a report: Bokeh's figures, the controls, and the script that joins them.

Bokeh's script lies in the page, so that the page needs no network: 1.3 MB without its widgets and
tables, which the page does not use. (Plotly's package has one script, of 4.8 MB; Vega-Lite draws a
rectangle a cell, which a million cells are too many for.) Bokeh also keeps arrays binary.
"""

import json
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

try:
    import bokeh as _bokeh  # noqa: F401
except ModuleNotFoundError as error:
    if error.name != "bokeh":
        raise
    message = "an interactive report takes Bokeh, which is not installed: "
    message += "pip install 'surefix[report]'"
    raise ModuleNotFoundError(message, name=error.name) from None

from bokeh.core.types import ID
from bokeh.embed import json_item
from bokeh.resources import Resources

from surefix._words import escaped, plain
from surefix.plot.outcome import Outcome
from surefix.plot.theme import DARK, LIGHT, LOOKS, Theme
from surefix.report import charts
from surefix.report.album import Album, fit
from surefix.report.page import Section
from surefix.report.scene import Scene

__all__ = ["explorer", "scripts"]

# Before the name of a method: how its curve is drawn.
LINE = '<svg width="26" height="8" aria-hidden="true"><line x2="26" y1="4" y2="4"/></svg> '


def explorer(scene: Scene, *more: str) -> Section:
    """The section of the page: its markup, with the data inside, below some words and ``more``."""
    fit((scene.queries, scene.references))
    drawn = charts.figures(scene)
    items = [json_item(fig, ID(f"explorer-figure-{name}")) for name, fig in drawn.items()]
    data = _data(scene) | {"items": items, "figures": list(drawn)}
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    # No text in it can end the element.
    text = text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
    html = _markup(scene, drawn)
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
        else f"a cell of the matrix, {rows} by {columns}, is "
        f"{'the least' if scene.least else 'one'} "
        f"of {down} by {across} distances"
    )
    marks = (
        "Blue is right, orange is wrong; bold is trusted, thin is not; what the threshold refuses "
        "is faint. "
        if scene.judged
        else "Blue is trusted, grey is not; what the threshold refuses is faint. "
    )
    return (
        "Point at the matrix or the strip, tap them, or use the arrow keys, to see a query beside "
        f"the place it was matched to. {marks}The stronger a tone, the nearer: {cells}."
    )


def _data(scene: Scene) -> dict[str, Any]:
    low, high = charts.span(scene)
    steps = np.abs(np.diff(scene.true_place)) if scene.true_place is not None else np.zeros(1)
    return {
        "queries": len(scene),
        "places": scene.places,
        "rows": scene.picture.shape[0],
        "columns": scene.picture.shape[1],
        "block": scene.block,
        "low": low,
        "step": (high - low) / charts.LEVELS,
        "chosen": plain(scene.chosen),
        "judged": scene.judged,
        "methods": [plain(method.name) for method in scene.methods],
        "on": [k < LOOKS for k in range(len(scene.methods))],
        # The line of the truth does not bridge a longer step.
        "jump": 10 + 5 * int(np.median(steps)) if len(steps) else 10,
        "starts": [] if scene.segments is None else [each.start for each in scene.segments],
        "queryNames": _names(scene.query_names),
        "placeNames": _names(scene.place_names),
        "images": [_images(scene.queries), _images(scene.references)],
        "themes": [_theme(theme, len(scene.methods)) for theme in (LIGHT, DARK)],
    }


def _names(names: Sequence[str] | None) -> list[str] | None:
    return None if names is None else [plain(name) for name in names]


def _images(album: Album) -> Mapping[str, Any]:
    return {"numbers": album.numbers, "files": album.texts()}


def _theme(theme: Theme, methods: int) -> Mapping[str, Any]:
    """Colours by their meaning, as in every figure, and the lines of the methods."""
    usual = ("paper", "ink", "muted", "grid", "trusted", "right", "wrong", "truth")
    names = *usual, *(each.name.lower() for each in Outcome)
    colours = {name: getattr(theme, name) for name in names}
    shades = theme.distance_map(np.linspace(0, 1, 256), bytes=True)
    return colours | {
        "tones": [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue, _ in shades],
        "lines": [_line(theme, k) for k in range(methods)],
    }


def _line(theme: Theme, k: int) -> Mapping[str, Any]:
    """The look of a method's curve: no colour that has a meaning on this page."""
    hues = theme.ink, theme.peak, theme.muted, theme.nearest
    dashes: Sequence[Sequence[int]] = ((), (8, 4), (2, 3), (8, 3, 2, 3))
    return {"color": hues[(k + k // 4) % 4], "dash": dashes[k % 4], "width": 1.6}


def _markup(scene: Scene, drawn: Mapping[str, Any]) -> str:
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
        name: f'<div class="plot" id="explorer-figure-{name}" role="group" '
        f'aria-label="{labels[name]}"'
        f"{' tabindex=0' if name in focus else ''}></div>"
        for name in drawn
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
    kinds = "A dot is right, a cross is wrong" if scene.judged else "Blue is trusted, grey is not"
    words = f"{kinds}; a square is probably off the map, says the method."
    below = {"plan": f'<p class="below">{words}</p>\n'}
    beside = "".join(
        f'<h3>{title}</h3>\n{plots[name]}\n<p class="below">{below.get(name, "")}</p>\n'
        for name, title in (("curve", "Precision and recall"), ("plan", "Plan of the route"))
        if name in plots
    )
    return f"""<div class="explorer" id="explorer">
<div class="board">
<div class="pair" role="region" aria-label="The chosen query">
<h3><span id="explorer-pair-title">Query</span> <span id="explorer-verdict"></span></h3>
<div class="images">{images}</div>
<p class="heard" id="explorer-said" aria-live="polite"></p>
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
        f'{escaped(method.name)}"{" checked" if method.name == scene.chosen else ""}></td>'
        f'<th scope="row"><label for="explorer-pick-{k}">'
        f"{'' if method.curve is None else LINE}{escaped(method.name)}</label>"
        f"<small>{escaped(method.description)}</small></th>"
        + '<td class="number"></td>'
        * len(heads)
        + f'<td><input type="checkbox" aria-label="Compare {escaped(method.name)}"'
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
        f"<div><dt{' id=explorer-by' if name == 'score' else ''}>{label}</dt>"
        f'<dd id="explorer-{name}"></dd></div>'
        for name, label in told
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
