"""The parts of the Olympe bridge: addresses, moves, clock, speeds, pictures, metadata, the SDK."""

from __future__ import annotations

import logging
import math
import socket
import sys
import threading
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import sim_bridge.olympe
from sim_bridge.olympe.config import OlympeConfig, olympe_config
from sim_bridge.olympe.courier import Courier
from sim_bridge.olympe.metadata import FrameMetadata, frame_metadata
from sim_bridge.olympe.moves import MoveLedger
from sim_bridge.olympe.pace import FrameClock
from sim_bridge.olympe.probe import probe
from sim_bridge.olympe.sdk import load_sdk
from sim_bridge.olympe.speed import CENTRED, SpeedHolder
from sim_bridge.olympe.video import CaptureTimes, NewestFrame, Picture
from tests.sim_bridge.olympe.fake_olympe import Time, config
from uav_bt.errors import DroneError, InputError, MissingDependencyError, ValueRangeError
from uav_bt.protocols import Drone, DroneOptions
from uav_bt.types import BodyVelocity, DroneState, FlyingState, MoveBy, MovementState, Velocity

# --- addresses ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "address", "host", "port"),
    [
        ("anafi", None, "192.168.42.1", 44445),
        ("sphinx", None, "10.202.0.1", 44445),
        ("anafi", "127.0.0.2", "127.0.0.2", 44445),
        ("sphinx", "drone.lab:45000", "drone.lab", 45000),
    ],
)
def test_an_address_is_a_host_and_perhaps_a_port(
    kind: str, address: str | None, host: str, port: int
) -> None:
    made = olympe_config(kind, DroneOptions(address=address))
    assert (made.host, made.discovery_port) == (host, port)


@pytest.mark.parametrize("address", ["", ":1", "a:b", "::1", "a b", "127.0.0.1:", "x:1234567"])
def test_a_malformed_address_is_refused_with_an_example(address: str) -> None:
    with pytest.raises(InputError, match="expected HOST or HOST:DISCOVERY_PORT, for instance"):
        olympe_config("anafi", DroneOptions(address=address))


def test_a_port_beyond_the_last_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="within 1 and 65535, got 70000"):
        olympe_config("anafi", DroneOptions(address="127.0.0.1:70000"))


def test_only_the_remote_control_stands_between() -> None:
    assert OlympeConfig(kind="anafi", host="192.168.53.1").through_skycontroller
    assert not OlympeConfig(kind="anafi", host="192.168.42.1").through_skycontroller


@pytest.mark.parametrize("limit", ["speed_limit_mps", "altitude_limit_m", "climb_limit_mps"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan])
def test_limits_are_positive(limit: str, value: float) -> None:
    with pytest.raises(ValueRangeError, match=f"{limit} must be a positive number"):
        config(**{limit: value})


def test_both_kinds_are_drones() -> None:
    for create in (sim_bridge.olympe.create_anafi, sim_bridge.olympe.create_sphinx):
        assert isinstance(create(DroneOptions()), Drone)


# --- is anybody there -----------------------------------------------------------------------------


def test_a_listening_port_is_a_drone() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        probe(replace(config(), discovery_port=server.getsockname()[1]))


def test_a_closed_port_is_told_with_what_to_do() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(DroneError, match=r"cannot reach anafi at 127.*refused.*join its Wi-Fi"):
        probe(replace(config(), discovery_port=port))


# --- movements ------------------------------------------------------------------------------------


def told(*moves: MoveBy) -> MoveLedger:
    ledger = MoveLedger()
    for move in moves:
        ledger.told(move)
    return ledger


def state_of(ledger: MoveLedger) -> tuple[int, MovementState]:
    assert ledger.status is not None
    return ledger.status.id, ledger.status.state


def test_a_new_movement_interrupts_the_one_before() -> None:
    ledger = told(MoveBy(id=1, forward_m=1.0), MoveBy(id=2, yaw_rad=0.5))
    ledger.ended("interrupted", (0.4, 0.0, 0.0, 0.0))
    assert state_of(ledger) == (2, MovementState.RUNNING)
    ledger.ended("ok", (0.0, 0.0, 0.0, 0.5))
    assert state_of(ledger) == (2, MovementState.DONE)


def test_an_end_that_crossed_the_next_command_is_the_first_ones() -> None:
    ledger = told(MoveBy(id=1, forward_m=1.0), MoveBy(id=2, yaw_rad=0.5))
    ledger.ended("ok", (1.0, 0.0, 0.0, 0.0))
    assert state_of(ledger) == (2, MovementState.RUNNING)


def test_a_lost_event_does_not_shift_the_later_ones() -> None:
    ledger = told(MoveBy(id=1, forward_m=1.0), MoveBy(id=2, yaw_rad=0.5))
    ledger.ended("ok", (0.0, 0.0, 0.0, 0.49))
    assert state_of(ledger) == (2, MovementState.DONE)
    assert not ledger.moving


