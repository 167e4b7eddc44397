"""Routes of several segments and closed ones, as Python sees them (method 1.14)."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pandas
import pytest

import surefix
from surefix.simulate import Route

TOWN = surefix.Segments(12, breaks=[5], closed=[0])


def drive(places: int, truth: list[int]) -> np.ndarray:
    """Distances of 0 at the true places and of 1 elsewhere."""
    D = np.ones((places, len(truth)), np.float32)
    D[truth, np.arange(len(truth))] = 0
    return D


def test_a_fix_says_which_segment_and_where_in_it(tmp_path: Path) -> None:
    """In the fix, the run, the table and the file; a pickled run knows its segments."""
    run = surefix.match_distances(drive(12, [3, 4, 0, 7, 8]), segments=TOWN, gaps=[3])
    assert run.place.tolist() == [3, 4, 0, 7, 8]
    assert run.segment.tolist() == [0, 0, 0, 1, 1]
    assert run.segment_place.tolist() == [3, 4, 0, 2, 3]
    assert (run[3].segment, run[3].segment_place) == (1, 2)
    assert run.segment.dtype == run.segment_place.dtype == np.int64
    run.to_csv(tmp_path / "run.csv")
    table = pandas.read_csv(tmp_path / "run.csv")
    assert table.columns[-2:].tolist() == ["segment", "segment_place"]
    assert table.segment_place.tolist() == run.to_dataframe().segment_place.tolist()
    assert table.segment_place.tolist() == run.segment_place.tolist()
    again = pickle.loads(pickle.dumps(run))
    assert again.segments == run.segments == TOWN
    assert again[4] == run[4]


def test_a_stream_knows_its_segments() -> None:
    """Also after a restart, without being told them again."""
    live = surefix.Matcher(TOWN)
    assert surefix.Matcher.restore(live.snapshot()).segments == TOWN
    for column, place in zip(drive(12, [4, 0, 1]).T, [4, 0, 1], strict=True):
        fix = live.push(column.copy())
        assert (fix.place, fix.segment_place) == (place, place)
    assert fix.sequence is not None
    assert fix.sequence.anchors == 2


def test_a_tolerance_goes_round_a_closed_segment_and_not_across_a_break() -> None:
    """Of a run, and of other methods' matches if the segments are given."""
    # Queries 0 and 1 are right round the loop; 2 and 3 are beside the break.
    truth = [4, 0, 4, 5]
    found = [0, 4, 5, 4]
    run = surefix.match_distances(drive(12, found), segments=TOWN, sequence_length=1)
    matches = surefix.Matches(place=run.place, score=run.score)
    assert surefix.evaluate(run, truth).correct == 2
    assert surefix.evaluate(matches, truth, segments=TOWN).correct == 2
    assert surefix.evaluate(matches, truth).correct == 2  # the other two
    assert surefix.evaluate(run, truth, tolerance=0).correct == 0
    trust = surefix.evaluate_trust(run, truth)
    assert trust.true_positives + trust.false_negatives == 2
    assert surefix.recall_at(drive(12, found), truth, [1], segments=TOWN) == [0.5]
    cells = np.zeros((12, 4), bool)
    cells[truth, np.arange(4)] = True
    assert surefix.evaluate(run, cells).correct == 2


def test_segments_that_do_not_fit_are_refused() -> None:
    """The error names the option, what was expected and what came."""
    D = drive(12, [3, 4])
    with pytest.raises(surefix.SurefixError, match=r"sequence_length.*from 1 to 7 .*longest"):
        surefix.Matcher(surefix.Segments(12, breaks=[7]), sequence_length=8)
    with pytest.raises(surefix.SurefixError, match=r"segments: expected 12, got 11|segments"):
        surefix.match_distances(D, segments=surefix.Segments(11))
    run = surefix.match_distances(D, segments=TOWN)
    with pytest.raises(surefix.SurefixError, match="none with a run, which has its own"):
        surefix.evaluate(run, [3, 4], segments=TOWN)
    matches = surefix.Matches(place=run.place, score=run.score)
    with pytest.raises(surefix.SurefixError, match="truth"):
        surefix.evaluate(matches, [3, 12], segments=TOWN)
    with pytest.raises(surefix.SurefixError, match="segments"):
        surefix.recall_at(D, [3, 4], [1], segments=surefix.Segments(11))


def test_all_sequences_of_three_laps_are_right_on_a_closed_map() -> None:
    """A generated ring, mapped in summer and driven three times in autumn: on an open route nearly
    all sequences are wrong for a while after each lap.
    """
    places, length = 150, 20
    ring = Route(places=places, size=(96, 48), seed=5)
    route = surefix.Map.from_images(ring.reference())
    laps = [ring.revisit(lateral_offset=0.5, speed_jitter=0, seed=seed) for seed in (1, 2, 3)]
    columns = [route.distances(route.descriptor.describe(image)) for lap in laps for image in lap]
    D, truth = np.stack(columns, axis=1), np.tile(np.arange(places), 3)
    ways = {
        closed: surefix.match_distances(
            D, segments=surefix.Segments(places, closed=closed), sequence_length=length
        )
        for closed in (False, True)
    }
    closed = ways[True]
    ready = int(closed.ready.sum())
    assert ready == 3 * places - length + 1
    assert surefix.evaluate(closed, truth).correct == ready
    for lap in (1, 2):
        after = slice(lap * places, lap * places + length)
        wrong = np.abs(ways[False].place[after] - truth[after]) > 1
        assert wrong.sum() >= length - 2
