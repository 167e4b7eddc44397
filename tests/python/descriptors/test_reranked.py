"""Re-ranked candidates as distances of all places; Patch-NetVLAD's own package, if it is
installed.
"""

import configparser
import warnings
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import surefix
from surefix.descriptors import PatchNetVlad, Reranker, read_pairs, reranked_distances


@pytest.mark.parametrize("seed", range(200))
def test_who_was_not_looked_at_is_worse_finite_and_in_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 60))
    k = int(rng.integers(1, n + 1))
    scale = 10.0 ** rng.integers(-6, 7)
    coarse = np.round(rng.random(n) * scale, int(rng.integers(0, 8)))
    candidates = rng.permutation(n)[:k]
    scores = rng.choice(
        [
            rng.standard_normal(k),
            np.zeros(k),
            rng.integers(-3, 3, k).astype(float),
            1e6 + rng.random(k),
        ]
    )
    scores = scores * 10.0 ** rng.integers(-4, 5)
    got = reranked_distances(coarse, candidates, scores)
    assert got.shape == (n,)
    assert got.dtype == np.float32
    assert np.isfinite(got).all()
    np.testing.assert_array_equal(got[candidates], scores.astype(np.float32))
    others = np.setdiff1d(np.arange(n), candidates)
    if len(others):
        assert got[others].min() > got[candidates].max()
        order = others[np.argsort(coarse[others], kind="stable")]
        assert (np.diff(got[order]) >= 0).all()
        # Far apart in float32's eyes: the order is strict.
        span = np.ptp(coarse[others])
        for first, second in pairwise(order):
            if coarse[second] - coarse[first] > 1e-2 * span:
                assert got[second] > got[first]
    if n >= 2:
        surefix.Matcher(places=n, sequence_length=1).push(got)


def test_without_scores_the_order_is_the_score() -> None:
    got = reranked_distances(np.arange(6.0)[::-1], [4, 0, 2])
    assert got[[4, 0, 2]].tolist() == [0, 1, 2]
    assert got[5] < got[3] < got[1]
    assert reranked_distances([3.0, 1.0], [1, 0]).tolist() == [1, 0]
    assert reranked_distances([3.0, 1.0, 2.0], [0], [7.0]).argmin() == 0


def test_what_is_malformed_is_named() -> None:
    cases: list[tuple[Any, str]] = [
        (([], [0]), r"global_distances: expected numbers of one dimension, got float64 \(0,\)"),
        (([[1.0]], [0]), r"global_distances: .* got float64 \(1, 1\)"),
        (([1.0, np.nan], [0]), "global_distances: expected finite numbers, got nan at index 1"),
        (([1.0, 2.0], []), "candidates: expected at least one place's index"),
        (([1.0, 2.0], [0.0]), "candidates: expected at least one place's index, .* got float64"),
        (([1.0, 2.0], [2]), "candidates: expected places from 0 to 1, got 2"),
        (([1.0, 2.0], [-1]), "candidates: expected places from 0 to 1, got -1"),
        (([1.0, 2.0], [1, 1]), "candidates: expected each place once, got 1 twice"),
        (([1.0, 2.0], [1], [1.0, 2.0]), "scores: expected one for each of the 1 candidates, got 2"),
        (([1.0, 2.0], [1], [np.inf]), "scores: expected finite numbers, got inf at index 0"),
    ]
    for arguments, message in cases:
        with pytest.raises(surefix.SurefixValueError, match=message):
            reranked_distances(*arguments)


REFERENCES = [f"/data/summer/{index}.png" for index in range(5)]
QUERIES = [f"/data/winter/{index}.png" for index in range(3)]


def test_pairs_files_of_kapture_and_hloc_are_read(tmp_path: Path) -> None:
    file = tmp_path / "PatchNetVLAD_predictions.txt"
    lines = ["# kapture format: 1.0", "# query_image, map_image"]
    lines += [
        f"{QUERIES[query]}, {REFERENCES[place]}"
        for query, places in ((0, (3, 1)), (2, (4, 0)))
        for place in places
    ]
    file.write_text("\n".join(lines) + "\n")
    got = read_pairs(file, REFERENCES, QUERIES)
    assert [candidates.tolist() for candidates in got] == [[3, 1], [], [4, 0]]
    names = [Path(name).name for name in REFERENCES]
    assert [c.tolist() for c in read_pairs(file, names, QUERIES)] == [[3, 1], [], [4, 0]]
    file.write_text("winter/1.png summer/2.png\nwinter/1.png summer/0.png\n")
    assert [c.tolist() for c in read_pairs(file, REFERENCES, QUERIES)] == [[], [2, 0], []]
    for text, message in (
        ("only", "line 1: expected query, reference, got 'only'"),
        (
            "\n0.png, 9.png",
            r"line 2: expected one of the 5 references, got 9\.png: there is none of that name",
        ),
        ("7.png, 0.png", r"line 1: expected one of the 3 queries, got 7\.png"),
        (
            "0.png, 1.png\n0.png, 1.png",
            r"line 2: expected each pair once, got 1\.png twice for 0\.png",
        ),
    ):
        file.write_text(text)
        with pytest.raises(surefix.SurefixValueError, match=message):
            read_pairs(file, REFERENCES, QUERIES)
    file.write_text("0.png, summer/1.png")
    with pytest.raises(
        surefix.SurefixValueError, match=r"got summer/1\.png: several end in 1\.png"
    ):
        read_pairs(file, [*REFERENCES, "/data/spring/1.png"], QUERIES)
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(surefix.SurefixValueError, match="expected a text file in UTF-8"):
        read_pairs(file, REFERENCES, QUERIES)
    with pytest.raises(surefix.SurefixFileError, match="cannot read the pairs"):
        read_pairs(tmp_path / "no.txt", REFERENCES, QUERIES)


