"""One command per tick: leaves propose, the arbiter decides.

Overrides come first, in the order of the safety table; then the leaves' proposals; nothing proposed
means hover. Limits clamp what is left.
"""

from __future__ import annotations

import math
from dataclasses import replace

from uav_bt.board.context import Proposals
from uav_bt.mission.safety import Circumstances, Limits, Override, rule_in_force
from uav_bt.types import Command, DroneState, Hover, MoveBy, Movement, Velocity


class Arbiter:
    """Turns proposals and circumstances into the one command of the tick."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self.override: Override | None = None  # the one in force since the last decision

    def decide(
        self,
        proposals: Proposals,
        state: DroneState,
        *,
        frame_age_s: float,
        state_age_s: float = 0.0,
        abort: bool = False,
        manual: bool = False,
        cut: bool = False,
    ) -> Command:
        """Return this tick's command.

        Args:
            proposals: what the leaves asked for in this tick.
            state: the newest drone state.
            frame_age_s: age of the newest frame, inf before the first.
            state_age_s: of the newest telemetry.
            abort: an operator or a fault wants the drone on the ground.
            manual: a person at this machine took over.
            cut: a person wants the motors off.
        """
        now = Circumstances(
            state=state,
            frame_age_s=frame_age_s,
            state_age_s=state_age_s,
            manual=manual,
            abort=abort,
            cut=cut,
        )
        rule = rule_in_force(now, self._limits)
        self.override = None if rule is None else rule.override
        if rule is None:
            movement = proposals.movement or Hover()
            return Command(movement=self._clamp(movement, state), gimbal=proposals.gimbal)
        gimbal = proposals.gimbal if rule.gimbal_too else None
        return Command(movement=rule.movement, gimbal=gimbal)

    def _clamp(self, movement: Movement, state: DroneState) -> Movement:
        limits = self._limits
        # Down is positive: the most negative step that stays below the ceiling.
        headroom_m = max(0.0, limits.ceiling_m - state.height_above_carpet_m)
        if isinstance(movement, MoveBy):
            return replace(movement, down_m=max(movement.down_m, -headroom_m))
        if isinstance(movement, Velocity):
            horizontal = math.hypot(movement.forward_mps, movement.right_mps)
            shrink = min(1.0, limits.speed_mps / horizontal) if horizontal > 0 else 1.0
            climb_mps = limits.climb_mps if headroom_m > 0 else 0.0
            return Velocity(
                forward_mps=movement.forward_mps * shrink,
                right_mps=movement.right_mps * shrink,
                down_mps=min(max(movement.down_mps, -climb_mps), limits.climb_mps),
                yaw_rate_radps=min(
                    max(movement.yaw_rate_radps, -limits.yaw_rate_radps), limits.yaw_rate_radps
                ),
            )
        return movement
