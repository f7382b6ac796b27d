"""The survey planner on drawn maps: its choice of legs, and their clearance."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from behaviours.path.clearance import ClearanceMap, Route
from behaviours.path.margins import Margins
from behaviours.path.nearby import RecentObstacles
from behaviours.path.survey import best_route
from uav_bt.errors import ValueRangeError
from uav_bt.testing.world import drawn_map
from uav_bt.types.site_map import MapObject, SiteMap

MARGINS = Margins()
NOTHING = np.empty((0, 2))


def where(condition: str) -> NDArray[np.bool_]:
    x, y = np.indices((61, 61)) * 0.1 - 3.0
    return {"left": y < 0.0, "right": y > 0.0, "near": np.hypot(x, y) < 1.2}[condition]


def leg(
    site_map: SiteMap, assumed: NDArray[np.float64] = NOTHING, margins: Margins = MARGINS
) -> Route | None:
    return best_route(ClearanceMap(site_map, RecentObstacles(assumed_m=assumed), margins))


def test_the_leg_leads_to_the_half_that_was_not_passed() -> None:
    found = leg(drawn_map(passed=where("left")))
    assert found is not None
    assert found.path_m[-1][1] > 0.3
    assert found.new_m2 > 0.5


def test_a_leg_straight_ahead_is_better_than_the_same_behind() -> None:
    ahead = leg(drawn_map(pose=(0.0, 0.0, math.pi / 2)))
    assert ahead is not None
    assert ahead.path_m[-1][1] > 0.0


def test_all_passed_is_no_leg() -> None:
    assert leg(drawn_map(passed=np.ones((61, 61), dtype=bool))) is None


def test_ground_behind_a_wall_is_not_flown_to() -> None:
    wall = np.column_stack([np.arange(-2.2, 2.3, 0.05), np.full(90, 0.8)])
    found = leg(drawn_map(passed=where("left") | where("near"), obstacles=wall))
    assert found is None or found.path_m[:, 1].max() < 0.8 - MARGINS.touch_m + 0.1


def test_unknown_ground_is_not_flown_over() -> None:
    known = where("near")
    found = leg(drawn_map(known=known))
    assert found is not None
    assert np.hypot(*found.path_m.T).max() < 1.3


RING = np.array([(math.cos(a), math.sin(a)) for a in np.linspace(0, 2 * math.pi, 120)])


def test_where_an_obstacle_is_assumed_no_leg_leads() -> None:
    """Nobody has seen the ground there: it is only known to be free at the flight height."""
    drawn = drawn_map(passed=where("near"))
    apart_m = np.hypot(*np.moveaxis(drawn.places_m(), -1, 0))
    unseen = (apart_m > 0.8) & (apart_m < 1.8)
    ring = replace(drawn, seen_s=np.where(unseen, -np.inf, drawn.seen_s))
    beyond = leg(ring)
    assert beyond is not None
    assert np.hypot(*beyond.path_m.T).max() > 1.2
    found = leg(ring, 1.3 * RING)
    assert found is None or np.hypot(*found.path_m.T).max() < 1.2


def test_over_open_ground_legs_may_lead_past_what_is_assumed() -> None:
    """Slower; among things that move they do not."""
    seen = drawn_map(passed=where("near"))
    past = replace(MARGINS, past_assumed=True)
    found = leg(seen, RING, past)
    assert found is not None
    assert np.hypot(*found.path_m.T).max() > 1.2
    assert found.clear_m.min() == pytest.approx(MARGINS.touch_m)
    moving = replace(seen, lanes_m=np.array([[-1.9, -1.9]]))
    for closed in (leg(seen, RING), leg(moving, RING, past)):
        assert closed is None or np.hypot(*closed.path_m.T).max() < 1.0


def test_an_obstacle_assumed_beside_one_of_the_map_is_that_one() -> None:
    """The map is displaced by as much: both ways past the wall's end stay closed."""
    wall = np.column_stack([np.arange(-2.2, 0.0, 0.05), np.full(44, 0.8)])
    passed = where("left") | where("near")
    beside = np.array([[x, 0.8] for x in np.arange(0.2, 0.4, 0.1)])
    before, after = (
        leg(
            drawn_map(passed=passed, obstacles=wall, pose=(0.6, 0.0, 0.0)),
            assumed,
            replace(MARGINS, past_assumed=True),
        )
        for assumed in (NOTHING, beside)
    )
    assert before is not None
    assert after is not None
    nearest_m = [
        min(math.dist(place, box) for place in found.path_m for box in beside)
        for found in (before, after)
    ]
    assert nearest_m[0] < nearest_m[1]
    assert nearest_m[1] >= MARGINS.doubt_m - 0.05


@given(st.lists(st.tuples(st.floats(-2, 2), st.floats(-2, 2)), max_size=25))
def test_no_leg_passes_an_obstacle_or_the_edge_too_near(places: list[tuple[float, float]]) -> None:
    obstacles = np.array([p for p in places if math.hypot(*p) > 0.7], dtype=float).reshape(-1, 2)
    found = leg(drawn_map(obstacles=obstacles))
    if found is None:
        return
    away = found.path_m[np.hypot(*found.path_m.T) > 0.7]
    assert np.abs(away).max(initial=0.0) <= 2.0 - MARGINS.edge_m + 0.1
    for place in obstacles:
        assert np.hypot(*(away - place).T).min(initial=9.0) >= MARGINS.touch_m - 0.1


