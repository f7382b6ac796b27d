"""The survey planner on drawn maps: its choice of routes, and their clearance."""

import math
from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from behaviours.path.clearance import ClearanceMap, Route
from behaviours.path.margins import Margins
from behaviours.path.nearby import RecentObstacles
from behaviours.path.survey import best_route
from uav_bt.testing.world import drawn_map
from uav_bt.types.site_map import SiteMap

MARGINS = Margins()
PAST = replace(MARGINS, past_assumed=True)
NOTHING = np.empty((0, 2))
RING = np.array([(math.cos(a), math.sin(a)) for a in np.linspace(0, 2 * math.pi, 120)])


def where(condition: str) -> NDArray[np.bool_]:
    x, y = np.indices((61, 61)) * 0.1 - 3.0
    return {"left": y < 0.0, "right": y > 0.0, "near": np.hypot(x, y) < 1.2}[condition]


def leg(
    site_map: SiteMap, assumed: NDArray[np.float64] = NOTHING, margins: Margins = MARGINS
) -> Route | None:
    return best_route(ClearanceMap(site_map, RecentObstacles(assumed_m=assumed), margins))


def furthest_m(found: Route | None) -> float:
    """Return how far a route leads from the origin; 0 without one."""
    return 0.0 if found is None else float(np.hypot(*found.path_m.T).max())


def test_a_leg_leads_to_what_was_not_passed_and_rather_ahead_than_behind() -> None:
    found = leg(drawn_map(passed=where("left")))
    assert found is not None
    assert found.path_m[-1][1] > 0.3
    assert found.new_m2 > 0.5
    ahead = leg(drawn_map(pose=(0.0, 0.0, math.pi / 2)))
    assert ahead is not None
    assert ahead.path_m[-1][1] > 0.0
    assert leg(drawn_map(passed=np.ones((61, 61), dtype=bool))) is None
    leg(drawn_map(pose=(50.0, -50.0, 0.0)))  # a drone off the grid plans from its edge


def test_ground_that_is_unknown_or_behind_a_wall_is_not_flown_to() -> None:
    assert 0.0 < furthest_m(leg(drawn_map(known=where("near")))) < 1.3
    wall = np.column_stack([np.arange(-2.2, 2.3, 0.05), np.full(90, 0.8)])
    found = leg(drawn_map(passed=where("left") | where("near"), obstacles=wall))
    assert found is None or found.path_m[:, 1].max() < 0.8 - MARGINS.touch_m + 0.1


def test_where_an_obstacle_is_assumed_no_leg_leads() -> None:
    """Nobody has seen the ground there: it is only known to be free at the flight height."""
    drawn = drawn_map(passed=where("near"))
    apart_m = np.hypot(*np.moveaxis(drawn.places_m(), -1, 0))
    unseen = (apart_m > 0.8) & (apart_m < 1.8)
    ring = replace(drawn, seen_s=np.where(unseen, -np.inf, drawn.seen_s))
    assert furthest_m(leg(ring)) > 1.2
    assert furthest_m(leg(ring, 1.3 * RING)) < 1.2


def test_over_open_ground_legs_may_lead_past_what_is_assumed() -> None:
    """Slower; among things that move they do not."""
    seen = drawn_map(passed=where("near"))
    found = leg(seen, RING, PAST)
    assert found is not None
    assert furthest_m(found) > 1.2
    assert found.clear_m.min() == MARGINS.touch_m
    moving = replace(seen, lanes_m=np.array([[-1.9, -1.9]]))
    for closed in (leg(seen, RING), leg(moving, RING, PAST)):
        assert furthest_m(closed) < 1.0


def test_an_obstacle_assumed_beside_one_of_the_map_is_that_one() -> None:
    """The map is displaced by as much: both ways past the wall's end stay closed."""
    wall = np.column_stack([np.arange(-2.2, 0.0, 0.05), np.full(44, 0.8)])
    passed = where("left") | where("near")
    drawn = drawn_map(passed=passed, obstacles=wall, pose=(0.6, 0.0, 0.0))
    beside = np.array([[x, 0.8] for x in np.arange(0.2, 0.4, 0.1)])
    nearest_m = []
    for assumed in (NOTHING, beside):
        found = leg(drawn, assumed, PAST)
        assert found is not None
        nearest_m.append(np.linalg.norm(found.path_m[:, None] - beside, axis=-1).min())
    assert nearest_m[0] < nearest_m[1]
    assert nearest_m[1] >= MARGINS.doubt_m - 0.05


@given(st.lists(st.tuples(st.floats(-2, 2), st.floats(-2, 2)), max_size=25))
def test_no_leg_passes_an_obstacle_or_the_edge_too_near(places: list[tuple[float, float]]) -> None:
    obstacles = np.array([p for p in places if math.hypot(*p) > 0.7], dtype=float).reshape(-1, 2)
    found = leg(drawn_map(obstacles=obstacles))
    if found is None:
        return
    away = found.path_m[np.hypot(*found.path_m.T) > 0.7]  # near the drone there may be less room
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
    assert leg(site_map) is None
    out_of_it = leg(replace(site_map, passed=where("near")))
    assert out_of_it is not None
    assert out_of_it.clear_m[-1] >= MARGINS.touch_m
