"""Perception without images: ray casting, with the errors of the networks and of the odometry."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_bridge.plain.caster import Caster
from sim_bridge.plain.mark_sight import MarkErrors, is_covered, see_mark
from sim_bridge.twin.noise import child_seed
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.simulation import Capture, Simulation
from uav_bt.landing_marks import MarkSighting
from uav_bt.types import ClassMap, DepthMap, Frame, Pose2D


@dataclass(frozen=True, kw_only=True)
class SightErrors:
    """Sizes of the errors of perception.

    Attributes:
        jitter_px: Standard deviation of where a pixel looks, pixels of the class map. It frays the
            borders of things as the network does. Fitted: `benchmarks/fit_plain_world.py`.
        depth_share: Standard deviation of the relative depth of a frame, as a share. Chosen.
        shift_m: Standard deviation of the measured motion between two frames, each way: that of
            the optical flow in flights of the twin.
        turn_rad: Standard deviation of the measured turn between two frames, likewise.
        min_ground: Least share of ground in both frames for a measurement. Chosen.
    """

    jitter_px: float = 0.2
    depth_share: float = 0.05
    shift_m: float = 0.002
    turn_rad: float = 0.002
    min_ground: float = 0.1


SIZE_PX: Final = (112, 56)
"""Width and height of class maps and depth maps: half of the U-Net's."""
_UNIT: Final = 0.3  # relative depth of a metre; any number
_SAMPLES: Final = 1 << 16  # of the noise, of which each frame reads a window
# Distance of two frames' windows, modulo `_SAMPLES`: its golden section, so that the windows of
# five frames in a row do not overlap.
_WINDOW_STEP: Final = 40503


class ExactCasts:
    """Exact class ids and depth of captures, at any size.

    Args:
        scene: the lab.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._casters: dict[tuple[int, int], Caster] = {}

    def class_ids(self, capture: Capture, size_px: tuple[int, int]) -> NDArray[np.uint8]:
        """Return the class ids, (H, W) uint8, at a width and height."""
        return self._cast(capture, size_px)[0]

    def depth(self, capture: Capture, size_px: tuple[int, int]) -> NDArray[np.float32]:
        """Return the depth along the optical axis, (H, W) float32, metres."""
        return self._cast(capture, size_px)[1]

    def _cast(
        self, capture: Capture, size_px: tuple[int, int]
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        if size_px not in self._casters:
            self._casters[size_px] = Caster(self._scene, size_px)
        return self._casters[size_px].cast(capture.camera, capture.movers)


class PlainSight:
    """Perceives the frames of a simulation; implements the protocol `Sight`.

    Args:
        scene: the lab.
        simulation: it keeps the last 30 s of captures.
        seed: random seed of the flight.
        errors: sizes of the errors.
    """

    def __init__(
        self, scene: Scene, simulation: Simulation, seed: int, errors: SightErrors | None = None
    ) -> None:
        self.exact, self._scene = ExactCasts(scene), scene
        self._mark_errors = MarkErrors()
        self._simulation, self._seed = simulation, seed
        self._errors = errors or SightErrors()
        self._caster = Caster(scene, SIZE_PX)
        generator = np.random.default_rng(child_seed(seed, 18))
        pitch = self._caster.rays[1, 1] - self._caster.rays[0, 0]
        noise = generator.normal(0.0, self._errors.jitter_px, (_SAMPLES + math.prod(SIZE_PX), 2))
        self._noise = noise * pitch
        self._seen: tuple[int, NDArray[np.uint8], NDArray[np.float32]] | None = None
        self._ground: dict[int, float] = {}  # share of ground by index, last two frames

    def segment(self, frame: Frame) -> ClassMap:
        """Return the class map of a frame, (H, W) uint8 of `SIZE_PX`."""
        ids, _ = self._cast_frame(frame)
        return ClassMap(ids=ids, classes=self._caster.classes, captured_s=frame.captured_s)

    def estimate(self, frame: Frame) -> DepthMap:
        """Return the relative depth of a frame, (H, W) float32 of `SIZE_PX`."""
        _, depth_m = self._cast_frame(frame)
        generator = np.random.default_rng(child_seed(self._seed, 13, frame.index))
        unit = _UNIT * math.exp(generator.normal(0.0, self._errors.depth_share))
        depth = np.asarray(depth_m * np.float32(unit), dtype=np.float32)
        return DepthMap(depth=depth, metric=False, captured_s=frame.captured_s)

    def mark(self, frame: Frame) -> MarkSighting | None:
        """Return the landing mark in a frame as a finder in images does; None without a view."""
        camera, pad = self._simulation.capture_of(frame.index).camera, self._scene.helipad
        if pad is None or is_covered(pad, camera, self._cast_frame(frame)[1], self._caster.camera):
            return None
        generator = np.random.default_rng(child_seed(self._seed, 17, frame.index))
        return see_mark(pad, camera, self._mark_errors, generator)

    def motion(self, first: Frame, second: Frame) -> Pose2D | None:
        """Return the pose of the second lens in the level frame of the first, with errors."""
        errors = self._errors
        shares = [self._ground.get(frame.index, 0.0) for frame in (first, second)]
        if min(shares) < errors.min_ground:
            return None
        begin, end = (self._simulation.capture_of(frame.index).camera for frame in (first, second))
        cos, sin = math.cos(begin.yaw_rad), math.sin(begin.yaw_rad)
        x_m, y_m = end.x_m - begin.x_m, end.y_m - begin.y_m
        generator = np.random.default_rng(child_seed(self._seed, 14, second.index))
        ahead_m, aside_m, turn_rad = generator.normal(
            0.0, (errors.shift_m, errors.shift_m, errors.turn_rad)
        )
        # The world's yaw is counter-clockwise, a heading is clockwise and y is to the right.
        return Pose2D(
            x_m=cos * x_m + sin * y_m + float(ahead_m),
            y_m=sin * x_m - cos * y_m + float(aside_m),
            yaw_rad=math.remainder(begin.yaw_rad - end.yaw_rad, math.tau) + float(turn_rad),
        )

    def _cast_frame(self, frame: Frame) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
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