CONFIG = """
[feature_match]
matcher = {matcher}
n_values_all = 1,5
imageresizew = 160
imageresizeh = 128
patchweights2use = 0.6,0.4
[global_params]
patch_sizes = 2,5
strides = 1,1
"""
PLACES, SEEN, DIM = 9, 4, 16


@pytest.fixture
def features(tmp_path: Path) -> Path:
    """Features as the package's extraction writes them: query ``i`` is place ``2 i``, seen through
    noise.
    """
    pytest.importorskip("torch")
    pytest.importorskip("patchnetvlad")
    pytest.importorskip("cv2")
    rng = np.random.default_rng(2)
    for drive in ("summer", "winter"):
        (tmp_path / drive).mkdir()
    coarse = rng.standard_normal((PLACES, 32)).astype(np.float32)
    noise = rng.standard_normal((SEEN, 32)).astype(np.float32)
    np.save(tmp_path / "summer" / "globalfeats.npy", coarse)
    np.save(tmp_path / "winter" / "globalfeats.npy", coarse[: 2 * SEEN : 2] + 0.8 * noise)
    for size in (2, 5):
        spots = (8 - size + 1) * (10 - size + 1)
        patches = rng.standard_normal((PLACES, DIM, spots))
        patches /= np.linalg.norm(patches, axis=1, keepdims=True)
        for place in range(PLACES):
            np.save(
                tmp_path / "summer" / f"patchfeats_psize{size}_{place}.npy",
                patches[place].astype(np.float32),
            )
        for query in range(SEEN):
            seen = patches[2 * query] + 0.2 * rng.standard_normal((DIM, spots))
            seen /= np.linalg.norm(seen, axis=0)
            np.save(
                tmp_path / "winter" / f"patchfeats_psize{size}_{query}.npy", seen.astype(np.float32)
            )
    return tmp_path


@pytest.mark.parametrize("matcher", ["RANSAC", "spatialApproximator"])
def test_the_ranking_is_the_packages_own(features: Path, matcher: str) -> None:
    from patchnetvlad.models.local_matcher import local_matcher

    file = features / "config.ini"
    file.write_text(CONFIG.format(matcher=matcher))
    config = configparser.ConfigParser()
    config.read(file)
    summer, winter = (
        np.load(features / drive / "globalfeats.npy") for drive in ("summer", "winter")
    )
    route = surefix.Map.from_descriptors(summer, metric="euclidean")
    coarse = np.stack([route.distances(row) for row in winter], axis=1)
    places = [features / "summer" / f"{i}.png" for i in range(PLACES)]
    queries = [features / "winter" / f"{i}.png" for i in range(SEEN)]
    reranker = Reranker(PatchNetVlad(file), places, candidates=5)
    columns = reranker.distances(coarse, queries).T
    nearest = np.argsort(((summer[None] - winter[:, None]) ** 2).sum(2), axis=1)[:, :5]
    data = SimpleNamespace(
        images=[f"{i}.png" for i in range(PLACES)] + [f"{i}.png" for i in range(SEEN)], numDb=PLACES
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        theirs = local_matcher(
            nearest,
            data,
            str(features / "winter" / "patchfeats"),
            str(features / "summer" / "patchfeats"),
            config,
            "cpu",
        )
    matched = surefix.Matcher(places=PLACES)
    for query, (column, ranked) in enumerate(zip(columns, theirs, strict=True)):
        # Equal scores are in any order.
        assert (np.diff(column[ranked]) >= -1e-5).all()
        assert set(ranked) == set(np.argsort(column)[:5])
        assert column.argmin() == 2 * query
        assert matched.push(column).single.place == 2 * query
    plain = Reranker(PatchNetVlad(file, normalised=False), places, candidates=5)
    assert plain.distances(coarse, queries).argmin(axis=0).tolist() == [0, 2, 4, 6]


def test_a_missing_file_of_patches_and_a_wrong_configuration_are_named(features: Path) -> None:
    with pytest.raises(surefix.SurefixFileError, match=r"fast\.ini: cannot read the configuration"):
        PatchNetVlad("fast")
    reranker = Reranker(
        PatchNetVlad("speed"), [features / "summer" / f"{i}" for i in range(PLACES)]
    )
    with pytest.raises(
        surefix.SurefixFileError, match=r"patchfeats_psize\d_other0\.npy: cannot read the features"
    ):
        reranker.distances(np.arange(PLACES), features / "winter" / "other0.png")
    (features / "bad.ini").write_text("[feature_match]\nmatcher = RANSAC\n")
    with pytest.raises(
        surefix.SurefixValueError, match=r"bad\.ini: expected a configuration of Patch-NetVLAD"
    ):
        PatchNetVlad(features / "bad.ini")
