"""Ground truth of a flight in the twin, for reports and evaluations."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin.scene import Scene
from sim_bridge.twin.simulation import Capture, Simulation
from uav_bt.errors import ValueRangeError
from uav_bt.types import Frame, Pose, Truth
from uav_bt.types.ground import Ground


class ExactViews(Protocol):
    """Source of exact class ids and depth of captures."""

    def class_ids(self, capture: Capture, size_px: tuple[int, int]) -> NDArray[np.uint8]:
        """Return the class ids, (H, W) uint8, at a width and height."""
        ...

    def depth(self, capture: Capture, size_px: tuple[int, int]) -> NDArray[np.float32]:
        """Return the depth along the optical axis, (H, W) float32, metres."""
        ...


class TwinReferee:
    """Reports the true state of one flight."""

    def __init__(self, scene: Scene, simulation: Simulation, views: ExactViews) -> None:
        self._scene = scene
        self._simulation = simulation
        self._views = views

    def truth(self) -> Truth:
        """Return the present truth; contacts include those of the last 0.1 s."""
        simulation, pads = self._simulation, self._scene.pads
        motion = simulation.motion
        x, y = motion.x_m, motion.y_m
        return Truth(
            time_s=simulation.now_s,
            pose=Pose(x_m=x, y_m=y, z_m=motion.z_m, yaw_rad=motion.yaw_rad),
            contacts=simulation.contacts(),
            clearance_m=simulation.body.clearance_m(),
            inside_ground=self._scene.ground_plan.contains(x, y),
            on_mark=any(pad.footprint.contains(x, y) for pad in pads),
            landing_error_m=math.dist((x, y), pads[0].position_m) if pads else None,
            motors_on=simulation.motors_on,
            gimbal_pitch_rad=simulation.gimbal_pitch_rad,
            movers=simulation.movers,
        )

    def ground(self) -> Ground:
        """Return the ground and the objects on it."""
        return self._scene.ground_plan

    def class_ids(self, frame: Frame, width_px: int, height_px: int) -> NDArray[np.uint8]:
        """Return the exact class ids of the view of a delivered frame.

        Raises:
            ValueRangeError: the frame is too old or from another flight.
        """
        return self._views.class_ids(self._capture(frame), (width_px, height_px))

    def depth(self, frame: Frame, width_px: int, height_px: int) -> NDArray[np.float32]:
        """Return the exact depth of the view of a delivered frame, metres along the optical axis.

        Raises:
            ValueRangeError: the frame is too old or from another flight.
        """
        return self._views.depth(self._capture(frame), (width_px, height_px))

    def _capture(self, frame: Frame) -> Capture:
        capture = self._simulation.capture_of(frame.index)
        if capture.time_s != frame.captured_s:
            raise ValueRangeError(
                f"frame {frame.index} of {frame.captured_s:.2f} s is not of this flight; ask only "
                "the referee of the drone that sent it"
            )
        return capture
