"""The places that a robot has moved between two frames: one drive in every format of odometry."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

import surefix
from recordings import Bag, pictures, write_video
from surefix.datasets import places_per_metre
from surefix.frames import Advances, EveryMetres, Frame, KeepNewest, Odometry, Stride
from surefix.frames import open as frames_open
from surefix.tables.poses import driven, rotations

BLACK = np.zeros((4, 6), np.uint8)
Float64 = npt.NDArray[np.float64]
START = 1_700_000_000
# Ten rows a second: on at 2 m/s, a stop, back at 1 m/s, and on again; on a circle around (0, 30).
TIMES = np.arange(201) / 10
ALONG = np.interp(TIMES, [0, 8, 12, 16, 20], [0, 16, 16, 12, 20])
YAW = ALONG / 30
AT = 30 * np.stack([np.sin(YAW), 1 - np.cos(YAW), 0 * YAW], axis=1)
# Around z: (x, y, z, w).
TURNED = np.stack([0 * YAW, 0 * YAW, np.sin(YAW / 2), np.cos(YAW / 2)], axis=1)
# Two frames a second, between the rows.
TAKEN = np.arange(40) / 2 + 0.13
PLACES_PER_METRE = 0.5
EXPECTED = PLACES_PER_METRE * np.diff(np.interp(TAKEN, TIMES, ALONG))


def test_the_drive_goes_on_stands_and_reverses() -> None:
    assert EXPECTED.max() == pytest.approx(0.5)
    assert EXPECTED.min() == pytest.approx(-0.25)
    assert (EXPECTED == 0).sum() >= 6


def table(path: Path, header: str, columns: Float64, between: str = ",") -> Path:
    lines = [between.join(f"{value:.9f}" for value in row) for row in columns]
    path.write_text("\n".join([header, *lines, ""]))
    return path


def camera_poses() -> tuple[Float64, Float64]:
    """Of a camera that looks ahead, z, with x to its right, in the frame of its first pose."""
    turns = np.zeros((len(YAW), 3, 3))
    turns[:, 0, 0] = turns[:, 2, 2] = np.cos(YAW)
    turns[:, 1, 1] = 1
    # To the left is to -x.
    turns[:, 0, 2], turns[:, 2, 0] = -np.sin(YAW), np.sin(YAW)
    return turns, np.stack([-AT[:, 1], 0 * YAW, AT[:, 0]], axis=1)


def distance_csv(folder: Path) -> Path:
    return table(folder / "a.csv", "time,distance", np.stack([START + TIMES, ALONG], 1))


def both_csv(folder: Path) -> Path:
    columns = np.column_stack([START + TIMES, AT[:, :2], ALONG])
    return table(folder / "a.csv", "time,x,y,distance", columns)


def yaw_csv(folder: Path) -> Path:
    columns = np.column_stack([YAW, START + TIMES, AT])
    return table(folder / "a.csv", "yaw,time,x,y,z", columns)


def tum(folder: Path) -> Path:
    columns = np.column_stack([START + TIMES, AT, TURNED])
    return table(folder / "a.txt", "# timestamp tx ty tz qx qy qz qw", columns, " ")


def tum_of_a_camera(folder: Path) -> Path:
    """In the world's frame, as TUM's own files are: z ahead, x to the right, y down."""
    # The robot's axes from the camera's: its z is x, its x is -y, its y is -z.
    mount = np.array([-0.5, 0.5, -0.5, 0.5])
    x, y, z, w = TURNED.T
    a, b, c, d = mount
    product = [w * a + x * d + y * c - z * b, w * b - x * c + y * d + z * a,
               w * c + x * b - y * a + z * d, w * d - x * a - y * b - z * c]  # fmt: skip
    columns = np.column_stack([START + TIMES, AT, *product])
    return table(folder / "a.tum", "", columns, "\t")


def kitti(folder: Path) -> Path:
    turns, at = camera_poses()
    table(folder / "times.txt", "", (START + TIMES)[:, None])
    return table(folder / "a.txt", "", np.dstack([turns, at]).reshape(-1, 12), " ")


def kitti_sequence(folder: Path) -> Path:
    """In the folders of KITTI's odometry benchmark."""
    for inside in ("poses", "sequences/00"):
        (folder / inside).mkdir(parents=True)
    table(folder / "sequences/00/times.txt", "", (START + TIMES)[:, None])
    turns, at = camera_poses()
    return table(folder / "poses/00.txt", "", np.dstack([turns, at]).reshape(-1, 12), " ")


