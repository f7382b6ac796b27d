"""Places as tree files write them, the frames that they are in, and areas."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.worlds.tables import cases
from uav_bt.errors import ValueRangeError
from uav_bt.testing.world import drawn_map
from uav_bt.types import Pose2D
from uav_bt.types.area import Area
from uav_bt.types.place import Place, PlaceFrame, parse_places
from uav_bt.types.place_frames import Goal, Unresolved, lab_to_start, resolve, start_place
from uav_bt.types.site_map import MapMark, MapObject, SiteMap

CASES = cases("values")


@pytest.mark.parametrize(("text", "given"), CASES["places"])
def test_a_place_of_a_text(text: str, given: dict[str, Any]) -> None:
    frame = PlaceFrame(given["frame"])
    assert Place.parse(text) == Place(**{**given, "frame": frame})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        *CASES["refused_places"],
        *((text, "such as start:2,0 ") for text in ("object:3,1", "object:" + 5000 * "9")),
        ("start:1,0@" + 400 * "9", "a heading in degrees"),
    ],
)
def test_other_texts_are_refused_with_an_example(text: str, words: str) -> None:
    with pytest.raises(ValueRangeError, match=words):
        Place.parse(text)


def test_a_list_keeps_its_order() -> None:
    places = parse_places("start:1,0; mark ;lab:0.5,0.5@180;")
    assert [place.frame.value for place in places] == ["start", "mark", "lab"]
    with pytest.raises(ValueRangeError, match="empty list"):
        parse_places(" ; ")


@given(
    frame=st.sampled_from(["start", "body", "lab"]),
    x_cm=st.integers(-99_999, 99_999),
    y_cm=st.integers(-99_999, 99_999),
    heading_deg=st.none() | st.integers(-179, 179),
)
def test_places_survive_as_text(frame: str, x_cm: int, y_cm: int, heading_deg: int | None) -> None:
    place = Place(
        frame=PlaceFrame(frame),
        x_m=x_cm / 100,
        y_m=y_cm / 100,
        heading_rad=None if heading_deg is None else math.radians(heading_deg),
    )
    again = Place.parse(str(place))
    assert (again.x_m, again.y_m) == pytest.approx((place.x_m, place.y_m))
    assert (again.heading_rad is None) == (place.heading_rad is None)
    if again.heading_rad is not None and place.heading_rad is not None:
        assert again.heading_rad == pytest.approx(place.heading_rad)


# --- frames ---------------------------------------------------------------------------------------

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
def test_what_is_not_on_the_map_is_unresolved(text: str, mark: Pose2D | None, reason: str) -> None:
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


# --- areas ----------------------------------------------------------------------------------------

SQUARE = ((-1.0, -2.0), (3.0, -2.0), (3.0, 2.0), (-1.0, 2.0))
CORNER = ((0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (1.0, 1.0), (1.0, 4.0), (0.0, 4.0))  # an L


@pytest.mark.parametrize(("at_m", "margin_m"), CASES["margins"])
def test_the_margin_is_the_distance_to_the_edge(at_m: tuple[float, float], margin_m: float) -> None:
    assert Area((SQUARE,)).margin_m(*at_m) == pytest.approx(margin_m)
    assert Area((SQUARE[::-1],)).margin_m(*at_m) == pytest.approx(margin_m)


def test_a_concave_area_has_its_notch_outside() -> None:
    area = Area((CORNER,))
    assert area.margin_m(2.0, 2.0) == pytest.approx(-1.0)
    assert area.margin_m(0.5, 3.0) == pytest.approx(0.5)


def test_of_two_areas_both_hold() -> None:
    area = Area((SQUARE, CORNER))
    assert area.margin_m(-0.5, 0.0) < 0.0
    assert area.margin_m(3.5, 0.5) < 0.0
    assert area.margin_m(2.0, 0.5) == pytest.approx(0.5)


@pytest.mark.parametrize(("polygons", "words"), CASES["refused_areas"])
def test_what_is_no_polygon_is_refused(
    polygons: tuple[tuple[tuple[float, float], ...], ...], words: str
) -> None:
    with pytest.raises(ValueRangeError, match=words):
        Area(polygons)
