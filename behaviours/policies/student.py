"""The control student as a leaf policy: a network that reads frames instead of perception results.

`policy="student"` uses the network that comes with the package, `policy="student:FILE.onnx"`
another one. The tree needs `<RememberViews/>` before the leaves that fly.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from pathlib import Path
from typing import Final, Self

from perception.control.ego_state import state_vector
from perception.control.runtime import SHIPPED_STUDENT, OnnxControlStudent
from perception.networks.weights_file import check_onnx
from uav_bt.answers import Advance, Blocked
from uav_bt.errors import MissionError
from uav_bt.protocols import PolicyView
from uav_bt.types import PastView
from uav_bt.types.arrays import Image

_KEPT: Final = 48  # images at the network's size: 4 s at 10 frames a second, and 8 spare
_ADVANCE_AT: Final = 0.5  # probability of "advance" above which the drone advances
# Reduction of that after each full turn without a free path; the rules relax likewise.
_RELIEF: Final = 0.1
_MAX_FULL_TURNS: Final = 3  # full turns after which it falls no further
# The shortest and the longest step of the rules in the training data.
_SHORTEST_STEP_M: Final = 0.3
_LONGEST_STEP_M: Final = 1.0
_TURN_RAD: Final = math.radians(30)  # one correction, as in the rules


class StudentPolicy:
    """The network as a leaf policy. Its only state is a cache of resized images."""

    def __init__(self, weights: Path = SHIPPED_STUDENT) -> None:
        """Load the network from its ONNX file."""
        self._student = OnnxControlStudent(weights)
        self._images: OrderedDict[tuple[int, float], Image] = OrderedDict()

    @classmethod
    def from_text(cls, text: str) -> Self:
        """Return the policy of a network's file, for `policy="student:FILE.onnx"`."""
        return cls(Path(text))

    @staticmethod
    def look_up(text: str) -> None:
        """Check the network's file; raises WeightsError if it is absent or not ONNX."""
        check_onnx(Path(text), "`uav-bt net train student`")

    def decide(self, view: PolicyView) -> Advance | Blocked:
        """Return an advance or a turn. A turn keeps its direction until the path is free."""
        if view.recent is None:
            raise MissionError(
                "policy 'student' needs the pixels of the last second, and none are on the board: "
                "put <RememberViews/> ahead of the leaves that fly"
            )
        views = [view.recent.ago(age_s) for age_s in self._student.config.ages_s]
        state = state_vector(
            [past.pose for past in views],
            height_above_ground_m=view.height_above_ground_m,
            gimbal_pitch_rad=view.gimbal_pitch_rad,
            turning=view.turning,
            full_turns=view.full_turns,
        )
        estimate = self._student.estimate([self._image(past) for past in views], state)
        wanted = _ADVANCE_AT - _RELIEF * min(view.full_turns, _MAX_FULL_TURNS)
        free_m = min(max(estimate.free_m, 0.0), _LONGEST_STEP_M)
        ends = estimate.ground_ends > 0.5
        # The drone turns away from an edge even if the path is free of obstacles, as in the rule.
        if estimate.advance > wanted and not ends:
            step_m = min(max(estimate.step_m, _SHORTEST_STEP_M), _LONGEST_STEP_M)
            reason = f"clear {estimate.advance:.2f}"
            return Advance(forward_m=step_m, reason=reason, free_m=free_m)
        yaw_rad = math.copysign(_TURN_RAD, view.turning or estimate.clockwise - 0.5)
        reason = f"{'edge' if ends else 'obstacle'} {estimate.advance:.2f}"
        return Blocked(yaw_rad=yaw_rad, ground_ends=ends, reason=reason, free_m=free_m)

    def _image(self, past: PastView) -> Image:
        """Return the image of a view at the network's input size; each is resized once."""
        key = (past.frame.index, past.frame.captured_s)
        if key not in self._images:
            self._images[key] = self._student.preprocess(past.frame.image)
            if len(self._images) > _KEPT:
                self._images.popitem(last=False)
        return self._images[key]
