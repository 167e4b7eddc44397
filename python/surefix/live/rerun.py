"""A drive in rerun: its viewer, a recording to open later, or both."""

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surefix import Fix, Localizer, Map, SurefixError, SurefixFileError, Track
from surefix._core import _AtomicFile, _is_stream
from surefix._terminal import say
from surefix.live.binning import Bins
from surefix.live.ground import Ground
from surefix.live.matrix import MARKS, Matrix, encoded
from surefix.live.view import (
    FAINT,
    HERE,
    MINIMUM,
    PEAK,
    TRUSTED,
    UNTRUSTED,
    Closing,
    Image,
    Images,
    References,
    Seen,
    pillow,
    rgb,
)
from surefix.live.viewer import layout, load_rerun, open_viewer

__all__ = ["RerunView"]

# Times from here on, 2001, count from the epoch; smaller ones from the start of a video.
EPOCH = 1e9


class RerunView(Closing):
    """A drive in the rerun viewer, and in a recording: the camera's image and that of the matched
    place, the distances with their minimum and gradient peak, the newest columns of their matrix,
    the trusted track, the score; with motion, the belief along the route and the confidence.

    Each query is a row on the timeline ``frame``, and on ``time`` if frames have one. The entity
    ``fix`` has the fix itself, number by number, for a program that reads a recording back. More
    distances than ``places_drawn`` are binned, with their minima kept, and the matrix has the
    newest queries only: the cost of a query does not grow.

    Parameters
    ----------
    map : Map
        The localizer's map. Its positions, if it has any, become the track's ground.
    save : path, optional
        Write a recording, to be opened by ``rerun FILE.rrd``. A file of that name is replaced.
    spawn : bool, optional
        Open the viewer, or use the one that is open. By default, if nothing is saved.
    references : path or sequence of images, optional
        The folder of the map's images, or the images themselves. By default the map's thumbnails,
        else they are looked for by the names that the map has for its places.
    port : int
        The port at which the viewer listens.
    memory : str
        How much the viewer and its server may keep each, as "2GB" or "50%", before they forget the
        oldest.
    columns : int, optional
        The number of newest queries in the matrix; by default enough to fill its view.
    places_drawn : int
        The most bars of distances.

    Raises
    ------
    SurefixError
        If rerun is not installed, the viewer cannot be opened, or the recording cannot be written.

    Notes
    -----
    Positions are drawn from the map's first, which keeps metres of a national grid exact; of two
    coordinates, the second is drawn upwards. On a map with a screen, the view asks for all
    distances, which the push was spared.

    Examples
    --------
    >>> view = RerunView(route, save="drive.rrd")     # doctest: +SKIP
    >>> view.update(frame, fix, localizer, 85.0)      # doctest: +SKIP
    >>> view.close()                                  # doctest: +SKIP
    """

    WIDEST = 480

    def __init__(
        self,
        map: Map,
        save: str | os.PathLike[str] | None = None,
        *,
        spawn: bool | None = None,
        references: str | Path | Images | None = None,
        port: int = 9876,
        memory: str = "2GB",
        columns: int | None = None,
        places_drawn: int = 1000,
    ) -> None:
        self.save = None if save is None else Path(save)
        self.references = References(map, references)
        self.bins = Bins(len(map), places_drawn)
        self.rr = load_rerun()
        self.matrix = Matrix(self.rr, map, columns)
        self.ground = None if map.positions is None else Ground(self.rr, map)
        self.recording = self.rr.RecordingStream("surefix")
        if not self.rr.is_enabled(self.recording):
            raise SurefixError(
                "rerun is turned off: expected the environment variable RERUN to be unset or on"
            )
        self.recording.set_log_time_enabled(False)
        self.recording.set_log_tick_enabled(False)
        self.started = False
        self.shown: int | None = None
        self.dropped = 0
        sinks: list[Any] = []
        if spawn if spawn is not None else save is None:
            open_viewer(self.recording, port, memory)
            sinks.append(self.rr.GrpcSink(f"rerun+http://127.0.0.1:{port}/proxy"))
        self._part: _AtomicFile | None = None
        try:
            if self.save is not None:
                sinks.append(self.rr.FileSink(self._begun(self.save)))
            self.recording.set_sinks(*sinks)
        except (RuntimeError, OSError) as error:
            if self._part is not None:
                self._part.discard()
            raise SurefixFileError(f"{self.save}: cannot write the recording: {error}") from None

    def update(self, frame: Any, fix: Fix, localizer: Localizer, latency_us: float) -> None:
        """Log one frame and its fix; as ``View.update``."""
        seen = Seen.of(frame, fix)
        if not self.started:
            self._start(seen, fix.track is not None)
            self.started = True
        self.recording.set_time("frame", sequence=fix.frame)
        if seen.time is None:
            self.recording.disable_timeline("time")
        else:
            kind = "timestamp" if seen.time >= EPOCH else "duration"
            self.recording.set_time("time", **{kind: seen.time})
        self._log_images(seen, fix)
        distances = localizer.distances
        self._log_distances(distances, fix)
        self.matrix.update(self.recording.log, distances, fix)
        self._log_track(fix)
        self._log_belief(localizer, fix)
        self._log_numbers(seen, fix, latency_us)

    def close(self) -> None:
        """Send the rest, and finish the file. The viewer stays open.

        Raises
        ------
        SurefixFileError
            If there is no recording in the end.
        """
        if self.recording is None:
            return
        recording, self.recording = self.recording, None
        try:
            recording.flush(timeout_sec=10)
        except (RuntimeError, ValueError) as error:
            # The viewer was closed before the drive was over, which is no mistake.
            say(f"rerun: {error}", file=sys.stderr)
        recording.disconnect()
        if self._part is None:
            return
        try:
            self._part.commit()
        except OSError as error:
            raise SurefixFileError(f"{self.save}: cannot write the recording: {error}") from None

    def _begun(self, save: Path) -> Path:
        """The file that rerun writes: beside an older recording, until this one ends."""
        if sys.platform == "win32" or _is_stream(save):
            # There a lock keeps rerun out, too.
            return save
        self._part = _AtomicFile(save, False)
        return self._part.path

    def _start(self, seen: Seen, tracked: bool) -> None:
        """Log the layout, the styles and the route, which stay for the whole drive."""
        rr, log = self.rr, self.recording.log
        images = seen.image is not None, bool(self.references)
        kind, zoom = (self.ground.kind, self.ground.zoom) if self.ground else (None, None)
        drawn = layout(*images, kind, zoom, self.matrix.shape, tracked)
        self.recording.send_blueprint(drawn)
        for name, colour, size in MARKS:
            style = {"markers": "circle", "marker_sizes": size}
            series = rr.SeriesPoints(colors=rgb(colour), names=name, **style)
            log(f"place/{name}", series, static=True)
        lines = [("score", "score", UNTRUSTED), ("latency_us", "push, microseconds", UNTRUSTED)]
        if tracked:
            lines += [("sure/confidence", "confidence", TRUSTED), ("sure/off_map", "off map", HERE)]
        for entity, name, colour in lines:
            series = rr.SeriesLines(colors=rgb(colour), names=name, widths=1.5)
            log(entity, series, static=True)
        if self.ground is not None:
            log("route/places", self.ground.lines(FAINT, 1.5), static=True)
            if (starts := self.ground.starts(UNTRUSTED, 3.5)) is not None:
                log("route/starts", starts, static=True)
        self.matrix.axes(log)

    def _log_images(self, seen: Seen, fix: Fix) -> None:
        if seen.image is not None:
            self.recording.log("camera", self._jpeg(seen.image))
        if self.references and fix.place != self.shown:
            self.shown = fix.place
            reference = self.references.image(fix.place)
            clear = self.rr.Clear(recursive=False)
            self.recording.log("matched", clear if reference is None else self._jpeg(reference))

    def _jpeg(self, image: Image) -> Any:
        picture = pillow(image)
        # Means of whole blocks: a finer resize takes longer than the rest of a view.
        picture = picture.reduce(max(1, -(-max(picture.size) // self.WIDEST)))
        return encoded(self.rr, picture, "jpeg", quality=85)

    def _log_distances(self, distances: NDArray[np.float32], fix: Fix) -> None:
        """All distances less their median as bars, so that the least one shows as a dip; those of
        the minimum and of the gradient peak in colours.
        """
        chart, log = self.rr.BarChart, self.recording.log
        base = np.float32(np.median(distances))
        log("distances/all", self._bars(self.bins.smallest(distances) - base, UNTRUSTED))
        # On a long route, one bar would be too thin to see.
        thick = max(float(self.bins.width), len(distances) / 150)
        marks = ("minimum", fix.single.place, MINIMUM, thick), (
            "gradient_peak", fix.gradient.place, PEAK, thick / 2,
        )  # fmt: skip
        for name, place, colour, wide in marks:
            at = {"abscissa": [float(place)], "widths": [wide]}
            value = distances[[place]] - base
            log(f"distances/{name}", chart(value, color=rgb(colour), **at))

    def _log_track(self, fix: Fix) -> None:
        marks = ("trusted", TRUSTED, 5.0), ("untrusted", UNTRUSTED, 2.0)
        name, colour, size = marks[0] if fix.trusted else marks[1]
        self.recording.log(f"place/{name}", self.rr.Scalars(fix.place))
        if self.ground is not None:
            self.recording.log(f"route/{name}", self.ground.points([fix.place], colour, size))
            here = self.ground.points([fix.place], HERE, 8.0 if fix.trusted else 4.0)
            self.recording.log("route/here", here)

    def _log_belief(self, localizer: Localizer, fix: Fix) -> None:
        """The square root of the belief in each bin of places, so that a spread one is visible."""
        belief, track = localizer.belief, fix.track
        if belief is None or track is None:
            return
        log = self.recording.log
        log("belief", self._bars(np.sqrt(self.bins.sums(belief)).astype(np.float32), TRUSTED))
        log("sure/confidence", self.rr.Scalars(track.confidence))
        log("sure/off_map", self.rr.Scalars(track.off_map))

    def _bars(self, values: NDArray[np.float32], colour: str) -> Any:
        """A bar for each bin, as wide as its places."""
        wide = float(self.bins.width)
        middles, widths = self.bins.first + (wide - 1) / 2, np.full(len(values), wide)
        return self.rr.BarChart(values, abscissa=middles, widths=widths, color=rgb(colour))

    def _log_numbers(self, seen: Seen, fix: Fix, latency_us: float) -> None:
        rr, log, sequence, track = self.rr, self.recording.log, fix.sequence, fix.track
        log("score", rr.Scalars(fix.score))
        log("latency_us", rr.Scalars(latency_us))
        self.dropped += seen.dropped
        numbers = rr.AnyValues(
            query=seen.name,
            place=fix.place,
            score=fix.score,
            trusted=fix.trusted,
            ready=sequence is not None,
            anchors=-1 if sequence is None else sequence.anchors,
            speed=float("nan") if fix.speed is None else fix.speed,
            single_place=fix.single.place,
            single_distance=fix.single.distance,
            gradient_place=fix.gradient.place,
            gradient_value=fix.gradient.value,
            latency_us=latency_us,
            dropped=self.dropped,
            **({} if track is None else _numbers(track)),
        )
        log("fix", numbers)


def _numbers(track: Track) -> dict[str, float]:
    low, high = track.interval
    sure = {"confidence": track.confidence, "off_map": track.off_map}
    return sure | {"place_low": low, "place_high": high}
