"""The runner: the order of a tick, ends of missions, and landings after faults."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar, Self

import pytest

from tests.worlds import values
from tests.worlds.trees import document
from uav_bt.board import FRAME, ODOMETRY, PHASE, STATE
from uav_bt.board.context import MissionContext
from uav_bt.clock import TickClock
from uav_bt.errors import DroneError, NodeFailedError
from uav_bt.mission.judge import Judge, JudgeConfig
from uav_bt.mission.runner import MissionRunner, RunnerConfig
from uav_bt.mission.safety import Override
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.testing import ScriptedDrone
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Port, Status, parse_tree
from uav_bt.types import Command, Hover, Land, MoveBy, Observation, TakeOff, Velocity
from uav_bt.types.dead_reckoning import OdometryPose
from uav_bt.types.drone_state import BodyVelocity, DroneState, FlyingState
from uav_bt.types.place import LandOn

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
    """Lands; without fresh telemetry it proposes nothing."""

    reads = (STATE,)

    def update(self) -> Status:
        state = self.read(STATE).value
        if state is not None and state.flying is FlyingState.LANDED:
            return Status.SUCCESS
        if state is not None:
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


class Track(Leaf):
    """Sees the drone stand still over the ground, held against a drift of 0.1 m/s."""

    reads = (FRAME, STATE)
    writes = (ODOMETRY,)

    def update(self) -> Status:
        if self.read(FRAME).value is not None and self.read(STATE).value is not None:
            here = OdometryPose(x_m=0.0, y_m=0.0, yaw_rad=0.0, time_s=self.clock.now())
            self.write(ODOMETRY, values.motion(here, error=BodyVelocity(forward_mps=0.1)))
        return Status.SUCCESS


class Count(Leaf):
    """Counts its ticks for ever, from the count of its predecessor on."""

    ports = (Port("fussy", bool, default=False),)
    closed: ClassVar[list[str]] = []

    def on_setup(self, mission: MissionContext) -> None:
        del mission
        self.count = 0

    def on_inherit(self, former: Self) -> None:
        if self.port_value("fussy"):
            raise RuntimeError("rather not")
        self.count = former.count

    def on_shutdown(self) -> None:
        self.closed.append(self.name)

    def update(self) -> Status:
        self.count += 1
        self.feedback_message = str(self.count)
        return Status.RUNNING


REGISTRY = NodeRegistry([Up, Down, Drift, Wait, Break, Clumsy, Track, Count])


class Told(ScriptedDrone):
    """A drone whose reports a function changes; Land and other orders may fail."""

    def __init__(
        self,
        change: Callable[[Observation, float], Observation] = lambda seen, _: seen,
        send: Callable[[Command], Command] = lambda command: command,
    ) -> None:
        super().__init__()
        self.change, self.order = change, send

    def observe(self) -> Observation:
        return self.change(super().observe(), self.clock.now())

    def send(self, command: Command) -> Command:
        return super().send(self.order(command))


def of_frame(captured_s: float) -> Callable[[Observation, float], Observation]:
    """Return a video whose last frame is of a time."""

    def change(seen: Observation, now_s: float) -> Observation:
        frame = seen.frame
        if frame is None or now_s <= captured_s:
            return seen
        return replace(seen, frame=replace(frame, captured_s=captured_s))

    return change


def between(begin_s: float, end_s: float, **changes: Any) -> Callable[..., Observation]:
    """Return a change of the state between two times."""
    return lambda seen, now_s: (
        replace(seen, state=replace(seen.state, **changes)) if begin_s < now_s < end_s else seen
    )


def no_frame(seen: Observation, _: float) -> Observation:
    return replace(seen, frame=None)


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


Acts = Mapping[int, Callable[[MissionRunner], object]]


class Flight:
    """A scripted drone, a tree and a runner; `then` has further trees by their first tick."""

    def __init__(
        self,
        body: str | Leaf,
        drone: ScriptedDrone | None = None,
        *,
        acts: Acts | None = None,
        listeners: Sequence[TickListener] = (),
        then: Mapping[int, str] | None = None,
        **judge: Any,
    ) -> None:
        self.drone = drone or ScriptedDrone()
        self.tree = MissionTree(body) if isinstance(body, Leaf) else tree_of(body)
        clock = TickClock(self.drone.clock)
        self.context = MissionContext(clock=clock)
        self.tree.setup(self.context)
        self.records = Records()
        acting = [
            At(index, lambda act=act: act(self.runner)) for index, act in (acts or {}).items()
        ]
        self.runner = MissionRunner(
            self.drone,
            self.tree,
            self.context,
            Judge(JudgeConfig(**{"land_on": LandOn.ANY, **judge})),
            config=RunnerConfig(tick_s=TICK_S, landing_grace_s=2.0),
            listeners=(self.records, *acting, *listeners),
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

    def fly(self) -> tuple[str, str]:
        """Return outcome and reason."""
        verdict = self.runner.run()
        return verdict.outcome.value, verdict.reason

    @property
    def sent(self) -> str:
        """The first letters of the sent movements, without repetitions."""
        names = (type(command.movement).__name__[0] for command in self.drone.commands)
        return "".join(name for name, _ in itertools.groupby(names))

    @property
    def landed(self) -> bool:
        return self.drone.state.flying is FlyingState.LANDED


def tree_of(body: str) -> MissionTree:
    return parse_tree(document(body), REGISTRY)


@pytest.fixture(autouse=True)
def _forget() -> None:
    HALTED.clear()


def stop(runner: MissionRunner, why: str = "stop") -> None:
    runner.abort.request(why)


def take(runner: MissionRunner, *, manual: bool = True) -> None:
    runner.manual = manual


hand_back = partial(take, manual=False)
stop_again = partial(stop, why="second")


def cut(runner: MissionRunner) -> None:
    runner.abort.cut_motors("a person cut the motors")


def give_up(runner: MissionRunner) -> None:
    stop(runner)
    runner.abort.give_up()


WAIT = "<Sequence><Up/><Wait/></Sequence>"
FOR_EVER = "<Sequence><Up/><Drift/></Sequence>"
ONCE = '<Sequence><Up/><Drift ticks="1"/><Wait/></Sequence>'
FAILS = '<Sequence><Up/><Drift ticks="2" fails="true"/></Sequence>'
AWAY = '<Sequence><Up/><Drift ticks="2"/></Sequence>'
ROUND = '<Sequence><Up/><Drift ticks="15"/><Down/></Sequence>'
LONG = '<Sequence><Up/><Drift ticks="200"/><Down/></Sequence>'


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


def after(seconds: float, **changes: Any) -> ScriptedDrone:
    return Told(between(seconds, math.inf, **changes))


CUT = FlyingState.EMERGENCY
PILOT = {"pilot_has_control": True}
NAN = "its height is nan"
THERE_AND_BACK = "TVRVLH"


# Body, drone, what a person does by tick, verdict, movements.
@pytest.mark.parametrize(
    ("body", "drone", "acts", "verdict", "sent"),
    [
        (ROUND, None, {}, "success: landed", "TVLH"),
        (ONCE, None, {}, "timeout: not over after 30 s", "TVHL"),
        (FOR_EVER, Told(no_frame), {}, "aborted: no usable frame for 15 s", "THL"),
        (FOR_EVER, after(1.0, flying=CUT), {}, "aborted: the drone cut its motors", ""),
        (FOR_EVER, None, {12: stop}, "aborted: stop", "TVL"),
        (FOR_EVER, None, {12: stop, 13: stop_again}, "aborted: stop", "TVL"),
        ("<Wait/>", None, {3: stop}, "aborted: stop", "H"),
        (AWAY, None, {}, "aborted: the tree ended with SUCCESS in the air", "TVHL"),
        (FAILS, None, {}, "aborted: the tree ended with FAILURE in the air", "TVHL"),
        (FOR_EVER, after(1.0, battery=0.08), {}, "aborted: critical battery: 8 %", "TVL"),
        (ROUND, Told(between(1.0, 1.5, **PILOT)), {}, "success: landed", THERE_AND_BACK),
        (FOR_EVER, Told(between(1.0, 3.0, **PILOT)), {12: stop}, "aborted: stop", "TVRL"),
        (ROUND, None, {8: take, 28: hand_back}, "success: landed", THERE_AND_BACK),
        (FOR_EVER, None, {8: take, 12: cut}, "aborted: a person cut the motors", "TVRC"),
        (FOR_EVER, Told(of_frame(1.0)), {}, "aborted: no usable frame for 15 s", "TVHL"),
        (LONG, Told(between(1.0, 5.0, captured_s=1.0)), {}, "success: landed", "TVHVLH"),
        (LONG, Implausible(1), {}, "success: landed", ""),
        (LONG, Implausible(8), {}, f"aborted: no usable telemetry for 11 s: {NAN}", ""),
    ],
)  # fmt: skip
def test_each_flight_ends_with_its_verdict(
    body: str, drone: ScriptedDrone | None, acts: Acts, verdict: str, sent: str
) -> None:
    flight = Flight(body, drone, acts=acts, time_limit_s=30.0)
    assert ": ".join(flight.fly()) == verdict
    assert flight.sent == sent or not sent
    assert flight.landed or "cut" in verdict
    pauses = sum(record.override is Override.MANUAL for record in flight.records)
    steered = sum(isinstance(command.movement, Velocity) for command in flight.drone.commands)
    if sent == THERE_AND_BACK:  # the mission pauses meanwhile: its leaf keeps its remaining ticks
        assert (pauses, steered) == (20 if acts else 4, 15)
    if body == ONCE:
        assert steered == 1  # a proposal does not survive its tick


# --- a tick -----------------------------------------------------------------------------------


def test_a_tick_has_its_events() -> None:
    """Of the tree, the arbiter and the drone; each once."""
    body = '<Fallback name="f"><Sequence name="s"><Up/><Drift ticks="30" fails="true"/></Sequence>'
    flight = Flight(f"{body}<Down/></Fallback>", acts={12: take, 14: hand_back})
    flight.fly()
    told = [(event.kind.value, event.node) for event in flight.context.notes.events]
    assert told == [
        ("phase", "Main/f/s/Up"), ("phase", "Main/f/s/Drift"), ("pilot", ""), ("pilot over", ""),
        ("failed", "Main/f/s/Drift"), ("phase", "Main/f/Down"), ("landed", ""),
        ("ended", "Main/f/Down"),
    ]  # fmt: skip
    of_ticks = [event for record in flight.records for event in record.events]
    assert of_ticks == flight.context.notes.events


def test_a_tick_observes_then_thinks_then_sends_then_tells_then_waits() -> None:
    """Each tick observes the effect of the last command; leaves see one time within it."""
    calls: list[str] = []

    def observe(seen: Observation, now_s: float) -> Observation:
        calls.append(f"observe {now_s:.1f}")
        return seen

    def send(command: Command) -> Command:
        calls.append("send")
        return command

    class Thinks(Leaf):
        def update(self) -> Status:
            calls.append(f"think {self.clock.now():.1f}")
            drone.clock.advance(0.03)  # as a real clock would
            calls.append(f"think {self.clock.now():.1f}")
            return Status.RUNNING

    drone = Told(observe, send)
    tells = [At(index, lambda: calls.append("tell")) for index in (0, 1)]
    Flight(Thinks(), drone, listeners=tells, acts={1: stop}).fly()
    assert calls[:10] == [
        "observe 0.0", "think 0.0", "think 0.0", "send", "tell",
        "observe 0.1", "think 0.1", "think 0.1", "send", "tell",
    ]  # fmt: skip


@pytest.mark.parametrize("lost", [Override.STALE_FRAME, Override.LINK])
def test_a_hover_without_frames_or_telemetry_is_held_against_the_known_drift(
    lost: Override,
) -> None:
    old = between(10.0, math.inf, captured_s=10.0) if lost is Override.LINK else of_frame(10.0)
    body = f"<ReactiveSequence><Track/>{WAIT}</ReactiveSequence>"
    flight = Flight(body, Told(old), time_limit_s=15.0)
    flight.fly()
    flown = [record.command.movement for record in flight.records if record.override is lost]
    assert len(flown) > 20
    assert all(isinstance(one, Velocity) and one.forward_mps < -0.05 for one in flown)


def test_a_record_holds_what_was_really_sent() -> None:
    """The drone returns the command that it executes within its limits."""
    slow = Velocity(forward_mps=0.1)

    def limited(command: Command) -> Command:
        moves = isinstance(command.movement, Velocity)
        return replace(command, movement=slow) if moves else command

    flight = Flight(FOR_EVER, Told(send=limited), time_limit_s=2.0)
    flight.fly()
    record = next(record for record in flight.records if record.command.movement == slow)
    assert record.decided == Command(movement=Velocity(forward_mps=0.5))
    told = (record.phase, record.feedback, record.active[-1], record.proposed_by)
    assert told == ("drift", "drifts", "Drift", "Main/Sequence/Drift")


# --- faults -----------------------------------------------------------------------------------


def test_a_leaf_that_raises_stops_the_tree_lands_and_is_named() -> None:
    flight = Flight(
        '<Sequence name="mission"><Up/><Drift ticks="2"/>'
        '<ParallelAll><Wait name="beside"/><Break name="bad"/></ParallelAll></Sequence>'
    )
    with pytest.raises(NodeFailedError, match="LookupError: no such thing") as caught:
        flight.fly()
    assert caught.value.node_path == "Main/mission/ParallelAll/bad"
    assert isinstance(caught.value.__cause__, LookupError)
    assert flight.landed
    assert flight.tree.root.node_status is Status.IDLE
    assert HALTED == ["Main/mission/ParallelAll/beside"]
    assert flight.sent == "TVL"


def test_a_leaf_that_raises_when_it_is_halted_does_not_keep_the_drone_up() -> None:
    flight = Flight("<Sequence><Up/><Clumsy/></Sequence>", time_limit_s=1.0)
    with pytest.raises(NodeFailedError, match="cannot let go"):
        flight.fly()
    assert flight.landed


def test_a_listener_that_raises_is_left_out_and_the_flight_goes_on() -> None:
    """A failed display or a full disk does not end a flight."""

    def fail() -> None:
        raise OSError("disk full")

    ticks = Records()
    flight = Flight(ROUND, listeners=(At(9, fail), At(10, fail), ticks))
    assert flight.fly() == ("success", "landed")
    assert flight.runner.listeners.lost == dict.fromkeys(("At", "At#2"), "OSError: disk full")
    assert len(ticks) == len(flight.records) > 10


def test_an_interrupt_that_gets_through_lands_the_drone() -> None:
    def interrupt(_: MissionRunner) -> None:
        raise KeyboardInterrupt  # not an Exception, so the runner does not catch it

    flight = Flight(FOR_EVER, acts={9: interrupt})
    with pytest.raises(KeyboardInterrupt):
        flight.fly()
    assert flight.landed


def test_when_landing_fails_too_the_first_fault_is_reported() -> None:
    def refuse(command: Command) -> Command:
        if isinstance(command.movement, Land):
            raise DroneError("no answer")
        return command

    flight = Flight("<Sequence><Up/><Break/></Sequence>", Told(send=refuse))
    with pytest.raises(NodeFailedError, match="no such thing") as caught:
        flight.fly()
    assert caught.value.__notes__ == ["while landing, also: DroneError: no answer"]


def test_a_drone_that_does_not_land_is_given_up_after_the_grace_time() -> None:
    def stay(command: Command) -> Command:
        return Command(movement=Hover()) if isinstance(command.movement, Land) else command

    flight = Flight("<Sequence><Up/><Wait/></Sequence>", Told(send=stay), time_limit_s=1.0)
    assert flight.fly()[0] == "timeout"
    over_s = flight.records[-1].time_s
    assert flight.drone.clock.now() == pytest.approx(over_s + 2.0, abs=TICK_S)
    assert flight.runner.descent.airborne


class Faulty(ScriptedDrone):
    """Raises in a method, from the twelfth command to the last."""

    def __init__(self, method: str, last: float = math.inf) -> None:
        super().__init__()
        self.method, self.last = method, last

    def _fail(self, method: str) -> None:
        if method == self.method and 12 <= len(self.commands) < self.last:
            raise DroneError(f"{method} failed")

    def observe(self) -> Observation:
        self._fail("observe")
        return super().observe()

    def send(self, command: Command) -> Command:
        self.commands.append(command)
        self._fail("send")
        self.commands.pop()
        return super().send(command)


@pytest.mark.parametrize("method", ["observe", "send"])
def test_landing_is_asked_for_again_and_again_whatever_raises(method: str) -> None:
    flight = Flight(FOR_EVER, Faulty(method))
    with pytest.raises(DroneError, match=f"{method} failed"):
        flight.fly()
    asked = [c for c in flight.drone.commands[12:] if isinstance(c.movement, Land)]
    assert len(asked) == pytest.approx(2.0 / TICK_S, abs=2)  # during the whole grace time
    assert flight.runner.descent.airborne


def test_a_drone_that_recovers_while_it_is_brought_down_lands() -> None:
    flight = Flight(FOR_EVER, Faulty("send", last=18))
    with pytest.raises(DroneError, match="send failed"):
        flight.fly()
    assert flight.landed
    assert not flight.runner.descent.airborne


def test_a_clock_that_stands_still_does_not_keep_the_program() -> None:
    drone = Faulty("observe")
    still = At(11, lambda: setattr(drone.clock, "sleep_until", lambda _: None))
    flight = Flight(FOR_EVER, drone, listeners=(still,))
    with pytest.raises(DroneError, match="observe failed"):
        flight.fly()
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
        flight.fly()
    assert flight.landed
    assert len(Follows.seen) > 1
    assert all("no such thing" in reason for reason in Follows.seen)


def test_nobody_waits_for_a_landing_that_was_given_up() -> None:
    """It is still commanded, and the result says that the drone is in the air."""
    flight = Flight(FOR_EVER, acts={9: give_up})
    assert flight.fly() == ("aborted", "stop")
    assert flight.runner.descent.airborne
    assert isinstance(flight.drone.commands[-1].movement, Land)
    assert flight.records[-1].index <= 11


def test_an_abort_halts_the_tree_once() -> None:
    """`_onHalted` runs in the first tick of the abort only, however long the landing takes."""
    body = '<Sequence><Script code="halts := 0"/><Up/><Drift _onHalted="halts += 1"/></Sequence>'
    halts: list[object] = []
    flight = Flight(
        body, acts={12: stop, 13: lambda _: halts.append(flight.tree.variables["halts"])}
    )
    flight.fly()
    assert halts == [flight.tree.variables["halts"]] == [2]
    after = flight.records[13:]
    assert all(record.override is Override.ABORT for record in after)
    assert all(record.tree_status is Status.IDLE and not record.active for record in after)


@pytest.mark.parametrize(
    ("lost", "words", "until_s"),
    [
        (True, r"is broken: .*remote control", 2.0),
        (False, "nothing heard from the drone for 10 s", 12),
    ],
)
def test_only_a_connection_that_may_come_back_is_waited_for(
    *, lost: bool, words: str, until_s: float
) -> None:
    """When it is broken for good, the landing is commanded once: further ones cannot arrive."""
    flight = Flight(
        FOR_EVER, Told(between(2.0, math.inf, captured_s=2.0, connected=False, lost=lost))
    )
    with pytest.raises(DroneError, match=words):
        flight.fly()
    assert flight.drone.clock.now() == pytest.approx(until_s, abs=3.0 if not lost else 2 * TICK_S)
    assert flight.sent.endswith("L")
    assert not lost or flight.drone.commands[-2].movement != Land()
    assert flight.runner.descent.airborne is lost


# --- landings -----------------------------------------------------------------------------------

LANDS = "<ReactiveSequence><Track/><Sequence><Up/><Down/></Sequence></ReactiveSequence>"


class Sinking(ScriptedDrone):
    """Has a fault for 3 s, from the moment when it has descended to a height."""

    def __init__(self, fault: str, below_m: float) -> None:
        super().__init__()
        self.fault, self.below_m = fault, below_m
        self.first: Observation | None = None
        self.since = 0  # the number of commands then

    def observe(self) -> Observation:
        seen = super().observe()
        sinks = self.state.flying is FlyingState.FLYING and self.state.height_m <= self.below_m
        if self.first is None and sinks:
            self.first, self.since = seen, len(self.commands)
        if self.first is None or len(self.commands) > self.since + 3.0 / TICK_S:
            return seen
        return replace(seen, **{self.fault: getattr(self.first, self.fault)})


def test_a_landing_is_flown_down_to_the_drone_s_own() -> None:
    """2.6 s from 1 m to 0.2 m by velocities, then the drone's own; another tree waits for it."""
    flight = Flight(LANDS, then=dict.fromkeys(range(12, 60), FOR_EVER))
    assert flight.fly() == ("success", "landed")
    velocities = [c for c in flight.drone.commands if isinstance(c.movement, Velocity)]
    assert flight.sent == "TVLH"
    assert len(velocities) == pytest.approx(26, abs=2)


