"""Thresholds with a promise: beside an oracle, other libraries, and simulated drives."""

import numpy as np
import pytest
from mapie.risk_control.methods import compute_hoeffding_bentkus_p_value
from scipy.stats import norm
from sklearn.isotonic import IsotonicRegression

import surefix
from surefix import SurefixValueError
from surefix._core import block_length


def matches(wrong, score):
    """Matches of which some are wrong, and their truth."""
    place = np.arange(len(score))
    return surefix.Matches(place=place, score=score), np.where(wrong, -1, place)


def lasting(rng, count, tau):
    """Normal numbers whose correlation falls as exp(-k / tau)."""
    keep = np.exp(-1 / tau) if tau else 0.0
    fresh = rng.normal(size=count)
    for query in range(1, count):
        fresh[query] = keep * fresh[query - 1] + np.sqrt(1 - keep**2) * fresh[query]
    return fresh


# The oracle, from section 1.12 of the design.


def slow_time(x):
    off = np.asarray(x, float) - np.mean(x)
    rho = [np.sum(off[: len(off) - k] * off[k:]) / np.sum(off**2) for k in range(len(off))]
    total, lag = -1.0, 0
    while lag + 1 < len(rho) and rho[lag] + rho[lag + 1] > 0:
        total += 2 * (rho[lag] + rho[lag + 1])
        lag += 2
    return max(total, 1.0)


def slow_block(wrong):
    few = min(np.sum(wrong), len(wrong) - np.sum(wrong))
    m = len(wrong)
    if few == 0:
        return int(np.ceil(np.sqrt(m)))
    t = slow_time(wrong)
    return min(m, int(np.ceil(t * (1 + 1.64 * np.sqrt(10 * t / m + t / (2 * few))))))


def slow_threshold(score, wrong, most, sure):
    """The threshold and the block of its test."""

    def capital(flags, accepted, block):
        gain = np.where(accepted, flags - most, 0.0)
        gain = np.append(gain, np.zeros(-len(gain) % block)).reshape(-1, block).mean(1)
        bets = np.array([0.3, 0.6, 0.95])[:, None] / (1 - most)
        return np.mean(np.prod(1 - bets * gain, axis=1))

    ordered = np.sort(score)
    count, counts = np.ceil(np.log(1 - sure) / np.log(1 - most)), []
    while int(count) < len(score):
        counts.append(int(count))
        count *= 1.1
    lines = [ordered[count - 1] for count in [*counts, len(score)]]
    block = both = slow_block(wrong)
    blocks = []
    for line in lines[::-1]:
        those = wrong * (score <= line)
        if np.sum(those) >= 5 and np.ptp(those):
            block = min(both, slow_block(those))
        blocks.insert(0, int(np.ceil(np.sqrt(both * block))))
    for few in (1 / 3, 1 / 6, 0):
        enough = [
            capital(np.full(len(score), few * most), score <= line, block) >= 1 / (1 - sure)
            for line, block in zip(lines, blocks, strict=True)
        ]
        if any(enough):
            lines, blocks = lines[enough.index(True) :], blocks[enough.index(True) :]
            break
    else:
        return None, blocks[-1]
    found = None, blocks[0]
    for line, block in zip(lines, blocks, strict=True):
        if capital(wrong, score <= line, block) < 1 / (1 - sure):
            break
        found = line, block
    return found


@pytest.mark.parametrize("tau", [0, 2, 8])
@pytest.mark.parametrize(("most", "sure"), [(0.05, 0.95), (0.1, 0.9), (0.3, 0.99)])
def test_the_threshold_is_that_of_the_oracle(tau, most, sure):
    promised = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        count = int(rng.integers(1, 1500))
        score = np.round(lasting(rng, count, tau), 1 + seed % 2).astype(np.float32)
        wrong = lasting(rng, count, tau) + 0.8 * score > rng.uniform(0.5, 3)
        found = surefix.calibrate(*matches(wrong, score), wrong=most, sure=sure)
        expected, block = slow_threshold(score, wrong.astype(float), most, sure)
        assert (found.score, found.block) == (expected, block)
        if expected is not None:
            promised += 1
            assert found.accepted == np.sum(score <= expected)
            assert found.errors == np.sum(wrong[score <= expected])
    assert promised > 2


