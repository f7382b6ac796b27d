"""How a place is flown: the keys that lab files and site files have in common.

    # All of it may be left out.
    flight_height_m: 1.2           # above the ground; replaces `height_m` of the tree's take-off
    take_off_surface_m: 0.4        # height of the take-off surface above the ground
    camera: anafi-720p.yaml        # of `uav-bt lab calibrate`
    network: {model: hall.onnx, classes: hall-classes.yaml, depth: any}
    ground: [carpet, background]   # which of the classes it may fly over and scale depth by
    limits: {speed_mps: 0.6, climb_mps: 0.5, yaw_rate_radps: 1.2, ceiling_m: 2.0}
    take_off: {position_m: [0.5, -1.2], yaw_deg: 90}   # in the lab's drawing, for lab:1,2
    area: "start:-1,-2; start:4,-2; start:4,2; start:-1,2"   # that every mission stays in
    margins: {obstacle_m: 0.4, edge_m: 0.3, unknown_m: 0.35, lane_m: 0.7}   # that routes keep
    battery: {take_off: 0.4, critical: 0.15}
    link: {take_off: 0.4}
    video: {latency_s: 0.2}
    ports: {http: 8080, rtsp: 8554}
    return_home: off               # the drone's automatic return, during a flight
    mark: {kind: apriltag, size_m: [0.5, 0.5], height_m: 0.2, options: {id: 7, size_m: 0.3}}

Files that it names lie beside it, unless their path is absolute.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NotRequired

from pydantic import AfterValidator, Field, ValidationInfo, WithJsonSchema
from typing_extensions import TypedDict

from uav_bt.errors import ValueRangeError
from uav_bt.files import did_you_mean_file
from uav_bt.plugins import make_mark_finder
from uav_bt.settings import brief_repr
from uav_bt.types.place_frames import check_area
from uav_bt.types.pose import Pose2D
from uav_bt.types.sizes import MAX_HEIGHT_M, Clearances, LandingMark


def _beside(value: Path, info: ValidationInfo) -> Path:
    context: Any = info.context
    file: Path = context["folder"] / value
    if not file.is_file():
        raise ValueError(f"there is no file {file}{did_you_mean_file(file)}")
    return file


def _network(value: str, info: ValidationInfo) -> str:
    return str(_beside(Path(value), info)) if value.endswith(".onnx") else value


def _onnx(value: Path, info: ValidationInfo) -> Path:
    if value.suffix != ".onnx":
        raise ValueError(f"expected an ONNX file, got {value}")
    return _beside(value, info)


def _area(value: str) -> str:
    check_area(value)
    return value


Coordinate = Annotated[float, Field(ge=-1000.0, le=1000.0)]  # metres, or an angle in degrees
Position = Annotated[
    tuple[Coordinate, Coordinate], Field(description="x to the right and y up the drawing, metres")
]
_YAW = "counter-clockwise from the drawing's x axis, degrees"
Yaw = Annotated[Coordinate, Field(description=_YAW)]
_Number = Annotated[float, Field(ge=0.0, le=1000.0)]
_Height = Annotated[float, Field(gt=0.0, le=1000.0)]
_Side = Annotated[float, Field(gt=0.0, le=5.0)]
_Share = Annotated[float, Field(ge=0.0, le=1.0)]
_Port = Annotated[int, Field(ge=1, le=65_535)]
_FileBeside = Annotated[Path, AfterValidator(_beside)]
# YAML 1.1 reads `on` and `off` as truth values, and editors read them as texts.
_Switch = Annotated[bool, WithJsonSchema({"enum": [True, False, "on", "off"]})]


class NetworkKeys(TypedDict, total=False):
    """The networks: files or names of shipped ones."""

    model: Annotated[str, AfterValidator(_network)]
    """Segmentation network."""
    classes: _FileBeside
    """Class mapping of the segmentation network."""
    depth: Annotated[str, AfterValidator(_network)]
    """Depth network."""


class TeacherKeys(TypedDict):
    """A network that labels the images for `uav-bt lab train`, and its class mapping."""

    model: Annotated[Path, AfterValidator(_onnx)]
    classes: NotRequired[_FileBeside]


class LimitKeys(TypedDict, total=False):
    """Limits that no movement exceeds."""

    speed_mps: _Number
    climb_mps: _Number
    yaw_rate_radps: _Number
    ceiling_m: _Number


class BatteryKeys(TypedDict, total=False):
    """Charge of the battery, 0 to 1: least for a take-off, and below which the drone lands."""

    take_off: _Share
    critical: _Share


class TakeOffKeys(TypedDict, total=False):
    """The take-off pose in the lab's drawing. Without a position it is that of the mark."""

    position_m: Position
    yaw_deg: Yaw


