"""Newest video frame with its metadata, and the clock that ticks with the frames.

The SDK writes the metadata of a frame as JSON in one of two formats: newer firmware sends a message
with `drone` and `camera`, older firmware a flat record (versions 2 and 3). Source: output of
libvideo-metadata in the wheels parrot-olympe 7.7.5 and 8.5.0.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import av
import numpy as np
from av.video.reformatter import ColorRange, Colorspace
from numpy.typing import NDArray

from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.olympe.telemetry import STANDING_M
from uav_bt.clock import WallClock
from uav_bt.types import Attitude, DroneState, Frame
from uav_bt.types.pose import clamp

# Least norm of a valid quaternion, no unit; chosen: half of 1. An unknown rotation is all zeros.
_LEAST_NORM: Final = 0.5
# Allowed drift between two clocks, s/s; chosen: ten times the 20 parts per million of quartz.
_DRIFT: Final = 2e-4
# Delay that shows a reset of the drone's clock; chosen: above all delays of frames.
_RESTARTED_S: Final = 10.0
# Longest wait for a frame after the wanted time; chosen: a mission without video ticks at 10 Hz.
NO_FRAME_S: Final = 0.1


@dataclass(frozen=True, kw_only=True)
class DecodedFrame:
    """A decoded frame, copied out of the SDK's memory; None for values that it lacks."""

    image: av.VideoFrame
    stamp: tuple[str, int] | None = None  # name of a clock, and its microseconds
    attitude: Attitude | None = None
    gimbal_pitch_rad: float | None = None
    height_m: float | None = None  # above the surface below
    altitude_m: float | None = None  # above the take-off point


def decode_frame(frame: Any) -> DecodedFrame | None:
    """Return a copy of the SDK's frame, of which a reference is held; None without content."""
    info, planes = frame.info(), frame.as_ndarray()
    if not info or planes is None:
        return None
    raw, vmeta = info["raw"]["frame"], frame.vmeta()[1]
    layout = "nv12" if "SEMI_PLANAR" in raw.get("format", "") else "yuv420p"
    image = av.VideoFrame.from_ndarray(planes, format=layout)
    bt601 = str(raw["info"].get("matrix_coefs", "")).startswith("BT601")
    image.colorspace = Colorspace.ITU601 if bt601 else Colorspace.ITU709  # HD video has BT.709
    full_range = raw["info"].get("full_range", False)
    image.color_range = ColorRange.JPEG if full_range else ColorRange.MPEG
    drone, camera = _mapping(vmeta.get("drone")), _mapping(vmeta.get("camera"))
    if not drone and not camera:  # flat record
        drone = {"quat": vmeta.get("drone_quat"), "ground_distance": vmeta.get("ground_distance")}
        camera = {"quat": vmeta.get("frame_quat")}
    stamps = {"camera": camera.get("timestamp"), "stream": info.get("ntp_raw_timestamp")}
    known = [(clock, int(stamp)) for clock, stamp in stamps.items() if _number(stamp)]
    view = _attitude(camera.get("quat"))
    return DecodedFrame(
        image=image,
        stamp=known[0] if known else None,
        attitude=_attitude(drone.get("quat")),
        gimbal_pitch_rad=None if view is None else view.pitch_rad,
        height_m=_number(drone.get("ground_distance")),
        altitude_m=_number(drone.get("altitude_ato")),
    )


