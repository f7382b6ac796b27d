"""The runner: the order of a tick, and landings after faults."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar, Self

import pytest

from tests.worlds.trees import document
from uav_bt.board import CAMERA, ELAPSED, FRAME, HEIGHT, ODOMETRY, PHASE, STATE
from uav_bt.board.context import MissionContext
from uav_bt.clock import TickClock
from uav_bt.errors import DroneError, NodeFailedError, ProposalConflictError
from uav_bt.mission.judge import Judge, JudgeConfig, Outcome
from uav_bt.mission.runner import MissionRunner, RunnerConfig
from uav_bt.mission.safety import Override
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.testing import ScriptedDrone, blank_frame
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Port, Status, parse_tree
from uav_bt.types import (
    BodyVelocity,
    Command,
    DroneState,
    FlyingState,
    GimbalTo,
    Hover,
    Land,
    MoveBy,
    Observation,
    Release,
    TakeOff,
    Velocity,
)
from uav_bt.types.dead_reckoning import MotionEstimate, OdometryPose
from uav_bt.types.mission_rules import LandOn, MissionRules

TICK_S = 0.1
HALTED: list[str] = []  # paths of the leaves that were halted, in order


# --- leaves -----------------------------------------------------------------------------------


class Up(Leaf):
    """Takes off; SUCCESS in the air, in a tick without a proposal."""

    reads = (STATE,)

    def update(self) -> Status:
        state = self.read(STATE).value
        if state is not None and state.flying is FlyingState.HOVERING:
            return Status.SUCCESS
        self.propose(TakeOff())
        return Status.RUNNING


class Down(Leaf):
    """Lands; SUCCESS on the ground."""

    reads = (STATE,)

    def update(self) -> Status:
        state = self.read(STATE).value
        if state is not None and state.flying is FlyingState.LANDED:
            return Status.SUCCESS
        self.propose(Land())
        return Status.RUNNING


class Drift(Leaf):
    """Flies ahead for some ticks, or for ever, with feedback."""

    ports = (Port("ticks", int, default=-1), Port("fails", bool, default=False))
    writes = (PHASE,)

    def initialise(self) -> None:
        self.write(PHASE, "drift")
        self._left: int = self.port_value("ticks")

    def update(self) -> Status:
        if self._left == 0:
            return Status.FAILURE if self.port_value("fails") else Status.SUCCESS
        self._left -= 1
        self.feedback_message = "drifts"
        self.propose(Velocity(forward_mps=0.5))
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        if new_status is Status.IDLE:
            HALTED.append(self.path)


class Slide(Leaf):
    """Flies to the right for two ticks and writes no phase."""

    def initialise(self) -> None:
        self._left = 2

    def update(self) -> Status:
        if self._left == 0:
            return Status.SUCCESS
        self._left -= 1
        self.propose(Velocity(right_mps=0.5))
        return Status.RUNNING


class Rest(Leaf):
    """Proposes nothing for two ticks."""

    def initialise(self) -> None:
        self._left = 2

    def update(self) -> Status:
        self._left -= 1
        return Status.SUCCESS if self._left < 0 else Status.RUNNING


class Wait(Leaf):
    """Runs for ever without a proposal."""

    def update(self) -> Status:
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        if new_status is Status.IDLE:
            HALTED.append(self.path)


class Break(Leaf):
    """Raises in its first tick, after a proposal."""

    def update(self) -> Status:
        self.propose(MoveBy(id=1, forward_m=9.0))
        raise LookupError("no such thing")


class Clumsy(Leaf):
    """Runs, and raises when it is halted."""

    def update(self) -> Status:
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        raise RuntimeError(f"cannot let go ({new_status.name})")


class Look(Leaf):
    """Records the board's values in each tick."""

    reads = (STATE, FRAME, HEIGHT, ELAPSED, CAMERA)
    seen: ClassVar[list[tuple[float | None, float | None, float | None]]] = []

    def update(self) -> Status:
        frame, camera = self.read(FRAME).value, self.read(CAMERA).value
        assert camera is not None
        self.seen.append(
            (frame.captured_s if frame else None, self.read(HEIGHT).value, self.read(ELAPSED).value)
        )
        return Status.RUNNING


class Track(Leaf):
    """Sees the drone stand still over the ground, held against a drift of 0.1 m/s."""

    reads = (FRAME, STATE)
    writes = (ODOMETRY,)

    def update(self) -> Status:
        if self.read(FRAME).value is not None and self.read(STATE).value is not None:
            here = OdometryPose(x_m=0.0, y_m=0.0, yaw_rad=0.0, time_s=self.clock.now())
            motion = MotionEstimate(
                pose=here,
                seen=here,
                velocity=BodyVelocity(),
                error=BodyVelocity(forward_mps=0.1),
                tracked_s=here.time_s,
            )
            self.write(ODOMETRY, motion)
        return Status.RUNNING


class Count(Leaf):
    """Counts its ticks for ever, from the count of its predecessor on."""

    ports = (Port("fussy", bool, default=False),)

    def on_setup(self, mission: MissionContext) -> None:
        del mission
        self.count = 0

    def on_inherit(self, former: Self) -> None:
        if self.port_value("fussy"):
            raise RuntimeError("rather not")
        self.count = former.count

    def update(self) -> Status:
        self.count += 1
        self.feedback_message = str(self.count)
        return Status.RUNNING


