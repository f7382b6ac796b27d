"""A workbench for one leaf: a board to write on, a clock to advance, proposals to look at."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any, TypeVar

from uav_bt import plugins
from uav_bt.board import CAMERA, FRAME, HEIGHT, MISSION_KEYS, STATE
from uav_bt.clock import ManualClock
from uav_bt.errors import BoardAccessError, MissionError
from uav_bt.mission.arbiter import Proposals
from uav_bt.mission.blackboard import Blackboard, Key, Reading
from uav_bt.mission.context import MissionContext
from uav_bt.protocols import Clock, LeafPolicy, Segmenter
from uav_bt.testing.drone import blank_frame, pinhole
from uav_bt.tree import Leaf, MissionTree, Status
from uav_bt.types import (
    DroneState,
    FlyingState,
    GimbalTo,
    MoveBy,
    Movement,
    MovementState,
    MovementStatus,
)

__all__ = ["BenchBoard", "LeafBench", "StrictBlackboard"]

T = TypeVar("T")


class StrictBlackboard(Blackboard):
    """A board on which reading a stale value is an error.

    In flight a stale value reads as none, and a leaf copes. In a test it mostly means that the test
    forgot to refresh its board, and would pass for the wrong reason.
    """

    def __init__(self, clock: Clock, keys: Iterable[Key[Any]]) -> None:
        super().__init__(clock, keys)
        self.allow_stale = False

    def read(self, key: Key[T]) -> Reading[T]:
        """Return a fresh value, or a reading of nothing for one that was never written.

        Raises:
            BoardAccessError: the value is stale and `allow_stale` is False.
        """
        reading = super().read(key)
        if reading.value is None and reading.age_s < math.inf and not self.allow_stale:
            raise BoardAccessError(
                f"board key '{key.name}' is stale in this test: {reading.age_s:.2f} s old, at most "
                f"{key.max_age_s:.2f} s; write it again after advancing the clock, "
                "or set allow_stale to test how the leaf copes"
            )
        return reading


class BenchBoard:
    """The test's own access to the board: everything, by key."""

    def __init__(self, board: Blackboard) -> None:
        self._board = board

    def __setitem__(self, key: Key[T], value: T) -> None:
        """Write as whoever writes that key would, captured now or when the value itself says.

        Raises:
            BoardAccessError: the value has another type than the key.
        """
        self._board.declare(key)
        self._board.write(key, value, captured_s=getattr(value, "captured_s", None))

    def __getitem__(self, key: Key[T]) -> T:
        """Return what was written last, however old.

        Raises:
            KeyError: nothing was.
        """
        value: T = self._board.snapshot()[key.name][0]
        return value

    def __contains__(self, key: Key[Any]) -> bool:
        """Return whether the key holds anything."""
        return key.name in self._board.snapshot()

    def __delitem__(self, key: Key[Any]) -> None:
        """Drop what the key holds."""
        self._board.forget(key)


class LeafBench:
    """One leaf, alone.

        bench = LeafBench(Explore, policy="segmentation")
        bench.hover(height_m=1.5)
        bench.board[CLASS_MAP] = class_map
        assert bench.tick() is Status.RUNNING
        assert bench.proposed == MoveBy(id=1, forward_m=0.3)
        bench.finish_movement()

    Whatever a leaf must not do fails the test: undeclared, mistyped or stale reading and writing
    raise `NodeFailedError` from `BoardAccessError`.

    Args:
        leaf: the leaf's class.
        attributes: its attributes, as in a tree file or typed.
    """

    def __init__(self, leaf: type[Leaf], /, **attributes: object) -> None:
        self.clock = ManualClock()
        self.leaf = leaf(None, **attributes)
        self.tree = MissionTree(self.leaf, name="Bench")
        self.policies: dict[str, LeafPolicy] = {}  # ahead of the installed ones
        self.segmenter: Segmenter | None = None
        self.seed = 0
        self.camera = pinhole()
        self.strict_board = StrictBlackboard(self.clock, MISSION_KEYS)
        for key in (*leaf.reads, *leaf.writes):
            self.strict_board.declare(key)
        self.board = BenchBoard(self.strict_board)
        self.proposals = Proposals()
        self._frames = 0
        self._ready = False

    # --- the world around the leaf ----------------------------------------------------------------

    @property
    def variables(self) -> Any:
        """The tree's variables, for ports such as `{count}`."""
        return self.tree.variables

    def allow_stale(self) -> None:
        """From now on a stale value reads as none, as in flight."""
        self.strict_board.allow_stale = True

    def hover(self, *, height_m: float = 1.5, gimbal_pitch_rad: float = 0.0) -> None:
        """Write what the runner writes before each tick, for a drone that hovers and sees black."""
        self.observe(
            DroneState(
                captured_s=self.clock.now(),
                flying=FlyingState.HOVERING,
                altitude_m=height_m,
                height_m=height_m,
                height_above_carpet_m=height_m,
                gimbal_pitch_rad=gimbal_pitch_rad,
            )
        )

    def observe(self, state: DroneState) -> None:
        """Write a state, its heights, and a new black frame with the same telemetry."""
        self.board[STATE] = state
        self.board[HEIGHT] = state.height_above_carpet_m
        self.board[CAMERA] = self.camera
        self.board[FRAME] = blank_frame(self.camera, state, index=self._frames)
        self._frames += 1

    def finish_movement(self, state: MovementState = MovementState.DONE) -> None:
        """Let the drone say how the movement that the leaf proposed last has ended.

        Raises:
            MissionError: the leaf proposed no `MoveBy` in the last tick.
        """
        move = self.proposed
        if not isinstance(move, MoveBy):
            raise MissionError(f"no MoveBy was proposed in the last tick, but {move}")
        if STATE not in self.board:
            self.hover()
        status = MovementStatus(id=move.id, state=state)
        self.observe(replace(self.board[STATE], captured_s=self.clock.now(), movement=status))

    # --- what the leaf does -----------------------------------------------------------------------

    def setup(self) -> None:
        """Set the leaf up; the first tick does so by itself.

        Raises:
            InputError: the leaf cannot use what it was given.
        """
        context = MissionContext(
            board=self.strict_board,
            clock=self.clock,
            proposals=self.proposals,
            policy=self._policy,
            seed=self.seed,
            segmenter=self.segmenter,
        )
        self.tree.setup(context)
        self._ready = True

    def tick(self, advance_s: float = 0.0) -> Status:
        """Forget the last tick's proposals, tick the leaf once and return its answer.

        Args:
            advance_s: how much time passes before.

        Raises:
            NodeFailedError: the leaf raised.
        """
        self.clock.advance(advance_s)
        if not self._ready:
            self.setup()
        self.proposals.clear()
        return self.tree.tick()

    def halt(self) -> None:
        """Halt the leaf, as a parent does that turns to another branch."""
        self.tree.halt()

    @property
    def proposed(self) -> Movement | None:
        """The movement proposed in the last tick."""
        return self.proposals.movement

    @property
    def pointed(self) -> GimbalTo | None:
        """The camera direction proposed in the last tick."""
        return self.proposals.gimbal

    @property
    def feedback(self) -> str:
        """What the status line would show."""
        message: str = self.leaf.feedback_message
        return message

    def _policy(self, name: str) -> LeafPolicy:
        if name in self.policies:
            return self.policies[name]
        policy: LeafPolicy = plugins.load(plugins.POLICIES, name)()
        return policy
