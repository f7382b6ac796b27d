"""The runner: the order of a tick, its events, ends of missions, and changes of the tree."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import pytest

from tests.uav_bt.mission.runner_world import (
    FOR_EVER,
    HALTED,
    ROUND,
    WAIT,
    Acts,
    At,
    Count,
    Flight,
    Told,
    between,
    stop,
)
from tests.worlds.tables import cases
from uav_bt.board.context import MissionContext
from uav_bt.errors import NodeFailedError
from uav_bt.mission.runner import MissionRunner
from uav_bt.mission.safety import Override
from uav_bt.mission.tick import EventWatch
from uav_bt.testing import ScriptedDrone
from uav_bt.tree import Leaf, Status
from uav_bt.tree.scripted import ScriptedLeaf
from uav_bt.tree.watches import BranchEnds
from uav_bt.types import Command, Observation, TakeOff, Velocity
from uav_bt.types.drone_state import FlyingState


def of_frame(captured_s: float) -> Callable[[Observation, float], Observation]:
    """Return a video whose last frame is of a time."""

    def change(seen: Observation, now_s: float) -> Observation:
        frame = seen.frame
        if frame is None or now_s <= captured_s:
            return seen
        return replace(seen, frame=replace(frame, captured_s=captured_s))

    return change


def no_frame(seen: Observation, _: float) -> Observation:
    return replace(seen, frame=None)


def take(runner: MissionRunner, *, manual: bool = True) -> None:
    runner.manual = manual


hand_back = partial(take, manual=False)
stop_again = partial(stop, why="second")


def cut(runner: MissionRunner) -> None:
    runner.abort.cut_motors("a person cut the motors")


ONCE = '<Sequence><Up/><Drift ticks="1"/><Wait/></Sequence>'
FAILS = '<Sequence><Up/><Drift ticks="2" fails="true"/></Sequence>'
AWAY = '<Sequence><Up/><Drift ticks="2"/></Sequence>'
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
def test_a_hover_without_frames_or_telemetry_is_held_against_drift(lost: Override) -> None:
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


# --- events that no leaf reports ----------------------------------------------------------------

QUIET: dict[str, Any] = {"override": None, "refused": (), "landed": False, "ends": BranchEnds()}


@pytest.mark.parametrize(("ticks", "events"), cases("mission")["events"])
def test_a_change_is_an_event(ticks: list[dict[str, Any]], events: list[list[str]]) -> None:
    context = MissionContext()
    watch = EventWatch(context)
    for tick in ticks:
        watch.update(**QUIET | tick)
    assert [[event.kind.value, event.text] for event in context.notes.events] == events


def test_the_last_failure_is_kept_unless_the_tree_fails_with_a_reason() -> None:
    watch = EventWatch(MissionContext())
    lost, landing = ScriptedLeaf("lost"), ScriptedLeaf("landing")
    lost.feedback_message = "no way"
    watch.update(**QUIET | {"ends": BranchEnds(failed=(lost,))})
    watch.update(**QUIET | {"ends": BranchEnds(ended=landing)})
    assert watch.failure == "lost: no way"
    landing.feedback_message = "no ground"
    watch.update(**QUIET | {"ends": BranchEnds(ended=landing)})
    assert watch.failure == "landing: no ground"
