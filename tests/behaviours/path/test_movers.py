"""What moves, for the planner: slower, waiting, round it, and out of its way."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.fly.keeping_away import WayOut, way_out
from behaviours.path.clearance import ClearanceMap
from behaviours.path.movers import SPARE_M, TIMES_S, gap_m, outlines_m, runs_into, yielding_mps
from behaviours.path.nearby import RecentObstacles
from behaviours.path.survey import best_route
from tests.behaviours.path.drawn_maps import RING, mover, where, with_movers
from uav_bt.testing.world import drawn_map
from uav_bt.types.site_map import MapMover, SiteMap

BODY_M = 0.2
AHEAD = np.array([[0.1 * step, 0.0] for step in range(20)])


def escape(site_map: SiteMap, before: WayOut | None = None) -> WayOut:
    clearance = ClearanceMap(
        replace(site_map, movers=(), lanes_m=np.empty((0, 2))), RecentObstacles()
    )
    return way_out(clearance, site_map.movers, BODY_M, before=before)


def min_room_m(way: WayOut, site_map: SiteMap) -> float:
    """Return the gap to movers of a drone that flies a way after its reaction."""
    flown_s = np.maximum(TIMES_S - 0.4, 0.0)
    speed_mps = math.hypot(way.x_mps, way.y_mps)
    flown_s = np.minimum(flown_s, 1.2 / max(speed_mps, 0.01))
    places_m = flown_s[:, None] * (way.x_mps, way.y_mps)
    return float(gap_m(site_map.movers, places_m, BODY_M))


@pytest.mark.parametrize(
    ("movers", "least_mps", "most_mps"),
    [
        ([], 0.6, 0.6),
        ([mover(-1.5, 1.5, -0.5)], 0.6, 0.6),
        ([mover(0.9, -0.9, 0.0, 0.5)], 0.0, 0.0),  # it waits for what crosses close ahead
        # What crosses 1.6 m ahead has passed before a slower drone is there.
        ([mover(1.6, -0.9, 0.0, 0.6)], 0.11, 0.59),
        ([mover(0.9, 0.9, 0.0, 0.5)], 0.6, 0.6),  # behind what has passed it flies on
    ],
)
def test_it_flies_as_fast_as_movers_on_its_path_allow(
    movers: list[MapMover], least_mps: float, most_mps: float
) -> None:
    assert least_mps <= yielding_mps(movers, AHEAD, 0.6, BODY_M) <= most_mps


@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(-1, 1), st.floats(-1, 1), st.floats(0.12, 0.6))
def test_the_speed_that_is_flown_keeps_the_room(
    x_m: float, y_m: float, x_mps: float, y_mps: float, wanted_mps: float
) -> None:
    them = [mover(x_m, y_m, x_mps, y_mps)]
    speed_mps = yielding_mps(them, AHEAD, wanted_mps, BODY_M)
    assert 0.0 <= speed_mps <= wanted_mps
    if speed_mps > 0.0:
        places_m = np.column_stack([speed_mps * TIMES_S, np.zeros(len(TIMES_S))])
        assert gap_m(them, places_m, BODY_M) >= SPARE_M - 1e-9


def test_a_leg_leads_round_what_stands_in_the_way_for_now() -> None:
    halted = mover(0.0, 0.7)
    site_map = with_movers(halted, passed=where("left"), pose=(0.0, -0.4, math.pi / 2))
    leg = best_route(ClearanceMap(site_map, RecentObstacles()))
    assert leg is not None
    apart_m = np.hypot(*(leg.path_m - (halted.x_m, halted.y_m)).T)
    assert apart_m.min() > halted.radius_m + 0.3


def test_ground_that_is_taken_lies_along_the_course() -> None:
    points_m = outlines_m([mover(0.0, 0.0, 0.6)])
    assert points_m[:, 0].max() == pytest.approx(0.6 + 0.25)
    assert points_m[:, 0].min() == pytest.approx(-0.25)
    assert outlines_m([]).shape == (0, 2)


LOST = replace(mover(2.5, 0.0), std_m=3.3, std_mps=0.65)  # from view five seconds ago


@pytest.mark.parametrize(
    ("movers", "flies_mps", "threatens"),
    [
        ([mover(1.5, 0.0, -0.5)], 0.0, True),
        ([mover(0.5, 0.0)], 0.0, True),
        ([mover(1.5, 0.0, 0.5)], 0.0, False),
        ([mover(1.5, 1.2, -0.5)], 0.0, False),
        ([], 0.0, False),
        # What may be anywhere threatens nobody far away: a way from where it was may lead to it.
        ([LOST], 0.0, False),
        ([replace(LOST, x_m=1.2)], 0.0, True),
        # A drone that flies into the way of something runs into it.
        ([mover(0.9, -0.9, 0.0, 0.5)], 0.5, True),
        ([mover(0.9, -0.9, 0.0, 0.5)], 0.0, False),
        ([mover(0.9, -0.9, 0.0, 0.5)], -0.5, False),
    ],
)
def test_what_comes_at_the_drone_threatens_it_and_what_passes_does_not(
    movers: list[MapMover], flies_mps: float, *, threatens: bool
) -> None:
    assert runs_into(with_movers(*movers), np.array([flies_mps, 0.0]), BODY_M) == threatens


@pytest.mark.parametrize("azimuth", np.arange(0.0, 2.0 * math.pi, 0.7))
@pytest.mark.parametrize("speed_mps", [0.3, 0.5, 0.8])
def test_in_the_open_it_gets_out_of_the_way(azimuth: float, speed_mps: float) -> None:
    """Wherever it comes from, straight at the drone from two seconds away."""
    towards = np.array([math.cos(azimuth), math.sin(azimuth)])
    start_m, velocity = -towards * (0.6 + 2.0 * speed_mps), towards * speed_mps
    site_map = with_movers(mover(*map(float, start_m), *map(float, velocity)))
    assert min_room_m(WayOut(), site_map) < 0.0
    assert min_room_m(escape(site_map), site_map) > 0.05


def test_a_wall_the_edge_and_unknown_ground_are_no_way_out() -> None:
    wall = np.column_stack([np.arange(-1.5, 1.5, 0.05), np.full(60, 0.5)])
    comes = mover(1.6, -0.05, -0.6)
    assert escape(with_movers(comes)).y_mps > 0.1
    assert escape(with_movers(comes, obstacles=wall)).y_mps < -0.1
    at_edge = with_movers(mover(1.6, 1.45, -0.6), pose=(0.0, 1.5, 0.0))
    assert escape(at_edge).y_mps < -0.1
    unknown = with_movers(mover(1.6, -0.65, -0.6), known=where("left"), pose=(0.0, -0.6, 0.0))
    assert escape(unknown).y_mps <= 0.0


def test_ground_that_was_never_seen_is_no_way_out() -> None:
    """The map counts it as free, because the drone is near."""
    shown = with_movers(mover(-1.2, 0.0, x_mps=0.6))
    unseen = np.where(shown.places_m()[..., 0] >= -0.3, -np.inf, shown.seen_s)
    assert escape(shown) != WayOut()
    assert escape(replace(shown, seen_s=unseen)) == WayOut()


def test_it_can_stop_before_what_stands_and_shut_in_it_stays() -> None:
    """In a dead end it gives way at the lower speed, from which it stops before the wall."""
    line = np.arange(-1.5, 1.5, 0.05)
    sides = [np.column_stack([np.full(60, side), line]) for side in (-0.5, 0.5)]
    walls = np.vstack([*sides, np.column_stack([line, np.full(60, 1.4)])])
    site_map = with_movers(mover(0.0, -1.4, 0.0, 0.6), obstacles=walls)
    assert escape(site_map).y_mps == pytest.approx(0.3)
    way = escape(with_movers(mover(1.6, 0.0, -0.6), obstacles=0.39 * RING))
    assert math.hypot(way.x_mps, way.y_mps) == 0.0


def test_a_way_that_has_become_blocked_is_left() -> None:
    wall = np.column_stack([np.arange(-1.5, 1.5, 0.05), np.full(60, 0.42)])
    site_map = with_movers(mover(-0.159, 0.948, -0.431, -0.717), obstacles=wall)
    way = escape(site_map, WayOut(y_mps=0.6))
    assert way.x_mps == pytest.approx(0.6)


def test_ground_where_something_moved_is_not_flown_over_unseen() -> None:
    """It may come back; where nobody has looked since, no leg leads there."""
    lane = np.column_stack([np.arange(-2.0, 2.0, 0.1), np.full(40, 1.2)])
    crossed = drawn_map(passed=where("left") | where("near"))
    assert best_route(ClearanceMap(crossed, RecentObstacles())) is not None
    leg = best_route(ClearanceMap(replace(crossed, lanes_m=lane), RecentObstacles()))
    assert leg is None or leg.path_m[:, 1].max() < 1.2 - 0.6


def test_it_does_not_change_its_mind_for_a_little_more_room() -> None:
    head_on = with_movers(mover(1.6, 0.02, -0.5))
    for side in (-1.0, 1.0):
        assert side * escape(head_on, WayOut(y_mps=0.6 * side)).y_mps > 0.0
