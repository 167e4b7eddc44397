"""The confusion table of a trust flag, as a picture."""

from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from surefix import Trust
from surefix.plot.outcome import Outcome
from surefix.plot.theme import LIGHT, Theme

__all__ = ["trust_table"]


def trust_table(ax: Axes, trust: Trust, *, theme: Theme = LIGHT) -> Axes:
    """Draws four cells, trusted or not by right or wrong: how many single matches, and their share
    of all.

    Parameters
    ----------
    trust : Trust
        As of ``surefix.evaluate_trust``. The depth of a cell is its share.
    """
    cells = {
        Outcome.TRUSTED_RIGHT: (0, 0, trust.true_positives),
        Outcome.TRUSTED_WRONG: (1, 0, trust.false_positives),
        Outcome.UNTRUSTED_RIGHT: (0, 1, trust.false_negatives),
        Outcome.UNTRUSTED_WRONG: (1, 1, trust.true_negatives),
    }
    total = max(1, sum(count for _, _, count in cells.values()))
    for outcome, (column, row, count) in cells.items():
        colour = theme.trusted_right if outcome.right else theme.trusted_wrong
        box = (column, row), 1, 1
        ax.add_patch(
            Rectangle(*box, facecolor=colour, alpha=0.06 + 0.34 * count / total, linewidth=0)
        )
        ax.add_patch(Rectangle(*box, fill=False, edgecolor=theme.grid, linewidth=1.2))
        ax.text(
            column + 0.5,
            row + 0.44,
            str(count),
            ha="center",
            va="center",
            fontsize=17,
            fontweight="bold",
        )
        share = f"{100 * count / total:.1f} %"
        ax.text(
            column + 0.5, row + 0.74, share, ha="center", va="center", color=theme.ink, fontsize=9.5
        )
    ax.set_xlim(0, 2)
    ax.set_ylim(2, 0)
    ax.set_xticks([0.5, 1.5], labels=["right", "wrong"])
    ax.set_yticks([0.5, 1.5], labels=["trusted", "not trusted"])
    ax.xaxis.tick_top()
    ax.tick_params(length=0, labelcolor=theme.ink, labelsize=10.5)
    ax.set_xlabel(
        f"precision {trust.precision:.3f},  recall {trust.recall:.3f},\n"
        f"{100 * trust.share_trusted:.1f} % of the single matches are trusted"
    )
    for spine in ax.spines.values():
        spine.set_visible(False)
    return ax
