"""What the firmware is made of, and what its parts share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from sim_bridge.loopback.firmware.publisher import Handler, Publisher
from sim_bridge.loopback.firmware.settings import Settings
from sim_bridge.loopback.firmware.travel import Travel
from sim_bridge.loopback.world import World, WorldState


@dataclass(frozen=True, kw_only=True)
class Core:
    """What the parts of the firmware share."""

    publisher: Publisher
    world: World
    settings: Settings
    travel: Travel  # carries relative movements out
    interrupt: Callable[[], None]  # ends whatever moves the drone

    @property
    def ceiling_m(self) -> float:
        """The greatest altitude, m above the take-off point: set by a client, or the world's."""
        highest: float = self.settings.value("ardrone3.PilotingSettingsState.MaxAltitudeChanged")
        return min(highest, self.world.limits.ceiling_m)


class Part:
    """One part of the firmware.

    Args:
        core: what it shares with the others.
    """

    def __init__(self, core: Core) -> None:
        self._core = core

    def handlers(self) -> Mapping[str, Handler]:
        """Return the commands it handles, by name."""
        return {}

    def update(self, state: WorldState) -> None:
        """React to a new state of the world; `state.time_s` is the time."""
