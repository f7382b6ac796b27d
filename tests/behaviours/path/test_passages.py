"""Margins of a place and of its passages, and the way out of a corner by a narrow gap."""

import math
from dataclasses import replace

import numpy as np
import pytest

from behaviours.path.margins import Margins, Passage
from behaviours.path.nearby import RecentObstacles
from behaviours.path.passages import ClearanceMaps
from benchmarks.landing_marks import corner_scene
from uav_bt.errors import ValueRangeError
from uav_bt.testing.world import drawn_map
from uav_bt.types import Clearances, LandingMark, NearObstacles, Pose2D
from uav_bt.types.site_map import SiteMap

CORNER = (-1.6, 1.4)
MARK = (0.5, -1.0)


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


def corner(gap_m: float, *, at: tuple[float, float] = CORNER) -> SiteMap:
    """Return a map whose wall leaves a corner, and a gap between the wall's end and the outside."""
    ends_m = -2.1 + gap_m
    across = [(x_m, 0.5) for x_m in np.arange(ends_m, -1.05, 0.1)]
    along = [(-1.1, y_m) for y_m in np.arange(0.5, 2.05, 0.1)]
    return drawn_map(obstacles=np.array(across + along), pose=(*at, math.pi / 2))


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
