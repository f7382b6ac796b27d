"""Frames in datagrams."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_bridge.loopback.frames import (
    MAX_PACK_BYTES,
    VERSION_1,
    VERSION_2,
    FrameType,
    Framing,
    WireFrame,
)
from tests.sim_bridge.loopback.loopback_patience import PATIENT

FRAMES = st.builds(
    WireFrame,
    type=st.sampled_from(FrameType),
    buffer=st.integers(0, 255),
    sequence=st.integers(0, 255),
    payload=st.binary(max_size=300),
)
VERSIONS = st.sampled_from([VERSION_1, VERSION_2])


@PATIENT
@given(VERSIONS, st.lists(FRAMES, max_size=5))
def test_a_datagram_holds_several_frames(framing: Framing, frames: list[WireFrame]) -> None:
    datagram = b"".join(framing.to_bytes(frame) for frame in frames)
    assert list(framing.parse(datagram)) == frames


@PATIENT
@given(VERSIONS, FRAMES, st.binary(max_size=5))
def test_what_follows_a_frame_and_is_none_is_left_out(
    framing: Framing, frame: WireFrame, rest: bytes
) -> None:
    assert next(framing.parse(framing.to_bytes(frame) + rest)) == frame


@PATIENT
@given(VERSIONS, st.binary(max_size=100))
def test_garbage_is_survived(framing: Framing, datagram: bytes) -> None:
    parsed = list(framing.parse(datagram))
    assert sum(len(frame.payload) for frame in parsed) <= len(datagram)
    assert sum(map(len, framing.unpack(datagram))) <= len(datagram)


@PATIENT
@given(st.lists(st.binary(max_size=50), max_size=6))
def test_messages_are_packed_and_unpacked(messages: list[bytes]) -> None:
    assert VERSION_2.unpack(VERSION_2.pack(messages)) == messages


def test_a_pack_fits_into_a_packet() -> None:
    assert VERSION_2.fits([b"a" * 1000], b"b" * (MAX_PACK_BYTES - 1004))
    assert not VERSION_2.fits([b"a" * 1000], b"b" * (MAX_PACK_BYTES - 1003))
    assert VERSION_2.fits([], b"c" * 2 * MAX_PACK_BYTES)
    assert not VERSION_1.fits([b"a"], b"b")


@pytest.mark.parametrize(
    ("framing", "known"),
    [(VERSION_1, "04 7e 09 09000000 6162"), (VERSION_2, "0c 04 7e 0900 02 6162")],
)
def test_known_bytes(framing: Framing, known: str) -> None:
    frame = WireFrame(type=FrameType.DATA_WITH_ACK, buffer=126, sequence=9, payload=b"ab")
    assert framing.to_bytes(frame) == bytes.fromhex(known)


def test_a_long_payload_has_its_size_in_two_bytes() -> None:
    frame = WireFrame(type=FrameType.DATA, buffer=127, sequence=300, payload=bytes(200))
    assert VERSION_2.to_bytes(frame)[:7] == bytes.fromhex("0c 02 7f 2c01 c801")
