"""Settings chosen on a drive: on generated roads whose best setting is known, and by hand."""

import numpy as np
import pytest

import real_data
import surefix
from surefix import contradictions


def road(seed, noise, truth, places):
    """Distances of a drive with this truth."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(places, 24))
    seen = rows[truth] + noise * rng.normal(size=(len(truth), 24))
    return np.linalg.norm(rows[:, None] - seen[None], axis=2).astype(np.float32)


def starts(queries):
    """The drive begins anew every 40 queries, so that errors do not last."""
    return list(range(40, queries, 40))


def tune(*drive, **options):
    return surefix.tune(*drive, progress=False, **options)


def area(run, truth, judged):
    found = surefix.Matches(run.place, run.score, run.ready & judged)
    return surefix.evaluate(found, truth, recall="place_exists")


@pytest.fixture(scope="module")
def twice():
    """A drive at two places a query."""
    truth = np.arange(0, 1600, 2)
    return road(1, 4.0, truth, 1600), truth


@pytest.fixture(scope="module")
def paced(twice):
    return tune(twice[0], None, twice[1], gaps=starts(800), wrong=0.2)


def test_a_drive_at_two_places_a_query_is_told_by_its_truth(twice, paced):
    D, truth = twice
    assert (paced.chosen.name, paced.chosen.difference.low > 0) == ("steady, pace 2", True)
    settings = paced.settings
    assert settings.options["motion"]["pace"] == 2
    assert settings.options["motion"]["speeds"] == [1.0]
    # And it is better on the half that it was not chosen on.
    later = np.arange(800) >= 400
    gaps = starts(800)
    runs = [surefix.match_distances(D, gaps=gaps, config=settings)]
    runs.append(surefix.match_distances(D, gaps=gaps, motion="any", floor="running"))
    one, two = (area(run, truth, later).auc(1.0) for run in runs)
    assert one > two + 0.05


def test_its_trials_are_those_of_matches_and_evaluate(twice, paced):
    D, truth = twice
    gaps = starts(800)

    def matched(options):
        return surefix.match_distances(D, gaps=gaps, config=surefix.Settings(**options))

    runs = [matched(trial.options) for trial in paced.trials]
    # On the queries of the first half that no sequence among them warms up in.
    ready = np.logical_and.reduce([run.ready for run in runs]) & (np.arange(800) < 400)
    curves = [area(run, truth, ready) for run in runs]
    assert paced.settings.measured["judged"] == f"{ready.sum()} queries of the first half"
    assert [trial.name for trial in paced.trials[:3]] == ["any", "steady", "free"]
    for trial, curve in zip(paced.trials, curves, strict=True):
        expected = curve.auc(1.0), *curve.auc_interval(1.0)
        assert (trial.area, trial.area.low, trial.area.high) == expected
        expected = curve.auc_difference_interval(curves[0], 1.0)
        assert trial.difference == pytest.approx(curve.auc(1.0) - curves[0].auc(1.0))
        assert (trial.difference.low, trial.difference.high) == expected
    assert [trial for trial in paced.trials if trial.chosen] == [paced.chosen]
    lengths = [trial.name for trial in paced.trials if "no track" in trial.name]
    # A warm-up of 19 of each 40 queries leaves too few.
    assert lengths == [f"no track, L={length}" for length in (2, 5)]


def test_the_threshold_is_of_the_half_that_nothing_was_chosen_on(twice, paced):
    D, truth = twice
    run = surefix.match_distances(D, gaps=starts(800), config=paced.settings)
    later = np.arange(800) >= 400
    expected = surefix.calibrate(run, truth, 0.2, 0.95, only=later)
    assert paced.settings.threshold == expected
    assert expected.queries == 400
    assert paced.settings.measured["calibrated_on"] == "the second half"
    cut = surefix.Matches(run.place[400:], run.score[400:])
    alone = surefix.calibrate(cut, truth[400:], 0.2, 0.95)
    for name in ("score", "accepted", "errors", "block", "more"):
        assert getattr(alone, name) == getattr(expected, name)
    with pytest.raises(surefix.SurefixValueError, match="only"):
        surefix.calibrate(run, truth, only=later[1:])


def test_what_the_default_is_best_for_is_unchanged():
    rng = np.random.default_rng(3)
    truth = np.cumsum(np.repeat(rng.choice([0, 1, 2, 3], size=40), 15))
    truth = truth[truth < 800]
    D = road(1, 1.5, truth, 800)
    found = tune(D, None, truth, wrong=0.2)
    assert found.chosen is found.trials[0]
    usual = surefix.Settings(motion="any")
    assert found.settings.options == usual.options
    run = surefix.match_distances(D, config=usual)
    assert found.settings.threshold == surefix.calibrate(run, truth, 0.2)
    assert found.settings.measured["calibrated_on"] == "the whole drive"
    assert "any, area" in repr(found)


@pytest.mark.slow
def test_on_a_real_route_it_is_better_on_the_half_that_it_did_not_see():
    """As the table of docs/howto/tune.md says."""
    folder = real_data.folder() / "nordland"
    summer, winter = (np.load(folder / f"{name}_0000_1149.npy") for name in ("summer", "winter"))
    route = surefix.Map.from_images(list(summer), progress=False)
    rows = surefix.Map.from_images(list(winter), progress=False).descriptors
    truth, later = np.arange(1150), np.arange(1150) >= 575
    found = tune(route, rows, truth)
    assert found.chosen.name == "steady"
    assert found.contradictions == []
    runs = [surefix.match(route, rows, config=found.settings, progress=False)]
    runs.append(surefix.match(route, rows, motion="any", floor="running", progress=False))
    one, two = (area(run, truth, later).auc(1.0) for run in runs)
    assert one > two + 0.1
    assert tune(route, rows).chosen.name == "any"


@pytest.mark.parametrize("aligned", [False, True])
def test_a_useless_technique_loses_its_weight(aligned):
    truth = np.arange(600)
    useless = np.random.default_rng(9).random((600, 600)).astype(np.float32)
    D = road(0, 3.0, truth, 600)
    found = tune([D, useless], None, None if aligned else truth, gaps=starts(600))
    assert found.chosen.name == "any, weights 1,0"
    assert found.settings.options["technique_weights"] == [1, 0]
    assert sum("weights" in trial.name for trial in found.trials) == 4
    assert [trial.name for trial in found.trials if "weights" not in trial.name][1:2] == (
        [] if aligned else ["steady"]
    )


def test_an_alignment_chooses_no_motion_and_leaves_out_what_it_is_unsure_of(twice):
    D, _ = twice
    gaps = starts(800)
    alignment = surefix.align(D, gaps=gaps)
    found, given = (tune(D, None, truth, gaps=gaps) for truth in (None, alignment))
    assert [trial.name for trial in found.trials] == ["any"]
    assert found.trials == given.trials
    assert found.settings.threshold == given.settings.threshold
    run = surefix.match_distances(D, gaps=gaps, motion="any", floor="running")
    kept = (alignment.confidence >= 0.5) & (np.arange(800) < 400)
    assert 100 < kept.sum() < 390
    expected = area(run, alignment.place, kept)
    assert found.chosen.area == expected.auc(1.0)
    assert found.settings.threshold == surefix.calibrate(run, alignment)
    assert found.settings.measured["truth"] == "an alignment, motion any"
    assert found.settings.measured["right_within"] == "1 place"
    free = tune(D, None, None, gaps=gaps, motion="free")
    assert free.settings.options == surefix.Settings(motion="free").options


def test_a_map_gives_what_its_distances_give(tmp_path):
    rng = np.random.default_rng(2)
    rows = rng.normal(size=(300, 16)).astype(np.float32)
    seen = (rows + 1.2 * rng.normal(size=rows.shape)).astype(np.float32)
    where = np.stack([2.5 * np.arange(300), np.zeros(300)], axis=1)
    route = surefix.Map.from_descriptors(rows, positions=where)
    D = np.stack([route.distances(row) for row in seen], axis=1)
    truth = np.arange(300)
    found = tune(route, seen, truth, wrong=0.2)
    expected = tune(D, None, truth, wrong=0.2)
    assert found.trials == expected.trials
    # The file is what a localizer uses, and no other map's.
    file = tmp_path / "route.toml"
    found.settings.save(file)
    opened = surefix.Settings.open(file)
    assert opened == found.settings
    assert "surely" not in opened.measured["promise"]
    localizer = surefix.Localizer(route, config=file)
    run = surefix.match(route, seen, config=opened)
    fixes = [localizer.push(row) for row in seen]
    assert [fix.place for fix in fixes] == run.place.tolist()
    accepted = opened.threshold.accepts(run)
    assert accepted.sum() > 0
    assert [fix.accepted for fix in fixes] == accepted.tolist()
    with pytest.raises(surefix.SurefixValueError, match="the map that they were measured on"):
        surefix.Localizer(surefix.Map.from_descriptors(rows[:-1]), config=file)
    # Metres: by the map's positions, and by those of the queries.
    for known, tolerance in ((truth[:40], 1), ((where, where[:40]), 3), (None, 1)):
        short = tune(route, rows[:40], known, tolerance=tolerance, wrong=0.05).settings.threshold
        assert short.score is None
        assert short.more_metres / short.more == pytest.approx(2.5 * 39 / 40)


def test_positions_and_matrices_are_truths_too():
    truth = np.arange(200)
    D = road(4, 1.5, truth, 200)
    where = np.stack([truth * 2.0, truth * 0.0], axis=1)
    cells = np.abs(truth[:, None] - truth) <= 1
    by_place = tune(D, None, truth)
    by_metres = tune(D, None, (where, where), tolerance=2.5)
    assert by_metres.trials == by_place.trials
    assert by_metres.settings.measured["right_within"] == "2.5 metres"
    assert tune(D, None, cells, tolerance=0).trials == by_place.trials


def test_progress_counts_every_trial_and_stops():
    truth = np.arange(100)
    D = road(4, 1.5, truth, 100)
    seen = []
    surefix.tune(D, None, truth, progress=lambda *at: seen.append(at))
    assert seen[-1][0] == seen[-1][1]
    with pytest.raises(surefix.SurefixError, match="stopped"):
        surefix.tune(D, None, truth, progress=lambda done, total: total == 100)


def test_a_truth_that_contradicts_a_sure_alignment_is_named():
    truth = np.arange(200)
    D = road(4, 1.0, truth, 200)
    alignment = surefix.align(D, motion="steady")
    assert contradictions(alignment, truth) == []
    wrong = truth.copy()
    wrong[50:60] += 4  # more than 3 places
    wrong[80:82] += 50  # only two in a row
    wrong[100:130] = -1  # nothing is said
    wrong[150:153] -= 30
    wrong[170:180] += 3  # near enough
    for form in (wrong, np.where(wrong < 0, False, truth[:, None] == wrong)):
        found = contradictions(alignment, form)
        assert [(each.first, each.last) for each in found] == [(50, 59), (150, 152)]
        assert (found[0].truth, found[0].aligned) == ((54, 63), (50, 59))
    assert str(found[1]) == (
        "queries 150 to 152: places 120 to 122 by the truth, 150 to 152 by the alignment"
    )
    where = np.stack([truth * 2.0, truth * 0.0], axis=1)
    moved = where[np.maximum(wrong, 0)]
    moved[100:130] = 1e6
    found = contradictions(alignment, (where, moved), tolerance=2.5)
    assert [(each.first, each.last) for each in found] == [(150, 152)]
    assert [(each.first, each.last) for each in tune(D, None, wrong).contradictions] == [
        (50, 59),
        (150, 152),
    ]
    # An alignment that stands, or is not sure, contradicts nothing.
    stood = surefix.align(road(4, 1.0, np.full(100, 70), 200))
    assert np.ptp(stood.place[stood.confidence > 0.95]) == 0
    assert contradictions(stood, np.arange(100)) == []
    unsure = surefix.align(np.random.default_rng(0).random((200, 200)).astype(np.float32))
    assert contradictions(unsure, wrong) == []
    flat = where[:, 0]
    cases = {
        "each of 200 queries, got 199": wrong[1:],
        "whole numbers.*float64": wrong + 0.5,
        "whole numbers.*<U1": ["a"] * 200,
        r"the same axes, got \(200, 2\) and \(200, 3\)": (where, np.zeros((200, 3))),
        r"the same axes, got \(200,\) and \(200,\)": (flat, flat),
    }
    for words, bad in cases.items():
        with pytest.raises(surefix.SurefixValueError, match=words):
            contradictions(alignment, bad)


def test_what_a_drive_cannot_tell_is_said_or_refused():
    eye = 1 - np.eye(60, dtype=np.float32)
    perfect = tune(eye, None, np.arange(60))
    assert perfect.chosen is perfect.trials[0]
    assert perfect.settings.threshold.score is not None or perfect.settings.threshold.more
    hopeless = tune(eye, None, np.full(60, -1)).settings.threshold
    assert (hopeless.score, "nothing can be promised" in hopeless.promise) == (None, True)
    short = tune(eye[:, :8], None, np.arange(8)).settings.threshold
    assert short.promise.startswith("nothing can be promised")
    D = np.zeros((5, 0), np.float32)
    unsure = np.random.default_rng(0).random((60, 60)).astype(np.float32)
    cases = {
        "some in the first half": [(D,), (eye[:, :1], None, np.arange(1)), (unsure,)],
        "alignment is sure of": [(unsure,)],
        "each of 60 queries, got 59": [(eye, None, np.arange(59))],
        "alignment of 60 queries, got 59": [(eye, None, surefix.align(eye[:, :59]))],
        "images or descriptors, got none": [
            (surefix.Map.from_descriptors(np.eye(4, dtype=np.float32)),)
        ],
        "an empty list": [([],)],
        "truth": [(eye, None, np.arange(60) + 30), (eye, None, np.zeros((9, 9), bool))],
    }
    for words, drives in cases.items():
        for drive in drives:
            with pytest.raises(surefix.SurefixValueError, match=words):
                tune(*drive)
    for options in ({"wrong": 0.0}, {"sure": 1.0}, {"motion": "fast"}):
        with pytest.raises(surefix.SurefixValueError, match="option"):
            tune(eye, None, np.arange(60), **options)
