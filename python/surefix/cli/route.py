"""ROUTE of a command: a map, or images of which one is made in memory."""

import sys
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from surefix import Map, SurefixError, SurefixValueError
from surefix._terminal import fitted, say
from surefix._words import plural
from surefix.cli import inputs
from surefix.cli.drives import open_map
from surefix.cli.inputs import refuse
from surefix.cli.making import Making, make
from surefix.cli.networks import ModelOptions, Network, open_network
from surefix.errors import check_folder
from surefix.frames import Frames, ImageFrames
from surefix.frames.camera import is_camera
from surefix.frames.images import Images
from surefix.frames.opening import is_recording
from surefix.frames.recording import is_bag
from surefix.tables.npy import read_npy

SaveMap = Annotated[
    Path | None,
    typer.Option(help="Keep the map that is made of ROUTE, if that is images, in this file."),
]


@dataclass(frozen=True, eq=False)
class Route:
    """A map, and whence it is.

    Attributes
    ----------
    place : str
        The map's file, or the images.
    map : Map
    frames : Frames, or None
        Of a map that is made here: the images.
    network : Network, or None
        That network which described them, if one did.
    """

    place: str
    map: Map
    frames: Frames | None = None
    network: Network | None = None

    @property
    def files(self) -> list[str]:
        """The files that are read."""
        return [self.place] if self.frames is None else self.frames.files

    @property
    def pictures(self) -> Images | None:
        """The image of each place, if the map is made here of image files or of an array. Of a
        recording the map has thumbnails.
        """
        if not isinstance(self.frames, ImageFrames):
            return None
        images, names = self.frames.images, self.map.names
        if names is None or len(images) == len(names):
            return images
        bad = {*inputs.missing(images.names, names)}
        return images.take([index for index in range(len(images)) if index not in bad])


def open_route(
    place: str,
    model: ModelOptions,
    save: Path | None = None,
    read: Iterable[Path | str | None] = (),
    queries: str | None = None,
    **reading: Any,
) -> Route:
    """The map of ROUTE. Of images it is made here, which is said, and kept in the file ``save``,
    which must be none that is ``read``. The options of ``reading`` are those of the queries, which
    must be there before a map is made for them.
    """
    if not is_images(place):
        expected = "--save-map: expected images as ROUTE, of which a map is made"
        refuse(save is not None, f"{expected}, got the map {place}")
        _refuse_other(place)
        return Route(place, open_map(place))
    frames = inputs.open_frames(place, **_reading(place, **reading))
    if queries is not None and not is_camera(queries):
        inputs.check_there(queries, "images, a video or a bag")
    if queries is not None and not (is_recording(queries) or is_camera(queries)):
        with inputs.naming_folders(queries):
            ImageFrames(inputs.listed(queries))
    if save is not None:
        check_folder(save, "cannot write the map")
        read = [*frames.files, *model.files, queries, reading.get("odometry"), *read]
        inputs.check_not_read(save, read, "--save-map")
    network = open_network(model)
    # The images of a recording come one after the other: its places are shown by thumbnails.
    thumbnails = not isinstance(frames, ImageFrames)
    how = Making(network=network, strict=reading.get("strict", False), thumbnails=thumbnails)
    try:
        made, notes = make(place, frames, how)
    except SurefixValueError as error:
        build = f"surefix map build {place} has more options"
        raise SurefixValueError(f"a map of {place}, in memory: {error} ({build})") from None
    if save is not None:
        made.save(save)
    kept = "in memory; --save-map FILE keeps it" if save is None else f"kept in {save}"
    said = f"{_label(place)}: a map of {plural(len(made), 'place')}, {kept}"
    say(*fitted("; ".join([said, *notes]), sys.stderr), file=sys.stderr)
    return Route(place, made, frames, network)


def is_images(place: str) -> bool:
    """Whether this names images or a recording, and no map or matrix: a folder, a pattern, a video,
    a bag or a ``.npy`` of images.
    """
    path = Path(place)
    if path.suffix == ".npy":
        with suppress(SurefixError):
            return read_npy(path, "the array", mapped=True).ndim > 2
        return False
    pattern = any(sign in place for sign in "*?[") and not path.exists()
    return path.is_dir() or pattern or is_recording(place)


def is_matrix(place: str) -> bool:
    """Whether this names distances."""
    return Path(place).suffix == ".npy" and not is_images(place)


def _refuse_other(place: str) -> None:
    """Refuses an array and an image as a map, and says what to do."""
    inputs.check_there(place, "a map or images")
    path = Path(place)
    if path.suffix == ".npy" and path.is_file():
        read_npy(path, "the array", mapped=True)
        raise typer.BadParameter(
            f"ROUTE: expected a map or images, got the array {place}; if it holds descriptors, "
            f"make a map of them: surefix map build {place}; if it holds distances, surefix align, "
            "audit, tune and eval take it"
        )
    if path.is_file() and path.suffix not in ("", ".safetensors"):
        with suppress(SurefixError):
            ImageFrames(place)
            pattern = path.with_name(f"*{path.suffix}")
            raise typer.BadParameter(
                f"ROUTE: expected a map or images, got the image {place}; if the shell made it of "
                f"a pattern, give the folder, or quote the pattern: '{pattern}'"
            )


def _reading(place: str, **given: Any) -> dict[str, Any]:
    """The options of the queries that are the route's, too: how its images are ordered and sampled.
    Odometry in a file is that of the queries alone.
    """
    recording = is_recording(place)
    odometry, metres = given.get("odometry"), given.get("metres")
    of_bag = odometry is not None and odometry.startswith("/") and not Path(odometry).is_file()
    of_bag = of_bag and is_bag(place)
    if metres is not None and odometry is not None and not of_bag:
        build = f"surefix map build {place} --metres {metres:g} --odometry FILE"
        expected = "--metres: expected a map as ROUTE, as --odometry is that of QUERIES"
        raise typer.BadParameter(f"{expected}; got {place}, of which this makes one: {build}")
    kept: dict[str, Any] = {"stride": given.get("stride", 1), "strict": given.get("strict", False)}
    if recording:
        kept["every"] = given.get("every")
        kept["topic"] = given.get("topic") if is_bag(place) else None
        if of_bag and metres is not None:
            kept |= {"odometry": odometry, "metres": metres}
    elif Path(place).suffix != ".npy":
        kept["order"] = given.get("order", "name")
    return kept


def _label(place: str) -> str:
    return place.rstrip("/") or place
