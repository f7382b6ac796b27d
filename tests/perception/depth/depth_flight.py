"""A short flight along a known path in the twin, as footage with exact or noisy telemetry."""

import math
from dataclasses import dataclass, replace
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.training.footage import FOOTAGE_SIZE_PX, LABEL_SIZE_PX, Flight, shrink
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views
from uav_bt.types import Attitude, BodyVelocity, DroneState, FlyingState, Frame
from uav_bt.types.projection import camera_axes

PITCH_RAD = math.radians(-28.0)
AHEAD_M = 0.15


@dataclass(frozen=True, kw_only=True)
class KnownFlight:
    """Footage and its ground truth."""

    footage: Flight
    depth_m: NDArray[np.float32]  # (N, 256, 320)
    ids: NDArray[np.uint8]  # (N, 256, 320)
    poses: list[CameraPose]

    def labels(self) -> NDArray[np.float16]:
        """Return the true depth of every frame, without bounds, as `Flight.labels`."""
        small = [
            cv2.resize(exact, LABEL_SIZE_PX, interpolation=cv2.INTER_NEAREST_EXACT)
            for exact in self.depth_m
        ]
        return np.stack([small, np.full_like(small, np.inf)], axis=1).astype(np.float16)

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
    speed = 0.5
    x = -1.3 + np.cumsum(speed * 0.1 * np.cos(yaw))
    y = -1.2 + np.cumsum(speed * 0.1 * np.sin(yaw))
    z = 1.5 + 0.05 * np.sin(times)
    poses = [
        CameraPose(
            x_m=float(x[i] + AHEAD_M * math.cos(yaw[i])),
            y_m=float(y[i] + AHEAD_M * math.sin(yaw[i])),
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
    velocities = np.stack([c * vx + s * vy, s * vx - c * vy, -vz], axis=1).tolist()
    seen, told = ([Attitude(yaw_rad=float(angle)) for angle in -yaw + each] for each in noise)
    footage = Flight(
        frames=tuple(
            Frame(
                image=shrink(view.image),
                index=3 * place,
                captured_s=float(times[place]),
                gimbal_pitch_rad=PITCH_RAD,
                attitude=seen[place],
                height_above_ground_m=float(z[place]),
            )
            for place, view in enumerate(views)
        ),
        states=tuple(
            DroneState(
                captured_s=float(times[place]),
                flying=FlyingState.FLYING,
                attitude=told[place],
                velocity=BodyVelocity(forward_mps=forward, right_mps=right, down_mps=down),
            )
            for place, (forward, right, down) in enumerate(velocities)
        ),
        camera=anafi_camera(640, 360).resized(*FOOTAGE_SIZE_PX),
    )
    return KnownFlight(
        footage=footage,
        depth_m=np.stack([view.depth for view in views]),
        ids=np.stack([view.ids for view in views]),
        poses=poses,
    )


@cache
def small_flight() -> Flight:
    """Return footage of 8 frames of 64x64 pixels, with its true labels."""
    known, size_px = known_flight(8), (64, 64)
    frames = [replace(one, image=shrink(one.image, size_px)) for one in known.footage.frames]
    return Flight(
        frames=tuple(frames),
        states=known.footage.states,
        camera=known.footage.camera.resized(*size_px),
        labels=known.labels()[:, :, 2::4, 2::5],
    )
