"""Every method by its name, as the command line chooses them."""

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from test_baselines import MATRICES, every_matrix
from test_baselines_supervised import route

import surefix
from surefix import baselines
from surefix.baselines import METHODS, Context, run_method

Array = npt.NDArray[Any]


def test_the_names() -> None:
    assert list(METHODS) == [
        "single",
        "masked",
        "gradient",
        "sequence",
        "sequence-10",
        "sequence-20",
        "weighted",
        "supervised-masked",
        "supervised-weighted",
        "perfect-masked",
        "perfect-weighted",
        "ratio",
        "spread",
        "seqslam",
        "topological",
        "track_steady",
        "track_free",
        "track_any",
        "track_odometry",
        "track",
        "fused",
    ]
    for method in METHODS.values():
        assert 10 < len(method.description) < 90
        assert "\n" not in method.description
    with pytest.raises(TypeError):
        METHODS["mine"] = METHODS["single"]  # type: ignore[index]


def test_a_name_runs_its_method_with_what_the_context_says() -> None:
    (D, truth), calibration = route(1, 60), route(2, 60)
    rng = np.random.default_rng(0)
    positions, advance = rng.normal(size=(60, 2)), rng.uniform(0.5, 1.5, D.shape[1])
    context = Context(
        sequence_length=3,
        weight=0.5,
        floor="running",
        tolerance=2,
        smoothing=1,
        gradient="unhalved",
        speeds=(0.5, 1.0),
        contrast=6,
        exclude=4,
        top=5,
        positions=positions,
        truth=truth,
        truth_tolerance=0,
        calibration=calibration,
        calibration_tolerance=3,
        advance=advance,
        techniques=[calibration[0]],
        motion=surefix.Motion("free", pace=2.0),
        technique_weights=(1.0, 0.5),
    )
    prediction: dict[str, Any] = {"tolerance": 2, "smoothing": 1, "gradient": "unhalved"}
    weighting: dict[str, Any] = {
        "sequence_length": 3,
        "weight": 0.5,
        "floor": "running",
        "speeds": (0.5, 1.0),
        **prediction,
    }
    right = baselines.perfect_predictor(D, truth, 0)
    taught = baselines.SupervisedPredictor().fit(*calibration, 3).predict(D)
    expected = {
        "single": baselines.single_frame(D),
        "masked": baselines.masked_single_frame(D, **prediction),
        "gradient": baselines.maximum_gradient(D, smoothing=1, gradient="unhalved"),
        "sequence": baselines.plain_sequence(D, sequence_length=3, speeds=(0.5, 1.0)),
        "sequence-10": baselines.plain_sequence(D, sequence_length=10, speeds=(0.5, 1.0)),
        "sequence-20": baselines.plain_sequence(D, sequence_length=20, speeds=(0.5, 1.0)),
        "weighted": baselines.weighted_sequence(D, **weighting),
        "supervised-masked": baselines.masked_single_frame(D, trusted=taught),
        "supervised-weighted": baselines.weighted_sequence(D, trusted=taught, **weighting),
        "perfect-masked": baselines.masked_single_frame(D, trusted=right),
        "perfect-weighted": baselines.weighted_sequence(D, trusted=right, **weighting),
        "ratio": baselines.ratio_test(D, exclude=4),
        "spread": baselines.spread(D, positions, top=5),
        "seqslam": baselines.plain_sequence(D, sequence_length=3, contrast=6, speeds=(0.5, 1.0)),
        "topological": baselines.topological(D),
        "track_steady": baselines.track(D, motion="steady", tolerance=2),
        "track_free": baselines.track(D, tolerance=2),
        "track_any": baselines.track(D, motion="any", tolerance=2),
        "track_odometry": baselines.track(D, motion="any", advance=advance, tolerance=2),
        "track": baselines.track(D, motion=context.motion, advance=advance, tolerance=2),
        "fused": baselines.track(
            [D, calibration[0]], motion=context.motion, tolerance=2, technique_weights=(1.0, 0.5)
        ),
    }
    assert expected.keys() == METHODS.keys()
    answers = set()
    for name, want in expected.items():
        got = run_method(name, D, context)
        for field in ("place", "score", "ready", "accepted"):
            np.testing.assert_array_equal(
                getattr(got, field), getattr(want, field), err_msg=f"{name} {field}"
            )
        answers.add((got.place.tobytes(), got.score.tobytes(), got.accepted.tobytes()))
    assert len(answers) == len(METHODS)


