"""A plain word about each picture of a drive, with its numbers."""

from collections.abc import Sequence

from surefix._words import are, counted
from surefix.plot.outcome import Outcome
from surefix.report.drive import Drive
from surefix.report.page import Picture, Section

__all__ = ["curves", "matrix", "meaning", "pairs", "route"]


def matrix(drive: Drive, whole: Picture, close: Picture) -> Section:
    """The distance matrix."""
    single = int(drive.single_right.sum())
    return Section(
        "What it saw, and what it answered",
        (
            "Each column is a frame of the second drive, each row a place of the map, and a strong tone "
            "means that the two look alike. The true path runs from corner to corner; season, dusk and "
            "traffic have all but wiped it out, and much beside it looks just as near. Going by the nearest "
            f"place alone, {single} of {len(drive.run)} frames {are(single)} right.",
            "A mark is the answer for a frame. Round is right (within one place of the truth), a cross is "
            "wrong; bold is trusted, thin is not.",
        ),
        (whole, close),
    )


def route(drive: Drive, strip: Picture) -> Section:
    """The strip along the route."""
    trusted_wrong, held = drive.counts[Outcome.TRUSTED_WRONG], drive.counts[Outcome.UNTRUSTED_WRONG]
    right = drive.counts[Outcome.UNTRUSTED_RIGHT]
    start, stop = drive.gap_metres
    return Section(
        "Along the route",
        (
            f"A robot that acts on every fix is sent to a wrong place {counted(trusted_wrong + held, 'time')} in "
            f"{len(drive.run)}. One that acts on the trusted fixes only, {counted(trusted_wrong, 'time')}. The price: "
            f"{counted(right, 'right fix', 'right fixes')} {are(right)} held back together with the "
            f"{counted(held, 'wrong one')}, and the longest stretch without a fix that is both trusted and right is "
            f"{stop - start:.0f} m. Odometry has to bridge it.",
        ),
        (strip,),
    )


def curves(drive: Drive, picture: Picture) -> Section:
    """The precision-recall curves."""
    weighted, baseline = drive.weighted_curve, drive.baseline_curve
    correct = [
        int((right & run.ready).sum())
        for right, run in ((drive.right, drive.run), (drive.baseline_right, drive.baseline))
    ]
    false = [curve.false_positives_at(0.2) or 0 for curve in (weighted, baseline)]
    flawless = [f"{curve.recall_at_precision(1.0):.3f}" for curve in (weighted, baseline)]
    return Section(
        "Precision and recall",
        (
            "Accept only matches whose score is good enough, and ease that threshold step by step: every "
            "score of the drive is a threshold once, none is left out. Precision is the share of the "
            "accepted matches that is correct. Recall is the share of the correct matches that is accepted, "
            f"the convention named \u201ccorrect\u201d: each curve counts its own, {correct[0]} for the "
            f"weighted sequence and {correct[1]} for the unweighted one.",
            "Both sequences see the same distances; the weighted one draws trusted matches nearer. When it "
            f"reaches recall 0.2 it has accepted {_wrong(false[0])}, the unweighted one {_wrong(false[1])}. "
            f"With no wrong match at all, the one gets to recall {flawless[0]}, the other to {flawless[1]}.",
            *_left_out(drive),
        ),
        (picture,),
    )


def pairs(drive: Drive, montage: Picture) -> Section:
    """The montage."""
    return Section(
        "See for yourself",
        (
            "Above, what the camera saw; below, the place it was matched to. The pairs are not chosen for "
            "their looks: of each kind, they are spread evenly over the drive.",
            "Trusted and wrong is the column to worry about: "
            f"{drive.counts[Outcome.TRUSTED_WRONG]} of {len(drive.run)} fixes. Untrusted and wrong is what "
            f"trust is for: {drive.counts[Outcome.UNTRUSTED_WRONG]} that it held back.",
        ),
        (montage,),
    )


def meaning(drive: Drive) -> Section:
    """What trust is, and is not."""
    counts, run = drive.counts, drive.run
    trusted_wrong, untrusted_right = counts[Outcome.TRUSTED_WRONG], counts[Outcome.UNTRUSTED_RIGHT]
    trusted = int(run.trusted.sum())
    untrusted = len(run) - trusted
    single = int((run.trusted & drive.single_right).sum())
    differ = int((run.trusted & (run.place != run.single_place)).sum())
    return Section(
        "What trusted means, and what it does not",
        (
            "surefix asks the same distances two questions. Which place is nearest? And at which place does "
            "the distance dip most sharply below its neighbours on the route, over the last three frames "
            "together? Where the two answers agree, to within one place, the match is trusted. Looking near "
            "is easy for a place like any other; a sharp dip that travels along with the camera is not.",
            f"It is no probability and no promise: {trusted_wrong} of the "
            f"{counted(trusted, 'trusted fix', 'trusted fixes')} of this drive {are(trusted_wrong)} wrong. Nor does "
            f"untrusted mean wrong: {untrusted_right} of the {counted(untrusted, 'untrusted one')} "
            f"{are(untrusted_right)} right. Where two stretches of road truly look the same, both "
            "questions are fooled together. And it needs a map in the order of the route.",
            f"Trust is a word about a frame's own match, which is right in {single} of the "
            f"{counted(trusted, 'trusted case')}. The fix is the place of the sequence, and in {differ} of them that "
            "is another place.",
            "This is a drawn world, in conditions set so that plain image matching fares about as it does on "
            "real roads. It shows what the method does; how well it does it, only your own route can tell.",
        ),
    )


def _wrong(count: int) -> str:
    return counted(count, "wrong match", "wrong matches") if count else "no wrong matches"


def _left_out(drive: Drive) -> Sequence[str]:
    """Why the star may have another share of right ones than all trusted fixes have."""
    early = ~drive.run.ready
    if not early.any():
        return ()
    trusted = early & drive.run.trusted
    return (
        f"Curves and star leave out {counted(int(early.sum()), 'fix', 'fixes')} at the start, whose window is not full "
        f"yet: {int(trusted.sum())} trusted, {int((trusted & ~drive.right).sum())} trusted and wrong.",
    )
