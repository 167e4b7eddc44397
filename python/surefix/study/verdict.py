"""A sentence or two for each method, made from its numbers: it wins, loses or is level."""

from surefix._words import verb
from surefix.study.study import UPTO, Result

__all__ = ["verdict"]


def verdict(result: Result) -> str:
    """A method beside the plain sequence."""
    if not result.judged.any():
        return f"{result.name}: no query was judged, so there is nothing to say."
    parts = (_compared(result), _matches(result), _otherwise(result))
    return f"{result.name} {' '.join(filter(None, parts))}"


def _compared(result: Result) -> str:
    area, low, high = result.area
    plain = result.study.baseline
    if result is plain:
        return (
            f"is the baseline. Its area up to recall {UPTO:g} is {area:.3f} (95 % interval "
            f"{low:.3f} to {high:.3f})."
        )
    if not plain.judged.any():
        return f"has area {area:.3f} ({low:.3f} to {high:.3f}); the plain sequence was never ready."
    _, low, high = result.difference
    if low == high == 0:
        return f"is level with the plain sequence, area {area:.3f} in every sample."
    said = {"wins": "wins over", "loses": "loses to", "level": "is level with"}[result.outcome]
    holds = ": it holds 0" if result.outcome == "level" else ""
    return (
        f"{said} the plain sequence, area {area:.3f} against {plain.area[0]:.3f} (95 % interval "
        f"of the difference {low:+.3f} to {high:+.3f}{holds})."
    )


def _matches(result: Result) -> str:
    judged, right = int(result.judged.sum()), int((result.right & result.judged).sum())
    own = f"{right} of {judged} matches {verb(right)} right"
    refused = int((result.judged & ~result.accepted).sum())
    if refused:
        lost = int((result.judged & result.right & ~result.accepted).sum())
        ones = "one" if lost < 2 else "ones"
        own += f", but it refuses {refused}, {lost or 'no'} right {ones} among them"
    plain = result.study.baseline
    if result is plain:
        return f"{own}."
    both = result.judged & result.accepted & plain.judged
    repaired = int((both & result.right & ~plain.right).sum())
    spoiled = int((both & ~result.right & plain.right).sum())
    return (
        f"{own}; it repairs {repaired} that the plain sequence has wrong and spoils {spoiled} that "
        "it has right."
    )


def _otherwise(result: Result) -> str:
    """Numbers that may speak against the first word."""
    plain, curve = result.study.baseline.curve, result.curve
    if curve.max_recall < UPTO:
        return (
            f"Its curve ends at recall {curve.max_recall:.3f}: the recalls beyond count as 0 in "
            "its area."
        )
    found: dict[str, list[str]] = {"worse": [], "better": []}
    flawless, plain_flawless = (each.recall_at_precision(1.0) for each in (curve, plain))
    for name, own, other in (
        ("recall at 100 % precision", flawless, plain_flawless),
        ("the area of the whole curve", curve.auc(1.0), plain.auc(1.0)),
        ("the largest recall", curve.max_recall, plain.max_recall),
    ):
        if round(own - other, 3):
            word = "better" if own > other else "worse"
            found[word].append(f"{name} ({own:.3f} against {other:.3f})")
    return " ".join(
        f"It is {word} in {' and '.join(filter(None, (', '.join(items[:-1]), items[-1])))}."
        for word, items in found.items()
        if items
    )
