"""How a robot moves: the options of the tracker."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Literal

from surefix.errors import mismatch

# A belief off the map above this is rare on the map: at most 3 % of the fixes of 17 of 19 recorded
# drives, but of 18 % (the median) of the fixes in a stretch that the map lacks.
PERHAPS_OFF = 0.2

# How the kinds differ from each other; the rest is the same for all.
KINDS: dict[str, dict[str, Any]] = {
    "steady": {"speeds": (1.0,)},
    "free": {"speeds": (0.0, 0.5, 1.0, 1.5, 2.0)},
    "any": {
        "speeds": (0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0),
        "restart": 0.02,
        "evidence": 0.6,
        "clip": 6.0,
        "by_distance": True,
        "repeat": 0.9,
    },
}
KINDS["loops"] = KINDS["any"] | {
    "speeds": (0.5, 1.0, 1.5, 2.0),
    "leave": 0.1,
    "rejoin": 0.01,
    "hubness": 3.0,
}


@dataclass(frozen=True, init=False)
class Motion:
    """How a robot moves, and how much one query says, for the tracker (method 1.9).

    Parameters
    ----------
    kind : {"free", "steady", "any", "loops"}
        "steady" goes on at its pace; "free" stands, or goes at up to twice its pace; "any" goes at
        up to five times the map's, and its evidence weighs more; "loops" is for ``LoopCloser``: it
        comes to a place rarely, leaves soon, and drives at half to twice its pace. With odometry,
        all are moved by it. The other parameters are those of the kind by default.
    speeds : sequence of float, optional
        Speeds that the robot may have, ascending, in units of the pace; those of the kind by
        default.
    pace : float
        The places that the robot usually passes between two queries; at most 1000 with the fastest
        speed.
    switching : float
        The probability that the speed changes to a neighbouring one between two queries.
    jitter : float
        The probability of one place less than the speed says, and that of one more.
    restart : float
        The probability that the robot is suddenly anywhere on the route.
    leave, rejoin : float
        The probabilities that it leaves the map between two queries, and that it comes back.
    evidence : float
        How much one query weighs, `lambda`.
    clip : float
        Evidence counts up to this many standard deviations.
    hubness : float
        The queries after which a place's mean distance is half believed.
    by_distance : bool
        Whether a known advance counts by its length. If so, the belief moves by its fraction, too,
        jitter grows with it, and restart, leave and rejoin are as much less likely as it is shorter
        than a place.
        If not, the belief moves by whole places of the way so far.
    repeat : float
        The correlation from which on two queries in a row count less and less as two: the view
        repeats, so that the robot stands. It is asked if the advance is not known. 1 for never.

    Raises
    ------
    SurefixValueError
        For another kind or no sequence of speeds here; for a number outside its range when it is
        used.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> distances = 1 - np.eye(6, dtype=np.float32)
    >>> motion = surefix.Motion("steady", restart=0.001)
    >>> surefix.match_distances(distances, motion=motion).place.tolist()[1:]
    [1, 2, 3, 4, 5]
    """

    speeds: tuple[float, ...]
    pace: float = 1.0
    switching: float = 0.05
    jitter: float = 0.01
    restart: float = 0.01
    leave: float = 0.05
    rejoin: float = 0.1
    evidence: float = 0.5
    clip: float = 4.0
    hubness: float = 10.0
    by_distance: bool = False
    repeat: float = 1.0

    def __init__(
        self,
        kind: Literal["free", "steady", "any", "loops"] = "free",
        *,
        speeds: Sequence[float] | None = None,
        pace: float | None = None,
        switching: float | None = None,
        jitter: float | None = None,
        restart: float | None = None,
        leave: float | None = None,
        rejoin: float | None = None,
        evidence: float | None = None,
        clip: float | None = None,
        hubness: float | None = None,
        by_distance: bool | None = None,
        repeat: float | None = None,
    ) -> None:
        if not isinstance(kind, str) or kind not in KINDS:
            raise mismatch("motion", f"one of {', '.join(KINDS)}", repr(kind))
        given = {name: value for name, value in locals().items() if value is not None}
        for field in fields(self):
            default = KINDS[kind].get(field.name, field.default)
            object.__setattr__(self, field.name, given.get(field.name, default))
        try:
            object.__setattr__(self, "speeds", tuple(self.speeds))
        except TypeError:
            raise mismatch("motion.speeds", "a sequence of numbers", repr(speeds)) from None
