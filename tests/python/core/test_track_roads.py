"""The tracker and the alignment on segments, closed ones and links, beside their oracles."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest
from test_align import oracle as smoothed
from test_track import Case, compare, generate

import surefix
from oracle import Array
from oracle_track import Roads
from surefix.simulate import Route

# With make test-long 10,000 cases.
SEEDS, CASES_PER_SEED = range(10), 1000 if "LONG" in os.environ else 60


def town(rng: np.random.Generator, n: int) -> surefix.Segments:
    """Segments with closed ones among them, and links between any two places."""
    breaks = np.flatnonzero(rng.random(n) < rng.choice([0.0, 0.05, 0.3]))
    breaks = breaks[breaks > 0]
    lengths = np.diff(np.concatenate([[0], breaks, [n]]))
    closed = np.flatnonzero((lengths > 2) & (rng.random(len(lengths)) < rng.choice([0.0, 0.5, 1])))
    alone = surefix.Segments(n, breaks, closed)
    after = Roads(alone).along(1)
    links = np.unique(rng.integers(n, size=(int(rng.choice([0, 1, 3, n])), 2)), axis=0)
    links = [(a, b) for a, b in links if a != b and not after[a, b]]
    return surefix.Segments(n, breaks, closed, links)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_tracker_equals_the_oracle(seed: int) -> None:
    rng = np.random.default_rng(1000 + seed)
    for number in range(CASES_PER_SEED):
        n = int(rng.integers(2, 40))
        case = generate(rng, n, int(rng.integers(1, 9)))
        if rng.random() < 0.2:  # laps, and moves about as long as those that follow links
            case.advance[:] += rng.choice([1e9, -9e11, 62.0, -63.0])
        case = Case(**{**vars(case), "segments": town(rng, n)})
        try:
            compare(case, -1)
        except AssertionError as error:
            raise AssertionError(f"seed {seed}, case {number}: {case}") from error


@pytest.mark.parametrize("seed", range(3))
def test_long_routes_equal_the_oracle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    case = generate(rng, 700, 6)
    segments = town(rng, 700)
    if seed == 0:
        segments = surefix.Segments(700, closed=True)
    compare(Case(**{**vars(case), "segments": segments}), -1)


@pytest.mark.parametrize("seed", range(60))
def test_the_alignment_equals_the_oracle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(2, 25)), int(rng.integers(1, 20))
    D = rng.random((n, m)).astype(np.float32)
    segments = town(rng, n)
    motion: Any = ("steady", "free", "any")[seed % 3]
    advance = rng.normal(0, 4, m) if seed % 2 == 0 else None
    at = rng.integers(0, n, (seed % 3, m))
    how: dict[str, Any] = {"motion": motion, "advance": advance, "tolerance": int(seed % 4)}
    got = surefix.align(D, segments=segments, at=at, **how)
    expected = smoothed([D], at=at, segments=segments, **how)
    np.testing.assert_array_equal(got.place, expected[:, 0])
    np.testing.assert_allclose(got.confidence, expected[:, 1], atol=1e-9)
    np.testing.assert_allclose(got.off_map, expected[:, 2], atol=1e-9)
    np.testing.assert_allclose(got.right, expected[:, 3:].T, atol=1e-9)
    # The belief in all places and off the map is 1.
    everywhere = np.tile(np.arange(n)[:, None], m)
    how["tolerance"] = 0
    each = surefix.align(D, segments=segments, at=everywhere, **how)
    np.testing.assert_allclose(each.right.sum(0) + each.off_map, 1.0, atol=1e-9)


def test_the_last_query_is_the_tracks_own() -> None:
    rng = np.random.default_rng(8)
    segments = town(rng, 30)
    D = rng.random((30, 20), np.float32)
    for motion in ("steady", "free", "any"):
        track = surefix.match_distances(D, motion=motion, segments=segments)
        aligned = surefix.align(D, motion=motion, segments=segments)
        assert aligned.confidence[-1] == pytest.approx(track.confidence[-1], abs=1e-12)
        assert aligned.place[-1] == track.place[-1]


@pytest.mark.parametrize("closed", [False, True])
def test_a_lap_ends_where_it_began(closed: bool) -> None:
    """Nothing is lost at the seam, where an open road begins anew."""
    rng = np.random.default_rng(4)
    at = np.arange(30, 90) % 60
    D = (0.2 * rng.random((60, 60)) + (np.abs(np.arange(60)[:, None] - at) > 0)).astype(np.float32)
    segments = surefix.Segments(60, closed=closed)
    # The view says nothing for a while before and after the seam.
    D[:, 25:36] = 0.5
    run = surefix.match_distances(D, motion="steady", segments=segments)
    seam = run.place[28:36]
    assert (seam == at[28:36]).all() == closed
    assert (run.confidence[35] > 0.5) == closed
    wide = surefix.match_distances(D, motion="steady", segments=segments, tolerance=10**9)
    np.testing.assert_allclose(wide.confidence + wide.off_map, 1.0)
    live = surefix.Matcher(segments, motion="free")
    intervals = np.array([live.push(np.ascontiguousarray(d)).track.interval for d in D.T])
    round_it = intervals[:, 0] > intervals[:, 1]
    assert round_it[28:33].any() == closed
    if closed:
        assert ((intervals[round_it, 1] - intervals[round_it, 0]) % 60).min() < 30


def junction() -> tuple[Array, Array]:
    """Three generated roads, and a winter's drive along the first and on along the third: distances
    and places.
    """
    roads = [Route(places=60, size=(96, 48), seed=seed) for seed in (1, 2, 3)]
    rows = [road.reference() for road in roads]
    sad = surefix.Sad()
    town = np.concatenate([np.stack([sad.describe(image) for image in each]) for each in rows])
    route = surefix.Map.from_descriptors(town, metric="manhattan")
    winter = [road.revisit(lateral_offset=0.8) for road in (roads[0], roads[2])]
    seen = [sad.describe(image) for each in winter for image in each]
    D = np.stack([route.distances(one) for one in seen], axis=1)
    return D, np.concatenate([np.arange(60), np.arange(120, 180)])


def test_a_drive_is_followed_through_a_junction() -> None:
    D, truth = junction()
    apart = surefix.Segments(180, breaks=[60, 120])
    linked = surefix.Segments(180, breaks=[60, 120], links=[(59, 60), (59, 120)])

    def frames_until_sure(segments: surefix.Segments) -> int:
        run = surefix.match_distances(D, motion="free", segments=segments)
        sure = (run.confidence > 0.9) & (np.abs(run.place - truth) <= 1)
        return 1 + int(np.argmax(sure[60:]))

    assert frames_until_sure(linked) < frames_until_sure(apart)


def test_what_does_not_fit_is_refused() -> None:
    D, segments = np.random.default_rng(0).random((9, 5), np.float32), surefix.Segments(8)
    for refuse in (surefix.align, surefix.audit, surefix.match_distances):
        with pytest.raises(surefix.SurefixValueError, match=r"segments.*expected 9.*got 8"):
            refuse(D, segments=segments)
        with pytest.raises(surefix.SurefixError, match="segments"):
            refuse(D, segments=[3])
    route = surefix.Map.from_descriptors(D)
    for on_a_map in (surefix.align, surefix.audit):
        with pytest.raises(surefix.SurefixValueError, match=r"segments.*none with a map"):
            on_a_map(route, D, segments=surefix.Segments(9))