REGISTRY = NodeRegistry([Up, Down, Drift, Slide, Rest, Wait, Break, Clumsy, Look, Track, Count])


class Records(list[TickRecord]):
    """Stores every tick."""

    def on_tick(self, record: TickRecord) -> None:
        self.append(record)


class At:
    """Calls a function at a tick."""

    def __init__(self, index: int, action: Callable[[], object]) -> None:
        self.index = index
        self.action = action

    def on_tick(self, record: TickRecord) -> None:
        if record.index == self.index:
            self.action()


def tree_of(body: str) -> MissionTree:
    return parse_tree(document(body), REGISTRY)


class Flight:
    """A scripted drone, a tree and a runner; `then` has further trees by their first tick."""

    def __init__(
        self,
        body: str,
        *,
        drone: ScriptedDrone | None = None,
        judge: JudgeConfig | None = None,
        listeners: Sequence[TickListener] = (),
        then: Mapping[int, str] | None = None,
    ) -> None:
        self.drone = drone or ScriptedDrone()
        self.tree = tree_of(body)
        self.context = MissionContext(clock=self.drone.clock)
        self.tree.setup(self.context)
        self.records = Records()
        self.runner = MissionRunner(
            self.drone,
            self.tree,
            self.context,
            Judge((judge or JudgeConfig()).under(MissionRules(land_on=LandOn.ANY))),
            config=RunnerConfig(tick_s=TICK_S, landing_grace_s=2.0),
            listeners=(self.records, *listeners),
            next_tree=self._next_tree,
        )
        self.then = dict(then or {})
        self.asked = 0

    def _next_tree(self) -> MissionTree | None:
        self.asked += 1
        body = self.then.pop(len(self.records), None)
        if body is None:
            return None
        tree = tree_of(body)
        tree.setup(self.context)
        return tree

    @property
    def sent(self) -> list[str]:
        """The names of the sent movements, without repetitions."""
        names: list[str] = []
        for command in self.drone.commands:
            name = type(command.movement).__name__
            if not names or names[-1] != name:
                names.append(name)
        return names

    @property
    def landed(self) -> bool:
        return self.drone.state.flying is FlyingState.LANDED


@pytest.fixture(autouse=True)
def _forget() -> None:
    HALTED.clear()
    Look.seen.clear()


# --- a tick -----------------------------------------------------------------------------------


def test_a_tick_has_its_events() -> None:
    """Of the tree, the arbiter and the drone; each once."""
    body = '<Fallback name="f"><Sequence name="s"><Up/><Drift ticks="30" fails="true"/></Sequence>'
    flight = Flight(f"{body}<Down/></Fallback>")
    take = At(12, lambda: setattr(flight.runner, "manual", True))
    back = At(14, lambda: setattr(flight.runner, "manual", False))
    flight.runner = with_listeners(flight, take, back)
    flight.runner.run()
    told = [(event.kind.value, event.node) for event in flight.context.notes.events]
    assert told == [
        ("phase", "Main/f/s/Up"),
        ("phase", "Main/f/s/Drift"),
        ("pilot", ""),
        ("pilot over", ""),
        ("failed", "Main/f/s/Drift"),
        ("phase", "Main/f/Down"),
        ("landed", ""),
        ("ended", "Main/f/Down"),
    ]
    of_ticks = [event for record in flight.records for event in record.events]
    assert of_ticks == flight.context.notes.events


def test_a_mission_flies_up_ahead_and_down() -> None:
    """A leaf that ends and the next that starts share a tick without a conflict or a hover."""
    flight = Flight('<Sequence><Up/><Drift ticks="3"/><Down/></Sequence>')
    verdict = flight.runner.run()
    assert verdict.outcome is Outcome.SUCCESS
    assert flight.sent == ["TakeOff", "Velocity", "Land", "Hover"]
    assert flight.drone.x_m == pytest.approx(3 * TICK_S * 0.5)
    assert flight.landed


def test_real_time_stands_still_within_a_tick() -> None:
    drone = ScriptedDrone()
    clock = TickClock(drone.clock)
    seen: list[float] = []

    class Computes(Leaf):
        def update(self) -> Status:
            for _ in range(2):
                seen.append(self.clock.now())
                drone.clock.advance(0.03)  # as a real clock would
            return Status.RUNNING

    context = MissionContext(clock=clock)
    tree = MissionTree(Computes())
    tree.setup(context)
    records = Records()
    stops = At(1, lambda: runner.abort.request("enough"))
    runner = MissionRunner(drone, tree, context, Judge(), listeners=(records, stops), clock=clock)
    runner.run()
    assert seen == [0.0, 0.0, 0.1, 0.1]
    assert [record.time_s for record in records][:2] == [0.0, 0.1]


