"""The section `mark` of lab and site files: kind, size, height and options of the landing mark."""

from __future__ import annotations

import math
from typing import Annotated, Any

from pydantic import Field
from typing_extensions import TypedDict

from uav_bt.errors import ValueRangeError
from uav_bt.lab.flight_keys import Position, Yaw
from uav_bt.plugins import make_mark_finder
from uav_bt.types.landing_mark import MAX_HEIGHT_M, LandingMark
from uav_bt.types.pose import Pose2D

_Side = Annotated[float, Field(gt=0.0, le=5.0)]


class MarkSection(TypedDict, total=False):
    """Form of the section. A lab file states size and height; a site file keeps the lab's.

    Attributes:
        kind: Registered name of the plug-in that finds the mark.
        options: Settings of the plug-in.
        size_m: Length and width of the top, metres.
        height_m: Height of the top above the ground, metres; 0 for a mat.
        position_m: Where the mark stands in the lab's drawing, metres.
        yaw_deg: Direction of the mark's x axis there, counter-clockwise; its upper edge is towards
            its y axis.
    """

    kind: Annotated[str, Field(description="Kind of landing mark; default: helipad.")]
    options: Annotated[dict[str, Any], Field(description="Settings of that kind.")]
    position_m: Position
    yaw_deg: Yaw
    size_m: tuple[_Side, _Side]
    height_m: Annotated[float, Field(ge=0.0, lt=MAX_HEIGHT_M)]


def mark_of_section(section: MarkSection, usual: LandingMark | None = None) -> LandingMark:
    """Return the landing mark of a section, whose missing keys are those of the usual mark.

    Options belong to a kind, so another kind begins without options.
    """
    lacking = [key for key in ("size_m", "height_m") if usual is None and key not in section]
    if lacking:
        raise ValueRangeError(f"lacks the key '{lacking[0]}'")
    usual = usual or LandingMark(length_m=1.0, width_m=1.0, height_m=0.0)
    kind = section.get("kind", usual.kind)
    length_m, width_m = section.get("size_m", usual.top_m)
    mark = LandingMark(
        kind=kind,
        length_m=length_m,
        width_m=width_m,
        height_m=section.get("height_m", usual.height_m),
        options=section.get("options", usual.options if usual.kind == kind else {}),
    )
    if "kind" in section or "options" in section:
        make_mark_finder(mark)  # refuses wrong options
    return mark


def mark_pose(section: MarkSection | None) -> Pose2D | None:
    """Return the pose of the mark in the drawing, yaw counter-clockwise; None if not stated."""
    if section is None or "position_m" not in section:
        if section is not None and "yaw_deg" in section:
            raise ValueRangeError("yaw_deg needs position_m: where the mark stands in the drawing")
        return None
    x_m, y_m = section["position_m"]
    return Pose2D(x_m=x_m, y_m=y_m, yaw_rad=math.radians(section.get("yaw_deg", 0.0)))
