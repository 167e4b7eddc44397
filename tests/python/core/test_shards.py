"""Shards and their driver, by bytes: a localizer's fixes, and each wrong message refused."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import surefix
from surefix import _core
from surefix._core import Fix, Shard, ShardDriver
from surefix.errors import SurefixError, SurefixValueError

PLACES, DIM, SHARDS = 3 * 4096 + 500, 12, 3
OPTIONS: Any = {"motion": "any", "sequence_length": 4, "tolerance": 3}


def rows(seed: int = 0) -> npt.NDArray[np.float32]:
    return np.random.default_rng(seed).random((PLACES, DIM), np.float32)


@pytest.fixture(scope="module")
def route(tmp_path_factory: pytest.TempPathFactory) -> surefix.Map:
    file = tmp_path_factory.mktemp("shards") / "route.safetensors"
    surefix.Map.from_descriptors(rows(), breaks=[4000, 8200], closed=[1]).save(file)
    return surefix.Map.open(file, mmap=True)


def drive(seed: int = 0) -> Iterator[npt.NDArray[np.float32]]:
    """Frames along the places around the border of two shards."""
    noise, of_places = np.random.default_rng(seed), rows()
    for place in range(4090, 4106):
        yield of_places[place] + 0.1 * noise.random(DIM, np.float32)


class Sharded:
    """A driver and its shards in one process."""

    def __init__(self, route: surefix.Map, **options: Any) -> None:
        self.driver = ShardDriver(route, SHARDS, **options)
        self.shards = [Shard(route, index, SHARDS, **options) for index in range(SHARDS)]

    def ask(self, asked: tuple[str, list[bytes]]) -> list[bytes]:
        stage, questions = asked
        shards = zip(self.shards, questions, strict=True)
        return [getattr(shard, stage)(question) for shard, question in shards]

    def push(self, frame: npt.NDArray[np.float32], advance: float | None = None) -> Fix:
        asked: tuple[str, list[bytes]] | Fix = self.driver.push(frame, advance)
        while not isinstance(asked, Fix):
            asked = self.driver.answer(self.ask(asked))
        return asked


def test_the_places_of_the_shards(route: surefix.Map) -> None:
    sharded = Sharded(route)
    expected = [(0, 4096), (4096, 8192), (8192, PLACES)]
    assert sharded.driver.places == expected
    assert [shard.places for shard in sharded.shards] == expected


def test_fixes_are_the_localizers(route: surefix.Map) -> None:
    sharded, localizer = Sharded(route, **OPTIONS), surefix.Localizer(route, **OPTIONS)
    for index, frame in enumerate(drive()):
        if index == 6:
            sharded.driver.gap(3.5)
            localizer.gap(3.5)
        if index == 9:
            again = Sharded(route, **OPTIONS)
            again.driver.restore(sharded.driver.snapshot())
            for old, new in zip(sharded.shards, again.shards, strict=True):
                new.restore(old.snapshot())
            sharded = again
        advance = 1.25 if index % 3 == 0 else None
        assert sharded.push(frame, advance) == localizer.push(frame, advance=advance)
    sharded.driver.reset()
    localizer.reset()
    for frame in drive(1):
        assert sharded.push(frame) == localizer.push(frame)
    assert sharded.driver.frames == sharded.shards[0].frames == 16
    # A frame that shows nothing asks for a census.
    nothing = np.zeros(DIM, np.float32)
    stage, _ = sharded.driver.push(nothing)
    assert stage == "census"
    sharded.driver.abandon()
    assert sharded.push(nothing) == localizer.push(nothing)


def test_a_threshold_judges_and_positions_are_given() -> None:
    at = np.arange(2.0 * PLACES).reshape(-1, 2)
    route = surefix.Map.from_descriptors(rows(), positions=at)
    assert (
        Sharded(route).push(rows()[7]).position == surefix.Localizer(route).push(rows()[7]).position
    )


def refused(what: str) -> Any:
    return pytest.raises(SurefixError, match=what)


def test_messages_out_of_turn_are_refused(route: surefix.Map) -> None:
    sharded, localizer = Sharded(route, **OPTIONS), surefix.Localizer(route, **OPTIONS)
    frames = list(drive())
    assert sharded.push(frames[0]) == localizer.push(frames[0])
    first = sharded.driver.push(frames[1])
    with refused("expected the answers of frame 1 first, got a query"):
        sharded.driver.push(frames[1])
    with refused("expected the answers of frame 1 first, got a snapshot"):
        sharded.driver.snapshot()
    answers = sharded.ask(first)
    assert sharded.ask(first) == answers
    with refused("expected a question of the stage second, got first"):
        sharded.shards[0].second(first[1][0])
    with refused("expected a question to the shard of places 0 to 4095, got 4096 to 8191"):
        sharded.shards[0].first(first[1][1])
    with refused("answers, one a shard: expected 3 values, got 2"):
        sharded.driver.answer(answers[:2])
    with refused("expected the answer of shard 0 to frame 1, got another's"):
        sharded.driver.answer(answers[::-1])
    second = sharded.driver.answer(answers)
    assert not isinstance(second, Fix)
    with refused("expected answers of the stage second, got others"):
        sharded.driver.answer(answers)
    with refused("shards may have kept the query"):
        sharded.driver.abandon()
    answers = sharded.ask(second)
    with refused("frame 2 after the queries"):
        sharded.shards[1].second(second[1][1])
    with refused("frame 2 after the queries"):
        sharded.shards[1].first(first[1][1])
    assert sharded.driver.answer(answers) == localizer.push(frames[1])
    with refused("expected no answers"):
        sharded.driver.answer(answers)
    assert sharded.push(frames[2]) == localizer.push(frames[2])
    # Another driver that is as far, on another drive.
    other = Sharded(route, **OPTIONS)
    for frame in frames[5:8]:
        other.push(frame)
    with refused("expected the next query, frame 3 after"):
        sharded.shards[0].first(other.driver.push(frames[8])[1][0])


def test_others_than_the_drivers_are_refused(route: surefix.Map, tmp_path: Path) -> None:
    stage, questions = ShardDriver(route, SHARDS, **OPTIONS).push(rows()[0])
    assert stage == "first"
    question = questions[0]
    shard = Shard(route, 0, SHARDS, **OPTIONS)
    version = _core.__version__.encode()
    newer = bytes([version[0] + 1]) + version[1:]
    with refused(f"expected surefix {version.decode()}, got {newer.decode()}"):
        shard.first(question.replace(version, newer, 1))
    for damaged in (b"", b"nothing", question[:-3], question + b"more"):
        with pytest.raises(SurefixError):
            shard.first(damaged)
    with refused("expected the options with the mark"):
        Shard(route, 0, SHARDS, sequence_length=5).first(question)
    # Another map of the same size.
    file = tmp_path / "other.safetensors"
    surefix.Map.from_descriptors(rows(1), breaks=[4000, 8200], closed=[1]).save(file)
    other = surefix.Map.open(file, mmap=True)
    with refused(f"expected the map of {PLACES} places x 12 .* got {PLACES} places x 12"):
        Shard(other, 0, SHARDS, **OPTIONS).first(question)
    with pytest.raises(SurefixValueError, match="expected the map of"):
        shard.restore(Shard(other, 0, SHARDS, **OPTIONS).snapshot())
    with pytest.raises(SurefixValueError, match="expected the shard of places 0 to 4095"):
        shard.restore(Shard(route, 1, SHARDS, **OPTIONS).snapshot())
    # The same file, read into memory.
    read = surefix.Map.open(tmp_path / "other.safetensors")
    question = ShardDriver(read, SHARDS).push(rows()[0])[1][0]
    assert Shard(other, 0, SHARDS).first(question)


def test_what_shards_do_not_have_is_refused(route: surefix.Map) -> None:
    small = surefix.Map.from_descriptors(rows()[:4097])
    for wrong, make in [
        ("`shards`: expected from 1 to 2, .* got 3", lambda: ShardDriver(small, 3)),
        ("`shards`: expected from 1 to 4", lambda: Shard(route, 0, 0)),
        ("`shard`: expected a shard from 0 to 1, got 2", lambda: Shard(route, 2, 2)),
        ("`shards`: expected a whole number", lambda: Shard(route, 0, "two")),  # type: ignore[arg-type]
        ("shards do not fuse several, got 2", lambda: ShardDriver([route, route], 2)),  # type: ignore[arg-type]
        ("`floor`", lambda: ShardDriver(route, 2, floor="global")),
        ("`technique_weights`", lambda: Shard(route, 0, 2, technique_weights=[1.0, 2.0])),
        ("`tempo`", lambda: Shard(route, 0, 2, tempo=1)),  # type: ignore[call-arg]
    ]:
        with pytest.raises(SurefixValueError, match=wrong):
            make()
    driver = ShardDriver(route, 2)
    with pytest.raises(SurefixValueError, match="expected finite numbers"):
        driver.push(np.full(DIM, np.nan, np.float32))
    with pytest.raises(SurefixValueError, match="advance"):
        driver.push(rows()[0], advance=float("nan"))
    driver.push(rows()[0])