def test_the_block_length_is_that_of_the_oracle():
    rng = np.random.default_rng(0)
    for tau in (0, 3, 20):
        wrong = (lasting(rng, 500, tau) > 1).astype(np.float32)
        assert block_length(wrong) == slow_block(wrong.astype(float))
    assert block_length(np.full(9, 0.3, np.float32)) is None


@pytest.mark.parametrize("seed", range(6))
def test_independent_drives_are_those_of_mapie(seed):
    rng = np.random.default_rng(seed)
    count, most, sure = 400, 0.1, 0.9
    score = rng.permutation(count).astype(np.float32) / count
    wrong = rng.random(count) < 0.3 * score
    found = surefix.calibrate(*matches(wrong, score), wrong=most, sure=sure, independent=True)
    # The same thresholds, strict to lax, each accepting 1.1 times as many.
    start, counts = np.ceil(np.log(1 - sure) / np.log(1 - most)), []
    while int(start) < count:
        counts.append(int(start))
        start *= 1.1
    lines = np.sort(score)[np.array([*counts, count]) - 1]
    accepted = np.array([np.sum(score <= line) for line in lines])

    def values(errors):
        # A little less, as MAPIE rounds up to whole errors.
        share = np.maximum(errors - 1e-6, 0) / accepted
        return compute_hoeffding_bentkus_p_value(share, accepted, most, binary=True)[:, 0]

    start = np.argmax(values(np.ceil(accepted * most / 3)) <= 1 - sure)
    lines, accepted = lines[start:], accepted[start:]
    passes = values(np.array([np.sum(wrong & (score <= line)) for line in lines])) <= 1 - sure
    expected = len(lines) if passes.all() else np.argmin(passes)
    assert (0 if found.score is None else np.sum(lines <= found.score)) == expected
    assert found.block is None


def test_probabilities_are_those_of_scikit_learn():
    for seed in range(10):
        rng = np.random.default_rng(seed)
        score = np.round(rng.normal(size=200), seed % 3).astype(np.float32)
        wrong = rng.random(200) < 1 / (1 + np.exp(-2 * score))
        found = surefix.calibrate(*matches(wrong, score))
        ends = [score.min(), *score, score.max()]
        isotonic = IsotonicRegression(increasing=False, out_of_bounds="clip")
        isotonic.fit(np.array(ends, float), np.array([0, *(~wrong), 1], float))
        asked = np.concatenate([score, rng.normal(scale=2, size=500).astype(np.float32)])
        asked = np.minimum(asked, score.max())
        got = found.probability(surefix.Matches(place=np.zeros(700, int), score=asked))
        np.testing.assert_allclose(got, isotonic.predict(asked.astype(float)), atol=1e-9)
        assert got.min() > 0
        assert got.max() < 1


def test_scores_beyond_those_of_the_drive_are_not_believed():
    score = np.linspace(0.1, 0.3, 200, dtype=np.float32)
    found = surefix.calibrate(*matches(np.arange(200) > 150, score))
    last, half, limit, beyond = found.probability(
        surefix.Matches(place=[0] * 4, score=[0.3, 0.4, 0.5, 9.0])
    )
    assert half == pytest.approx(last / 2, rel=1e-5)
    assert last > 0
    assert limit == pytest.approx(0, abs=1e-6)
    assert beyond == 0

    # A track's score ends at 1, a confidence of 0.
    D = np.random.default_rng(0).random((60, 60), np.float32) - np.eye(60, dtype=np.float32)
    run = surefix.match_distances(D, motion="steady")
    tracked = surefix.calibrate(run, np.arange(60), wrong=0.3)
    lost = surefix.match_distances(
        np.random.default_rng(1).random((60, 60), np.float32), motion="any"
    )
    low = tracked.probability(lost)[lost.score > run.score.max()]
    assert len(low)
    assert (np.diff(low[np.argsort(lost.score[lost.score > run.score.max()])]) <= 0).all()


