"""Packets and reports of one client."""

from __future__ import annotations

import struct
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_bridge.loopback.video.encoder import EncodedFrame
from sim_bridge.loopback.video.rtp import (
    MIN_PAYLOAD_BYTES,
    MTU_BYTES,
    FramePackets,
    RtpStream,
    packetize,
)
from tests.sim_bridge.loopback.video.video_client import (
    parse_rtcp,
    parse_rtp,
    reassemble,
    seeded,
    unpack_metadata,
)
from uav_bt.errors import ValueRangeError

LARGE = EncodedFrame(nals=(b"\x67\x42", b"\x68\xce", b"\x65" + bytes(range(1, 250)) * 20))


@given(st.integers(0, 2**32 - 1), st.binary(min_size=1, max_size=300))
def test_a_picture_comes_back_with_its_metadata(seed: int, metadata: bytes) -> None:
    shown = FramePackets.of(LARGE, metadata, 3.0)
    packets = list(RtpStream(seeded(seed), "X").packets(shown))
    assert max(len(packet) for packet in packets) <= MTU_BYTES
    parts = [parse_rtp(packet) for packet in packets]
    assert reassemble(part.payload for part in parts) == LARGE.nals
    number, content = parts[0].extension or (0, b"")
    assert (number, unpack_metadata(content)) == (0x5062, metadata)
    assert [part.extension for part in parts[1:]] == [None] * (len(parts) - 1)
    assert [part.marker for part in parts] == [False] * (len(parts) - 1) + [True]
    assert {part.kind for part in parts} == {96}
    assert len({(part.stamp, part.ssrc) for part in parts}) == 1
    steps = [(b.sequence - a.sequence) % 65536 for a, b in pairwise(parts)]
    assert steps == [1] * (len(parts) - 1)


def test_numbers_go_on_from_picture_to_picture_and_wrap() -> None:
    stream = RtpStream(seeded(1), "X")
    shown = FramePackets.of(LARGE, b"m", 3.0)
    numbers = [parse_rtp(p).sequence for _ in range(14_000) for p in stream.packets(shown)]
    assert len(numbers) > 65_536
    assert all((b - a) % 65536 == 1 for a, b in pairwise(numbers))
    assert stream.next_sequence == (numbers[-1] + 1) % 65536


def test_time_stamps_count_at_90_khz_whatever_the_beginning() -> None:
    stream = RtpStream(seeded(2), "X")
    assert (stream.stamp(7.5) - stream.stamp(7.0)) % 2**32 == 45_000
    assert (stream.stamp(60_000.0) - stream.stamp(0.0)) % 2**32 == 60_000 * 90_000 % 2**32


def test_two_clients_streams_are_not_alike() -> None:
    random = seeded(3)
    one, two = RtpStream(random, "X"), RtpStream(random, "X")
    assert one.ssrc != two.ssrc
    assert one.stamp(0.0) != two.stamp(0.0)


def test_a_report_maps_stamps_to_the_drones_clock_and_counts() -> None:
    stream = RtpStream(seeded(4), "PI040416")
    shown = FramePackets.of(LARGE, b"m", 3.0)
    sent = [parse_rtp(packet) for packet in stream.packets(shown)]
    parts = parse_rtcp(stream.report(12.25))
    ssrc, seconds, fraction, stamp, packets, payload = struct.unpack("!6I", parts[200])
    assert (ssrc, seconds, fraction) == (stream.ssrc, 12, 1 << 30)
    assert stamp == stream.stamp(12.25)
    assert (packets, payload) == (len(sent), sum(len(packet.payload) for packet in sent))
    described = parts[202]
    assert described[:4] == stream.ssrc.to_bytes(4, "big")
    assert described[4:14] == b"\x01\x08PI040416"
    assert set(described[14:]) == {0}


def test_goodbye_is_a_report_with_a_last_word() -> None:
    stream = RtpStream(seeded(5), "X")
    parts = parse_rtcp(stream.goodbye(1.0))
    assert list(parts) == [200, 202, 203]
    assert parts[203] == stream.ssrc.to_bytes(4, "big")


# Types from 24 on belong to the payload format; an encoder never uses them.
nal = st.builds(
    lambda importance, kind, rest: bytes([importance << 5 | kind]) + rest,
    st.integers(0, 3),
    st.integers(1, 23),
    st.binary(max_size=400),
)
limits = st.integers(MIN_PAYLOAD_BYTES, 500)


@given(st.lists(nal, max_size=8), limits, limits)
def test_payloads_reassemble_to_the_same_units(nals: list[bytes], limit: int, first: int) -> None:
    payloads = packetize(nals, limit, first_limit_bytes=first)
    assert reassemble(payloads) == tuple(nals)


@given(st.lists(nal, min_size=1, max_size=8), limits, limits)
def test_no_payload_exceeds_its_limit(nals: list[bytes], limit: int, first: int) -> None:
    head, *rest = packetize(nals, limit, first_limit_bytes=first)
    assert len(head) <= first
    assert all(len(payload) <= limit for payload in rest)


@given(st.lists(nal, min_size=2, max_size=8))
def test_an_aggregate_is_as_important_as_its_most_important_unit(nals: list[bytes]) -> None:
    (payload,) = packetize(nals, 10_000)
    assert payload[0] == max(unit[0] & 0x60 for unit in nals) | 24


def test_a_lone_unit_that_fits_travels_as_it_is() -> None:
    assert packetize([b"\x65" + bytes(99)], 100) == (b"\x65" + bytes(99),)


def test_a_unit_one_byte_too_large_is_cut_in_two() -> None:
    payloads = packetize([b"\x65" + bytes(100)], 100)
    assert [payload[:2].hex() for payload in payloads] == ["7c85", "7c45"]
    assert [len(payload) for payload in payloads] == [100, 4]


def test_no_units_need_no_packets() -> None:
    assert packetize([], 100) == ()


def test_an_empty_unit_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="at least one byte"):
        packetize([b"\x65", b""], 100)


def test_a_payload_too_small_for_anything_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="got 10"):
        packetize([b"\x65"], 100, first_limit_bytes=10)
