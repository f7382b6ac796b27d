"""The search over the map, flown in a hall that is drawn: to the mark, and over unseen ground."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from behaviours.path.map_search import Aim, Course, MapSearch, MapSearchConfig
from tests.behaviours.path.drawn_hall import SIGHT, DrawnHall
from tests.worlds.values import corridor
from uav_bt.answers import Done, FollowLeg, Rotate
from uav_bt.testing.world import drawn_map
from uav_bt.types import NearObstacles, Pose2D
from uav_bt.types.site_map import MapMark

BOXES = (
    *((-3.4, 3.2), (-0.9, 3.7), (2.1, 3.4), (3.9, 1.2), (3.3, -1.9), (1.0, -3.6)),
    *((-1.2, -2.4), (-3.7, 0.3), (-1.4, 1.1), (1.2, 0.8), (0.7, -1.2), (4.1, -4.0)),
)
TURN = Rotate(yaw_rad=0.3)


def hall(x_m: float, y_m: float, yaw_rad: float, **what: object) -> DrawnHall:
    pose = Pose2D(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)
    return DrawnHall(side_m=10.0, boxes=BOXES, pose=pose, **what)


def known(place: DrawnHall) -> DrawnHall:
    """Let all of a place have been seen."""
    place.seen_s[place.ground & ~place.solid] = 0.0
    place.free |= place.ground & ~place.solid
    place.outside |= ~place.ground
    place.stands |= place.solid
    return place


def test_a_hall_is_searched_systematically() -> None:
    """Of 100 m2 nearly all is seen within 40 m, and nothing twice before."""
    search, place = MapSearch(), hall(2.6, 2.2, 0.8)
    nearest_m = math.inf
    while place.seen_share() < 0.95 and place.now_s < 150.0:
        row, column = place.map().cell_of(place.pose.x_m, place.pose.y_m)
        assert place.free[row, column]
        place.fly(search.decide(place.map(), None, None, None, SIGHT) or TURN)
        nearest_m = min(nearest_m, place.clearance_m())
    assert place.seen_share() >= 0.95
    assert place.flown_m < 40.0
    assert place.now_s < 110.0
    assert nearest_m > 0.3


def test_when_all_was_seen_it_begins_anew() -> None:
    search, place = MapSearch(), known(hall(0.0, -0.2, 0.0))
    place.now_s = 60.0
    decision = search.decide(place.map(), None, None, None, SIGHT)
    assert isinstance(decision, FollowLeg | Rotate)
    for _ in range(300):
        place.fly(search.decide(place.map(), None, None, None, SIGHT) or TURN)
    assert place.flown_m > 10.0


def test_a_look_for_a_way_ends_when_all_was_seen() -> None:
    """Ground that was seen before shows no new way to a mark whose place is known."""
    search, place = MapSearch(MapSearchConfig(repeats=False)), known(hall(0.0, -0.2, 0.0))
    place.now_s = 60.0
    assert search.decide(place.map(), None, None, None, SIGHT) is None
    place.seen_s[place.ground & (place.map().places_m()[..., 0] > 2.0)] = -math.inf
    assert search.decide(place.map(), None, None, None, SIGHT) is not None


def test_ground_that_stays_unseen_is_not_stared_at() -> None:
    """Ground that stays unseen despite the map's prediction is given up after a look."""
    search, place = MapSearch(), known(hall(0.0, -0.2, 0.0))
    hidden = np.zeros_like(place.ground)
    hidden[95:105, 70:80] = True
    for _ in range(250):
        place.seen_s[hidden] = -math.inf
        place.fly(search.decide(place.map(), None, None, None, SIGHT) or TURN)
    assert place.flown_m > 6.0


def test_it_flies_to_the_mark_and_says_when_it_is_there() -> None:
    """Round the boxes, without a stop on the way, and not much further than straight."""
    mark = MapMark(x_m=-3.6, y_m=-3.4, std_m=0.03, seen_s=0.0)
    search, place = MapSearch(), known(hall(2.6, 2.2, -2.4))
    decision: Course = TURN
    nearest_m = math.inf
    while not isinstance(decision, Done) and place.now_s < 60.0:
        decision = search.decide(place.map(mark), mark, None, None, SIGHT) or TURN
        assert search.aim is Aim.MARK
        place.fly(decision)
        nearest_m = min(nearest_m, place.clearance_m())
    apart_m = math.hypot(place.pose.x_m - mark.x_m, place.pose.y_m - mark.y_m)
    assert isinstance(decision, Done)
    assert apart_m < 1.1
    assert place.flown_m < 10.0
    assert place.now_s < 25.0
    assert nearest_m > 0.3


