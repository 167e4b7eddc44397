"""The supervised predictor: the authors' two factors, scikit-learn's machine, and a real
railway.
"""

import subprocess
import sys
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from sklearn.svm import SVC

import real_data
import surefix
from surefix.baselines import SupervisedPredictor, integrity_factors, perfect_predictor

Array = npt.NDArray[Any]


def route(seed: int, length: int = 150, share: float = 0.6) -> tuple[Array, Array]:
    """Random distances, with a dip at the true place of some queries, and the truth."""
    rng = np.random.default_rng(seed)
    D = rng.random((length, length), np.float32) + 0.5
    seen = rng.random(length) < share
    D[np.arange(length), np.arange(length)] -= np.where(
        seen, rng.uniform(0.0, 0.6, length), 0.0
    ).astype(np.float32)
    return D, np.arange(length)


def factors_by_hand(column: Array, exclude: int) -> tuple[float, float]:
    """The words of the paper, and the ends and the sum of two sides of the authors' code."""
    best = int(column.argmin())
    others = sorted(float(d) for i, d in enumerate(column) if abs(i - best) > exclude)
    span = float(column.max()) - float(column[best])
    sides = [
        float(column[i]) - float(column[best]) for i in (best - 1, best + 1) if 0 <= i < len(column)
    ]
    return ((others[0] - float(column[best])) / span if span else 0.0), sum(sides)


@pytest.mark.parametrize("exclude", [0, 2])
def test_the_factors_are_the_papers(exclude: int) -> None:
    rng = np.random.default_rng(0)
    shapes = [rng.random((20, 30), np.float32), rng.integers(0, 3, (8, 40)).astype(np.float32)]
    for D in [*shapes, -shapes[0], np.full((7, 4), 0.25, np.float32), np.empty((7, 0), np.float32)]:
        expected = np.array([factors_by_hand(column, exclude) for column in D.T]).reshape(-1, 2)
        np.testing.assert_allclose(
            integrity_factors(D, exclude=exclude), expected, rtol=1e-12, atol=1e-12
        )
        halved = integrity_factors(D, exclude=exclude, gradient="halved")
        ends = np.isin(D.argmin(axis=0), (0, len(D) - 1))
        np.testing.assert_allclose(
            halved[:, 1], expected[:, 1] * np.where(ends, 1, 0.5), rtol=1e-12, atol=1e-12
        )


@pytest.mark.parametrize("seed", range(5))
def test_it_is_the_machine_of_the_paper_step_by_step(seed: int) -> None:
    (D, truth), (other, _) = route(seed), route(seed + 100)
    right = perfect_predictor(D, truth)
    known, new = integrity_factors(D), integrity_factors(other)
    mean, std = known.mean(axis=0), known.std(axis=0)
    share = right.mean()
    weights = {True: 0.5 / share, False: 0.5 / (1 - share)}
    machine = SVC(C=1.0, kernel="rbf", gamma=0.5, class_weight=weights).fit(
        (known - mean) / std, right
    )

    predictor = SupervisedPredictor()
    assert predictor.factors is None
    assert predictor.fit(D, truth) is predictor
    np.testing.assert_array_equal(predictor.factors, known)
    np.testing.assert_array_equal(predictor.right, right)
    expected = machine.predict((new - mean) / std)
    trusted = predictor.predict(other)
    assert trusted.dtype == np.bool_
    assert (trusted == expected).mean() > 0.99
    assert 0 < trusted.sum() < len(trusted)
    assert predictor.predict(other[:, :0]).shape == (0,)


def test_it_does_not_ask_for_the_unit_only_that_it_stays() -> None:
    (D, truth), (other, _) = route(1), route(2)
    here = SupervisedPredictor().fit(D, truth).predict(other)
    np.testing.assert_array_equal(SupervisedPredictor().fit(D * 4, truth).predict(other * 4), here)


def test_queries_that_the_truth_ignores_are_left_out_and_those_off_the_map_are_mistakes() -> None:
    D, truth = route(3, 60)
    off = np.where(np.arange(60) < 10, -1, truth)
    off_the_map = SupervisedPredictor().fit(D, off)
    assert off_the_map.right is not None
    assert not off_the_map.right[:10].any()
    cells = np.eye(60, dtype=np.int8)
    cells[:, :10] = -1
    ignored = SupervisedPredictor().fit(D, cells)
    assert ignored.right is not None
    np.testing.assert_array_equal(ignored.right, perfect_predictor(D, truth)[10:])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["nordland"])
def test_on_a_real_railway_half_teaches_the_other_half(name: str) -> None:
    folder = real_data.folder() / name
    places = surefix.Map.from_images(np.load(folder / "summer_0000_1149.npy"))
    winter = np.load(folder / "winter_0000_1149.npy")
    D = np.stack([places.distances(places.descriptor.describe(image)) for image in winter], axis=1)  # type: ignore[union-attr]
    half = len(D) // 2
    first, second = D[:half, :half], D[half:, half:]
    for teach, test in ((first, second), (second, first)):
        trusted = SupervisedPredictor().fit(teach, np.arange(len(teach))).predict(test)
        right = perfect_predictor(test, np.arange(len(test)))
        assert trusted.any()
        assert right[trusted].mean() > right.mean() + 0.1


def refused(call: Any, *words: str) -> str:
    with pytest.raises(surefix.SurefixError) as caught:
        call()
    for word in words:
        assert word in str(caught.value)
    return str(caught.value)


def test_bad_calibrations_are_named_and_change_nothing() -> None:
    D, truth = route(4, 40)
    predictor = SupervisedPredictor()
    refused(lambda: predictor.predict(D), "fit", "predict")
    before = predictor.fit(D, truth).predict(D)
    right = np.resize(np.flatnonzero(perfect_predictor(D, truth)), 12)
    refused(lambda: predictor.fit(D[:, right], truth[right]), "calibration", "12 right and 0 wrong")
    refused(lambda: predictor.fit(D, np.full(40, -1)), "calibration", "0 right and 40 wrong")
    refused(lambda: predictor.fit(D[:, :9], truth[:9]), "calibration", "at least 10", "9")
    refused(lambda: predictor.fit(D, truth[:5]), "truth", "(40,)", "(5,)")
    refused(lambda: predictor.fit(D.astype(float), truth), "float32", "float64")
    refused(lambda: SupervisedPredictor(exclude=20).fit(D, truth), "`exclude`", "19", "20")
    refused(lambda: SupervisedPredictor(gradient="steep").fit(D, truth), "`gradient`", "steep")
    np.testing.assert_array_equal(predictor.predict(D), before)


def test_without_scikit_learn_one_line_says_what_to_install() -> None:
    script = (
        "import sys; sys.modules['sklearn'] = None\n"
        "import surefix, surefix.baselines as baselines\n"
        "try: baselines.SupervisedPredictor()\n"
        "except surefix.SurefixError as error: print(error)"
    )
    said = subprocess.run(
        [sys.executable, "-c", script], check=True, capture_output=True, text=True
    ).stdout
    assert said.count("\n") == 1
    assert "pip install 'surefix[eval]'" in said


def test_scikit_learn_is_not_loaded_before_it_is_needed() -> None:
    script = "import sys, surefix.baselines; print('sklearn' in sys.modules)"
    said = subprocess.run(
        [sys.executable, "-c", script], check=True, capture_output=True, text=True
    ).stdout
    assert said.strip() == "False"
