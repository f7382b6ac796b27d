"""Site files: the settings of a place and of the drone there, as YAML.

    # All of it may be left out.
    flight_height_m: 1.2           # above the ground; replaces `height_m` of the tree's take-off
    take_off_surface_m: 0.4        # height of the take-off surface above the ground
    camera: anafi-720p.yaml        # of `uav-bt lab calibrate`
    network: {model: hall.onnx, classes: hall-classes.yaml}   # for all that segment
    ground: [carpet, background]   # which of the classes it may fly over and scale depth by
    limits: {speed_mps: 0.6, climb_mps: 0.5, yaw_rate_radps: 1.2, ceiling_m: 2.0}
    take_off: {position_m: [0.5, -1.2], yaw_deg: 90}   # in the lab's drawing, for lab:1,2
    area: "start:-1,-2; start:4,-2; start:4,2; start:-1,2"   # that every mission stays in
    mark: {kind: apriltag, size_m: [0.5, 0.5], height_m: 0.2, options: {id: 7, size_m: 0.3}}
    margins: {obstacle_m: 0.4, edge_m: 0.3, unknown_m: 0.35, lane_m: 0.7}   # that routes keep
    battery: {take_off: 0.4, critical: 0.15}
    link: {take_off: 0.4}
    video: {latency_s: 0.2}
    ports: {http: 8080, rtsp: 8554}
    return_home: off               # the drone's automatic return, during a flight

Files that it names lie beside it, unless their path is absolute.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, NotRequired

from pydantic import AfterValidator, Field, ValidationInfo
from typing_extensions import TypedDict

from uav_bt.brief import brief_repr
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.files import did_you_mean_file
from uav_bt.lab.mark_section import MarkSection, mark_of_section
from uav_bt.lab.shipped import default_mark
from uav_bt.mission.limits import Limits
from uav_bt.mission.preflight import PreflightConfig
from uav_bt.types import NARROWER_M, Airframe, Clearances, LandingMark, Pose2D
from uav_bt.types.place import Place, area_corners
from uav_bt.yaml_file import YamlFile, read_yaml


@dataclass(frozen=True, kw_only=True)
class Site:
    """A place to fly in; `load_site` reads one from a file.

    Attributes:
        flight_height_m: above the ground; None: as the tree says.
        take_off_surface_m: height of the surface that the drone takes off from, above the ground.
        take_off_pose: take-off pose in the lab's drawing, yaw counter-clockwise; None if unknown.
        camera: a camera file; None: the drone's own intrinsics.
        model: the segmentation network's name or file; None: as the tree says.
        classes: Class-mapping file of that network.
        ground: names of the classes that the drone may fly over and scale depth by.
        limits: Limits of all commands.
        area: corners of the polygon that every mission stays in; None: no bound.
        mark: Landing mark; None: that of the scene or of the lab.
        clearances: distances that routes keep.
        preflight: least battery and link of a real drone before it takes off.
        video_latency_s: least time from exposure to arrival of a frame, seconds.
        http_port: of the drone's web interface; None: the drone's usual one.
        rtsp_port: of the drone's video; None: the drone's usual one.
        return_home: whether the drone returns by itself during a flight; None: as it is set.
        file: the site file that it was read from; None: none.
    """

    flight_height_m: float | None = None
    take_off_surface_m: float = 0.0
    take_off_pose: Pose2D | None = None
    camera: Path | None = None
    model: str | None = None
    classes: Path | None = None
    ground: tuple[str, ...] = ()
    limits: Limits = field(default_factory=Limits)
    area: tuple[Place, ...] | None = None
    mark: LandingMark | None = None
    clearances: Clearances = field(default_factory=Clearances)
    preflight: PreflightConfig = field(default_factory=PreflightConfig)
    video_latency_s: float = 0.15
    http_port: int | None = None
    rtsp_port: int | None = None
    return_home: bool | None = None
    file: Path | None = field(default=None, compare=False)

    __repr__ = brief_repr


def load_site(path: str | Path) -> Site:
    """Read a site file.

    Raises:
        FileError: it is absent or malformed; the message names the key.
    """
    file = read_yaml(Path(path), _SiteFile, "site file")
    found = file.value
    battery, ports = found.battery or {}, found.ports or {}
    limits: dict[str, Any] = {**(found.limits or {})}
    if "critical" in battery:
        limits["critical_battery"] = battery["critical"]
    preflight = {
        name: section["take_off"]
        for name, section in (("battery", battery), ("link", found.link or {}))
        if "take_off" in section
    }
    network = found.network or {}
    mark = None if found.mark is None else _mark(file, found.mark)
    try:
        return Site(
            flight_height_m=found.flight_height_m,
            take_off_surface_m=found.take_off_surface_m,
            take_off_pose=None if found.take_off is None else _pose(found.take_off),
            camera=found.camera,
            model=network.get("model"),
            classes=network.get("classes"),
            ground=found.ground,
            limits=Limits(**limits),
            area=None if found.area is None else area_corners(found.area),
            mark=mark,
            clearances=Clearances(**(found.margins or {})),
            preflight=PreflightConfig(**preflight),
            video_latency_s=(found.video or {}).get("latency_s", Site.video_latency_s),
            http_port=ports.get("http"),
            rtsp_port=ports.get("rtsp"),
            return_home=found.return_home,
            file=Path(path),
        )
    except ValueRangeError as error:
        raise file.error(str(error), "limits") from error


def check_clearances(site: Site, airframe: Airframe) -> None:
    """Refuse distances that the drone's hull does not fit in.

    Args:
        site: With the distances.
        airframe: Size of the drone's body.

    Raises:
        InputError: A distance is too small. As a FileError it names the site file and the line.
    """
    reach_m = airframe.radius_m
    for name, least_m in site.clearances.below(reach_m).items():
        narrower = (
            f", and narrow passages take off {NARROWER_M:g} m" if name == "obstacle_m" else ""
        )
        message = (
            f"must be at least {least_m:.2f} m, because the drone reaches {reach_m:.2f} m "
            f"from its centre{narrower}, got {getattr(site.clearances, name):g}"
        )
        if site.file is not None:
            raise read_yaml(site.file, _SiteFile, "site file").error(message, "margins", name)
        raise InputError(f"margins.{name}: {message}; a site file sets it")


def _pose(section: _TakeOff) -> Pose2D:
    x_m, y_m = section["position_m"]
    return Pose2D(x_m=x_m, y_m=y_m, yaw_rad=math.radians(section.get("yaw_deg", 0.0)))


def _mark(file: YamlFile[_SiteFile], section: MarkSection) -> LandingMark:
    try:
        return mark_of_section(section, default_mark())
    except InputError as error:
        raise file.error(str(error), "mark") from error


# --- the form of the file -------------------------------------------------------------------------


def _beside(value: Path, info: ValidationInfo) -> Path:
    context: Any = info.context
    file: Path = context["folder"] / value
    if not file.is_file():
        raise ValueError(f"there is no file {file}{did_you_mean_file(file)}")
    return file


def _network(value: str, info: ValidationInfo) -> str:
    return str(_beside(Path(value), info)) if value.endswith(".onnx") else value


def _area(value: str) -> str:
    try:
        area_corners(value)
    except ValueRangeError as error:
        raise ValueError(str(error)) from error
    return value


_Number = Annotated[float, Field(ge=0.0, le=1000.0)]
_Coordinate = Annotated[float, Field(ge=-1000.0, le=1000.0)]
_Distance = Annotated[float, Field(ge=0.0, le=5.0)]
_Share = Annotated[float, Field(ge=0.0, le=1.0)]
_Port = Annotated[int, Field(ge=1, le=65_535)]
_FileBeside = Annotated[Path, AfterValidator(_beside)]


class _Network(TypedDict, total=False):
    model: Annotated[str, AfterValidator(_network)]  # a file, or a name that ships
    classes: _FileBeside


class _Limits(TypedDict, total=False):
    speed_mps: _Number
    climb_mps: _Number
    yaw_rate_radps: _Number
    ceiling_m: _Number


class _Margins(TypedDict, total=False):
    obstacle_m: _Distance
    edge_m: _Distance
    unknown_m: _Distance
    lane_m: _Distance


class _Battery(TypedDict, total=False):
    take_off: _Share
    critical: _Share


class _TakeOff(TypedDict):
    position_m: tuple[_Coordinate, _Coordinate]
    yaw_deg: NotRequired[_Coordinate]


class _Link(TypedDict, total=False):
    take_off: _Share


class _Video(TypedDict, total=False):
    latency_s: _Number


class _Ports(TypedDict, total=False):
    http: _Port
    rtsp: _Port


@dataclass(frozen=True, kw_only=True)
class _SiteFile:
    flight_height_m: Annotated[float, Field(gt=0.0, le=1000.0)] | None = None
    take_off_surface_m: _Number = 0.0
    take_off: _TakeOff | None = None
    camera: _FileBeside | None = None
    network: _Network | None = None
    ground: Annotated[tuple[str, ...], Field(min_length=1)] = ()
    limits: _Limits | None = None
    area: Annotated[str, AfterValidator(_area)] | None = None
    mark: MarkSection | None = None
    margins: _Margins | None = None
    battery: _Battery | None = None
    link: _Link | None = None
    video: _Video | None = None
    ports: _Ports | None = None
    return_home: bool | None = None