def test_home_leads_through_a_gap_where_there_is_no_other_way() -> None:
    """The hull has 0.2 m, the gap 0.3 m to each side of its middle."""
    mark = MapMark(x_m=2.0, y_m=0.0, std_m=0.03, seen_s=0.0)
    wall = tuple((0.0, y_m) for y_m in np.arange(-4.9, 5.0, 0.1) if abs(y_m) > 0.25)
    place = known(DrawnHall(side_m=10.0, boxes=wall, box_m=0.05))
    place.pose = Pose2D(x_m=-2.0, y_m=1.0, yaw_rad=0.0)
    search = MapSearch()
    decision: Course = TURN
    while not isinstance(decision, Done) and place.now_s < 60.0:
        decision = search.decide(place.map(mark), mark, None, None, SIGHT) or TURN
        place.fly(decision)
    assert place.pose.x_m > 0.5


def test_without_a_mark_unseen_ground_is_flown_to() -> None:
    mark = MapMark(x_m=-3.6, y_m=-3.4, std_m=0.03, seen_s=5.0)
    search, place = MapSearch(), known(hall(2.6, 2.2, -2.4))
    search.decide(place.map(mark), None, None, None, SIGHT)
    assert search.aim is Aim.GROUND
    search.decide(place.map(mark), mark, None, None, SIGHT)
    assert search.aim is Aim.MARK


def test_a_mark_across_unknown_ground_is_not_flown_to_straight() -> None:
    """First the ground before it is looked at."""
    mark = MapMark(x_m=-3.6, y_m=-3.4, std_m=0.03, seen_s=0.0)
    search, place = MapSearch(), hall(2.6, 2.2, -2.4)
    search.decide(place.map(mark), mark, None, None, SIGHT)
    assert search.aim is Aim.GROUND


def test_a_map_that_is_contradicted_is_not_flown_by() -> None:
    search, place = MapSearch(), known(hall(0.0, -0.2, 0.0))
    assert search.decide(place.map(contradicted_s=3.0), None, None, None, SIGHT) is None


def test_corridor_and_assumed_obstacles_limit_the_speed() -> None:
    mark = MapMark(x_m=3.0, y_m=-0.2, std_m=0.03, seen_s=0.0)
    place = known(DrawnHall(side_m=10.0))
    free = MapSearch().decide(place.map(mark), mark, None, None, SIGHT)
    near = corridor(0.6, "front")
    by_corridor = MapSearch().decide(place.map(mark), mark, None, near, SIGHT)
    beside = np.array([(0.6, 0.5), (0.6, -0.5)])
    assumed = NearObstacles(points_m=np.empty((0, 2)), assumed_m=beside, captured_s=0.0)
    by_doubt = MapSearch().decide(place.map(mark), mark, assumed, None, SIGHT)
    assert isinstance(free, FollowLeg)
    assert isinstance(by_corridor, FollowLeg)
    assert isinstance(by_doubt, FollowLeg)
    assert free.speed_mps == 0.6
    assert by_corridor.speed_mps < 0.3
    assert by_doubt.speed_mps < 0.5


def test_what_lies_beyond_the_grid_is_looked_at_once() -> None:
    """The place is larger than its map: the drone looks there, flies on, and does not stare."""
    cells = np.ones((61, 61), dtype=bool)
    search, pose, looked = MapSearch(), Pose2D(x_m=1.5, y_m=0.0, yaw_rad=0.0), 0
    for step in range(400):
        whole = replace(drawn_map(), pose=pose, free=cells, outside=~cells, full=True)
        whole = replace(whole, seen_s=cells.astype(np.float32), captured_s=1.0 + 0.2 * step)
        decision = search.decide(whole, None, None, None, SIGHT)
        if decision is None or isinstance(decision, Done):
            break
        looked += decision.reason == "looked"
        yaw_rad = pose.yaw_rad + max(-0.2, min(0.2, decision.yaw_rad))
        step_m = 0.2 * decision.speed_mps if isinstance(decision, FollowLeg) else 0.0
        x_m, y_m = pose.x_m + step_m * math.cos(yaw_rad), pose.y_m + step_m * math.sin(yaw_rad)
        pose = Pose2D(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)
    assert looked >= 3
    assert math.hypot(pose.x_m - 1.5, pose.y_m) > 1.0
