"""``surefix reproduce``: its report is whole, says that it is generated, and equals the
results of NumPy.
"""

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import surefix

pytest.importorskip("matplotlib")

from PIL import Image

import oracle
import real_data
from commands import surefix_, surefix_process
from html_reader import read
from surefix.baselines import SupervisedPredictor, noisy_predictor
from surefix.reproduce import (
    Case,
    Settings,
    check_pairs,
    exhibits,
    find_datasets,
    generated_cases,
    load_cases,
    matrix_case,
    read_pairs,
    read_paper,
)
from surefix.reproduce.break_even import crossing, measure
from surefix.reproduce.curves import single_frames
from surefix.reproduce.paper import PUBLISHED
from surefix.reproduce.sweeps import ablation
from surefix.reproduce.table import table_1

QUICK = Settings(quick=True)
NAMES = {
    "table_1", "precision_recall", "single_frame", "perfect_prediction", "weight_sweep", "break_even", "ablation",
    "false_positives", "execution_time",
}  # fmt: skip

# Reference figures of an independent implementation: (unweighted, weighted) at L = 2, 3, 5, 10.
FIGURES = {
    "nordland": [(0.7407, 1.0000), (0.6837, 1.0000), (0.6414, 1.0000), (0.6943, 1.0000)],
    "gardens_point": [(0.9563, 0.9112), (0.7055, 0.9468), (0.8217, 0.9867), (0.8984, 1.0000)],
    "corridor": [(0.4883, 0.8475), (0.6380, 0.7804), (0.7198, 0.8867), (0.9847, 0.9940)],
}


def reproduce(*options: object) -> subprocess.CompletedProcess[str]:
    """Runs the command in a pipe."""
    return surefix_("reproduce", *options, code=None)


