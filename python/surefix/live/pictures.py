"""Pictures small enough to be logged with every frame of a drive."""

import io
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from PIL import Image

__all__ = ["heat", "shrunk_jpeg"]

# A tone for each level of ``Columns.levels``: what is not there, then from far, dark as the
# viewer's paper, to near.
_STOPS = (1, 150, 225, 255)
_TONES = ((22, 42, 120, 255), (27, 82, 170, 250), (36, 118, 190, 225))
PALETTE = (
    np.array([np.interp(np.arange(256), _STOPS, tones) for tones in _TONES])
    .T.round()
    .astype(np.uint8)
)
PALETTE[0] = 13, 16, 20


def shrunk_jpeg(image: NDArray[np.uint8], widest: int) -> bytes:
    """A camera's image, no wider or higher than ``widest`` pixels, as a JPEG file."""
    from PIL import Image

    picture = Image.fromarray(np.ascontiguousarray(image))
    # Means of whole blocks: a finer resize takes longer than the rest of a view.
    picture = picture.reduce(max(1, -(-max(picture.size) // widest)))
    return _file(picture, "JPEG", quality=85)


def heat(levels: NDArray[np.uint8]) -> bytes:
    """Levels of nearness, 0 where there is none, in colours: a PNG file whose bytes are the
    levels.
    """
    from PIL import Image

    picture = Image.fromarray(levels)
    picture.putpalette(PALETTE.tobytes())
    return _file(picture, "PNG", compress_level=1)


def _file(picture: "Image.Image", form: str, **options: int) -> bytes:
    file = io.BytesIO()
    picture.save(file, form, **options)
    return file.getvalue()
