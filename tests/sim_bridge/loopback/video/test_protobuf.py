"""The writer of protobuf fields."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_bridge.loopback.video import protobuf
from tests.sim_bridge.loopback.video.video_client import fields
from uav_bt.errors import ValueRangeError


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        (protobuf.unsigned(1, 150), "089601"),  # example of the encoding guide
        (protobuf.message(2, b"testing"), "120774657374696e67"),  # example of the encoding guide
        (protobuf.signed(1, -1), "0801"),  # zigzag: 0, -1, 1, -2 are 0, 1, 2, 3
        (protobuf.signed(1, 1), "0802"),
        (protobuf.signed(1, -2), "0803"),
        (protobuf.unsigned(16, 1), "800101"),  # a number whose tag takes two bytes
        (protobuf.float32(1, 1.0), "0d0000803f"),
        (protobuf.double(1, 1.0), "09000000000000f03f"),
        (protobuf.message(3, b""), "1a00"),  # presence is information
    ],
)
def test_fields_have_the_bytes_of_the_standard(written: bytes, expected: str) -> None:
    assert written.hex() == expected


def test_defaults_are_left_out() -> None:
    assert protobuf.unsigned(1, 0) == protobuf.signed(1, 0) == b""
    assert protobuf.float32(1, 0.0) == protobuf.double(1, 0.0) == b""


@given(st.integers(1, 500), st.integers(1, 2**64 - 1), st.integers(-(2**63), 2**63 - 1))
def test_numbers_come_back(number: int, large: int, signed: int) -> None:
    assert fields(protobuf.unsigned(number, large)) == {number: large}
    coded = fields(protobuf.signed(number, signed)).get(number, 0)
    assert (coded >> 1) ^ -(coded & 1) == signed


@given(st.floats(allow_nan=False, width=32).filter(bool), st.binary(max_size=300))
def test_floats_and_messages_come_back(value: float, content: bytes) -> None:
    data = protobuf.float32(7, value) + protobuf.message(8, content) + protobuf.double(9, value)
    found = fields(data)
    assert struct.unpack("<f", found[7]) == struct.unpack("<d", found[9]) == (value,)
    assert found[8] == content


@pytest.mark.parametrize("value", [-1, 2**64])
def test_what_does_not_fit_is_refused(value: int) -> None:
    with pytest.raises(ValueRangeError, match="unsigned number of 64 bits"):
        protobuf.unsigned(1, value)
    with pytest.raises(ValueRangeError, match="signed number of 64 bits"):
        protobuf.signed(1, 2**63)