def test_listeners_get_every_tick_with_what_was_sent() -> None:
    flight = Flight('<Sequence name="mission"><Up/><Drift ticks="3"/><Down/></Sequence>')
    flight.runner.run()
    records = flight.records
    assert [record.index for record in records] == list(range(len(records)))
    assert [record.time_s for record in records] == pytest.approx(
        [index * TICK_S for index in range(len(records))]
    )
    assert [record.command for record in records] == flight.drone.commands
    drifting = next(record for record in records if record.phase == "drift")
    assert drifting.active == ("mission", "Drift")
    assert drifting.feedback == "drifts"
    assert drifting.proposed_by == "Main/mission/Drift"
    assert drifting.tree_status is Status.RUNNING
    assert drifting.override is None
    assert drifting.truth is None
    assert records[0].phase == "Up"
    assert records[-1].tree_status is Status.SUCCESS
    assert records[-1].proposed_by is None


def test_a_moving_leaf_that_writes_no_phase_is_the_phase_itself() -> None:
    flight = Flight(
        '<Sequence><Up/><Drift ticks="2"/><Slide name="to the door"/><Rest/><Down/></Sequence>'
    )
    flight.runner.run()
    phases = [name for name, _ in itertools.groupby(record.phase for record in flight.records)]
    # A leaf that proposes nothing leaves the phase as it is.
    assert phases == ["Up", "drift", "to the door", "Down"]


def test_all_listeners_are_called_in_their_order() -> None:
    told: list[str] = []
    first, second = At(2, lambda: told.append("first")), At(2, lambda: told.append("second"))
    Flight("<Sequence><Up/><Down/></Sequence>", listeners=(first, second)).runner.run()
    assert told == ["first", "second"]


def test_a_tick_observes_then_thinks_then_sends_then_tells_then_waits() -> None:
    """Each tick observes the effect of the last command; the clock is constant within it."""
    calls: list[str] = []

    class Noting(ScriptedDrone):
        def observe(self) -> Observation:
            calls.append(f"observe {self.clock.now():.1f}")
            return super().observe()

        def send(self, command: Command) -> Command:
            calls.append(f"send {self.clock.now():.1f}")
            return super().send(command)

    class Thinks(Leaf):
        def update(self) -> Status:
            calls.append("think")
            return Status.RUNNING

    drone = Noting()
    context = MissionContext(clock=drone.clock)
    tree = MissionTree(Thinks())
    tree.setup(context)
    tells = [At(index, lambda: calls.append("tell")) for index in (0, 1)]
    stops = At(1, lambda: runner.abort.request("enough"))
    runner = MissionRunner(drone, tree, context, Judge(), listeners=(*tells, stops))
    runner.run()
    assert calls[:8] == [
        "observe 0.0", "think", "send 0.0", "tell",
        "observe 0.1", "think", "send 0.1", "tell",
    ]  # fmt: skip


def test_the_board_holds_what_was_observed_in_this_tick() -> None:
    """Leaves see the present frame, state and camera, and the time since the take-off command."""
    flight = Flight(
        "<ParallelAll><Up/><Look/></ParallelAll>",
        judge=JudgeConfig(time_limit_s=1.0),
    )
    flight.runner.run()
    frames, heights, elapsed = zip(*Look.seen, strict=True)
    times = [record.time_s for record in flight.records]
    assert frames == pytest.approx(times)
    assert heights[0] == 0.0
    assert heights[-1] == flight.drone.config.take_off_height_m
    assert elapsed == pytest.approx(times)  # the take-off was in the first tick, at 0 s


def test_nothing_proposed_means_hover() -> None:
    flight = Flight("<Sequence><Up/><Wait/></Sequence>", judge=JudgeConfig(time_limit_s=2.0))
    verdict = flight.runner.run()
    assert verdict.outcome is Outcome.TIMEOUT
    assert flight.sent == ["TakeOff", "Hover", "Land"]
    assert flight.landed


def test_a_proposal_does_not_survive_its_tick() -> None:
    """The last proposal of a leaf ends when the next leaf proposes nothing."""
    flight = Flight(
        '<Sequence><Up/><Drift ticks="1"/><Wait/></Sequence>', judge=JudgeConfig(time_limit_s=2.0)
    )
    flight.runner.run()
    assert sum(isinstance(c.movement, Velocity) for c in flight.drone.commands) == 1
    assert flight.sent == ["TakeOff", "Velocity", "Hover", "Land"]


def test_without_a_frame_nothing_is_on_the_board_and_the_drone_hovers() -> None:
    """For overrides the age of a missing frame is infinite."""

    class Blind(ScriptedDrone):
        def observe(self) -> Observation:
            return replace(super().observe(), frame=None)

    flight = Flight(
        "<Sequence><Up/><ParallelAll><Drift/><Look/></ParallelAll></Sequence>",
        drone=Blind(),
        judge=JudgeConfig(time_limit_s=1.5),
    )
    flight.runner.run()
    assert flight.records[-1].override is Override.STALE_FRAME
    assert Look.seen[-1][0] is None
    assert flight.sent == ["TakeOff", "Hover", "Land"]


