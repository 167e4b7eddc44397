"""``surefix map build`` and ``append``: make a map of a route, or make it longer."""

import time
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from surefix import Map, Sad, SurefixValueError
from surefix._saving import edited
from surefix._terminal import say
from surefix._words import plural
from surefix.cli import inputs
from surefix.cli.drives import networks_of
from surefix.cli.flags import SELDOM, documented, with_ray
from surefix.cli.info import look, said_blank, size_of
from surefix.cli.inputs import refuse
from surefix.cli.making import Making, check_breaks, make
from surefix.cli.networks import Model, ModelOptions, Output, Weights, open_network
from surefix.cli.roads import (
    Breaks,
    NoBreaks,
    closable,
    noted,
    sampled_by_metres,
    wanted,
    with_roads,
)
from surefix.cli.where import DEGREES, naming, positions_of_frames
from surefix.descriptors.mapping import sad_map
from surefix.errors import check_folder, mismatch
from surefix.frames import Frames, ImageFrames
from surefix.frames.levels import Levels, checked_levels
from surefix.tables.breaks import said_breaks

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


@with_ray
@documented
@closable
def build(
    references: inputs.Place,
    out: Annotated[Path, typer.Option("--out", "-o")] = Path("route.safetensors"),
    size: str | None = None,
    patch: Annotated[int, typer.Option(min=1)] = 8,
    dtype: Dtype = "u8",
    metric: Annotated[Metric | None, typer.Option(show_default=False)] = None,
    key: str | None = None,
    model: Model = None,
    weights: Weights = None,
    output: Output = None,
    mean: str | None = None,
    std: str | None = None,
    batch: Annotated[int | None, typer.Option(min=1)] = None,
    post: str | None = None,
    cache: inputs.Cache = None,
    positions: Path | None = None,
    plane: Annotated[str | None, SELDOM] = None,
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
    thumbnails: bool = False,
    breaks: Breaks = None,
    no_breaks: NoBreaks = False,
    closed: bool | None = None,
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
    mean: --model FILE: of RGB / 255, such as 0.5,0.5,0.5, or "none"; ImageNet's by default.
    std: --model FILE: as --mean, the standard deviation.
    batch: --model: images at a time, 8 by default.
    post: Ready descriptors and --model: steps for them, and for queries later, with commas:
        standardize, or standardize:running by the queries so far, pca:N, projection:N, normalize.
    positions: A .npy or .csv of each place's position, (n, 2) or (n, 3) metres, or latitude and
        longitude; or with a column time, at times of their own; or a folder of images named
        @east@north@.
    plane: The plane that positions in metres lie on: the latitude and longitude of its origin, such
        as -27.47,153.02, or its name, such as "UTM 56S".
    skip_blank: Leave out the places that show nothing: black, covered, or equal to many others.
    levels: Images of more than 8 bits: the samples LOW and HIGH that are black and white, for the
        map and all its queries; by default measured on the images.
    mixed_sizes: The images may differ in size.
    thumbnails: Keep a small grey picture of each place in the map, so that every view can show it.
    """
    start = time.perf_counter()
    asked = wanted(breaks, no_breaks, closed)
    range_ = None if levels is None else _levels(levels)
    check_folder(out, "cannot write the map")
    steps = None if post is None else inputs.steps_of(post)
    network, named = None, ModelOptions(model, weights, output)
    if model is not None:
        of_sad = (patch, dtype) != (8, "u8")
        refuse(of_sad, "--patch, --dtype: expected images for SAD, got --model")
        sides = None if size is None else _size(size)
        network = open_network(named, sides, mean, std, batch)
    elif (weights, output, mean, std, batch, cache) != (None,) * 6:
        options = "--weights, --output, --mean, --std, --batch, --cache"
        raise typer.BadParameter(f"{options}: expected --model too, got none")
    if key is None:
        inputs.refuse_map("REFERENCES", references)
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
    inputs.check_not_read(out, [*frames.files, *named.files, cache, positions, odometry])
    if frames.ready is not None:
        got = f"expected images, got the ready descriptors {references}"
        refuse(network is not None, f"--model: {got}")
        refuse((size, patch, dtype) != (None, 8, "u8"), f"--size, --patch, --dtype: {got}")
        refuse(range_ is not None or mixed_sizes, f"--levels, --mixed-sizes: {got}")
        refuse(thumbnails, f"--thumbnails: {got}")
    elif network is None:
        _check_sad(references, metric, post)
    by_sad = frames.ready is None and network is None
    how = Making(
        roads=asked,
        network=network,
        sad=_sad(size, patch, dtype, range_) if by_sad else Sad(),
        metric=metric,
        post=steps,
        cache=cache,
        levels=range_,
        strict=strict,
        mixed_sizes=mixed_sizes,
        thumbnails=thumbnails,
        skip_blank=skip_blank,
        plane=plane,
    )
    notes = make(references, frames, how, positions, out).notes
    said = f"Made {out}: {size_of(out)}, in {time.perf_counter() - start:.1f} s"
    say("; ".join([said, *notes]))


@documented
@closable
def append(
    file: Path,
    references: inputs.Place,
    positions: Path | None = None,
    model: Model = None,
    weights: Weights = None,
    cache: inputs.Cache = None,
    order: inputs.Order = "name",
    strict: inputs.Strict = False,
    mixed_sizes: bool = False,
    topic: inputs.Topic = None,
    stride: inputs.Stride = 1,
    every: inputs.Every = None,
    metres: inputs.Metres = None,
    odometry: inputs.Odometry = None,
    new_segment: bool = False,
    breaks: Breaks = None,
    no_breaks: NoBreaks = False,
    closed: bool | None = None,
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
    positions: A .npy or .csv of each new place's position, if the map has positions; latitude and
        longitude if the map knows its origin.
    mixed_sizes: The images may differ in size.
    new_segment: The new places begin a new segment: they do not follow the last one.
    """
    start = time.perf_counter()
    # What is no map is refused as such.
    look(file)
    with edited(file, "cannot write the map") as own:
        old = look(own)
        asked = wanted(breaks, no_breaks, closed)
        several = len(old.traverses)
        way = "build a map of the new places, and join the two by surefix map join"
        refuse(several > 1, f"FILE: expected a map of one traverse, {file} has {several}: {way}")
        if not (Path(references).exists() and file.samefile(references)):
            inputs.refuse_map("REFERENCES", references)
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
        read = None if positions is None else positions_of_frames(positions, frames, old)
        where = None if read is None else read.values
        _bring_odometry(frames, old, where is not None)
        if isinstance(frames, ImageFrames):
            check_breaks(asked, len(old) + len(frames))
        frames = noted(frames)
        more: dict[str, Any]
        (network,) = networks_of([old], [file], ModelOptions(model, weights), frames, "REFERENCES")
        none = cache is not None and network is None
        refuse(none, "--cache: expected images for a network, as --model is")
        # A closed segment has no end to go on from.
        begins = new_segment or old.segments[-1].closed
        joined: dict[str, Any] = {"new_segment": begins}
        plane = {"origin": old.origin or old.plane}
        with naming(positions):
            if frames.ready is not None:
                rows, post, recipe = frames.ready, old.post, old.recipe
                known: dict[str, Any] = {"post": post, "recipe": recipe}
                known |= {} if where is None else plane
                added = Map.from_descriptors(rows, old.metric, where, **known)
                Map.append(own, added, **joined)
            elif network is not None:
                images: Any = frames.source if isinstance(frames, ImageFrames) else frames
                more = {"positions": where, "cache": cache, "skip_bad": not strict}
                Map.append(own, images, network, **more, **joined)
            elif isinstance(frames, ImageFrames):
                more = {"positions": where, "skip_bad": not strict, "mixed_sizes": mixed_sizes}
                Map.append(own, frames.source, **more, **joined)
            else:
                assert old.descriptor is not None
                small = old.thumbnail(0)
                how: dict[str, Any] = {"mixed_sizes": mixed_sizes} | plane
                how["thumbnails"] = False if small is None else small.shape[::-1]
                Map.append(own, sad_map(frames, old.descriptor, where, **how), **joined)
        longer = look(own)
        count = plural(len(longer) - len(old), "place")
        whole, found, notes = with_roads(longer, frames, asked, len(old), file)
        if whole is not longer:
            whole.save(own)
        kept = None if frames.ready is not None or whole.names is None else whole.names[len(old) :]
        blank = [place for place in whole.blank.tolist() if place >= len(old)]
        ring = ["the last segment is closed, so that the new places begin another"]
        ring = ring if old.segments[-1].closed and not new_segment else []
        notes = [
            *ring,
            *_again(old, whole),
            *said_breaks(found),
            *notes,
            *said_blank(blank, whole.names),
        ]
        del whole, longer
    seconds = time.perf_counter() - start
    said = f"Added {count} to {file}: now {size_of(file)}, in {seconds:.1f} s"
    say("; ".join([said, *notes, *inputs.notes_on(frames, kept)]))


def _bring_odometry(frames: Frames, old: Map, given: bool) -> None:
    """Brings the odometry's degrees onto the map's own plane; refuses metres if this is of degrees,
    unless the positions are ``given`` beside it.
    """
    found = sampled_by_metres(frames)
    if found is None or old.positions is None:
        return
    if found.odometry.degrees is None:
        if old.origin is not None and not given and found.odometry.positions.shape[1] > 1:
            raise mismatch(found.odometry.source, DEGREES, "metres: they share no plane")
        return
    if old.origin is None:
        expected = "metres, as the map's, which has no origin"
        raise mismatch(found.odometry.source, expected, "degrees")
    found.odometry = found.odometry.about(old.origin)


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
