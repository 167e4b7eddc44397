"""From a ROS image message, of either ROS, to an image."""

from typing import Any, NamedTuple, get_args

import numpy as np
import numpy.typing as npt

from surefix._core import decode_image
from surefix.datasets.bayer import Pattern, demosaic
from surefix.errors import SurefixValueError

__all__ = ["IMAGE", "compressed_image", "image_of", "raw_image"]

UInt8 = npt.NDArray[np.uint8]

COMPRESSED = "sensor_msgs/msg/CompressedImage"
IMAGE = ("sensor_msgs/msg/Image", COMPRESSED)


class Layout(NamedTuple):
    """How an encoding's pixels lie: bytes a sample, samples a pixel, and which of them are taken,
    in the order RGB.
    """

    size: int
    samples: int
    taken: tuple[int, ...]


LAYOUTS = {
    "mono8": Layout(1, 1, (0,)),
    "8UC1": Layout(1, 1, (0,)),
    "rgb8": Layout(1, 3, (0, 1, 2)),
    "bgr8": Layout(1, 3, (2, 1, 0)),
    # As OpenCV holds colour, whose name of a type this is.
    "8UC3": Layout(1, 3, (2, 1, 0)),
    "rgba8": Layout(1, 4, (0, 1, 2)),
    "bgra8": Layout(1, 4, (2, 1, 0)),
    "mono16": Layout(2, 1, (0,)),
    "16UC1": Layout(2, 1, (0,)),
    "rgb16": Layout(2, 3, (0, 1, 2)),
    "bgr16": Layout(2, 3, (2, 1, 0)),
    # Brightness beside every pixel, colour beside every second: the brightness is taken.
    "yuv422": Layout(1, 2, (1,)),
    "uyvy": Layout(1, 2, (1,)),
    "yuv422_yuy2": Layout(1, 2, (0,)),
    "yuyv": Layout(1, 2, (0,)),
}
BAYER: dict[str, tuple[int, Pattern]] = {
    f"bayer_{pattern}{8 * size}": (size, pattern)
    for size in (1, 2)
    for pattern in get_args(Pattern)
}


def image_of(message: Any, where: str = "image") -> UInt8:
    """The picture of a ``sensor_msgs`` Image or CompressedImage, as rclpy, rospy or rosbags hand it
    over.

    Of 16 bits the upper 8 are taken, rounded; a Bayer mosaic becomes a colour image of half its
    sides (``surefix.datasets.demosaic``); of YUV 4:2:2 the brightness is taken; an alpha channel is
    left out.

    Parameters
    ----------
    message : object
        With the fields of the message.
    where : str
        What an error calls it.

    Returns
    -------
    array of uint8, shape (H, W) or (H, W, 3) RGB

    Raises ------ SurefixValueError For an encoding that is none of these, or data that do not fit
    the size; for a compressed image that is not png, jpeg or another format of
    ``surefix.read_image``.
    """
    return (
        raw_image(message, where)
        if hasattr(message, "encoding")
        else compressed_image(message, where)
    )


def raw_image(message: Any, where: str = "image") -> UInt8:
    """The picture of a ``sensor_msgs`` Image, as ``image_of`` says."""
    encoding = str(message.encoding)
    if encoding in BAYER:
        size, pattern = BAYER[encoding]
        mosaic = _samples(message, Layout(size, 1, (0,)), where)[..., 0]
        try:
            return demosaic(np.ascontiguousarray(mosaic), pattern)
        except SurefixValueError as error:
            raise SurefixValueError(f"{where}: {error}") from None
    layout = LAYOUTS.get(encoding)
    if layout is None:
        known = ", ".join([*LAYOUTS, *BAYER])
        raise SurefixValueError(f"{where}: expected an encoding among {known}, got {encoding!r}")
    samples = _samples(message, layout, where)
    if len(layout.taken) == 1:
        return np.ascontiguousarray(samples[..., layout.taken[0]])
    return np.ascontiguousarray(samples[..., layout.taken])


def compressed_image(message: Any, where: str = "image") -> UInt8:
    """The picture of a ``sensor_msgs`` CompressedImage, as ``image_of`` says."""
    encoding = str(message.format)
    # Its png has a header of its own before it, and 16-bit depths in it.
    if "compressedDepth" in encoding:
        raise SurefixValueError(
            f"{where}: expected a camera's image, got a depth image (format {encoding!r})"
        )
    return decode_image(bytes(_bytes(message.data)), where)


def _samples(message: Any, layout: Layout, where: str) -> UInt8:
    """8-bit samples, shape (H, W, samples a pixel)."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    row = width * layout.samples * layout.size
    data = _bytes(message.data)
    if not (height and width) or step < row or len(data) != step * height:
        raise SurefixValueError(
            f"{where}: expected {height} rows of {row} bytes or more ({width} pixels, {message.encoding}), "
            f"got a row step of {step} and {len(data)} bytes"
        )
    pixels = data.reshape(height, step)[:, :row]
    if layout.size == 2:
        wide = (
            np.ascontiguousarray(pixels)
            .view(">u2" if message.is_bigendian else "<u2")
            .astype(np.uint32)
        )
        pixels = ((wide + 128) // 257).astype(np.uint8)
    return pixels.reshape(height, width, layout.samples)


def _bytes(data: Any) -> UInt8:
    """The bytes of a message's field: an array, bytes or ``array.array``."""
    return np.frombuffer(data, dtype=np.uint8)
