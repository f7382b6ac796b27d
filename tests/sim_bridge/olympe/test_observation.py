"""Events and frames of an ANAFI as states and frames; speeds as stick positions."""

from __future__ import annotations

import math
import threading
import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from sim_bridge.olympe import video
from sim_bridge.olympe.speed import FullSticks, SpeedHolder, Sticks
from sim_bridge.olympe.video import CaptureTimes, FrameClock, decode_frame
from tests.sim_bridge.olympe.fake_olympe import (
    FLYING,
    MEASURED,
    PATIENCE_S,
    STATE,
    FakeFrame,
    Flight,
    config,
)
from uav_bt.types import BodyVelocity, FlyingState, Frame, MoveBy, Velocity


def test_events_become_a_state() -> None:
    flight = Flight(take_off_surface_m=0.4)
    state = flight.state
    assert (state.battery, state.link, state.captured_s) == (None, None, -math.inf)
    flight.play(3.0)
    tell = flight.sdk.event
    tell(FLYING, state=SimpleNamespace(name="flying"))  # a member of an enumeration of the SDK
    tell(f"{STATE}.AttitudeChanged", roll=0.1, pitch=-0.2, yaw=math.pi / 2)
    tell(f"{STATE}.SpeedChanged", speedX=0.0, speedY=0.5, speedZ=-0.1)
    tell(f"{STATE}.AltitudeChanged", altitude=1.5)
    tell("common.CommonState.BatteryStateChanged", percent=63)
    tell("common.CommonState.LinkSignalQuality", value=0x80 | 4)
    tell("gimbal.attitude", gimbal_id=0, pitch_absolute=-30.0, pitch_relative=3.0)
    state = flight.state
    assert (state.captured_s, state.flying) == (3.0, FlyingState.FLYING)
    assert (state.attitude.roll_rad, state.attitude.pitch_rad) == (0.1, -0.2)
    velocity = (state.velocity.forward_mps, state.velocity.right_mps, state.velocity.down_mps)
    assert velocity == pytest.approx((0.5, 0.0, -0.1))
    heights = (state.altitude_m, state.height_m, state.height_above_ground_m)
    assert heights == pytest.approx((1.5, 1.55, 1.95))
    assert state.gimbal_pitch_rad == pytest.approx(math.radians(-30))
    assert (state.battery, state.link) == (0.63, 0.8)
    assert (state.pilot_has_control, state.connected, state.lost) == (False, True, False)
    flight.sdk.connected = False
    assert (flight.state.connected, flight.state.lost) == (False, True)


def test_other_events_and_our_own_commands_do_not_renew_the_state() -> None:
    flight = Flight()
    flight.sdk.measures()
    for _ in range(200):  # 10 s of 20 events a second
        flight.play(0.05)
        flight.sdk.event("gimbal.attitude", gimbal_id=0, pitch_absolute=-30.0)
        flight.sdk.event("camera.zoom_level", cam_id=0, level=1.0)
        flight.play("hovering")
    flight.play(MoveBy(id=1, forward_m=0.3))
    state = flight.state
    assert state.captured_s == 0.0
    assert state.times.gimbal_s == pytest.approx(10.0)
    flight.sdk.measures()
    assert flight.state.captured_s == pytest.approx(10.0)


@pytest.mark.parametrize("silent", MEASURED)
def test_the_state_is_as_old_as_its_oldest_part(silent: str) -> None:
    flight = Flight()
    flight.sdk.measures()
    flight.play(3.0)
    flight.sdk.measures(silent)
    state = flight.state
    assert state.captured_s == getattr(state.times, f"{silent}_s") == 0.0


def test_a_measured_height_has_its_own_time_and_a_computed_one_that_of_the_altitude() -> None:
    flight = Flight()
    flight.sdk.measures()
    assert flight.state.times.height_s == 0.0
    flight.sdk.event(f"{STATE}.AltitudeAboveGroundChanged", altitude=1.2)
    flight.play(1.0)
    flight.sdk.measures()
    assert (flight.state.times.altitude_s, flight.state.times.height_s) == (1.0, 0.0)


def turned(roll: float, pitch: float, yaw: float) -> dict[str, float]:
    rotation = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    return dict(zip("xyzw", rotation.as_quat().tolist(), strict=True))


@given(roll=st.floats(-3, 3), pitch=st.floats(-1.5, 1.5), yaw=st.floats(-3, 3))
def test_older_firmware_sends_a_flat_record(roll: float, pitch: float, yaw: float) -> None:
    record = {"drone_quat": turned(roll, pitch, yaw), "frame_quat": turned(0.0, -0.6, 0.4)}
    frame = FakeFrame({**record, "ground_distance": 1.25}, stream_us=7)
    frame.ref()
    found = decode_frame(frame)
    assert found is not None
    assert found.attitude is not None
    angles = (found.attitude.roll_rad, found.attitude.pitch_rad, found.attitude.yaw_rad)
    assert angles == pytest.approx((roll, pitch, yaw), abs=1e-5)
    assert found.gimbal_pitch_rad == pytest.approx(-0.6)
    assert (found.height_m, found.altitude_m, found.stamp) == (1.25, None, ("stream", 7))


def delivered(flight: Flight, *sent: FakeFrame) -> Frame:
    """Return what is seen of frames that the SDK delivers."""
    for frame in sent:
        flight.sdk.on_frame(frame)
        assert frame.references == 0
    seen = flight.drone.observe().frame
    assert seen is not None
    return seen


