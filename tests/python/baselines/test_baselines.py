"""The methods that the paper compares itself to, each against a slow telling of it in other
words.
"""

import doctest
import inspect
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.special import softmax

import oracle
import surefix
from surefix import baselines
from surefix.matches import Matches

Array = npt.NDArray[Any]


def matrices() -> Iterator[tuple[str, Array]]:
    """Distances, smooth and random, full of ties, negative, zero, flat, tiny, and in odd memory
    layouts.
    """
    rng = np.random.default_rng(3)
    for n, m in ((40, 30), (9, 17), (4, 1), (2, 5), (3, 3)):
        yield f"random {n} x {m}", rng.random((n, m), np.float32)
        yield f"ties {n} x {m}", rng.integers(0, 3, (n, m)).astype(np.float32)
        yield f"signs {n} x {m}", rng.integers(-2, 3, (n, m)).astype(np.float32)
    yield "smooth", np.cumsum(rng.normal(size=(60, 25)), axis=0).astype(np.float32)
    yield "negated similarities", -rng.random((20, 20), np.float32)
    yield "flat", np.full((12, 7), 0.3, np.float32)
    yield "zero", np.zeros((12, 7), np.float32)
    yield "huge", rng.random((15, 8), np.float32) * np.float32(3e37)
    yield "tiny", rng.random((15, 8), np.float32) * np.float32(1e-20)
    yield "no query", np.empty((5, 0), np.float32)
    yield "by columns", np.asfortranarray(rng.random((15, 12), np.float32))
    yield "every other", rng.random((30, 24), np.float32)[::2, ::-2]


MATRICES = dict(matrices())
every_matrix = pytest.mark.parametrize("D", MATRICES.values(), ids=MATRICES.keys())


def least(column: Array) -> int:
    return min(range(len(column)), key=lambda i: (column[i], i))


def same(matches: Matches, place: list[int], score: Any, *, rtol: float = 1e-6) -> None:
    np.testing.assert_array_equal(matches.place, np.array(place, int))
    np.testing.assert_allclose(matches.score, np.array(score, float), rtol=rtol, atol=1e-7)


@every_matrix
def test_a_single_frame_is_the_first_of_the_nearest(D: Array) -> None:
    matches = baselines.single_frame(D)
    place = [least(column) for column in D.T]
    same(matches, place, [D[i, j] for j, i in enumerate(place)], rtol=0)
    assert matches.ready.all()
    assert matches.accepted.all()


@every_matrix
def test_a_mask_refuses_what_the_consensus_does_not_trust(D: Array) -> None:
    options = oracle.Options(sequence_length=1, tolerance=2, smoothing=2, gradient="unhalved")
    matches = baselines.masked_single_frame(D, tolerance=2, smoothing=2, gradient="unhalved")
    if D.shape[1]:
        np.testing.assert_array_equal(matches.accepted, oracle.match(D, options).trusted)
    single = baselines.single_frame(D)
    np.testing.assert_array_equal(matches.place, single.place)
    np.testing.assert_array_equal(matches.score, single.score)
    flags = np.arange(D.shape[1]) % 3 == 0
    accepted = baselines.masked_single_frame(D, trusted=flags).accepted
    # Distances that are all equal are never trusted.
    np.testing.assert_array_equal(accepted, flags & oracle.telling(D))


@every_matrix
@pytest.mark.parametrize("smoothing", [1, 3])
def test_the_maximum_gradient_is_the_other_half_of_the_consensus(D: Array, smoothing: int) -> None:
    if not D.shape[1]:
        return
    run = oracle.match(D, oracle.Options(sequence_length=1, smoothing=smoothing))
    matches = baselines.maximum_gradient(D, smoothing=smoothing)
    same(matches, run.gradient_place.tolist(), -run.gradient_value, rtol=0)


@every_matrix
def test_a_plain_sequence_of_one_is_the_single_frame(D: Array) -> None:
    one, single = baselines.plain_sequence(D, sequence_length=1), baselines.single_frame(D)
    np.testing.assert_array_equal(one.place, single.place)
    np.testing.assert_array_equal(one.score, single.score)


