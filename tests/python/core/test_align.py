"""Alignment beside an oracle: the whole joint model as one matrix, forwards and backwards."""

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import surefix
from oracle_track import Roads
from surefix.simulate import Route

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"
SPEEDS = {
    "steady": [1.0],
    "free": [0, 0.5, 1, 1.5, 2],
    "any": [0, 0.5, 1, 2, 3, 4, 5],
}


class Model:
    """The tracker of docs/method.md 1.9 as one matrix a query, over all states."""

    def __init__(self, techniques, motion, advance, segments=None):
        self.n, self.m = techniques[0].shape
        self.advance, self.any = advance, motion == "any"
        self.roads = Roads(segments or surefix.Segments(self.n))
        # With odometry all speeds move alike.
        self.speeds = SPEEDS[motion] if advance is None else [1.0]
        self.lam, self.clip = (0.6, 6) if self.any else (0.5, 4)
        self.restart = 0.02 if self.any else 0.01
        each = [self.standardised(np.asarray(D, np.float64)) for D in techniques]
        self.z = each[0]
        if len(each) > 1:
            clipped = [np.clip(z, -self.clip, self.clip) for z in each]
            self.z, self.clip = sum(clipped) / np.sqrt(len(each)), np.inf
        new = np.ones(self.m)
        if self.any and advance is None:
            for j in range(1, self.m):
                # Techniques that contradict each other say nothing together.
                if min(self.z[:, j - 1].std(), self.z[:, j].std()) < 1e-9:
                    continue
                r = np.corrcoef(self.z[:, j], self.z[:, j - 1])[0, 1]
                new[j] = min(1.0, (1 - r) / 0.1)
        self.moved = np.minimum(1.0, 2 * new)
        self.weight, self.happens = np.maximum(new, 0.1), np.maximum(self.moved, 0.1)
        self.spread = np.ones(self.m)
        if advance is not None:
            way = np.clip(np.abs(advance), 0.05, 1)
            self.weight[1:] = way[1:]
            if self.any:
                self.happens[1:] = way[1:]
                self.spread[1:] = np.maximum(np.abs(advance[1:]), 0.05)

    def standardised(self, D):
        sums = np.cumsum(D, axis=1)
        x = D - (sums - sums.mean(0)) / (np.arange(1, self.m + 1) + 10)
        return (x - x.mean(0)) / x.std(0)

    def evidence(self):
        z = np.clip(self.z, -self.clip, self.clip)
        e = np.exp(-self.lam * self.weight * z).T
        return np.hstack([np.tile(e, len(self.speeds)), e.mean(1, keepdims=True)])

    def one(self, places, jitter, reach=1):
        """From each place to each, and beyond the route."""
        step = np.zeros((self.n, self.n + 1))
        whole = int(np.floor(places))
        jitter = min(jitter, 0.25 / reach)
        for target, share in ((whole, 1 - places + whole), (whole + 1, places - whole)):
            for off in range(-reach, reach + 1):
                weight = 1 - 2 * reach * jitter if off == 0 else jitter
                step[:, : self.n] += share * weight * self.roads.move(target + off)
        step[:, self.n] = 1 - step.sum(1)
        return step

    def matrix(self, query):
        """From each state (speed, place) and the one off the map to each."""
        n, V = self.n, len(self.speeds)
        switch = np.eye(V)
        for v in range(V if V > 1 else 0):
            near = [w for w in (v - 1, v + 1) if 0 <= w < V]
            switch[v] = [0.95 if w == v else 0.05 / len(near) * (w in near) for w in range(V)]
        stay = np.hstack([np.eye(n), np.zeros((n, 1))])
        if self.advance is None:
            steps = [self.one(v, 0.01) if v else stay for v in self.speeds]
        elif self.any:
            steps = [self.one(self.advance[query], 0.01 * self.spread[query])]
        else:
            way = np.concatenate([[0], np.cumsum(self.advance)])
            steps = [self.one(np.rint(way[query + 1]) - np.rint(way[query]), 0.01)]
        moved, happens = self.moved[query], self.happens[query]
        steps = [moved * step + (1 - moved) * stay for step in steps]
        leave, restart, rejoin = 0.05 * happens, self.restart * happens, 0.1 * happens
        M = np.zeros((V * n + 1, V * n + 1))
        keep, anew = (1 - leave) * (1 - restart), np.full(V * n, 1 / (V * n))
        for v in range(V):
            for w in range(V):
                block = M[v * n : (v + 1) * n, w * n : (w + 1) * n]
                block += keep * switch[v, w] * steps[w][:, :n]
                # What leaves the route starts anew.
                lost = keep * switch[v, w] * steps[w][:, n]
                M[v * n : (v + 1) * n, :-1] += lost[:, None] * anew
        M[:-1, :-1] += (1 - leave) * restart * anew
        M[:-1, -1] = leave
        M[-1, :-1], M[-1, -1] = rejoin * anew, 1 - rejoin
        return M


