"""Keeping away from near obstacles, edges and movers."""

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from behaviours.fly.explore import Avoid, Explore
from behaviours.fly.keeping_away import MARGINS, GivingWay, by_the_map, push_away_mps, step_away_m
from behaviours.fly.steering import SteeringLeaf
from behaviours.path.movers import ABOVE_M, RAISED_S, raised_m
from tests.behaviours.path.drawn_maps import mover
from tests.worlds.leaves import ADVANCE, RETURN_TO_BASE, TURN_RIGHT, steering_bench, velocity
from tests.worlds.values import motion
from uav_bt.board import FLIGHT_HEIGHT, ODOMETRY, SITE_MAP
from uav_bt.testing import LeafBench
from uav_bt.testing.world import Says, drawn_map, show
from uav_bt.tree import Status
from uav_bt.types import (
    Airframe,
    BodyVelocity,
    Clearances,
    MapObject,
    MoveBy,
    NearObstacles,
    Velocity,
)
from uav_bt.types.dead_reckoning import OdometryPose
from uav_bt.types.site_map import MapMover, SiteMap

Points = Sequence[tuple[float, float]]


def around(points: Points, edges: Points = ()) -> NearObstacles:
    points_m, edges_m = (np.array(each, dtype=float).reshape(-1, 2) for each in (points, edges))
    return NearObstacles(points_m=points_m, edges_m=edges_m, captured_s=0.0)


BESIDE: Points = [(0.0, 0.3)]


@pytest.mark.parametrize(
    ("obstacles", "edge_m", "step_m"),
    [
        (around([*BESIDE, (2.0, 0.0)]), 0.3, (0.0, -0.15)),
        (None, 0.3, None),
        (around([]), 0.3, None),
        (around([(0.5, 0.0)]), 0.3, None),
        (around([*BESIDE, (0.0, -0.4)]), 0.3, None),  # to another obstacle
        # Between a box and the edge the drone stays rather than leave the ground.
        (around(BESIDE, [(0.0, -0.4)]), 0.3, None),
        (around(BESIDE, [(0.0, -0.6)]), 0.3, (0.0, -0.15)),
        (around(BESIDE, [(0.0, -0.6)]), 0.5, None),  # it ends 0.45 m before that edge
    ],
)
def test_the_step_leads_away_from_the_nearest_obstacle(
    obstacles: NearObstacles | None, edge_m: float, step_m: tuple[float, float] | None
) -> None:
    found_m = step_away_m(obstacles, edge_m)
    assert found_m == (None if step_m is None else pytest.approx(step_m))


def test_the_push_grows_with_the_intrusion_up_to_a_limit() -> None:
    pushes_mps = [-push_away_mps(around([(0.0, at_m)]))[1] for at_m in (1.0, 0.44, 0.35, 0.2)]
    assert pushes_mps[0] == 0.0
    assert pushes_mps == sorted(set(pushes_mps))
    assert pushes_mps[-1] == pytest.approx(0.2)
    _, right_mps = push_away_mps(around([(0.0, 0.4)], [(0.0, -1.0)]))
    assert right_mps == pytest.approx(-0.075)


def test_mapped_obstacles_are_kept_away_from_where_the_map_has_them() -> None:
    """Remembered on the left, where they have drifted to; the map knows them on the right.

    A map that views contradict is not used.
    """
    site_map = drawn_map(obstacles=np.array([(0.0, 0.3), (0.0, 0.35), (0.05, 0.3)]))
    seen = around([(0.0, 0.1), (0.02, 0.1), (0.0, 0.12)])
    found = by_the_map(seen, site_map)
    assert found is not None
    assert found.nearest_m == pytest.approx(0.3)
    assert push_away_mps(found)[1] < 0.0
    unmapped = by_the_map(around([(0.0, -0.3), (0.0, -0.32), (0.02, -0.3)]), drawn_map())
    assert unmapped is not None
    assert unmapped.nearest_m == pytest.approx(0.3)
    assert by_the_map(seen, replace(site_map, contradicted_s=0.5)) is seen
    assert by_the_map(seen, None) is seen
    assert by_the_map(None, site_map) is None


def test_in_a_gap_what_was_seen_lately_comes_before_the_map() -> None:
    """A single point apart from others is none."""
    mapped_m = np.array([(0.0, 0.3), (0.0, 0.35), (0.05, 0.3), (0.0, -0.42)])
    seen = around([(0.0, 0.36), (0.02, 0.36), (0.05, 0.36), (0.0, 0.2)])
    found = by_the_map(seen, replace(drawn_map(obstacles=mapped_m), near=seen), in_gap=True)
    assert found is not None
    assert sorted(found.points_m[:, 1]) == pytest.approx([-0.42, 0.36, 0.36, 0.36])


