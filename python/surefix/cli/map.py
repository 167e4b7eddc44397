"""``surefix map``: make a map of a route, make it longer, or look at one."""

import json
import time
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from surefix import Map, Sad, SurefixValueError
from surefix._words import plural
from surefix.cli import inputs
from surefix.cli.drives import check_kind, open_map
from surefix.cli.flags import documented
from surefix.cli.inputs import refuse
from surefix.cli.where import metres_of_frames
from surefix.descriptors import metric_of
from surefix.descriptors.mapping import map_of_images, sad_map
from surefix.errors import check_folder
from surefix.frames import ImageFrames
from surefix.frames.levels import Levels, checked_levels

Metric = Literal["cosine", "euclidean", "manhattan"]
# How SAD descriptors are kept.
Dtype = Literal["u8", "f32"]


def _size(text: str) -> tuple[int, int]:
    width, x, height = text.lower().partition("x")
    if not (x and width.strip().isdecimal() and height.strip().isdecimal()):
        raise typer.BadParameter(f"expected WIDTHxHEIGHT, such as 64x32, got {text!r}")
    return int(width), int(height)


def _levels(levels: tuple[int, int]) -> Levels:
    try:
        return checked_levels(levels)
    except SurefixValueError as error:
        raise typer.BadParameter(f"--{error}") from None


def _sad(size: str | None, patch: int, dtype: Dtype, levels: Levels | None) -> Sad:
    try:
        return Sad(_size(size or "64x32"), patch, dtype, levels)
    except SurefixValueError as error:
        raise typer.BadParameter(str(error)) from None


def _check_sad(references: str, metric: Metric | None, post: str | None) -> None:
    """Refuses options that SAD does not have."""
    wanted = "expected ready descriptors or --model, got images for SAD"
    other = metric not in (None, "manhattan")
    refuse(other, f"--metric: {wanted}, which is manhattan: {references}")
    refuse(post is not None, f"--post: {wanted}: {references}")


@documented
def build(
    references: inputs.Place,
    out: Annotated[Path, typer.Option("--out", "-o")] = Path("route.safetensors"),
    size: str | None = None,
    patch: Annotated[int, typer.Option(min=1)] = 8,
    dtype: Dtype = "u8",
    metric: Annotated[Metric | None, typer.Option(show_default=False)] = None,
    key: str | None = None,
    model: Path | None = None,
    output: str | None = None,
    mean: str | None = None,
    std: str | None = None,
    batch: Annotated[int, typer.Option(min=1)] = 8,
    post: str | None = None,
    cache: inputs.Cache = None,
    positions: Path | None = None,
    skip_blank: bool = False,
    topic: inputs.Topic = None,
    stride: inputs.Stride = 1,
    every: inputs.Every = None,
    metres: inputs.Metres = None,
    odometry: inputs.Odometry = None,
    order: inputs.Order = "name",
    strict: inputs.Strict = False,
    levels: tuple[int, int] | None = None,
    mixed_sizes: bool = False,
) -> None:
    """Make a map of a route from its reference images, a video or a bag, or from ready
    descriptors.

    Parameters
    ----------
    references: A folder of images, a pattern ("route/*.png"), a .npy of images, a video or a bag;
        or ready descriptors: a .npy, .npz, .safetensors, .h5 or flat faiss index.
    out: The map to write.
    size: The small image, WIDTHxHEIGHT in pixels. SAD: 64x32 by default; --model: the network's own
        size.
    patch: SAD: the side of a patch, in pixels.
    dtype: SAD: how descriptors are kept.
    metric: Ready descriptors and --model: the metric; by default a faiss index's own, else cosine.
    key: Ready descriptors: which array of the file, if it has several.
    model: An ONNX file: describe the images by this network.
    output: --model: which of its outputs, if it has several.
    mean: --model: of RGB / 255, such as 0.5,0.5,0.5, or "none"; ImageNet's by default.
    std: --model: as --mean, the standard deviation.
    batch: --model: images at a time.
    post: Ready descriptors and --model: steps for them, and for queries later, with commas:
        standardize, or standardize:running by the queries so far, pca:N, projection:N, normalize.
    positions: A .npy or .csv of each place's position, (n, 2) or (n, 3) metres; or with a column
        time, at times of their own; or a folder of images named @east@north@.
    skip_blank: Leave out the places that show nothing: black, covered, or equal to many others.
    levels: Images of more than 8 bits: the samples LOW and HIGH that are black and white, for the
        map and all its queries; by default measured on the images.
    mixed_sizes: The images may differ in size.
    """
    start = time.perf_counter()
    range_ = None if levels is None else _levels(levels)
    check_folder(out, "cannot write the map")
    steps = None if post is None else inputs.steps_of(post)
    network = None
    if model is not None:
        of_sad = (patch, dtype) != (8, "u8")
        refuse(of_sad, "--patch, --dtype: expected images for SAD, got --model")
        sides = None if size is None else _size(size)
        network = inputs.open_network(model, output, sides, mean, std, batch)
    elif (output, mean, std, batch, cache) != (None, None, None, 8, None):
        options = "--output, --mean, --std, --batch, --cache"
        raise typer.BadParameter(f"{options}: expected --model too, got none")
    frames = inputs.open_frames(
        references,
        key,
        order=order,
        strict=strict,
        topic=topic,
        stride=stride,
        every=every,
        metres=metres,
        odometry=odometry,
    )
    inputs.check_not_read(out, [*frames.files, model, cache])
    where = None if positions is None else metres_of_frames(positions, frames)
    if frames.ready is not None:
        got = f"expected images, got the ready descriptors {references}"
        refuse(network is not None, f"--model: {got}")
        refuse((size, patch, dtype) != (None, 8, "u8"), f"--size, --patch, --dtype: {got}")
        refuse(range_ is not None or mixed_sizes, f"--levels, --mixed-sizes: {got}")
        by = metric or metric_of(references) or "cosine"
        Map.from_descriptors(frames.ready, by, positions=where, post=steps).save(out)
    elif network is not None:
        how: dict[str, Any] = {"levels": range_, "skip_bad": not strict}
        map_of_images(frames, network, metric or "cosine", where, steps, cache, **how).save(out)
    else:
        _check_sad(references, metric, post)
        sad = _sad(size, patch, dtype, range_)
        if isinstance(frames, ImageFrames):
            how = {"skip_bad": not strict, "mixed_sizes": mixed_sizes}
            Map.build(out, frames.source, sad, positions=where, **how)
        else:
            sad_map(frames, sad, where, mixed_sizes=mixed_sizes).save(out)
    made = _look(out)
    kept = None if frames.ready is not None else made.names
    blank = _blank(made.blank.tolist(), made.names, "left out" if skip_blank else MATCHED)
    if blank and skip_blank:
        made.without_blank().save(out)
    del made
    said = f"Made {out}: {_size_of(out)}, in {time.perf_counter() - start:.1f} s"
    print("; ".join([said, *blank, *inputs.notes_on(frames, kept)]))


