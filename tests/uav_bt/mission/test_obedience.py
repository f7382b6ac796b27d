"""Obedience: a drone that does not execute its commands is named, an obedient one never."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from uav_bt.mission.obedience import ObedienceWatch
from uav_bt.types import (
    Attitude,
    BodyVelocity,
    Command,
    DroneState,
    FlyingState,
    GimbalTo,
    Hover,
    Land,
    MeasurementTimes,
    MoveBy,
    Movement,
    MovementState,
    MovementStatus,
    TakeOff,
    Velocity,
)

TICK_S = 0.1
HOVERS = DroneState(captured_s=0.0, flying=FlyingState.HOVERING)

Body = Callable[[float], tuple[Movement, DroneState]]
"""Returns the commanded movement and the drone's report at a time, s."""


def first_complaint(body: Body, *, seconds: float = 60.0, gimbal_rad: float | None = None) -> str:
    watch = ObedienceWatch()
    gimbal = None if gimbal_rad is None else GimbalTo(pitch_rad=gimbal_rad)
    for tick in range(round(seconds / TICK_S)):
        now_s = tick * TICK_S
        movement, state = body(now_s)
        command = Command(movement=movement, gimbal=gimbal)
        found = watch.complaint(command, replace(state, captured_s=now_s), now_s)
        if found is not None:
            return found
    return ""


def status(number: int, state: MovementState) -> DroneState:
    return replace(HOVERS, movement=MovementStatus(id=number, state=state))


