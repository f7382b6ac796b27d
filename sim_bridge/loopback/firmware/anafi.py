"""Firmware of the ANAFI: dispatches commands to its parts and publishes their events."""

from __future__ import annotations

import logging
from typing import Final

from sim_bridge.loopback.codec import Received
from sim_bridge.loopback.firmware.camera import Camera, Gimbal, Shutter
from sim_bridge.loopback.firmware.core import Core, Part, Travel
from sim_bridge.loopback.firmware.moves import MoveBy, MoveTo
from sim_bridge.loopback.firmware.piloting import Flight, Piloting
from sim_bridge.loopback.firmware.publisher import Handler, Publisher, Sink, Values
from sim_bridge.loopback.firmware.return_to_home import ReturnToHome
from sim_bridge.loopback.firmware.settings import Settings
from sim_bridge.loopback.firmware.storage import Storage
from sim_bridge.loopback.firmware.telemetry_events import (
    Battery,
    BatteryOptions,
    Telemetry,
    publish_identity,
)
from sim_bridge.loopback.firmware.zoom import Zoom
from sim_bridge.loopback.handshake import Identity
from sim_bridge.loopback.media import MediaStore
from sim_bridge.loopback.messages import MessageTable
from sim_bridge.loopback.world import World, WorldState
from uav_bt.types import FlyingState, Hover

_LOG = logging.getLogger(__name__)

# Commands that the SDK sends to every drone; an ANAFI does not answer them either.
_OF_THE_SDK: Final = frozenset(
    {"mission.custom_msg_enable", "generic.custom_cmd", "generic.custom_evt"}
)
# Commands that scripts for the ANAFI try, but that Parrot documents for other drones.
_OTHER_DRONES: Final = frozenset(
    {
        "ardrone3.Piloting.CancelMoveBy",
        "ardrone3.Piloting.CancelMoveTo",
        "ardrone3.Piloting.SmartTakeOffLand",
    }
)


class Anafi:
    """Handles commands and publishes events for one client at a time.

    Args:
        world: the simulated body.
        table: the known messages.
        identity: name and serial number.
        battery: charge, life and thresholds.
        gps: whether there is a GPS fix.
        shoot: takes a photograph; None makes photographs fail.
        media: stores photographs; None makes a new store.
    """

    def __init__(
        self,
        world: World,
        table: MessageTable,
        *,
        identity: Identity | None = None,
        battery: BatteryOptions | None = None,
        gps: bool = True,
        shoot: Shutter | None = None,
        media: MediaStore | None = None,
    ) -> None:
        identity = identity or Identity()
        # An empty store is false, so `or` would replace it.
        media = MediaStore() if media is None else media
        self._world = world
        self._publisher = Publisher(table)
        publish_identity(self._publisher, identity, gps=gps)
        settings = Settings(self._publisher)
        settings.change("common.SettingsState.ProductNameChanged", name=identity.name)
        self._travel = Travel(world)
        core = Core(
            publisher=self._publisher,
            world=world,
            settings=settings,
            travel=self._travel,
            interrupt=self._stop_moving,
            gps=gps,
        )
        self._warned: set[str] = set()
        flight = Flight(core)
        self.battery = Battery(core, flight, battery or BatteryOptions())
        self._move_to = MoveTo(core)
        self._return_to_home = ReturnToHome(core, flight)
        self._piloting = Piloting(core, self._claim_sticks)
        gimbal = Gimbal(core)
        self.zoom = Zoom(core)
        # The end of a movement is published before the hovering that follows.
        self._parts: tuple[Part, ...] = (
            MoveBy(core),
            self._move_to,
            self._return_to_home,
            self._piloting,
            flight,
            gimbal,
            self.battery,
            self.zoom,
            Camera(core, shoot, media),
            Storage(core, media),
            Telemetry(core, gimbal),
        )
        self._handlers: dict[str, Handler] = {
            "common.Common.AllStates": self._all_states,
            "common.Settings.AllSettings": self._all_settings,
            "common.Common.Reboot": lambda _, __: None,
            **settings.handlers,
        }
        for part in self._parts:
            self._handlers.update(part.handlers)
        self.update()

    def connected(self, sink: Sink) -> None:
        """Start sending events to a client."""
        self._publisher.sink = sink
        self._return_to_home.link_lost_s = None

    def disconnected(self) -> None:
        """Centre the sticks; return home unless a client connects in time."""
        self._publisher.sink = None
        self._piloting.release()
        state = self._world.state()
        if state.flying is FlyingState.LANDED:
            self.battery.exchange()
        elif not self._travel.running:
            self._world.move(Hover())
        self._return_to_home.link_lost_s = state.time_s

    def handle(self, command: Received) -> None:
        """Execute a command; one that is not simulated has no effect."""
        handler = self._handlers.get(command.type.name)
        if handler is None:
            name = command.type.name
            # Clients continue to poll, so each command is logged only once.
            if name not in self._warned | _OF_THE_SDK:
                self._warned.add(name)
                _LOG.warning(
                    "%s is %s: it has no effect",
                    name,
                    "not a command of the ANAFI" if name in _OTHER_DRONES else "not simulated",
                )
            return
        handler(command.values, self._world.state())

    def update(self) -> None:
        """Observe the body and publish changes."""
        state = self._world.state()
        self._travel.update(state)
        for part in self._parts:
            part.update(state)

    def _stop_moving(self) -> None:
        state = self._world.state()
        self._piloting.release()
        self._return_to_home.interrupted()
        self._travel.interrupt(state)

    def _claim_sticks(self) -> bool:
        """Let deflected sticks interrupt a moveBy or a return to home, but not a moveTo."""
        if self._move_to.running:
            return False
        self._stop_moving()
        return True

    def _all_states(self, _values: Values, _state: WorldState) -> None:
        self._publisher.replay(settings=False)
        self._publisher.notify("common.CommonState.AllStatesChanged")

    def _all_settings(self, _values: Values, _state: WorldState) -> None:
        self._publisher.replay(settings=True)
        self._publisher.notify("common.SettingsState.AllSettingsChanged")
