"""ARSDK messages, frames in datagrams, and the command link on a channel with loss."""

from __future__ import annotations

import contextlib
import struct
from random import Random
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sim_bridge.loopback.codec import Argument, WireError, decode, encode, message_types
from sim_bridge.loopback.link import (
    ACK_OFFSET,
    EVENTS,
    MAX_PACK_BYTES,
    PING,
    PONG,
    SILENCE_S,
    FrameType,
    Link,
    WireFrame,
    pack,
    parse,
    unpack,
)

PATIENT = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])


DECODED = [
    message
    for message in message_types().values()
    if "binary" not in [argument.kind for argument in message.arguments]
]


def _value(argument: Argument) -> st.SearchStrategy[Any]:
    size = 8 * struct.calcsize(argument.layout)
    low = 0 if argument.layout.isupper() else -(2 ** max(0, size - 1))
    by_kind: dict[str, st.SearchStrategy[Any]] = {
        "string": st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20),
        "enum": st.sampled_from(argument.names or ("",)),
        "bits": st.sets(st.sampled_from(argument.names[:size] or ("",))),
        "float": st.floats(width=32, allow_nan=False),
        "double": st.floats(allow_nan=False),
    }
    return by_kind.get(argument.kind, st.integers(low, low + 2**size - 1))


@st.composite
def any_message(draw: st.DrawFn) -> tuple[str, dict[str, Any]]:
    message = draw(st.sampled_from(DECODED))
    return message.name, {argument.name: draw(_value(argument)) for argument in message.arguments}


@PATIENT
@given(any_message(), st.floats(0.0, 0.99))
def test_only_whole_messages_are_decoded(message: tuple[str, dict[str, Any]], share: float) -> None:
    payload = encode(*message)
    received = decode(payload)
    assert (received.name, received.values) == message
    with pytest.raises(WireError):
        decode(payload[: int(share * len(payload))])


@PATIENT
@given(st.binary(max_size=60))
def test_garbage_is_a_wire_error_and_nothing_else(payload: bytes) -> None:
    with contextlib.suppress(WireError):
        decode(payload)
    frames = list(parse(payload))
    assert sum(len(frame.payload) for frame in frames) <= len(payload)
    assert sum(map(len, unpack(payload))) <= len(payload)


@pytest.mark.parametrize(
    ("name", "values", "data"),
    [
        (
            "ardrone3.Piloting.moveBy",
            {"dX": 1.0, "dY": 0.0, "dZ": -2.0, "dPsi": 0.5},
            "01000700 0000803f 00000000 000000c0 0000003f",
        ),
        ("ardrone3.PilotingState.FlyingStateChanged", {"state": "hovering"}, "01040100 02000000"),
        ("common.SettingsState.ProductNameChanged", {"name": "é"}, "00030200 c3a900"),
        ("ardrone3.Piloting.TakeOff", {}, "01000100"),
    ],
)
def test_known_bytes(name: str, values: dict[str, Any], data: str) -> None:
    assert encode(name, values) == bytes.fromhex(data)
    assert message_types()[name].event is ("State" in name)
    unacknowledged = {"ardrone3.Piloting.PCMD", "ardrone3.PilotingState.AttitudeChanged"}
    assert {message_types()[name].buffer for name in unacknowledged} == {"noack"}


@pytest.mark.parametrize(
    ("data", "why"),
    [
        ("0100010000", "TakeOff has 4 bytes, got 5"),
        ("01040100 ffffffff", "state is damaged"),
        ("ff000000", "no message is numbered 255-0-0"),
    ],
)
def test_what_is_no_message_is_refused(data: str, why: str) -> None:
    with pytest.raises(WireError, match=why):
        decode(bytes.fromhex(data))


FRAMES = st.builds(
    WireFrame,
    type=st.sampled_from(FrameType),
    buffer=st.integers(0, 255),
    sequence=st.integers(0, 65_535),
    payload=st.binary(max_size=300),
)


@PATIENT
@given(st.lists(FRAMES, max_size=5), st.binary(max_size=5))
def test_a_datagram_holds_several_frames(frames: list[WireFrame], rest: bytes) -> None:
    datagram = b"".join(frame.to_bytes() for frame in frames)
    assert list(parse(datagram + rest)) == frames


def datagram(kind: FrameType, buffer: int, sequence: int, payload: bytes) -> bytes:
    return WireFrame(type=kind, buffer=buffer, sequence=sequence, payload=payload).to_bytes()


