"""``surefix bench``: the rows that it prints, its options, and its refusals."""

import re
from pathlib import Path

import numpy as np
import pytest

from commands import surefix_
from surefix import Map
from surefix.cli.bench import memory_speed, timed
from surefix.post import Standardize

ROWS = ["descriptor to fix", "distances to fix", "scan on one thread"]


def test_each_push_is_timed_once_the_window_is_full() -> None:
    pushed: list[int] = []
    took = timed(pushed.append, [1, 2, 3], pushes=4, warm_up=5)
    assert took.shape == (4,)
    assert (took > 0).all()
    assert pushed == [1, 2, 3] * 3, "5 that fill the window, then 4"


def test_memory_is_read_at_some_speed_by_one_thread_and_by_two() -> None:
    for threads in (1, 2):
        assert 1e8 < memory_speed(1 << 20, threads, seconds=0.01) < 1e13


@pytest.mark.parametrize("dtype", ["u8", "i8", "f16", "f32"])
def test_a_random_map_of_the_given_size(dtype: str) -> None:
    options = "--places", 60, "--dim", 24, "--dtype", dtype, "-L", 5, "--threads", 2
    said = surefix_("bench", *options, "--pushes", 50).stdout
    machine, about, heads, *rows = said.splitlines()
    assert "cores" in machine
    assert about.startswith("60 places x 24 ")
    assert "L = 5, 2 threads" in about
    assert heads.split() == ["p50", "p99", "p99.9", "max", "pushes"]
    assert [row[:19].rstrip() for row in rows] == ROWS
    for row in rows[:2]:
        assert re.fullmatch(r".{20}( +[\d.e+]+ (ns|us|ms|s)){4} +50", row)
    assert re.search(r"GB/s \(.*\); the memory gives [\d.]+ GB/s$", rows[2])


def test_a_map_file_and_one_with_post_processing_which_has_no_plain_scan(tmp_path: Path) -> None:
    rows = np.random.default_rng(0).standard_normal((40, 16), np.float32)
    for post, names in ((None, ROWS), (Standardize(), ROWS[:2])):
        file = tmp_path / "route.safetensors"
        Map.from_descriptors(rows, post=post).save(file)
        said = surefix_("bench", file, "--pushes", 20).stdout.splitlines()
        assert said[1].startswith("40 places x 16 float32, cosine")
        assert [row[:19].rstrip() for row in said[3:]] == names


def test_images_are_pushed_on_a_map_of_sad() -> None:
    said = surefix_("bench", "--image", "--places", 60, "--pushes", 5).stdout.splitlines()
    assert said[1].startswith("60 places x 2,048 uint8, manhattan")
    assert said[3].startswith("image to fix ")


@pytest.mark.parametrize(
    "arguments", [("--dtype", "f64"), ("--threads", 0), ("--places", 1), ("--pushes", 0)]
)
def test_bad_usage_is_2(arguments: tuple[object, ...]) -> None:
    assert surefix_("bench", *arguments, code=None).returncode == 2


def test_a_map_too_short_for_the_sequence_or_missing_is_1(tmp_path: Path) -> None:
    for arguments in (("--places", 10, "-L", 11), (tmp_path / "none.safetensors",)):
        done = surefix_("bench", *arguments, code=None)
        assert done.returncode == 1
        assert done.stderr.startswith("surefix: ")


def test_help_has_an_example() -> None:
    assert "Example: surefix bench" in surefix_("bench", "--help").stdout
