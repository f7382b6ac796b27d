"""The runner: observes, ticks, arbitrates and sends until the flight has ended."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from uav_bt.board import CAMERA, ELAPSED, FRAME, HEIGHT, ODOMETRY, SITE_MAP, STATE
from uav_bt.board.context import MissionContext
from uav_bt.clock import TickClock
from uav_bt.errors import NodeFailedError
from uav_bt.mission.contingencies import Abort, Contingencies, Descent
from uav_bt.mission.ground_height import GroundHeight
from uav_bt.mission.judge import Judge, Verdict
from uav_bt.mission.limits import Limits
from uav_bt.mission.mission_numbers import MissionNumbers, Whereabouts
from uav_bt.mission.position_hold import PositionHold
from uav_bt.mission.safety import Arbiter, Circumstances
from uav_bt.mission.screening import FrameJudge, Screening
from uav_bt.mission.tick import EventWatch, TickListener, TickListeners, TickRecord
from uav_bt.protocols import Drone
from uav_bt.settings import check_numbers
from uav_bt.tree import MissionTree, Status
from uav_bt.tree.watches import BranchWatch, BudgetWatch
from uav_bt.types import Command, DroneState, FlyingState, Hover, Land, Observation, TakeOff

NextTree = Callable[[], MissionTree | None]
"""Called between two ticks: returns a new tree, set up, or None to keep the present one."""


@dataclass(frozen=True, kw_only=True)
class RunnerConfig:
    """Pace of a mission, and its longest landing.

    Attributes:
        tick_s: length of a tick, seconds; the drone's own `tick_s` replaces it. Chosen: three
            frames of a video of 30 Hz, and time for the networks (`benchmarks/timing.py pipeline`).
        landing_grace_s: longest duration of a landing after a fault or an abort, seconds; then the
            drone is left to its firmware. Chosen: 8 m of descent with the twin's 0.5 m/s, and a
            margin.

    Raises:
        ValueRangeError: a time is not positive, or the tick is longer than a second.
    """

    tick_s: float = 0.1
    landing_grace_s: float = 20.0

    def __post_init__(self) -> None:
        check_numbers(self, most={"tick_s": 1.0})


class MissionRunner:
    """Flies one tree with one drone, once.

    Args:
        drone: the connected drone.
        tree: the tree, set up for the context.
        context: the board, proposals and settings that the leaves were set up with.
        judge: decides when and how the flight has ended.
        limits: of every command.
        config: pace and landing.
        listeners: called after every tick.
        judge_frame: returns why a frame's image cannot be flown by; None trusts all images.
        next_tree: called between two ticks for a tree that replaces the present one.

    Attributes:
        abort: ends the mission early; safe to use from a signal handler or another thread.
        manual: whether a person took over, safe to set from another thread: from the next tick
            nothing is sent and the tree is not ticked; after the hand-back it resumes. A pilot who
            takes the drone's remote control has the same effect.
        budgets: the leaves that blocked, including the last halt.
        descent: the landing after the last tick.
    """

    def __init__(
        self,
        drone: Drone,
        tree: MissionTree,
        context: MissionContext,
        judge: Judge,
        *,
        limits: Limits | None = None,
        config: RunnerConfig | None = None,
        listeners: Sequence[TickListener] = (),
        judge_frame: FrameJudge | None = None,
        next_tree: NextTree | None = None,
    ) -> None:
        self._drone = drone
        self._tree = tree
        self._context = context
        self._judge = judge
        config, limits = config or RunnerConfig(), limits or Limits()
        self._tick_s = config.tick_s
        self._arbiter = Arbiter(
            limits, drone.airframe, area=context.area, grounded=judge.stays_grounded
        )
        self._whereabouts = Whereabouts(context.board, context.area)
        self._numbers = MissionNumbers(context.board, context.notes, self._whereabouts, judge)
        self.listeners = TickListeners(listeners)
        self._next_tree = next_tree
        self._screening = Screening(drone.camera, judge_frame)
        self._height = GroundHeight()
        self._contingencies = Contingencies(limits)
        self._hold = PositionHold(drone.airframe)
        self.budgets = BudgetWatch(tree)
        self._branches = BranchWatch(tree)
        self._is_halted = True  # the tree: not ticked since the last halt
        self._events = EventWatch(context)
        self._index = 0
        self.abort = Abort(config.landing_grace_s)
        self.manual = False
        self.descent = Descent(drone, self._landing_command, self.abort, self._tick_s)

    def run(self) -> Verdict:
        """Fly until the mission has ended and return the verdict.

        Raises:
            NodeFailedError: a leaf raised; the tree was stopped and the drone landed first.
            DroneError: the drone was lost; a landing was commanded first.
        """
        verdict: Verdict | None = None
        try:
            while verdict is None:
                verdict = self._tick()
        except BaseException as fault:
            try:
                self._stop_and_land(str(fault) or type(fault).__name__)
            except Exception as second:  # noqa: BLE001  # the first fault is the one to report
                fault.add_note(f"while landing, also: {type(second).__name__}: {second}")
            for trouble in self.descent.faults:
                fault.add_note(f"while landing, also: {trouble}")
            raise
        self._stop_and_land(verdict.reason)
        return verdict

    def _tick(self) -> Verdict | None:
        """Fly one tick, record and judge it, and wait for the next one."""
        if not (self.abort or self._arbiter.landing):  # another tree would cancel a landing
            self._renew_tree()
        clock, shown = self._drone.clock, self._context.clock
        # A clock that runs on is shown to the leaves as one that stands still within a tick.
        start_s = shown.begin_tick() if isinstance(shown, TickClock) else clock.now()
        record = self._flown(start_s)
        self.listeners.on_tick(record)
        self._index += 1
        verdict = self._verdict(record)
        if verdict is None:
            site_map = self._context.board.read(SITE_MAP).value
            trouble = self._contingencies.abort_reason(
                record, self._screening, self._hold.trouble, site_map
            )
            if trouble is not None:
                self.abort.request(trouble)
            clock.sleep_until(start_s + self._tick_s)
        return verdict

    def _flown(self, start_s: float) -> TickRecord:
        """Observe, check, write the board, tick, arbitrate, send; return the tick's record."""
        usable = self._screening.usable(self._drone.observe(), start_s)
        observation = self._height.corrected(usable, start_s)
        self._write_board(observation, start_s)
        status, compute_s = self._run_tree(observation.state)
        decided = self._arbitrate(observation, start_s)
        sent = self._drone.send(decided)
        if isinstance(sent.movement, TakeOff):
            self._judge.took_off(start_s)
        active = self._tree.active_nodes()
        override, refused = self._arbiter.override, self._screening.refused
        landed = observation.state.flying is FlyingState.LANDED
        self._events.update(override, refused, self._branches.take(), landed=landed)
        return TickRecord(
            index=self._index,
            time_s=start_s,
            observation=observation,
            tree_status=status,
            phase=self._events.phase,
            active=tuple(node.name for node in active),
            command=sent,
            proposed_by=self._context.proposals.movement_owner,
            override=override,
            compute_s=compute_s,
            truth=self._drone.referee.truth() if self._drone.referee else None,
            feedback=active[-1].feedback_message if active else "",
            slow=self.budgets.take(),
            refused=refused,
            decided=decided,
            warnings=(
                *self._screening.warnings,
                *self._hold.watch.warnings,
                *self._contingencies.map.warnings,
            ),
            events=self._context.notes.take(),
        )

    # --- the tree ---------------------------------------------------------------------------------

    def _renew_tree(self) -> None:
        """Halt the tree for the next one, which begins at its root, on the same board.

        Its leaves may inherit the state of the old ones. Then the old tree is shut down.
        """
        tree = None if self._next_tree is None else self._next_tree()
        if tree is None:
            return
        self._halt_tree()
        former, self._tree = self._tree, tree
        self.budgets.follow(tree)
        self._branches.follow(tree)
        tree.inherit(former)
        former.shutdown()

    def _run_tree(self, state: DroneState) -> tuple[Status, float]:
        """Tick the tree; it is not ticked while a person flies, and is halted by an abort.

        Returns:
            The tree's status, and the wall time of its tick in seconds.
        """
        self._context.proposals.clear()
        status, began_s = Status.IDLE, time.perf_counter()
        if not self.abort:
            rests = self.manual or state.pilot_has_control
            status = Status.RUNNING if rests else self._tick_tree()
        compute_s = time.perf_counter() - began_s
        if self.abort:
            self._halt_tree()
        return status, compute_s

    def _tick_tree(self) -> Status:
        self._is_halted = False
        try:
            return self._tree.tick()
        except NodeFailedError:
            self._is_halted = True  # it has halted itself
            raise

    def _halt_tree(self) -> None:
        """Halt the tree once: each further halt would run its `_onHalted` scripts again."""
        if not self._is_halted:
            self._is_halted = True
            self._tree.halt()

    # --- the parts of a tick ----------------------------------------------------------------------

    def _write_board(self, observation: Observation, now_s: float) -> None:
        board, state = self._context.board, observation.state
        board.write(STATE, state, captured_s=state.captured_s)
        board.write(HEIGHT, state.height_above_ground_m, captured_s=state.captured_s)
        board.write(ELAPSED, self._judge.elapsed(now_s))
        board.write(CAMERA, self._drone.camera)
        if observation.frame is not None:
            board.write(FRAME, observation.frame, captured_s=observation.frame.captured_s)
        self._numbers.write(observation, now_s)

    def _arbitrate(self, observation: Observation, now_s: float) -> Command:
        frame, state = observation.frame, observation.state
        now = Circumstances(
            state=state,
            frame_age_s=math.inf if frame is None else now_s - frame.captured_s,
            state_age_s=now_s - state.captured_s,
            abort=bool(self.abort),
            manual=self.manual,
            cut=self.abort.cut,
            place=self._whereabouts.update(),
        )
        motion = self._context.board.read(ODOMETRY).value
        correct = partial(self._hold.correct, state=state, motion=motion, now_s=now_s)
        hover = partial(self._hold.against_drift, Hover(), state, now_s)
        command = self._arbiter.decide(self._context.proposals, now, correct, hover)
        self._hold.sent(command.movement, motion, now_s, rests=not self._arbiter.is_held)
        return command

    def _verdict(self, record: TickRecord) -> Verdict | None:
        verdict = self._judge.verdict(
            record,
            abort_reason=self.abort.reason,
            landing=self._arbiter.landing,
            mark_m=self._whereabouts.mark_m(),
            place=self._whereabouts.place,
            failure=self._events.failure,
        )
        given_up = self.abort.follow(record)
        over = record.tree_status in (Status.SUCCESS, Status.FAILURE)
        if over and record.observation.state.flying is not FlyingState.LANDED:
            self.abort.request(f"the tree ended with {record.tree_status.name} in the air")
        return verdict or given_up

    def _stop_and_land(self, reason: str) -> None:
        """Halt the tree, and bring the drone down if it is still up.

        Raises:
            NodeFailedError: a leaf raised when it was halted; the drone was landed.
        """
        try:
            self._halt_tree()
        finally:
            self._context.proposals.clear()
            self.descent.run(reason, self.listeners.following)

    def _landing_command(self, state: DroneState | None) -> Command:
        if state is None:
            return Command(movement=Land())
        now = Circumstances(state=state, abort=True, manual=self.manual, cut=self.abort.cut)
        return self._arbiter.decide(self._context.proposals, now)
