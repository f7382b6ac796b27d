"""Frames in datagrams."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from sim_bridge.loopback.frames import (
    MAX_PACK_BYTES,
    FrameType,
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
