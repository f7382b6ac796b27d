"""The safety table: its order, the command of each rule, and time limits."""

from __future__ import annotations

import dataclasses
import itertools
import math

import pytest

from uav_bt.board import FRAME
from uav_bt.board.context import Proposals
from uav_bt.errors import ProposalConflictError, ValueRangeError
from uav_bt.mission.limits import Limits
from uav_bt.mission.safety import SAFETY, Arbiter, Circumstances, Override, rule_in_force
from uav_bt.types import (
    Command,
    CutMotors,
    DroneState,
    FlyingState,
    GimbalTo,
    Hover,
    Land,
    MoveBy,
    Movement,
    Release,
    TakeOff,
    Velocity,
)

# The cause of each rule, as changes of normal circumstances.
CAUSES = {
    Override.CUT: {"cut": True},
    Override.MANUAL: {"manual": True},
    Override.ABORT: {"abort": True},
    Override.BATTERY: {"battery": 0.05},
    Override.LINK: {"state_age_s": 2.0},
    Override.STALE_FRAME: {"frame_age_s": math.inf},
}


def circumstances(*causes: Override, flying: FlyingState = FlyingState.HOVERING) -> Circumstances:
    changes = {name: value for cause in causes for name, value in CAUSES[cause].items()}
    state = DroneState(captured_s=0.0, flying=flying, battery=changes.pop("battery", 1.0))
    return Circumstances(state=state, **changes)


def test_the_order_is_the_documented_one() -> None:
    assert [rule.override for rule in SAFETY] == [
        Override.CUT,
        Override.MANUAL,
        Override.ABORT,
        Override.BATTERY,
        Override.LINK,
        Override.STALE_FRAME,
    ]
    assert list(Override) == [rule.override for rule in SAFETY]


@pytest.mark.parametrize(
    ("override", "command"),
    [
        (Override.CUT, Command(movement=CutMotors())),
        (Override.MANUAL, Command(movement=Release())),
        (Override.ABORT, Command(movement=Land())),
        (Override.BATTERY, Command(movement=Land())),
        (Override.LINK, Command(movement=Hover())),
        (Override.STALE_FRAME, Command(movement=Hover(), gimbal=GimbalTo(pitch_rad=-0.5))),
    ],
)
def test_each_rule_has_one_answer(override: Override, command: Command) -> None:
    proposals = Proposals()
    proposals.propose("leaf", Velocity(forward_mps=0.5))
    proposals.propose_gimbal("leaf", GimbalTo(pitch_rad=-0.5))
    arbiter = Arbiter(LIMITS)
    decided = arbiter.decide(proposals, circumstances(override))
    assert decided == command
    assert arbiter.override is override


@pytest.mark.parametrize("count", range(1, len(SAFETY) + 1))
def test_whatever_else_is_wrong_the_strongest_rule_decides(count: int) -> None:
    """All combinations of simultaneous causes."""
    for causes in itertools.combinations(list(Override), count):
        rule = rule_in_force(circumstances(*causes), LIMITS)
        assert rule is not None
        assert rule.override is causes[0], causes


def test_a_pilot_at_the_remote_control_is_a_take_over() -> None:
    state = DroneState(captured_s=0.0, flying=FlyingState.FLYING, pilot_has_control=True)
    rule = rule_in_force(Circumstances(state=state, abort=True), LIMITS)
    assert rule is not None
    assert rule.override is Override.MANUAL


@pytest.mark.parametrize(
    ("override", "flying"),
    [
        *(
            (Override.BATTERY, FlyingState.TAKING_OFF),
            (Override.STALE_FRAME, FlyingState.TAKING_OFF),
        ),
        *(
            (each, FlyingState.LANDED)
            for each in (Override.BATTERY, Override.LINK, Override.STALE_FRAME)
        ),
        *(
            (each, FlyingState.LANDING)
            for each in (Override.BATTERY, Override.LINK, Override.STALE_FRAME)
        ),
    ],
)
def test_what_only_matters_in_the_air_matters_only_there(
    override: Override, flying: FlyingState
) -> None:
    assert rule_in_force(circumstances(override, flying=flying), LIMITS) is None


