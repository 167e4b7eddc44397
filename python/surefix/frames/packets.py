"""Pictures from packets of H.264, H.265 and the like, one a message, by PyAV."""

import re
from collections import deque
from collections.abc import Generator, Iterable
from typing import Any

from surefix._extra import require
from surefix.errors import SurefixValueError, mismatch
from surefix.frames.pixels import most_pixels
from surefix.frames.ros_image import bytes_of

PACKETS = (
    "foxglove_msgs/msg/CompressedVideo",
    "ffmpeg_image_transport_msgs/msg/FFMPEGPacket",
)
# As messages name them, by what FFmpeg calls them.
CODECS = {
    "h264": r"h\.?264|avc|x264",
    "hevc": r"h\.?265|hevc|x265",
    "av1": r"av1|aom|svt",
    "vp9": r"vp9",
    "vp8": r"vp8|vpx",
    "mjpeg": r"mjpeg",
    "ffv1": r"ffv1",
}
# The most pictures that a later packet's may come before.
REORDERED = 16
# Before each part of a picture.
START = (b"\x00\x00\x00\x01", b"\x00\x00\x01")


def codec_of(message: Any, where: str = "video") -> str | None:
    """FFmpeg's name of the codec of a message's packet; None if it is an image by itself.

    Raises
    ------
    SurefixValueError
        For a video of a codec that is not known.
    """
    kind = getattr(message, "__msgtype__", "")
    form = str(getattr(message, "format", getattr(message, "encoding", "")))
    if kind not in PACKETS:
        if not hasattr(message, "format"):
            return None
        # Some drivers say jpeg, or nothing.
        if bytes(bytes_of(message)[:4]).startswith(START):
            return _named(form) or "h264"
        return _named(form) if not re.search("jpe?g|png|compressedDepth", form) else None
    codec = _named(form.partition(";")[0])
    if codec is None:
        raise mismatch(where, f"a video of {', '.join(CODECS)}", repr(form))
    return codec


def decoded(
    codec: str, packets: Iterable[tuple[int, Any]]
) -> Generator[tuple[int, Any | None], None, None]:
    """Of each packet's number, in the order of the pictures, its picture; None if there is none: it
    comes before the first whole picture, or is damaged, as is a message of None.

    Raises
    ------
    SurefixError
        If PyAV is missing: ``pip install "surefix[video]"``.
    """
    av = require("av", "a video in a bag", "PyAV", "surefix[video]")
    context = av.CodecContext.create(codec, "r")
    context.thread_type = "SLICE"
    context.options = {"err_detect": "explode", "max_pixels": most_pixels()}
    # The numbers of the packets whose pictures have not come.
    waiting: deque[int] = deque()

    # After a damaged picture, those up to the next key frame are made of it.
    whole = True

    def pictures(packet: Any) -> Generator[tuple[int, Any | None], None, None]:
        nonlocal whole
        try:
            found = context.decode(packet)
        except (av.FFmpegError, EOFError):
            found = []
            if packet is not None and packet.pts in waiting:
                whole = False
                waiting.remove(packet.pts)
                yield packet.pts, None
        late = REORDERED if context.has_b_frames else 0
        for frame in found:
            while waiting and waiting[0] < frame.pts - late:
                yield waiting.popleft(), None
            if frame.pts in waiting:
                whole = (whole or frame.key_frame) and not frame.is_corrupt
                waiting.remove(frame.pts)
                yield frame.pts, frame if whole else None

    for number, message in packets:
        data = b"" if message is None else bytes(bytes_of(message))
        if not data:
            # To FFmpeg it would be the end.
            whole = False
            yield number, None
            continue
        packet = av.Packet(data)
        packet.pts = number
        waiting.append(number)
        yield from pictures(packet)
    yield from pictures(None)
    for number in waiting:
        yield number, None


def rgb(picture: Any, where: str) -> Any:
    """The picture as uint8, (H, W, 3)."""
    try:
        return picture.to_ndarray(format="rgb24")
    except Exception as error:  # It depends on the damaged bytes.
        raise SurefixValueError(f"{where}: cannot be decoded: {error}") from None


def _named(form: str) -> str | None:
    found = (name for name, pattern in CODECS.items() if re.search(pattern, form, re.IGNORECASE))
    return next(found, None)