@pytest.mark.parametrize("error", ["busy", "notAvailable", "unknown"])
def test_a_refusal_is_the_latest_ones(error: str) -> None:
    ledger = told(MoveBy(id=1, forward_m=1.0), MoveBy(id=2, yaw_rad=0.5))
    ledger.ended(error, (0.0, 0.0, 0.0, 0.0))
    assert state_of(ledger) == (2, MovementState.REJECTED)


def test_an_end_of_nothing_says_nothing() -> None:
    ledger = MoveLedger()
    ledger.ended("ok", (0.0, 0.0, 0.0, 0.0))
    assert ledger.status is None


# --- the clock ------------------------------------------------------------------------------------


def clock(time: Time) -> FrameClock:
    return FrameClock(monotonic=time, condition=time)  # type: ignore[arg-type]


def test_a_tick_waits_for_its_time_even_when_a_frame_is_there() -> None:
    time = Time()
    ticking = clock(time)
    ticking.frame_arrived()
    ticking.sleep_until(0.03)
    assert ticking.now() == pytest.approx(0.03)


def test_without_frames_the_mission_still_ticks() -> None:
    ticking = clock(Time())
    ticking.sleep_until(0.03)
    assert ticking.now() == pytest.approx(0.13, abs=1e-5)


def test_a_frame_that_was_looked_at_wakes_nobody() -> None:
    ticking = clock(Time())
    ticking.frame_arrived()
    ticking.frame_seen()
    ticking.sleep_until(0.0)
    assert ticking.now() == pytest.approx(0.1, abs=1e-5)


# --- speeds ---------------------------------------------------------------------------------------


@settings(deadline=None)  # the machine may be busy
@given(
    forward=st.floats(-5, 5),
    right=st.floats(-5, 5),
    down=st.floats(-5, 5),
    yaw=st.floats(-9, 9),
    measured=st.floats(-20, 20),
)
def test_sticks_stay_within_a_hundred_percent(
    forward: float, right: float, down: float, yaw: float, measured: float
) -> None:
    holder = SpeedHolder(config())
    order = holder.limited(
        Velocity(forward_mps=forward, right_mps=right, down_mps=down, yaw_rate_radps=yaw)
    )
    assert math.hypot(order.forward_mps, order.right_mps) <= 1.0 + 1e-9
    sticks = holder.sticks(order, BodyVelocity(forward_mps=measured), 0.0)
    assert max(map(abs, (sticks.roll, sticks.pitch, sticks.yaw, sticks.climb))) <= 100


def test_nothing_wanted_and_nothing_moving_is_centred() -> None:
    assert SpeedHolder(config()).sticks(Velocity(), BodyVelocity(), 0.0) == CENTRED


@pytest.mark.parametrize("plant", ["tilt", "speed"])
def test_a_speed_is_reached_whatever_the_sticks_mean(plant: str) -> None:
    """On a drone whose sticks tilt it, and on one that takes them for shares of a speed."""
    holder, speed_mps, step_s = SpeedHolder(config()), 0.0, 0.05
    for step in range(400):
        told_mps = BodyVelocity(forward_mps=speed_mps)
        sticks = holder.sticks(Velocity(forward_mps=0.5), told_mps, step * step_s)
        share = sticks.pitch / 100
        if plant == "tilt":
            pull_mps2 = 9.81 * math.tan(share * math.radians(10.0)) - 0.25 * speed_mps
        else:
            pull_mps2 = (share * 1.0 - speed_mps) / 0.3
        speed_mps += step_s * pull_mps2
    assert speed_mps == pytest.approx(0.5, abs=0.05)


# --- pictures -------------------------------------------------------------------------------------