def _attitude(quaternion: Any) -> Attitude | None:
    """Return roll, pitch and yaw of a quaternion from body to north-east-down; None if unknown."""
    parts = _mapping(quaternion)
    w, x, y, z = (_number(parts.get(name)) or 0.0 for name in "wxyz")
    length = math.hypot(w, x, y, z)
    if length < _LEAST_NORM:
        return None
    w, x, y, z = w / length, x / length, y / length, z / length
    return Attitude(
        roll_rad=math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        pitch_rad=math.asin(clamp(2.0 * (w * y - z * x), 1.0)),
        yaw_rad=math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _number(value: Any) -> float | None:
    known = isinstance(value, (int, float)) and not isinstance(value, bool)
    return float(value) if known and math.isfinite(value) else None


class CaptureTimes:
    """Converts timestamps of frames to capture times by this machine's clock.

    The drone stamps frames by another clock. The frame with the least delay gives the offset of the
    two clocks, assuming the minimum latency for it. Later frames were delayed by the difference.
    Frames without timestamps count as frames of minimum latency.
    """

    def __init__(self, latency_s: float) -> None:
        self._latency_s = latency_s  # minimum time from exposure to arrival
        self._offsets_s: dict[str, tuple[float, float]] = {}  # by clock: offset and its time

    def captured(self, arrived_s: float, stamp: tuple[str, int] | None) -> float:
        """Return the capture time of a frame from its arrival and its timestamp."""
        if stamp is None:
            return arrived_s - self._latency_s
        clock, stamp_s = stamp[0], 1e-6 * stamp[1]
        offset_s = arrived_s - stamp_s
        if clock in self._offsets_s:
            before_s, last_s = self._offsets_s[clock]
            drifted_s = before_s + _DRIFT * (arrived_s - last_s)
            if offset_s - drifted_s < _RESTARTED_S:
                offset_s = min(offset_s, drifted_s)
        self._offsets_s[clock] = offset_s, arrived_s
        return stamp_s + offset_s - self._latency_s


class FrameClock(WallClock):
    """The live clock: real time since its creation, and a tick at each new frame."""

    def __init__(self) -> None:
        super().__init__()
        self._fresh = threading.Event()  # set while the newest frame has not been used

    def frame_arrived(self) -> None:
        """End the wait; called on the thread of the video."""
        self._fresh.set()

    def frame_seen(self) -> None:
        """Record that the newest frame was used, so that `sleep_until` waits for the next one."""
        self._fresh.clear()

    def sleep_until(self, time_s: float) -> None:
        """Return at the first new frame after a time, s, or a tenth of a second after it."""
        super().sleep_until(time_s)
        self._fresh.wait(max(0.0, time_s + NO_FRAME_S - self.now()))


class NewestFrame:
    """Stores the newest frame on the SDK's thread; converts it on request."""

    def __init__(self, config: OlympeConfig, clock: FrameClock) -> None:
        self._config = config
        self._clock = clock
        self._times = CaptureTimes(config.video_latency_s)
        self._held: tuple[int, float, DecodedFrame] | None = None  # replaced as a whole
        self._frame: Frame | None = None

    def take(self, decoded: DecodedFrame) -> None:
        """Store a frame; it replaces the one before."""
        captured_s = self._times.captured(self._clock.now(), decoded.stamp)
        index = 0 if self._held is None else self._held[0] + 1
        self._held = index, captured_s, decoded
        self._clock.frame_arrived()

    def newest(self, state: DroneState) -> Frame | None:
        """Return the newest frame; None before the first. The state fills in what it lacks."""
        held = self._held
        if held is None:
            return None
        index, captured_s, decoded = held
        if self._frame is None or self._frame.index != index:
            altitude_m = _known(decoded.altitude_m, state.altitude_m)
            above_ground_m = self._config.take_off_surface_m + STANDING_M
            self._frame = Frame(
                image=_rgb(decoded.image, self._config.image_size_px),
                index=index,
                captured_s=captured_s,
                gimbal_pitch_rad=_known(decoded.gimbal_pitch_rad, state.gimbal_pitch_rad),
                attitude=_known(decoded.attitude, state.attitude),
                altitude_m=altitude_m,
                height_m=_known(decoded.height_m, state.height_m),
                height_above_ground_m=altitude_m + above_ground_m,
            )
        return self._frame


def _known(value: Any, otherwise: Any) -> Any:
    return otherwise if value is None else value


def _rgb(frame: av.VideoFrame, size_px: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the frame as RGB of a size, (H, W, 3)."""
    image = frame.reformat(
        width=size_px[0],
        height=size_px[1],
        format="rgb24",
        interpolation="AREA",
        threads=1,  # it takes 0.2 ms, less than starting more threads, above all on busy cores
    ).to_ndarray()
    return np.ascontiguousarray(image, dtype=np.uint8)
