"""Perception without images: ray casting, with the errors of networks, odometry and mark finder."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.plain.caster import Caster
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.noise import child_seed
from sim_bridge.twin.objects import Helipad
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.simulation import Simulation
from uav_bt.landing_marks import MarkSighting
from uav_bt.types import ClassMap, DepthMap, Frame, Pose2D
from uav_bt.types.projection import camera_axes, project

SIZE_PX: Final = (112, 56)
"""Width and height of class maps and depth maps: half of the U-Net's."""
JITTER_PX: Final = 0.2
"""Standard deviation of where a pixel looks, pixels of the class map.

It frays the borders of things as the network does. Fitted: `benchmarks/fit_plain_world.py`.
"""
MOTION_STD: Final = (0.002, 0.002, 0.002)
"""Standard deviation of the measured motion between two frames: m ahead, m aside, and rad.

That of the optical flow in flights of the twin.
"""
# Standard deviations of a sighting: range as a share of it, bearing in rad, heading in degrees.
# They are those that `benchmarks/landing_marks.py views` shows for tags.
_MARK_STD: Final = np.array([0.01, 0.001, 0.3])
_MARK_MIN_PX: Final = 10.0  # least side of a tag that is found in the video of 640x360
# Least side of full confidence. The errors of a smaller tag are larger by this side over its own.
_MARK_SURE_PX: Final = 16.0
_DEPTH_SHARE_STD: Final = 0.05  # standard deviation of the relative depth of a frame. Chosen.
_MIN_GROUND: Final = 0.1  # least share of ground in both frames for a measured motion. Chosen.
_UNIT: Final = 0.3  # relative depth of a metre; any number
_SAMPLES: Final = 1 << 16  # of the noise, of which each frame reads a window
# Distance of two frames' windows, modulo `_SAMPLES`: its golden section, so that the windows of
# five frames in a row do not overlap.
_WINDOW_STEP: Final = 40503
_VIDEO: Final = anafi_camera(640, 360)
_LENS: Final = _VIDEO.resized(*SIZE_PX)
_SAME: Final = 0.9  # least share of the expected depth at which nothing is in between. Chosen.
_TOP_SHARE: Final = 0.6  # side of a mark without a stated size over the side of the top. Chosen.


class PlainSight:
    """Perceives the last 30 s of frames of a simulation; implements the protocol `Sight`."""

    def __init__(self, scene: Scene, simulation: Simulation, seed: int) -> None:
        self._scene, self._simulation, self._seed = scene, simulation, seed
        self._caster = Caster(scene, SIZE_PX)
        generator = np.random.default_rng(child_seed(seed, 18))
        pitch = self._caster.rays[1, 1] - self._caster.rays[0, 0]
        noise = generator.normal(0.0, JITTER_PX, (_SAMPLES + math.prod(SIZE_PX), 2))
        self._noise = noise * pitch
        self._seen: tuple[int, NDArray[np.uint8], NDArray[np.float32]] | None = None
        self._ground: dict[int, float] = {}  # share of ground by index, last two frames

    def segment(self, frame: Frame) -> ClassMap:
        """Return the class map of a frame, (H, W) uint8 of `SIZE_PX`."""
        ids, _ = self._cast(frame)
        return ClassMap(ids=ids, classes=self._caster.classes, captured_s=frame.captured_s)

    def estimate(self, frame: Frame) -> DepthMap:
        """Return the relative depth of a frame, (H, W) float32 of `SIZE_PX`."""
        _, depth_m = self._cast(frame)
        unit = _UNIT * math.exp(self._random(13, frame).normal(0.0, _DEPTH_SHARE_STD))
        depth = np.asarray(depth_m * np.float32(unit), dtype=np.float32)
        return DepthMap(depth=depth, metric=False, captured_s=frame.captured_s)

    def mark(self, frame: Frame) -> MarkSighting | None:
        """Return the landing mark in a frame as a finder in images does; None without a view."""
        if self._scene.helipad is None:
            return None
        camera, depth_m = self._simulation.capture_of(frame.index).camera, self._cast(frame)[1]
        return see_mark(self._scene.helipad, camera, depth_m, self._random(17, frame))

    def motion(self, first: Frame, second: Frame) -> Pose2D | None:
        """Return the pose of the second lens in the level frame of the first, with errors."""
        shares = [self._ground.get(frame.index, 0.0) for frame in (first, second)]
        if min(shares) < _MIN_GROUND:
            return None
        begin, end = (self._simulation.capture_of(frame.index).camera for frame in (first, second))
        cos, sin = math.cos(begin.yaw_rad), math.sin(begin.yaw_rad)
        x_m, y_m = end.x_m - begin.x_m, end.y_m - begin.y_m
        ahead_m, aside_m, turn_rad = self._random(14, second).normal(0.0, MOTION_STD).tolist()
        # The world's yaw is counter-clockwise, a heading is clockwise and y is to the right.
        return Pose2D(
            x_m=cos * x_m + sin * y_m + ahead_m,
            y_m=sin * x_m - cos * y_m + aside_m,
            yaw_rad=math.remainder(begin.yaw_rad - end.yaw_rad, math.tau) + turn_rad,
        )

    def _random(self, purpose: int, frame: Frame) -> np.random.Generator:
        return np.random.default_rng(child_seed(self._seed, purpose, frame.index))

    def _cast(self, frame: Frame) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        if self._seen is None or self._seen[0] != frame.index:
            capture, rays = self._simulation.capture_of(frame.index), self._caster.rays
            start = (frame.index * _WINDOW_STEP) % _SAMPLES
            shift = self._noise[start : start + rays.shape[0] * rays.shape[1]]
            ids, depth_m = self._caster.cast(
                capture.camera, capture.movers, rays + shift.reshape(rays.shape)
            )
            self._seen = frame.index, ids, depth_m
            self._ground.pop(frame.index, None)
            self._ground[frame.index] = float(np.mean(ids == self._caster.ground_id))
            if len(self._ground) > 2:
                del self._ground[next(iter(self._ground))]
        return self._seen[1:]


