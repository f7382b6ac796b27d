"""Leaves, drones and flights for the tests of the runner."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, Self

from tests.worlds import values
from tests.worlds.trees import document
from uav_bt.board import FRAME, ODOMETRY, PHASE, STATE
from uav_bt.board.context import MissionContext
from uav_bt.clock import TickClock
from uav_bt.mission.judge import Judge, JudgeConfig
from uav_bt.mission.runner import MissionRunner, RunnerConfig
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.testing import ScriptedDrone
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Port, Status, parse_tree
from uav_bt.types import Command, Land, MoveBy, Observation, TakeOff, Velocity
from uav_bt.types.dead_reckoning import OdometryPose
from uav_bt.types.drone_state import BodyVelocity, FlyingState
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


class Wait(Leaf):
    """Runs for ever without a proposal."""

    def update(self) -> Status:
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        if new_status is Status.IDLE:
            HALTED.append(self.path)


class Drift(Wait):
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


def between(begin_s: float, end_s: float, **changes: Any) -> Callable[..., Observation]:
    """Return a change of the state between two times."""
    return lambda seen, now_s: (
        replace(seen, state=replace(seen.state, **changes)) if begin_s < now_s < end_s else seen
    )


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
        HALTED.clear()
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


def stop(runner: MissionRunner, why: str = "stop") -> None:
    runner.abort.request(why)


WAIT = "<Sequence><Up/><Wait/></Sequence>"
FOR_EVER = "<Sequence><Up/><Drift/></Sequence>"
ROUND = '<Sequence><Up/><Drift ticks="15"/><Down/></Sequence>'
