"""The report of ``surefix demo``: a study with and without weights, and the drive in pictures."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from surefix import match_distances
from surefix._words import plural, verb
from surefix.baselines.distances import Flags, Floats
from surefix.machine import machine
from surefix.plot.images import Column, Pair, montage, montage_height, spread
from surefix.plot.outcome import Outcome, longest_gap, outcomes
from surefix.report import figures, sections
from surefix.report.page import Picture, Section, Tile, drawn, photograph, write
from surefix.report.tables import write_csv
from surefix.simulate import Traverse
from surefix.study import UPTO, Study

__all__ = ["FILES", "Demo", "write_report"]

FILES = {
    "report.html": "this page, with its pictures inside",
    "distance_matrix.png": "the matrix with every match",
    "close_up.png": "a part of it, cell by cell",
    "route.png": "right and wrong along the route",
    "precision_recall.png": "the curves",
    "montage.png": "queries and the places they were matched to",
    "fixes.csv": "every fix of the weighted sequence",
    "baseline.csv": "every fix of the unweighted sequence",
    "truth.csv": "each frame's true place, and its position in metres",
    "distances.npy": "the distance matrix, float32 (places, queries)",
}

LABEL = "distance (mean difference, in standard deviations of a patch)"
PAIRS = 3


@dataclass(frozen=True, eq=False)
class Demo:
    """A drive along a generated route, localized on the map of an earlier drive.

    Attributes
    ----------
    study : Study
        Of the distances that the localizer saw, with the truth in places.
    reference, revisit : Traverse
        The drive that was mapped, and the one that was localized.
    seed : int
    latency : array of float64, shape (m,)
        Seconds that each push took.
    """

    study: Study
    reference: Traverse
    revisit: Traverse
    seed: int
    latency: Floats

    @property
    def right(self) -> Flags:
        """Which fixes are right."""
        return self.study.shown.right

    @cached_property
    def masks(self) -> dict[Outcome, Flags]:
        """Which fixes had each outcome."""
        return outcomes(self.right, self.study.run.trusted)

    @cached_property
    def counts(self) -> dict[Outcome, int]:
        """The number of fixes of each outcome."""
        return {outcome: int(mask.sum()) for outcome, mask in self.masks.items()}

    @property
    def trusted_point(self) -> tuple[float, float] | None:
        """Recall and precision of the trusted fixes, as the curves count; None without any."""
        ready, trusted = self.study.run.ready, self.study.run.trusted
        accepted = int((ready & trusted).sum())
        found = int((ready & trusted & self.right).sum())
        correct = max(1, int((ready & self.right).sum()))
        return (found / correct, found / accepted) if accepted else None

    @cached_property
    def metres_off(self) -> Floats:
        """The distance along the road between each fix and the camera."""
        return np.abs(self.reference.positions[self.study.run.place] - self.revisit.positions)

    @property
    def gap_metres(self) -> float:
        """The longest stretch between two fixes that are trusted and right, or an end."""
        positions, gap = self.revisit.positions, longest_gap(self.masks[Outcome.TRUSTED_RIGHT])
        stop = min(gap.stop, len(positions) - 1)
        return float(positions[stop] - positions[max(gap.start - 1, 0)])


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
    lead = (
        f"A camera drove {kilometres:.1f} km on a summer noon, and surefix made a map of it: "
        f"{len(demo.study.distances)} places, in order. Then it drove there again on a winter "
        "afternoon, among other cars, not quite in its old lane. Frame by frame, surefix said "
        "where it was, and which of these answers to trust. Nothing was trained, and the truth "
        "was not used.",
        "Both drives are generated, so the truth is known, and every answer can be checked.",
    )
    return write(
        folder,
        "Where am I on this route, and may I trust that answer?",
        lead,
        _hero(demo),
        _tiles(demo),
        [*_sections(demo), _made(demo, command, seconds)],
        lambda inside: _write_tables(demo, inside),
    )


def _write_tables(demo: Demo, folder: Path) -> None:
    study = demo.study
    study.run.to_csv(folder / "fixes.csv")
    plain = match_distances(study.distances, **study.context.options | {"weight": 0.0})
    plain.to_csv(folder / "baseline.csv")
    np.save(folder / "distances.npy", study.distances)
    places = zip(study.true_place, demo.revisit.positions, strict=True)
    rows = ((frame, place, f"{at:.3f}") for frame, (place, at) in enumerate(places))
    write_csv(folder / "truth.csv", "frame,place,position", rows)


def _hero(demo: Demo) -> Sequence[Picture]:
    outcome = next(outcome for outcome in Outcome if demo.counts[outcome])
    query = spread(np.flatnonzero(demo.masks[outcome]), 1)[0]
    place = int(demo.study.run.place[query])
    view = f"The second drive, frame {query}: the camera's view."
    answer = f"The map, place {place}: surefix's answer. {outcome.value.capitalize()}."
    return (
        photograph(demo.revisit[query], f"A street in winter, frame {query}.", view),
        photograph(demo.reference[place], f"A street in summer, place {place}.", answer),
    )


def _tiles(demo: Demo) -> Sequence[Tile]:
    m, bad = len(demo.study), demo.counts[Outcome.TRUSTED_WRONG]
    good = demo.counts[Outcome.TRUSTED_RIGHT]
    median, p99 = np.quantile(demo.latency, (0.5, 0.99)) * 1000
    within = f"99 of 100 within {p99:.2f} ms"
    weighted, plain = (result.area[0] for result in (demo.study.shown, demo.study.baseline))
    area, unweighted = (
        f"area under the curve up to recall {UPTO:g}",
        f"unweighted sequence: {plain:.2f}",
    )
    off = demo.metres_off[demo.masks[Outcome.TRUSTED_WRONG]]
    how_far = "on this drive"
    if len(off):
        to = f" to {off.max():.0f}" if len(off) > 1 else ""
        how_far = f"{off.min():.0f}{to} m off"
    return (
        sections.share("trusted-right", good, good + bad, "of the trusted fixes are right"),
        sections.share("right", int(demo.right.sum()), m, "of all fixes are right"),
        sections.share("trusted", good + bad, m, "of the frames got a trusted fix"),
        Tile("trusted-wrong", str(bad), "trusted, and wrong all the same", how_far),
        Tile("area", f"{weighted:.2f}", area, unweighted),
        Tile("latency", f"{median:.2f} ms", "for a fix, median", within),
    )


def _sections(demo: Demo) -> Sequence[Section]:
    """The page from the matrix on, in its order."""
    study, run, m = demo.study, demo.study.run, len(demo.study)
    _, bad, held_right, held = demo.counts.values()
    trusted, single_right = int(run.trusted.sum()), int(study.single_right.sum())
    matrix = sections.matrix(
        study,
        figures.matrix(study, every=True, label=LABEL),
        "The true path runs from corner to corner; season, dusk and traffic have all but wiped it "
        "out, and many other places look just as near. By the nearest place alone, "
        f"{single_right} of {m} frames {verb(single_right)} right.",
    )
    strip = figures.strip(
        study, demo.revisit.positions, ("weighted, trusted fixes only", demo.right, run.trusted)
    )
    route = Section(
        "Along the route",
        (
            "A robot that acts on every fix is sent to a wrong place "
            f"{plural(bad + held, 'time')} in {m}. One that acts on the trusted fixes only, "
            f"{plural(bad, 'time')}. The price: {plural(held_right, 'right fix', 'right fixes')} "
            f"{verb(held_right)} held back together with the {plural(held, 'wrong one')}, and the "
            "longest stretch without a fix that is both trusted and right is "
            f"{demo.gap_metres:.0f} m. Odometry has to bridge it.",
        ),
        {"route.png": strip},
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
            f"{plural(trusted, 'trusted case')}. The fix is the place of the sequence, and in "
            f"{differ} of them that is another place.",
            "This is a drawn world, in conditions set so that plain image matching fares about as "
            "it does on real roads. It shows what the method does; how well it does it, only your "
            "own route can tell.",
        ),
    )
    return matrix, route, _curves(demo), *sections.methods(study), see, meaning


def _curves(demo: Demo) -> Section:
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
    early, star = ~demo.study.run.ready, "the trusted fixes alone"
    if early.any():
        star = "the trusted fixes of full windows alone"
        trusted = early & demo.study.run.trusted
        more.append(
            f"Curves and star leave out {plural(int(early.sum()), 'fix', 'fixes')} at the start, "
            f"whose window is not full yet: {int(trusted.sum())} trusted, "
            f"{int((trusted & ~demo.right).sum())} trusted and wrong."
        )
    return sections.curves(demo.study, figures.curves(demo.study, demo.trusted_point, star), *more)


def _montage(demo: Demo) -> Picture:
    """Queries and the places they were matched to, by outcome."""
    place = demo.study.run.place

    def pair(query: int) -> Pair:
        caption = f"frame {query} to place {place[query]}\n{demo.metres_off[query]:.0f} m off"
        return Pair(demo.revisit[query], demo.reference[int(place[query])], caption)

    columns = [
        Column(outcome, demo.counts[outcome], list(map(pair, spread(np.flatnonzero(mask), PAIRS))))
        for outcome, mask in demo.masks.items()
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


def _made(demo: Demo, command: str, seconds: Sequence[tuple[str, float]]) -> Section:
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
            "distance so far",
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
        command=command,
    )
