"""Routes on drawn maps: the survey's legs, and passages of all widths."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from behaviours.path.clearance import ClearanceMap, Route
from behaviours.path.margins import Margins, Passage
from behaviours.path.nearby import RecentObstacles
from behaviours.path.passages import ClearanceMaps
from behaviours.path.survey import best_route
from benchmarks.landing_marks import corner_scene
from tests.behaviours.path.drawn_maps import CORNER, MARK, RING, corner, where
from uav_bt.errors import ValueRangeError
from uav_bt.testing.world import drawn_map
from uav_bt.types import Clearances, LandingMark, NearObstacles, Pose2D
from uav_bt.types.site_map import SiteMap

MARGINS = Margins()
PAST = replace(MARGINS, past_assumed=True)
NOTHING = np.empty((0, 2))


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


# --- margins of a place and of its passages -------------------------------------------------------


@pytest.mark.parametrize(
    ("passage", "where", "distances_m", "slow_mps"),
    [
        (Passage.ORDINARY, {}, (0.4, 0.3), 0.3),
        (Passage.TIGHT, {}, (0.34, 0.3), 0.3),
        (Passage.TIGHT, {"at_pad": True}, (0.34, 0.2), 0.3),
        (Passage.OUT, {}, (0.3, 0.3), 0.1),
        (Passage.OUT, {"shut_in": True}, (0.3, 0.2), 0.1),
        (Passage.OUT, {"at_pad": True}, (0.3, 0.2), 0.1),
        (Passage.OUT, {"at_pad": True, "shut_in": True}, (0.3, 0.2), 0.1),
    ],
)
def test_distances_from_obstacles_and_edges_and_the_slowest_speed(
    passage: Passage, where: dict[str, bool], distances_m: tuple[float, float], slow_mps: float
) -> None:
    margins = Margins().through(passage, **where)
    assert (margins.touch_m, margins.edge_m) == pytest.approx(distances_m)
    speeds_mps = margins.speed_mps(np.array([0.0, margins.touch_m, 0.6, margins.wide_m, 3.0]))
    assert np.all(np.diff(speeds_mps) >= 0.0)
    assert speeds_mps[[0, 1, -1]].tolist() == [0.1, slow_mps, 0.6]
    # Views that do not fit the map widen the ordinary passage only.
    assert (margins.by(1.0) == margins) == (passage is not Passage.ORDINARY)


@pytest.mark.parametrize(
    ("place", "ordinary_m", "tight_m", "pad_m", "out_m"),
    [
        (Clearances(), (0.4, 0.3), (0.34, 0.3), (0.34, 0.2), (0.3, 0.2)),
        (
            Clearances(obstacle_m=0.5, edge_m=0.45),
            *((0.5, 0.45), (0.44, 0.45), (0.44, 0.35), (0.4, 0.35)),
        ),
        (Clearances(obstacle_m=0.35), (0.35, 0.3), (0.29, 0.3), (0.29, 0.2), (0.25, 0.2)),
        (Clearances(edge_m=0.15), (0.4, 0.15), (0.34, 0.15), (0.34, 0.2), (0.3, 0.15)),
    ],
)
def test_a_place_shifts_the_distances_of_all_passages(
    place: Clearances,
    ordinary_m: tuple[float, float],
    tight_m: tuple[float, float],
    pad_m: tuple[float, float],
    out_m: tuple[float, float],
) -> None:
    margins = Margins().within(place)
    out = margins.through(Passage.OUT, shut_in=True)
    all_of = (margins, margins.tight(), margins.at_pad(), out)
    found_m = [(each.touch_m, each.edge_m) for each in all_of]
    assert found_m == [pytest.approx(each) for each in (ordinary_m, tight_m, pad_m, out_m)]
    assert margins.min_start_m <= margins.touch_m < margins.wide_m
    assert margins.wide_m - margins.touch_m == pytest.approx(Margins.wide_m - Margins.touch_m)


def test_unknown_cells_lanes_and_the_mark_are_those_of_the_place() -> None:
    """Half of the diagonal of 0.6 x 0.8 m is 0.5 m, and a cell is 0.1 m."""
    mark = LandingMark(length_m=0.6, width_m=0.8, height_m=0.05)
    margins = Margins().within(Clearances(unknown_m=0.3, lane_m=0.9), mark)
    assert (margins.unknown_m, margins.lane_m, margins.over_m) == pytest.approx((0.3, 0.9, 0.6))


def test_margins_that_differ_from_the_default_keep_their_difference() -> None:
    further = Margins(touch_m=0.38, edge_m=0.4)
    assert further.within(Clearances()) == further
    assert further.within(Clearances(edge_m=0.5)).edge_m == pytest.approx(0.6)


def test_speeds_in_the_wrong_order_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="in order"):
        Margins(slow_mps=1.0, fast_mps=0.5)


def maps_of(site_map: SiteMap, *, over: tuple[float, float] | None = None) -> ClearanceMaps:
    return ClearanceMaps(site_map, RecentObstacles(), Margins(), crossing=True, over=over)


@pytest.mark.parametrize("over", [None, MARK], ids=["to the place", "over the mark"])
def test_a_drone_in_a_corner_flies_out_by_the_gap_beside_the_edge(
    over: tuple[float, float] | None,
) -> None:
    """0.2 m from the edge and 0.3 m from the wall, which a route may begin with as well."""
    maps = maps_of(corner(0.5), over=over)
    assert maps[Passage.TIGHT].shut_in
    route = maps.route_to(MARK, near_m=0.15, far_m=0.15)
    assert route is not None
    assert route.margins == maps[Passage.OUT].margins
    assert maps_of(corner(0.4), over=over).route_to(MARK, near_m=0.15, far_m=0.15) is None


@pytest.mark.parametrize("x_m", [-1.9, -1.8, -1.7, -1.6, -1.5])
def test_a_drone_that_sways_in_the_corner_sees_the_same_way_out(x_m: float) -> None:
    assert maps_of(corner(0.5, at=(x_m, 1.0))).route_to(MARK, near_m=0.15, far_m=0.15) is not None


def test_nobody_flies_into_the_corner_by_that_gap() -> None:
    assert maps_of(corner(0.5, at=MARK)).route_to(CORNER, near_m=0.15, far_m=0.15) is None


@pytest.mark.parametrize(("half_m", "touch_m"), [(0.4, 0.4), (0.3, 0.3), (0.2, None)])
def test_a_gap_is_flown_by_the_widest_passage_that_fits(
    half_m: float, touch_m: float | None
) -> None:
    """From one half of the ground to the other: nobody is shut in."""
    y_m = np.arange(-2.2, 2.25, 0.1)
    y_m = y_m[np.abs(y_m) > half_m - 0.01]
    maps = maps_of(drawn_map(obstacles=np.column_stack([0.0 * y_m, y_m]), pose=(1.0, 0.0, 0.0)))
    found = maps.route_to((-1.0, 0.0), near_m=0.15, far_m=0.15)
    assert (found and round(found.margins.touch_m, 2)) == touch_m


def leads_over(mark: tuple[float, float], site_map: SiteMap) -> bool:
    way_out = maps_of(site_map, over=mark)[Passage.OUT]
    return way_out.route_to(mark, near_m=0.1, far_m=0.1) is not None


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_a_gap_leads_to_a_mark_in_a_corner_behind_boxes(seed: int) -> None:
    """Scenes of the benchmark: the entrance is 0.6 m wide, and the ground 5 m by 4 m."""
    scene, walls = corner_scene(seed), []
    for box in scene["boxes"]:
        (x_m, y_m), (long_m, wide_m, _) = box["position_m"], box["size_m"]
        corners = Pose2D(x_m=x_m, y_m=y_m, yaw_rad=0.0).rectangle(long_m / 2, wide_m / 2)
        walls += list(zip(corners, np.roll(corners, -1, axis=0), strict=True))
    drawn = drawn_map(ground_m=5.0, walls=walls, pose=(*scene["take_off"]["from"], 0.0))
    site_map = replace(drawn, outside=drawn.outside | (np.abs(drawn.places_m()[..., 1]) > 2.0))
    assert leads_over(tuple(scene["helipad"]["position_m"]), site_map)


def two_walls(gap_m: float, beside_m: float = 0.0) -> SiteMap:
    ends_m = beside_m - gap_m / 2, beside_m + gap_m / 2
    walls = [((0.0, -2.0), (0.0, ends_m[0])), ((0.0, ends_m[1]), (0.0, 2.0))]
    return drawn_map(walls=walls, pose=(-0.6, 0.1, 0.0))


@pytest.mark.parametrize(("gap_m", "is_open"), [(0.6, True), (0.44, False)])
@pytest.mark.parametrize("beside_m", [0.0, 0.03, 0.05, 0.08])
def test_the_width_of_a_gap_depends_on_no_cells(
    gap_m: float, beside_m: float, *, is_open: bool
) -> None:
    assert leads_over((1.1, beside_m), two_walls(gap_m, beside_m)) == is_open


def test_a_gap_is_as_wide_as_it_was_seen_lately() -> None:
    """The map has it 16 cm narrower."""
    narrow = two_walls(0.44)
    seen = NearObstacles(points_m=two_walls(0.6).obstacles_m - (-0.6, 0.1))
    assert leads_over((1.1, 0.0), replace(narrow, near=seen))
