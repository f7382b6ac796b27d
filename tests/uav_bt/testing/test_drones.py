"""Drones of the kit: one that answers exactly, and one with faults."""

from __future__ import annotations

import math
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_bridge.plain import PlainConfig
from sim_bridge.twin import TwinConfig
from tests.worlds import values
from tests.worlds.tables import cases
from uav_bt.errors import InputError
from uav_bt.protocols import Drone
from uav_bt.testing import FAULTS, Fault, FaultKind, FaultyDrone, InjectedError, ScriptedDrone
from uav_bt.types import (
    Command,
    FlyingState,
    Hover,
    MoveBy,
    MovementState,
    Observation,
    TakeOff,
    Velocity,
)
from uav_bt.types.commands import CutMotors, GimbalTo, Land, Movement


def flying() -> ScriptedDrone:
    drone = ScriptedDrone()
    while drone.observe().state.flying is not FlyingState.HOVERING:
        drone.send(Command(movement=TakeOff()))
    drone.commands.clear()
    return drone


def word(drone: ScriptedDrone) -> tuple[int, MovementState] | None:
    status = drone.observe().state.movement
    return (status.id, status.state) if status else None


def test_a_movement_ends_after_its_ticks() -> None:
    drone = flying()
    move = MoveBy(id=4, forward_m=1.0, down_m=-0.5, yaw_rad=math.pi / 2)
    words = []
    for _ in range(5):
        drone.send(Command(movement=move))
        words.append(word(drone))
    running, done = (4, MovementState.RUNNING), (4, MovementState.DONE)
    assert words == [running, running, done, done, done]
    assert (drone.x_m, drone.y_m) == pytest.approx((1.0, 0.0))
    assert drone.state.height_above_ground_m == pytest.approx(1.5)
    drone.send(Command(movement=MoveBy(id=5, forward_m=1.0)))
    for _ in range(2):
        drone.send(Command(movement=MoveBy(id=5, forward_m=1.0)))
    # Turned clockwise from +x, ahead is -y.
    assert (drone.x_m, drone.y_m) == pytest.approx((1.0, -1.0))


def test_a_new_movement_supersedes_and_anything_else_cancels() -> None:
    drone = flying()
    drone.send(Command(movement=MoveBy(id=1, forward_m=1.0)))
    drone.send(Command(movement=MoveBy(id=2, forward_m=1.0)))
    assert word(drone) == (2, MovementState.RUNNING)
    drone.send(Command(movement=Hover()))
    assert word(drone) == (2, MovementState.INTERRUPTED)
    assert drone.x_m == 0.0


def test_on_the_ground_movements_are_rejected_and_frames_are_of_now() -> None:
    drone = ScriptedDrone()
    drone.send(Command(movement=MoveBy(id=1, forward_m=1.0)))
    assert word(drone) == (1, MovementState.REJECTED)
    drone.clock.advance(0.1)
    frame = drone.observe().frame
    assert frame is not None
    assert frame.index == 1
    assert frame.captured_s == pytest.approx(0.1)


CASES = cases("faults")


class World(ScriptedDrone):
    """A scripted drone whose images differ from frame to frame."""

    def observe(self) -> Observation:
        seen = super().observe()
        assert seen.frame is not None
        image = np.full_like(seen.frame.image, 10 + seen.frame.index)
        return replace(seen, frame=replace(seen.frame, image=image))


def faulty(text: str) -> tuple[FaultyDrone, World]:
    world = World()
    drone = FaultyDrone(world, Fault.parse(text))
    drone.connect()
    return drone, world


def ticks(drone: FaultyDrone, world: World, *movements: Any, phase: str = "") -> list[Observation]:
    """Observe and send once per movement; return the observations."""
    seen = []
    for movement in movements:
        seen.append(drone.observe())
        drone.send(Command(movement=movement))
        if phase:
            drone.on_tick(values.tick(seen[-1].state, time_s=world.clock.now(), phase=phase))
        world.clock.advance(0.1)
    return seen


def last(text: str) -> Observation:
    """Return the observation of the fourth tick, the second one after the fault's start."""
    drone, world = faulty(text)
    return ticks(drone, world, TakeOff(), Hover(), Hover(), Hover())[-1]


# --- faults: text and time ------------------------------------------------------------------------


