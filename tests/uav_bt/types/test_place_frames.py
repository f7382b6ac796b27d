"""Conversion between the frames of places."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.worlds.tables import cases
from uav_bt.testing.world import drawn_map
from uav_bt.types import Pose2D
from uav_bt.types.place import Place
from uav_bt.types.place_frames import Goal, Unresolved, lab_to_start, resolve, start_place
from uav_bt.types.site_map import MapMark, MapObject, SiteMap

CASES = cases("values")

START = Pose2D(x_m=0.5, y_m=-0.25, yaw_rad=math.radians(90))  # faces the map's y


def the_map() -> SiteMap:
    box = MapObject(class_id=4, x_m=1.0, y_m=2.0, size_m=0.4, std_m=0.1, seen_s=1.0, id=3)
    return replace(
        drawn_map(pose=(0.0, 0.0, 0.0)),
        start=START,
        pose=Pose2D(x_m=1.0, y_m=1.0, yaw_rad=math.radians(180)),
        objects=(box,),
    )


def goal_of(text: str, site_map: SiteMap | None = None, take_off: Pose2D | None = None) -> Goal:
    found = resolve(Place.parse(text), site_map or the_map(), take_off)
    assert isinstance(found, Goal)
    return found


MARK = MapMark(x_m=0.25, y_m=0.5, std_m=0.1, seen_s=1.0)


@pytest.mark.parametrize(("text", "goal"), CASES["goals"])
def test_places_in_the_frame_of_the_map(text: str, goal: tuple[float, float, float | None]) -> None:
    found = goal_of(text, replace(the_map(), mark=MARK))
    assert (found.x_m, found.y_m) == pytest.approx(goal[:2])
    assert (found.yaw_rad is None) == (goal[2] is None)
    if found.yaw_rad is not None and goal[2] is not None:
        turn_rad = math.remainder(found.yaw_rad - math.radians(goal[2]), math.tau)
        assert turn_rad == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "mark", "reason"),
    [
        ("mark", None, "not seen"),
        ("object:7", None, "no object 7"),
        ("lab:0,0", None, "take-off pose"),
        ("lab:1,0", Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0), "mark and its heading were not seen"),
    ],
)
def test_what_the_map_does_not_know_is_unresolved(
    text: str, mark: Pose2D | None, reason: str
) -> None:
    found = resolve(Place.parse(text), the_map(), None, mark)
    assert isinstance(found, Unresolved)
    assert reason in found.reason
    if mark is not None:  # a mark without a heading does not help
        assert resolve(Place.parse(text), replace(the_map(), mark=MARK), None, mark) == found


def test_take_off_pose_and_mark_lead_to_the_same_place() -> None:
    """The take-off pose faces along x of a drawing in which the mark is turned by 30 degrees."""
    take_off, drawn = (
        Pose2D(x_m=-1.0, y_m=0.5, yaw_rad=math.radians(20)),
        Pose2D(x_m=1.5, y_m=1.0, yaw_rad=math.radians(30)),
    )
    at = lab_to_start(replace(drawn, yaw_rad=drawn.yaw_rad + math.pi / 2), take_off)
    x_m, y_m = START.to_world(at.x_m, at.y_m)
    mark = MapMark(x_m=x_m, y_m=y_m, std_m=0.1, seen_s=1.0, yaw_rad=START.yaw_rad + at.yaw_rad)
    seen, place = replace(the_map(), mark=mark), Place.parse("lab:0.7,-1.2@-40")
    one, other = resolve(place, seen, take_off), resolve(place, seen, None, drawn)
    assert isinstance(one, Goal)
    assert isinstance(other, Goal)
    assert (one.x_m, one.y_m) == pytest.approx((other.x_m, other.y_m))
    assert one.yaw_rad == pytest.approx(other.yaw_rad)


def test_the_drawing_is_counter_clockwise() -> None:
    # The take-off at (-1, 0) of the drawing looks along its x: 1 m up is 1 m to the left.
    take_off = Pose2D(x_m=-1.0, y_m=0.0, yaw_rad=0.0)
    assert lab_to_start(Pose2D(x_m=1.0, y_m=1.0, yaw_rad=0.0), take_off) == Pose2D(
        x_m=2.0, y_m=-1.0, yaw_rad=0.0
    )
    goal = goal_of("lab:1,1@90", take_off=take_off)
    assert (goal.x_m, goal.y_m) == pytest.approx(START.to_world(2.0, -1.0))
    assert goal.yaw_rad == pytest.approx(START.yaw_rad - math.pi / 2)


NUMBERS = st.floats(-5.0, 5.0)
POSES = st.builds(Pose2D, x_m=NUMBERS, y_m=NUMBERS, yaw_rad=st.floats(-3.1, 3.1))


@given(start=POSES, pose=POSES)
def test_a_place_of_the_map_is_found_again_by_its_text(start: Pose2D, pose: Pose2D) -> None:
    site_map = replace(the_map(), start=start, pose=pose)
    place = start_place(site_map, pose.x_m, pose.y_m)
    goal = goal_of(str(place), site_map)
    assert (goal.x_m, goal.y_m) == pytest.approx((pose.x_m, pose.y_m), abs=0.01)
