"""Compares the motion over the ground with telemetry: a wrong velocity, an unnoticed drift."""

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
    """Thresholds of a disagreement between ground and telemetry.

    Attributes:
        off_mps: greatest error of telemetry's velocity, m/s. Chosen: four times the noise of the
            twin's velocity (0.02 m/s).
        off_s: shortest duration of a reported error, seconds. Chosen: twice the correlation time of
            the twin's gusts.
    """

    off_mps: float = 0.08
    off_s: float = 3.0


class GroundWatch:
    """Reports a difference between the motion over the ground and telemetry's velocity.

    The mission flies by the ground in any case (`uav_bt.mission.position_hold`).

    Args:
        config: thresholds.
    """

    def __init__(self, config: GroundWatchConfig | None = None) -> None:
        self._config = config or GroundWatchConfig()
        self._off = Lasting()
        self.warning: str | None = None  # while they disagree

    def update(self, motion: MotionEstimate | None, now_s: float) -> None:
        """Check the estimate of a tick.

        Args:
            motion: over the ground; None where it is unknown.
            now_s: mission clock, seconds.
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
                "it drifts without noticing, or reports a wrong velocity; flying by vision instead"
            )
            _LOG.warning("%s", self.warning)
