"""Results of a flight for its user: events, photographs, and the objects of the map."""

from __future__ import annotations

import enum
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from uav_bt.types.pose import Pose2D
from uav_bt.types.site_map import MapObject

# Frame of the positions in results: origin and x axis of the take-off pose, y to its right.
FRAME_OF_RESULTS: Final = "start"


class EventKind(enum.StrEnum):
    """The kinds of events of a flight."""

    INFO = "info"  # a leaf's message
    WARNING = "warning"  # the same, of greater weight
    PHASE = "phase"  # another phase of the mission began
    FAILED = "failed"  # a branch of the tree failed, and the mission takes another course
    EXPECTED = "expected"  # a running branch failed, as the tree is written to go on
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


_UNSHOWN: Final = {EventKind.PHASE, EventKind.PHOTO, EventKind.LANDED, EventKind.EXPECTED}


def shown_events(events: Sequence[FlightEvent]) -> Iterator[str]:
    """Yield what changed the course of a mission; what repeats comes once, with its number."""
    shown = [event for event in events if event.kind not in _UNSHOWN]
    times = Counter((event.kind, event.text) for event in shown)
    for event in shown:
        if count := times.pop((event.kind, event.text), 0):
            yield f"{event} ({count} times)" if count > 1 else str(event)


@dataclass(frozen=True, kw_only=True)
class ReportedPose:
    """Position and heading of the drone as results state them, in `FRAME_OF_RESULTS`."""

    x_m: float
    y_m: float
    heading_deg: float  # clockwise, 0 to 360


@dataclass(frozen=True, kw_only=True)
class Photo:
    """A photograph that a mission stored."""

    label: str  # text of the mission
    file: str | None  # name of the image in the flight's folder; None: the drone has no images
    class_map: str | None  # name of the PNG of class ids; None: this frame has no class map
    time_s: float  # of the capture, since the take-off command
    pose: ReportedPose | None
    height_m: float  # above the ground plane
    raised_m: float = 0.0  # how much of it the drone flew above its flight height for a mover
    gimbal_pitch_deg: float  # 0 level, negative down
    # The photograph of the drone's own camera: its file, fetched after the landing, and its
    # identifier on the drone's memory card. None: the camera took none.
    camera_file: str | None = None
    camera_media: str | None = None


@dataclass(frozen=True, kw_only=True)
class FoundObject:
    """An object of the site map at the end of a flight, in `FRAME_OF_RESULTS`."""

    id: int  # as in the place `object:ID`
    class_name: str
    x_m: float  # of the middle of its base
    y_m: float
    size_m: float  # seen length of the longer side of its base
    width_m: float  # of the shorter side
    height_m: float | None  # above the ground; None: no view showed where it ends
    heading_deg: float  # direction of the longer side, clockwise, 0 to 180
    std_m: float  # one standard deviation of the position


def reported_pose(pose: Pose2D, start: Pose2D) -> ReportedPose:
    """Return a pose as results state it; both are in the site map's frame."""
    forward_m, right_m = start.to_body(pose.x_m, pose.y_m)
    return ReportedPose(
        x_m=round(forward_m, 3),
        y_m=round(right_m, 3),
        heading_deg=round(math.degrees(pose.yaw_rad - start.yaw_rad) % 360.0, 1) % 360.0,
    )


def found_object(seen: MapObject, class_name: str, start: Pose2D) -> FoundObject:
    """Return an object of the map as results state it; `start` is the take-off pose in the map."""
    pose = reported_pose(Pose2D(x_m=seen.x_m, y_m=seen.y_m, yaw_rad=seen.yaw_rad), start)
    return FoundObject(
        id=seen.id,
        class_name=class_name,
        x_m=pose.x_m,
        y_m=pose.y_m,
        size_m=round(seen.size_m, 3),
        width_m=round(seen.width_m, 3),
        height_m=None if seen.height_m is None else round(seen.height_m, 3),
        heading_deg=round(pose.heading_deg % 180.0, 1),
        std_m=round(seen.std_m, 3),
    )