def test_a_broken_connection_is_a_lost_link_at_once() -> None:
    """The link is lost even while the drone's last report is fresh."""
    state = DroneState(captured_s=0.0, flying=FlyingState.FLYING, connected=False)
    rule = rule_in_force(Circumstances(state=state), LIMITS)
    assert rule is not None
    assert rule.override is Override.LINK


def test_a_battery_that_nobody_reported_is_not_critical() -> None:
    state = DroneState(captured_s=0.0, flying=FlyingState.FLYING, battery=None)
    assert rule_in_force(Circumstances(state=state), LIMITS) is None


def test_calm_circumstances_leave_the_word_to_the_leaves() -> None:
    assert rule_in_force(circumstances(), LIMITS) is None


def test_a_corrected_movement_is_limited_like_any_other_and_no_rule_is_corrected() -> None:
    faster = Velocity(forward_mps=30.0)
    arbiter, proposals = Arbiter(Limits(speed_mps=0.5)), proposals_of(Hover())
    flying = Circumstances(state=DroneState(captured_s=0.0, flying=FlyingState.FLYING))
    decided = arbiter.decide(proposals, flying, lambda _: faster)
    aborted = arbiter.decide(proposals, dataclasses.replace(flying, abort=True), lambda _: faster)
    assert decided.movement == Velocity(forward_mps=0.5)
    assert aborted.movement == Land()


def test_every_rule_says_why() -> None:
    assert all(rule.why for rule in SAFETY)


LIMITS = Limits(speed_mps=1.0, climb_mps=0.5, yaw_rate_radps=1.5, ceiling_m=2.4)
DOWN = GimbalTo(pitch_rad=-1.0)


def state_of(
    flying: FlyingState = FlyingState.HOVERING,
    *,
    height_m: float = 1.5,
    battery: float = 1.0,
    pilot: bool = False,
) -> DroneState:
    return DroneState(
        captured_s=0.0,
        flying=flying,
        height_above_ground_m=height_m,
        battery=battery,
        pilot_has_control=pilot,
    )


def proposals_of(movement: Movement | None = None, gimbal: GimbalTo | None = None) -> Proposals:
    proposals = Proposals()
    if movement is not None:
        proposals.propose("Mission/leaf", movement)
    if gimbal is not None:
        proposals.propose_gimbal("Mission/leaf", gimbal)
    return proposals


def decide(movement: Movement, *, height_m: float = 1.5) -> Movement:
    """Return the command for a proposal in normal circumstances."""
    arbiter = Arbiter(LIMITS)
    state = state_of(height_m=height_m)
    return arbiter.decide(proposals_of(movement), Circumstances(state=state)).movement


# --- proposals ------------------------------------------------------------------------------------


def test_nothing_proposed_means_hover() -> None:
    arbiter = Arbiter(LIMITS)
    command = arbiter.decide(Proposals(), Circumstances(state=state_of()))
    assert command == Command(movement=Hover(), gimbal=None)
    assert arbiter.override is None


def test_movement_and_gimbal_are_channels_of_their_own() -> None:
    """Two leaves may propose in the same tick on different channels."""
    proposals = Proposals()
    proposals.propose("a", Land())
    proposals.propose_gimbal("b", DOWN)
    command = Arbiter(LIMITS).decide(proposals, Circumstances(state=state_of()))
    assert command == Command(movement=Land(), gimbal=DOWN)
    assert proposals.movement_owner == "a"


def test_a_gimbal_alone_points_a_hovering_drone() -> None:
    command = Arbiter(LIMITS).decide(proposals_of(gimbal=DOWN), Circumstances(state=state_of()))
    assert command == Command(movement=Hover(), gimbal=DOWN)


def test_a_conflict_of_movements_names_both_leaves_and_keeps_the_first() -> None:
    proposals = proposals_of(Land())
    with pytest.raises(
        ProposalConflictError, match=r"'Mission/leaf' and 'Mission/other'.*movement"
    ):
        proposals.propose("Mission/other", Land())
    assert proposals.movement == Land()


