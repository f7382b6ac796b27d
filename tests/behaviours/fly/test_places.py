"""GoTo, Face, MoveBy and ClimbTo on drawn maps."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from behaviours.fly.go_to import GoTo
from behaviours.fly.move_by import MoveBy
from behaviours.fly.places import Face
from behaviours.fly.take_off import ClimbTo
from tests.behaviours.path.drawn_maps import mover
from tests.perception.marks.mark_views import tag_mark
from tests.worlds.leaves import ended, step, velocity
from tests.worlds.values import corridor, fix
from uav_bt.board import CORRIDOR, FLIGHT_HEIGHT, FLIGHT_PITCH, MARK, PHASE
from uav_bt.errors import InputError
from uav_bt.testing import LeafBench
from uav_bt.testing.world import drawn_map, live
from uav_bt.tree import Status
from uav_bt.types import GimbalTo, NearObstacles, Pose2D, Velocity
from uav_bt.types.area import Area
from uav_bt.types.site_map import MapMark, MapObject, SiteMap


def on(
    x_m: float = 0.0, y_m: float = 0.0, yaw_rad: float = 0.0, *, wall_m: float | None = None
) -> SiteMap:
    """Return ground of 4 x 4 m with the drone on it, and maybe a wall across at some x."""
    walls = [] if wall_m is None else [((wall_m, -2.0), (wall_m, 2.0))]
    return drawn_map(pose=(x_m, y_m, yaw_rad), walls=walls)


X_M, Y_M = np.indices((61, 61)) * 0.1 - 3.0


def test_it_flies_ahead_to_a_place_ahead() -> None:
    facing_y = Pose2D(x_m=1.0, y_m=0.0, yaw_rad=math.pi / 2)
    for to, site_map in (
        ("start:1.5,0", on()),
        # The drone took off at (1, 0) of the map, facing its y: the place is at (1, 1.5).
        ("start:1.5,0", replace(on(yaw_rad=1.0), start=facing_y)),
        # As near as the ground is known: what lies further on was not seen yet.
        ("start:1.9,0", drawn_map(known=X_M < 1.0)),
    ):
        bench = LeafBench(GoTo, to=to)
        assert live(bench, site_map=site_map) is Status.RUNNING
        assert velocity(bench).forward_mps > 0.2
        assert bench.board[PHASE] == "go to"


def test_the_last_step_ends_at_the_place_and_then_it_is_there() -> None:
    bench = LeafBench(GoTo, to="start:1.5,0")
    live(bench, site_map=on(1.2, 0.1))
    assert (step(bench).forward_m, step(bench).right_m) == pytest.approx((0.3, -0.1))
    assert live(bench, site_map=on(1.5, 0.0), movement=ended(bench)) is Status.SUCCESS


def test_body_counts_from_where_the_leaf_began() -> None:
    bench = LeafBench(GoTo, to="body:0.5,0")
    live(bench, site_map=on(1.0))
    assert velocity(bench).forward_mps > 0.0
    assert live(bench, site_map=on(1.49), seconds=0.3) is Status.SUCCESS


def test_where_no_way_is_known_it_looks_around_and_fails_after_a_time() -> None:
    bench = LeafBench(GoTo, to="start:1.5,0", blocked_s=3.0)
    statuses, turns = [], []
    for _ in range(12):
        statuses.append(live(bench, site_map=on(wall_m=0.8), seconds=0.3))
        turns.append(bench.proposed)
    assert set(statuses[:9]) == {Status.RUNNING}
    assert isinstance(turns[8], Velocity)
    assert turns[8].yaw_rate_radps > 0.3
    assert statuses[-1] is Status.FAILURE
    assert "no known way" in bench.leaf.feedback_message


def test_it_looks_down_at_unseen_ground_nearby() -> None:
    bench = LeafBench(GoTo, to="start:0,0.6")
    live(bench, site_map=drawn_map(known=np.hypot(X_M, Y_M - 0.6) > 0.3))
    assert velocity(bench).forward_mps == 0.0
    assert velocity(bench).yaw_rate_radps > 0.3
    assert bench.pointed == GimbalTo(pitch_rad=math.radians(-55))


def test_a_place_that_cannot_be_reached_fails_with_its_reason() -> None:
    for place, reason in (
        ("start:2.7,0", "beyond the edge"),
        ("start:1.55,0", "no room at the place: 0.05 m to an obstacle, 0.30 m needed"),
        ("object:3", "no object 3"),
        ("mark", "not seen"),
    ):
        assert reason in failed(place, on(wall_m=1.6))


def failed(place: str, site_map: SiteMap, *, free_m: float = math.inf) -> str:
    """Return why GoTo fails at a place; the corridor is free for a distance."""
    bench, status = LeafBench(GoTo, to=place, blocked_s=1.0, gives_way="false"), Status.RUNNING
    while status is Status.RUNNING:
        bench.board[CORRIDOR] = corridor(free_m, captured_s=bench.clock.now() + 0.3)
        status = live(bench, site_map=site_map, seconds=0.3)
    assert status is Status.FAILURE
    return str(bench.leaf.feedback_message)


def test_the_reason_names_the_object_beside_the_place_or_in_the_way() -> None:
    box = MapObject(
        id=3, class_id=5, x_m=1.2, y_m=0.0, size_m=0.4, width_m=0.4, std_m=0.05, seen_s=1.0
    )
    name = f"{on().classes.names[5]} (object:3)"
    # Only the side that faces the start was seen, and the drone is as near as it gets.
    beside = replace(on(1.75, 0.0), objects=(box,), obstacles_m=np.array([(1.0, 0.0)]))
    assert f"at the place: 0.21 m to {name}, 0.30 m needed" in failed("start:1.61,0", beside)
    assert f"at the place: 0.10 m to {name}, 0.30 m needed" in failed("start:1.5,0", beside)
    assert failed("start:-1.5,0", beside) == "no progress, 4.2 m left"
    wall = [((0.8, -2.0), (0.8, -0.2)), ((0.8, 0.2), (0.8, 2.0))]
    gap = failed("start:1.6,0", drawn_map(walls=wall))
    assert "no known way is wide enough: at start:0.8,0 0.20 m to an obstacle, 0.30 m" in gap
    assert "an obstacle is in between, at start:0.8" in failed("start:1.6,0", on(wall_m=0.8))
    strip = failed("start:1.6,0", drawn_map(known=(X_M < -0.6) | (X_M > 1.0), pose=(-1.2, 0, 0)))
    assert "was never seen" in strip
    assert failed("start:1.6,0", drawn_map(known=X_M < 0.3)) == "the place was never seen"
    blocked = failed("start:1.6,0", on(), free_m=0.2)
    assert blocked == "0.20 m to something that the map does not have"


def test_it_waits_for_a_map() -> None:
    bench = LeafBench(GoTo, to="start:1,0", blocked_s=2.0)
    assert live(bench) is Status.RUNNING
    assert bench.proposed is None
    assert [live(bench, seconds=0.5) for _ in range(5)][-1] is Status.FAILURE
    assert "no map" in bench.leaf.feedback_message


def test_progress_counts_not_time() -> None:
    bench = LeafBench(GoTo, to="start:1.9,0", blocked_s=1.0)
    for tick in range(12):
        assert live(bench, site_map=on(-1.5 + 0.2 * tick), seconds=0.6) is Status.RUNNING


def test_the_time_of_giving_way_does_not_count() -> None:
    for leaf, ports in (
        (GoTo, {"to": "start:1.9,0", "blocked_s": 2.0}),
        (Face, {"at": "180", "give_up_s": 2.0}),
    ):
        bench = LeafBench(leaf, **ports)
        for tick in range(40):
            near = replace(on(), movers=(mover(0.8, 0.0),) if tick > 2 else ())
            assert live(bench, site_map=near, seconds=0.2) is Status.RUNNING
        assert bench.leaf.feedback_message == "gives way"
        walled = on(wall_m=0.5)
        ticks = 0
        while live(bench, site_map=walled, seconds=0.2) is Status.RUNNING:
            ticks += 1
        assert 4 <= ticks <= 12


def test_a_heading_is_turned_to_at_the_place() -> None:
    bench = LeafBench(GoTo, to="start:0,0@90")
    live(bench, site_map=on())
    assert velocity(bench).yaw_rate_radps > 0.3
    assert live(bench, site_map=on(yaw_rad=math.radians(89)), seconds=0.3) is Status.SUCCESS


def test_a_height_becomes_the_height_of_the_flight() -> None:
    bench = LeafBench(GoTo, to="start:0,0,1.2")
    live(bench, site_map=on())
    assert bench.board[FLIGHT_HEIGHT] == 1.2
    assert step(bench).down_m == pytest.approx(0.3)
    assert live(bench, site_map=on(), height_m=1.2, movement=ended(bench)) is Status.SUCCESS


def test_a_place_of_the_drawing_counts_from_a_tag_once_it_was_seen() -> None:
    bench = LeafBench(GoTo, to="lab:1,0")
    bench.provide(mark=tag_mark(), mark_pose=ORIGIN)
    assert live(bench, site_map=on()) is Status.FAILURE
    assert "the landing mark and its heading were not seen yet" in bench.leaf.feedback_message
    # The tag's upper edge is to the left of the drone, and the drawing's x ahead of it.
    mark = MapMark(x_m=0.5, y_m=0.0, std_m=0.1, seen_s=1.0, yaw_rad=math.radians(-90))
    assert live(bench, site_map=replace(on(), mark=mark)) is Status.RUNNING
    assert velocity(bench).forward_mps > 0.2


ORIGIN = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)
YARD = Area((((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)),))


def test_a_place_that_is_nowhere_is_refused_before_the_take_off() -> None:
    for to, place, message in (
        ("lab:1,0", {}, "take-off pose"),
        ("lab:1,0", {"mark_pose": ORIGIN}, "a helipad shows no heading"),
        ("start:1.5,0", {"area": YARD}, r"lies 0\.5 m outside"),
    ):
        bench = LeafBench(GoTo, to=to)
        bench.provide(**place)
        with pytest.raises(InputError, match=message):
            live(bench, site_map=on())


def test_a_place_that_turns_out_to_lie_outside_fails() -> None:
    mark = MapMark(x_m=0.0, y_m=1.5, std_m=0.1, seen_s=1.0)
    bench = LeafBench(GoTo, to="mark")
    bench.provide(area=YARD)
    assert live(bench, site_map=replace(on(), mark=mark)) is Status.FAILURE
    assert "outside the mission's area" in bench.leaf.feedback_message


@pytest.mark.parametrize(
    ("to", "site_map", "reason"),
    [("mark@90", None, "heading"), ("mark", replace(on(0.9), contradicted_s=2.0), "outside")],
)
def test_beside_a_mark_without_a_map_heading_and_area_still_count(
    to: str, site_map: SiteMap | None, reason: str
) -> None:
    bench = LeafBench(GoTo, to=to, arrive_m=0.5, blocked_s=1.0)
    bench.provide(area=YARD)
    statuses = set()
    for _ in range(6):
        bench.board[MARK] = fix(bench.clock.now() + 0.3, 0.3, 0.0)
        statuses.add(live(bench, site_map=site_map, seconds=0.3))
    assert statuses - {Status.RUNNING} == {Status.FAILURE}
    assert reason in bench.leaf.feedback_message


def test_before_an_obstacle_of_unknown_range_depth_stops_the_flight_to_the_mark() -> None:
    """The narrow way to the mark crosses assumed obstacles, until depth shows one there."""
    ahead = NearObstacles(
        unplaced_rad=np.radians(range(-25, 26)),
        assumed_m=np.stack(np.meshgrid([0.5, 0.6], np.linspace(-2.0, 2.0, 41)), -1).reshape(-1, 2),
    )
    mark = MapMark(x_m=1.1, y_m=0.0, std_m=0.1, seen_s=1.0)
    bench = LeafBench(GoTo, to="mark", arrive_m=0.5)
    speeds_mps = []
    for free_m in (2.0, 0.3):
        bench.board[CORRIDOR] = corridor(free_m, captured_s=bench.clock.now() + 0.3)
        live(bench, site_map=replace(on(), mark=mark, near=ahead), seconds=0.3)
        speeds_mps.append(velocity(bench).forward_mps)
    assert speeds_mps[0] > 0.2
    assert speeds_mps[1] == 0.0


def test_before_it_flies_around_a_corner_to_the_mark_it_looks_there_once() -> None:
    """On the curve the inner side of the gap would stay out of view."""
    bench, mark = LeafBench(GoTo, to="mark"), MapMark(x_m=1.4, y_m=1.2, std_m=0.1, seen_s=1.0)
    walls = [((0.5, 0.4), (-2.0, 0.4)), ((1.1, 0.4), (2.0, 0.4))]
    for yaw_rad, turns in ((0.0, True), (0.8, False), (0.0, False)):
        drawn = drawn_map(walls=walls, pose=(0.2, -0.2, yaw_rad))
        live(bench, site_map=replace(drawn, mark=mark), yaw_rad=yaw_rad)
        assert (velocity(bench).forward_mps == 0.0) == turns
        assert ("looks ahead" in bench.leaf.feedback_message) == turns


def test_a_port_states_the_pitch_of_the_camera() -> None:
    bench = LeafBench(GoTo, to="start:1.5,0", gimbal_deg=-50.0)
    live(bench, site_map=on())
    assert bench.pointed == GimbalTo(pitch_rad=math.radians(-50))


@pytest.mark.parametrize("place", ["2,0", "start:a,0", ""])
def test_other_texts_are_refused_where_the_tree_is_made(place: str) -> None:
    with pytest.raises(InputError, match="expected a place"):
        LeafBench(GoTo, to=place)


def test_it_turns_to_the_place() -> None:
    for at, right in (("90", True), ("-90", False), ("mark", True), ("object:2", False)):
        box = MapObject(class_id=4, x_m=0.0, y_m=-1.0, size_m=0.4, std_m=0.1, seen_s=1.0, id=2)
        mark = MapMark(x_m=0.0, y_m=1.0, std_m=0.1, seen_s=1.0)
        bench = LeafBench(Face, at=at)
        live(bench, site_map=replace(on(), objects=(box,), mark=mark))
        assert (velocity(bench).yaw_rate_radps > 0.3) == right
        assert abs(velocity(bench).yaw_rate_radps) > 0.3


@pytest.mark.parametrize("at", ["nan", "inf", "-Infinity"])
def test_a_heading_is_a_finite_number(at: str) -> None:
    with pytest.raises(InputError, match=f"expected a heading in degrees, or a place, got '{at}'"):
        LeafBench(Face, at=at)


def test_it_faces_the_place_for_a_moment_and_gives_up_when_it_is_kept_from_turning() -> None:
    bench = LeafBench(Face, at="0")
    assert live(bench, site_map=on()) is Status.RUNNING
    assert [live(bench, site_map=on(), seconds=0.2) for _ in range(2)][-1] is Status.SUCCESS
    bench = LeafBench(Face, at="180", give_up_s=1.0)
    assert [live(bench, site_map=on(), seconds=0.4) for _ in range(4)][-1] is Status.FAILURE


def test_it_moves_where_the_map_shows_free_ground() -> None:
    bench = LeafBench(MoveBy, right_m=0.5)
    live(bench, site_map=on())
    assert (step(bench).forward_m, step(bench).right_m) == (0.0, 0.5)
    assert live(bench, site_map=on(0.0, 0.5), movement=ended(bench)) is Status.SUCCESS


def test_it_does_not_move_towards_a_wall_and_stops_for_one_that_appears() -> None:
    bench = LeafBench(MoveBy, forward_m=0.7)
    assert live(bench, site_map=on(wall_m=0.9)) is Status.FAILURE
    assert bench.proposed is None
    for residual_m, status in ((0.0, Status.RUNNING), (0.03, Status.FAILURE)):
        unsure = replace(on(wall_m=1.1), residual_m=residual_m)
        assert live(LeafBench(MoveBy, forward_m=0.7), site_map=unsure) is status
    bench = LeafBench(MoveBy, forward_m=1.0)
    assert live(bench, site_map=on()) is Status.RUNNING
    assert live(bench, site_map=on(0.2, wall_m=1.2), seconds=0.3) is Status.FAILURE


def test_it_looks_down_once_where_the_ground_ahead_was_not_seen() -> None:
    unseen, seen = drawn_map(known=np.hypot(X_M - 1.5, Y_M) < 0.8), on()
    bench = LeafBench(MoveBy, forward_m=1.0)
    bench.board[FLIGHT_PITCH] = math.radians(-30)
    for _ in range(20):
        assert live(bench, site_map=unseen) is Status.RUNNING
        assert bench.pointed == GimbalTo(pitch_rad=math.radians(-55))
        assert isinstance(bench.proposed, Velocity)  # it swings to both sides
    live(bench, site_map=seen)
    assert (step(bench).forward_m, step(bench).right_m) == pytest.approx((1.0, 0.0), abs=0.01)
    for moves in ({"forward_m": 1.0}, {"right_m": 1.0}):
        bench = LeafBench(MoveBy, **moves)
        answers = [live(bench, site_map=unseen) for _ in range(52)]
        assert answers.index(Status.FAILURE) == (51 if "forward_m" in moves else 0)
        assert "lower the camera (gimbal_deg of TakeOff)" in bench.notes.events[-1].text


def test_a_blocked_way_is_an_event_with_place_and_reason() -> None:
    for leaf, words in (
        (
            LeafBench(MoveBy, forward_m=1.0),
            "MoveBy: .* an obstacle is 0.0. m from it, 0.34 m are needed",
        ),
        (LeafBench(GoTo, to="object:7"), "GoTo object:7: .*"),
    ):
        assert live(leaf, site_map=on(wall_m=0.9)) is Status.FAILURE
        (event,) = leaf.notes.events
        assert event.kind == "failed"
        assert re.fullmatch(words, event.text), event.text


def test_climbs_need_no_map_and_the_flight_goes_on_at_the_new_height() -> None:
    bench = LeafBench(MoveBy, up_m=0.3)
    assert live(bench) is Status.RUNNING
    assert step(bench).down_m == -0.3
    bench = LeafBench(ClimbTo, height_m=1.8)
    live(bench)
    assert step(bench).down_m == pytest.approx(-0.3)
    assert bench.board[FLIGHT_HEIGHT] == 1.8
    assert live(bench, height_m=1.8, movement=ended(bench)) is Status.SUCCESS
