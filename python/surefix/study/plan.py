"""A study: routes, descriptors, settings and methods, each with each."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from surefix.baselines import METHODS
from surefix.judged import Recall
from surefix.motion import Motion

__all__ = ["Evaluation", "Plan", "Table"]

NONE = "none"
# In the names of files, it stands for the route's.
ROUTE_NAME = "{route}"


class Table(NamedTuple):
    """A route or a descriptor: its name, and what the file says of it."""

    name: str
    given: dict[str, Any]


class Evaluation(NamedTuple):
    """One row of the results."""

    route: Table
    descriptor: Table
    settings: dict[str, Any]
    method: str

    def file(self, key: str) -> str | None:
        """A file of the descriptor, or else of the route."""
        found = self.descriptor.given.get(key, self.route.given.get(key))
        return None if found is None else found.replace(ROUTE_NAME, self.route.name)

    @property
    def options(self) -> dict[str, Any]:
        """The settings as a context takes them."""
        motion = self.settings.get("motion")
        found = {**self.settings}
        if motion is not None:
            found["motion"] = Motion(**motion) if isinstance(motion, dict) else motion
        return found


@dataclass(frozen=True)
class Plan:
    """What a study evaluates.

    Attributes
    ----------
    routes, descriptors : list of Table
    settings : dict of str to list
        The values of each setting.
    methods : list of str
    recall, upto, samples
        As for ``surefix.compare``.
    """

    path: Path
    routes: list[Table]
    descriptors: list[Table]
    settings: dict[str, list[Any]] = field(default_factory=dict)
    methods: list[str] = field(default_factory=lambda: ["weighted"])
    recall: Recall = "correct"
    upto: float = 0.2
    samples: int = 1000

    def __iter__(self) -> Iterator[Evaluation]:
        """Each evaluation once, those of one route and descriptor one after the other."""
        grid = [dict(zip(self.settings, each, strict=True)) for each in self._grid()]
        for route, descriptor in product(self.routes, self.descriptors):
            seen = set()
            for settings, method in product(grid, self.methods):
                moving = METHODS[method].needs == "motion"
                own = {k: v for k, v in settings.items() if v != NONE}
                if moving and "motion" not in own:
                    continue
                if not moving:
                    own.pop("motion", None)
                known = json.dumps([own, method], sort_keys=True)
                if known not in seen:
                    seen.add(known)
                    yield Evaluation(route, descriptor, own, method)

    def _grid(self) -> Iterator[tuple[Any, ...]]:
        return product(*self.settings.values())
