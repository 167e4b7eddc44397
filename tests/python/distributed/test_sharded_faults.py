"""Actors that die or are slow: each query is answered exactly, or refused with a typed error."""

import os
import random
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from shard_maps import alone, bits, drive, road, saved

import surefix
from surefix.distributed import ShardDeadline, ShardedLocalizer, ShardError
from surefix.distributed.remote import Deadline, Remote, Trip

LONG = bool(os.environ.get("LONG"))
OPTIONS: dict[str, Any] = {"motion": "free", "sequence_length": 5}
# Of each of two drives.
QUERIES, KILLS = (5000, 80) if LONG else (500, 4)


@pytest.fixture(scope="module")
def route() -> surefix.Map:
    return road()


@pytest.fixture(scope="module")
def file(route: surefix.Map, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return saved(tmp_path_factory.mktemp("maps"), route)


def process(ray: Any, remote: Remote) -> int:
    number: int = ray.get(remote.actor.process.remote())
    return number


def kill_soon(ray: Any, remote: Remote, rng: random.Random) -> threading.Thread:
    """Ends an actor at some time in the next query, in one of two ways."""
    number = process(ray, remote) if rng.random() < 0.6 else None
    after = rng.random() * 0.01

    def kill() -> None:
        time.sleep(after)
        if number is None:
            ray.kill(remote.actor, no_restart=False)
        else:
            os.kill(number, signal.SIGKILL)

    thread = threading.Thread(target=kill)
    thread.start()
    return thread


@pytest.mark.slow
@pytest.mark.parametrize("motion", [None, "free"])
def test_actors_are_killed_and_each_fix_is_that_of_one_machine(
    ray: Any, route: surefix.Map, file: Path, motion: str | None
) -> None:
    options = OPTIONS | {"motion": motion}
    pushed = drive(route, QUERIES)
    rng = random.Random(5)
    doomed = sorted(rng.sample(range(QUERIES), KILLS))
    wanted = alone(route, pushed, **options)
    with ShardedLocalizer(file, shards=3, deadline=60.0, **options) as localizer:
        before = {process(ray, remote) for remote in localizer._remotes}
        for number, one in enumerate(pushed):
            killers = []
            if number in doomed:
                count = 2 if number == doomed[-1] else 1
                which = rng.sample(localizer._remotes, count)
                killers = [kill_soon(ray, remote, rng) for remote in which]
            assert bits(localizer.push(**one)) == wanted[number], number
            for killer in killers:
                killer.join()
        after = {process(ray, remote) for remote in localizer._remotes}
        assert len(after - before) > 0
        assert localizer.frames == QUERIES


@pytest.mark.slow
@pytest.mark.parametrize("last", [False, True])
def test_a_slow_shard_is_named_and_nothing_is_lost(
    ray: Any, route: surefix.Map, file: Path, last: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    pushed = drive(route, 12, seed=last)
    wanted = alone(route, pushed, **OPTIONS)
    with ShardedLocalizer(file, shards=2, deadline=60.0, **OPTIONS) as localizer:
        fixes = [bits(localizer.push(**one)) for one in pushed[:5]]
        number = process(ray, localizer._remotes[1])
        run = Trip.run

        def stopped(trip: Trip, deadline: Deadline) -> list[bytes]:
            if (trip.stage == "second") != last:
                return run(trip, deadline)
            os.kill(number, signal.SIGSTOP)
            return run(trip, Deadline(1.0))

        monkeypatch.setattr(Trip, "run", stopped)
        stage, after = ("second", "taken") if last else ("first", "nothing has changed")
        said = rf"shard 1 of 2, {stage} trip: did not answer within 1 s; .*{after}"
        with pytest.raises(ShardDeadline, match=said):
            localizer.push(**pushed[5])
        assert localizer.frames == (6 if last else 5)
        if last:
            # It must be ended first.
            with pytest.raises(ShardDeadline, match=said):
                localizer.gap()
        os.kill(number, signal.SIGCONT)
        monkeypatch.setattr(Trip, "run", run)
        ended = localizer.finish()
        assert (ended is not None) == last
        fixes.append(bits(ended or localizer.push(**pushed[5])))
        fixes += [bits(localizer.push(**one)) for one in pushed[6:]]
    assert fixes == wanted


@pytest.mark.slow
def test_a_frame_that_is_not_ended_is_ended_by_the_next(
    ray: Any, route: surefix.Map, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pushed = drive(route, 8, seed=3)
    wanted = alone(route, pushed, **OPTIONS)
    with ShardedLocalizer(file, shards=2, snapshot_every=3, **OPTIONS) as localizer:
        for one in pushed[:4]:
            localizer.push(**one)
        run, number = Trip.run, process(ray, localizer._remotes[0])

        def killed(trip: Trip, deadline: Deadline) -> list[bytes]:
            if trip.stage == "second":
                os.kill(number, signal.SIGKILL)
                return run(trip, Deadline(0.1))
            return run(trip, deadline)

        monkeypatch.setattr(Trip, "run", killed)
        with pytest.raises(ShardError, match="the frame counts as taken"):
            localizer.push(**pushed[4])
        monkeypatch.setattr(Trip, "run", run)
        assert [bits(localizer.push(**one)) for one in pushed[5:]] == wanted[5:]


@pytest.mark.slow
def test_drives_share_shards_and_their_restarts(ray: Any, route: surefix.Map, file: Path) -> None:
    drives = [drive(route, 40, seed=seed) for seed in (7, 8, 9)]
    wanted = [alone(route, pushed, **OPTIONS) for pushed in drives]
    fixes: list[list[bytes]] = [[] for _ in drives]
    first = ShardedLocalizer(file, shards=2, deadline=60.0, **OPTIONS)
    with first.another() as second, second.another() as third:
        localizers = [first, second, third]

        def push(which: int, count: int) -> None:
            for one in drives[which][len(fixes[which]) :][:count]:
                fixes[which].append(bits(localizers[which].push(**one)))

        push(0, 9)
        threads = [threading.Thread(target=push, args=(which, 30)) for which in range(3)]
        for thread in threads:
            thread.start()
        time.sleep(0.05)
        ray.kill(first._remotes[0].actor, no_restart=False)
        for thread in threads:
            thread.join()
        # The others go on.
        first.close()
        push(1, 40)
        push(2, 40)
    assert fixes == [wanted[0][:39], *wanted[1:]]
    with pytest.raises(surefix.SurefixError, match="it is closed"):
        first.push(**drives[0][0])


@pytest.mark.slow
def test_the_map_is_gone_when_an_actor_comes_back(
    ray: Any, route: surefix.Map, tmp_path: Path
) -> None:
    file = saved(tmp_path, route)
    pushed = drive(route, 6, seed=4)
    with ShardedLocalizer(file, shards=2, **OPTIONS) as localizer:
        fixes = [bits(localizer.push(**one)) for one in pushed[:3]]
        file.rename(tmp_path / "elsewhere")
        ray.kill(localizer._remotes[1].actor, no_restart=False)
        with pytest.raises(ShardError, match=r"shard 1 of 2, .*cannot read the map"):
            localizer.push(**pushed[3])
        (tmp_path / "elsewhere").rename(file)
        localizer.finish()
        if localizer.frames == 3:
            fixes.append(bits(localizer.push(**pushed[3])))
        fixes += [bits(localizer.push(**one)) for one in pushed[4:]]
        wanted = alone(route, pushed, **OPTIONS)
        assert fixes == (wanted if len(fixes) == 6 else wanted[:3] + wanted[4:])


NODE_LOST = """
import pickle, sys, time
import ray
from ray.cluster_utils import Cluster
from shard_maps import alone, bits, drive
import surefix
from surefix.distributed import ShardedLocalizer, ShardError

file = sys.argv[1]
pushed = drive(surefix.Map.open(file), 12)
wanted = alone(surefix.Map.open(file), pushed, motion="free")
cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
node = cluster.add_node(num_cpus=1, resources={"shard": 2})
ray.init(cluster.address, log_to_driver=False)
options = {"ray_options": {"resources": {"shard": 1}}, "snapshot_every": 1, "deadline": 120.0}
localizer = ShardedLocalizer(file, shards=2, motion="free", **options)
fixes = [bits(localizer.push(**one)) for one in pushed[:8]]
cluster.add_node(num_cpus=1, resources={"shard": 2})
cluster.remove_node(node)
for one in (pushed[8], pushed[8]):
    try:
        localizer.push(**one)
        print("answered")
    except ShardError as error:
        print(error)
localizer.reset()
again = [bits(localizer.push(**one)) for one in pushed]
print(fixes == wanted[:8] and again == wanted)
"""


@pytest.mark.skipif(not LONG, reason="takes a minute: LONG=1")
def test_a_lost_node_takes_its_snapshots_along(file: Path) -> None:
    pytest.importorskip("ray")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    ran = subprocess.run(
        [sys.executable, "-c", NODE_LOST, str(file)],
        capture_output=True, text=True, env=environment,
    )  # fmt: skip
    *said, last = ran.stdout.splitlines() or [ran.stderr]
    assert last == "True", ran.stderr
    assert len(said) == 2
    for line in said:
        assert re.fullmatch(r"shard \d of 2: its node was lost with .* call reset\(\)", line), line
