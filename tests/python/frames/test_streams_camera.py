"""A camera, by OpenCV: here one on the network, which this test serves."""

import csv
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest

import surefix
from recordings import pictures
from surefix.frames import CameraFrames, KeepNewest
from surefix.frames import open as frames_open

IMAGES = pictures(20, 96, 128)


class Camera(BaseHTTPRequestHandler):
    """Serves the pictures as a network camera does: one JPEG after another, and then no more."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        self.end_headers()
        for image in IMAGES:
            jpeg = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 95])[
                1
            ].tobytes()
            head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
            try:
                self.wfile.write(head.encode() + jpeg + b"\r\n")
            except OSError:
                return
            time.sleep(0.01)

    def log_message(self, *_: object) -> None:
        """Says nothing."""


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with ThreadingHTTPServer(("127.0.0.1", 0), Camera) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_address[1]}/front.mjpg"
        server.shutdown()
        thread.join()


def near(image: np.ndarray, index: int) -> bool:
    """The picture, but for the losses of JPEG."""
    return bool(np.abs(image.astype(int) - IMAGES[index]).mean() < 4)


def test_a_camera_gives_what_it_sees_and_when(address: str) -> None:
    begin = time.time()
    stream = frames_open(address, newest=False)
    assert isinstance(stream, CameraFrames)
    with closing(stream.frames()) as camera:
        frames = list(islice(camera, 5))
    assert [frame.name for frame in frames] == ["0", "1", "2", "3", "4"]
    assert all(near(frame.image, index) for index, frame in enumerate(frames))
    times = [frame.time for frame in frames if frame.time is not None]
    assert len(times) == 5
    assert begin <= times[0]
    assert times == sorted(times)
    assert times[-1] <= time.time()


def test_a_camera_that_stops_is_said_after_its_frames(address: str) -> None:
    stream = frames_open(address)
    assert isinstance(stream, KeepNewest)
    seen = []
    message = ""
    try:
        for frame in stream:
            seen.append(frame)
            time.sleep(0.02)
    except surefix.SurefixFileError as error:
        message = str(error)
    assert message.startswith(f"camera {address}: it gives no frame any more, after ")
    given = int(message.split()[-2])
    assert len(seen) + sum(frame.dropped for frame in seen) == given
    assert all(near(frame.image, int(frame.name)) for frame in seen)


def test_a_camera_is_known_by_its_number_its_device_or_its_address() -> None:
    for place in (0, "0", "/dev/video0", "rtsp://robot.local/front"):
        stream = frames_open(place)
        assert isinstance(stream, KeepNewest)
        assert isinstance(stream.source, CameraFrames)
        assert stream.live


def test_a_camera_that_is_not_there_is_named() -> None:
    with pytest.raises(
        surefix.SurefixFileError, match=r"camera http://127\.0\.0\.1:1/x: cannot open it"
    ):
        list(frames_open("http://127.0.0.1:1/x"))


@pytest.mark.slow
def test_a_robot_runs_along_a_route_by_its_camera(address: str, tmp_path: Path) -> None:
    surefix.Map.from_images(IMAGES, progress=False).save(tmp_path / "route.safetensors")
    out = tmp_path / "fixes.csv"
    command = [
        sys.executable,
        "-m",
        "surefix",
        "run",
        tmp_path / "route.safetensors",
        address,
        "-o",
        out,
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    # The camera's end is an error; the frames before it are kept.
    assert done.returncode == 1, done.stderr
    *_, summary, _, kept, error = done.stderr.splitlines()
    assert error.startswith(f"surefix: camera {address}: it gives no frame any more")
    assert not out.exists()
    assert "fixes.part.csv" in kept
    rows = list(csv.DictReader((tmp_path / "fixes.part.csv").read_text().splitlines()))
    assert summary.startswith(f"{len(rows)} fixes, ")
    assert [int(row["single_place"]) for row in rows] == [int(row["query"]) for row in rows]
    seen = len(rows) + sum(int(row["dropped"]) for row in rows)
    assert int(error.split()[-2]) == seen
