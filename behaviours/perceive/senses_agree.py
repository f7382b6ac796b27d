"""SensesAgree: do camera file, height and networks agree? With it a tree lands when they do not."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, Final

from behaviours.fly.leaf_clock import LeafClock
from uav_bt.board import CAMERA, CLASS_MAP, FRAME, ODOMETRY, RELATIVE_DEPTH
from uav_bt.board.context import MissionContext
from uav_bt.tree import Leaf, Port, Status

if TYPE_CHECKING:
    from perception.depth.confidence import Confidence

_SAME_S: Final = 1e-6  # times that differ by less are equal
_FEWEST: Final = 3  # frames with an answer in a window
_ADVICE: Final = "is the camera file that of this drone, and is the take-off surface stated?"


class SensesAgree(Leaf):
    """SUCCESS while camera, height and networks agree; FAILURE when they do not for a while.

    Two checks, each over a window. A network whose depth is in heights of the camera (`any`) must
    see the ground as the plane that camera file and pitch give: their agreement, 0 to 1, is
    `least` on average. The ground must pass below the drone as far as telemetry reports, within
    the factor `stretch`: otherwise height or focal length is wrong, or telemetry's velocity. What
    is not measured contradicts nothing.
    """

    condition = True
    ports = (
        Port(
            "least",
            float,
            default=0.3,
            least=0,
            most=1,
            doc="least mean agreement of the network's depth with the ground's plane; 0: no check",
        ),
        Port(
            "stretch",
            float,
            default=1.25,
            least=1,
            most=10,
            doc="largest factor between the ways by the ground and by telemetry; 10: no check",
        ),
        Port("for_s", float, default=3.0, least=0.5, most=600, doc="length of the window, s"),
    )
    reads = (FRAME, CLASS_MAP, CAMERA, RELATIVE_DEPTH, ODOMETRY)

    def on_setup(self, mission: MissionContext) -> None:
        """Start without a history."""
        # Late: OpenCV is heavy.
        from perception.depth.plane_check import agreement_with_plane  # noqa: PLC0415

        self._compare = agreement_with_plane
        self._generator = mission.rng(self.path)
        self._clock = LeafClock(mission.clock)
        self._last_index = -1
        self._agreements: deque[tuple[float, float, str]] = deque()  # time, s; value; reason
        self._stretched_since_s: float | None = None

    def update(self) -> Status:
        """Compare the newest frame, and judge the window."""
        if self._clock.tick() > 0:
            self._agreements.clear()
            self._stretched_since_s = None
        now_s = self._clock.now()
        found = self._look()
        if found is not None:
            self._agreements.append((now_s, found.value or 0.0, found.reason))
        self.feedback_message = self._against_plane(now_s) or self._against_telemetry(now_s)
        return Status.FAILURE if self.feedback_message else Status.SUCCESS

    def _look(self) -> Confidence | None:
        frame, camera = self.read(FRAME).value, self.read(CAMERA).value
        class_map, relative = self.read(CLASS_MAP).value, self.read(RELATIVE_DEPTH).value
        if frame is None or camera is None or class_map is None or relative is None:
            return None
        if frame.index == self._last_index:
            return None
        self._last_index = frame.index
        return self._compare(relative, class_map, frame, camera, self._generator)

    def _against_plane(self, now_s: float) -> str:
        """Return why the window's depth contradicts the plane; empty if it does not."""
        began_s, known = now_s - self.port_value("for_s") + _SAME_S, self._agreements
        if known and known[-1][0] <= began_s:
            known.clear()  # nothing was measured within the window
        while len(known) > 1 and known[1][0] <= began_s:
            known.popleft()
        full = bool(known) and known[0][0] <= began_s
        if not full or len(known) < _FEWEST:
            return ""
        mean = sum(value for _, value, _ in known) / len(known)
        if mean >= self.port_value("least"):
            return ""
        return f"the network's depth contradicts the ground's plane ({known[-1][2]}): {_ADVICE}"

    def _against_telemetry(self, now_s: float) -> str:
        """Return why the motion over the ground contradicts telemetry; empty if it does not."""
        motion, most = self.read(ODOMETRY).value, math.log(self.port_value("stretch"))
        factor = None if motion is None else motion.stretch
        apart = factor is not None and (factor <= 0.0 or abs(math.log(factor)) > most)
        if not apart or factor is None:
            self._stretched_since_s = None
            return ""
        if self._stretched_since_s is None:
            self._stretched_since_s = now_s
        if now_s - self._stretched_since_s < self.port_value("for_s") - _SAME_S:
            return ""
        return f"the ground passes {factor:.2f} times as fast as telemetry says: {_ADVICE}"