MATCHED = "nothing is matched to them (--skip-blank leaves them out)"
# Blank places that are named.
NAMED = 5


def _blank(blank: list[int], names: list[str] | None, done: str = "") -> list[str]:
    """How many places show nothing, which are the first, and what is done about it."""
    if not blank:
        return []
    named = [f"{place} ({names[place]})" if names else str(place) for place in blank[:NAMED]]
    more = [f"{len(blank) - NAMED} more"] if len(blank) > NAMED else []
    shows = "shows" if len(blank) == 1 else "show"
    said = f"{plural(len(blank), 'place')} {shows} nothing: {', '.join([*named, *more])}"
    return [f"{said}: {done}" if done else said]


@documented
def append(
    file: Path,
    references: inputs.Place,
    positions: Path | None = None,
    model: inputs.Model = None,
    cache: inputs.Cache = None,
    order: inputs.Order = "name",
    strict: inputs.Strict = False,
    mixed_sizes: bool = False,
    topic: inputs.Topic = None,
    stride: inputs.Stride = 1,
    every: inputs.Every = None,
    metres: inputs.Metres = None,
    odometry: inputs.Odometry = None,
) -> None:
    """Make a map longer: images are described as its own were; ready descriptors must be of its own
    kind.

    The map's rows are copied, never read into memory, and the old map stays until the new one is
    whole.

    Parameters
    ----------
    file: The map that becomes longer.
    references: The places that follow: a folder of images, a pattern ("more/*.png"), a .npy, a
        video or a bag.
    positions: A .npy or .csv of each new place's position, if the map has positions.
    mixed_sizes: The images may differ in size.
    """
    start, old = time.perf_counter(), _look(file)
    frames = inputs.open_frames(
        references,
        order=order,
        strict=strict,
        topic=topic,
        stride=stride,
        every=every,
        metres=metres,
        odometry=odometry,
    )
    same = any(file.samefile(read) for read in frames.files if Path(read).exists())
    refuse(same, f"REFERENCES: {references} is the map itself")
    where = None if positions is None else metres_of_frames(positions, frames)
    more: dict[str, Any]
    network = None
    if model is not None:
        network = inputs.network_of(old, file, model)
        got = f"expected images, got the ready descriptors {references}"
        refuse(frames.ready is not None, f"--model: {got}")
    refuse(cache is not None and model is None, "--cache: expected --model too, got none")
    if model is None and frames.ready is None and old.recipe is not None:
        raise inputs.no_model(old.recipe["name"], file)
    if frames.ready is not None:
        rows, post, recipe = frames.ready, old.post, old.recipe
        Map.append(file, Map.from_descriptors(rows, old.metric, where, post=post, recipe=recipe))
    elif network is not None:
        images: Any = frames.source if isinstance(frames, ImageFrames) else frames
        more = {"positions": where, "cache": cache, "skip_bad": not strict}
        Map.append(file, images, network, **more)
    elif isinstance(frames, ImageFrames):
        more = {"positions": where, "skip_bad": not strict, "mixed_sizes": mixed_sizes}
        Map.append(file, frames.source, **more)
    elif old.descriptor is None:
        check_kind(old, str(file), frames, None)
    else:
        Map.append(file, sad_map(frames, old.descriptor, where, mixed_sizes=mixed_sizes))
    longer, seconds = _look(file), time.perf_counter() - start
    added = plural(len(longer) - len(old), "place")
    kept = None if frames.ready is not None or longer.names is None else longer.names[len(old) :]
    said = f"Added {added} to {file}: now {_size_of(file)}, in {seconds:.1f} s"
    blank = [place for place in longer.blank.tolist() if place >= len(old)]
    notes = [*_again(old, longer), *_blank(blank, longer.names), *inputs.notes_on(frames, kept)]
    print("; ".join([said, *notes]))


