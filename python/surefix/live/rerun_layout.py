"""How the rerun viewer is laid out when a drive is opened."""

from typing import Any

__all__ = ["layout"]


def layout(*, camera: bool, references: bool, dimensions: int, matrix: tuple[int, int]) -> Any:
    """The blueprint of a drive.

    Parameters
    ----------
    camera, references : bool
        Whether there are images of the queries, and of the map's places.
    dimensions : int
        Coordinates of the map's positions, 2 or 3; 0 where it has none.
    matrix : (int, int)
        Rows and columns of the picture of the matrix.
    """
    import rerun as rr
    import rerun.blueprint as rrb

    images = []
    if camera:
        images.append(rrb.Spatial2DView(origin="camera", name="Camera"))
    if references:
        images.append(rrb.Spatial2DView(origin="matched", name="Matched place"))
    ground = []
    if dimensions:
        view, points = (
            (rrb.Spatial3DView, rr.Points3D)
            if dimensions == 3
            else (rrb.Spatial2DView, rr.Points2D)
        )
        # What the drive left behind stays, up to where the cursor is; of all else there is only the
        # newest.
        start, now = rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.cursor_relative()
        so_far = rrb.VisibleTimeRanges(
            [rrb.VisibleTimeRange(name, start=start, end=now) for name in ("frame", "time")]
        )
        trail: Any = {
            f"route/{name}": [so_far, points.from_fields()] for name in ("trusted", "untrusted")
        }
        ground.append(view(origin="route", name="Route", overrides=trail))
    legend = rrb.PlotLegend(rrb.Corner2D.LeftBottom)
    distances = rrb.BarChartView(
        origin="distances", name="Distances to all places", plot_legend=legend
    )
    rows, columns = matrix
    bounds = rrb.VisualBounds2D(x_range=(0, columns), y_range=(0, rows))
    newest = rrb.Spatial2DView(
        origin="matrix", name="Newest columns of the matrix", visual_bounds=bounds
    )
    place = rrb.TimeSeriesView(
        origin="place", name="Place", plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop)
    )
    bare = rrb.PlotLegend(visible=False)
    score = rrb.TimeSeriesView(origin="score", name="Score", plot_legend=bare)
    latency = rrb.TimeSeriesView(
        origin="latency_us", name="Latency, microseconds", plot_legend=bare
    )
    views = [
        rrb.Vertical(distances, newest),
        rrb.Vertical(*ground, place, rrb.Horizontal(score, latency)),
    ]
    shares = [2.0, 2.0]
    if images:
        views.insert(0, rrb.Vertical(*images))
        shares.insert(0, 1.3)
    return rrb.Blueprint(
        rrb.Horizontal(*views, column_shares=shares),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="frame", play_state="following"),
        auto_views=False,
    )
