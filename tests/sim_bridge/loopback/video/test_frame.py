"""Frames of a source, and their telemetry as Parrot's metadata."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_bridge.loopback.video.frame import (
    EXTENSION_ID,
    MAX_METADATA_BYTES,
    NorthEastDown,
    VideoFrame,
    extension,
    quaternion,
    timed_metadata,
)
from sim_bridge.loopback.world import Location
from tests.sim_bridge.loopback.video.video_client import fields, quadrants, unpack_metadata
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.types import Attitude, FlyingState


@pytest.mark.parametrize("shape", [(4, 4), (4, 4, 4), (0, 4, 3)])
def test_an_image_has_rows_columns_and_three_colours(shape: tuple[int, ...]) -> None:
    with pytest.raises(ShapeError, match="video image must be HxWx3"):
        VideoFrame(image=np.zeros(shape, np.uint8), captured_s=0.0)


def test_an_image_holds_bytes() -> None:
    with pytest.raises(ValueRangeError, match="uint8, got float32"):
        VideoFrame(image=np.zeros((4, 4, 3), np.float32), captured_s=0.0)  # type: ignore[arg-type]


@pytest.mark.parametrize("battery", [-0.1, 87.0])
def test_the_battery_is_a_share(battery: float) -> None:
    with pytest.raises(ValueRangeError, match="within 0 and 1"):
        VideoFrame(image=np.zeros((4, 4, 3), np.uint8), captured_s=0.0, battery=battery)


FRAME = VideoFrame(
    image=quadrants(),
    captured_s=12.5,
    captured_utc_s=1_700_000_000.25,
    attitude=Attitude(roll_rad=0.1, pitch_rad=-0.2, yaw_rad=1.5),
    camera=Attitude(pitch_rad=-0.5, yaw_rad=1.5),
    velocity_mps=NorthEastDown(north=1.0, east=2.0, down=-0.5),
    position_m=NorthEastDown(north=3.0, east=-4.0, down=-1.5),
    location=Location(latitude_deg=48.8789, longitude_deg=2.36778, altitude_m=100.0),
    altitude_m=1.5,
    height_m=1.25,
    battery=0.87,
    flying=FlyingState.HOVERING,
    fov_rad=(1.25, 0.75),
)
# Output of Parrot's library (libvideo-metadata-protobuf of parrot-olympe 8.5.0) for FRAME, with 12
# satellites; here the byte is 14.
PACKED_BY_PARROT = bytes.fromhex(
    "0a81010a140de145393f1564b6d53d1d75fb1fbd256a582e3f121d092a3a92cb7f70484011a9fb00a436f102401900"
    "00000000005940200e19000000000000f43f220f0d0000803f15000000401d000000bf28ae0138024a0f0d00004040"
    "15000080c01d0000c0bf520f0d0000404015000080c01d0000c0bf600169000000000000f83f125c08a0f8fa05120a"
    "0df64f3b3f25e17f2e3f1a140d407d353f15ffaf2c3e1d055e39be252313293f450000a03f4d0000403f5090a188c1"
    "c1c4820358e8077a140d407d353f15ffaf2c3e1d055e39be252313293f85010000803f880101"
)

angles = st.floats(-math.pi, math.pi)


def test_the_message_has_the_bytes_that_parrots_library_packs() -> None:
    # The third field is the link: 20,000 kbit/s, quality 5, -35 dBm.
    wifi = b"\x1a\x0a\x0a\x08\x08\xa0\x9c\x01\x10\x05\x18\x45"
    assert timed_metadata(FRAME) == PACKED_BY_PARROT + wifi


def test_a_frame_that_knows_little_says_little() -> None:
    """Unknown position and date are omitted, instead of 0 degrees and 1970."""
    message = fields(timed_metadata(VideoFrame(image=quadrants(), captured_s=1.0)))
    assert 2 not in fields(message[1])
    assert not {10, 11} & set(fields(message[2]))
    assert fields(message[2])[1] == 1_000_000


@pytest.mark.parametrize(
    ("state", "number"), [(state, number) for number, state in enumerate(FlyingState)]
)
def test_flying_states_have_parrots_numbers(state: FlyingState, number: int) -> None:
    frame = VideoFrame(image=quadrants(), captured_s=1.0, flying=state)
    assert fields(fields(timed_metadata(frame))[1]).get(7, 0) == number


@given(angles, st.floats(-1.5, 1.5), angles)
def test_quaternions_turn_as_the_angles_say(roll: float, pitch: float, yaw: float) -> None:
    """The quaternion rotates the forward axis by yaw and pitch, and the right axis by roll."""
    w, x, y, z = quaternion(Attitude(roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw))
    nose = (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y))
    ahead = (math.cos(pitch) * math.cos(yaw), math.cos(pitch) * math.sin(yaw), -math.sin(pitch))
    assert nose == pytest.approx(ahead, abs=1e-9)
    wing_down = 2 * (y * z + w * x)
    assert wing_down == pytest.approx(math.sin(roll) * math.cos(pitch), abs=1e-9)
    assert math.hypot(w, x, y, z) == pytest.approx(1.0)


@given(st.binary(max_size=MAX_METADATA_BYTES))
def test_the_extension_gives_the_message_back(message: bytes) -> None:
    data = extension(message)
    number, words = struct.unpack_from("!HH", data)
    assert (number, len(data)) == (EXTENSION_ID, 4 + 4 * words)
    assert unpack_metadata(data[4:]) == message


def test_any_frames_metadata_go_on_one_packet() -> None:
    """Fixed-size fields have constant size; varints are longest for times far in the future."""
    frame = VideoFrame(
        image=np.zeros((2, 2, 3), np.uint8),
        captured_s=1e9,
        captured_utc_s=1e10,
        attitude=FRAME.attitude,
        camera=FRAME.attitude,
        velocity_mps=FRAME.velocity_mps,
        position_m=FRAME.position_m,
        location=FRAME.location,
        altitude_m=1.0,
        height_m=1.0,
        flying=FlyingState.EMERGENCY,
        fov_rad=(1.0, 1.0),
    )
    assert len(timed_metadata(frame)) <= MAX_METADATA_BYTES


def test_too_much_metadata_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="at most 300 bytes, got 301"):
        extension(bytes(301))