def test_only_the_newest_frame_is_seen_with_its_metadata() -> None:
    flight = Flight()
    assert flight.drone.observe().frame is None
    meta = {
        "drone": {"quat": turned(0.0, 0.0, 0.2), "ground_distance": 0.7, "altitude_ato": 1.1},
        "camera": {"quat": turned(0.0, -0.5, 0.0), "timestamp": 5_000_000},
    }
    frame = delivered(flight, FakeFrame(meta, level=16), FakeFrame(meta, level=235))
    assert (frame.image.shape, frame.index) == ((360, 640, 3), 1)
    assert frame.image.min() > 250
    assert frame.captured_s == pytest.approx(-0.15)
    assert (frame.attitude.yaw_rad, frame.gimbal_pitch_rad) == pytest.approx((0.2, -0.5))
    assert (frame.altitude_m, frame.height_m) == (1.1, 0.7)
    assert frame.height_above_ground_m == pytest.approx(1.15)
    assert flight.drone.observe().frame is frame


@pytest.mark.parametrize("meta", [{}, {"drone": 3, "camera": {"quat": {"w": "a"}, "timestamp": 0}}])
def test_a_frame_without_metadata_has_the_values_of_the_state_and_grows_old(meta: Any) -> None:
    flight = Flight()
    flight.sdk.event(f"{STATE}.AltitudeChanged", altitude=1.3)
    flight.sdk.event("gimbal.attitude", pitch_absolute=-45.0)
    frame = delivered(flight, FakeFrame(meta))
    flight.play(7.0)
    assert (frame.altitude_m, frame.gimbal_pitch_rad) == pytest.approx((1.3, -math.pi / 4))
    assert flight.drone.clock.now() - frame.captured_s == pytest.approx(7.15)


def test_colours_come_back() -> None:
    """A red field, computed by the equations of BT.709."""
    red = FakeFrame(level=63)
    red.planes[24:30], red.planes[30:] = 102, 240
    image = delivered(Flight(), red).image
    assert np.abs(image - np.array([255.0, 0.0, 0.0])).max() <= 6


@pytest.mark.parametrize(
    "frames",
    [
        # A delayed frame keeps its time.
        [(10.0, "camera", 1.0, 9.9), (10.3, "camera", 1.1, 10.0), (10.31, "camera", 1.3, 10.2)],
        # Two clocks are independent.
        [(10.0, "stream", 5.0, 9.9), (10.1, "camera", 1.0, 10.0), (10.2, "stream", 5.2, 10.1)],
        # A clock that was set back is a new one.
        [(10.0, "camera", 900.0, 9.9), (10.1, "camera", 0.005, 10.0)],
        # The drone's clock may be slower: by 0.1 s in 1000 s.
        [(0.0, "camera", 0.0, -0.1), (1000.0, "camera", 999.9, 999.9)],
        [(10.0, None, 0.0, 9.9)],
    ],
)
def test_capture_times_are_those_of_the_fastest_frame(frames: list[Any]) -> None:
    times = CaptureTimes(0.1)
    for arrived_s, clock, stamp_s, captured_s in frames:
        stamp = None if clock is None else (clock, round(1e6 * stamp_s))
        assert times.captured(arrived_s, stamp) == pytest.approx(captured_s, abs=1e-3)


def test_a_tick_waits_a_tenth_of_a_second_for_a_new_frame() -> None:
    clock = FrameClock()
    clock.frame_arrived()
    clock.sleep_until(0.03)
    assert clock.now() >= 0.03
    clock.frame_seen()
    clock.sleep_until(0.03)
    assert clock.now() >= 0.13


def test_a_frame_ends_the_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(video, "NO_FRAME_S", PATIENCE_S)
    flight = Flight()
    flight.drone.observe()
    began_s = time.monotonic()
    threading.Timer(0.02, lambda: flight.sdk.on_frame(FakeFrame())).start()
    flight.drone.clock.sleep_until(0.0)
    assert time.monotonic() - began_s < PATIENCE_S


FULL = FullSticks(tilt_rad=math.radians(10.0), climb_mps=0.6, yaw_rate_radps=1.6)


@given(speeds=st.tuples(*[st.floats(-5, 5)] * 3), yaw=st.floats(-9, 9), measured=st.floats(-20, 20))
def test_sticks_stay_within_a_hundred_percent(
    speeds: tuple[float, float, float], yaw: float, measured: float
) -> None:
    forward, right, down = speeds
    holder = SpeedHolder(config())
    limited = holder.limited(
        Velocity(forward_mps=forward, right_mps=right, down_mps=down, yaw_rate_radps=yaw)
    )
    assert math.hypot(limited.forward_mps, limited.right_mps) <= 1.0 + 1e-9
    sticks = holder.sticks(limited, BodyVelocity(forward_mps=measured), 0.0, FULL)
    assert max(map(abs, sticks)) <= 100


def test_without_an_order_a_drone_brakes_and_then_holds_its_position() -> None:
    holder = SpeedHolder(config())
    assert holder.sticks(Velocity(), BodyVelocity(forward_mps=0.5), 0.0, FULL).pitch < 0
    assert holder.sticks(Velocity(), BodyVelocity(forward_mps=0.05), 1.0, FULL) == Sticks()


def test_a_speed_is_reached_also_where_sticks_command_speeds() -> None:
    holder, speed_mps, step_s = SpeedHolder(config()), 0.0, 0.05
    for step in range(400):
        measured = BodyVelocity(forward_mps=speed_mps)
        sticks = holder.sticks(Velocity(forward_mps=0.5), measured, step * step_s, FULL)
        speed_mps += step_s * (sticks.pitch / 100 - speed_mps) / 0.3
    assert speed_mps == pytest.approx(0.5, abs=0.05)
