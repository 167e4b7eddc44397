"""Localization on maps beyond one machine, on Ray: ``pip install "surefix[ray]"``."""

from surefix.distributed.errors import ShardDeadline, ShardError
from surefix.distributed.localizer import ShardedLocalizer

__all__ = ["ShardDeadline", "ShardError", "ShardedLocalizer"]
