"""The limit of pixels, for images that other libraries decode."""

from surefix._core import max_pixels
from surefix.errors import SurefixValueError


def most_pixels() -> str:
    """The limit as an option of FFmpeg's, which refuses larger frames."""
    return str(min(max_pixels(), 2**31 - 1))


def check_pixels(width: int, height: int, where: str) -> None:
    """Refuses an image, or a frame of a video, of more pixels than ``surefix.max_pixels()``."""
    count, limit = width * height, max_pixels()
    if count > limit:
        raise SurefixValueError(
            f"{where}: {width} x {height} pixels count as {count}, and surefix reads images of up "
            f"to max_pixels = {limit}: make it smaller, or set max_pixels (on the command line "
            f"--max-pixels) to {count} or more"
        )