def oracle(techniques, motion, advance=None, tolerance=1, at=(), segments=None):
    model = Model(techniques, motion, advance, segments)
    n, m, V, seen = model.n, model.m, len(model.speeds), model.evidence()
    state = np.append(np.full(V * n, 0.95 / (V * n)), 0.05)
    forwards = []
    for query in range(m):
        state = state @ model.matrix(query) * seen[query]
        state /= state.sum()
        forwards.append(state)
    later, found = np.ones(V * n + 1), np.zeros((m, 3 + len(at)))
    for query in reversed(range(m)):
        both = forwards[query] * later
        both /= both.sum()
        places = both[:-1].reshape(V, n).sum(0)
        best = int(places.argmax())
        asked = [best, *(int(each[query]) for each in at)]
        near = [places[model.roads.near(i, tolerance)].sum() for i in asked]
        found[query] = best, near[0], both[-1], *near[1:]
        later = model.matrix(query) @ (seen[query] * later)
        later /= later.mean()
    return found


@pytest.mark.parametrize("seed", range(120))
def test_it_is_the_smoothing_of_the_whole_model(seed):
    rng = np.random.default_rng(seed)
    n, m = rng.integers(2, 25), rng.integers(1, 30)
    D = rng.random((n, m)).astype(np.float32)
    if seed % 5 == 0:
        # The robot stands, and sees nearly the same again.
        D[:, m // 2 :] = D[:, m // 2 : m // 2 + 1] + 0.1 * D[:, m // 2 :]
    motion = list(SPEEDS)[seed % 3]
    advance = rng.normal(1, 1.2, m) if seed % 2 == 0 else None
    tolerance = int(rng.integers(0, 3))
    # Other techniques, of other units; and places to ask about.
    more = [rng.exponential(9, (n, m)).astype(np.float32) for _ in range(seed // 3 % 4)]
    at = rng.integers(0, n, (seed % 3, m))
    given = [D, *more] if more else D
    got = surefix.align(given, motion=motion, advance=advance, tolerance=tolerance, at=at)
    expected = oracle([D, *more], motion, advance, tolerance, at)
    np.testing.assert_allclose(got.confidence, expected[:, 1], atol=1e-9)
    np.testing.assert_allclose(got.off_map, expected[:, 2], atol=1e-9)
    np.testing.assert_allclose(got.right, expected[:, 3:].T, atol=1e-9)
    np.testing.assert_array_equal(got.place, expected[:, 0])
    low, high = got.interval.T
    assert ((low <= got.place) & (got.place <= high)).all()
    if advance is not None:
        np.testing.assert_allclose(got.speed, advance)


def test_the_last_query_is_the_tracks_own_and_a_gap_parts_the_drives():
    one, two = np.random.default_rng(3).random((2, 20, 30)).astype(np.float32)
    fused = surefix.match_distances([one, two], motion="any")
    assert surefix.align([one, two]).confidence[-1] == pytest.approx(
        fused.confidence[-1], abs=1e-12
    )
    D = one
    for motion in ("steady", "free", "any"):
        track = surefix.match_distances(D, motion=motion)
        aligned = surefix.align(D, motion=motion)
        assert aligned.place[-1] == track.place[-1]
        assert aligned.confidence[-1] == pytest.approx(track.confidence[-1], abs=1e-12)
        parted = surefix.align(D, motion=motion, gaps=[12])
        before = surefix.align(D[:, :12], motion=motion)
        np.testing.assert_array_equal(parted.confidence[:12], before.confidence)


def test_maps_and_their_matrices_give_the_same():
    rng = np.random.default_rng(5)
    maps, seen, matrices = [], [], []
    for dim in (16, 5):
        rows = rng.normal(size=(60, dim)).astype(np.float32)
        seen.append((rows[5:50] + 0.8 * rng.normal(size=(45, dim))).astype(np.float32))
        maps.append(surefix.Map.from_descriptors(rows))
        matrices.append(np.stack([maps[-1].distances(query) for query in seen[-1]], axis=1))
    one, two = surefix.align(maps[0], seen[0]), surefix.align(matrices[0])
    np.testing.assert_array_equal(one.confidence, two.confidence)
    assert np.abs(one.place - np.arange(5, 50)).max() <= 1
    one, two = surefix.align(maps, seen, gaps=[7]), surefix.align(matrices, gaps=[7])
    np.testing.assert_array_equal(one.confidence, two.confidence)
    assert np.abs(one.place - np.arange(5, 50)).max() <= 1


def test_images_of_several_techniques_are_aligned_by_all():
    road = Route(places=60, size=(96, 48))
    summer, winter = road.reference(), road.revisit(lateral_offset=0.8)
    maps = [
        surefix.Map.from_images(summer, surefix.Sad(size=size)) for size in ((64, 32), (32, 16))
    ]
    rows = [np.stack([each.descriptor.describe(image) for image in winter]) for each in maps]
    one, two = surefix.align(maps, winter), surefix.align(maps, rows)
    np.testing.assert_array_equal(one.confidence, two.confidence)


def test_the_memory_grows_with_the_root_of_the_queries():
    """Resident, of a process of its own: beside the descriptors, as documented."""
    code = """
import resource, sys
import numpy as np, surefix
n, m = int(sys.argv[1]), int(sys.argv[2])
rows = np.random.default_rng(0).random((n, 16), np.float32)
route, seen = surefix.Map.from_descriptors(rows), rows[np.arange(m) % n]
surefix.align(route, seen[:9], motion="any")
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
surefix.align(route, seen, motion="any")
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024)
"""
    n, m, V = 4000, 1600, 7
    done = subprocess.run(
        [sys.executable, "-c", code, str(n), str(m)], capture_output=True, text=True, check=True
    )
    # 2 sqrt(m) (V + 2) n numbers of 8 bytes, 16 MB of distances, and as much for the rest; the
    # whole matrix of beliefs would take 410 MB.
    assert int(done.stdout) < 16 * np.sqrt(m) * (V + 2) * n + 32e6


def test_the_file_is_a_truth(tmp_path):
    D = (1 - np.eye(25, dtype=np.float32)) + 0.1 * np.random.default_rng(0).random((25, 25))
    alignment = surefix.align(D.astype(np.float32), motion="steady")
    alignment.to_csv(tmp_path / "truth.csv", least=2.0 * alignment.confidence.min())
    with (tmp_path / "truth.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["place"]) for row in rows] == alignment.place.tolist()
    doubtful = alignment.confidence < 2.0 * alignment.confidence.min()
    expected = np.where(doubtful, -1, alignment.place)
    assert [int(row["reference"]) for row in rows] == expected.tolist()
    assert "x" not in rows[0]
    assert alignment.position is None


@pytest.mark.parametrize("axes", [2, 3])
def test_a_map_with_positions_gives_those_of_the_places(tmp_path, axes):
    rng = np.random.default_rng(1)
    rows, where = rng.normal(size=(30, 8)).astype(np.float32), rng.normal(size=(30, axes))
    route = surefix.Map.from_descriptors(rows, positions=where)
    alignment = surefix.align([surefix.Map.from_descriptors(rows), route], [rows, rows])
    np.testing.assert_array_equal(alignment.position, where[alignment.place])
    alignment.to_csv(tmp_path / "truth.csv")
    table = np.genfromtxt(tmp_path / "truth.csv", delimiter=",", names=True)
    written = np.stack([table[name] for name in "xyz"[:axes]], axis=1)
    np.testing.assert_array_equal(written, where[alignment.place])


def test_real_drives_are_placed_without_a_label():
    matrices = sorted((DATA / "corridor" / "matrices").glob("*.npy"))
    if not matrices:
        pytest.skip(f"no real distances in {DATA}")
    for path in matrices:
        D = (1 - np.load(path)).astype(np.float32)
        place = surefix.align(D, motion="steady").place
        assert np.mean(np.abs(place - np.arange(len(place))) <= 1) > 0.8, path.name


def test_bad_input_is_refused():
    D = np.ones((5, 4), np.float32)
    D[2, 3] = np.nan
    with pytest.raises(surefix.SurefixValueError, match="row: query"):
        surefix.align(D)
    with pytest.raises(surefix.SurefixValueError, match="motion"):
        surefix.align(D, motion="fast")
    route = surefix.Map.from_descriptors(np.eye(4, dtype=np.float32))
    with pytest.raises(surefix.SurefixValueError, match="expected images or descriptors, got none"):
        surefix.align(route)
    with pytest.raises(surefix.SurefixValueError, match="expected images or descriptors, got none"):
        surefix.align([route, route])
    with pytest.raises(surefix.SurefixError, match="stopped"):
        surefix.align(np.eye(70, dtype=np.float32), progress=lambda done, total: False)


def test_techniques_that_do_not_fit_are_refused():
    D, rows = np.random.default_rng(0).random((6, 4), np.float32), np.eye(6, dtype=np.float32)
    route, shorter = surefix.Map.from_descriptors(rows), surefix.Map.from_descriptors(rows[:5])
    wrong = {
        "expected \\(6, 4\\), got \\(5, 4\\)": ([D, D[:5]],),
        "distances.*1 to 32": ([D] * 33,),
        "queries of a map, as of the first.*6.*4": ([route, route], [rows, rows[:4]]),
        "places of a map, as of the first.*6.*5": ([route, shorter], [rows, rows]),
        "maps.*1 to 32": ([route] * 33, [rows] * 33),
    }
    for words, given in wrong.items():
        with pytest.raises(surefix.SurefixValueError, match=words):
            surefix.align(*given)
    asked = {
        "at.*expected 4.*got 3": [[0, 1, 2]],
        "at.*from 0 to 5.*got 6": [[0, 1, 2, 6]],
        "from 0, got -1": [[0, 1, -1, 2]],
        "at: each row": [0, 1, 2, 3],
        "whole numbers": np.zeros((1, 4)),
    }
    for words, at in asked.items():
        with pytest.raises(surefix.SurefixValueError, match=words):
            surefix.align(D, at=at)
