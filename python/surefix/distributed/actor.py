"""The part of a map that one Ray actor holds, for one drive or several."""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from surefix import _core
from surefix._core import Map
from surefix.distributed.sources import Source, joined, places_of
from surefix.errors import SurefixError

__all__ = ["GONE", "Holder"]

# An answer of ``resume``: the node that had the snapshot is gone.
GONE = "gone"


class Holder:
    """An actor. A new one, and one that Ray has restarted, knows nothing of a drive's earlier
    queries until ``resume``.

    Parameters
    ----------
    files : list of (Source, str)
        The map's files, with their identities; none for a map in Ray's object store.
    parts : range
        Its parts, of all ``count`` of the map: each is worked on by a thread.
    options : dict
        Of the method.
    """

    def __init__(
        self,
        files: list[tuple[Source, str]],
        parts: range,
        count: int,
        options: dict[str, Any],
    ) -> None:
        self._files, self._parts, self._count, self._options = files, parts, count, options
        self._threads = ThreadPoolExecutor(len(parts)) if len(parts) > 1 else None
        self._map: Map | None = None
        # By the drive: a shard for each part.
        self._shards: dict[int, list[Any]] = {}

    def open(self, drive: int, version: str, whole: list[Any]) -> None:
        """Opens the map and its own rows, before the first query of a drive.

        Parameters
        ----------
        drive : int
            Its number.
        version : str
            Of surefix on the driver.
        whole : list of ObjectRef
            The map itself, if there are no files. In a list, so that Ray does not fetch it.

        Raises
        ------
        SurefixError
            If the worker has another version of surefix, or the file is another one.
        """
        if version != _core.__version__:
            expected = f"expected surefix {version} as on the driver"
            raise SurefixError(f"{expected}, got {_core.__version__} on a worker")
        if self._map is None:
            self._map = self._opened(whole)
        self._shards[drive] = self._fresh(self._map)

    def ask(self, drive: int, stage: str, messages: list[bytes]) -> list[bytes] | None:
        """Answers the driver's messages, one for each part; None if it knows nothing of earlier
        queries.
        """
        if drive not in self._shards:
            return None
        if stage == "snapshot":
            return self.saved(drive)[0]
        return self._answers(self._shards[drive], stage, messages)

    def resume(
        self,
        drive: int,
        version: str,
        whole: list[Any],
        base: list[Any],
        replay: list[tuple[str, list[bytes]]],
    ) -> str | None:
        """Comes to the state after these messages, the first of which followed on the snapshot.

        Returns
        -------
        str or None
            ``GONE`` if the snapshot is lost.
        """
        import ray

        self.open(drive, version, whole)
        # They are asked nothing unless all goes well.
        shards = self._shards.pop(drive)
        if base:
            try:
                blobs = ray.get(base[0])
            except ray.exceptions.ObjectLostError:
                return GONE
            for shard, blob in zip(shards, blobs, strict=True):
                shard.restore(blob)
        for stage, messages in replay:
            self._answers(shards, stage, messages)
        self._shards[drive] = shards
        return None

    def saved(self, drive: int) -> tuple[list[bytes], bool]:
        """The state after the queries so far, and that it is there."""
        if drive not in self._shards:
            raise SurefixError("restarted before its snapshot")
        return [shard.snapshot() for shard in self._shards[drive]], True

    def forget(self, drive: int) -> None:
        """Drops what it holds for a drive."""
        self._shards.pop(drive, None)

    def process(self) -> int:
        """The number of its process."""
        return os.getpid()

    def _opened(self, whole: list[Any]) -> Map:
        if not self._files:
            import ray

            route: Map = ray.get(whole[0])
            return route
        for source, identity in self._files:
            if source.identity() != identity:
                raise SurefixError(f"{source.name}: not the file that the driver opened")
        # Which rows it needs, it knows once the rest is open.
        maps = [source.open() for source, _ in self._files]
        rows = [span for shard in self._fresh(joined(maps)) for span in shard.rows()]
        needed = places_of(map(len, maps), rows)
        pairs = zip(self._files, needed, strict=True)
        return joined([source.open(places) for (source, _), places in pairs])

    def _fresh(self, route: Map) -> list[Any]:
        return [_core.Shard(route, part, self._count, **self._options) for part in self._parts]

    def _answers(self, shards: list[Any], stage: str, messages: list[bytes]) -> list[bytes]:
        each: Callable[..., Iterable[bytes]] = self._threads.map if self._threads else map
        return list(each(lambda shard, said: getattr(shard, stage)(said), shards, messages))
