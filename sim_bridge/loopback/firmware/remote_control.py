"""Firmware of a SkyController 3: forwards messages and arbitrates pilot and client."""

from __future__ import annotations

import math
from typing import Final

from sim_bridge.loopback.codec import Received
from sim_bridge.loopback.firmware.anafi import Anafi
from sim_bridge.loopback.firmware.publisher import Handler, Publisher, Sink, Values
from sim_bridge.loopback.handshake import Identity
from sim_bridge.loopback.messages import MessageTable
from sim_bridge.loopback.world import World, WorldState

_PERIOD_S: Final = 0.05  # time between two attitudes of the remote control; measured by others
_ATTITUDE: Final = "skyctrl.SkyControllerState.AttitudeChanged"
_STICKS: Final = "ardrone3.Piloting.PCMD"


class RemoteControl:
    """Firmware of the remote control; the server drives it instead of the drone's firmware.

    The pilot has control until a client requests it, and again after the client leaves.

    Args:
        anafi: firmware of the drone.
        world: source of the time.
        table: the known messages.
        drone: name and serial number of the drone.
        identity: name and serial number of the remote control.
    """

    def __init__(
        self,
        anafi: Anafi,
        world: World,
        table: MessageTable,
        *,
        drone: Identity,
        identity: Identity,
    ) -> None:
        self._anafi = anafi
        self._world = world
        self._publisher = Publisher(table)
        self._attitude_s = -math.inf
        self._source = "SkyController"
        self._handlers: dict[str, Handler] = {
            "skyctrl.Common.AllStates": self._all_states,
            "skyctrl.Common.CurrentDateTime": self._set_time,
            "skyctrl.Settings.AllSettings": self._all_settings,
            "skyctrl.CoPiloting.setPilotingSource": self._set_source,
            "mapper.grab": self._grab,
        }
        publish = self._publisher.state
        publish("skyctrl.SettingsState.ProductSerialChanged", serialNumber=identity.serial)
        publish("skyctrl.SettingsState.ProductVersionChanged", software="1.8.2", hardware="HW_00")
        publish("skyctrl.CommonState.BootId", bootId="loopback")
        publish("skyctrl.SkyControllerState.BatteryChanged", percent=100)
        publish("skyctrl.SkyControllerState.BatteryState", state="discharging")
        publish("skyctrl.SkyControllerState.GpsFixChanged", fixed=0)
        publish("mapper.grab_state", buttons=0, axes=0, buttons_state=0)
        publish(
            "drone_manager.connection_state",
            state="connected",
            serial=drone.serial,
            model=drone.model,
            name=drone.name,
        )
        self.give_sticks("SkyController")

    def connected(self, sink: Sink) -> None:
        """Start sending events of the drone and of the remote control to a client."""
        self._publisher.sink = sink
        self._anafi.connected(sink)

    def disconnected(self) -> None:
        """Give control to the pilot."""
        self._publisher.sink = None
        self.give_sticks("SkyController")
        self._anafi.disconnected()

    def handle(self, command: Received) -> None:
        """Execute a command, or forward it to the drone."""
        name = command.type.name
        handler = self._handlers.get(name)
        if handler is not None:
            handler(command.values, self._world.state())
        elif name != _STICKS or self._source == "Controller":
            self._anafi.handle(command)

    def update(self) -> None:
        """Update the drone; publish the attitude of the remote control when due."""
        self._anafi.update()
        now_s = self._world.state().time_s
        if now_s - self._attitude_s >= _PERIOD_S:
            self._attitude_s = now_s
            self._publisher.refresh(_ATTITUDE, q0=1.0, q1=0.0, q2=0.0, q3=0.0)

    def give_sticks(self, source: str) -> None:
        """Give control to `SkyController` (the pilot) or `Controller` (the client)."""
        self._source = source
        self._publisher.refresh("skyctrl.CoPilotingState.pilotingSource", source=source)

    def _all_states(self, _values: Values, _state: WorldState) -> None:
        self._publisher.replay(settings=False)
        self._publisher.notify("skyctrl.CommonState.AllStatesChanged")

    def _all_settings(self, _values: Values, _state: WorldState) -> None:
        self._publisher.replay(settings=True)
        self._publisher.notify("skyctrl.SettingsState.AllSettingsChanged")

    def _set_time(self, values: Values, _state: WorldState) -> None:
        self._publisher.refresh("skyctrl.CommonState.CurrentDateTimeChanged", **values)

    def _set_source(self, values: Values, _state: WorldState) -> None:
        self.give_sticks(values["source"])

    def _grab(self, values: Values, _state: WorldState) -> None:
        self._publisher.refresh("mapper.grab_state", **values, buttons_state=0)
