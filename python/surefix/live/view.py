"""What a view is: something that is shown each frame with its fix."""

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from surefix import Fix, Localizer

__all__ = ["Seen", "View"]


@runtime_checkable
class View(Protocol):
    """Something that shows a drive as it goes."""

    def update(self, frame: Any, fix: Fix, localizer: Localizer, latency_us: float) -> None:
        """Take one frame and its fix, right after the push.

        Parameters
        ----------
        frame : array or surefix.frames.Frame
            What was pushed: an image, a descriptor, or a stream's frame.
        fix : Fix
            What the push gave.
        localizer : Localizer
            What was pushed to. Its newest distances are those of this frame.
        latency_us : float
            How long the push took, in microseconds.
        """

    def close(self) -> None:
        """Finish: what was shown stays, files are complete, the terminal is as it was. Once more
        does nothing.
        """


@dataclass(frozen=True, slots=True)
class Seen:
    """What there is to show of a frame, be it a plain array or a stream's frame."""

    name: str
    image: NDArray[np.uint8] | None
    time: float | None
    dropped: int
    gap: bool

    @classmethod
    def of(cls, frame: Any, fix: Fix) -> "Seen":
        """Look at a frame. A descriptor has no image; a frame without a name is called by its
        number.
        """
        pixels = getattr(frame, "image", frame)
        is_image = isinstance(pixels, np.ndarray) and pixels.dtype == np.uint8 and pixels.ndim >= 2
        return cls(
            name=getattr(frame, "name", "") or str(fix.frame),
            image=pixels if is_image else None,
            time=getattr(frame, "time", None),
            dropped=getattr(frame, "dropped", 0),
            gap=getattr(frame, "gap", False),
        )
