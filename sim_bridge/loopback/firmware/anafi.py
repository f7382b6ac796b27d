"""Firmware of the ANAFI: dispatches commands to its parts and publishes their events."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Final

from sim_bridge.loopback.codec import Message, Values
from sim_bridge.loopback.firmware.camera import Camera, Shutter
from sim_bridge.loopback.firmware.flight import Flight
from sim_bridge.loopback.firmware.moves import MoveBy
from sim_bridge.loopback.firmware.places import MoveTo, ReturnHome
from sim_bridge.loopback.firmware.states import DEVICES, Sink, States
from sim_bridge.loopback.firmware.telemetry import Battery, Telemetry
from sim_bridge.loopback.handshake import ANAFI
from sim_bridge.loopback.media import MediaStore
from sim_bridge.loopback.twin_world import TwinWorld
from sim_bridge.loopback.world import WorldState
from uav_bt.types import FlyingState

_LOG = logging.getLogger(__name__)

Handler = Callable[[Values, WorldState], None]  # executes one command

_OF_THE_SDK: Final = "mission.custom_msg_enable"  # sent to every drone; an ANAFI is silent, too


class Anafi:
    """Handles commands and publishes events for one client at a time."""

    def __init__(
        self, world: TwinWorld, *, shoot: Shutter, media: MediaStore, charge: float
    ) -> None:
        self._world = world
        self._states = states = States("drone", "common")
        self._unanswered: set[str] = set()
        half = len(ANAFI.serial) // 2
        states.begin("common.SettingsState.ProductNameChanged", name=ANAFI.name)
        states.begin("common.SettingsState.ProductSerialHighChanged", high=ANAFI.serial[:half])
        states.begin("common.SettingsState.ProductSerialLowChanged", low=ANAFI.serial[half:])
        flight = Flight(world, states)
        self.battery = Battery(flight, charge)
        self._return_home = ReturnHome(flight)
        camera = Camera(world, states, shoot, media, self._warn)
        telemetry = Telemetry(flight)
        self._handlers: dict[str, Handler] = {
            **flight.handlers,
            **MoveBy(flight).handlers,
            **MoveTo(flight).handlers,
            **self._return_home.handlers,
            **camera.handlers,
        }
        # The end of a movement is published before the hovering that follows.
        self._updates: tuple[Callable[[WorldState], None], ...] = (
            flight.travel.update,
            self._return_home.update,
            flight.update,
            self.battery.update,
            camera.update,
            telemetry.update,
        )
        self.update()

    def connected(self, sink: Sink) -> None:
        """Start sending events to a client."""
        self._states.sink = sink
        self._return_home.link_lost_s = None

    def disconnected(self) -> None:
        """Return home unless a client connects in time; until then the sticks expire."""
        self._states.sink = None
        state = self._world.state()
        if state.flying is FlyingState.LANDED:
            self.battery.exchange()
        self._return_home.link_lost_s = state.captured_s

    def handle(self, command: Message) -> None:
        """Execute a command; one that is not answered has no effect."""
        if any(command.values.get(device) for device in DEVICES):
            return  # of a camera or gimbal that an ANAFI does not have
        handler = self._handlers.get(command.name)
        if handler is not None:
            handler(command.values, self._world.state())
        elif not self._states.answer(command):
            self._warn(command.name)

    def update(self) -> None:
        """Observe the body and publish changes."""
        state = self._world.state()
        for update in self._updates:
            update(state)

    def _warn(self, command: str) -> None:
        """Log a command that is not answered, once: clients continue to poll."""
        if command != _OF_THE_SDK and command not in self._unanswered:
            self._unanswered.add(command)
            _LOG.warning("%s is not answered by the loopback: it has no effect", command)
