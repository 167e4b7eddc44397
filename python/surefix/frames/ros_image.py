"""From a ROS image message, of either ROS, to an image."""

from typing import Any, NamedTuple, get_args

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import as_strided

from surefix._core import decode_image
from surefix.errors import SurefixValueError, mismatch
from surefix.frames.bayer import Pattern, demosaic

Pixels = npt.NDArray[Any]
UInt8 = npt.NDArray[np.uint8]

RAW = ("sensor_msgs/msg/Image", "foxglove_msgs/msg/RawImage")
COMPRESSED = ("sensor_msgs/msg/CompressedImage", "foxglove_msgs/msg/CompressedImage")


class Layout(NamedTuple):
    """An encoding: the type of a sample, samples a pixel, which of them are red, green and blue, or
    grey, and how many rows of a step follow those of the image, as a share of its height.
    """

    dtype: str
    samples: int
    channels: tuple[int, ...]
    more: float = 0


GREY, RGB, BGR = (0,), (0, 1, 2), (2, 1, 0)
LAYOUTS = {
    "mono8": Layout("u1", 1, GREY),
    "rgb8": Layout("u1", 3, RGB),
    "bgr8": Layout("u1", 3, BGR),
    "rgba8": Layout("u1", 4, RGB),
    "bgra8": Layout("u1", 4, BGR),
    "mono16": Layout("u2", 1, GREY),
    "rgb16": Layout("u2", 3, RGB),
    "bgr16": Layout("u2", 3, BGR),
    "rgba16": Layout("u2", 4, RGB),
    "bgra16": Layout("u2", 4, BGR),
    # OpenCV's names of types, so in its order.
    "8UC1": Layout("u1", 1, GREY),
    "8UC3": Layout("u1", 3, BGR),
    "8UC4": Layout("u1", 4, BGR),
    "16UC1": Layout("u2", 1, GREY),
    "16UC3": Layout("u2", 3, BGR),
    "16UC4": Layout("u2", 4, BGR),
    "32FC1": Layout("f4", 1, GREY),
    # Brightness at every pixel, colour at fewer: the brightness is taken.
    "yuv422": Layout("u1", 2, (1,)),
    "uyvy": Layout("u1", 2, (1,)),
    "yuv422_yuy2": Layout("u1", 2, GREY),
    "yuyv": Layout("u1", 2, GREY),
    # The brightness comes first, all colour after it.
    "nv12": Layout("u1", 1, GREY, 0.5),
    "nv21": Layout("u1", 1, GREY, 0.5),
    "i420": Layout("u1", 1, GREY, 0.5),
    "yuv420": Layout("u1", 1, GREY, 0.5),
    "yv12": Layout("u1", 1, GREY, 0.5),
    "nv24": Layout("u1", 1, GREY, 2),
}
BAYER: dict[str, tuple[str, Pattern]] = {
    f"bayer_{pattern}{8 * size}": (f"u{size}", pattern)
    for size in (1, 2)
    for pattern in get_args(Pattern)
}
OF_FLOATS = 256
# Drivers write RGB8 and NV12 as well.
KNOWN = {name.lower(): name for name in (*LAYOUTS, *BAYER)}


def image_of(message: Any, where: str = "image") -> Pixels:
    """The picture of an image message of rclpy, rospy or rosbags: ``sensor_msgs`` Image or
    CompressedImage, or Foxglove's of the same names.

    16 bits stay so: the map's levels make 8 of them. Floats become 16 bits by one rule, whatever
    the image: times 256, so that shades from 0 to 1 keep 256 levels, and depths up to 256 m steps
    of 4 mm. What is no number is 0. A Bayer mosaic becomes a colour image of half its sides
    (``surefix.datasets.demosaic``). Of YUV the brightness is taken. An alpha channel is left out.

    Parameters
    ----------
    message : object
        With the fields of the message.
    where : str
        Its name in an error.

    Returns
    -------
    array of uint8 or uint16, shape (H, W) or (H, W, 3) RGB

    Raises
    ------
    SurefixValueError
        For another encoding, or data that do not fit the size; for a compressed image that is not
        png, jpeg or another format of ``surefix.read_image``.
    """
    return _raw(message, where) if hasattr(message, "encoding") else _compressed(message, where)


def check_fits(message: Any, where: str = "image") -> None:
    """Refuses a raw image that ``image_of`` would, by its encoding and the length of its data."""
    # A packet of a video has an encoding as well, and no rows.
    if hasattr(message, "step"):
        _rows(message, _layout(message, where), where)


def _layout(message: Any, where: str) -> Layout:
    name = KNOWN.get(str(message.encoding).lower())
    if name is None:
        raise mismatch(
            where, f"an encoding among {', '.join(KNOWN.values())}", repr(message.encoding)
        )
    return LAYOUTS[name] if name in LAYOUTS else Layout(BAYER[name][0], 1, GREY)


def _raw(message: Any, where: str) -> Pixels:
    layout = _layout(message, where)
    samples = _rows(message, layout, where)
    name = KNOWN[str(message.encoding).lower()]
    if name in BAYER:
        try:
            return demosaic(samples[..., 0], BAYER[name][1])
        except SurefixValueError as error:
            raise SurefixValueError(f"{where}: {error}") from None
    channels = layout.channels[0] if len(layout.channels) == 1 else layout.channels
    samples = samples[..., channels]
    if samples.dtype == np.float32:
        known = np.nan_to_num(samples, nan=0.0, posinf=0.0, neginf=0.0)
        samples = np.rint((known * OF_FLOATS).clip(0, 65535)).astype(np.uint16)
    return np.ascontiguousarray(samples)


def _compressed(message: Any, where: str) -> Pixels:
    encoding = str(message.format)
    # Its png has a header of its own before it, and 16-bit depths in it.
    if "compressedDepth" in encoding:
        raise mismatch(where, "a camera's image", f"a depth image (format {encoding!r})")
    return decode_image(bytes(bytes_of(message)), where)


def _rows(message: Any, layout: Layout, where: str) -> Pixels:
    """The samples, shape (H, W, samples a pixel), in this machine's order of bytes."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    # Foxglove's have no such field: they are little-endian.
    dtype = np.dtype((">" if getattr(message, "is_bigendian", 0) else "<") + layout.dtype)
    row = width * layout.samples * dtype.itemsize
    # Some drivers leave it out.
    step = step or row
    data = bytes_of(message)
    # Some count the rows of the colour too.
    if layout.more and height and len(data) == step * height:
        height = round(height / (1 + layout.more))
    # The last row need not be padded.
    short = len(data) < step * (height - 1) + row + step * round(height * layout.more)
    if not (height and width) or step < row or short:
        total = round(height * (1 + layout.more))
        expected = f"{total} rows of {row} bytes or more ({width} pixels, {message.encoding})"
        raise mismatch(where, expected, f"a row step of {step} and {len(data)} bytes")
    # A view of rows of which the last may end early.
    pixels = np.ascontiguousarray(as_strided(data, (height, row), (step, 1)))
    native = pixels.view(dtype).astype(dtype.newbyteorder("="), copy=False)
    return native.reshape(height, width, layout.samples)


def bytes_of(message: Any) -> UInt8:
    """The bytes of a message's data: an array, bytes or ``array.array``."""
    return np.frombuffer(message.data, dtype=np.uint8)