def test_in_a_gap_the_push_leads_to_its_middle() -> None:
    """However many points are on a side: fewer than three are none."""
    left_m, right_m = ([(0.05 * i, y_m) for i in range(3)] for y_m in (-0.25, 0.35))
    both = around([*left_m, *left_m, *right_m])
    assert push_away_mps(both, in_gap=True)[1] == pytest.approx(1.2 * 0.05)
    one = around([*left_m, *right_m[1:]])
    assert push_away_mps(one, in_gap=True)[1] == pytest.approx(0.1, abs=0.05)


def test_the_sides_of_an_object_that_were_never_seen_push_too() -> None:
    box = MapObject(class_id=4, x_m=0.0, y_m=0.5, size_m=0.4, width_m=0.4, std_m=0.1, seen_s=1.0)
    x_m = np.arange(-0.2, 0.25, 0.1)
    sides_m = np.vstack([np.column_stack([x_m, np.full(len(x_m), at_m)]) for at_m in (0.7, -0.4)])
    known = replace(drawn_map(obstacles=sides_m), objects=(box,))
    near = by_the_map(around([]), known)
    assert push_away_mps(near)[1] < -0.05  # away from the box's near side, 0.3 m to the right


# --- leaves give way ------------------------------------------------------------------------------

LEAVES = [Explore, Avoid, RETURN_TO_BASE]
COMES = mover(1.6, 0.0, -0.6)
CROSSES = mover(0.9, -0.9, 0.0, 0.5)


def fly(
    bench: LeafBench,
    *,
    yaw_rad: float = 0.0,
    forward_mps: float = 0.0,
    again: SiteMap | None = None,
    **shown: Any,
) -> None:
    """Show a map without movers, or the map of an earlier view, and the drone's motion; tick."""
    drawn = replace(drawn_map(pose=(0.0, 0.0, yaw_rad)), **shown)
    show(bench, site_map=drawn if again is None else None)
    if again is not None:
        bench.board.write(SITE_MAP, again)
    now_s = bench.clock.now()
    pose = OdometryPose(time_s=now_s, x_m=0.0, y_m=0.0, yaw_rad=yaw_rad)
    speed = BodyVelocity(forward_mps=forward_mps)
    bench.board[ODOMETRY] = motion(pose, velocity=speed, tracked_s=now_s)
    assert bench.tick() is Status.RUNNING


def flown(
    leaf: type[SteeringLeaf],
    *movers: MapMover,
    gives_way: bool = True,
    place: Clearances | None = None,
    **flight: float,
) -> LeafBench:
    """Return a bench whose leaf has worked for half a second, with movers from the last tick on."""
    policy = Says(TURN_RIGHT if leaf is Avoid else ADVANCE)
    bench = steering_bench(leaf, policy, gives_way=gives_way)
    bench.provide(clearances=place or Clearances())
    for step in range(5):
        fly(bench, movers=movers if step == 4 else (), **flight)
    return bench


def gives_way(bench: LeafBench) -> bool:
    return any(leaf.feedback_message == "gives way" for leaf in bench.tree.leaves())


@pytest.mark.parametrize("leaf", LEAVES)
@pytest.mark.parametrize("yaw_rad", [0.0, 2.0])
def test_it_leaves_the_way_of_what_comes(leaf: type[SteeringLeaf], yaw_rad: float) -> None:
    """Across its course mostly, wherever the nose points."""
    bench = flown(leaf, COMES, yaw_rad=yaw_rad)
    way = velocity(bench)
    assert gives_way(bench)
    (told,) = (event.text for event in bench.notes.events)
    assert re.fullmatch(r"gives way to a mover \d\.\d m away", told)
    x_mps = math.cos(yaw_rad) * way.forward_mps - math.sin(yaw_rad) * way.right_mps
    y_mps = math.sin(yaw_rad) * way.forward_mps + math.cos(yaw_rad) * way.right_mps
    assert math.hypot(x_mps, y_mps) > 0.25
    assert abs(y_mps) > 0.2
    assert x_mps < 0.3


@pytest.mark.parametrize("leaf", LEAVES)
def test_it_stops_before_it_flies_into_the_way_of_something(leaf: type[SteeringLeaf]) -> None:
    stopped = velocity(flown(leaf, CROSSES, forward_mps=0.5))
    assert (stopped.forward_mps, stopped.right_mps) == (0.0, 0.0)
    assert stopped.yaw_rate_radps < -0.3  # it watches what crosses from the left
    assert not gives_way(flown(leaf, CROSSES))


@pytest.mark.parametrize("leaf", LEAVES)
def test_what_passes_changes_nothing(leaf: type[SteeringLeaf]) -> None:
    passing = flown(leaf, mover(1.7, 1.4, -0.5), forward_mps=0.3)
    assert not gives_way(passing)
    assert passing.proposed == flown(leaf, forward_mps=0.3).proposed


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_evades_a_lost_mover_whose_base_is_below_the_view(side: float) -> None:
    """The view shows an obstacle of unknown range, and a mover was lost two seconds ago."""
    bench = steering_bench(Explore, Says(ADVANCE))
    lost = replace(mover(3.0, side), std_mps=0.6)
    hidden = NearObstacles(unplaced_rad=side * np.radians(np.arange(10.0, 30.0)))
    for step in range(30):
        near = hidden if step == 29 else NearObstacles()
        fly(bench, movers=(lost,) if step > 25 else (), near=near)
        assert gives_way(bench) == (step == 29)
    assert velocity(bench).right_mps * side < -0.2 or velocity(bench).forward_mps < -0.2


