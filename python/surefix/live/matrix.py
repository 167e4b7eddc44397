"""The distances of the newest queries in rerun: a picture, its axes, breaks and matched cells."""

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surefix import Fix, Map
from surefix._colours import DARK
from surefix.live.binning import Columns, ticks
from surefix.live.view import HERE, TRUSTED, UNTRUSTED, pillow, rgb

__all__ = ["PALETTE", "Matrix", "encoded"]

# A tone for each level of ``Columns.levels``, from far to near: those of the dark reports.
PALETTE = np.linspace(rgb(DARK.paper), rgb(DARK.near), 256).round().astype(np.uint8)
# Names, colours and sizes of the matched cells.
MARKS = ("untrusted", UNTRUSTED, 1.5), ("trusted", TRUSTED, 3.0)


class Matrix:
    """What is drawn of the newest columns; a place at the bottom is the map's first."""

    ROWS = 160
    # About half the height of a word, as a share of the picture's.
    WORD = 0.045

    def __init__(self, rr: Any, route: Map, columns: int | None) -> None:
        rows = min(len(route), self.ROWS)
        self.rr, self.route = rr, route
        self.columns = Columns(len(route), columns or max(60, 3 * rows // 2), rows)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the picture."""
        return self.columns.rows, self.columns.count

    def axes(self, log: Any) -> None:
        """Logs what stays: the numbers of places, and a line at each break of the route."""
        columns = self.columns.count
        heights = {place: self._height(place) for place in ticks(len(self.route))}
        names = [str(place) if place else "place 0" for place in heights]
        # The viewer writes words below their point.
        raised = self.WORD * self.columns.rows
        at = [[-columns / 16, height - raised] for height in heights.values()]
        log("matrix/places", self._words(at, names), static=True)
        breaks = [self._height(int(place)) + 0.5 for place in self.route.segments.breaks]
        if breaks:
            lines = [[[0.0, height], [columns, height]] for height in breaks]
            style = {"colors": rgb(DARK.muted), "radii": self.rr.Radius.ui_points(0.7)}
            log("matrix/breaks", self.rr.LineStrips2D(lines, **style), static=True)

    def update(self, log: Any, distances: NDArray[np.float32], fix: Fix) -> None:
        """Logs the picture with the newest query."""
        rr = self.rr
        self.columns.add(distances, fix)
        levels = pillow(self.columns.levels())
        levels.putpalette(PALETTE.tobytes())
        log("matrix/distances", encoded(rr, levels, "png", compress_level=1))
        for name, colour, size in MARKS:
            cells = self.columns.cells(name == "trusted")
            points = rr.Points2D(cells, colors=rgb(colour), radii=rr.Radius.ui_points(size))
            log(f"matrix/{name}", points)
        rows, columns = self.shape
        first = fix.frame + 1 - len(self.columns.values)
        at = [[columns / 16, rows * 1.04], [columns * 15 / 16, rows * 1.04]]
        log("matrix/queries", self._words(at, [f"query {first}", str(fix.frame)]))

    def _height(self, place: int) -> float:
        return self.columns.height(self.columns.bins.of(place))

    def _words(self, at: list[list[float]], words: list[str]) -> Any:
        style = {"colors": rgb(HERE), "radii": self.rr.Radius.ui_points(0.0)}
        return self.rr.Points2D(at, labels=words, show_labels=True, **style)


def encoded(rr: Any, picture: Any, kind: str, **options: int) -> Any:
    """A picture of Pillow as rerun's, of this kind of file."""
    file = io.BytesIO()
    picture.save(file, kind, **options)
    return rr.EncodedImage(contents=file.getvalue(), media_type=f"image/{kind}")
