"""Site files: what a place and its drone need, as YAML.

    # All of it may be left out.
    flight_height_m: 1.2           # above the ground; replaces the height in the tree's TakeOff
    take_off_surface_m: 0.4        # what it takes off from is so high above the ground
    camera: anafi-720p.yaml        # of `uav-bt calibrate`
    network: {model: hall.onnx, classes: hall-classes.yaml}   # segments the pictures
    ground: [carpet, background]   # which of the classes it may fly over and scale depth by
    limits: {speed_mps: 0.6, climb_mps: 0.5, yaw_rate_radps: 1.2, ceiling_m: 2.0}
    battery: {take_off: 0.4, critical: 0.15}
    link: {take_off: 0.4}
    video: {latency_s: 0.2}
    ports: {http: 8080, rtsp: 8554}

Files that it names lie beside it, unless their path is absolute.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import yaml

from uav_bt.errors import FileError, ValueRangeError, did_you_mean
from uav_bt.mission.preflight import PreflightConfig
from uav_bt.mission.safety import Limits

__all__ = ["Site", "load_site"]


@dataclass(frozen=True, kw_only=True)
class Site:
    """A place to fly in."""

    flight_height_m: float | None = None  # above the ground; as the tree says when None
    take_off_surface_m: float = 0.0  # above the ground
    camera: Path | None = None  # a camera file; the drone's own intrinsics when None
    model: str | None = None  # the segmentation network's name or file; as the tree says when None
    classes: Path | None = None  # what that network's classes mean
    ground: tuple[str, ...] = ("carpet",)  # class names
    limits: Limits = field(default_factory=Limits)
    preflight: PreflightConfig = field(default_factory=PreflightConfig)
    video_latency_s: float = 0.15  # least time from exposure to arrival
    http_port: int | None = None
    rtsp_port: int | None = None


_SECTIONS: Final[Mapping[str, tuple[str, ...]]] = {
    "network": ("model", "classes"),
    "limits": ("speed_mps", "climb_mps", "yaw_rate_radps", "ceiling_m"),
    "battery": ("take_off", "critical"),
    "link": ("take_off",),
    "video": ("latency_s",),
    "ports": ("http", "rtsp"),
}
_KEYS: Final = ("flight_height_m", "take_off_surface_m", "camera", "ground", *_SECTIONS)
_MAX_PORT: Final = 65_535


def load_site(path: Path) -> Site:
    """Read a site file.

    Raises:
        FileError: it is absent or malformed; the message names the key.
    """
    content = _read(path)
    _refuse_unknown(path, content, _KEYS, "")
    sections = {name: _section(path, content, name) for name in _SECTIONS}
    number = _Numbers(path)
    battery, network = sections["battery"], sections["network"]
    limits = {name: number.of(sections["limits"], name, "limits.") for name in sections["limits"]}
    if "critical" in battery:
        limits["critical_battery"] = number.of(battery, "critical", "battery.", most=1.0)
    preflight = {}
    for name, section in (("battery", battery), ("link", sections["link"])):
        if "take_off" in section:
            preflight[name] = number.of(section, "take_off", f"{name}.", most=1.0)
    height_m = None
    if "flight_height_m" in content:
        height_m = number.of(content, "flight_height_m", "")
        if height_m <= 0.0:
            raise FileError(path, f"flight_height_m must be positive, got {height_m}")
    try:
        return Site(
            flight_height_m=height_m,
            take_off_surface_m=number.of(content, "take_off_surface_m", "", default=0.0),
            camera=_beside(path, content, "camera"),
            model=_model(path, network),
            classes=_beside(path, network, "classes"),
            ground=_ground(path, content),
            limits=Limits(**limits),
            preflight=PreflightConfig(**preflight),
            video_latency_s=number.of(sections["video"], "latency_s", "video.", default=0.15),
            http_port=_port(path, sections["ports"], "http"),
            rtsp_port=_port(path, sections["ports"], "rtsp"),
        )
    except ValueRangeError as error:
        raise FileError(path, str(error)) from error


class _Numbers:
    def __init__(self, path: Path) -> None:
        self._path = path

    def of(
        self,
        section: Mapping[str, Any],
        key: str,
        prefix: str,
        *,
        default: float | None = None,
        most: float = 1000.0,
    ) -> float:
        """Return a number that is not negative and not absurd."""
        value = section.get(key, default)
        known = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not known or not math.isfinite(value) or not 0.0 <= value <= most:
            raise FileError(
                self._path, f"{prefix}{key} must be a number from 0 to {most:g}, got {value!r}"
            )
        return float(value)


def _read(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise FileError(path, "there is no such site file")
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(path, f"cannot be read as UTF-8 text: {error}") from error
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else None
        raise FileError(path, f"not valid YAML: {error.problem}", line) from error
    except (yaml.YAMLError, RecursionError) as error:
        raise FileError(path, f"not valid YAML: {error}") from error
    if content is None:
        return {}
    if not isinstance(content, dict):
        raise FileError(path, f"a site file is a mapping with {', '.join(_KEYS)}")
    return content


def _section(path: Path, content: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    section = content.get(name)
    if section is None:
        return {}
    if not isinstance(section, dict):
        raise FileError(path, f"{name} is a mapping with {', '.join(_SECTIONS[name])}")
    _refuse_unknown(path, section, _SECTIONS[name], f"{name}.")
    return section


def _refuse_unknown(
    path: Path, content: Mapping[Any, Any], known: tuple[str, ...], prefix: str
) -> None:
    for key in content:
        if key not in known:
            hint = did_you_mean(str(key), known)
            raise FileError(path, f"unknown key '{prefix}{key}'{hint} (known: {', '.join(known)})")


def _beside(path: Path, section: Mapping[str, Any], key: str) -> Path | None:
    value = section.get(key)
    if value is None:
        return None
    if not isinstance(value, str):
        raise FileError(path, f"{key} must name a file, got {value!r}")
    file = path.parent / value
    if not file.is_file():
        raise FileError(path, f"{key}: there is no file {file}")
    return file


def _model(path: Path, section: Mapping[str, Any]) -> str | None:
    """Return a network's file, or a name that ships with the project."""
    value = section.get("model")
    if value is None:
        return None
    if not isinstance(value, str):
        raise FileError(path, f"network.model must name a network, got {value!r}")
    return str(_beside(path, section, "model")) if value.endswith(".onnx") else value


def _ground(path: Path, content: Mapping[str, Any]) -> tuple[str, ...]:
    value = content.get("ground", ["carpet"])
    if not isinstance(value, list) or not value or not all(isinstance(n, str) for n in value):
        raise FileError(path, f"ground must be a list of class names, got {value!r}")
    return tuple(value)


def _port(path: Path, section: Mapping[str, Any], key: str) -> int | None:
    value = section.get(key)
    if value is None:
        return None
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= _MAX_PORT:
        raise FileError(path, f"ports.{key} must be a port from 1 to {_MAX_PORT}, got {value!r}")
    return value