def test_without_a_context_the_defaults_are_the_functions() -> None:
    D = MATRICES["random 40 x 30"]
    for name, want in {
        "masked": baselines.masked_single_frame(D),
        "weighted": baselines.weighted_sequence(D),
        "sequence": baselines.plain_sequence(D),
        "ratio": baselines.ratio_test(D),
        "spread": baselines.spread(D),
        "seqslam": baselines.plain_sequence(D, contrast=10, speeds=(0.8, 0.9, 1.0, 1.1, 1.2)),
    }.items():
        np.testing.assert_array_equal(run_method(name, D).score, want.score)


@every_matrix
def test_no_method_ever_says_nan_or_leaves_the_map(D: Array) -> None:
    n, m = D.shape
    context = Context(
        exclude=0,
        truth=np.arange(m) % n,
        calibration=route(5),
        advance=np.ones(m),
        techniques=[D],
        motion="any",
    )
    for name in METHODS:
        matches = run_method(name, D, context)
        assert len(matches) == m
        assert ((matches.place >= 0) & (matches.place < n)).all(), name
        assert np.isfinite(matches.score).all(), name


def test_a_perfect_mask_has_no_mistakes_and_misses_nothing() -> None:
    D, truth = route(6)
    matches = run_method("perfect-masked", D, Context(truth=truth))
    evaluation = surefix.evaluate(matches, truth)
    assert evaluation.auc(1.0) == 1.0
    assert evaluation.max_recall == 1.0


def test_what_is_missing_is_named() -> None:
    D = MATRICES["random 40 x 30"]
    with pytest.raises(surefix.SurefixValueError, match=r"single, masked.*fused, got 'sinlge'"):
        run_method("sinlge", D)
    for name in METHODS:
        of = {
            "perfect": "truth",
            "supervised": "calibration",
            "track_odometry": "advance",
            "track": "motion",
            "fused": "techniques",
        }
        needs = of.get(name.partition("-")[0])
        assert METHODS[name].needs == needs
        if needs is not None:
            with pytest.raises(
                surefix.SurefixError, match=rf"method {name}: needs .*Context\({needs}="
            ):
                run_method(name, D, Context())


def test_the_segments_of_a_route_reach_each_of_surefixs_methods() -> None:
    D = np.random.default_rng(0).random((40, 30), np.float32)
    segments = surefix.Segments(40, breaks=[10, 25])
    for name, options in (
        ("weighted", {"floor": "global"}),
        ("sequence", {"floor": "global", "weight": 0.0}),
        ("track_free", {"motion": "free", "sequence_length": 1}),
    ):
        expected = surefix.match_distances(D, segments=segments, **options)
        found = run_method(name, D, Context(segments=segments))
        assert np.array_equal(found.place, expected.place)


def test_the_gaps_of_a_drive_reach_each_of_surefixs_methods() -> None:
    D = np.random.default_rng(0).random((40, 30), np.float32)
    for name, options in (
        ("weighted", {"floor": "global"}),
        ("track_free", {"motion": "free", "sequence_length": 1}),
    ):
        expected = surefix.match_distances(D, gaps=[7, 20], **options)
        found = run_method(name, D, Context(gaps=[7, 20]))
        assert np.array_equal(found.place, expected.place)
        np.testing.assert_array_equal(found.ready, expected.ready)
        assert not np.array_equal(found.score, run_method(name, D).score)


def test_no_line_of_seqslam_crosses_a_break() -> None:
    D = np.random.default_rng(2).random((40, 30), np.float32) + 1
    # A line from the end of the first road into the second, which no robot can drive.
    D[np.arange(5, 15), np.arange(10)] = 0
    segments = surefix.Segments(40, breaks=[10])
    context = Context(sequence_length=6, speeds=(1.0,), segments=segments)
    found = run_method("seqslam", D, context)
    assert run_method("seqslam", D, replace(context, segments=None)).place[7] == 12
    assert found.place[7] != 12
    enhanced = baselines.enhance_contrast(D, 10)
    how: Any = {"sequence_length": 6, "weight": 0.0}
    expected = surefix.match_distances(enhanced, segments=segments, **how)
    np.testing.assert_array_equal(found.place, expected.place)
