"""Reliability and detection against scikit-learn, and frames to notice and to find back against
plain loops.
"""

import numpy as np
import pytest
from numpy.typing import NDArray

from surefix import SurefixValueError
from surefix.study import frames_to_notice, frames_to_relocalise, reliability, roc_area


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("bins", [1, 5, 10])
def test_the_diagram_is_that_of_scikit_learn(seed: int, bins: int) -> None:
    calibration = pytest.importorskip("sklearn.calibration")
    rng = np.random.default_rng(seed)
    # Some on the edges.
    said = rng.choice([rng.random(50), np.round(rng.random(50), 1)])
    right = rng.random(50) < said
    share, mean = calibration.calibration_curve(right, said, n_bins=bins)
    diagram = reliability(said, right, bins)
    np.testing.assert_allclose(diagram.right, share)
    np.testing.assert_allclose(diagram.said, mean)
    assert diagram.count.sum() == 50


def test_the_error_is_0_for_honest_words_and_1_for_lies() -> None:
    rng = np.random.default_rng(0)
    said = rng.random(200_000)
    assert reliability(said, rng.random(200_000) < said).error < 0.01
    assert reliability([1.0, 1.0, 0.0], [False, False, True]).error == 1
    assert np.isnan(reliability([], []).error)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("levels", [2, 5, 1000])
def test_the_area_is_that_of_scikit_learn(seed: int, levels: int) -> None:
    metrics = pytest.importorskip("sklearn.metrics")
    rng = np.random.default_rng(seed)
    score, off = rng.integers(0, levels, 60).astype(float), rng.random(60) < 0.3
    assert roc_area(score, off) == pytest.approx(metrics.roc_auc_score(off, score))
    assert roc_area(score, off) + roc_area(-score, off) == pytest.approx(1)


def test_without_both_kinds_there_is_no_area() -> None:
    assert np.isnan(roc_area([1, 2], [True, True]))
    assert np.isnan(roc_area([1, 2], [False, False]))


def slow_notice(doubt: NDArray[np.float64], off: NDArray[np.bool_]) -> list[float]:
    found: list[float] = []
    waiting = None
    for query, away in enumerate(off):
        if away and (query == 0 or not off[query - 1]):
            found.append(np.inf)
            waiting = query
        if not away:
            waiting = None
        elif waiting is not None and doubt[query] >= 0.5:
            found[-1] = query - waiting
            waiting = None
    return found


def slow_relocalise(
    right: NDArray[np.bool_], off: NDArray[np.bool_], jumps: set[int], sure: NDArray[np.bool_]
) -> list[float]:
    m = len(right)

    def event(query: int) -> bool:
        back = query > 0 and off[query - 1] and not off[query]
        return bool(back or (query in jumps and not off[query]))

    found = []
    for start in filter(event, range(m)):
        end = start + 1
        while end < m and not off[end] and not event(end):
            end += 1
        held = (q - start for q in range(start, end - 2) if sure[q] and right[q : q + 3].all())
        found.append(next(held, np.inf))
    return found


@pytest.mark.parametrize("seed", range(200))
def test_the_frames_are_those_of_a_plain_loop(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m = int(rng.integers(1, 60))
    off = np.repeat(rng.random(m) < 0.4, rng.integers(1, 6, m))[:m]
    right, confidence = rng.random(m) < 0.8, rng.random(m)
    jumps = rng.choice(m, size=int(rng.integers(0, 1 + m // 8)), replace=False)
    assert frames_to_notice(confidence, off).tolist() == slow_notice(confidence, off)
    got = frames_to_relocalise(right, off, jumps, confidence=confidence)
    assert got.tolist() == slow_relocalise(right, off, set(jumps.tolist()), confidence >= 0.5)
    plain = frames_to_relocalise(right, off, jumps)
    assert plain.tolist() == slow_relocalise(right, off, set(jumps.tolist()), np.ones(m, bool))
    assert (plain <= got).all()


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: reliability([0.5, 1.2], [True, True]), "from 0 to 1, got 1.2 at 1"),
        (
            lambda: reliability([0.5], [True, True]),
            r"both \(m,\), got the shapes \(1,\) and \(2,\)",
        ),
        (lambda: reliability([0.5], [True], 0), "bins"),
        (lambda: roc_area([0.5, np.nan], [True, False]), "finite numbers, got nan at 1"),
    ],
)
def test_errors_say_what_came(call, says: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(SurefixValueError, match=says):
        call()
