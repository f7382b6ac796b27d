"""Codec of ARSDK messages."""

from __future__ import annotations

import contextlib
import math
import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_bridge.loopback.codec import WireError, decode, encode
from sim_bridge.loopback.messages import Argument, Kind, MessageType, message_table
from tests.sim_bridge.loopback.loopback_patience import PATIENT
from uav_bt.errors import InputError, ValueRangeError

TABLE = message_table()


def _value(argument: Argument) -> st.SearchStrategy[Any]:
    size = 8 * struct.calcsize(argument.layout) if argument.layout else 0
    if argument.kind is Kind.INTEGER:
        low = 0 if argument.layout.isupper() else -(2 ** (size - 1))
        return st.integers(low, low + 2**size - 1)
    by_kind: dict[Kind, st.SearchStrategy[Any]] = {
        Kind.TEXT: st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20),
        Kind.BINARY: st.binary(max_size=20),
        Kind.CHOICE: st.sampled_from(argument.values or ("",)),
        Kind.BITS: st.frozensets(st.sampled_from(argument.values[:size] or ("",))),
        Kind.FLOAT: st.floats(width=32 if argument.layout == "f" else 64, allow_nan=False),
    }
    return by_kind[argument.kind]


@st.composite
def any_message(draw: st.DrawFn) -> tuple[MessageType, dict[str, Any]]:
    message = draw(st.sampled_from(list(TABLE)))
    return message, {argument.name: draw(_value(argument)) for argument in message.arguments}


@PATIENT
@given(any_message())
def test_what_is_encoded_is_decoded(pair: tuple[MessageType, dict[str, Any]]) -> None:
    message, values = pair
    received = decode(encode(message, values), TABLE)
    assert received.type is message
    assert dict(received.values) == values


@PATIENT
@given(any_message(), st.data())
def test_a_message_that_is_cut_off_is_refused(
    pair: tuple[MessageType, dict[str, Any]], data: st.DataObject
) -> None:
    payload = encode(*pair)
    with pytest.raises(WireError):
        decode(payload[: data.draw(st.integers(0, len(payload) - 1))], TABLE)


@PATIENT
@given(st.binary(max_size=60))
def test_garbage_is_a_wire_error_and_nothing_else(payload: bytes) -> None:
    with contextlib.suppress(WireError):
        decode(payload, TABLE)


def test_known_bytes() -> None:
    move = TABLE.named("ardrone3.Piloting.moveBy")
    payload = encode(move, {"dX": 1.0, "dY": 0.0, "dZ": -2.0, "dPsi": 0.5})
    assert payload == bytes.fromhex("01000700 0000803f 00000000 000000c0 0000003f")
    state = TABLE.named("ardrone3.PilotingState.FlyingStateChanged")
    assert encode(state, {"state": "hovering"}) == bytes.fromhex("01040100 02000000")
    name = TABLE.named("common.SettingsState.ProductNameChanged")
    assert encode(name, {"name": "é"}) == bytes.fromhex("00030200 c3a900")


def test_more_bytes_than_the_arguments_take_are_refused() -> None:
    with pytest.raises(WireError, match="TakeOff has 4 bytes, got 5"):
        decode(bytes.fromhex("0100010000"), TABLE)


def test_a_choice_that_is_none_is_refused() -> None:
    with pytest.raises(WireError, match="state is damaged"):
        decode(bytes.fromhex("01040100 ffffffff"), TABLE)


def test_wrong_arguments_are_named() -> None:
    move = TABLE.named("ardrone3.Piloting.moveBy")
    with pytest.raises(InputError, match=r"moveBy takes \['dPsi', 'dX', 'dY', 'dZ'\], got \['dX'"):
        encode(move, {"dX": 1.0})
    with pytest.raises(ValueRangeError, match="dX"):
        encode(move, {"dX": "far", "dY": 0.0, "dZ": 0.0, "dPsi": math.nan})
