"""The evaluations of ``surefix study``: distances made ready once, and then judged."""

import hashlib
import io
import json
from collections.abc import Iterable
from functools import lru_cache
from glob import glob
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import typer

from surefix import Segments, SurefixError, __version__
from surefix._saving import save
from surefix.cli.judging import Ready, TruthOptions
from surefix.cli.networks import ModelOptions
from surefix.cli.route import is_images, is_matrix
from surefix.cli.where import GAP
from surefix.comparing import estimates
from surefix.judged import FIGURES, Recall
from surefix.study.plan import Evaluation, Plan
from surefix.study.plan_file import FILES, SAMPLING
from surefix.tables.matrices import read_matrix

__all__ = ["Asked", "Job", "evaluate", "identity", "make_ready", "pair_of"]

PROBLEM = "cannot write the distances"


class Asked(NamedTuple):
    """What all evaluations of a study share: the folder of its distances, and the figures."""

    folder: Path
    recall: Recall
    upto: float
    samples: int


class Job(NamedTuple):
    """An evaluation, and the mark of its route and descriptor."""

    pair: str
    evaluation: Evaluation


def pair_of(evaluation: Evaluation) -> str:
    """The mark of a route and a descriptor: what the file says, and the files as they are now."""
    given = [
        {key: value for key, value in table.given.items() if key != "name"}
        for table in (evaluation.route, evaluation.descriptor)
    ]
    file = evaluation.file("file")
    # A map is read in place of the references, and distances in place of the queries too.
    unread = {"references"} if file is not None else set()
    unread |= {"queries"} if file is not None and is_matrix(file) else set()
    names = [evaluation.file(key) for key in (*FILES, "model") if key not in unread]
    return _mark([__version__, given, [_facts(name) for name in names if name is not None]])


def identity(job: Job, plan: Plan) -> str:
    """The mark of a row."""
    evaluation = job.evaluation
    how = [plan.recall, plan.upto, plan.samples]
    return _mark([job.pair, evaluation.settings, evaluation.method, how])


def _mark(facts: Any) -> str:
    text = json.dumps(facts, sort_keys=True, default=str)
    return hashlib.blake2b(text.encode(errors="surrogateescape"), digest_size=12).hexdigest()


def _facts(name: str) -> tuple[Any, ...]:
    """The sizes and times of the files of a name."""
    place = Path(name)
    files: Iterable[Path] = [place] if place.exists() else map(Path, sorted(glob(name)))
    if place.is_dir():
        files = sorted(each for each in place.rglob("*") if each.is_file())
    stats = ((str(file), file.stat()) for file in files)
    found = [(file, stat.st_size, stat.st_mtime_ns) for file, stat in stats]
    return name, found if len(found) < 2 else _mark(found)


def make_ready(asked: Asked, job: Job) -> str | None:
    """Writes the distances and the truth of a route and a descriptor; why it cannot, if so."""
    path = asked.folder / f"{job.pair}.npz"
    if path.exists():
        return None
    given, said = job.evaluation.route.given, job.evaluation.descriptor.given
    where = TruthOptions(
        given.get("truth"),
        None if "positions" not in given else Path(given["positions"]),
        given.get("query_positions"),
        given.get("tolerance"),
        given.get("position_gap", GAP),
    )
    file = job.evaluation.file("file")
    place = job.evaluation.file("references") if file is None else file
    assert place is not None
    weights = None if "weights" not in said else Path(said["weights"])
    model = ModelOptions(said.get("model"), weights, said.get("output"))
    matrix = is_matrix(place)
    queries = None if matrix else job.evaluation.file("queries")
    sampling = {key: given[key] for key in SAMPLING if key in given and not matrix}
    sampling |= {} if matrix else {"order": given.get("order", "name")}
    similarity = said.get("similarity", False)
    try:
        kept = path.with_suffix(".safetensors") if is_images(place) else None
        ready = Ready.open(where, place, queries, model, similarity, sampling, kept)
        if not matrix:
            with_distances = path.with_suffix(".npy")
            save(with_distances, _bytes(np.save, ready.distances), PROBLEM)
        save(path, _bytes(np.savez, **_parts(ready, place, matrix, similarity)), PROBLEM)
    except (SurefixError, typer.BadParameter) as error:
        return _said(error)
    return None


def evaluate(asked: Asked, job: Job) -> dict[str, Any]:
    """The figures with their intervals, as of ``surefix compare``; or an error."""
    try:
        ready = _ready(asked.folder.absolute(), job.pair)
        evaluation = job.evaluation
        (judged,) = ready.judged([evaluation.method], evaluation.options, asked.recall)
        found = estimates(judged, asked.upto, asked.samples)
    except (SurefixError, typer.BadParameter) as error:
        return {"error": _said(error)}
    places, queries = ready.distances.shape
    row: dict[str, Any] = {"places": places, "queries": queries}
    for name in FIGURES:
        known = found.get(name)
        ends = (None,) * 3 if known is None else (float(known), known.low, known.high)
        row |= dict(zip((name, f"{name}_low", f"{name}_high"), ends, strict=True))
    return row


def _said(error: Exception) -> str:
    return getattr(error, "message", None) or str(error)


def _bytes(write: Any, *given: Any, **named: Any) -> bytes:
    file = io.BytesIO()
    write(file, *given, **named)
    return file.getvalue()


def _parts(ready: Ready, place: str, matrix: bool, similarity: bool) -> dict[str, Any]:
    """The arrays of a file, without the distances."""
    parts: dict[str, Any] = {"tolerance": ready.tolerance, "similarity": similarity}
    parts |= {"matrix": str(place) if matrix else ""}
    if isinstance(ready.truth, tuple):
        parts |= {"truth_places": ready.truth[0], "truth_queries": ready.truth[1]}
    else:
        parts |= {"truth": np.asarray(ready.truth)}
    if ready.positions is not None:
        parts |= {"positions": np.asarray(ready.positions)}
    if (along := ready.segments) is not None:
        closed = [index for index, each in enumerate(along) if each.closed]
        parts |= {"breaks": along.breaks, "closed": np.array(closed, np.int64)}
        parts |= {"links": along.links, "places": along.places}
    return parts


@lru_cache(maxsize=1)
def _ready(folder: Path, pair: str) -> Ready:
    """The distances that a process judges several times."""
    path = folder / f"{pair}.npz"
    with np.load(path) as parts:
        matrix = str(parts["matrix"])
        if matrix:
            distances = read_matrix(matrix, bool(parts["similarity"]))
        else:
            distances = np.asarray(np.load(path.with_suffix(".npy"), mmap_mode="r"))
        by_position = "truth_places" in parts
        positions = (parts["truth_places"], parts["truth_queries"]) if by_position else None
        truth: Any = parts["truth"] if positions is None else positions
        along = None
        if "places" in parts:
            closed = parts["closed"].tolist()
            along = Segments(int(parts["places"]), parts["breaks"], closed, parts["links"])
        where = parts.get("positions")
        return Ready(matrix or pair, distances, truth, float(parts["tolerance"]), along, where)
