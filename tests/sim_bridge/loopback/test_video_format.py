"""Bytes of the video: H.264 as PyAV's decoder and Parrot's library read it, RTP, RTCP, metadata."""

from __future__ import annotations

import struct
from dataclasses import replace
from itertools import pairwise

import av
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_bridge.loopback.encoder import Encoder, is_key, nal_type, parameter_sets
from sim_bridge.loopback.metadata import timed_metadata
from sim_bridge.loopback.rtp import MTU_BYTES, RtpStream, packetize
from tests.sim_bridge.loopback.video_client import (
    BYE,
    FRAME,
    SIZE_PX,
    assert_quadrants,
    parse_rtcp,
    parse_rtp,
    units_of,
)
from uav_bt.errors import ValueRangeError


def test_each_frame_comes_at_once_in_slices_and_key_frames_once_a_second_or_on_demand() -> None:
    encoder = Encoder(SIZE_PX, 10.0)
    frames = [encoder.encode(FRAME.image, 1.0 + n / 10.0, key=n == 5) for n in range(17)]
    assert [n for n, nals in enumerate(frames) if is_key(nals)] == [0, 5, 15]
    assert set(map(nal_type, frames[1])) == {1}
    assert 1 < len(frames[1]) <= 4
    sets = parameter_sets(SIZE_PX, 10.0)
    assert frames[5][:2] == frames[0][:2] == sets
    assert sets[0][1:3].hex() == "42c0"  # the baseline profile, as drones send it
    stream = b"".join(b"\x00\x00\x00\x01" + unit for unit in frames[0])
    decoder = av.CodecContext.create("h264", "r")
    (shown,) = [*decoder.decode(av.Packet(stream)), *decoder.decode(None)]
    assert (shown.width, shown.height) == SIZE_PX
    assert_quadrants(shown.to_ndarray(format="rgb24"))


def test_an_odd_size_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="must be even, got 656x369"):
        Encoder((656, 369), 30.0)


# Types from 24 on belong to the payload format; an encoder never uses them.
nal = st.builds(
    lambda importance, kind, size: bytes([importance << 5 | kind]) + bytes(range(1, 250)) * size,
    st.integers(0, 3),
    st.integers(1, 23),
    st.integers(0, 12),
)


@given(st.lists(nal, min_size=1, max_size=6), st.binary(min_size=1, max_size=300))
def test_a_frame_comes_back_with_its_metadata(nals: list[bytes], metadata: bytes) -> None:
    packets = list(RtpStream("X").packets(packetize(tuple(nals), metadata, 3.0)))
    assert max(map(len, packets)) <= MTU_BYTES
    parts = [parse_rtp(packet) for packet in packets]
    assert units_of(parts) == tuple(nals)
    assert [part.metadata for part in parts] == [metadata] + [None] * (len(parts) - 1)
    assert [part.marker for part in parts] == [False] * (len(parts) - 1) + [True]
    assert {(part.kind, part.stamp, part.ssrc) for part in parts} == {(96, *parts[0][3:5])}


@pytest.mark.parametrize(("spare", "packets"), [(0, 1), (-1, 2)])
def test_a_unit_is_cut_only_if_it_does_not_fit(spare: int, packets: int) -> None:
    room = MTU_BYTES - 12 - 12  # headers, and the extension with four bytes
    frame = packetize((b"\x65" + bytes(room - 1 - spare),), b"meta", 0.0)
    assert len(frame.bodies) == packets


def test_numbers_and_stamps_of_each_client_go_on_and_wrap() -> None:
    one, two = RtpStream("X"), RtpStream("X")
    shown = packetize((b"\x65",) * 1000, b"m", 3.0)
    numbers = [parse_rtp(p).sequence for _ in range(66) for p in one.packets(shown)]
    assert all((b - a) % 65536 == 1 for a, b in pairwise(numbers))
    assert one.next_sequence == (numbers[-1] + 1) % 65536
    assert (one.stamp(60_000.5) - one.stamp(0.0)) % 2**32 == 60_000.5 * 90_000 % 2**32
    assert (one.ssrc, one.stamp(0.0)) != (two.ssrc, two.stamp(0.0))


def test_a_report_maps_stamps_to_the_drones_clock_and_counts() -> None:
    stream = RtpStream("PI040416")
    shown = packetize((b"\x67\x42", b"\x65" + bytes(5000)), b"m", 3.0)
    sent = [parse_rtp(packet).payload for packet in stream.packets(shown)]
    parts, ssrc = parse_rtcp(stream.goodbye(12.25)), stream.ssrc.to_bytes(4, "big")
    assert list(parts) == [200, 202, BYE]
    report = stream.ssrc, 12, 1 << 30, stream.stamp(12.25), len(sent), sum(map(len, sent))
    assert struct.unpack("!6I", parts[200]) == report
    assert parts[202].rstrip(b"\0") == ssrc + b"\x01\x08PI040416"
    assert parts[BYE] == ssrc


# Output of Parrot's library (libvideo-metadata-protobuf of parrot-olympe 8.5.0) for FRAME, with 12
# satellites; here the byte is 14.
PACKED_BY_PARROT = bytes.fromhex(
    "0a81010a140de145393f1564b6d53d1d75fb1fbd256a582e3f121d092a3a92cb7f70484011a9fb00a436f102401900"
    "00000000005940200e19000000000000f43f220f0d0000803f15000000401d000000bf28ae0138024a0f0d00004040"
    "15000080c01d0000c0bf520f0d0000404015000080c01d0000c0bf600169000000000000f83f125c08a0f8fa05120a"
    "0df64f3b3f25e17f2e3f1a140d407d353f15ffaf2c3e1d055e39be252313293f450000a03f4d0000403f5090a188c1"
    "c1c4820358e8077a140d407d353f15ffaf2c3e1d055e39be252313293f85010000803f880101"
)
_WIFI = b"\x1a\x0a\x0a\x08\x08\xa0\x9c\x01\x10\x05\x18\x45"  # 20,000 kbit/s, quality 5, -35 dBm


def test_the_message_has_the_bytes_that_parrots_library_packs() -> None:
    assert timed_metadata(FRAME) == PACKED_BY_PARROT + _WIFI
    assert len(timed_metadata(FRAME)) <= 300  # limit of Parrot's sender for one packet
    # An unknown position is omitted.
    rest = b"\x0a\x62" + PACKED_BY_PARROT[3:25] + PACKED_BY_PARROT[56:]  # with its new length
    assert timed_metadata(replace(FRAME, location=None)) == rest + _WIFI
