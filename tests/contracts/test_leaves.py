"""Rules for every leaf: halted, blind, interrupted; its declarations."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import pytest

from behaviours.fly.explore import Explore
from behaviours.fly.moving_leaf import MovingLeaf
from behaviours.nodes import NODES
from tests.paper_lab import paper_map
from tests.worlds.leaves import ADVANCE, TURN_RIGHT
from tests.worlds.values import corridor, fix, motion
from uav_bt.answers import Answer
from uav_bt.board import (
    CORRIDOR,
    FLIGHT_HEIGHT,
    FLIGHT_PITCH,
    HELD_TURN,
    MARK,
    ODOMETRY,
    PHASE,
    STATE,
)
from uav_bt.board.blackboard import Key
from uav_bt.board.context import FlightFolder
from uav_bt.errors import NodeFailedError
from uav_bt.testing import LeafBench
from uav_bt.testing.world import Says, drawn_map, ground, show
from uav_bt.tree import Leaf, Port, Status
from uav_bt.tree.loading.attributes import POLICY_PORT
from uav_bt.tree.status import FAILURE, SUCCESS
from uav_bt.types import (
    ClassMap,
    FlyingState,
    Frame,
    Hover,
    Land,
    MoveBy,
    MovementState,
    MovementStatus,
)
from uav_bt.types.dead_reckoning import OdometryPose

# --- what shipped leaves declare about themselves agrees with their code --------------------------

LEAVES: Final = [node for node in NODES if issubclass(node, Leaf)]
PORTS: Final[dict[str, dict[str, object]]] = {
    "EstimateDepth": {"model": "contact"},
    "MoveBy": {"forward_m": 1.0},
    "SearchUnderPolicy": {"first_s": 3600.0},  # counts on while the leaf does not run
    "TakeOff": {"height_m": 2.0},
    "Turn": {"degrees": 90.0},
}
"""Values of ports by leaf; other leaves get the samples of the ports that they require."""

SUCCEED_BLIND: Final = {
    *("Advise", "BuildCorridor", "EstimateDepth", "FindMark", "MapSite", "RememberViews"),
    *("Segment", "TrackMotion", "CoverageGrows", "MovesOn", "SensesAgree"),
    *("HoverFor", "Rules", "Say"),
}
"""Leaves that succeed without any value: those that perceive or doubt, and that need none."""

TOLD_BLIND: Final = {PHASE, FLIGHT_HEIGHT, FLIGHT_PITCH, HELD_TURN}
"""Keys that need no measurement."""

Trace = list[tuple[str, str, bool]]
"""Of each tick: the status, the kind of the movement, and whether the camera is pointed."""


class Ground:
    """A segmenter that sees ground everywhere."""

    def segment(self, frame: Frame) -> ClassMap:
        return paper_map(ids=ground(), captured_s=frame.captured_s)


class Flight:
    """A flight of one leaf: the drone ends movements after three ticks, and points its camera.

    Args:
        leaf: the leaf's class.
        situation: `free`, `blocked` or `landed`.
        outputs: an empty folder.
        word: how the drone ends a movement.
    """

    def __init__(
        self,
        leaf: type[Leaf],
        outputs: Path,
        situation: str = "free",
        word: MovementState = MovementState.DONE,
    ) -> None:
        given = {port.name: port.sample or "1" for port in leaf.ports if port.required}
        if any(port.name == "policy" for port in leaf.ports):
            given["policy"] = "says"
        self.bench = LeafBench(leaf, **{**given, **PORTS.get(leaf.__name__, {})})
        answer: Answer = TURN_RIGHT if situation == "blocked" else ADVANCE
        self.bench.policies["says"] = Says(answer)
        self.bench.provide(segmenter=Ground(), outputs=FlightFolder(outputs))
        self.bench.allow_stale()
        self.situation, self.word = situation, word
        self.ids: set[int] = set()
        self.without: Key[Any] | None = None
        self._held = 0

    def see(self, seconds: float = 0.1) -> None:
        """Let time pass, and write what the drone and the leaves of perception would write."""
        bench, blocked = self.bench, self.situation == "blocked"
        move, ended = bench.proposed, None
        if isinstance(move, MoveBy):
            self._held = 0 if move.id not in self.ids else self._held + 1
            self.ids.add(move.id)
            if self._held == 3:
                ended = MovementStatus(id=move.id, state=self.word)
        pitch_rad = math.radians(-30) if bench.pointed is None else bench.pointed.pitch_rad
        walls = [((0.6, -1.5), (0.6, 1.5))] if blocked else []
        landed = self.situation == "landed"
        show(
            bench,
            seconds=seconds,
            site_map=drawn_map(walls=walls),
            flying=FlyingState.LANDED if landed else FlyingState.HOVERING,
            height_m=0.1 if landed else 1.5,
            gimbal_deg=math.degrees(pitch_rad),
            movement=ended,
        )
        now_s = bench.clock.now()
        pose = OdometryPose(time_s=now_s, x_m=0.0, y_m=0.0, yaw_rad=0.0)
        bench.board[ODOMETRY] = motion(pose)
        bench.board[CORRIDOR] = corridor(0.3 if blocked else 3.0, "front", captured_s=now_s)
        if not blocked:
            bench.board[MARK] = fix(now_s, 1.0, 0.2)
        if self.without is not None:
            del bench.board[self.without]

    def wait(self, seconds: float = 0.1) -> None:
        """Let time pass without anything new."""
        self.bench.clock.advance(seconds)

    def fly(self, ticks: int, world: Callable[[], None] | None = None) -> Trace:
        """Tick until the leaf ends, and return the trace.

        Args:
            ticks: at most.
            world: called before each tick; default: `see`.
        """
        trace: Trace = []
        for _ in range(ticks):
            (world or self.see)()
            status, bench = self.bench.tick(), self.bench
            if status is not Status.RUNNING:
                assert (bench.proposed, bench.pointed) == (None, None)
            trace.append((status.name, type(bench.proposed).__name__, bench.pointed is not None))
            if status is not Status.RUNNING:
                break
        return trace

    @property
    def runs(self) -> bool:
        return self.bench.leaf.node_status is Status.RUNNING


def phases(trace: Trace) -> Trace:
    """Return a trace without repetitions."""
    return [tick for tick, before in zip(trace, [None, *trace], strict=False) if tick != before]


def moves(trace: Trace) -> set[str]:
    """Return the kinds of movements that change the place of a drone."""
    return {kind for _, kind, _ in trace} - {"NoneType", Hover.__name__, Land.__name__}


every_leaf = pytest.mark.parametrize("leaf", LEAVES, ids=lambda leaf: leaf.__name__)
situations = pytest.mark.parametrize("situation", ["free", "blocked"])


@pytest.mark.parametrize("situation", ["free", "blocked", "landed"])
@every_leaf
def test_halted_it_proposes_nothing_and_begins_anew(
    leaf: type[Leaf], situation: str, tmp_path: Path
) -> None:
    """Also with movements of new numbers, because the drone has cancelled the old ones."""
    for ticks in (1, 8):
        flight = Flight(leaf, tmp_path / str(ticks), situation)
        first = flight.fly(ticks)
        if not flight.runs:
            break
        flight.bench.mission.proposals.clear()
        flight.bench.halt()
        assert (flight.bench.proposed, flight.bench.pointed) == (None, None)
        flight.wait(600.0)
        used, flight.ids = flight.ids, set()
        assert phases(flight.fly(12))[: len(phases(first))] == phases(first)
        assert not used & flight.ids


@every_leaf
def test_without_any_value_it_waits_or_ends(leaf: type[Leaf], tmp_path: Path) -> None:
    """What it does not know is not written. When the values come, it does what it always does."""
    flight = Flight(leaf, tmp_path / "blind")
    for _ in range(2):
        assert not moves(flight.fly(30, lambda: flight.wait(0.5)))
        assert {key for key in leaf.writes if key in flight.bench.board} <= TOLD_BLIND
        ends = SUCCESS if leaf.__name__ in SUCCEED_BLIND else FAILURE
        assert flight.runs or flight.bench.leaf.node_status is ends

    late, early = Flight(leaf, tmp_path / "late"), Flight(leaf, tmp_path / "early")
    late.fly(3, late.wait)
    if late.runs:
        assert phases(late.fly(20))[-1] == phases(early.fly(20))[-1]


@situations
@every_leaf
def test_by_old_values_it_neither_moves_nor_tells_anything(
    leaf: type[Leaf], situation: str, tmp_path: Path
) -> None:
    flight = Flight(leaf, tmp_path, situation)
    flight.fly(8)
    flight.wait(1.0)
    assert not moves(flight.fly(20, lambda: flight.wait(0.5)))
    ageing = [key for key in leaf.writes if key.max_age_s < 1.0]
    assert all(flight.bench.board.read(key).value is None for key in ageing)


@situations
@every_leaf
def test_without_one_value_it_goes_on_or_ends(
    leaf: type[Leaf], situation: str, tmp_path: Path
) -> None:
    for number, key in enumerate(leaf.reads):
        flight = Flight(leaf, tmp_path / str(number), situation)
        flight.without = key
        trace = flight.fly(5)
        assert key is not STATE or not moves(trace)


@situations
@every_leaf
def test_time_in_which_a_person_flies_does_not_count(
    leaf: type[Leaf], situation: str, tmp_path: Path
) -> None:
    """The tree is not ticked then, and no time of the leaf is over because of it."""
    flight = Flight(leaf, tmp_path / "flight", situation)
    flight.fly(3)
    if flight.runs:
        undisturbed = Flight(leaf, tmp_path / "undisturbed", situation)
        undisturbed.fly(3)
        flight.wait(600.0)
        fails = flight.fly(20)[-1][0] == FAILURE.name
        assert fails is (undisturbed.fly(20)[-1][0] == FAILURE.name)


@pytest.mark.parametrize("word", [MovementState.INTERRUPTED, MovementState.REJECTED])
@every_leaf
def test_not_obeyed_it_tries_again_and_says_so_when_it_fails(
    leaf: type[Leaf], word: MovementState, tmp_path: Path
) -> None:
    flight = Flight(leaf, tmp_path, word=word)
    trace = flight.fly(60, lambda: flight.see(0.2))
    assert len(flight.ids) != 1
    if issubclass(leaf, MovingLeaf) and leaf.resumes and trace[-1][0] == "FAILURE" and flight.ids:
        assert word.value in flight.bench.feedback


WORDS = {"SUCCESS": Status.SUCCESS, "FAILURE": Status.FAILURE}


@every_leaf
def test_the_description_names_declared_answers_only(leaf: type[Leaf]) -> None:
    first = inspect.cleandoc(leaf.__doc__ or "").partition("Args:")[0]
    for word, status in WORDS.items():
        assert word not in first or status in leaf.answers, (leaf.__name__, word)


@every_leaf
def test_the_code_returns_declared_answers_only(leaf: type[Leaf]) -> None:
    """Of the statuses that the class's own module returns, none is undeclared."""
    shared = {MovingLeaf.fails, MovingLeaf.moved}  # return FAILURE for the leaves that call them
    source = "".join(
        inspect.getsource(method)
        for base in leaf.__mro__
        if base.__module__.startswith("behaviours.")
        for method in vars(base).values()
        if inspect.isfunction(method) and method not in shared
    )
    for status in (Status.FAILURE, Status.RUNNING):
        if f"return Status.{status.name}" in source:
            assert status in leaf.answers
    if "self.fails(" in source or "self.moved(" in source:
        assert Status.FAILURE in leaf.answers


