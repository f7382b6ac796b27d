"""Factor between the displacements that frames show and those that telemetry reports.

The displacement over the ground is measured in angles and becomes metres by the height and the
focal length. If one of them is wrong by a factor, so are all displacements, whatever their
direction. A drift or a bias of telemetry's velocity adds the same to all of them. A regression of
the seen on the reported velocities, in the body frame and about their means, separates the two: the
slope is the factor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

_LEAST: Final = 1e-9


@dataclass(frozen=True, kw_only=True)
class StretchConfig:
    """When the factor is known. All numbers are chosen.

    Attributes:
        forget_s: Time constant with which displacements are forgotten, s.
        error: Largest standard error of a factor that is returned. The errors of successive
            displacements are alike, and the true error is about twice as large.
        varied_mps: Least standard deviation of the reported velocities, m/s: a drone that hovers
            shows no factor.
    """

    forget_s: float = 20.0
    error: float = 0.04
    varied_mps: float = 0.08


class Stretch:
    """Regression of seen on reported velocities, with forgetting.

    Args:
        config: When the factor is known.
    """

    def __init__(self, config: StretchConfig | None = None) -> None:
        self._config = config or StretchConfig()
        self._steps = 0.0  # weighted number of displacements
        self._seen = self._reported = self._product = 0j  # weighted sums
        self._seen2 = self._reported2 = 0.0

    def add(
        self, seen_mps: tuple[float, float], reported_mps: tuple[float, float], passed_s: float
    ) -> None:
        """Add a displacement, as mean velocities between two frames.

        Args:
            seen_mps: Forward and right in the body frame, measured on the ground.
            reported_mps: The same by telemetry.
            passed_s: Time between the frames.
        """
        keeps = math.exp(-passed_s / self._config.forget_s)
        seen, reported = complex(*seen_mps), complex(*reported_mps)
        self._steps = keeps * self._steps + 1.0
        self._seen = keeps * self._seen + seen
        self._reported = keeps * self._reported + reported
        self._product = keeps * self._product + reported.conjugate() * seen
        self._seen2 = keeps * self._seen2 + abs(seen) ** 2
        self._reported2 = keeps * self._reported2 + abs(reported) ** 2

    @property
    def factor(self) -> float | None:
        """Seen over reported displacement; None while it is not known well enough."""
        cfg, steps = self._config, self._steps
        if steps < 2.0:
            return None
        varied = self._reported2 - abs(self._reported) ** 2 / steps
        if varied < steps * cfg.varied_mps**2:
            return None
        shared = (self._product - self._reported.conjugate() * self._seen / steps).real
        rest = self._seen2 - abs(self._seen) ** 2 / steps - shared**2 / varied
        if math.sqrt(max(rest, _LEAST) / steps / varied) > cfg.error:
            return None
        return shared / varied
