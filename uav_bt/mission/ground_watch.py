"""What the ground shows, held against telemetry: a velocity that is wrong, or a drift unnoticed."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import Final

from uav_bt.mission.lasting import Lasting
from uav_bt.types.dead_reckoning import MotionEstimate

_LOG: Final = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class GroundWatchConfig:
    """When ground and telemetry disagree.

    Attributes:
        off_mps: a velocity estimate is off by less ...
        off_s: ... or not for so long.
    """

    off_mps: float = 0.08
    off_s: float = 3.0


class GroundWatch:
    """Says when the ground moves otherwise than telemetry's velocity, beyond what can be wrong.

    The mission flies by the ground then, as it does anyway (`uav_bt.mission.position_hold`).

    Args:
        config: when they disagree.
    """

    def __init__(self, config: GroundWatchConfig | None = None) -> None:
        self._config = config or GroundWatchConfig()
        self._off = Lasting()
        self.warning: str | None = None  # while they disagree

    def update(self, motion: MotionEstimate | None, now_s: float) -> None:
        """Look at the estimate of a tick.

        Args:
            motion: how the drone moves over the ground, None where nothing shows it.
            now_s: mission clock.
        """
        off_mps = 0.0
        if motion is not None:
            off_mps = math.hypot(motion.error.forward_mps, motion.error.right_mps)
        lasted_s = self._off.update(now_s, holds=off_mps > self._config.off_mps)
        if off_mps <= self._config.off_mps:
            self.warning = None
        elif lasted_s > self._config.off_s and self.warning is None:
            self.warning = (
                f"the ground moves by {off_mps:.2f} m/s otherwise than the drone's velocity says: "
                "it drifts without noticing, or reports a wrong velocity; the ground is flown by"
            )
            _LOG.warning("%s", self.warning)
