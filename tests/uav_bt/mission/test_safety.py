"""The arbiter: order of the safety rules, the command of each, landings, and limits."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import Any

import pytest

from tests.worlds.tables import cases
from uav_bt.board import FRAME
from uav_bt.board.context import Proposals
from uav_bt.errors import ProposalConflictError, ValueRangeError
from uav_bt.mission.limits import Limits, approach_speed_mps, limit_movement
from uav_bt.mission.safety import Arbiter, Circumstances, Override, safety_rules
from uav_bt.types import Airframe, DroneState, FlyingState, Release, TakeOff, Velocity
from uav_bt.types.commands import Command, CutMotors, GimbalTo, Hover, Land, MoveBy, Movement

CASES = cases("mission")["safety"]
LIMITS = Limits(speed_mps=1.0, climb_mps=0.5, yaw_rate_radps=1.5, ceiling_m=2.4)
DOWN = GimbalTo(pitch_rad=-1.0)
AHEAD = MoveBy(id=1, forward_m=1.0)

# The cause of each rule, as changes of normal circumstances; its command.
RULES: dict[Override, tuple[dict[str, Any], Command]] = {
    Override.CUT: ({"cut": True}, Command(movement=CutMotors())),
    Override.MANUAL: ({"manual": True}, Command(movement=Release())),
    Override.ABORT: ({"abort": True}, Command(movement=Land())),
    Override.BATTERY: ({"battery": 0.05}, Command(movement=Land())),
    Override.LINK: ({"state_age_s": 2.0}, Command(movement=Hover())),
    Override.STALE_FRAME: ({"frame_age_s": math.inf}, Command(movement=Hover(), gimbal=DOWN)),
}


def now(
    flying: FlyingState = FlyingState.HOVERING, *, height_m: float = 1.5, **changes: Any
) -> Circumstances:
    """Return normal circumstances, with changes of them or of the state."""
    told = {name: changes.pop(name) for name in ("battery", "connected") if name in changes}
    pilot = changes.pop("pilot", False)
    state = DroneState(
        captured_s=0.0,
        flying=flying,
        height_m=height_m,
        height_above_ground_m=height_m,
        pilot_has_control=pilot,
        **told,
    )
    return Circumstances(state=state, **changes)


def proposing(movement: Movement | None = None, gimbal: GimbalTo | None = None) -> Proposals:
    proposals = Proposals()
    if movement is not None:
        proposals.propose("Mission/leaf", movement)
    if gimbal is not None:
        proposals.propose_gimbal("Mission/leaf", gimbal)
    return proposals


def decide(movement: Movement | None, limits: Limits = LIMITS, **changes: Any) -> Movement:
    return Arbiter(limits).decide(proposing(movement), now(**changes)).movement


# --- the rules ------------------------------------------------------------------------------------


def test_the_order_is_the_documented_one() -> None:
    assert (
        [override for _, override, _ in safety_rules(now(), LIMITS)]
        == list(RULES)
        == list(Override)
    )


@pytest.mark.parametrize("override", Override)
def test_each_rule_has_one_answer_and_ends_with_its_cause(override: Override) -> None:
    """Only where a frame is stale the leaves still point the camera, which may end it."""
    cause, command = RULES[override]
    arbiter = Arbiter(LIMITS)
    assert arbiter.decide(proposing(AHEAD, DOWN), now(**cause)) == command
    assert arbiter.override is override
    assert arbiter.decide(proposing(AHEAD, DOWN), now()) == Command(movement=AHEAD, gimbal=DOWN)
    assert arbiter.override is None


@pytest.mark.parametrize("count", range(1, len(Override) + 1))
def test_whatever_else_is_wrong_the_strongest_rule_decides(count: int) -> None:
    """All combinations of simultaneous causes."""
    for causes in itertools.combinations(list(Override), count):
        changes = {name: value for cause in causes for name, value in RULES[cause][0].items()}
        arbiter = Arbiter(LIMITS)
        assert arbiter.decide(proposing(AHEAD, DOWN), now(**changes)) == RULES[causes[0]][1], causes
        assert arbiter.override is causes[0]


AT_THE_LIMITS = {"battery": LIMITS.critical_battery, "frame_age_s": FRAME.max_age_s}


@pytest.mark.parametrize(("changes", "override"), [*CASES["matters"], (AT_THE_LIMITS, None)])
def test_causes_count_where_they_matter(changes: dict[str, Any], override: Override | None) -> None:
    """Limits are reached only beyond them."""
    arbiter = Arbiter(LIMITS)
    arbiter.decide(proposing(), now(**changes))
    assert arbiter.override is override


# --- proposals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("movement", "gimbal"), [(None, None), (Land(), DOWN), (None, DOWN), (TakeOff(), None)]
)
def test_movement_and_gimbal_are_channels_of_their_own_and_nothing_means_hover(
    movement: Movement | None, gimbal: GimbalTo | None
) -> None:
    command = Arbiter(LIMITS).decide(proposing(movement, gimbal), now())
    assert command == Command(movement=movement or Hover(), gimbal=gimbal)


def test_a_conflict_names_both_leaves_and_keeps_the_first() -> None:
    proposals = proposing(Land(), DOWN)
    names = "'Mission/leaf' and 'Mission/other'"
    with pytest.raises(ProposalConflictError, match=f"{names}.*movement"):
        proposals.propose("Mission/other", Land())
    with pytest.raises(ProposalConflictError, match=f"{names}.*gimbal"):
        proposals.propose_gimbal("Mission/other", DOWN)
    assert (proposals.movement, proposals.movement_owner) == (Land(), "Mission/leaf")


# --- landings -------------------------------------------------------------------------------------

OLD = [{"frame_age_s": 5.0}, {"state_age_s": 5.0}, {"state_age_s": 0.8}, {"frame_age_s": 0.8}]


def landing() -> Arbiter:
    arbiter = Arbiter(LIMITS)
    arbiter.decide(proposing(Land()), now(FlyingState.FLYING))
    assert arbiter.landing
    return arbiter


@pytest.mark.parametrize("old", OLD)
def test_no_leaf_takes_a_landing_back_by_old_data(old: dict[str, float]) -> None:
    for proposed in (None, Hover(), MoveBy(id=1, down_m=-1.0)):
        assert landing().decide(proposing(proposed), now(**old)).movement == Land()
    assert decide(Land(), **old) == Land()
    assert decide(Velocity(down_mps=0.2), **old) == Hover()
    for stronger in ({"abort": True}, {"battery": 0.05}):
        assert landing().decide(proposing(None), now(**(stronger | old))).movement == Land()


def test_with_fresh_data_a_mission_may_change_its_mind() -> None:
    arbiter = landing()
    assert arbiter.decide(proposing(MoveBy(id=1)), now()).movement == MoveBy(id=1)
    assert not arbiter.landing
    assert arbiter.decide(proposing(None), now(frame_age_s=5.0)).movement == Hover()


def test_a_leaf_that_is_silent_for_a_tick_does_not_stop_a_drone_that_is_landing() -> None:
    assert landing().decide(proposing(None), now(FlyingState.LANDING)).movement == Land()


@pytest.mark.parametrize("override", [Override.MANUAL, Override.CUT])
def test_a_pilot_and_the_motor_cut_end_a_landing(override: Override) -> None:
    """Afterwards, with old data, the drone hovers until a leaf proposes the landing again."""
    arbiter, (cause, command) = landing(), RULES[override]
    assert arbiter.decide(proposing(Land()), now(**cause)) == command
    assert not arbiter.landing
    assert arbiter.decide(proposing(None), now(frame_age_s=5.0)).movement == Hover()


# --- limits ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(("asked", "height_m", "flown"), CASES["limited"])
def test_a_movement_is_flown_within_the_limits_in_its_direction(
    asked: Movement, height_m: float, flown: Movement
) -> None:
    decided = decide(asked, height_m=height_m)
    assert type(decided) is type(flown)
    assert vars(decided) == pytest.approx(vars(flown), abs=1e-4)


def test_a_corrected_movement_is_limited_a_landing_in_speed_only_and_no_rule_is_corrected() -> None:
    """The position hold flies the landing as a velocity, also below the floor."""

    def flown(movement: Movement, held: Velocity, **changes: Any) -> Movement:
        low = now(height_m=0.25, **changes)
        return Arbiter(LIMITS).decide(proposing(movement), low, lambda _: held).movement

    fast = Velocity(forward_mps=30.0, down_mps=0.9)
    assert flown(Hover(), fast) == Velocity(forward_mps=1.0)
    assert flown(Land(), fast) == Velocity(forward_mps=1.0, down_mps=0.5)
    assert flown(Hover(), fast, abort=True) == Land()


def test_a_prompt_drone_brakes_with_its_deceleration() -> None:
    """V = sqrt(2 a s): from 0.6 m/s it stops within 0.18 m at 1 m/s^2."""
    prompt = Airframe(command_delay_s=0.0, command_lag_s=0.0)
    assert approach_speed_mps(0.18, 1.0, prompt, 0.0) == pytest.approx(0.6)
    assert approach_speed_mps(0.0, 1.0, prompt, 0.0) == 0.0


def test_a_late_drone_has_room_for_its_delay_its_lag_and_old_telemetry_and_brakes() -> None:
    """Room = (e d + 4 T) v + v^2 / (2 a); at 0.5 s and 0.25 s 0.46 m/s need 1.2 m."""
    late = Airframe(command_delay_s=0.1, command_lag_s=0.25)
    speed_mps = approach_speed_mps(1.2, 0.9, late, 0.4)
    assert (math.e * 0.5 + 4.0 * 0.25) * speed_mps + speed_mps**2 / 1.8 == pytest.approx(1.2)
    old = now(height_m=1.5).state
    flown = limit_movement(Velocity(down_mps=-9.0), old, Limits(), late, state_age_s=0.4)
    assert flown == Velocity(down_mps=-approach_speed_mps(0.9, late.climb_braking_mps2, late, 0.4))


def test_the_floor_is_below_the_ceiling() -> None:
    with pytest.raises(ValueRangeError, match=r"floor_m must be below the ceiling of 2\.4 m"):
        dataclasses.replace(LIMITS, floor_m=2.4)
