"""The folder of the real traverses, if this machine has them: they are not ours to publish."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


def folder() -> Path:
    """`SUREFIX_DATA`, or the first `shared/data` above this file; a skip if there is neither."""
    named = os.environ.get("SUREFIX_DATA")
    if named is not None:
        if not Path(named).is_dir():
            pytest.fail(f"SUREFIX_DATA={named} is not a folder")
        return Path(named)
    for parent in Path(__file__).resolve().parents:
        if (parent / "shared" / "data").is_dir():
            return parent / "shared" / "data"
    pytest.skip("real data is missing: no ../shared/data beside the repository, no SUREFIX_DATA")
