"""``surefix map info``: say what a map holds."""

import json
import sys
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from surefix import Map
from surefix._saving import save
from surefix._terminal import Console, say
from surefix._words import plural
from surefix.cli.drives import open_map
from surefix.cli.flags import documented
from surefix.cli.inputs import refuse
from surefix.tables.fix_files import NO_DEGREES
from surefix.tables.geojson import roads
from surefix.tables.utm import map_degrees

# Blank places, segments and links that are named.
NAMED = 5
WIDE = 10_000


@documented
def info(
    file: Path,
    as_json: Annotated[bool, typer.Option("--json")] = False,
    geojson: Path | None = None,
) -> None:
    """Say what a map holds.

    Parameters
    ----------
    file: The map to look at.
    as_json: One JSON object instead of a table.
    geojson: Write the route to this file too, a line for each segment, if the map's positions came
        as degrees.
    """
    route = look(file)
    if geojson is not None:
        _write_geojson(route, file, geojson)
    facts = facts_of(route, file)
    if as_json:
        say(json.dumps(facts))
        return
    table = Table(show_header=False, box=None)
    said = _said_facts(route, facts)
    for name, value in facts.items():
        if (shown := said.get(name, str(value))) is not None:
            table.add_row(name, shown)
    # A pipe has lines of any length.
    width = None if sys.stdout.isatty() else WIDE
    Console(soft_wrap=True, width=width).print(table)


def facts_of(route: Map, file: Path) -> dict[str, Any]:
    """All that ``--json`` says."""
    names, where, small = route.names, route.positions, route.thumbnail(0)
    return {
        "file": str(file),
        "bytes": file.stat().st_size,
        "places": len(route),
        "dim": route.dim,
        "dtype": str(route.dtype),
        "metric": route.metric,
        "image_size": None if route.image_size is None else list(route.image_size),
        "levels": None if route.levels is None else list(route.levels),
        "descriptor": repr(route.descriptor) if route.descriptor else None,
        "recipe": route.recipe,
        "post": None if route.post is None else route.post.steps,
        "input_dim": route.input_dim,
        "names": [names[0], names[-1]] if names else None,
        "repeated": repeated(names),
        "positions": None if where is None else list(where.shape),
        "origin": None if route.origin is None else list(route.origin),
        "plane": route.plane,
        "segments": [[each.start, each.end] for each in route.segments],
        "closed": [index for index, each in enumerate(route.segments) if each.closed],
        "links": route.segments.links.tolist(),
        "traverses": [_traverse(each) for each in route.traverses],
        "thumbnails": None if small is None else list(small.shape),
        "blank": route.blank.tolist(),
        "parts": _parts_of(file),
    }


def _parts_of(file: Path) -> dict[str, int]:
    """The bytes of each part of a map's file, which is one of safetensors."""
    with file.open("rb") as opened:
        length = int.from_bytes(opened.read(8), "little")
        header = json.loads(opened.read(length))
    header.pop("__metadata__", None)
    spans = {name: part["data_offsets"] for name, part in header.items()}
    return {"header": 8 + length} | {name: end - start for name, (start, end) in spans.items()}


def _traverse(each: Any) -> dict[str, Any]:
    """Its label, and the first and last of each stretch of places that it covers."""
    places = np.asarray(each.places, np.int64)
    ends = np.flatnonzero(np.diff(places, prepend=-2, append=len(places) + int(places[-1]) + 2) > 1)
    runs = [[int(places[a]), int(places[b - 1])] for a, b in pairwise(ends)]
    return {"label": each.label, "rows": len(places), "places": runs}


def _said_facts(route: Map, facts: dict[str, Any]) -> dict[str, str | None]:
    """The facts as the table says them, None for one that it leaves out."""
    names, small = route.names, facts["thumbnails"]
    return {
        "bytes": f"{facts['bytes']:,}",
        "descriptor": _descriptor_of(route),
        # The descriptor's name stands for the recipe; --json has all of it.
        "recipe": None,
        "input_dim": None,
        "post": None if route.post is None else repr(route.post),
        "names": f"{names[0]} to {names[-1]}" if names else "none",
        "repeated": said_repeated(facts["repeated"]) if facts["repeated"] else None,
        "positions": _said_positions(route),
        "origin": None,
        "plane": None,
        "segments": _said_segments(route),
        "closed": None,
        "links": _said_links(facts["links"]),
        "parts": _said_parts(facts["parts"]),
        "traverses": _said_traverses(facts["traverses"]),
        "thumbnails": None if small is None else f"{small[1]} x {small[0]}",
        "blank": "".join(said_blank(facts["blank"], names)) or "none",
        "image_size": " x ".join(map(str, route.image_size)) if route.image_size else None,
        "levels": " to ".join(map(str, route.levels)) if route.levels else None,
    }


