"""Faults of a mission's map are named; a map without any ground ends the mission."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from tests.paper_lab import CLASSES
from uav_bt.mission.map_check import MapWatch
from uav_bt.types import Pose2D
from uav_bt.types.site_map import MapMark, SiteMap

TICK_S = 0.1
NOTHING = np.zeros((5, 5), dtype=bool)
MARK = MapMark(x_m=1.0, y_m=0.0, std_m=0.05, seen_s=0.0)
GROUND = SiteMap(
    classes=CLASSES,
    pose=Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0),
    corner_m=(0.0, 0.0),
    cell_m=0.1,
    seen_s=np.zeros((5, 5)),
    free=~NOTHING,
    outside=NOTHING,
    passed=NOTHING,
    obstacles_m=np.empty((0, 2)),
    edges_m=np.empty((0, 2)),
    captured_s=0.0,
    mark=MARK,
)
SEEN = replace(GROUND, seen_s=np.full((5, 5), 1e6))
NO_GROUND = replace(GROUND, seen_s=np.full((5, 5), -np.inf), mark=None)


def watched(maps: Sequence[SiteMap | None], *, airborne: bool = True) -> MapWatch:
    """Return a watch after one map per tick, each captured in its tick."""
    watch = MapWatch()
    for tick, each in enumerate(maps):
        now_s = tick * TICK_S
        watch.update(each and replace(each, captured_s=now_s), now_s, airborne=airborne)
    return watch


def shown(maps: Sequence[SiteMap | None], *, airborne: bool = True) -> str:
    """Return the warnings after the last map."""
    return "; ".join(watched(maps, airborne=airborne).warnings)


def test_of_a_good_map_and_of_none_nothing_is_wrong() -> None:
    for site_map in (SEEN, None):
        assert shown([site_map] * 400) == ""
        assert watched([site_map] * 400).trouble is None


def test_no_ground_since_the_take_off_is_named_and_then_ends_the_mission() -> None:
    assert shown([NO_GROUND] * 70) == ""
    assert "no ground in view" in shown([NO_GROUND] * 100)
    assert watched([NO_GROUND] * 290).trouble is None
    assert watched([NO_GROUND] * 320).trouble == "no ground in view for 32 s"


def test_ground_that_is_seen_no_more_is_named_and_ends_nothing() -> None:
    """The map's ground is old, but the drone may still return to it."""
    assert "no ground in view" in shown([GROUND] * 400)
    assert watched([GROUND] * 400).trouble is None
    at_it = replace(GROUND, seen_s=np.full((5, 5), 20.0))
    assert watched([at_it] * 400).trouble is None


def test_a_drone_that_stands_waits_for_its_ground() -> None:
    assert watched([NO_GROUND] * 400, airborne=False).trouble is None
    assert shown([NO_GROUND] * 400, airborne=False) == ""


def test_ground_that_comes_into_view_ends_the_trouble() -> None:
    assert watched([*[NO_GROUND] * 320, SEEN]).trouble is None
    assert shown([*[NO_GROUND] * 100, SEEN]) == ""


def test_a_place_that_is_larger_than_the_grid_stays_named() -> None:
    assert "larger than its map" in shown([replace(SEEN, full=True)] * 300)


def test_a_map_that_was_begun_anew_is_named_for_some_seconds() -> None:
    anew = [replace(SEEN, restarts=1)] * 50
    assert "begun anew" in shown([SEEN, *anew])
    assert shown([SEEN, *anew * 3]) == ""
    assert "begun anew" in shown([SEEN, *anew * 3, replace(SEEN, restarts=2)])


def test_a_mark_that_moved_is_named() -> None:
    once, twice = (replace(SEEN, mark=replace(MARK, moved_m=far_m)) for far_m in (1.2, 2.0))
    assert "landing mark stands 1.2 m" in shown([SEEN, once])
    assert "landing mark stands 0.8 m" in shown([SEEN, once, twice])
    assert shown([SEEN, *[once] * 200]) == ""


def test_what_lasts_and_what_happens_again_is_logged_once_each(
    caplog: pytest.LogCaptureFixture,
) -> None:
    anew = [replace(SEEN, restarts=1)] * 150 + [replace(SEEN, restarts=2)] * 20
    watched([*[NO_GROUND] * 200, SEEN, *anew])
    logged = [record.message[:20] for record in caplog.records]
    assert logged == ["no ground in view: t", "the map was begun an", "the map was begun an"]
