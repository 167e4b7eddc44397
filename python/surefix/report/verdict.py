"""A sentence for each method, made from its numbers: where it wins, where it loses, and what the
drive cannot tell.
"""

from surefix._words import are
from surefix.report.comparison import UPTO, Comparison, Result

__all__ = ["outcome", "verdict"]


def outcome(result: Result) -> str:
    """Against the plain sequence, in a word or two: "wins", "loses", "the same" or "the drive does
    not tell".
    """
    _, low, high = result.difference
    if low == high == 0:
        return "the same"
    if low > 0:
        return "wins"
    return "loses" if high < 0 else "the drive does not tell"


def verdict(comparison: Comparison, result: Result) -> str:
    """What became of a method, beside the plain sequence."""
    if not result.judged.any():
        return f"{result.name}: no query was judged, so there is nothing to say."
    return " ".join(
        filter(
            None,
            (_compared(comparison, result), _matches(comparison, result), _yet(comparison, result)),
        )
    )


def _compared(comparison: Comparison, result: Result) -> str:
    area, low, high = result.area
    plain = comparison.baseline
    if result is plain:
        says = "what the others are compared to. Its area"
        return f"{result.name}: {says} up to recall {UPTO:g} is {area:.3f} (95 % interval {low:.3f} to {high:.3f})."
    if not plain.judged.any():
        return f"{result.name}: area {area:.3f} ({low:.3f} to {high:.3f}); the plain sequence was never ready."
    difference, low, high = result.difference
    areas = f"area {area:.3f} against {plain.area[0]:.3f}"
    span = f"95 % interval of the difference {low:+.3f} to {high:+.3f}"
    said = {
        "wins": f"wins over the plain sequence, {areas} ({span}).",
        "loses": f"loses to the plain sequence, {areas} ({span}).",
        "the same": f"has the plain sequence's area, {area:.3f}, in every sample.",
        "the drive does not tell": f"{_face(difference)} the plain sequence, {areas}, but the drive does not tell "
        f"which is better ({span}: it holds 0).",
    }[outcome(result)]
    return f"{result.name}: {said}"


def _face(difference: float) -> str:
    return "level with" if difference == 0 else "above" if difference > 0 else "below"


def _matches(comparison: Comparison, result: Result) -> str:
    judged, right = int(result.judged.sum()), int((result.right & result.judged).sum())
    own = f"{right} of {judged} matches {are(right)} right"
    refused = int((result.judged & ~result.accepted).sum())
    if refused:
        lost = int((result.judged & result.right & ~result.accepted).sum())
        own += f", but it refuses {refused}, {lost or 'no'} right {'one' if lost < 2 else 'ones'} among them"
    plain = comparison.baseline
    if result is plain:
        return f"{own}."
    both = result.judged & result.accepted & plain.judged
    repaired = int((both & result.right & ~plain.right).sum())
    spoiled = int((both & ~result.right & plain.right).sum())
    return f"{own}; it repairs {repaired} that the plain sequence has wrong and spoils {spoiled} that it has right."


def _yet(comparison: Comparison, result: Result) -> str:
    """What else speaks against the first word."""
    plain, curve = comparison.baseline.curve, result.curve
    if curve.max_recall < UPTO:
        return f"Its curve ends at recall {curve.max_recall:.3f}: what lies beyond counts as nothing in its area."
    if result is comparison.baseline:
        return ""
    worse: list[str] = []
    better: list[str] = []
    for name, own, other in (
        (
            "recall at 100 % precision",
            curve.recall_at_precision(1.0),
            plain.recall_at_precision(1.0),
        ),
        ("the area of the whole curve", curve.auc(1.0), plain.auc(1.0)),
        ("the largest recall", curve.max_recall, plain.max_recall),
    ):
        if round(own - other, 3):
            (better if own > other else worse).append(f"{name} ({own:.3f} against {other:.3f})")
    return " ".join(
        f"It is {word} in {_and(items)}."
        for word, items in (("worse", worse), ("better", better))
        if items
    )


def _and(items: list[str]) -> str:
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}"
