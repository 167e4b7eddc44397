"""The oracle: docs/method.md in plain NumPy, whole matrices at a time, slow and obvious.

It shares no code with the library: no stream, no ring, no state, only matrices `D[i, j]` (place
`i`, query `j`) and their shifted copies. Section numbers are those of that page, equation numbers
those of Carson, Ford, Milford, ICRA 2023.

The paper leaves open: `D` is float32; ties go to the lowest index; gradients are float32 in the
written order of operations; diagonal sums are float64, in the order of 1.5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

Array = npt.NDArray[Any]
Floor = str | float


@dataclass(frozen=True)
class Road:
    """1.14: the places of a segment, first and end, and whether the last is followed by the first."""

    first: int
    end: int
    closed: bool = False

    def __len__(self) -> int:
        return self.end - self.first


def roads(n: int, breaks: Sequence[int] = (), closed: Sequence[int] = ()) -> list[Road]:
    """1.14: the segments of `n` places that are cut at `breaks`; some of them are closed."""
    edges = [0, *map(int, breaks), n]
    pairs = pairwise(edges)
    return [Road(a, b, number in closed) for number, (a, b) in enumerate(pairs)]


def shifted(X: Array, road: Road, k: int) -> tuple[Array, Array]:
    """Of the rows of one road, `X[i - k]` in row `i`, and in which rows there is a place `i - k`."""
    n = len(road)
    if road.closed:
        return np.roll(X, k, axis=0), np.ones(n, bool)
    moved = np.zeros_like(X)
    if k >= 0:
        moved[k:] = X[: max(n - k, 0)]
    else:
        moved[:k] = X[-k:]
    place = np.arange(n) - k
    return moved, (place >= 0) & (place < n)


def gradient(D: Array, kind: str = "halved", route: list[Road] | None = None) -> Array:
    """Eq. 1, column by column, float32: `0.5 (d[i+1] + d[i-1]) - d[i]`; at an end there is one
    neighbour, `d[i+1] - d[i]` or `d[i-1] - d[i]`, and a place by itself has 0.

    `unhalved` (the authors' code) is `(d[i+1] + d[i-1]) - 2 d[i]` inside, and has the same ends.
    """
    D = np.asarray(D, np.float32)
    if kind not in ("halved", "unhalved"):
        raise ValueError(kind)
    g = np.empty_like(D)
    for road in route or roads(len(D)):
        d = D[road.first : road.end]
        (before, has_before), (after, has_after) = shifted(d, road, 1), shifted(d, road, -1)
        around = after + before
        both = np.float32(0.5) * around - d if kind == "halved" else around - np.float32(2.0) * d
        known = [(has_before & has_after)[:, None], has_after[:, None], has_before[:, None]]
        g[road.first : road.end] = np.select(
            [np.broadcast_to(k, d.shape) for k in known],
            [both, after - d, before - d],
            np.float32(0),
        )
    return g


def gradient_mean(D: Array, kind: str = "halved", route: list[Road] | None = None) -> Array:
    """1.2: the mean of each column of the gradient over each place's segment, (n, m), telescoped,
    in float32. A closed segment's is 0.
    """
    D = np.asarray(D, np.float32)
    mean = np.zeros_like(D)
    for a, b, closed in ((r.first, r.end, r.closed) for r in route or roads(len(D))):
        if kind == "halved" and not closed and b - a > 1:
            ends = (D[a + 1] - D[a]) + (D[b - 2] - D[b - 1])
            mean[a:b] = ends / np.float32(2 * (b - a))
    return mean


def drives(queries: int, gaps: Sequence[int] = ()) -> Array:
    """1.5: the number of each query's unbroken drive, (m,): a gap before query `j` begins a new one
    there.
    """
    first_of_a_drive = np.isin(np.arange(queries), np.asarray(gaps, np.int64))
    return np.cumsum(first_of_a_drive)


def enhance(
    g: Array,
    mean: Array,
    smoothing: int = 3,
    drive: Array | None = None,
    route: list[Road] | None = None,
) -> Array:
    """1.2: `G[i, j] = g_j[i] + g_{j-1}[i-1] + ...`, `smoothing` terms, in this order, float32.

    A term before the first place of an open segment or the first query, or of another `drive` (m,)
    than query `j`'s, is `mean[i, j]`, of the *current* column. `smoothing` may exceed both sides of
    the matrix.
    """
    n, m = g.shape
    mean = np.broadcast_to(mean, (n, m))
    drive = np.zeros(m) if drive is None else drive
    G = g.copy()
    for k in range(1, smoothing):
        term = mean.copy()
        together = drive[k:] == drive[: max(m - k, 0)]
        for road in route or roads(n):
            rows = slice(road.first, road.end)
            moved, known = shifted(g[rows, : max(m - k, 0)], road, k)
            term[rows, k:] = np.where(known[:, None] & together, moved, term[rows, k:])
        G = G + term
    return G


def telling(D: Array) -> Array:
    """1.3: which queries tell one place from another, (m,): a column of one number says nothing."""
    return np.ptp(np.asarray(D, np.float64), axis=0) > 0


def near(a: Array, b: Array, within: float, route: list[Road]) -> Array:
    """1.14: whether places lie on one segment, at most so far apart, round a closed one too."""
    result = np.zeros(np.broadcast(a, b).shape, bool)
    for road in route:
        on_it = (np.minimum(a, b) >= road.first) & (np.maximum(a, b) < road.end)
        apart = np.abs(np.asarray(a) - b)
        if road.closed:
            apart = np.minimum(apart, len(road) - apart)
        result |= on_it & (apart <= within)
    return result


def consensus(
    D: Array, G: Array, tolerance: int = 1, route: list[Road] | None = None
) -> tuple[Array, Array, Array]:
    """1.3: the places of the least distance and the largest gradient (Eq. 2), and trust (Eq. 3)."""
    i_d = np.argmin(D, axis=0)
    i_g = np.argmax(G, axis=0)
    route = route or roads(len(D))
    # A place by itself has no neighbour to dip below.
    alone = [road.first for road in route if len(road) == 1]
    return i_d, i_g, near(i_g, i_d, tolerance, route) & ~np.isin(i_d, alone)


def floors(D: Array, floor: Floor = "running") -> Array:
    """1.4: the floor at query `j`, (m,) float32.

    `running` is the least raw distance of all queries up to and including `j`; a number `x` is
    `min(x, running)`, with `x` taken as a float32; `global` is the minimum of the whole matrix.
    Queries that say nothing do not count: without any other it is infinite.
    """
    least = np.where(telling(D), D.min(axis=0), np.float32(np.inf))
    running = np.minimum.accumulate(least)
    if floor == "running":
        return running
    if floor == "global":
        return np.full_like(running, least.min())
    return np.minimum(np.float32(floor), running)


def weight(d0: Array, floor: Array, w: float = 0.99) -> Array:
    """Eq. 4: `d0 - w (d0 - floor)`, float64 from float32 values, then a float32 cell of `D_w`."""
    d0, floor = np.asarray(d0, np.float64), np.asarray(floor, np.float64)
    return (d0 - w * (d0 - floor)).astype(np.float32)


def steps_back(speed: float, k: int) -> int:
    """1.5: `round(v k)`, halves up."""
    return int(np.floor(speed * k + 0.5))


def sequence(
    D: Array,
    i_d: Array,
    trusted: Array,
    floor: Array,
    w: float,
    length: int,
    speed: float = 1.0,
    drive: Array | None = None,
    route: list[Road] | None = None,
) -> tuple[Array, Array]:
    """Eq. 5: `L S` (n, m) float64, `inf` if undefined, and the number of anchors on each diagonal.

    Column `j` weights *every* column of its window with `floor[j]`. Each sum runs from the oldest
    query to the newest. Defined if `j >= L-1`, all queries of the window are of one `drive` (m,),
    and place `i` has at least `round(v (L-1))` places of an open segment before it, or is on a
    closed one.
    """
    n, m = D.shape
    drive = np.zeros(m) if drive is None else drive
    S = np.full((n, m), np.inf)  # sums, for the means of two of them can be equal
    anchors = np.zeros((n, m), np.int64)
    for j in range(length - 1, m):
        if len(set(drive[j - length + 1 : j + 1])) > 1:
            continue
        columns = D[:, : j + 1].astype(np.float64)
        on_it = np.zeros((n, j + 1), bool)
        for q in np.flatnonzero(trusted[: j + 1]):
            columns[i_d[q], q] = weight(D[i_d[q], q], floor[j], w)
            on_it[i_d[q], q] = True
        for road in route or roads(n):
            rows = slice(road.first, road.end)
            window = [(q, steps_back(speed, j - q)) for q in range(j - length + 1, j + 1)]
            terms = [shifted(columns[rows, q], road, k)[0] for q, k in window]
            counts = [shifted(on_it[rows, q], road, k)[0] for q, k in window]
            whole = shifted(terms[0], road, window[0][1])[1]
            S[rows, j] = np.where(whole, reduce(np.add, terms), np.inf)
            anchors[rows, j] = np.sum(counts, axis=0)
    return S, anchors


@dataclass(frozen=True)
class Options:
    """The options of the method, with their defaults."""

    sequence_length: int = 2
    weight: float = 0.99
    tolerance: int = 1
    smoothing: int = 3
    gradient: str = "halved"
    floor: Floor = "running"
    speeds: Sequence[float] = (1.0,)


@dataclass(frozen=True)
class Run:
    """One value per query, by the names of `surefix.Run`."""

    place: Array
    score: Array
    trusted: Array
    anchors: Array
    ready: Array
    speed: Array
    single_place: Array
    single_distance: Array
    gradient_place: Array
    gradient_value: Array
    blank: Array
    segment: Array
    segment_place: Array


def match(
    D: Array,
    o: Options,
    trusted: Array | None = None,
    gaps: Sequence[int] = (),
    route: list[Road] | None = None,
) -> Run:
    """Sections 1.1 to 1.5 for a matrix `D` (n, m); `trusted` (m,) replaces the consensus.

    `gaps` are queries that do not follow the one before, in any order; floors ignore them. Warming
    up (the first `L-1` queries of each drive): place and score are the single frame's, no anchors,
    speed NaN. `route` is its segments, one by default. Ties between speeds: the lowest place, then the first in the list. A speed whose
    diagonal never fits is ignored.
    """
    D = np.asarray(D, np.float32)
    route = route or roads(len(D))
    drive = drives(D.shape[1], gaps)
    g, mean = gradient(D, o.gradient, route), gradient_mean(D, o.gradient, route)
    G = enhance(g, mean, o.smoothing, drive, route)
    i_d, i_g, agreed = consensus(D, G, o.tolerance, route)
    says = telling(D)
    trusted = says & (agreed if trusted is None else np.asarray(trusted, bool))
    floor = floors(D, o.floor)

    j = np.arange(D.shape[1])
    single = D[i_d, j]
    place, best = i_d.copy(), np.full(len(j), np.inf)
    speed, anchors = np.full(len(j), np.nan), np.zeros(len(j), np.int64)
    for v in o.speeds:
        length = o.sequence_length
        S, on_diagonal = sequence(D, i_d, trusted, floor, o.weight, length, v, drive, route)
        i_0 = np.argmin(S, axis=0)  # Eq. 6
        s = S[i_0, j]
        better = (s < best) | (np.isfinite(s) & (s == best) & (i_0 < place))
        place[better], best[better], speed[better] = i_0[better], s[better], v
        anchors[better] = on_diagonal[i_0, j][better]
    ready = np.isfinite(best)
    means = (0.0 + best) / o.sequence_length
    score = np.where(ready, means, single).astype(np.float32)
    G_max = G[i_g, j]
    number = np.searchsorted([road.end for road in route], place, side="right")
    counted = place - np.array([road.first for road in route])[number]
    return Run(
        place,
        score,
        trusted,
        anchors,
        ready,
        speed,
        i_d,
        single,
        i_g,
        G_max,
        ~says,
        number,
        counted,
    )


def distances(query: Array, rows: Array, metric: str) -> Array:
    """1.6: one query (dim,) against rows (n, dim), by direct differences in float64."""
    q, r = np.asarray(query, np.float64), np.asarray(rows, np.float64)
    if metric == "manhattan":
        return np.abs(r - q).mean(axis=1)
    if metric == "euclidean":
        return np.sqrt(((r - q) ** 2).sum(axis=1))
    if metric == "cosine":
        return 1.0 - (r @ q) / (np.sqrt((r**2).sum(axis=1)) * np.sqrt((q**2).sum()))
    raise ValueError(metric)


def sad_distances(query: Array, rows: Array) -> Array:
    """1.7: between SAD descriptors, in units of `z` for both dtypes (32 steps of u8 are one)."""
    step = 32.0 if np.asarray(query).dtype == np.uint8 else 1.0
    return distances(query, rows, "manhattan") / step


def grey(image: Array) -> Array:
    """1.7: Rec. 601 in Pillow's integers; a grey image (H, W) is returned as it is."""
    if image.ndim == 2:
        return image
    r, g, b = (image[..., c].astype(np.int64) for c in range(3))
    return ((19595 * r + 38470 * g + 7471 * b + 32768) >> 16).astype(np.uint8)


def resize(grey_image: Array, size: tuple[int, int]) -> Array:
    """1.7: Pillow's own antialiased bilinear, to (width, height)."""
    return np.asarray(Image.fromarray(grey_image).resize(size, Image.Resampling.BILINEAR))


def normalise(thumbnail: Array, patch: int = 8, dtype: str = "u8") -> Array:
    """1.7: every tile to `z = (p - mean) / std`, row by row of the *image* (y, then x).

    From exact integer sums: with `N` pixels, `N p - sum p` over `sqrt(N sum p^2 - (sum p)^2)`. A
    tile of population std below one grey level is 0. `u8` is `clamp(floor(128 + 32 z + 0.5))`.
    """
    height, width = thumbnail.shape
    tiles = thumbnail.reshape(height // patch, patch, width // patch, patch).astype(np.int64)
    count = patch * patch
    total = tiles.sum(axis=(1, 3), keepdims=True)
    variance = count * (tiles**2).sum(axis=(1, 3), keepdims=True) - total**2  # count^2 * std^2
    flat = variance < count**2
    z = (count * tiles - total) / np.sqrt(np.where(flat, 1, variance))
    z = np.where(flat, 0.0, z).reshape(-1)
    if dtype == "f32":
        return z.astype(np.float32)
    return np.clip(np.floor(128.0 + 32.0 * z + 0.5), 0, 255).astype(np.uint8)


def sad(image: Array, size: tuple[int, int] = (64, 32), patch: int = 8, dtype: str = "u8") -> Array:
    """1.7: image (H, W) or (H, W, 3) uint8 to its descriptor (width * height,)."""
    return normalise(resize(grey(image), size), patch, dtype)


def shows_nothing(image: Array) -> bool:
    """1.7: whether at most 7.5 % of the numbers are more than a quarter of their tile's deviation
    from its lower median, or at most an eighth of the tiles have such numbers.
    """
    tiles = sad(image).astype(int).reshape(4, 8, 8, 8).swapaxes(1, 2).reshape(32, 64)
    apart = np.abs(tiles - np.sort(tiles, axis=1)[:, 31:32]) > 8
    return bool(apart.mean() <= 0.075 or apart.any(axis=1).sum() <= 4)


def without_blank(D: Array, places: Array, queries: Array) -> Array:
    """1.7: the distances (n, m) without what says nothing: `places` (n,) and `queries` (m,) that do
    not have, in each column, the mean over the others.
    """
    means = np.asarray(D, np.float64)[~places].mean(axis=0).astype(np.float32)
    return np.where(places[:, None] | queries[None], means, D).astype(np.float32)


def pr_curve(
    scores: Array, correct: Array, n_relevant: int | None = None, recall: str = "correct"
) -> tuple[Array, Array, Array]:
    """1.8: (recall, precision, thresholds), one point per distinct score, `score <= threshold`.

    `correct` (m,) is False for a query without a true place. `n_relevant` is the number of queries
    that have one, for `place_exists`. A recall of 0 / 0 is 0.
    """
    scores, correct = np.asarray(scores), np.asarray(correct, bool)
    thresholds = np.unique(scores)
    accepted = scores[None, :] <= thresholds[:, None]
    tp = (accepted & correct).sum(axis=1)
    if recall == "correct":
        whole = np.full_like(tp, correct.sum())
    elif recall == "place_exists":
        whole = np.full_like(tp, len(scores) if n_relevant is None else n_relevant)
    elif recall == "rejected":
        whole = tp + (~accepted).sum(axis=1)
    else:
        raise ValueError(recall)
    return tp / np.maximum(whole, 1), tp / accepted.sum(axis=1), thresholds


def auc(recall: Array, precision: Array, upto: float = 1.0) -> float:
    """1.8: the area under the curve up to recall `upto`, over `upto`; nothing past its end.

    One knot per distinct recall, at its *last* precision, the lowest, and trapezoids between knots.
    Recall 0 has the first precision, unless mistakes come first. A cut inside a segment leads to
    the *first* precision of the next recall, the sweep's own line. (The reference figures were
    computed so; trapezoids through every point of the sweep give others.)
    """
    r = np.concatenate([[0.0], recall])
    p = np.concatenate([precision[:1], precision])
    knots = np.unique(r)
    last = np.array([p[r == x][-1] for x in knots])
    first = np.array([p[r == x][0] for x in knots])
    area = 0.0
    for s in range(len(knots) - 1):
        r0, r1 = knots[s], knots[s + 1]
        if r1 <= upto:
            area += (r1 - r0) * (last[s] + last[s + 1]) / 2
        elif r0 < upto:
            at_cut = last[s] + (first[s + 1] - last[s]) * (upto - r0) / (r1 - r0)
            area += (upto - r0) * (last[s] + at_cut) / 2
    return float(area / upto)