def command(sequence: int) -> bytes:
    return datagram(FrameType.DATA_WITH_ACK, 11, sequence, pack([b"go"]))


def test_known_frames() -> None:
    acknowledged = datagram(FrameType.DATA_WITH_ACK, 126, 9, b"ab")
    assert acknowledged == bytes.fromhex("0c 04 7e 0900 02 6162")
    long = datagram(FrameType.DATA, 127, 300, bytes(200))
    assert long[:7] == bytes.fromhex("0c 02 7f 2c01 c801")


@settings(PATIENT, max_examples=30)
@given(st.integers(0, 2**32), st.floats(0.0, 0.3))
def test_all_that_is_acknowledged_arrives_once_and_in_order(seed: int, bad: float) -> None:
    """Datagrams between two links are lost, doubled and overtaken."""
    chance = Random(seed).random  # noqa: S311 - not for secrets
    line: list[tuple[float, int, bytes]] = []  # time of arrival, to which link, datagram
    now_s = 0.0

    def put(to: int, data: bytes) -> None:
        copies = 0 if chance() < bad else 2 if chance() < bad else 1
        late = [0.03 if chance() < bad else 0.001 for _ in range(copies)]
        line.extend((now_s + late_s, to, data) for late_s in late)

    links = [Link(lambda data: put(1, data), 0.0), Link(lambda data: put(0, data), 0.0)]
    messages = [bytes([index]) for index in range(40)]
    arrived: list[list[bytes]] = [[], []]
    for link in links:
        for message in messages:
            link.send(message, now_s, acked=True)
    while arrived != [messages, messages]:
        now_s += 0.01
        assert now_s < 60.0, arrived
        due = sorted(item for item in line if item[0] <= now_s)
        line[:] = [item for item in line if item[0] > now_s]
        for _, to, data in due:
            arrived[to] += links[to].receive(data, now_s)
        for link in links:
            link.poll(now_s)


def test_a_good_line_needs_no_repeats_and_a_frame_fits_into_a_packet() -> None:
    sent: list[bytes] = []
    link = Link(sent.append, 0.0)
    events = [b"one", b"a" * 1000, b"b" * (MAX_PACK_BYTES - 1004), b"c" * 2 * MAX_PACK_BYTES]
    for event in events:
        link.send(event, 0.0, acked=True)
    for sequence in (0, 0, 1, 2):  # a duplicate acknowledges nothing else
        ack = struct.pack("<H", sequence)
        link.receive(datagram(FrameType.ACK, EVENTS + ACK_OFFSET, 0, ack), 0.01)
    link.poll(0.05)
    packs = [unpack(frame.payload) for data in sent for frame in parse(data)]
    assert packs == [events[:1], events[1:3], events[3:]]


def test_an_event_is_repeated_until_it_is_acknowledged_and_pings_have_a_rhythm() -> None:
    sent: list[bytes] = []
    link = Link(sent.append, 0.0)
    link.send(b"one", 0.0, acked=True)
    ack = datagram(FrameType.ACK, EVENTS + ACK_OFFSET, 0, struct.pack("<H", 0))
    for now_s, expected in ((0.09, 1), (0.11, 2), (0.2, 2), (0.22, 3), (1.9, 3), (2.1, 4), (4, 4)):
        link.poll(now_s)
        if now_s == 0.22:
            link.receive(ack, now_s)
        assert len(sent) == expected, now_s
    assert sent[0] == sent[1] == sent[2]


def test_each_command_is_acknowledged_and_handled_once_also_when_the_sequence_wraps() -> None:
    sent: list[bytes] = []
    link, numbers = Link(sent.append, 0.0), (65_534, 65_534, 65_535, 0, 65_535, 1)
    taken = [link.receive(command(number), 0.0) for number in numbers]
    assert taken == [[b"go"], [], [b"go"], [b"go"], [], [b"go"]]
    acks = [frame for data in sent for frame in parse(data)]
    assert [(ack.type, ack.buffer, ack.payload) for ack in acks] == [
        (FrameType.ACK, 139, struct.pack("<H", number)) for number in numbers
    ]


def test_a_ping_is_answered_with_its_own_payload_and_silence_is_death() -> None:
    sent: list[bytes] = []
    link = Link(sent.append, 0.0)
    assert link.receive(datagram(FrameType.DATA, PING, 0, b"12345678"), 1.0) == []
    (pong,) = parse(sent[0])
    assert (pong.buffer, pong.payload) == (PONG, b"12345678")
    assert not link.dead(SILENCE_S + 0.9)
    assert link.dead(SILENCE_S + 1.1)
