"""The order of a folder's images, and what is left out of it."""

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import surefix
from commands import surefix_
from surefix._core import image_files
from surefix.frames import ImageFrames, foreign
from surefix.frames import images as frames_images


def touch(folder: Path, *names: str) -> Path:
    """Small images of these names, made in another order."""
    folder.mkdir(exist_ok=True, parents=True)
    for index, name in enumerate(sorted(names, key=lambda name: name[::-1])):
        noise = np.random.default_rng(index).integers(0, 256, (16, 32), np.uint8)
        Image.fromarray(noise).save(folder / name, "png")
    return folder


def names(folder: Path, order: str = "name") -> list[str]:
    return [Path(path).name for path in surefix.find_images(folder, order)]


@pytest.mark.parametrize(
    "listed",
    [
        # Seconds, as Python writes them.
        ["9.125.png", "9.25.png", "9.5.png", "10.0.png", "10.05.png"],
        ["frame_1700000000.05.png", "frame_1700000000.1.png", "frame_1700000000.25.png"],
        # Seconds and unpadded nanoseconds: whole numbers, one of which ends in 0.
        ["9.5.png", "9.25.png", "9.125000000.png", "10.0.png"],
        ["5.50000000.png", "5.100000000.png", "5.150000000.png", "6.0.png"],
        # Seconds and padded nanoseconds: both readings agree.
        ["1.000000005.png", "1.050000000.png", "1.500000000.png", "2.000000000.png"],
        # Chapters and their frames.
        ["1.1.png", "1.2.png", "1.10.png", "2.1.png"],
        # Upper and lower case; cameras, phones, recorders.
        ["frame1.png", "Frame2.png", "frame3.png", "FRAME4.png"],
        ["IMG_9.PNG", "img_10.png", "IMG_11.png"],
        ["frame.9.png", "frame.10.png", "frame.100.png"],
        ["Screenshot 2024-05-11 at 9.30.05.png", "Screenshot 2024-05-11 at 10.05.00.png"],
        ["GX010001.png", "GX010002.png", "GX020001.png"],
        ["v1.5_9.png", "v1.5_10.png"],
        ["frame.png", "frame2.png"],
    ],
)
def test_names_are_in_the_order_in_which_a_person_counts(tmp_path: Path, listed: list[str]) -> None:
    assert names(touch(tmp_path, *listed)) == listed


def test_an_order_that_names_leave_open_is_said_and_chosen(tmp_path: Path) -> None:
    folder = touch(tmp_path / "a", "9.125.png", "9.25.png", "9.5.png")
    decimals, whole = ["9.125.png", "9.25.png", "9.5.png"], ["9.5.png", "9.25.png", "9.125.png"]
    assert names(folder) == names(folder, "decimals") == decimals
    assert names(folder, "whole") == whole
    remarks = {order: image_files(folder, order)[1] for order in ("name", "decimals", "whole")}
    assert "decimals" in remarks["name"][0]
    assert "whole" in remarks["name"][0]
    assert remarks["decimals"] == remarks["whole"] == []
    # Names that leave nothing open.
    assert image_files(touch(tmp_path / "b", "9.05.png", "9.5.png"))[1] == []
    done = surefix_("map", "build", folder, "-o", tmp_path / "m")
    assert "decimals" in done.stdout.splitlines()[-1]
    surefix_("map", "build", folder, "-o", tmp_path / "m", "--order", "whole")
    assert surefix.Map.open(tmp_path / "m").names == whole


