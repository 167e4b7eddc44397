"""The report of ``surefix align``: where each query was, and where the alignment is not sure."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from surefix import Alignment
from surefix._words import plural, verb
from surefix.plot.belief import confidence
from surefix.plot.matrix import aligned_track
from surefix.report import sections, tables
from surefix.report.page import Section, Table, Tile, drawn, write

__all__ = ["FILES", "LEAST", "Stretch", "stretches", "write_report"]

FILES = {
    "report.html": "this page, with its pictures inside",
    "distance_matrix.png": "the matrix with the place of each query",
    "confidence.png": "how sure the alignment is, query by query",
    "doubtful.csv": "a line for each doubtful stretch",
}
COLUMNS = "first_query,last_query,off_map,place_low,place_high,confidence"
# A query of a lower confidence is doubtful.
LEAST = 0.5
# A page is read by people, and no picture has more rows or columns.
ROWS, SHOWN = 100, 1200
# A motion of several speeds makes no such step.
JUMP = 10


@dataclass(frozen=True)
class Stretch:
    """Consecutive queries that are doubtful, or probably off the map.

    Attributes
    ----------
    queries : range
    off_map : bool
    places : (int, int)
        The first and the last place that they may be at.
    confidence : float
        The mean.
    """

    queries: range
    off_map: bool
    places: tuple[int, int]
    confidence: float


def stretches(alignment: Alignment) -> list[Stretch]:
    """The stretches of a confidence below ``LEAST``, or off the map with 0.5 or more, in order."""
    off = alignment.off_map >= 0.5
    kind = np.where(off, 2, np.where(alignment.confidence < LEAST, 1, 0))
    starts = np.flatnonzero(np.diff(kind, prepend=-1))
    found = []
    for start, end in zip(starts, [*starts[1:], len(kind)], strict=True):
        if kind[start]:
            within = alignment.interval[start:end]
            places = int(within[:, 0].min()), int(within[:, 1].max())
            sure = float(alignment.confidence[start:end].mean())
            found.append(Stretch(range(int(start), int(end)), bool(off[start]), places, sure))
    return found


def jumps(alignment: Alignment) -> list[int]:
    """The queries whose place is far from that of the query before: more than ``JUMP`` places
    beyond the usual step.
    """
    steps = np.abs(np.diff(alignment.place))
    usual = np.median(steps) if len(steps) else 0
    return [int(query) + 1 for query in np.flatnonzero(steps > JUMP + 2 * usual)]


def write_report(
    alignment: Alignment,
    distances: Callable[[NDArray[np.int64]], NDArray[np.float32]],
    folder: Path,
    command: str,
    *,
    motion: object,
    places: int,
    breaks: Sequence[int] = (),
    query_names: Sequence[str] | None = None,
    title: str = "An alignment",
) -> Path:
    """Writes the page and all that belongs to it into ``folder``; returns the path of the page.

    Parameters
    ----------
    alignment : Alignment
    distances : function of an array of queries
        Gives the distances between each place and these queries, for the picture.
    folder : Path
    command : str
        The command that makes this report again.
    motion : str or Motion
    places : int
        How many the map has.
    breaks : sequence of int
        The places at which a segment begins.
    query_names : sequence of str, optional
    title : str
        The drive and its map.
    """
    m = len(alignment)
    D = distances(np.arange(0, m, -(-m // SHOWN)))
    D = np.minimum.reduceat(D, np.arange(0, places, -(-places // SHOWN)), axis=0)
    doubtful = stretches(alignment)
    sure = int((alignment.confidence >= LEAST).sum())
    off = int((alignment.off_map >= 0.5).sum())
    count = plural(len(doubtful), "doubtful stretch", "doubtful stretches")
    advice = (
        f"Look at the {count} below before you trust a figure that rests on this alignment."
        if doubtful
        else "No stretch is doubtful."
    )
    lead = (
        f"{plural(m, 'query', 'queries')} aligned with a map of {plural(places, 'place')}, motion "
        f"{motion}, without any label: the place of each is that of all queries, those after it "
        "too.",
        f"{sure} of them {'has' if sure == 1 else 'have'} a confidence of {LEAST:g} or more; {off} "
        f"{verb(off)} probably off the map. {advice}",
    )
    longest = max(doubtful, key=lambda each: len(each.queries), default=None)
    size = "none" if longest is None else plural(len(longest.queries), "query", "queries")
    at = "" if longest is None else f"from query {longest.queries[0]} on"
    tiles = (
        sections.share("sure", sure, m, f"of the queries have a confidence of {LEAST:g} or more"),
        Tile("confidence", f"{np.mean(alignment.confidence):.3f}", "mean confidence"),
        sections.share("off", off, m, "of the queries are probably off the map"),
        Tile("longest", size, "the longest doubtful stretch", at),
    )
    matrix = drawn(
        (6.4, 6.6),
        f"Distance matrix of {plural(places, 'place')} by {plural(m, 'query', 'queries')}, with "
        "the place of each query. The doubtful stretches are shaded.",
        aligned_track,
        D,
        alignment.place,
        alignment.confidence,
        alignment.off_map,
        places=places,
        least=LEAST,
        breaks=breaks,
        caption="The stronger the tone, the more alike. A dot is the place of a query.",
        textured=True,
    )
    along = drawn(
        (11, 2.6),
        "The confidence of each query, and the belief that it is off the map.",
        confidence,
        alignment.confidence,
        alignment.off_map,
        stretches=[("", each.queries) for each in doubtful],
        accept=LEAST,
    )

    def write_tables(inside: Path) -> None:
        rows = [
            (q[0], q[-1], str(each.off_map).lower(), *each.places, each.confidence)
            for each in doubtful
            for q in (each.queries,)
        ]
        tables.write_csv(inside / "doubtful.csv", COLUMNS, rows)

    return write(
        folder,
        title,
        lead,
        (),
        tiles,
        (
            Section(
                "The track over the distances",
                (
                    "Each column is a query, each row a place of the map. If the dots follow the "
                    "dark line of the matrix, the alignment is what you would have drawn by hand. "
                    "If they leave it, or jump in a stretch that is not shaded, the motion may not "
                    "be that of these drives.",
                ),
                {"distance_matrix.png": matrix},
                points=_jumps(alignment),
            ),
            Section(
                "How sure it is",
                (
                    "Confidence is the belief of all queries that the place is right. It counts "
                    "only if the motion is that of the drives. Doubtful stretches are shaded.",
                ),
                {"confidence.png": along},
            ),
            _table(doubtful, query_names),
            sections.made(*FILES.items()),
        ),
        write_tables,
        FILES,
        identity=sections.identity("Where was each query?"),
        command=command,
    )


def _table(doubtful: Sequence[Stretch], names: tables.Names) -> Section:
    if not doubtful:
        return Section("Doubtful stretches", (f"None: no confidence is below {LEAST:g}.",))
    named = [
        (tables.named(q[0], names), tables.named(q[-1], names), str(len(q)), *_said(each))
        for each in doubtful[:ROWS]
        for q in (each.queries,)
    ]
    header = ("first query", "last query", "queries", "where", "mean confidence")
    left = len(doubtful) - ROWS
    more = f" The other {left} are in doubtful.csv." if left > 0 else ""
    words = (
        f"In these the alignment has a confidence below {LEAST:g}. The places are those between "
        f"which 95 % of the belief lies.{more}"
    )
    table = Table("doubtful", "In the order of the drive.", header, named)
    return Section("Doubtful stretches", (words,), tables=(table,))


def _jumps(alignment: Alignment) -> list[str]:
    """In words, as a robot does not jump."""
    found, place = jumps(alignment), alignment.place
    if not found:
        return ["The track does not jump."]
    told = [f"at query {at} from place {place[at - 1]} to {place[at]}" for at in found[:ROWS]]
    more = f", and {len(found) - ROWS} times more" if len(found) > ROWS else ""
    return [
        f"The track jumps {', '.join(told)}{more}. Between two jumps the alignment may be sure of "
        "a wrong place: as when it stands still there."
    ]


def _said(stretch: Stretch) -> tuple[str, str]:
    low, high = stretch.places
    where = "probably off the map" if stretch.off_map else f"somewhere from place {low} to {high}"
    return where, f"{stretch.confidence:.2f}"
