"""``surefix compare``: reports, fixes, maps and distances in one table; bad input is one line."""

import csv
import io
import json
import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import surefix
from commands import surefix_
from html_reader import Reader, read

pytest.importorskip("matplotlib")

N = 40


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two drives of images, two maps, distances, two reports, and fixes of two runs."""
    folder, random = tmp_path_factory.mktemp("compare"), np.random.default_rng(0)
    for day in ("monday", "tuesday"):
        (folder / day).mkdir()
    for k in range(N):
        scene = random.integers(0, 256, (32, 64), np.uint8)
        noise = random.integers(0, 256, scene.shape)
        for day, share in (("monday", 0.0), ("tuesday", 0.85)):
            mixed = ((1 - share) * scene + share * noise).astype(np.uint8)
            Image.fromarray(mixed).save(folder / day / f"{k:03}.png")
    queries = [np.asarray(Image.open(folder / "tuesday" / f"{k:03}.png")) for k in range(N)]
    for name, size in (("large", (64, 32)), ("small", (8, 8))):
        route = surefix.Map.from_images(folder / "monday", surefix.Sad(size=size), progress=False)
        route.save(folder / f"{name}.safetensors")
        rows = [route.distances(route.descriptor.describe(image)) for image in queries]
        np.save(folder / f"{name}.npy", np.stack(rows, axis=1))
        what = (folder / f"{name}.safetensors", folder / "tuesday", "--truth", "identity")
        more = ("--method", "sequence", "--method", "weighted", "--method", "track_any")
        surefix_("eval", *what, *more, "-o", folder / name)
    surefix_("run", *what[:2], "-o", folder / "plain.csv", "--motion", "none")
    surefix_("run", *what[:2], "-o", folder / "track.jsonl")
    return folder


def table(text: str) -> dict[tuple[str, str], dict[str, str]]:
    rows = csv.DictReader(io.StringIO(text))
    return {(row["run"], row["figure"]): row for row in rows}


def test_reports_are_compared_with_the_numbers_that_they_hold(data: Path) -> None:
    found = table(surefix_("compare", data / "large", data / "small").stdout)
    assert [run for run, figure in found if figure == "area"] == ["large", "small"]
    for name in ("large", "small"):
        with (data / name / "methods.csv").open(encoding="utf-8") as file:
            own = {row["method"]: row for row in csv.DictReader(file)}["weighted"]
        area = found[name, "area"]
        assert (area["value"], area["low"], area["high"]) == (
            own["auc"], own["auc_low"], own["auc_high"],
        )  # fmt: skip
        flawless = float(found[name, "recall_at_full_precision"]["value"])
        assert flawless == pytest.approx(float(own["recall_at_full_precision"]))
        with (data / name / "drive.csv").open(encoding="utf-8") as file:
            drive = {row["quantity"]: row["value"] for row in csv.DictReader(file)}
        precision = float(found[name, "trusted_precision"]["value"])
        assert precision == pytest.approx(float(drive["trust_precision"]))
    assert found["small", "right"]["verdict"] == "worse"
    assert found["large", "right"]["verdict"] == "the baseline"


def test_the_methods_of_one_report_are_compared_as_its_table_does(data: Path) -> None:
    found = table(surefix_("compare", data / "large" / "fixes.csv", "--samples", 1000).stdout)
    with (data / "large" / "methods.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert list(dict.fromkeys(run for run, _ in found)) == [row["method"] for row in rows]
    for row in rows[1:]:
        area = found[row["method"], "area"]
        assert area["difference_low"] == row["difference_low"]
        assert area["difference_high"] == row["difference_high"]


def test_reports_maps_distances_and_fixes_agree(data: Path) -> None:
    files = (data / f"small{kind}" for kind in ("", ".safetensors", ".npy"))
    found = table(
        surefix_(
            "compare", *files, f"run={data / 'plain.csv'}", "--queries", data / "tuesday",
            "--truth", "identity",
        ).stdout
    )  # fmt: skip
    names = ["small", "small.safetensors", "small.npy", "run"]
    assert list(dict.fromkeys(run for run, _ in found)) == names
    # Of one route and drive, read in four ways; a run's floor is that of the queries so far.
    for run, figure in found:
        same = run in names[1:3] or figure in ("trusted_precision", "trusted_recall")
        assert not same or found[run, figure]["verdict"] == "the same" or run == names[0]
        assert not same or found[run, figure]["value"] == found[names[0], figure]["value"]


def test_fixes_of_a_track_are_judged_from_the_first_query_on(data: Path) -> None:
    found = table(
        surefix_(
            "compare", data / "plain.csv", data / "track.jsonl", "--truth", "identity",
            "--recall", "place_exists", "--upto", 1,
        ).stdout
    )  # fmt: skip
    route = surefix.Map.open(data / "small.safetensors")
    for name, motion in (("plain", None), ("track", "any")):
        run = surefix.match(route, data / "tuesday", motion=motion)
        curve = surefix.evaluate(run, np.arange(N), recall="place_exists")
        assert float(found[name, "area"]["value"]) == pytest.approx(curve.auc(1.0))


def test_the_methods_of_several_maps_are_compared_against_the_one_that_is_named(data: Path) -> None:
    maps = data / "large.safetensors", data / "small.safetensors"
    made = surefix_(
        "compare", *maps, "--queries", data / "tuesday", "--truth", "identity", "--method", "single",
        "--method", "weighted", "--against", "small: weighted", "-L", 3,
    )  # fmt: skip
    found = table(made.stdout)
    assert found["small: weighted", "area"]["verdict"] == "the baseline"
    D = np.load(data / "large.npy")
    run = surefix.match_distances(D, sequence_length=3, floor="global")
    expected = surefix.evaluate(run, np.arange(N)).auc(0.2)
    assert float(found["large: weighted", "area"]["value"]) == pytest.approx(expected)
    right = float(found["large: single", "right"]["value"])
    assert right == pytest.approx((np.abs(D.argmin(0) - np.arange(N)) <= 1).mean())


def test_positions_are_a_truth_of_maps_and_of_fixes(data: Path, tmp_path: Path) -> None:
    at = np.arange(N)[:, None] * [3.0, 4.0]
    np.save(tmp_path / "at.npy", at)
    where = ("--positions", tmp_path / "at.npy", "--query-positions", tmp_path / "at.npy")
    kinds = ("large.npy", "plain.csv")
    by_metres, by_places = (
        surefix_("compare", *(data / kind for kind in kinds), *truth).stdout
        for truth in ((*where, "--tolerance", 5.5), ("--truth", "identity"))
    )
    assert by_metres == by_places


def page_of(path: Path) -> Reader:
    return read(path.read_text(encoding="utf-8"))


def test_the_file_is_of_the_kind_that_its_name_says(data: Path, tmp_path: Path) -> None:
    reports = data / "large", data / "small"
    said = surefix_("compare", *reports, "-o", tmp_path / "all.csv").stdout
    assert said == f"Made {tmp_path / 'all.csv'}: 2 runs against large\n"
    csv_ = table((tmp_path / "all.csv").read_text(encoding="utf-8"))
    for name in ("all.json", "all.md", "all.html"):
        surefix_("compare", *reports, "-o", tmp_path / name)
    rows = json.loads((tmp_path / "all.json").read_text(encoding="utf-8"))["rows"]
    for row in rows:
        assert float(csv_[row["run"], row["figure"]]["value"]) == row["value"]
    difference = float(csv_["small", "right"]["difference"])
    assert f"| {difference:+.3f} |" in (tmp_path / "all.md").read_text(encoding="utf-8")
    page = page_of(tmp_path / "all.html")
    assert page.language == "en"
    inside = [link for link in page.links if not link.startswith("data:image/")]
    assert len(inside) == 4
    assert all(link[1:] in page.ids for link in inside)
    assert all(image["alt"] for image in page.images)
    assert f"{difference:+.3f}" in page.text
    assert "small is worse in" in page.text
    assert sum(int(page.ids[name]) for name in ("better", "worse", "unsure")) <= len(rows) // 2


def test_many_runs_are_drawn_each_beside_the_baseline(data: Path, tmp_path: Path) -> None:
    runs = [f"{k}={data / 'small.npy'}" for k in range(10)]
    out = tmp_path / "many.html"
    surefix_("compare", *runs, "--truth", "identity", "--samples", 20, "-o", out)
    page = page_of(out)
    assert "9 runs against 0" in page.text
    assert len(page.images) == 2


def test_a_report_without_a_column_of_trust_is_compared_without_it(
    data: Path, tmp_path: Path
) -> None:
    (tmp_path / "old").mkdir()
    for name in ("methods.csv", "fixes.csv"):
        lines = (data / "large" / name).read_text(encoding="utf-8").splitlines()
        if name == "fixes.csv":
            lines = [",".join(line.split(",")[:11]) for line in lines]
        (tmp_path / "old" / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    made = surefix_("compare", tmp_path / "old", data / "small")
    found = table(made.stdout)
    assert found["old", "trusted_precision"]["value"] == ""
    assert found["small", "trusted_precision"]["verdict"] == ""
    assert found["small", "right"]["verdict"] == "worse"
    assert made.stderr.startswith("Note: no figures of trust for old")


def changed(source: Path, target: Path, old: str, new: str) -> Path:
    target.mkdir()
    for name in ("methods.csv", "fixes.csv"):
        text = (source / name).read_text(encoding="utf-8")
        (target / name).write_text(text.replace(old, new), encoding="utf-8")
    return target


def test_a_mistake_is_one_line(data: Path, tmp_path: Path) -> None:
    large, small, plain = data / "large", data / "small", data / "plain.csv"
    (tmp_path / "alone").mkdir()
    (tmp_path / "alone" / "fixes.csv").write_bytes((large / "fixes.csv").read_bytes())
    (tmp_path / "no.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    (tmp_path / "no.jsonl").write_text("{}\n", encoding="utf-8")
    other = changed(large, tmp_path / "other", ".png", ".jpg")
    word = changed(large, tmp_path / "word", ",true,", ",yes,")
    rejected = changed(large, tmp_path / "rejected", ",correct,", ",rejected,")
    truth = ("--truth", "identity")
    header, *lines = csv.reader(io.StringIO(plain.read_text(encoding="utf-8")))
    lines[1][header.index("score")] = "nan"
    unknown = tmp_path / "unknown.csv"
    unknown.write_text("\n".join(map(",".join, (header, *lines))), encoding="utf-8")
    for arguments, code, said in (
        ([large], 0, ""),
        ([plain, *truth], 2, "RUNS: expected two or more to compare"),
        ([], 2, "Missing argument"),
        ([large, data / "none"], 2, "got nothing there"),
        ([large, data / "monday"], 1, "monday: expected the folder of a report, by surefix eval"),
        ([large, tmp_path / "alone"], 1, "with methods.csv in it, got none"),
        (
            [large, other],
            1,
            "other: expected the queries of large, 40 (000.png to 039.png), got 40 ",
        ),
        ([large, word], 1, "fixes.csv, row 2: expected trusted, true or false, got 'yes'"),
        (
            [plain, unknown, *truth],
            1,
            "unknown.csv, row 3: expected a finite score, got nan",
        ),
        ([large, rejected], 1, "rejected, recall: expected one convention, got 'rejected'"),
        (
            [large, tmp_path / "no.csv", *truth],
            1,
            "no.csv, row 1: expected the columns query, place",
        ),
        (
            [large, tmp_path / "no.jsonl", *truth],
            1,
            "no.jsonl, row 1: expected an object with query",
        ),
        ([large, plain], 2, "--truth: expected it, or --query-positions, to judge"),
        ([large, small, *truth], 2, "--truth: expected none with reports"),
        ([large, small, "--against", "big"], 2, "--against: expected one of large, small, got"),
        (
            [large, small, "--method", "best"],
            1,
            "large, method: expected one of sequence, weighted",
        ),
        (
            [large, small, "-o", "out.txt"],
            2,
            "expected a name that ends in .csv, .html, .json or .md",
        ),
        ([large, plain, *truth, "-o", plain], 2, "is what is read here; name another file"),
        (
            [large, data / "small.safetensors", *truth],
            2,
            "--queries: expected the drive to match to",
        ),
        ([large, small, "--queries", data / "tuesday"], 2, "--queries: expected maps"),
        ([f"a={large}", f"a={small}"], 2, "expected a name each, as NAME=PATH, got a twice"),
        (
            [large, data / "small.npy", *truth, "--method", "fused"],
            2,
            "--method fused: expected one",
        ),
        ([plain, data / "track.jsonl", "--query-positions", "a.csv"], 2, "--tolerance: expected"),
    ):
        made = surefix_("compare", *arguments, code=code)
        assert said in " ".join(made.stderr.replace("\u2502", " ").split()), (
            arguments,
            made.stderr,
        )
        assert code != 1 or made.stderr.count("\n") == 1


def test_images_may_have_any_name(tmp_path: Path) -> None:
    for day in ("monday", "tuesday"):
        (tmp_path / day).mkdir()
        for k in range(12):
            name = os.fsdecode(b'%02d\xff,\n"<b>\xe2\x80\xa8.png' % k)
            scene = np.random.default_rng(k).integers(0, 256, (32, 64), np.uint8)
            Image.fromarray(scene).save(tmp_path / day / name)
    what = (tmp_path / "monday", tmp_path / "tuesday", "--truth", "identity")
    surefix_("eval", *what, "--method", "single", "--method", "weighted", "-o", tmp_path / "report")
    found = table(surefix_("compare", tmp_path / "report").stdout)
    assert found["single", "right"]["value"] == "1.0"


def test_another_drive_with_the_same_names_is_found_out(data: Path, tmp_path: Path) -> None:
    what = ("eval", data / "large.safetensors", data / "monday", "--truth", "identity")
    surefix_(*what, "--method", "weighted", "-o", tmp_path / "monday")
    made = surefix_("compare", data / "large", tmp_path / "monday", code=1)
    said = "monday: expected the drive of large, got other files of the same names; compare them"
    assert said in made.stderr
    maps = (data / "small.safetensors", "--queries", data / "monday", "--truth", "identity")
    made = surefix_("compare", data / "large", *maps, code=1)
    assert "small: expected the drive of large, got other files" in made.stderr
    surefix_("compare", data / "large", tmp_path / "monday", "--unpaired")


def test_other_queries_can_be_compared_unpaired(data: Path, tmp_path: Path) -> None:
    other = changed(data / "large", tmp_path / "other", ".png", ".jpg")
    found = table(surefix_("compare", data / "small", other, "--unpaired").stdout)
    paired = table(surefix_("compare", data / "small", data / "large").stdout)
    for figure in ("right", "area"):
        own, pair = found["other", figure], paired["large", figure]
        assert (own["value"], own["difference"]) == (pair["value"], pair["difference"])
