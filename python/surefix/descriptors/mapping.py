"""Maps of images that a learned descriptor describes: what ``Map.from_images`` and ``Map.append``
do with one.
"""

from os import PathLike
from typing import Any

import numpy as np

from surefix._core import Map
from surefix.descriptors.extraction import Progress, extract
from surefix.descriptors.recipe import recipe_of, same_vectors
from surefix.descriptors.source import Source
from surefix.errors import SurefixValueError

__all__ = ["append_images", "map_of_images"]


def map_of_images(
    images: Any,
    descriptor: Any,
    metric: str = "cosine",
    positions: Any = None,
    post: Any = None,
    cache: str | PathLike[str] | None = None,
    progress: Progress | None = None,
) -> Map:
    """The images described, post-processed, and named as their files are; the map keeps the
    descriptor's recipe.
    """
    _check_positions(images, positions)
    rows = extract(images, descriptor, cache=cache, progress=progress)
    names = _names(images) if hasattr(images, "__len__") or isinstance(images, PathLike) else None
    recipe = recipe_of(descriptor)
    return Map.from_descriptors(
        rows, metric, positions=positions, names=names, post=post, recipe=recipe
    )


def append_images(
    path: Any,
    images: Any,
    descriptor: Any,
    positions: Any = None,
    cache: str | PathLike[str] | None = None,
    progress: Progress | None = None,
) -> None:
    """The map in the file made longer by images, described and post-processed as its own were.

    Where the map has names, the images are named as in ``map_of_images``; those that are but their
    numbers count on.
    """
    old = Map.open(path, mmap=True)
    # Before anything is described.
    _check_own(old, descriptor)
    _check_positions(images, positions)
    rows = extract(images, descriptor, cache=cache, progress=progress)
    names = None
    if old.names is not None:
        counted = hasattr(images, "__len__") or isinstance(images, PathLike)
        names = (
            _names(images, len(old))
            if counted
            else [str(len(old) + index) for index in range(len(rows))]
        )
    recipe = old.recipe or recipe_of(descriptor)
    more = Map.from_descriptors(
        rows, old.metric, positions=positions, names=names, post=old.post, recipe=recipe
    )
    del old
    Map.append(path, more)


def _check_own(route: Map, descriptor: Any) -> None:
    if route.descriptor is not None:
        raise SurefixValueError(
            f"descriptor: expected {route.descriptor!r}, as the map's own, got {descriptor.name!r}"
        )
    recipe = recipe_of(descriptor)
    if route.recipe is not None and not same_vectors(route.recipe, recipe):
        raise SurefixValueError(
            f"descriptor: expected the map's own, by the recipe {route.recipe}, got {recipe}"
        )


def _check_positions(images: Any, positions: Any) -> None:
    """What a network that has seen the whole drive would find refused, refused now, where the
    images can be counted.
    """
    if positions is not None and (count := Source(images).count) is not None:
        Map.from_descriptors(np.zeros((count, 1), np.float32), "euclidean", positions=positions)


def _names(images: Any, first: int = 0) -> list[str]:
    items = enumerate(Source(images).items())
    return [str(first + index) if item.name == str(index) else item.name for index, item in items]
