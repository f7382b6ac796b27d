"""The judge: end and outcome of a flight."""

from __future__ import annotations

import math

import pytest

from tests.worlds import values
from uav_bt.mission.judge import Belief, Judge, JudgeConfig, Outcome, Verdict
from uav_bt.tree import Status
from uav_bt.types import DroneState, FlyingState, Pose, Pose2D, Truth
from uav_bt.types.area import Area
from uav_bt.types.mission_rules import LandOn, MissionRules


def truth_of(
    *,
    contacts: tuple[str, ...] = (),
    inside: bool = True,
    on_pad: bool = False,
    error_m: float = 1.25,
    motors_on: bool = True,
) -> Truth:
    return values.truth(
        Pose(x_m=2.613, y_m=-0.5, z_m=1.5, yaw_rad=0.0),
        contacts=contacts,
        inside_ground=inside,
        on_mark=on_pad,
        landing_error_m=error_m,
        motors_on=motors_on,
    )


ON_PAD = truth_of(on_pad=True, contacts=("mark",), error_m=0.05, motors_on=False)
ON_GROUND = truth_of(contacts=("ground",), motors_on=False)


def ask(
    judge: Judge,
    now_s: float,
    flying: FlyingState = FlyingState.HOVERING,
    truth: Truth | None = None,
    status: Status = Status.RUNNING,
    *,
    abort: str | None = None,
) -> Verdict | None:
    state = DroneState(captured_s=now_s, flying=flying)
    return judge.verdict(values.tick(state, truth=truth, tree_status=status), abort_reason=abort)


def flown(config: JudgeConfig | None = None) -> Judge:
    """Return the judge of a flight that took off at 10 s and hovers at 11 s."""
    judge = Judge(config)
    judge.took_off(10.0)
    assert ask(judge, 11.0, truth=truth_of()) is None
    return judge


def test_a_landing_on_the_pad_is_a_success() -> None:
    verdict = ask(flown(), 90.0, FlyingState.LANDED, ON_PAD, Status.SUCCESS)
    assert verdict == Verdict(outcome=Outcome.SUCCESS, reason="landed")


def test_a_landing_beside_the_pad_is_aborted_and_says_how_far() -> None:
    verdict = ask(flown(), 90.0, FlyingState.LANDED, ON_GROUND, Status.SUCCESS)
    assert verdict is not None
    assert verdict.outcome is Outcome.ABORTED
    assert "1.25 m" in verdict.reason


def test_a_mission_may_end_elsewhere_when_its_rules_say_so() -> None:
    judge = flown(JudgeConfig(land_on=LandOn.ANY))
    verdict = ask(judge, 90.0, FlyingState.LANDED, ON_GROUND, Status.SUCCESS)
    assert verdict is not None
    assert verdict.outcome is Outcome.SUCCESS


def test_a_landing_that_only_the_drone_believes_in_is_no_success() -> None:
    hovering = truth_of(on_pad=True, error_m=0.05)
    verdict = ask(flown(), 90.0, FlyingState.LANDED, hovering, Status.SUCCESS)
    assert verdict is not None
    assert verdict.outcome is Outcome.ABORTED
    assert "motors still run" in verdict.reason


@pytest.mark.parametrize(
    ("abort", "reason"),
    [(None, "the drone cut its motors"), ("a person cut the motors", "a person cut the motors")],
)
def test_motors_that_are_cut_end_the_flight_at_once(abort: str | None, reason: str) -> None:
    verdict = ask(flown(), 20.0, FlyingState.EMERGENCY, truth_of(), abort=abort)
    assert verdict == Verdict(outcome=Outcome.ABORTED, reason=reason)


def test_a_landing_that_nobody_hears_of_is_no_collision() -> None:
    """The last report is HOVERING, but the drone has landed since."""
    state = DroneState(captured_s=15.0, flying=FlyingState.HOVERING)
    assert flown().verdict(values.tick(state, time_s=20.0, truth=ON_PAD), abort_reason=None) is None


def test_a_tree_that_fails_on_the_ground_is_aborted_even_on_the_pad() -> None:
    verdict = ask(flown(), 90.0, FlyingState.LANDED, ON_PAD, Status.FAILURE)
    assert verdict == Verdict(outcome=Outcome.ABORTED, reason="the tree failed; landed")


