"""Memory follows what was read, never what a file claims: each row of the table runs in a process
that may take 256 MiB more than it had, and 10 seconds of processor.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hostile_row import COMMAND, Row
from hostile_table import ROWS

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="the limit is one of Linux"
)

# One thread a library: each has its own stack, and would count.
ALONE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"), "1")


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """What each row gave, all by one process that forks."""
    command = [
        sys.executable,
        Path(__file__).with_name("hostile_runner.py"),
        tmp_path_factory.mktemp("hostile"),
    ]
    here = os.pathsep.join(path for path in sys.path if path)
    done = subprocess.run(
        [*map(str, command)],
        capture_output=True,
        text=True,
        env=os.environ | ALONE | {"PYTHONPATH": here},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    lines = map(json.loads, done.stdout.splitlines())
    return {line["name"]: line for line in lines}


def test_the_table_is_long_and_names_each_row_once() -> None:
    names = [row.name for row in ROWS]
    assert len(names) >= 100
    assert sorted({*names}) == sorted(names)


@pytest.mark.parametrize("row", ROWS, ids=[row.name for row in ROWS])
def test_a_hostile_input_gets_its_error(row: Row, answers: dict[str, dict[str, Any]]) -> None:
    got = answers[row.name]
    if got.get("missing"):
        pytest.skip(f"without {', '.join(got['missing'])}")
    if not row.error:
        assert got["classes"] == [], got
        return
    assert row.error in got["classes"], got
    assert re.search(row.text, got["text"], re.DOTALL), got
    assert got["length"] < 2000, "a message is to be read"
    if row.error == COMMAND:
        assert got["code"] in (1, 2), got
        assert "Traceback" not in got["text"], got
        if got["code"] == 1:
            assert re.fullmatch("surefix: [^\n]+\n", got["text"]), got
