"""4Seasons and Oxford RobotCar, on small trees with the publishers' layout and columns; and the
Bayer mosaic.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

import surefix
from surefix import datasets

Float64 = npt.NDArray[np.float64]
PATTERNS = ("rggb", "grbg", "gbrg", "bggr")


def mosaic_of(image: npt.NDArray[np.uint8], pattern: str) -> npt.NDArray[np.uint8]:
    """The mosaic of an RGB image in a camera with this filter."""
    mosaic = np.zeros(image.shape[:2], np.uint8)
    for row, column in np.ndindex(*mosaic.shape):
        colour = pattern[2 * (row % 2) + column % 2]
        mosaic[row, column] = image[row, column, "rgb".index(colour)]
    return mosaic


class TestDemosaic:
    @pytest.mark.parametrize("pattern", PATTERNS)
    def test_one_colour_comes_back_as_it_was(self, pattern: str) -> None:
        image = np.full((6, 8, 3), (250, 3, 77), np.uint8)
        shown = datasets.demosaic(mosaic_of(image, pattern), pattern)  # type: ignore[arg-type]
        np.testing.assert_array_equal(shown, np.broadcast_to([250, 3, 77], (3, 4, 3)))

    @pytest.mark.parametrize("pattern", PATTERNS)
    def test_superpixel_takes_each_cell_as_it_is(self, pattern: str) -> None:
        mosaic = np.random.default_rng(2).integers(0, 256, (8, 6), np.uint8)
        shown = datasets.demosaic(mosaic, pattern)  # type: ignore[arg-type]
        for row, column in np.ndindex(4, 3):
            cell = mosaic[2 * row : 2 * row + 2, 2 * column : 2 * column + 2].ravel().tolist()
            red, blue = cell[pattern.index("r")], cell[pattern.index("b")]
            green = sum(value for value, colour in zip(cell, pattern, strict=True) if colour == "g")
            assert shown[row, column].tolist() == [red, (green + 1) // 2, blue]

    def test_16_bits_stay_16_bits(self) -> None:
        cell = np.array([[1000, 65535], [50000, 65534]], np.uint16)
        shown = datasets.demosaic(cell, "gbrg")
        assert shown.dtype == np.uint16
        assert shown.tolist() == [[[50000, (1000 + 65534 + 1) // 2, 65535]]]

    @pytest.mark.parametrize(
        "arguments",
        [
            (np.zeros((4, 5), np.uint8),),
            (np.zeros((0, 0), np.uint8),),
            (np.zeros((4, 4, 3), np.uint8),),
            (np.zeros((4, 4), np.float32),),
            (np.zeros((4, 4), np.uint8), "gbgr"),
        ],
    )
    def test_what_is_no_mosaic_is_refused(self, arguments: tuple[object, ...]) -> None:
        with pytest.raises(surefix.SurefixValueError, match="expected"):
            datasets.demosaic(*arguments)  # type: ignore[arg-type]


INS = (
    "timestamp,ins_status,latitude,longitude,altitude,northing,easting,down,utm_zone,"
    "velocity_north,velocity_east,velocity_down,roll,pitch,yaw"
)
RTK = (
    "timestamp,latitude,longitude,altitude,northing,easting,down,utm_zone,"
    "velocity_north,velocity_east,velocity_down,roll,pitch,yaw"
)
OLDER, NEWER = "2014-11-14-16-34-33", "2015-03-17-11-08-44"
COLOUR = (200, 40, 90)
START = 1_418_381_798_086_398
EAST, NORTH = 619_500.25, 5_735_000.5


def drive(
    folder: Path,
    speed: float,
    *,
    seconds: float = 4.0,
    offset: float = 0.0,
    camera: str = "stereo/centre",
) -> None:
    """North from (EAST, NORTH + offset) at a speed in metres a second; 10 images a second, 5 INS
    rows a second.
    """
    (folder / camera).mkdir(parents=True)
    (folder / "gps").mkdir(exist_ok=True)
    pattern = "gbrg" if camera.startswith("stereo") else "rggb"
    mosaic = Image.fromarray(mosaic_of(np.full((6, 8, 3), COLOUR, np.uint8), pattern))
    stamps = [START + 100_000 * i for i in range(round(10 * seconds))]
    for stamp in stamps:
        mosaic.save(folder / camera / f"{stamp}.png")
    (folder / f"{camera.split('/')[0]}.timestamps").write_text(
        "".join(f"{stamp} {i // 20 + 1}\n" for i, stamp in enumerate(stamps))
    )
    rows = [INS]
    rtk = [RTK]
    for i in range(round(5 * seconds) + 1):
        north = NORTH + offset + speed * i / 5
        place = f"51.76,-1.26,110.1,{north},{EAST},-110.1,30U,{speed},0,0,0.01,0.02,0.03"
        rows.append(f"{START + 200_000 * i},INS_SOLUTION_GOOD,{place}")
        rtk.append(f"{START + 200_000 * i},{place}")
    (folder / "gps" / "ins.csv").write_text("\n".join(rows) + "\n")
    (folder / "gps" / "rtk.csv").write_text("\n".join(rtk) + "\n")


@pytest.fixture
def oxford(tmp_path: Path) -> Path:
    drive(tmp_path / OLDER, speed=10)  # 0 to 39 m, an image a metre
    drive(tmp_path / NEWER, speed=20, offset=4)  # 4 to 82 m, an image every two metres
    return tmp_path


def change(file: Path, edit: Callable[[list[str]], None]) -> None:
    lines = file.read_text().splitlines()
    edit(lines)
    file.write_text("\n".join(lines) + "\n")


class TestRobotCar:
    def test_positions_are_metres_and_give_the_truth(self, oxford: Path) -> None:
        pair = datasets.robotcar(oxford, spacing=None, tolerance=0.5)
        assert pair.name == f"RobotCar {OLDER} / {NEWER}"
        assert pair.references.names[0] == f"{START}.png"
        assert pair.reference_positions is not None
        assert pair.query_positions is not None
        assert pair.truth is not None
        np.testing.assert_allclose(pair.reference_positions[:, 0], EAST)
        np.testing.assert_allclose(pair.reference_positions[:, 1], NORTH + np.arange(40), atol=1e-6)
        np.testing.assert_allclose(
            pair.query_positions[:, 1], NORTH + 4 + 2 * np.arange(40), atol=1e-6
        )
        expected = [4 + 2 * i if 4 + 2 * i < 40 else -1 for i in range(40)]
        assert pair.truth.tolist() == expected
        assert pair.notes == ()
        assert "BY-NC-SA" in pair.licence

    def test_an_image_every_so_many_metres(self, oxford: Path) -> None:
        pair = datasets.robotcar(oxford, spacing=3.0)
        assert pair.reference_positions is not None
        assert pair.query_positions is not None
        np.testing.assert_allclose(np.diff(pair.reference_positions[:, 1]), 3)
        np.testing.assert_allclose(np.diff(pair.query_positions[:, 1]), 4)
        assert pair.references.names[1] == f"{START + 300_000}.png"

    def test_images_are_in_colour(self, oxford: Path) -> None:
        pair = datasets.robotcar(oxford)
        np.testing.assert_array_equal(pair.references[5], np.broadcast_to(COLOUR, (3, 4, 3)))
        assert pair.references.paths is None

    def test_the_monocular_cameras_have_another_mosaic(self, oxford: Path) -> None:
        for traverse in (OLDER, NEWER):
            drive(oxford / traverse, speed=10, camera="mono_rear")
        pair = datasets.robotcar(oxford, camera="mono_rear")
        assert pair.references[0][0, 0].tolist() == list(COLOUR)

    def test_the_images_make_a_map(self, oxford: Path) -> None:
        pair = datasets.robotcar(oxford, spacing=10.0)
        route = surefix.Map.from_images(
            pair.references, positions=pair.reference_positions, progress=False
        )
        assert len(route) == len(pair.references) == 4

    def test_the_ground_truth_of_2020(self, oxford: Path) -> None:
        rtk = datasets.robotcar(oxford, positions="rtk")
        ins = datasets.robotcar(oxford)
        assert rtk.query_positions is not None
        np.testing.assert_array_equal(rtk.query_positions, ins.query_positions)

    @pytest.mark.parametrize("missing", ["stereo/centre", "stereo.timestamps", "gps/ins.csv", "."])
    def test_every_missing_file_is_named_with_its_source(self, oxford: Path, missing: str) -> None:
        path = oxford / NEWER / missing
        path.rename(oxford / "elsewhere")
        with pytest.raises(surefix.SurefixFileError) as said:
            datasets.robotcar(oxford, reference=OLDER, query=NEWER)
        for part in (str(path), "robotcar-dataset.robots.ox.ac.uk", "BY-NC-SA"):
            assert part in str(said.value)
        assert "\n" not in str(said.value)

    def test_which_traverses_is_asked_unless_there_are_two(self, oxford: Path) -> None:
        drive(oxford / "2015-08-12-15-04-18", speed=10)
        assert datasets.traverses("robotcar", oxford) == [OLDER, NEWER, "2015-08-12-15-04-18"]
        with pytest.raises(surefix.SurefixValueError, match=f"{OLDER}, {NEWER}, 2015-08-12"):
            datasets.robotcar(oxford)
        with pytest.raises(surefix.SurefixValueError, match="expected reference and query"):
            datasets.robotcar(oxford, reference=NEWER)
        with pytest.raises(
            surefix.SurefixFileError, match=r"at least two of them, each a traverse.*Licence"
        ):
            datasets.robotcar(oxford / OLDER)
        assert (
            datasets.robotcar(oxford, reference=NEWER, query=OLDER).name
            == f"RobotCar {NEWER} / {OLDER}"
        )

    @pytest.mark.parametrize(
        ("file", "row", "text", "said"),
        [
            (
                "stereo.timestamps",
                3,
                "1418381798286398",
                "row 3: expected 2 values (timestamp chunk), got 1",
            ),
            (
                "stereo.timestamps",
                3,
                "14183x 1",
                "row 3: expected a timestamp in microseconds, a whole number",
            ),
            ("stereo.timestamps", 3, f"{START} 1", "row 3: expected ascending timestamps"),
            (
                "stereo.timestamps",
                2,
                f"{START} 1",
                f"row 2: expected ascending timestamps, got {START} twice",
            ),
            ("gps/ins.csv", 4, "1,2,3", "row 4: expected 15 values, got 3"),
            (
                "gps/ins.csv",
                3,
                f"{START},G,1,1,1,1,1,1,30U,1,1,1,1,1,1",
                f"row 3: expected ascending timestamps, got {START}",
            ),
            (
                "gps/ins.csv",
                2,
                f"{START},G,1,1,1,north,1,1,30U,1,1,1,1,1,1",
                "row 2: expected metres, a number, got 'north'",
            ),
            (
                "gps/ins.csv",
                2,
                f"{START},G,1,1,1,nan,1,1,30U,1,1,1,1,1,1",
                "row 2: expected metres, a finite number",
            ),
            (
                "gps/ins.csv",
                2,
                f"{START},G,1,1,1,1,1,1,31U,1,1,1,1,1,1",
                "expected one UTM zone, got 31U and 30U",
            ),
            ("gps/ins.csv", 1, "time,north,east", "row 2: expected 3 values, got 15"),
        ],
    )
    def test_a_malformed_row_is_named(
        self, oxford: Path, file: str, row: int, text: str, said: str
    ) -> None:
        path = oxford / OLDER / file
        change(path, lambda lines: lines.__setitem__(row - 1, text))
        with pytest.raises(surefix.SurefixValueError) as error:
            datasets.robotcar(oxford)
        assert str(path) in str(error.value)
        assert said in str(error.value)

    def test_a_table_without_positions_is_named(self, oxford: Path) -> None:
        path = oxford / OLDER / "gps/ins.csv"
        path.write_text(path.read_text().replace("northing", "north"))
        with pytest.raises(
            surefix.SurefixValueError,
            match=r"ins\.csv, row 1: expected the columns timestamp, easting",
        ):
            datasets.robotcar(oxford)

    @pytest.mark.parametrize("file", ["stereo.timestamps", "gps/ins.csv"])
    def test_an_empty_file_is_named(self, oxford: Path, file: str) -> None:
        (oxford / OLDER / file).write_text("")
        with pytest.raises(surefix.SurefixValueError, match=f"{file}: expected"):
            datasets.robotcar(oxford)

    def test_two_zones_share_no_plane(self, oxford: Path) -> None:
        path = oxford / NEWER / "gps/ins.csv"
        path.write_text(path.read_text().replace("30U", "31U"))
        with pytest.raises(
            surefix.SurefixValueError, match="UTM zone of the reference, 30U, got 31U"
        ):
            datasets.robotcar(oxford)

    def test_a_chunk_that_was_not_downloaded_is_left_out_and_said(self, oxford: Path) -> None:
        for i in range(20):
            (oxford / NEWER / "stereo/centre" / f"{START + 100_000 * i}.png").unlink()
        pair = datasets.robotcar(oxford, spacing=None)
        assert len(pair.queries) == 20
        assert pair.query_positions is not None
        np.testing.assert_allclose(pair.query_positions[0], [EAST, NORTH + 44])
        assert len(pair.notes) == 1
        assert "20 of the 40 images" in pair.notes[0]
        with pytest.raises(surefix.SurefixFileError, match=f"{START}.png: no such image .*Licence"):
            datasets.robotcar(oxford, incomplete="error")

    def test_images_without_a_position_are_left_out_and_said(self, oxford: Path) -> None:
        change(
            oxford / OLDER / "gps/ins.csv", lambda lines: lines.__delitem__(slice(1, 4))
        )  # the first 0.6 s
        change(
            oxford / OLDER / "gps/ins.csv", lambda lines: lines.__delitem__(slice(3, 9))
        )  # a hole of 1.4 s
        pair = datasets.robotcar(oxford, spacing=None)
        assert pair.reference_positions is not None
        kept = [*range(6, 9), *range(22, 40)]
        np.testing.assert_allclose(
            pair.reference_positions[:, 1], NORTH + np.array(kept), atol=1e-6
        )
        assert "19 of the 40 images" in pair.notes[0]
        assert len(datasets.robotcar(oxford, spacing=None, longest_gap=1.4).references) == 34
        with pytest.raises(
            surefix.SurefixValueError, match=r"19 of the 40 images .* have no position"
        ):
            datasets.robotcar(oxford, incomplete="error")

    def test_no_position_at_all_is_an_error(self, oxford: Path) -> None:
        path = oxford / OLDER / "gps/ins.csv"
        path.write_text(path.read_text().replace("1418381", "1518381"))
        with pytest.raises(
            surefix.SurefixValueError, match=r"40 of the 40 images .* have no position"
        ):
            datasets.robotcar(oxford)

    def test_an_image_that_is_no_mosaic_is_named(self, oxford: Path) -> None:
        Image.new("RGB", (8, 6)).save(oxford / OLDER / "stereo/centre" / f"{START}.png")
        pair = datasets.robotcar(oxford)
        with pytest.raises(
            surefix.SurefixValueError,
            match=rf"{START}\.png: mosaic: expected uint8 or uint16 \(H, W\)",
        ):
            pair.references[0]

    @pytest.mark.parametrize(
        "options",
        [
            {"camera": "stereo"},
            {"spacing": 0},
            {"spacing": math.nan},
            {"longest_gap": 0},
            {"tolerance": -1},
            {"incomplete": "ask"},
        ],
    )
    def test_options_are_checked(self, oxford: Path, options: dict[str, object]) -> None:
        with pytest.raises(surefix.SurefixValueError, match=next(iter(options))):
            datasets.robotcar(oxford, **options)  # type: ignore[arg-type]


SPRING, WINTER = "recording_2020-03-24_17-36-22", "recording_2021-01-07_12-04-03"
NANO = 1_585_067_782_000_000_003


def quaternion(rotation: Float64) -> Float64:
    """(x, y, z, w) of a rotation matrix: the eigenvector that Bar-Itzhack's method finds."""
    r = rotation
    k = np.array(
        [
            [r[0, 0] - r[1, 1] - r[2, 2], 0, 0, 0],
            [r[1, 0] + r[0, 1], r[1, 1] - r[0, 0] - r[2, 2], 0, 0],
            [r[2, 0] + r[0, 2], r[2, 1] + r[1, 2], r[2, 2] - r[0, 0] - r[1, 1], 0],
            [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], np.trace(r)],
        ]
    )
    return np.asarray(np.linalg.eigh(k)[1][:, -1])