@pytest.mark.parametrize("speeds", [(1.0,), (0.5, 1.0, 2.0)])
@pytest.mark.parametrize("length", [2, 4])
def test_plain_and_weighted_sequences_are_the_oracles(
    length: int, speeds: tuple[float, ...]
) -> None:
    for name in ("random 40 x 30", "ties 9 x 17", "signs 40 x 30", "every other"):
        D = MATRICES[name]
        trusted = np.arange(D.shape[1]) % 2 == 0
        options = {"sequence_length": length, "speeds": speeds}
        cases: list[tuple[Matches, dict[str, Any], Array | None]] = [
            (baselines.plain_sequence(D, **options), {"weight": 0.0}, None),  # type: ignore[arg-type]
            (baselines.weighted_sequence(D, **options), {"weight": 0.99}, None),  # type: ignore[arg-type]
            (
                baselines.weighted_sequence(D, weight=0.5, trusted=trusted, **options),
                {"weight": 0.5},
                trusted,
            ),  # type: ignore[arg-type]
        ]
        for matches, weight, flags in cases:
            expected = oracle.match(D, oracle.Options(floor="global", **weight, **options), flags)  # type: ignore[arg-type]
            same(matches, expected.place.tolist(), expected.score)
            np.testing.assert_array_equal(matches.ready, expected.ready)


@every_matrix
def test_weights_of_zero_are_the_plain_sequence(D: Array) -> None:
    length = min(3, len(D))
    plain = baselines.plain_sequence(D, sequence_length=length)
    for trusted in (None, np.ones(D.shape[1], bool)):
        weighted = baselines.weighted_sequence(
            D, sequence_length=length, weight=0.0, trusted=trusted
        )
        np.testing.assert_array_equal(weighted.place, plain.place)
        np.testing.assert_array_equal(weighted.score, plain.score)
        np.testing.assert_array_equal(weighted.ready, plain.ready)


