"""NAL units cut into payloads."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_bridge.loopback.video.packetizer import MIN_PAYLOAD_BYTES, packetize
from tests.sim_bridge.loopback.video.video_client import reassemble
from uav_bt.errors import ValueRangeError

# Types 24 and above are the payload format's own and never come from an encoder.
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
