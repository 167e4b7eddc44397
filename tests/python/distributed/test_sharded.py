"""A map in shards: the fixes of one machine, to the last bit, and what is refused."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shard_maps import BLOCK, alone, bits, drive, road, saved

import surefix
from surefix import SurefixError, SurefixFileError, SurefixValueError, _core
from surefix.distributed import ShardedLocalizer, ShardError

OPTIONS: dict[str, Any] = {"motion": "free", "sequence_length": 4}


@pytest.fixture(scope="module")
def route() -> surefix.Map:
    return road()


@pytest.fixture(scope="module")
def file(route: surefix.Map, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return saved(tmp_path_factory.mktemp("maps"), route)


@pytest.mark.slow
def test_all_sources_give_the_fixes_of_one_machine(
    ray: Any, route: surefix.Map, file: Path, tmp_path: Path
) -> None:
    pushed = drive(route, 25)
    wanted = alone(route, pushed, **OPTIONS)
    names = [saved(tmp_path, route.slice(0, 9000)), tmp_path / "second.safetensors"]
    route.slice(9000, len(route)).save(names[1])
    joined = surefix.Map.join([surefix.Map.open(name) for name in names])
    for given, of in (
        (file, wanted),
        (route, wanted),
        (f"file://{file}", wanted),
        ([names[0], f"file://{names[1]}"], alone(joined, pushed, **OPTIONS)),
    ):
        with ShardedLocalizer(given, shards=3, **OPTIONS) as localizer:
            assert [bits(localizer.push(**one)) for one in pushed] == of, given


@pytest.mark.slow
@pytest.mark.parametrize("motion", [None, "free"])
def test_several_traverses_and_what_shows_nothing(
    ray: Any, route: surefix.Map, tmp_path: Path, motion: str | None
) -> None:
    # Two seasons over the border of two shards, dark places beside it, and a dark frame.
    # Rows of 8 numbers are too short to show nothing.
    rows = np.tile(route.descriptors, 2)
    rows[12_200:12_215] = 0.0
    noise = np.random.default_rng(4).standard_normal((400, rows.shape[1])) * 0.2
    winter = (rows[12_100:12_900:2] + 0.5 + noise).astype(np.float32)
    summer = surefix.Map.from_descriptors(rows, metric="euclidean").with_segments(route.segments)
    both = summer.add_traverse(winter, motion="free", progress=False)
    assert both.traverses[1].rows > 300
    assert len(both.blank) > 0
    pushed: list[dict[str, Any]] = [
        {"frame": row + np.float32(0.4)} for row in rows[12_180:12_330:3]
    ]
    pushed[20]["frame"] = np.zeros(rows.shape[1], np.float32)
    options = OPTIONS | {"motion": motion}
    wanted = alone(both, pushed, **options)
    with ShardedLocalizer(saved(tmp_path, both), shards=3, **options) as localizer:
        assert [bits(localizer.push(**one)) for one in pushed] == wanted


@pytest.mark.slow
def test_parts_of_a_shard(ray: Any, route: surefix.Map, file: Path) -> None:
    pushed = drive(route, 12, seed=3)
    wanted = alone(route, pushed, **OPTIONS)
    with ShardedLocalizer(file, shards=2, threads=3, **OPTIONS) as localizer:
        fixes = [bits(localizer.push(**one)) for one in pushed[:8]]
        blob = localizer.snapshot()
        ray.kill(localizer._remotes[1].actor, no_restart=False)
        fixes += [bits(localizer.push(**one)) for one in pushed[8:]]
    assert fixes == wanted
    with ShardedLocalizer.restore(file, blob, threads=3, **OPTIONS) as again:
        assert [bits(again.push(**one)) for one in pushed[8:]] == wanted[8:]
    for threads in (4, 0, "2"):
        with pytest.raises(SurefixValueError, match="threads: expected those of a snapshot of 6"):
            ShardedLocalizer.restore(file, blob, threads=threads, **OPTIONS)


@pytest.mark.slow
def test_gaps_resets_and_snapshots(ray: Any, route: surefix.Map, file: Path) -> None:
    pushed = drive(route, 24, seed=2)
    one = surefix.Localizer(route, **OPTIONS)
    with ShardedLocalizer(file, shards=2, **OPTIONS) as localizer:
        for number, frame in enumerate(pushed[:16]):
            if number % 5 == 4:
                for each in (one, localizer):
                    each.gap(None if number < 9 else 3.5)
            assert bits(localizer.push(**frame)) == bits(one.push(**frame)), number
        blob = localizer.snapshot()
        localizer.reset()
        assert localizer.frames == 0
        fresh = [bits(localizer.push(**frame)) for frame in pushed[:4]]
        assert fresh == alone(route, pushed[:4], **OPTIONS)
    with pytest.raises(SurefixError, match="it is closed"):
        localizer.push(**pushed[0])
    with ShardedLocalizer.restore(file, blob, **OPTIONS) as again:
        assert (again.frames, again.shards) == (16, 2)
        for frame in pushed[16:]:
            assert bits(again.push(**frame)) == bits(one.push(**frame))
    for bad in (b"", blob[:-1], blob[:40], b"x" + blob[1:]):
        with pytest.raises(SurefixValueError, match=r"snapshot: expected bytes of Sharded"):
            ShardedLocalizer.restore(file, bad, **OPTIONS)
    with pytest.raises(SurefixError):
        ShardedLocalizer.restore(file, blob, **(OPTIONS | {"sequence_length": 3}))


@pytest.mark.slow
def test_a_refused_frame_changes_nothing(ray: Any, route: surefix.Map, file: Path) -> None:
    pushed = drive(route, 10, seed=6)
    wanted = alone(route, pushed, **OPTIONS)
    fixes = []
    with ShardedLocalizer(file, shards=2, **OPTIONS) as localizer:
        for one in pushed:
            for frame in (np.full(8, np.nan, np.float32), np.zeros(9, np.float32)):
                with pytest.raises(SurefixValueError):
                    localizer.push(frame)
            fixes.append(bits(localizer.push(**one)))
    assert fixes == wanted


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"shards": 0}, "shards: expected a whole number of 1 or more, got 0"),
        ({"shards": 10}, "shards`: expected from 1 to 9, .*got 10"),
        ({"deadline": 0}, "deadline: expected seconds above 0, got 0"),
        ({"snapshot_every": 2.5}, "snapshot_every: expected a whole number"),
        ({"shards": 5, "threads": 2}, "shards`: expected from 1 to 9, .*got 10"),
        ({"threads": 0}, "threads: expected a whole number of 1 or more, got 0"),
        ({"sequence_length": 0}, "sequence_length`: expected"),
        ({"colour": 1}, "colour"),
    ],
)
def test_options_are_refused_before_an_actor_is_made(
    file: Path, options: dict[str, Any], said: str
) -> None:
    pytest.importorskip("ray")
    with pytest.raises((SurefixValueError, TypeError), match=said):
        ShardedLocalizer(file, **options)


def test_maps_that_are_none_are_refused(file: Path, tmp_path: Path) -> None:
    pytest.importorskip("ray")
    with pytest.raises(SurefixFileError, match=r"absent.safetensors: .*No such file"):
        ShardedLocalizer([file, tmp_path / "absent.safetensors"])
    for given in ([], 7, [7]):
        with pytest.raises(SurefixValueError, match="map: expected a Map, or the path or URL"):
            ShardedLocalizer(given)  # type: ignore[arg-type]
    other = surefix.Map.from_descriptors(np.ones((BLOCK, 3), np.float32))
    other.save(tmp_path / "other.safetensors")
    with pytest.raises(
        SurefixValueError, match=r"map 1: .*expected .* 8 x float32, .* 3 x float32"
    ):
        ShardedLocalizer([file, tmp_path / "other.safetensors"])


def test_without_ray(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(SurefixError, match=r'Ray.*pip install "surefix\[ray\]"'):
        ShardedLocalizer(file)


def test_a_cluster_that_is_not_there(file: Path) -> None:
    pytest.importorskip("ray")
    code = "import sys, surefix.distributed as d; d.ShardedLocalizer(sys.argv[1], shards=1)"
    done = subprocess.run(
        [sys.executable, "-c", code, str(file)],
        capture_output=True,
        text=True,
        env=os.environ | {"RAY_ADDRESS": "127.0.0.1:1"},
    )
    assert done.returncode == 1
    assert "SurefixError: RAY_ADDRESS 127.0.0.1:1: there is no cluster" in done.stderr


@pytest.mark.slow
def test_another_version_on_a_worker(ray: Any, file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_core, "__version__", "9.9.9")
    said = r"shard 0 of 2: expected surefix 9.9.9 as on the driver, got .* on a worker"
    with pytest.raises(ShardError, match=said):
        ShardedLocalizer(file, shards=2)


@pytest.mark.slow
def test_another_file_on_a_worker(ray: Any, file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("surefix.distributed.sources.Source.identity", lambda source: "other")
    with pytest.raises(ShardError, match=r"road.safetensors: not the file that the driver opened"):
        ShardedLocalizer(file, shards=2)
