"""``surefix map join``, ``cut``, ``thin``, ``traverse`` and ``info``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

import surefix
from commands import surefix_
from surefix.simulate import Route

N = 40
UInt8 = npt.NDArray[np.uint8]


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two roads, of which the second begins in the middle of the first; and a map without
    positions.
    """
    folder = tmp_path_factory.mktemp("town")
    ways = {
        "main": np.stack([np.arange(N) * 2.0, np.zeros(N)], axis=1),
        "side": np.stack([np.full(N, 40.0), np.arange(N) * 2.0 + 1], axis=1),
    }
    for seed, (name, way) in enumerate(ways.items()):
        route = Route(places=N, size=(64, 32), seed=seed)
        for kind, drive in (("", route.reference()), ("2", route.revisit())):
            (folder / f"{name}{kind}").mkdir()
            for index, image in enumerate(drive):
                Image.fromarray(image).save(folder / f"{name}{kind}" / f"{name}{index}.png")
        np.save(folder / f"{name}.npy", way)
        given = folder / name, "--positions", folder / f"{name}.npy"
        surefix_("map", "build", *given, "-o", folder / f"{name}.map")
    surefix_("map", "build", folder / "main", "-o", folder / "plain.map")
    return folder


def facts(file: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(surefix_("map", "info", file, "--json").stdout)
    return found


def refused(*arguments: Any) -> str:
    """The words of a refusal, as one line."""
    done = surefix_("map", *arguments, code=2, COLUMNS="300")
    return " ".join(done.stderr.replace("│", " ").split())


def test_roads_are_joined_and_linked_by_their_positions(town: Path, tmp_path: Path) -> None:
    out = tmp_path / "town.map"
    both = town / "main.map", town / "side.map"
    said = surefix_("map", "join", *both, "-o", out, "--link-within", 3, "--link", "79:0").stdout
    assert said.startswith(f"Joined 2 maps as {out}: 80 places x 2048 uint8, ")
    assert said.rstrip().endswith("; 2 segments, 2 links; 1 link found within 3 m")
    known = facts(out)
    assert known["segments"] == [[0, 40], [40, 80]]
    assert known["closed"] == []
    assert known["links"] == [[20, 40], [79, 0]]
    shown = surefix_("map", "info", out).stdout
    assert "2: 0 to 39, 40 to 79" in shown
    assert "2: 20 to 40, 79 to 0" in shown
    # The drive turns off at the junction: the tracker follows.
    drive = [*sorted_images(town / "main2")[:20], *sorted_images(town / "side2")]
    localizer = surefix.Localizer(surefix.Map.open(out), motion="steady")
    fixes = [localizer.push(surefix.read_image(file)) for file in drive]
    places = np.array([fix.place for fix in fixes])
    truth = np.r_[np.arange(20), 40 + np.arange(N)]
    assert np.mean(np.abs(places - truth)[5:] <= 1) > 0.9


def sorted_images(folder: Path) -> list[str]:
    return [str(file) for file in surefix.find_images(folder)]


def test_joins_say_what_is_wrong(town: Path, tmp_path: Path) -> None:
    out = tmp_path / "town.map"
    both = town / "main.map", town / "side.map"
    one = refused("join", both[0], "-o", out)
    assert "FILES: expected two maps or more, got 1" in one
    for link in ("5", "5:", "x:4", "-1:4", "3-4"):
        assert "--link: expected FROM:TO, two places" in refused(
            "join", *both, "-o", out, "--link", link
        )
    assert "--link: expected places from 0 to 79, got 4 to 99" in refused(
        "join", *both, "-o", out, "--link", "4:99"
    )
    for metres in ("0", "-3", "nan"):
        assert "--link-within: expected metres above 0" in refused(
            "join", *both, "-o", out, "--link-within", metres
        )
    plain = town / "plain.map", town / "plain.map"
    assert "--link-within: expected maps with positions" in refused(
        "join", *plain, "-o", out, "--link-within", 3
    )
    # One with positions, one without.
    surefix_("map", "join", both[0], town / "plain.map", "-o", out, code=1)
    assert not out.exists()
    said = surefix_("map", "join", *plain, "-o", out).stdout
    assert said.rstrip().endswith("; warning: places 40 to 79 have names that come before")


def test_a_stretch_is_kept(town: Path, tmp_path: Path) -> None:
    out, source = tmp_path / "part.map", town / "main.map"
    whole = surefix.Map.open(source)
    for places, first, end in (("10:30", 10, 30), (":12", 0, 12), ("25:", 25, N)):
        said = surefix_("map", "cut", source, places, "-o", out).stdout
        assert said.startswith(f"Kept places {first} to {end - 1} of {N} in {out}: {end - first} ")
        part = surefix.Map.open(out)
        assert np.array_equal(part.descriptors, whole.descriptors[first:end])
        assert part.positions is not None
        assert part.positions[0].tolist() == [2 * first, 0]
    # In place.
    surefix_("map", "cut", out, "2:9")
    assert len(surefix.Map.open(out)) == 7
    before = out.read_bytes()
    for places in (":", "5", "a:b", "3:3", "5:2", "0:8", "-1:3", "1:2:3"):
        assert "PLACES: expected" in refused("cut", out, "--", places)
    surefix_("map", "cut", out, "2:3", code=1)
    surefix_("map", "cut", out, "1:5", "-o", tmp_path / "no" / "x", code=1)
    assert out.read_bytes() == before


def test_a_map_is_thinned(town: Path, tmp_path: Path) -> None:
    out, source = tmp_path / "thin.map", town / "main.map"
    said = surefix_("map", "thin", source, "--metres", 4, "-o", out).stdout
    assert said.startswith(f"Kept 20 of 40 places in {out}: 20 places")
    thin = surefix.Map.open(out)
    assert thin.positions is not None
    assert np.diff(thin.positions[:, 0]).tolist() == [4.0] * 19
    before = out.read_bytes()
    for metres in ("0", "-1", "nan"):
        assert "--metres: expected a number above 0" in refused("thin", out, "--metres", metres)
    assert "--metres: expected a map with positions" in refused(
        "thin", town / "plain.map", "--metres", 2
    )
    # Fewer than two places are no map.
    surefix_("map", "thin", out, "--metres", 1000, code=1)
    assert out.read_bytes() == before


def test_a_traverse_is_added_and_taken_out_again(town: Path, tmp_path: Path) -> None:
    out, source = tmp_path / "both.map", town / "main.map"
    given = source, town / "main2", "--motion", "steady", "-o", out
    said = surefix_("map", "traverse", *given).stdout
    assert said.startswith(f"Added the traverse {town / 'main2'} to {out}: {N} places x 2048 ")
    assert f"of {N} queries are sure (mean confidence " in said
    assert said.rstrip().endswith("; 2 traverses now")
    first, second = facts(out)["traverses"]
    assert first == {"label": "", "rows": N, "places": [[0, N - 1]]}
    assert second["label"] == "main2"
    assert f"it covers {second['rows']} of {N} places" in said
    assert sum(end - start + 1 for start, end in second["places"]) == second["rows"] > N // 2
    shown = surefix_("map", "info", out).stdout
    assert f"0 of {N} places, 1 (main2) of {second['rows']} places" in shown
    known = surefix.Map.open(out)
    drive = [surefix.read_image(file) for file in sorted_images(town / "main2")]
    before = surefix.match(surefix.Map.open(source), drive).single_distance
    assert np.median(surefix.match(known, drive).single_distance) < np.median(before)
    said = surefix_("map", "traverse", out, "--remove", 1).stdout
    assert said.startswith(f"Took traverse 1 out of {out}: ")
    assert said.rstrip().endswith("; 1 traverse left")
    assert np.array_equal(surefix.Map.open(out).descriptors, surefix.Map.open(source).descriptors)


def test_traverses_say_what_is_wrong(town: Path, tmp_path: Path) -> None:
    source = tmp_path / "map"
    source.write_bytes((town / "main.map").read_bytes())
    before = source.read_bytes()
    assert "DRIVE: expected another drive of the road" in refused("traverse", source)
    assert "--remove: expected a map of several traverses" in refused(
        "traverse", source, "--remove", 0
    )
    assert "--remove: expected no DRIVE" in refused(
        "traverse", source, town / "main2", "--remove", 0
    )
    assert "motion" in refused("traverse", source, town / "main2", "--motion", "wild")
    refused("traverse", source, town / "main2", "--least", 2)
    surefix_("map", "traverse", source, town / "nothing", code=1)
    # A drive of another road has no sure place.
    done = surefix_("map", "traverse", source, town / "side2", "--least", 1, code=1)
    assert "place is sure" in done.stderr
    assert source.read_bytes() == before
    surefix_("map", "traverse", source, town / "main2", "--motion", "steady")
    assert "--remove: expected a traverse from 0 to 1, got 2" in refused(
        "traverse", source, "--remove", 2
    )


def test_info_of_many_segments_is_short(tmp_path: Path) -> None:
    out = tmp_path / "city.map"
    rows = np.random.default_rng(0).random((3000, 4), np.float32)
    segments = surefix.Segments(3000, range(3, 3000, 3), closed=[1, 7], links=[(2, 90), (5, 60)])
    surefix.Map.from_descriptors(rows).with_segments(segments).save(out)
    shown = surefix_("map", "info", out).stdout
    assert "1000, 2 closed: 0 to 2, 3 to 5 closed, 6 to 8, 9 to 11, 12 to 14, 995 more" in shown
    assert max(map(len, shown.splitlines())) < 120
    known = facts(out)
    assert len(known["segments"]) == 1000
    assert known["closed"] == [1, 7]
    assert known["origin"] is None
    assert known["thumbnails"] is None


@pytest.mark.parametrize(
    ("command", "method"),
    [
        (["append", "main2"], "with_segments"),
        (["cut", ":20"], "with_segments"),
        (["thin", "--metres", "4"], "thin"),
        (["traverse", "main2", "--label", "again"], "add_traverse"),
    ],
)
def test_a_map_that_is_changed_takes_no_append_meanwhile(
    command: list[str], method: str, town: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, *rest = [str(town / each) if each == "main2" else each for each in command]
    out = tmp_path / "main.map"
    out.write_bytes((town / "main.map").read_bytes())
    if name == "append":
        rest += ["--break", str(N + 5), "--positions", str(town / "main.npy")]
    refusals = []
    usual, appended = getattr(surefix.Map, method), surefix.Map.open(town / "side.map")

    def beside(*given: Any, **more: Any) -> Any:
        # The map was read, and is not saved yet.
        with pytest.raises(surefix.SurefixFileError) as refused:
            surefix.Map.append(out, appended, new_segment=True)
        refusals.append(str(refused.value))
        return usual(*given, **more)

    monkeypatch.setattr(surefix.Map, method, beside)
    surefix_("map", name, out, *rest)
    assert refusals
    assert all(said.startswith(f"{out}: cannot write the map: another") for said in refusals)
    assert [*tmp_path.iterdir()] == [out]
