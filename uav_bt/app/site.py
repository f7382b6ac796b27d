"""Sites: the settings of a place and of the drone there, from a site file or a lab file.

A site file is YAML with the keys of `uav_bt.lab.flight_keys` and a landing mark, of which every
part may be left out:

    flight_height_m: 1.2
    mark: {kind: apriltag, size_m: [0.5, 0.5], height_m: 0.2, options: {id: 7, size_m: 0.3}}
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from uav_bt.app.lab_network import network_of
from uav_bt.brief import brief_repr
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.lab.flight_keys import FlightKeys, mark_of, mark_pose, take_off_pose
from uav_bt.lab.lab import Lab
from uav_bt.lab.lab_file import lab_error
from uav_bt.lab.shipped import default_mark
from uav_bt.mission.limits import Limits
from uav_bt.mission.preflight import PreflightConfig
from uav_bt.settings import check_numbers
from uav_bt.types import NARROWER_M, Airframe, Clearances, LandingMark, Pose2D
from uav_bt.types.place import Place, area_corners
from uav_bt.yaml_file import read_yaml


@dataclass(frozen=True, kw_only=True)
class Site:
    """A place to fly in; `load_site` reads one from a file, `site_of_lab` makes that of a lab.

    Attributes:
        flight_height_m: above the ground; None: as in the tree.
        take_off_surface_m: height of the surface that the drone takes off from, above the ground.
        take_off_pose: take-off pose in the lab's drawing, yaw counter-clockwise; None if unknown.
        camera: a camera file; None: the drone's own intrinsics.
        model: the segmentation network's name or file; None: as in the tree.
        classes: Class-mapping file of that network.
        depth: the depth network's name or file; None: as in the tree.
        ground: names of the classes that the drone may fly over and scale depth by.
        limits: Limits of all commands.
        area: corners of the polygon that every mission stays in; None: no bound.
        mark: Landing mark; None: that of the scene or of the lab.
        mark_pose: pose of the mark in the lab's drawing, yaw counter-clockwise; None if unknown.
        clearances: distances that routes keep.
        preflight: least battery and link of a real drone before it takes off.
        video_latency_s: least time from exposure to arrival of a frame, seconds.
        http_port: of the drone's web interface; None: the drone's usual one.
        rtsp_port: of the drone's video; None: the drone's usual one.
        return_home: whether the drone returns by itself during a flight; None: as it is set.
        file: the site file or lab file that it was read from; None: none.
        lab: name of the lab that it was made of; None: none.

    Raises:
        ValueRangeError: a number is out of its range.
    """

    flight_height_m: float | None = None
    take_off_surface_m: float = 0.0
    take_off_pose: Pose2D | None = None
    camera: Path | None = None
    model: str | None = None
    classes: Path | None = None
    depth: str | None = None
    ground: tuple[str, ...] = ()
    limits: Limits = field(default_factory=Limits)
    area: tuple[Place, ...] | None = None
    mark: LandingMark | None = None
    mark_pose: Pose2D | None = None
    clearances: Clearances = field(default_factory=Clearances)
    preflight: PreflightConfig = field(default_factory=PreflightConfig)
    video_latency_s: float = 0.15
    http_port: int | None = None
    rtsp_port: int | None = None
    return_home: bool | None = None
    file: Path | None = field(default=None, compare=False)
    lab: str | None = field(default=None, compare=False)

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        least = {"take_off_surface_m": 0.0, "video_latency_s": 0.0}
        check_numbers(self, least, dict.fromkeys(("http_port", "rtsp_port"), 65_535))

    @property
    def source(self) -> str:
        """What states the settings, in messages: site or lab."""
        return "site" if self.lab is None else "lab"


def load_site(path: str | Path) -> Site:
    """Read a site file.

    Raises:
        FileError: it is absent or malformed; the message names the key.
    """
    file = read_yaml(Path(path), FlightKeys, "site file")
    with file.at("mark"):
        pose, mark = mark_pose(file.value), mark_of(file.value, default_mark())
    return _site(file.value, file.error, mark=mark, mark_pose=pose, file=Path(path))


def site_of_lab(lab: Lab) -> Site:
    """Return the site of a lab, as of a site file with the same keys.

    Raises:
        FileError: A limit is out of its range; the message has the line of the lab file.
    """
    return _site(
        replace(lab.flight, network=network_of(lab)),
        partial(lab_error, lab.file),
        mark=lab.mark,
        mark_pose=lab.mark_pose,
        file=lab.file,
        lab=lab.name,
    )


def _site(keys: FlightKeys, failure: Callable[..., InputError], **given: Any) -> Site:
    """Return the site of the keys of a file.

    Args:
        keys: Keys of the file.
        failure: Makes an error of a message and the keys that lead to the value.
        given: Further fields of the site.
    """
    battery, ports, network = keys.battery or {}, keys.ports or {}, keys.network or {}
    limits: dict[str, Any] = {**(keys.limits or {})}
    if "critical" in battery:
        limits["critical_battery"] = battery["critical"]
    preflight = {
        name: section["take_off"]
        for name, section in (("battery", battery), ("link", keys.link or {}))
        if "take_off" in section
    }
    try:
        start = take_off_pose(keys)
    except ValueRangeError as error:
        raise failure(str(error), "take_off") from error
    try:
        allowed = Limits(**limits)
    except ValueRangeError as error:
        raise failure(str(error), "limits") from error
    return Site(
        flight_height_m=keys.flight_height_m,
        take_off_surface_m=keys.take_off_surface_m,
        take_off_pose=start,
        camera=keys.camera,
        model=network.get("model"),
        classes=network.get("classes"),
        depth=network.get("depth"),
        ground=keys.ground,
        limits=allowed,
        area=None if keys.area is None else area_corners(keys.area),
        clearances=keys.margins or Clearances(),
        preflight=PreflightConfig(**preflight),
        video_latency_s=(keys.video or {}).get("latency_s", Site.video_latency_s),
        http_port=ports.get("http"),
        rtsp_port=ports.get("rtsp"),
        return_home=keys.return_home,
        **given,
    )


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
        if site.file is not None and site.lab is not None:
            raise lab_error(site.file, message, "margins", name)
        if site.file is not None:
            raise read_yaml(site.file, FlightKeys, "site file").error(message, "margins", name)
        raise InputError(f"margins.{name}: {message}; a site file sets it")
