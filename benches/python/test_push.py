"""From distances, a descriptor or an image to the fix."""

from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

from rival import ArrayLocalizer, ArrayMatcher
from surefix import Localizer, Map, Matcher, Sad
from surefix.simulate import Route
from work import LEVEL, Work, equal, pushing, read_by_push, same_fixes, same_trust, times

# A drive is so long that its jump back to the start is in few windows.
COLUMNS, LONG, DESCRIPTORS, IMAGES = 16, 1000, 32, 8
BYTES, DIM = 2048, 4096
# How alike two neighbouring places are, and a place and its query.
ALONG, ACROSS = 0.95, 0.7
OURS, PLAIN, ARRAYS = "surefix", "surefix, without the screen", "NumPy + SciPy"


def drive(places: int, queries: int = COLUMNS) -> list[Any]:
    """Distances of a drive: noise, and a dip at the true place, one further with each query."""
    rng = np.random.default_rng(places)
    columns = 0.5 + rng.random((queries, places), np.float32)
    columns[np.arange(queries), (places // 3 + np.arange(queries)) % places] *= 0.2
    return list(columns)


def long_drive(places: int, queries: int) -> list[Any]:
    """The same in the memory of one query: each is the one before it, a place further."""
    noise = np.float32(0.5) + np.random.default_rng(places).random(places + queries, np.float32)
    noise[queries + places // 3] *= 0.2
    return [noise[queries - query : queries - query + places] for query in range(queries)]


def matcher(places: int, length: int, columns: list[Any], **more: Any) -> Any:
    return pushing(lambda: Matcher(places, sequence_length=length).push, columns, **more)


def localizer(known: Map, queries: Any, threads: int | None = 1, length: int = 3, **more: Any):
    def fresh() -> Any:
        return Localizer(known, threads=threads, sequence_length=length).push

    return pushing(fresh, queries, **more)


@pytest.fixture(scope="module", params=[(3, False), (3, True), (100, False), (100, True)])
def distances(request: Any, quick: bool) -> Work:
    length, large = request.param
    places = (10_000 if quick else 100_000) if large else 1800
    name = f"Matcher.push, n = {places:,}, L = {length}"
    if length == 100:
        columns = long_drive(places, LONG)
        entrants = {"surefix, L = 2": matcher(places, 2, columns)}
        agrees = same_trust
    else:
        columns, entrants, agrees = drive(places), {}, same_fixes
        if find_spec("scipy"):
            entrants[ARRAYS] = pushing(
                lambda: ArrayMatcher(places, length).push,
                columns,
                target=times(50 if large else 30),
            )
    entrants = {OURS: matcher(places, length, columns), **entrants}
    return Work(name, entrants, agrees, read_by_push(places, length))


@pytest.mark.parametrize("nth", [0, 1])
def test_distances(distances: Work, nth: int, measure: Any) -> None:
    """Distances to fix"""
    measure(distances, [*distances.entrants, ARRAYS][nth])


@pytest.fixture(scope="module")
def learned(quick: bool, enough_memory: Any) -> Work:
    places = 4_000 if quick else 100_000
    name = f"learned descriptors, {places:,} x {DIM:,}, whole push"
    # The rows, the map's own, and a quarter more for the screen.
    enough_memory(name, 9 * places * DIM)
    rows, queries = route(places, DIM, DESCRIPTORS)
    plain = Map.from_descriptors(rows, metric="cosine")
    entrants = {
        OURS: localizer(plain.with_screen("i8"), queries),
        PLAIN: localizer(plain, queries, agrees=equal),
    }
    if find_spec("scipy"):

        def arrays() -> Any:
            push = ArrayMatcher(places, 3).push
            return lambda query: push(1 - rows @ query)

        entrants[ARRAYS] = pushing(arrays, queries, target=times(2.5))
    return Work(name, entrants, same_fixes, places * DIM + read_by_push(places, 3))


@pytest.mark.parametrize("name", [OURS, ARRAYS, PLAIN])
def test_learned(learned: Work, name: str, measure: Any) -> None:
    """Learned descriptor to fix"""
    measure(learned, name)


@pytest.fixture(scope="module")
def look_alikes(quick: bool, enough_memory: Any) -> Work:
    """Two places again and again: the screen has to give up, and that must cost little."""
    places = 4_000 if quick else 25_000
    name = f"places that no screen tells apart, {places:,} x {DIM:,}, whole push"
    enough_memory(name, 9 * places * DIM)
    rng = np.random.default_rng(places)
    rows = np.float32(1e-5) * rng.standard_normal((places, DIM), np.float32)
    for start, place in enumerate(rng.standard_normal((2, DIM), np.float32)):
        rows[start::2] += place
    noise = rng.standard_normal((DESCRIPTORS, DIM), np.float32)
    queries = list(rows[:DESCRIPTORS] + np.float32(1e-5) * noise)
    plain = Map.from_descriptors(rows, metric="cosine")
    target = 1 / 1.1, "at most 1.1 x its time"
    entrants = {
        OURS: localizer(plain.with_screen("i8"), queries),
        PLAIN: localizer(plain, queries, target=target),
    }
    return Work(name, entrants, equal, rows.nbytes + read_by_push(places, 3))


@pytest.mark.parametrize("name", [OURS, PLAIN])
def test_look_alikes(look_alikes: Work, name: str, measure: Any) -> None:
    """Learned descriptor to fix"""
    measure(look_alikes, name)


def route(places: int, dim: int, queries: int) -> tuple[Any, list[Any]]:
    """Descriptors along a route, neighbours alike, and those of a second drive over a part."""
    rng = np.random.default_rng(places)
    rows = np.empty((places, dim), np.float32)
    before = rng.standard_normal(dim, np.float32)
    for start in range(0, places, 1024):
        block = rows[start : start + 1024]
        rng.standard_normal(dtype=np.float32, out=block)
        block *= np.float32(np.sqrt(1 - ALONG**2))
        for row in block:
            row += np.float32(ALONG) * before
            before = row
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    drive = []
    for place in range(places // 3, places // 3 + queries):
        query = ACROSS * rows[place] + np.sqrt((1 - ACROSS**2) / dim) * rng.standard_normal(dim)
        drive.append((query / np.linalg.norm(query)).astype(np.float32))
    return rows, drive


def sad_route(places: int) -> tuple[Map, list[Any]]:
    """A route of random bytes, and a drive along a part of it, a third of its bytes replaced."""
    rng = np.random.default_rng(places)
    rows = rng.integers(0, 256, (places, BYTES), np.uint8)
    drive = rows[places // 3 : places // 3 + 6].copy()
    drive[:, ::3] = rng.integers(0, 256, drive[:, ::3].shape, np.uint8)
    return Map.from_descriptors(rows, metric="manhattan"), list(drive)


@pytest.fixture(scope="module", params=[2, None])
def threads(request: Any, quick: bool, enough_memory: Any) -> Work:
    count = request.param
    chosen = "two threads" if count else "threads chosen by size"
    places = (20_000 if quick else 100_000) if count else 1800
    name = f"u8 SAD push, {places:,} x {BYTES:,}, {chosen}"
    enough_memory(name, 2 * places * BYTES)
    known, queries = sad_route(places)
    one = localizer(known, queries, 1, 2, target=times(1.7) if count else LEVEL)
    entrants = {
        f"surefix, {chosen}": localizer(known, queries, count, 2),
        "surefix, one thread": one,
    }
    return Work(name, entrants, equal, places * BYTES + read_by_push(places, 2), count or 1)


@pytest.mark.parametrize("nth", [0, 1])
def test_threads(threads: Work, nth: int, measure: Any) -> None:
    """Two threads"""
    measure(threads, list(threads.entrants)[nth])


@pytest.fixture(scope="module")
def scale(quick: bool, enough_memory: Any) -> Work:
    places = 50_000 if quick else 1_000_000
    name = f"u8 SAD push, {places:,} x {BYTES:,}, a place's cost"
    enough_memory(name, 2 * (places + places // 10) * BYTES)
    (known, queries), (part, some) = sad_route(places), sad_route(places // 10)
    target = 1 / 1.3, "at most 1.3 x its cost"
    other = localizer(part, some, 1, 2, target=target, scale=10)
    entrants = {OURS: localizer(known, queries, 1, 2), f"surefix, {places // 10:,} places": other}

    def found(ours: Any, theirs: Any) -> str:
        # Two drives, each along its own map.
        for answer, size in ((ours, places), (theirs, places // 10)):
            if [fix[0] for fix in answer] != list(range(size // 3, size // 3 + 6)):
                return f"{size:,} places: expected 6 in a row from {size // 3} on, got {answer}"
        return ""

    return Work(name, entrants, found, places * BYTES + read_by_push(places, 2))


@pytest.mark.parametrize("nth", [0, 1])
def test_scale(scale: Work, nth: int, measure: Any) -> None:
    """A million places"""
    measure(scale, list(scale.entrants)[nth])


@pytest.fixture(scope="module")
def image() -> Work:
    places, small = 1800, (64, 32)
    # The map's images are small ones, drawn a hundred times faster: they are described alike.
    reference = Route(places=places, size=small).reference()
    known = Map.from_images(reference, Sad(), progress=False)
    winter = Route(places=places, size=(640, 480)).revisit()
    frames = [np.asarray(winter[places // 3 + query]) for query in range(IMAGES)]
    rows = np.asarray(known.descriptors)
    entrants = {OURS: localizer(known, frames, None)}
    if find_spec("scipy") and find_spec("PIL"):
        entrants["Pillow + NumPy + SciPy"] = pushing(
            lambda: ArrayLocalizer(rows, 3).push, frames, target=times(10)
        )
    read = frames[0].nbytes + rows.nbytes + read_by_push(places, 3)
    name = f"image to fix, 640 x 480 RGB, SAD, n = {places:,}"
    return Work(name, entrants, same_fixes, read)


@pytest.mark.parametrize("name", [OURS, "Pillow + NumPy + SciPy"])
def test_image(image: Work, name: str, measure: Any) -> None:
    """Image to fix"""
    measure(image, name)
