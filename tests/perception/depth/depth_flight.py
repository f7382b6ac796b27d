"""A short flight along a known path in the twin, as footage with exact or noisy telemetry."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.training.footage import FOOTAGE_SIZE_PX, Footage, shrink
from perception.depth.training.labelling import LABEL_SIZE_PX, DepthLabels
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views
from uav_bt.types.projection import camera_axes

PITCH_RAD = math.radians(-28.0)


@dataclass(frozen=True, kw_only=True)
class KnownFlight:
    """Footage and its ground truth."""

    footage: Footage
    depth_m: NDArray[np.float32]  # (N, 256, 320)
    ids: NDArray[np.uint8]  # (N, 256, 320)
    poses: list[CameraPose]

    def labels(self) -> DepthLabels:
        """Return the true depth of every frame at the size of labels."""
        how = cv2.INTER_NEAREST_EXACT
        small = [cv2.resize(exact, LABEL_SIZE_PX, interpolation=how) for exact in self.depth_m]
        return DepthLabels(depth_m=np.stack(small).astype(np.float16))

    def motion(self, origin: int, target: int) -> NDArray[np.float64]:
        """Return the true movement of points from one camera's frame to another's, (3, 4)."""
        (r1, p1), (r2, p2) = (_in_world(self.poses[place]) for place in (origin, target))
        return np.concatenate([r2.T @ r1, (r2.T @ (p1 - p2))[:, None]], axis=1)


def _in_world(pose: CameraPose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return rotation and position in a frame with x as the world's, y to its right, z down."""
    c, s = math.cos(-pose.yaw_rad), math.sin(-pose.yaw_rad)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return turn @ camera_axes(pose.pitch_rad), np.array([pose.x_m, -pose.y_m, -pose.z_m])


def known_flight(count: int = 12, *, yaw_noise_rad: float = 0.0, seed: int = 0) -> KnownFlight:
    """Fly a bend over the ground of a training scene, ten frames a second."""
    scene = load_scene("train-a")
    times = 0.1 * np.arange(count)
    yaw = 0.9 + 0.25 * times  # counter-clockwise, as the world has it
    x = -1.3 + np.cumsum(0.05 * np.cos(yaw))  # 0.5 m/s
    y = -1.2 + np.cumsum(0.05 * np.sin(yaw))
    z = 1.5 + 0.05 * np.sin(times)
    poses = [
        CameraPose(
            x_m=float(x[i] + 0.15 * math.cos(yaw[i])),  # the lens ahead of the centre
            y_m=float(y[i] + 0.15 * math.sin(yaw[i])),
            z_m=float(z[i]),
            yaw_rad=float(yaw[i]),
            pitch_rad=PITCH_RAD,
        )
        for i in range(count)
    ]
    views = list(render_views(scene, poses, truth_size_px=FOOTAGE_SIZE_PX))
    noise = np.random.default_rng(seed).normal(0.0, yaw_noise_rad, (2, count))
    # Velocity as it is at the ticks: differences of the very positions, half a step each way.
    vx, vy, vz = (np.gradient(axis, times) for axis in (x, y, z))
    c, s = np.cos(yaw), np.sin(yaw)
    told = np.zeros((2, count, 3))
    told[:, :, 2] = -yaw + noise
    footage = Footage(
        frames=np.stack([shrink(view.image) for view in views]),
        index=3 * np.arange(count, dtype=np.int64),
        captured_s=times,
        gimbal_pitch_rad=np.full(count, PITCH_RAD),
        attitude_rad=told[0],
        height_above_ground_m=z,
        state_s=times,
        state_attitude_rad=told[1],
        velocity_mps=np.stack([c * vx + s * vy, s * vx - c * vy, -vz], axis=1),
        camera=anafi_camera(640, 360).resized(*FOOTAGE_SIZE_PX),
    )
    return KnownFlight(
        footage=footage,
        depth_m=np.stack([view.depth for view in views]),
        ids=np.stack([view.ids for view in views]),
        poses=poses,
    )
