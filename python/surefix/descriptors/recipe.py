"""What a map remembers of the descriptor that made it, and whether another one gives the same
vectors.
"""

import json
from collections.abc import Mapping
from typing import Any

__all__ = ["recipe_of", "same_vectors"]

# What a file is called has no part in what it holds.
LABELS = ("name", "file")
CONTENT = "sha256"


def recipe_of(descriptor: Any) -> dict[str, Any]:
    """What a map says of the descriptor that made it."""
    return {**descriptor.recipe, "name": descriptor.name}


def same_vectors(one: Mapping[str, object], other: Mapping[str, object]) -> bool:
    """Whether two recipes are equal, but for the name of a file whose SHA-256 they both have."""
    first, second = (json.loads(json.dumps(dict(recipe))) for recipe in (one, other))
    if first == second:
        return True
    for recipe in (first, second):
        if CONTENT not in recipe:
            return False
        for label in LABELS:
            recipe.pop(label, None)
    return bool(first == second)
