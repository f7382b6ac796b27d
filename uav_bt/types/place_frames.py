"""Conversion between the frames of places and the map's frame, and the area of a lab.

| frame | origin                | axes                                  | heading           |
|-------|-----------------------|---------------------------------------|-------------------|
| map   | of the odometry       | x along compass yaw 0, y to its right | clockwise         |
| start | take-off pose         | x ahead, y to the right               | clockwise         |
| body  | the drone now         | x ahead, y to the right               | clockwise         |
| lab   | middle of the drawing | x to the right, y up                  | counter-clockwise |

Users write the last three. The map's frame stays inside the program.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from uav_bt.errors import ValueRangeError
from uav_bt.types.area import Area
from uav_bt.types.place import SEPARATOR, Place, PlaceFrame, area_corners
from uav_bt.types.pose import Pose2D, wrap_angle
from uav_bt.types.site_map import SiteMap


@dataclass(frozen=True, kw_only=True)
class Goal:
    """A place on the map; None: the height of the flight, any heading."""

    x_m: float  # in the map's frame
    y_m: float
    height_m: float | None = None  # above the ground
    yaw_rad: float | None = None  # in the map's frame


@dataclass(frozen=True, kw_only=True)
class Unresolved:
    """A place that the map does not know yet; the reason is for status line and report."""

    reason: str


def resolve(
    place: Place,
    site_map: SiteMap,
    take_off: Pose2D | None = None,
    mark: Pose2D | None = None,
) -> Goal | Unresolved:
    """Return a place in the map's frame.

    A place of the lab's drawing counts from the take-off pose there, yaw counter-clockwise; if that
    is unknown, from the landing mark, whose upper edge is towards the y axis of its pose there.
    """
    origin = _origin(place, site_map, take_off, mark)
    if isinstance(origin, Unresolved):
        return origin
    here, drawn = origin
    offset = Pose2D(x_m=place.x_m, y_m=place.y_m, yaw_rad=place.heading_rad or 0.0)
    at = here.pose_to_world(offset if drawn is None else lab_to_start(offset, drawn))
    yaw_rad = None if place.heading_rad is None else wrap_angle(at.yaw_rad)
    return Goal(x_m=at.x_m, y_m=at.y_m, height_m=place.height_m, yaw_rad=yaw_rad)


def _origin(
    place: Place, site_map: SiteMap, take_off: Pose2D | None, mark: Pose2D | None
) -> tuple[Pose2D, Pose2D | None] | Unresolved:
    """Return the pose that a place counts from on the map; and in the drawing, if it counts there.

    Headings at the mark and at objects count from the take-off heading.
    """
    seen, here = site_map.mark, site_map.start
    drawn = take_off if place.frame is PlaceFrame.LAB else None
    if place.frame is PlaceFrame.BODY:
        here = site_map.pose
    elif place.frame is PlaceFrame.MARK:
        if seen is None:
            return Unresolved(reason="the landing mark was not seen yet")
        here = replace(here, x_m=seen.x_m, y_m=seen.y_m)
    elif place.frame is PlaceFrame.OBJECT:
        found = site_map.object(place.object_id)
        if found is None:
            return Unresolved(reason=f"the map has no object {place.object_id}")
        here = replace(here, x_m=found.x_m, y_m=found.y_m)
    elif place.frame is PlaceFrame.LAB and take_off is None:
        if mark is None:
            return Unresolved(
                reason="the take-off pose in the lab's drawing is unknown: state `take_off`"
            )
        if seen is None or seen.yaw_rad is None:
            return Unresolved(reason="the landing mark and its heading were not seen yet")
        here = Pose2D(x_m=seen.x_m, y_m=seen.y_m, yaw_rad=seen.yaw_rad)
        drawn = replace(mark, yaw_rad=mark.yaw_rad + math.pi / 2)
    return here, drawn


def from_start(place: Place, take_off: Pose2D | None = None) -> tuple[float, float] | None:
    """Return a place ahead of the take-off pose and to its right, metres.

    None for a place that is known in flight only, or that needs an unknown take-off pose.
    """
    if place.frame is PlaceFrame.START:
        return place.x_m, place.y_m
    if place.frame is not PlaceFrame.LAB or take_off is None:
        return None
    there = lab_to_start(Pose2D(x_m=place.x_m, y_m=place.y_m, yaw_rad=0.0), take_off)
    return there.x_m, there.y_m


def start_place(
    site_map: SiteMap, x_m: float, y_m: float, *, yaw_rad: float | None = None
) -> Place:
    """Return a place of the map relative to the take-off pose, as users write it."""
    forward_m, right_m = site_map.start.to_body(x_m, y_m)
    heading_rad = None if yaw_rad is None else wrap_angle(yaw_rad - site_map.start.yaw_rad)
    return Place(frame=PlaceFrame.START, x_m=forward_m, y_m=right_m, heading_rad=heading_rad)


def lab_to_start(place: Pose2D, take_off: Pose2D) -> Pose2D:
    """Return a pose of the lab's drawing (yaw counter-clockwise) from the take-off pose."""
    forward_m, left_m = take_off.to_body(place.x_m, place.y_m)
    yaw_rad = wrap_angle(take_off.yaw_rad - place.yaw_rad)
    return Pose2D(x_m=forward_m, y_m=-left_m, yaw_rad=yaw_rad)


_UNTURNED = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)


def check_area(text: str) -> None:
    """Refuse an area that no take-off pose makes right.

    Whether corners in the lab's drawing contain the take-off pose depends on the scene, and is
    checked when the flight is put together; so are corners in both frames.
    """
    if len({corner.frame for corner in area_corners(text)}) > 1:
        return
    problem = area_problem(text, take_off=None, mark=None)
    if problem is not None:
        raise ValueRangeError(problem)


def area_problem(text: str, *, take_off: Pose2D | None, mark: Pose2D | None) -> str | None:
    """Return the fault of the area of a lab; None without one.

    Take-off pose and mark are those in the lab's drawing; None if unknown.
    """
    corners = area_corners(text)
    shown = f"{SEPARATOR} ".join(map(str, corners))
    frames = {corner.frame for corner in corners}
    if take_off is None and len(frames) > 1:
        return "corners in both frames need the take-off pose in the drawing: add 'take_off'"
    # Without a take-off pose the corners keep their frame, which is one for all of them.
    origin = _UNTURNED if take_off is None else take_off
    try:
        area = Area((tuple(filter(None, (from_start(each, origin) for each in corners))),))
    except ValueRangeError as error:
        return str(error)
    knows_start = take_off is not None or frames == {PlaceFrame.START}
    if knows_start and area.margin_m(0.0, 0.0) <= 0.0:
        return f"the take-off pose lies outside the area {shown}"
    if mark is not None and (take_off is not None or frames == {PlaceFrame.LAB}):
        there = lab_to_start(mark, origin)
        if area.margin_m(there.x_m, there.y_m) < 0.0:
            at = f"lab:{mark.x_m:g},{mark.y_m:g}"
            return f"the landing mark at {at} lies outside the area {shown}"
    return None
