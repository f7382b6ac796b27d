"""The time of a loopback ANAFI's twin, and its camera."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from sim_bridge.loopback.twin_camera import TwinCamera
from sim_bridge.loopback.twin_world import TwinWorld
from sim_bridge.twin.profile import Profile
from tests.sim_bridge.loopback.loopback_world import Bench, move_by
from uav_bt.clock import ManualClock
from uav_bt.errors import DroneError


def test_time_that_the_machine_had_not_is_left_out() -> None:
    bench = Bench()
    bench.run(0.1)
    before_s = bench.state.captured_s
    bench.clock.advance(3.0)
    bench.world.catch_up()
    assert bench.world.lost_s == pytest.approx(3.0, abs=0.03)
    bench.run(0.2)
    assert bench.state.captured_s == pytest.approx(before_s + 0.2, abs=0.03)


def test_the_newest_picture_of_an_age_is_returned() -> None:
    bench = Bench()
    assert bench.world.newest_capture(0.1) is None
    bench.run(1.0)
    for age_s in (0.0, 0.1, 0.3):
        capture, time_s = bench.world.newest_capture(age_s) or pytest.fail("no picture")
        old_s = bench.state.captured_s - capture.time_s
        assert age_s - 1e-6 <= old_s < age_s + 0.05
        assert time_s == capture.time_s


def test_a_simulation_that_failed_raises_in_the_callers_thread() -> None:
    failed = threading.Event()

    class Broken(ManualClock):
        def now(self) -> float:
            if threading.current_thread() is threading.main_thread():
                return super().now()
            failed.set()
            raise RuntimeError("out of memory")

    world = TwinWorld(None, Profile.named("ideal"), 1, Broken())
    world.start()
    assert failed.wait(60.0)
    world.stop()
    world.stop()
    with pytest.raises(DroneError, match="the simulation failed: out of memory"):
        world.state()


@pytest.mark.parametrize("scene", [None, "train-a"])
def test_the_camera_draws_each_picture_once(scene: str | None) -> None:
    bench = Bench(scene)
    bench.fly()
    how: Any = {"image_size_px": (160, 90), "seed": 1, "clock": bench.clock, "battery": lambda: 0.5}
    camera: Any = TwinCamera(bench.world, **how)
    first = camera.newest()
    assert first.image.shape == (90, 160, 3)
    assert first.image.std() > 1.0
    assert camera.newest() is first
    bench.play(move_by(1.0, 0.5), 4.0)
    second = camera.newest()
    state, place = bench.state, second.position_m
    assert (place.north, place.east) == pytest.approx((state.north_m, state.east_m), abs=0.02)
    assert second.captured_s > first.captured_s
    assert second.battery == 0.5
    assert (second.location is None) is (scene is not None)
    assert second.position_m.down == -second.altitude_m == pytest.approx(-1.0, abs=0.1)
    camera.close()
    camera.close()
