"""A recording read back, by rerun's own reader."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image


class Recording:
    """The logged values, by entity and frame."""

    def __init__(self, path: Path) -> None:
        from rerun.chunk import RrdReader

        reader = RrdReader(path)
        (self.blueprint,) = reader.blueprints()
        self.layout = [
            chunk.to_record_batch().to_pylist() for chunk in reader.stream(store=self.blueprint)
        ]
        self.static: dict[str, dict[str, Any]] = {}
        self.logged: dict[str, dict[int, dict[str, Any]]] = {}
        for chunk in reader.stream():
            for row in chunk.to_record_batch().to_pylist():
                entity = chunk.entity_path.lstrip("/")
                if chunk.is_static:
                    self.static.setdefault(entity, {}).update(row)
                else:
                    # An entity may be logged in several parts.
                    self.logged.setdefault(entity, {}).setdefault(row["frame"], {}).update(row)

    def column(self, entity: str, component: str) -> dict[int, Any]:
        """One component of an entity, by frame."""
        return {frame: row[component] for frame, row in sorted(self.logged.get(entity, {}).items())}

    def scalars(self, entity: str) -> dict[int, float]:
        """A curve, by frame."""
        return {frame: value for frame, (value,) in self.column(entity, "Scalars:scalars").items()}

    def bars(self, entity: str, frame: int, component: str = "values") -> NDArray[np.float64]:
        """The heights of a bar chart, or the positions of its bars."""
        (tensor,) = self.logged[entity][frame][f"BarChart:{component}"]
        return np.array(tensor["buffer"])

    def picture(self, entity: str, frame: int) -> Image.Image:
        """An image, decoded."""
        (blob,) = self.logged[entity][frame]["EncodedImage:blob"]
        return Image.open(io.BytesIO(bytes(blob)))

    def points(self, entity: str, frame: int, kind: str = "Points2D") -> NDArray[np.float32]:
        """The positions of points."""
        return np.array(self.logged[entity][frame][f"{kind}:positions"], np.float32)
