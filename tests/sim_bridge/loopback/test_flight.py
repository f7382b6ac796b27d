"""Take-off, landing, emergency stop, and the sticks."""

from __future__ import annotations

import math

import pytest

from sim_bridge.loopback.firmware.flight import EXPIRY_S
from tests.sim_bridge.loopback.loopback_world import Bench, Step, move_by
from uav_bt.types import FlyingState

UP, DOWN = FlyingState.HOVERING, FlyingState.LANDED


def speed_mps(bench: Bench) -> float:
    return math.hypot(bench.state.velocity.forward_mps, bench.state.velocity.right_mps)


FLOWN = ["motor_ramping", "takingoff", "hovering"]


@pytest.mark.parametrize(
    ("steps", "states"),
    [
        (["TakeOff", UP, "Landing", DOWN, 0.1], [*FLOWN, "landing", "landed"]),
        # An emergency stop is reported at once, also on the ground.
        (["TakeOff", UP, "Emergency"], [*FLOWN, "emergency"]),
        (["TakeOff", UP, "Emergency", 3.0], [*FLOWN, "emergency", "landed"]),
        (["Emergency", 3.0], ["emergency", "landed"]),
    ],
)
def test_a_flight_goes_through_the_firmwares_states(steps: list[Step], states: list[str]) -> None:
    bench = Bench(profile="lab")  # which executes commands late
    bench.play(*steps)
    assert bench.flying_states() == states


@pytest.mark.parametrize("centred", [True, False])
def test_the_sticks_fly_until_they_are_centred_or_expire(flown: Bench, *, centred: bool) -> None:
    flown.sticks(0.3, pitch=50)
    going = speed_mps(flown)
    assert going > 0.1
    if centred:
        flown.sticks(0.1)
    else:
        flown.run(EXPIRY_S - 0.2)
        assert flown.flying_states() == ["flying"]
    flown.run(EXPIRY_S)
    assert speed_mps(flown) < going
    flown.run(2.0)
    assert flown.flying_states() == ["flying", "hovering"]


def test_sticks_need_a_flight_and_roll_and_pitch_the_flag(flown: Bench) -> None:
    flown.sticks(1.0, flag=0, roll=50, pitch=50, yaw=100)
    assert speed_mps(flown) == pytest.approx(0.0, abs=0.01)
    assert flown.state.attitude.yaw_rad > 0.3
    landed = Bench()
    landed.sticks(1.0, pitch=50, gaz=50)
    assert landed.state.flying is DOWN
    assert (landed.state.north_m, landed.state.altitude_m) == pytest.approx((0.0, 0.0), abs=1e-3)


def test_a_tilt_accelerates_until_drag_ends_it(flown: Bench) -> None:
    flown.send("MaxTilt", current=5.0)
    flown.sticks(1.0, pitch=100)
    assert 0.5 < speed_mps(flown) < 0.86  # without drag, g tan(5 degrees) gives 0.86 m/s
    flown.sticks(20.0, pitch=100)
    assert speed_mps(flown) == pytest.approx(1.56, abs=0.02)


def test_sticks_are_shares_of_what_is_set_within_what_the_body_can_do(flown: Bench) -> None:
    for setting, value in (
        ("MaxTilt", 40.0),
        ("MaxVerticalSpeed", 0.4),
        ("MaxRotationSpeed", 30.0),
    ):
        flown.send(setting, current=value)
    flown.sticks(5.0, gaz=50, yaw=-100)
    assert flown.state.velocity.down_mps == pytest.approx(-0.2, abs=0.02)
    before = flown.state.turned_rad
    flown.sticks(1.0, gaz=50, yaw=-100)
    assert flown.state.turned_rad - before == pytest.approx(-math.radians(30.0), abs=0.02)
    flown.sticks(20.0, pitch=100, roll=-100)
    assert speed_mps(flown) == pytest.approx(4.0, abs=0.05)
    assert flown.state.velocity.right_mps == pytest.approx(-2.83, abs=0.05)


@pytest.mark.parametrize(
    ("scene", "limit_m", "kept_m"),
    [(None, 2.0, 2.0), ("depot-val-a", 30.0, 3.5), ("train-a", 30.0, 3.75)],
)
def test_it_climbs_to_its_limit(scene: str | None, limit_m: float, kept_m: float) -> None:
    bench = Bench(scene)
    bench.fly()
    bench.send("MaxAltitude", current=limit_m)
    bench.sticks(16.0, gaz=25)
    assert bench.state.altitude_m == pytest.approx(kept_m, abs=0.2)
    bench.play(move_by(dz=-5.0), 4.0)
    assert bench.state.altitude_m == pytest.approx(kept_m, abs=0.2)
