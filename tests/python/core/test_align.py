"""Alignment beside an oracle: the whole joint model as one matrix, forwards and backwards."""

import csv
from pathlib import Path

import numpy as np
import pytest

import surefix

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"
SPEEDS = {
    "steady": [1.0],
    "free": [0, 0.5, 1, 1.5, 2],
    "any": [0, 0.5, 1, 2, 3, 4, 5],
}


class Model:
    """The tracker of docs/method.md 1.9 as one matrix a query, over all states."""

    def __init__(self, D, motion, advance):
        self.n, self.m = D.shape
        self.advance, self.any = advance, motion == "any"
        # With odometry all speeds move alike.
        self.speeds = SPEEDS[motion] if advance is None else [1.0]
        self.lam, self.clip = (0.6, 6) if self.any else (0.5, 4)
        self.restart = 0.02 if self.any else 0.01
        D = np.asarray(D, np.float64)
        sums = np.cumsum(D, axis=1)
        x = D - (sums - sums.mean(0)) / (np.arange(1, self.m + 1) + 10)
        self.z = (x - x.mean(0)) / x.std(0)
        new = np.ones(self.m)
        if self.any and advance is None:
            for j in range(1, self.m):
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
                for i in range(self.n):
                    to = i + target + off
                    step[i, to if 0 <= to < self.n else self.n] += share * weight
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


def oracle(D, motion, advance=None, tolerance=1):
    model = Model(D, motion, advance)
    (n, m), V, seen = D.shape, len(model.speeds), model.evidence()
    state = np.append(np.full(V * n, 0.95 / (V * n)), 0.05)
    forwards = []
    for query in range(m):
        state = state @ model.matrix(query) * seen[query]
        state /= state.sum()
        forwards.append(state)
    later, found = np.ones(V * n + 1), np.zeros((m, 3))
    for query in reversed(range(m)):
        both = forwards[query] * later
        both /= both.sum()
        places = both[:-1].reshape(V, n).sum(0)
        best = int(places.argmax())
        near = places[max(0, best - tolerance) : best + tolerance + 1].sum()
        found[query] = best, near, both[-1]
        later = model.matrix(query) @ (seen[query] * later)
        later /= later.mean()
    return found


@pytest.mark.parametrize("seed", range(90))
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
    got = surefix.align(D, motion=motion, advance=advance, tolerance=tolerance)
    expected = oracle(D, motion, advance, tolerance)
    np.testing.assert_allclose(got.confidence, expected[:, 1], atol=1e-9)
    np.testing.assert_allclose(got.off_map, expected[:, 2], atol=1e-9)
    np.testing.assert_array_equal(got.place, expected[:, 0])
    low, high = got.interval.T
    assert ((low <= got.place) & (got.place <= high)).all()
    if advance is not None:
        np.testing.assert_allclose(got.speed, advance)


def test_the_last_query_is_the_tracks_own_and_a_gap_parts_the_drives():
    D = np.random.default_rng(3).random((20, 30)).astype(np.float32)
    for motion in ("steady", "free", "any"):
        track = surefix.match_distances(D, motion=motion)
        aligned = surefix.align(D, motion=motion)
        assert aligned.place[-1] == track.place[-1]
        assert aligned.confidence[-1] == pytest.approx(track.confidence[-1], abs=1e-12)
        parted = surefix.align(D, motion=motion, gaps=[12])
        before = surefix.align(D[:, :12], motion=motion)
        np.testing.assert_array_equal(parted.confidence[:12], before.confidence)


def test_a_map_and_its_matrix_give_the_same():
    rng = np.random.default_rng(5)
    rows = rng.normal(size=(60, 16)).astype(np.float32)
    queries = (rows[5:50] + 0.8 * rng.normal(size=(45, 16))).astype(np.float32)
    route = surefix.Map.from_descriptors(rows)
    D = np.stack([route.distances(query) for query in queries], axis=1)
    one, two = surefix.align(route, queries, motion="any"), surefix.align(D, motion="any")
    np.testing.assert_array_equal(one.confidence, two.confidence)
    assert np.abs(one.place - np.arange(5, 50)).max() <= 1


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
    with pytest.raises(surefix.SurefixError, match="stopped"):
        surefix.align(np.eye(70, dtype=np.float32), progress=lambda done, total: False)