def test_colours_come_back() -> None:
    """A red, a green and a blue field, made by BT.709's equations."""
    wanted = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255]], np.float64)
    matrix = np.array([[0.2126, 0.7152, 0.0722], [-0.1146, -0.3854, 0.5], [0.5, -0.4542, -0.0458]])
    y, cb, cr = (matrix @ wanted.T) * np.array([[219], [224], [224]]) / 255
    planes = np.zeros((3 * 32 // 2, 96), np.uint8)
    for field in range(3):
        planes[:32, 32 * field : 32 * field + 32] = round(16 + y[field])
    for number, colour in enumerate((cb, cr)):
        half = np.repeat(np.round(128 + colour).astype(np.uint8)[None], 16, 0).repeat(16, 1)
        planes[32 + 8 * number : 40 + 8 * number] = half.reshape(8, 96)
    time = Time()
    frames = NewestFrame((96, 32), time, latency_s=0.0, arrived=lambda: None)
    frames.take(Picture(planes=planes))
    frame = frames.newest(DroneState(captured_s=0.0, flying=FlyingState.LANDED), 0.0)
    assert frame is not None
    seen = frame.image[16, [16, 48, 80]].astype(int)
    assert np.abs(seen - wanted).max() <= 6


def test_a_delayed_frame_keeps_its_time() -> None:
    times = CaptureTimes(0.1)
    assert times.captured(10.0, ("camera", 1_000_000)) == pytest.approx(9.9)
    assert times.captured(10.3, ("camera", 1_100_000)) == pytest.approx(10.0, abs=1e-3)
    assert times.captured(10.31, ("camera", 1_300_000)) == pytest.approx(10.2, abs=1e-3)


def test_clocks_are_not_mixed_up() -> None:
    times = CaptureTimes(0.1)
    assert times.captured(10.0, ("stream", 5_000_000_000)) == pytest.approx(9.9)
    assert times.captured(10.1, ("camera", 1_000_000)) == pytest.approx(10.0)
    assert times.captured(10.2, ("stream", 5_000_200_000)) == pytest.approx(10.1, abs=1e-3)


def test_a_clock_that_was_set_back_is_a_new_one() -> None:
    times = CaptureTimes(0.1)
    times.captured(10.0, ("camera", 900_000_000))
    assert times.captured(10.1, ("camera", 5_000)) == pytest.approx(10.0)


def test_a_frame_without_a_stamp_is_of_least_latency() -> None:
    assert CaptureTimes(0.1).captured(10.0, None) == pytest.approx(9.9)


# --- metadata -------------------------------------------------------------------------------------


def turned(roll: float, pitch: float, yaw: float) -> dict[str, float]:
    cr, sr, cp, sp = (f(a / 2) for a in (roll, pitch) for f in (math.cos, math.sin))
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return {
        "w": cr * cp * cy + sr * sp * sy,
        "x": sr * cp * cy - cr * sp * sy,
        "y": cr * sp * cy + sr * cp * sy,
        "z": cr * cp * sy - sr * sp * cy,
    }


@settings(deadline=None)  # the machine may be busy
@given(roll=st.floats(-3, 3), pitch=st.floats(-1.5, 1.5), yaw=st.floats(-3, 3))
def test_a_rotation_comes_back_as_angles(roll: float, pitch: float, yaw: float) -> None:
    attitude = frame_metadata({"drone": {"quat": turned(roll, pitch, yaw)}}).attitude
    assert attitude is not None
    found = (attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad)
    assert found == pytest.approx((roll, pitch, yaw), abs=1e-5)


def test_older_firmware_tells_a_flat_record() -> None:
    told = frame_metadata(
        {
            "drone_quat": turned(0.0, 0.0, 0.4),
            "frame_quat": turned(0.0, -0.6, 0.4),
            "ground_distance": 1.25,
        }
    )
    assert told.attitude is not None
    assert told.attitude.yaw_rad == pytest.approx(0.4)
    assert told.gimbal_pitch_rad == pytest.approx(-0.6)
    assert (told.height_m, told.altitude_m, told.captured_us) == (1.25, None, None)


@pytest.mark.parametrize(
    "told",
    [
        {},
        {"drone": 3, "camera": "x"},
        {"drone": {"quat": {"w": 0, "x": 0, "y": 0, "z": 0}, "ground_distance": None}},
        {"camera": {"quat": {"w": "a"}, "timestamp": 0}},
    ],
)
def test_metadata_that_say_nothing_are_no_error(told: dict[str, object]) -> None:
    assert frame_metadata(told) == FrameMetadata()


# --- the SDK --------------------------------------------------------------------------------------


def test_a_missing_sdk_is_named_with_its_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "olympe", None)
    with pytest.raises(MissingDependencyError, match=r"Parrot's SDK cannot be imported"):
        load_sdk()
    assert logging.root.manager.disable == logging.NOTSET


def test_the_sdks_log_becomes_ours(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    fake = ModuleType("olympe")
    fake.__version__ = "8.5.0"  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "olympe", fake)
    loud = logging.getLogger("olympe")
    monkeypatch.setattr(loud, "handlers", [logging.StreamHandler()])
    monkeypatch.setattr(loud, "propagate", True)
    caplog.set_level(logging.DEBUG)
    assert load_sdk().version == (8, 5, 0)
    logging.getLogger("olympe.pdraw").error("sky %s", "falls")
    assert [(r.name, r.levelname, r.getMessage()) for r in caplog.records] == [
        ("sim_bridge.olympe.sdk.olympe.pdraw", "INFO", "sky falls")
    ]


# --- the courier ----------------------------------------------------------------------------------


def test_jobs_are_done_in_order_and_an_error_comes_back_with_the_next() -> None:
    done: list[int] = []
    failed, landed = threading.Event(), threading.Event()
    courier = Courier()

    def fail() -> None:
        raise DroneError("gone")

    courier.give(lambda: done.append(1))
    courier.give(fail)
    courier.give(failed.set)
    assert failed.wait(30.0)
    with pytest.raises(DroneError, match="gone"):
        courier.give(landed.set)
    assert landed.wait(30.0)
    courier.give(lambda: done.append(2))
    courier.close(30.0)
    assert done == [1, 2]
