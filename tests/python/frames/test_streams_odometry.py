"""A frame every few metres."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import surefix
from recordings import KINDS, Bag, pictures
from surefix.datasets import local_metres
from surefix.frames import EveryMetres, Frame, Odometry
from surefix.frames import open as frames_open

BLACK = np.zeros((4, 6), np.uint8)
Float64 = npt.NDArray[np.float64]


def frames(times: Float64) -> list[Frame]:
    return [Frame(BLACK, float(time), str(index)) for index, time in enumerate(times)]


def taken(times: Float64, odometry: Odometry, metres: float) -> list[int]:
    return [int(frame.name) for frame in EveryMetres(frames(times), odometry, metres)]


def nearest(reach: Callable[[int, int], Float64], count: int, step: float) -> list[int]:
    """The first, then of each mark the nearest frame, not taken before: ``reach(start, end)`` are
    the ways from a frame to those after it. A mark that is passed by more than a step moves.
    """
    chosen, over = [0], 0.0
    while True:
        start = chosen[-1]
        off = (reach(start, count)[1:] + over) / step - 1
        if not len(off):
            return chosen
        late = np.flatnonzero(off >= -1e-6)
        before = off[: late[0] if len(late) else None]
        # Of frames that stand at the same distance, the last.
        best = len(before) - 1 - int(np.argmax(before[::-1])) if len(before) else -1
        near = -before[best] if best >= 0 else np.inf
        # At the end, or before a jump, one more frame like the last must not be nearer.
        ends = not len(late) or off[late[0]] > 1
        last = np.concatenate([[over / step - 1], before])
        bound = (last[-1] - last[max(len(last) - 2, 0)]) / 2 if ends else off[late[0]] - 1e-6
        if near < bound:
            over, taken = step * off[best], best
        elif len(late):
            taken = late[0]
            over = step * off[taken] if off[taken] <= 1 else 0.0
        else:
            return chosen
        chosen.append(int(taken) + start + 1)


def every_metres(distance: Float64, metres: float) -> list[int]:
    """Of frames at these distances along a line."""
    return nearest(lambda start, end: distance[start:end] - distance[start], len(distance), metres)


@pytest.mark.parametrize("seed", range(60))
def test_along_a_line_it_is_the_frame_nearest_to_each_mark(seed: int) -> None:
    generator = np.random.default_rng(seed)
    stamps = np.arange(40.0)
    # Standing, creeping and driving, in exact quarters of a metre.
    driven = np.cumsum(generator.choice([0, 0, 1, 8, 20], 40)) / 4
    # In quarters of a second: positions between are exact too.
    times = np.unique(generator.integers(0, 39 * 4, 120)) / 4
    metres = float(generator.choice([0.5, 1.0, 2.0, 8.0]))
    expected = every_metres(np.interp(times, stamps, driven), metres)
    assert taken(times, Odometry(stamps, driven[:, None]), metres) == expected
    # The same drive, straight, in a plane and in space: 3-4-5 and 2-3-6-7 keep the lengths exact.
    for direction, length in (((3, 4), 5), ((2, 3, 6), 7)):
        at = np.outer(driven, direction) + 1000.0
        assert taken(times, Odometry(stamps, at), metres * length) == expected


@pytest.mark.parametrize("seed", range(30))
def test_along_a_curve_ways_are_straight_from_the_frame_taken_before(seed: int) -> None:
    generator = np.random.default_rng(seed)
    stamps = np.arange(200.0)
    heading = np.cumsum(generator.normal(0, 0.1, 200))
    speed = generator.choice([0.0, 1.0, 3.0], 200)
    at = np.cumsum(np.stack([np.cos(heading), np.sin(heading)], axis=1) * speed[:, None], axis=0)
    expected = nearest(lambda a, b: np.linalg.norm(at[a:b] - at[a], axis=1), 200, 2.5)
    assert taken(stamps, Odometry(stamps, at), 2.5) == expected


@pytest.mark.parametrize("seed", range(10))
def test_a_frame_a_metre_stays_one_if_the_receiver_jitters(seed: int) -> None:
    times = np.arange(300.0)
    noise = np.random.default_rng(seed).uniform(-0.02, 0.02, 300)
    assert taken(times, Odometry(times, (times + noise)[:, None]), 1.0) == [*range(300)]
    # A little more or less than a metre each: all, or now and then one less.
    slow = taken(times, Odometry(times, (1.003 * times + noise)[:, None]), 1.0)
    assert slow == [*range(300)]
    fast = taken(times, Odometry(times, (0.997 * times + noise)[:, None]), 1.0)
    assert len(fast) in (299, 300)


def test_standing_still_yields_nothing_and_noise_is_no_path() -> None:
    times = np.arange(1000.0)
    still = Odometry(times, np.tile([5.0, 7.0], (1000, 1)))
    assert taken(times, still, 0.1) == [0]
    noise = np.random.default_rng(0).normal(0, 0.05, (1000, 2)).clip(-0.1, 0.1)
    assert np.abs(np.diff(noise, axis=0)).sum() > 100
    assert taken(times, Odometry(times, noise), 1.0) == [0]


@pytest.mark.parametrize("seed", range(20))
def test_positions_between_are_numpys(seed: int) -> None:
    generator = np.random.default_rng(seed)
    stamps = np.cumsum(generator.uniform(0.01, 2, 30)) + 1.7e9
    at = generator.normal(0, 100, (30, 3))
    odometry = Odometry(stamps, at)
    for time in generator.uniform(stamps[0], stamps[-1], 50).tolist() + stamps.tolist():
        expected = [np.interp(time, stamps, column) for column in at.T]
        found = odometry.at(time)
        assert found is not None
        assert np.allclose(found, expected, rtol=0, atol=1e-6)
    assert odometry.at(stamps[0] - 0.1) is None
    assert odometry.at(stamps[-1] + 0.1) is None


def test_frames_without_a_position_are_passed_over() -> None:
    odometry = Odometry([10.0, 20.0], [[0.0, 0.0], [10.0, 0.0]])
    assert taken(np.arange(5.0, 30.0), odometry, 5) == [5, 10, 15]


def test_clocks_that_differ_are_said() -> None:
    odometry = Odometry([1.7e9, 1.7e9 + 5], [[0.0], [9.0]], "wheels.csv")
    expected = r"wheels\.csv: expected positions at the times of the frames, 0\.0 s to 4\.0 s, got those of 1700000000\.0"
    with pytest.raises(surefix.SurefixValueError, match=expected):
        taken(np.arange(5.0), odometry, 1)
    assert list(EveryMetres([], odometry, 1)) == []


@pytest.mark.parametrize(
    ("columns", "values", "expected"),
    [
        ("time,x,y", ["0,0,0", "1,3,4"], [[0, 0], [3, 4]]),
        ("z,y,x,time,speed", ["1,2,3,0,9", "4,5,6,1.5,9"], [[3, 2, 1], [6, 5, 4]]),
        ("Time, Distance", ["# wheels", "0, 0", "", "2, 7.5"], [[0], [7.5]]),
    ],
)
def test_a_table_is_read_by_its_header(
    tmp_path: Path, columns: str, values: list[str], expected: list[list[float]]
) -> None:
    path = tmp_path / "wheels.csv"
    path.write_text("\n".join([columns, *values]))
    assert Odometry.from_csv(path).positions.tolist() == expected


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,lat,lon\n0,1,2\n", "row 1: expected the columns time in seconds, and x,y"),
        ("x,y\n0,1\n", "row 1: expected the columns time"),
        ("time,x,y\n0,1,2\n1,one,2\n", "row 3: expected x, a number, got 'one'"),
        ("time,x,y\n0,1,2\n1,nan,2\n", "row 3: expected x, a finite number"),
        ("time,x,y\n0,1,2\n\n0,1,2\n", "row 4: expected ascending times, got 0.0 after 0.0"),
        ("time,x,y\n0,1\n", "row 2: expected 3 values, got 2"),
        ("time,x,y\n", "expected a header"),
    ],
)
def test_a_table_that_is_none_is_named_with_its_row(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "wheels.csv"
    path.write_text(text)
    with pytest.raises(surefix.SurefixValueError, match=words) as refused:
        Odometry.from_csv(path)
    assert str(refused.value).startswith(str(path))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "pose",
    [
        "nav_msgs/msg/Odometry",
        "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/PoseWithCovarianceStamped",
    ],
)
def test_the_poses_of_a_bag(tmp_path: Path, kind: str, pose: str) -> None:
    times = 1_700_000_000 + np.arange(8) / 4
    driven = np.array([0, 0, 1, 2, 2, 2, 3, 5.0])
    with Bag(tmp_path, kind) as bag:
        for time, distance, image in zip(times, driven, pictures(8), strict=True):
            bag.image("/image", image, float(time))
            bag.pose("/pose", pose, (3 * distance, 4 * distance, 0), float(time))
    odometry = Odometry.from_bag(bag.path, "/pose")
    assert odometry.times.tolist() == times.tolist()
    assert np.array_equal(odometry.positions, np.outer(driven, [3, 4, 0]))
    stream = frames_open(bag.path, metres=5, odometry="/pose")
    assert [int(frame.name) for frame in stream] == every_metres(driven, 1)


def test_a_receiver_of_satellites(tmp_path: Path) -> None:
    latitude = 48.0 + np.arange(5) * 1e-5
    with Bag(tmp_path, "mcap") as bag:
        for index, degrees in enumerate(latitude):
            status = -1 if index == 2 else 0
            bag.pose(
                "/fix", "sensor_msgs/msg/NavSatFix", (degrees, 11.0, 500.0, status), 100.0 + index
            )
    odometry = Odometry.from_bag(bag.path, "/fix")
    assert odometry.times.tolist() == [100, 101, 103, 104]
    kept = np.delete(latitude, 2)
    assert np.array_equal(odometry.positions, local_metres(kept, np.full(4, 11.0)))


def test_a_topic_that_has_no_poses_is_said(tmp_path: Path) -> None:
    with Bag(tmp_path, "mcap") as bag:
        bag.image("/image", pictures(1)[0], 1.0)
        bag.pose("/pose", "geometry_msgs/msg/PoseStamped", (float("nan"), 0, 0), 1.0)
    for topic in ("/image", "/odom"):
        with pytest.raises(
            surefix.SurefixValueError, match=rf"got '{topic}' .*there are /pose \(geometry_msgs"
        ):
            frames_open(bag.path, metres=1, odometry=topic)
    with pytest.raises(
        surefix.SurefixValueError, match=r"/pose, message 0: expected finite numbers"
    ):
        frames_open(bag.path, metres=1, odometry="/pose")


@pytest.mark.parametrize(
    ("times", "positions", "words"),
    [
        ([], np.zeros((0, 2)), "one or more, got 0 times"),
        ([0, 1], [[0.0, 0.0]], "got 2 times and 1 positions"),
        ([0, 1], [0.0, 1.0], r"got \(2,\) and \(2,\)"),
        ([0, 1], np.zeros((2, 4)), r"got \(2,\) and \(2, 4\)"),
        ([0, np.inf], np.zeros((2, 2)), r"finite numbers, got inf, \[0.0, 0.0\] in row 1"),
        ([1, 1], np.zeros((2, 2)), "ascending times, got 1.0 after 1.0 in row 1"),
    ],
)
def test_odometry_that_is_none_is_refused(
    times: list[float], positions: npt.ArrayLike, words: str
) -> None:
    with pytest.raises(surefix.SurefixValueError, match=words):
        Odometry(times, positions)


@pytest.mark.parametrize("metres", [0, -1, float("nan"), float("inf")])
def test_metres_are_above_0(metres: float) -> None:
    with pytest.raises(surefix.SurefixValueError, match="metres: expected a distance above 0"):
        EveryMetres([], Odometry([0], [[0.0]]), metres)