def test_a_frozen_camera_is_noticed() -> None:
    """A frame that no longer changes becomes stale, and the drone stops."""

    class Frozen(ScriptedDrone):
        def observe(self) -> Observation:
            seen = super().observe()
            captured_s = min(seen.state.captured_s, 1.0)
            frame = blank_frame(self.camera, seen.state, captured_s=captured_s)
            return replace(seen, frame=frame)

    flight = Flight(
        "<Sequence><Up/><ParallelAll><Drift/><Look/></ParallelAll></Sequence>",
        drone=Frozen(),
        judge=JudgeConfig(time_limit_s=4.0),
    )
    flight.runner.run()
    stopped = [record for record in flight.records if record.override is Override.STALE_FRAME]
    assert 1.7 <= stopped[0].time_s <= 1.9
    assert all(record.command.movement == Hover() for record in stopped)
    assert stopped[0].proposed_by is not None  # proposed, and overridden
    assert Look.seen[0][0] is not None
    assert Look.seen[-1][0] is None  # leaves do not see the stale frame


@pytest.mark.parametrize("lost", [Override.STALE_FRAME, Override.LINK])
def test_a_hover_without_frames_or_telemetry_is_held_against_the_known_drift(
    lost: Override,
) -> None:
    class Losing(ScriptedDrone):
        def observe(self) -> Observation:
            seen = super().observe()
            until_s = min(seen.state.captured_s, 10.0)
            if lost is Override.LINK:
                return replace(seen, state=replace(seen.state, captured_s=until_s))
            return replace(seen, frame=blank_frame(self.camera, seen.state, captured_s=until_s))

    flight = Flight(
        "<ParallelAll><Track/><Sequence><Up/><Wait/></Sequence></ParallelAll>",
        drone=Losing(),
        judge=JudgeConfig(time_limit_s=15.0),
    )
    flight.runner.run()
    flown = [record.command.movement for record in flight.records if record.override is lost]
    assert len(flown) > 20
    for movement in flown:
        assert isinstance(movement, Velocity)
        assert movement.forward_mps < -0.05


# --- faults ---------------------------------------------------------------------------------------


def test_a_leaf_that_raises_stops_the_tree_lands_and_is_named() -> None:
    flight = Flight(
        '<Sequence name="mission"><Up/><Drift ticks="2"/>'
        '<ParallelAll><Wait name="beside"/><Break name="bad"/></ParallelAll></Sequence>'
    )
    with pytest.raises(NodeFailedError) as caught:
        flight.runner.run()
    assert caught.value.node_path == "Main/mission/ParallelAll/bad"
    assert flight.landed
    assert flight.tree.root.node_status is Status.IDLE
    assert HALTED == ["Main/mission/ParallelAll/beside"]
    assert not any(isinstance(c.movement, MoveBy) for c in flight.drone.commands)


def test_the_cause_travels_with_the_error() -> None:
    flight = Flight("<Sequence><Up/><Break/></Sequence>")
    with pytest.raises(NodeFailedError, match="LookupError: no such thing") as caught:
        flight.runner.run()
    assert isinstance(caught.value.__cause__, LookupError)
    assert flight.sent == ["TakeOff", "Land"]


def test_two_leaves_that_both_move_are_an_error_that_names_both() -> None:
    flight = Flight(
        '<Sequence><Up/><ParallelAll name="both"><Drift name="a"/><Drift name="b"/></ParallelAll>'
        "</Sequence>"
    )
    with pytest.raises(NodeFailedError, match=r"both/a' and .*both/b'") as caught:
        flight.runner.run()
    assert isinstance(caught.value.__cause__, ProposalConflictError)
    assert flight.landed


def test_a_leaf_that_raises_when_it_is_halted_does_not_keep_the_drone_up() -> None:
    """The drone lands, and the fault is raised."""
    flight = Flight("<Sequence><Up/><Clumsy/></Sequence>", judge=JudgeConfig(time_limit_s=1.0))
    with pytest.raises(NodeFailedError, match="cannot let go"):
        flight.runner.run()
    assert flight.landed


def test_a_listener_that_raises_is_left_out_and_the_flight_goes_on() -> None:
    """A failed display or a full disk does not end a flight."""

    def fail() -> None:
        raise OSError("disk full")

    ticks = Records()
    flight = Flight(
        '<Sequence><Up/><Drift ticks="9"/><Down/></Sequence>',
        listeners=(At(9, fail), At(10, fail), ticks),
    )
    assert flight.runner.run().outcome is Outcome.SUCCESS
    assert flight.runner.listeners.lost == dict.fromkeys(("At", "At#2"), "OSError: disk full")
    assert len(ticks) == len(flight.records) > 10


def test_an_interrupt_that_gets_through_lands_the_drone() -> None:
    def interrupt() -> None:
        raise KeyboardInterrupt  # not an Exception, so the runner does not catch it

    flight = Flight("<Sequence><Up/><Drift/></Sequence>", listeners=(At(9, interrupt),))
    with pytest.raises(KeyboardInterrupt):
        flight.runner.run()
    assert flight.landed


def test_when_landing_fails_too_the_first_fault_is_reported() -> None:
    class Lost(ScriptedDrone):
        def send(self, command: Command) -> Command:
            if isinstance(command.movement, Land):
                raise DroneError("no answer")
            return super().send(command)

    flight = Flight("<Sequence><Up/><Break/></Sequence>", drone=Lost())
    with pytest.raises(NodeFailedError, match="no such thing") as caught:
        flight.runner.run()
    assert caught.value.__notes__ == ["while landing, also: DroneError: no answer"]


