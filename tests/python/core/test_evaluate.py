"""Evaluation against scikit-learn, against the oracle, and at every corner."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from sklearn import metrics

import oracle
import surefix

CASES = 300


def matches(rng: np.random.Generator, n: int, m: int) -> surefix.Matches:
    """Random matches, with ties, some not ready and some masked."""
    score = rng.integers(0, 12, m) / 4 if rng.random() < 0.5 else rng.random(m)
    return surefix.Matches(
        place=rng.integers(0, n, m),
        score=score,
        ready=rng.random(m) < 0.9,
        accepted=rng.random(m) < 0.8,
    )


def truths(rng: np.random.Generator, n: int, m: int) -> np.ndarray[Any, Any]:
    return np.where(rng.random(m) < 0.2, -1, rng.integers(0, n, m))


@pytest.mark.parametrize("recall", ["correct", "place_exists", "rejected"])
def test_the_sweep_is_a_count_at_every_threshold(recall: str) -> None:
    rng = np.random.default_rng(1)
    for _ in range(CASES):
        n, m, tolerance = (
            int(rng.integers(2, 12)),
            int(rng.integers(1, 40)),
            int(rng.integers(0, 3)),
        )
        found, truth = matches(rng, n, m), truths(rng, n, m)
        curve = surefix.evaluate(found, truth, tolerance, recall)
        assert found.ready is not None
        assert found.accepted is not None
        right = (truth >= 0) & (np.abs(found.place - truth) <= tolerance)
        expected = []
        for threshold in np.unique(found.score[found.ready & found.accepted]):
            taken = found.ready & found.accepted & (found.score <= threshold)
            hits = (taken & right).sum()
            relevant = {
                "correct": (found.ready & right).sum(),
                "place_exists": (found.ready & (truth >= 0)).sum(),
                "rejected": hits + (found.ready & ~taken).sum(),
            }[recall]
            expected.append(
                (threshold, hits / taken.sum(), hits / max(relevant, 1), (taken & ~right).sum())
            )
        got = zip(
            curve.thresholds, curve.precision, curve.recall, curve.false_positives, strict=True
        )
        assert list(got) == expected
        assert curve.max_recall == max((row[2] for row in expected), default=0)
        f1 = [2 * p * r / (p + r) if p + r else 0 for _, p, r, _ in expected]
        assert curve.best_f1 == pytest.approx(max(f1, default=0))
        for level in (0.5, 1.0):
            assert curve.recall_at_precision(level) == max(
                (r for _, p, r, _ in expected if p >= level), default=0
            )
            assert curve.false_positives_at(level) == next(
                (f for _, _, r, f in expected if r >= level), None
            )


@pytest.mark.slow
def test_the_curve_is_scikit_learns() -> None:
    rng = np.random.default_rng(2)
    for _ in range(CASES):
        n, m = int(rng.integers(2, 12)), int(rng.integers(2, 60))
        found, truth = matches(rng, n, m), truths(rng, n, m)
        found = surefix.Matches(found.place, found.score)
        right = (truth >= 0) & (np.abs(found.place - truth) <= 1)
        if not right.any():
            continue
        curve = surefix.evaluate(found, truth)
        precision, recall, thresholds = metrics.precision_recall_curve(right, -found.score)
        np.testing.assert_allclose(curve.precision, precision[:-1][::-1])
        np.testing.assert_allclose(curve.recall, recall[:-1][::-1])
        np.testing.assert_array_equal(curve.thresholds, -thresholds[::-1])
        best = max(
            metrics.f1_score(right, found.score <= threshold) for threshold in curve.thresholds
        )
        assert curve.best_f1 == pytest.approx(best)


def test_the_area_is_the_oracles() -> None:
    rng = np.random.default_rng(3)
    for _ in range(CASES):
        found, truth = matches(rng, 6, 40), truths(rng, 6, 40)
        curve = surefix.evaluate(found, truth, 0)
        if not len(curve.recall):
            continue
        for upto in (0.1, 0.2, 0.37, 1.0):
            expected = oracle.auc(curve.recall, curve.precision, upto)
            assert curve.auc(upto) == pytest.approx(expected, abs=1e-12)


def test_a_matrix_and_positions_say_what_places_say() -> None:
    rng = np.random.default_rng(4)
    for _ in range(100):
        n, m, tolerance = (
            int(rng.integers(2, 12)),
            int(rng.integers(1, 30)),
            int(rng.integers(0, 3)),
        )
        found, truth = matches(rng, n, m), truths(rng, n, m)
        cells = np.zeros((n, m), bool)
        cells[truth[truth >= 0], np.flatnonzero(truth >= 0)] = True
        far = np.where(truth < 0, 10_000, truth)
        positions = (np.c_[5.0 * np.arange(n), np.zeros(n)], np.c_[5.0 * far, np.zeros(m)])
        by_places = surefix.evaluate(found, truth, tolerance, "place_exists")
        for other in (
            surefix.evaluate(found, cells, tolerance, "place_exists"),
            surefix.evaluate(
                found, np.asfortranarray(cells.astype(np.int64)), tolerance, "place_exists"
            ),
            surefix.evaluate(found, positions, 5.0 * tolerance, "place_exists"),
        ):
            np.testing.assert_array_equal(by_places.recall, other.recall)
            np.testing.assert_array_equal(by_places.precision, other.precision)


def test_ignored_cells_leave_their_queries_out() -> None:
    found = surefix.Matches(place=np.array([0, 1, 2]), score=np.array([0.1, 0.2, 0.3]))
    cells = np.array([[1, 0, 0], [0, -1, 0], [0, 1, 0]])
    assert surefix.evaluate(found, cells, tolerance=0).judged == 2
    assert surefix.evaluate(found, np.maximum(cells, 0), tolerance=0).judged == 3
    # Within the tolerance of a true place, a match is correct, ignored or not.
    wide = surefix.evaluate(found, cells, tolerance=1)
    assert (wide.judged, wide.correct) == (3, 2)


def test_the_trust_table_is_scikit_learns() -> None:
    rng = np.random.default_rng(5)
    D = rng.random((20, 200), np.float32)
    D[np.arange(200) % 20, np.arange(200)] -= 0.7
    truth = np.where(rng.random(200) < 0.1, -1, np.arange(200) % 20)
    run = surefix.match_distances(D)
    right = (truth >= 0) & (np.abs(run.single_place - truth) <= 1)
    (tn, fp), (fn, tp) = metrics.confusion_matrix(right, run.trusted)
    trust = surefix.evaluate_trust(run, truth)
    got = (trust.true_negatives, trust.false_positives, trust.false_negatives, trust.true_positives)
    assert got == (tn, fp, fn, tp)
    assert min(got) > 0
    assert trust.precision == pytest.approx(metrics.precision_score(right, run.trusted))
    assert trust.recall == pytest.approx(metrics.recall_score(right, run.trusted))
    assert trust.share_trusted == pytest.approx(run.trusted.mean())
    assert trust.false_positive_rate == pytest.approx(fp / (fp + tn))


def test_recall_at_k_counts_the_nearest() -> None:
    rng = np.random.default_rng(6)
    for _ in range(100):
        n, m = int(rng.integers(2, 15)), int(rng.integers(1, 30))
        D = (rng.integers(0, 6, (n, m)) / 2).astype(np.float32)
        truth = truths(rng, n, m)
        ks = [1, 2, 5, n]
        order = np.argsort(D, axis=0, kind="stable")
        known = truth >= 0
        expected = []
        for k in ks:
            hit = (np.abs(order[:k] - truth) <= 1).any(0) & known
            expected.append(hit.sum() / max(known.sum(), 1))
        assert surefix.recall_at(D, truth, ks) == pytest.approx(expected)


def noisy(
    rng: np.random.Generator, m: int = 400, smooth: int = 1
) -> tuple[surefix.Matches, np.ndarray[Any, Any]]:
    """Matches whose wrongness comes in runs of ``smooth``, with scores that know half of it."""
    wrong = np.repeat(rng.random(m // smooth) < 0.4, smooth)
    score = wrong + rng.normal(0, 1, m)
    return surefix.Matches(place=np.where(wrong, 9, 0), score=score), np.zeros(m, int)


def test_the_bootstrap_is_that_of_numpy() -> None:
    rng = np.random.default_rng(7)
    found, truth = noisy(rng)
    curve = surefix.evaluate(found, truth)
    low, high = curve.auc_interval(0.5, block=1, samples=2000)
    figures = []
    for _ in range(600):
        drawn = rng.integers(0, 400, 400)
        again = surefix.Matches(found.place[drawn], found.score[drawn])
        figures.append(surefix.evaluate(again, truth).auc(0.5))
    expected = np.quantile(figures, [0.025, 0.975])
    assert low < curve.auc(0.5) < high
    np.testing.assert_allclose([low, high], expected, atol=0.25 * (expected[1] - expected[0]))


def test_the_bootstrap_knows_that_neighbours_are_not_independent() -> None:
    widths = []
    for block in (1, 40):
        intervals = [
            surefix.evaluate(*noisy(np.random.default_rng(seed), smooth=20)).auc_interval(
                0.5, block=block
            )
            for seed in range(6)
        ]
        widths.append(np.mean([high - low for low, high in intervals]))
    assert widths[1] > 1.3 * widths[0]


def test_the_bootstrap_is_reproducible_and_its_ends_are_sane() -> None:
    found, truth = noisy(np.random.default_rng(8))
    curve = surefix.evaluate(found, truth)
    assert curve.auc_interval(0.2) == curve.auc_interval(0.2)
    assert curve.auc_interval(0.2) != curve.auc_interval(0.2, seed=1)
    wide, narrow = curve.auc_interval(0.2, level=0.99), curve.auc_interval(0.2, level=0.5)
    assert wide[0] < narrow[0] < narrow[1] < wide[1]
    # One block of all queries is the drive itself, begun elsewhere.
    assert curve.auc_interval(0.2, block=400) == pytest.approx((curve.auc(0.2),) * 2)
    assert curve.auc_difference_interval(curve, 0.2) == (0, 0)
    better = surefix.evaluate(surefix.Matches(found.place, (found.place != 0) * 1.0), truth)
    low, high = better.auc_difference_interval(curve, 0.2)
    assert 0 < low < better.auc(0.2) - curve.auc(0.2) < high


NOTHING = np.full(1, -1)
CORNERS: dict[str, Callable[[], surefix.Evaluation]] = {
    "no query": lambda: surefix.evaluate(
        surefix.Matches(np.empty(0, int), np.empty(0)), np.empty(0, int)
    ),
    "one right": lambda: surefix.evaluate(
        surefix.Matches(np.array([3]), np.array([0.5])), np.array([3])
    ),
    "one wrong": lambda: surefix.evaluate(
        surefix.Matches(np.array([3]), np.array([0.5])), np.array([7])
    ),
    "no truth": lambda: surefix.evaluate(surefix.Matches(np.array([3]), np.array([0.5])), NOTHING),
    "nothing ready": lambda: surefix.evaluate(
        surefix.Matches(np.array([3]), np.array([0.5]), ready=np.array([False])), np.array([3])
    ),
    "nothing accepted": lambda: surefix.evaluate(
        surefix.Matches(np.array([3]), np.array([0.5]), accepted=np.array([False])), np.array([3])
    ),
    "all ignored": lambda: surefix.evaluate(
        surefix.Matches(np.array([1]), np.array([0.5])), np.full((2, 1), -1), 0
    ),
}


@pytest.mark.parametrize("name", CORNERS)
@pytest.mark.parametrize("recall", ["correct", "place_exists", "rejected"])
def test_every_corner_gives_numbers(name: str, recall: str) -> None:
    curve = CORNERS[name]()
    figures = [curve.auc(0.2), curve.auc(1.0), curve.auc(0.0), curve.max_recall, curve.best_f1]
    figures += [curve.recall_at_precision(1.0), curve.best_f1_threshold]
    figures += [*curve.auc_interval(0.2), *curve.auc_difference_interval(curve, 0.2)]
    assert np.isfinite(figures).all()
    assert curve.auc(0.2) == (1.0 if name == "one right" else 0.0)


def test_trust_without_anything_is_zeros() -> None:
    run = surefix.match_distances(np.ones((3, 2), np.float32))
    for truth in ([-1, -1], [2, 2]):
        trust = surefix.evaluate_trust(run, truth)
        figures = [trust.precision, trust.recall, trust.share_trusted, trust.false_positive_rate]
        assert np.isfinite(figures).all()
    assert surefix.recall_at(np.ones((3, 2), np.float32), [-1, -1]) == [0, 0, 0]


def test_refusals_say_what_came() -> None:
    found = surefix.Matches(np.array([0, 1]), np.array([0.1, 0.2]))
    refused: list[tuple[Callable[[], Any], str]] = [
        (lambda: surefix.evaluate(found, [0]), "expected 2 values, got 1"),
        (lambda: surefix.evaluate(found, [0, 1], tolerance=0.5), "whole number of places"),
        (lambda: surefix.evaluate(found, [0, 1], tolerance=-1), "got -1"),
        (
            lambda: surefix.evaluate(found, np.full((3, 2), 4)),
            "1 .the same place.*place 0, query 0",
        ),
        (lambda: surefix.evaluate(found, np.zeros((3, 2))), "float64"),
        (lambda: surefix.evaluate(found, (np.zeros((3, 2)), np.zeros((2, 3)))), "query positions"),
        (
            lambda: surefix.evaluate(found, (np.full((3, 2), np.nan), np.zeros((2, 2)))),
            "NaN at row 0",
        ),
        (
            lambda: surefix.evaluate("run", [0, 1]),
            "expected a surefix.Run or surefix.Matches, got str",
        ),
        (lambda: surefix.evaluate(surefix.Matches([0], [np.nan]), [0]), "scores"),
        (lambda: surefix.evaluate(surefix.Matches([-1], [0.1]), [0]), "from 0, got -1 for query 0"),
        (lambda: surefix.Matches([0, 1], [0.1]), r"score: .*got the shape \(1,\)"),
        (lambda: surefix.evaluate(found, [0, 1]).auc_interval(0.2, samples=0), "samples"),
        (lambda: surefix.evaluate(found, [0, 1]).auc_interval(0.2, level=1.5), "level"),
        (lambda: surefix.evaluate(found, [0, 1]).auc_interval(0.2, block=0), "block"),
        (lambda: surefix.recall_at(np.ones((3, 2), np.float32), [0]), "expected 2 values, got 1"),
        (
            lambda: surefix.recall_at(np.ones((3, 2), np.float32), [0, 3]),
            "places below 3.*got 3 for query 1",
        ),
        (
            lambda: surefix.recall_at(np.ones((3, 2), np.float32), np.eye(2, dtype=bool)),
            "expected 3 values, got 2",
        ),
        (lambda: surefix.recall_at(np.ones((3, 2), np.float32), [0, 1], ks=[-1]), "ks"),
        (lambda: surefix.recall_at(np.ones((3, 2), np.float32), [0, 1], ks=[0]), "ks"),
        (
            lambda: surefix.evaluate(surefix.match_distances(np.ones((3, 2), np.float32)), [0, 7]),
            "got 7 for query 1",
        ),
        (
            lambda: surefix.evaluate_trust(
                surefix.match_distances(np.ones((3, 2), np.float32)), np.eye(2, dtype=int)
            ),
            "expected 3 values, got 2",
        ),
        (lambda: surefix.evaluate(found, [0, 1]).auc(float("nan")), "upto.*NaN"),
        (lambda: surefix.evaluate(found, [0, 1]).auc(2.0), "upto.*from 0 to 1, got 2"),
        (lambda: surefix.Matches([0.5, 1.7], [0.1, 0.2]), "whole numbers.*float64"),
        (lambda: surefix.Matches(["a"], [0.1]), "place: expected whole numbers"),
        (lambda: surefix.Matches(3, 1), "place: expected whole numbers"),
        (lambda: surefix.Matches([0], [0.1], ready=[1]), "ready: expected bool"),
    ]
    for act, words in refused:
        with pytest.raises(surefix.SurefixValueError, match=words):
            act()
