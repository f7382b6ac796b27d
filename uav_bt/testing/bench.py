"""A test bench for one leaf: a board, a clock, policies and a drone around it."""

from __future__ import annotations

from dataclasses import replace

from uav_bt.board import CAMERA, FRAME, HEIGHT, MISSION_KEYS, STATE
from uav_bt.board.context import MissionContext, Proposals
from uav_bt.board.flight_folder import FlightFolder
from uav_bt.board.flight_notes import FlightNotes
from uav_bt.board.numbers import BATTERY_SHARE, FLYING, LINK_SHARE, UNKNOWN
from uav_bt.clock import ManualClock
from uav_bt.errors import InputError, MissionError, ValueRangeError
from uav_bt.lab.shipped import default_mark
from uav_bt.plugins import make_policy
from uav_bt.protocols import LeafPolicy, Segmenter, Sight
from uav_bt.still_camera import StillCamera
from uav_bt.testing.board import BenchBoard, StrictBlackboard
from uav_bt.testing.drone import blank_frame, pinhole
from uav_bt.tree import Leaf, MissionTree, Status, Variables
from uav_bt.tree.describe import ABILITIES
from uav_bt.types import (
    Airframe,
    Attitude,
    BodyVelocity,
    Clearances,
    DroneState,
    FlyingState,
    GimbalTo,
    MoveBy,
    Movement,
    MovementState,
    MovementStatus,
    Pose2D,
)
from uav_bt.types.area import Area


class BenchWorld:
    """A tree with everything that a tick needs, under the test's control."""

    def __init__(self, tree: MissionTree) -> None:
        self.clock = ManualClock()
        self.tree = tree
        self.policies: dict[str, LeafPolicy] = {}  # with precedence over the installed ones
        self.segmenter: Segmenter | None = None
        self.sight: Sight | None = None  # of a drone without images
        self.stills: StillCamera | None = None  # of a drone that takes photographs
        self.outputs: FlightFolder | None = None  # such as FlightFolder(tmp_path)
        self.notes = FlightNotes()  # events and photographs
        self.mark, self.clearances = default_mark(), Clearances()
        self.airframe = Airframe()
        self.take_off: Pose2D | None = None  # in the lab's drawing
        self.mark_pose: Pose2D | None = None  # likewise
        self.area: Area | None = None
        self.seed = 0
        self.camera = pinhole()
        self.strict_board = StrictBlackboard(self.clock, MISSION_KEYS)
        for leaf in tree.leaves():
            for key in (*leaf.reads, *leaf.writes):
                self.strict_board.declare(key)
        self.board = BenchBoard(self.strict_board)
        self.proposals = Proposals()
        self._frames = 0
        self._ready = False

    @property
    def variables(self) -> Variables:
        """The tree's variables, for ports such as `{count}`."""
        return self.tree.variables

    def allow_stale(self) -> None:
        """Let stale values read as None from now on, as in flight."""
        self.strict_board.allow_stale = True

    # --- the drone --------------------------------------------------------------------------------

    def hover(
        self,
        *,
        height_m: float = 1.5,
        gimbal_pitch_rad: float = 0.0,
        attitude: Attitude | None = None,
        forward_mps: float = 0.0,
        right_mps: float = 0.0,
        down_mps: float = 0.0,
        battery_share: float = 1.0,
        link_share: float = 1.0,
        pilot_has_control: bool = False,
    ) -> None:
        """Write the board values of a drone in the air with a black image, as the runner does.

        Heights are above the ground and the take-off point, a negative pitch is down, velocities
        are along the heading and to its right, shares 0 to 1. A drone with a velocity is FLYING.
        """
        for name, share in (("battery_share", battery_share), ("link_share", link_share)):
            if not 0.0 <= share <= 1.0:
                raise ValueRangeError(f"{name} must be 0 to 1, got {share}")
        velocity = BodyVelocity(forward_mps=forward_mps, right_mps=right_mps, down_mps=down_mps)
        still = velocity == BodyVelocity()
        self.observe(
            DroneState(
                captured_s=self.clock.now(),
                flying=FlyingState.HOVERING if still else FlyingState.FLYING,
                attitude=attitude or Attitude(),
                velocity=velocity,
                altitude_m=height_m,
                height_m=height_m,
                height_above_ground_m=height_m,
                gimbal_pitch_rad=gimbal_pitch_rad,
                battery=battery_share,
                link=link_share,
                pilot_has_control=pilot_has_control,
            )
        )

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
        return self.proposals.movement

    @property
    def pointed(self) -> GimbalTo | None:
        """The camera direction proposed in the last tick."""
        return self.proposals.gimbal

    # --- the tree ---------------------------------------------------------------------------------

    def setup(self) -> None:
        """Set the tree up; otherwise the first tick does."""
        context = MissionContext(
            board=self.strict_board,
            clock=self.clock,
            proposals=self.proposals,
            policy=self._policy,
            seed=self.seed,
            segmenter=self.segmenter,
            sight=self.sight,
            stills=self.stills,
            outputs=self.outputs,
            notes=self.notes,
            mark=self.mark,
            clearances=self.clearances,
            airframe=self.airframe,
            take_off=self.take_off,
            mark_pose=self.mark_pose,
            area=self.area,
        )
        self.tree.setup(context)
        self._ready = True

    def _prepare(self) -> None:
        if not self._ready:
            self.setup()
        self.proposals.clear()

    def _tick_tree(self) -> Status:
        """Tick; raise MissionError if a leaf proposed what its class does not declare."""
        status = self.tree.tick()
        asked = (("moves", self.proposals.movement_owner), ("points", self.proposals.gimbal_owner))
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
        self._prepare()
        return self._tick_tree()

    @property
    def feedback(self) -> str:
        """The leaf's text for the status line."""
        message: str = self.leaf.feedback_message
        return message
