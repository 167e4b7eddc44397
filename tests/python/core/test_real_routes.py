"""The main job on real routes: the reference figures, through the wheel and through the command
line.
"""

import csv
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import oracle
import real_data
import surefix

# Correct single matches, trusted ones, trusted and correct ones, within one frame.
FIGURES = {"nordland": (311, 283, 279), "gardens_point": (42, 24, 17), "corridor": (29, 16, 7)}
# Decoders of JPEG differ by a grey level here and there; arrays do not.
SLACK = {"nordland": 0, "gardens_point": 2, "corridor": 2}


def route(name: str) -> tuple[Any, Any]:
    folder = real_data.folder() / name
    if name == "nordland":
        return np.load(folder / "summer_0000_1149.npy"), np.load(folder / "winter_0000_1149.npy")
    if name == "gardens_point":
        return folder / "day_left", folder / "day_right"
    return folder / "reference", folder / "query"


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_the_reference_figures(name: str) -> None:
    references, queries = route(name)
    places = surefix.Map.from_images(references)
    run = surefix.match(places, queries)
    truth = np.arange(len(run))
    right = np.abs(run.single_place - truth) <= 1
    got = (int(right.sum()), int(run.trusted.sum()), int((right & run.trusted).sum()))
    assert np.abs(np.subtract(got, FIGURES[name])).max() <= SLACK[name], got

    localizer = surefix.Localizer(places)
    assert [fix.place for fix in localizer.stream(queries)] == run.place.tolist()
    for length, floor in ((2, 1.0), (10, 1.0)):
        curves = [
            surefix.evaluate(
                surefix.match(
                    places, queries, sequence_length=length, weight=weight, floor="global"
                ),
                truth,
            )
            for weight in (0.0, 0.99)
        ]
        assert curves[1].auc(0.2) >= min(curves[0].auc(0.2) - 0.06, floor)


def test_nordland_is_the_oracles_to_the_last_place() -> None:
    references, queries = route("nordland")
    places = surefix.Map.from_images(references[:400])
    columns = [places.distances(places.descriptor.describe(image)) for image in queries[:120]]
    D = np.stack(columns, axis=1)
    expected = oracle.match(D, oracle.Options(sequence_length=5, floor="global"))
    run = surefix.match(places, queries[:120], sequence_length=5, floor="global")
    np.testing.assert_array_equal(run.place, expected.place)
    np.testing.assert_array_equal(run.trusted, expected.trusted)
    np.testing.assert_array_equal(run.anchors, expected.anchors)
    np.testing.assert_allclose(run.score, expected.score, rtol=1e-6, atol=0)


def test_a_street_with_a_standstill_and_a_tail_off_the_map_runs_through() -> None:
    cost = np.load(real_data.folder() / "bonn_cost_matrix.npy").astype(np.float32)
    for D in (cost, cost.T):
        run = surefix.match_distances(D, sequence_length=10, speeds=[0.0, 0.5, 1.0, 1.5])
        assert len(run) == D.shape[1]
        assert run.ready.sum() == D.shape[1] - 9
        assert np.isfinite(run.score).all()


@pytest.mark.parametrize("technique", ["NetVLAD", "CALC", "HOG"])
def test_learned_techniques_come_as_ready_distances(technique: str) -> None:
    matrices = real_data.folder() / "corridor" / "matrices"
    similarity = np.load(matrices / f"{technique}_similarity_ref_x_query.npy")
    run = surefix.match_distances(1 - similarity, sequence_length=5)
    expected = oracle.match(1 - similarity, oracle.Options(sequence_length=5, floor="global"))
    np.testing.assert_array_equal(run.place, expected.place)


@pytest.mark.slow
def test_the_command_line_maps_and_runs_a_real_route(tmp_path: Path) -> None:
    references, queries = route("gardens_point")
    surefix_ = [sys.executable, "-m", "surefix"]
    file, fixes = tmp_path / "left.safetensors", tmp_path / "fixes.csv"
    subprocess.run([*surefix_, "map", "build", str(references), "-o", str(file)], check=True)
    subprocess.run([*surefix_, "run", str(file), str(queries), "-o", str(fixes)], check=True)
    with fixes.open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    run = surefix.match(surefix.Map.open(file), queries, motion="any")
    assert [int(row["place"]) for row in rows] == run.place.tolist()
    assert [row["trusted"] == "true" for row in rows] == run.trusted.tolist()
    assert rows[3]["place_name"].startswith("Image")
