"""Rerun itself: the package, its viewer, and the layout of a drive in it."""

import os
import shutil
import socket
import sys
import sysconfig
from importlib.util import find_spec
from typing import Any

from surefix import SurefixError
from surefix._extra import require
from surefix.live.ground import Kind

__all__ = ["layout", "load_rerun", "open_viewer", "viewer_obstacle"]


def load_rerun() -> Any:
    """The package rerun.

    Raises
    ------
    SurefixError
        If it is not installed: the error says which extra to install.
    """
    return require("rerun", "the live view", "rerun", "surefix[live]")


def viewer_obstacle() -> str | None:
    """Why rerun's viewer cannot be opened here, in a few words; None if it can."""
    if find_spec("rerun") is None:
        return 'rerun is not installed: pip install "surefix[live]"'
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        return "rerun's viewer needs a screen, and DISPLAY names none"
    return None


def open_viewer(recording: Any, port: int, memory: str) -> None:
    """Open rerun's viewer in a window of its own, or find the one that listens at ``port``. It
    outlives the process.

    Raises
    ------
    SurefixError
        If there is no screen to open it on, or it does not start.
    """
    if obstacle := viewer_obstacle():
        raise SurefixError(obstacle)
    chosen = os.environ.get("RUST_LOG")
    # The viewer logs to this terminal, on which the drive is drawn.
    os.environ.setdefault("RUST_LOG", "error")
    try:
        load_rerun().spawn(
            # Without a recording, rerun takes itself for turned off, and opens nothing.
            recording=recording,
            port=port,
            connect=False,
            memory_limit=memory,
            server_memory_limit=memory,
            hide_welcome_screen=True,
            # A virtual environment that is not activated is not on the shell's path.
            executable_path=shutil.which("rerun", path=sysconfig.get_path("scripts")),
        )
    except (RuntimeError, OSError) as error:
        raise SurefixError(f"rerun's viewer did not open: {error}") from None
    finally:
        if chosen is None:
            del os.environ["RUST_LOG"]
    # Rerun does not say whether it worked.
    try:
        socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
    except OSError as error:
        raise SurefixError(
            f"rerun's viewer did not open: nothing answers at port {port} ({error})"
        ) from None


def layout(
    camera: bool,
    references: bool,
    ground: Kind | None,
    zoom: float | None,
    matrix: tuple[int, int],
    tracked: bool,
) -> Any:
    """The blueprint of a drive: with images of the queries and of the map's places or without, for
    the ground that the route lies on and the zoom of a map, for a matrix of these rows and columns,
    and with the belief and the confidence in place of the score, or without.
    """
    import rerun as rr
    import rerun.blueprint as rrb

    images = [rrb.Spatial2DView(origin="camera", name="Camera")] if camera else []
    if references:
        images.append(rrb.Spatial2DView(origin="matched", name="Matched place"))
    grounds = []
    if ground is not None:
        # The trail stays, up to the cursor; of all else there is only the newest.
        start, now = rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.cursor_relative()
        so_far = rrb.VisibleTimeRanges(
            [rrb.VisibleTimeRange(name, start=start, end=now) for name in ("frame", "time")]
        )
        views_of: Any = {
            "map": (rrb.MapView, rr.GeoPoints),
            "plan": (rrb.Spatial2DView, rr.Points2D),
            "space": (rrb.Spatial3DView, rr.Points3D),
        }
        view, points = views_of[ground]
        names = "route/trusted", "route/untrusted"
        trail: Any = {name: [so_far, points.from_fields()] for name in names}
        more = {} if zoom is None else {"zoom": zoom}
        grounds.append(view(origin="route", name="Route", overrides=trail, **more))
    bare = rrb.PlotLegend(visible=False)
    name = "Distances less their median: least (yellow), gradient peak (pink)"
    distances = rrb.BarChartView(origin="distances", name=name, plot_legend=bare)
    rows, columns = matrix
    # With room for the numbers at two of its sides.
    bounds = rrb.VisualBounds2D(x_range=(-columns / 8, columns), y_range=(0, rows * 1.08))
    newest = rrb.Spatial2DView(
        origin="matrix", name="Distances of the newest queries", visual_bounds=bounds
    )
    # The colours are named in the titles: a legend would lie over what it explains.
    sure = ("sure", "Confidence, off map (white)")
    place, score, latency = (
        rrb.TimeSeriesView(origin=origin, name=name, plot_legend=bare)
        for origin, name in (
            ("place", "Place: trusted (blue), untrusted (grey)"),
            sure if tracked else ("score", "Score"),
            ("latency_us", "Latency, us"),
        )
    )
    views = [rrb.Vertical(*images)] if images else []
    name = "Belief over the route, square root"
    strip = [rrb.BarChartView(origin="belief", name=name, plot_legend=bare)] if tracked else []
    heights = [1.0, 2.0, 2.0] if tracked else [2.0, 2.0]
    views.append(rrb.Vertical(*strip, distances, newest, row_shares=heights))
    views.append(
        rrb.Vertical(*grounds, place, rrb.Horizontal(score, latency, column_shares=[1.4, 1.0]))
    )
    shares = [1.3, 2.0, 2.0] if images else [2.0, 2.0]
    return rrb.Blueprint(
        rrb.Horizontal(*views, column_shares=shares),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="frame", play_state="following"),
        auto_views=False,
    )
