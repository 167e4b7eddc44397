"""``surefix audit``: what a technique is worth on a route, without ground truth."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from surefix import audit
from surefix._words import plural
from surefix.cli.align import open_drive, refusing_options
from surefix.cli.flags import documented

# Below this mean confidence of the alignment, an audit is not worth much.
DOUBTFUL = 0.7


@documented
def audit_(
    route: str,
    queries: Annotated[str | None, typer.Argument()] = None,
    motion: str = "any",
    tolerance: Annotated[int, typer.Option(min=0)] = 1,
    similarity: bool = False,
    model: Path | None = None,
) -> None:
    """Estimate how often a technique is right on a recorded drive, without ground truth.

    Parameters
    ----------
    route: The map, from `surefix map build`; or a .npy of distances, (places, queries).
    queries: A folder of images, a pattern, or a .npy of images or of descriptors; none with
        distances.
    motion: steady if both drives took frames at the same distances, free for 0 to 2 places a
        query, any for 0 to 5.
    tolerance: A match is right within this many places.
    similarity: The .npy holds similarities s: the distances are 1 - s.
    model: A map of `surefix map build --model`: the ONNX file, to describe the images.
    """
    drive, given = open_drive(route, queries, similarity, model)
    found = refusing_options(audit, *drive, motion=motion, tolerance=tolerance, **given)
    trusted = int(found.trusted.sum())
    print(f"Single matches right: {found.recall_at_1} of {plural(len(found), 'query', 'queries')}")
    if trusted:
        print(f"Trusted matches right: {found.trusted_precision} of {trusted}")
    else:
        print("Trusted matches: none")
    print("Each with its 95 % interval, estimated from an alignment, without ground truth.")
    sure = float(np.mean(found.confidence))
    if sure < DOUBTFUL:
        print(
            f"Do not rely on it: the alignment has a mean confidence of {sure:.2f}. Is --motion "
            f"{motion} that of these drives? Is the technique too weak for the route?"
        )
