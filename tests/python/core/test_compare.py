"""``surefix.compare``: its figures, and the intervals of their differences, are those of a naive
computation in NumPy.
"""

import itertools
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

import surefix
from surefix import Matches, SurefixError, SurefixValueError
from surefix.comparing import compare_judged
from surefix.judged import Judged

M, N = 90, 60
RECALLS = ("correct", "place_exists", "rejected")


def drive(seed: int, share: float) -> tuple[Matches, np.ndarray]:
    """Matches with equal scores, refused ones, a warm-up and queries off the map; and the truth."""
    random = np.random.default_rng(seed)
    truth = np.arange(M) * N // M
    truth[20:30] = -1
    # Errors last for some queries.
    right = np.repeat(random.random(M // 5) < share, 5)
    place = np.where(right, np.maximum(truth, 0), random.integers(0, N, M))
    score = np.round(random.random(M) - 0.4 * right, 1).astype(np.float32)
    ready = np.arange(M) >= 4
    off = np.clip(random.random(M) + 0.3 * (truth < 0), 0, 1)
    return Matches(place, score, ready, random.random(M) < 0.9, off_map=off), truth


def naive(matches: Matches, truth: np.ndarray, which: np.ndarray, recall: str) -> dict[str, float]:
    """The figures of these queries, some of them several times, by their definitions."""
    place, score, truth = matches.place[which], matches.score[which], truth[which]
    ready, accepted, off = (
        flags[which] for flags in (matches.ready, matches.accepted, matches.off_map)
    )
    right = (truth >= 0) & (np.abs(place - truth) <= 1)
    most = 0.0
    for threshold in np.unique(score[ready]):
        taken = ready & accepted & (score <= threshold)
        if taken.any() and right[taken].all():
            among = {
                "correct": (ready & right).sum(),
                "place_exists": (ready & (truth >= 0)).sum(),
                "rejected": ready.sum(),
            }[recall]
            most = max(most, taken.sum() / among)
    away, home = off[ready & (truth < 0)], off[ready & (truth >= 0)]
    wins = [(a > b) + 0.5 * (a == b) for a, b in itertools.product(away, home)]
    return {
        "right": right[truth >= 0].mean(),
        "recall_at_full_precision": most,
        "off_map_roc": float(np.mean(wins)) if wins else math.nan,
    }


@pytest.mark.parametrize("recall", RECALLS)
def test_figures_and_differences_are_those_of_a_naive_bootstrap(recall: str) -> None:
    (weak, truth), (good, _) = drive(1, 0.4), drive(2, 0.7)
    runs = {"weak": weak, "good": good}
    comparison = surefix.compare(runs, truth, recall=recall, samples=80)
    judged = {name: comparison.judged[k] for k, name in enumerate(runs)}
    every = np.arange(M)
    own = {name: naive(matches, truth, every, recall) for name, matches in runs.items()}
    # Blocks as long as the errors of the run that errs for longer last.
    block = max(each.parts[0][0] for each in judged.values())
    assert block > 2
    starts = np.random.default_rng(0).integers(M, size=(80, -(-M // block)))
    apart = []
    for row in starts:
        drawn = np.concatenate([(start + np.arange(block)) % M for start in row])[:M]
        both = [naive(matches, truth, drawn, recall) for matches in runs.values()]
        apart.append({name: both[1][name] - both[0][name] for name in both[0]})
    for figure, value in own["good"].items():
        assert comparison["good"].figures[figure] == pytest.approx(value)
        found = comparison["good"].differences[figure]
        assert found == pytest.approx(value - own["weak"][figure])
        ends = np.nanquantile([each[figure] for each in apart], (0.025, 0.975))
        assert (found.low, found.high) == pytest.approx(tuple(ends))
        said = comparison["good"].verdict(figure)
        expected = "better" if found.low > 0 else "worse" if found.high < 0 else None
        assert said == (expected or "the drive does not tell")


@pytest.mark.parametrize("recall", RECALLS)
@pytest.mark.parametrize("upto", [0.2, 1.0])
def test_areas_are_those_of_evaluate(recall: str, upto: float) -> None:
    (weak, truth), (good, _) = drive(1, 0.4), drive(2, 0.7)
    comparison = surefix.compare({"a": weak, "b": good}, truth, recall=recall, upto=upto)
    curves = [surefix.evaluate(each, truth, 1, recall) for each in (weak, good)]
    area, apart = comparison["b"].figures["area"], comparison["b"].differences["area"]
    assert (area, area.low, area.high) == (curves[1].auc(upto), *curves[1].auc_interval(upto))
    assert apart == curves[1].auc(upto) - curves[0].auc(upto)
    assert (apart.low, apart.high) == curves[1].auc_difference_interval(curves[0], upto)


def test_trust_is_that_of_evaluate_trust() -> None:
    random = np.random.default_rng(3)
    D = random.random((N, N)).astype(np.float32)
    runs = {
        name: surefix.match_distances(D - by * np.eye(N, dtype=np.float32))
        for name, by in (("weak", 0.1), ("good", 0.5))
    }
    truth = np.arange(N)
    comparison = surefix.compare(runs, truth)
    for name, run in runs.items():
        trust, figures = surefix.evaluate_trust(run, truth), comparison[name].figures
        assert figures["trusted_precision"] == trust.precision
        assert figures["trusted_recall"] == trust.recall
        assert "off_map_roc" not in figures
    assert comparison["good"].verdict("right") == "better"


def test_segments_and_positions_judge_as_evaluate_does() -> None:
    random = np.random.default_rng(4)
    D = (random.random((N, N)) - 0.4 * np.eye(N)).astype(np.float32)
    town = surefix.Segments(N, breaks=[30], closed=[0, 1])
    runs = {f"L={k}": surefix.match_distances(D, sequence_length=k, segments=town) for k in (1, 3)}
    truth = (np.arange(N) + 1) % N
    at = np.arange(N, dtype=float)[:, None] * [3.0, 4.0]
    for given, tolerance in ((truth, 1), ((at, at + 1), 6.0)):
        comparison = surefix.compare(runs, given, tolerance)
        for (name, run), judged in zip(runs.items(), comparison.judged, strict=True):
            curve = surefix.evaluate(run, given, tolerance)
            assert comparison[name].figures["area"] == curve.auc(0.2)
            assert judged.curve.correct == curve.correct


def test_a_run_beside_itself_is_the_same_and_queries_without_a_truth_are_left_out() -> None:
    matches, truth = drive(1, 0.5)
    unknown = truth.astype(float)
    unknown[50:] = np.nan
    comparison = surefix.compare({"a": matches, "b": matches}, unknown)
    assert {comparison["b"].verdict(figure) for figure in comparison.figures} == {"the same"}
    assert comparison["a"].verdict("right") == ""
    part = Matches(
        matches.place[:50], matches.score[:50], matches.ready[:50], matches.accepted[:50],
        off_map=matches.off_map[:50],
    )  # fmt: skip
    short = surefix.compare({"a": part, "b": part}, truth[:50])
    for figure in comparison.figures:
        assert comparison["a"].figures[figure] == short["a"].figures[figure]


def test_drives_of_their_own_are_compared_by_their_intervals() -> None:
    (one, truth), (other, _) = drive(1, 0.4), drive(2, 0.8)
    judged = [
        Judged.by_truth("a", one, truth, queries=[f"{k}" for k in range(M)]),
        Judged.by_truth("b", other, truth, queries=[f"{k}.jpg" for k in range(M)]),
    ]
    with pytest.raises(SurefixValueError, match=r"b: expected the queries of a, 90 \(0 to 89\), "):
        compare_judged(judged)
    comparison = compare_judged(judged, paired=False)
    for figure in comparison.figures:
        a, b = (comparison[name].figures[figure] for name in "ab")
        found = comparison["b"].differences[figure]
        assert found.low == pytest.approx(b - a - math.hypot(b - b.low, a.high - a))
        assert found.high == pytest.approx(b - a + math.hypot(b.high - b, a - a.low))
    assert "Other queries each" in comparison.how


def test_all_forms_hold_the_same_numbers(tmp_path: Path) -> None:
    (weak, truth), (good, _) = drive(1, 0.4), drive(2, 0.7)
    comparison = surefix.compare({"weak | old": weak, "<good>": good}, truth, against="<good>")
    comparison.to_csv(tmp_path / "all.csv")
    text = (tmp_path / "all.csv").read_text(encoding="utf-8")
    assert text == comparison.csv()
    lines = text.splitlines()
    assert lines[0].startswith("run,figure,value,low,high,difference,")
    assert len(lines) == 1 + 2 * len(comparison.figures)
    read = json.loads(comparison.json())
    assert read["against"] == "<good>"
    assert [row["value"] for row in read["rows"]] == [
        float(line.split(",")[2]) for line in lines[1:]
    ]
    assert [row["verdict"] for row in read["rows"][-4:]] == ["the baseline"] * 4
    right = comparison["weak | old"].differences["right"]
    for form in (str(comparison), comparison.markdown(), comparison._repr_html_()):
        assert f"{right:+.3f}" in form
    assert "weak \\| old" in comparison.markdown()
    broken = surefix.compare({"weak\n| old": weak, "good": good}, truth).markdown()
    assert "| weak \\| old |" in broken
    assert "&lt;good&gt;" in comparison._repr_html_()
    assert "<good>" not in comparison._repr_html_()


def test_a_file_that_cannot_be_written_leaves_the_older_one(tmp_path: Path) -> None:
    matches, truth = drive(1, 0.4)
    comparison = surefix.compare({"a": matches, "b": matches}, truth)
    (tmp_path / "old.csv").mkdir()
    with pytest.raises(surefix.SurefixFileError, match="cannot write the comparison"):
        comparison.to_csv(tmp_path / "old.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["old.csv"]
    with pytest.raises(surefix.SurefixFileError, match="there is no folder"):
        comparison.to_csv(tmp_path / "none" / "new.csv")


def test_a_mistake_is_named() -> None:
    matches, truth = drive(1, 0.4)
    short = Matches(matches.place[:9], matches.score[:9])
    both = {"a": matches, "b": matches}
    for runs, options, said in (
        ({"a": matches}, {}, "runs: expected two or more to compare, got 1"),
        (both, {"against": "c"}, "against: expected one of a, b, got 'c'"),
        ({"a": matches, "b": 3}, {}, "runs, b: expected a surefix.Run or surefix.Matches, got int"),
        ({"a": matches, "b": short}, {}, "truth: expected "),
        ("a/", {"truth": None}, "runs: expected a mapping of runs, or a list of folders"),
        (both, {"truth": None}, "truth: expected one, as for surefix.evaluate"),
        (["a/", "b/"], {}, "truth: expected none with folders, which hold their own"),
        (["a/", "b/"], {"truth": None}, "a: expected the folder of a report"),
        (both, {"truth": truth[:5]}, "truth: expected "),
    ):
        with pytest.raises(SurefixError, match=f"^{re.escape(said)}"):
            surefix.compare(runs, **({"truth": truth} | options))  # type: ignore[arg-type]
