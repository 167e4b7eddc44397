"""The tracker: where the robot is by all queries so far."""

from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

from rival_track import Answer, ArrayTracker, HiddenMarkov
from surefix import Matcher, baselines
from test_push import COLUMNS, drive
from work import Entrant, Work, pushing, read_by_push

SPEEDS = {"steady": [1.0], "free": [0.0, 0.5, 1.0, 1.5, 2.0]}
OURS, PAPER, ARRAYS = "surefix", "surefix, without motion", "NumPy, the filter alone"
MARKOV, TOPOLOGICAL = "hmmlearn, the forward pass alone", "a topological filter in NumPy"


def same_tracks(ours: list[Answer], theirs: list[Answer]) -> str:
    """Places must be the same, and probabilities within 1e-6."""
    for query, (mine, other) in enumerate(zip(ours, theirs, strict=True)):
        if mine[0] != other[0] or np.abs(np.subtract(mine[1:], other[1:])).max() > 1e-6:
            return f"query {query}: surefix says {mine}, the rival {other}"
    return ""


@pytest.fixture(scope="module", params=[(k, big) for k in (*SPEEDS, "any") for big in (0, 1)])
def tracker(request: Any, quick: bool) -> Work:
    kind, large = request.param
    places = (10_000 if quick else 100_000) if large else 1800
    columns = drive(places)
    whole = np.stack(columns, axis=1)

    def tracks() -> list[Answer]:
        live = Matcher(places, motion=kind)
        found = [live.push(column).track for column in columns]
        return [(track.place, track.confidence, track.off_map) for track in found]

    def found(ours: list[Answer], theirs: list[Any]) -> str:
        """Another method: both must have found the drive by its end."""
        end = places // 3 + COLUMNS - 1
        got = ours[-1][0], theirs[-1][0]
        return "" if got == (end, end) else f"expected {end} at the end, got {got}"

    def topological() -> list[Any]:
        return [(place, 0.0, False) for place in baselines.topological(whole).place]

    entrants = {
        OURS: Entrant(pushing(lambda: Matcher(places, motion=kind).push, columns).call, tracks),
        PAPER: pushing(lambda: Matcher(places).push, columns, agrees=found),
    }
    if kind in SPEEDS:
        entrants[ARRAYS] = Entrant(
            pushing(lambda: ArrayTracker(places, SPEEDS[kind]).push, columns).call,
            lambda: [*map(ArrayTracker(places, SPEEDS[kind]).push, columns)],
        )
    if kind == "steady":
        entrants[TOPOLOGICAL] = Entrant(topological, agrees=found, scale=1 / COLUMNS)
    if kind == "steady" and not large and find_spec("hmmlearn"):
        markov = HiddenMarkov(places).learn(columns)
        entrants[MARKOV] = Entrant(markov.forward, scale=1 / COLUMNS)
    # The belief that was and the sums of distances, in float64.
    count = len(SPEEDS.get(kind, range(7)))
    read = read_by_push(places, 2) + 8 * places * (1 + count)
    return Work(f"Matcher.push, n = {places:,}, motion {kind}", entrants, same_tracks, read)


@pytest.mark.parametrize("name", [OURS, PAPER, ARRAYS, MARKOV, TOPOLOGICAL])
def test_tracker(tracker: Work, name: str, measure: Any) -> None:
    """Distances to fix, with motion"""
    measure(tracker, name)
