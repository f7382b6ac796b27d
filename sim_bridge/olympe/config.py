"""Addresses, ports, limits and time-outs of an ANAFI flown through Olympe."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import ClassVar, Final

from sim_bridge.anafi import ANAFI_AIRFRAME
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.types import Airframe

SKYCONTROLLER_HOST: Final = "192.168.53.1"  # over USB; from Parrot's documentation
DISCOVERY_PORT: Final = 44445  # TCP; ARSDK's, as the SDK uses it
RTSP_PORT: Final = 554  # TCP; the port registered for RTSP, and the ANAFI's
GRAVITY_MPS2: Final = 9.81  # m/s2; standard gravity, rounded
MIN_TILT_RAD: Final = math.radians(1.0)  # rad; the lowest MaxTilt that an ANAFI takes
_POSITIVE: Final = (
    *("speed_limit_mps", "climb_limit_mps", "yaw_rate_limit_radps"),
    *("altitude_limit_m", "tilt_limit_rad"),
)
_PORT: Final = re.compile(r"[0-9]{1,5}")
_HOST: Final = re.compile(r"[A-Za-z0-9]([A-Za-z0-9.-]*[A-Za-z0-9])?")


@dataclass(frozen=True, kw_only=True)
class OlympeConfig:
    """How an ANAFI is reached and flown.

    Attributes:
        address: HOST or HOST:DISCOVERY_PORT. None: the address that Parrot's documentation gives.
        http_port: TCP port of the drone's web interface. Default: the ANAFI's.
        rtsp_port: TCP port of the drone's video. Default: the ANAFI's.
        airframe: size of the body, command delay and lag. A drone with guards needs another one.
        image_size_px: width and height that frames are resized to. Default: half of the 1280x720
            that the ANAFI streams.
        probe_limit_s: longest wait for an answer at the discovery port, seconds. Chosen: a drone in
            reach answers within milliseconds.
        behind_limit_s: longest wait for a remote control to report its drone, seconds. Chosen.
        connect_limit_s: longest wait for a connection, seconds. Chosen: two or three are usual, and
            the SDK alone waits for 45.
        close_limit_s: longest wait for the SDK to disconnect, seconds. Chosen: it needs one at most
            from a drone that answers (`benchmarks/loopback_faults.py`), and half a minute from
            others.
        command_limit_s: longest wait at the end for the commands still queued, seconds. Chosen: one
            call of the SDK may block for 2 s.
        setting_limit_s: longest wait for the drone to report settings, before the first flight and
            after the last one, seconds. In between nothing waits, and a warning follows. Chosen:
            usually it takes milliseconds.
        video_limit_s: longest wait for the video to be granted, seconds. Default: the SDK's.
        speed_limit_mps: horizontal speed limit, m/s. Chosen: a lab of 5 m is crossed in 5 s.
        climb_limit_mps: vertical speed limit, m/s. Chosen: a room of 3 m is climbed in 5 s.
        yaw_rate_limit_radps: limit of the turning rate, rad/s. Chosen: a full turn in 4 s.
        altitude_limit_m: the drone's own ceiling above the take-off point, m. Chosen: a room.
        tilt_limit_rad: tilt at full stick, rad. Chosen: 10 degrees make 4 m/s in the long run.
        return_home: whether the drone returns by itself during a flight. None: as it is set.
        remote_control: whether a remote control answers at the address, as SkyController 3 does.
        take_off_surface_m: height of the take-off surface above the carpet, m.
        video_latency_s: least time from exposure to arrival of a frame, seconds. Default: an
            estimate, not measured on a drone; the loopback drone's is 0.16 (`docs/results.md`).
        order_repeat_s: time until a take-off or landing without effect is ordered again, seconds.
            Chosen: the SDK gives up a packet without an acknowledgement after 0.9.
        sticks_hold_s: time for which the SDK repeats stick positions, every 25 ms, before it
            centres them, seconds. Chosen: a drone whose mission hangs flies half a metre on.
        drag_per_s: of the speed control: share of the speed that the air takes away each second.
            Default: an estimate below the 0.55 of full speed (15 m/s at 40 degrees of tilt, from
            Parrot's data sheet: g tan(40) / 15), because the air resists less at walking pace.
        proportional_per_s: of the speed control: its proportional gain, 1/s. Chosen: slow beside
            the 0.3 s that telemetry and tilt take.
        integral_per_s2: of the speed control: its integral gain, 1/s2. Chosen: it removes the rest
            of the error within some seconds.

    Raises:
        InputError: the address is malformed.
        ValueRangeError: a number is out of its range.
    """

    kind: ClassVar[str]  # the name that the drone is registered under
    default_host: ClassVar[str]  # the address that Parrot's documentation gives

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
        """The drone's address on the network."""
        return self._host_and_port()[0]

    @property
    def discovery_port(self) -> int:
        """The port that the drone is asked on whether it is there."""
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
        """Whether the remote control stands between this machine and the drone."""
        return self.remote_control or self.host == SKYCONTROLLER_HOST

    @property
    def gentle_tilt_rad(self) -> float:
        """The tilt that flies no faster than the speed limit, `MIN_TILT_RAD` at least.

        Firmware that takes no speed with a movement flies it with the greatest tilt that is set.
        """
        steady_rad = math.atan(self.drag_per_s * self.speed_limit_mps / GRAVITY_MPS2)
        return min(self.tilt_limit_rad, max(MIN_TILT_RAD, steady_rad))

    @property
    def where(self) -> str:
        """Kind and address, for messages."""
        return f"{self.kind} at {self.host}:{self.discovery_port}"