def test_matches_that_a_mask_rejects_are_not_accepted():
    score = np.linspace(0, 1, 400, dtype=np.float32)
    mask = np.arange(400) % 2 == 0
    masked = surefix.Matches(place=np.arange(400), score=score, accepted=mask)
    truth = np.where(mask, np.arange(400), -1)
    found = surefix.calibrate(masked, truth, wrong=0.1, block=1)
    assert found.queries == found.accepted == 200
    assert found.accepts(masked).tolist() == mask.tolist()


def true_risk(limits, offset, slope):
    """The share of wrong among the scores up to each limit, if a match is wrong when
    ``lasting > offset - slope * score``.
    """
    s = np.linspace(-9, 9, 20001)
    inside = np.cumsum(norm.pdf(s) * norm.sf(offset - slope * s)) * (s[1] - s[0])
    return np.interp(limits, s, inside) / norm.cdf(limits)


@pytest.mark.slow
@pytest.mark.parametrize("slope", [0.0, 1.0])
def test_few_dependent_drives_of_10000_break_their_promise(slope):
    """5000 of each kind. If scores say nothing (slope 0), all that pass break the promise."""
    most, sure, queries = 0.1, 0.95, 1150
    broken, promised, drives = {}, 0, 0
    for tau in (0, 3, 10, 30):
        broken[tau] = 0
        rng = np.random.default_rng(tau)
        keep = np.exp(-1 / tau) if tau else 0.0
        z = rng.normal(size=(2, 1250, queries))
        for query in range(1, queries):
            z[..., query] = keep * z[..., query - 1] + np.sqrt(1 - keep**2) * z[..., query]
        # Without a slope, a little more is wrong than promised at every threshold.
        offset = 1.5 if slope else norm.isf(most * 1.01)
        limits = np.linspace(-4, 4, 1601)
        risk = true_risk(limits, offset, slope)
        for score, error in zip(z[0].astype(np.float32), z[1], strict=True):
            found = surefix.calibrate(
                *matches(error > offset - slope * score, score), wrong=most, sure=sure
            )
            drives += 1
            if found.score is not None:
                promised += 1
                broken[tau] += np.interp(found.score, limits, risk) > most
    assert drives == 5000
    assert sum(broken.values()) <= (1 - sure) * drives
    # A drive of 38 correlation times is short; if scores say nothing, it is too short.
    allowed = 0.08 if slope == 0 else 1 - sure
    for tau, count in broken.items():
        assert count <= (allowed if tau == 30 else 1 - sure) * 1250, (tau, count)
    # The promise is worth something: 1.00, 0.99, 0.18 and 0.03 of the drives of each tau have one.
    assert promised > 0.5 * drives if slope else promised < 0.05 * drives


@pytest.mark.slow
def test_a_drive_that_happens_to_have_no_error_promises_little():
    """Errors in stretches of 30 queries, two a drive, which scores do not show."""
    rng, queries, share, length = np.random.default_rng(1), 1150, 0.055, 30
    broken = without = 0
    for _ in range(1000):
        wrong, now = np.zeros(queries, bool), rng.random() < share
        for query, chance in enumerate(rng.random(queries)):
            wrong[query] = now
            ends, begins = 1 / length, share / (1 - share) / length
            now = chance >= ends if now else chance < begins
        found = surefix.calibrate(*matches(wrong, rng.random(queries).astype(np.float32)))
        broken += found.score is not None
        without += not wrong.any()
    assert 70 < without < 150
    assert broken < 65


