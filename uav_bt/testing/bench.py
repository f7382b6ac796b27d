"""A test bench for one leaf: a strict board, a clock, policies and a drone around it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, TypeVar

from uav_bt.board import CAMERA, FRAME, HEIGHT, MISSION_KEYS, STATE
from uav_bt.board.blackboard import Blackboard, Key, Reading
from uav_bt.board.context import MissionContext
from uav_bt.board.keys import BATTERY_SHARE, FLYING, LINK_SHARE, UNKNOWN
from uav_bt.clock import ManualClock
from uav_bt.errors import BoardAccessError, InputError, MissionError, ValueRangeError, did_you_mean
from uav_bt.plugins import make_policy
from uav_bt.protocols import LeafPolicy
from uav_bt.testing.drone import blank_frame, pinhole
from uav_bt.tree import Leaf, MissionTree, Status
from uav_bt.tree.describe import ABILITIES
from uav_bt.types import BodyVelocity, DroneState, FlyingState, MovementState, MovementStatus
from uav_bt.types.commands import GimbalTo, MoveBy, Movement

T = TypeVar("T")


class StrictBlackboard(Blackboard):
    """A board that raises when a stale value or an undeclared key is read.

    In flight a stale value reads as None, and leaves must handle it. In a test it mostly means that
    the test forgot to refresh its board, and would pass for the wrong reason.

    The test itself has unrestricted access by key: `board[KEY]`.
    """

    allow_stale = False

    def read(self, key: Key[T]) -> Reading[T]:
        """Return a fresh value, or an empty reading if none was ever written."""
        declared = self._keys.get(key.name)
        if declared is None:
            raise BoardAccessError(
                f"board key '{key.name}' was never declared on this board"
                f"{did_you_mean(key.name, self._keys)}"
            )
        if declared != key:
            raise BoardAccessError(
                f"board key '{key.name}' was declared as {declared.type.__name__}, "
                f"and is read as another key, of {key.type.__name__}"
            )
        reading = super().read(key)
        if reading.value is None and reading.age_s < math.inf and not self.allow_stale:
            raise BoardAccessError(
                f"board key '{key.name}' is stale in this test: {reading.age_s:.2f} s old, at most "
                f"{key.max_age_s:.2f} s; write it again after advancing the clock, "
                "or set allow_stale to test how the leaf copes"
            )
        return reading

    def __setitem__(self, key: Key[T], value: T) -> None:
        """Write a value, captured at its `captured_s` or else now."""
        self.declare(key)
        self.write(key, value, captured_s=getattr(value, "captured_s", None))

    def __getitem__(self, key: Key[T]) -> T:
        """Return the last value, of any age; KeyError if there is none."""
        value: T = self._entries[key.name][0]
        return value

    def __contains__(self, key: Key[Any]) -> bool:
        """Return whether the key has a value."""
        return key.name in self._entries

    def __delitem__(self, key: Key[Any]) -> None:
        """Delete the key's value."""
        self.forget(key)


