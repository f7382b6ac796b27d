"""Obedience: a drone that does not execute its commands is named, an obedient one never."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.worlds.tables import cases
from uav_bt.mission.obedience import ObedienceWatch
from uav_bt.mission.safety import Lasting
from uav_bt.types import MeasurementTimes, MovementState, MovementStatus, Velocity
from uav_bt.types.commands import Command, GimbalTo, Hover, Land, MoveBy, Movement, TakeOff
from uav_bt.types.drone_state import Attitude, BodyVelocity, DroneState, FlyingState

CASES = cases("mission")["obedience"]
TICK_S = 0.1
HOVERS = DroneState(captured_s=0.0, flying=FlyingState.HOVERING)

Body = Callable[[float], tuple[Movement, DroneState]]
"""Returns the commanded movement and the drone's report at a time, s."""


def heard(
    body: Body,
    seconds: float = 60.0,
    *,
    gimbal_rad: float | None = None,
    captured_s: float | None = None,
) -> tuple[str, float]:
    """Return the first complaint and its time, s; the telemetry is fresh if it has no own time."""
    watch = ObedienceWatch()
    gimbal = None if gimbal_rad is None else GimbalTo(pitch_rad=gimbal_rad)
    for tick in range(round(seconds / TICK_S)):
        now_s = tick * TICK_S
        movement, state = body(now_s)
        state = replace(state, captured_s=now_s if captured_s is None else captured_s)
        found = watch.complaint(Command(movement=movement, gimbal=gimbal), state, now_s)
        if found is not None:
            return found, now_s
    return "", math.inf


