"""Real drives, as a bag and as videos: the fixes are those of the images."""

from pathlib import Path

import numpy as np

import surefix
from real_data import folder
from recordings import Bag, write_video
from surefix.frames import open as frames_open


def test_a_corridor_in_a_bag_and_in_a_video(tmp_path: Path) -> None:
    data = folder() / "corridor"
    route = surefix.Map.from_images(data / "reference", progress=False)
    files = surefix.find_images(data / "query")
    plain = [(fix.place, fix.score, fix.trusted) for fix in surefix.Localizer(route).stream(files)]
    images = [surefix.read_image(file) for file in files]
    with Bag(tmp_path, "mcap") as bag:
        for index, file in enumerate(files):
            bag.compressed("/camera/compressed", Path(file).read_bytes(), "jpeg", 100 + index / 10)
    colour = [
        image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2) for image in images
    ]
    lossless = write_video(tmp_path / "drive.mkv", colour)
    for place in (bag.path, lossless):
        localizer = surefix.Localizer(route)
        fixes = [localizer.push(frame.image) for frame in frames_open(place)]
        assert [(fix.place, fix.score, fix.trusted) for fix in fixes] == plain
    # As cameras record: the losses of compression move few matches, if any.
    lossy = write_video(tmp_path / "drive.mp4", colour, codec="libx264", pixels="yuv420p")
    localizer = surefix.Localizer(route)
    places = [localizer.push(frame.image).place for frame in frames_open(lossy)]
    assert np.mean(np.abs(np.array(places) - [place for place, _, _ in plain]) <= 1) > 0.9
