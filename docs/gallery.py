"""The figures and the table of the gallery, of real routes that are not ours to publish.

``python docs/gallery.py DATA`` draws them anew and prints the table. DATA has a folder for each
route, in which frame ``i`` of both drives shows the same place:

- ``nordland/summer_0000_1149.npy`` and ``winter_0000_1149.npy``, uint8 (1150, 32, 64);
- ``gardens_point/day_left/*.jpg`` and ``day_right/*.jpg``, 100 each;
- ``corridor/reference/*.jpg`` and ``query/*.jpg``, 111 each.
"""

import contextlib
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pages

import surefix
from surefix import plot

__all__ = ["HEADINGS", "ROUTES", "Driven", "draw", "drive", "row"]

# The map's images, the queries', and the name on the page.
ROUTES = {
    "nordland": ("summer_0000_1149.npy", "winter_0000_1149.npy", "Nordland, summer to winter"),
    "gardens_point": ("day_left", "day_right", "Gardens Point, left to right"),
    "corridor": ("reference", "query", "indoor corridor, two viewpoints"),
}
HEADINGS = (
    *("route", "frames", "single matches right", "trusted", "trusted and right"),
    *("tracker right", "confidence above 0.95", "those right"),
)
SURE = 0.95


@dataclass(frozen=True)
class Driven:
    """A drive along a route: by the paper alone, and with the tracker."""

    alone: surefix.Run
    plain: surefix.Run
    tracked: surefix.Run
    truth: np.ndarray


def drive(data: Path, route: str) -> Driven:
    """Localizes the queries of a route, with the defaults of the library and ``motion="any"``."""
    first, second, _ = ROUTES[route]
    places, queries = (_images(data / route / name) for name in (first, second))
    known = surefix.Map.from_images(places, progress=False)
    D = known.distances(queries)
    alone, plain, tracked = (
        surefix.match_distances(D, floor="running", **options)
        for options in ({}, {"weight": 0.0}, {"motion": "any"})
    )
    return Driven(alone, plain, tracked, np.arange(D.shape[1]))


def row(route: str, driven: Driven) -> list[str]:
    """The row of the page's table."""
    single, track = (
        np.abs(place - driven.truth) <= 1
        for place in (driven.alone.single_place, driven.tracked.place)
    )
    trusted, sure = driven.alone.trusted, driven.tracked.confidence > SURE
    counts = (len(single), single, trusted, trusted & single, track, sure, sure & track)
    return [ROUTES[route][2], *(str(np.sum(count)) for count in counts)]


def draw(route: str, driven: Driven, ending: str = "") -> dict[str, bytes]:
    """The figures of a route as PNG, by their names in ``images``; ``-dark`` on dark paper."""
    with pages.dark_paper() if ending else contextlib.nullcontext():
        axes = {"matrix": (driven.tracked.plot(driven.truth), (4.2, 4.7))}
        curves = {
            "tracker": driven.tracked,
            "weighted sequence": driven.alone,
            "plain sequence": driven.plain,
        }
        ax = None
        for name, run in curves.items():
            ax = surefix.evaluate(run, driven.truth).plot(ax=ax, name=name)
        axes["curves"] = (ax, (6.4, 4.2))
        axes["confidence"] = (driven.tracked.plot(driven.truth, kind="confidence"), (6.4, 2.8))
        return {
            f"gallery-{route.replace('_', '-')}-{name}{ending}.png": plot.png(ax, size=size)
            for name, (ax, size) in axes.items()
        }


def _images(path: Path) -> str | np.ndarray:
    return np.load(path) if path.suffix == ".npy" else str(path)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("expected the folder of the data: python docs/gallery.py DATA")
    print("|".join(("", *HEADINGS, "")), "|".join(("", *["---"] * len(HEADINGS), "")), sep="\n")
    for route in ROUTES:
        driven = drive(Path(sys.argv[1]), route)
        print(f"| {' | '.join(row(route, driven))} |")
        for ending in ("", "-dark"):
            for name, picture in draw(route, driven, ending).items():
                pages.keep(picture, pages.IMAGES / name)