def test_what_nothing_can_be_promised_of():
    score = np.arange(40, dtype=np.float32)
    short = surefix.calibrate(*matches(score < 0, score), block=1, metres=400)
    assert short.score is None
    assert not short.accepts(surefix.Matches([0], [0.0])).any()
    assert 40 < short.more < 60
    assert short.more_metres == pytest.approx(10 * short.more)
    assert "nothing can be promised" in short.promise
    assert " m, would do" in short.promise
    longer = np.arange(40 + short.more, dtype=np.float32)
    assert surefix.calibrate(*matches(longer < 0, longer), block=1).score is not None
    hopeless = surefix.calibrate(*matches(score >= 0, score))
    assert "would not change that" in hopeless.promise
    assert hopeless.score is None
    assert hopeless.more is None
    alone = surefix.calibrate(*matches(score < 0, score), independent=True, wrong=0.01)
    assert alone.more == pytest.approx(299 - 40, rel=0.2)


def test_a_run_is_judged_as_its_fixes_are():
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(400, 16))
    D = np.linalg.norm(rows[:, None] - (rows + rng.normal(size=rows.shape))[None], axis=2)
    D = D.astype(np.float32)
    for motion in (None, "steady"):
        run = surefix.match_distances(D, motion=motion, sequence_length=3)
        found = surefix.calibrate(run, np.arange(400), wrong=0.1, block=1)
        accepted, probable = found.accepts(run), found.probability(run)
        assert accepted.tolist() == [found.accepts(fix) for fix in run]
        each = [found.probability(fix) for fix in run]
        assert each == [None if np.isnan(p) else p for p in probable]
        assert accepted[run.ready].tolist() == (run.score <= found.score)[run.ready].tolist()
        assert not accepted[~run.ready].any()
        assert found.accepted == accepted.sum()
        assert (found.confidence is None) == (motion is None)
    with pytest.raises(SurefixValueError, match=r"with a track.*without"):
        found.accepts(surefix.match_distances(D))
    with pytest.raises(SurefixValueError, match=r"with a track.*without"):
        found.carried_to(surefix.match_distances(D))


def test_by_an_alignment_doubt_counts_as_wrong():
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(500, 16))
    D = np.linalg.norm(rows[:, None] - (rows + 1.5 * rng.normal(size=rows.shape))[None], axis=2)
    D = D.astype(np.float32)
    run = surefix.match_distances(D, sequence_length=4)
    alignment = surefix.align(D, motion="steady")
    by_truth = surefix.calibrate(run, np.arange(500), wrong=0.2)
    by_alignment = surefix.calibrate(run, alignment, wrong=0.2)
    assert by_truth.score is not None
    assert by_alignment.score is not None
    off = np.abs(run.place - alignment.place) > 1
    doubt = np.where(off, 1, 1 - alignment.confidence)[by_alignment.accepts(run)].sum()
    assert by_alignment.errors == pytest.approx(doubt)
    assert abs(by_alignment.accepted - by_truth.accepted) < 100


def test_a_threshold_is_carried_over_by_its_quantile():
    rng = np.random.default_rng(2)
    score = np.sort(rng.gamma(2, size=1000)).astype(np.float32)
    found = surefix.calibrate(*matches(rng.random(1000) < score / 40, score), wrong=0.1)
    assert found.score is not None
    assert not found.carried
    # Other light: all distances twice as large and a half more.
    dark = surefix.Matches(place=np.arange(1000), score=rng.permutation(2 * score + 0.5))
    there = found.carried_to(dark)
    assert there.accepts(dark).sum() == found.accepted
    assert there.score == pytest.approx(2 * found.score + 0.5, rel=1e-5)
    again = np.sort(found.probability(surefix.Matches(np.arange(1000), score)))
    # Quantiles are a little coarse at a step.
    assert np.abs(np.sort(there.probability(dark)) - again).mean() < 0.002
    assert there.carried
    assert "nothing is promised" in there.promise


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"wrong": 0}, "`wrong`: expected a share between 0 and 1, got 0"),
        ({"sure": 1.0}, "`sure`: expected a share between 0 and 1, got 1"),
        ({"block": 0}, "`block`: expected at least 1 query"),
        ({"block": 3, "independent": True}, "`block`: .*none if they are independent"),
        ({"metres": -1.0}, "`metres`: expected metres, 0 or more"),
        ({"tolerance": 0.5}, "`tolerance`: expected a whole number"),
    ],
)
def test_options_outside_their_range(change, message):
    with pytest.raises(SurefixValueError, match=message):
        surefix.calibrate(*matches([False], np.zeros(1, np.float32)), **change)


