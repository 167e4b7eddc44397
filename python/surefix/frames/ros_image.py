"""From a ROS image message, of either ROS, to an image."""

from typing import Any, NamedTuple, get_args

import numpy as np
import numpy.typing as npt

from surefix._core import decode_image
from surefix.errors import SurefixValueError, mismatch
from surefix.frames.bayer import Pattern, demosaic

UInt8 = npt.NDArray[np.uint8]

IMAGE = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")


class Layout(NamedTuple):
    """An encoding: bytes a sample, samples a pixel, and which are red, green, blue, or grey."""

    size: int
    samples: int
    channels: tuple[int, ...]


LAYOUTS = {
    "mono8": Layout(1, 1, (0,)),
    "8UC1": Layout(1, 1, (0,)),
    "rgb8": Layout(1, 3, (0, 1, 2)),
    "bgr8": Layout(1, 3, (2, 1, 0)),
    # OpenCV's name of a type, so in its order.
    "8UC3": Layout(1, 3, (2, 1, 0)),
    "rgba8": Layout(1, 4, (0, 1, 2)),
    "bgra8": Layout(1, 4, (2, 1, 0)),
    "mono16": Layout(2, 1, (0,)),
    "16UC1": Layout(2, 1, (0,)),
    "rgb16": Layout(2, 3, (0, 1, 2)),
    "bgr16": Layout(2, 3, (2, 1, 0)),
    # Brightness at every pixel, colour at every second: the brightness is taken.
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
    """The picture of a ``sensor_msgs`` Image or CompressedImage of rclpy, rospy or rosbags.

    16 bits are rounded to the upper 8; a Bayer mosaic becomes a colour image of half its sides
    (``surefix.datasets.demosaic``); of YUV 4:2:2 the brightness is taken; an alpha channel is left
    out.

    Parameters
    ----------
    message : object
        With the fields of the message.
    where : str
        Its name in an error.

    Returns
    -------
    array of uint8, shape (H, W) or (H, W, 3) RGB

    Raises
    ------
    SurefixValueError
        For another encoding, or data that do not fit the size; for a compressed image that is not
        png, jpeg or another format of ``surefix.read_image``.
    """
    return _raw(message, where) if hasattr(message, "encoding") else _compressed(message, where)


def _raw(message: Any, where: str) -> UInt8:
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
        raise mismatch(where, f"an encoding among {known}", repr(encoding))
    one = len(layout.channels) == 1
    channels = layout.channels[0] if one else layout.channels
    return np.ascontiguousarray(_samples(message, layout, where)[..., channels])


def _compressed(message: Any, where: str) -> UInt8:
    encoding = str(message.format)
    # Its png has a header of its own before it, and 16-bit depths in it.
    if "compressedDepth" in encoding:
        raise mismatch(where, "a camera's image", f"a depth image (format {encoding!r})")
    return decode_image(bytes(_bytes(message.data)), where)


def _samples(message: Any, layout: Layout, where: str) -> UInt8:
    """8-bit samples, shape (H, W, samples a pixel)."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    row = width * layout.samples * layout.size
    data = _bytes(message.data)
    if not (height and width) or step < row or len(data) != step * height:
        expected = f"{height} rows of {row} bytes or more ({width} pixels, {message.encoding})"
        raise mismatch(where, expected, f"a row step of {step} and {len(data)} bytes")
    pixels = data.reshape(height, step)[:, :row]
    if layout.size == 2:
        order = ">u2" if message.is_bigendian else "<u2"
        wide = np.ascontiguousarray(pixels).view(order).astype(np.uint32)
        pixels = ((wide + 128) // 257).astype(np.uint8)
    return pixels.reshape(height, width, layout.samples)


def _bytes(data: Any) -> UInt8:
    """The bytes of a message's field: an array, bytes or ``array.array``."""
    return np.frombuffer(data, dtype=np.uint8)