EUROC = "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v_RS_R_x [m s^-1]"


def euroc(folder: Path) -> Path:
    path = folder / "data.csv"
    with path.open("w", encoding="utf-8") as file:
        print(EUROC, file=file)
        for time, at, (x, y, z, w) in zip(TIMES, AT, TURNED, strict=True):
            cells = [START * 10**9 + round(time * 1e9), *at, w, x, y, z, 0.0]
            print(",".join(map(str, cells)), file=file)
    return path


def euroc_positions(folder: Path) -> Path:
    """Positions without orientation, and a header that is no comment."""
    path = euroc(folder)
    lines = [",".join(line.split(",")[:4]) for line in path.read_text().splitlines()]
    path.write_text("\n".join(["timestamp, p_RS_R_x, p_RS_R_y, p_RS_R_z", *lines[1:]]))
    return path


def orb_slam3(folder: Path) -> Path:
    """TUM's columns with nanoseconds."""
    return table(folder / "f_a.txt", "", np.column_stack([1e9 * (START + TIMES), AT, TURNED]), " ")


FILES = [
    distance_csv,
    both_csv,
    yaw_csv,
    tum,
    tum_of_a_camera,
    kitti,
    kitti_sequence,
    euroc,
    orb_slam3,
]


def advances(odometry: Odometry, places: float = PLACES_PER_METRE) -> list[float | None]:
    frames = [Frame(BLACK, START + float(time), f"{time}") for time in TAKEN]
    return [frame.advance for frame in Advances(frames, odometry, places)]


def close(found: list[float | None], expected: Float64) -> bool:
    """Chords for arcs, and decimals in a file, are the differences."""
    return found[0] is None and np.allclose(np.array(found[1:], float), expected, atol=1e-5, rtol=0)


@pytest.mark.parametrize("write", FILES)
def test_every_file_gives_the_same_advances(write: Callable[[Path], Path], tmp_path: Path) -> None:
    assert close(advances(Odometry.from_file(write(tmp_path))), EXPECTED)


def test_without_orientation_distances_have_no_sign(tmp_path: Path) -> None:
    odometry = Odometry.from_file(euroc_positions(tmp_path))
    assert odometry.along is None
    found = np.array(advances(odometry)[1:], float)
    # A straight distance hides a turning point between two frames.
    steady = np.isclose(np.abs(EXPECTED), [[0.5], [0.25], [0]]).any(axis=0)
    assert steady.sum() >= 30
    assert np.allclose(found[steady], np.abs(EXPECTED)[steady], atol=1e-4)
    assert (found >= 0).all()


KINDS = [
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/TransformStamped",
]


@pytest.mark.parametrize("kind", KINDS)
def test_every_topic_of_poses_gives_the_same_advances(kind: str, tmp_path: Path) -> None:
    with Bag(tmp_path, "mcap") as bag:
        for time, at, turned in zip(TIMES, AT, TURNED, strict=True):
            bag.pose("/pose", kind, at.tolist(), START + time, turned.tolist())
    assert close(advances(Odometry.from_bag(bag.path)), EXPECTED)


@pytest.mark.parametrize("unset", [(0, 0, 0, 1), (0, 0, 0, 0), (float("nan"),) * 4])
def test_the_speed_tells_reversing_if_the_orientation_is_not_set(
    unset: tuple[float, ...], tmp_path: Path
) -> None:
    speed = np.gradient(ALONG, TIMES)
    with Bag(tmp_path, "ros1") as bag:
        for time, at, ahead in zip(TIMES, AT, speed, strict=True):
            for topic, said in (("/odom", ahead), ("/silent", 0.0)):
                given = at.tolist(), START + time, unset, said
                bag.pose(topic, "nav_msgs/msg/Odometry", *given)
    assert close(advances(Odometry.from_bag(bag.path, "/odom")), EXPECTED)
    silent = Odometry.from_bag(bag.path, "/silent")
    assert silent.along is None


