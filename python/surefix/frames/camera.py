"""Frames from a camera, by OpenCV."""

import time
from collections.abc import Generator
from functools import partial

import numpy as np

from surefix._extra import require
from surefix.errors import SurefixFileError
from surefix.frames.frame import Frames, Shot

SCHEMES = ("rtsp://", "rtsps://", "rtmp://", "http://", "https://", "udp://", "tcp://")


class CameraFrames(Frames):
    """The images of a camera, as RGB, with the times of their arrival.

    Parameters
    ----------
    device : int or str
        The camera's number, from 0, its device file, or a URL (RTSP, HTTP).

    Raises
    ------
    SurefixError
        If OpenCV is missing: ``pip install "surefix[camera]"``.
    SurefixFileError
        While it is read: if the camera cannot be opened, or gives no frame any more.
    """

    timed = True
    live = True

    def __init__(self, device: int | str) -> None:
        self.device = int(device) if isinstance(device, str) and device.isdecimal() else device
        self._cv2 = require("cv2", "a camera", "OpenCV", "surefix[camera]")
        self._closed = False

    def close(self) -> None:
        """Ends the iteration, after the frame that it waits for."""
        self._closed = True

    def shots(self) -> Generator[Shot, None, None]:
        """Each frame, by its number from 0."""
        self._closed = False
        capture = self._cv2.VideoCapture(self.device)
        try:
            if not capture.isOpened():
                asked = "is it there, and is it free?"
                raise SurefixFileError(f"camera {self.device}: cannot open it: {asked}")
            index = 0
            while not self._closed:
                there, image = capture.read()
                if not there:
                    ended = f"it gives no frame any more, after {index} frames"
                    raise SurefixFileError(f"camera {self.device}: {ended}")
                yield Shot(time.time(), str(index), partial(np.ascontiguousarray, image[..., ::-1]))
                index += 1
        finally:
            capture.release()


def is_camera(place: str) -> bool:
    """Whether this names a camera: a number, a device file or a URL."""
    return place.isdecimal() or place.startswith(("/dev/video", *SCHEMES))
