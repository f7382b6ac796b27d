"""The benches of leaves and trees, their log of events, and drawn maps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.worlds.trees import document, tree_file
from uav_bt import testing
from uav_bt.answers import Advance
from uav_bt.board import ELAPSED, FRAME, HEIGHT, STATE
from uav_bt.board.context import MissionContext
from uav_bt.errors import (
    BoardAccessError,
    InputError,
    MissionError,
    NodeFailedError,
    ShapeError,
    TreeError,
    UnknownNameError,
    ValueRangeError,
)
from uav_bt.protocols import LeafPolicy
from uav_bt.testing import LeafBench, Says, TreeBench, drawn_map, load_tree, parse_tree
from uav_bt.tree import Leaf, NodeRegistry, Port, Status
from uav_bt.types import Attitude, BodyVelocity, FlyingState, GimbalTo, Hover, MoveBy, MovementState


class Step(Leaf):
    """Steps ahead once, looking down a little."""

    moves = points = True
    ports = (Port("policy", str, default="always"), Port("step_m", float, default=0.3))
    reads = (STATE, FRAME)

    def on_setup(self, mission: MissionContext) -> None:
        self.policy: LeafPolicy = mission.policy(self.port_value("policy"))
        self._id = 0

    def update(self) -> Status:
        state = self.read(STATE).value
        if state is None:
            self.feedback_message = "no telemetry"
            return Status.RUNNING
        if self._id == 0:
            self._id = self.mission.proposals.next_id()
        told = state.movement
        if told is not None and told.id == self._id:
            return Status.SUCCESS if told.state is MovementState.DONE else Status.FAILURE
        self.point(GimbalTo(pitch_rad=-0.5))
        self.propose(MoveBy(id=self._id, forward_m=self.port_value("step_m")))
        return Status.RUNNING


def step_bench(**attributes: object) -> LeafBench:
    bench = LeafBench(Step, **attributes)
    bench.policies["always"] = Says(Advance(forward_m=0.3))
    return bench


@pytest.mark.parametrize(
    ("word", "answer"),
    [(MovementState.DONE, Status.SUCCESS), (MovementState.INTERRUPTED, Status.FAILURE)],
)
def test_a_movement_from_proposal_to_end(word: MovementState, answer: Status) -> None:
    bench = step_bench(step_m="0.25")
    bench.hover(height_m=1.5)
    assert bench.tick() is Status.RUNNING
    assert bench.proposed == MoveBy(id=1, forward_m=0.25)
    assert bench.pointed == GimbalTo(pitch_rad=-0.5)
    bench.clock.advance(1.0)
    bench.finish_movement(word)
    assert bench.tick(advance_s=0.1) is answer
    assert bench.proposed is None


def test_hover_takes_what_a_leaf_may_ask_the_telemetry() -> None:
    bench, attitude = step_bench(), Attitude(yaw_rad=0.4)
    bench.hover(height_m=1.2)
    assert bench.board[STATE].flying is FlyingState.HOVERING
    assert bench.board[HEIGHT] == bench.board[FRAME].height_above_ground_m == 1.2
    bench.hover(attitude=attitude, forward_mps=0.5, battery_share=0.12, link_share=0.3)
    state = bench.board[STATE]
    assert (state.flying, state.battery, state.link) == (FlyingState.FLYING, 0.12, 0.3)
    assert state.velocity == BodyVelocity(forward_mps=0.5)
    assert state.attitude == bench.board[FRAME].attitude == attitude
    with pytest.raises(ValueRangeError, match="battery_share must be 0 to 1, got 80"):
        bench.hover(battery_share=80)


def test_stale_access_fails_the_test() -> None:
    bench = step_bench()
    assert bench.tick() is Status.RUNNING
    assert bench.feedback == "no telemetry"  # what is missing is not stale
    bench.hover()
    bench.tick()
    with pytest.raises(NodeFailedError, match=r"'state' is stale in this test: 5\.00 s") as error:
        bench.tick(advance_s=5.0)
    assert isinstance(error.value.__cause__, BoardAccessError)
    bench.allow_stale()
    assert bench.tick() is Status.RUNNING
    assert bench.feedback == "no telemetry"


def test_all_names_of_the_kit_can_be_imported() -> None:
    assert all(hasattr(testing, name) for name in testing.__all__)
    assert not hasattr(testing, "Nothing")


def test_wrong_use_is_explained() -> None:
    with pytest.raises(InputError, match="did you mean 'step_m'"):
        LeafBench(Step, step="1")
    with pytest.raises(InputError, match="unknown policy 'none-of-these'"):
        LeafBench(Step, policy="none-of-these").tick()
    with pytest.raises(MissionError, match="no MoveBy was proposed"):
        step_bench().finish_movement()
    with pytest.raises(InputError, match=r"expected a leaf's class, .*: LeafBench\(Step\)"):
        LeafBench(Step())  # type: ignore[arg-type]


# --- the tree bench: a tree file with mocked leaves, ticked by hand -------------------------------


class Climb(Leaf):
    """Proposes a movement until it is high enough."""

    moves = points = True
    ports = (Port("to_m", float, default=1.0, doc="height, m"),)
    reads = (HEIGHT, STATE)

    def update(self) -> Status:
        if self.read(STATE).value is None:
            return Status.FAILURE
        if (self.read(HEIGHT).value or 0.0) >= self.port_value("to_m"):
            return Status.SUCCESS
        self.propose(Hover())
        self.point(GimbalTo(pitch_rad=-0.5))
        return Status.RUNNING


class Late(Leaf):
    """Reads an undeclared board key."""

    def update(self) -> Status:
        self.read(ELAPSED)
        return Status.SUCCESS


CLIMBERS = NodeRegistry([Climb, Late])


def test_a_file_with_a_real_and_a_mocked_leaf(tmp_path: Path) -> None:
    """Ticks have the distance of `tick_s`; after each, its proposal is available."""
    path = tree_file(tmp_path, '<Sequence><Late/><Climb to_m="9"/></Sequence>')
    bench = load_tree(path, CLIMBERS, mocks={"Late": "(RS)"}, overrides={"Climb": {"to_m": "1.5"}})
    bench.hover(height_m=1.0)
    assert [bench.tick() for _ in range(2)] == [Status.RUNNING] * 2
    bench.advance(5.0)
    bench.tick()
    bench.hover(height_m=1.5)
    assert bench.tick_until(Status.SUCCESS, max_ticks=3) == 1
    assert bench.answers == "RRRS"
    assert [outcome.time_s for outcome in bench.outcomes] == pytest.approx([0.0, 0.1, 5.2, 5.3])
    first, second, *_ = bench.outcomes
    assert (first.movement, first.proposed_by, first.gimbal) == (None, None, None)
    assert (second.movement, second.proposed_by) == (Hover(), "Main/Sequence/Climb")
    assert second.gimbal == GimbalTo(pitch_rad=-0.5)
    assert bench.proposed is None


def test_telemetry_goes_on_until_it_is_lost() -> None:
    bench = parse_tree(document('<Climb to_m="9"/>'), CLIMBERS, tick_s=1.0)
    bench.hover()
    for _ in range(5):
        assert bench.tick() is Status.RUNNING
    bench.lose_telemetry()
    with pytest.raises(NodeFailedError, match=r"'state' is stale in this test: 1\.00 s"):
        bench.tick()
    bench.allow_stale()
    assert bench.tick() is Status.FAILURE


def test_waiting_in_vain_tells_what_happened() -> None:
    text = document("<Sequence><Late/><Climb/></Sequence>")
    bench = parse_tree(text, CLIMBERS, mocks={"Late": "S", "Climb": "R"})
    with pytest.raises(AssertionError) as failure:
        bench.tick_until(Status.FAILURE, max_ticks=3)
    message = str(failure.value)
    assert message.startswith(
        "expected FAILURE within 3 ticks, the last answers were RRR; running: Sequence > Climb\n"
    )
    assert "    3     0.20  ran        Main/Sequence/Climb" in message


def test_a_mock_of_an_unknown_leaf_is_refused_with_a_suggestion() -> None:
    with pytest.raises(TreeError, match=r"mock of 'Clim': .*did you mean 'Climb'"):
        parse_tree(document("<Climb/>"), CLIMBERS, mocks={"Clim": "S"})


# --- the log: its events, and the failures of its assertions --------------------------------------


class Look(Leaf):
    """Looks."""

    def update(self) -> Status:
        raise ZeroDivisionError("blind")


class Fly(Leaf):
    """Flies."""

    update = Look.update


class Clear(Leaf):
    """Reports whether the path is clear."""

    condition = True


REGISTRY = NodeRegistry([Look, Fly, Clear])


def bench_of(body: str, **mocks: str) -> TreeBench:
    text = f'<root BTCPP_format="4"><BehaviorTree ID="M">{body}</BehaviorTree></root>'
    return parse_tree(text, REGISTRY, mocks=mocks)


def happened(bench: TreeBench) -> list[str]:
    return [f"{e.tick} {e.path.rpartition('/')[2]} {e.kind.value}" for e in bench.log.events]


REACTIVE = '<ReactiveSequence name="r"><Clear/><Fly/></ReactiveSequence>'


def test_every_node_is_followed_from_start_to_end() -> None:
    bench = bench_of(REACTIVE, Clear="SSF", Fly="R")
    for _ in range(3):
        bench.tick()
    assert happened(bench) == [
        *("1 r started", "1 Clear started", "1 Clear succeeded", "1 Fly started"),
        *("2 r ran", "2 Clear started", "2 Clear succeeded", "2 Fly ran"),
        *("3 r ran", "3 Clear started", "3 Clear failed", "3 Fly halted", "3 r failed"),
    ]


def test_conditions_forestall_and_skip() -> None:
    bench = bench_of('<Sequence><Fly _successIf="true"/><Look _skipIf="true"/></Sequence>')
    assert bench.tick() is Status.SUCCESS
    bench.log.assert_not_started("Fly")
    bench.log.assert_succeeded("Fly")
    bench.log.assert_skipped("Look", times=1, tick=1)


def test_an_exception_is_an_event_of_its_node() -> None:
    bench = bench_of("<Parallel><Fly/><Look/></Parallel>", Fly="R")
    with pytest.raises(NodeFailedError, match="'M/Parallel/Look' failed"):
        bench.tick()
    assert [e.path for e in bench.log.of("Look", "raised")] == ["M/Parallel/Look"]
    assert not bench.log.of("Parallel", "raised")
    bench.log.assert_order("Look raised", "Fly halted")


def test_a_failing_assertion_shows_the_log() -> None:
    bench = bench_of("<Fly/>", Fly="RS")
    bench.tick_until(Status.SUCCESS, max_ticks=2)
    with pytest.raises(AssertionError) as failure:
        bench.log.assert_halted("Fly")
    assert str(failure.value) == (
        "expected 'Fly' halted at least once, it was 0 times\n"
        " tick     time  event      node\n"
        "    1     0.00  started    M/Fly\n"
        "    2     0.10  ran        M/Fly\n"
        "    2     0.10  succeeded  M/Fly"
    )
    with pytest.raises(AssertionError, match="'Fly' started or ran in tick 2 3 times, it was 1"):
        bench.log.assert_ran("Fly", times=3, tick=2)
    with pytest.raises(AssertionError, match="'Fly' started never, it was 1 times"):
        bench.log.assert_not_started("Fly")


def test_misspelt_names_are_no_silent_pass() -> None:
    bench = bench_of("<Fly/>", Fly="R")
    with pytest.raises(UnknownNameError, match="unknown node 'Flu'; did you mean 'Fly'"):
        bench.log.assert_not_started("Flu")
    with pytest.raises(UnknownNameError, match="unknown event 'halts'; did you mean 'halted'"):
        bench.log.assert_order("Fly halts")


def test_nodes_that_never_began_are_listed() -> None:
    bench = bench_of('<Fallback name="f"><Clear/><Fly/><Look/></Fallback>', Clear="F", Fly="S")
    assert bench.log.never_ran() == ("M/f", "M/f/Clear", "M/f/Fly", "M/f/Look")
    bench.tick()
    assert bench.log.never_ran() == ("M/f/Look",)


# --- drawn maps -----------------------------------------------------------------------------------


def test_walls_have_points_from_end_to_end() -> None:
    points = drawn_map(
        walls=[((1.0, -0.5), (1.0, 0.5)), ((0.0, 1.0), (0.0, 1.0))], obstacles=np.array([[-1, 0]])
    ).obstacles_m
    assert points[0] == pytest.approx((-1.0, 0.0))
    wall = points[points[:, 0] == 1.0]
    assert (wall[0, 1], wall[-1, 1]) == pytest.approx((-0.5, 0.5))
    assert np.diff(wall[:, 1]).max() <= 0.05 + 1e-9
    assert (points[-2:] == (0.0, 1.0)).all()


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ShapeError, match="known"):
        drawn_map(known=np.ones((3, 3), dtype=bool))
    with pytest.raises(ShapeError, match="obstacles"):
        drawn_map(obstacles=np.zeros(2))
    with pytest.raises(ValueRangeError, match="ground_m must be positive"):
        drawn_map(ground_m=0.0)