def test_a_failed_tree_states_its_last_failure() -> None:
    landed = DroneState(captured_s=90.0, flying=FlyingState.LANDED)
    failure = "senses_agree: the floor shows too little texture"
    verdict = flown().verdict(
        values.tick(landed, truth=ON_PAD, tree_status=Status.FAILURE),
        abort_reason=None,
        failure=failure,
    )
    assert verdict is not None
    assert verdict.reason == f"the tree failed; landed; last failure: {failure}"


def test_a_tree_that_never_flew_is_no_success() -> None:
    verdict = ask(Judge(), 0.0, FlyingState.LANDED, ON_PAD, Status.SUCCESS)
    assert verdict is not None
    assert verdict.outcome is Outcome.ABORTED
    assert "without a take-off" in verdict.reason


@pytest.mark.parametrize("status", [Status.SUCCESS, Status.FAILURE])
def test_a_tree_that_ends_in_the_air_ends_no_flight(status: Status) -> None:
    """The drone must land first."""
    assert ask(flown(), 20.0, FlyingState.HOVERING, truth_of(), status) is None


@pytest.mark.parametrize("status", [Status.RUNNING, Status.IDLE])
def test_a_tree_that_goes_on_ends_no_flight_on_the_ground(status: Status) -> None:
    assert ask(flown(), 20.0, FlyingState.LANDED, ON_PAD, status) is None


def test_an_abort_ends_the_flight_on_the_ground_with_its_reason() -> None:
    judge = flown()
    assert ask(judge, 12.0, FlyingState.LANDING, truth_of(), abort="stopped") is None
    verdict = ask(judge, 14.0, FlyingState.LANDED, ON_PAD, Status.SUCCESS, abort="stopped")
    assert verdict == Verdict(outcome=Outcome.ABORTED, reason="stopped")


# --- collisions -----------------------------------------------------------------------------------

GROUND_STATES = {FlyingState.LANDED, FlyingState.TAKING_OFF, FlyingState.LANDING}


@pytest.mark.parametrize("flying", FlyingState)
@pytest.mark.parametrize("geom", ["mark", "ground"])
def test_the_landing_surface_may_be_touched_only_while_taking_off_or_landing(
    flying: FlyingState, geom: str
) -> None:
    verdict = ask(flown(), 20.0, flying, truth_of(contacts=(geom,)))
    if flying is FlyingState.EMERGENCY:
        assert verdict is not None
        assert verdict.outcome is Outcome.ABORTED  # the drone fell
    elif flying in GROUND_STATES:
        assert verdict is None
    else:
        assert verdict == Verdict(outcome=Outcome.COLLISION, reason=f"touched {geom}")


@pytest.mark.parametrize("flying", FlyingState)
def test_a_box_may_never_be_touched(flying: FlyingState) -> None:
    """It is named even if an allowed surface is touched, too."""
    verdict = ask(flown(), 20.0, flying, truth_of(contacts=("mark", "box_3")))
    assert verdict is not None
    assert verdict.outcome is Outcome.COLLISION
    if flying in {*GROUND_STATES, FlyingState.EMERGENCY}:
        assert verdict.reason == "touched box_3"


def test_landing_surfaces_are_configurable() -> None:
    judge = flown(JudgeConfig(landing_surfaces=("table", "box-3")))
    for name in ("table", "table_7", "table-7", "box-3-2"):
        assert ask(judge, 20.0, FlyingState.LANDING, truth_of(contacts=(name,))) is None
    for name in ("ground", "tablet-1", "box-31"):
        verdict = ask(judge, 20.1, FlyingState.LANDING, truth_of(contacts=(name,)))
        assert verdict is not None
        assert verdict.outcome is Outcome.COLLISION


# --- area and time --------------------------------------------------------------------------------


def test_flying_beyond_the_edge_ends_the_flight_and_says_where() -> None:
    verdict = ask(flown(), 20.0, truth=truth_of(inside=False))
    assert verdict == Verdict(
        outcome=Outcome.LEFT_AREA, reason="flew beyond the ground's edge at (2.61, -0.50) m"
    )


def test_before_the_take_off_nobody_is_beyond_the_edge() -> None:
    assert ask(Judge(), 0.0, FlyingState.LANDED, truth_of(inside=False)) is None


def test_time_counts_from_the_first_take_off_command() -> None:
    judge = flown()
    judge.took_off(200.0)
    assert judge.elapsed(10.5) == 0.5
    assert ask(judge, 310.0) is None
    verdict = ask(judge, 310.1)
    assert verdict == Verdict(outcome=Outcome.TIMEOUT, reason="not over after 300 s")


