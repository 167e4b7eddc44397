"""What fits better than a truth that does not fit, and no word if nothing does."""

import numpy as np
import pytest

from surefix.study.fit import better_fit

Q = np.arange(60)
FITS = {
    "every second frame is a query": (2 * np.arange(15), np.arange(15), "place = 2 * query"),
    "every second frame is a place": (Q // 2, Q, "place = query / 2"),
    "the other direction": (Q[::-1], Q, "place = -query + 59"),
    "a later start": (Q + 7, Q, "place = query + 7"),
    "a truth that counts from 1": (Q % 30, Q % 30 + 1, "place = truth -1 is exact for 60 of 60"),
    "a truth of another drive": (Q, (Q * 17) % 60, "place = query fits 60 of 60"),
}


@pytest.mark.parametrize("name", FITS)
def test_a_line_that_fits_is_said(name: str) -> None:
    place, truth, words = FITS[name]
    said = better_fit(place, truth)
    assert said is not None
    assert said.startswith(words)


def test_of_noisy_matches_too() -> None:
    rng = np.random.default_rng(0)
    truth = np.arange(100)
    place = np.where(rng.random(100) < 0.6, 3 * truth + 5, rng.integers(0, 300, 100))
    said = better_fit(place, truth)
    assert said is not None
    assert said.startswith("place = 3 * query + 5 fits ")


def test_matches_by_chance_and_a_right_truth_need_no_word() -> None:
    rng = np.random.default_rng(1)
    for _ in range(300):
        places = int(rng.integers(30, 400))
        truth = np.arange(rng.integers(6, places + 1))
        chance = rng.integers(0, places, len(truth))
        assert better_fit(chance, truth) is None
        assert better_fit(np.where(rng.random(len(truth)) < 0.3, truth, chance), truth) is None
        assert better_fit(truth, truth) is None
    assert better_fit(chance, np.full(len(chance), -1)) is None