def steps(lasts_s: float, end: MovementState, *, yaw_rad: float = 0.0) -> Body:
    """Return a mission of consecutive steps, each reported as ended near the end of its time."""

    def body(now_s: float) -> tuple[Movement, DroneState]:
        number = int(now_s // lasts_s)
        over = now_s % lasts_s > lasts_s - 2.5 * TICK_S
        word = end if over else MovementState.RUNNING
        turned_rad = yaw_rad * (now_s / lasts_s)
        state = replace(status(number, word), attitude=Attitude(yaw_rad=turned_rad))
        return MoveBy(id=number, forward_m=0.3, yaw_rad=abs(yaw_rad)), state

    return body


def test_steps_that_are_done_are_obedience() -> None:
    assert first_complaint(steps(3.0, MovementState.DONE)) == ""


def test_steps_that_flow_into_each_other_need_no_end() -> None:
    assert first_complaint(steps(1.5, MovementState.RUNNING)) == ""


def test_steps_that_never_end_are_named() -> None:
    assert "movements are not done" in first_complaint(steps(6.0, MovementState.RUNNING))


@pytest.mark.parametrize("end", [MovementState.INTERRUPTED, MovementState.REJECTED])
def test_steps_that_the_drone_breaks_off_are_named(end: MovementState) -> None:
    assert "in a row were interrupted" in first_complaint(steps(1.0, end))


def test_a_turn_that_is_reported_and_not_seen_is_named() -> None:
    stays = steps(2.0, MovementState.DONE, yaw_rad=0.0)

    def body(now_s: float) -> tuple[Movement, DroneState]:
        move, state = stays(now_s)
        assert isinstance(move, MoveBy)
        return replace(move, forward_m=0.0, yaw_rad=0.6), state

    assert first_complaint(body) == "it does not turn"


def test_a_turn_that_is_seen_is_obedience() -> None:
    assert first_complaint(steps(2.0, MovementState.DONE, yaw_rad=0.6)) == ""


@pytest.mark.parametrize(("rate_radps", "said"), [(0.0, "it does not turn"), (0.5, "")])
def test_velocity_orders_must_turn_it_too(rate_radps: float, said: str) -> None:
    def body(now_s: float) -> tuple[Movement, DroneState]:
        heading = math.remainder(rate_radps * now_s, math.tau)
        return Velocity(yaw_rate_radps=0.5), replace(HOVERS, attitude=Attitude(yaw_rad=heading))

    assert first_complaint(body) == said


@pytest.mark.parametrize("noise_rad", [0.0, 0.005, 0.015], ids=["no", "lab", "harsh"])
@pytest.mark.parametrize("hovers_s", [0.0, 120.0])
def test_noise_of_the_heading_is_not_taken_for_a_turn(noise_rad: float, hovers_s: float) -> None:
    """150 degrees at 0.6 rad/s take 4.4 s, after 0.6 s of allowed delay."""
    random = np.random.default_rng(3)
    watch, found_s = ObedienceWatch(), math.inf
    for tick in range(round((hovers_s + 20.0) / TICK_S)):
        now_s = tick * TICK_S
        turns = now_s >= hovers_s
        heading = Attitude(yaw_rad=float(random.normal(0.0, noise_rad)))
        state = replace(HOVERS, captured_s=now_s, attitude=heading)
        command = Command(movement=Velocity(yaw_rate_radps=0.6 if turns else 0.0))
        if watch.complaint(command, state, now_s) is not None:
            found_s = now_s
            break
    assert found_s - hovers_s == pytest.approx(5.0, abs=0.3)


def test_a_drone_that_turns_the_other_way_is_named() -> None:
    def body(now_s: float) -> tuple[Movement, DroneState]:
        heading = math.remainder(-0.5 * now_s, math.tau)
        return Velocity(yaw_rate_radps=0.5), replace(HOVERS, attitude=Attitude(yaw_rad=heading))

    assert first_complaint(body) == "it does not turn"


def test_corrections_to_and_fro_are_no_ordered_turn() -> None:
    """A heading controller that oscillates faster than the drone reacts commands no turn."""

    def body(now_s: float) -> tuple[Movement, DroneState]:
        return Velocity(yaw_rate_radps=0.4 * math.copysign(1.0, math.sin(9.0 * now_s))), HOVERS

    assert first_complaint(body, seconds=120.0) == ""


# One period of a survey between two courses: the heading at every second tick, radians.
# A turn is ordered clockwise from the third of them on, and the other way from the seventh on.
TO_AND_FRO_RAD = (-0.652, -0.665, -0.839, -1.087, -1.259, -1.238, -1.060, -0.811)


@pytest.mark.parametrize(("turns", "complaint"), [(True, ""), (False, "it does not turn")])
def test_turns_to_and_fro_are_answered_late(*, turns: bool, complaint: str) -> None:
    """The answer to each turn begins when most of the turn is over."""

    def body(now_s: float) -> tuple[Movement, DroneState]:
        step = round(now_s / TICK_S) % 16
        heading = TO_AND_FRO_RAD[step // 2] if turns else 0.0
        rate_radps = 1.0 if 4 <= step < 12 else -1.0
        state = replace(HOVERS, attitude=Attitude(yaw_rad=heading))
        return Velocity(yaw_rate_radps=rate_radps), state

    assert first_complaint(body, seconds=120.0) == complaint


def test_short_corrections_do_not_hide_a_drone_that_has_ceased_to_turn() -> None:
    """Corrections that are too short to count as asked must not count as turned."""
    watch, found_s = ObedienceWatch(), math.inf
    for tick in range(round(140.0 / TICK_S)):
        now_s = tick * TICK_S
        swings = now_s < 120.0
        rate_radps = 0.5 * math.copysign(1.0, math.sin(7.0 * now_s)) if swings else 0.6
        heading = Attitude(yaw_rad=0.07 * abs(math.sin(3.5 * now_s)) if swings else 0.0)
        state = replace(HOVERS, captured_s=now_s, attitude=heading)
        command = Command(movement=Velocity(yaw_rate_radps=rate_radps))
        if watch.complaint(command, state, now_s) is not None:
            found_s = now_s
            break
    assert found_s - 120.0 == pytest.approx(5.0, abs=0.3)


@pytest.mark.parametrize("turns_rad", [0.0, -0.6])
def test_movements_that_turn_too_little_or_the_wrong_way_are_named(turns_rad: float) -> None:
    assert first_complaint(steps(2.0, MovementState.DONE, yaw_rad=0.6)) == ""
    wrong = steps(2.0, MovementState.DONE, yaw_rad=turns_rad)

    def body(now_s: float) -> tuple[Movement, DroneState]:
        move, state = wrong(now_s)
        assert isinstance(move, MoveBy)
        return replace(move, yaw_rad=0.6), state

    assert first_complaint(body) == "it does not turn"


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

    assert first_complaint(body, gimbal_rad=-1.0) == complaint


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


def test_a_landing_that_does_not_begin_is_named() -> None:
    assert first_complaint(lambda _: (Land(), HOVERS)) == "it does not land"
    lands = replace(HOVERS, flying=FlyingState.LANDING)
    assert first_complaint(lambda _: (Land(), lands)) == ""


def test_a_take_off_that_does_not_begin_is_named() -> None:
    stands = replace(HOVERS, flying=FlyingState.LANDED)
    assert first_complaint(lambda _: (TakeOff(), stands)) == "it does not take off"


@pytest.mark.parametrize(("speed_mps", "said"), [(0.4, True), (0.1, False)])
def test_a_drone_that_is_carried_away_is_named(speed_mps: float, said: bool) -> None:  # noqa: FBT001
    blown = replace(HOVERS, velocity=BodyVelocity(right_mps=speed_mps))
    assert ("is there wind?" in first_complaint(lambda _: (Hover(), blown))) is said


def test_to_and_fro_is_no_drift() -> None:
    def body(now_s: float) -> tuple[Movement, DroneState]:
        sway = BodyVelocity(forward_mps=0.5 * math.sin(6.0 * now_s))
        return Hover(), replace(HOVERS, velocity=sway)

    assert first_complaint(body) == ""


def test_old_telemetry_is_held_against_nobody() -> None:
    watch = ObedienceWatch()
    blown = replace(HOVERS, velocity=BodyVelocity(right_mps=2.0))
    for tick in range(200):
        assert watch.complaint(Command(movement=Hover()), blown, 5.0 + tick * TICK_S) is None


def test_old_telemetry_does_not_say_that_a_landing_has_not_begun() -> None:
    watch = ObedienceWatch()
    for tick in range(200):
        assert watch.complaint(Command(movement=Land()), HOVERS, 1.0 + tick * TICK_S) is None
