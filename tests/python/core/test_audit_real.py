"""Audit on real routes, beside the truth: each technique alone, and which of them is best."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import real_data
import surefix

Drives = dict[str, dict[str, Any]]

# Truth says "the same index"; a match is right within one place.


def distances(references: Any, queries: Any, descriptor: Any = None, post: Any = None) -> Any:
    if descriptor is None:
        route = surefix.Map.from_images(references, progress=False)
        rows = surefix.Map.from_images(queries, progress=False).descriptors
    else:
        route = surefix.Map.from_images(references, descriptor, post=post, progress=False)
        rows = descriptor.describe(queries)
    return np.stack([route.distances(row) for row in rows], axis=1)


def pairs() -> dict[str, tuple[Any, Any]]:
    """The images of each route and drive."""
    data = real_data.folder()
    found: dict[str, tuple[Any, Any]] = {}
    for name, one, two in (
        ("corridor", "reference", "query"),
        ("gardens_point", "day_left", "day_right"),
    ):
        files = (surefix.find_images(data / name / folder) for folder in (one, two))
        found[name] = tuple([surefix.read_image(file) for file in each] for each in files)
    summer, winter = (
        np.load(data / "nordland" / f"{season}_0000_1149.npy") for season in ("summer", "winter")
    )
    for start in (0, 400, 800):
        part = slice(start, start + 350)
        found[f"nordland {start}"] = list(summer[part]), list(winter[part])
    return found


@pytest.fixture(scope="module")
def drives() -> Drives:
    """The distances of each technique on each route."""
    data = real_data.folder()
    found: Drives = {name: {"Sad": distances(*images)} for name, images in pairs().items()}
    for file in sorted((data / "corridor" / "matrices").glob("*.npy")):
        found["corridor"][file.stem] = (1 - np.load(file)).astype(np.float32)
    return found


@pytest.fixture(scope="module")
def learned(drives: Drives) -> Drives:
    """The same with two outputs of a network, one good across viewpoints, one across seasons."""
    pytest.importorskip("onnxruntime")
    from surefix.descriptors import Onnx
    from surefix.post import Normalize, Standardize

    file = real_data.folder().parent / "models" / "efficientnet_lite0.onnx"
    if not file.exists():
        pytest.skip(f"no model {file}")
    posts = {"embedding": [Normalize()], "feat_s16": [Standardize("running"), Normalize()]}
    images = pairs()
    found: Drives = {}
    for name, matrices in drives.items():
        found[name] = dict(matrices)
        for output, post in posts.items():
            network = Onnx(file, output=output, size=(224, 224), threads=1)
            place_map = surefix.Map.from_images(images[name][0], network, post=post)
            localizer = surefix.Localizer(place_map, descriptor=network, sequence_length=1)
            columns = []
            for row in network.describe(images[name][1]):
                localizer.push(row)
                columns.append(np.array(localizer.distances))
            found[name][output] = np.stack(columns, axis=1)
    return found


def errors(
    drives: Drives, motion: str
) -> tuple[dict[tuple[str, str], Any], dict[tuple[str, str], Any]]:
    """Of recall@1, of trust, and how many are trusted: each technique by itself, and beside the
    others; trust is NaN if nothing is trusted.
    """
    alone, beside = {}, {}
    for name, matrices in drives.items():
        several = list(matrices.values())
        together = surefix.audit(several, motion=motion).techniques or (None,)
        for technique, both in zip(matrices, together, strict=True):
            D = matrices[technique]
            right = np.abs(D.argmin(0) - np.arange(D.shape[1])) <= 1
            for found, to in ((surefix.audit(D, motion=motion), alone), (both, beside)):
                if found is not None:
                    kept = right[found.trusted]
                    trust = found.trusted_precision - kept.mean() if len(kept) else np.nan
                    to[name, technique] = found.recall_at_1 - right.mean(), trust, len(kept)
    return alone, beside


def test_the_estimates_are_near_the_truth(drives: Drives) -> None:
    off = np.abs([each[:2] for each in errors(drives, "steady")[0].values()])
    assert len(off) == 15
    assert (np.nanmean(off, axis=0) < (0.06, 0.08)).all(), off
    assert np.nanmax(off) < 0.2, off


@pytest.mark.slow
def test_those_of_a_network_are_too(learned: Drives) -> None:
    off = np.abs([*errors(learned, "steady")[0].values()])
    assert len(off) == 25
    assert (np.nanmean(off[:, :2], axis=0) < (0.06, 0.08)).all(), off
    assert off[:, 0].max() < 0.2, off
    # One in ten of ten trusted matches is no estimate.
    many = off[:, 2] >= 20
    assert many.sum() >= 15
    assert np.nanmax(off[many, 1]) < 0.2, off


@pytest.mark.slow
@pytest.mark.parametrize("motion", ["free", "any"])
def test_a_weak_technique_is_audited_better_beside_others(learned: Drives, motion: str) -> None:
    """As the table of docs/howto/align.md says."""
    alone, beside = errors(learned, motion)
    chosen = [key for key in alone if key[0] != "corridor"]
    one, two = (np.abs([each[key][:2] for key in chosen]) for each in (alone, beside))
    assert (np.nanmean(one, axis=0) < (0.08, 0.1)).all(), one
    assert (np.nanmean(two, axis=0) < (0.04, 0.04)).all(), two
    assert np.nanmax(two) < 0.12, two


@pytest.mark.parametrize("motion", ["steady", "free", "any"])
def test_the_ranking_is_that_of_the_truth(drives: Drives, motion: str) -> None:
    check_ranking(drives["corridor"], motion)


@pytest.mark.slow
@pytest.mark.parametrize("motion", ["steady", "free", "any"])
def test_the_ranking_is_that_of_the_truth_with_a_network(learned: Drives, motion: str) -> None:
    for matrices in learned.values():
        check_ranking(matrices, motion)


def check_ranking(matrices: dict[str, Any], motion: str) -> None:
    truth, said = [], []
    audits = surefix.audit(list(matrices.values()), motion=motion).techniques
    for D, found in zip(matrices.values(), audits, strict=True):
        truth.append(np.mean(np.abs(D.argmin(0) - np.arange(D.shape[1])) <= 1))
        said.append(float(found.recall_at_1))
    assert np.argmax(said) == np.argmax(truth)
    ranks = [np.argsort(np.argsort(numbers)) for numbers in (said, truth)]
    assert np.corrcoef(*ranks)[0, 1] > 0.9
    # What is said to be better beyond the interval is not worse in truth.
    best = audits[int(np.argmax(said))]
    for found, right in zip(audits, truth, strict=True):
        assert best.difference(found).low <= 0 or right < max(truth)
