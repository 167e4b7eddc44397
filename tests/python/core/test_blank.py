"""What shows nothing is never trusted: dark frames and dark places on a generated road and on a
real one.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image, ImageDraw

import oracle
import real_data
import surefix
from surefix.post import Normalize, Pca, Standardize
from surefix.simulate import Route

Array = npt.NDArray[Any]
PLACES, LENGTH = 200, 2
DARK = range(80, 109)
KINDS = ["black", "white", "grey", "clock", "no signal", "hot pixels"]
PLACES_DARK = [[0], [100], [90, 91, 92], [0, 1, 2], [*range(90, 110)]]


def nothing(like: Array, kind: str, seed: int = 0) -> Array:
    """An image without content: a lens cap is never exactly flat, and a recorder writes on it."""
    if kind in ("black", "white"):
        return np.full_like(like, 255 * (kind == "white"))
    dice = np.random.default_rng(seed)
    if kind == "hot pixels":
        image = np.zeros_like(like)
        spots = dice.integers(0, like.shape[0], 30), dice.integers(0, like.shape[1], 30)
        image[spots] = 255
        return image
    if kind in ("clock", "no signal"):
        drawn = Image.new("RGB", like.shape[1::-1], "black" if kind == "clock" else (0, 0, 200))
        draw, side = ImageDraw.Draw(drawn), like.shape[0]
        if kind == "clock":
            text, size, at = f"2024-05-01 12:00:{seed % 60:02}", side / 9, (side / 20, 0.85 * side)
        else:
            text, size, at = "NO SIGNAL", side / 6, (0.5 * side, 0.4 * side)
        draw.text(at, text, fill="white", font_size=size)
        image = np.asarray(drawn)
        return image if like.ndim == 3 else np.asarray(drawn.convert("L"))
    noise = np.random.default_rng(seed).normal(128, 2, like.shape)
    return np.clip(np.round(noise), 0, 255).astype(np.uint8)


@cache
def road(seed: int) -> tuple[Array, Array]:
    """The images of the map and of a drive a season later."""
    route = Route(places=PLACES, seed=seed)
    reference, revisit = route.reference(), route.revisit()
    return np.stack([*map(np.asarray, reference)]), np.stack([*map(np.asarray, revisit)])


def darkened(images: Array, where: list[int] | range, kind: str) -> Array:
    images = images.copy()
    for at in where:
        images[at] = nothing(images[at], kind, at)
    return images


def right(run: surefix.Run, but: list[int]) -> float:
    """The share of right single matches at the other places."""
    truth = np.arange(len(run.place))
    near = np.abs(run.single_place - truth) <= 1
    return float(near[~np.isin(truth, but)].mean())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_good_drive_passes_dark_places_as_if_they_were_not_there(seed: int, kind: str) -> None:
    """At the dark places themselves nothing can be right."""
    reference, drive = road(seed)
    plain = surefix.match(surefix.Map.from_images(reference), drive)
    for dark in PLACES_DARK:
        route = surefix.Map.from_images(darkened(reference, dark, kind))
        assert route.blank.tolist() == dark
        run = surefix.match(route, drive)
        assert right(run, dark) > right(plain, dark) - 0.02, dark
        assert not np.isin(run.single_place, dark).any()
        assert not run.blank.any()
        truth = np.arange(PLACES)
        good = [np.mean(np.abs(r.single_place - truth)[r.trusted] <= 1) for r in (run, plain)]
        assert good[0] > good[1] - 0.04, dark


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_dark_drive_is_trusted_nowhere(seed: int, kind: str) -> None:
    reference, drive = road(seed)
    route = surefix.Map.from_images(reference)
    plain, dark = surefix.match(route, drive), darkened(drive, DARK, kind)
    for place in (None, 20, 90):
        there = [] if place is None else [place]
        route = surefix.Map.from_images(darkened(reference, there, kind))
        run = surefix.match(route, dark)
        assert not run.trusted[DARK].any()
        assert np.flatnonzero(run.blank).tolist() == list(DARK)
        told = surefix.match(route, dark, trusted=np.ones(PLACES, bool))
        assert told.trusted.tolist() == (~run.blank).tolist()
    # Beyond the window and the smoothing, places and scores after it are as without it.
    run = surefix.match(surefix.Map.from_images(reference), dark)
    after = slice(DARK.stop + LENGTH + 2, None)
    for name in ("place", "score", "trusted", "gradient_value", "anchors"):
        np.testing.assert_array_equal(getattr(run, name)[after], getattr(plain, name)[after])


def test_the_track_goes_on_in_the_dark_by_its_motion_alone() -> None:
    reference, drive = road(1)
    route = surefix.Map.from_images(reference)
    run = surefix.match(route, darkened(drive, DARK, "black"), motion="steady", tolerance=2)
    truth = np.arange(PLACES)
    assert (np.abs(run.place - truth) <= 2)[DARK].all()
    assert run.confidence is not None
    assert (np.diff(run.confidence[DARK]) <= 1e-9).all(), "nothing new is learnt"
    assert not run.trusted[DARK].any()


def test_what_shows_nothing_is_the_oracle_s() -> None:
    """On pictures between the two: more and more of a road under a black cover."""
    for image in road(3)[0][::20]:
        for covered in np.linspace(0, 1, 26):
            part = image.copy()
            part[: round(covered * len(part))] = 0
            assert surefix.Sad().shows_nothing(part) == oracle.shows_nothing(part)
        for kind in KINDS:
            assert oracle.shows_nothing(nothing(image, kind))
            assert surefix.Sad(dtype="f32").shows_nothing(nothing(image, kind))


def test_distances_are_the_oracle_s() -> None:
    """Of places and queries that show nothing, each the mean of the others."""
    reference, drive = road(2)
    dark = [0, 7, 8, 150]
    reference, drive = (
        darkened(reference, dark, "grey"),
        darkened(drive[:40], range(10, 15), "black"),
    )
    route = surefix.Map.from_images(reference)
    rows = np.stack([oracle.sad(image) for image in reference])
    raw = np.stack([oracle.sad_distances(oracle.sad(image), rows) for image in drive], axis=1)
    places = np.array([oracle.shows_nothing(image) for image in reference])
    queries = np.array([oracle.shows_nothing(image) for image in drive])
    assert np.flatnonzero(places).tolist() == dark
    D = oracle.without_blank(raw.astype(np.float32), places, queries)
    localizer = surefix.Localizer(route, motion=None)
    fixes = [localizer.push(image) for image in drive]
    expected = oracle.match(D, oracle.Options())
    assert [fix.blank for fix in fixes] == expected.blank.tolist() == queries.tolist()
    assert [fix.trusted for fix in fixes] == expected.trusted.tolist()
    assert [fix.place for fix in fixes] == expected.place.tolist()
    np.testing.assert_allclose([fix.score for fix in fixes], expected.score, rtol=1e-5)
    seen = np.stack([route.distances(surefix.Sad().describe(image)) for image in drive], axis=1)
    np.testing.assert_allclose(seen, D, rtol=1e-5)


@pytest.mark.parametrize("number", [0.0, 0.5, 3.0])
def test_distances_that_are_all_equal_say_nothing(number: float) -> None:
    matcher = surefix.Matcher(50)
    for _ in range(5):
        fix = matcher.push(np.full(50, number, np.float32))
        assert (fix.blank, fix.trusted) == (True, False)
    assert "blank=True" in repr(fix)
    fix = matcher.push(np.full(50, number, np.float32), trusted=True)
    assert not fix.trusted
    # Nor is it the floor of what comes after.
    D = np.random.default_rng(0).random((50, 30), np.float32) + 1
    D[:, 4] = number
    for floor in ("running", "global"):
        run = surefix.match_distances(D, floor=floor)
        other = D.copy()
        other[:, 4] = 7.0
        np.testing.assert_array_equal(
            run.score[7:], surefix.match_distances(other, floor=floor).score[7:]
        )
        assert np.flatnonzero(run.blank).tolist() == [4]
    assert surefix.match_distances(np.full((9, 5), number, np.float32), floor="global").blank.all()


def test_learned_descriptors_of_zeros_show_nothing_under_every_metric() -> None:
    rows = np.random.default_rng(0).normal(size=(40, 64)).astype(np.float32)
    rows[[3, 30]] = 0
    for metric in ("cosine", "euclidean", "manhattan"):
        route = surefix.Map.from_descriptors(rows, metric=metric)
        assert route.blank.tolist() == [3, 30]
        assert len(route.without_blank()) == 38
        localizer = surefix.Localizer(route)
        fix = localizer.push(np.zeros(64, np.float32))
        assert (fix.blank, fix.trusted) == (True, False)
        assert not localizer.push(rows[5]).blank
        again = surefix.Map.from_bytes(route.to_bytes())
        assert again.blank.tolist() == [3, 30]
    steps = [surefix.post.Standardize(), surefix.post.Normalize()]
    dark = surefix.match(surefix.Map.from_descriptors(rows, post=steps), rows)
    assert np.flatnonzero(dark.blank).tolist() == [3, 30], "as it is before post-processing"


class Edges:
    """A network's stand-in: what it makes of darkness is noise, but never zeros, nor twice the
    same.
    """

    name = "edges"
    recipe: dict[str, object] = {"name": "edges"}  # noqa: RUF012

    def describe(self, images: Any) -> Array:
        small = [np.asarray(Image.fromarray(each).convert("L").resize((16, 8))) for each in images]
        return np.float32([3 + np.diff(each.astype(float)).ravel() for each in small])


@pytest.mark.parametrize("steps", [None, [Standardize()], [Standardize(), Pca(20), Normalize()]])
@pytest.mark.parametrize("kind", ["black", "grey", "clock", "no signal"])
def test_dark_images_say_nothing_whatever_describes_them(kind: str, steps: Any) -> None:
    reference, revisit = road(1)
    dark = [20, 21, 22]
    given = darkened(reference, dark, kind), darkened(revisit, DARK, kind)
    route = surefix.Map.from_images(given[0], descriptor=Edges(), post=steps)
    assert route.blank.tolist() == dark
    run = surefix.match(route, given[1], descriptor=Edges(), motion="any")
    localizer = surefix.Localizer(route, descriptor=Edges(), motion="any")
    assert list(localizer.stream(given[1])) == list(run)
    assert np.flatnonzero(run.blank).tolist() == [*DARK]
    assert not run.trusted[DARK].any()


@pytest.mark.parametrize(
    "steps",
    [[Standardize()], [Normalize()], [Standardize("running"), Pca(4)], [Pca(9, whiten=False)]],
)
@pytest.mark.parametrize("metric", ["cosine", "euclidean"])
def test_zeros_show_nothing_after_post_processing_too(
    steps: Any, metric: Any, tmp_path: Path
) -> None:
    rows = np.random.default_rng(4).standard_normal((30, 16)).astype(np.float32)
    rows[[3, 4]] = 0
    route = surefix.Map.from_descriptors(rows, metric, post=steps)
    route.save(tmp_path / "route.safetensors")
    for known in (route, surefix.Map.open(tmp_path / "route.safetensors")):
        assert known.blank.tolist() == [3, 4]
        run = surefix.match(known, rows)
        assert np.flatnonzero(run.blank).tolist() == [3, 4]
        assert not np.isin(run.single_place[5:], [3, 4]).any()


def test_five_equal_descriptors_are_no_places_and_points_of_a_plane_are() -> None:
    rows = np.random.default_rng(0).normal(size=(40, 64)).astype(np.float32)
    rows[[1, 2, 5, 30]] = rows[0]
    route = surefix.Map.from_descriptors(rows)
    assert route.blank.tolist() == [0, 1, 2, 5, 30]
    fix = surefix.Localizer(route).push(rows[0])
    assert (fix.blank, fix.trusted) == (True, False)
    assert surefix.Map.from_descriptors(rows[1:]).blank.size == 0, "four may be alike"
    plane = surefix.Map.from_descriptors(np.zeros((9, 2), np.float32), metric="euclidean")
    assert plane.blank.size == 0


def test_a_map_leaves_them_out_on_request() -> None:
    reference, _ = road(1)
    images = darkened(reference[:30], [0, 9, 10, 29], "grey")
    where = np.arange(60.0).reshape(30, 2)
    route = surefix.Map.from_images(images, positions=where, skip_blank=True)
    kept = np.delete(np.arange(30), [0, 9, 10, 29])
    assert (len(route), route.blank.size) == (26, 0)
    assert route.names == [str(place) for place in kept]
    np.testing.assert_array_equal(route.positions, where[kept])
    with pytest.raises(surefix.SurefixValueError, match="at least 2 places, got 1"):
        surefix.Map.from_images(darkened(reference[:2], [1], "black"), skip_blank=True)


def test_the_list_is_in_the_file_and_grows_with_it(tmp_path: Path) -> None:
    reference, _ = road(1)
    images = darkened(reference[:30], [4, 20], "black")
    path = tmp_path / "route.safetensors"
    surefix.Map.build(path, images[:10])
    surefix.Map.append(path, images[10:15])
    surefix.Map.append(path, surefix.Map.from_images([*images[15:]]).slice(0, 15))
    for mmap in (False, True):
        assert surefix.Map.open(path, mmap=mmap).blank.tolist() == [4, 20]
    # Four at a time they are places; together they are too many.
    frozen = surefix.Map.from_images(reference[[0, 1, 2, 2, 2, 2]])
    assert frozen.blank.size == 0
    frozen.save(path)
    surefix.Map.append(path, frozen.slice(0, 3))
    assert surefix.Map.open(path).blank.tolist() == [2, 3, 4, 5, 8]
    assert frozen.extended(frozen).blank.tolist() == [2, 3, 4, 5, 8, 9, 10, 11]


@pytest.mark.parametrize("dark", [[0], [50], [40, 41, 42], [*range(40, 60)]])
@pytest.mark.parametrize("kind", ["black", "grey", "clock", "no signal"])
def test_gardens_point_with_frames_blanked(kind: str, dark: list[int]) -> None:
    reference, drive = gardens_point()
    plain = surefix.match(surefix.Map.from_images(reference), drive, sequence_length=5)
    route = surefix.Map.from_images(darkened(reference, dark, kind))
    assert route.blank.tolist() == dark
    run = surefix.match(route, drive, sequence_length=5)
    assert right(run, dark) > right(plain, dark) - 0.02
    run = surefix.match(route, darkened(drive, dark, kind), sequence_length=5)
    assert np.flatnonzero(run.blank).tolist() == dark
    assert not run.trusted[dark].any()
    assert right(run, dark) > right(plain, dark) - 0.02


@cache
def gardens_point() -> tuple[Array, Array]:
    """The paper's frames, made small: their descriptors stay nearly the same."""
    folder = real_data.folder() / "gardens_point"
    sides = [sorted((folder / side).iterdir()) for side in ("day_left", "day_right")]
    images = [[np.asarray(Image.open(path).resize((240, 135))) for path in side] for side in sides]
    return np.stack(images[0]), np.stack(images[1])
