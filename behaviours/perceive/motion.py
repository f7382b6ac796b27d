"""The leaf that estimates the drone's motion over the ground."""

from __future__ import annotations

from typing import Self

from behaviours.stage_timer import StageTimer
from uav_bt.board import CAMERA, CLASS_MAP, FRAME, ODOMETRY, STATE
from uav_bt.board.context import MissionContext
from uav_bt.tree import Leaf, Status


class TrackMotion(Leaf):
    """Estimate the drone's pose and velocity over the ground in every tick; SUCCESS always.

    The estimate integrates telemetry. Each class map with enough ground in view corrects it. It is
    written from the first class map on. Leaves that need the drone's position (`MapSite`, the
    position hold) read it. Place this leaf after `Segment` and before `MapSite`.
    """

    answers = (Status.SUCCESS,)
    reads = (STATE, FRAME, CLASS_MAP, CAMERA)
    writes = (ODOMETRY,)

    def on_setup(self, mission: MissionContext) -> None:
        """Make the odometry."""
        from perception.odometry.ground import GroundOdometry  # noqa: PLC0415  (OpenCV is heavy)

        self._odometry = GroundOdometry(
            measure=None if mission.sight is None else mission.sight.motion
        )
        self._timer = StageTimer(mission, "odometry")
        self._last_s = -1.0

    def on_inherit(self, former: Self) -> None:
        """Keep the odometry, and with it the origin of its frame."""
        self._odometry, self._last_s = former._odometry, former._last_s

    def update(self) -> Status:
        """Integrate telemetry, and correct the estimate with a new class map."""
        state = self.read(STATE).value
        if state is None:
            return Status.SUCCESS
        self._odometry.predict(state, self.clock.now())
        frame, camera = self.read(FRAME).value, self.read(CAMERA).value
        class_map = self.read(CLASS_MAP).value
        if frame is None or camera is None or class_map is None:
            pass  # telemetry alone
        elif self._last_s != class_map.captured_s == frame.captured_s:
            self._last_s = frame.captured_s
            height_px, width_px = class_map.ids.shape
            with self._timer:
                self._odometry.see(class_map, frame, camera.resized(width_px, height_px))
        motion = self._odometry.estimate
        if motion is not None:
            self.write(ODOMETRY, motion, captured_s=motion.pose.time_s)
        return Status.SUCCESS
