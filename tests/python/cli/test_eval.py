"""``surefix eval``: its numbers are those of an independent computation, and its report is
whole.
"""

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import surefix
from surefix.simulate import Route

pytest.importorskip("matplotlib")
pytest.importorskip("bokeh")

from PIL import Image

from commands import surefix_, surefix_process
from html_reader import Reader, read
from surefix import baselines
from surefix.report.eval import FILES

# The fixtures draw whole reports.
pytestmark = pytest.mark.slow

PLACES = 70
METHODS = ("sequence", "weighted", "single", "masked")


@dataclass
class Report:
    folder: Path
    said: str

    def table(self, name: str) -> list[dict[str, str]]:
        with (self.folder / name).open(newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file))

    def method(self, name: str) -> dict[str, np.ndarray]:
        rows = [row for row in self.table("fixes.csv") if row["method"] == name]
        flags = ("ready", "accepted", "judged", "right", "trusted")
        numbers = {
            c: np.array([float(row[c]) for row in rows]) for c in ("place", "score", "true_place")
        }
        return numbers | {c: np.array([row[c] == "true" for row in rows]) for c in flags}

    @property
    def page(self) -> Reader:
        return read((self.folder / "report.html").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drives")
    route = Route(places=PLACES, size=(64, 32), seed=2)
    reference, revisit = route.reference(), route.revisit()
    for name, drive in (("summer", reference), ("winter", revisit)):
        np.save(folder / f"{name}.npy", np.stack([drive[index] for index in range(PLACES)]))
    places = surefix.Map.from_images(reference, surefix.Sad())
    places.save(folder / "route.safetensors")
    D = np.stack([places.distances(surefix.Sad().describe(frame)) for frame in revisit], axis=1)
    np.save(folder / "D.npy", D)
    np.save(folder / "S.npy", 1 - D.astype(np.float64))
    np.save(folder / "truth.npy", revisit.truth(reference))
    rows = "".join(f"{query},{place}\n" for query, place in enumerate(revisit.truth(reference)))
    (folder / "truth.csv").write_text("query,reference\n" + rows)
    for name, drive in (("reference", reference), ("query", revisit)):
        np.savetxt(
            folder / f"{name}.csv", np.c_[drive.positions, 0 * drive.positions], delimiter=","
        )
    return folder


@pytest.fixture(scope="module")
def report(drives: Path) -> Report:
    """As a user makes one, in a pipe."""
    out = drives / "not" / "yet there"
    options = ["--truth", drives / "truth.csv", "--references", drives / "summer.npy", "-o", out]
    said = surefix_process("eval", drives / "route.safetensors", drives / "winter.npy", *options)
    assert said.stderr == ""
    return Report(out, said.stdout)


def test_a_pipe_gets_plain_lines_and_the_last_says_what_was_made_and_where(report: Report) -> None:
    lines = report.said.splitlines()
    assert all(character.isprintable() or character == "\n" for character in report.said)
    assert [line.partition(":")[0] for line in lines[1:5]] == list(METHODS)
    assert lines[-1].startswith(f"Made {report.folder / 'report.html'}: 4 methods compared, ")


def area_upto(recall: np.ndarray, precision: np.ndarray, upto: float) -> float:
    """By a sum over a fine grid of recalls, through the last precision at each recall; nothing
    beyond the end.
    """
    if len(recall) == 0:
        return 0.0
    last = np.r_[recall[1:] > recall[:-1], True]
    grid = np.linspace(0, upto, 100_001)
    heights = np.interp(grid, np.r_[0, recall[last]], np.r_[precision[0], precision[last]])
    return float((heights * (grid <= recall[-1])).mean())


@pytest.mark.parametrize("name", METHODS)
def test_the_numbers_of_a_method_are_those_of_its_fixes(report: Report, name: str) -> None:
    m = report.method(name)
    right = np.abs(m["place"] - m["true_place"]) <= 1
    assert (m["right"] == right).all()
    assert (m["judged"] == m["ready"]).all()
    scores = m["score"][m["ready"] & m["accepted"]]
    correct = right[m["ready"] & m["accepted"]]
    found = int((right & m["ready"]).sum())
    points = [
        (correct[scores <= s].sum(), (~correct[scores <= s]).sum()) for s in np.unique(scores)
    ]
    hits, misses = np.array(points).T
    recall, precision = hits / found, hits / (hits + misses)

    row = next(row for row in report.table("methods.csv") if row["method"] == name)
    assert float(row["auc"]) == pytest.approx(area_upto(recall, precision, 0.2), abs=2e-3)
    assert float(row["max_recall"]) == pytest.approx(recall[-1])
    assert float(row["recall_at_full_precision"]) == pytest.approx(
        max(recall[precision == 1], default=0)
    )
    assert int(row["false_positives"]) == misses[recall >= 0.2][0]
    assert float(row["best_f1"]) == pytest.approx(
        np.max(2 * precision * recall / np.maximum(precision + recall, 1e-9))
    )
    assert (int(row["correct"]), int(row["judged"])) == (found, int(m["ready"].sum()))
    assert float(row["auc_low"]) <= float(row["auc"]) + 1e-9
    curve = [r for r in report.table("curves.csv") if r["method"] == name]
    assert [float(r["recall"]) for r in curve] == pytest.approx(recall.tolist())
    assert [float(r["precision"]) for r in curve] == pytest.approx(precision.tolist())


def test_the_matches_are_those_of_other_words(report: Report, drives: Path) -> None:
    D = np.load(drives / "D.npy").astype(np.float64)
    assert report.method("single")["place"].tolist() == D.argmin(axis=0).tolist()
    best = np.argmin(D[1:, 1:] + D[:-1, :-1], axis=0) + 1
    assert report.method("sequence")["place"][1:].tolist() == best.tolist()
    run = surefix.match_distances(np.load(drives / "D.npy"), floor="global")
    assert report.method("weighted")["place"].tolist() == run.place.tolist()
    assert report.method("masked")["accepted"].tolist() == run.trusted.tolist()


def test_the_page_says_what_the_tables_say_and_hides_no_row(report: Report, drives: Path) -> None:
    page, rows = report.page, {row["method"]: row for row in report.table("methods.csv")}
    assert page.ids["area"] == f"{float(rows['weighted']['auc']):.3f}"
    assert (
        page.ids["difference"]
        == f"{float(rows['weighted']['auc']) - float(rows['sequence']['auc']):+.3f}"
    )
    assert page.ids["false"] == rows["weighted"]["false_positives"]
    single = report.method("single")
    trusted = single["trusted"]
    assert page.ids["trusted"] == f"{100 * trusted.mean():.1f} %"
    assert page.ids["trusted-right"] == f"{100 * single['right'][trusted].mean():.1f} %"
    values = {row["quantity"]: float(row["value"]) for row in report.table("drive.csv")}
    assert values["trusted_wrong"] == (trusted & ~single["right"]).sum()
    order = np.load(drives / "D.npy").argsort(axis=0)
    near = np.abs(order - np.load(drives / "truth.npy")) <= 1
    for k in (1, 5, 10):
        assert values[f"recall_at_{k}"] == pytest.approx(near[:k].any(axis=0).mean())
    assert page.ids["recall-at-1"] == f"{values['recall_at_1']:.3f}"
    for name in METHODS:
        assert f"{float(rows[name]['auc']):.3f} (" in page.text
        assert re.search(rf"{name} (is|wins|loses) ", page.text)
    weighted, plain = report.method("weighted"), report.method("sequence")
    both = weighted["judged"] & plain["judged"]
    repaired, spoiled = (
        int((both & a["right"] & ~b["right"]).sum())
        for a, b in ((weighted, plain), (plain, weighted))
    )
    assert (
        f"repairs {repaired} that the plain sequence has wrong and spoils {spoiled} that it has right"
        in page.text
    )


def test_the_page_is_whole_and_needs_nothing_else(report: Report) -> None:
    page = report.page
    assert page.language == "en"
    assert all(link.startswith("data:image/") for link in page.links)
    assert not page.tags & {"link", "iframe"}
    assert all(
        image["alt"] and int(image["width"]) and int(image["height"])
        for image in page.images
        if "src" in image
    )
    assert not re.search(r"\b(nan|inf|None)\b", page.text)
    made = {file.name for file in report.folder.iterdir()}
    assert set(FILES) <= made
    assert made - set(FILES) <= {"mistakes.png", "trusted_mistakes.png"}
    for name in made:
        assert name in page.text


def test_nothing_on_a_picture_is_cut_off(report: Report) -> None:
    for file in report.folder.glob("*.png"):
        picture = np.asarray(Image.open(file).convert("RGB"))
        assert picture.shape[1] > 700
        for side in (picture[:2], picture[-2:], picture[:, :2], picture[:, -2:]):
            assert (side == picture[0, 0]).all(), file.name
        assert (picture != picture[0, 0]).any(axis=2).mean() > 0.02, file.name


@pytest.fixture
def here(drives: Path, monkeypatch: pytest.MonkeyPatch, undrawn: None) -> None:
    """Among the drives, and without drawing."""
    monkeypatch.chdir(drives)


def test_each_kind_of_truth_says_the_same(
    drives: Path,
    report: Report,
    tmp_path: Path,
    here: None,
) -> None:
    truth = np.load(drives / "truth.npy")
    matrix = np.zeros((PLACES, PLACES), bool)
    matrix[truth, np.arange(PLACES)] = True
    np.save(drives / "matrix.npy", matrix)
    wanted = {row["method"]: row["auc"] for row in report.table("methods.csv")}
    for source, given in (
        (["D.npy"], ["--truth", "truth.npy"]),
        (["S.npy", "--similarity"], ["--truth", "matrix.npy"]),
    ):
        out = tmp_path / given[1]
        surefix_("eval", *source, *given, "--method", "weighted", "-o", out)
        made = {row["method"]: row["auc"] for row in Report(out, "").table("methods.csv")}
        assert list(made) == ["sequence", "weighted"]
        assert {name: float(value) for name, value in made.items()} == pytest.approx(
            {name: float(wanted[name]) for name in made}, abs=1e-6
        )


def test_positions_are_a_truth_in_metres(
    drives: Path,
    tmp_path: Path,
    here: None,
) -> None:
    options = (
        "--positions",
        "reference.csv",
        "--query-positions",
        "query.csv",
        "--tolerance",
        "4.5",
    )
    said = surefix_("eval", "D.npy", *options, "--method", "single", "-o", tmp_path)
    where, here = (
        np.loadtxt(drives / f"{name}.csv", delimiter=",") for name in ("reference", "query")
    )
    D = np.load(drives / "D.npy")
    right = np.linalg.norm(where[D.argmin(axis=0)] - here, axis=1) <= 4.5
    made = Report(tmp_path, "")
    assert made.method("single")["right"].tolist() == right.tolist()
    assert "within 4.5 m of the true position" in made.page.text
    assert "way along the drive (m)" not in said.stderr


def test_the_spread_is_of_the_positions_given(
    drives: Path,
    tmp_path: Path,
    here: None,
) -> None:
    uneven = np.c_[np.cumsum(np.arange(PLACES) % 7), np.zeros(PLACES)].astype(float)
    np.save(drives / "uneven.npy", uneven)
    options = ("--positions", "uneven.npy", "--query-positions", "uneven.npy", "--tolerance", "3")
    want = baselines.spread(np.load(drives / "D.npy"), uneven).score
    for route in (["D.npy"], ["route.safetensors", "winter.npy"]):
        surefix_("eval", *route, *options, "--method", "spread", "-o", tmp_path)
        np.testing.assert_allclose(Report(tmp_path, "").method("spread")["score"], want, rtol=1e-6)


def test_metres_are_not_the_tolerance_of_the_calibration(
    drives: Path,
    tmp_path: Path,
    here: None,
) -> None:
    pytest.importorskip("sklearn")
    D, truth = np.load(drives / "D.npy"), np.load(drives / "truth.npy")
    learn = (
        "--calibration",
        "D.npy",
        "--calibration-truth",
        "truth.npy",
        "--method",
        "supervised-masked",
    )
    options = (
        "--positions",
        "reference.csv",
        "--query-positions",
        "query.csv",
        "--tolerance",
        "4.5",
        *learn,
    )
    for places, more in ((1, ()), (5, ("--calibration-tolerance", "5"))):
        surefix_("eval", "D.npy", *options, *more, "-o", tmp_path)
        trusted = baselines.SupervisedPredictor().fit(D, truth, places).predict(D)
        assert (
            Report(tmp_path, "").method("supervised-masked")["accepted"].tolist()
            == trusted.tolist()
        )


def test_a_line_warns_of_similarities_and_of_queries_that_were_not_judged(
    drives: Path,
    tmp_path: Path,
    here: None,
) -> None:
    np.save(drives / "start.npy", np.load(drives / "D.npy")[:, :9])
    np.save(drives / "nine.npy", np.load(drives / "truth.npy")[:9])
    out = ("--method", "sequence", "-o", str(tmp_path))
    for arguments, words in (
        (("S.npy", "--truth", "truth.npy"), "are these similarities? Then use --similarity"),
        (
            ("start.npy", "--truth", "nine.npy", "-L", "20"),
            "no query was judged for sequence: a sequence takes 20",
        ),
        (("S.npy", "--truth", "truth.npy", "--similarity"), ""),
        (("D.npy", "--truth", "truth.npy"), ""),
    ):
        said = surefix_("eval", *arguments, *out).stderr
        assert words in said
        assert said.count("Warning: ") == (words != "")