def steps(
    lasts_s: float, end: MovementState, *, ordered_rad: float = 0.0, turned_rad: float = 0.0
) -> Body:
    """Return a mission of consecutive steps, each reported as ended near the end of its time."""

    def body(now_s: float) -> tuple[Movement, DroneState]:
        number = int(now_s // lasts_s)
        over = now_s % lasts_s > lasts_s - 2.5 * TICK_S
        word = MovementStatus(id=number, state=end if over else MovementState.RUNNING)
        heading = Attitude(yaw_rad=turned_rad * (now_s / lasts_s))
        state = replace(HOVERS, movement=word, attitude=heading)
        return MoveBy(id=number, forward_m=0.3, yaw_rad=ordered_rad), state

    return body


def turns(ordered: Callable[[float], float], heading: Callable[[float], float]) -> Body:
    return lambda now_s: (
        Velocity(yaw_rate_radps=ordered(now_s)),
        replace(HOVERS, attitude=Attitude(yaw_rad=math.remainder(heading(now_s), math.tau))),
    )


def steady(movement: Movement, **state: Any) -> Body:
    return lambda _: (movement, replace(HOVERS, **state))


def swaying(speed_mps: Callable[[float], float]) -> Body:
    return lambda now_s: (
        Hover(),
        replace(HOVERS, velocity=BodyVelocity(forward_mps=speed_mps(now_s))),
    )


# One period of a survey between two courses: the heading at every second tick, radians.
# A turn is ordered clockwise from the third of them on, and the other way from the seventh on.
TO_AND_FRO_RAD = (-0.652, -0.665, -0.839, -1.087, -1.259, -1.238, -1.060, -0.811)


def step_of(now_s: float) -> int:
    return round(now_s / TICK_S) % 16


def to_and_fro(now_s: float) -> float:
    return 1.0 if 4 <= step_of(now_s) < 12 else -1.0


RUNNING, DONE = MovementState.RUNNING, MovementState.DONE
INTERRUPTED = "6 movements in a row were interrupted"
NO_TURN, UNDONE = "it does not turn", "its movements are not done"


@pytest.mark.parametrize(
    ("body", "complaint"),
    [
        (steps(3.0, DONE), ""),
        (steps(1.5, RUNNING), ""),  # steps that flow into each other need no end
        (steps(6.0, RUNNING), UNDONE),
        (steps(1.0, MovementState.INTERRUPTED), INTERRUPTED),
        (steps(2.0, DONE, ordered_rad=0.6, turned_rad=0.6), ""),
        (steps(2.0, DONE, ordered_rad=0.6), NO_TURN),
        (steps(2.0, DONE, ordered_rad=0.6, turned_rad=-0.6), NO_TURN),
        (turns(lambda _: 0.5, lambda _: 0.0), NO_TURN),
        (turns(lambda _: 0.5, lambda now_s: 0.5 * now_s), ""),
        (turns(lambda _: 0.5, lambda now_s: -0.5 * now_s), NO_TURN),
        # A heading controller that oscillates faster than the drone reacts orders no turn.
        (turns(lambda now_s: math.copysign(0.4, math.sin(9.0 * now_s)), lambda _: 0.0), ""),
        # The answer to each turn begins when most of the turn is over.
        (turns(to_and_fro, lambda now_s: TO_AND_FRO_RAD[step_of(now_s) // 2]), ""),
        (turns(to_and_fro, lambda _: 0.0), NO_TURN),
        (steady(Land()), "it does not land"),
        (steady(TakeOff(), flying=FlyingState.LANDED), "it does not take off"),
        (swaying(lambda _: 0.4), "it drifts at 0.40 m/s while it should hover: is there wind?"),
        (swaying(lambda _: 0.1), ""),
        (swaying(lambda now_s: 0.5 * math.sin(6.0 * now_s)), ""),
    ],
)
def test_only_disobedience_is_named(body: Body, complaint: str) -> None:
    assert heard(body, 120.0)[0] == complaint


@pytest.mark.parametrize(
    ("body", "after_s"),
    [(steady(Land()), 6.0), (steady(TakeOff(), flying=FlyingState.LANDED), 12.0),
     (swaying(lambda _: 0.4), 4.0), (steps(100.0, RUNNING), 40.0)],
)  # fmt: skip
def test_a_drone_has_time_to_obey(body: Body, after_s: float) -> None:
    assert heard(body)[1] == pytest.approx(after_s, abs=0.21)


@pytest.mark.parametrize("noise_rad", [0.0, 0.005, 0.015], ids=["no", "lab", "harsh"])
@pytest.mark.parametrize("begins_s", [0.0, 120.0])
def test_noise_of_the_heading_is_not_taken_for_a_turn(noise_rad: float, begins_s: float) -> None:
    """150 degrees at 0.6 rad/s take 4.4 s, after 0.6 s of allowed delay."""
    random = np.random.default_rng(3)
    body = turns(
        lambda now_s: 0.6 if now_s >= begins_s else 0.0,
        lambda _: float(random.normal(0.0, noise_rad)),
    )
    assert heard(body, begins_s + 20.0)[1] - begins_s == pytest.approx(5.0, abs=0.3)


def test_short_corrections_do_not_hide_a_drone_that_has_ceased_to_turn() -> None:
    """Corrections that are too short to count as asked must not count as turned."""
    body = turns(
        lambda now_s: math.copysign(0.5, math.sin(7.0 * now_s)) if now_s < 120.0 else 0.6,
        lambda now_s: 0.07 * abs(math.sin(3.5 * now_s)) if now_s < 120.0 else 0.0,
    )
    assert heard(body, 140.0)[1] - 120.0 == pytest.approx(5.0, abs=0.3)


@pytest.mark.parametrize(
    ("pitch_rad", "age_s", "complaint"),
    [
        (0.0, 0.0, "its camera does not point where it should: is the gimbal stuck?"),
        (-0.97, 0.0, ""),
        (0.0, math.inf, ""),  # a drone that never reports its gimbal
    ],
)
def test_a_camera_that_stays_is_named(pitch_rad: float, age_s: float, complaint: str) -> None:
    def body(now_s: float) -> tuple[Movement, DroneState]:
        times = replace(MeasurementTimes.all_at(now_s), gimbal_s=now_s - age_s)
        state = replace(HOVERS, captured_s=now_s, measured=times, gimbal_pitch_rad=pitch_rad)
        return Hover(), state

    assert heard(body, gimbal_rad=-1.0)[0] == complaint


def test_an_outage_is_no_time_in_which_the_camera_stays() -> None:
    """The camera is sent down as telemetry ends, and turns in the first second after the outage."""
    watch, complaints = ObedienceWatch(), set()
    for tick in range(110):
        now_s, known = TICK_S * tick, tick < 2 or tick > 95
        heard_s = now_s if known else TICK_S
        state = replace(HOVERS, captured_s=heard_s, measured=MeasurementTimes.all_at(heard_s))
        command = Command(movement=Hover(), gimbal=GimbalTo(pitch_rad=-1.0))
        complaints.add(watch.complaint(command, state, now_s))
    assert complaints == {None}


@pytest.mark.parametrize("body", [steady(Land()), swaying(lambda _: 2.0)])
def test_old_telemetry_is_held_against_nobody(body: Body) -> None:
    assert heard(body, captured_s=-1.0)[0] == ""


# --- how long a condition has held ----------------------------------------------------------------


@pytest.mark.parametrize(("gap_s", "ticks"), CASES["lasting"])
def test_a_condition_lasts_over_a_short_gap(gap_s: float, ticks: list[list[float]]) -> None:
    lasting = Lasting(gap_s=gap_s)
    for at_s, lasted_s in ticks:
        assert lasting.update(abs(at_s), holds=at_s > 0.0) == pytest.approx(lasted_s)
    lasting.reset()
    assert lasting.update(9.0, holds=True) == 0.0
