"""A landing by velocities, which hold the place, until the drone's own landing takes over."""

from __future__ import annotations

from dataclasses import dataclass

from uav_bt.settings import check_numbers


@dataclass(frozen=True, kw_only=True)
class HeldLandingConfig:
    """Speed and end of a held landing.

    Attributes:
        speed_per_s: speed per metre of height above the surface below, 1/s. Chosen: from 0.75 m
            down the drone slows, and arrives at `own_from_m` with the least speed.
        least_mps: least speed, metres per second. Chosen: below the 0.25 m/s of the
            twin's touch-down.
        most_mps: greatest speed, metres per second. Chosen: the twin's own landing has 0.5 m/s.
        own_from_m: height at which the drone's own landing takes over, metres. Chosen: the own
            landing then lasts 0.8 s in the twin, in which a drift of 0.1 m/s makes 8 cm.
        overrun: the drone's own landing also takes over when the ordered descent exceeds this many
            times the height at the begin, because the height does not sink as ordered. Chosen:
            from 0.6 m above a landing box the drone may drift off the box, which adds 0.4 m.

    Raises:
        ValueRangeError: a number is not positive, or the speeds are out of order.
    """

    speed_per_s: float = 0.6
    least_mps: float = 0.2
    most_mps: float = 0.45
    own_from_m: float = 0.2
    overrun: float = 1.5

    def __post_init__(self) -> None:
        check_numbers(self, {"most_mps": self.least_mps, "overrun": 1.0})


class HeldLanding:
    """Gives the vertical speed of one landing, tick by tick.

    Args:
        config: speed and end.
        height_m: above the surface below, where the landing begins, metres.
    """

    def __init__(self, config: HeldLandingConfig, height_m: float) -> None:
        self._config = config
        self._most_m = config.overrun * height_m
        self._ordered_m = 0.0
        self._down_mps = 0.0

    def order(self, height_m: float, passed_s: float) -> float | None:
        """Return the speed of the descent, m/s; None once the drone's own landing takes over.

        Args:
            height_m: above the surface below, metres.
            passed_s: time since the last tick, seconds.
        """
        config = self._config
        self._ordered_m += self._down_mps * passed_s
        if height_m <= config.own_from_m or self._ordered_m > self._most_m:
            return None
        fast_mps = config.speed_per_s * height_m
        self._down_mps = min(max(fast_mps, config.least_mps), config.most_mps)
        return self._down_mps