def test_elapsed_time_is_zero_until_the_take_off() -> None:
    judge = Judge()
    assert judge.elapsed(7.0) == 0.0
    judge.took_off(7.0)
    assert judge.elapsed(9.5) == 2.5


def test_a_mission_that_never_takes_off_ends_when_patience_does() -> None:
    """The patience begins with the first tick, at any time of the clock."""
    judge = Judge(JudgeConfig(patience_s=5.0))
    assert ask(judge, 100.0, FlyingState.LANDED) is None
    assert ask(judge, 105.0, FlyingState.LANDED) is None
    verdict = ask(judge, 105.1, FlyingState.LANDED)
    assert verdict == Verdict(outcome=Outcome.TIMEOUT, reason="no take-off within 5 s")


def test_patience_ends_with_the_take_off() -> None:
    judge = Judge(JudgeConfig(patience_s=5.0))
    assert ask(judge, 0.0, FlyingState.LANDED) is None
    judge.took_off(4.0)
    assert ask(judge, 60.0) is None


def test_a_violation_comes_before_an_ending() -> None:
    """Touching a box is a collision, also in a landing on the pad or after an abort."""
    hit = truth_of(contacts=("box_1",), on_pad=True, inside=False)
    for abort in (None, "stopped"):
        verdict = ask(flown(), 500.0, FlyingState.LANDED, hit, Status.SUCCESS, abort=abort)
        assert verdict == Verdict(outcome=Outcome.COLLISION, reason="touched box_1")
    late = ask(flown(), 500.0, FlyingState.LANDED, ON_PAD, Status.SUCCESS)
    assert late is not None
    assert late.outcome is Outcome.TIMEOUT


# --- without a referee ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mark_m", "land_on", "reason"),
    [
        (0.2, None, None),
        (0.2, LandOn.MARK, None),
        (0.2, LandOn.GROUND, "landed on the landing mark, and the mission's rules want the ground"),
        (0.2, LandOn.ANY, None),
        (0.8, None, "landed 0.80 m from the landing mark's centre"),
        (0.8, LandOn.GROUND, None),
        (0.8, LandOn.ANY, None),
        (None, None, "landed where no landing mark is known"),
        (None, LandOn.GROUND, None),
        (None, LandOn.ANY, None),
    ],
)
def test_without_a_referee_the_last_belief_in_the_air_counts(
    mark_m: float | None, land_on: LandOn | None, reason: str | None
) -> None:
    """After the landing the camera sees nothing: a belief of then is worth nothing."""
    judge = flown(JudgeConfig(land_on=land_on))
    for flying, believed_m in ((FlyingState.LANDING, mark_m), (FlyingState.LANDED, 3.0)):
        status = Status.RUNNING if flying is FlyingState.LANDING else Status.SUCCESS
        verdict = judge.verdict(
            values.tick(DroneState(captured_s=90.0, flying=flying), tree_status=status),
            abort_reason=None,
            belief=Belief(mark_m=believed_m),
        )
    expected = Outcome.SUCCESS if reason is None else Outcome.ABORTED
    assert verdict == Verdict(outcome=expected, reason=reason or "landed")


@pytest.mark.parametrize(
    ("truth", "land_on", "outcome"),
    [
        (ON_PAD, LandOn.MARK, Outcome.SUCCESS),
        (ON_PAD, LandOn.GROUND, Outcome.ABORTED),
        (ON_PAD, LandOn.ANY, Outcome.SUCCESS),
        (ON_GROUND, LandOn.MARK, Outcome.ABORTED),
        (ON_GROUND, LandOn.GROUND, Outcome.SUCCESS),
        (ON_GROUND, LandOn.ANY, Outcome.SUCCESS),
    ],
)
def test_the_referee_overrules_the_belief(truth: Truth, land_on: LandOn, outcome: Outcome) -> None:
    judge = flown(JudgeConfig(land_on=land_on))
    wrong = Belief(mark_m=0.0 if truth is ON_GROUND else 5.0)
    state = DroneState(captured_s=90.0, flying=FlyingState.LANDED)
    verdict = judge.verdict(
        values.tick(state, truth=truth, tree_status=Status.SUCCESS), abort_reason=None, belief=wrong
    )
    assert verdict is not None
    assert verdict.outcome is outcome


