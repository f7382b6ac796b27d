"""Configuration of an ANAFI flown through Olympe: address, ports and limits."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import ClassVar, Final

from sim_bridge.anafi import ANAFI_AIRFRAME
from uav_bt.errors import InputError
from uav_bt.settings import check_numbers
from uav_bt.types import Airframe

DISCOVERY_PORT: Final = 44445  # TCP; of ARSDK and of the SDK
RTSP_PORT: Final = 554  # TCP; of the ANAFI
_LAST_PORT: Final = 65_535
_ADDRESS: Final = re.compile(r"([A-Za-z0-9](?:[A-Za-z0-9.-]*[A-Za-z0-9])?)(?::([0-9]{1,5}))?")


@dataclass(frozen=True, kw_only=True)
class OlympeConfig:
    """Connection and limits of an ANAFI.

    Attributes:
        address: HOST or HOST:DISCOVERY_PORT. None: the address in Parrot's documentation.
        http_port: TCP port of the drone's web interface. Default: that of the ANAFI.
        rtsp_port: TCP port of the drone's video. Default: that of the ANAFI.
        airframe: size of the body, command delay and lag. A drone with guards needs other values.
        image_size_px: width and height to which frames are resized. Default: half of the ANAFI's
            1280x720.
        speed_limit_mps: horizontal speed limit, m/s. Chosen: 5 m, the size of a lab, take 5 s.
        climb_limit_mps: vertical speed limit, m/s. Chosen: 3 m, the height of a room, take 5 s.
        yaw_rate_limit_radps: yaw rate limit, rad/s. Chosen: a full turn takes 4 s.
        altitude_limit_m: altitude limit in the drone, above the take-off point, m. Chosen: the
            height of a room.
        tilt_limit_rad: tilt limit in the drone. Chosen: 10 degrees reach 4 m/s in the long run.
        return_home: whether the drone may return automatically during a flight. None: unchanged.
        take_off_surface_m: height of the take-off surface above the ground, m.
        video_latency_s: least time from exposure to arrival of a frame, s. Default: an estimate,
            not measured on a drone.

    Raises:
        InputError: the address is malformed.
        ValueRangeError: a number is out of its range.
    """

    kind: ClassVar[str]  # registered name of the drone
    default_host: ClassVar[str]  # the address in Parrot's documentation

    address: str | None = None
    http_port: int = 80
    rtsp_port: int = RTSP_PORT
    airframe: Airframe = ANAFI_AIRFRAME
    image_size_px: tuple[int, int] = (640, 360)
    speed_limit_mps: float = 1.0
    climb_limit_mps: float = 0.6
    yaw_rate_limit_radps: float = 1.6
    altitude_limit_m: float = 3.0
    tilt_limit_rad: float = math.radians(10.0)
    return_home: bool | None = None
    take_off_surface_m: float = 0.0
    video_latency_s: float = 0.15

    def __post_init__(self) -> None:
        least = {"take_off_surface_m": 0.0, "video_latency_s": 0.0}
        check_numbers(self, least, {"http_port": _LAST_PORT, "rtsp_port": _LAST_PORT})
        self._host_and_port()

    @property
    def host(self) -> str:
        """The network address of the drone."""
        return self._host_and_port()[0]

    @property
    def discovery_port(self) -> int:
        """The TCP port of the discovery."""
        return self._host_and_port()[1]

    @property
    def where(self) -> str:
        """Kind and address, for messages."""
        return f"{self.kind} at {self.host}:{self.discovery_port}"

    def _host_and_port(self) -> tuple[str, int]:
        if self.address is None:
            return self.default_host, DISCOVERY_PORT
        parts = _ADDRESS.fullmatch(self.address)
        port = int(parts[2] or DISCOVERY_PORT) if parts else 0
        if parts is None or not 1 <= port <= _LAST_PORT:
            raise InputError(
                f"'{self.address}' is not the address of a drone: expected HOST or "
                f"HOST:DISCOVERY_PORT, for instance {self.kind}:{self.default_host} or "
                f"{self.kind}:127.0.0.1:{DISCOVERY_PORT}"
            )
        return parts[1], port
