"""Gardens Point Walking: a campus by day on the left and right of the path, and by night."""

from os import PathLike
from pathlib import Path

from surefix.datasets.pair import Origin, Pair, same_places
from surefix.errors import mismatch
from surefix.frames.images import Images, open_images

TRAVERSES = ("day_left", "day_right", "night_right")
GARDENS_POINT = Origin(
    "Gardens Point Walking",
    "https://zenodo.org/record/4590133 (A. Glover, Queensland University of Technology)",
    "stated on that page; not established by surefix",
    signs=TRAVERSES,
)


def gardens_point(
    root: str | PathLike[str], *, reference: str = "day_left", query: str = "day_right"
) -> Pair:
    """Two walks of Gardens Point Walking. Query ``i`` shows the place of reference ``i``.

    Layout::

        root/day_left/Image000.jpg, Image001.jpg ...
        root/day_right/...
        root/night_right/...

    The publisher has 200 images a walk; any number is taken, with the same names in both.

    Parameters
    ----------
    root : str or path
    reference, query : {"day_left", "day_right", "night_right"}

    Returns
    -------
    Pair
        With the identity as the truth, and no positions.

    Raises
    ------
    SurefixFileError
        For a walk that is missing.
    SurefixValueError
        For an unknown walk, one without images, or an image that only one of the two has.
    """
    for option, traverse in (("reference", reference), ("query", query)):
        if traverse not in TRAVERSES:
            raise mismatch(option, f"one of {', '.join(TRAVERSES)}", repr(traverse))
    name = f"Gardens Point {reference} / {query}"
    return same_places(name, GARDENS_POINT, _walk(root, reference), _walk(root, query))


def walks(root: Path) -> list[str]:
    """The walks that exist, by day on the left first."""
    return [walk for walk in TRAVERSES if (root / walk).is_dir()]


def _walk(root: str | PathLike[str], traverse: str) -> Images:
    GARDENS_POINT.folder(root, "with the folders day_left, day_right, night_right")
    purpose = f"the images of the walk {traverse}"
    return open_images(GARDENS_POINT.folder(Path(root) / traverse, purpose))