@every_leaf
def test_a_leaf_that_turns_the_camera_points(leaf: type[Leaf]) -> None:
    if issubclass(leaf, MovingLeaf):
        overrides = leaf.gimbal_pitch_rad is not MovingLeaf.gimbal_pitch_rad
        assert leaf.points is overrides
        assert leaf.moves


def test_explore_points_the_camera_where_it_looks_down() -> None:
    assert not Explore(None, policy="segmentation").may_point()
    assert Explore(None, policy="segmentation", looks_down="true").may_point()
    assert Explore(None, policy="segmentation", looks_down="{far}").may_point()


@pytest.mark.parametrize(
    ("leaf", "port"),
    [(leaf, port) for leaf in LEAVES for port in leaf.ports if port.direction == "input"],
    ids=lambda value: value.name if isinstance(value, Port) else value.__name__,
)
def test_ports_that_are_read_at_the_setup_are_declared(
    leaf: type[Leaf], port: Port[object]
) -> None:
    """Without a value of their variable the setup raises."""
    given = {one.name: one.sample or "1" for one in leaf.ports if one.required}
    bench = LeafBench(leaf, **{**given, port.name: "{nothing}"})
    if port.at_setup or port.name == POLICY_PORT:
        with pytest.raises(NodeFailedError, match=r"\{nothing\} holds nothing"):
            bench.setup()
    else:
        bench.setup()
