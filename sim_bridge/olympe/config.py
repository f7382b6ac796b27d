"""Configuration of an ANAFI flown through Olympe: addresses, ports, limits and timeouts."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import ClassVar, Final

from sim_bridge.anafi import ANAFI_AIRFRAME
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.types import Airframe

SKYCONTROLLER_HOST: Final = "192.168.53.1"  # over USB; from Parrot's documentation
DISCOVERY_PORT: Final = 44445  # TCP; port of ARSDK and of the SDK
RTSP_PORT: Final = 554  # TCP; registered port of RTSP, used by the ANAFI
GRAVITY_MPS2: Final = 9.81  # m/s2; standard gravity, rounded
MIN_TILT_RAD: Final = math.radians(1.0)  # rad; the lowest MaxTilt that an ANAFI accepts
_POSITIVE: Final = (
    *("speed_limit_mps", "climb_limit_mps", "yaw_rate_limit_radps"),
    *("altitude_limit_m", "tilt_limit_rad"),
)
_PORT: Final = re.compile(r"[0-9]{1,5}")
_HOST: Final = re.compile(r"[A-Za-z0-9]([A-Za-z0-9.-]*[A-Za-z0-9])?")


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
        probe_limit_s: timeout of an answer at the discovery port, s. Chosen: a drone in reach
            answers within milliseconds.
        behind_limit_s: timeout of a remote control's report of its drone, s. Chosen.
        connect_limit_s: timeout of the connection, s. Chosen: it usually takes two or three, and
            the SDK waits for 45.
        close_limit_s: timeout of the SDK's disconnection, s. Chosen: it takes at most 1 s with a
            drone that answers (`benchmarks/loopback_faults.py`), otherwise 30 s.
        command_limit_s: timeout of the queued commands at the end, s. Chosen: one call of the SDK
            may block for 2 s.
        setting_limit_s: timeout of the drone's reports of its settings, before the first flight
            and after the last one, s. During a flight nothing waits for a report, and a missing
            one causes a warning. Chosen: a report usually takes milliseconds.
        video_limit_s: timeout of the request for the video, s. Default: that of the SDK.
        speed_limit_mps: horizontal speed limit, m/s. Chosen: 5 m, the size of a lab, take 5 s.
        climb_limit_mps: vertical speed limit, m/s. Chosen: 3 m, the height of a room, take 5 s.
        yaw_rate_limit_radps: yaw rate limit, rad/s. Chosen: a full turn takes 4 s.
        altitude_limit_m: altitude limit in the drone, above the take-off point, m. Chosen: the
            height of a room.
        tilt_limit_rad: tilt at full stick, rad. Chosen: 10 degrees reach 4 m/s in the long run.
        return_home: whether the drone may return automatically during a flight. None: unchanged.
        remote_control: whether a remote control answers at the address, as a SkyController 3.
        take_off_surface_m: height of the take-off surface above the ground, m.
        video_latency_s: least time from exposure to arrival of a frame, s. Default: an estimate,
            not measured on a drone.
        order_repeat_s: time after which a take-off or landing without effect is repeated, s.
            Chosen: the SDK drops a packet without acknowledgement after 0.9.
        sticks_hold_s: time for which the SDK repeats stick positions, every 25 ms, before it
            centres them, s. Chosen: a drone whose mission hangs flies at most half a metre.
        drag_per_s: share of the speed lost to drag per second, for the speed control. Default: an
            estimate. Drag is lower at walking speed than the 0.55 at full speed (15 m/s at 40
            degrees of tilt, from Parrot's data sheet: g tan(40) / 15).
        proportional_per_s: proportional gain of the speed control, 1/s. Chosen: slow compared to
            the 0.3 s of telemetry and tilt.
        integral_per_s2: integral gain of the speed control, 1/s2. Chosen: it removes the
            remaining error within some seconds.

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
    probe_limit_s: float = 2.0
    behind_limit_s: float = 5.0
    connect_limit_s: float = 10.0
    close_limit_s: float = 5.0
    command_limit_s: float = 3.0
    setting_limit_s: float = 2.0
    video_limit_s: float = 5.0
    speed_limit_mps: float = 1.0
    climb_limit_mps: float = 0.6
    yaw_rate_limit_radps: float = 1.6
    altitude_limit_m: float = 3.0
    tilt_limit_rad: float = math.radians(10.0)
    return_home: bool | None = None
    remote_control: bool = False
    take_off_surface_m: float = 0.0
    video_latency_s: float = 0.15
    order_repeat_s: float = 1.0
    sticks_hold_s: float = 0.5
    drag_per_s: float = 0.4
    proportional_per_s: float = 0.8
    integral_per_s2: float = 0.5

    def __post_init__(self) -> None:
        for name in _POSITIVE:
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueRangeError(f"{name} must be a positive number, got {value}")
        if min(self.take_off_surface_m, self.video_latency_s) < 0.0:
            raise ValueRangeError("take-off surface and video latency must not be negative")
        for port in (self.discovery_port, self.http_port, self.rtsp_port):
            if not 1 <= port <= 65535:
                raise ValueRangeError(f"a port lies within 1 and 65535, got {port}")

    @property
    def host(self) -> str:
        """The network address of the drone."""
        return self._host_and_port()[0]

    @property
    def discovery_port(self) -> int:
        """The TCP port of the discovery."""
        return self._host_and_port()[1]

    def _host_and_port(self) -> tuple[str, int]:
        if self.address is None:
            return self.default_host, DISCOVERY_PORT
        host, colon, port = self.address.partition(":")
        if not _HOST.fullmatch(host) or (colon and not _PORT.fullmatch(port)):
            raise InputError(
                f"'{self.address}' is not the address of a drone: expected HOST or "
                f"HOST:DISCOVERY_PORT, for instance {self.kind}:{self.default_host} or "
                f"{self.kind}:127.0.0.1:{DISCOVERY_PORT}"
            )
        return host, int(port) if colon else DISCOVERY_PORT

    @property
    def through_skycontroller(self) -> bool:
        """Whether the drone is reached through its remote control."""
        return self.remote_control or self.host == SKYCONTROLLER_HOST

    @property
    def gentle_tilt_rad(self) -> float:
        """The tilt that reaches the speed limit, at least `MIN_TILT_RAD`.

        Firmware without speeds for movements uses the largest tilt of the settings.
        """
        steady_rad = math.atan(self.drag_per_s * self.speed_limit_mps / GRAVITY_MPS2)
        return min(self.tilt_limit_rad, max(MIN_TILT_RAD, steady_rad))

    @property
    def where(self) -> str:
        """Kind and address, for messages."""
        return f"{self.kind} at {self.host}:{self.discovery_port}"
