"""The judge: end and outcome of a flight."""

from __future__ import annotations

import math
from typing import Any

import pytest

from tests.worlds import values
from tests.worlds.tables import cases
from uav_bt.mission.judge import Judge, JudgeConfig, Verdict
from uav_bt.tree import Status
from uav_bt.types import DroneState, FlyingState, Pose, Pose2D, Truth
from uav_bt.types.area import Area
from uav_bt.types.place import LandOn, MissionRules

CASES = cases("mission")["judge"]
LANDED, HOVERING, LANDING = FlyingState.LANDED, FlyingState.HOVERING, FlyingState.LANDING
EMERGENCY = FlyingState.EMERGENCY
DONE, FAILED = Status.SUCCESS, Status.FAILURE


def truth_of(*contacts: str, error_m: float = 1.25, **more: Any) -> Truth:
    pose = Pose(x_m=2.613, y_m=-0.5, z_m=1.5, yaw_rad=0.0)
    given = {"on_mark": False, "motors_on": True, **more}
    return values.truth(pose, contacts=contacts, landing_error_m=error_m, **given)


ON_PAD = truth_of("mark", on_mark=True, error_m=0.05, motors_on=False)
TRUTHS = {
    "ON_PAD": ON_PAD,
    "ON_GROUND": truth_of("ground", motors_on=False),
    "MOTORS_ON": truth_of(on_mark=True, error_m=0.05),
    "ALOFT": truth_of(),
}


def ask(
    judge: Judge,
    now_s: float,
    flying: FlyingState = HOVERING,
    truth: Truth | None = None,
    status: Status = Status.RUNNING,
    *,
    heard_s: float | None = None,
    abort: str | None = None,
    **more: Any,
) -> str:
    """Return outcome and reason of a tick; empty while the flight goes on."""
    state = DroneState(captured_s=now_s if heard_s is None else heard_s, flying=flying)
    tick = values.tick(state, time_s=now_s, truth=truth, tree_status=status)
    return said(judge.verdict(tick, abort_reason=abort, **more))


def said(verdict: Verdict | None) -> str:
    return "" if verdict is None else f"{verdict.outcome.value}: {verdict.reason}"


def flown(**config: Any) -> Judge:
    """Return the judge of a flight that took off at 10 s and hovers at 11 s."""
    judge = Judge(JudgeConfig(**config))
    judge.took_off(10.0)
    assert ask(judge, 11.0, truth=truth_of()) == ""
    return judge


@pytest.mark.parametrize(("flying", "truth", "status", "verdict"), CASES["ends"])
def test_a_flight_ends_on_the_ground_where_the_rules_want_it(
    flying: FlyingState, truth: str, status: Status, verdict: str
) -> None:
    assert ask(flown(), 90.0, flying, TRUTHS[truth], status) == verdict


def test_an_abort_ends_the_flight_on_the_ground_with_its_reason() -> None:
    judge = flown()
    assert ask(judge, 12.0, LANDING, truth_of(), abort="stopped") == ""
    assert ask(judge, 14.0, LANDED, ON_PAD, DONE, abort="stopped") == "aborted: stopped"
    assert ask(flown(), 20.0, EMERGENCY, truth_of(), abort="cut") == "aborted: cut"


def test_a_failed_tree_states_its_last_failure() -> None:
    failure = "senses_agree: the floor shows too little texture"
    verdict = ask(flown(), 90.0, LANDED, ON_PAD, FAILED, failure=failure)
    assert verdict == f"aborted: the tree failed; landed; last failure: {failure}"


def test_a_tree_that_never_flew_is_no_success() -> None:
    assert "aborted: the tree ended without a take-off" in ask(Judge(), 0.0, LANDED, ON_PAD, DONE)


# --- collisions -----------------------------------------------------------------------------------


@pytest.mark.parametrize("flying", FlyingState)
@pytest.mark.parametrize("name", ["mark", "ground"])
def test_the_pad_is_touched_at_take_off_and_landing_only(flying: FlyingState, name: str) -> None:
    """What else is touched is named, even if an allowed surface is touched, too."""
    low = flying in {LANDED, FlyingState.TAKING_OFF, LANDING, EMERGENCY}
    fell = "aborted: the drone cut its motors" if flying is EMERGENCY else ""
    assert ask(flown(), 20.0, flying, truth_of(name)) == (
        fell if low else f"collision: touched {name}"
    )
    box = ask(flown(), 20.0, flying, truth_of(name, "box_3"))
    assert box == f"collision: touched {'box_3' if low else name}"


def test_a_landing_that_nobody_hears_of_is_no_collision() -> None:
    """The last report is HOVERING, but the drone has landed since."""
    assert ask(flown(), 20.0, truth=ON_PAD, heard_s=15.0) == ""
    assert ask(flown(), 20.0, truth=ON_PAD, landing=True) == ""


# --- area and time --------------------------------------------------------------------------------


def test_flying_beyond_the_edge_ends_the_flight_and_says_where() -> None:
    outside = truth_of(inside_ground=False)
    beyond = "left_area: flew beyond the ground's edge at (2.61, -0.50) m"
    assert ask(flown(), 20.0, truth=outside) == beyond
    assert ask(Judge(), 0.0, LANDED, outside) == "", "before the take-off"


AHEAD = Area((((-0.5, -0.5), (3.0, -0.5), (3.0, 2.0), (-0.5, 2.0)),))
OUTSIDE = "left_area: left the mission's area by 0.40 m"


