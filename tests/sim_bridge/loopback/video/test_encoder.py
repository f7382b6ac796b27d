"""The H.264 encoder, tested with PyAV's decoder."""

from __future__ import annotations

from typing import Any

import av
import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_bridge.loopback.video.encoder import (
    IDR,
    Encoder,
    EncoderConfig,
    ParameterSets,
    find_parameter_sets,
    nal_type,
    parameter_sets,
    split_nals,
)
from tests.sim_bridge.loopback.video.video_client import (
    COLOURS,
    SIZE_PX,
    centres,
    decodable,
    quadrants,
)
from uav_bt.errors import DroneError, ValueRangeError

CONFIG = EncoderConfig(size_px=SIZE_PX)


def decoded(*streams: bytes) -> list[Any]:
    decoder = av.CodecContext.create("h264", "r")
    frames = [frame for stream in streams for frame in decoder.decode(av.Packet(stream))]
    return [*frames, *decoder.decode(None)]


@pytest.mark.parametrize("size_px", [SIZE_PX, (128, 96), (32, 24)])
def test_colours_come_back_at_the_videos_size(size_px: tuple[int, int]) -> None:
    """An image of another size is resized, not cropped; both ways of decoding show red as red."""
    encoded = Encoder(CONFIG).encode(quadrants(size_px), 1.0)
    (frame,) = decoded(decodable(encoded.nals))
    assert (frame.width, frame.height) == SIZE_PX
    by_stream = frame.to_ndarray(format="rgb24")
    by_opencv = cv2.cvtColor(frame.to_ndarray(format="yuv420p"), cv2.COLOR_YUV2RGB_I420)
    for image in (by_stream, by_opencv):
        assert np.abs(centres(image) - np.array(COLOURS)).max() <= 6


def test_every_picture_comes_out_at_once_and_in_slices() -> None:
    encoder = Encoder(CONFIG)
    pictures = [encoder.encode(quadrants(), 1.0 + n / 30.0) for n in range(5)]
    assert [picture.is_key for picture in pictures] == [True, False, False, False, False]
    assert [nal_type(unit) for unit in pictures[1].nals] == [1] * len(pictures[1].nals)
    assert 1 < len(pictures[1].nals) <= CONFIG.slices
    assert len(decoded(*(decodable(picture.nals) for picture in pictures))) == 5


def test_a_key_frame_is_made_when_it_is_wanted_and_brings_its_parameters() -> None:
    encoder = Encoder(CONFIG)
    encoder.encode(quadrants(), 1.0)
    encoder.encode(quadrants(), 1.1)
    wanted = encoder.encode(quadrants(), 1.2, key=True)
    assert wanted.is_key
    assert find_parameter_sets(wanted.nals) == parameter_sets(CONFIG)
    assert len(decoded(decodable(wanted.nals))) == 1


def test_key_frames_come_in_the_interval() -> None:
    config = EncoderConfig(size_px=SIZE_PX, rate_hz=10.0, keyframe_interval_s=0.5)
    encoder = Encoder(config)
    keys = [encoder.encode(quadrants(), 1.0 + n / 10.0).is_key for n in range(11)]
    assert [n for n, key in enumerate(keys) if key] == [0, 5, 10]


def test_the_stream_is_baseline_as_drones_send_it() -> None:
    sets = parameter_sets(CONFIG)
    assert sets.profile_level_id.startswith("42C0")
    assert nal_type(sets.sps) != IDR


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"size_px": (641, 360)}, "even"),
        ({"size_px": (0, 360)}, "even"),
        ({"rate_hz": 0.0}, "rate_hz must lie within 0.1 and 240"),
        ({"bitrate_bps": 1}, "bitrate_bps"),
        ({"keyframe_interval_s": 0.0}, "keyframe_interval_s"),
        ({"keyframe_interval_s": float("nan")}, "keyframe_interval_s"),
        ({"slices": 0}, "slices"),
        ({"threads": 99}, "threads"),
    ],
)
def test_settings_out_of_range_are_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueRangeError, match=message):
        EncoderConfig(**values)


# An encoder never writes the bytes 0 0 0..3 within a unit, nor a final 0.
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
