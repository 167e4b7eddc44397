"""Other techniques of the same places, for ``surefix eval --fuse``."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from surefix import Map
from surefix.cli.drives import Float32, describe, distances_of, networks_of, open_map
from surefix.cli.networks import ModelOptions, Network
from surefix.cli.route import is_matrix
from surefix.errors import mismatch
from surefix.frames import Frames
from surefix.tables.matrices import read_matrix


@dataclass(frozen=True)
class Technique:
    """Another technique's distances, or its map and the network of that."""

    ready: Float32 | None
    place_map: Map | None = None
    network: Network | None = None

    @classmethod
    def open(
        cls,
        file: str,
        places: int,
        count: int,
        frames: Frames | None,
        model: ModelOptions,
        similarity: bool,
    ) -> "Technique":
        if is_matrix(file):
            ready = read_matrix(file, similarity)
            if ready.shape != (places, count):
                raise mismatch(f"--fuse {file}", f"the shape {(places, count)}", ready.shape)
            return cls(ready)
        place_map = open_map(file)
        if len(place_map) != places:
            raise mismatch(f"--fuse {file}", f"a map of {places} places", len(place_map))
        if frames is None:
            raise mismatch(
                f"--fuse {file}", "a .npy of distances, as there are no QUERIES", "a map"
            )
        # Of several maps, those of learned descriptors are the model's.
        named = model if place_map.descriptor is None else ModelOptions()
        return cls(None, place_map, *networks_of([place_map], [file], named, frames))

    def distances(self, frames: Frames | None, bad: Collection[int] = ()) -> Float32:
        """Those to the queries, of which the ``bad`` ones are left out, in ``frames`` too."""
        if self.ready is not None:
            return np.delete(self.ready, [*bad], axis=1) if bad else self.ready
        assert self.place_map is not None
        assert frames is not None
        return distances_of(self.place_map, describe(self.place_map, frames, self.network))
