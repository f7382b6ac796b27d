"""Addresses, ports, limits and time-outs of an ANAFI flown through Olympe."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Final

from uav_bt.errors import InputError, ValueRangeError
from uav_bt.protocols import DroneOptions

__all__ = ["DISCOVERY_PORT", "SKYCONTROLLER_HOST", "OlympeConfig", "olympe_config"]

# The addresses that Parrot's documentation gives: the drone's own Wi-Fi, its remote control on USB
# and Sphinx's first drone.
_HOSTS: Final = {"anafi": "192.168.42.1", "sphinx": "10.202.0.1"}
SKYCONTROLLER_HOST: Final = "192.168.53.1"

DISCOVERY_PORT: Final = 44445
_HTTP_PORT: Final = 80
_RTSP_PORT: Final = 554
_PORT: Final = re.compile(r"[0-9]{1,5}")
_HOST: Final = re.compile(r"[A-Za-z0-9]([A-Za-z0-9.-]*[A-Za-z0-9])?")


@dataclass(frozen=True, kw_only=True)
class OlympeConfig:
    """How an ANAFI is reached and flown.

    Raises:
        ValueRangeError: a number is out of its range.
    """

    kind: str  # anafi or sphinx
    host: str
    discovery_port: int = DISCOVERY_PORT
    http_port: int = _HTTP_PORT
    rtsp_port: int = _RTSP_PORT
    image_size_px: tuple[int, int] = (640, 360)  # what frames are resized to; the drone sends 720p
    probe_limit_s: float = 2.0  # a drone in reach answers its discovery port within milliseconds
    connect_limit_s: float = 10.0  # an ANAFI takes two or three; the SDK alone would wait for 45
    close_limit_s: float = 5.0  # for the SDK to disconnect
    command_limit_s: float = 3.0  # for commands that are queued when the drone is disconnected
    setting_limit_s: float = 2.0  # for the drone to confirm a setting; it takes milliseconds
    video_limit_s: float = 5.0  # from asking for the video to its being granted
    speed_limit_mps: float = 1.0  # horizontal; a lab is 5 m long
    climb_limit_mps: float = 0.6
    yaw_rate_limit_radps: float = 1.6
    altitude_limit_m: float = 3.0  # above the take-off point; the drone's own ceiling
    tilt_limit_rad: float = math.radians(10.0)  # full stick; plenty for 1 m/s, no surprises
    take_off_surface_m: float = 0.0  # what it takes off from is so high above the carpet
    video_latency_s: float = 0.15  # minimum from exposure to arrival
    order_repeat_s: float = 1.0  # until a take-off or landing without effect is ordered again
    # The SDK repeats stick positions every 25 ms for so long, then centres them: a drone whose
    # mission hangs hovers.
    sticks_hold_s: float = 0.5
    # Speed control. At 40 degrees of tilt an ANAFI reaches 15 m/s, which makes g tan(40) / 15 m/s
    # of drag; at walking pace the air resists less.
    drag_per_s: float = 0.4
    proportional_per_s: float = 0.8  # slow beside the 0.3 s that telemetry and tilt take
    integral_per_s2: float = 0.5  # removes the rest of the error within some seconds

    def __post_init__(self) -> None:
        positive = {
            "speed_limit_mps": self.speed_limit_mps,
            "climb_limit_mps": self.climb_limit_mps,
            "yaw_rate_limit_radps": self.yaw_rate_limit_radps,
            "altitude_limit_m": self.altitude_limit_m,
            "tilt_limit_rad": self.tilt_limit_rad,
        }
        for name, value in positive.items():
            if not (math.isfinite(value) and value > 0.0):
                raise ValueRangeError(f"{name} must be a positive number, got {value}")
        if min(self.take_off_surface_m, self.video_latency_s) < 0.0:
            raise ValueRangeError("take-off surface and video latency must not be negative")
        for port in (self.discovery_port, self.http_port, self.rtsp_port):
            if not 1 <= port <= 65535:
                raise ValueRangeError(f"a port lies within 1 and 65535, got {port}")

    @property
    def through_skycontroller(self) -> bool:
        """Whether the remote control stands between this machine and the drone."""
        return self.host == SKYCONTROLLER_HOST

    @property
    def where(self) -> str:
        """Kind and address, for messages."""
        return f"{self.kind} at {self.host}:{self.discovery_port}"


def olympe_config(kind: str, options: DroneOptions) -> OlympeConfig:
    """Return the configuration that options give an ANAFI.

    Args:
        kind: anafi or sphinx.
        options: the address is HOST or HOST:DISCOVERY_PORT; the kind's own host when None.

    Raises:
        InputError: the address is malformed.
        ValueRangeError: a number is out of its range.
    """
    host, discovery_port = _address(kind, options.address)
    return OlympeConfig(
        kind=kind,
        host=host,
        discovery_port=discovery_port,
        http_port=_HTTP_PORT if options.http_port is None else options.http_port,
        rtsp_port=_RTSP_PORT if options.rtsp_port is None else options.rtsp_port,
        image_size_px=options.image_size_px,
        speed_limit_mps=options.speed_limit_mps,
        climb_limit_mps=options.climb_limit_mps,
        yaw_rate_limit_radps=options.yaw_rate_limit_radps,
        altitude_limit_m=options.altitude_limit_m,
        take_off_surface_m=options.take_off_surface_m,
        video_latency_s=options.video_latency_s,
    )


def _address(kind: str, address: str | None) -> tuple[str, int]:
    if address is None:
        return _HOSTS[kind], DISCOVERY_PORT
    host, colon, port = address.partition(":")
    if not _HOST.fullmatch(host) or (colon and not _PORT.fullmatch(port)):
        raise InputError(
            f"'{address}' is not the address of a drone: expected HOST or HOST:DISCOVERY_PORT, for "
            f"instance {kind}:{_HOSTS[kind]} or {kind}:127.0.0.1:{DISCOVERY_PORT}"
        )
    return host, int(port) if colon else DISCOVERY_PORT
