"""The report of ``surefix demo --town``: three roads with a ring and two junctions, mapped in two
seasons, and driven through in a third.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from surefix._words import plural
from surefix.machine import machine
from surefix.plot.belief import confidence
from surefix.plot.matrix import distance_matrix
from surefix.plot.plan import plan
from surefix.report import sections
from surefix.report.page import Picture, Section, Table, Tile, drawn, photograph, write
from surefix.report.tables import write_csv
from surefix.study.demo import ACCEPT
from surefix.study.town import BEST, ONE_LINE, SUMMER, TownDemo
from surefix.tables.geojson import roads

__all__ = ["FILES", "write_town"]

FILES = {
    "report.html": "this page, with its pictures inside",
    "plan.png": "right and wrong fixes from above",
    "confidence.png": "how sure the tracker was, frame by frame",
    "one_line.png": "the same on a map that is one line",
    "distance_matrix.png": "the distances to each place, road by road",
    "fixes.csv": "every fix of the drive",
    "truth.csv": "the true place of each frame",
    "town.safetensors": "the map",
    "route.geojson": "its roads",
}


def write_town(demo: TownDemo, folder: Path, command: str, seconds: float) -> Path:
    """Writes the page and all that belongs to it into ``folder``; returns the path of the page."""
    m = len(demo.drive)
    lead = (
        f"A town of three roads, {len(demo.known)} places: a road in, a ring that one can drive "
        "round for ever, and a road out that leaves the ring halfway. It was mapped on a summer "
        "noon and once more in autumn; the two drives were laid upon each other without any "
        "label, so that a place knows both of its looks.",
        f"Then, on a winter afternoon, {plural(m, 'frame')}: in, one and a half times round the "
        "ring, and out, with the odometry of its wheels. The tracker knows the junctions, and "
        "follows the robot through them.",
    )
    return write(
        folder,
        "A town of roads: junctions, a ring, two seasons",
        lead,
        _hero(demo),
        _tiles(demo),
        [_from_above(demo), _through(demo), _matrix(demo), _made(demo, seconds)],
        lambda inside: _write_tables(demo, inside),
        identity=sections.identity("surefix demo --town"),
        command=command,
    )


def _write_tables(demo: TownDemo, folder: Path) -> None:
    demo.run.to_csv(folder / "fixes.csv")
    demo.known.save(folder / "town.safetensors")
    degrees = demo.known.degrees
    assert degrees is not None
    lines = json.dumps(roads(degrees, demo.known.segments))
    (folder / "route.geojson").write_text(lines + "\n", encoding="utf-8")
    write_csv(folder / "truth.csv", "frame,place", enumerate(demo.drive.truth.tolist()))


def _hero(demo: TownDemo) -> Sequence[Picture]:
    query = demo.drive.junctions[0] + 2
    place = int(demo.run.place[query])
    segment = demo.run.segment[query]
    view = f"The drive, frame {query}, just past the first junction."
    answer = f"The map, place {place}, on {demo.town.names[segment]}: surefix's answer."
    summer = demo.town.mapped()[place]
    return (
        photograph(demo.drive.images[query], f"A street in winter, frame {query}.", view),
        photograph(summer, f"A street in summer, place {place}.", answer),
    )


def _tiles(demo: TownDemo) -> Sequence[Tile]:
    m, sure = len(demo.drive), demo.sure(BEST)
    right = {name: int(flags.sum()) for name, flags in demo.right.items()}
    waits = [max(demo.after_junctions(name)) for name in (BEST, ONE_LINE)]
    return (
        sections.share("right", right[BEST], m, "of the fixes are right"),
        sections.share("sure", int(sure.sum()), m, f"are sure: confidence {ACCEPT:g} or more"),
        sections.share(
            "sure-right",
            int((sure & demo.right[BEST]).sum()),
            int(sure.sum()),
            "of these are right",
        ),
        Tile(
            "junction",
            plural(waits[0], "frame"),
            "after a junction until right and sure, at most",
            f"{waits[1]} on a map that is one line",
        ),
        sections.share("one-line", right[ONE_LINE], m, "right on a map that is one line"),
        sections.share("summer", right[SUMMER], m, "right with one season"),
    )


def _from_above(demo: TownDemo) -> Section:
    town, drive = demo.town, demo.drive
    picture = drawn(
        (9, 5.2),
        "The town from above, each frame at its true place, marked by whether its fix is right.",
        plan,
        town.positions,
        town.segments,
        place=drive.truth,
        right=demo.right[BEST],
        names=town.names,
    )
    return Section(
        "From above",
        (
            "Each frame stands where it was taken; its mark says whether the tracker's place was "
            "right, within one place along the road. Two places on either side of a junction may "
            "have neighbouring numbers; they are not taken for neighbours.",
        ),
        {"plan.png": picture},
    )


def _through(demo: TownDemo) -> Section:
    segments = demo.town.segments
    pictures = {}
    names = {BEST: "confidence.png", ONE_LINE: "one_line.png"}
    for name, file in names.items():
        said, off = demo.runs[name].confidence, demo.runs[name].off_map
        assert said is not None
        assert off is not None
        stretches = [("junction", range(at, at + 3)) for at in demo.drive.junctions]
        pictures[file] = drawn(
            (11, 3.2),
            f"The confidence of each fix: {name}.",
            confidence,
            said,
            off,
            demo.right[name],
            stretches=stretches,
            accept=ACCEPT,
            caption=f"On the map of {name}.",
        )
    rows = []
    for name in (BEST, ONE_LINE, SUMMER):
        sure, right = demo.sure(name), demo.right[name]
        waits = ", ".join(map(str, demo.after_junctions(name)))
        alone = demo.town.segments.are_near(demo.runs[name].single_place, demo.drive.truth)
        counts = (alone.sum(), right.sum(), (sure & right).sum(), (sure & ~right).sum())
        rows.append((name, *(str(int(count)) for count in counts), waits))
    header = (
        "map",
        "single right",
        "right",
        "sure and right",
        "sure and wrong",
        "frames after each junction",
    )
    caption = f"Of {len(demo.drive)} frames; at a junction, frames until right and sure again."
    return Section(
        "Through the junctions",
        (
            f"The map has {plural(len(segments), 'segment')}, of which one is closed, and "
            f"{plural(len(segments.links), 'link')}. The tracker's belief moves along them: at the "
            "place of a link it is shared among all roads that go on from there, and the next "
            "frames decide. On a map that is one line, the robot has to be found again.",
        ),
        pictures,
        tables=(Table("maps", caption, header, rows),),
    )


def _matrix(demo: TownDemo) -> Section:
    sad, run = demo.known.descriptor, demo.run
    assert sad is not None
    columns = [demo.known.distances(sad.describe(image)) for image in demo.drive.images]
    picture = drawn(
        (8, 6.4),
        "The distance between each place and each frame, with the match of each.",
        distance_matrix,
        np.stack(columns, axis=1),
        run.place,
        run.trusted,
        demo.right[BEST],
        truth=demo.drive.truth,
        textured=True,
    )
    return Section(
        "The distances",
        (
            "A column a frame, a row a place: first the ring, then the road in, then the road out. "
            "The path jumps at each junction, and at the end of a lap it begins again below. A "
            "place's distance is the least of its two seasons'.",
        ),
        {"distance_matrix.png": picture},
    )


def _made(demo: TownDemo, seconds: float) -> Section:
    height, width = demo.drive.images[0].shape[:2]
    return sections.made(
        ("Town", f"generated; {len(demo.known)} places, one every 3 m"),
        ("Frames", f"{width} x {height} pixels; {len(demo.drive)} of the drive"),
        ("Descriptor", "SAD: grey, 64 x 32 pixels, normalized in patches of 8 x 8, a byte each"),
        ("Seasons", "mapped at summer noon and in autumn; driven on a winter afternoon"),
        ("Right means", "within one place of the true one, along its road"),
        ("On", machine()),
        ("Took", f"{seconds:.1f} s"),
        *FILES.items(),
    )
