"""The oracle itself: tiny examples worked by hand, and the reference figures on real data."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

import oracle
import real_data
from oracle import Array, Options


def test_gradient_of_three_places() -> None:
    """Eq. 1: inside `0.5 (1 + 2) - 4`, at the ends one-sided."""
    d = np.array([[1.0], [4.0], [2.0]])
    assert_array_equal(oracle.gradient(d)[:, 0], [3.0, -2.5, 2.0])
    assert_array_equal(oracle.gradient(d, "unhalved")[:, 0], [3.0, -5.0, 2.0])


def test_gradient_of_two_places_is_its_two_ends() -> None:
    """Eq. 1 with no inside."""
    assert_array_equal(oracle.gradient(np.array([[1.0], [5.0]]))[:, 0], [4.0, -4.0])


@pytest.mark.parametrize("kind", ["halved", "unhalved"])
def test_gradient_mean_telescopes(kind: str) -> None:
    """1.2: the closed form is the mean of the gradient, to float32 rounding."""
    D = np.random.default_rng(0).random((17, 9))
    plain = oracle.gradient(D, kind).astype(np.float64).mean(axis=0)
    assert_allclose(oracle.gradient_mean(D, kind), np.tile(plain, (17, 1)), atol=1e-6)


def test_enhancement_sums_the_trailing_diagonal() -> None:
    """1.2: three terms back along the diagonal; a missing term is the current column's mean."""
    g = np.array([[1, 2, 3], [4, 5, 6], [7, 8, 9]], np.float32)
    mean = np.array([10, 20, 30], np.float32)
    assert_array_equal(
        oracle.enhance(g, mean, 3),
        [
            [1 + 10 + 10, 2 + 20 + 20, 3 + 30 + 30],
            [4 + 10 + 10, 5 + 1 + 20, 6 + 2 + 30],
            [7 + 10 + 10, 8 + 4 + 20, 9 + 5 + 1],
        ],
    )
    assert_array_equal(oracle.enhance(g, mean, 1), g)
    assert_array_equal(oracle.enhance(g, mean, 5)[:, 2], [3 + 120, 6 + 2 + 90, 9 + 5 + 1 + 60])


def test_a_drive_begins_at_each_gap() -> None:
    """1.5: the numbers of the drives of six queries; one before query 0 begins no second."""
    assert oracle.drives(6).tolist() == [0] * 6
    assert oracle.drives(6, [4, 2, 4]).tolist() == [0, 0, 1, 1, 2, 2]
    assert len(set(oracle.drives(6, [0]).tolist())) == 1


def test_enhancement_ends_at_a_gap() -> None:
    """1.2: the gradient of another drive is missing, and the current column's mean stands in."""
    g = np.array([[1, 2, 3], [4, 5, 6], [7, 8, 9]], np.float32)
    mean = np.array([10, 20, 30], np.float32)
    drive = oracle.drives(3, [2])
    G = oracle.enhance(g, mean, 3, drive)
    assert_array_equal(G[:, :2], oracle.enhance(g, mean, 3)[:, :2])
    assert_array_equal(G[:, 2], g[:, 2] + 60)
    drive = oracle.drives(3, [1])
    assert_array_equal(oracle.enhance(g, mean, 3, drive)[:, 2], [3 + 60, 6 + 2 + 30, 9 + 5 + 30])


def test_no_sequence_reaches_across_a_gap() -> None:
    """1.5 on 4 x 5, `L` of 2, a gap before query 2: its drive warms up again, under the old
    floor.
    """
    D = np.ones((4, 5))
    D[0, 0], D[2, 2], D[3, 3] = 0.25, 0.5, 0.75
    run = oracle.match(D, Options(weight=1.0), trusted=np.ones(5, bool), gaps=[2])
    assert_array_equal(run.ready, [False, True, False, True, True])
    assert_array_equal(run.place[:4], [0, 1, 2, 3])
    assert_array_equal(run.score[:4], [0.25, (0.25 + 1.0) / 2, 0.5, 0.25])
    assert_array_equal(run.anchors[:4], [0, 1, 0, 2])


def test_consensus_within_the_tolerance_and_ties_to_the_lowest() -> None:
    """Eqs. 2 and 3 on three queries: one place apart, two places apart, ties."""
    D = np.array([[0, 0, 1], [5, 5, 1], [5, 5, 1]])
    G = np.array([[1, 1, 2], [9, 1, 2], [1, 9, 2]])
    i_d, i_g, trusted = oracle.consensus(D, G, tolerance=1)
    assert_array_equal(i_d, [0, 0, 0])
    assert_array_equal(i_g, [1, 2, 0])
    assert_array_equal(trusted, [True, False, True])
    assert_array_equal(oracle.consensus(D, G, tolerance=0)[2], [False, False, True])
    assert_array_equal(oracle.consensus(D, G, tolerance=2)[2], [True, True, True])


