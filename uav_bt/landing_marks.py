"""Landing marks as plug-ins: the interface of a finder, its input and its result.

A kind of landing mark is a class that is registered in the group `uav_bt.landing_marks`. It is made
with a `LandingMark`, whose options it checks, and it finds that mark in one view at a time:

    class Beacon:
        uses_images, shows_heading = True, False

        def __init__(self, mark: LandingMark) -> None: ...
        def find(self, view: MarkView) -> MarkSighting | None: ...
        def picture(self) -> NDArray[np.uint8] | None: ...
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from uav_bt.errors import ValueRangeError, did_you_mean
from uav_bt.types.camera import CameraModel, ClassMap, Frame
from uav_bt.types.pose import Pose2D
from uav_bt.types.sizes import LandingMark

OptionsT = TypeVar("OptionsT", bound="Options")


@dataclass(frozen=True, kw_only=True)
class MarkView:
    """Input of a finder: one frame, its camera and its class map."""

    frame: Frame  # undistorted image, gimbal pitch, and height of the camera above the ground
    camera: CameraModel  # intrinsics at any size with the image's aspect ratio
    class_map: ClassMap | None = None  # class map of the frame; None without one
    # Take-off pose relative to the body at the capture, by map and odometry: x forward, y right,
    # yaw clockwise. None where it is unknown.
    take_off: Pose2D | None = None


@dataclass(frozen=True, kw_only=True)
class MarkSighting:
    """A landing mark in one frame, from the body's centre in the heading-aligned level plane."""

    forward_m: float  # distance ahead
    right_m: float  # distance to the right
    height_m: float  # height of the mark's top above the ground
    confidence: float = 1.0  # 0 to 1
    # Heading of the drone relative to the mark, clockwise, -180 to 180; 0 if the drone looks
    # towards the mark's upper edge. None if the mark does not show it.
    heading_deg: float | None = None

    def __post_init__(self) -> None:
        values = (self.forward_m, self.right_m, self.height_m, self.heading_deg or 0.0)
        if not all(map(math.isfinite, values)) or not 0.0 <= self.confidence <= 1.0:
            expected = "must be finite and its confidence within 0 and 1"
            raise ValueRangeError(f"a sighting of a landing mark {expected}, got {self}")

    @property
    def range_m(self) -> float:
        """Horizontal distance from the body's centre to the mark's centre."""
        return math.hypot(self.forward_m, self.right_m)


@runtime_checkable
class MarkFinder(Protocol):
    """Finder of one landing mark, registered in `uav_bt.landing_marks` by its class."""

    # Whether `find` needs the image of a frame; otherwise the class map is enough
    uses_images: bool
    shows_heading: bool  # whether sightings have a heading

    def find(self, view: MarkView) -> MarkSighting | None:
        """Return the mark in a view; None if it is not there."""

    def picture(self) -> NDArray[np.uint8] | None:
        """Return the mark's top, (H, W, 3) RGB, upright; None if the simulator draws the mark."""


class Options(BaseModel):
    """The options of a kind that has none; base of the forms of others."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


def read_options(mark: LandingMark, form: type[OptionsT]) -> OptionsT:
    """Return the options of a landing mark; raises ValueRangeError for the first wrong one."""
    try:
        return form.model_validate(dict(mark.options))
    except ValidationError as error:
        wrong = error.errors(include_url=False)[0]
    steps, kind = [str(step) for step in wrong["loc"]], f"landing mark '{mark.kind}'"
    where, message = ".".join(steps), wrong["msg"].removeprefix("Input ")
    if wrong["type"] == "extra_forbidden":
        schema = form.model_json_schema()
        if len(steps) > 1:  # a form has one nested form at most
            [schema] = schema["$defs"].values()
        known = list(schema["properties"])
        raise ValueRangeError(
            f"{kind} has no option '{where}'{did_you_mean(steps[-1], known)} "
            f"(options: {', '.join(known) or 'none'})"
        )
    if wrong["type"] == "missing":
        raise ValueRangeError(f"{kind} needs the option {where}")
    if wrong["type"] == "value_error":
        raise ValueRangeError(f"{kind} {wrong['ctx']['error']}")
    raise ValueRangeError(f"option {where} of {kind} {message}, got {wrong['input']!r}")
