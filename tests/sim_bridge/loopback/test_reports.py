"""Gimbal, photographs, memory card, battery, and periodic telemetry."""

from __future__ import annotations

import math

import pytest

from sim_bridge.loopback.media import MAX_BYTES, Card, Photo
from sim_bridge.loopback.world import GROUND_M, HOME
from tests.sim_bridge.loopback.loopback_world import Bench
from uav_bt.types import FlyingState


@pytest.fixture
def bench() -> Bench:
    return Bench()


def gimbal_to(bench: Bench, pitch: float, mode: str = "position", frame: str = "absolute") -> None:
    bench.send(
        "gimbal.set_target",
        gimbal_id=0,
        control_mode=mode,
        yaw_frame_of_reference="none",
        yaw=0.0,
        pitch_frame_of_reference=frame,
        pitch=pitch,
        roll_frame_of_reference="none",
        roll=0.0,
    )


@pytest.mark.parametrize(
    ("asked", "mode", "frame", "seen"),
    [
        (-45.0, "position", "absolute", -45.0),
        (-45.0, "position", "relative", -45.0),
        (-120.0, "position", "absolute", -90.0),
        (95.0, "position", "absolute", 90.0),
        (math.nan, "position", "absolute", -10.0),
        (-30.0, "position", "none", -10.0),
        (-0.5, "velocity", "absolute", -10.0),
    ],
)
def test_the_gimbal_points_within_its_bounds(
    bench: Bench, asked: float, mode: str, frame: str, seen: float
) -> None:
    gimbal_to(bench, -10.0)
    gimbal_to(bench, asked, mode, frame)
    bench.run(2.0)
    assert math.degrees(bench.state.gimbal_pitch_rad) == pytest.approx(seen, abs=0.5)
    assert bench.values("gimbal.attitude", "pitch_absolute")[-1] == pytest.approx(seen, abs=0.5)
    bench.send("gimbal.reset_orientation", gimbal_id=0)
    bench.run(2.0)
    assert bench.state.gimbal_pitch_rad == pytest.approx(0.0, abs=0.01)


def test_a_photograph_is_taken_saved_and_counted(bench: Bench) -> None:
    bench.send("camera.take_photo", cam_id=0)
    bench.send("camera.take_photo", cam_id=0)
    bench.photo.set_result(Photo(jpeg=b"j", thumbnail=b"t", size_px=(640, 360), taken_utc_s=9.0))
    bench.run(0.4)
    assert len(bench.media) == 0  # a real one takes longer
    bench.run(0.2)
    assert bench.values("camera.photo_progress", "result") == [
        "taking_photo",
        "error_bad_state",
        "photo_taken",
        "photo_saved",
    ]
    assert bench.values("camera.photo_state", "state") == ["active", "inactive"]
    assert bench.values("mediastore.counters", "photo_media_count") == [1]
    assert bench.values("camera.photo_progress", "media_id")[-1] in bench.media.media


@pytest.mark.parametrize(
    ("card", "results", "state"),
    [
        (Card.READY, ["taking_photo", "error"], ("available", "ready")),
        (Card.FULL, ["error_no_storage_space"], ("available", "ready")),
        (Card.ABSENT, ["error_no_storage_space"], ("undetected", "unknown")),
    ],
)
def test_a_photograph_that_fails(card: Card, results: list[str], state: tuple[str, str]) -> None:
    bench = Bench(card=card)
    bench.photo.set_exception(OSError("dark"))
    bench.send("common.Common.AllStates")
    bench.send("camera.take_photo", cam_id=0)
    bench.run(1.0)
    assert bench.values("camera.photo_progress", "result") == results
    (reported,) = bench.values("user_storage.state")
    assert (reported["physical_state"], reported["file_system_state"]) == state
    assert bench.values("user_storage.info", "capacity") == [MAX_BYTES]
    assert len(bench.media) == 0


def test_the_battery_drains_warns_and_lands() -> None:
    bench = Bench(charge=0.21)
    bench.fly()
    bench.run(180.0)
    percents = bench.values("common.CommonState.BatteryStateChanged", "percent")
    assert percents == sorted(percents, reverse=True)
    volts = bench.values("battery.voltage", "voltage")
    assert volts == sorted(volts, reverse=True)
    assert 6600 < volts[-1] < 8700
    alerts = bench.values("ardrone3.PilotingState.AlertStateChanged", "state")
    assert alerts == ["low_battery", "critical_battery"]
    levels = [(one["alert"], one["level"]) for one in bench.values("battery.alert")]
    assert [one for one in levels if one[1] != "none"] == [
        ("power_level", "warning"),
        ("power_level", "critical"),
    ]
    assert bench.state.flying is FlyingState.LANDED
    bench.send("ardrone3.Piloting.TakeOff")
    bench.run(1.0)
    assert bench.state.flying is FlyingState.LANDED
    bench.anafi.disconnected()  # on the ground its battery is changed
    bench.send("ardrone3.Piloting.TakeOff")
    bench.run_until(FlyingState.HOVERING)


def test_telemetry_comes_five_times_a_second(bench: Bench) -> None:
    bench.run(1.0)
    bench.events.clear()
    bench.run(4.0)
    for name in ("AttitudeChanged", "SpeedChanged", "AltitudeChanged", "GpsLocationChanged"):
        assert 19 <= len(bench.values(f"ardrone3.PilotingState.{name}")) <= 21
    assert 19 <= len(bench.values("gimbal.attitude")) <= 21


def test_speed_is_reported_north_east_down_and_positions_above_sea_level(bench: Bench) -> None:
    bench.fly()
    bench.move_by(dpsi=math.pi / 2)
    bench.run(5.0)
    bench.move_by(5.0)
    bench.run(2.5)
    speed = bench.values("ardrone3.PilotingState.SpeedChanged")[-1]
    assert speed["speedY"] > 0.5
    assert (speed["speedX"], speed["speedZ"]) == pytest.approx((0.0, 0.0), abs=0.05)
    place = bench.values("ardrone3.PilotingState.GpsLocationChanged")[-1]
    assert place["altitude"] == pytest.approx(GROUND_M + bench.state.altitude_m, abs=0.05)
    assert place["latitude"] == pytest.approx(HOME.latitude_deg, abs=1e-6)
    assert place["longitude"] > HOME.longitude_deg
