"""Post-processing of learned descriptors: fitted on the references, kept in the map, applied to
each query.

>>> import numpy as np, surefix
>>> from surefix.post import Normalize, Pca, Standardize
>>> raw = np.random.default_rng(0).standard_normal((100, 64), np.float32)
>>> route = surefix.Map.from_descriptors(raw, post=[Standardize(), Pca(16), Normalize()])
>>> route.dim, route.input_dim
(16, 64)
>>> surefix.Localizer(route).push(raw[7]).place     # a vector as it comes from the network
7
"""

import json
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt

from surefix._core import Post, Running, fit_post
from surefix.errors import mismatch

__all__ = [
    "Normalize",
    "Pca",
    "Post",
    "RandomProjection",
    "Running",
    "Standardize",
    "Step",
    "as_json",
    "fit",
    "standardized",
]


@dataclass(frozen=True, slots=True)
class Standardize:
    """Each dimension less its mean over the references, divided by its population standard
    deviation. A dimension that is the same in all references becomes 0.

    Parameters
    ----------
    statistics : "references" or "running"
        The statistics for queries: those of the references; or those of the drive's queries so far,
        the newest included, which begin with the references' as if these were one query. With
        "running", a ``Localizer`` keeps the drive's, in its snapshots too, until ``reset``, and
        ``match`` takes its queries as one drive. The references always have their own.
    """

    statistics: Literal["references", "running"] = "references"
    step: ClassVar[str] = "standardize"


@dataclass(frozen=True, slots=True)
class Pca:
    """The coordinates along the ``dim`` directions in which the references differ most, whitened by
    default, as of scikit-learn's ``PCA(dim, whiten=True)``. ``dim`` must be below the number of
    references.
    """

    dim: int
    whiten: bool = True
    step: ClassVar[str] = "pca"


@dataclass(frozen=True, slots=True)
class Normalize:
    """Scales to length 1; zeros, which have no direction, stay zeros."""

    step: ClassVar[str] = "normalize"


@dataclass(frozen=True, slots=True)
class RandomProjection:
    """The products with ``dim`` vectors of random signs, divided by ``sqrt(dim)``, which preserve
    distances approximately: Achlioptas, *Database-friendly random projections*, 2003. The same
    ``seed`` gives the same signs everywhere.
    """

    dim: int
    seed: int = 0
    step: ClassVar[str] = "projection"


Step = Standardize | Pca | Normalize | RandomProjection


def fit(references: Any, steps: Iterable[Step]) -> Post:
    """A chain of steps, each fitted on the references as the steps before it leave them.

    Parameters
    ----------
    references : array of float32, shape (n, dim)
    steps : iterable of Standardize, Pca, Normalize and RandomProjection

    Raises
    ------
    SurefixValueError
        For references of another shape or type, fewer than two, a NaN or an infinity; for more
        principal components than they span.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.post import Standardize, fit
    >>> fit(np.float32([[1, 5], [3, 5]]), [Standardize()]).apply(np.float32([5, 5]))
    array([3., 0.], dtype=float32)
    """
    return fit_post(references, as_json(steps))[0]


def standardized(rows: Any) -> npt.NDArray[np.float32]:
    """Rows standardised by their own statistics: for a whole drive that is known before matching.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.post import standardized
    >>> standardized(np.float32([[1, 5], [3, 5]]))
    array([[-1.,  0.],
           [ 1.,  0.]], dtype=float32)
    """
    return fit_post(rows, as_json([Standardize()]))[1]


def as_json(steps: Any) -> str:
    """The steps as the core reads them."""
    listed = [steps] if isinstance(steps, Step) else list(steps)
    for step in listed:
        if not isinstance(step, Step):
            expected = "steps such as Standardize(), Pca(512), RandomProjection(512), Normalize()"
            raise mismatch("post", expected, repr(step))
        for name, value in asdict(step).items():
            expected, fits = _EXPECTED[name]
            if not fits(value):
                where = f"post: {type(step).__name__}"
                raise mismatch(where, f"{name} to be {expected}", repr(value))
    # NumPy's numbers as Python's.
    return json.dumps([_plain(step) for step in listed], default=lambda number: number.item())


def _plain(step: Step) -> dict[str, Any]:
    if isinstance(step, Standardize):
        return {"step": step.step if step.statistics == "references" else f"{step.step}_running"}
    return {"step": step.step, **asdict(step)}


def _is_whole(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        return False
    return 0 <= int(value) < 2**63


# The values of each field of a step.
_EXPECTED: dict[str, tuple[str, Callable[[object], bool]]] = {
    "statistics": ('"references" or "running"', lambda value: value in ("references", "running")),
    "whiten": ("True or False", lambda value: isinstance(value, (bool, np.bool_))),
    "dim": ("a whole number", _is_whole),
    "seed": ("a whole number", _is_whole),
}
