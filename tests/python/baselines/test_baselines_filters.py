"""The topological filter against a slow telling of it in other words, and how filters behave."""

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import surefix
from surefix import baselines

Array = npt.NDArray[Any]


def slow_topological(D: Array, reach: int) -> tuple[Array, Array]:
    """The published formulas as they stand: a transition matrix, and evidence about the median."""
    D = D.astype(np.float64)
    n = len(D)
    moves = 0.1 * np.eye(n) + 0.8 * np.eye(n, k=-1) + 0.1 * np.eye(n, k=-2)
    spread = np.percentile(D[:, 0], 97.5) - np.percentile(D[:, 0], 2.5)
    belief, places, confidence = np.ones(n), [], []
    for query in range(D.shape[1]):
        d = D[:, query]
        prior = belief if query == 0 else moves @ belief
        belief = prior * 5.0 ** (-(d - np.median(d)) / spread)
        belief = belief / np.sum(belief)
        places.append(int(np.argmax(belief)))
        confidence.append(sum(belief[i] for i in range(n) if abs(i - places[-1]) <= reach))
    return np.array(places), np.array(confidence)


def drive(seed: int, n: int = 60, noise: float = 0.6) -> Array:
    """A place a query, seen through noise."""
    rng = np.random.default_rng(seed)
    return (rng.normal(0, noise, (n, n)) - np.eye(n)).astype(np.float32)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("reach", [0, 1, 6])
def test_the_topological_filter_is_the_published_one(seed: int, reach: int) -> None:
    D = drive(seed, 20 + seed)
    places, confidence = slow_topological(D, reach)
    matches = baselines.topological(D, reach=reach)
    np.testing.assert_array_equal(matches.place, places)
    np.testing.assert_allclose(matches.confidence, confidence, atol=1e-12)
    np.testing.assert_allclose(matches.score, 1 - confidence, atol=1e-6)


@pytest.mark.parametrize("seed", range(10))
def test_the_unit_of_the_distances_is_nothing_to_the_topological_filter(seed: int) -> None:
    D = drive(seed)
    plain, other = baselines.topological(D), baselines.topological(4 * D - 8)
    np.testing.assert_array_equal(plain.place, other.place)
    np.testing.assert_allclose(plain.confidence, other.confidence, atol=1e-5)


def test_the_topological_filter_lives_through_columns_that_say_nothing_or_far_too_much() -> None:
    D = drive(1, noise=0.1)
    D[:, :3] = 0.5
    D[:, 30] = 0.25
    D[:, 31] *= 1e30
    matches = baselines.topological(D)
    assert np.isfinite(matches.score).all()
    assert (np.abs(matches.place[10:30] - np.arange(10, 30)) <= 1).all()
    # Without evidence in any column it knows nothing: no place but by the route's end.
    assert baselines.topological(np.ones((40, 2), np.float32)).confidence.max() < 0.25
    assert len(baselines.topological(np.ones((40, 0), np.float32))) == 0


@pytest.mark.parametrize("method", ["topological", "track_steady", "track_free", "track_any"])
def test_a_filter_finds_what_single_frames_do_not(method: str) -> None:
    single = right = 0
    for seed in range(10):
        D = drive(seed)
        single += int((D.argmin(axis=0) == np.arange(60)).sum())
        matches = baselines.run_method(method, D)
        assert matches.confidence is not None
        right += int((np.abs(matches.place - np.arange(60)) <= 1)[10:].sum())
    assert single < 200
    assert right > 400


def test_odometry_follows_a_drive_that_stops_and_turns_back() -> None:
    truth = np.r_[np.arange(30), np.full(20, 29), np.arange(28, 4, -1)]
    rng = np.random.default_rng(0)
    D = rng.normal(0, 0.6, (60, len(truth))) - (np.arange(60)[:, None] == truth)
    context = baselines.Context(advance=np.diff(truth, prepend=truth[0]).astype(float))
    D = D.astype(np.float32)
    with_it = baselines.run_method("track_odometry", D, context)
    without = baselines.run_method("track_free", D, context)
    near, far = (int((np.abs(each.place - truth) <= 1).sum()) for each in (with_it, without))
    assert near > 50 > far
    assert with_it.off_map is not None
    assert ((with_it.off_map >= 0) & (with_it.off_map <= 1)).all()


def test_the_confidence_of_matches_is_checked() -> None:
    place = np.arange(3)
    with pytest.raises(surefix.SurefixValueError, match="off_map: expected probabilities from 0"):
        surefix.Matches(place=place, score=place, off_map=np.array([0, 0.5, 2]))
    with pytest.raises(surefix.SurefixValueError, match="confidence: expected one number a query"):
        surefix.Matches(place=place, score=place, confidence=np.zeros(2))
