"""Sites: the settings of a place and of the drone there, from a site file or a lab file.

A site file is YAML with the keys of `uav_bt.lab.flight_keys`.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from perception.networks.weights_file import ANY
from uav_bt.errors import InputError
from uav_bt.lab.flight_keys import FlightKeys, NetworkKeys, mark_of, mark_pose, take_off_pose
from uav_bt.lab.lab import Lab
from uav_bt.lab.lab_file import lab_text
from uav_bt.lab.shipped import default_mark, load_lab
from uav_bt.mission.limits import Limits
from uav_bt.mission.preflight import PreflightConfig
from uav_bt.settings import brief_repr, check_numbers
from uav_bt.types import Airframe, Clearances, LandingMark, Pose2D
from uav_bt.types.place import Place, area_corners
from uav_bt.yaml_file import YamlFile, read_yaml


@dataclass(frozen=True, kw_only=True)
class Site:
    """A place to fly in; `load_site` reads one from a file. Poses count yaw counter-clockwise.

    Raises:
        ValueRangeError: a number is out of its range.
    """

    flight_height_m: float | None = None  # above the ground; None: as in the tree
    take_off_surface_m: float = 0.0  # height of the take-off surface above the ground
    take_off_pose: Pose2D | None = None  # in the lab's drawing; None: unknown
    camera: Path | None = None  # a camera file; None: the drone's own intrinsics
    model: str | None = None  # name or file of the segmentation network; None: as in the tree
    classes: Path | None = None  # class mapping of that network
    depth: str | None = None  # name or file of the depth network; None: as in the tree
    ground: tuple[str, ...] = ()  # classes that the drone may fly over and scale depth by
    limits: Limits | None = None  # of all commands; None: those of the flight, or the usual ones
    area: tuple[Place, ...] | None = None  # None: no bound
    mark: LandingMark | None = None  # None: that of the scene or of the lab
    mark_pose: Pose2D | None = None  # in the lab's drawing; None: unknown
    clearances: Clearances = field(default_factory=Clearances)  # that routes keep
    preflight: PreflightConfig = field(default_factory=PreflightConfig)  # for a real take-off
    video_latency_s: float = 0.15  # least time from exposure to arrival of a frame
    http_port: int | None = None  # of the drone's web interface; None: the usual one
    rtsp_port: int | None = None  # of the drone's video; None: the usual one
    return_home: bool | None = None  # whether the drone returns by itself; None: as it is set
    file: Path | None = field(default=None, compare=False)  # that it was read from
    lab: str | None = field(default=None, compare=False)  # its name

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        least = {"take_off_surface_m": 0.0, "video_latency_s": 0.0}
        check_numbers(self, least, dict.fromkeys(("http_port", "rtsp_port"), 65_535))


def load_site(path: str | Path) -> Site:
    """Read a site file.

    Raises:
        FileError: it is absent or malformed; the message names the key.
    """
    file = _site_text(Path(path))
    with file.at("mark"):
        pose, mark = mark_pose(file.value), mark_of(file.value, default_mark())
    site = _site(file.value, file.value.network, file.at)
    return replace(site, mark=mark, mark_pose=pose, file=Path(path))


def _site_text(path: Path) -> YamlFile[FlightKeys]:
    return read_yaml(path, FlightKeys, "site file")


def site_of_lab(lab: Lab) -> Site:
    """Return the site of a lab, as of a site file with the same keys."""
    site = _site(lab.flight, network_of(lab), lab_text(lab.file).at)
    return replace(site, mark=lab.mark, mark_pose=lab.mark_pose, file=lab.file, lab=lab.name)


def network_of(lab: Lab) -> NetworkKeys:
    """Return the networks that a lab is flown with: its own, else those for any room.

    One with the classes of the paper's lab is flown with the tree's.
    """
    return lab.network if has_paper_classes(lab) else {"model": ANY, "depth": ANY, **lab.network}


def has_paper_classes(lab: Lab) -> bool:
    """Return whether the shipped networks of the paper's lab fit a lab."""
    return lab.classes.names == load_lab().classes.names


def _site(
    keys: FlightKeys, network: NetworkKeys | None, at: Callable[[str], AbstractContextManager[None]]
) -> Site:
    """Return the site of a file; `at` gives errors of a block the line of a key."""
    same = ("flight_height_m", "take_off_surface_m", "camera", "ground", "return_home")
    stated: dict[str, Any] = {name: getattr(keys, name) for name in same} | {**(network or {})}
    stated |= {f"{name}_port": port for name, port in (keys.ports or {}).items()}
    stated |= {f"video_{name}": value for name, value in (keys.video or {}).items()}
    battery, link = keys.battery or {}, keys.link or {}
    limits: dict[str, Any] = {**(keys.limits or {})}
    if "critical" in battery:
        limits["critical_battery"] = battery["critical"]
    take_off = {"battery": battery.get("take_off"), "link": link.get("take_off")}
    preflight = {name: share for name, share in take_off.items() if share is not None}
    with at("take_off"):
        stated["take_off_pose"] = take_off_pose(keys)
    with at("limits"):
        stated["limits"] = Limits(**limits) if limits else None
    return Site(
        area=None if keys.area is None else area_corners(keys.area),
        clearances=keys.margins or Clearances(),
        preflight=PreflightConfig(**preflight),
        **stated,
    )


def check_clearances(site: Site, airframe: Airframe) -> None:
    """Refuse distances that the drone's hull does not fit in."""
    for name, least_m in site.clearances.below(airframe.radius_m).items():
        message = (
            f"must be at least {least_m:.2f} m, since the drone reaches {airframe.radius_m:.2f} m "
            f"from its centre, got {getattr(site.clearances, name):g}"
        )
        if site.file is None:
            raise InputError(f"margins.{name}: {message}; a site file sets it")
        file: Any = lab_text(site.file) if site.lab else _site_text(site.file)
        raise file.error(message, "margins", name)
