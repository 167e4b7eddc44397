"""A shard as the driver sees it: its actor, and the messages that bring it back."""

import re
import time
from typing import Any

from surefix import _core
from surefix.distributed.actor import GONE
from surefix.distributed.errors import ShardDeadline, ShardError

__all__ = ["LAST", "Deadline", "Message", "Remote", "Trip", "one_line"]

# The last trip, with which a frame is taken.
LAST = "second"

# Of a stage, to each part of a shard.
Message = tuple[str, list[bytes]]

# Seconds until an actor that is being restarted is asked again. If that is too soon, Ray waits for
# two seconds before it says so.
PAUSE = 0.25
# An answer of the same actor that fails as often is no accident.
FAILURES = 3


class Deadline:
    """A time, in seconds from when it was made."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._until = time.monotonic() + seconds

    def left(self) -> float:
        """The seconds that are left."""
        return max(self._until - time.monotonic(), 0.0)


class Remote:
    """An actor, its newest snapshot, and the messages since then."""

    def __init__(self, ray: Any, actor: Any, whole: list[Any], drive: int) -> None:
        self.ray, self.actor, self._whole, self._drive = ray, actor, whole, drive
        # In a list: Ray fetches arguments, but not what they hold.
        self._base: list[Any] = []
        self._since: list[Message] = []
        # A snapshot under way, whether it is done, and the length of `_since` at its time.
        self._coming: tuple[Any, Any, int] | None = None
        self._queries = 0
        # Whether it must be brought back before it is asked, and the call that does.
        self.lost = False
        self.resuming: Any = None

    def open(self) -> Any:
        """Opens its part of the map."""
        return self.actor.open.remote(self._drive, _core.__version__, self._whole)

    def ask(self, message: Message) -> Any:
        """Sends it a message of the query."""
        return self.actor.ask.remote(self._drive, *message)

    def forget(self) -> None:
        """Says that the drive is over."""
        self.actor.forget.remote(self._drive)

    def resume(self) -> Any:
        """Brings it to the state after all queries so far, if that is not under way."""
        if self.resuming is None:
            self.resuming = self.actor.resume.remote(
                self._drive, _core.__version__, self._whole, self._base, self._since
            )
        return self.resuming

    def commit(self, sent: list[Message], every: int) -> None:
        """These messages were a whole query. Each ``every`` of them, a snapshot is taken."""
        self._since += sent
        self._queries += 1
        self._settle()
        if self._queries % every == 0 and self._coming is None:
            blob, done = self.actor.saved.options(num_returns=2).remote(self._drive)
            self._coming = blob, done, len(self._since)

    def rewind(self, base: list[Any]) -> None:
        """To the state of this snapshot, or to that before the first query."""
        self._base, self._since, self._coming = base, [], None
        self.lost, self.resuming = True, None

    def _settle(self) -> None:
        """Counts from the snapshot under way once it is there."""
        if self._coming is None:
            return
        blob, done, length = self._coming
        if not self.ray.wait([done], timeout=0)[0]:
            return
        self._coming = None
        try:
            self.ray.get(done)
        except self.ray.exceptions.RayError:
            # Its actor has died: the next one will do.
            return
        self._base, self._since = [blob], self._since[length:]


class Trip:
    """A message to each shard, and their answers. A trip that a deadline has cut can go on."""

    def __init__(
        self, remotes: list[Remote], stage: str, parts: list[bytes], sent: list[list[Message]]
    ) -> None:
        self.stage, self._remotes = stage, remotes
        each = len(parts) // len(remotes)
        messages = [parts[each * index :][:each] for index in range(len(remotes))]
        # Those of the query to each shard; one that is brought back is asked all of them.
        self.messages = [[*s, (stage, m)] for s, m in zip(sent, messages, strict=True)]
        self._next: list[list[Message]] = [[(stage, message)] for message in messages]
        self._answers: list[list[bytes]] = [[] for _ in remotes]
        self._failures = [0] * len(remotes)
        self._unsent = set(range(len(remotes)))
        # By the reference of a call: the shard, and whether it is brought back.
        self._waiting: dict[Any, tuple[int, bool]] = {}

    def run(self, deadline: Deadline) -> list[bytes]:
        """The answers of all parts.

        Raises
        ------
        ShardError
            If a shard can neither answer nor be brought back.
        """
        ray = self._remotes[0].ray
        while self._unsent or self._waiting:
            for index in sorted(self._unsent):
                self._send(index)
            refs = list(self._waiting)
            if not ray.wait(refs, timeout=deadline.left())[0]:
                raise self._late(deadline.seconds)
            for ref in ray.wait(refs, num_returns=len(refs), timeout=0)[0]:
                self._take(ref)
        return [answer for answers in self._answers for answer in answers]

    def _send(self, index: int) -> None:
        remote = self._remotes[index]
        if remote.lost:
            self._next[index] = list(self.messages[index])
            self._waiting[remote.resume()] = index, True
        else:
            self._waiting[remote.ask(self._next[index][0])] = index, False
        self._unsent.discard(index)

    def _take(self, ref: Any) -> None:
        index, resumed = self._waiting.pop(ref)
        remote, errors = self._remotes[index], self._remotes[index].ray.exceptions
        self._unsent.add(index)
        try:
            answer = remote.ray.get(ref)
        except errors.RayError as error:
            remote.lost, remote.resuming = True, None
            if isinstance(error, errors.ActorUnavailableError):
                time.sleep(PAUSE)
                return
            self._failures[index] += 1
            died = not isinstance(error, errors.RayTaskError)
            if resumed or died or self._failures[index] == FAILURES:
                raise ShardError(self._said(index, one_line(error))) from None
            return
        if resumed:
            remote.resuming = None
            if answer == GONE:
                remote.lost = True
                what = "its node was lost with its newest snapshot"
                raise ShardError(f"shard {index} of {len(self._remotes)}: {what}: call reset()")
            remote.lost = False
        elif answer is None:
            remote.lost = True
        else:
            self._next[index].pop(0)
            if not self._next[index]:
                self._answers[index] = answer
                self._unsent.discard(index)

    def _late(self, seconds: float) -> ShardDeadline:
        index, resumed = min(self._waiting.values())
        what = "was not brought back" if resumed else "did not answer"
        return ShardDeadline(self._said(index, f"{what} within {seconds:g} s"))

    def _said(self, index: int, what: str) -> str:
        taken = "the frame counts as taken, and the next call ends it"
        after = taken if self.stage == LAST else "nothing has changed"
        return f"shard {index} of {len(self._remotes)}, {self.stage} trip: {what}; {after}"


def one_line(error: Exception) -> str:
    """The cause of an error that Ray raises, without the worker's traceback."""
    cause = getattr(error, "cause", None) or error
    lines = [line.strip() for line in str(cause).splitlines() if line.strip()]
    if not lines:
        return type(cause).__name__
    # Of an actor that could not be made, the traceback is the text.
    return re.sub(r"\x1b\[\d*m", "", lines["creation task" in lines[0] and -1])
