"""What exploring, avoiding and returning share: look, ask the policy, move, wait until it has moved.

A decision is only taken on a class map captured after the last movement ended, as in the paper, and
the direction of a turn is held until the way is free, so that two boxes never make the drone dither.
"""

from __future__ import annotations

import numpy as np

from behaviours.movement import Mover, Progress
from uav_bt.board import CAMERA, CLASS_MAP, FRAME, PHASE, STATE
from uav_bt.mission.context import MissionContext
from uav_bt.protocols import Decision, LeafPolicy, PolicyView
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types import ClassMap, DroneState, Frame

__all__ = ["FLIGHT_HEIGHT", "POLICY", "SteeringLeaf"]

POLICY = Port("policy", str, default="segmentation", doc="leaf policy that chooses the way")
FLIGHT_HEIGHT = Port("height_m", float, default=1.5, doc="flight height above the carpet, m")

# Less than this is the altimeter's noise; more is corrected with the next advance.
_ALTITUDE_SLACK_M = 0.08


class SteeringLeaf(Leaf):
    """Base of the leaves that move step by step under a leaf policy."""

    ports = (POLICY, FLIGHT_HEIGHT)
    reads = (STATE, FRAME, CLASS_MAP, CAMERA)
    writes = (PHASE,)

    def on_setup(self, mission: MissionContext) -> None:
        """Find the policy; raises UnknownNameError for a name that nobody registered."""
        self._policy: LeafPolicy = mission.policy(self.port_value("policy"))
        self._rng: np.random.Generator = mission.rng(self.path)
        self._mover = Mover()
        self.turning = 0  # the turn under way: +1 clockwise, -1 counter-clockwise, 0 none

    def terminate(self, new_status: Status) -> None:
        """Let go of the movement; the arbiter cancels what is no longer proposed."""
        self._mover.drop(self.clock.now())

    def state(self) -> DroneState | None:
        """Return the drone's state, None when telemetry is stale."""
        return self.read(STATE).value

    def moving(self, state: DroneState) -> bool:
        """Propose the movement in progress again; False when there is none (any more)."""
        if self._mover.update(state, self.clock.now()) is not Progress.RUNNING:
            return False
        if self._mover.proposal is not None:
            self.propose(self._mover.proposal)
        return True

    def move(self, *, forward_m: float = 0.0, yaw_rad: float = 0.0) -> None:
        """Start a movement, correcting the altitude on the way."""
        state = self.state()
        error_m = (state.height_above_carpet_m - self.port_value("height_m")) if state else 0.0
        self.propose(
            self._mover.start(
                self.mission.proposals,
                self.clock.now(),
                forward_m=forward_m,
                yaw_rad=yaw_rad,
                down_m=error_m if abs(error_m) > _ALTITUDE_SLACK_M else 0.0,
            )
        )

    def current_view(self) -> tuple[Frame, ClassMap] | None:
        """Return the frame and its class map when they show what lies ahead *now*."""
        frame, class_map = self.read(FRAME).value, self.read(CLASS_MAP).value
        if frame is None or class_map is None:
            return None
        # Pitch and height belong to the frame that the class map was made from.
        if class_map.captured_s != frame.captured_s or frame.captured_s < self._mover.ended_s:
            return None
        return frame, class_map

    def decide(self) -> Decision | None:
        """Ask the policy about the present view; None while there is no view of it."""
        view, camera = self.current_view(), self.read(CAMERA).value
        if view is None or camera is None:
            self.feedback_message = "waiting for a view"
            return None
        frame, class_map = view
        height_px, width_px = class_map.ids.shape
        decision = self._policy.decide(
            PolicyView(
                class_map=class_map,
                camera=camera.resized(width_px, height_px),
                gimbal_pitch_rad=frame.gimbal_pitch_rad,
                height_above_carpet_m=frame.height_above_carpet_m,
                turning=self.turning,
                coin=float(self._rng.random()),
            )
        )
        self.feedback_message = decision.reason
        return decision