def test_a_receiver_of_satellites_gives_distances_without_a_sign(tmp_path: Path) -> None:
    # Degrees whose local metres are those of the drive, about the middle of it.
    unit = surefix.datasets.local_metres([48, 48.001], [11, 11.001], (48.0, 11.0))[1]
    with Bag(tmp_path, "sqlite3") as bag:
        for time, (x, y, _) in zip(TIMES, AT, strict=True):
            fix = 48 + y / unit[1] / 1000, 11 + x / unit[0] / 1000, 0.0, 0
            bag.pose("/fix", "sensor_msgs/msg/NavSatFix", fix, START + time)
    odometry = Odometry.from_bag(bag.path, "/fix")
    assert odometry.along is None
    moving = np.abs(EXPECTED) > 0.2499
    found = np.array(advances(odometry)[1:], float)
    assert np.allclose(found[moving], np.abs(EXPECTED)[moving], atol=1e-3)


@pytest.mark.parametrize("seed", range(20))
def test_the_robots_own_axis_is_found_however_the_sensor_is_mounted(seed: int) -> None:
    generator = np.random.default_rng(seed)
    # Turned by up to half a radian about any axis; then z or x looks ahead.
    axis = generator.normal(size=3)
    angle = generator.uniform(-0.5, 0.5) / 2
    turn = np.append(np.sin(angle) * axis / np.linalg.norm(axis), np.cos(angle))
    to_camera = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0.0]]) if seed % 2 else np.eye(3)
    mounted = rotations(TURNED) @ rotations([turn])[0] @ to_camera
    found = driven(AT, mounted)
    assert found is not None
    np.testing.assert_allclose(found, ALONG, atol=1e-3)
    # Standing for long, with a jitter whose steps are 100 m together, changes neither.
    still = AT[-1] + generator.normal(0, 0.01, (5000, 3))
    halted = np.concatenate([mounted, mounted[-1:].repeat(5000, 0)])
    noisy = driven(np.concatenate([AT, still]), halted)
    assert noisy is not None
    np.testing.assert_allclose(noisy[: len(AT)], ALONG, atol=1e-3)
    assert np.abs(noisy[len(AT) :] - ALONG[-1]).max() < 0.1


def test_an_orientation_that_does_not_fit_the_way_is_left_out() -> None:
    around = np.linspace(0, 2 * np.pi, 400)
    circle = 30 * np.stack([np.sin(around), 1 - np.cos(around)], axis=1)
    assert driven(circle, np.eye(3)[None].repeat(400, 0)) is None
    # There and back on another lane, by a receiver that knows no heading.
    lane = np.r_[np.zeros(200), np.full(200, 3.0)] + np.random.default_rng(0).normal(0, 0.05, 400)
    way = np.stack([np.r_[np.arange(200), np.arange(200)[::-1]], lane], axis=1)
    assert driven(way, np.eye(3)[None].repeat(400, 0)) is None
    # Straight along its own axis and back, it has reversed.
    straight = np.stack([np.r_[np.arange(5), 3, 2], np.zeros(7)], axis=1)
    back = driven(straight, np.eye(3)[None].repeat(7, 0))
    assert back is not None
    assert back.tolist() == [0, 1, 2, 3, 4, 3, 2]
    # A drone that looks anywhere.
    yaw = np.random.default_rng(1).uniform(0, 2 * np.pi, 400)
    o = 0 * yaw
    drone = rotations(np.stack([o, o, np.sin(yaw / 2), np.cos(yaw / 2)], 1))
    assert driven(circle, drone) is None