def test_a_drone_that_does_not_land_is_given_up_after_the_grace_time() -> None:
    class Stubborn(ScriptedDrone):
        def send(self, command: Command) -> Command:
            stays = isinstance(command.movement, Land)
            super().send(Command(movement=Hover()) if stays else command)
            self.commands[-1] = command
            return command

    flight = Flight(
        "<Sequence><Up/><Wait/></Sequence>",
        drone=Stubborn(),
        judge=JudgeConfig(time_limit_s=1.0),
    )
    verdict = flight.runner.run()
    assert verdict.outcome is Outcome.TIMEOUT
    over_s = flight.records[-1].time_s
    assert flight.drone.clock.now() == pytest.approx(over_s + 2.0, abs=TICK_S)


class Faulty(ScriptedDrone):
    """Raises in the given methods, from the command with number `after` on."""

    def __init__(self, *methods: str, after: int = 12) -> None:
        super().__init__()
        self._methods = methods
        self._after = after

    def _fails(self, method: str) -> None:
        if method in self._methods and len(self.commands) >= self._after:
            raise DroneError(f"{method} failed")

    def observe(self) -> Observation:
        self._fails("observe")
        return super().observe()

    def send(self, command: Command) -> Command:
        self.commands.append(command)
        self._fails("send")
        self.commands.pop()
        return super().send(command)


@pytest.mark.parametrize("method", ["observe", "send"])
def test_landing_is_asked_for_again_and_again_whatever_raises(method: str) -> None:
    drone = Faulty(method)
    flight = Flight("<Sequence><Up/><Drift/></Sequence>", drone=drone)
    with pytest.raises(DroneError, match=f"{method} failed"):
        flight.runner.run()
    asked = [c for c in drone.commands[12:] if isinstance(c.movement, Land)]
    assert len(asked) == pytest.approx(2.0 / TICK_S, abs=2)  # during the whole grace time


def test_a_drone_that_recovers_while_it_is_brought_down_lands() -> None:
    class Moody(Faulty):
        def _fails(self, method: str) -> None:
            if len(self.commands) < 18:
                super()._fails(method)

    flight = Flight("<Sequence><Up/><Drift/></Sequence>", drone=Moody("send"))
    with pytest.raises(DroneError, match="send failed"):
        flight.runner.run()
    assert flight.landed
    assert not flight.runner.descent.airborne


def test_a_clock_that_stands_still_does_not_keep_the_program() -> None:
    class Still(Faulty):
        def _fails(self, method: str) -> None:
            if method in self._methods and len(self.commands) >= self._after:
                self.clock.sleep_until = lambda _: None  # type: ignore[method-assign]
                raise DroneError("lost")

    flight = Flight("<Sequence><Up/><Drift/></Sequence>", drone=Still("observe"))
    with pytest.raises(DroneError, match="lost"):
        flight.runner.run()
    assert flight.runner.descent.airborne


def test_whoever_follows_the_descent_sees_why_and_that_it_goes_on() -> None:
    class Follows(Records):
        seen: ClassVar[list[str]] = []

        def on_descent(self, state: DroneState | None, reason: str) -> None:
            del state
            self.seen.append(reason)
            raise OSError("the terminal is gone")

    flight = Flight("<Sequence><Up/><Break/></Sequence>", listeners=(Follows(),))
    with pytest.raises(NodeFailedError):
        flight.runner.run()
    assert flight.landed
    assert len(Follows.seen) > 1
    assert all("no such thing" in reason for reason in Follows.seen)


def test_nobody_waits_for_a_landing_that_was_given_up() -> None:
    """The landing is still commanded, and the result says that the drone is in the air."""

    def stop_twice() -> None:
        flight.runner.abort.request("stopped")
        flight.runner.abort.give_up()

    flight = Flight("<Sequence><Up/><Drift/></Sequence>", listeners=(At(9, stop_twice),))
    verdict = flight.runner.run()
    assert (verdict.outcome, verdict.reason) == (Outcome.ABORTED, "stopped")
    assert flight.runner.descent.airborne
    assert isinstance(flight.drone.commands[-1].movement, Land)
    assert flight.records[-1].index <= 11


def test_motors_that_the_drone_cut_stay_off() -> None:
    """The drone is on the ground and does not take off again."""

    class Stalls(ScriptedDrone):
        def observe(self) -> Observation:
            if len(self.commands) == 12:
                self._set_height(0.0, FlyingState.EMERGENCY)
            return super().observe()

    flight = Flight("<Fallback><Sequence><Up/><Drift/></Sequence></Fallback>", drone=Stalls())
    verdict = flight.runner.run()
    assert (verdict.outcome, verdict.reason) == (Outcome.ABORTED, "the drone cut its motors")
    assert len(flight.drone.commands) == 13


# --- aborts ---------------------------------------------------------------------------------------


def abort_at(index: int, body: str = "<Sequence><Up/><Drift/></Sequence>") -> Flight:
    """Return a flight that an operator stops at a tick."""
    stop = At(index, lambda: flight.runner.abort.request("the operator's wish"))
    flight = Flight(body, listeners=(stop,))
    return flight


