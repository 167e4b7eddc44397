"""Pickles and copies: of every class, and of those that go on, with the same answers to the bit."""

import copy
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surefix
import tiny_network
from surefix import _core, post, simulate
from surefix.descriptors import Onnx
from surefix.distributed import ShardDeadline, ShardError

WAYS: list[Callable[[Any], Any]] = [
    lambda thing: pickle.loads(pickle.dumps(thing)),
    copy.copy,
    copy.deepcopy,
]
ROUTE = simulate.Route(places=60, seed=3)
MAP = surefix.Map.from_images(ROUTE.traverse())
DRIVE = ROUTE.traverse(season=0.6, light=0.2, seed=4)
RUN = surefix.match(MAP, DRIVE, motion="any", sequence_length=4)
SEGMENTS = surefix.Segments(60, [20], [1], [(3, 40)])
PLACED = surefix.match(MAP.with_positions(np.ones((60, 2)), origin=(51.5, 0.0)), DRIVE)
SCORES = np.float32(np.arange(300) * 7 % 11 / 100)


def threshold() -> surefix.Threshold:
    return surefix.calibrate(RUN, np.arange(60), tolerance=3, wrong=0.5, sure=0.6)


def things() -> list[Any]:
    vectors = np.random.default_rng(0).standard_normal((9, 4), np.float32)
    fix = RUN[10]
    running = post.Running(references=vectors)
    running.push(vectors[0])
    return [
        surefix.Alarm(SCORES, 10),
        surefix.align(MAP, DRIVE, motion="steady"),
        surefix.evaluate(RUN, np.arange(60)),
        surefix.evaluate_trust(RUN, np.arange(60)),
        fix,
        PLACED[3].position,
        SEGMENTS,
        SEGMENTS[1],
        fix.single,
        fix.gradient,
        fix.sequence,
        fix.track,
        MAP,
        surefix.Map.from_descriptors(vectors).with_screen("i8"),
        RUN,
        ROUTE,
        DRIVE,
        surefix.Localizer(MAP, motion="any"),
        surefix.Matcher(9),
        surefix.Motion(speeds=[0.5, 1.0]),
        surefix.Sad((32, 16), 4),
        surefix.Segments(9, breaks=[4], closed=[1], links=[(3, 6)]),
        surefix.Segments(9)[0],
        MAP.traverses[0],
        surefix.LoopCloser().push(np.arange(20, dtype=np.float32)),
        surefix.Settings(motion="any", threshold=threshold(), maps=MAP, measured={"on": "a road"}),
        threshold(),
        post.fit(vectors, [post.Standardize(), post.Pca(2)]),
        running,
        surefix.audit(MAP, DRIVE),
        surefix.SurefixFileError(2, "no such file", "there"),
        surefix.SurefixValueError("said"),
        ShardError("said"),
        ShardDeadline("said"),
    ]


def seen(thing: Any) -> Any:
    """All that its properties say, in a form that can be compared."""
    if isinstance(thing, np.ndarray):
        return thing.dtype.name, thing.shape, thing.tobytes()
    if type(thing).__module__.split(".")[0] == "surefix" and not isinstance(thing, Exception):
        names = [name for name in dir(type(thing)) if not name.startswith("_")]
        # The distances of a drive are left out (test_distances.py).
        left = {"distances"} if isinstance(thing, (surefix.Run, surefix.Alignment)) else set()
        values = {name: getattr(thing, name) for name in names if name not in left}
        return repr(thing), {n: seen(v) for n, v in values.items() if not callable(v)}
    if isinstance(thing, (list, tuple)):
        return [seen(one) for one in thing]
    return repr(thing)


@pytest.mark.parametrize("way", WAYS, ids=["pickle", "copy", "deepcopy"])
def test_every_class(way: Callable[[Any], Any]) -> None:
    given = things()
    classes = {
        name for name, kind in vars(_core).items() if isinstance(kind, type) and name[0] != "_"
    }
    # An iterator, as Python's own, cannot; a map that grows may hold a file; and shards with their
    # driver, of one state, have snapshots.
    left = classes - {type(thing).__name__ for thing in given}
    assert left == {"FixStream", "LoopCloser", "Shard", "ShardDriver"}
    for thing in given:
        again = way(thing)
        assert type(again) is type(thing)
        assert seen(again) == seen(thing)


@pytest.mark.parametrize("way", WAYS, ids=["pickle", "copy", "deepcopy"])
def test_what_goes_on_goes_on_alike_and_alone(way: Callable[[Any], Any]) -> None:
    config = surefix.Settings(motion="any", threshold=threshold())
    localizer = surefix.Localizer(MAP, config=config, threads=2)
    for image in list(DRIVE)[:20]:
        localizer.push(image)
    again = way(localizer)
    assert again.threads == 2
    rest = [localizer.push(image) for image in list(DRIVE)[20:]]
    assert [again.push(image) for image in list(DRIVE)[20:]] == rest
    assert rest[-1].accepted is not None

    alarm = surefix.Alarm(SCORES, 10)
    alarm.push(0.9)
    other = way(alarm)
    assert [alarm.push(0.9) for _ in range(90)] == [other.push(0.9) for _ in range(90)]
    assert alarm.raised
    assert alarm.evidence == other.evidence

    running = post.Running(3)
    running.push(np.float32([1, 2, 3]))
    follower = way(running)
    after = [one.push(np.float32([4, 0, 1])) for one in (running, follower)]
    np.testing.assert_array_equal(*after)


def test_infinities_and_the_last_bit_survive() -> None:
    vectors = np.float32([[0, 1e-45], [1, 3.4e38], [0.1, -0.0]])
    run = surefix.match(surefix.Map.from_descriptors(vectors, metric="euclidean"), vectors)
    again = pickle.loads(pickle.dumps(run))
    assert list(again) == list(run)


def test_networks_are_opened_again(tmp_path: Path) -> None:
    network = Onnx(tiny_network.save(tmp_path / "tiny.onnx"), output="mean", size=(20, 12))
    image = np.random.default_rng(1).integers(0, 256, (12, 20, 3), np.uint8)
    route = surefix.Map.from_images([image, image[::-1]], descriptor=network)
    localizer = surefix.Localizer(route, descriptor=network)
    for way in WAYS:
        np.testing.assert_array_equal(way(network).describe(image), network.describe(image))
        assert way(localizer).push(image).single.place == 0


def test_a_pickle_of_something_else_is_refused() -> None:
    with pytest.raises(surefix.SurefixValueError, match="expected a pickle of this version"):
        surefix.Fix._unpickled(b"\x93abc")  # type: ignore[attr-defined]
