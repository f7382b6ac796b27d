"""The remote control in front of the drone."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from sim_bridge.loopback.codec import Received, decode
from sim_bridge.loopback.firmware.remote_control import RemoteControl
from sim_bridge.loopback.handshake import Identity
from sim_bridge.loopback.messages import MessageType, message_table
from tests.sim_bridge.loopback.loopback_world import STEP_S, Bench

SOURCE = "skyctrl.CoPilotingState.pilotingSource"
TAKE = "skyctrl.CoPiloting.setPilotingSource"
LINK = "drone_manager.connection_state"
STICKS = {"flag": 1, "roll": 0, "pitch": 50, "yaw": 0, "gaz": 0, "timestampAndSeqNum": 0}


@dataclass
class Desk(Bench):
    """A client of a remote control whose drone flies in a fake world."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.remote = RemoteControl(
            self.anafi,
            self.world,
            message_table(),
            drone=Identity(),
            identity=Identity(name="remote", serial="PI040401AA0A000000"),
        )
        self.remote.connected(self.hear)

    def hear(self, _message: MessageType, payload: bytes) -> None:
        self.events.append(decode(payload, message_table()))

    def send(self, name: str, /, **values: object) -> None:
        self.remote.handle(Received(type=message_table().named(name), values=values))

    def run(self, duration_s: float) -> None:
        for _ in range(round(duration_s / STEP_S)):
            self.world.advance()
            self.remote.update()


@pytest.fixture
def desk() -> Desk:
    return Desk()


def test_it_says_who_it_is_and_that_it_has_a_drone(desk: Desk) -> None:
    desk.events.clear()
    desk.send("skyctrl.Common.AllStates")
    desk.send("skyctrl.Settings.AllSettings")
    assert desk.values(LINK)[0]["state"] == "connected"
    assert desk.values(LINK)[0]["serial"] == Identity().serial
    assert desk.values(SOURCE) == [{"source": "SkyController"}]
    assert desk.names()[-1] == "skyctrl.SettingsState.AllSettingsChanged"
    assert not [name for name in desk.names() if name.startswith(("ardrone3", "common"))]
    desk.send("common.Common.AllStates")
    assert "ardrone3.PilotingState.FlyingStateChanged" in desk.names()


def test_a_clients_sticks_count_only_while_it_has_them(desk: Desk) -> None:
    desk.fly()
    desk.send("ardrone3.Piloting.PCMD", **STICKS)
    desk.run(0.2)
    assert desk.world.state().north_m == 0.0
    desk.send(TAKE, source="Controller")
    desk.send("ardrone3.Piloting.PCMD", **STICKS)
    desk.run(0.2)
    assert desk.world.state().north_m > 0.0
    assert desk.values(SOURCE) == [{"source": "Controller"}]


def test_a_client_that_leaves_gives_the_sticks_back(desk: Desk) -> None:
    desk.send(TAKE, source="Controller")
    desk.remote.disconnected()
    desk.events.clear()
    desk.remote.connected(desk.hear)
    desk.send("skyctrl.Common.AllStates")
    assert desk.values(SOURCE) == [{"source": "SkyController"}]


def test_grabbed_buttons_are_confirmed(desk: Desk) -> None:
    desk.events.clear()
    desk.send("mapper.grab", buttons=3, axes=1)
    assert desk.values("mapper.grab_state") == [{"buttons": 3, "axes": 1, "buttons_state": 0}]
