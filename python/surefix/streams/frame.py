"""One frame of a stream."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["Frame"]


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """An image of a stream, when it was taken, and what is missing before it.

    Attributes ---------- image : array of uint8, shape (H, W) grey or (H, W, 3) RGB From a file of
    ready descriptors, one of them: shape (dim,). time : float or None In seconds: since 1970 from a
    camera, a bag or a folder that grows, since the start from a video. None where nothing says.
    name : str A file's name, or the frame's number in its video, its topic or its array. dropped :
    int How many frames were lost between the one before and this one. gap : bool Whether time is
    missing before this frame: the drive does not go on from the frame before. breaks : bool Either
    of the two: the matcher is to be told, by ``Localizer.gap``.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.streams import Frame
    >>> Frame(np.zeros((4, 6), np.uint8), time=12.5, name="125", dropped=2)
    Frame('125', 4 x 6, time=12.5, dropped=2)
    """

    image: npt.NDArray[np.uint8]
    time: float | None
    name: str
    dropped: int = 0
    gap: bool = False

    @property
    def breaks(self) -> bool:
        """Whether the drive is broken before this frame: a gap, or dropped frames."""
        return self.gap or self.dropped > 0

    def __repr__(self) -> str:
        """In short: the pixels stay out."""
        parts = [repr(self.name), " x ".join(map(str, self.image.shape[:2]))]
        parts += [] if self.time is None else [f"time={self.time}"]
        parts += [f"dropped={self.dropped}"] if self.dropped else []
        parts += ["gap=True"] if self.gap else []
        return f"Frame({', '.join(parts)})"
