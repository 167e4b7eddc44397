"""The options of the method, stated once: their types, defaults and help.

The Rust ``Config`` says the same to the compiled part, and a test holds the two together. The
command line makes its flags from this table.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from os import PathLike
from typing import Any, Literal, SupportsFloat, SupportsIndex, TypeAlias, TypedDict

from surefix._core import Settings
from surefix.motion import Motion

Gradient: TypeAlias = Literal["halved", "unhalved"]
Floor: TypeAlias = Literal["running", "global"] | SupportsFloat


class Options(TypedDict, total=False):
    """Keyword arguments of ``Matcher``, ``Localizer``, ``match`` and ``match_distances``."""

    sequence_length: SupportsIndex
    weight: SupportsFloat
    tolerance: SupportsIndex
    smoothing: SupportsIndex
    gradient: Gradient | str
    floor: Floor | str
    speeds: Iterable[SupportsFloat]
    motion: Motion | str | None
    technique_weights: Iterable[SupportsFloat]
    config: Settings | str | PathLike[str] | None


@dataclass(frozen=True)
class Option:
    """One option: its default (of a stream, for the floor), the range in words, and its help.

    ``choices`` are the words that it may be; ``floor`` may be a number too. ``seldom`` ones are few
    people's.
    """

    name: str
    type: type
    default: Any
    range: str
    help: str
    choices: tuple[str, ...] = ()
    short: str | None = None
    seldom: bool = False


# In the order in which they are needed.
OPTIONS: tuple[Option, ...] = (
    Option(
        "motion",
        str,
        None,
        '"steady", "free" or "any"',
        "Track the robot: at a steady pace, from 0 to twice it, or at any speed.",
        choices=("steady", "free", "any"),
    ),
    Option(
        "sequence_length",
        int,
        2,
        "from 1 to the number of places",
        "Queries a sequence.",
        short="L",
    ),
    Option(
        "weight", float, 0.99, "0 to 1", "How far a trusted match is drawn to the floor.", short="w"
    ),
    Option(
        "tolerance",
        int,
        1,
        "0 or more",
        "Places between minimum and gradient peak of a trusted match; a track's confidence is "
        "of as many.",
    ),
    Option(
        "technique_weights",
        list,
        (),
        "0 or more, such as 1,0.5",
        "How much each fused technique counts; all the same by default.",
        seldom=True,
    ),
    Option(
        "floor",
        float,
        "running",
        '"global", "running" or a number',
        "The target of trusted matches: the least distance so far, which is all that a stream "
        "knows; of all queries, as in the paper; or a number.",
        choices=("global", "running"),
        seldom=True,
    ),
    Option(
        "speeds",
        list,
        (1.0,),
        "0 or more, such as 0.9,1,1.1",
        "Slopes to try, in places a query.",
        seldom=True,
    ),
    Option(
        "smoothing",
        int,
        3,
        "1 or more",
        "Gradients summed; 1 for queries in any order.",
        seldom=True,
    ),
    Option(
        "gradient",
        str,
        "halved",
        '"halved" or "unhalved"',
        "The gradient of the distances with the factor 1/2 of the paper's Eq. 1, or without it, as "
        "in the authors' code.",
        choices=("halved", "unhalved"),
        seldom=True,
    ),
)
