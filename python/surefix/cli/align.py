"""``surefix align``: where each query of a recorded drive was, without any label."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from surefix import Map, SurefixValueError, align
from surefix._progress import terminal_bar
from surefix._words import plural
from surefix.cli import inputs
from surefix.cli.flags import documented
from surefix.cli.inputs import check_not_read, refuse
from surefix.tables.matrices import read_matrix

T = TypeVar("T")


@documented
def align_(
    route: str,
    queries: Annotated[str | None, typer.Argument()] = None,
    out: Annotated[Path, typer.Option("--out", "-o")] = Path("truth.csv"),
    motion: str = "any",
    tolerance: Annotated[int, typer.Option(min=0)] = 1,
    least: Annotated[float, typer.Option(min=0, max=1)] = 0.5,
    similarity: bool = False,
    model: Path | None = None,
) -> None:
    """Align a recorded drive with a route, without any label: a truth for `surefix eval`.

    Parameters
    ----------
    route: The map, from `surefix map build`; or a .npy of distances, (places, queries).
    queries: A folder of images, a pattern, or a .npy of images or of descriptors; none with
        distances.
    out: The .csv to write: query,reference and the confidence of each.
    motion: steady if both drives took frames at the same distances, free for 0 to 2 places a
        query, any for 0 to 5.
    tolerance: The confidence is the belief within this many places.
    least: A query of a lower confidence has no reference in the file: -1.
    similarity: The .npy holds similarities s: the distances are 1 - s.
    model: A map of `surefix map build --model`: the ONNX file, to describe the images.
    """
    refuse(out.suffix != ".csv", f"--out: expected a name that ends in .csv, got {out}")
    check_not_read(out, [route, queries])
    drive, given = open_drive(route, queries, similarity, model)
    given |= {"motion": motion, "tolerance": tolerance}
    alignment = refusing_options(align, *drive, **given)
    alignment.to_csv(out, least)
    found = int((alignment.confidence >= least).sum())
    away = int((alignment.off_map >= 0.5).sum())
    print(
        f"{plural(len(alignment), 'query', 'queries')}, {found} with a reference of confidence "
        f"{least:g} or more, {away} probably off the map, in {out}",
        file=sys.stderr,
    )


def open_drive(
    route: str, queries: str | None, similarity: bool, model: Path | None
) -> tuple[tuple[Any, ...], dict[str, Any]]:
    """The arguments and options of ``surefix.align``: distances, or a map and queries."""
    matrix = Path(route).suffix == ".npy"
    refuse(similarity and not matrix, "--similarity: expected a .npy of similarities, got a map")
    refuse(matrix and queries is not None, f"QUERIES: expected none with distances, got {queries}")
    refuse(matrix and model is not None, f"--model: expected a map, got the distances {route}")
    refuse(not matrix and queries is None, "QUERIES: expected images or descriptors, got none")
    given: dict[str, Any] = {"progress": terminal_bar("Aligning")}
    if matrix:
        return (read_matrix(route, similarity),), given
    place_map = Map.open(route)
    ready = inputs.open_frames(str(queries)).ready
    given["descriptor"] = None if model is None else inputs.network_of(place_map, route, model)
    return (place_map, queries if ready is None else ready), given


def refusing_options(call: Callable[..., T], *arguments: Any, **options: Any) -> T:
    """The result; an option outside its range is bad usage."""
    try:
        return call(*arguments, **options)
    except SurefixValueError as error:
        if str(error).startswith("option"):
            raise typer.BadParameter(str(error)) from None
        raise