@pytest.mark.parametrize(("text", "error", "said"), CASES["refused"])
def test_other_texts_are_refused(text: str, error: type[Exception], said: str) -> None:
    with pytest.raises(error, match=said):
        Fault.parse(text)


@pytest.mark.parametrize(("time", "first", "count"), CASES["times"])
def test_a_fault_begins_and_lasts_by_the_clock(time: str, first: int, count: int) -> None:
    drone, world = faulty(f"battery-low@start{time}")
    low = [each.state.battery == 0.05 for each in ticks(drone, world, *[Hover()] * 20)]
    assert low.index(True) == first
    assert sum(low) == count
    assert drone.began_s == pytest.approx(0.1 * first)


@pytest.mark.parametrize("written", ["go to", "go_to"])
def test_a_fault_waits_for_its_phase_and_lasts_from_its_first_tick_on(written: str) -> None:
    drone, world = faulty(f"battery-low@{written}+0.1~0.2")
    assert drone.missed == f"the flight did not enter the phase '{written}'"
    ticks(drone, world, Hover(), Hover(), phase="land")
    seen = ticks(drone, world, *[Hover()] * 4, phase="go to")
    assert [each.state.battery for each in seen] == [1.0, 0.05, 0.05, 1.0]
    assert drone.missed is None


# --- faults: observations -------------------------------------------------------------------------


def test_a_jump_of_the_position_happens_in_the_tick_after_its_phase_began() -> None:
    drone, world = faulty("position-jump=1@center")
    seen = ticks(drone, world, *[Hover()] * 4, phase="center")
    assert [each.state.velocity.forward_mps for each in seen] == [0.0, 10.0, 0.0, 0.0]


@pytest.mark.parametrize("kind", ["no-telemetry", "video-lost", "link-lost"])
def test_what_is_lost_from_the_start_stays_the_first(kind: str) -> None:
    drone, world = faulty(kind)
    seen = ticks(drone, world, *[Hover()] * 20)
    if kind != "video-lost":
        assert {each.state.captured_s for each in seen} == {0.0}
    if kind != "no-telemetry":
        assert {each.frame.index for each in seen if each.frame} == {0}


def test_noise_changes_the_image() -> None:
    frame = last("noise=5").frame
    assert frame is not None
    assert 0 <= frame.image.min() < 13 < frame.image.max() <= 40  # it was 13


@pytest.mark.parametrize(("kind", "what", "expected"), CASES["observations"])
def test_observations_change(kind: str, what: str, expected: Any) -> None:
    seen = last(kind)
    one = what.startswith(("state", "frame"))
    for path in [what] if one else [f"state.{what}", f"frame.{what}"]:
        told = attrgetter(path)(seen)
        told = told() if callable(told) else told
        shape, number = isinstance(expected, list), isinstance(expected, float)
        assert (list(told) if shape else told) == (
            pytest.approx(expected, nan_ok=True) if number else expected
        )


# --- faults: commands -----------------------------------------------------------------------------

TURN = MoveBy(id=7, forward_m=0.2, yaw_rad=0.5)


@pytest.mark.parametrize(("kind", "sent", "arrives"), CASES["commands"])
def test_another_movement_arrives_than_was_sent(kind: str, sent: Any, arrives: Any) -> None:
    drone, world = faulty(kind)
    drone.observe()
    gimbal = GimbalTo(pitch_rad=-0.5)
    meant = Command(movement=sent, gimbal=gimbal)
    assert drone.send(meant) == meant
    keeps = kind not in {"deaf", "link-lost", "motors-cut", "gimbal-stuck"}
    assert world.commands == [Command(movement=arrives, gimbal=gimbal if keeps else None)]


def test_motors_are_cut_once() -> None:
    drone, world = faulty("motors-cut")
    ticks(drone, world, *[Hover()] * 7)
    cuts = [isinstance(command.movement, CutMotors) for command in world.commands]
    assert cuts == [True] * 5 + [False] * 2


@pytest.mark.parametrize(
    ("kind", "state"),
    [("never-done", MovementState.RUNNING), ("interrupted", MovementState.INTERRUPTED)],
)
def test_movements_do_not_end_as_they_should(kind: str, state: MovementState) -> None:
    drone, world = faulty(kind)
    ticks(drone, world, *[TakeOff()] * 12, *[TURN] * 12)
    moving = drone.observe().state.movement
    assert moving is not None
    assert (moving.id, moving.state) == (TURN.id, state)