@pytest.mark.parametrize(
    ("status", "now_s", "outcome", "words"),
    [
        (Status.SUCCESS, 90.0, Outcome.SUCCESS, "succeeded on the ground"),
        (Status.FAILURE, 90.0, Outcome.ABORTED, "failed on the ground"),
        (Status.RUNNING, 90.0, None, ""),
        (Status.RUNNING, 301.0, Outcome.TIMEOUT, "not over after 300 s"),
    ],
)
def test_a_mission_that_never_takes_off_is_judged_by_its_tree(
    status: Status, now_s: float, outcome: Outcome | None, words: str
) -> None:
    judge = Judge(JudgeConfig(land_on=LandOn.NONE))
    assert ask(judge, 0.0, FlyingState.LANDED) is None
    verdict = ask(judge, now_s, FlyingState.LANDED, status=status)
    assert (None if verdict is None else verdict.outcome) is outcome
    assert verdict is None or words in verdict.reason


def test_a_take_off_against_the_rules_is_no_success() -> None:
    judge = flown(JudgeConfig(land_on=LandOn.NONE))
    verdict = ask(judge, 90.0, FlyingState.LANDED, ON_PAD, Status.SUCCESS)
    assert verdict is not None
    assert (verdict.outcome, "forbid" in verdict.reason) == (Outcome.ABORTED, True)


AHEAD = Area((((-0.5, -0.5), (3.0, -0.5), (3.0, 2.0), (-0.5, 2.0)),))
OUTSIDE = Verdict(outcome=Outcome.LEFT_AREA, reason="left the mission's area by 0.40 m")


def place(x_m: float, y_m: float) -> Pose2D:
    return Pose2D(x_m=x_m, y_m=y_m, yaw_rad=0.0)


@pytest.mark.parametrize(
    ("at", "verdict"),
    [(None, None), (place(2.6, 0.0), None), (place(3.2, 0.0), None), (place(3.4, 0.0), OUTSIDE)],
)
def test_without_a_referee_a_drone_that_believes_to_be_far_outside_has_left_its_area(
    at: Pose2D | None, verdict: Verdict | None
) -> None:
    judge, state = Judge(area=AHEAD), DroneState(captured_s=20.0, flying=FlyingState.HOVERING)
    belief = Belief(place=at)
    assert judge.verdict(values.tick(state), abort_reason=None, belief=belief) == verdict


@pytest.mark.parametrize(
    ("x_m", "y_m", "verdict"),
    [(1.0, 3.2, None), (1.0, 3.4, OUTSIDE), (0.3, 0.0, None), (0.1, 0.0, OUTSIDE), (2.9, 0, None)],
)
def test_where_there_is_a_referee_the_true_place_counts(
    x_m: float, y_m: float, verdict: Verdict | None
) -> None:
    """It takes off at (1, 0) m, along y of the world: the area's right is the world's x."""
    judge, state = Judge(area=AHEAD), DroneState(captured_s=20.0, flying=FlyingState.HOVERING)
    start = values.truth(Pose(x_m=1.0, y_m=0.0, z_m=0.0, yaw_rad=math.pi / 2))
    assert judge.verdict(values.tick(state, truth=start), abort_reason=None) is None
    there = values.truth(Pose(x_m=x_m, y_m=y_m, z_m=1.5, yaw_rad=0.3))
    wrong = Belief(place=place(9.0, 9.0) if verdict is None else place(0.0, 0.0))
    seen = values.tick(state, truth=there)
    assert judge.verdict(seen, abort_reason=None, belief=wrong) == verdict


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
    judge = flown(JudgeConfig(time_limit_s=30.0))
    assert judge.time_left(15.0) == pytest.approx(25.0)
    assert Judge(JudgeConfig(time_limit_s=30.0)).time_left(15.0) == 30.0
    grounded = Judge(JudgeConfig(time_limit_s=30.0, land_on=LandOn.NONE))
    assert ask(grounded, 2.0, FlyingState.LANDED) is None
    assert grounded.time_left(10.0) == pytest.approx(22.0)


def test_without_a_referee_time_still_runs_out() -> None:
    verdict = ask(flown(JudgeConfig(time_limit_s=30.0)), 40.5)
    assert verdict == Verdict(outcome=Outcome.TIMEOUT, reason="not over after 30 s")


def test_a_landing_place_may_be_its_name() -> None:
    assert JudgeConfig(land_on="any").land_on is LandOn.ANY  # type: ignore[arg-type]
