"""Firmware of a SkyController 3: forwards messages and arbitrates pilot and client."""

from __future__ import annotations

import math
from typing import Final

from sim_bridge.loopback.codec import Message
from sim_bridge.loopback.firmware.anafi import Anafi
from sim_bridge.loopback.firmware.states import Sink, States
from sim_bridge.loopback.handshake import ANAFI, SKYCONTROLLER
from sim_bridge.loopback.twin_world import TwinWorld

_PERIOD_S: Final = 0.05  # time between two attitudes of the remote control; measured by others
_ATTITUDE: Final = "skyctrl.SkyControllerState.AttitudeChanged"
_SOURCE: Final = "skyctrl.CoPilotingState.pilotingSource"


class RemoteControl:
    """Firmware of the remote control; the server drives it instead of the drone's firmware.

    The pilot has control until a client requests it, and again after the client leaves.
    """

    def __init__(self, anafi: Anafi, world: TwinWorld) -> None:
        self._anafi = anafi
        self._world = world
        self._states = States("remote_control", "skyctrl")
        self._attitude_s = -math.inf
        self._states.begin(
            "skyctrl.SettingsState.ProductSerialChanged", serialNumber=SKYCONTROLLER.serial
        )
        self._states.begin(
            "drone_manager.connection_state",
            state="connected",
            serial=ANAFI.serial,
            model=ANAFI.model,
            name=ANAFI.name,
        )

    def connected(self, sink: Sink) -> None:
        """Start sending events of the drone and of the remote control to a client."""
        self._states.sink = sink
        self._anafi.connected(sink)

    def disconnected(self) -> None:
        """Give control to the pilot."""
        self._states.sink = None
        self._states.set(_SOURCE, source="SkyController")
        self._anafi.disconnected()

    def handle(self, command: Message) -> None:
        """Execute a command, or forward it to the drone; the sticks are those of one of both."""
        client_flies = self._states.value(_SOURCE, "source") == "Controller"
        if not self._states.answer(command) and (
            client_flies or command.name != "ardrone3.Piloting.PCMD"
        ):
            self._anafi.handle(command)

    def update(self) -> None:
        """Update the drone; publish the attitude of the remote control when due."""
        self._anafi.update()
        now_s = self._world.state().captured_s
        if now_s - self._attitude_s >= _PERIOD_S:
            self._attitude_s = now_s
            self._states.refresh(_ATTITUDE)
