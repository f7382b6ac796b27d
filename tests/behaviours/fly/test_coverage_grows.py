"""CoverageGrows: new ground within a window, by the map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from behaviours.fly.coverage_grows import CoverageGrows
from tests.worlds.leaves import map_with
from uav_bt.board import SITE_MAP
from uav_bt.testing import LeafBench
from uav_bt.tree import Status
from uav_bt.types import NearObstacles, SiteMap


def map_of(covered: int, captured_s: float) -> SiteMap:
    """Return a map of 100 ground cells."""
    site_map = map_with(NearObstacles(captured_s=captured_s))
    cells = np.zeros((10, 10), dtype=bool)
    passed = cells.copy()
    passed.flat[:covered] = True
    return replace(site_map, seen_s=np.zeros((10, 10)), free=cells, outside=cells, passed=passed)


def answers(bench: LeafBench, covered: list[int], *, restarts: int = 0) -> list[Status]:
    """Return the answers of ticks half a second apart."""
    result = []
    for cells in covered:
        bench.clock.advance(0.5)
        site_map = map_of(cells, bench.clock.now())
        bench.board[SITE_MAP] = replace(site_map, restarts=restarts)
        result.append(bench.tick())
    return result


def test_it_fails_when_a_window_brought_less_than_asked() -> None:
    bench = LeafBench(CoverageGrows, min_share=0.02, window_s=2.5)
    growing = [10, 12, 14, 16, 18, 20, 22]
    assert set(answers(bench, growing)) == {Status.SUCCESS}
    # After a window at 22 to 23 cells the window has brought 1 of 100.
    stalled = answers(bench, [22, 22, 23, 23, 23, 23])
    assert stalled == [*[Status.SUCCESS] * 4, Status.FAILURE, Status.FAILURE]


def test_it_waits_for_the_first_window() -> None:
    bench = LeafBench(CoverageGrows, min_share=0.02, window_s=2.5)
    assert answers(bench, [10] * 6) == [*[Status.SUCCESS] * 5, Status.FAILURE]


def test_a_pause_restarts_the_window() -> None:
    """A pilot's take-over does not end the survey."""
    bench = LeafBench(CoverageGrows, min_share=0.02, window_s=2.5)
    answers(bench, [10] * 4)
    bench.clock.advance(20.0)
    assert answers(bench, [10] * 5) == [Status.SUCCESS] * 5


def test_a_map_that_begins_anew_restarts_the_window() -> None:
    bench = LeafBench(CoverageGrows, min_share=0.02, window_s=2.5)
    answers(bench, [40, 42, 44, 46, 48, 50])
    assert answers(bench, [0, 0, 0, 0, 0], restarts=1) == [Status.SUCCESS] * 5
    assert answers(bench, [0], restarts=1) == [Status.FAILURE]


def test_with_a_share_of_zero_it_never_fails() -> None:
    assert set(answers(LeafBench(CoverageGrows, min_share=0, window_s=1), [10] * 9)) == {
        Status.SUCCESS
    }
