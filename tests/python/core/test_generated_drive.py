"""Drives along the generated route that stop, reverse, leave the map and come back."""

from typing import Any

import numpy as np
import pytest

from surefix import Localizer, Map, Sad, SurefixValueError
from surefix.simulate import Route

ROUTE = Route(places=120, size=(64, 32))
LEGS: list[Any] = [
    ("drive", 60),
    ("stop", 10),
    ["reverse", np.int64(20), 0.5],
    ("detour", 30, 1),
    ("drive", 20),
    ("loop", 40),
    ("drive", 15, 2.0),
]
# A leg's step along the route, the direction of the wheels, and whether it is on the map.
KINDS = {
    "drive": (1, 1, True),
    "stop": (0, 1, True),
    "reverse": (-1, 1, True),
    "detour": (1, 1, False),
    "loop": (-1, -1, False),
}


def planned(legs: list[Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The place of each frame, the places that the wheels count, and whether it is on the map."""
    rows = [
        (step * (*leg, 1.0)[2], wheels, on)
        for leg in legs
        for step, wheels, on in [KINDS[leg[0]]] * int(leg[1])
    ]
    steps, wheels, on = np.array(rows).T
    steps[0] = 0
    return np.cumsum(steps), steps * wheels, on.astype(bool)


@pytest.mark.parametrize("spacing", [3.0, 0.7])
def test_positions_wheels_and_truth_follow_the_legs(spacing: float) -> None:
    route = Route(places=120, size=(64, 32), spacing=spacing)
    drive = route.traverse(legs=LEGS)
    places, advance, on = planned(LEGS)
    assert len(drive) == len(places) == 195
    np.testing.assert_allclose(drive.positions, np.where(on, places * spacing, np.nan))
    np.testing.assert_allclose(drive.odometry(), advance * spacing, atol=1e-12)
    truth = drive.truth(route.reference())
    whole = on & (places == np.round(places))
    assert (truth[whole] == places[whole]).all()
    assert (truth[~on] == -1).all()


def test_wheels_err_as_told_and_the_way_with_uneven_speed_is_the_same() -> None:
    drive = ROUTE.revisit(legs=LEGS)
    true = drive.odometry()
    np.testing.assert_allclose(drive.odometry(scale=1.02), 1.02 * true)
    noisy = drive.odometry(noise=0.05)
    assert (noisy == ROUTE.revisit(legs=LEGS).odometry(noise=0.05)).all()
    moves = true != 0
    assert (noisy[~moves] == 0).all()
    assert 0.03 < np.std(noisy[moves] / true[moves]) < 0.07
    assert true[1:60].sum() == pytest.approx(drive.positions[59])


def test_without_legs_a_speed_drives_the_whole_route() -> None:
    assert len(ROUTE.traverse(speed=0.1)) == 1191
    fast = ROUTE.traverse(speed=3)
    assert fast.truth(ROUTE.reference()).tolist() == list(range(0, 120, 3))
    assert (fast[7] == ROUTE.reference()[21]).all()


def test_off_the_map_every_place_is_far() -> None:
    known = Map.from_images(ROUTE.reference(), Sad())
    drive = ROUTE.traverse(legs=LEGS, noise=0.05)
    localizer = Localizer(known)
    nearest = np.array([fix.single.distance for fix in localizer.stream(drive)])
    places, _, on = planned(LEGS)
    # Half a place on, the view has changed.
    on_place = on & (places == np.round(places))
    assert nearest[~on].min() > 2 * nearest[on_place].max()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"legs": []}, "expected 1 leg or more, got none"),
        ({"legs": 5}, "expected a sequence of legs, got 5"),
        ({"legs": "drive"}, "expected a sequence of legs, got 'drive'"),
        ({"legs": [("fly", 3)]}, r"or \"loop\", a number of frames .* got \('fly', 3\)"),
        ({"legs": [("drive", 2.5)]}, r"got \('drive', 2.5\)"),
        ({"legs": [("drive", 9), ("stop", 0)]}, r"expected 1 frame or more .* leg 1: Stop\(0\)"),
        ({"legs": [("drive", 9)], "speed": 0}, "expected a speed above 0, .* leg 0: Drive"),
        ({"speed": 0}, "expected a speed above 0"),
        ({"speed": float("nan")}, "expected a speed above 0"),
        (
            {"legs": [("drive", 9), ("reverse", 9)]},
            r"places 0 to 119, got leg 1: Reverse\(9, 1.0\), which ends at -1",
        ),
        ({"legs": [("drive", 121)]}, "which ends at 120"),
    ],
)
def test_a_bad_plan_is_named(options: dict[str, Any], said: str) -> None:
    for drive in (ROUTE.traverse, ROUTE.revisit):
        with pytest.raises(SurefixValueError, match=f"option `legs`: .*{said}"):
            drive(**options)


@pytest.mark.parametrize(
    ("errors", "said"),
    [
        ({"scale": float("nan")}, "option `scale`: expected a finite number, got NaN"),
        ({"noise": -0.1}, "option `noise`: expected a finite number of 0 or more, got -0.1"),
    ],
)
def test_bad_wheels_are_named(errors: dict[str, float], said: str) -> None:
    with pytest.raises(SurefixValueError, match=said):
        ROUTE.reference().odometry(**errors)
