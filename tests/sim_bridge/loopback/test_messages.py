"""The table of ARSDK messages."""

from __future__ import annotations

import pytest

from sim_bridge.loopback.messages import Buffer, Kind, Memory, message_table
from uav_bt.errors import UnknownNameError


@pytest.mark.parametrize(
    ("name", "number", "event", "buffer"),
    [
        ("common.Common.AllStates", (0, 4, 0), False, Buffer.ACK),
        ("common.SettingsState.AllSettingsChanged", (0, 3, 0), True, Buffer.ACK),
        ("ardrone3.Piloting.TakeOff", (1, 0, 1), False, Buffer.ACK),
        ("ardrone3.Piloting.PCMD", (1, 0, 2), False, Buffer.NOACK),
        ("ardrone3.Piloting.Emergency", (1, 0, 4), False, Buffer.PRIO),
        ("ardrone3.PilotingState.AttitudeChanged", (1, 4, 6), True, Buffer.NOACK),
        ("ardrone3.PilotingEvent.moveByEnd", (1, 34, 0), True, Buffer.ACK),
        ("gimbal.set_target", (148, 0, 5), False, Buffer.NOACK),
        ("gimbal.attitude", (148, 0, 6), True, Buffer.NOACK),
    ],
)
def test_numbers_and_directions_are_those_of_the_sdk(
    name: str, number: tuple[int, int, int], *, event: bool, buffer: Buffer
) -> None:
    message = message_table().named(name)
    assert (message.number, message.event, message.buffer) == (number, event, buffer)
    assert message_table().numbered(number) is message


def test_numbers_and_names_are_unique() -> None:
    messages = list(message_table())
    assert len({one.number for one in messages}) == len(messages) > 600


def test_choices_bits_and_memory_are_read() -> None:
    flying = message_table().named("ardrone3.PilotingState.FlyingStateChanged").arguments[0]
    assert flying.kind is Kind.CHOICE
    assert flying.values[:5] == ("landed", "takingoff", "hovering", "flying", "landing")
    alert = message_table().named("battery.alert")
    assert (alert.memory, alert.key) == (Memory.MAP, "alert")
    assert alert.arguments[-1].kind is Kind.BITS
    assert alert.arguments[-1].values == ("First", "Last", "Empty", "Remove")
    assert message_table().named("ardrone3.PilotingEvent.moveByEnd").memory is Memory.NOTE


def test_an_unknown_name_gets_a_suggestion() -> None:
    with pytest.raises(UnknownNameError, match=r"did you mean 'ardrone3\.Piloting\.TakeOff'"):
        message_table().named("ardrone3.Piloting.Takeoff")