def see_mark(
    pad: Helipad,
    camera: CameraPose,
    depth_m: NDArray[np.float32],
    generator: np.random.Generator,
) -> MarkSighting | None:
    """Return the landing mark in a view of known depth, with errors; None if it is not found.

    It is too small, not in view, or something nearer hides its middle.
    """
    middle, corners = _in_level_frame(pad, camera)
    column, row = project(middle, _LENS, camera.pitch_rad)
    if not (0.0 <= column <= _LENS.width_px - 1 and 0.0 <= row <= _LENS.height_px - 1):
        return None
    expected_m = float((middle @ camera_axes(camera.pitch_rad))[2])
    if depth_m[round(row), round(column)] < _SAME * expected_m:
        return None
    pixels = project(corners, _VIDEO, camera.pitch_rad)
    inside = (pixels > -0.5) & (pixels < (_VIDEO.width_px - 0.5, _VIDEO.height_px - 0.5))
    if not inside.all():  # NaN, behind the lens, is outside
        return None
    side_px = float(np.linalg.norm(pixels - np.roll(pixels, 1, axis=0), axis=1).min())
    if side_px < _MARK_MIN_PX:
        return None
    confidence = min(1.0, side_px / _MARK_SURE_PX)
    stretch, aside_rad, turn_deg = generator.normal(0.0, _MARK_STD / confidence).tolist()
    range_m = math.hypot(middle[0], middle[1]) * (1.0 + stretch)
    bearing_rad = math.atan2(middle[1], middle[0]) + aside_rad
    # Yaw is counter-clockwise, a heading clockwise; the upper edge is towards the pad's y axis.
    heading_deg = pad.yaw_deg + 90.0 - math.degrees(camera.yaw_rad) + turn_deg
    return MarkSighting(
        forward_m=range_m * math.cos(bearing_rad) + CAMERA_FORWARD_M,
        right_m=range_m * math.sin(bearing_rad),
        height_m=pad.size_m[2],
        confidence=confidence,
        heading_deg=math.remainder(heading_deg, 360.0),
    )


def _sides_m(pad: Helipad) -> NDArray[np.float64]:
    """Return the sides of the mark along the pad's axes, (2,): those of its largest tag."""
    tags = pad.options.get("tags") or [pad.options]
    sides_m = [float(tag["size_m"]) for tag in tags if "size_m" in tag]
    return np.full(2, max(sides_m)) if sides_m else _TOP_SHARE * np.array(pad.size_m[:2])


def _in_level_frame(
    pad: Helipad, camera: CameraPose
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the middle (3,) and corners (4, 3) of the tag in the level frame of the camera."""
    cos, sin = math.cos(camera.yaw_rad), math.sin(camera.yaw_rad)
    # From the world (x, y up to the left of x) to forward and right.
    level = np.array([[cos, sin, 0.0], [sin, -cos, 0.0], [0.0, 0.0, -1.0]])
    turn, half_m = math.radians(pad.yaw_deg), _sides_m(pad) / 2.0
    along = half_m[0] * np.array([math.cos(turn), math.sin(turn), 0.0])
    across = half_m[1] * np.array([-math.sin(turn), math.cos(turn), 0.0])
    top = np.array([*pad.position_m, pad.size_m[2]])
    corners = np.array([across - along, along + across, along - across, -along - across]) + top
    lens = np.array([camera.x_m, camera.y_m, camera.z_m])
    return np.asarray(level @ (top - lens)), np.asarray((corners - lens) @ level.T)
