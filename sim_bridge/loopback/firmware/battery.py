"""The battery and its alerts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from sim_bridge.loopback.firmware.flight import AIRBORNE, Flight
from sim_bridge.loopback.firmware.part import Core, Part
from sim_bridge.loopback.world import WorldState
from uav_bt.errors import ValueRangeError
from uav_bt.types import FlyingState


@dataclass(frozen=True, kw_only=True)
class BatteryOptions:
    """The battery's charge, life and thresholds.

    Raises:
        ValueRangeError: a value is out of its range.
    """

    charge: float = 1.0  # 0 to 1, at first and again whenever it is changed on the ground
    life_s: float = 1500.0  # s in the air from full to empty, the ANAFI's 25 minutes
    low: float = 0.2  # share at which it warns
    critical: float = 0.1  # share at which the drone lands by itself

    def __post_init__(self) -> None:
        if not (0.0 <= self.charge <= 1.0 and self.life_s > 0.0):
            raise ValueRangeError(
                f"a battery's charge lies within 0 and 1, its life is positive, got {self}"
            )


_ALERTS: Final = (
    *("power_level", "too_hot", "too_cold"),
    *("gauge_too_old", "authentication_failure", "lost_comm"),
)


class Battery(Part):
    """Drains in the air; a critical one makes the drone land.

    Args:
        core: what the parts share.
        flight: lands.
        options: charge, life and thresholds.
    """

    def __init__(self, core: Core, flight: Flight, options: BatteryOptions) -> None:
        super().__init__(core)
        self._flight = flight
        self._options = options
        self._charge = options.charge
        self._updated_s: float | None = None
        self._severity: str | None = None  # of the power level's alert; None before the first
        core.publisher.state("battery.health", state_of_health=100)
        core.publisher.state("battery.cycle_count", count=1)
        core.publisher.state("battery.reliability", is_charge_level_reliable=1)
        self._publish()

    @property
    def charge(self) -> float:
        """The charge, 0 to 1."""
        return self._charge

    def exchange(self) -> None:
        """Restore the first charge."""
        self._charge = self._options.charge
        self._publish()

    def update(self, state: WorldState) -> None:
        """Drain while the motors turn; land when the charge is critical."""
        elapsed_s = 0.0 if self._updated_s is None else state.time_s - self._updated_s
        self._updated_s = state.time_s
        if state.flying in (*AIRBORNE, FlyingState.TAKING_OFF, FlyingState.LANDING):
            self._charge = max(0.0, self._charge - elapsed_s / self._options.life_s)
        self._publish()
        if self._severity == "critical" and state.flying in AIRBORNE:
            self._flight.land()

    def _publish(self) -> None:
        publisher = self._core.publisher
        percent = round(100.0 * self._charge)
        publisher.state("common.CommonState.BatteryStateChanged", percent=percent)
        severity, alert = "none", "none"
        if self._charge <= self._options.critical:
            severity, alert = "critical", "critical_battery"
        elif self._charge <= self._options.low:
            severity, alert = "warning", "low_battery"
        if severity == self._severity:
            return
        self._severity = severity
        self._flight.may_take_off = severity != "critical"
        publisher.state("ardrone3.PilotingState.AlertStateChanged", state=alert)
        levels = dict.fromkeys(_ALERTS, "none") | {"power_level": severity}
        publisher.entries(
            "battery.alert", [{"alert": name, "level": level} for name, level in levels.items()]
        )