def test_by_the_time_of_the_file_and_of_the_camera(tmp_path: Path) -> None:
    shuffled = ["c.jpg", "a.jpg", "d.jpg", "b.jpg"]
    for index, name in enumerate(shuffled):
        exif = Image.Exif()
        # The time of capture stands in a directory of its own, its fraction beside it.
        exif.get_ifd(0x8769)[0x9003] = f"2024:05:11 12:00:0{index // 2}"
        exif.get_ifd(0x8769)[0x9291] = ["05", "5"][index % 2]
        noise = np.random.default_rng(index).integers(0, 256, (16, 32), np.uint8)
        Image.fromarray(noise).save(tmp_path / name, exif=exif)
        os.utime(tmp_path / name, ns=(0, 10**18 - index))
    assert names(tmp_path) == sorted(shuffled)
    assert names(tmp_path, "time") == shuffled[::-1]
    assert names(tmp_path, "exif") == shuffled
    for order in ("time", "exif"):
        assert [Path(file).name for file in ImageFrames(tmp_path, order=order).files] == names(
            tmp_path, order
        )
        run = surefix.frames.open(tmp_path, order=order)
        assert [frame.name for frame in run] == names(tmp_path, order)
    Image.new("L", (32, 16)).save(tmp_path / "none.jpg")
    with pytest.raises(surefix.SurefixValueError, match=r"none.jpg.*DateTimeOriginal"):
        surefix.find_images(tmp_path, "exif")
    with pytest.raises(surefix.SurefixValueError, match="order"):
        surefix.find_images(tmp_path, "random")
    for name in shuffled:
        os.utime(tmp_path / name, (5, 5))
    os.utime(tmp_path / "none.jpg", (5, 5))
    assert "one time of change" in image_files(tmp_path, "time")[1][0]


@pytest.mark.parametrize(
    "listed",
    [
        ["left_1.png", "left_2.png", "right_1.png", "right_2.png"],
        ["1_left.png", "2_left.png", "1_right.png", "2_right.png"],
        ["cam0_1.png", "cam0_2.png", "cam1_1.png", "cam1_2.png"],
        ["IMG_1.jpg", "IMG_1.png", "IMG_2.jpg", "IMG_2.png"],
    ],
)
def test_two_drives_in_one_folder_are_noticed(tmp_path: Path, listed: list[str]) -> None:
    _, remarks = image_files(touch(tmp_path / "a", *listed))
    assert "two drives or cameras" in remarks[0]
    assert "*" in remarks[0]
    done = surefix_("map", "build", tmp_path / "a", "-o", tmp_path / "m")
    assert "two drives" in done.stdout.splitlines()[-1]


@pytest.mark.parametrize(
    "listed",
    [
        ["frame1.png", "frame2.png", "frame3.png", "cover.png"],
        ["GX010001.png", "GX010002.png", "GX020001.png", "GX020002.png"],
        ["2024-05-11_10-30-05.png", "2024-05-11_10-31-07.png", "2024-05-11_11-00-05.png"],
        ["day_1.png", "day_2.png", "night_3.png", "night_4.png"],
    ],
)
def test_one_drive_is_no_two(tmp_path: Path, listed: list[str]) -> None:
    assert image_files(touch(tmp_path, *listed))[1] == []


