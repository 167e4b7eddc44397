"""The tracker's filter in NumPy, as a careful user would write it, and in hmmlearn."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
# Place, confidence, off the map.
Answer = tuple[int, float, float]
# What both motions have in common (method 1.9).
JITTER = np.array([0.01, 0.98, 0.01])
SWITCHING, RESTART, LEAVE, REJOIN, EVIDENCE, CLIP, HUBNESS = 0.05, 0.01, 0.05, 0.1, 0.5, 4.0, 10
KEEP, OFF = (1 - LEAVE) * (1 - RESTART), 0.05


class Evidence:
    """How much a query speaks for each place: distances corrected for hubness, standardised."""

    def __init__(self, places: int) -> None:
        self.sums, self.queries = np.zeros(places), 0

    def of(self, d: npt.NDArray[np.float32]) -> Floats:
        self.sums += d
        self.queries += 1
        x = d - self.sums / (self.queries + HUBNESS)
        x -= x.mean()
        x /= -x.std()
        return np.exp(EVIDENCE * np.clip(x, -CLIP, CLIP, out=x), out=x)


class ArrayTracker:
    """The filter alone, whole arrays at a time: a convolution for each speed."""

    def __init__(self, places: int, speeds: Sequence[float]) -> None:
        self.evidence = Evidence(places)
        self.belief = np.full((len(speeds), places), (1 - OFF) / (len(speeds) * places))
        self.off = OFF
        self.steps = [self.step(speed) for speed in speeds]

    @staticmethod
    def step(speed: float) -> tuple[int, Floats]:
        """The least move, and the probability of it and of those above."""
        if not speed:
            return 0, np.ones(1)
        whole = int(speed)
        return whole - 1, np.convolve(np.trim_zeros([1 - speed + whole, speed - whole]), JITTER)

    def push(self, d: npt.NDArray[np.float32]) -> Answer:
        """Place, confidence and belief off the map after one query."""
        before, places = self.belief, d.size
        if len(before) > 1:
            to_neighbours = SWITCHING * before
            to_neighbours[1:-1] *= 0.5
            before = (1 - SWITCHING) * before
            for one, other in pairwise(range(len(before))):
                before[one] += to_neighbours[other]
                before[other] += to_neighbours[one]
        belief = np.zeros_like(before)
        for row, out, (least, chances) in zip(before, belief, self.steps, strict=True):
            all_moves = np.convolve(row, chances)
            skip = max(-least, 0)
            moved = all_moves[skip : skip + places - max(least, 0)]
            out[max(least, 0) : max(least, 0) + moved.size] = moved
        on = 1 - self.off
        left = on - belief.sum()
        belief *= KEEP
        belief += (REJOIN * self.off + (1 - LEAVE) * RESTART * on + KEEP * left) / belief.size
        e = self.evidence.of(d)
        belief *= e
        off = ((1 - REJOIN) * self.off + LEAVE * on) * e.mean()
        in_places = belief.sum(axis=0)
        total = in_places.sum() + off
        belief /= total
        self.belief, self.off = belief, off / total
        return answer(in_places / total, self.off)


def answer(belief: Floats, off: float) -> Answer:
    """The answer within one place."""
    place = int(belief.argmax())
    return place, float(belief[max(0, place - 1) : place + 2].sum()), float(off)


class HiddenMarkov:
    """hmmlearn's forward pass of "steady": a hidden state for each place, and one off the map.

    Each query is a symbol of its own, and what is emitted is its evidence, computed before.
    """

    def __init__(self, places: int) -> None:
        from hmmlearn.hmm import CategoricalHMM

        self.places = places
        moves = np.zeros((places + 1, places + 1))
        onto, off = moves[:places, :places], places
        for by, chance in zip((0, 1, 2), JITTER, strict=True):
            onto += KEEP * chance * np.eye(places, k=by)
        # What moves beyond the end starts anew, as after a restart.
        onto += (1 - LEAVE - onto.sum(axis=1, keepdims=True)) / places
        moves[:places, off], moves[off, :places], moves[off, off] = (
            LEAVE,
            REJOIN / places,
            1 - REJOIN,
        )
        self.model = CategoricalHMM(places + 1, implementation="scaling", init_params="")
        start = np.full(places + 1, (1 - OFF) / places)
        start[off] = OFF
        self.model.startprob_, self.model.transmat_ = start @ moves, moves

    def learn(self, columns: Sequence[Any]) -> "HiddenMarkov":
        """Takes the evidence of the queries."""
        evidence = Evidence(self.places)
        e = np.stack([evidence.of(column) for column in columns], axis=1)
        e = np.vstack([e, e.mean(axis=0)])
        e /= 2 * e.sum(axis=1).max()
        # The rest is a symbol that is never seen.
        self.model.emissionprob_ = np.hstack([e, 1 - e.sum(axis=1, keepdims=True)])
        self.model.n_features = e.shape[1] + 1
        self.model._check()
        self.evidence = self.model._compute_likelihood(np.arange(len(columns))[:, None])
        return self

    def forward(self) -> list[Answer]:
        """The filter's answers to all queries."""
        from hmmlearn._hmmc import forward_scaling

        model = self.model
        _log, beliefs, _scales = forward_scaling(model.startprob_, model.transmat_, self.evidence)
        return [answer(belief[:-1], belief[-1]) for belief in beliefs]
