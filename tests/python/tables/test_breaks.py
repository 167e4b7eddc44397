"""Breaks of a recorded road: jumps and gaps, and nothing on drives that have none."""

from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from surefix.tables.breaks import Break, found_breaks, gaps, jumps, said_breaks, usual_step

Float64 = npt.NDArray[np.float64]
RATE = 10


@cache
def car(seed: int, seconds: int = 400) -> Float64:
    """A car on a ring of 300 m radius, ten positions a second: it stops, crawls, and drives at up
    to 33 m/s, with 3 m/s^2 ahead and 5 m/s^2 of brakes.
    """
    rng = np.random.default_rng(seed)
    speed, wanted, way = 0.0, 14.0, [0.0]
    for _ in range(seconds * RATE):
        if rng.random() < 1 / (20 * RATE):
            wanted = rng.choice([0, 0, 1.4, 8, 14, 33])
        speed += np.clip(wanted - speed, -5 / RATE, 3 / RATE)
        way.append(way[-1] + speed / RATE)
    angle = np.array(way) / 300
    return 300 * np.stack([np.cos(angle), np.sin(angle)], axis=1)


@pytest.mark.parametrize("noise", [0.0, 0.5, 3.0])
@pytest.mark.parametrize("every", [1, 5, 10, 50])
def test_no_drive_breaks_at_stops_and_fast_stretches(every: int, noise: float) -> None:
    for seed in range(8):
        drive = car(seed)[::every]
        drive = drive + np.random.default_rng(seed).normal(0, noise, drive.shape)
        assert jumps(drive) == []


@pytest.mark.parametrize("metres", [0.5, 1.0, 2.0, 10.0, 30.0])
def test_a_jump_is_found_whatever_the_step(metres: float) -> None:
    """After sampling by metres, as by five speeds."""
    count = 300
    road = np.stack([np.arange(count) * metres, np.zeros(count)], axis=1)
    road += np.random.default_rng(0).normal(0, metres / 10, road.shape)
    assert jumps(road) == []
    road[120:, 1] += 340
    ((place, far),) = jumps(road)
    assert place == 120
    assert far == pytest.approx(340, abs=10)
    road[250:, 0] -= 5000
    assert [place for place, _ in jumps(road)] == [120, 250]
    # In one dimension too: the way along.
    assert [place for place, _ in jumps(road[:, :1])] == [250]


@pytest.mark.parametrize("length", [1, 2, 4])
def test_a_receivers_error_that_comes_back_is_no_break(length: int) -> None:
    road = np.stack([np.arange(100) * 2.0, np.zeros(100)], axis=1)
    road[40 : 40 + length] += 900
    assert jumps(road) == []


def test_short_roads_and_standstills_have_no_jumps() -> None:
    for positions in ([[0.0, 0]], [[0, 0], [900.0, 0]], [[0, 0]] * 9):
        assert jumps(np.array(positions, np.float64)) == []
    assert usual_step(np.zeros((4, 2))) == 0
    assert usual_step(np.array([[0.0], [0.0], [3.0], [6.0], [6.0]])) == 3


def test_a_gap_is_long_beside_the_usual_interval() -> None:
    clock = np.arange(100) / 8
    assert gaps(clock.tolist(), None) == []
    late = clock + 12 * (np.arange(100) >= 60)
    assert gaps(late.tolist(), None) == [(60, 12.125)]
    # Ten intervals of a slow clock, or two seconds of a fast one, are none.
    assert gaps((late * 16).tolist(), None) == [(60, 194.0)]
    assert gaps((np.arange(100) + 9.0 * (np.arange(100) >= 60)).tolist(), None) == []
    assert gaps((clock + 1.5 * (np.arange(100) >= 60)).tolist(), None) == []
    back = clock - 5 * (np.arange(100) >= 60)
    assert gaps(back.tolist(), None) == [(60, pytest.approx(-4.875))]
    # Unknown times have no gaps.
    for unknown in ([], [1.0], [*late.tolist()[:99], None]):
        assert gaps(unknown, None) == []


def test_a_halt_is_no_gap() -> None:
    clock = np.arange(100) / 8 + 300 * (np.arange(100) >= 60)
    road = np.stack([np.arange(100) * 2.0, np.zeros(100)], axis=1)
    assert gaps(clock.tolist(), road) == []
    road[60:] += 50
    assert [place for place, _ in gaps(clock.tolist(), road)] == [60]


def test_breaks_are_said_with_their_reasons() -> None:
    road = np.stack([np.arange(100) * 2.0, np.zeros(100)], axis=1)
    road[60:, 1] += 600
    clock = np.arange(100) / 8 + 60 * (np.arange(100) >= 60) + 9 * (np.arange(100) >= 80)
    # Before place 80 the robot stood still.
    assert found_breaks(road, clock.tolist()) == [Break(60, "a jump of 600 m, a gap of 60 s")]
    said = ["2 breaks: before place 60 (a gap of 60 s), before 80 (a gap of 9 s)"]
    assert said_breaks(found_breaks(None, clock.tolist())) == said
    assert said_breaks([]) == []
    many = [Break(place) for place in range(1, 9)]
    said = "8 breaks: before place 1, before 2, before 3, before 4, before 5, 3 more"
    assert said_breaks(many) == [said]
