"""Errors of shards."""

from surefix.errors import SurefixError

__all__ = ["ShardDeadline", "ShardError"]


class ShardError(SurefixError):
    """A shard failed, and the query was refused. The message names the shard, the stage and the
    cause, and says whether the frame counts as taken.
    """


class ShardDeadline(ShardError):  # noqa: N818
    """A shard did not answer within the deadline."""
