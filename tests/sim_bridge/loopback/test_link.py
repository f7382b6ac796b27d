"""Frames in datagrams, and the command link on a channel with loss, duplicates and reordering."""

from __future__ import annotations

from random import Random

from hypothesis import given, settings
from hypothesis import strategies as st

from sim_bridge.loopback.link import (
    EVENTS,
    MAX_PACK_BYTES,
    PING,
    PONG,
    FrameType,
    Link,
    LinkTiming,
    WireFrame,
    fits,
    pack,
    parse,
    unpack,
)
from tests.sim_bridge.loopback.loopback_patience import PATIENT

FRAMES = st.builds(
    WireFrame,
    type=st.sampled_from(FrameType),
    buffer=st.integers(0, 255),
    sequence=st.integers(0, 65_535),
    payload=st.binary(max_size=300),
)


@PATIENT
@given(st.lists(FRAMES, max_size=5))
def test_a_datagram_holds_several_frames(frames: list[WireFrame]) -> None:
    datagram = b"".join(frame.to_bytes() for frame in frames)
    assert list(parse(datagram)) == frames


@PATIENT
@given(FRAMES, st.binary(max_size=5))
def test_what_follows_a_frame_and_is_none_is_left_out(frame: WireFrame, rest: bytes) -> None:
    assert next(parse(frame.to_bytes() + rest)) == frame


@PATIENT
@given(st.binary(max_size=100))
def test_garbage_is_survived(datagram: bytes) -> None:
    parsed = list(parse(datagram))
    assert sum(len(frame.payload) for frame in parsed) <= len(datagram)
    assert sum(map(len, unpack(datagram))) <= len(datagram)


@PATIENT
@given(st.lists(st.binary(max_size=50), max_size=6))
def test_messages_are_packed_and_unpacked(messages: list[bytes]) -> None:
    assert unpack(pack(messages)) == messages


def test_a_pack_fits_into_a_packet() -> None:
    assert fits([b"a" * 1000], b"b" * (MAX_PACK_BYTES - 1004))
    assert not fits([b"a" * 1000], b"b" * (MAX_PACK_BYTES - 1003))
    assert fits([], b"c" * 2 * MAX_PACK_BYTES)


def test_known_bytes() -> None:
    frame = WireFrame(type=FrameType.DATA_WITH_ACK, buffer=126, sequence=9, payload=b"ab")
    assert frame.to_bytes() == bytes.fromhex("0c 04 7e 0900 02 6162")


def test_a_long_payload_has_its_size_in_two_bytes() -> None:
    frame = WireFrame(type=FrameType.DATA, buffer=127, sequence=300, payload=bytes(200))
    assert frame.to_bytes()[:7] == bytes.fromhex("0c 02 7f 2c01 c801")


class Channel:
    """Two links with a bad channel between them; time passes in steps of 10 ms."""

    def __init__(self, seed: int, *, bad: float) -> None:
        self._random = Random(seed)  # noqa: S311 - not for secrets
        self._bad = bad
        self._now_s = 0.0
        self._line: list[tuple[float, bool, bytes]] = []
        self.drone = Link(lambda data: self._put(data, to_client=True), 0.0)
        self.client = Link(lambda data: self._put(data, to_client=False), 0.0)
        self.at_drone: list[bytes] = []
        self.at_client: list[bytes] = []

    def _put(self, data: bytes, *, to_client: bool) -> None:
        chance = self._random.random
        copies = 0 if chance() < self._bad else 2 if chance() < self._bad else 1
        for _ in range(copies):
            late = 0.03 if chance() < self._bad else 0.0
            self._line.append((self._now_s + 0.001 + late, to_client, data))

    def run(self, duration_s: float) -> None:
        for _ in range(round(duration_s / 0.01)):
            self._now_s += 0.01
            due = sorted(item for item in self._line if item[0] <= self._now_s)
            self._line = [item for item in self._line if item[0] > self._now_s]
            for _, to_client, data in due:
                if to_client:
                    self.at_client += self.client.receive(data, self._now_s)
                else:
                    self.at_drone += self.drone.receive(data, self._now_s)
            self.drone.poll(self._now_s)
            self.client.poll(self._now_s)

    def send(self, link: Link, payload: bytes) -> None:
        link.send(payload, self._now_s, acked=True)


@settings(PATIENT, max_examples=30)
@given(st.integers(0, 2**32), st.floats(0.0, 0.3))
def test_all_that_is_acknowledged_arrives_once_and_in_order(seed: int, bad: float) -> None:
    channel = Channel(seed, bad=bad)
    messages = [bytes([index]) for index in range(40)]
    for message in messages:
        channel.send(channel.drone, message)
        channel.send(channel.client, message)
    for _ in range(20):
        channel.run(3.0)
        if not (channel.drone.pending or channel.client.pending):
            break
    assert channel.at_client == messages
    assert channel.at_drone == messages


def messages_in(sent: list[bytes]) -> list[bytes]:
    return [one for data in sent for frame in parse(data) for one in unpack(frame.payload)]


def test_a_good_line_needs_no_repeats() -> None:
    sent: list[bytes] = []
    link = Link(sent.append, 0.0)
    link.send(b"one", 0.0, acked=True)
    link.send(b"two", 0.0, acked=True)
    assert messages_in(sent) == [b"one"]
    ack = WireFrame(type=FrameType.ACK, buffer=EVENTS + 128, sequence=0, payload=b"\0\0")
    link.receive(ack.to_bytes(), 0.01)
    link.receive(ack.to_bytes(), 0.02)  # a duplicate acknowledges nothing else
    link.poll(0.05)
    assert messages_in(sent) == [b"one", b"two"]
    assert link.pending == 1


def test_a_command_that_comes_twice_is_acknowledged_twice_and_handled_once() -> None:
    sent: list[bytes] = []
    link = Link(sent.append, 0.0)
    command = WireFrame(type=FrameType.DATA_WITH_ACK, buffer=11, sequence=7, payload=pack([b"go"]))
    assert link.receive(command.to_bytes(), 0.0) == [b"go"]
    assert link.receive(command.to_bytes(), 0.1) == []
    acks = [frame for data in sent for frame in parse(data)]
    assert [(ack.type, ack.buffer, ack.payload) for ack in acks] == [
        (FrameType.ACK, 139, b"\7\0"),
        (FrameType.ACK, 139, b"\7\0"),
    ]


def test_the_sequence_wraps_around() -> None:
    link = Link(lambda _: None, 0.0)
    taken = []
    for sequence in (65_534, 65_535, 0, 65_535, 1):
        frame = WireFrame(type=FrameType.DATA, buffer=10, sequence=sequence, payload=pack([b"x"]))
        taken.append(len(link.receive(frame.to_bytes(), 0.0)))
    assert taken == [1, 1, 1, 0, 1]


def test_a_ping_is_answered_with_its_own_payload() -> None:
    sent: list[bytes] = []
    link = Link(sent.append, 0.0)
    ping = WireFrame(type=FrameType.DATA, buffer=PING, sequence=0, payload=b"12345678")
    assert link.receive(ping.to_bytes(), 0.0) == []
    (pong,) = parse(sent[0])
    assert (pong.buffer, pong.payload) == (PONG, b"12345678")


def test_silence_is_death() -> None:
    link = Link(lambda _: None, 0.0, timing=LinkTiming(silence_s=5.0))
    assert not link.dead(4.9)
    assert link.dead(5.1)