@pytest.mark.parametrize(
    ("write", "row", "text", "words"),
    [
        (tum, 3, "1 2 3 4 0 0 0 1 5", r"row 3: expected 8 values \(timestamp tx ty tz qx qy qz qw\), got 9"),
        (tum, 3, "1 2 3 x 0 0 0 1", "row 3: expected tz, a number, got 'x'"),
        (tum, 3, "1700000000.1 2 3 4 0 0 nan 1", "row 3: expected qz, a finite number, got 'nan'"),
        (tum, 4, "1700000000.2 2 3 4 0 0 0 2", "row 4: expected a quaternion of unit length"),
        (tum, 5, "1700000000.1 2 3 4 0 0 0 1", "row 5: expected ascending times, got 1700000000.1"),
        (kitti, 4, "1 0 0 0 0 1 0 0 0 0 1", "row 4: expected 12 values .*, got 11"),
        (kitti, 3, "2 0 0 0 0 1 0 0 0 0 1 0", "row 3: expected a rotation in the columns but the"),
        (kitti, 3, "1 0 0 0 0 1 0 0 0 0 1 inf", "row 3: expected .*, a finite number, got 'inf'"),
        (euroc, 1, "#timestamp [us],p_RS_R_x,p_RS_R_y,p_RS_R_z", r"row 1: expected #timestamp \[ns\], p_RS_R_x"),
        (euroc, 4, "1,2,3", "row 4: expected 9 values, got 3"),
        (euroc, 2, "1.5,0,0,0,1,0,0,0,0", "row 2: expected timestamp in nanoseconds, a whole number"),
        (euroc, 3, "1700000000100000000,0,0,y,1,0,0,0,0", "row 3: expected p_rs_r_z, a number"),
        (euroc, 3, "1700000000000000000,0,0,0,1,0,0,0,0", "row 3: expected ascending times"),
        (yaw_csv, 2, "east,0,0,0,0", "row 2: expected yaw, a number, got 'east'"),
        (both_csv, 3, "1700000000.1,0,0,nan", "row 3: expected distance, a finite number"),
    ],
)  # fmt: skip
def test_a_malformed_row_is_named_with_its_file(
    write: Callable[[Path], Path], row: int, text: str, words: str, tmp_path: Path
) -> None:
    path = write(tmp_path)
    lines = path.read_text().splitlines()
    lines[row - 1] = text
    path.write_text("\n".join(lines))
    with pytest.raises(surefix.SurefixValueError, match=words) as refused:
        Odometry.from_file(path)
    assert str(refused.value).startswith(str(path))


def test_a_file_of_no_known_format_is_refused(tmp_path: Path) -> None:
    for text, words in (("1 2 3\n", "row 1: .*got 3 values"), ("", "TUM, KITTI or EuRoC, got 0")):
        (tmp_path / "a.txt").write_text(text)
        with pytest.raises(surefix.SurefixValueError, match=words):
            Odometry.from_file(tmp_path / "a.txt")
    with pytest.raises(surefix.SurefixFileError, match="cannot read the odometry"):
        Odometry.from_file(tmp_path / "none.txt")
    path = kitti(tmp_path)
    (tmp_path / "times.txt").write_text("0\n1\n")
    with pytest.raises(
        surefix.SurefixValueError, match=r"a time for each of the 201 poses in .*got 2"
    ):
        Odometry.from_file(path)


def test_a_video_has_the_clock_of_a_table_that_starts_at_0(tmp_path: Path) -> None:
    write_video(tmp_path / "drive.mkv", pictures(100))
    path = table(tmp_path / "wheels.csv", "time,distance", np.stack([TIMES, ALONG], 1))
    options = {"odometry": path, "places_per_metre": 2.0}
    found = [frame.advance for frame in frames_open(tmp_path / "drive.mkv", **options)]  # type: ignore[arg-type]
    assert close(found, 2 * np.diff(ALONG[:100]))
    # From one frame that is left to the next.
    sampled = frames_open(tmp_path / "drive.mkv", stride=8, **options)  # type: ignore[arg-type]
    assert close([frame.advance for frame in sampled], 2 * np.diff(ALONG[:100:8]))
    metres = list(frames_open(tmp_path / "drive.mkv", metres=4, **options))  # type: ignore[arg-type]
    assert [int(frame.name) for frame in metres] == [0, 20, 40, 60, 80]
    assert close([frame.advance for frame in metres], np.full(4, 8.0))
    assert repr(metres[1]).endswith("advance=8)")


def images(folder: Path, names: list[str]) -> Path:
    folder.mkdir()
    for name in names:
        Image.fromarray(BLACK).save(folder / f"{name}.png")
    return folder


