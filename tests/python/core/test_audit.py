"""Audit: estimates without ground truth, beside the truth."""

import copy
import pickle

import numpy as np
import pytest

import surefix
from surefix.auditing import SAMPLES, redrawn_sums
from surefix.simulate import Route


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


def test_fixes_of_a_run_are_audited_by_their_scores():
    D, _ = road(4, 2.0, 90)
    aligned = surefix.align(D, motion="steady")
    for run in (
        surefix.match_distances(D, motion="steady"),
        surefix.match_distances(D, sequence_length=10),
        surefix.Matches(D.argmin(0), D.min(0)),
    ):
        found = surefix.audit(D, motion="steady", run=run)
        near = surefix.align(D, motion="steady", at=[run.place]).right[0]
        np.testing.assert_array_equal(found.fix_right, near)
        score = np.median(run.score)
        accepted = run.ready & (run.score <= score)
        np.testing.assert_array_equal(found.accepted(score), accepted)
        assert found.accepted_precision(score) == pytest.approx(near[accepted].mean())
        assert found.accepted(np.inf).sum() == run.ready.sum()
        assert np.isnan(found.accepted_precision(-1e9))
    # A single match is audited as one.
    np.testing.assert_array_equal(found.fix_right, aligned.single_right)
    with pytest.raises(surefix.SurefixValueError, match=r"audit\(..., run=run\)"):
        surefix.audit(D).accepted_precision(0.1)


def test_techniques_are_audited_by_one_alignment():
    matrices = [road(6, noise, 120)[0] for noise in (1.0, 2.5)]
    found = surefix.audit(matrices, motion="steady")
    places = [D.argmin(0) for D in matrices]
    aligned = surefix.align(matrices, motion="steady", at=places)
    for each, right, D in zip(found.techniques, aligned.right, matrices, strict=True):
        alone = surefix.match_distances(D)
        np.testing.assert_array_equal(each.right, right)
        np.testing.assert_array_equal(each.distance, D.min(0))
        np.testing.assert_array_equal(each.trusted, alone.trusted)
        np.testing.assert_array_equal(each.confidence, aligned.confidence)
    np.testing.assert_array_equal(found.right, aligned.single_right)
    good, bad = found.techniques
    apart = good.difference(bad)
    assert apart == pytest.approx(good.recall_at_1 - bad.recall_at_1)
    assert 0 < apart.low < apart < apart.high
    assert bad.difference(good).high == pytest.approx(-apart.low)
    same = good.difference(good)
    assert (same, same.low, same.high) == (0, 0, 0)
    assert "of 2 techniques" in repr(found)
    assert surefix.audit(matrices[:1]).techniques == ()


def test_maps_and_images_give_what_their_matrices_give():
    road_ = Route(places=60, size=(96, 48))
    summer, winter = road_.reference(), road_.revisit(lateral_offset=0.8)
    sads = [surefix.Sad(size=(64, 32)), surefix.Sad(size=(32, 16))]
    maps = [surefix.Map.from_images(summer, sad) for sad in sads]
    rows = [np.stack([sad.describe(image) for image in winter]) for sad in sads]
    matrices = [
        np.stack([each.distances(row) for row in seen], axis=1)
        for each, seen in zip(maps, rows, strict=True)
    ]
    expected = surefix.audit(matrices)
    for queries in (winter, rows):
        found = surefix.audit(maps, queries)
        for one, two in zip(found.techniques, expected.techniques, strict=True):
            np.testing.assert_array_equal(one.right, two.right)
            np.testing.assert_array_equal(one.trusted, two.trusted)
    one, two = surefix.audit(maps[0], winter), surefix.audit(matrices[0])
    np.testing.assert_array_equal(one.right, two.right)


@pytest.mark.parametrize("block", [1, 7, 10, 50])
def test_drives_are_redrawn_in_blocks(block):
    rows = np.random.default_rng(block).random((2, 50))
    sums = redrawn_sums(rows, block)
    generator = np.random.default_rng(0)
    starts = generator.integers(50, size=(SAMPLES, -(-50 // block)))
    drawn = (starts[:, :, None] + np.arange(block)).reshape(SAMPLES, -1)[:, :50] % 50
    np.testing.assert_allclose(sums, rows[:, drawn].sum(-1), rtol=1e-12)


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


def test_what_does_not_fit_is_refused():
    D, _ = road(1, 2.0, 30)
    run = surefix.match_distances(D)
    route = surefix.Map.from_descriptors(np.eye(30, dtype=np.float32))
    holed = D.copy()
    holed[7, 3] = np.nan
    cases = {
        "run: expected a fix for each of 12 queries, got 30": ([D[:, :12]], {"run": run}),
        "run: expected places from 0 to 9, got": ([D[:10]], {"run": run}),
        "expected images or descriptors, got none": ([[route, route]], {}),
        "several techniques.*30, 30.*30, 9": ([[D, D[:, :9]]], {}),
        "several techniques.*30, 30.*9, 30": ([[D, D[:9]]], {}),
        "map: expected a surefix.Map": ([[route, 3], np.eye(30, dtype=np.float32)], {}),
        "got an empty list": ([[]], {}),
        "1 to 32": ([[D] * 33], {}),
        "reranked: .* NaN at place 7, query 3": ([D], {"reranked": holed}),
    }
    for words, (given, options) in cases.items():
        with pytest.raises(surefix.SurefixValueError, match=words):
            surefix.audit(*given, **options)
    with pytest.raises(surefix.SurefixValueError, match="the same 30 queries, got 12"):
        surefix.audit(D).difference(surefix.audit(D[:, :12]))
