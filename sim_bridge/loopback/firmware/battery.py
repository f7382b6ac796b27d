"""The battery, and the alerts that come with its end."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from sim_bridge.loopback.firmware.announcer import Announcer
from sim_bridge.loopback.firmware.flight import AIRBORNE, Flight
from sim_bridge.loopback.firmware.part import Handler
from sim_bridge.loopback.world import WorldState
from uav_bt.errors import ValueRangeError
from uav_bt.types import FlyingState

__all__ = ["Battery", "BatteryOptions"]


@dataclass(frozen=True, kw_only=True)
class BatteryOptions:
    """How full it is, and how long it lasts.

    Raises:
        ValueRangeError: a value is out of its range.
    """

    charge: float = 1.0  # 0 to 1, at first and again whenever it is changed on the ground
    life_s: float = 1500.0  # s in the air from full to empty, the ANAFI's 25 minutes
    low: float = 0.2  # share at which it warns
    critical: float = 0.1  # share at which it lands by itself

    def __post_init__(self) -> None:
        if not (0.0 <= self.charge <= 1.0 and self.life_s > 0.0):
            raise ValueRangeError(
                f"a battery's charge lies within 0 and 1, its life is positive, got {self}"
            )


class _Level(enum.Enum):
    GOOD = ("none", "none")
    LOW = ("low_battery", "warning")
    CRITICAL = ("critical_battery", "critical")


_ALERTS: Final = (
    "power_level",
    "too_hot",
    "too_cold",
    "gauge_too_old",
    "authentication_failure",
    "lost_comm",
)


class Battery:
    """Drains in the air; a critical one makes the drone land."""

    def __init__(self, announcer: Announcer, flight: Flight, options: BatteryOptions) -> None:
        """Put it in.

        Args:
            announcer: told the charge and the alerts.
            flight: lands.
            options: how full it is and how long it lasts.
        """
        self._announcer = announcer
        self._flight = flight
        self._options = options
        self._charge = options.charge
        self._updated_s: float | None = None
        self._level: _Level | None = None
        announcer.state("battery.health", state_of_health=100)
        announcer.state("battery.cycle_count", count=1)
        announcer.state("battery.reliability", is_charge_level_reliable=1)
        self._tell()

    @property
    def charge(self) -> float:
        """How full it is, 0 to 1."""
        return self._charge

    def handlers(self) -> Mapping[str, Handler]:
        """Nothing to obey."""
        return {}

    def exchange(self) -> None:
        """Put the first charge back."""
        self._charge = self._options.charge
        self._tell()

    def update(self, state: WorldState) -> None:
        """Drain while the motors turn; land with the last of it."""
        elapsed = 0.0 if self._updated_s is None else state.time_s - self._updated_s
        self._updated_s = state.time_s
        if state.flying in (*AIRBORNE, FlyingState.TAKING_OFF, FlyingState.LANDING):
            self._charge = max(0.0, self._charge - elapsed / self._options.life_s)
        self._tell()
        if self._level is _Level.CRITICAL and state.flying in AIRBORNE:
            self._flight.land()

    def _tell(self) -> None:
        percent = round(100.0 * self._charge)
        self._announcer.state("common.CommonState.BatteryStateChanged", percent=percent)
        level = _Level.GOOD
        if self._charge <= self._options.critical:
            level = _Level.CRITICAL
        elif self._charge <= self._options.low:
            level = _Level.LOW
        if level is self._level:
            return
        self._level = level
        self._flight.may_take_off = level is not _Level.CRITICAL
        alert, severity = level.value
        self._announcer.state("ardrone3.PilotingState.AlertStateChanged", state=alert)
        self._announcer.entries(
            "battery.alert",
            [
                {"alert": name, "level": severity if name == "power_level" else "none"}
                for name in _ALERTS
            ],
        )