def _again(old: Map, longer: Map) -> list[str]:
    """The names of added places that the map had before: perhaps the same drive once more."""
    if old.names is None or longer.names is None:
        return []
    known = set(old.names)
    twice = [name for name in longer.names[len(old) :] if name in known]
    if not twice:
        return []
    span = twice[0] if len(twice) == 1 else f"{twice[0]} to {twice[-1]}"
    return [f"warning: {plural(len(twice), 'name')} were in the map before: {span}"]


@documented
def info(file: Path, as_json: Annotated[bool, typer.Option("--json")] = False) -> None:
    """Say what a map holds.

    Parameters
    ----------
    file: The map to look at.
    as_json: One JSON object instead of a table.
    """
    route = _look(file)
    names, where = route.names, route.positions
    facts = {
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
        "repeated": _repeated(names),
        "positions": None if where is None else list(where.shape),
        "blank": route.blank.tolist(),
    }
    if as_json:
        print(json.dumps(facts))
        return
    coordinates = "none" if where is None else f"{where.shape[1]} coordinates a place, in metres"
    table = Table(show_header=False, box=None)
    for name, value in facts.items():
        shown = {
            "bytes": f"{facts['bytes']:,}",
            "descriptor": _descriptor_of(route),
            "post": repr(route.post),
            "names": f"{names[0]} to {names[-1]}" if names else "none",
            "repeated": _said(facts["repeated"]),
            "positions": coordinates,
            "blank": "".join(_blank(facts["blank"], names)) or "none",
            "image_size": " x ".join(map(str, route.image_size or ())),
            "levels": " to ".join(map(str, route.levels or ())),
        }.get(name, str(value))
        # The descriptor's name stands for the recipe; --json has all of it.
        absent = (name == "post" and route.post is None) or (name == "repeated" and not value)
        if name in ("recipe", "input_dim") or absent:
            continue
        if name in ("image_size", "levels") and value is None:
            continue
        table.add_row(name, Text(shown))
    Console(highlight=False, soft_wrap=True).print(table)


def _repeated(names: list[str] | None) -> list[list[int]]:
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


def _said(repeated: Any) -> str:
    parts = [f"{first} to {last}" if first != last else str(first) for first, last in repeated[:5]]
    more = f" and {len(repeated) - 5} stretches more" if len(repeated) > 5 else ""
    return f"places {', '.join(parts)}{more} have names that come before"


def _descriptor_of(route: Map) -> str:
    if route.descriptor is not None:
        return repr(route.descriptor)
    if route.recipe is None:
        return "ready descriptors: queries come as descriptors too"
    return f"{route.recipe['name']}: queries come as its descriptors, or as images with it"


def _look(file: Path) -> Map:
    """The map without its rows: a file of gigabytes takes no longer than a small one."""
    if file.is_dir():
        return open_map(str(file))
    return Map.open(file, mmap=file.is_file())


def _size_of(file: Path) -> str:
    route = _look(file)
    size = f"{file.stat().st_size / 1e6:.1f} MB"
    return f"{plural(len(route), 'place')} x {route.dim} {route.dtype}, {size}"