@pytest.mark.parametrize("height_m", [0.35, 0.8])
@pytest.mark.parametrize("old", ["frame", "state"])
def test_a_landing_goes_on_as_the_drone_s_own_where_data_are_old(old: str, height_m: float) -> None:
    """It neither hovers in ground effect nor returns to velocities when the data return."""
    flight = Flight(LANDS, Sinking(old, height_m))
    assert flight.fly() == ("success", "landed")
    assert flight.sent == "TVLH"
    since = flight.drone.since  # type: ignore[attr-defined]
    own = next(i for i, c in enumerate(flight.drone.commands) if c.movement == Land())
    assert own - since <= 8  # 0.7 s is the maximum age of a frame
    assert len(flight.records) < since + 40
    wanted = Override.LINK if old == "state" else Override.STALE_FRAME
    assert wanted in {record.override for record in flight.records}


# --- another tree in flight -------------------------------------------------------------------


def test_another_tree_begins_at_its_root_between_two_ticks() -> None:
    """The old tree is halted and proposes nothing more; drone, clock and board go on."""
    flight = Flight(FOR_EVER, then={9: '<Sequence name="second"><Wait/></Sequence>', 14: "<Down/>"})
    assert flight.fly() == ("success", "landed")
    assert flight.sent == "TVHLH"
    assert HALTED == ["Main/Sequence/Drift", "Main/second/Wait"]
    records = flight.records
    assert [record.active for record in records[8:10]] == [
        ("Sequence", "Drift"),
        ("second", "Wait"),
    ]
    assert [record.index for record in records] == list(range(len(records)))
    assert records[13].phase == "drift"


