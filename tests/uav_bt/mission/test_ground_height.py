"""The height above the ground: free of the altimeter's error and of objects below the drone."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tests.worlds import values
from uav_bt.mission.ground_height import GroundHeight
from uav_bt.types import BodyVelocity, DroneState, FlyingState, MeasurementTimes, Observation

TICK_S = 0.1
FLYING_M = 1.5


def observed(
    time_s: float,
    true_m: float = FLYING_M,
    *,
    altimeter_m: float = 0.0,
    surface_m: float = 0.0,
    down_mps: float = 0.0,
    captured_s: float | None = None,
) -> Observation:
    """Return the report of a drone above a surface, with an altimeter error and a frame."""
    altitude_m = true_m + altimeter_m
    frame = values.frame(
        (9, 16), 0.0, altitude_m, captured_s=time_s if captured_s is None else captured_s, index=1
    )
    state = DroneState(
        captured_s=time_s,
        flying=FlyingState.FLYING,
        velocity=BodyVelocity(down_mps=down_mps),
        altitude_m=altitude_m - 0.1,  # the take-off surface is 0.1 m high
        height_m=true_m - surface_m,
        height_above_ground_m=altitude_m,
    )
    return Observation(frame=frame, state=state)


def errors_m(report: Callable[[float], Observation], last_s: float = 60.0) -> list[float]:
    """Return the errors of the estimates of a flight at constant height, m."""
    height, found = GroundHeight(), []
    for tick in range(round(last_s / TICK_S)):
        corrected = height.corrected(report(tick * TICK_S))
        found.append(corrected.state.height_above_ground_m - FLYING_M)
    return found


def between(begin_s: float, end_s: float, time_s: float) -> float:
    return 0.4 if begin_s < time_s < end_s else 0.0


@pytest.mark.parametrize(
    ("report", "from_tick", "most_m"),
    [
        # The altimeter's slow error is taken off.
        (lambda now_s: observed(now_s, altimeter_m=0.1 * math.sin(now_s / 20.0)), 0, 0.03),
        # A box or the pad below is no ground; a take-off from a box counts from the ground.
        (lambda now_s: observed(now_s, surface_m=between(10.0, 40.0, now_s)), 0, 1e-6),
        (lambda now_s: observed(now_s, surface_m=0.4), 0, 1e-6),
        # Without a rangefinder the height below stays at a constant distance from the altitude.
        (lambda now_s: observed(now_s, surface_m=0.15), 0, 1e-6),
        # With a false sink rate it hovers above the pad for 40 s; over ground it recovers.
        (
            lambda now_s: observed(now_s, surface_m=between(10.0, 50.0, now_s), down_mps=0.05),
            530,
            0.05,
        ),
    ],
)
def test_errors_and_objects_below_are_taken_off(
    report: Callable[[float], Observation], from_tick: int, most_m: float
) -> None:
    assert np.abs(errors_m(report)[from_tick:]).max() < most_m


def test_a_climb_is_followed_at_once_and_late_frames_are_placed_where_they_were() -> None:
    height = GroundHeight()
    for tick in range(30):
        time_s = tick * TICK_S
        captured_s = max(0.0, time_s - 0.3)
        report = observed(time_s, 1.0 + 0.5 * time_s, down_mps=-0.5, captured_s=captured_s)
        corrected = height.corrected(report)
        assert corrected.state.height_above_ground_m == pytest.approx(1.0 + 0.5 * time_s)
        assert corrected.frame is not None
        assert corrected.frame.height_above_ground_m == pytest.approx(1.0 + 0.5 * captured_s)


@pytest.mark.parametrize("step_m", [0.24, 0.45, 1.0, -0.6])
@pytest.mark.parametrize("both", [True, False])
def test_a_step_of_the_altimeter_is_no_climb(step_m: float, *, both: bool) -> None:
    """The vertical velocity shows that the drone stays, whatever the rangefinder says."""
    height, seen_m = GroundHeight(), []
    for tick in range(300):
        climbs, wrong_m = tick < 10, step_m if 100 <= tick < 200 else 0.0
        height_m = FLYING_M - 0.05 * max(0, 10 - tick)
        report = observed(
            tick * TICK_S,
            height_m,
            altimeter_m=wrong_m,
            surface_m=-wrong_m if both else 0.0,
            down_mps=-0.5 if climbs else 0.0,
        )
        seen_m.append(height.corrected(report).state.height_above_ground_m)
    assert seen_m[20:] == pytest.approx([FLYING_M] * 280, abs=0.06)


def test_a_wrong_vertical_velocity_is_no_step_of_the_altimeter() -> None:
    """The drone climbs on, and reports that it stands."""
    height = GroundHeight()
    for tick in range(30):
        down_mps = -0.5 if tick < 5 else 0.0
        corrected = height.corrected(observed(tick * TICK_S, 0.05 * tick, down_mps=down_mps))
        assert corrected.state.height_above_ground_m == pytest.approx(0.05 * tick, abs=0.25)


def test_a_drone_that_reports_no_vertical_velocity_is_measured_anew() -> None:
    height = GroundHeight()
    height.corrected(observed(0.0, 0.1))
    corrected = height.corrected(observed(TICK_S, 1.0))
    assert corrected.state.height_above_ground_m == pytest.approx(1.0)


def test_after_a_gap_the_altimeter_counts_less_its_known_error() -> None:
    height = GroundHeight()
    for tick in range(300):
        height.corrected(observed(tick * TICK_S, altimeter_m=0.06 if tick else 0.0))
    corrected = height.corrected(observed(100.0, 0.8, altimeter_m=0.06))
    assert corrected.state.height_above_ground_m == pytest.approx(0.8, abs=0.02)


def test_what_was_estimated_is_estimated_again_from_its_record() -> None:
    """A replay uses the recorded heights, which are already corrected."""
    rng, first, second = np.random.default_rng(2), GroundHeight(), GroundHeight()
    for tick in range(100):
        altimeter_m, below_m = rng.normal(0.0, 0.03, 2)
        report = observed(tick * TICK_S, altimeter_m=altimeter_m, surface_m=below_m)
        flown = first.corrected(report)
        again = second.corrected(flown)
        assert again.state == flown.state
        assert again.frame is not None
        assert flown.frame is not None
        assert again.frame.height_above_ground_m == flown.frame.height_above_ground_m


def test_one_frame_stays_one_and_a_sample_that_is_not_newer_changes_nothing() -> None:
    height, report = GroundHeight(), observed(1.0)
    first, again = height.corrected(report), height.corrected(report)
    assert first.frame is again.frame
    assert first.state == again.state


# --- quantities with different times --------------------------------------------------------------


def test_between_two_reports_the_height_follows_the_vertical_velocity_to_now() -> None:
    """It climbs at 0.5 m/s; the report is 0.2 s old."""
    height = GroundHeight()
    for tick in range(11):
        report = observed(0.2 * tick, FLYING_M + 0.1 * tick, down_mps=-0.5)
        seen = height.corrected(report, 0.2 * tick + 0.2)
    assert seen.state.height_above_ground_m == pytest.approx(FLYING_M + 1.1, abs=0.02)


def test_a_dead_vertical_velocity_is_carried_on_for_half_a_second_only() -> None:
    height = GroundHeight()
    report = observed(0.0, down_mps=-0.6)
    height.corrected(report, 0.0)
    late = height.corrected(report, 9.0)
    assert late.state.height_above_ground_m == pytest.approx(FLYING_M + 0.3)


def test_an_altitude_counts_at_its_own_time() -> None:
    """It sinks at 0.5 m/s, and the altitude is 0.2 s older than the velocity: 0.1 m higher up."""
    height = GroundHeight()
    for tick in range(100):
        now_s, true_m = 0.1 * tick, 6.0 - 0.05 * tick
        report = observed(now_s, true_m + 0.1, down_mps=0.5)
        times = replace(
            MeasurementTimes.all_at(now_s), altitude_s=now_s - 0.2, height_s=now_s - 0.2
        )
        state = replace(report.state, captured_s=now_s - 0.2, measured=times)
        seen = height.corrected(Observation(frame=None, state=state), now_s)
    assert seen.state.height_above_ground_m == pytest.approx(true_m, abs=0.02)