def rows(folder: Path, name: str) -> list[dict[str, str]]:
    with (folder / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def run_here(folder: Path) -> list[dict[str, str]]:
    return [line for line in rows(folder, "table_1") if line["verdict"] != "not run here"]


def area(D: np.ndarray, truth: np.ndarray, length: int, weight: float, upto: float = 0.2) -> float:
    """The area up to a recall, from the oracle's matches: a sum over a fine grid of recalls."""
    run = oracle.match(D, oracle.Options(sequence_length=length, weight=weight, floor="global"))
    ready = np.arange(D.shape[1]) >= length - 1
    right, scores = (np.abs(run.place - truth) <= 1)[ready], np.asarray(run.score)[ready]
    points = [
        (right[scores <= s].sum() / right.sum(), right[scores <= s].mean())
        for s in np.unique(scores)
    ]
    recall, precision = np.array([(r, min(q for p, q in points if p == r)) for r in dict(points)]).T
    # If recall stays, precision only falls: the line goes on from the lowest.
    grid = np.linspace(0, upto, 20_001)
    return float(np.interp(grid, np.r_[0, recall], np.r_[points[0][1], precision]).mean())


@pytest.fixture(scope="module")
def report(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[Path, subprocess.CompletedProcess[str]]:
    folder = tmp_path_factory.mktemp("reproduce") / "not" / "yet there"
    return folder, surefix_process("reproduce", "--quick", "-o", folder)


@pytest.fixture(scope="module")
def generated() -> list[Case]:
    return list(generated_cases(QUICK))


@pytest.mark.slow
def test_a_pipe_gets_plain_lines_and_the_last_says_what_was_made_and_where(report) -> None:
    folder, said = report
    assert said.returncode == 0, said.stderr
    assert said.stderr == ""
    assert all(character.isprintable() or character == "\n" for character in said.stdout)
    assert "this is the generated route" in said.stdout
    assert said.stdout.splitlines()[-1].startswith(f"Made {folder / 'report.html'}, with ")


@pytest.mark.slow
def test_the_page_is_whole_and_says_that_it_is_generated_and_whose_numbers_are_the_papers(
    report,
) -> None:
    folder, _ = report
    reader = read((folder / "report.html").read_text(encoding="utf-8"))
    assert reader.language == "en"
    # Links stay on the page, or are the pictures themselves.
    inside = [link for link in reader.links if not link.startswith("data:image/")]
    assert len(inside) == len(NAMES) + 2
    assert all(link.startswith("#") and link[1:] in reader.ids for link in inside)
    assert not reader.tags & {"link", "iframe"}
    assert all(image["alt"] for image in reader.images)
    for words in (
        "on a generated route",
        "Table I (arXiv 2307.01464): 15 rows, of which 15 were not run here",
        "Weighting loses in",
        "Weighting wins in",
        "Level, the interval holds 0",
        "Made with --quick",
    ):
        assert words in reader.text
    # A picture for each exhibit, however many cases there are.
    assert {path.stem for path in folder.glob("*.png")} == NAMES
    assert len(reader.images) == len(NAMES)


@pytest.mark.slow
def test_every_comparison_has_its_numbers_and_every_picture_something_on_it(report) -> None:
    folder, _ = report
    assert {path.stem for path in folder.glob("*.csv")} == NAMES
    assert all(rows(folder, name) for name in NAMES)
    for path in folder.glob("*.png"):
        picture = np.asarray(Image.open(path).convert("RGB")).astype(int)
        edge = np.concatenate([picture[:2].reshape(-1, 3), picture[-2:].reshape(-1, 3)])
        assert np.abs(edge - picture[0, 0]).max() <= 2, path.name
        assert (np.abs(picture - picture[0, 0]).max(axis=2) > 8).mean() > 0.02, path.name


@pytest.mark.slow
def test_the_table_is_what_the_oracle_computes(report, generated: list[Case]) -> None:
    lines = run_here(report[0])
    assert [line["dataset"] for line in lines] == [case.dataset for case in generated]
    for line, case in zip(lines, generated, strict=True):
        assert float(line["baseline"]) == pytest.approx(area(case.D, case.truth, 2, 0.0), abs=1e-3)
        assert float(line["weighted"]) == pytest.approx(area(case.D, case.truth, 2, 0.99), abs=1e-3)
        for motion in ("steady", "free", "any"):
            run = surefix.match_distances(case.D, motion=motion)
            expected = surefix.evaluate(run, case.truth).auc(0.2)
            assert float(line[f"track_{motion}"]) == pytest.approx(expected)
        # Each of these data sets has one technique.
        assert line["fused"] == ""
        low, high = float(line["low"]), float(line["high"])
        assert low <= float(line["difference"]) <= high
        expected = "wins" if low > 0 else "loses" if high < 0 else "level"
        assert (line["verdict"], line["paper_baseline"]) == (expected, "")


def test_the_techniques_of_a_data_set_are_fused() -> None:
    rng = np.random.default_rng(0)
    both = [(rng.normal(0, 0.5, (40, 40)) - np.eye(40)).astype(np.float32) for _ in range(2)]
    truth = np.arange(40)
    cases = [
        Case(f"road {road}", f"technique {index}", D, truth)
        for index, (road, D) in enumerate([(1, both[0]), (1, both[1]), (2, both[0])])
    ]
    lines = table_1(cases, None, Settings(quick=True)).rows
    run = surefix.match_distances(both, motion="any")
    fused = surefix.evaluate(run, truth).auc(0.2)
    assert [row[12] for row in lines[:3]] == [pytest.approx(fused)] * 2 + [None]


@pytest.mark.slow
def test_the_lengths_the_false_positives_and_the_curves_agree_with_the_table(report) -> None:
    folder, _ = report
    for line in run_here(folder):
        same = {(r["dataset"], r["length"]): r for r in rows(folder, "ablation")}[
            line["dataset"], "2"
        ]
        assert (same["unweighted"], same["weighted"]) == (line["baseline"], line["weighted"])
        for which in ("unweighted", "weighted"):
            named = (line["dataset"], which)
            curve = [
                r for r in rows(folder, "precision_recall") if (r["dataset"], r["curve"]) == named
            ]
            first = next(r for r in curve if float(r["recall"]) >= 0.2)
            counted = next(
                r for r in rows(folder, "false_positives") if r["dataset"] == line["dataset"]
            )
            assert counted[which] == first["false_positives"]
        sweep = [r for r in rows(folder, "weight_sweep") if r["dataset"] == line["dataset"]]
        start = [float(r["auc"]) for r in sweep if float(r["weight"]) == 0]
        assert start == pytest.approx([float(line["baseline"])] * 4)
        consensus = next(
            r for r in sweep if r["predictor"] == "consensus" and r["weight"] == "0.99"
        )
        assert float(consensus["auc"]) == float(line["weighted"])


@pytest.mark.slow
def test_the_two_contributions_make_up_the_time(report) -> None:
    for line in rows(report[0], "execution_time"):
        for which, sequence in (("median", "sequence_us"), ("mean", "sequence_mean_us")):
            parts = float(line[f"prediction_{which}_us"]) + float(line[sequence])
            assert parts == pytest.approx(float(line[f"whole_{which}_us"]))
    text = read((report[0] / "report.html").read_text(encoding="utf-8")).text
    for words in (
        "mean: prediction",
        "mean: weighted sequence",
        "mean: whole",
        "median: whole",
        "shows medians",
    ):
        assert words in text


def test_a_drawn_predictor_has_the_consensuss_rate_and_more_wrong_trust_never_helps_in_the_end(
    generated: list[Case],
) -> None:
    one = measure(generated[0], QUICK)
    assert one.areas[0] >= one.areas[-1]
    right = generated[0].study(QUICK).single_right
    trusted = noisy_predictor(right, true_positive_rate=one.trust.recall, false_positive_rate=0.0)
    assert trusted.sum() == one.trust.true_positives


@pytest.mark.parametrize(
    ("areas", "expected"),
    [
        ([0.9, 0.7, 0.5], 0.5),
        ([0.4, 0.3, 0.2], 0.0),
        ([0.9, 0.9, 0.8], None),
        ([0.9, 0.6, 0.5], None),
    ],
)
def test_the_break_even_is_where_the_line_crosses(
    areas: list[float], expected: float | None
) -> None:
    got = crossing(np.array([0.0, 0.5, 1.0]), np.array(areas), 0.7 if expected else 0.5)
    assert got == (None if expected is None else pytest.approx(expected))


@pytest.fixture(scope="module")
def two_drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a data set of two folders and two matrices, and one that lacks its images."""
    data = tmp_path_factory.mktemp("data")
    rng = np.random.default_rng(0)
    for day in ("reference", "query"):
        (data / "walk" / day).mkdir(parents=True)
        for frame in range(12):
            Image.fromarray(rng.integers(0, 256, (32, 64), np.uint8)).save(
                data / "walk" / day / f"{frame}.png"
            )
    (data / "walk" / "matrices").mkdir()
    np.save(data / "walk" / "matrices" / "Net_distance.npy", 1 - np.eye(12))
    np.save(data / "walk" / "matrices" / "unnamed.npy", np.eye(12))
    (data / "gardens_point" / "day_left").mkdir(parents=True)
    return data


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_ready_matrices_and_folders_fill_their_rows_beside_the_papers_numbers_and_what_is_wrong_is_said(
    tmp_path: Path, two_drives: Path, generated: list[Case]
) -> None:
    D = generated[0].D[:60, :60]
    np.save(tmp_path / "net.npy", 1 - D)
    np.save(tmp_path / "off.npy", 1 - D[:, :40])
    np.save(tmp_path / "truth.npy", np.arange(40))
    (tmp_path / "paper.csv").write_text(
        "dataset,technique,baseline,weighted\nhere,NetVLAD,0.25,0.5\nelsewhere,SAD,,0.75\n",
        encoding="utf-8",
    )
    out = tmp_path / "out"
    said = reproduce(
        "--quick", "--similarity", "-o", str(out), "--paper", str(tmp_path / "paper.csv"), "--data", str(two_drives),
        "--matrix", f"here/netvlad={tmp_path / 'net.npy'}",
        "--matrix", f"off={tmp_path / 'off.npy'},{tmp_path / 'truth.npy'}",
    )  # fmt: skip
    assert said.returncode == 0, said.stderr
    lines = rows(out, "table_1")
    assert [line["technique"] for line in lines] == ["netvlad", "off", "SAD", "Net", "SAD"]
    here, off, _, _, elsewhere = lines
    assert (here["paper_baseline"], here["paper_weighted"]) == ("0.25", "0.5")
    assert float(here["baseline"]) == pytest.approx(area(D, np.arange(60), 2, 0.0), abs=2e-3)
    assert (off["places"], off["queries"], off["paper_weighted"]) == ("60", "40", "")
    assert (elsewhere["dataset"], elsewhere["verdict"], elsewhere["paper_weighted"]) == (
        "elsewhere",
        "not run here",
        "0.75",
    )
    text = read((out / "report.html").read_text(encoding="utf-8")).text
    assert "No truth was given: query i is taken to show place i" in text
    assert "generated route" not in text
    assert [line.partition(":")[0] for line in said.stderr.splitlines()] == ["Not used"] * 2
    assert "unnamed.npy: expected NAME_similarity*.npy" in text
    assert str(two_drives / "gardens_point" / "day_left") in text


def walks(folder: Path, *names: str, images: int = 12) -> Path:
    """A folder of walks, each of images of noise."""
    rng = np.random.default_rng(len(names))
    for name in names:
        (folder / name).mkdir(parents=True)
        for frame in range(images):
            Image.fromarray(rng.integers(0, 256, (32, 64), np.uint8)).save(
                folder / name / f"Image{frame:03d}.jpg"
            )
    return folder


def matrices(folder: Path, *names: str, shape: tuple[int, int] = (12, 12)) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        np.save(folder / f"{name}.npy", np.random.default_rng(0).random(shape))


GARDENS = "Gardens Point Walking"


def test_every_pair_that_is_there_is_a_case_and_matrices_say_which_they_are_of(
    tmp_path: Path,
) -> None:
    walks(tmp_path, "day_left", "day_right", "night_right")
    matrices(tmp_path / "matrices", "Net_distance", "SAD_similarity")
    matrices(tmp_path / "matrices" / "day_left_to_night_right", "Net_distance")
    (found,) = find_datasets(tmp_path)
    cases, problems = load_cases(found)
    assert problems == []
    assert [(case.dataset, case.technique) for case in cases] == [
        (f"{GARDENS}, day_left to day_right", "SAD"),
        (f"{GARDENS}, day_left to day_right", "Net"),
        (f"{GARDENS}, day_left to day_right", "SAD_similarity"),
        (f"{GARDENS}, day_left to night_right", "SAD"),
        (f"{GARDENS}, day_left to night_right", "Net"),
    ]
    assert "taken to be of day_left to day_right" in cases[1].notes[0]
    assert (cases[4].notes, cases[4].aliases) == ((), ("gardens_point, day_left to night_right",))
    chosen = read_pairs(["gardens-point=night_right/day_left"])["gardens_point"]
    alone, *_ = load_cases(found, chosen)[0]
    assert alone.dataset == f"{GARDENS}, night_right to day_left"
    assert {GARDENS, "gardens_point"} <= set(alone.aliases)


def test_one_pair_keeps_the_short_name_and_seasons_are_paired_with_summer(tmp_path: Path) -> None:
    for season in ("winter", "summer"):
        np.save(
            tmp_path / f"{season}_0.npy",
            np.random.default_rng(0).integers(0, 256, (12, 32, 64), np.uint8),
        )
    assert [case.dataset for case in load_cases(find_datasets(tmp_path)[0])[0]] == ["Nordland"]
    np.save(
        tmp_path / "fall_0.npy", np.random.default_rng(0).integers(0, 256, (12, 32, 64), np.uint8)
    )
    names = [case.dataset for case in load_cases(find_datasets(tmp_path)[0])[0]]
    assert names == ["Nordland, summer to winter", "Nordland, summer to fall"]


def test_two_folders_of_one_data_set_are_told_apart(tmp_path: Path) -> None:
    for name in ("first", "second"):
        walks(tmp_path / name, "day_left", "day_right")
    for name in ("a-b", "a b"):
        matrices(tmp_path / name / "matrices", "Net_distance")
    cases = [case for found in find_datasets(tmp_path) for case in load_cases(found)[0]]
    assert [case.dataset for case in cases] == [
        "a b",
        "a-b 2",
        f"{GARDENS} (first)",
        f"{GARDENS} (second)",
    ]
    assert cases[2].aliases[0] == "gardens_point (first)"
    assert next(exhibits(cases, QUICK)).rows


def test_matrices_need_no_images(tmp_path: Path) -> None:
    matrices(tmp_path / "square" / "matrices", "Net_distance")
    matrices(tmp_path / "long" / "matrices", "Net_distance", shape=(20, 12))
    matrices(tmp_path / "told" / "matrices", "Net_distance", shape=(20, 12))
    matrices(walks(tmp_path / "walk", "day_left", "day_right") / "matrices", "Net_distance")
    (tmp_path / "walk" / "day_right" / "Image003.jpg").write_bytes(b"no image")
    matrices(walks(tmp_path / "half", "reference") / "matrices", "Net_distance")
    # The top's own matrices do not hide those below.
    matrices(tmp_path / "matrices", "Top_distance")
    lines = ["query,reference", *(f"{query},{query + 8}" for query in range(12))]
    (tmp_path / "told" / "ground_truth.csv").write_text("\n".join(lines), encoding="utf-8")
    cases, problems = {}, []
    for found in find_datasets(tmp_path):
        loaded, wrong = load_cases(found)
        cases |= {case.dataset: case for case in loaded}
        problems += wrong
    assert list(cases) == [tmp_path.name, "half", "square", "told", GARDENS]
    assert {case.technique for case in cases.values()} == {"Net", "Top"}
    assert cases["square"].notes == ("No truth was given: query i is taken to show place i.",)
    np.testing.assert_array_equal(cases["told"].truth, np.arange(12) + 8)
    half, long, walk = problems
    assert f"{tmp_path / 'half' / 'query'}: no such folder" in half
    assert f"{tmp_path / 'long' / 'ground_truth.csv'}, as 20 places and 12 queries" in long
    assert "Image003" in walk


def test_a_truth_of_another_map_is_refused() -> None:
    D = np.random.default_rng(0).random((12, 12), np.float32)
    with pytest.raises(
        surefix.SurefixValueError,
        match="expected places from 0 to 11, or -1 for none, got 12 for query 11",
    ):
        Case("here", "Net", D, np.arange(12) + 1)
    with pytest.raises(
        surefix.SurefixValueError, match="12 positions of places and 12 of queries, got 13 and 12"
    ):
        Case("here", "Net", D, (np.zeros((13, 2)), np.zeros((12, 2))))


def test_the_papers_rows_are_found_by_the_registrys_names_and_others_are_told_the_names(
    tmp_path: Path,
) -> None:
    D = np.random.default_rng(0).random((12, 12), np.float32)
    case = Case(GARDENS, "Net", D, np.arange(12), aliases=("gardens_point",))
    (tmp_path / "paper.csv").write_text(
        "dataset,technique,baseline,weighted\nGardens_Point,NET,0.25,0.5\nGardens,Net,0.5,0.75\n",
        encoding="utf-8",
    )
    comparison = next(exhibits([case], QUICK, read_paper(tmp_path / "paper.csv")))
    assert [row[-2:] for row in comparison.rows] == [(0.25, 0.5), (0.5, 0.75)]
    said = " ".join(comparison.paragraphs)
    assert (
        f"2 rows, of which 1 were not run here. A row is matched by its names. The data sets here: {GARDENS}; "
        in said
    )
    assert "gardens_point. The techniques: Net." in said


def test_the_published_table_has_its_averages_and_its_wins() -> None:
    assert len(PUBLISHED) == 15
    pairs = [(row.baseline or 0, row.weighted or 0) for row in PUBLISHED]
    # As the paper prints them.
    assert np.mean(pairs, axis=0).round(2).tolist() == [0.77, 0.84]
    assert sum(weighted >= baseline for baseline, weighted in pairs) == 13


@pytest.mark.parametrize(
    ("names", "technique", "weighted"),
    [
        ((GARDENS, "gardens_point", "gardens_point, day_left to day_right"), "sad", 0.68),
        ((f"{GARDENS}, day_left to night_right", "gardens_point"), "SAD", None),
        (("GardensPoint",), "Patch-NetVLAD", 0.94),
        (("Nordland, winter to summer", "nordland, winter to summer"), "NetVLAD", 0.35),
        (("Nordland, summer to winter", "nordland, summer to winter"), "NetVLAD", None),
        (("Oxford RobotCar", "robotcar"), "SAD", 0.82),
        (("4Seasons", "four_seasons"), "SAD", 0.96),
    ],
)
def test_a_published_row_stands_beside_its_own_traverses_only(
    names: tuple[str, ...], technique: str, weighted: float | None
) -> None:
    found = [row.weighted for row in PUBLISHED if row.is_for(technique, *names)]
    assert found == ([] if weighted is None else [weighted])


@pytest.mark.slow
@pytest.mark.parametrize("module", ["matplotlib", "PIL"])
def test_without_the_extra_it_is_one_line_with_the_command(tmp_path: Path, module: str) -> None:
    code = f"import sys; sys.modules[{module!r}] = None; from surefix.cli import main; main()"
    command = [sys.executable, "-c", code, "reproduce", "-o", str(tmp_path / "out")]
    said = subprocess.run(command, capture_output=True, text=True, encoding="utf-8", check=False)
    assert said.returncode == 1
    assert said.stderr.startswith("surefix: a report takes ")
    assert said.stderr.endswith('which is not installed: pip install "surefix[report]"\n')
    assert said.stderr.count("\n") == 1


def test_two_cases_of_one_name_are_refused(tmp_path: Path, generated: list[Case]) -> None:
    np.save(tmp_path / "D.npy", generated[0].D)
    option = f"a/b={tmp_path / 'D.npy'}"
    said = reproduce("--quick", "-o", str(tmp_path / "out"), "--matrix", option, "--matrix", option)
    assert said.returncode == 1
    assert (
        said.stderr
        == "surefix: cases: expected names that differ in letters or digits, got a, b twice\n"
    )


def test_a_route_of_positions_is_judged_in_metres(generated: list[Case]) -> None:
    case = generated[0]
    places = np.stack([4.0 * np.arange(len(case.D)), np.zeros(len(case.D))], axis=1)
    metres = Case("in metres", "SAD", case.D, (places, places[case.truth]), 4.5)
    same, other = metres.study(QUICK), case.study(QUICK)
    assert same.correct_means == "within 4.5 m"
    assert same.baseline.area == other.baseline.area
    assert same.shown.area == other.shown.area
    assert same.shown.difference == other.shown.difference
    one, another = (single_frames([each], QUICK).rows for each in (metres, case))
    assert [row[2:] for row in one] == [row[2:] for row in another]


SUPERVISED = "distance, masked by the supervised predictor"


def test_without_scikit_learn_the_page_says_which_extra_to_install(
    monkeypatch: pytest.MonkeyPatch, generated: list[Case]
) -> None:
    monkeypatch.setitem(sys.modules, "sklearn.pipeline", None)
    comparison = single_frames(generated[:1], QUICK)
    assert {row[2] for row in comparison.rows} == {
        "distance, masked by the prediction",
        "distance",
        "gradient alone",
    }
    assert any("pip install 'surefix[eval]'" in point for point in comparison.points)


def test_the_supervised_curve_is_of_queries_that_it_did_not_learn_from(
    generated: list[Case],
) -> None:
    pytest.importorskip("sklearn")
    case = generated[0]
    comparison = single_frames([case], QUICK)
    predictor = SupervisedPredictor().fit(case.D[:, :50], case.truth[:50])
    trusted = predictor.predict(case.D[:, 50:])
    right = np.abs(case.D[:, 50:].argmin(axis=0) - case.truth[50:]) <= 1
    last = [row for row in comparison.rows if row[2] == SUPERVISED][-1]
    assert last[3:5] == pytest.approx(
        ((trusted & right).sum() / right.sum(), right[trusted].mean())
    )


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--data", "nowhere"], "nowhere: no such folder"),
        (["--pair", "nordland=summer/winter"], "--pair: expected --data with it"),
        (
            ["--pair", "nordland=summer"],
            "--pair: expected DATASET=REFERENCE/QUERY, two traverses, got",
        ),
        (
            ["--pair", "folders=a/b"],
            "--pair: expected one of gardens_point, nordland, four_seasons, robotcar before",
        ),
        (["--paper", "nowhere.csv"], "nowhere.csv: cannot read the paper's numbers"),
        (["--matrix", "NetVLAD"], "--matrix: expected NAME=FILE.npy"),
        (["--matrix", "NetVLAD=nowhere.npy"], "nowhere.npy: cannot read the matrix"),
    ],
)
def test_a_mistake_is_one_clear_line(tmp_path: Path, options: list[str], says: str) -> None:
    said = reproduce("-o", str(tmp_path / "out"), *options)
    assert said.returncode == 1
    assert said.stdout == ""
    assert said.stderr.startswith(f"surefix: {says}")
    assert said.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("pair", "words"),
    [
        (
            "gardens_point=day_left/day_foo",
            "--pair gardens_point: expected traverses that are there",
        ),
        ("gardens-point=night_right/day_left", "got night_right/day_left"),
        ("nordland=summer/fall", "--pair: expected a data set that is there (gardens_point in"),
    ],
)
def test_a_pair_that_is_not_there_is_bad_usage_before_anything_is_computed(
    tmp_path: Path, pair: str, words: str
) -> None:
    data = tmp_path / "data"
    walks(data / "gardens", "day_left", "day_right")
    here = "gardens_point=day_left/day_right"
    said = reproduce(
        "--data", str(data), "--pair", here, "--pair", pair, "-o", str(tmp_path / "out")
    )
    assert (said.returncode, said.stdout) == (2, "")
    # In a box, which breaks lines.
    assert "".join(words.split()) in "".join(said.stderr.replace("│", "").split())
    assert not (tmp_path / "out").exists()


def test_a_pair_is_looked_for_in_each_folder_of_its_data_set(tmp_path: Path) -> None:
    walks(tmp_path / "a", "day_left", "day_right")
    walks(tmp_path / "b", "day_left", "night_right")
    matrices(tmp_path / "b" / "matrices" / "night_right_to_day_right", "Net_distance")
    a, b = find_datasets(tmp_path)
    pairs = [("day_left", "day_right"), ("day_left", "night_right"), ("night_right", "day_right")]
    assert [a.has(pair) for pair in pairs] == [True, False, False]
    assert [b.has(pair) for pair in pairs] == [False, True, True]
    check_pairs(tmp_path, [a, b], {"gardens_point": pairs})
    with pytest.raises(
        surefix.SurefixValueError,
        match=r"day_right in .*a; day_left, night_right in .*b\), got x/y$",
    ):
        check_pairs(tmp_path, [a, b], {"gardens_point": [*pairs, ("x", "y")]})


def test_bad_usage_is_exit_code_2(tmp_path: Path) -> None:
    assert reproduce("--recall", "all", "-o", str(tmp_path)).returncode == 2


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("dataset,technique\n", "row 1: expected the columns"),
        (
            "dataset,technique,baseline,weighted\nA,B,1.5,0\n",
            "row 2, baseline: expected an area from 0 to 1",
        ),
        (
            "dataset,technique,baseline,weighted\nA,B,1,0\na,b,1,0\n",
            "row 3: expected each case once",
        ),
        ("dataset,technique,baseline,weighted\nA,B,1\n", "row 2: expected 4 cells, got 3"),
    ],
)
def test_the_papers_numbers_are_checked(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "paper.csv").write_text(text, encoding="utf-8")
    with pytest.raises(surefix.SurefixValueError, match=says):
        read_paper(tmp_path / "paper.csv")


def test_a_matrix_that_cannot_be_paired_asks_for_its_truth(tmp_path: Path) -> None:
    np.save(tmp_path / "D.npy", np.ones((20, 30)))
    with pytest.raises(surefix.SurefixValueError, match=r"expected FILE\.npy,TRUTH\.npy"):
        matrix_case(f"NetVLAD={tmp_path / 'D.npy'}")


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_the_reference_figures_on_real_data(name: str) -> None:
    found = next(found for found in find_datasets(real_data.folder()) if found.folder.name == name)
    cases, problems = load_cases(found)
    assert problems == []
    sad = cases[0]
    for length, expected in zip((2, 3, 5, 10), FIGURES[name], strict=True):
        both = sad.study(Settings()).at(sequence_length=length).results
        areas = [result.curve.auc(0.2) for result in both]
        assert areas == pytest.approx(expected, abs=0.002), length


@pytest.mark.slow
def test_the_other_recall_on_real_data() -> None:
    settings = Settings(recall="place_exists")
    for name, length, expected in (
        ("nordland", 2, (0.7145, 1.0)),
        ("corridor", 10, (0.8983, 0.9049)),
    ):
        found = next(
            found for found in find_datasets(real_data.folder()) if found.folder.name == name
        )
        sad = load_cases(found)[0][0]
        both = sad.study(settings).at(sequence_length=length).results
        assert [result.curve.auc(0.2) for result in both] == pytest.approx(expected, abs=0.002)


def test_the_ten_published_techniques_of_the_corridor_fill_their_rows() -> None:
    found = next(
        found for found in find_datasets(real_data.folder()) if found.folder.name == "corridor"
    )
    cases, _ = load_cases(found)
    assert len(cases) == 11
    comparison = table_1(cases, [], QUICK)
    assert [row[1] for row in comparison.rows] == [case.technique for case in cases]
    assert [row[1] for row in comparison.tables[0].rows] == [case.technique for case in cases]
    # Words are for what wins or loses; the others are in the table and in the picture.
    said = " ".join(comparison.points)
    for case, row in zip(cases, comparison.tables[0].rows, strict=True):
        assert (case.name in said) == (row[7] != "level")
    (picture,) = comparison.pictures.values()
    assert all(case.name in picture.alt for case in cases)
    lengths = ablation(cases[:1], QUICK).rows
    assert [row[2] for row in lengths] == list(range(2, 10))