def test_floor_policies() -> None:
    """1.4: running, fixed (never above running), global."""
    D = np.array([[3.0, 1.0, 2.0], [4.0, 5.0, 0.5]], np.float32)
    assert_array_equal(oracle.floors(D, "running"), [3.0, 1.0, 0.5])
    assert_array_equal(oracle.floors(D, 2.0), [2.0, 1.0, 0.5])
    assert_array_equal(oracle.floors(D, "global"), [0.5, 0.5, 0.5])


def test_weight_moves_a_cell_to_the_floor() -> None:
    """Eq. 4: nothing, half way, all the way."""
    d0, floor = np.float32(4.0), np.float32(2.0)
    assert [float(oracle.weight(d0, floor, w)) for w in (0.0, 0.5, 1.0)] == [4.0, 3.0, 2.0]


def test_match_applies_the_running_floor_afresh_to_the_whole_window() -> None:
    """Eqs. 4 to 6 on 2 x 2: at query 1 the floor is 1, and query 0's cell 2 becomes 1.5."""
    D = np.array([[2.0, 3.0], [4.0, 1.0]])
    run = oracle.match(D, Options(weight=0.5), trusted=np.array([True, True]))
    assert_array_equal(run.ready, [False, True])
    assert_array_equal(run.place, [0, 1])
    assert_array_equal(run.score, [2.0, (1.0 + 1.5) / 2])
    assert_array_equal(run.anchors, [0, 2])
    assert_array_equal(run.speed, [np.nan, 1.0])


def test_match_counts_only_anchors_on_the_winning_diagonal() -> None:
    """1.5: query 1's anchor is at place 0, at which no diagonal ends, and counts for nothing."""
    D = np.array([[1.0, 0.0], [2.0, 5.0], [9.0, 5.0]])
    run = oracle.match(D, Options(weight=0.0), trusted=np.array([True, True]))
    assert_array_equal(run.single_place, [0, 0])
    assert (run.place[1], run.score[1], run.anchors[1]) == (1, 3.0, 1)


def test_an_untrusted_query_is_not_weighted() -> None:
    """1.4: with no query trusted the weight changes nothing; w = 0 is the same with all trusted."""
    D = np.random.default_rng(1).random((8, 12))
    none, every = np.zeros(12, bool), np.ones(12, bool)
    plain = oracle.match(D, Options(weight=0.99), none).score
    assert_array_equal(plain, oracle.match(D, Options(weight=0.0), every).score)
    assert (oracle.match(D, Options(weight=0.99), every).score < plain).any()


def test_steps_back_round_halves_up() -> None:
    """1.5: `round(v k)`."""
    assert [oracle.steps_back(0.5, k) for k in range(6)] == [0, 1, 1, 2, 2, 3]
    assert [oracle.steps_back(1.5, k) for k in range(4)] == [0, 2, 3, 5]
    assert [oracle.steps_back(0.0, k) for k in range(3)] == [0, 0, 0]


def test_a_window_is_added_from_the_oldest_query_to_the_newest() -> None:
    """1.5 by hand: float64 holds 2**53 + 2, but rounds 2**53 + 1, so that the ones must meet first."""
    for diagonal, expected in (
        ([1.0, 1.0, 0.0, 2.0**53], 2.0**53 + 2.0),
        ([2.0**53, 0.0, 1.0, 1.0], 2.0**53),
    ):
        D = np.diag(np.float32(diagonal))
        sums, _ = oracle.sequence(D, np.zeros(4, int), np.zeros(4, bool), np.zeros(4), 0.0, 4)
        assert sums[3, 3] == expected


def test_velocity_search_finds_a_standstill() -> None:
    """1.5: three queries at place 2 lie on the diagonal of speed 0."""
    D = np.full((5, 3), 1.0)
    D[2] = 0.0
    run = oracle.match(D, Options(sequence_length=3, speeds=(1.0, 0.0)))
    assert (run.place[2], run.speed[2], run.score[2]) == (2, 0.0, 0.0)


def test_velocity_ties_go_to_the_lowest_place_then_the_first_speed() -> None:
    """1.5 on an all-equal matrix: speed 0.5 is defined from place 1, speed 1 from place 2."""
    D = np.ones((5, 3))
    slower = oracle.match(D, Options(sequence_length=3, speeds=(1.0, 0.5)))
    assert (slower.place[2], slower.speed[2]) == (1, 0.5)
    first = oracle.match(D, Options(sequence_length=3, speeds=(0.6, 0.5)))
    assert (first.place[2], first.speed[2]) == (1, 0.6)