def test_a_drone_too_near_to_a_box_flies_on_as_near_and_away() -> None:
    """Between two rows of boxes 0.35 m to both sides it is not shut in for ever."""
    rows = [(x, y) for x in np.arange(-0.4, 0.45, 0.05) for y in (-0.35, 0.35)]
    found = leg(drawn_map(obstacles=np.array(rows)))
    assert found is not None
    assert np.hypot(*found.path_m[-1]) > 0.8


def test_a_leg_ends_where_there_is_room() -> None:
    """A drone in a gap flies out of it: it does not creep in, a step with each decision."""
    gap = [(x, y) for x in np.arange(-0.2, 2.0, 0.05) for y in (-0.33, 0.33)]
    x, y = np.indices((61, 61)) * 0.1 - 3.0
    ahead = (np.abs(y) < 0.3) & (x > 0.55) & (x < 1.2)
    site_map = drawn_map(obstacles=np.array(gap), passed=~ahead)
    assert best_route(ClearanceMap(site_map, RecentObstacles())) is None
    out_of_it = best_route(ClearanceMap(replace(site_map, passed=where("near")), RecentObstacles()))
    assert out_of_it is not None
    assert out_of_it.clear_m[-1] >= MARGINS.touch_m


def test_objects_are_solid() -> None:
    """A box of which one side was seen is kept away from on all sides."""
    site_map = drawn_map()
    box = MapObject(
        class_id=4,
        x_m=1.0,
        y_m=0.0,
        size_m=0.5,
        width_m=0.4,
        yaw_rad=math.radians(90.0),
        std_m=0.05,
        seen_s=1.0,
    )
    clearance = ClearanceMap(replace(site_map, objects=(box,)), RecentObstacles())
    for x_m, y_m, distance_m in ((0.0, 0.0, 0.8), (2.0, 0.0, 0.8), (1.0, 1.0, 0.75), (1.0, 0, 0)):
        assert clearance.obstacle_m[site_map.cell_of(x_m, y_m)] == pytest.approx(
            distance_m, abs=0.11
        )


def test_walls_all_round_shut_in() -> None:
    ring = [(0.8 * math.cos(a), 0.8 * math.sin(a)) for a in np.linspace(0, 2 * math.pi, 120)]
    assert ClearanceMap(drawn_map(obstacles=np.array(ring)), RecentObstacles()).shut_in
    assert not ClearanceMap(drawn_map(), RecentObstacles()).shut_in


def test_the_speed_rises_with_the_room() -> None:
    speeds = MARGINS.speed_mps(np.array([0.0, MARGINS.touch_m, 0.6, MARGINS.wide_m, 3.0]))
    assert np.all(np.diff(speeds) >= 0.0)
    assert list(speeds[:2]) == [0.1, MARGINS.slow_mps]
    assert speeds[-1] == MARGINS.fast_mps


def test_a_drone_off_the_grid_plans_from_its_edge() -> None:
    leg(drawn_map(pose=(50.0, -50.0, 0.0)))


def test_speeds_in_the_wrong_order_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="in order"):
        Margins(slow_mps=1.0, fast_mps=0.5)


def test_an_edge_seen_lately_counts_beside_the_maps() -> None:
    """The map's edge may be off by drift; recent points are correct relative to the drone."""
    site_map = drawn_map()
    ahead_m = np.array([[0.6, y_m] for y_m in np.arange(-0.5, 0.55, 0.05)])
    row, column = site_map.cell_of(0.5, 0.0)
    assert ClearanceMap(site_map, RecentObstacles()).open[row, column]
    assert not ClearanceMap(site_map, RecentObstacles(edges_m=ahead_m)).open[row, column]


def test_views_that_are_off_the_map_widen_the_distances() -> None:
    sure, unsure = MARGINS.by(0.016), MARGINS.by(0.026)
    assert sure == MARGINS
    assert unsure.touch_m == pytest.approx(MARGINS.touch_m + 0.01 * 8.0)
    assert unsure.edge_m == pytest.approx(MARGINS.edge_m + 0.01 * 8.0)
    assert MARGINS.by(1.0).touch_m == pytest.approx(MARGINS.touch_m + MARGINS.unsure_m)
    site_map = drawn_map(obstacles=np.array([[1.0, 0.0]]))
    open_now = ClearanceMap(site_map, RecentObstacles()).open.sum()
    assert ClearanceMap(replace(site_map, residual_m=0.05), RecentObstacles()).open.sum() < open_now


def test_the_unknown_is_kept_away_from_on_all_sides_alike() -> None:
    x, y = np.indices((61, 61)) * 0.1 - 3.0
    hidden = (np.abs(x) < 0.25) & (np.abs(y) < 0.25)
    clearance = ClearanceMap(
        drawn_map(known=~hidden, pose=(-1.5, -1.5, 0.0)), RecentObstacles(), MARGINS
    )
    assert np.array_equal(clearance.clear_m, clearance.clear_m[::-1])
    assert np.array_equal(clearance.clear_m, clearance.clear_m[:, ::-1])
    assert clearance.clear_m[30, 30 + 6] == pytest.approx(0.4 + MARGINS.touch_m - MARGINS.unknown_m)


def test_a_single_cell_that_no_ray_has_met_is_not_unknown() -> None:
    x, y = np.indices((61, 61)) * 0.1 - 3.0
    speck = (np.abs(x) < 0.05) & (np.abs(y) < 0.05)
    clearance = ClearanceMap(
        drawn_map(known=~speck, pose=(-1.5, -1.5, 0.0)), RecentObstacles(), MARGINS
    )
    assert clearance.clear_m[30, 31] > MARGINS.wide_m
