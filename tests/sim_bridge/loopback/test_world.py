"""The twin as the body of a loopback ANAFI, and its camera."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable

import pytest

from sim_bridge.loopback.twin_camera import TwinCamera
from sim_bridge.loopback.twin_world import TwinWorld
from sim_bridge.loopback.world import WorldState
from sim_bridge.twin.profile import Profile
from tests.sim_bridge.loopback.loopback_world import twin_world
from uav_bt.clock import ManualClock
from uav_bt.errors import DroneError
from uav_bt.types import FlyingState, Land, MoveBy, MovementState, TakeOff, Velocity


class Stepped:
    """The body in the open field, whose physics is advanced by the test."""

    def __init__(self) -> None:
        self.world, self.clock = twin_world()

    def until(self, reached: Callable[[WorldState], bool], limit_s: float = 20.0) -> WorldState:
        for _ in range(round(limit_s / 0.02)):
            self.clock.advance(0.02)
            self.world.catch_up()
            if reached(self.world.state()):
                return self.world.state()
        raise AssertionError(f"not within {limit_s} s: {self.world.state()}")

    def until_moved(self) -> WorldState:
        return self.until(
            lambda state: state.movement is not None and state.movement.state is MovementState.DONE,
            limit_s=9.0,
        )

    def take_off(self) -> None:
        self.world.move(TakeOff())
        self.until(lambda state: state.flying is FlyingState.HOVERING)


@pytest.fixture
def field() -> Stepped:
    return Stepped()


def test_it_takes_off_moves_and_lands(field: Stepped) -> None:
    field.take_off()
    assert field.world.state().altitude_m == pytest.approx(1.0, abs=0.1)
    field.world.move(MoveBy(id=1, forward_m=12.0, yaw_rad=math.pi / 2))
    field.world.point(-0.5)  # which does not disturb the movement
    state = field.until_moved()
    assert (state.north_m, state.east_m) == pytest.approx((12.0, 0.0), abs=0.2)
    assert state.attitude.yaw_rad == pytest.approx(math.pi / 2, abs=0.1)
    assert state.gimbal_pitch_rad == pytest.approx(-0.5, abs=0.02)
    field.world.move(Land())
    state = field.until(lambda state: state.flying is FlyingState.LANDED)
    assert state.altitude_m == pytest.approx(0.0, abs=0.05)


def test_east_is_right_of_north(field: Stepped) -> None:
    field.take_off()
    field.world.move(Velocity(right_mps=1.0))
    state = field.until(lambda state: state.east_m > 0.5)
    assert state.north_m == pytest.approx(0.0, abs=0.2)
    assert state.velocity.right_mps > 0.3


def test_time_that_the_machine_had_not_is_left_out(field: Stepped) -> None:
    field.clock.advance(3.0)
    field.world.catch_up()
    assert field.world.lost_s == pytest.approx(3.0)
    assert field.world.state().captured_s == pytest.approx(0.0, abs=0.03)
    field.until(lambda state: state.captured_s >= 0.1, limit_s=0.2)


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


def test_the_camera_draws_each_picture_once(field: Stepped) -> None:
    field.take_off()
    camera = TwinCamera(
        field.world, image_size_px=(160, 90), seed=1, clock=field.clock, battery=lambda: 0.5
    )
    try:
        first = camera.newest()
        assert first is not None
        assert first.image.shape == (90, 160, 3)
        assert first.image.std() > 1.0
        assert first.location is not None
        assert camera.newest() is first
        field.until(lambda state: state.captured_s > first.captured_s + 0.2)
        second = camera.newest()
        assert second is not None
        assert second.captured_s > first.captured_s
        assert second.battery == 0.5
        assert second.altitude_m == pytest.approx(1.0, abs=0.1)
    finally:
        camera.close()
        camera.close()