def test_images_named_by_their_times_follow_euroc_and_tum(tmp_path: Path) -> None:
    nanoseconds = images(tmp_path / "cam0", [f"{START * 10**9 + round(t * 1e9)}" for t in TAKEN])
    seconds = images(tmp_path / "rgb", [f"{START + t:.6f}" for t in TAKEN])
    for folder, path in ((nanoseconds, euroc(tmp_path)), (seconds, tum(tmp_path))):
        frames = frames_open(folder, odometry=path, places_per_metre=PLACES_PER_METRE)
        assert close([frame.advance for frame in frames], EXPECTED)
        assert len(frames) == len(TAKEN)
        assert [frame.time for frame in frames][:2] == [None, None]
    counted = images(tmp_path / "counted", ["0001", "0002"])
    with pytest.raises(
        surefix.SurefixValueError, match=r"files named by their times, got .*0001.png"
    ):
        frames_open(counted, odometry=tum(tmp_path), places_per_metre=1)


@pytest.mark.parametrize("timed", [False, True])
def test_row_k_of_kitti_is_of_image_k(timed: bool, tmp_path: Path) -> None:
    folder, path = images(tmp_path / "image_0", [f"{i:06}" for i in range(201)]), kitti(tmp_path)
    if not timed:
        (tmp_path / "times.txt").unlink()
    for options in ({}, {"stride": 10}, {"newest": 300}):
        step = options.get("stride", 1)
        frames = frames_open(folder, odometry=path, places_per_metre=1.0, **options)  # type: ignore[arg-type]
        assert close([frame.advance for frame in frames], np.diff(ALONG[::step]))
    frames = [Frame(BLACK, START + float(time), f"{i:06}.png") for i, time in enumerate(TIMES)]
    expected = EveryMetres(frames, Odometry.from_file(both_csv(tmp_path)), 2.3)
    every = frames_open(folder, odometry=path, metres=2.3)
    assert [frame.name for frame in every] == [frame.name for frame in expected]


def test_frames_outside_the_odometrys_times_have_no_advance() -> None:
    frames = [Frame(BLACK, float(time), str(time)) for time in range(8)]
    odometry = Odometry([2, 3, 5], [[0.0], [1.0], [-1.0]], "wheels.csv")
    stream = Advances(frames, odometry, 2.0)
    for _ in range(2):
        assert [f.advance for f in stream] == [None, None, None, 2.0, -2.0, -2.0, None, None]
        assert stream.outside == 4
    with pytest.raises(surefix.SurefixValueError, match=r"wheels\.csv: expected positions at the"):
        list(Advances(frames[:2], odometry, 1.0))
    with pytest.raises(surefix.SurefixValueError, match="odometry: expected frames with times"):
        list(Advances([Frame(BLACK, None, "0")], odometry, 1.0))
    assert list(Advances([], odometry, 1.0)) == []
    for places in (0, float("nan"), float("inf")):
        with pytest.raises(surefix.SurefixValueError, match="places_per_metre: expected a number"):
            Advances(frames, odometry, places)


def test_advances_of_frames_that_are_passed_over_count() -> None:
    given = [None, 1.0, 2.0, -0.5, None, 1.0, 1.0]
    frames = [Frame(BLACK, None, str(i), advance=a) for i, a in enumerate(given)]
    assert [frame.advance for frame in Stride(frames, 2)] == [None, 3.0, None, 2.0]
    kept = list(KeepNewest(frames, size=2))
    sums = np.cumsum([0, 1, 2, -0.5, np.nan, 1, 1])
    assert kept[-1].advance == (1.0 if len(kept) > 1 and kept[-1].dropped == 0 else sums[-1])


def test_a_maps_spacing_is_the_median_of_its_own() -> None:
    along = np.cumsum([0, 2, 2, 2, 0, 0, 50, 2, 2])
    assert places_per_metre(np.stack([along, 0 * along], 1)) == 0.5
    for wrong in (np.zeros((3, 2)), np.zeros((1, 2))):
        with pytest.raises(surefix.SurefixValueError, match="two places or more at different"):
            places_per_metre(wrong)