def test_a_conflict_of_camera_directions_names_both_leaves() -> None:
    proposals = proposals_of(gimbal=DOWN)
    with pytest.raises(ProposalConflictError, match=r"'Mission/leaf' and 'Mission/other'.*gimbal"):
        proposals.propose_gimbal("Mission/other", DOWN)


def test_a_leaf_may_change_its_mind_within_a_tick() -> None:
    proposals = proposals_of(Land(), DOWN)
    proposals.propose("Mission/leaf", Hover())
    proposals.propose_gimbal("Mission/leaf", GimbalTo(pitch_rad=0.0))
    assert proposals.movement == Hover()
    assert proposals.gimbal == GimbalTo(pitch_rad=0.0)


def test_clearing_forgets_all_but_the_count_of_ids() -> None:
    proposals = proposals_of(Land(), DOWN)
    first = proposals.next_id()
    proposals.clear()
    assert (proposals.movement, proposals.movement_owner, proposals.gimbal) == (None, None, None)
    proposals.propose("Mission/other", Hover())
    assert proposals.next_id() == first + 1


# --- overrides ------------------------------------------------------------------------------------

# Overrides in order of priority, with the sent movement.
OVERRIDES = [
    (Override.MANUAL, Release()),
    (Override.ABORT, Land()),
    (Override.BATTERY, Land()),
    (Override.STALE_FRAME, Hover()),
]


@pytest.mark.parametrize("first", range(len(OVERRIDES)))
def test_the_strongest_override_wins_over_all_weaker_ones(first: int) -> None:
    """The causes of all lower overrides hold, too."""
    override, movement = OVERRIDES[first]
    arbiter = Arbiter(LIMITS)
    command = arbiter.decide(
        proposals_of(MoveBy(id=1, forward_m=1.0)),
        Circumstances(
            state=state_of(pilot=first == 0, battery=0.05 if first <= 2 else 1.0),
            frame_age_s=5.0,
            abort=first <= 1,
        ),
    )
    assert arbiter.override is override
    assert command.movement == movement


def test_an_override_ends_with_its_reason() -> None:
    arbiter = Arbiter(LIMITS)
    proposals = proposals_of(MoveBy(id=1, forward_m=1.0))
    arbiter.decide(proposals, Circumstances(state=state_of(), frame_age_s=5.0))
    assert arbiter.override is Override.STALE_FRAME
    command = arbiter.decide(proposals, Circumstances(state=state_of(), frame_age_s=0.1))
    assert arbiter.override is None
    assert command.movement == MoveBy(id=1, forward_m=1.0)


def test_only_a_stale_frame_leaves_the_camera_to_the_leaves() -> None:
    """Pointing the camera may end the override; landings and pilots are not disturbed."""
    proposals = proposals_of(Hover(), DOWN)
    arbiter = Arbiter(LIMITS)
    assert (
        arbiter.decide(proposals, Circumstances(state=state_of(), frame_age_s=5.0)).gimbal == DOWN
    )
    assert arbiter.decide(proposals, Circumstances(state=state_of(battery=0.0))).gimbal is None
    assert arbiter.decide(proposals, Circumstances(state=state_of(pilot=True))).gimbal is None
    assert arbiter.decide(proposals, Circumstances(state=state_of(), abort=True)).gimbal is None


def test_a_drone_on_the_ground_may_take_off_before_its_first_frame() -> None:
    arbiter = Arbiter(LIMITS)
    standing = state_of(FlyingState.LANDED, height_m=0.0)
    command = arbiter.decide(
        proposals_of(TakeOff()), Circumstances(state=standing, frame_age_s=math.inf)
    )
    assert command.movement == TakeOff()


@pytest.mark.parametrize(
    ("flying", "movement"), [(FlyingState.TAKING_OFF, TakeOff()), (FlyingState.LANDING, Land())]
)
def test_a_stale_frame_interrupts_neither_take_off_nor_landing(
    flying: FlyingState, movement: Movement
) -> None:
    arbiter = Arbiter(LIMITS)
    command = arbiter.decide(
        proposals_of(movement), Circumstances(state=state_of(flying), frame_age_s=9.0)
    )
    assert command.movement == movement
    assert arbiter.override is None