def test_distances_by_hand() -> None:
    """1.6: the mean of 3 and 4, the 3-4-5 triangle, a right angle."""
    rows = np.array([[4.0, 4.0], [-1.0, 1.0]])
    query = np.array([1.0, 0.0])
    assert oracle.distances(query, rows, "manhattan")[0] == 3.5
    assert oracle.distances(query, rows, "euclidean")[0] == 5.0
    assert oracle.distances(np.array([2.0, 2.0]), rows, "cosine")[1] == 1.0
    assert oracle.distances(np.array([2.0, 2.0]), rows, "cosine")[0] == pytest.approx(
        0.0, abs=1e-15
    )


def test_grey_is_pillows() -> None:
    """1.7: every channel's weight by hand, and any colour as Pillow has it."""
    primaries = np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]]], np.uint8)
    assert_array_equal(oracle.grey(primaries), [[76, 150, 29, 255]])
    colours = np.random.default_rng(2).integers(0, 256, (64, 64, 3), dtype=np.uint8)
    assert_array_equal(oracle.grey(colours), np.asarray(Image.fromarray(colours).convert("L")))


def test_normalise_two_tiles_row_by_row() -> None:
    """1.7: a tile of std 1 gives z = -1, 1; one of std 0.43 is flat; rows run over both tiles."""
    thumbnail = np.array([[0, 2, 5, 5], [0, 2, 5, 6]], np.uint8)
    assert_array_equal(oracle.normalise(thumbnail, 2), [96, 160, 128, 128, 96, 160, 128, 128])
    assert_array_equal(oracle.normalise(thumbnail, 2, "f32"), [-1, 1, 0, 0, -1, 1, 0, 0])


def test_normalise_clamps() -> None:
    """1.7: one white pixel in an 8 x 8 tile has z = sqrt(63), past 255; others -1 / sqrt(63)."""
    thumbnail = np.zeros((8, 8), np.uint8)
    thumbnail[3, 4] = 255
    described = oracle.normalise(thumbnail)
    assert described[3 * 8 + 4] == 255
    assert set(np.delete(described, 3 * 8 + 4)) == {124}


def test_sad_distance_is_in_units_of_z() -> None:
    """1.7: the same pair of images, u8 and f32, differ by rounding alone."""
    images = np.random.default_rng(3).integers(0, 256, (2, 40, 70, 3), dtype=np.uint8)
    by_dtype = [
        oracle.sad_distances(a, b[None])[0]
        for a, b in (
            (oracle.sad(images[0], dtype=t), oracle.sad(images[1], dtype=t)) for t in ("u8", "f32")
        )
    ]
    assert by_dtype[0] == pytest.approx(by_dtype[1], abs=1 / 32)
    assert by_dtype[0] > 0.5


@pytest.mark.parametrize(
    ("recall", "expected"),
    [
        ("correct", [1 / 3, 2 / 3, 3 / 3]),
        ("place_exists", [1 / 4, 2 / 4, 3 / 4]),
        ("rejected", [1 / 4, 2 / 3, 3 / 3]),
    ],
)
def test_curve_of_four_queries(recall: str, expected: list[float]) -> None:
    """1.8: equal scores enter together; the three recalls."""
    correct = np.array([True, False, True, True])
    r, p, thresholds = oracle.pr_curve(np.array([1, 2, 2, 3]), correct, 4, recall)
    assert_array_equal(thresholds, [1, 2, 3])
    assert_allclose(p, [1, 2 / 3, 3 / 4])
    assert_allclose(r, expected)


def test_auc_by_hand() -> None:
    """1.8: knots (0, 1), (1/2, 1/2), (1, 2/3), and a cut half way through the last segment."""
    r, p = np.array([0.5, 0.5, 1.0]), np.array([1.0, 0.5, 2 / 3])
    whole = 0.5 * (1 + 0.5) / 2 + 0.5 * (0.5 + 2 / 3) / 2
    cut = 0.5 * (1 + 0.5) / 2 + 0.25 * (0.5 + (0.5 + 2 / 3) / 2) / 2
    assert oracle.auc(r, p) == pytest.approx(whole)
    assert oracle.auc(r, p, 0.75) == pytest.approx(cut / 0.75)


def test_auc_at_the_ends_of_the_curve() -> None:
    """1.8: the first precision held back, nothing past the end, and a mistake before any match."""
    assert oracle.auc(np.array([0.25]), np.array([0.8]), 0.2) == pytest.approx(0.8)
    assert oracle.auc(np.array([0.25]), np.array([0.8]), 0.5) == pytest.approx(0.4)
    assert oracle.auc(np.array([0.0, 0.5]), np.array([0.0, 0.5]), 0.5) == pytest.approx(0.25)


