"""Landings: no automatic override cancels one; a pilot and the motor cut do."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from tests.worlds.trees import document
from tests.worlds.values import motion
from uav_bt.board import ODOMETRY, STATE
from uav_bt.board.context import MissionContext, Proposals
from uav_bt.mission.judge import Judge, JudgeConfig, Outcome
from uav_bt.mission.limits import Limits
from uav_bt.mission.runner import MissionRunner
from uav_bt.mission.safety import Arbiter, Circumstances, Override
from uav_bt.mission.tick import TickRecord
from uav_bt.testing import ScriptedDrone
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Status, parse_tree
from uav_bt.types import (
    CutMotors,
    DroneState,
    FlyingState,
    Hover,
    Land,
    MoveBy,
    Movement,
    Observation,
    Release,
    TakeOff,
    Velocity,
)
from uav_bt.types.dead_reckoning import OdometryPose
from uav_bt.types.mission_rules import LandOn

LOW_M = 0.35


class Up(Leaf):
    """Takes off; SUCCESS in the air."""

    reads = (STATE,)

    def update(self) -> Status:
        state = self.read(STATE).value
        if state is not None and state.flying is FlyingState.HOVERING:
            return Status.SUCCESS
        self.propose(TakeOff())
        return Status.RUNNING


class Down(Leaf):
    """Lands; without fresh telemetry it proposes nothing."""

    reads = (STATE,)

    def update(self) -> Status:
        state = self.read(STATE).value
        if state is not None and state.flying is FlyingState.LANDED:
            return Status.SUCCESS
        if state is not None:
            self.propose(Land())
        return Status.RUNNING


class Climb(Leaf):
    """Climbs, for ever."""

    def update(self) -> Status:
        self.propose(Velocity(down_mps=-0.4))
        return Status.RUNNING


class Track(Leaf):
    """Writes odometry of a drone at rest, which activates the position hold."""

    reads = (STATE,)
    writes = (ODOMETRY,)

    def update(self) -> Status:
        state = self.read(STATE).value
        if state is not None:
            pose = OdometryPose(time_s=state.captured_s, x_m=0.0, y_m=0.0, yaw_rad=0.0)
            still = motion(pose, tracked_s=state.captured_s)
            self.write(ODOMETRY, still, captured_s=state.captured_s)
        return Status.SUCCESS


REGISTRY = NodeRegistry([Up, Down, Climb, Track])
LANDS = "<ReactiveSequence><Track/><Sequence><Up/><Down/></Sequence></ReactiveSequence>"

Fault = Callable[[Observation, Observation], Observation]
"""Returns the faulty report from the present observation and that of the fault's first tick."""


def frozen_video(now: Observation, then: Observation) -> Observation:
    return replace(now, frame=then.frame)


def silence(now: Observation, then: Observation) -> Observation:
    return replace(now, state=then.state)


def empty_battery(now: Observation, then: Observation) -> Observation:
    del then
    return replace(now, state=replace(now.state, battery=0.05))


class Sinking(ScriptedDrone):
    """Has a fault for some seconds, from the moment when it has descended to a height."""

    def __init__(self, fault: Fault, *, below_m: float = LOW_M, lasts_s: float = 3.0) -> None:
        super().__init__()
        self._fault, self._below_m, self._lasts_s = fault, below_m, lasts_s
        self._begin: tuple[float, Observation] | None = None

    @property
    def sent_since(self) -> list[Movement]:
        """The movements sent from the start of the fault on."""
        assert self._begin is not None
        first = round(self._begin[0] / 0.1)
        return [command.movement for command in self.commands[first:]]

    def observe(self) -> Observation:
        seen, now_s = super().observe(), self.clock.now()
        sinks = self.state.flying is FlyingState.FLYING and self.state.height_m <= self._below_m
        if self._begin is None and sinks:
            self._begin = now_s, seen
        if self._begin is None or now_s > self._begin[0] + self._lasts_s:
            return seen
        return self._fault(seen, self._begin[1])


class Records(list[TickRecord]):
    def on_tick(self, record: TickRecord) -> None:
        self.append(record)


def tree_of(body: str, context: MissionContext) -> MissionTree:
    tree = parse_tree(document(body), REGISTRY)
    tree.setup(context)
    return tree


def fly(
    drone: ScriptedDrone, *, then: str | None = None, until_s: float = 30.0
) -> tuple[Outcome, Records]:
    """Fly a landing; `then` is another tree, offered from the start of the descent."""
    context = MissionContext(clock=drone.clock)
    records = Records()

    def next_tree() -> MissionTree | None:
        sinks = drone.state.flying in {FlyingState.FLYING, FlyingState.LANDING}
        return tree_of(then, context) if then is not None and sinks else None

    runner = MissionRunner(
        drone,
        tree_of(LANDS, context),
        context,
        Judge(JudgeConfig(time_limit_s=until_s, land_on=LandOn.ANY)),
        listeners=(records,),
        next_tree=next_tree,
    )
    return runner.run().outcome, records


def test_a_landing_is_flown_down_to_the_drone_s_own() -> None:
    """Without a fault: 2.6 s from 1 m to 0.2 m by velocities, then the drone's own landing."""
    drone = ScriptedDrone()
    outcome, _ = fly(drone)
    kinds = [type(command.movement) for command in drone.commands]
    assert outcome is Outcome.SUCCESS
    assert kinds.count(Velocity) == pytest.approx(26, abs=2)
    assert kinds.index(Land) > kinds.index(Velocity)
    assert Velocity not in kinds[kinds.index(Land) :]


