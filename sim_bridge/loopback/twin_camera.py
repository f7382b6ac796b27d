"""Camera of the twin as the source of the video: renders the newest view while a client plays.

A GL context belongs to one thread, so `newest` and `close` are called on the video's thread.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Final

from sim_bridge.anafi import CAMERA_FORWARD_M, FOCAL_SHARE, anafi_camera
from sim_bridge.loopback.metadata import NorthEastDown, VideoFrame
from sim_bridge.loopback.twin_world import TwinWorld
from sim_bridge.loopback.world import GROUND_M, location
from sim_bridge.twin.camera import Optics
from sim_bridge.twin.render import Renderer
from sim_bridge.twin.simulation import Capture
from uav_bt.protocols import Clock
from uav_bt.types import Attitude, rotate

# Time of rendering, encoding and sending, s; the rest of the profile's latency is added.
_PIPELINE_S: Final = 0.03


class TwinCamera:
    """Renders the camera frames of a `TwinWorld`; the first frame opens the renderer.

    Args:
        world: the simulated world.
        image_size_px: width and height, pixels, 16:9; ValueRangeError otherwise.
        seed: random seed of the image noise.
        clock: clock of the world; maps its time to UTC.
        battery: returns the charge, 0 to 1.
    """

    def __init__(
        self,
        world: TwinWorld,
        *,
        image_size_px: tuple[int, int],
        seed: int,
        clock: Clock,
        battery: Callable[[], float],
    ) -> None:
        self._camera = anafi_camera(*image_size_px)
        self._world = world
        self._optics = Optics(world.profile, *image_size_px, seed)
        self._battery = battery
        self._utc_offset_s = time.time() - clock.now()
        self._age_s = max(0.0, world.profile.video_latency_s - _PIPELINE_S)
        self._renderer: Renderer | None = None
        self._newest: VideoFrame | None = None

    def newest(self) -> VideoFrame | None:
        """Return the newest frame, rendered now if it is new; None before the first."""
        found = self._world.newest_capture(self._age_s)
        if found is None:
            return self._newest
        capture, captured_s = found
        if self._newest is None or captured_s > self._newest.captured_s:
            self._newest = self._frame(capture, captured_s)
        return self._newest

    def close(self) -> None:
        """Free the renderer; call after the last `newest`. Safe to call twice."""
        if self._renderer is not None:
            renderer, self._renderer = self._renderer, None
            renderer.close()

    def _frame(self, capture: Capture, captured_s: float) -> VideoFrame:
        if self._renderer is None:
            self._renderer = Renderer(self._world.lab)
        width, height = self._camera.width_px, self._camera.height_px
        clean = self._renderer.rgb(capture.camera, width, height, capture.movers)
        measured, start, lens = capture.telemetry, self._world.start_pose, capture.camera
        level_m = CAMERA_FORWARD_M * math.cos(measured.attitude.pitch_rad)
        north_m = lens.x_m - level_m * math.cos(lens.yaw_rad) - start.x_m
        east_m = start.y_m + level_m * math.sin(lens.yaw_rad) - lens.y_m
        velocity, yaw_rad = measured.velocity, measured.attitude.yaw_rad
        north_mps, east_mps = rotate(velocity.forward_mps, velocity.right_mps, yaw_rad)
        place = location(north_m, east_m, GROUND_M + measured.altitude_m)
        return VideoFrame(
            image=self._optics.degrade(clean, capture.index, capture.exposure),
            captured_s=captured_s,
            captured_utc_s=captured_s + self._utc_offset_s,
            attitude=measured.attitude,
            camera=Attitude(pitch_rad=lens.pitch_rad, yaw_rad=yaw_rad),
            velocity_mps=NorthEastDown(north=north_mps, east=east_mps, down=velocity.down_mps),
            position_m=NorthEastDown(north=north_m, east=east_m, down=-measured.altitude_m),
            location=place if self._world.outdoors else None,
            altitude_m=measured.altitude_m,
            height_m=measured.height_m,
            battery=self._battery(),
            flying=self._world.state().flying,
            fov_rad=(
                2.0 * math.atan(0.5 / FOCAL_SHARE),
                2.0 * math.atan(0.5 * height / (FOCAL_SHARE * width)),
            ),
        )
