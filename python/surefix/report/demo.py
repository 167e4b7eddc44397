"""The report of ``surefix demo``: the tracker and its confidence, a study of the sequence with and
without weights, and the drive in pictures.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from surefix import match_distances
from surefix._words import plural, verb
from surefix.baselines.distances import Flags
from surefix.machine import machine
from surefix.plot.belief import confidence
from surefix.plot.images import Column, Pair, montage, montage_height, spread
from surefix.plot.outcome import Outcome, longest_gap, outcomes
from surefix.report import figures, sections
from surefix.report.explore import explorer, scripts
from surefix.report.page import Picture, Section, Tile, drawn, photograph, write
from surefix.report.scene import of_study
from surefix.report.tables import write_csv
from surefix.study import UPTO
from surefix.study.demo import ACCEPT, Demo

__all__ = ["FILES", "write_report"]

FILES = {
    "report.html": "this page; it needs no other file",
    "confidence.png": "how sure the tracker was, frame by frame",
    "distance_matrix.png": "the matrix with every match",
    "close_up.png": "a part of it, cell by cell",
    "route.png": "right and wrong along the route",
    "precision_recall.png": "the curves",
    "montage.png": "queries and the places they were matched to",
    "fixes.csv": "every fix of the drive, by the tracker",
    "weighted.csv": "every fix of the weighted sequence",
    "baseline.csv": "every fix of the unweighted sequence",
    "truth.csv": "each frame's true place, its position in metres, and the odometry in places",
    "distances.npy": "the distance matrix, float32 (places, queries)",
}

LABEL = "distance (mean difference, in standard deviations of a patch)"
# The star's fixes, if the curves leave some out.
WHOLE = "the trusted fixes of full windows alone"
PAIRS = 3


def write_report(
    demo: Demo, folder: Path, command: str, seconds: Sequence[tuple[str, float]]
) -> Path:
    """Writes the page and all that belongs to it into ``folder``; returns the path of the page.

    Parameters
    ----------
    demo : Demo
    folder : Path
    command : str
        The command that makes this drive again.
    seconds : sequence of (name, float)
        The parts of the demo, and the time that each took.
    """
    kilometres = float(demo.reference.positions[-1]) / 1000
    still, off = int(demo.standing.sum()), int(demo.study.off_map.sum())
    lead = (
        f"A camera drove {kilometres:.1f} km on a summer noon, and surefix made a map of it: "
        f"{len(demo.study.distances)} places, in order. Then it drove there again on a winter "
        f"afternoon, among other cars, not quite in its old lane. It stood still for "
        f"{plural(still, 'frame')}, took a detour of {plural(off, 'frame')} off the map, and came "
        "back. Frame by frame, surefix said where it was, how sure it was of that, and whether to "
        "trust the frame's own match. Nothing was trained, and the truth was not used.",
        "Both drives are generated, so the truth is known, and every answer can be checked.",
    )
    return write(
        folder,
        "Where am I on this route, and may I trust that answer?",
        lead,
        _hero(demo),
        _tiles(demo),
        [*_sections(demo), _made(demo, seconds)],
        lambda inside: _write_tables(demo, inside),
        files=_files(demo),
        identity=sections.identity("surefix demo"),
        command=command,
        scripts=scripts(),
    )


def _write_tables(demo: Demo, folder: Path) -> None:
    study = demo.study
    demo.run.to_csv(folder / "fixes.csv")
    study.run.to_csv(folder / "weighted.csv")
    plain = match_distances(study.distances, **study.context.options | {"weight": 0.0})
    plain.to_csv(folder / "baseline.csv")
    np.save(folder / "distances.npy", study.distances)
    assert study.context.advance is not None
    frames = zip(study.true_place, demo.revisit.positions, study.context.advance, strict=True)
    rows = (
        (frame, place, "" if np.isnan(at) else f"{at:.3f}", f"{moved:.6f}")
        for frame, (place, at, moved) in enumerate(frames)
    )
    write_csv(folder / "truth.csv", "frame,place,position,advance", rows)


def _masks(demo: Demo) -> dict[Outcome, Flags]:
    """Which fixes had each outcome."""
    return outcomes(demo.right, demo.run.trusted)


def _counts(demo: Demo) -> dict[Outcome, int]:
    """The number of fixes of each outcome."""
    return {outcome: int(mask.sum()) for outcome, mask in _masks(demo).items()}


def _hero(demo: Demo) -> Sequence[Picture]:
    masks = _masks(demo)
    outcome = next(outcome for outcome in Outcome if masks[outcome].any())
    query = spread(np.flatnonzero(masks[outcome]), PAIRS)[0]
    place = int(demo.run.place[query])
    view = f"The second drive, frame {query}: the camera's view."
    answer = f"The map, place {place}: surefix's answer. {outcome.value.capitalize()}."
    return (
        photograph(demo.revisit[query], f"A street in winter, frame {query}.", view),
        photograph(demo.reference[place], f"A street in summer, place {place}.", answer),
    )


def _tiles(demo: Demo) -> Sequence[Tile]:
    m, sure, off_map = len(demo.study), demo.sure, demo.study.off_map
    off = int(off_map.sum())
    good, bad, *_ = _counts(demo).values()
    sure_count, lost = int(sure.sum()), int((sure & off_map).sum())
    sure_right = int((sure & demo.right).sum())
    median, p99 = np.quantile(demo.latency, (0.5, 0.99)) * 1000
    within = f"99 of 100 within {p99:.2f} ms"
    return (
        sections.share("trusted-right", good, good + bad, "of the trusted fixes are right"),
        sections.share("sure-right", sure_right, sure_count, "of the sure fixes are right"),
        sections.share("right", int(demo.right.sum()), m - off, "of those on the map are right"),
        sections.share("sure", sure_count, m, f"are sure: confidence {ACCEPT:g} or more"),
        Tile("sure-off-map", str(lost), "sure fixes off the map", f"of {off} frames"),
        Tile("latency", f"{median:.2f} ms", "for a fix, median", within),
    )


def _sections(demo: Demo) -> Sequence[Section]:
    """The page from the confidence on, in its order."""
    study, run, m = demo.study, demo.run, len(demo.study)
    _, bad, held_right, held = _counts(demo).values()
    trusted, single_right = int(run.trusted.sum()), int(study.single_right.sum())
    said = (
        "The true path runs from corner to corner, level while the drive stands still, with a gap "
        "for the detour; season, dusk and traffic have all but wiped it out, and many other places "
        f"look just as near. By the nearest place alone, {single_right} of {m} frames "
        f"{verb(single_right)} right."
    )
    scene = of_study(study, queries=demo.revisit, references=demo.reference)
    first = explorer(replace(scene, chosen="track_odometry", positions=None), said)
    sure_wrong = int((demo.sure & ~demo.right).sum())
    modest, gap = int((demo.right & ~demo.sure).sum()), len(longest_gap(demo.sure & demo.right))
    route = Section(
        "Along the route",
        (
            "Without the tracker, a robot that acts on every match of a sequence is sent to a "
            f"wrong place {plural(int((~study.shown.right).sum()), 'time')} in {m}. With it, "
            f"{plural(bad + held, 'time')}; if it acts on the sure fixes only, "
            f"{plural(sure_wrong, 'time')}. The price: "
            f"{plural(modest, 'right fix', 'right fixes')} {verb(modest)} held back, and the "
            f"longest stretch without a fix that is both sure and right is {plural(gap, 'frame')}. "
            "Odometry alone has to bridge it.",
        ),
    )
    see = Section(
        "See for yourself",
        (
            "Above, the camera's view; below, the place it was matched to. The pairs are not "
            "chosen for their looks: of each kind, they are spread evenly over the drive.",
            f"Trusted and wrong is the column to worry about: {bad} of {m} fixes. "
            f"Untrusted and wrong is what trust is for: {held} that it held back.",
        ),
        {"montage.png": _montage(demo)},
    )
    single = int((run.trusted & study.single_right).sum())
    differ = int((run.trusted & (run.place != run.single_place)).sum())
    meaning = Section(
        "What trusted means, and what it does not",
        (
            "surefix asks the same distances two questions. Which place is nearest? And at which "
            "place does the distance dip most sharply below its neighbours on the route, over the "
            "last three frames together? If the two answers agree, to within one place, the match "
            "is trusted. Looking near is easy for a place like any other; a sharp dip that travels "
            "along with the camera is not.",
            f"It is no probability and no promise: {bad} of the "
            f"{plural(trusted, 'trusted fix', 'trusted fixes')} of this drive {verb(bad)} wrong. "
            f"Nor does untrusted mean wrong: {held_right} of the "
            f"{plural(m - trusted, 'untrusted one')} {verb(held_right)} right. If two "
            "stretches of road truly look the same, both questions are fooled together. And it "
            "needs a map in the order of the route.",
            f"The trust flag is about a frame's own match, which is right in {single} of the "
            f"{plural(trusted, 'trusted case')}. The fix is the place of the tracker, and in "
            f"{differ} of them that is another place.",
            "This is a drawn world, in conditions set so that plain image matching fares about as "
            "it does on real roads. It shows what the method does; how well it does it, only your "
            "own route can tell.",
        ),
    )
    table, words = sections.methods(study)
    table = replace(table, paragraphs=[*table.paragraphs, *_curves(demo)])
    return first, _confidence(demo), route, table, words, see, meaning


def _files(demo: Demo) -> Mapping[str, Picture]:
    """The pictures that are no part of the page."""
    study = demo.study
    bands = (
        ("weighted, trusted fixes only", study.shown.right, demo.run.trusted),
        ("track_odometry, sure fixes only", demo.right, demo.sure),
    )
    star = "the trusted fixes alone" if study.run.ready.all() else WHOLE
    return (
        figures.matrix(study, every=True, label=LABEL, result=demo.tracker)
        | {"route.png": figures.strip(study, more=bands)}
        | figures.curves(study, demo.trusted_point, star)
    )


def _confidence(demo: Demo) -> Section:
    """How sure the tracker was, and where it was not."""
    said, noticed = demo.tracker.matches, demo.tracker.noticed
    assert said.confidence is not None
    assert said.off_map is not None
    assert noticed is not None
    still, off = np.flatnonzero(demo.standing), np.flatnonzero(demo.study.off_map)
    picture = drawn(
        (11, 3.5),
        "The confidence of each fix: it falls where the drive leaves the map, and returns with it.",
        confidence,
        said.confidence,
        said.off_map,
        demo.right,
        stretches=[
            (name, range(int(frames[0]), int(frames[-1]) + 1))
            for name, frames in (("standing still", still), ("off the map", off))
        ],
        accept=ACCEPT,
    )
    fall, rise = (
        plural(int(first[0]) + 1, "frame") if np.isfinite(first[0]) else "no number of frames"
        for first in (noticed, demo.tracker.relocalised)
    )
    before, after = said.confidence[still[0] - 1], said.confidence[still[-1]]
    return Section(
        "How sure it was",
        (
            "A tracker adds up the evidence of all frames so far, and the odometry between them. "
            "Its confidence is the share of its belief within one place of the fix; a fix is sure "
            f"if that is {ACCEPT:g} or more. It was not told of the detour: {fall} after the drive "
            f"left the map, the confidence was below 0.5, and {rise} after it was back, the fixes "
            "were right with more than that again.",
            "The odometry came from wheels that count 2 % too much, with a noise of 5 %. Frames "
            "that repeat each other prove little, so those of a stop hardly count: over the "
            f"{plural(len(still), 'frame')} of it, the confidence went from {before:.2f} to "
            f"{after:.2f}.",
        ),
        {"confidence.png": picture},
    )


def _curves(demo: Demo) -> Sequence[str]:
    """Words about the curves."""
    weighted, plain = demo.study.shown.curve, demo.study.baseline.curve
    false = [
        plural(count, "wrong match", "wrong matches") if count else "no wrong matches"
        for count in (curve.false_positives_at(UPTO) for curve in (weighted, plain))
    ]
    flawless = [curve.recall_at_precision(1.0) for curve in (weighted, plain)]
    more = [
        f"Each curve counts its own correct matches: {weighted.correct} of the weighted sequence "
        f"and {plain.correct} of the unweighted one. Both see the same distances; the weighted one "
        f"draws trusted matches nearer. At recall {UPTO:g} it has accepted {false[0]}, the "
        f"unweighted one {false[1]}. With no wrong match at all, the one gets to recall "
        f"{flawless[0]:.3f}, the other to {flawless[1]:.3f}."
    ]
    early = ~demo.study.run.ready
    if early.any():
        trusted = early & demo.study.run.trusted
        more.append(
            f"Curves leave out {plural(int(early.sum()), 'fix', 'fixes')} at the start, "
            f"whose window is not full yet: {int(trusted.sum())} trusted, "
            f"{int((trusted & ~demo.study.shown.right).sum())} trusted and wrong."
        )
    return more


def _montage(demo: Demo) -> Picture:
    """Queries and the places they were matched to, by outcome."""
    place = demo.run.place

    def pair(query: int) -> Pair:
        caption = f"frame {query} to place {place[query]}\n{demo.off(query)}"
        return Pair(demo.revisit[query], demo.reference[int(place[query])], caption)

    columns = [
        Column(outcome, int(mask.sum()), list(map(pair, spread(np.flatnonzero(mask), PAIRS))))
        for outcome, mask in _masks(demo).items()
    ]
    rows = max(len(column.pairs) for column in columns)
    height, width = demo.revisit[0].shape[:2]
    tall = montage_height((width, height), 10.8, columns=len(columns), rows=rows)
    return drawn(
        (11, tall + 0.2),
        "Pairs of images, a column for each outcome: the query above, the place it was matched to "
        "below.",
        montage,
        columns,
        rows=rows,
        textured=True,
    )


def _made(demo: Demo, seconds: Sequence[tuple[str, float]]) -> Section:
    n, m = demo.study.distances.shape
    c = demo.study.context
    median, p99, slowest = np.quantile(demo.latency, (0.5, 0.99, 1.0)) * 1000
    height, width = demo.revisit[0].shape[:2]
    spacing = float(np.median(np.diff(demo.reference.positions)))
    return sections.made(
        ("Route", f"generated, seed {demo.seed}, a place every {spacing:.3g} m"),
        ("Frames", f"{width} x {height} pixels; {n} on the map, {m} on the second drive"),
        ("Descriptor", "SAD: grey, 64 x 32 pixels, normalized in patches of 8 x 8, a byte each"),
        (
            "Matching",
            f"sequence length {c.sequence_length}, weight {c.weight:g}, floor: the smallest "
            "distance so far; tracker with odometry",
        ),
        ("Right means", f"{demo.study.correct_means} of the true one"),
        (
            "A fix took",
            f"{median:.2f} ms median, {p99:.2f} ms 99th percentile, {slowest:.2f} ms slowest, "
            "from the image to the place",
        ),
        ("On", machine()),
        ("Took", ", ".join(f"{name} {duration:.1f} s" for name, duration in seconds)),
        *FILES.items(),
    )
