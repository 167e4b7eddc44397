"""The actors that hold a map, for all drives that share them."""

import threading
from collections.abc import Iterable, Mapping
from os import PathLike
from typing import Any

from surefix._core import Map
from surefix._extra import require
from surefix._ray import Cluster
from surefix.distributed.actor import Holder
from surefix.distributed.errors import ShardError
from surefix.distributed.remote import Remote, one_line
from surefix.distributed.sources import joined, sources

__all__ = ["Held", "Where"]

Where = str | PathLike[str]


class Held:
    """A map, and its actors once a drive begins.

    Raises
    ------
    SurefixError
        If the map cannot be opened.
    """

    def __init__(
        self,
        given: Map | Where | Iterable[Where],
        shards: int,
        threads: int,
        options: dict[str, Any],
        ray_options: Mapping[str, Any],
    ) -> None:
        require("ray", "a ShardedLocalizer", "Ray", "surefix[ray]")
        self._files = [] if isinstance(given, Map) else sources(given)
        # As an actor has it: of the same bytes.
        whole = [Map.from_bytes(given.to_bytes())] if isinstance(given, Map) else []
        self.map = joined(whole or [file.open() for file in self._files])
        self.shards, self.threads = shards, threads
        self.options, self._ray_options = options, ray_options
        self.ray: Any = None
        self._whole: list[Any] = []
        self._actors: list[Any] = []
        # The drives so far, and those that are not over.
        self._count, self._drives = 0, 0
        self._lock = threading.Lock()

    @property
    def parts(self) -> int:
        """The parts that the map is cut into."""
        return self.shards * self.threads

    def drive(self) -> list[Remote]:
        """Begins a drive on the actors, which are made for the first one."""
        with self._lock:
            if not self._actors:
                self._start()
            number = self._count
            self._count, self._drives = self._count + 1, self._drives + 1
        remotes = [Remote(self.ray, actor, self._whole, number) for actor in self._actors]
        try:
            self.wait(remotes, [remote.open() for remote in remotes])
        except BaseException:
            self.end(remotes)
            raise
        return remotes

    def end(self, remotes: list[Remote]) -> None:
        """Ends a drive, and after the last one the actors."""
        with self._lock:
            self._drives -= 1
            if self._drives:
                for remote in remotes:
                    remote.forget()
                return
            actors, self._actors = self._actors, []
            for actor in actors if self.ray.is_initialized() else ():
                self.ray.kill(actor)

    def wait(self, remotes: list[Remote], calls: list[Any]) -> None:
        """Until each has opened its part of the map."""
        errors = self.ray.exceptions
        for index, (remote, call) in enumerate(zip(remotes, calls, strict=True)):
            try:
                self.ray.get(call)
            except errors.ActorUnavailableError:
                # It is brought back with the first query.
                remote.lost, remote.resuming = True, None
            except errors.RayError as error:
                where = f"shard {index} of {len(calls)}"
                raise ShardError(f"{where}: {one_line(error)}") from None

    def _start(self) -> None:
        # It stays joined: others in this process may use the cluster, too.
        self.ray = Cluster().ray
        files = [(file, file.identity()) for file in self._files]
        self._whole = [] if files else [self.ray.put(self.map)]
        given = {"num_cpus": 0, "scheduling_strategy": "SPREAD", **self._ray_options}
        holder = self.ray.remote(Holder).options(max_restarts=-1, max_task_retries=0, **given)
        count, each = self.parts, self.threads
        ranges = [range(first, first + each) for first in range(0, count, each)]
        self._actors = [holder.remote(files, parts, count, self.options) for parts in ranges]