class BenchWorld:
    """A tree with everything that a tick needs, under the test's control."""

    def __init__(self, tree: MissionTree) -> None:
        self.clock = ManualClock()
        self.tree = tree
        self.variables = tree.variables  # for ports such as `{count}`
        self.policies: dict[str, LeafPolicy] = {}  # with precedence over the installed ones
        self.camera = pinhole()
        self.board = StrictBlackboard(self.clock, MISSION_KEYS)
        for leaf in tree.leaves():
            for key in (*leaf.reads, *leaf.writes):
                self.board.declare(key)
        self.mission = MissionContext(clock=self.clock, board=self.board, policy=self._policy)
        self.notes = self.mission.notes  # events and photographs
        self._frames = 0
        self._ready = False

    def provide(self, **fields: Any) -> None:
        """Set fields of the `MissionContext`, such as `outputs=FlightFolder(tmp_path)`."""
        self.mission = replace(self.mission, **fields)

    def allow_stale(self) -> None:
        """Let stale values read as None from now on, as in flight."""
        self.board.allow_stale = True

    # --- the drone --------------------------------------------------------------------------------

    def hover(
        self,
        *,
        height_m: float = 1.5,
        forward_mps: float = 0.0,
        right_mps: float = 0.0,
        down_mps: float = 0.0,
        battery_share: float = 1.0,
        link_share: float = 1.0,
        **state: Any,
    ) -> None:
        """Write the board values of a drone in the air with a black image, as the runner does.

        Heights are above the ground and the take-off point, velocities are along the heading and to
        its right, shares 0 to 1. A drone with a velocity is FLYING. `state` has further fields of
        the `DroneState`, such as `gimbal_pitch_rad`.
        """
        for name, share in (("battery_share", battery_share), ("link_share", link_share)):
            if not 0.0 <= share <= 1.0:
                raise ValueRangeError(f"{name} must be 0 to 1, got {share}")
        velocity = BodyVelocity(forward_mps=forward_mps, right_mps=right_mps, down_mps=down_mps)
        told = {
            "flying": FlyingState.FLYING if any(vars(velocity).values()) else FlyingState.HOVERING,
            "velocity": velocity,
            "altitude_m": height_m,
            "height_m": height_m,
            "height_above_ground_m": height_m,
            "battery": battery_share,
            "link": link_share,
        }
        self.observe(DroneState(captured_s=self.clock.now(), **{**told, **state}))

    def observe(self, state: DroneState) -> None:
        """Write a state, its numbers, and a new black frame with the same telemetry."""
        self.board[STATE] = state
        self.board[BATTERY_SHARE] = UNKNOWN if state.battery is None else state.battery
        self.board[LINK_SHARE] = UNKNOWN if state.link is None else state.link
        self.board[FLYING] = float(state.in_air)
        self.board[HEIGHT] = state.height_above_ground_m
        self.board[CAMERA] = self.camera
        self.board[FRAME] = blank_frame(self.camera, state, index=self._frames)
        self._frames += 1

    def finish_movement(self, state: MovementState = MovementState.DONE) -> None:
        """Report the end of the `MoveBy` that was proposed in the last tick."""
        move = self.proposed
        if not isinstance(move, MoveBy):
            raise MissionError(f"no MoveBy was proposed in the last tick, but {move}")
        if STATE not in self.board:
            self.hover()
        status = MovementStatus(id=move.id, state=state)
        self.observe(replace(self.board[STATE].dated(self.clock.now()), movement=status))

    @property
    def proposed(self) -> Movement | None:
        """The movement proposed in the last tick."""
        return self.mission.proposals.movement

    @property
    def pointed(self) -> GimbalTo | None:
        """The camera direction proposed in the last tick."""
        return self.mission.proposals.gimbal

    # --- the tree ---------------------------------------------------------------------------------

    def setup(self) -> None:
        """Set the tree up; otherwise the first tick does."""
        self.tree.setup(self.mission)
        self._ready = True

    def _tick_tree(self) -> Status:
        """Tick; raise MissionError if a leaf proposed what its class does not declare."""
        if not self._ready:
            self.setup()
        proposals = self.mission.proposals
        proposals.clear()
        status = self.tree.tick()
        asked = (("moves", proposals.movement_owner), ("points", proposals.gimbal_owner))
        for attribute, owner in asked:
            leaf = next((leaf for leaf in self.tree.leaves() if leaf.path == owner), None)
            if leaf is not None and not getattr(leaf, attribute):
                raise MissionError(
                    f"leaf '{owner}' {ABILITIES[attribute]} in this tick without declaring it: "
                    f"write `{attribute} = True` in the class {type(leaf).__qualname__}"
                )
        return status

    def halt(self) -> None:
        """Halt the running nodes, as a parent or the operator does."""
        self.tree.halt()

    def _policy(self, name: str) -> LeafPolicy:
        return self.policies[name] if name in self.policies else make_policy(name)


class LeafBench(BenchWorld):
    """A bench for a single leaf.

        bench = LeafBench(Explore, policy="segmentation")
        bench.hover(height_m=1.5)
        bench.board[CLASS_MAP] = class_map
        assert bench.tick() is Status.RUNNING
        assert bench.proposed == MoveBy(id=1, forward_m=0.3)
        bench.finish_movement()

    Attributes are as in a tree file, or typed. Access to the board that is undeclared, mistyped or
    stale raises `NodeFailedError` from `BoardAccessError`.
    """

    def __init__(self, leaf: type[Leaf], /, **attributes: object) -> None:
        if isinstance(leaf, Leaf):
            name = type(leaf).__name__
            raise InputError(f"expected a leaf's class, got an object of it: LeafBench({name})")
        self.leaf = leaf(None, **attributes)
        super().__init__(MissionTree(self.leaf, name="Bench"))

    def tick(self, advance_s: float = 0.0) -> Status:
        """Let time pass, tick the leaf once and return its answer."""
        self.clock.advance(advance_s)
        return self._tick_tree()

    @property
    def feedback(self) -> str:
        """The leaf's text for the status line."""
        return str(self.leaf.feedback_message)
