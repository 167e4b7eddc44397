"""Actors that die or are slow: each query is answered exactly, or refused with a typed error."""

import os
import random
import signal
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
QUERIES, KILLS = (10_000, 150) if LONG else (1000, 8)


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
def test_actors_are_killed_and_each_fix_is_that_of_one_machine(
    ray: Any, route: surefix.Map, file: Path
) -> None:
    pushed = drive(route, QUERIES)
    rng = random.Random(5)
    doomed = sorted(rng.sample(range(QUERIES), KILLS))
    wanted = alone(route, pushed, **OPTIONS)
    restarted = 0
    with ShardedLocalizer(file, shards=3, deadline=60.0, **OPTIONS) as localizer:
        before = {process(ray, remote) for remote in localizer._remotes}
        for number, one in enumerate(pushed):
            killers = []
            if number in doomed:
                # Once in four, two at a time.
                count = 2 if number == doomed[len(doomed) // 4] else 1
                which = rng.sample(localizer._remotes, count)
                killers = [kill_soon(ray, remote, rng) for remote in which]
            assert bits(localizer.push(**one)) == wanted[number], number
            for killer in killers:
                killer.join()
        after = {process(ray, remote) for remote in localizer._remotes}
        restarted = len(after - before)
        assert localizer.frames == QUERIES
    assert restarted > 0


@pytest.mark.slow
@pytest.mark.parametrize("last", [False, True])
def test_a_slow_shard_is_named_and_nothing_is_lost(
    ray: Any, route: surefix.Map, file: Path, last: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    pushed = drive(route, 12, seed=last)
    wanted = alone(route, pushed, **OPTIONS)
    with ShardedLocalizer(file, shards=2, deadline=1.0, **OPTIONS) as localizer:
        fixes = [bits(localizer.push(**one)) for one in pushed[:5]]
        number = process(ray, localizer._remotes[1])
        run = Trip.run

        def stopped(trip: Trip, deadline: Deadline) -> list[bytes]:
            if (trip.stage == "second") == last:
                os.kill(number, signal.SIGSTOP)
            return run(trip, deadline)

        monkeypatch.setattr(Trip, "run", stopped)
        stage, after = ("second", "taken") if last else ("first", "nothing has changed")
        said = rf"shard 1 of 2, {stage} trip: did not answer within 1 s; .*{after}"
        with pytest.raises(ShardDeadline, match=said):
            localizer.push(**pushed[5])
        monkeypatch.setattr(Trip, "run", run)
        assert localizer.frames == (6 if last else 5)
        if last:
            # The same again, as it must be ended first.
            with pytest.raises(ShardDeadline, match=said):
                localizer.gap()
        os.kill(number, signal.SIGCONT)
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
        run, remote = Trip.run, localizer._remotes[0]

        def killed(trip: Trip, deadline: Deadline) -> list[bytes]:
            if trip.stage == "second":
                ray.kill(remote.actor, no_restart=False)
                return run(trip, Deadline(0.1))
            return run(trip, deadline)

        monkeypatch.setattr(Trip, "run", killed)
        with pytest.raises(ShardError, match="the frame counts as taken"):
            localizer.push(**pushed[4])
        monkeypatch.setattr(Trip, "run", run)
        assert [bits(localizer.push(**one)) for one in pushed[5:]] == wanted[5:]


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