def test_an_abort_halts_the_tree_lands_and_is_the_outcome() -> None:
    flight = abort_at(12)
    verdict = flight.runner.run()
    assert verdict.outcome is Outcome.ABORTED
    assert verdict.reason == "the operator's wish"
    assert flight.landed
    assert flight.sent == ["TakeOff", "Velocity", "Land"]
    assert HALTED == ["Main/Sequence/Drift"]
    after = flight.records[13:]
    assert all(record.override is Override.ABORT for record in after)
    assert all(record.tree_status is Status.IDLE and not record.active for record in after)


def test_an_abort_halts_the_tree_once() -> None:
    """`_onHalted` runs in the first tick of the abort only, however long the landing takes."""
    body = '<Sequence><Script code="halts := 0"/><Up/><Drift _onHalted="halts += 1"/></Sequence>'
    flight, halts = abort_at(12, body), []
    flight.runner.listeners.following.append(
        At(13, lambda: halts.append(flight.tree.variables["halts"]))
    )
    flight.runner.run()
    assert halts == [flight.tree.variables["halts"]]
    assert halts[0] > 0


def test_an_abort_during_take_off_lands_as_soon_as_it_can() -> None:
    flight = abort_at(1)
    assert flight.runner.run().outcome is Outcome.ABORTED
    assert flight.landed


def test_an_abort_on_the_ground_ends_at_once() -> None:
    flight = abort_at(3, body="<Wait/>")
    assert flight.runner.run().outcome is Outcome.ABORTED
    assert len(flight.records) == 4
    assert FlyingState.TAKING_OFF not in {r.observation.state.flying for r in flight.records}


def test_the_first_reason_for_an_abort_counts() -> None:
    flight = Flight(
        "<Sequence><Up/><Drift/></Sequence>",
        listeners=(
            At(8, lambda: flight.runner.abort.request("first")),
            At(9, lambda: flight.runner.abort.request("second")),
        ),
    )
    assert flight.runner.run().reason == "first"


@pytest.mark.parametrize(("fails", "status"), [("false", "SUCCESS"), ("true", "FAILURE")])
def test_a_tree_that_ends_in_the_air_is_brought_down_and_aborted(fails: str, status: str) -> None:
    flight = Flight(f'<Sequence><Up/><Drift ticks="2" fails="{fails}"/></Sequence>')
    verdict = flight.runner.run()
    assert verdict.outcome is Outcome.ABORTED
    assert verdict.reason == f"the tree ended with {status} in the air"
    assert flight.landed
    assert flight.drone.x_m == pytest.approx(2 * TICK_S * 0.5)  # the tree was not started again


class Draining(ScriptedDrone):
    """Has a critical battery after 1 s."""

    def observe(self) -> Observation:
        seen = super().observe()
        battery = 0.08 if self.clock.now() > 1.0 else 0.9
        return replace(seen, state=replace(seen.state, battery=battery))


def test_a_critical_battery_ends_the_flight_on_the_ground() -> None:
    """No proposal of a leaf cancels the landing."""
    flight = Flight("<Sequence><Up/><Drift/></Sequence>", drone=Draining())
    verdict = flight.runner.run()
    assert verdict.outcome is Outcome.ABORTED
    assert verdict.reason == "critical battery: 8 %"
    assert flight.sent == ["TakeOff", "Velocity", "Land"]
    assert flight.landed
    overrides = [record.override for record in flight.records if record.override]
    assert overrides[0] is Override.BATTERY


class Taken(ScriptedDrone):
    """A pilot has control between 1.0 and 1.5 s."""

    def observe(self) -> Observation:
        seen = super().observe()
        pilot = 1.0 < self.clock.now() < 1.5
        return replace(seen, state=replace(seen.state, pilot_has_control=pilot))


def test_while_a_pilot_flies_nothing_is_sent_and_then_the_mission_goes_on() -> None:
    flight = Flight(
        '<Sequence><Up/><Drift ticks="15"/><Down/></Sequence>',
        drone=Taken(),
    )
    assert flight.runner.run().outcome is Outcome.SUCCESS
    taken = [record for record in flight.records if record.override is Override.MANUAL]
    assert len(taken) == 4
    assert all(record.command == Command(movement=Release()) for record in taken)
    assert flight.sent == ["TakeOff", "Velocity", "Release", "Velocity", "Land", "Hover"]


def test_an_abort_does_not_take_the_drone_from_a_pilot() -> None:
    class Piloted(ScriptedDrone):
        def observe(self) -> Observation:
            seen = super().observe()
            pilot = 1.0 < self.clock.now() < 3.0
            return replace(seen, state=replace(seen.state, pilot_has_control=pilot))

    flight = Flight(
        "<Sequence><Up/><Drift/></Sequence>",
        drone=Piloted(),
        listeners=(At(12, lambda: flight.runner.abort.request("stop")),),
    )
    assert flight.runner.run().outcome is Outcome.ABORTED
    assert flight.sent == ["TakeOff", "Velocity", "Release", "Land"]


