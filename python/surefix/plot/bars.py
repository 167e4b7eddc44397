"""How many wrong matches were accepted by a recall."""

from collections.abc import Mapping

from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from surefix.plot.theme import LIGHT, Theme

__all__ = ["false_positives"]


def false_positives(
    ax: Axes, counts: Mapping[str, int | None], *, recall: float = 0.2, theme: Theme = LIGHT
) -> Axes:
    """Draws a bar for each method: the wrong matches accepted by the time that ``recall`` is
    reached.

    Parameters ---------- counts : mapping of a name to a count As of
    ``Evaluation.false_positives_at``; None where the recall is never reached, which is said in
    place of the bar. recall : float Where they were counted.
    """
    longest = max((count for count in counts.values() if count is not None), default=0)
    for row, (name, count) in enumerate(counts.items()):
        if count is None:
            ax.text(
                0.01 * max(longest, 1),
                row,
                f"never reaches recall {recall:g}",
                va="center",
                color=theme.muted,
            )
            continue
        ax.barh(row, count, height=0.62, color=theme.trusted_wrong, label=name)
        ax.text(count + 0.01 * max(longest, 1), row, str(count), va="center")
    ax.set_yticks(range(len(counts)), labels=list(counts))
    ax.set_ylim(len(counts) - 0.5, -0.5)
    ax.set_xlim(0, 1.12 * max(longest, 1))
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.tick_params(axis="y", length=0, labelcolor=theme.ink)
    ax.set_xlabel(f"false positives at recall {recall:g} (wrong matches accepted)")
    ax.grid(axis="x", linewidth=0.8)
    ax.set_axisbelow(True)
    return ax