def enhanced_by_hand(D: Array, window: int) -> Array:
    result = np.zeros(D.shape)
    for i, j in np.ndindex(*D.shape):
        around = [float(D[k, j]) for k in range(len(D)) if abs(k - i) <= window // 2]
        if len(set(around)) > 1:
            result[i, j] = (float(D[i, j]) - np.mean(around)) / np.std(around, ddof=1)
    return result


@every_matrix
@pytest.mark.parametrize("window", [2, 5, 10, 1000])
def test_contrast_is_the_distance_from_the_neighbourhood_in_its_deviations(
    D: Array, window: int
) -> None:
    enhanced = baselines.enhance_contrast(D, window)
    assert enhanced.dtype == np.float32
    np.testing.assert_allclose(enhanced, enhanced_by_hand(D, window), rtol=2e-6, atol=2e-6)


def test_contrast_forgets_the_scale_and_the_level_of_each_query() -> None:
    # Steps of 1/256 and powers of two, so that the changed distances are exact.
    D = np.random.default_rng(5).integers(0, 256, (50, 20)).astype(np.float32) / 256
    scale = 2.0 ** np.random.default_rng(6).integers(-3, 4, 20)
    changed = (D * scale + np.arange(20)).astype(np.float32)
    np.testing.assert_allclose(
        baselines.enhance_contrast(changed), baselines.enhance_contrast(D), atol=1e-6
    )
    before = baselines.plain_sequence(D, sequence_length=4, contrast=10)
    np.testing.assert_array_equal(
        baselines.plain_sequence(changed, sequence_length=4, contrast=10).place, before.place
    )
    # Without it, the level of one query does not matter, but its scale does.
    assert (baselines.plain_sequence(changed, sequence_length=4).place != before.place).any()


def test_contrast_in_blocks_is_contrast_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    from surefix.baselines import rivals

    D = MATRICES["random 40 x 30"]
    whole = baselines.enhance_contrast(D)
    monkeypatch.setattr(rivals, "CELLS_AT_ONCE", 7 * len(D))
    np.testing.assert_array_equal(baselines.enhance_contrast(D), whole)


def test_contrast_finds_a_dip_on_a_slope() -> None:
    places = np.arange(60, dtype=np.float32)
    D = np.stack([places / 60 - np.float32(0.08) * (places == 20 + j) for j in range(10)], axis=1)
    assert (baselines.plain_sequence(D, sequence_length=3).place[2:] < 10).all()
    found = baselines.plain_sequence(D, sequence_length=3, contrast=10)
    np.testing.assert_array_equal(found.place[2:], np.arange(22, 30))


@every_matrix
@pytest.mark.parametrize("exclude", [0, 1, 3])
def test_the_ratio_is_the_best_over_the_best_elsewhere(D: Array, exclude: int) -> None:
    if len(D) < 2 * exclude + 2:
        with pytest.raises(surefix.SurefixValueError, match="exclude"):
            baselines.ratio_test(D, exclude=exclude)
        return
    low = min([0.0, *D.astype(float).ravel()])
    place, score = [], []
    for column in D.astype(float).T - low:
        best = least(column)
        elsewhere = min(
            d for i, d in enumerate(column) if not best - exclude <= i <= best + exclude
        )
        place.append(best)
        score.append(1.0 if elsewhere == 0 else column[best] / elsewhere)
    matches = baselines.ratio_test(D, exclude=exclude)
    same(matches, place, score)
    assert ((matches.score >= 0) & (matches.score <= 1)).all()


def test_the_ratio_of_nothing_near_is_zero_and_of_two_alike_is_one() -> None:
    D = np.array([[0, 0, 2], [9, 9, 9], [9, 9, 9], [4, 0, 2]], np.float32)
    assert baselines.ratio_test(D).score.tolist() == [0, 1, 1]
    assert baselines.ratio_test(D - 5).score.tolist() == [0, 1, 1]


def spread_by_hand(D: Array, positions: Array, top: int, slope: float) -> list[float]:
    spreads = []
    for column in D.astype(float).T:
        first = sorted(range(len(column)), key=lambda i: (column[i], i))[:top]
        weights = softmax(-slope * column[first])
        covariance = np.atleast_2d(np.cov(positions[first].T, aweights=weights, ddof=0))
        spreads.append(np.sqrt(np.trace(covariance) / len(covariance)))
    return spreads


@every_matrix
@pytest.mark.parametrize("slope", [0.0, 3.0, 350.0])
def test_the_spread_is_the_weighted_deviation_of_the_first_places(D: Array, slope: float) -> None:
    place = [least(column) for column in D.T]
    positions = np.random.default_rng(8).normal(0, 20, (len(D), 2))
    index = np.arange(len(D), dtype=float)[:, None]
    for top in (2, 5, 10):
        same(
            baselines.spread(D, top=top, slope=slope),
            place,
            spread_by_hand(D, index, top, slope),
            rtol=1e-5,
        )
        matches = baselines.spread(D, positions, top=top, slope=slope)
        same(matches, place, spread_by_hand(D, positions, top, slope), rtol=1e-5)
    np.testing.assert_array_equal(
        baselines.spread(D, index[:, 0], slope=slope).score, baselines.spread(D, slope=slope).score
    )


def test_the_spread_does_not_vanish_when_all_are_far_and_is_limited_by_its_reach() -> None:
    D = np.array([[50], [50], [90]], np.float32)
    assert baselines.spread(D, [0, 10, 20], slope=350.0).score.tolist() == [5.0]
    assert baselines.spread(D, [0, 10_000, 20], slope=350.0).score.tolist() == [500.0]
    assert baselines.spread(D, [0, 10, 20], reach=3.0).score.tolist() == [3.0]


@every_matrix
def test_a_perfect_predictor_masks_exactly(D: Array) -> None:
    n, m = D.shape
    rng = np.random.default_rng(1)
    truth = rng.integers(-1, n, m)
    for tolerance in (0, 1, 3):
        place = [least(column) for column in D.T]
        right = [t >= 0 and abs(p - t) <= tolerance for p, t in zip(place, truth, strict=True)]
        trusted = baselines.perfect_predictor(D, truth, tolerance)
        np.testing.assert_array_equal(trusted, np.array(right, bool))
        if trusted.any():
            matches = baselines.masked_single_frame(D, trusted=trusted)
            taken = np.where(matches.accepted, matches.score, np.inf)
            assert (np.isfinite(taken) == (np.array(right) & oracle.telling(D))).all()


def test_the_truth_has_the_same_kinds_as_in_evaluate() -> None:
    D = MATRICES["random 40 x 30"]
    n, m = D.shape
    rng = np.random.default_rng(2)
    places = np.where(
        rng.random(m) < 0.6, baselines.single_frame(D).place + rng.integers(-2, 3, m), -1
    )
    places = places.clip(-1, n - 1)
    cells = (np.arange(n)[:, None] == places).astype(np.int8)
    for tolerance in (0, 1, 2):
        expected = baselines.perfect_predictor(D, places, tolerance)
        assert expected.any()
        assert not expected.all()
        np.testing.assert_array_equal(baselines.perfect_predictor(D, cells, tolerance), expected)
        np.testing.assert_array_equal(
            baselines.perfect_predictor(D, cells == 1, tolerance), expected
        )
        np.testing.assert_array_equal(
            baselines.perfect_predictor(D, places.tolist(), float(tolerance)), expected
        )
    known = places >= 0
    route, here = np.arange(n)[:, None] * [3.0, 4.0], places[:, None] * [3.0, 4.0]
    right = baselines.perfect_predictor(D, (route, here), 5.0)
    np.testing.assert_array_equal(right[known], baselines.perfect_predictor(D, places, 1)[known])
    for truth, tolerance in ((places, 1), (cells, 1), ((route, here), 5.0)):
        judged = surefix.evaluate(baselines.single_frame(D), truth, tolerance)
        assert judged.correct == baselines.perfect_predictor(D, truth, tolerance).sum()
    two = np.arange(2) + 3
    for pair in (tuple(two), tuple(two.tolist())):
        right = baselines.perfect_predictor(D[:, :2], pair, 4)
        np.testing.assert_array_equal(right, baselines.perfect_predictor(D[:, :2], two, 4))


def test_the_ends_of_a_route_are_not_neighbours() -> None:
    D = np.array([[0, 9], [5, 5], [5, 5], [9, 0]], np.float32)
    far = np.array([[0, 1], [0, 0], [0, 0], [1, 0]], bool)
    assert not baselines.perfect_predictor(D, far, 2).any()
    assert baselines.perfect_predictor(D, far, 3).all()


def test_a_noisy_predictor_hits_its_rates_and_sweeps_smoothly() -> None:
    right = np.random.default_rng(4).random(1000) < 0.3
    of_right, of_wrong = right.sum(), (~right).sum()
    before = np.zeros(1000, bool)
    for rate in np.linspace(0, 1, 21):
        trusted = baselines.noisy_predictor(
            right, true_positive_rate=rate, false_positive_rate=rate / 2, seed=7
        )
        assert abs(trusted[right].sum() - rate * of_right) <= 0.5
        assert abs(trusted[~right].sum() - rate / 2 * of_wrong) <= 0.5
        assert (trusted >= before).all()
        before = trusted
    rates = {"true_positive_rate": 0.5, "false_positive_rate": 0.5}
    first = baselines.noisy_predictor(right, **rates)
    np.testing.assert_array_equal(baselines.noisy_predictor(right, **rates), first)
    assert (baselines.noisy_predictor(right, **rates, seed=1) != first).any()
    perfect = baselines.noisy_predictor(right, true_positive_rate=1, false_positive_rate=0)
    np.testing.assert_array_equal(perfect, right)
    assert not len(baselines.noisy_predictor([], **rates))


GOOD = MATRICES["random 9 x 17"]
WRONG: dict[str, tuple[Any, list[str]]] = {
    "another type": (lambda: baselines.ratio_test(GOOD.astype(float)), ["float32", "float64"]),
    "a NaN": (
        lambda: baselines.spread(np.full((3, 3), np.nan, np.float32)),
        ["NaN", "row 0, index 0"],
    ),
    "one place": (lambda: baselines.enhance_contrast(GOOD[:1]), ["at least 2", "1"]),
    "a vector": (lambda: baselines.single_frame(GOOD[0]), ["2 dimension", "(17,)"]),
    "a window of one": (
        lambda: baselines.plain_sequence(GOOD, contrast=1),
        ["`contrast`", "2 or more", "1"],
    ),
    "a window of 2.5": (
        lambda: baselines.enhance_contrast(GOOD, 2.5),
        ["`contrast`", "whole", "2.5"],
    ),  # type: ignore[arg-type]
    "a long sequence": (
        lambda: baselines.plain_sequence(GOOD, sequence_length=10),
        ["`sequence_length`", "9", "10"],
    ),
    "flags too few": (
        lambda: baselines.masked_single_frame(GOOD, trusted=[True]),
        ["trusted", "17", "1"],
    ),
    "nothing elsewhere": (
        lambda: baselines.ratio_test(GOOD, exclude=4),
        ["`exclude`", "from 0 to 3", "8 places"],
    ),
    "a window below zero": (lambda: baselines.ratio_test(GOOD, exclude=-1), ["`exclude`", "-1"]),
    "a spread of one": (lambda: baselines.spread(GOOD, top=1), ["`top`", "2 or more", "1"]),
    "a slope that falls": (
        lambda: baselines.spread(GOOD, slope=-1.0),
        ["`slope`", "0 or more", "-1.0"],
    ),
    "a slope of words": (lambda: baselines.spread(GOOD, slope="steep"), ["`slope`", "steep"]),  # type: ignore[arg-type]
    "positions of others": (
        lambda: baselines.spread(GOOD, np.ones(17)),
        ["positions", "(9,)", "(17,)"],
    ),
    "a lost position": (
        lambda: baselines.spread(GOOD, np.where(np.arange(9) == 4, np.nan, 0.0)),
        ["positions", "nan", "place 4"],
    ),
    "positions in words": (lambda: baselines.spread(GOOD, ["here"] * 9), ["positions", "numbers"]),
    "a truth too short": (
        lambda: baselines.perfect_predictor(GOOD, [0, 1]),
        ["truth", "(17,)", "(2,)"],
    ),
    "a truth of floats": (
        lambda: baselines.perfect_predictor(GOOD, np.full(17, 0.5)),
        ["truth", "float64"],
    ),
    "a truth off the map": (
        lambda: baselines.perfect_predictor(GOOD, [0] * 16 + [9]),
        ["from 0 to 8", "9 for query 16"],
    ),
    "a truth below -1": (
        lambda: baselines.perfect_predictor(GOOD, [-2] * 17),
        ["truth", "-2", "query 0"],
    ),
    "a cell of 2": (
        lambda: baselines.perfect_predictor(GOOD, np.full((9, 17), 2)),
        ["truth", "1", "0", "-1", "2 at place 0, query 0"],
    ),
    "half a place": (
        lambda: baselines.perfect_predictor(GOOD, [0] * 17, 0.5),
        ["`tolerance`", "whole", "0.5"],
    ),
    "a tolerance below 0": (
        lambda: baselines.perfect_predictor(GOOD, [0] * 17, -1),
        ["`tolerance`", "-1"],
    ),
    "positions of other queries": (
        lambda: baselines.perfect_predictor(GOOD, (np.zeros((9, 2)), np.zeros((9, 2))), 5.0),
        ["truth", "17 of queries", "9"],
    ),
    "positions on other axes": (
        lambda: baselines.perfect_predictor(GOOD, (np.zeros((9, 2)), np.zeros((17, 3))), 5.0),
        ["truth", "(9, 2)", "(17, 3)"],
    ),
    "a rate in per cent": (
        lambda: baselines.noisy_predictor([True], true_positive_rate=90, false_positive_rate=0),
        ["`true_positive_rate`", "from 0 to 1", "90"],
    ),
    "right as numbers": (
        lambda: baselines.noisy_predictor(np.ones(3), true_positive_rate=1, false_positive_rate=0),
        ["right", "bool", "float64"],
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_bad_input_is_named(name: str) -> None:
    call, words = WRONG[name]
    with pytest.raises(surefix.SurefixValueError) as caught:
        call()
    for word in words:
        assert word in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", sorted(set(baselines.__all__) - {"METHODS"}))
def test_it_is_documented_and_its_example_runs(name: str) -> None:
    thing = getattr(baselines, name)
    text = inspect.getdoc(thing)
    assert text is not None
    example = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
    assert example.examples or name in {"Context", "Method"}
    said: list[str] = []
    doctest.DocTestRunner().run(example, out=said.append)
    assert not said, "".join(said)