@pytest.mark.parametrize(("moved_s", "down_mps"), [(-math.inf, 0.0), (0.0, -0.25)])
@pytest.mark.parametrize("allowed", [True, False])
def test_it_stays_above_after_something_moved(
    moved_s: float, down_mps: float, *, allowed: bool
) -> None:
    bench = steering_bench(Avoid, Says(TURN_RIGHT), gives_way=allowed)
    bench.board[FLIGHT_HEIGHT] = 1.5
    for _ in range(5):
        fly(bench, moved_s=moved_s)
    assert velocity(bench).down_mps == pytest.approx(down_mps if allowed else 0.0)


def test_it_stays_above_while_a_mover_may_come_back_and_then_comes_down() -> None:
    shown = drawn_map()
    for unseen_s, above_m in [(5.0, ABOVE_M), (RAISED_S, ABOVE_M), (RAISED_S + 1.0, 0.0)]:
        assert raised_m(replace(shown, moved_s=shown.captured_s - unseen_s)) == above_m
    assert raised_m(shown) == 0.0


def test_between_two_maps_the_way_is_held_and_afterwards_the_mission_goes_on() -> None:
    """Without the port nobody gives way: the rules of the paper stay as they are."""
    assert isinstance(flown(Explore, COMES, gives_way=False).proposed, MoveBy)
    bench = flown(Explore, COMES)
    way = bench.proposed
    bench.clock.advance(0.1)
    bench.tick()
    assert bench.proposed == way
    for _ in range(6):
        fly(bench)
    assert isinstance(bench.proposed, MoveBy)


def test_a_way_is_not_flown_on_without_a_new_view() -> None:
    bench = flown(Explore, COMES)
    shown = bench.board[SITE_MAP]
    assert bench.proposed != Velocity()
    for _ in range(10):
        fly(bench, again=shown)
    assert (velocity(bench).forward_mps, velocity(bench).right_mps) == (0.0, 0.0)


def test_without_a_new_view_it_stops_for_a_mover_that_was_on_its_way() -> None:
    """The view that showed it far away is old, such as while the camera looks straight down."""
    giving_way, shown = GivingWay(MARGINS, 0.2), drawn_map()
    far = replace(shown, movers=(mover(3.2, 0.0, -0.6),))
    now_s = shown.captured_s
    assert giving_way.velocity(far, None, None, now_s=now_s) is None
    near = replace(shown, movers=(mover(1.4, 0.0, -0.6),))  # predicted, from the same view
    assert giving_way.velocity(near, None, None, now_s=now_s + 0.5) is None
    stopped = giving_way.velocity(near, None, None, now_s=now_s + 3.0)
    assert stopped is not None
    assert (stopped.forward_mps, stopped.right_mps) == (0.0, 0.0)


def test_a_way_of_an_earlier_encounter_does_not_count() -> None:
    """A mover comes from ahead and slightly from the right, where the drone once went."""
    giving_way, shown = GivingWay(MARGINS, 0.2), drawn_map()
    earlier = replace(shown, movers=(mover(1.6, -0.03, -0.6),))
    later = replace(shown, movers=(mover(1.6, 0.03, -0.6),), captured_s=shown.captured_s + 60.0)
    for site_map in (earlier, later):
        way = giving_way.velocity(site_map, None, None, now_s=site_map.captured_s)
        fresh = GivingWay(MARGINS, 0.2).velocity(site_map, None, None, now_s=site_map.captured_s)
        assert way == fresh


@pytest.mark.parametrize("radius_m", [0.2, 0.35])
def test_a_larger_airframe_gives_way_earlier(radius_m: float) -> None:
    bench = steering_bench(Explore, Says(ADVANCE), gives_way=True)
    side_m = math.sqrt(2.0) * radius_m
    bench.provide(airframe=Airframe(body_size_m=(side_m, side_m, 0.1)))
    for ahead_m, near in ((0.8, False), (0.6, True)):
        for _ in range(3):
            fly(bench, movers=(mover(ahead_m + radius_m, 0.0),))
        assert gives_way(bench) == near


def test_it_does_not_leave_the_distance_from_the_edge_that_the_place_asks_for() -> None:
    """On ground of 4 m a side no place lies 2.5 m from the edge: it stays where it is."""
    for edge_m, flies in ((0.3, True), (2.5, False)):
        way = velocity(flown(Explore, COMES, place=Clearances(edge_m=edge_m)))
        assert (math.hypot(way.forward_mps, way.right_mps) > 0.1) == flies