class LinkKeys(TypedDict, total=False):
    """Least quality of the radio link for a take-off, 0 to 1."""

    take_off: _Share


class VideoKeys(TypedDict, total=False):
    """Least time from exposure to arrival of a frame, seconds."""

    latency_s: _Number


class PortKeys(TypedDict, total=False):
    """Ports of the drone's web interface and of its video."""

    http: _Port
    rtsp: _Port


class MarkSection(TypedDict, total=False):
    """The landing mark. A lab file states size and height; a site file keeps the lab's."""

    kind: str
    """Kind of landing mark, a registered plug-in; default: helipad."""
    options: dict[str, Any]
    """Settings of that kind."""
    position_m: Position
    yaw_deg: Yaw
    """Direction of the mark's x axis; its upper edge is towards its y axis."""
    size_m: tuple[_Side, _Side]
    """Length and width of the top, metres."""
    height_m: Annotated[float, Field(ge=0.0, lt=MAX_HEIGHT_M)]
    """Height of the top above the ground, metres; 0 for a mat."""


@dataclass(frozen=True, kw_only=True)
class FlightKeys:
    """How a place is flown, as a file states it. None and empty: not stated.

    Paths of files lead from the working directory, or are absolute.
    """

    flight_height_m: _Height | None = None
    """Flight height above the ground, instead of the tree's."""
    take_off_surface_m: _Number = 0.0
    """Height of the take-off surface above the ground."""
    take_off: TakeOffKeys | None = None
    """Take-off pose in the lab's drawing, for places such as lab:1,2"""
    camera: _FileBeside | None = None
    """Camera file of `uav-bt lab calibrate`, beside this file."""
    network: NetworkKeys | None = None
    """Network of all leaves that segment."""
    ground: Annotated[tuple[str, ...], Field(min_length=1)] = ()
    """Classes that the drone may fly over and scale depth by."""
    limits: LimitKeys | None = None
    """Limits of every movement."""
    area: Annotated[str, AfterValidator(_area)] | None = None
    """Corners that every mission stays within: start:x,y or lab:x,y, with ; between."""
    margins: Clearances | None = None
    """Distances that routes keep."""
    battery: BatteryKeys | None = None
    """Charge of a real drone's battery."""
    link: LinkKeys | None = None
    """Radio link of a real drone."""
    video: VideoKeys | None = None
    """Video of a real drone."""
    ports: PortKeys | None = None
    """Network ports of a real drone."""
    return_home: _Switch | None = None
    """Whether the drone returns by itself during a flight."""
    mark: MarkSection | None = None
    """The landing mark."""

    __repr__ = brief_repr


def take_off_pose(keys: FlightKeys) -> Pose2D | None:
    """Return the take-off pose in the lab's drawing, yaw counter-clockwise; None if not stated."""
    if keys.take_off is None:
        return None
    position_m = keys.take_off.get("position_m") or (keys.mark or {}).get("position_m")
    if position_m is None:
        raise ValueRangeError("lacks the key 'position_m', and the section 'mark' has none, too")
    return _pose(position_m, keys.take_off.get("yaw_deg", 0.0))


def mark_pose(keys: FlightKeys) -> Pose2D | None:
    """Return the pose of the mark in the drawing, yaw counter-clockwise; None if not stated."""
    section = keys.mark or {}
    if "position_m" in section:
        return _pose(section["position_m"], section.get("yaw_deg", 0.0))
    if "yaw_deg" in section:
        raise ValueRangeError("yaw_deg needs position_m: where the mark stands in the drawing")
    return None


def _pose(position_m: tuple[float, float], yaw_deg: float) -> Pose2D:
    return Pose2D(x_m=position_m[0], y_m=position_m[1], yaw_rad=math.radians(yaw_deg))


def mark_of(keys: FlightKeys, usual: LandingMark | None = None) -> LandingMark | None:
    """Return the landing mark, whose missing keys are those of the usual mark; None if not stated.

    Options belong to a kind, so another kind begins without options.
    """
    section = keys.mark
    if section is None:
        return None
    for key in ("size_m", "height_m"):
        if usual is None and key not in section:
            raise ValueRangeError(f"lacks the key '{key}'")
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
