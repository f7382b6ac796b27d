"""The safety table: its order, what each rule answers, and what lasts too long."""

from __future__ import annotations

import itertools
import math

import pytest

from uav_bt.board.context import Proposals
from uav_bt.mission.arbiter import Arbiter
from uav_bt.mission.safety import SAFETY, Circumstances, Limits, Override, rule_in_force
from uav_bt.types import (
    Command,
    CutMotors,
    DroneState,
    FlyingState,
    GimbalTo,
    Hover,
    Land,
    Release,
    Velocity,
)

LIMITS = Limits()
# What makes each rule hold, as changes of calm circumstances.
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
    now = circumstances(override)
    arbiter = Arbiter(LIMITS)
    decided = arbiter.decide(
        proposals,
        now.state,
        frame_age_s=now.frame_age_s,
        state_age_s=now.state_age_s,
        abort=now.abort,
        manual=now.manual,
        cut=now.cut,
    )
    assert decided == command
    assert arbiter.override is override


@pytest.mark.parametrize("count", range(1, len(SAFETY) + 1))
def test_whatever_else_is_wrong_the_strongest_rule_decides(count: int) -> None:
    """Every set of things that go wrong at once."""
    for causes in itertools.combinations(list(Override), count):
        rule = rule_in_force(circumstances(*causes), LIMITS)
        assert rule is not None
        assert rule.override is causes[0], causes


def test_a_pilot_at_the_remote_control_is_a_take_over() -> None:
    state = DroneState(captured_s=0.0, flying=FlyingState.FLYING, pilot_has_control=True)
    rule = rule_in_force(Circumstances(state=state, abort=True), LIMITS)
    assert rule is not None
    assert rule.override is Override.MANUAL


@pytest.mark.parametrize("override", [Override.BATTERY, Override.LINK, Override.STALE_FRAME])
@pytest.mark.parametrize(
    "flying", [FlyingState.LANDED, FlyingState.TAKING_OFF, FlyingState.LANDING]
)
def test_what_only_matters_in_the_air_matters_only_there(
    override: Override, flying: FlyingState
) -> None:
    assert rule_in_force(circumstances(override, flying=flying), LIMITS) is None


def test_calm_circumstances_leave_the_word_to_the_leaves() -> None:
    assert rule_in_force(circumstances(), LIMITS) is None


def test_every_rule_says_why() -> None:
    assert all(rule.why for rule in SAFETY)