@pytest.mark.parametrize("height_m", [LOW_M, 0.8])
@pytest.mark.parametrize(
    ("fault", "override"),
    [(frozen_video, Override.STALE_FRAME), (silence, Override.LINK)],
    ids=["frozen video", "silence"],
)
def test_a_landing_goes_on_as_the_drone_s_own_where_data_are_old(
    fault: Fault, override: Override, height_m: float
) -> None:
    """It neither hovers in ground effect nor returns to velocities when the data return."""
    drone = Sinking(fault, below_m=height_m)
    outcome, records = fly(drone)
    sent = drone.sent_since
    own = sent.index(Land())
    assert outcome is Outcome.SUCCESS
    assert own <= 8  # 0.7 s is the maximum age of a frame
    assert all(isinstance(movement, Velocity) for movement in sent[:own])
    ended = next(index for index, each in enumerate(sent) if isinstance(each, Hover))
    assert set(sent[own:ended]) == {Land()}
    assert drone.state.flying is FlyingState.LANDED
    assert records[-1].time_s < drone._begin[0] + 4.0  # type: ignore[index]
    assert override in {record.override for record in records}


def test_a_critical_battery_does_not_stop_a_landing() -> None:
    drone = Sinking(empty_battery, lasts_s=math.inf)
    outcome, _ = fly(drone)
    assert outcome is Outcome.ABORTED
    assert set(drone.sent_since) == {Land()}
    assert drone.state.flying is FlyingState.LANDED


def test_another_tree_waits_until_the_landing_is_over() -> None:
    drone = ScriptedDrone()
    outcome, _ = fly(drone, then="<Climb/>")
    assert outcome is Outcome.SUCCESS
    climbs = [c for c in drone.commands if c.movement == Velocity(down_mps=-0.4)]
    assert climbs == []


# --- the arbiter ----------------------------------------------------------------------------------


def circumstances(flying: FlyingState = FlyingState.FLYING, **changes: object) -> Circumstances:
    battery = changes.pop("battery", 1.0)
    state = DroneState(captured_s=0.0, flying=flying, height_m=LOW_M, battery=battery)  # type: ignore[arg-type]
    return Circumstances(state=state, **changes)  # type: ignore[arg-type]


def proposing(movement: Movement | None) -> Proposals:
    proposals = Proposals()
    if movement is not None:
        proposals.propose("leaf", movement)
    return proposals


def landing() -> Arbiter:
    arbiter = Arbiter(Limits())
    arbiter.decide(proposing(Land()), circumstances())
    assert arbiter.landing
    return arbiter


OLD = pytest.mark.parametrize(
    "old", [{"frame_age_s": 5.0}, {"state_age_s": 5.0}, {"state_age_s": 0.8}, {"frame_age_s": 0.8}]
)


@OLD
def test_a_proposed_landing_is_flown_with_old_data(old: dict[str, float]) -> None:
    decided = Arbiter(Limits()).decide(proposing(Land()), circumstances(**old))
    assert decided.movement == Land()


@OLD
@pytest.mark.parametrize("proposed", [None, Hover(), MoveBy(id=1, down_m=-1.0)])
def test_with_old_data_no_leaf_takes_a_landing_back(
    old: dict[str, float], proposed: Movement | None
) -> None:
    assert landing().decide(proposing(proposed), circumstances(**old)).movement == Land()


@OLD
def test_with_old_data_a_drone_that_does_not_land_hovers(old: dict[str, float]) -> None:
    decided = Arbiter(Limits()).decide(proposing(Velocity(down_mps=0.2)), circumstances(**old))
    assert decided.movement == Hover()


def test_with_fresh_data_a_mission_may_change_its_mind() -> None:
    arbiter = landing()
    assert arbiter.decide(proposing(MoveBy(id=1)), circumstances()).movement == MoveBy(id=1)
    assert not arbiter.landing
    assert arbiter.decide(proposing(None), circumstances(frame_age_s=5.0)).movement == Hover()


def test_a_leaf_that_is_silent_for_a_tick_does_not_stop_a_drone_that_is_landing() -> None:
    lands = circumstances(FlyingState.LANDING)
    assert landing().decide(proposing(None), lands).movement == Land()


@pytest.mark.parametrize(
    ("changes", "movement"),
    [({"manual": True}, Release()), ({"cut": True}, CutMotors())],
    ids=["pilot", "motor cut"],
)
def test_a_pilot_and_the_motor_cut_end_a_landing(
    changes: dict[str, bool], movement: Movement
) -> None:
    arbiter = landing()
    assert arbiter.decide(proposing(Land()), circumstances(**changes)).movement == movement
    assert not arbiter.landing
    # After the pilot, with old data, the drone hovers until a leaf proposes the landing again.
    assert arbiter.decide(proposing(None), circumstances(frame_age_s=5.0)).movement == Hover()


@pytest.mark.parametrize("changes", [{"abort": True}, {"battery": 0.05}])
def test_abort_and_critical_battery_land_themselves(changes: dict[str, object]) -> None:
    both = circumstances(**changes, frame_age_s=5.0, state_age_s=5.0)
    assert landing().decide(proposing(None), both).movement == Land()
