"""The control student as a leaf policy: a network that reads frames instead of perception results.

`policy="student"` uses the network that comes with the package, `policy="student:FILE.onnx"`
another one. The tree needs `<RememberViews/>` before the leaves that fly.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from perception.control.ego_state import EgoState, state_vector
from perception.control.runtime import SHIPPED_STUDENT, ControlEstimate, OnnxControlStudent
from perception.networks.named import check_onnx
from uav_bt.answers import Advance, Blocked
from uav_bt.errors import MissionError, ValueRangeError
from uav_bt.protocols import PolicyView
from uav_bt.types import PastView

_KEPT: Final = 48  # images at the network's size: 4 s at 10 frames a second, and 8 spare


@dataclass(frozen=True, kw_only=True)
class StudentPolicyConfig:
    """How the network's outputs become a movement."""

    advance_at: float = 0.5  # probability of "advance" above which the drone advances
    # Reduction of advance_at after each full turn without a free path; the rules relax likewise.
    relief: float = 0.1
    max_full_turns: int = 3  # full turns after which advance_at falls no further
    shortest_step_m: float = 0.3  # the shortest step of the rules in the training data
    longest_step_m: float = 1.0  # the longest step of the rules in the training data
    turn_rad: float = math.radians(30)  # one correction, as in the rules

    def __post_init__(self) -> None:
        if not 0.0 < self.shortest_step_m <= self.longest_step_m:
            raise ValueRangeError(f"steps must be positive and in order, got {self}")
        if not 0.0 <= self.relief * self.max_full_turns < self.advance_at < 1.0:
            raise ValueRangeError(f"the way must not be free by relief alone, got {self}")


class StudentPolicy:
    """The network as a leaf policy. Its only state is a cache of resized images."""

    def __init__(
        self, weights: Path = SHIPPED_STUDENT, *, config: StudentPolicyConfig | None = None
    ) -> None:
        """Load the network.

        Args:
            weights: its ONNX file.
            config: how its outputs become a movement.

        Raises:
            WeightsError: the file cannot be used.
        """
        self._config = config or StudentPolicyConfig()
        self._student = OnnxControlStudent(weights)
        self._images: OrderedDict[tuple[int, float], NDArray[np.uint8]] = OrderedDict()

    @classmethod
    def from_text(cls, text: str) -> Self:
        """Return the policy of a network's file, for `policy="student:FILE.onnx"`."""
        return cls(Path(text))

    @staticmethod
    def look_up(text: str) -> None:
        """Check the network's file; raises WeightsError if it is absent or not ONNX."""
        check_onnx(Path(text), "`uav-bt net train student`")

    def decide(self, view: PolicyView) -> Advance | Blocked:
        """Return an advance or a turn. A turn keeps its direction until the path is free.

        Raises:
            MissionError: no recent views are on the board.
            AnswerError: an output of the network is not a finite number.
        """
        if view.recent is None:
            raise MissionError(
                "policy 'student' needs the pixels of the last second, and none are on the board: "
                "put <RememberViews/> ahead of the leaves that fly"
            )
        views = [view.recent.ago(age_s) for age_s in self._student.config.ages_s]
        ego = EgoState(
            height_above_ground_m=view.height_above_ground_m,
            gimbal_pitch_rad=view.gimbal_pitch_rad,
            turning=view.turning,
            full_turns=view.full_turns,
        )
        estimate = self._student.estimate(
            [self._image(past) for past in views],
            state_vector(ego, [past.pose for past in views]),
        )
        return self._answer(estimate, view)

    def _answer(self, estimate: ControlEstimate, view: PolicyView) -> Advance | Blocked:
        cfg = self._config
        wanted = cfg.advance_at - cfg.relief * min(view.full_turns, cfg.max_full_turns)
        free_m = min(max(estimate.free_m, 0.0), cfg.longest_step_m)
        ends = estimate.ground_ends > 0.5
        # The drone turns away from an edge even if the path is free of obstacles, as in the rule.
        if estimate.advance > wanted and not ends:
            step_m = min(max(estimate.step_m, cfg.shortest_step_m), cfg.longest_step_m)
            return Advance(
                forward_m=step_m,
                reason=f"clear {estimate.advance:.2f}",
                free_m=free_m,
            )
        yaw_rad = math.copysign(cfg.turn_rad, view.turning or estimate.clockwise - 0.5)
        reason = f"{'edge' if ends else 'obstacle'} {estimate.advance:.2f}"
        return Blocked(yaw_rad=yaw_rad, ground_ends=ends, reason=reason, free_m=free_m)

    def _image(self, past: PastView) -> NDArray[np.uint8]:
        """Return the image of a view at the network's input size; each is resized once."""
        key = (past.frame.index, past.frame.captured_s)
        if key not in self._images:
            self._images[key] = self._student.preprocess(past.frame.image)
            if len(self._images) > _KEPT:
                self._images.popitem(last=False)
        return self._images[key]