def at(x_m: float, y_m: float) -> Pose2D:
    return Pose2D(x_m=x_m, y_m=y_m, yaw_rad=0.0)


@pytest.mark.parametrize(
    ("place", "verdict"),
    [(None, ""), (at(2.6, 0.0), ""), (at(3.2, 0.0), ""), (at(3.4, 0.0), OUTSIDE)],
)
def test_without_a_referee_a_drone_that_believes_to_be_far_outside_has_left_its_area(
    place: Pose2D | None, verdict: str
) -> None:
    assert ask(Judge(area=AHEAD), 20.0, place=place) == verdict


@pytest.mark.parametrize(
    ("x_m", "y_m", "verdict"),
    [(1.0, 3.2, ""), (1.0, 3.4, OUTSIDE), (0.3, 0.0, ""), (0.1, 0.0, OUTSIDE), (2.9, 0.0, "")],
)
def test_with_a_referee_the_true_place_counts(x_m: float, y_m: float, verdict: str) -> None:
    """It takes off at (1, 0) m, along y of the world: the area's right is the world's x."""
    judge = Judge(area=AHEAD)
    start = values.truth(Pose(x_m=1.0, y_m=0.0, z_m=0.0, yaw_rad=math.pi / 2))
    assert ask(judge, 19.0, truth=start) == ""
    there = values.truth(Pose(x_m=x_m, y_m=y_m, z_m=1.5, yaw_rad=0.3))
    wrong = at(0.0, 0.0) if verdict else at(9.0, 9.0)
    assert ask(judge, 20.0, truth=there, place=wrong) == verdict


def test_time_counts_from_the_first_take_off_command() -> None:
    judge = Judge()
    assert judge.elapsed(7.0) == 0.0
    judge = flown()
    judge.took_off(200.0)
    assert judge.elapsed(10.5) == 0.5
    assert ask(judge, 310.0) == ""
    assert ask(judge, 310.1) == "timeout: not over after 300 s"
    assert ask(flown(time_limit_s=30.0), 40.5) == "timeout: not over after 30 s"


def test_a_mission_that_never_takes_off_ends_when_patience_does() -> None:
    """The patience begins with the first tick, at any time of the clock."""
    judge = Judge()
    assert ask(judge, 100.0, LANDED) == ask(judge, 160.0, LANDED) == ""
    assert ask(judge, 160.1, LANDED) == "timeout: no take-off within 60 s"
    judge.took_off(160.1)
    assert ask(judge, 300.0) == ""


def test_a_violation_comes_before_an_ending() -> None:
    hit = truth_of("box_1", on_mark=True, inside_ground=False)
    for abort in (None, "stopped"):
        verdict = ask(flown(), 500.0, LANDED, hit, DONE, abort=abort)
        assert verdict == "collision: touched box_1"
    assert ask(flown(), 500.0, LANDED, ON_PAD, DONE).startswith("timeout")


# --- where it lands -------------------------------------------------------------------------------


@pytest.mark.parametrize(("mark_m", "land_on", "verdict"), CASES["beliefs"])
def test_without_a_referee_the_last_belief_in_the_air_counts(
    mark_m: float | None, land_on: LandOn | None, verdict: str
) -> None:
    """After the landing the camera sees nothing: a belief of then is worth nothing."""
    judge = flown(land_on=land_on)
    ask(judge, 89.0, LANDING, mark_m=mark_m)
    assert ask(judge, 90.0, LANDED, status=DONE, mark_m=3.0) == verdict


@pytest.mark.parametrize(("truth", "land_on", "verdict"), CASES["truths"])
def test_the_referee_overrules_the_belief(truth: str, land_on: LandOn, verdict: str) -> None:
    wrong_m = 0.0 if truth == "ON_GROUND" else 5.0
    told = ask(flown(land_on=land_on), 90.0, LANDED, TRUTHS[truth], DONE, mark_m=wrong_m)
    assert told == verdict


@pytest.mark.parametrize(("status", "now_s", "verdict"), CASES["grounded"])
def test_a_mission_that_never_takes_off_is_judged_by_its_tree(
    status: Status, now_s: float, verdict: str
) -> None:
    judge = Judge(JudgeConfig(land_on=LandOn.NONE))
    assert ask(judge, 0.0, LANDED) == ""
    assert ask(judge, now_s, LANDED, status=status) == verdict


@pytest.mark.parametrize(
    ("option_s", "rules_s", "limit_s"),
    [(None, None, 300.0), (None, 60.0, 60.0), (20.0, 60.0, 20.0), (90.0, 60.0, 90.0)],
)
def test_an_option_comes_before_the_missions_rules(
    option_s: float | None, rules_s: float | None, limit_s: float
) -> None:
    rules = MissionRules(time_limit_s=rules_s, land_on=LandOn.ANY)
    config = JudgeConfig(time_limit_s=option_s).under(rules)
    assert (config.limit_s, config.land_on) == (limit_s, LandOn.ANY)
    assert JudgeConfig(land_on=LandOn.MARK).under(rules).land_on is LandOn.MARK


def test_the_time_left_counts_from_the_take_off_or_without_one_from_the_start() -> None:
    assert flown(time_limit_s=30.0).time_left(15.0) == pytest.approx(25.0)
    assert Judge(JudgeConfig(time_limit_s=30.0)).time_left(15.0) == 30.0
    grounded = Judge(JudgeConfig(time_limit_s=30.0, land_on=LandOn.NONE))
    assert ask(grounded, 2.0, LANDED) == ""
    assert grounded.time_left(10.0) == pytest.approx(22.0)
