"""The protocol of a verifier: it compares a query with a few places once more."""

from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy.typing as npt

from surefix.errors import mismatch


@runtime_checkable
class Verifier(Protocol):
    """Compares a query with a few places more closely than a descriptor does, such as by local
    features.

    Any class with these two members is one. For ``Reranker.save`` it also has a ``recipe``, as a
    ``Descriptor`` has, and its features are NumPy arrays.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.descriptors import Verifier
    >>> class Rows:
    ...     def features(self, image):
    ...         return image.mean(axis=1)
    ...     def scores(self, query, places):
    ...         return [np.abs(query - place).mean() for place in places]
    >>> isinstance(Rows(), Verifier)
    True
    """

    def features(self, image: Any) -> Any:
        """What ``scores`` takes of an image: uint8 (H, W) or (H, W, 3), or a path if the verifier
        reads files.
        """
        ...

    def scores(self, query: Any, places: Sequence[Any]) -> npt.ArrayLike:
        """A finite number for each of some places, (k,), by their features and the query's.

        Smaller is better, as with distances.
        """
        ...


def require_verifier(thing: object) -> Verifier:
    """``thing``, if it is a verifier; the error names the missing members."""
    lacking = [member for member in ("features", "scores") if not hasattr(thing, member)]
    if lacking or not isinstance(thing, Verifier):
        got = f"{type(thing).__name__} without {' and '.join(lacking)}"
        raise mismatch("verifier", "an object with features and scores", got)
    return thing
