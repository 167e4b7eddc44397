"""What both views share: the protocol, a frame as it is shown, the map's images, the colours."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from surefix import Fix, Localizer, Map, SurefixError, read_image
from surefix._colours import DARK
from surefix._words import plain
from surefix.errors import mismatch
from surefix.frames.by_name import thumbnails_of
from surefix.frames.levels import in_8_bits

__all__ = ["Closing", "Image", "Images", "References", "Seen", "View", "pillow", "rgb"]

Image = NDArray[np.uint8]

# Hue says what a mark is, and its shape or place says it again. The views are dark.
TRUSTED, UNTRUSTED = DARK.trusted, DARK.untrusted
MINIMUM, PEAK = DARK.nearest, DARK.peak
FAINT, HERE = "#5b6672", "#f4f7fa"


def rgb(colour: str) -> list[int]:
    """The parts of a colour such as ``#56b4e9``."""
    return list(bytes.fromhex(colour[1:]))


def pillow(image: Image) -> Any:
    """The image as Pillow's, which comes with rerun."""
    from PIL import Image as Pillow

    return Pillow.fromarray(np.ascontiguousarray(image))


class Images(Protocol):
    """Images by their number; a KeyError for a place without one."""

    def __getitem__(self, index: int, /) -> Image: ...


@runtime_checkable
class View(Protocol):
    """Something that shows a drive as it goes."""

    def update(self, frame: Any, fix: Fix, localizer: Localizer, latency_us: float) -> None:
        """Take one frame and its fix, right after the push.

        Parameters
        ----------
        frame : array or surefix.frames.Frame
            The image, the descriptor or the stream's frame that was pushed.
        fix : Fix
            The push's answer.
        localizer : Localizer
            Its newest distances are those of this frame.
        latency_us : float
            The duration of the push in microseconds.
        """

    def close(self) -> None:
        """Finish: what was shown stays, files are complete, the terminal is as it was. Calling it
        again does nothing.
        """


class Closing:
    """A view as a context that closes it."""

    def close(self) -> None:
        """As ``View.close``."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@dataclass(frozen=True, slots=True)
class Seen:
    """The parts of a frame that are shown, be it a plain array or a stream's frame."""

    name: str
    image: Image | None
    time: float | None
    dropped: int
    gap: bool

    @classmethod
    def of(cls, frame: Any, fix: Fix) -> "Seen":
        """A descriptor has no image; a frame without a name is called by its number. A name is
        plain text, on a console of the caller's, too.
        """
        pixels = getattr(frame, "image", frame)
        is_image = isinstance(pixels, np.ndarray) and pixels.dtype == np.uint8 and pixels.ndim >= 2
        return cls(
            name=plain(getattr(frame, "name", "") or str(fix.frame)),
            image=pixels if is_image else None,
            time=getattr(frame, "time", None),
            dropped=getattr(frame, "dropped", 0),
            gap=getattr(frame, "gap", False),
        )


class References:
    """The image of each place of a map.

    Parameters
    ----------
    map : Map
        Its ``names`` are file names.
    source : path or sequence of images, optional
        The folder of those files, or the images themselves. By default the map's thumbnails, else
        names are looked for as they are: a path, or a file in the working folder.

    Raises
    ------
    SurefixValueError
        If the given folder does not exist or has none of the map's images.
    """

    # A robot that stands or moves slowly asks for the same few places again and again.
    KEPT = 32

    def __init__(self, map: Map, source: str | Path | Images | None = None) -> None:
        self.names, self.levels = map.names, map.levels
        given = thumbnails_of(map) if source is None else source
        self.images: Images | None = None if isinstance(given, str | Path) else given
        self.folder = Path(source) if isinstance(source, str | Path) else Path()
        self.image = lru_cache(maxsize=self.KEPT)(self._image)
        if not isinstance(source, str | Path):
            return
        if not self.folder.is_dir():
            raise mismatch("references", "the folder of the map's images", self.folder)
        if not self:
            first = f"its first is {self.names[0]}" if self.names else "it has no names"
            raise mismatch("references", f"images of the map in {self.folder}", f"none: {first}")

    def __bool__(self) -> bool:
        """Whether there are any, going by the first and the last place."""
        return self.images is not None or (
            self.names is not None
            and any((self.folder / self.names[place]).is_file() for place in (0, -1))
        )

    def _image(self, place: int) -> Image | None:
        """The image of a place; None if there is none or it cannot be read."""
        if self.images is not None:
            try:
                return in_8_bits(self.images[place], self.levels)
            except KeyError:
                return None
        if not self.names:
            return None
        file = self.folder / self.names[place]
        try:
            return in_8_bits(read_image(file), self.levels) if file.is_file() else None
        except SurefixError:
            # A picture beside the answer is no reason to stop a robot.
            return None
