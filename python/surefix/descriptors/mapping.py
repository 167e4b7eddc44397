"""A map of images that a learned descriptor describes: what ``Map.from_images`` does with one."""

from os import PathLike
from typing import Any

from surefix._core import Map
from surefix.descriptors.extraction import Progress, extract
from surefix.descriptors.source import Source

__all__ = ["map_of_images"]


def map_of_images(
    images: Any,
    descriptor: Any,
    metric: str = "cosine",
    positions: Any = None,
    post: Any = None,
    cache: str | PathLike[str] | None = None,
    progress: Progress | None = None,
) -> Map:
    """The images described, post-processed, and named as their files are; the map keeps the descriptor's recipe."""
    rows = extract(images, descriptor, cache=cache, progress=progress)
    counted = hasattr(images, "__len__")
    names = [item.name for item in Source(images).items()] if counted or isinstance(images, PathLike) else None
    recipe = {**descriptor.recipe, "name": descriptor.name}
    return Map.from_descriptors(rows, metric, positions=positions, names=names, post=post, recipe=recipe)
