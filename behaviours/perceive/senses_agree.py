"""SensesAgree: do camera file, height, networks and floor agree? With it a tree lands otherwise."""

from __future__ import annotations

import math
from typing import Final

from behaviours.fly.moving_leaf import LeafClock
from uav_bt.board import CAMERA, CLASS_MAP, FRAME, ODOMETRY, RELATIVE_DEPTH
from uav_bt.board.context import MissionContext
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types.dead_reckoning import MotionEstimate

_SAME_S: Final = 1e-6  # times that differ by less are equal
_FEWEST: Final = 3  # frames with an answer in a window
_SHOWS_GROUND: Final = 0.2  # share of the image; with less, good floors are not always followed
_ADVICE: Final = "is the camera file that of this drone, and is the take-off surface stated?"
_LEAST: Final = "least mean agreement of the network's depth with the ground's plane; 0: no check"
_STRETCH: Final = "largest factor between the ways by the ground and by telemetry; 10: no check"
_FOLLOWED: Final = "least share of frames with ground whose motion is measured on it; 0: no check"


_Answers = list[tuple[float, float]]  # of frames, by time: time in s, value


def _mean(answers: _Answers, began_s: float) -> float | None:
    """Return the mean answer of a window, and drop older ones; None before the window is full."""
    if answers and answers[-1][0] <= began_s:
        answers.clear()  # nothing was measured within the window
    while len(answers) > 1 and answers[1][0] <= began_s:
        answers.pop(0)
    if len(answers) < _FEWEST or answers[0][0] > began_s:
        return None
    return sum(value for _, value in answers) / len(answers)


class SensesAgree(Leaf):
    """SUCCESS while camera, height, networks and floor agree; FAILURE when not for a while.

    Three checks, each over a window. A network whose depth is in heights of the camera (`any`) must
    see the ground as the plane that camera file and pitch give: their agreement, 0 to 1, is
    `least` on average. The ground must pass below the drone as far as telemetry reports, within
    the factor `stretch`: otherwise height or focal length is wrong, or telemetry's velocity. Where
    ground fills a fifth of the image, its motion must be measured in the share `followed` of the
    frames: a floor of one colour shows none, and the position is telemetry's alone. A quantity
    without a measurement contradicts nothing.
    """

    condition = True
    ports = (
        Port("least", float, default=0.3, least=0, most=1, doc=_LEAST),
        Port("stretch", float, default=1.25, least=1, most=10, doc=_STRETCH),
        Port("followed", float, default=0.4, least=0, most=1, doc=_FOLLOWED),
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
        self._reason = ""  # of the last agreement
        self._seen_s = -math.inf  # capture time of the last frame of the odometry
        self._forget()

    def _forget(self) -> None:
        self._agreements: _Answers = []
        self._followed: _Answers = []
        self._stretched_since_s: float | None = None

    def update(self) -> Status:
        """Compare the newest frame, and judge the window."""
        if self._clock.tick() > 0:
            self._forget()
        now_s, motion = self._clock.now(), self.read(ODOMETRY).value
        self._began_s = now_s - self.port_value("for_s") + _SAME_S  # of the window
        contradictions = (
            self._against_plane(now_s),
            self._against_telemetry(now_s, motion),
            self._plain(now_s, motion),
        )
        self.feedback_message = next(filter(None, contradictions), "")
        return Status.FAILURE if self.feedback_message else Status.SUCCESS

    def _against_plane(self, now_s: float) -> str:
        """Return why the window's depth contradicts the plane; empty if it does not."""
        frame, camera = self.read(FRAME).value, self.read(CAMERA).value
        class_map, relative = self.read(CLASS_MAP).value, self.read(RELATIVE_DEPTH).value
        if frame is None or camera is None or class_map is None or relative is None:
            pass
        elif frame.index != self._last_index:
            self._last_index = frame.index
            found = self._compare(relative, class_map, frame, camera, self._generator)
            if found is not None:
                value, self._reason = found
                self._agreements.append((now_s, value))
        mean = _mean(self._agreements, self._began_s)
        if mean is None or mean >= self.port_value("least"):
            return ""
        return f"the network's depth contradicts the ground's plane ({self._reason}): {_ADVICE}"

    def _against_telemetry(self, now_s: float, motion: MotionEstimate | None) -> str:
        """Return why the motion over the ground contradicts telemetry; empty if it does not."""
        factor = None if motion is None else motion.stretch
        most = math.log(self.port_value("stretch"))
        if factor is None or (factor > 0.0 and abs(math.log(factor)) <= most):
            self._stretched_since_s = None
            return ""
        if self._stretched_since_s is None:
            self._stretched_since_s = now_s
        if self._stretched_since_s > self._began_s:
            return ""
        return f"the ground passes {factor:.2f} times as fast as telemetry reports: {_ADVICE}"

    def _plain(self, now_s: float, motion: MotionEstimate | None) -> str:
        """Return why the motion over the floor is not measured; empty if it is."""
        if motion is not None and motion.seen.time_s != self._seen_s:
            self._seen_s = motion.seen.time_s
            if motion.ground_share is not None and motion.ground_share >= _SHOWS_GROUND:
                self._followed.append((now_s, float(motion.tracked_s == self._seen_s)))
        share = _mean(self._followed, self._began_s)
        if share is None or share >= self.port_value("followed"):
            return ""
        found = f"its motion was measured in {share:.0%} of the frames that show it"
        return f"the floor shows too little texture: {found}"
