"""``surefix demo --save-drives``: drives to try the other commands on."""

import errno
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest

import surefix
from commands import surefix_
from surefix.cli import save_drives
from surefix.cli.save_drives import HANG, STOP, Form
from surefix.simulate import Route

SMALL = "--places", 60, "--width", 64, "--height", 32


def test_a_folder_has_a_picture_of_each_place(tmp_path: Path) -> None:
    said = surefix_("demo", "--save-drives", tmp_path / "new" / "drives", *SMALL).stdout
    summer, winter = (tmp_path / "new" / "drives" / name for name in ("summer", "winter"))
    assert said == f"Made {summer} and {winter}; try: surefix run {summer} {winter}\n"
    road = Route(places=60, size=(64, 32), seed=1)
    for folder, drive in ((summer, road.reference()), (winter, road.revisit())):
        frames = list(surefix.frames.open(str(folder)).frames())
        assert len(frames) == 60
        for index, frame in enumerate(frames):
            np.testing.assert_array_equal(frame.image, drive[index])


@pytest.mark.parametrize(("form", "ending"), [("video", ".mp4"), ("bag", "")])
def test_a_recording_stops_and_hangs(form: Form, ending: str, tmp_path: Path) -> None:
    surefix_("demo", "--save-drives", tmp_path, "--as", form, *SMALL)
    summer, winter = (str(tmp_path / f"{name}{ending}") for name in ("summer", "winter"))
    assert len(list(surefix.frames.open(summer).frames())) == 60
    odometry = str(tmp_path / "odometry.csv") if form == "video" else "/odom"
    frames = list(
        surefix.frames.open(winter, gap=1, odometry=odometry, places_per_metre=1).frames()
    )
    assert len(frames) == 60 + 10 * STOP
    still = [index for index, frame in enumerate(frames) if frame.advance == 0]
    assert still == [*range(33, 33 + 10 * STOP)]
    hung = [index for index, frame in enumerate(frames) if frame.gap]
    assert hung == [48 + 10 * STOP]
    assert frames[88].time - frames[87].time == pytest.approx(HANG + 0.1)


def test_nothing_is_written_over_or_unused(tmp_path: Path) -> None:
    (tmp_path / "winter").mkdir()
    drives = "demo", "--save-drives", tmp_path
    said = surefix_(*drives, *SMALL, code=1).stderr
    assert f"expected a folder without winter, got {tmp_path / 'winter'}" in said
    assert [*tmp_path.iterdir()] == [tmp_path / "winter"]
    (tmp_path / "odometry.csv").write_text("")
    said = surefix_("demo", "--save-drives", tmp_path, "--as", "video", *SMALL, code=1).stderr
    assert f"expected a folder without odometry.csv, got {tmp_path / 'odometry.csv'}" in said
    assert "--save-drives too" in surefix_("demo", "--as", "bag", code=2).stderr
    assert "expected no --town" in surefix_(*drives, "--town", code=2).stderr
    (tmp_path / "file").write_text("")
    said = surefix_("demo", "--save-drives", tmp_path / "file", *SMALL, code=1).stderr
    assert f"{tmp_path / 'file'}: cannot write the drives" in said


@pytest.mark.parametrize("form", ["images", "video", "bag"])
def test_a_drive_is_whole_or_not_there(
    form: Form, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*given: Any, **more: Any) -> Any:
        raise OSError(errno.ENOSPC, "No space left on device")

    # The last that a form calls for its second drive, after some of it was written.
    modules = {"images": PIL.Image.Image, "video": save_drives, "bag": Path}
    name = {"images": "save", "video": "save", "bag": "rename"}[form]
    monkeypatch.setattr(modules[form], name, fails)
    road = Route(places=60, size=(64, 32), seed=1)
    with pytest.raises(surefix.SurefixFileError, match="cannot write the drives: No space left"):
        save_drives.save_drives(tmp_path, form, road)
    assert [*tmp_path.iterdir()] == []
