"""Land on the helipad, or, in an emergency, on any carpet."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from behaviours.fly.moving_leaf import STRAIGHT_DOWN_RAD, MovingLeaf, camera_points_at
from behaviours.fly.step import Progress
from uav_bt.board import CAMERA, CLASS_MAP, FRAME, PHASE, STATE
from uav_bt.classes import GROUP_CARPET, GROUP_HELIPAD, group_of
from uav_bt.tree import Port, Status
from uav_bt.types import CameraModel, ClassMap, DroneState, FlyingState, Frame, MissionPhase
from uav_bt.types import Land as LandCommand
from uav_bt.types.projection import ground_points


@dataclass(frozen=True, kw_only=True)
class EmergencyLandConfig:
    """Which views count, and when the drone is above the spot."""

    pitch_slack_rad: float = math.radians(5)  # off straight down, at which a class map counts
    tolerance_m: float = 0.05  # to the spot; a shorter step is not worth its time


class Land(MovingLeaf):
    """Move the camera's offset forward, descend, stop the motors; SUCCESS on the ground."""

    reads = (STATE, CAMERA)
    writes = (PHASE,)

    def initialise(self) -> None:
        """Begin with the forward step."""
        self.write(PHASE, MissionPhase.LAND)
        self._moved = False

    def work(self, state: DroneState) -> Status:
        """Move forward, then ask for the landing until the motors are off."""
        if state.flying is FlyingState.LANDED:
            return Status.SUCCESS
        camera = self.read(CAMERA).value
        if not self._moved and camera is not None and camera.forward_offset_m != 0.0:
            self._moved = True
            self.start_move(forward_m=camera.forward_offset_m)
            return Status.RUNNING
        if self.moving(state):
            return Status.RUNNING
        self.propose(LandCommand())
        return Status.RUNNING


@dataclass(frozen=True)
class LandingSpot:
    """A free place to land, from the body's centre."""

    forward_m: float
    right_m: float


def nearest_landing_spot(
    class_map: ClassMap, camera: CameraModel, frame: Frame, *, radius_m: float
) -> LandingSpot | None:
    """Return the nearest place whose surroundings are all carpet (or helipad), None without one.

    Args:
        class_map: of a frame that looks straight down.
        camera: intrinsics at the class map's size.
        frame: the frame that the class map was made from.
        radius_m: of the disc that must be free, metres.
    """
    import cv2  # noqa: PLC0415 - `uav-bt check` imports this module and must answer at once

    groups = group_of(class_map.ids)
    safe = ((groups == GROUP_CARPET) | (groups == GROUP_HELIPAD)).astype(np.uint8)
    height_m = max(frame.height_above_carpet_m, 0.05)
    # Beyond the image nothing is known: a border of unsafe pixels keeps the disc inside.
    clear_px = cv2.distanceTransform(np.pad(safe, 1), cv2.DIST_L2, 5)[1:-1, 1:-1]
    px_per_m = min(camera.fx_px, camera.fy_px) / height_m
    rows, columns = np.nonzero(clear_px >= radius_m * px_per_m)
    if rows.size == 0:
        return None
    spots = ground_points(
        np.stack([columns, rows], axis=-1), camera, frame.gimbal_pitch_rad, height_m
    )
    spots[:, 0] += camera.forward_offset_m
    forward_m, right_m = spots[np.argmin(np.hypot(spots[:, 0], spots[:, 1]))]
    return LandingSpot(float(forward_m), float(right_m))


class EmergencyLand(MovingLeaf):
    """Land on the nearest free carpet below; where none is in view, land at once.

    FAILURE on the ground: a mission that had to come down like this was not fulfilled.
    """

    config: ClassVar[EmergencyLandConfig] = EmergencyLandConfig()
    ports = (
        Port(
            "radius_m",
            float,
            default=0.25,
            least=0.05,
            most=5,
            doc="radius of the free disc to land on, m",
        ),
        Port(
            "look_s",
            float,
            default=6.0,
            least=0,
            most=600,
            doc="seconds to look for carpet before landing anyway",
        ),
    )
    reads = (STATE, FRAME, CLASS_MAP, CAMERA)
    writes = (PHASE,)

    def initialise(self) -> None:
        """Note the time; no spot has been found."""
        self.write(PHASE, MissionPhase.EMERGENCY_LANDING)
        self._started_s = self.leaf_clock.now()
        self._above_spot = False

    def gimbal_pitch_rad(self) -> float:
        """Return straight down."""
        return STRAIGHT_DOWN_RAD

    def work(self, state: DroneState) -> Status:
        """Find a spot, move above it, descend."""
        if state.flying is FlyingState.LANDED:
            return Status.FAILURE
        if self.moving(state):
            return Status.RUNNING
        if self.progress is Progress.INTERRUPTED:
            self._above_spot = False  # a person flew it elsewhere: look again
        waited_s = self.leaf_clock.now() - self._started_s
        if self._above_spot or waited_s > self.port_value("look_s"):
            self.propose(LandCommand())
            return Status.RUNNING
        spot = self._spot()
        if spot is not None:
            self._above_spot = True
            if math.hypot(spot.forward_m, spot.right_m) > self.config.tolerance_m:
                self.start_move(forward_m=spot.forward_m, right_m=spot.right_m)
        return Status.RUNNING

    def _spot(self) -> LandingSpot | None:
        frame, camera = self.read(FRAME).value, self.read(CAMERA).value
        class_map = self.read(CLASS_MAP).value
        if frame is None or camera is None or class_map is None:
            return None
        down = camera_points_at(frame, STRAIGHT_DOWN_RAD, slack_rad=self.config.pitch_slack_rad)
        if not down or class_map.captured_s != frame.captured_s:
            return None
        height_px, width_px = class_map.ids.shape
        return nearest_landing_spot(
            class_map,
            camera.resized(width_px, height_px),
            frame,
            radius_m=self.port_value("radius_m"),
        )