@pytest.fixture
def _alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the libraries of ``surefix[heif]``."""
    for module in (foreign, frames_images):
        monkeypatch.setattr(module, "endings", lambda: ())


FOREIGN = ["c.heic", "d.heic", "e.gif", "f.avif", "g.jp2", "h.dng", "notes.txt", "raw", ".DS_Store"]


@pytest.fixture
def mixed(tmp_path: Path, _alone: None) -> Path:
    """Two images among other files, and a folder."""
    folder = touch(tmp_path / "photos", "a.png", "b.jfif", "b2.jpe")
    for name in FOREIGN:
        (folder / name).write_bytes(b"other")
    touch(folder / "part2", "a.png")
    return folder


def test_what_is_left_out_is_counted_and_named_in_the_last_line(
    mixed: Path, tmp_path: Path
) -> None:
    expected = (
        "9 files left out: 1 without an ending, 1 .avif, 1 .dng, 1 .gif, 2 .heic, 1 .jp2, 1 .txt, "
        "1 hidden, folder part2"
    )
    for place in (mixed, mixed / "*", mixed / "?*"):
        # A pattern's star matches hidden names too.
        files, remarks = image_files(place)
        assert [Path(file).name for file in files] == ["a.png", "b.jfif", "b2.jpe"]
        assert remarks[-1].startswith(expected), place
        assert "magick" in remarks[-1]
    known = tmp_path / "m"
    done = surefix_("map", "build", mixed, "-o", known)
    assert expected in done.stdout.splitlines()[-1]
    assert ": 3 places x" in done.stdout
    done = surefix_("run", known, mixed)
    assert done.stderr.splitlines()[-1].startswith(expected)
    done = surefix_("map", "append", known, mixed)
    assert expected in done.stdout.splitlines()[-1]
    surefix_("map", "build", mixed, "-o", known)
    done = surefix_(
        "eval", known, mixed, "--truth", "identity", "-o", tmp_path / "r", "--method", "single"
    )
    assert expected in done.stdout.splitlines()[-1]
    done = surefix_("align", known, mixed, "-o", tmp_path / "truth.csv")
    assert expected in done.stderr


def test_of_a_file_without_an_ending_the_content_decides_if_a_pattern_names_it(
    tmp_path: Path,
) -> None:
    folder = touch(tmp_path, "frame_1", "frame_2", "frame_3.dat")
    (folder / "frame_4").write_bytes(b"no image")
    files, remarks = image_files(folder / "frame_*")
    assert [Path(file).name for file in files] == ["frame_1", "frame_2", "frame_3.dat"]
    assert remarks == ["1 file left out: 1 without an ending"]


@pytest.mark.usefixtures("_alone")
def test_a_folder_without_images_says_what_is_there(tmp_path: Path) -> None:
    (tmp_path / "a.heic").write_bytes(b"other")
    for act in (surefix.find_images, surefix.Map.from_images):
        with pytest.raises(
            surefix.SurefixValueError, match=r"found none; 1 file left out: 1 .heic"
        ):
            act(tmp_path)  # type: ignore[operator]


def test_heic_and_avif_are_read_by_their_libraries(tmp_path: Path) -> None:
    pytest.importorskip("pillow_heif")
    folder = touch(tmp_path / "photos", "0.png", "3.png")
    scene = np.random.default_rng(9).integers(0, 256, (6, 8, 3), np.uint8).repeat(8, 0).repeat(8, 1)
    exif = Image.Exif()
    exif[0x112] = 6
    # Stored turned to the left; 16 x 32 as the others once it is upright.
    upright = np.ascontiguousarray(np.rot90(scene[:16, :32]))
    foreign.endings()
    for name in ("1.heic", "2.AVIF"):
        # The writer of HEIC drops the orientation, which is a property of its own there.
        if name == "1.heic":
            Image.fromarray(scene[:16, :32]).save(folder / name, "heif", quality=100)
        else:
            Image.fromarray(upright).save(folder / name, "avif", quality=100, exif=exif)
    frames = ImageFrames(folder)
    assert frames.images.names == ["0.png", "1.heic", "2.AVIF", "3.png"]
    assert frames.remarks == []
    for index in (1, 2):
        assert np.abs(frames.images[index].astype(int) - scene[:16, :32]).mean() < 12
    known = surefix.Map.from_images(folder)
    assert known.names == frames.images.names
    surefix_("map", "build", folder, "-o", tmp_path / "m")
    assert surefix.Map.open(tmp_path / "m").to_bytes() == known.to_bytes()
    done = surefix_("run", tmp_path / "m", folder)
    assert done.stderr.startswith("4 fixes")
    (folder / "1.heic").write_bytes((folder / "1.heic").read_bytes()[:300])
    done = surefix_("map", "build", folder, "-o", tmp_path / "m")
    assert done.stdout.splitlines()[-1].endswith("1 bad frame passed over: 1.heic")
