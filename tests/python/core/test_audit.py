"""Audit: estimates without ground truth, beside the truth."""

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest

import surefix

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"


def road(seed, noise, places=300):
    """Distances of a drive at a place a query, and its truth."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(places, 24))
    seen = rows + noise * rng.normal(size=rows.shape)
    D = np.linalg.norm(rows[:, None] - seen[None], axis=2)
    return D.astype(np.float32), np.arange(places)


def errors(D, truth, motion):
    """Of recall@1 and of the precision of trust; NaN if nothing is trusted."""
    found = surefix.audit(D, motion=motion)
    right = np.abs(D.argmin(0) - truth) <= 1
    recall = found.recall_at_1 - right.mean()
    trust = found.trusted_precision - right[found.trusted].mean() if found.trusted.any() else np.nan
    return recall, trust


@pytest.mark.parametrize("noise", [0.5, 1.5, 2.5])
@pytest.mark.parametrize("motion", ["steady", "free", "any"])
def test_the_estimates_are_near_the_truth_on_generated_roads(motion, noise):
    both = np.array([errors(*road(seed, noise), motion) for seed in range(5)])
    assert np.abs(both[:, 0]).max() < 0.06
    assert np.nanmax(np.abs(both[:, 1])) < 0.12


def test_the_estimates_are_near_the_truth_on_real_routes():
    files = sorted((DATA / "corridor" / "matrices").glob("*.npy"))
    if not files:
        pytest.skip(f"no real distances in {DATA}")
    drives = [(1 - np.load(path)).astype(np.float32) for path in files]
    nordland = [DATA / "nordland" / f"{season}_0000_1149.npy" for season in ("summer", "winter")]
    summer, winter = (np.load(path) for path in nordland)
    for start in (0, 400, 800):
        route = surefix.Map.from_images(summer[start : start + 350])
        images = winter[start : start + 350]
        rows = [route.descriptor.describe(image) for image in images]
        drives.append(np.stack([route.distances(row) for row in rows], axis=1))
    both = np.array([errors(D, np.arange(D.shape[1]), "steady") for D in drives])
    off = np.abs(both)
    assert (np.nanmean(off, axis=0) < (0.06, 0.08)).all(), off
    assert np.nanmax(off) < 0.2, off


def test_its_parts_are_those_of_the_alignment_and_of_the_matches():
    D, _ = road(1, 2.0, 80)
    found = surefix.audit(D, motion="steady", tolerance=2)
    aligned = surefix.align(D, motion="steady", tolerance=2)
    run = surefix.match_distances(D, tolerance=2)
    np.testing.assert_array_equal(found.right, aligned.single_right)
    np.testing.assert_array_equal(found.trusted, run.trusted)
    assert aligned.single_place.tolist() == D.argmin(0).tolist()
    same = aligned.single_place == aligned.place
    np.testing.assert_allclose(aligned.single_right[same], aligned.confidence[same])
    assert found.recall_at_1 == pytest.approx(found.right.mean())
    bar = np.median(found.distance)
    assert found.precision_at(bar) == pytest.approx(found.right[found.distance <= bar].mean())
    for share in (found.recall_at_1, found.trusted_precision, found.precision_at(bar)):
        assert share.low <= share <= share.high
    assert np.isnan(found.precision_at(-1.0))
    assert (len(found), str(found.recall_at_1) in repr(found)) == (80, True)


def test_a_map_gives_what_its_matrix_gives():
    rng = np.random.default_rng(2)
    rows = rng.normal(size=(70, 12)).astype(np.float32)
    seen = (rows + rng.normal(size=rows.shape)).astype(np.float32)
    route = surefix.Map.from_descriptors(rows)
    D = np.stack([route.distances(row) for row in seen], axis=1)
    np.testing.assert_array_equal(surefix.audit(route, seen).right, surefix.audit(D).right)


def test_an_estimate_is_a_number_that_is_copied_whole():
    share = surefix.Estimate(0.5, 0.25, 0.75)
    for again in (copy.copy(share), pickle.loads(pickle.dumps(share))):
        assert (again, again.low, again.high) == (0.5, 0.25, 0.75)
    assert f"{share}" == "0.500 (0.250 to 0.750)"


def test_no_query_is_refused():
    with pytest.raises(surefix.SurefixValueError, match="at least one query"):
        surefix.audit(np.zeros((5, 0), np.float32))
