"""What fails in flight: the drone is brought down, and the first fault is reported."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import ClassVar

import pytest

from tests.uav_bt.mission.runner_world import (
    FOR_EVER,
    HALTED,
    ROUND,
    TICK_S,
    WAIT,
    At,
    Flight,
    Records,
    Told,
    between,
    stop,
)
from uav_bt.errors import DroneError, NodeFailedError
from uav_bt.mission.hold_model import HeldLanding
from uav_bt.mission.runner import MissionRunner
from uav_bt.mission.safety import Override
from uav_bt.testing import ScriptedDrone
from uav_bt.tree import Status
from uav_bt.types import Command, Hover, Land, Observation, Velocity
from uav_bt.types.drone_state import DroneState, FlyingState


def give_up(runner: MissionRunner) -> None:
    stop(runner)
    runner.abort.give_up()


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

    flight = Flight(WAIT, Told(send=stay), time_limit_s=1.0)
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
def test_only_what_may_come_back_is_waited_for(*, lost: bool, words: str, until_s: float) -> None:
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


def test_the_speed_of_a_landing_follows_the_height_until_it_does_not_sink() -> None:
    """0.6 per second: 0.45 m/s from 0.75 m up, 0.3 m/s at 0.5 m, 0.2 m/s from 0.33 m down."""
    landing = HeldLanding(2.0)
    speeds = [landing.order(height_m, 0.0) for height_m in (2.0, 0.75, 0.5, 0.3, 0.2)]
    assert speeds == [0.45, pytest.approx(0.45), pytest.approx(0.3), 0.2, None]
    for begin_m, after_s in ((1.5, 5.0), (3.0, 10.0)):  # 1.5 times the height at 0.45 m/s
        landing, ticks = HeldLanding(begin_m), 0
        while landing.order(begin_m, TICK_S) is not None:
            ticks += 1
        assert ticks * TICK_S == pytest.approx(after_s, abs=2 * TICK_S)
