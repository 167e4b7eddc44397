"""Drives made of a recorded one: each query shows the place that its truth names."""

import numpy as np
import pytest
from numpy.typing import NDArray

from surefix import Segments, SurefixValueError
from surefix.baselines import Context
from surefix.study import SCENARIOS, Drive, Study, frames_to_notice, roc_area, scenario

PROFILE = np.concatenate((np.zeros(40), np.full(400, 25.0), np.zeros(60), np.full(300, 20.0)))
PLACES = 200


def apart(truth: NDArray[np.float64], places: int = PLACES) -> NDArray[np.float32]:
    """Distances that are the places between the row and the query's true one."""
    return np.abs(np.arange(places)[:, None] - truth).astype(np.float32)


def made(name: str, truth: NDArray[np.float64], seed: int = 0, **odometry: float) -> Drive:
    return scenario(name, apart(truth), truth, seed, profile=PROFILE, spacing=200, **odometry)


@pytest.mark.parametrize("name", SCENARIOS)
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("rate", [1.0, 0.5])
def test_the_truth_is_that_of_the_distances(name: str, seed: int, rate: float) -> None:
    recorded = np.arange(0, PLACES, rate)
    drive = made(name, recorded, seed)
    # The distances hold each query's recorded place, and the rows are recorded places.
    shown = recorded[drive.columns]
    assert np.array_equal(drive.distances, np.abs(drive.rows[:, None] - shown).astype(np.float32))
    on = drive.truth >= 0
    near = np.abs(drive.rows[drive.truth] - shown)
    assert np.all(near[on] == drive.distances.min(axis=0)[on])
    assert np.all(near[on] <= (SCENARIOS[name].thin - 1 if rate == 1 else SCENARIOS[name].thin))
    assert on.all() or SCENARIOS[name].missing or rate < 1


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_advance_is_the_way_between_two_queries(name: str) -> None:
    drive = made(name, np.arange(float(PLACES)))
    moved = np.diff(drive.rows[0] + drive.columns.astype(float)) / SCENARIOS[name].thin
    ordinary = ~np.isin(np.arange(1, len(drive.advance)), drive.jumps)
    assert drive.advance[0] == 0
    np.testing.assert_allclose(drive.advance[1:][ordinary], moved[ordinary], atol=1e-12)
    assert np.all(np.abs(moved[~ordinary]) > 10)
    assert np.all(np.abs(drive.advance[drive.jumps]) <= 2)
    assert len(drive.jumps) in ((2, 3) if SCENARIOS[name].kidnap else (0,))


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_seed_gives_one_drive_with_any_odometry(name: str) -> None:
    first, again = made(name, np.arange(200.0), 3), made(name, np.arange(200.0), 3, noise=0.1)
    other = made(name, np.arange(200.0), 4)
    assert np.array_equal(first.columns, again.columns)
    assert np.array_equal(first.rows, again.rows)
    same = np.array_equal(first.columns, other.columns) and np.array_equal(first.rows, other.rows)
    assert same == (name == "recorded")


@pytest.mark.parametrize("name", ["speeds", "all", "rate-1/3", "rate-1/2", "rate-2", "rate-5"])
def test_stops_take_a_third_of_the_time(name: str) -> None:
    # Long, so that a slow stretch, which repeats frames too, weighs little.
    drive = scenario(name, np.zeros((3000, 3000), np.float32), np.arange(3000))
    still = np.mean(np.diff(drive.columns) == 0)
    # Between frames, the varied speeds repeat some as well.
    assert 0.32 < still < (0.34 if name.startswith("rate") else 0.55)


def test_the_rate_is_that_of_moving_queries() -> None:
    for name, rate in (("rate-1/3", 1 / 3), ("rate-1/2", 1 / 2), ("rate-2", 2), ("rate-5", 5)):
        advance = made(name, np.arange(200.0)).advance
        np.testing.assert_allclose(advance[advance > 0], rate)


def test_a_fifth_of_the_map_is_missing_in_one_stretch() -> None:
    drive = made("missing", np.arange(200.0))
    assert len(drive.rows) == 160
    assert sorted(np.unique(np.diff(drive.rows))) in ([1], [1, 41])
    gone = np.setdiff1d(np.arange(200), drive.rows)
    assert np.array_equal(np.flatnonzero(drive.truth < 0), gone)


def test_a_profile_moves_a_place_a_query_at_its_median_speed() -> None:
    drive = scenario(
        "profile", np.zeros((3000, 3000), np.float32), np.arange(3000), profile=PROFILE, spacing=200
    )
    assert np.median(drive.advance[drive.advance > 0]) == 1
    # An eighth of the time stands: 100 of 800 s.
    assert 0.1 < np.mean(drive.advance == 0) < 0.3