def rigid(rotation: Float64, translation: Float64) -> Float64:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix


def east_north_up(latitude: float, longitude: float) -> Float64:
    """From a local plane at sea level to the Earth-centred frame."""
    lat, lon = math.radians(latitude), math.radians(longitude)
    east = np.array([-math.sin(lon), math.cos(lon), 0])
    up = np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)])
    n = 6378137.0 / math.sqrt(1 - 6.69437999014e-3 * math.sin(lat) ** 2)
    return rigid(
        np.stack([east, np.cross(up, east), up], axis=1), n * up * [1, 1, 1 - 6.69437999014e-3]
    )


def record(folder: Path, track: Float64, plane: Float64, seed: int, scale: float) -> None:
    """A recording of a track (n, 3), east, north, up of the first recording's plane; its own frames
    are random.

    Ten images a second; a key frame, with a pose, at every second of them.
    """
    random = np.random.default_rng(seed)
    own = east_north_up(48.2 + 1e-3 * seed, 11.6 - 1e-3 * seed)
    visual = rigid(np.linalg.qr(random.normal(size=(3, 3)))[0], random.normal(size=3))
    visual[:3, 0] *= np.linalg.det(visual[:3, :3])
    slam = rigid(np.linalg.qr(random.normal(size=(3, 3)))[0], np.zeros(3))
    slam[:3, 0] *= np.linalg.det(slam[:3, :3])
    earth = plane @ np.c_[track, np.ones(len(track))].T
    poses = (np.linalg.inv(own @ np.linalg.inv(visual) @ slam) @ earth)[:3].T / scale
    (folder / "undistorted_images/cam0").mkdir(parents=True)
    stamps = [NANO + 100_000_000 * i for i in range(len(track))]
    for stamp in stamps:
        Image.new("L", (16, 8), 90).save(folder / f"undistorted_images/cam0/{stamp}.png")
    (folder / "times.txt").write_text(
        "".join(f"{stamp} {stamp / 1e9:.9f} 1.5\n" for stamp in stamps)
    )
    lines = ["# frame_id, translation (x, y, z), rotation (x, y, z, w), scale, fusion_quality, v3"]
    for stamp, pose in list(zip(stamps, poses.tolist(), strict=True))[::2]:
        lines.append(",".join(map(str, [stamp, *pose, 0, 0, 0, 1, scale, 2, 1])))
    (folder / "GNSSPoses.txt").write_text("\n".join(lines) + "\n")
    text = ""
    for name, matrix in (
        ("transform_S_AS", slam),
        ("TS_cam_imu", np.eye(4)),
        ("transform_w_gpsw", visual),
        ("transform_gps_imu", np.eye(4)),
        ("transform_e_gpsw", own),
    ):
        values = [*matrix[:3, 3].tolist(), *quaternion(matrix[:3, :3]).tolist()]
        text += (
            f"# {name}: translation vector, rotation quaternion\n{','.join(map(str, values))}\n\n"
        )
    (folder / "Transformations.txt").write_text(text + f"# GNSS scale\n{scale}\n")


