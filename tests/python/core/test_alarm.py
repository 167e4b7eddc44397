"""The alarm beside an oracle, and on drives that change and that do not."""

import re
from collections.abc import Callable, Iterator
from fractions import Fraction

import numpy as np
import pytest
from numpy.typing import NDArray

import real_data
import surefix

POWERS = (0.1, 0.3, 0.6)


def split_mix() -> Iterator[int]:
    """Steele, Lea and Flood (2014), from seed 0."""
    state = 0
    while True:
        state = (state + 0x9E3779B97F4A7C15) % 2**64
        z = (state ^ (state >> 30)) * 0xBF58476D1CE4E5B9 % 2**64
        z = (z ^ (z >> 27)) * 0x94D049BB133111EB % 2**64
        yield z ^ (z >> 31)


def blocks(scores: NDArray[np.float32], block: int, ties: Iterator[int]) -> list[tuple[float, int]]:
    whole = scores[: len(scores) // block * block].astype(float).reshape(-1, block)
    return [(mean, next(ties)) for mean in whole.mean(1)]


def oracle(calibration: NDArray[np.float32], drive: NDArray[np.float32], block: int) -> list[float]:
    """The evidence after each block: the mean over all bettors, each of whom waits for his block.

    With probability 50 / (50 + t) a bettor still waits after t blocks.
    """
    ties = split_mix()
    known = blocks(calibration, block, ties)
    drive_blocks = blocks(drive, block, ties)
    pays: list[list[float]] = []
    for t, new in enumerate(drive_blocks):
        at = sum(other > new for other in known)
        earlier = [sum(other > one for other in known) for one in drive_blocks[:t]]
        count = len(known) + t + 1
        first = at + sum(other < at for other in earlier)
        last = first + sum(other == at for other in earlier) + 1
        low, high = Fraction(first, count), Fraction(last, count)
        # The mean over the rank of the derivative of rank ** power.
        pays.append([(float(high) ** k - float(low) ** k) / float(high - low) for k in POWERS])
    evidence = []
    for end in range(1, len(pays) + 1):
        total = 50 / (50 + end)
        for start in range(end):
            chance = 50 / (50 + start) - 50 / (51 + start)
            total += chance * np.prod(pays[start:end], axis=0).mean()
        evidence.append(float(total))
    return evidence


def frames_until(alarm: surefix.Alarm, scores: NDArray[np.float32]) -> int | None:
    """How many frames it takes to raise the alarm; None if it is not raised."""
    return next((frame for frame, score in enumerate(scores, 1) if alarm.push(score)), None)


def continuous(generator: np.random.Generator, count: int) -> NDArray[np.float32]:
    return generator.normal(size=count).astype(np.float32)


def tied(generator: np.random.Generator, count: int) -> NDArray[np.float32]:
    return np.maximum(generator.integers(-6, 4, count), 0).astype(np.float32)


@pytest.mark.parametrize("scores", [continuous, tied])
@pytest.mark.parametrize("block", [1, 3, 10])
@pytest.mark.parametrize("seed", range(5))
def test_the_evidence_is_the_oracles(
    scores: Callable[[np.random.Generator, int], NDArray[np.float32]], block: int, seed: int
) -> None:
    generator = np.random.default_rng(seed)
    calibration, drive = scores(generator, 40 * block + 7 % block), scores(generator, 60 * block)
    drive[30 * block :] += np.float32(0.5)
    alarm = surefix.Alarm(calibration, block, level=1e-150)
    got = []
    for frame, score in enumerate(drive, 1):
        assert not alarm.push(score)
        if frame % block == 0:
            got.append(alarm.evidence)
    np.testing.assert_allclose(got, oracle(calibration, drive, block), rtol=1e-10)


def test_it_is_raised_when_the_evidence_reaches_the_level_and_stays_so_until_reset() -> None:
    generator = np.random.default_rng(0)
    calibration, drive = continuous(generator, 100), continuous(generator, 60) + 2
    expected = oracle(calibration, drive, 2)
    for level in (0.4, 0.1, 0.01):
        alarm = surefix.Alarm(calibration, 2, level)
        first = next(block for block, value in enumerate(expected, 1) if value >= 1 / level**2)
        assert frames_until(alarm, drive) == 2 * first
        assert alarm.raised
        assert alarm.evidence == pytest.approx(expected[first - 1])
        assert all(alarm.push(score) for score in calibration)
        alarm.reset()
        assert not alarm.raised
        assert alarm.evidence == 1
        assert frames_until(alarm, drive) == 2 * first


def test_scores_that_become_better_raise_none() -> None:
    generator = np.random.default_rng(0)
    alarm = surefix.Alarm(continuous(generator, 300), 1)
    assert frames_until(alarm, continuous(generator, 3000) - 2) is None


def test_a_change_is_noticed_however_late_it_comes() -> None:
    generator = np.random.default_rng(0)
    alarm = surefix.Alarm(continuous(generator, 30), 1)
    assert frames_until(alarm, continuous(generator, 20_000)) is None
    frames = frames_until(alarm, continuous(generator, 1000) + 2)
    assert frames is not None
    assert frames < 30


@pytest.mark.parametrize("score", [np.nan, np.inf, -np.inf])
def test_a_score_that_is_no_number_is_refused_and_changes_nothing(score: float) -> None:
    generator = np.random.default_rng(0)
    calibration, drive = continuous(generator, 100), continuous(generator, 100) + 2
    alarm, other = surefix.Alarm(calibration, 5), surefix.Alarm(calibration, 5)
    for number in drive:
        if not other.raised:
            with pytest.raises(surefix.SurefixValueError, match="alarm: score: expected finite"):
                other.push(score)
        assert alarm.push(number) == other.push(number)
        assert alarm.evidence == other.evidence
    calibration[7] = score
    with pytest.raises(surefix.SurefixValueError, match=r"calibration scores.* at index 7"):
        surefix.Alarm(calibration, 5)


@pytest.mark.parametrize(
    ("count", "block", "level", "message"),
    [
        (100, 0, 0.01, "option `block`: expected a whole number of 1 or more, got 0"),
        (100, -1, 0.01, "option `block`: expected a whole number of 0 or more, got -1"),
        (100, 5, 0.0, "option `level`: expected a number between 0 and 1, got 0"),
        (100, 5, 1.0, "option `level`: expected a number between 0 and 1, got 1"),
        (100, 5, np.nan, "option `level`: expected a number between 0 and 1, got NaN"),
        (4, 5, 0.01, "calibration scores: expected at least a block of 5, got 4"),
        (0, 5, 0.01, "calibration scores: expected at least a block of 5, got 0"),
    ],
)
def test_bad_options_are_refused(count: int, block: int, level: float, message: str) -> None:
    with pytest.raises(surefix.SurefixValueError, match=re.escape(message)):
        surefix.Alarm(np.zeros(count, np.float32), block, level)


def test_a_score_of_another_type_is_refused() -> None:
    with pytest.raises(surefix.SurefixValueError, match="scores: expected float32, got float64"):
        surefix.Alarm(np.zeros(10), 5)  # type: ignore[arg-type]


@pytest.mark.slow
def test_a_real_drive_goes_on_without_alarm_until_its_frames_come_in_another_order() -> None:
    folder = real_data.folder() / "nordland"
    places = surefix.Map.from_images(np.load(folder / "summer_0000_1149.npy"))
    queries = np.load(folder / "winter_0000_1149.npy")
    half = len(queries) // 2
    scores = surefix.match(places, queries, motion="steady").score
    alarm = surefix.Alarm(scores[:half], 22)
    assert frames_until(alarm, scores[half:]) is None
    queries[half:] = np.random.default_rng(0).permutation(queries[half:])
    alarm.reset()
    changed = surefix.match(places, queries, motion="steady").score
    frames = frames_until(alarm, changed[half:])
    assert frames is not None
    assert frames < 250
