"""How a robot moves: the options of the tracker."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from surefix.errors import mismatch

SPEEDS = {"steady": (1.0,), "free": (0.0, 0.5, 1.0, 1.5, 2.0)}


@dataclass(frozen=True, init=False)
class Motion:
    """How a robot moves, and how much one query says, for the tracker (method 1.9).

    Parameters
    ----------
    kind : {"free", "steady"}
        "steady" goes on at its pace; "free" stands, or goes at up to twice its pace. With odometry,
        both are moved by it.
    speeds : sequence of float, optional
        Speeds that the robot may have, ascending, in units of the pace; those of the kind by
        default.
    pace : float
        The places that the robot usually passes between two queries.
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

    Raises
    ------
    SurefixValueError
        For another kind here; for a number outside its range when it is used.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> distances = 1 - np.eye(6, dtype=np.float32)
    >>> motion = surefix.Motion("steady", restart=0.001)
    >>> surefix.match_distances(distances, motion=motion).place.tolist()[1:]
    [1, 2, 3, 4, 5]
    """

    speeds: tuple[float, ...] = field(default=SPEEDS["free"])
    pace: float = 1.0
    switching: float = 0.05
    jitter: float = 0.01
    restart: float = 0.01
    leave: float = 0.05
    rejoin: float = 0.1
    evidence: float = 0.5
    clip: float = 4.0
    hubness: float = 10.0

    def __init__(
        self,
        kind: Literal["free", "steady"] = "free",
        *,
        speeds: Sequence[float] | None = None,
        pace: float = 1.0,
        switching: float = 0.05,
        jitter: float = 0.01,
        restart: float = 0.01,
        leave: float = 0.05,
        rejoin: float = 0.1,
        evidence: float = 0.5,
        clip: float = 4.0,
        hubness: float = 10.0,
    ) -> None:
        if kind not in SPEEDS:
            raise mismatch("motion", '"steady" or "free"', repr(kind))
        given = {name: value for name, value in locals().items() if name not in ("self", "kind")}
        given["speeds"] = tuple(SPEEDS[kind] if speeds is None else speeds)
        for name, value in given.items():
            object.__setattr__(self, name, value)