def test_limits_are_reached_only_beyond_them() -> None:
    """The critical charge and the maximum age of a frame are still valid values."""
    arbiter = Arbiter(LIMITS)
    proposals = proposals_of(CutMotors())
    arbiter.decide(
        proposals,
        Circumstances(state=state_of(battery=LIMITS.critical_battery), frame_age_s=FRAME.max_age_s),
    )
    assert arbiter.override is None


# --- limits ---------------------------------------------------------------------------------------


def test_what_lies_within_the_limits_passes_unchanged() -> None:
    for movement in (
        Velocity(forward_mps=0.6, right_mps=-0.8, down_mps=0.5, yaw_rate_radps=-1.5),
        Velocity(),
        MoveBy(id=3, forward_m=0.3, right_m=0.1, down_m=-0.8, yaw_rad=1.0),
        Land(),
    ):
        assert decide(movement) == movement


def test_horizontal_speed_is_shortened_and_keeps_its_direction() -> None:
    fast = decide(Velocity(forward_mps=3.0, right_mps=-4.0))
    assert isinstance(fast, Velocity)
    assert (fast.forward_mps, fast.right_mps) == pytest.approx((0.6, -0.8))


@pytest.mark.parametrize(("asked", "given"), [(2.0, 0.5), (-2.0, -0.5)])
def test_climbing_and_sinking_are_limited(asked: float, given: float) -> None:
    assert decide(Velocity(down_mps=asked)) == Velocity(down_mps=given)


@pytest.mark.parametrize(("asked", "given"), [(9.0, 1.5), (-9.0, -1.5)])
def test_turning_is_limited_both_ways(asked: float, given: float) -> None:
    assert decide(Velocity(yaw_rate_radps=asked)) == Velocity(yaw_rate_radps=given)


def test_a_step_is_bounded_and_keeps_its_direction() -> None:
    far = decide(MoveBy(id=1, forward_m=3e9, right_m=-4e9, yaw_rad=1e6))
    assert isinstance(far, MoveBy)
    assert (far.forward_m, far.right_m) == pytest.approx((6.0, -8.0))
    assert far.yaw_rad == pytest.approx(2 * math.pi)


def test_no_step_leads_into_the_ground() -> None:
    """From 1.2 m it descends to 0.3 m; from below 0.3 m it does not descend."""
    state = state_of()
    down = decide(MoveBy(id=1, down_m=50.0))
    assert isinstance(down, MoveBy)
    assert down.down_m == pytest.approx(state.height_above_ground_m - LIMITS.floor_m)
    low = Arbiter(dataclasses.replace(LIMITS, floor_m=2.0)).decide(
        proposals_of(MoveBy(id=1, down_m=0.1)), Circumstances(state=state)
    )
    assert low.movement == MoveBy(id=1)


def test_nobody_climbs_through_the_ceiling() -> None:
    """A step ends at the ceiling; above it only descents remain."""
    step = decide(MoveBy(id=1, forward_m=0.3, down_m=-2.0), height_m=1.5)
    assert isinstance(step, MoveBy)
    assert step.down_m == pytest.approx(-0.9)
    assert (step.id, step.forward_m) == (1, 0.3)
    above = decide(MoveBy(id=1, down_m=-0.1), height_m=2.6)
    assert isinstance(above, MoveBy)
    assert above.down_m == 0.0
    assert decide(MoveBy(id=1, down_m=0.4), height_m=2.6) == MoveBy(id=1, down_m=0.4)
    assert decide(Velocity(down_mps=-0.3), height_m=2.4) == Velocity(down_mps=0.0)
    assert decide(Velocity(down_mps=0.3), height_m=2.4) == Velocity(down_mps=0.3)


def test_the_floor_is_below_the_ceiling() -> None:
    with pytest.raises(ValueRangeError, match=r"floor_m must be below the ceiling of 2\.4 m"):
        dataclasses.replace(LIMITS, floor_m=2.4)