def test_drives_that_cannot_be_used():
    run = surefix.match_distances(1 - np.eye(5, dtype=np.float32), sequence_length=5)
    with pytest.raises(SurefixValueError, match="truth: expected 5 values, got 4"):
        surefix.calibrate(run, np.arange(4))
    with pytest.raises(SurefixValueError, match="alignment: expected 5 values, got 4"):
        surefix.calibrate(run, surefix.align(1 - np.eye(5, dtype=np.float32)[:, :4]))
    with pytest.raises(SurefixValueError, match=r"places below 5.*7 for query 2"):
        surefix.calibrate(run, [0, 1, 7, 3, 4])
    never = surefix.Matches(place=[0, 1], score=[0.0, 0.0], ready=[False, False])
    with pytest.raises(SurefixValueError, match="at least one that has a fix and a truth"):
        surefix.calibrate(never, [0, 1])
    for bad in (np.nan, np.inf):
        with pytest.raises(SurefixValueError, match="finite"):
            surefix.calibrate(surefix.Matches(place=[0], score=[bad]), [0])
    other = surefix.align(1 - np.eye(6, dtype=np.float32)[:, :5])
    with pytest.raises(SurefixValueError, match="alignment: the route: expected 5 values, got 6"):
        surefix.calibrate(run, other)


def test_a_threshold_goes_with_the_options_that_it_was_calibrated_with(tmp_path):
    rows = np.random.default_rng(0).normal(size=(60, 8)).astype(np.float32)
    route = surefix.Map.from_descriptors(rows)
    run = surefix.match(route, rows, motion="steady")
    threshold = surefix.calibrate(run, np.arange(60))
    settings = surefix.Settings(motion="steady", threshold=threshold, maps=route)
    settings.save(tmp_path / "route.toml")
    for call in (
        lambda: surefix.Localizer(route, config=settings, motion="free"),
        lambda: surefix.Settings(config=settings, tolerance=2),
    ):
        with pytest.raises(SurefixValueError, match="expected that of the settings, whose thre"):
            call()
    # The same value is no other, and a threshold of its own may come with other options.
    surefix.Localizer(route, config=tmp_path / "route.toml", motion="steady")
    assert surefix.Settings(config=settings, threshold=threshold, motion="free").threshold

    text = (tmp_path / "route.toml").read_text()
    for old, new in (
        ("sure = 0.95", "sure = -3.0"),
        ("wrong = 0.05", "wrong = nan"),
        ("queries = 60", "queries = 0"),
        ("right = [", "right = [5.0, "),
        ("scores = [", "scores = [nan, "),
        ("[threshold.probability]\nscores = [", "[threshold.probability]\nscores = [-1.0, "),
        ("[threshold.means]\nblock = ", "[threshold.means]\nblock = -"),
        ("tracked = true", "tracked = true\nscore = 2.0"),
    ):
        assert old in text, old
        damaged = text.replace(old, new, 1)
        (tmp_path / "damaged.toml").write_text(damaged)
        with pytest.raises(SurefixValueError, match="settings: "):
            surefix.Settings.open(tmp_path / "damaged.toml")
