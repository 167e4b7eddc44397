"""Camera images side by side: queries, the places they were matched to, the true places."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from surefix.plot.axes import on_axes
from surefix.plot.outcome import Outcome
from surefix.plot.theme import LIGHT, Theme

__all__ = [
    "Column",
    "Example",
    "Image",
    "Pair",
    "examples",
    "examples_height",
    "montage",
    "montage_height",
    "spread",
]

Image = NDArray[np.uint8]
Box = tuple[float, float, float, float]

# In widths of a picture: between columns, between the two pictures of a pair, below a pair, and
# above all.
ACROSS, BETWEEN, CAPTION, HEADER = 0.07, 0.012, 0.2, 0.27


@dataclass(frozen=True)
class Pair:
    """A query's image, that of the place it was matched to, and a line about both."""

    query: Image
    matched: Image
    caption: str


@dataclass(frozen=True)
class Column:
    """Some pairs of one outcome, and the number of all."""

    outcome: Outcome
    count: int
    pairs: Sequence[Pair]


def spread(queries: NDArray[np.int64], count: int) -> list[int]:
    """``count`` of the ``queries``, evenly spread over them; all of them if there are fewer."""
    if len(queries) <= count:
        return [int(query) for query in queries]
    # The middle of each of `count` equal parts.
    return [int(queries[(2 * k + 1) * len(queries) // (2 * count)]) for k in range(count)]


def photo(ax: Axes, image: Image, box: Box) -> None:
    """Draws an image, uint8 (H, W) or (H, W, 3), into ``box``: left, right, bottom, top."""
    ax.imshow(
        image, extent=box, interpolation="antialiased", cmap="gray", vmin=0, vmax=255, zorder=2
    )


def _note(ax: Axes, x: float, y: float, text: str, theme: Theme) -> None:
    ax.text(x, y, text, ha="center", va="center", color=theme.muted)


def _bare(ax: Axes, x: tuple[float, float], y: tuple[float, float]) -> Axes:
    """Units as long across as up, and no axes."""
    ax.set(xlim=x, ylim=y, aspect="equal")
    ax.set_axis_off()
    return ax


@on_axes(9, 6)
def montage(
    columns: Sequence[Column], *, rows: int = 3, ax: Axes | None = None, theme: Theme = LIGHT
) -> Axes:
    """Draws a column for each outcome: the query above, the matched place below, ``rows`` pairs in
    each.

    A column without pairs says so. One unit of the axis is the width of a picture.

    Parameters
    ----------
    ax : Axes, optional
        Where to draw; by default a new figure.
    """
    assert ax is not None
    height = _proportion(pair.query for column in columns for pair in column.pairs)
    step = _step(height)
    for c, column in enumerate(columns):
        left, colour = c * (1 + ACROSS), theme.colour(column.outcome)
        ax.add_patch(Rectangle((left, 0.07), 1, 0.045, color=colour, linewidth=0))
        title = f"{column.outcome.value} ({column.count})"
        ax.text(left, 0.16, title, fontsize=10, fontweight="bold", va="bottom")
        for r, pair in enumerate(column.pairs[:rows]):
            top = -r * step
            middle = top - height - BETWEEN
            for image, upper in ((pair.query, top), (pair.matched, middle)):
                photo(ax, image, (left, left + 1, upper - height, upper))
            text = top - 2 * height - BETWEEN - 0.035
            ax.text(left, text, pair.caption, fontsize=8, va="top", color=theme.muted)
        if not column.pairs:
            _note(ax, left + 0.5, -height, "none in this run", theme)
    return _bare(ax, (-0.01, _width(len(columns)) - 0.01), (-rows * step, HEADER))


def montage_height(size: tuple[int, int], width: float, *, columns: int, rows: int) -> float:
    """The height of ``montage`` at a width, for images of ``size`` (width, height)."""
    return width / _width(columns) * (rows * _step(size[1] / size[0]) + HEADER)


def _width(columns: int) -> float:
    return columns * (1 + ACROSS) - ACROSS + 0.02


def _step(height: float) -> float:
    """From one pair of pictures, each ``height`` high, to the next."""
    return 2 * height + BETWEEN + CAPTION


# In widths of a picture: between two pictures, between two examples, above and below the pictures
# of a row.
BESIDE, APART, TITLE, BELOW = 0.03, 0.16, 0.1, 0.15


@dataclass(frozen=True)
class Example:
    """Images of one query, each with its title, None if there is none, and a line about all."""

    images: Sequence[tuple[str, Image | None]]
    caption: str


@on_axes(11, 6)
def examples(
    shown: Sequence[Example], *, across: int = 2, ax: Axes | None = None, theme: Theme = LIGHT
) -> Axes:
    """Draws examples, each a row of images with titles above and its caption below, ``across`` of
    them side by side.

    An image keeps its proportions. One unit of the axis is the width of a picture; all have the box
    of the first.

    Parameters
    ----------
    shown : sequence of Example
        Images are uint8, (H, W) or (H, W, 3).
    across : int
        Examples in a row of the figure.
    ax : Axes, optional
        Where to draw; by default a new figure.
    """
    assert ax is not None
    (height, wide, step), (width, tall) = _sizes(shown, across)
    for index, example in enumerate(shown):
        row, column = divmod(index, across)
        left, top = column * (wide + APART), -row * step - TITLE
        for k, (title, image) in enumerate(example.images):
            at = left + k * (1 + BESIDE)
            ax.text(at, top + 0.02, title, fontsize=8, va="bottom", color=theme.ink)
            box = (at, top - height), 1, height
            if image is None:
                ax.add_patch(Rectangle(*box, fill=False, edgecolor=theme.grid))
                _note(ax, at + 0.5, top - height / 2, "no image", theme)
                continue
            rows, columns = image.shape[:2]
            w, h = min(1.0, height * columns / rows), min(height, rows / columns)
            ax.add_patch(Rectangle(*box, facecolor=theme.grid, linewidth=0))
            x, y = at + (1 - w) / 2, top - (height + h) / 2
            photo(ax, image, (x, x + w, y, y + h))
        ax.text(left, top - height - 0.02, example.caption, fontsize=8, va="top", color=theme.muted)
    return _bare(ax, (-0.01, width - 0.01), (0.01 - tall, 0.01))


def examples_height(shown: Sequence[Example], width: float, *, across: int = 2) -> float:
    """The height of ``examples`` at a width."""
    _, (wide, tall) = _sizes(shown, across)
    return width / wide * tall


def _sizes(
    shown: Sequence[Example], across: int
) -> tuple[tuple[float, float, float], tuple[float, float]]:
    """An image's height, an example's width, a row's height; and the width and height of all."""
    height = _proportion(image for example in shown for _, image in example.images)
    count = max((len(example.images) for example in shown), default=1)
    wide, step = count * (1 + BESIDE) - BESIDE, height + TITLE + BELOW
    rows = max(1, -(-len(shown) // across))
    return (height, wide, step), (across * (wide + APART) - APART + 0.02, rows * step + 0.01)


def _proportion(images: Iterable[Image | None]) -> float:
    """The height of the first image that there is, in widths."""
    sizes = (image.shape for image in images if image is not None)
    return next((height / width for height, width, *_ in sizes), 0.5)