def test_a_person_at_this_machine_takes_over_and_hands_back() -> None:
    """The mission pauses meanwhile: its leaf keeps its remaining ticks."""
    flight = Flight('<Sequence><Up/><Drift ticks="15"/><Down/></Sequence>')
    take = At(8, lambda: setattr(flight.runner, "manual", True))
    back = At(28, lambda: setattr(flight.runner, "manual", False))
    flight.runner = with_listeners(flight, take, back)
    assert flight.runner.run().outcome is Outcome.SUCCESS
    taken = [record for record in flight.records if record.override is Override.MANUAL]
    assert len(taken) == 20
    assert flight.sent == ["TakeOff", "Velocity", "Release", "Velocity", "Land", "Hover"]
    steered = [c for c in flight.drone.commands if isinstance(c.movement, Velocity)]
    assert len(steered) == 15


def test_cut_motors_come_before_everything() -> None:
    flight = Flight("<Sequence><Up/><Drift/></Sequence>")
    manual = At(8, lambda: setattr(flight.runner, "manual", True))
    cut = At(12, lambda: flight.runner.abort.cut_motors("a person cut the motors"))
    flight.runner = with_listeners(flight, manual, cut)
    verdict = flight.runner.run()
    assert verdict.outcome is Outcome.ABORTED
    assert verdict.reason == "a person cut the motors"
    assert flight.sent[:4] == ["TakeOff", "Velocity", "Release", "CutMotors"]


def with_listeners(flight: Flight, *listeners: TickListener) -> MissionRunner:
    return MissionRunner(
        flight.drone,
        flight.tree,
        flight.context,
        Judge(JudgeConfig(land_on=LandOn.ANY)),
        config=RunnerConfig(tick_s=TICK_S, landing_grace_s=2.0),
        listeners=(flight.records, *listeners),
    )


class Blind(ScriptedDrone):
    """The video stops after 1 s."""

    def observe(self) -> Observation:
        seen = super().observe()
        frame = seen.frame
        if frame is not None and frame.captured_s > 1.0:
            frame = replace(frame, captured_s=1.0)
        return replace(seen, frame=frame)


def test_blind_for_long_is_a_landing() -> None:
    flight = Flight("<Sequence><Up/><Drift/></Sequence>", drone=Blind())
    verdict = flight.runner.run()
    assert verdict.outcome is Outcome.ABORTED
    assert verdict.reason == "no usable frame for 15 s"
    assert flight.sent == ["TakeOff", "Velocity", "Hover", "Land"]
    assert flight.landed


class Unheard(ScriptedDrone):
    """The telemetry stops at 1 s, until a time or for ever."""

    def __init__(self, until_s: float) -> None:
        super().__init__()
        self.until_s = until_s

    def observe(self) -> Observation:
        seen = super().observe()
        if 1.0 < self.clock.now() < self.until_s:
            return replace(seen, state=replace(seen.state, captured_s=1.0))
        return seen


def test_a_link_that_comes_back_lets_the_mission_go_on() -> None:
    flight = Flight(
        '<Sequence><Up/><Drift ticks="40"/><Down/></Sequence>', drone=Unheard(until_s=5.0)
    )
    assert flight.runner.run().outcome is Outcome.SUCCESS
    assert Override.LINK in {record.override for record in flight.records}


def test_a_link_lost_for_long_is_the_end() -> None:
    flight = Flight("<Sequence><Up/><Drift/></Sequence>", drone=Unheard(until_s=math.inf))
    with pytest.raises(DroneError, match="nothing heard from the drone for 10 s: it hovers"):
        flight.runner.run()
    assert flight.sent == ["TakeOff", "Velocity", "Hover", "Land"]


class Implausible(ScriptedDrone):
    """In each nine observations some, the last of them, have an impossible height."""

    def __init__(self, bad_of_nine: int) -> None:
        super().__init__()
        self.first_bad, self.count = 9 - bad_of_nine, 0

    def observe(self) -> Observation:
        seen = super().observe()
        self.count += 1
        if self.clock.now() < 2.0 or self.count % 9 < self.first_bad:
            return seen
        return replace(seen, state=replace(seen.state, height_m=math.nan))


@pytest.mark.parametrize(
    ("bad_of_nine", "reason"),
    [
        (1, "landed"),
        (8, "no usable telemetry for 11 s: its height is nan"),
        (9, "no usable telemetry for 10 s: its height is nan"),
    ],
)
def test_impossible_telemetry_ends_a_mission_that_gets_no_other(
    bad_of_nine: int, reason: str
) -> None:
    body = '<Sequence><Up/><Drift ticks="200"/><Down/></Sequence>'
    assert Flight(body, drone=Implausible(bad_of_nine)).runner.run().reason == reason


class Lost(ScriptedDrone):
    """Its connection is broken from 2 s on, possibly for good."""

    def __init__(self, *, for_good: bool) -> None:
        super().__init__()
        self.for_good = for_good

    def observe(self) -> Observation:
        seen = super().observe()
        if self.clock.now() < 2.0:
            return seen
        state = replace(seen.state, captured_s=2.0, connected=False, lost=self.for_good)
        return replace(seen, state=state)


