"""What ``surefix eval`` says of queries and truths that say little."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from commands import surefix_
from surefix.frames.levels import Clipping
from surefix.simulate import Route

pytest.importorskip("matplotlib")
pytest.importorskip("bokeh")

pytestmark = pytest.mark.usefixtures("undrawn")

N = 40
TRUTH = ("--truth", "identity")


@pytest.fixture(scope="module")
def road(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Images of 8 bits, of 12 and of 16, some that show nothing, and maps of the first two."""
    folder = tmp_path_factory.mktemp("deep")
    for at, image in enumerate(Route(places=N, size=(64, 32), seed=3).reference()):
        grey = np.asarray(image).mean(axis=2)
        kinds: dict[str, npt.NDArray[np.generic]] = {
            "plain": grey.astype(np.uint8),
            "dark": (grey * (at not in (5, 6, 7))).astype(np.uint8),
            "deep": (grey * 16).astype(np.uint16),
            "bright": (grey * 16 + 20_000).astype(np.uint16),
            **({"one": grey.astype(np.uint8)} if at == 0 else {}),
        }
        for kind, array in kinds.items():
            (folder / kind).mkdir(exist_ok=True)
            Image.fromarray(array).save(folder / kind / f"{at:03}.png")
    for kind in ("plain", "deep"):
        surefix_("map", "build", folder / kind, "-o", folder / f"{kind}.safetensors")
    return folder


def said(road: Path, route: str, queries: str, *more: object, code: int = 0) -> str:
    """All that it says."""
    how = ("--method", "single", "-o", road / "report")
    done = surefix_("eval", road / f"{route}.safetensors", road / queries, *more, *how, code=code)
    return " ".join((done.stdout + done.stderr).replace("│", " ").split())


def test_queries_that_show_nothing_are_counted(road: Path) -> None:
    assert "Warning: 3 queries of 40 show nothing" in said(road, "plain", "dark", *TRUTH)
    assert "nothing is matched" not in said(road, "plain", "plain", *TRUTH)


def test_levels_that_do_not_fit_are_said_by_eval_and_run(road: Path, tmp_path: Path) -> None:
    few, outside = "leaves few levels", "lie outside of the map's levels"
    assert few in said(road, "plain", "deep", *TRUTH)
    assert outside in said(road, "deep", "bright", *TRUTH)
    for queries, warning in (("deep", few), ("bright", outside)):
        route = road / ("plain.safetensors" if queries == "deep" else "deep.safetensors")
        done = surefix_("run", route, road / queries, "-o", tmp_path / "fixes.csv")
        assert warning in done.stderr
    line = said(road, "deep", "deep", *TRUTH)
    assert few not in line
    assert outside not in line


@pytest.mark.parametrize(("bits", "few"), [(8, True), (10, True), (12, True), (14, False)])
def test_twelve_bits_and_fewer_leave_few_levels(bits: int, few: bool) -> None:
    clipping = Clipping(None)
    clipping.add(np.linspace(0, 2**bits - 1, 2_000).astype(np.uint16).reshape(40, 50))
    assert (clipping.warning is not None) == few


def test_names_of_other_images_are_refused(road: Path) -> None:
    way = [(f"{at:03}.png", 2.0 * at) for at in range(N)]
    table = "".join(f"{name},{x},0\n" for name, x in way)
    (road / "places.csv").write_text("name,x,y\n" + table)
    (road / "others.csv").write_text("image,x,y\n" + table.replace(".png", "_left.jpg"))
    positions = ("--positions", road / "places.csv", "--tolerance", 1, "--query-positions")
    line = said(road, "plain", "plain", *positions, road / "others.csv", code=1)
    assert "000_left.jpg, 001_left.jpg, 002_left.jpg for 000.png, 001.png, 002.png" in line
    assert "40 of 40 right" in said(road, "plain", "plain", *positions, road / "places.csv")
    # Those without a row are not known, however many they are.
    (road / "some.csv").write_text("image,x,y\n" + "".join(table.splitlines(True)[5:15]))
    line = said(road, "plain", "plain", *positions, road / "some.csv")
    assert "10 of 10 right" in line
    assert "30 queries of 40 without a known place" in line


@pytest.mark.parametrize("command", ["eval", "tune"])
def test_a_tolerance_of_nearly_all_places(road: Path, command: str, tmp_path: Path) -> None:
    out = tmp_path / "route.toml" if command == "tune" else tmp_path / "report"
    given = (command, road / "plain.safetensors", road / "plain", *TRUTH, "-o", out, "--tolerance")
    done = surefix_(*given, N - 1, code=2)
    words = " ".join(done.stderr.replace("│", " ").split())
    assert "tells places apart, got 39 of 40 places" in words
    chance = "a random match would be right for"
    assert f"Warning: {chance}" in surefix_(*given, 10).stderr
    assert chance not in surefix_(*given, 2).stderr


@pytest.mark.parametrize("command", ["eval", "tune", "align", "audit"])
def test_one_query(road: Path, command: str, tmp_path: Path) -> None:
    out = {"tune": "r.toml", "align": "r.csv", "eval": "report"}.get(command)
    more = TRUTH if command in ("eval", "tune") else ()
    to = () if out is None else ("-o", tmp_path / out)
    done = surefix_(command, road / "plain.safetensors", road / "one", *more, *to, code=1)
    assert "QUERIES: expected at least 2 queries, got 1" in done.stderr
