"""Views straight down at drawn ground, for the take-off spot as a landing mark."""

import math

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter

from sim_bridge.anafi import anafi_camera
from tests.worlds import values
from uav_bt.landing_marks import MarkView
from uav_bt.types import Pose2D
from uav_bt.types.arrays import Image
from uav_bt.types.projection import ground_points

CAMERA = anafi_camera(320, 180)
CAMERA_M = 1.5
CELL_M = 0.01  # of the drawn ground
SIDE_PX = 800
AT_THE_SPOT = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)


def texture(side_px: int = SIDE_PX) -> Image:
    """Return ground with spots of some centimetres, (side_px, side_px)."""
    noise = np.random.default_rng(1).normal(0.0, 1.0, (side_px, side_px))
    smooth = gaussian_filter(noise, 4.0, mode="wrap")
    return np.clip(120.0 + 25.0 * smooth / smooth.std(), 0.0, 255.0).astype(np.uint8)


def view(
    ground: Image, body: Pose2D, *, off: tuple[float, float, float] = (0.0, 0.0, 0.0), at_s: float
) -> MarkView:
    """Return a noisy view straight down.

    Args:
        ground: (S, S) grey, rows along x and columns along y, the take-off spot in its middle.
        body: Pose of the body in the take-off frame.
        off: Error of the drone's estimate of that pose: x, y in metres, yaw in degrees.
        at_s: Capture time.
    """
    pitch_rad = -math.pi / 2.0
    grid = np.stack(np.meshgrid(np.arange(320), np.arange(180)), axis=-1).reshape(-1, 2)
    places_m = ground_points(grid, CAMERA, pitch_rad, CAMERA_M)
    places_m[:, 0] += CAMERA.forward_offset_m
    cells = body.points_to_world(places_m) / CELL_M + (len(ground) - 1) / 2.0
    rows, columns = cells.T.astype(np.float32).reshape(2, 180, 320)
    seen = cv2.remap(ground, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    noise = np.random.default_rng(round(10.0 * at_s)).normal(0.0, 3.0, seen.shape)
    grey = np.clip(seen + noise, 0.0, 255.0).astype(np.uint8)
    frame = values.frame(
        np.repeat(grey[:, :, None], 3, axis=2),
        pitch_rad,
        CAMERA_M,
        captured_s=at_s,
        index=round(10.0 * at_s),
    )
    believed = Pose2D(
        x_m=body.x_m + off[0], y_m=body.y_m + off[1], yaw_rad=body.yaw_rad + math.radians(off[2])
    )
    return MarkView(
        frame=frame,
        camera=CAMERA,
        take_off=believed.pose_to_body(AT_THE_SPOT),
    )
