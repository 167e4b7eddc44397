"""Precision and recall of loop edges: `surefix.LoopCloser` beside the nearest place and a sequence.

    python benches/python/loop_closure.py [--data DATA] [--picture PICTURE]

A generated drive passes a road in summer, another road, a part of the first in winter, the other
road further on, and a part of the first in autumn, each lap with its own traffic, light and noise;
and day_right and day_left of Gardens Point, one after the other. An edge is right if its frames are
at most 3 places apart. Recall counts the frames that were at an earlier place.
"""

import argparse
from pathlib import Path

import numpy as np
import numpy.typing as npt

import surefix
from surefix.simulate import Route

EXCLUDE, LASTING, NEAR, LENGTH = 30, 10, 3, 10
SEEDS = range(11, 19)  # the defaults were chosen on 1 to 4
Floats = npt.NDArray[np.float64]
Drive = tuple[list[npt.NDArray[np.uint8]], Floats]  # images, and where along which road


def generated(seed: int) -> Drive:
    """670 frames, of which 230 are at earlier places."""
    road, other = (
        Route(places, (96, 48), seed=s) for places, s in [(240, seed), (400, 999 + seed)]
    )
    lap = {"speed_jitter": 0.4, "occluders": 0.5, "noise": 0.12}
    winter = lap | {"season": 0.9, "light": 0.4, "lateral_offset": 0.4}
    autumn = lap | {"season": 0.45, "light": 0.1, "lateral_offset": -0.3}
    legs = [
        (road, 1, lap, 0, 240, 0.0),
        (other, 1, lap, 0, 100, 1e6),
        (road, 2, winter, 40, 150, 0.0),
        (other, 2, winter, 150, 250, 1e6),
        (road, 3, autumn, 100, 220, 0.0),
    ]
    images, where = [], []
    for route, own, conditions, start, end, far in legs:
        drive = route.traverse(seed=own, **conditions)
        images += [drive[frame] for frame in range(start, end)]
        where += [far + place for place in drive.positions[start:end] / 3.0]
    return images, np.array(where)


def gardens_point(data: Path) -> Drive:
    """day_right, followed by day_left: the same walk, a step to the side."""
    sides = [
        surefix.find_images(data / "gardens_point" / side) for side in ("day_right", "day_left")
    ]
    images = [surefix.read_image(file) for side in sides for file in side]
    return images, np.concatenate([np.arange(float(len(side))) for side in sides])


class Rated:
    """The place of each frame, and how sure a method is of it; -inf for no edge."""

    def __init__(self, place: npt.NDArray[np.int64], score: Floats, where: Floats) -> None:
        m = len(where)
        apart = np.abs(where[:, None] - where)
        old = np.arange(m)[:, None] + EXCLUDE < np.arange(m)
        self.there = np.where(old, apart, np.inf).min(axis=0) <= 1
        self.right = apart[place, np.arange(m)] <= NEAR
        self.place, self.score = place, score

    def at(self, bar: float) -> tuple[int, float, float]:
        """How many edges there are above a bar, their precision and their recall."""
        edges = self.score >= bar
        count, right = int(edges.sum()), edges & self.right
        return count, right.sum() / max(count, 1), (right & self.there).sum() / self.there.sum()

    def recall_at(self, precision: float) -> float:
        """The largest recall at a precision of at least this."""
        found = [self.at(bar) for bar in np.unique(self.score[np.isfinite(self.score)])]
        return max([recall for _, p, recall in found if p >= precision], default=0.0)

    def area(self) -> float:
        """Under the curve, with the best precision at each recall or more."""
        order = np.argsort(-self.score, kind="stable")
        order = order[np.isfinite(self.score[order])]
        right = np.cumsum(self.right[order] & self.there[order])
        precision = np.cumsum(self.right[order]) / np.arange(1, len(order) + 1)
        best = np.maximum.accumulate(precision[::-1])[::-1]
        return float(np.trapezoid(best, right / self.there.sum()))


def closed(images: list[npt.NDArray[np.uint8]], where: Floats) -> tuple[Rated, Floats]:
    """By the loop closer: the score is the confidence that has lasted. And the distances."""
    closer = surefix.LoopCloser(surefix.Sad(), EXCLUDE)
    m = len(images)
    D, place, sure = np.full((m, m), np.inf), np.zeros(m, np.int64), np.zeros(m)
    for frame, image in enumerate(images):
        said = closer.push(image)
        n = len(closer.distances)
        D[:n, frame] = closer.distances
        # As in the loop closer: the newest places make no edge.
        place[frame] = said.place
        sure[frame] = said.confidence if said.place + 5 < n else -np.inf
    lasts = np.full(m, -np.inf)
    for frame in range(LASTING - 1, m):
        row = slice(frame - LASTING + 1, frame + 1)
        if np.abs(np.diff(place[row])).max() <= 5:
            lasts[frame] = sure[row].min()
    default = lasts >= 0.9
    assert [edge.frame for edge in closer.edges] == np.flatnonzero(default).tolist()
    return Rated(place, lasts, where), D


def nearest(D: Floats, where: Floats) -> Rated:
    """By the nearest place alone."""
    return Rated(D.argmin(axis=0), -D.min(axis=0), where)


def sequence(D: Floats, where: Floats) -> Rated:
    """By the least mean of 10 distances along a diagonal."""
    m = len(where)
    S = np.full((m, m), np.inf)
    for frame in range(LENGTH - 1, m):
        backs = np.arange(LENGTH)
        for place in range(LENGTH - 1, frame - EXCLUDE):
            S[place, frame] = D[place - backs, frame - backs].mean()
    return Rated(S.argmin(axis=0), -S.min(axis=0), where)


def row(name: str, rated: list[Rated]) -> str:
    """A line of the table: means over the drives."""
    full, most, area = (
        np.mean(values)
        for values in zip(
            *[(r.recall_at(1.0), r.recall_at(0.95), r.area()) for r in rated], strict=True
        )
    )
    return f"| {name} | {full:.2f} | {most:.2f} | {area:.2f} |"


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, help="the folder with gardens_point")
    given = parser.parse_args()
    drives = {f"generated, {len(SEEDS)} seeds": [generated(seed) for seed in SEEDS]}
    if given.data is not None:
        drives["Gardens Point"] = [gardens_point(given.data)]
    for name, each in drives.items():
        ours, near, along = [], [], []
        for images, where in each:
            rated, D = closed(images, where)
            ours.append(rated)
            near.append(nearest(D, where))
            along.append(sequence(D, where))
        print(f"\n{name}\n\n| | recall at precision 1 | at 0.95 | area |\n|---|---|---|---|")
        print(row("nearest place", near), row("sequence of 10", along), sep="\n")
        print(row("loop closer", ours))
        print("\n| confidence | edges | precision | recall |\n|---|---|---|---|")
        for bar in (0.5, 0.6, 0.7, 0.8, 0.9, 0.95):
            counts, _, recalls = zip(*[r.at(bar) for r in ours], strict=True)
            right = sum(int(((r.score >= bar) & r.right).sum()) for r in ours)
            total = sum(counts)
            print(f"| {bar} | {total} | {right / max(total, 1):.3f} | {np.mean(recalls):.2f} |")


if __name__ == "__main__":
    main()