# --- faults: exceptions ---------------------------------------------------------------------------


def test_drones_and_listeners_raise() -> None:
    for kind in ("observe-raises", "send-raises", "listener-raises"):
        drone, world = faulty(kind)
        with pytest.raises(InjectedError):
            ticks(drone, world, Land(), phase="land")


def test_an_error_of_a_fault_names_it() -> None:
    drone = FaultyDrone(faulty("observe-raises@start~3")[0], Fault.parse("black"))
    with pytest.raises(InjectedError) as caught:
        drone.observe()
    notes = caught.value.__notes__
    assert notes == ["the injected fault observe-raises@start~3 raised this error"]


# --- faults: with the twin ------------------------------------------------------------------------


def test_faults_of_the_air_need_a_drone_that_is_in_it() -> None:
    with pytest.raises(InputError, match="'wind' needs a drone with a method 'disturb'"):
        faulty("wind")


def hovering_off_m(*faults: str) -> tuple[float, float]:
    """Return a drone's distance from its take-off along x, m: the truth and its estimate."""
    drone: Drone = PlainConfig(profile="ideal").create()
    for text in faults:
        drone = FaultyDrone(drone, Fault.parse(text))
    drone.connect()
    assert drone.referee is not None
    start, believed_m = drone.referee.truth().pose.x_m, 0.0
    movements: list[Movement] = [TakeOff(), *[Hover()] * 99]
    for movement in movements:
        state = drone.observe().state
        world_x_mps = state.velocity.forward_mps * math.cos(state.attitude.yaw_rad)
        world_x_mps -= state.velocity.right_mps * math.sin(state.attitude.yaw_rad)
        believed_m += 0.1 * world_x_mps
        drone.send(Command(movement=movement))
        drone.clock.sleep_until(drone.clock.now() + 0.1)
    moved_m = drone.referee.truth().pose.x_m - start
    drone.disconnect()
    return moved_m, believed_m


def test_wind_pushes_drift_is_not_noticed_and_several_faults_add_up() -> None:
    wind, drift = hovering_off_m("wind=0.8@start+4"), hovering_off_m("drift=0.2@start+4")
    assert wind[0] == pytest.approx(0.2, abs=0.05)  # the drone tilts against the wind
    assert drift[0] == pytest.approx(1.2, abs=0.15)
    assert drift[1] == pytest.approx(0.0, abs=0.1)
    both = hovering_off_m("drift=0.2@start+4", "frozen", "drift=0.1@start+4", "wind=0.8~1")
    assert both[0] == pytest.approx(1.8, abs=0.3)


def test_exact_masks_are_of_what_a_frame_shows() -> None:
    twin = TwinConfig(image_size_px=(160, 90)).create()
    drone = FaultyDrone(twin, Fault.parse("frozen@start+4"))
    drone.connect()
    assert drone.referee is not None
    masks = []
    for number in range(60):
        frame = drone.observe().frame
        if number in {39, 59}:
            assert frame is not None
            masks.append(drone.referee.class_ids(frame, 80, 45))
        drone.send(Command(movement=Velocity(yaw_rate_radps=0.8) if number > 40 else TakeOff()))
        drone.clock.sleep_until(drone.clock.now() + 0.1)
    frame = twin.observe().frame
    assert frame is not None
    assert twin.referee is not None
    true = twin.referee.class_ids(frame, 80, 45)
    drone.disconnect()
    assert np.array_equal(masks[0], masks[1])
    assert not np.array_equal(masks[1], true)


# --- faults: the page -----------------------------------------------------------------------------

PAGE = Path(__file__).parents[3] / "docs" / "faults.md"


def row(kind: FaultKind) -> str:
    level = "" if kind.level is None else f"{kind.level:g} {kind.unit}"
    bounded = math.isfinite(kind.least) or math.isfinite(kind.most)
    limits = f"{kind.least:g} to {kind.most:g}" if bounded else "any"
    return f"| `{kind.name}` | {kind.what} | {level} | {limits if level else ''} |"


def test_the_page_has_the_kinds_as_the_code_has_them() -> None:
    rows = "\n".join(row(kind) for kind in FAULTS.values())
    table = f"| kind | effect | default level | range |\n|---|---|---|---|\n{rows}\n"
    assert table in PAGE.read_text(encoding="utf-8"), (
        f"docs/faults.md: replace the table by\n{table}"
    )