def test_leaves_go_on_from_those_of_their_class_and_the_old_ones_are_shut_down() -> None:
    two = '<Parallel success_count="2"><Count name="a"/><Count name="b"/></Parallel>'
    flight = Flight(
        f"<Sequence><Up/>{two}</Sequence>",
        acts={20: stop},
        then={9: '<Count name="c"/>', 14: two},
    )
    flight.drone.send(Command(movement=TakeOff()))
    Count.closed.clear()
    flight.fly()
    counts = [int(record.feedback) for record in flight.records if record.feedback.isdigit()]
    jumps = [after - before for before, after in itertools.pairwise(counts)]
    new = next(index for index, jump in enumerate(jumps) if jump != 1)
    assert jumps[:new] == [1] * new  # `c` continued from `a`, whose count equals that of `b`
    assert counts[new + 1] == 1  # the second `b` has no predecessor
    assert Count.closed == ["a", "b", "c"]


def test_no_other_tree_flies_once_the_mission_is_aborted() -> None:
    flight = Flight("<Sequence><Up/><Wait/></Sequence>", acts={8: stop}, then={9: FOR_EVER})
    assert flight.fly() == ("aborted", "stop")
    assert flight.asked == 9
    assert "V" not in flight.sent


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
        flight.fly()
    assert flight.landed
