"""Every method by its name, as the command line and the report choose them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy.typing as npt

from surefix._core import Segments
from surefix.baselines.distances import Distances, Flags, Floats
from surefix.baselines.filters import topological, track
from surefix.baselines.matching import (
    masked_single_frame,
    maximum_gradient,
    plain_sequence,
    single_frame,
    weighted_sequence,
)
from surefix.baselines.predictors import SupervisedPredictor, perfect_predictor
from surefix.baselines.rivals import ratio_test, spread
from surefix.baselines.truth import Truth
from surefix.errors import SurefixError, SurefixValueError
from surefix.matches import Matches
from surefix.motion import Motion

__all__ = ["METHODS", "Context", "Method", "run_method"]

# OpenSeqSLAM's slopes.
SEQSLAM_SPEEDS = (0.8, 0.9, 1.0, 1.1, 1.2)


@dataclass(frozen=True, eq=False)
class Context:
    """All that methods may need beside the distances. Each takes its own part.

    Parameters
    ----------
    sequence_length, weight, floor, tolerance, smoothing, gradient
        As for ``surefix.match_distances``.
    speeds : sequence of float, optional
        Slopes that a sequence may have, in places a query. By default 1, and 0.8 to 1.2 for
        ``seqslam``.
    contrast : int
        The window of ``seqslam``'s contrast enhancement, in places.
    exclude : int
        ``ratio`` compares the best place to those further from it than this.
    top : int
        The number of places that ``spread`` looks at.
    positions : array, shape (n,) or (n, k), optional
        The places' positions, in planar metres, for ``spread``; by default their index.
    truth, truth_tolerance
        As for ``surefix.evaluate``, for the perfect predictor.
    calibration : (distances, truth), optional
        A pair of drives with known truth, for the supervised predictor.
    calibration_tolerance : int
        That truth's, in places; in metres if it is positions.
    trusted : array of bool, shape (m,), optional
        Another predictor's flags in place of the consensus, for ``masked`` and ``weighted``.
    advance : array of float64, shape (m,), optional
        Places moved since the query before, by odometry, for ``track_odometry``.
    techniques : sequence of array of float32, shape (n, m), optional
        Distances of other techniques between the same places and queries, for ``fused``.
    segments : Segments, optional
        How the places follow each other, by default one after the other: for all methods but the
        published filter, ``topological``, which has no notion of it.
    gaps : sequence of int
        Queries before which the robot may have moved on unseen, for surefix's own methods, as for
        ``surefix.match``.
    motion : {"steady", "free", "any"} or surefix.Motion, optional
        How the robot moves, for ``track``; for ``fused`` it is "any" by default.
    technique_weights : sequence of float
        How much each technique counts, for ``fused``; all the same by default.
    """

    sequence_length: int = 2
    weight: float = 0.99
    floor: str | float = "global"
    tolerance: int = 1
    smoothing: int = 3
    gradient: str = "halved"
    speeds: Sequence[float] | None = None
    contrast: int = 10
    exclude: int = 1
    top: int = 10
    positions: npt.ArrayLike | None = None
    truth: Truth | None = None
    truth_tolerance: float = 1
    calibration: tuple[Distances, Truth] | None = None
    calibration_tolerance: int = 1
    trusted: Flags | None = None
    advance: Floats | None = None
    techniques: Sequence[Distances] | None = None
    segments: Segments | None = None
    gaps: Sequence[int] = ()
    motion: Motion | str | None = None
    technique_weights: Sequence[float] = ()

    @property
    def options(self) -> dict[str, Any]:
        """Those of ``surefix.match_distances``."""
        return self.roads | {
            "sequence_length": self.sequence_length,
            "weight": self.weight,
            "floor": self.floor,
            "tolerance": self.tolerance,
            "smoothing": self.smoothing,
            "gradient": self.gradient,
            "speeds": [1.0] if self.speeds is None else list(self.speeds),
        }

    @property
    def roads(self) -> dict[str, Any]:
        """The segments and the gaps, as arguments of ``surefix.match_distances``."""
        roads: dict[str, Any] = {} if self.segments is None else {"segments": self.segments}
        return roads | ({"gaps": list(self.gaps)} if self.gaps else {})


@dataclass(frozen=True)
class Method:
    """A method in a line, how to call it, and the field of the ``Context`` that it must have."""

    description: str
    call: Callable[[Distances, Context], Matches]
    needs: str | None = None


NEEDS = {
    "truth": "the truth of the queries: Context(truth=...)",
    "calibration": "a pair of drives with known truth to learn from: "
    "Context(calibration=(distances, truth))",
    "advance": "odometry, the places moved since the query before: Context(advance=...)",
    "techniques": "distances of other techniques: Context(techniques=...)",
    "motion": "how the robot moves: Context(motion=...)",
}


def run_method(name: str, D: Distances, context: Context | None = None) -> Matches:
    """Match by the method of this name, a key of ``METHODS``.

    Parameters
    ----------
    name : str
    D : array of float32, shape (n, m)
    context : Context, optional

    Returns
    -------
    Matches

    Raises
    ------
    SurefixValueError
        For an unknown name, and the method's own errors.
    SurefixError
        If the context lacks a field that the method needs.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> D = 1 - np.eye(5, dtype=np.float32)
    >>> baselines.run_method("sequence", D, baselines.Context(sequence_length=3)).place
    array([0, 1, 2, 3, 4])
    """
    method = METHODS.get(name)
    if method is None:
        raise SurefixValueError(f"method: expected one of {', '.join(METHODS)}, got {name!r}")
    context = Context() if context is None else context
    if method.needs is not None and getattr(context, method.needs) is None:
        raise SurefixError(f"method {name}: needs {NEEDS[method.needs]}")
    # The flags of the perfect predictor, or of the supervised one, in place of the consensus.
    if method.needs == "truth" and context.truth is not None:
        trusted = perfect_predictor(D, context.truth, context.truth_tolerance)
        context = replace(context, trusted=trusted)
    elif method.needs == "calibration" and context.calibration is not None:
        predictor = SupervisedPredictor().fit(*context.calibration, context.calibration_tolerance)
        context = replace(context, trusted=predictor.predict(D))
    return method.call(D, context)


def _masked(D: Distances, c: Context) -> Matches:
    return masked_single_frame(D, trusted=c.trusted, **c.options)


def _weighted(D: Distances, c: Context) -> Matches:
    return weighted_sequence(D, trusted=c.trusted, **c.options)


def _seqslam(D: Distances, c: Context) -> Matches:
    speeds = SEQSLAM_SPEEDS if c.speeds is None else c.speeds
    how: dict[str, Any] = {"contrast": c.contrast, "speeds": speeds, "segments": c.segments}
    return plain_sequence(D, sequence_length=c.sequence_length, **how)


def _longer(length: int) -> Callable[[Distances, Context], Matches]:
    def sequence(D: Distances, c: Context) -> Matches:
        return _sequence(D, replace(c, sequence_length=min(length, len(D))))

    return sequence


def _sequence(D: Distances, c: Context) -> Matches:
    return weighted_sequence(D, **c.options | {"weight": 0.0})


METHODS: Mapping[str, Method] = MappingProxyType(
    {
        "single": Method("single frames by their distance", lambda D, _: single_frame(D)),
        "masked": Method("single frames, refused if the prediction does not trust them", _masked),
        "gradient": Method(
            "single frames by the greatest gradient", lambda D, c: maximum_gradient(D, **c.options)
        ),
        "sequence": Method("unweighted sequences", _sequence),
        "sequence-10": Method("unweighted sequences of 10 queries", _longer(10)),
        "sequence-20": Method("unweighted sequences of 20 queries", _longer(20)),
        "weighted": Method("sequences weighted by the prediction: the paper", _weighted),
        "supervised-masked": Method(
            "single frames, masked by a support vector machine that learned from another drive",
            _masked,
            needs="calibration",
        ),
        "supervised-weighted": Method(
            "sequences weighted by a support vector machine that learned from another drive",
            _weighted,
            needs="calibration",
        ),
        "perfect-masked": Method(
            "single frames, masked by the truth: the bound for a mask", _masked, needs="truth"
        ),
        "perfect-weighted": Method(
            "sequences weighted by the truth: the bound for weights", _weighted, needs="truth"
        ),
        "ratio": Method(
            "single frames by the ratio to the best distance elsewhere",
            lambda D, c: ratio_test(D, exclude=c.exclude),
        ),
        "spread": Method(
            "single frames by the spread of the most alike places on the map (SUE)",
            lambda D, c: spread(D, c.positions, top=c.top),
        ),
        "seqslam": Method(
            "unweighted sequences on enhanced contrast, over several speeds", _seqslam
        ),
        "topological": Method(
            "a published Bayes filter over the places, at a place a query",
            lambda D, _: topological(D),
        ),
        "track_steady": Method(
            "the tracker, at a place a query",
            lambda D, c: track(D, motion="steady", tolerance=c.tolerance, **c.roads),
        ),
        "track_free": Method(
            "the tracker, at 0 to 2 places a query",
            lambda D, c: track(D, motion="free", tolerance=c.tolerance, **c.roads),
        ),
        "track_any": Method(
            "the tracker, at 0 to 5 places a query",
            lambda D, c: track(D, motion="any", tolerance=c.tolerance, **c.roads),
        ),
        "track_odometry": Method(
            "the tracker with odometry",
            lambda D, c: track(
                D, motion="any", advance=c.advance, tolerance=c.tolerance, **c.roads
            ),
            needs="advance",
        ),
        "track": Method(
            "the tracker, as it is set; with odometry if there is any",
            lambda D, c: track(
                D, motion=c.motion, advance=c.advance, tolerance=c.tolerance, **c.roads
            ),
            needs="motion",
        ),
        "fused": Method(
            "the tracker on several techniques together",
            lambda D, c: track(
                [D, *(c.techniques or ())],
                motion=c.motion or "any",
                tolerance=c.tolerance,
                technique_weights=c.technique_weights,
                **c.roads,
            ),
            needs="techniques",
        ),
    }
)