def test_odometry_has_the_errors_that_were_asked_for() -> None:
    true = made("speeds", np.arange(200.0)).advance
    wide = made("speeds", np.arange(200.0), scale_error=0.03).advance
    np.testing.assert_allclose(wide, 1.03 * true)
    noisy = scenario(
        "recorded", np.zeros((5000, 5000), np.float32), np.arange(5000), noise=0.1
    ).advance[1:]
    assert abs(noisy.mean() - 1) < 0.01
    assert abs(noisy.std() - 0.1) < 0.01


def test_queries_that_the_recorded_map_lacks_are_still_driven_past() -> None:
    truth = np.arange(100.0)
    truth[[0, 1, 40, 41, 99]] = -1, np.nan, -1, np.nan, -1
    drive = scenario("recorded", apart(np.arange(100.0), 100), truth)
    assert np.array_equal(drive.truth < 0, ~(truth >= 0))
    np.testing.assert_allclose(drive.advance[1:], 1)


def study(truth: object, tolerance: float = 1, **more: object) -> Study:
    """A drive of 100 places in noise, one query a place."""
    rng = np.random.default_rng(0)
    D = (rng.normal(0, 0.2, (100, 100)) - np.eye(100)).astype(np.float32)
    context = Context(truth=truth, truth_tolerance=tolerance, **more)  # type: ignore[arg-type]
    return Study(D, context, names=("sequence", "single", "topological"), samples=10)


METRES = np.c_[5.0 * np.arange(100), np.zeros(100)]


@pytest.mark.parametrize(
    "truth", [(METRES, METRES), np.eye(100, dtype=bool)], ids=["metres", "cells"]
)
@pytest.mark.parametrize("name", ["speeds", "missing", "all", "rate-2"])
def test_every_kind_of_truth_is_driven_alike(name: str, truth: object) -> None:
    tolerance = 6.0 if isinstance(truth, tuple) else 1
    given = study(truth, tolerance, positions=METRES).driven(name, 5)
    plain = study(np.arange(100)).driven(name, 5)
    assert np.array_equal(given.distances, plain.distances)
    on = ~plain.off_map
    assert np.array_equal(given.true_place[on], plain.true_place[on])
    # Beside the missing stretch a place may be within the metres.
    assert (given.off_map != plain.off_map).sum() <= 2 * isinstance(truth, tuple)
    assert np.array_equal(given.context.advance, plain.context.advance)
    assert np.shape(given.context.positions) == (len(given.distances), 2)
    assert given["single"].right_share > 0.9


@pytest.mark.parametrize("name", ["missing", "rate-3"])
def test_the_segments_are_those_of_the_places_that_are_left(name: str) -> None:
    roads = Segments(100, breaks=[40])
    drive = scenario(name, apart(np.arange(100.0), 100), np.arange(100.0), 5)
    given = study(np.arange(100), segments=roads).driven(name, 5)
    assert given.context.segments is not None
    kept = given.context.segments.breaks.tolist()
    assert kept == [int((drive.rows < 40).sum())]
    assert given["weighted"].right_share > 0.5


def test_the_results_of_a_drive_are_judged_by_its_truth() -> None:
    drive = study(np.arange(100)).driven("all", 2)
    single, filtered = drive["single"], drive["topological"]
    off = drive.off_map
    right = np.abs(single.matches.place - drive.true_place) <= 1
    assert single.right_share == right[~off].mean()
    assert single.off_map_area == roc_area(single.matches.score, off)
    assert single.off_map_area > 0.9
    assert (single.reliability, single.noticed) == (None, None)
    # As many events as jumps and returns on the map.
    assert drive.jumps
    returns = np.flatnonzero(off[:-1] & ~off[1:]) + 1
    events = {*returns, *(jump for jump in drive.jumps if not off[jump])}
    assert len(single.relocalised) == len(filtered.relocalised) == len(events)
    assert np.median(single.relocalised) == 0
    said = filtered.matches.confidence
    assert said is not None
    assert filtered.reliability is not None
    assert filtered.reliability.count.sum() == len(drive)
    assert filtered.noticed is not None
    assert filtered.noticed.tolist() == frames_to_notice(1 - said, off).tolist()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("slow", np.zeros((20, 20)), np.arange(20)), "scenario: expected one of recorded"),
        (("recorded", np.zeros((20, 20)), np.arange(19)), r"\(20,\), got the shape \(19,\)"),
        (("recorded", np.zeros((20, 20)), np.arange(20) + 1), "from 0 to 19, got 20 at 19"),
        (("recorded", np.zeros((20, 20)), np.full(20, -1)), "two places or more"),
        (("recorded", np.zeros((5, 20)), np.zeros(20)), "at least 10 places"),
        (("profile", np.zeros((20, 20)), np.arange(20)), "speeds in m/s, one a second, got none"),
        (("rate-5", np.zeros((10, 10)), np.arange(10)), "at least 4 queries"),
    ],
)
def test_errors_say_what_came(arguments: tuple[object, ...], says: str) -> None:
    with pytest.raises(SurefixValueError, match=says):
        scenario(*arguments)  # type: ignore[arg-type]
