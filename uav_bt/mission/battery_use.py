"""The share of the battery that a flight uses in a minute."""

from __future__ import annotations

from typing import Final

_STEP: Final = 0.01  # of a battery that reports whole per cent
_LEAST_S: Final = 20.0  # of flight before the use is known; chosen


class BatteryUse:
    """Measures the mean use of a battery since the last take-off.

    A battery that reports whole per cent may have lost almost a step more than it shows. The step
    is counted, so that the use is overestimated at first and never underestimated.
    """

    def __init__(self) -> None:
        self._begin: tuple[float, float] | None = None  # time and charge at the take-off
        self.per_min: float | None = None  # None while unknown

    def update(self, now_s: float, charge: float | None, *, flying: bool) -> None:
        """Add a measurement.

        Args:
            now_s: Mission clock, seconds.
            charge: Charge of the battery, 0 to 1; None where it is unknown.
            flying: Whether the drone is in the air; on the ground the last value is kept.
        """
        if not flying:
            self._begin = None
            return
        if charge is None:
            return
        if self._begin is None:
            self._begin = now_s, charge
        begin_s, full = self._begin
        if now_s - begin_s >= _LEAST_S:
            used = max(full - charge, 0.0) + _STEP
            self.per_min = 60.0 * used / (now_s - begin_s)