def test_nobody_waits_for_a_drone_whose_connection_is_broken_for_good() -> None:
    """The landing is commanded once; further commands could not arrive."""
    drone = Lost(for_good=True)
    flight = Flight("<Sequence><Up/><Drift/></Sequence>", drone=drone)
    with pytest.raises(DroneError, match=r"is broken: .*take over with its remote control"):
        flight.runner.run()
    assert drone.clock.now() == pytest.approx(2.0, abs=2 * TICK_S)
    assert flight.runner.descent.airborne
    assert flight.sent[-1] == "Land"
    assert flight.drone.commands[-2].movement != Land()


def test_a_connection_that_may_come_back_is_waited_for() -> None:
    drone = Lost(for_good=False)
    flight = Flight("<Sequence><Up/><Drift/></Sequence>", drone=drone)
    with pytest.raises(DroneError, match="nothing heard from the drone for 10 s"):
        flight.runner.run()
    assert drone.clock.now() > 12.0


# --- the record -----------------------------------------------------------------------------------


def test_a_record_holds_what_was_really_sent() -> None:
    """The drone returns the command that it executes within its limits."""

    class Slow(ScriptedDrone):
        def send(self, command: Command) -> Command:
            if isinstance(command.movement, Velocity):
                command = Command(movement=Velocity(forward_mps=0.1), gimbal=command.gimbal)
            return super().send(command)

    flight = Flight('<Sequence><Up/><Drift ticks="1"/><Down/></Sequence>', drone=Slow())
    flight.runner.run()
    assert Command(movement=Velocity(forward_mps=0.1)) in [r.command for r in flight.records]


def test_a_gimbal_command_reaches_the_drone_with_the_movement() -> None:
    class Nod(Leaf):
        def update(self) -> Status:
            self.point(GimbalTo(pitch_rad=-0.5))
            return Status.RUNNING

    drone = ScriptedDrone()
    context = MissionContext(clock=drone.clock)
    tree = MissionTree(Nod())
    tree.setup(context)
    MissionRunner(drone, tree, context, Judge(JudgeConfig(patience_s=0.3))).run()
    assert drone.commands[0] == Command(movement=Hover(), gimbal=GimbalTo(pitch_rad=-0.5))
    assert drone.state.gimbal_pitch_rad == -0.5


# --- another tree in flight -----------------------------------------------------------------------


def test_another_tree_begins_at_its_root_between_two_ticks() -> None:
    """The old tree is halted and proposes nothing more; the drone stays in the air."""
    flight = Flight(
        '<Sequence><Up/><Drift ticks="-1"/></Sequence>',
        then={9: '<Sequence name="second"><Wait/></Sequence>', 14: "<Down/>"},
    )
    verdict = flight.runner.run()
    assert verdict.outcome is Outcome.SUCCESS
    assert flight.sent == ["TakeOff", "Velocity", "Hover", "Land", "Hover"]
    assert HALTED == ["Main/Sequence/Drift", "Main/second/Wait"]
    records = flight.records
    assert [record.active for record in records[8:10]] == [
        ("Sequence", "Drift"),
        ("second", "Wait"),
    ]
    assert [record.index for record in records] == list(range(len(records)))
    assert [record.time_s for record in records] == pytest.approx(
        [index * TICK_S for index in range(len(records))]
    )
    assert records[13].phase == "drift"  # the board is kept


def test_leaves_go_on_from_those_of_their_class() -> None:
    two = '<Parallel success_count="2"><Count name="a"/><Count name="b"/></Parallel>'
    flight = Flight(f"<Sequence><Up/>{two}</Sequence>", then={9: '<Count name="c"/>', 14: two})
    flight.drone.send(Command(movement=TakeOff()))
    flight.runner.listeners.following.append(At(20, lambda: flight.runner.abort.request("done")))
    flight.runner.run()
    counts = [int(record.feedback) for record in flight.records if record.feedback.isdigit()]
    jumps = [after - before for before, after in itertools.pairwise(counts)]
    new = next(index for index, jump in enumerate(jumps) if jump != 1)
    assert jumps[:new] == [1] * new  # `c` continued from `a`, whose count equals that of `b`
    assert counts[new + 1] == 1  # the second `b` has no predecessor


def test_no_other_tree_flies_once_the_mission_is_aborted() -> None:
    flight = Flight(
        "<Sequence><Up/><Wait/></Sequence>",
        listeners=(At(8, lambda: flight.runner.abort.request("enough")),),
        then={9: "<Sequence><Up/><Drift/></Sequence>"},
    )
    assert flight.runner.run().outcome is Outcome.ABORTED
    assert flight.asked == 9
    assert "Velocity" not in flight.sent
    assert flight.landed


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        ("Clumsy", "Wait", "cannot let go"),
        ("Count", 'Count fussy="true"', "Main/Count' failed: RuntimeError: rather not"),
    ],
)
def test_a_leaf_that_spoils_the_change_lands_the_drone(first: str, second: str, words: str) -> None:
    flight = Flight(f"<Sequence><Up/><{first}/></Sequence>", then={9: f"<{second}/>"})
    with pytest.raises(NodeFailedError, match=words):
        flight.runner.run()
    assert flight.landed
