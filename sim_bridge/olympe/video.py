"""The newest video frame, never a queue of old ones."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import av
import numpy as np
from av.video.reformatter import ColorRange, Colorspace
from numpy.typing import NDArray

from sim_bridge.olympe.metadata import FrameMetadata
from uav_bt.types import DroneState, Frame

__all__ = ["CaptureTimes", "NewestFrame", "Picture"]

# Two quartz clocks drift apart by some 20 parts in a million; ten times that is let go.
_DRIFT: Final = 2e-4
_RESTARTED_S: Final = 10.0  # no frame is so late: a clock that was set back began anew


@dataclass(frozen=True, kw_only=True)
class Picture:
    """A decoded frame as the SDK delivers it, copied out of its memory."""

    planes: NDArray[np.uint8]  # (3 H / 2, W): Y above the two colour planes
    layout: str = "yuv420p"  # or nv12, in FFmpeg's names
    full_range: bool = False
    bt601: bool = False  # how colours were made; otherwise BT.709, which HD video says or means
    metadata: FrameMetadata = field(default_factory=FrameMetadata)
    streamed_us: int | None = None  # of the stream's clock, which begins anywhere

    @property
    def stamp(self) -> tuple[str, int] | None:
        """The best time it carries, in microseconds, and whose clock that is."""
        if self.metadata.captured_us is not None:
            return "camera", self.metadata.captured_us
        return None if self.streamed_us is None else ("stream", self.streamed_us)


class CaptureTimes:
    """When frames were captured, in our clock.

    The drone stamps frames with a clock of its own. The quickest frame so far shows how the two
    clocks relate, up to the least latency there is; what arrives later than that was delayed.
    Without stamps every frame is taken for one of least latency.

    Args:
        latency_s: least time from exposure to arrival.
    """

    def __init__(self, latency_s: float) -> None:
        self._latency_s = latency_s
        self._offsets_s: dict[str, tuple[float, float]] = {}  # by clock, and as of when

    def captured(self, arrived_s: float, stamp: tuple[str, int] | None) -> float:
        """Return the capture time of a frame that arrived just now.

        Args:
            arrived_s: just now.
            stamp: whose clock, and its microseconds; clocks of two names have nothing in common.
        """
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


class NewestFrame:
    """Takes pictures on the SDK's thread; makes a `Frame` of the newest when somebody looks.

    Args:
        size_px: width and height of the frames.
        now: the clock.
        latency_s: least time from exposure to arrival.
        arrived: told of each new frame.
    """

    def __init__(
        self,
        size_px: tuple[int, int],
        now: Callable[[], float],
        *,
        latency_s: float,
        arrived: Callable[[], None],
    ) -> None:
        self._size_px = size_px
        self._now = now
        self._times = CaptureTimes(latency_s)
        self._arrived = arrived
        self._lock = threading.Lock()
        self._picture: tuple[int, float, Picture] | None = None
        self._count = 0
        self._frame: Frame | None = None

    @property
    def count(self) -> int:
        """How many frames have come."""
        with self._lock:
            return self._count

    def take(self, picture: Picture) -> None:
        """Take a picture; the one before is forgotten, looked at or not."""
        captured_s = self._times.captured(self._now(), picture.stamp)
        with self._lock:
            self._picture = (self._count, captured_s, picture)
            self._count += 1
        self._arrived()

    def newest(self, state: DroneState, above_carpet_m: float) -> Frame | None:
        """Return the newest frame, None before the first.

        Args:
            state: stands in for what the frame does not say itself.
            above_carpet_m: of the body's centre, before take-off.
        """
        with self._lock:
            held = self._picture
        if held is None:
            return None
        index, captured_s, picture = held
        if self._frame is None or self._frame.index != index:
            told = picture.metadata
            altitude_m = _known(told.altitude_m, state.altitude_m)
            self._frame = Frame(
                image=_rgb(picture, self._size_px),
                index=index,
                captured_s=captured_s,
                gimbal_pitch_rad=_known(told.gimbal_pitch_rad, state.gimbal_pitch_rad),
                attitude=_known(told.attitude, state.attitude),
                altitude_m=altitude_m,
                height_m=_known(told.height_m, state.height_m),
                height_above_carpet_m=altitude_m + above_carpet_m,
            )
        return self._frame


def _known(value: Any, otherwise: Any) -> Any:
    return otherwise if value is None else value


def _rgb(picture: Picture, size_px: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the picture as RGB at a size, (H, W, 3)."""
    frame = av.VideoFrame.from_ndarray(picture.planes, format=picture.layout)
    image = frame.reformat(
        width=size_px[0],
        height=size_px[1],
        format="rgb24",
        src_colorspace=Colorspace.ITU601 if picture.bt601 else Colorspace.ITU709,
        src_color_range=ColorRange.JPEG if picture.full_range else ColorRange.MPEG,
        interpolation="AREA",
    ).to_ndarray()
    return np.ascontiguousarray(image, dtype=np.uint8)
