"""H.264 taken apart."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_bridge.loopback.video.h264 import ParameterSets, find_parameter_sets, nal_type, split_nals
from tests.sim_bridge.loopback.video.video_client import decodable
from uav_bt.errors import DroneError

# An encoder never lets three bytes 0 0 0..3 stand in a unit, and ends none with 0.
units = st.lists(st.binary(min_size=1, max_size=40).filter(lambda unit: 0 not in unit), max_size=6)


@given(units, st.sampled_from([b"\x00\x00\x01", b"\x00\x00\x00\x01"]))
def test_units_come_back_with_short_and_long_start_codes(nals: list[bytes], code: bytes) -> None:
    assert split_nals(b"".join(code + unit for unit in nals)) == tuple(nals)


def test_a_stream_without_start_code_has_no_units() -> None:
    assert split_nals(b"\x65\x01\x02") == split_nals(b"") == ()


def test_the_type_is_in_the_first_byte() -> None:
    assert nal_type(b"\x65") == 5


def test_parameter_sets_are_found_among_the_others() -> None:
    nals = split_nals(decodable([b"\x06\x01", b"\x67\x42\xc0\x1e\xaa", b"\x68\xce", b"\x65\x88"]))
    sets = find_parameter_sets(nals)
    assert sets == ParameterSets(sps=b"\x67\x42\xc0\x1e\xaa", pps=b"\x68\xce")
    assert sets.profile_level_id == "42C01E"


@pytest.mark.parametrize("nals", [(), (b"\x67\x42",), (b"\x68\xce", b"\x65")])
def test_missing_parameter_sets_are_an_error(nals: tuple[bytes, ...]) -> None:
    with pytest.raises(DroneError, match="expected NAL units 7 and 8"):
        find_parameter_sets(nals)
