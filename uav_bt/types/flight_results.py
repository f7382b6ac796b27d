"""Results of a flight for its user: events, photographs, and the objects of the map."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Final

from uav_bt.types.pose import Pose2D
from uav_bt.types.site_map import MapObject

FRAME_OF_RESULTS: Final = "start"
"""Frame of the positions in results: origin and x axis of the take-off pose, y to its right."""


class EventKind(enum.StrEnum):
    """The kinds of events of a flight."""

    INFO = "info"  # a leaf's message
    WARNING = "warning"  # the same, of greater weight
    PHASE = "phase"  # another phase of the mission began
    FAILED = "failed"  # a running branch of the tree failed
    OVERRIDE = "override"  # the arbiter overrides the tree
    OVERRIDE_OVER = "override over"
    PILOT = "pilot"  # a person took over
    PILOT_OVER = "pilot over"
    PHOTO = "photo"  # a photograph was stored
    NO_PHOTO = "no photo"  # a photograph could not be stored
    LANDED = "landed"
    ENDED = "ended"  # the tree succeeded or failed


@dataclass(frozen=True, kw_only=True)
class FlightEvent:
    """An event of a flight."""

    time_s: float  # since the take-off command
    kind: EventKind
    text: str
    node: str = ""  # path of the node; empty if the event has none

    def __str__(self) -> str:
        """Return time, kind and text in one line."""
        return f"{self.time_s:.1f} s  {self.kind}: {self.text}"


@dataclass(frozen=True, kw_only=True)
class ReportedPose:
    """Position and heading of the drone as results state them, in `FRAME_OF_RESULTS`."""

    x_m: float
    y_m: float
    heading_deg: float  # clockwise, 0 to 360


@dataclass(frozen=True, kw_only=True)
class Photo:
    """A photograph that a mission stored.

    Attributes:
        label: Text of the mission.
        file: Name of the image in the flight's folder. None: the drone has no images.
        class_map: Name of the PNG of class ids. None: no class map was made from this frame.
        time_s: Time of the capture since the take-off command.
        pose: Pose of the drone. None: unknown.
        height_m: Height of the drone above the ground plane.
        gimbal_pitch_deg: 0 level, negative down.
        camera_file: Name of the file with the photograph of the drone's own camera, which is
            fetched after the landing. None: the camera took none.
        camera_media: Identifier of this photograph on the drone's memory card. None: the same.
    """

    label: str
    file: str | None
    class_map: str | None
    time_s: float
    pose: ReportedPose | None
    height_m: float
    gimbal_pitch_deg: float
    camera_file: str | None = None
    camera_media: str | None = None


@dataclass(frozen=True, kw_only=True)
class FoundObject:
    """An object of the site map at the end of a flight.

    Attributes:
        id: Number of the object in the map, as in the place `object:ID`.
        class_name: Its class.
        x_m: Position of the middle of its base, in `FRAME_OF_RESULTS`.
        y_m: The same.
        size_m: Seen length of the longer side of its base.
        width_m: Seen length of the shorter side.
        heading_deg: Direction of the longer side, clockwise, 0 to 180.
        std_m: One standard deviation of the position.
    """

    id: int
    class_name: str
    x_m: float
    y_m: float
    size_m: float
    width_m: float
    heading_deg: float
    std_m: float


def reported_pose(pose: Pose2D, start: Pose2D) -> ReportedPose:
    """Return a pose of the map's frame as results state it.

    Args:
        pose: In the frame of the site map.
        start: Take-off pose in the same frame.
    """
    forward_m, right_m = start.to_body(pose.x_m, pose.y_m)
    return ReportedPose(
        x_m=round(forward_m, 3),
        y_m=round(right_m, 3),
        heading_deg=round(math.degrees(pose.yaw_rad - start.yaw_rad) % 360.0, 1) % 360.0,
    )


def found_object(seen: MapObject, class_name: str, start: Pose2D) -> FoundObject:
    """Return an object of the map as results state it.

    Args:
        seen: Object of the site map.
        class_name: Name of its class.
        start: Take-off pose in the map's frame.
    """
    pose = reported_pose(Pose2D(x_m=seen.x_m, y_m=seen.y_m, yaw_rad=seen.yaw_rad), start)
    return FoundObject(
        id=seen.id,
        class_name=class_name,
        x_m=pose.x_m,
        y_m=pose.y_m,
        size_m=round(seen.size_m, 3),
        width_m=round(seen.width_m, 3),
        heading_deg=round(pose.heading_deg % 180.0, 1),
        std_m=round(seen.std_m, 3),
    )