def _said_parts(parts: dict[str, int]) -> str:
    """The large parts of a map's file, and their bytes."""
    large = {name: size for name, size in parts.items() if 100 * size > sum(parts.values())}
    return ", ".join(f"{name} {size:,}" for name, size in large.items()) + " bytes"


def look(file: Path) -> Map:
    """The map without its rows: a file of gigabytes takes no longer than a small one."""
    if file.is_dir():
        return open_map(str(file))
    return Map.open(file, mmap=file.is_file())


def size_of(file: Path) -> str:
    """How many places of how many numbers it has, and its size."""
    route = look(file)
    size = f"{file.stat().st_size / 1e6:.1f} MB"
    return f"{plural(len(route), 'place')} x {route.dim} {route.dtype}, {size}"


def said_blank(blank: list[int], names: list[str] | None, done: str = "") -> list[str]:
    """How many places show nothing, which are the first, and what is done about it."""
    if not blank:
        return []
    named = [f"{place} ({names[place]})" if names else str(place) for place in blank[:NAMED]]
    more = [f"{len(blank) - NAMED} more"] if len(blank) > NAMED else []
    shows = "shows" if len(blank) == 1 else "show"
    said = f"{plural(len(blank), 'place')} {shows} nothing: {', '.join([*named, *more])}"
    return [f"{said}: {done}" if done else said]


def repeated(names: list[str] | None) -> list[list[int]]:
    """The stretches of places whose names come earlier in the map: first and last of each."""
    known: set[str] = set()
    found: list[list[int]] = []
    for place, name in enumerate(names or ()):
        if name in known:
            if found and found[-1][1] == place - 1:
                found[-1][1] = place
            else:
                found.append([place, place])
        known.add(name)
    return found


def said_repeated(stretches: list[list[int]]) -> str:
    """The stretches in words."""
    parts = [f"{first} to {last}" if first != last else str(first) for first, last in stretches[:5]]
    more = f" and {len(stretches) - 5} stretches more" if len(stretches) > 5 else ""
    return f"places {', '.join(parts)}{more} have names that come before"


def _said_positions(route: Map) -> str:
    where = route.positions
    if where is None:
        return "none"
    said = f"{where.shape[1]} coordinates a place"
    if route.origin is not None:
        latitude, longitude = route.origin
        return f"{said}, metres east and north of {latitude:.6g}, {longitude:.6g} (WGS84)"
    return f"{said}, in metres" + (f" of {route.plane}" if route.plane else "")


def _said_segments(route: Map) -> str:
    """How many segments there are, and the first few."""
    segments = route.segments
    shown = [
        f"{each.start} to {each.end - 1}" + (" closed" if each.closed else "")
        for each in list(segments)[:NAMED]
    ]
    if len(segments) == 1:
        return "1, closed" if segments[0].closed else "1"
    closed = sum(each.closed for each in segments)
    count = f"{len(segments)}" + (f", {closed} closed" if closed else "")
    more = [f"{len(segments) - NAMED} more"] if len(segments) > NAMED else []
    return f"{count}: {', '.join([*shown, *more])}"


def _said_links(links: list[list[int]]) -> str | None:
    if not links:
        return None
    shown = [f"{start} to {end}" for start, end in links[:NAMED]]
    more = [f"{len(links) - NAMED} more"] if len(links) > NAMED else []
    return f"{len(links)}: {', '.join([*shown, *more])}"


def _said_traverses(traverses: list[dict[str, Any]]) -> str | None:
    if len(traverses) < 2:
        return None
    shown = [
        f"{index}" + (f" ({each['label']})" if each["label"] else "") + f" of {each['rows']} places"
        for index, each in enumerate(traverses)
    ]
    return ", ".join(shown)


def _descriptor_of(route: Map) -> str:
    if route.descriptor is not None:
        return repr(route.descriptor)
    if route.recipe is None:
        return "ready descriptors: queries come as descriptors too"
    return f"{route.recipe['name']}: queries come as its descriptors, or as images with it"


def _write_geojson(route: Map, file: Path, out: Path) -> None:
    degrees = map_degrees(route, asked=True)
    if degrees is None:
        kind = "none" if route.positions is None else "metres only"
        raise typer.BadParameter(f"--geojson: {NO_DEGREES.format(kind)}")
    refuse(out.exists() and out.samefile(file), f"--geojson: {out} is the map; name another file")
    other = out.exists() and out.suffix.lower() not in (".geojson", ".json")
    expected = "--geojson: expected a new file, or one that ends in .geojson or .json"
    refuse(other, f"{expected}, got {out}, which exists")
    save(out, json.dumps(roads(degrees, route.segments)) + "\n", "cannot write the route")