def test_auc_is_numpys_interpolation_at_the_distinct_recalls() -> None:
    """1.8: the same area in NumPy's words, on curves with many mistakes and many ties."""
    rng = np.random.default_rng(4)
    for _ in range(200):
        size = int(rng.integers(3, 40))
        correct = rng.random(size) < 0.4
        correct[0] = True
        r, p, _ = oracle.pr_curve(rng.integers(0, 30, size), correct)
        upto = float(rng.uniform(0.05, 1.0))
        r0, p0 = np.concatenate([[0.0], r]), np.concatenate([p[:1], p])
        knots = np.unique(np.concatenate([r0[r0 < upto], [upto]]))
        area = np.trapezoid(np.interp(knots, r0, p0), knots) / upto
        assert oracle.auc(r, p, upto) == pytest.approx(area)


# The reference figures on real data. Truth is the identity, the tolerance one frame.


def read(folder: Path) -> list[Array]:
    return [np.asarray(Image.open(path)) for path in sorted(folder.glob("*.jpg"))]


def traverses(name: str) -> tuple[list[Array], list[Array]]:
    """Reference and query images of one set, in order."""
    data = real_data.folder()
    if name == "nordland":
        files = ("summer_0000_1149.npy", "winter_0000_1149.npy")
        return list(np.load(data / name / files[0])), list(np.load(data / name / files[1]))
    folders = {"gardens_point": ("day_left", "day_right"), "corridor": ("reference", "query")}[name]
    return read(data / name / folders[0]), read(data / name / folders[1])


@pytest.fixture(scope="module")
def matrix_of() -> Callable[[str], Array]:
    """The SAD matrix of a set: 64 x 32, patch 8, u8; made once."""
    made: dict[str, Array] = {}

    def matrix(name: str) -> Array:
        if name not in made:
            reference, query = traverses(name)
            rows = np.stack([oracle.sad(image) for image in reference])
            columns = [oracle.sad_distances(oracle.sad(image), rows) for image in query]
            made[name] = np.stack(columns, axis=1).astype(np.float32)
        return made[name]

    return matrix


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "queries", "correct", "trusted", "both", "within"),
    [
        ("nordland", 1150, 311, 283, 279, 0),  # pixels as they are: no decoder between us
        ("gardens_point", 100, 42, 24, 17, 2),
        ("corridor", 111, 29, 16, 7, 2),
    ],
)
def test_reference_counts(
    matrix_of: Callable[[str], Array],
    name: str,
    queries: int,
    correct: int,
    trusted: int,
    both: int,
    within: int,
) -> None:
    """Eqs. 1 to 3: correct single matches, trusted ones, and those that are both."""
    run = oracle.match(matrix_of(name), Options())
    right = np.abs(run.single_place - np.arange(queries)) <= 1
    assert abs(int(right.sum()) - correct) <= within
    assert abs(int(run.trusted.sum()) - trusted) <= within
    assert abs(int((right & run.trusted).sum()) - both) <= within


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "length", "unweighted", "weighted"),
    [
        ("nordland", 2, 0.7407, 1.0000),
        ("nordland", 3, 0.6837, 1.0000),
        ("nordland", 5, 0.6414, 1.0000),
        ("nordland", 10, 0.6943, 1.0000),
        ("gardens_point", 2, 0.9563, 0.9112),
        ("gardens_point", 3, 0.7055, 0.9468),
        ("gardens_point", 5, 0.8217, 0.9867),
        ("gardens_point", 10, 0.8984, 1.0000),
        ("corridor", 2, 0.4883, 0.8475),
        ("corridor", 3, 0.6380, 0.7804),
        ("corridor", 5, 0.7198, 0.8867),
        ("corridor", 10, 0.9847, 0.9940),
    ],
)
def test_reference_areas(
    matrix_of: Callable[[str], Array], name: str, length: int, unweighted: float, weighted: float
) -> None:
    """Eqs. 4 to 6 and 1.8: area to 20 % recall, of the queries past the warm-up alone."""
    D = matrix_of(name)
    within = 5e-5 if name == "nordland" else 2e-3
    for w, expected in ((0.0, unweighted), (0.99, weighted)):
        run = oracle.match(D, Options(sequence_length=length, weight=w, floor="global"))
        right = np.abs(run.place - np.arange(D.shape[1])) <= 1
        r, p, _ = oracle.pr_curve(run.score[run.ready], right[run.ready])
        assert oracle.auc(r, p, 0.2) == pytest.approx(expected, abs=within)
