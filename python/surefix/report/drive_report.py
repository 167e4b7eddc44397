"""The report of a drive: one page, its pictures, and what they were made from."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from surefix import __version__
from surefix.machine import machine
from surefix.plot.images import spread
from surefix.plot.outcome import Outcome
from surefix.report import drive_pictures as pictures
from surefix.report import drive_sections as sections
from surefix.report.drive import Drive
from surefix.report.page import Picture, Section, Tile, page
from surefix.report.staged import PAGE, staged

__all__ = ["write_report"]

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


def write_report(
    drive: Drive, folder: Path, command: str, seconds: Sequence[tuple[str, float]]
) -> Path:
    """Writes the page and all that belongs to it into ``folder``; returns the path of the page.

    Parameters
    ----------
    command : str
        What makes this drive again.
    seconds : sequence of (name, float)
        What took how long.

    Raises
    ------
    OSError
        Where a file cannot be written.
    """
    with staged(folder) as inside:
        drive.run.to_csv(inside / "fixes.csv")
        drive.baseline.to_csv(inside / "baseline.csv")
        np.save(inside / "distances.npy", drive.distances)
        truth = zip(drive.truth, drive.revisit.positions, strict=True)
        lines = (
            f"{frame},{place},{position:.3f}\n" for frame, (place, position) in enumerate(truth)
        )
        (inside / "truth.csv").write_text(
            "frame,place,position\n" + "".join(lines), encoding="utf-8"
        )
        drawn = {
            "distance_matrix.png": pictures.matrix(drive),
            "close_up.png": pictures.close_up(drive),
            "route.png": pictures.strip(drive),
            "precision_recall.png": pictures.curves(drive),
            "montage.png": pictures.pairs(drive),
        }
        for name, picture in drawn.items():
            (inside / name).write_bytes(picture.light)
        text = page(
            "Where am I on this route, and may I trust that answer?",
            _lead(drive),
            _hero(drive),
            _tiles(drive),
            (
                sections.matrix(drive, drawn["distance_matrix.png"], drawn["close_up.png"]),
                sections.route(drive, drawn["route.png"]),
                sections.curves(drive, drawn["precision_recall.png"]),
                sections.pairs(drive, drawn["montage.png"]),
                sections.meaning(drive),
                _made(drive, command, seconds),
            ),
        )
        (inside / PAGE).write_text(text, encoding="utf-8")
    return folder / PAGE


def _lead(drive: Drive) -> Sequence[str]:
    kilometres = float(drive.reference.positions[-1]) / 1000
    return (
        f"A camera drove {kilometres:.1f} km on a summer noon, and surefix made a map of it: "
        f"{len(drive.distances)} places, in order. Then it drove there again on a winter afternoon, among "
        "other cars, not quite in its old lane. Frame by frame, surefix said where it was, and which of "
        "these answers to trust. Nothing was trained, and nobody told it the truth.",
        "Both drives are generated, so the truth is known, and every answer can be held against it.",
    )


def _hero(drive: Drive) -> Sequence[Picture]:
    outcome = next(outcome for outcome in Outcome if drive.counts[outcome])
    query = spread(np.flatnonzero(drive.masks[outcome]), 1)[0]
    place = int(drive.run.place[query])
    seen = f"The second drive, frame {query}: what the camera sees."
    found = f"The map, place {place}: what surefix answers. {outcome.value.capitalize()}."
    return (
        pictures.photograph(drive.revisit[query], f"A street in winter, frame {query}.", seen),
        pictures.photograph(drive.reference[place], f"A street in summer, place {place}.", found),
    )


def _tiles(drive: Drive) -> Sequence[Tile]:
    m, right = len(drive.run), int(drive.right.sum())
    good, bad = drive.counts[Outcome.TRUSTED_RIGHT], drive.counts[Outcome.TRUSTED_WRONG]
    trusted = good + bad
    median, p99 = np.quantile(drive.latency, (0.5, 0.99)) * 1000
    weighted, baseline = drive.weighted_curve.auc(0.2), drive.baseline_curve.auc(0.2)
    area, unweighted = (
        "area under the curve up to recall 0.2",
        f"unweighted sequence: {baseline:.2f}",
    )
    return (
        Tile(
            "trusted-right",
            _share(good, trusted),
            "of the trusted fixes are right",
            f"{good} of {trusted}",
        ),
        Tile("right", _share(right, m), "of all fixes are right", f"{right} of {m}"),
        Tile("trusted", _share(trusted, m), "of the frames got a trusted fix", f"{trusted} of {m}"),
        Tile("trusted-wrong", str(bad), "trusted, and wrong all the same", _how_far(drive)),
        Tile("area", f"{weighted:.2f}", area, unweighted),
        Tile("latency", f"{median:.2f} ms", "for a fix, median", f"99 of 100 within {p99:.2f} ms"),
    )


def _made(drive: Drive, command: str, seconds: Sequence[tuple[str, float]]) -> Section:
    n, m = drive.distances.shape
    median, p99, slowest = np.quantile(drive.latency, (0.5, 0.99, 1.0)) * 1000
    width, height = drive.size
    spacing = float(np.median(np.diff(drive.reference.positions)))
    quantiles = f"{median:.2f} ms median, {p99:.2f} ms 99th percentile, {slowest:.2f} ms slowest"
    matching = (
        f"sequence length {drive.sequence_length}, weight 0.99, floor: the smallest distance so far"
    )
    rows = (
        ("Made with", f"surefix {__version__}: {command}"),
        ("Route", f"generated, seed {drive.seed}, a place every {spacing:.3g} m"),
        ("Frames", f"{width} x {height} pixels; {n} on the map, {m} on the second drive"),
        ("Descriptor", "SAD: grey, 64 x 32 pixels, normalized in patches of 8 x 8, a byte each"),
        ("Matching", matching),
        ("Right means", f"within {drive.tolerance} place of the true one"),
        ("A fix took", f"{quantiles}, from the image to the place"),
        ("On", machine()),
        ("Took", ", ".join(f"{name} {duration:.1f} s" for name, duration in seconds)),
        *FILES.items(),
    )
    return Section("How this was made", ("So that it can be checked, and done again.",), (), rows)


def _share(part: int, whole: int) -> str:
    return f"{100 * part / whole:.1f} %" if whole else "none"


def _how_far(drive: Drive) -> str:
    off = drive.metres_off[drive.masks[Outcome.TRUSTED_WRONG]]
    if len(off) == 0:
        return "on this drive"
    return f"{off.min():.0f} to {off.max():.0f} m off" if len(off) > 1 else f"{off[0]:.0f} m off"
