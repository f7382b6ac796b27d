"""The ANAFI's firmware as a whole: commands in, events out, a body moved."""

from __future__ import annotations

import logging
from typing import Any

from sim_bridge.loopback.codec import Received
from sim_bridge.loopback.firmware.announcer import Announcer, Sink
from sim_bridge.loopback.firmware.battery import Battery, BatteryOptions
from sim_bridge.loopback.firmware.camera import CAMERA_SETTINGS, Camera
from sim_bridge.loopback.firmware.flight import Flight
from sim_bridge.loopback.firmware.gimbal import Gimbal
from sim_bridge.loopback.firmware.homecoming import Homecoming
from sim_bridge.loopback.firmware.identity import tell_identity
from sim_bridge.loopback.firmware.moves import Moves
from sim_bridge.loopback.firmware.part import Handler, Part
from sim_bridge.loopback.firmware.piloting import Piloting
from sim_bridge.loopback.firmware.places import Places
from sim_bridge.loopback.firmware.settings import SETTINGS, Settings
from sim_bridge.loopback.firmware.telemetry import Telemetry
from sim_bridge.loopback.firmware.travel import Travel
from sim_bridge.loopback.handshake import Identity
from sim_bridge.loopback.messages import MessageTable
from sim_bridge.loopback.world import World, WorldState
from uav_bt.types import FlyingState, Hover

__all__ = ["Anafi"]

_LOG = logging.getLogger(__name__)


class Anafi:
    """Obeys commands and tells what happens; one client at a time."""

    def __init__(
        self,
        world: World,
        table: MessageTable,
        *,
        identity: Identity | None = None,
        battery: BatteryOptions | None = None,
    ) -> None:
        """Switch it on.

        Args:
            world: the body.
            table: the messages it speaks.
            identity: who it says it is.
            battery: how full it is, and how long it lasts.
        """
        who = identity or Identity()
        self._world = world
        self._state = world.state()
        self._announcer = told = Announcer(table)
        tell_identity(told, who)
        self._settings = Settings(told, (*SETTINGS, *CAMERA_SETTINGS))
        self._settings.change("common.SettingsState.ProductNameChanged", name=who.name)
        self._travel = Travel(world)
        self._flight = Flight(told, world, self._stop_moving)
        self._battery = Battery(told, self._flight, battery or BatteryOptions())
        self._moves = Moves(told, world, self._travel, self._settings, self._stop_moving)
        self._places = Places(told, world, self._travel, self._settings, self._stop_moving)
        self._home = Homecoming(
            told,
            world,
            travel=self._travel,
            settings=self._settings,
            flight=self._flight,
            interrupt=self._stop_moving,
        )
        self._piloting = Piloting(world, self._settings, self._sticks_may_fly)
        gimbal = Gimbal(told, world, self._settings)
        # A movement's end is told before the hovering that follows it.
        self._parts: tuple[Part, ...] = (
            self._settings,
            self._moves,
            self._places,
            self._home,
            self._piloting,
            self._flight,
            gimbal,
            self._battery,
            Camera(told),
            Telemetry(told, gimbal),
        )
        self._handlers: dict[str, Handler] = {
            "common.Common.AllStates": self._all_states,
            "common.Settings.AllSettings": self._all_settings,
            "common.Common.Reboot": self._ignore,
        }
        for part in self._parts:
            self._handlers.update(part.handlers())
        self.update()

    @property
    def battery(self) -> float:
        """How full it is, 0 to 1."""
        return self._battery.charge

    def connected(self, sink: Sink) -> None:
        """Talk to a client from now on."""
        self._announcer.sink = sink
        self._home.in_company()

    def disconnected(self) -> None:
        """Nobody listens any more: centre the sticks, and go home if nobody comes back."""
        self._announcer.sink = None
        self._piloting.release()
        state = self._world.state()
        if state.flying is FlyingState.LANDED:
            self._battery.exchange()
        elif not self._travel.under_way:
            self._world.move(Hover())
        self._home.left_alone(state.time_s)

    def obey(self, command: Received) -> None:
        """Carry a command out; one that it does not know changes nothing."""
        handler = self._handlers.get(command.type.name)
        if handler is None:
            _LOG.info("not simulated: %s", command.type.name)
            return
        handler(command.values, self._world.state())

    def update(self) -> None:
        """Look at the body and tell what is new."""
        state = self._world.state()
        self._travel.update(state)
        for part in self._parts:
            part.update(state)

    def _stop_moving(self) -> None:
        state = self._world.state()
        self._piloting.release()
        self._home.interrupted()
        self._travel.interrupt(state)

    def _sticks_may_fly(self) -> bool:
        """Let pushed sticks interrupt a moveBy and the way home, but not a moveTo."""
        if self._places.running:
            return False
        self._stop_moving()
        return True

    def _all_states(self, values: Any, state: WorldState) -> None:
        del values, state
        self._announcer.replay(settings=False)
        self._announcer.note("common.CommonState.AllStatesChanged")

    def _all_settings(self, values: Any, state: WorldState) -> None:
        del values, state
        self._announcer.replay(settings=True)
        self._announcer.note("common.SettingsState.AllSettingsChanged")

    def _ignore(self, values: Any, state: WorldState) -> None:
        del values, state
