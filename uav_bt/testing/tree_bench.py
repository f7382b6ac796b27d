"""A test bench for a tree file: mocked leaves, ticks by hand, and a log of events."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Unpack

from uav_bt.testing.bench import BenchWorld
from uav_bt.testing.events import EventLog
from uav_bt.tree import MissionTree, NodeRegistry, Status
from uav_bt.tree import load_tree as load_mission
from uav_bt.tree import parse_tree as parse_mission
from uav_bt.tree.loading.loader import TreeOptions
from uav_bt.types import DroneState, GimbalTo, Movement

_SHOWN: Final = 40  # answers in a failure message; chosen


@dataclass(frozen=True, kw_only=True)
class TickOutcome:
    """The result of one tick."""

    tick: int  # counted from 1
    time_s: float  # of the mission clock
    status: Status  # of the root
    movement: Movement | None  # the movement proposed in this tick
    proposed_by: str | None  # the path of the leaf that proposed it
    gimbal: GimbalTo | None  # the camera direction proposed in this tick


class TreeBench(BenchWorld):
    """A tree with a board, a clock and a drone in the test's hands, and a log of its events.

        bench = load_tree("mission.xml", mocks={"TakeOff": "RRS", "Land": "S"})
        bench.tick_until(Status.SUCCESS, max_ticks=10)
        bench.log.assert_order("TakeOff succeeded", "Land started")

    Ticks are `tick_s` apart, as in a mission. The state that a test has given (`hover`, `observe`)
    is observed again before every tick, until `lose_telemetry`.
    """

    def __init__(self, tree: MissionTree, *, tick_s: float = 0.1) -> None:
        super().__init__(tree)
        self.tick_s = tick_s
        self.log = EventLog(tree, self.clock)
        self.outcomes: list[TickOutcome] = []
        # Called before each tick, after the time has advanced, to refresh values on the board.
        self.before_tick: Callable[[TreeBench], None] | None = None
        self._telemetry: DroneState | None = None

    def observe(self, state: DroneState) -> None:
        """Observe a state now and before every following tick."""
        self._telemetry = state
        super().observe(state)

    def lose_telemetry(self) -> None:
        """Observe no new state from now on; the last one gets old."""
        self._telemetry = None

    def advance(self, seconds: float) -> None:
        """Let time pass without a tick."""
        self.clock.advance(seconds)

    def tick(self) -> Status:
        """Tick the tree once and return the root's answer."""
        if self.outcomes:
            self.clock.advance(self.tick_s)
        if self._telemetry is not None:
            self.observe(self._telemetry.dated(self.clock.now()))
        self.log.tick += 1
        if self.before_tick is not None:
            self.before_tick(self)
        status = self._tick_tree()
        self.outcomes.append(
            TickOutcome(
                tick=self.log.tick,
                time_s=self.clock.now(),
                status=status,
                movement=self.proposed,
                proposed_by=self.mission.proposals.movement_owner,
                gimbal=self.pointed,
            )
        )
        return status

    def tick_until(self, status: Status, max_ticks: int) -> int:
        """Tick until the root answers a status, else fail; return the number of ticks."""
        __tracebackhide__ = True
        for count in range(1, max_ticks + 1):
            if self.tick() is status:
                return count
        answers = self.answers[-_SHOWN:]
        running = " > ".join(self.tree.active_path()) or "nothing"
        raise AssertionError(
            f"expected {status.name} within {max_ticks} ticks, the last answers were {answers}; "
            f"running: {running}\n{self.log.table()}"
        )

    @property
    def answers(self) -> str:
        """The root's answers until now, a letter per tick, as in scripts: R, S, F and K."""
        return "".join(outcome.status.letter for outcome in self.outcomes)


def load_tree(
    path: Path | str,
    registry: NodeRegistry | None = None,
    *,
    tick_s: float = 0.1,
    **options: Unpack[TreeOptions],
) -> TreeBench:
    """Put a tree file on a bench, with ticks `tick_s` apart.

    Options are `mocks` (scripts such as `RRS`, or `Mock`) and what `uav_bt.tree.parse_tree` takes.
    A refused file, or a mock that does not fit, raises a `TreeError`.
    """
    return TreeBench(load_mission(path, _nodes(registry), **options), tick_s=tick_s)


def parse_tree(
    source: str | bytes,
    registry: NodeRegistry | None = None,
    *,
    tick_s: float = 0.1,
    **options: Unpack[TreeOptions],
) -> TreeBench:
    """Put the text of a tree file on a bench; the other arguments are those of `load_tree`."""
    return TreeBench(parse_mission(source, _nodes(registry), **options), tick_s=tick_s)


def _nodes(registry: NodeRegistry | None) -> NodeRegistry:
    # A test may define policies: `bench.policies`.
    return (NodeRegistry.installed() if registry is None else registry).with_any_policy()