@pytest.fixture
def munich(tmp_path: Path) -> Path:
    along = np.arange(41.0)
    plane = east_north_up(48.2, 11.6)
    record(
        tmp_path / SPRING,
        np.stack([along, 0 * along, 0 * along + 500], axis=1),
        plane,
        seed=0,
        scale=0.97,
    )
    record(
        tmp_path / WINTER,
        np.stack([80 - 2 * along, 0 * along + 3, 0 * along + 501], axis=1),
        plane,
        seed=1,
        scale=1.02,
    )
    return tmp_path


class TestFourSeasons:
    def test_the_report_pairs_the_oldest_of_three_recordings_with_each_other(
        self, munich: Path
    ) -> None:
        pytest.importorskip("matplotlib")
        from surefix.reproduce import find_datasets, load_cases

        third = "recording_2021-02-25_13-51-57"
        (munich / third).symlink_to(munich / WINTER)
        (munich / "notes").mkdir()
        assert datasets.traverses("four_seasons", munich) == [SPRING, WINTER, third]
        found = find_datasets(munich)
        assert [(one.dataset, one.pairs) for one in found] == [
            ("four_seasons", [(SPRING, WINTER), (SPRING, third)])
        ]
        cases, problems = load_cases(found[0])
        assert problems == []
        assert [case.dataset for case in cases] == [
            "4Seasons, 2020-03-24_17-36-22 to 2021-01-07_12-04-03",
            "4Seasons, 2020-03-24_17-36-22 to 2021-02-25_13-51-57",
        ]
        assert [case.name for case in load_cases(found[0], [(WINTER, SPRING)])[0]] == [
            "4Seasons, 2021-01-07_12-04-03 to 2020-03-24_17-36-22, SAD"
        ]

    def test_both_recordings_are_on_the_plane_of_the_reference(self, munich: Path) -> None:
        pair = datasets.four_seasons(munich, spacing=None, tolerance=3.5)
        assert pair.name == "4Seasons 2020-03-24_17-36-22 / 2021-01-07_12-04-03"
        assert pair.reference_positions is not None
        assert pair.query_positions is not None
        assert pair.truth is not None
        along = np.arange(41.0)
        np.testing.assert_allclose(
            pair.reference_positions, np.stack([along, 0 * along], axis=1), atol=1e-5
        )
        np.testing.assert_allclose(
            pair.query_positions, np.stack([80 - 2 * along, 0 * along + 3], axis=1), atol=1e-5
        )
        assert pair.truth.tolist()[:19] == [-1] * 19  # 80 .. 44 m, and the map ends at 40
        assert pair.truth.tolist()[20:] == [40 - 2 * i for i in range(21)]
        assert pair.notes == ()

    def test_the_images_are_plain_files_by_frame(self, munich: Path) -> None:
        pair = datasets.four_seasons(munich, spacing=4.9)
        assert pair.references.paths is not None
        assert pair.references.paths[1] == str(
            munich / SPRING / "undistorted_images/cam0" / f"{NANO + 500_000_000}.png"
        )
        assert len(pair.references) == 9
        assert pair.references[0].shape == (8, 16)
        assert len(surefix.Map.from_images(pair.references.paths, progress=False)) == 9

    def test_transforms_may_have_no_empty_lines_between(self, munich: Path) -> None:
        before = datasets.four_seasons(munich)
        path = munich / WINTER / "Transformations.txt"
        path.write_text(path.read_text().replace("\n\n", "\n"))
        np.testing.assert_array_equal(
            datasets.four_seasons(munich).query_positions, before.query_positions
        )  # type: ignore[arg-type]

    def test_poses_may_be_elsewhere(self, munich: Path) -> None:
        for recording in (SPRING, WINTER):
            (munich / recording / "poses").mkdir()
            (munich / recording / "GNSSPoses.txt").rename(
                munich / recording / "poses/GNSSPoses.txt"
            )
        assert len(datasets.four_seasons(munich, poses="poses/GNSSPoses.txt").queries) == 41

    def test_frames_beyond_the_key_frames_are_left_out_and_said(self, munich: Path) -> None:
        change(munich / WINTER / "GNSSPoses.txt", lambda lines: lines.__delitem__(slice(1, 4)))
        pair = datasets.four_seasons(munich, spacing=None)
        assert len(pair.queries) == 35
        assert "6 of the 41 images" in pair.notes[0]
        with pytest.raises(surefix.SurefixValueError, match="6 of the 41 images"):
            datasets.four_seasons(munich, incomplete="error")

    def test_a_key_frame_without_a_pose_is_bridged(self, munich: Path) -> None:
        change(
            munich / SPRING / "GNSSPoses.txt",
            lambda lines: lines.__setitem__(3, f"{NANO + 400_000_000}" + ",nan" * 10),
        )
        pair = datasets.four_seasons(munich, spacing=None)
        assert pair.reference_positions is not None
        np.testing.assert_allclose(pair.reference_positions[:, 0], np.arange(41), atol=1e-5)

    @pytest.mark.parametrize(
        "missing",
        ["times.txt", "GNSSPoses.txt", "Transformations.txt", "undistorted_images/cam0", "."],
    )
    @pytest.mark.parametrize("recording", [SPRING, WINTER])
    def test_every_missing_file_is_named_with_its_source(
        self, munich: Path, recording: str, missing: str
    ) -> None:
        path = munich / recording / missing
        path.rename(munich / "elsewhere")
        with pytest.raises(surefix.SurefixFileError) as said:
            datasets.four_seasons(munich, reference=SPRING, query=WINTER)
        for part in (str(path), "4seasons-dataset.com", "Licence:"):
            assert part in str(said.value)

    @pytest.mark.parametrize(
        ("file", "row", "text", "said"),
        [
            (
                "times.txt",
                2,
                "1.5e18 1.5 1",
                "row 2: expected frame_id, nanoseconds, a whole number, got '1.5e18'",
            ),
            (
                "times.txt",
                2,
                f"{NANO} 1.5 1",
                f"row 2: expected ascending timestamps, got {NANO} twice",
            ),
            ("GNSSPoses.txt", 3, "1,2,3", "row 3: expected at least 9 values (frame_id,t_x,"),
            (
                "GNSSPoses.txt",
                3,
                "5,a,0,0,0,0,0,1,1",
                "row 3: expected a pose and its scale, a number, got 'a'",
            ),
            (
                "GNSSPoses.txt",
                3,
                "5,0,0,0,0,0,0,1,1",
                "row 3: expected ascending timestamps, got 5 after",
            ),
            ("Transformations.txt", 2, "1,2,3", "row 2: expected 7 values of transform_S_AS"),
            (
                "Transformations.txt",
                2,
                "0,0,0,0,0,0,x",
                "row 2: expected transform_S_AS, a number, got 'x'",
            ),
            (
                "Transformations.txt",
                2,
                "0,0,0,0,0,0,2",
                "row 2: expected a unit quaternion of transform_S_AS",
            ),
            (
                "Transformations.txt",
                13,
                "# other",
                "expected a line '# transform_e_gpsw: ...', got # transform_S_AS",
            ),
        ],
    )
    def test_a_malformed_row_is_named(
        self, munich: Path, file: str, row: int, text: str, said: str
    ) -> None:
        path = munich / SPRING / file
        change(path, lambda lines: lines.__setitem__(row - 1, text))
        with pytest.raises(surefix.SurefixValueError) as error:
            datasets.four_seasons(munich)
        assert str(path) in str(error.value)
        assert said in str(error.value)

    @pytest.mark.parametrize("file", ["times.txt", "GNSSPoses.txt", "Transformations.txt"])
    def test_an_empty_file_is_named(self, munich: Path, file: str) -> None:
        (munich / WINTER / file).write_text("")
        with pytest.raises(surefix.SurefixValueError, match=f"{file}: expected"):
            datasets.four_seasons(munich)

    def test_the_publishers_own_example_is_a_plane_at_munich(self, munich: Path) -> None:
        """`transform_e_gpsw` as the data set's documentation prints it: its up must point away from
        the Earth.
        """
        path = munich / SPRING / "Transformations.txt"
        change(
            path,
            lambda lines: lines.__setitem__(
                13,
                "4172814.292643,857504.007380,4731704.606937,0.225469,0.276513,0.724007,0.590354",
            ),
        )
        from surefix.datasets.four_seasons import EARTH, _transform

        earth = _transform(munich / SPRING, EARTH)
        up = earth[:3, 2]
        assert math.degrees(math.asin(up[2])) == pytest.approx(48.194, abs=1e-3)
        assert math.degrees(math.atan2(up[1], up[0])) == pytest.approx(11.612, abs=1e-3)
        assert abs(earth[2, 0]) < 1e-5  # east is level
