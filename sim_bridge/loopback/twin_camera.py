"""The twin's camera as the video's source: draws the newest view when somebody watches.

A GL context belongs to one thread, so all drawing happens on a thread of its own.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Final

from sim_bridge.anafi import CAMERA_FORWARD_M, FOCAL_SHARE, anafi_camera
from sim_bridge.loopback.earth import place
from sim_bridge.loopback.twin_world import TwinWorld
from sim_bridge.loopback.video.frame import GeoPosition, NorthEastDown, VideoFrame
from sim_bridge.twin.optics import Optics
from sim_bridge.twin.render import Renderer
from sim_bridge.twin.simulation import Capture
from uav_bt.protocols import Clock
from uav_bt.types import Attitude

__all__ = ["TwinCamera"]

# s that drawing, encoding and sending take by themselves; the rest of the latency is waited for.
_PIPELINE_S: Final = 0.03
_SATELLITES: Final = 14


class TwinCamera:
    """Makes the pictures of a `TwinWorld`."""

    def __init__(
        self,
        world: TwinWorld,
        *,
        image_size_px: tuple[int, int],
        seed: int,
        clock: Clock,
        battery: Callable[[], float],
    ) -> None:
        """Describe the video; nothing is opened before the first picture.

        Args:
            world: what is seen.
            image_size_px: width and height, 16:9.
            seed: of the pictures' noise.
            clock: the world's; maps its time to that of the day.
            battery: asked for the charge, 0 to 1.

        Raises:
            ValueRangeError: the size is not 16:9.
        """
        self._camera = anafi_camera(*image_size_px)
        self._world = world
        self._optics = Optics(world.profile, *image_size_px, seed)
        self._battery = battery
        self._utc_offset_s = time.time() - clock.now()
        self._age_s = max(0.0, world.profile.video_latency_s - _PIPELINE_S)
        self._painter = ThreadPoolExecutor(max_workers=1, thread_name_prefix="twin-camera")
        self._renderer: Renderer | None = None
        self._last: VideoFrame | None = None

    def newest(self) -> VideoFrame | None:
        """Return the newest picture, drawn now where it is new; None before the first.

        Raises:
            MissingDependencyError: OpenGL does not work here.
        """
        found = self._world.newest_capture(self._age_s)
        if found is None:
            return self._last
        capture, captured_s = found
        if self._last is None or captured_s > self._last.captured_s:
            self._last = self._painter.submit(self._frame, capture, captured_s).result()
        return self._last

    def close(self) -> None:
        """Free what draws; call it when nobody asks any more. Safe to call twice."""
        if self._renderer is not None:
            renderer, self._renderer = self._renderer, None
            self._painter.submit(renderer.close).result()
        self._painter.shutdown()

    def _frame(self, capture: Capture, captured_s: float) -> VideoFrame:
        if self._renderer is None:
            self._renderer = Renderer(self._world.lab)
        width, height = self._camera.width_px, self._camera.height_px
        clean = self._renderer.rgb(capture.camera, width, height)
        told, start, lens = capture.telemetry, self._world.start_pose, capture.camera
        level_m = CAMERA_FORWARD_M * math.cos(told.attitude.pitch_rad)
        north_m = lens.x_m - level_m * math.cos(lens.yaw_rad) - start.x_m
        east_m = start.y_m + level_m * math.sin(lens.yaw_rad) - lens.y_m
        here = place(north_m, east_m)
        cosine, sine = math.cos(told.attitude.yaw_rad), math.sin(told.attitude.yaw_rad)
        velocity = told.velocity
        return VideoFrame(
            image=self._optics.spoil(clean, capture.index, capture.exposure),
            captured_s=captured_s,
            captured_utc_s=captured_s + self._utc_offset_s,
            attitude=told.attitude,
            camera=Attitude(pitch_rad=lens.pitch_rad, yaw_rad=told.attitude.yaw_rad),
            velocity_mps=NorthEastDown(
                north=velocity.forward_mps * cosine - velocity.right_mps * sine,
                east=velocity.forward_mps * sine + velocity.right_mps * cosine,
                down=velocity.down_mps,
            ),
            position_m=NorthEastDown(north=north_m, east=east_m, down=-told.altitude_m),
            location=GeoPosition(
                latitude_deg=here.latitude_deg,
                longitude_deg=here.longitude_deg,
                altitude_m=told.altitude_m,
                satellites=_SATELLITES,
            ),
            altitude_m=told.altitude_m,
            height_m=told.height_m,
            battery=self._battery(),
            flying=self._world.state().flying,
            fov_rad=(
                2.0 * math.atan(0.5 / FOCAL_SHARE),
                2.0 * math.atan(0.5 * height / (FOCAL_SHARE * width)),
            ),
        )
