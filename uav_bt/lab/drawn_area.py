"""Whether the area of a lab contains the take-off pose and the landing mark."""

from __future__ import annotations

from uav_bt.errors import ValueRangeError
from uav_bt.types.area import Area
from uav_bt.types.place import SEPARATOR, PlaceFrame, area_corners
from uav_bt.types.place_frames import from_start, lab_to_start
from uav_bt.types.pose import Pose2D

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
            return (
                f"the landing mark at lab:{mark.x_m:g},{mark.y_m:g} lies outside the area {shown}"
            )
    return None
