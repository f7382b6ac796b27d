"""The leaf bench: short tests of leaves, which fail on any forbidden access."""

from __future__ import annotations

import pytest

from uav_bt import testing
from uav_bt.answers import Advance
from uav_bt.board import FRAME, HEIGHT, STATE
from uav_bt.board.context import MissionContext
from uav_bt.errors import (
    BoardAccessError,
    InputError,
    MissionError,
    NodeFailedError,
    ValueRangeError,
)
from uav_bt.protocols import LeafPolicy
from uav_bt.testing import LeafBench, Says
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types import Attitude, BodyVelocity, FlyingState, GimbalTo, MoveBy, MovementState


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


def bench_of(**attributes: object) -> LeafBench:
    bench = LeafBench(Step, **attributes)
    bench.policies["always"] = Says(Advance(forward_m=0.3))
    return bench


@pytest.mark.parametrize(
    ("word", "answer"),
    [(MovementState.DONE, Status.SUCCESS), (MovementState.INTERRUPTED, Status.FAILURE)],
)
def test_a_movement_from_proposal_to_end(word: MovementState, answer: Status) -> None:
    bench = bench_of(step_m="0.25")
    bench.hover(height_m=1.5)
    assert bench.tick() is Status.RUNNING
    assert bench.proposed == MoveBy(id=1, forward_m=0.25)
    assert bench.pointed == GimbalTo(pitch_rad=-0.5)
    bench.clock.advance(1.0)
    bench.finish_movement(word)
    assert bench.tick(advance_s=0.1) is answer
    assert bench.proposed is None


def test_hover_takes_what_a_leaf_may_ask_the_telemetry() -> None:
    bench, attitude = bench_of(), Attitude(yaw_rad=0.4)
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
    bench = bench_of()
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
        bench_of().finish_movement()
    with pytest.raises(InputError, match=r"expected a leaf's class, .*: LeafBench\(Step\)"):
        LeafBench(Step())  # type: ignore[arg-type]
