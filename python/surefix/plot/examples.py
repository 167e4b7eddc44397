"""Images side by side: what the camera saw, what it was matched to, and where it was."""

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from surefix.plot.montage import Image, photo
from surefix.plot.theme import LIGHT, Theme

__all__ = ["Example", "examples", "examples_height"]

# In widths of a picture: between two pictures, between two examples, above and below the pictures
# of a row.
BESIDE, BETWEEN, TITLE, CAPTION = 0.03, 0.16, 0.1, 0.15


@dataclass(frozen=True)
class Example:
    """Some images of one query, each with its title or None where there is no image, and a line
    about them all.
    """

    images: Sequence[tuple[str, Image | None]]
    caption: str


def examples(ax: Axes, shown: Sequence[Example], *, across: int = 2, theme: Theme = LIGHT) -> Axes:
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
    """
    count = _images(shown)
    height, wide = _height(shown), _wide(count)
    step = height + TITLE + CAPTION
    for index, example in enumerate(shown):
        row, column = divmod(index, across)
        left, top = column * (wide + BETWEEN), -row * step - TITLE
        for k, (title, image) in enumerate(example.images):
            at = left + k * (1 + BESIDE)
            ax.text(at, top + 0.02, title, fontsize=8, va="bottom", color=theme.ink)
            if image is None:
                ax.add_patch(
                    Rectangle((at, top - height), 1, height, fill=False, edgecolor=theme.grid)
                )
                ax.text(
                    at + 0.5,
                    top - height / 2,
                    "no image",
                    ha="center",
                    va="center",
                    color=theme.muted,
                )
                continue
            rows, columns = image.shape[:2]
            w, h = min(1.0, height * columns / rows), min(height, rows / columns)
            ax.add_patch(
                Rectangle((at, top - height), 1, height, facecolor=theme.grid, linewidth=0)
            )
            x, y = at + (1 - w) / 2, top - (height + h) / 2
            photo(ax, image, (x, x + w, y, y + h))
        ax.text(left, top - height - 0.02, example.caption, fontsize=8, va="top", color=theme.muted)
    rows_ = -(-len(shown) // across)
    ax.set_xlim(-0.01, across * (wide + BETWEEN) - BETWEEN + 0.01)
    ax.set_ylim(-max(rows_, 1) * step, 0.01)
    ax.set_aspect("equal")
    ax.set_axis_off()
    return ax


def examples_height(shown: Sequence[Example], width: float, *, across: int = 2) -> float:
    """How high ``examples`` is where it is ``width`` wide."""
    unit = width / (across * (_wide(_images(shown)) + BETWEEN) - BETWEEN + 0.02)
    return unit * (max(1, -(-len(shown) // across)) * (_height(shown) + TITLE + CAPTION) + 0.01)


def _images(shown: Sequence[Example]) -> int:
    return max((len(example.images) for example in shown), default=1)


def _wide(count: int) -> float:
    return count * (1 + BESIDE) - BESIDE


def _height(shown: Sequence[Example]) -> float:
    """The height of the first image that there is, in widths."""
    images = [image for example in shown for _, image in example.images if image is not None]
    return float(images[0].shape[0] / images[0].shape[1]) if images else 0.5
