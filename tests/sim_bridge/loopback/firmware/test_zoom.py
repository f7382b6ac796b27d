"""The camera's zoom."""

from __future__ import annotations

import math

import pytest

from tests.sim_bridge.loopback.loopback_world import Bench

HALF_VIEW = 0.5 / 0.7275  # tangent of half the field of view of 69 degrees


def zoom_to(bench: Bench, target: float, mode: str = "level") -> None:
    bench.send("camera.set_zoom_target", cam_id=0, control_mode=mode, target=target)


def levels(bench: Bench) -> list[float]:
    return [one["level"] for one in bench.values("camera.zoom_level")]


def test_a_client_reads_level_and_bounds_when_it_connects(bench: Bench) -> None:
    bench.send("common.Common.AllStates")
    assert levels(bench) == [1.0]
    info = bench.values("camera.zoom_info")[-1]
    assert info["available"] == "available"
    assert info["maximum_level"] == 3.0
    assert info["high_quality_maximum_level"] == pytest.approx(2.8)


@pytest.mark.parametrize(("asked", "taken"), [(2.0, 2.0), (0.2, 1.0), (9.0, 3.0)])
def test_a_level_is_taken_within_its_bounds_and_reset(
    bench: Bench, asked: float, taken: float
) -> None:
    zoom_to(bench, asked)
    assert levels(bench) == [taken]
    bench.send("camera.reset_zoom", cam_id=0)
    assert levels(bench) == [taken, 1.0]
    assert bench.anafi.zoom.level == 1.0


def test_a_target_that_is_no_number_or_another_cameras_changes_nothing(bench: Bench) -> None:
    zoom_to(bench, 2.0)
    zoom_to(bench, math.nan)
    zoom_to(bench, math.inf, "velocity")
    bench.send("camera.set_zoom_target", cam_id=1, control_mode="level", target=1.5)
    bench.send("camera.reset_zoom", cam_id=1)
    bench.run(1.0)
    assert bench.anafi.zoom.level == 2.0


def test_a_speed_narrows_the_view_steadily_until_quality_would_suffer(bench: Bench) -> None:
    bench.send("camera.set_max_zoom_speed", cam_id=0, max=0.2)
    zoom_to(bench, 0.5, "velocity")
    bench.run(1.0)
    assert HALF_VIEW / bench.anafi.zoom.level == pytest.approx(HALF_VIEW - 0.1, abs=0.01)
    bench.run(10.0)
    assert bench.anafi.zoom.level == pytest.approx(2.8)
    assert levels(bench)[-1] == pytest.approx(2.8)
    bench.send("camera.set_zoom_velocity_quality_degradation", cam_id=0, allow=1)
    zoom_to(bench, 1.0, "velocity")
    bench.run(1.0)
    assert bench.anafi.zoom.level == pytest.approx(3.0)
    zoom_to(bench, -1.0, "velocity")
    bench.run(5.0)
    assert levels(bench)[-1] == 1.0


def test_a_level_ends_a_speed(bench: Bench) -> None:
    zoom_to(bench, -1.0, "velocity")
    zoom_to(bench, 2.0)
    bench.run(1.0)
    assert bench.anafi.zoom.level == 2.0
