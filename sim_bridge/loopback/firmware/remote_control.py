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
        self._drone = drone
        self._publisher = Publisher(table)
        self._sink: Sink | None = None
        self._attitude_s = -math.inf
        self._source = "SkyController"
        self.linked = True  # whether the drone is connected
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
        self._publish_link()
        self.give_sticks("SkyController")

    def connected(self, sink: Sink) -> None:
        """Start sending events of the drone and of the remote control to a client."""
        self._sink = self._publisher.sink = sink
        if self.linked:
            self._anafi.connected(sink)

    def disconnected(self) -> None:
        """Give control to the pilot."""
        self._sink = self._publisher.sink = None
        self.give_sticks("SkyController")
        if self.linked:
            self._anafi.disconnected()

    def handle(self, command: Received) -> None:
        """Execute a command, or forward it to the drone."""
        name = command.type.name
        handler = self._handlers.get(name)
        if handler is not None:
            handler(command.values, self._world.state())
        elif self.linked and (name != _STICKS or self._source == "Controller"):
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

    def lose_drone(self) -> None:
        """Lose the radio link to the drone; the client's link to the remote control remains."""
        self.linked = False
        self._anafi.disconnected()
        self._publish_link()

    def find_drone(self) -> None:
        """Restore the radio link to the drone."""
        self.linked = True
        if self._sink is not None:
            self._anafi.connected(self._sink)
        self._publish_link()

    def _publish_link(self) -> None:
        named = {"serial": self._drone.serial, "model": self._drone.model, "name": self._drone.name}
        if not self.linked:
            named = {"serial": "", "model": 0, "name": ""}
        state = "connected" if self.linked else "searching"
        self._publisher.refresh("drone_manager.connection_state", state=state, **named)

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
