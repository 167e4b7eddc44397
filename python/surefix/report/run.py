"""The report of a run, without a truth: what was matched, what is trusted, and how sure it is."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surefix import Fix, Map, Run
from surefix._saving import save
from surefix._words import plural
from surefix.errors import mismatch
from surefix.frames.levels import in_8_bits
from surefix.report import sections
from surefix.report.album import Album
from surefix.report.explore import explorer, scripts
from surefix.report.page import Tile, page
from surefix.report.scene import SIDE, Answers, Scene, thinned

__all__ = ["Recorder", "write_run"]


class Recorder:
    """Collects a run as it goes, in bounded memory but for some numbers of each fix: distances for
    a picture, and small copies of the images.

    Parameters
    ----------
    map : Map
    """

    def __init__(self, map: Map) -> None:
        self.map = map
        self.rows: list[tuple[Any, ...]] = []
        self.names: list[str] = []
        self.queries = Album()
        self._columns: list[NDArray[np.float32]] = []
        self._across = 1

    def __len__(self) -> int:
        """The number of fixes."""
        return len(self.rows)

    def add(self, fix: Fix, distances: NDArray[np.float32], name: str, image: Any = None) -> None:
        """Takes a fix, the distances of its query to all places, and its image, if it has one."""
        track, sequence = fix.track, fix.sequence
        at = -1 if sequence is None else sequence.place
        row: tuple[Any, ...] = (fix.trusted, fix.single.place, fix.single.distance)
        row += (distances[fix.place], fix.place, fix.score, track is not None or at >= 0)
        row += (0.0, 0.0) if track is None else (track.confidence, track.off_map)
        row += (at, 0.0 if sequence is None else sequence.score, distances[max(at, 0)])
        if image is not None:
            self.queries.add(len(self), image)
        column, _ = thinned(distances[:, None])
        if len(self) % self._across == 0:
            self._columns.append(column[:, 0])
        else:
            np.minimum(self._columns[-1], column[:, 0], out=self._columns[-1])
        self.rows.append(row)
        self.names.append(name)
        if len(self._columns) > 2 * SIDE and len(self) % self._across == 0:
            pairs = zip(self._columns[::2], [*self._columns[1::2], self._columns[-1]], strict=False)
            self._columns = [np.minimum(a, b) for a, b in pairs]
            self._across *= 2

    def scene(self, references: Any = None) -> Scene:
        """What the page shows; ``references`` are the places' images by number."""
        columns = list(zip(*self.rows, strict=True))
        trusted, ready = np.array(columns[0], bool), np.array(columns[6], bool)
        single, sequence = (np.array(columns[k], np.int64) for k in (1, 9))
        near = np.array(columns[2], np.float32)
        every = np.ones(len(self), bool)

        def told(name: str, words: str, k: int, at: int, known: Any, **more: Any) -> Answers:
            place = np.maximum(np.array(columns[k], np.int64), 0)
            score, distance = (np.array(columns[j], np.float32) for j in (k + 1, at))
            return Answers(name, words, place, score, known, every, distance=distance, **more)

        methods = []
        if any(columns[7]) or any(columns[8]):
            said = {"confidence": np.array(columns[7]), "off_map": np.array(columns[8])}
            words = "the fixes: where all queries so far say that it is"
            methods.append(told("track", words, 4, 3, ready, **said))
        words = "sequences weighted by the prediction: the paper"
        methods.append(told("sequence", words, 9, 11, sequence >= 0))
        words = "single frames by their distance"
        methods.append(told("single", words, 1, 2, every))
        picture, (_, more) = thinned(np.stack(self._columns, axis=1))
        wanted = {int(place) for each in methods for place in each.place}
        at = self.map.positions
        flat = None if at is None or at.shape[1] < 2 else np.asarray(at)[:, :2]
        return Scene(
            picture,
            (-(-len(self.map) // SIDE), self._across * more),
            len(self.map),
            methods,
            methods[0].name,
            trusted,
            single,
            near,
            positions=flat,
            segments=self.map.segments,
            query_names=self.names,
            place_names=self.map.names,
            queries=self.queries,
            references=Album() if references is None else Album.of(references, wanted),
        )

    def write(self, path: Path, title: str, command: str = "", references: Any = None) -> Path:
        """Writes the page; returns its path.

        Raises
        ------
        SurefixFileError
            If it cannot be written; an earlier file is whole then.
        """
        if not self.rows:
            raise mismatch("report", "at least one fix", "none")
        scene = self.scene(references)
        text = page(
            title,
            (_lead(scene),),
            (),
            _tiles(scene),
            (explorer(scene),),
            identity=sections.identity("Where was it, and may that be trusted?"),
            command=command,
            scripts=scripts(),
        )
        save(path, text, "cannot write the report")
        return path


def write_run(
    run: Run,
    path: str | Path,
    map: Map,
    distances: NDArray[np.float32],
    *,
    title: str = "",
    queries: Iterable[Any] | None = None,
    references: Any = None,
    names: Sequence[str] | None = None,
) -> Path:
    """Writes an interactive page of a run, which needs no truth and no other file.

    Parameters
    ----------
    run : Run
    path : str or path
        The file to write.
    map : Map
    distances : array of float32, shape (n, m)
        Between each place and each query.
    title : str
        By default how many queries and places there are.
    queries : iterable of images, optional
        uint8 or uint16, (H, W) or (H, W, 3), of each query.
    references : sequence of images, or a mapping by place, optional
        Of the places; by default the map's thumbnails.
    names : sequence of str, optional
        Of the queries.

    Returns
    -------
    Path
        That of the page.

    Raises
    ------
    SurefixValueError
        If the distances do not fit the run and the map.
    SurefixFileError
        If the page cannot be written; an earlier file is whole then.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np, surefix
    >>> from surefix.report import write_run
    >>> places = np.random.default_rng(0).random((40, 8), np.float32)
    >>> known = surefix.Map.from_descriptors(places)
    >>> D = np.stack([known.distances(row) for row in places], axis=1)
    >>> run = surefix.match_distances(D, motion="steady")
    >>> write_run(run, Path(tempfile.mkdtemp()) / "page.html", known, D).name
    'page.html'
    """
    D = np.asarray(distances, np.float32)
    if D.shape != (len(map), len(run)):
        raise mismatch("distances", f"the shape {(len(map), len(run))}", D.shape)
    if references is None:
        from surefix.frames.by_name import thumbnails_of

        references = thumbnails_of(map)
    recorder, images = Recorder(map), iter(() if queries is None else queries)
    for j in range(len(run)):
        image = next(images, None)
        shown = None if image is None else in_8_bits(np.asarray(image), map.levels)
        recorder.add(run[j], D[:, j], str(j) if names is None else names[j], shown)
    title = title or f"{plural(len(run), 'query', 'queries')} on {plural(len(map), 'place')}"
    return recorder.write(Path(path), title, references=references)


def _lead(scene: Scene) -> str:
    m, trusted = len(scene), int(scene.trusted.sum())
    return (
        f"{plural(m, 'query', 'queries')} on a map of {plural(scene.places, 'place')}, without a "
        f"truth: nothing here says what is right. {trusted} single "
        f"{'match is' if trusted == 1 else 'matches are'} trusted."
    )


def _tiles(scene: Scene) -> Sequence[Tile]:
    m, first = len(scene), scene.methods[0]
    tiles = [
        sections.share("trusted", int(scene.trusted.sum()), m, "of the single matches are trusted")
    ]
    if first.confidence is not None and first.off_map is not None:
        sure, off = int((first.confidence >= 0.5).sum()), int((first.off_map >= 0.5).sum())
        middle = f"{np.median(first.confidence):.2f}"
        tiles += [
            sections.share("sure", sure, m, "have a confidence of 0.5 or more"),
            Tile("confidence", middle, "median confidence"),
            sections.share("off", off, m, "are probably off the map"),
        ]
    return tiles
