"""``ShardedLocalizer``: the driver."""

import struct
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from copy import copy
from os import PathLike
from typing import Any, Self, cast

from surefix import _core
from surefix._core import Fix, Map, Settings
from surefix.distributed.held import Held, Where
from surefix.distributed.remote import LAST, Deadline, Message, Trip
from surefix.errors import SurefixError, mismatch

__all__ = ["ShardedLocalizer"]

# Of a snapshot: this, the number of shards, and the lengths of the parts, the driver's first.
MAGIC = b"surefix-shards-1"


class ShardedLocalizer:
    """A ``Localizer`` whose map lies in Ray actors, each with a range of places: the same fixes to
    the last bit, for maps beyond one machine.

    Parameters
    ----------
    map : Map, path, URL, or several paths and URLs
        The map's file, which every worker finds under the same name and maps into memory; or a URL
        for fsspec (``s3://bucket/city.safetensors``), of which a worker fetches its own rows.
        Several files are joined (``Map.join``). A ``Map`` is copied to every actor: only small
        ones.
    shards : int
        The number of actors: about one for each machine.
    threads : int
        Of each actor, which has as many parts of the map. At most one for each 4,096 places.
    deadline : float
        Seconds that ``push`` waits for the shards, restarts of theirs among them.
    snapshot_every : int
        The queries after which each shard's state is saved in Ray's object store. One that dies is
        brought back from there, and sees the queries since then again.
    ray_options : mapping, optional
        For each actor, beside ``{"num_cpus": 0, "scheduling_strategy": "SPREAD"}``: with
        ``{"num_cpus": 1}`` a cluster that scales by itself grows for them.
    descriptor
        As for ``Localizer``.
    **options
        As for ``Localizer``.

    Raises
    ------
    SurefixError
        If there is no Ray or no cluster, or a worker lacks the file, has another file or another
        version of surefix.
    SurefixValueError
        For an option outside its range, or more shards than blocks of 4,096 places.

    Examples
    --------
    >>> import surefix
    >>> from surefix.distributed import ShardedLocalizer
    >>> with ShardedLocalizer("city.safetensors", shards=8, motion="any") as city:  # doctest: +SKIP
    ...     for image in camera:
    ...         fix = city.push(image)
    """

    def __init__(
        self,
        map: Map | Where | Iterable[Where],
        *,
        shards: int = 8,
        threads: int = 1,
        deadline: float = 30.0,
        snapshot_every: int = 16,
        ray_options: Mapping[str, Any] | None = None,
        descriptor: Any = None,
        **options: Any,
    ) -> None:
        counts = {"shards": shards, "threads": threads, "snapshot_every": snapshot_every}
        for name, number in counts.items():
            if not isinstance(number, int) or number < 1:
                raise mismatch(name, "a whole number of 1 or more", repr(number))
        if not deadline > 0:
            raise mismatch("deadline", "seconds above 0", repr(deadline))
        config = options.get("config")
        if isinstance(config, (str, PathLike)):
            options["config"] = Settings.open(config)
        self._deadline, self._every, self._descriptor = float(deadline), snapshot_every, descriptor
        self._begin(Held(map, shards, threads, options, ray_options or {}))

    def _begin(self, held: Held) -> None:
        self._held = held
        self._busy = threading.Lock()
        self._anew()
        self._remotes = held.drive()

    def _anew(self) -> None:
        # The last trip of a frame that is taken.
        self._last: Trip | None = None
        given = {"descriptor": self._descriptor, **self._held.options}
        self._driver = _core.ShardDriver(self._held.map, self._held.parts, **given)

    def another(self) -> "ShardedLocalizer":
        """A localizer for another drive on the same shards, such as that of another robot. Each may
        have a thread of its own.
        """
        with self._alone():
            new = copy(self)
            new._begin(self._held)
            return new

    def push(self, frame: Any, trusted: bool | None = None, advance: float | None = None) -> Fix:
        """Takes one camera frame, and says where the robot is, as ``Localizer.push``.

        Raises
        ------
        ShardDeadline
            If a shard does not answer within the deadline.
        ShardError
            If a shard can neither answer nor be brought back. After both, either nothing has
            changed anywhere, or the frame counts as taken and the next call ends it: the message
            says which. ``finish`` gives its fix.
        SurefixValueError
            As for ``Localizer.push``; the localizer is then as it was.
        """
        with self._alone() as deadline:
            self._finish(deadline)
            stage, messages = self._driver.push(frame, advance=advance, trusted=trusted)
            sent: list[list[Message]] = [[] for _ in self._remotes]
            try:
                while stage != LAST:
                    trip = Trip(self._remotes, stage, messages, sent)
                    asked = self._driver.answer(trip.run(deadline))
                    stage, messages = cast("tuple[Any, list[bytes]]", asked)
                    sent = trip.messages
            except BaseException:
                with suppress(SurefixError):
                    self._driver.abandon()
                raise
            self._last = Trip(self._remotes, stage, messages, sent)
            fix = self._finish(deadline)
            assert fix is not None
            return fix

    def finish(self) -> Fix | None:
        """The fix of a frame that was taken, but whose ``push`` a deadline had cut; None if there
        is none. The next ``push`` does the same, and drops it.

        Raises
        ------
        ShardError
            As for ``push``.
        """
        with self._alone() as deadline:
            return self._finish(deadline)

    def gap(self, advance: float | None = None) -> None:
        """As ``Localizer.gap``."""
        with self._alone() as deadline:
            self._finish(deadline)
            self._driver.gap(advance)

    def reset(self) -> None:
        """Forgets all frames: the next one is frame 0. It works even if a shard's state is lost."""
        with self._alone():
            # The driver refuses it within a query, which may never come to its end.
            self._anew()
            for remote in self._remotes:
                remote.rewind([])

    def snapshot(self) -> bytes:
        """The state as bytes, without the map; ``restore`` goes on from it bit-identically."""
        with self._alone() as deadline:
            self._finish(deadline)
            nothing = [b""] * self._held.parts
            trip = Trip(self._remotes, "snapshot", nothing, [[] for _ in self._remotes])
            parts = [self._driver.snapshot(), *trip.run(deadline)]
            lengths = struct.pack(f"<I{len(parts)}Q", len(parts), *map(len, parts))
            return b"".join([MAGIC, lengths, *parts])

    @classmethod
    def restore(
        cls, map: Map | Where | Iterable[Where], blob: bytes, **options: Any
    ) -> "ShardedLocalizer":
        """A localizer that goes on where the snapshot was taken, with as many shards.

        Parameters
        ----------
        map
            The map that it was taken on.
        blob : bytes
            From ``snapshot``.
        **options
            As for ``ShardedLocalizer``; ``threads`` and those of the method as they were.

        Raises
        ------
        SurefixValueError
            If the bytes are damaged, or of another map or other options.
        """
        first, *rest = _parts(blob)
        threads = options.get("threads", 1)
        if not isinstance(threads, int) or threads < 1 or len(rest) % threads:
            raise mismatch("threads", f"those of a snapshot of {len(rest)} parts", repr(threads))
        new = cls(map, shards=len(rest) // threads, **options)
        try:
            new._driver.restore(first)
            for index, remote in enumerate(new._remotes):
                remote.rewind([new._held.ray.put(rest[index * threads :][:threads])])
            new._held.wait(new._remotes, [remote.resume() for remote in new._remotes])
        except BaseException:
            new.close()
            raise
        return new

    def close(self) -> None:
        """Ends the drive; with the last one on its shards, the actors."""
        remotes, self._remotes = self._remotes, []
        if remotes:
            self._held.end(remotes)

    @property
    def map(self) -> Map:
        """The map, as the driver opened it. Of a URL, rows are zeros."""
        return self._held.map

    @property
    def shards(self) -> int:
        """The number of shards; 0 once it is closed."""
        return len(self._remotes)

    @property
    def frames(self) -> int:
        """The number of frames taken."""
        return int(self._driver.frames) + (self._last is not None)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"ShardedLocalizer({self.map}, shards={self.shards}, frames={self.frames})"

    @contextmanager
    def _alone(self) -> Iterator[Deadline]:
        if not self._busy.acquire(blocking=False):
            raise SurefixError("ShardedLocalizer: in use by another thread: give each its own")
        try:
            if not self._remotes:
                raise SurefixError("ShardedLocalizer: it is closed")
            yield Deadline(self._deadline)
        finally:
            self._busy.release()

    def _finish(self, deadline: Deadline) -> Fix | None:
        """Ends the last trip of a frame that is taken."""
        if self._last is None:
            return None
        fix = cast("Fix", self._driver.answer(self._last.run(deadline)))
        for remote, messages in zip(self._remotes, self._last.messages, strict=True):
            remote.commit(messages, self._every)
        self._last = None
        return fix


def _parts(blob: bytes) -> list[bytes]:
    """The parts of a snapshot, the driver's first."""
    start = len(MAGIC) + 4
    try:
        if blob[: len(MAGIC)] != MAGIC:
            raise ValueError
        (count,) = struct.unpack_from("<I", blob, len(MAGIC))
        lengths = struct.unpack_from(f"<{count}Q", blob, start)
        start += 8 * count
        if count < 2 or start + sum(lengths) != len(blob):
            raise ValueError
    except (ValueError, struct.error):
        raise mismatch("snapshot", "bytes of ShardedLocalizer.snapshot", "others") from None
    ends = [start + sum(lengths[: index + 1]) for index in range(count)]
    return [blob[end - length : end] for end, length in zip(ends, lengths, strict=True)]
