"""Gimbal, photographs and recordings."""

from __future__ import annotations

import math

import pytest

from tests.sim_bridge.loopback.loopback_world import Bench


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


def pitch_deg(bench: Bench) -> float:
    return math.degrees(bench.world.state().gimbal_pitch_rad)


@pytest.mark.parametrize(("asked", "taken"), [(-45.0, -45.0), (-120.0, -90.0), (95.0, 90.0)])
def test_the_gimbal_points_within_its_bounds(bench: Bench, asked: float, taken: float) -> None:
    gimbal_to(bench, asked)
    bench.run(0.3)
    assert pitch_deg(bench) == pytest.approx(taken)
    assert bench.values("gimbal.attitude")[-1]["pitch_absolute"] == pytest.approx(taken)


def test_the_gimbal_moves_at_a_speed_until_its_bound(bench: Bench) -> None:
    bench.send("gimbal.set_max_speed", gimbal_id=0, yaw=0.0, pitch=60.0, roll=0.0)
    gimbal_to(bench, -0.5, mode="velocity", frame="none")
    bench.run(1.0)
    assert pitch_deg(bench) == pytest.approx(-30.0, abs=1.0)
    bench.run(5.0)
    assert pitch_deg(bench) == pytest.approx(-90.0)
    gimbal_to(bench, 0.5, mode="velocity", frame="none")
    bench.run(1.0)
    gimbal_to(bench, 0.0, mode="velocity", frame="none")
    bench.run(1.0)
    assert pitch_deg(bench) == pytest.approx(-60.0, abs=1.0)


@pytest.mark.parametrize(("pitch", "frame"), [(math.nan, "absolute"), (-30.0, "none")])
def test_a_gimbal_target_that_is_none_changes_nothing(
    bench: Bench, pitch: float, frame: str
) -> None:
    gimbal_to(bench, -10.0)
    gimbal_to(bench, pitch, frame=frame)
    assert pitch_deg(bench) == pytest.approx(-10.0)


def test_a_photo_is_taken_and_saved(bench: Bench) -> None:
    bench.events.clear()
    bench.send("camera.take_photo", cam_id=0)
    bench.run(1.0)
    results = [one["result"] for one in bench.values("camera.photo_progress")]
    assert results == ["taking_photo", "photo_taken", "photo_saved"]
    assert [one["state"] for one in bench.values("camera.photo_state")] == ["active", "inactive"]


def test_a_recording_starts_and_stops(bench: Bench) -> None:
    bench.events.clear()
    bench.send("camera.stop_recording", cam_id=0)
    bench.send("camera.start_recording", cam_id=0)
    bench.send("camera.stop_recording", cam_id=0)
    results = [one["result"] for one in bench.values("camera.recording_progress")]
    assert results == ["error_bad_state", "started", "stopped"]


@pytest.mark.parametrize(
    ("mode", "effective"),
    [
        ("automatic", ("shutter_1_over_500", "iso_100")),
        ("manual", ("shutter_1_over_60", "iso_800")),
        ("manual_iso_sensitivity", ("shutter_1_over_500", "iso_800")),
        ("manual_shutter_speed", ("shutter_1_over_60", "iso_100")),
    ],
)
def test_the_effective_exposure_is_the_manual_one_where_one_is_set(
    bench: Bench, mode: str, effective: tuple[str, str]
) -> None:
    bench.send("common.Common.AllStates")
    assert bench.values("camera.exposure")[-1]["shutter_speed"] == "shutter_1_over_500"
    bench.send(
        "camera.set_exposure_settings",
        cam_id=0,
        mode=mode,
        shutter_speed="shutter_1_over_60",
        iso_sensitivity="iso_800",
        max_iso_sensitivity="iso_3200",
        metering_mode="standard",
    )
    bench.run(0.1)
    exposure = bench.values("camera.exposure")[-1]
    assert (exposure["shutter_speed"], exposure["iso_sensitivity"]) == effective
    assert exposure["lock_roi_x"] == -1.0
