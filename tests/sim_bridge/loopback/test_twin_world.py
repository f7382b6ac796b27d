"""The twin as the world of a loopback ANAFI."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from functools import partial

import cv2
import numpy as np
import pytest

from sim_bridge.loopback.twin_camera import TwinCamera
from sim_bridge.loopback.twin_world import TwinWorld
from sim_bridge.loopback.world import WorldState
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene_file import load_scene
from uav_bt.clock import ManualClock
from uav_bt.errors import DroneError
from uav_bt.types import FlyingState, Land, MoveBy, MovementState, TakeOff, Velocity


class Stepped:
    """A world whose physics is advanced by the test."""

    def __init__(self, scene: str | None = None) -> None:
        self.clock = ManualClock()
        lab = None if scene is None else load_scene(scene)
        self.world = TwinWorld(lab, profile=Profile.named("ideal"), seed=1, clock=self.clock)

    def until(self, reached: Callable[[WorldState], bool], limit_s: float = 20.0) -> WorldState:
        for _ in range(round(limit_s / 0.02)):
            self.clock.advance(0.02)
            self.world.catch_up()
            if reached(self.world.state()):
                return self.world.state()
        raise AssertionError(f"not within {limit_s} s: {self.world.state()}")

    def take_off(self) -> None:
        self.world.move(TakeOff())
        self.until(lambda state: state.flying is FlyingState.TAKING_OFF and not state.lifting)
        self.until(lambda state: state.flying is FlyingState.TAKING_OFF and state.lifting)
        self.until(lambda state: state.flying is FlyingState.HOVERING)


@pytest.fixture
def field() -> Stepped:
    return Stepped()


def test_it_takes_off_moves_and_lands(field: Stepped) -> None:
    field.take_off()
    assert field.world.state().altitude_m == pytest.approx(1.0, abs=0.1)
    field.world.move(MoveBy(id=1, forward_m=12.0, yaw_rad=math.pi / 2))
    state = field.until(
        lambda state: state.movement is not None and state.movement.state is MovementState.DONE,
        limit_s=9.0,
    )
    assert (state.north_m, state.east_m) == pytest.approx((12.0, 0.0), abs=0.2)
    assert state.attitude.yaw_rad == pytest.approx(math.pi / 2, abs=0.1)
    field.world.move(Land())
    state = field.until(lambda state: state.flying is FlyingState.LANDED)
    assert state.altitude_m == pytest.approx(0.0, abs=0.05)


def test_east_is_right_of_north(field: Stepped) -> None:
    field.take_off()
    field.world.move(Velocity(right_mps=1.0))
    state = field.until(lambda state: state.east_m > 0.5)
    assert state.north_m == pytest.approx(0.0, abs=0.2)
    assert state.velocity.right_mps > 0.3


def test_the_gimbal_turns_without_disturbing_a_movement(field: Stepped) -> None:
    field.take_off()
    field.world.move(MoveBy(id=1, forward_m=3.0))
    field.world.point(-0.5)
    state = field.until(
        lambda state: state.movement is not None and state.movement.state is MovementState.DONE
    )
    assert state.north_m == pytest.approx(3.0, abs=0.2)
    assert state.gimbal_pitch_rad == pytest.approx(-0.5, abs=0.02)


def test_a_lab_keeps_its_walls_its_pace_and_its_ceiling() -> None:
    lab = Stepped("train-a")
    assert lab.world.limits.max_speed_mps == 1.0
    assert 2.0 < lab.world.limits.ceiling_m < 5.0


def test_time_that_the_machine_had_not_is_left_out(field: Stepped) -> None:
    field.clock.advance(3.0)
    field.world.catch_up()
    assert field.world.lost_s == pytest.approx(3.0)
    assert field.world.state().time_s == pytest.approx(0.0, abs=0.03)
    field.until(lambda state: state.time_s >= 0.1, limit_s=0.2)


def test_it_runs_on_a_thread_of_its_own_until_stopped(field: Stepped) -> None:
    field.world.start()
    field.world.stop()
    field.world.stop()
    assert field.world.state().flying is FlyingState.LANDED


def test_a_simulation_that_failed_raises_in_the_callers_thread() -> None:
    failed = threading.Event()

    class Broken(ManualClock):
        def now(self) -> float:
            if threading.current_thread() is threading.main_thread():
                return super().now()
            failed.set()
            raise RuntimeError("out of memory")

    world = TwinWorld(None, profile=Profile.named("ideal"), seed=1, clock=Broken())
    world.start()
    assert failed.wait(60.0)
    world.stop()
    with pytest.raises(DroneError, match="the simulation failed: out of memory"):
        world.state()


def test_the_camera_draws_each_picture_once(field: Stepped) -> None:
    field.take_off()
    camera = TwinCamera(
        field.world,
        image_size_px=(160, 90),
        seed=1,
        clock=field.clock,
        battery=lambda: 0.5,
    )
    try:
        first = camera.newest()
        assert first is not None
        assert first.image.shape == (90, 160, 3)
        assert first.image.std() > 1.0
        assert camera.newest() is first
        field.until(lambda state: state.time_s > first.captured_s + 0.2)
        second = camera.newest()
        assert second is not None
        assert second.captured_s > first.captured_s
        assert second.battery == 0.5
        assert second.altitude_m == pytest.approx(1.0, abs=0.1)
    finally:
        camera.close()
        camera.close()


def test_the_zoom_magnifies_the_middle_of_the_picture_and_says_so(field: Stepped) -> None:
    field.world.point(math.radians(-60.0))
    field.take_off()
    views = {}
    for zoom in (1.0, 2.0):
        camera = TwinCamera(
            field.world,
            image_size_px=(320, 180),
            seed=1,
            clock=field.clock,
            battery=lambda: 1.0,
            zoom=partial(float, zoom),
        )
        try:
            frame = camera.newest()
            assert frame is not None
            views[zoom] = frame
        finally:
            camera.close()
    wide, close = views[1.0], views[2.0]
    assert math.tan(close.fov_rad[0] / 2) == pytest.approx(math.tan(wide.fov_rad[0] / 2) / 2)
    assert math.tan(close.fov_rad[1] / 2) == pytest.approx(math.tan(wide.fov_rad[1] / 2) / 2)
    middle = cv2.resize(wide.image[45:135, 80:240], (320, 180))
    same = np.abs(middle.astype(float) - close.image).mean()
    other = np.abs(wide.image.astype(float) - close.image).mean()
    assert same < 0.5 * other
