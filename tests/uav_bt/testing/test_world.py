"""A state in flight on the bench, and a policy with given answers."""

from __future__ import annotations

import math

import pytest

from tests.paper_lab import CARPET
from uav_bt.answers import Advance, Done
from uav_bt.board import CLASS_MAP, FRAME, SITE_MAP, STATE
from uav_bt.testing import LeafBench, drawn_map, show
from uav_bt.tree import Leaf, Status

ADVANCE, DONE = Advance(forward_m=0.3, reason="clear"), Done(reason="covered")


class Waits(Leaf):
    """Waits for a heading."""

    reads = (STATE, CLASS_MAP, SITE_MAP)

    def update(self) -> Status:
        state, site_map = self.read(STATE).value, self.read(SITE_MAP).value
        assert state is not None
        assert self.read(CLASS_MAP).known
        if site_map is None:
            return Status.RUNNING
        return Status.SUCCESS if state.attitude.yaw_rad > 1.0 else Status.FAILURE


def test_everything_is_of_now() -> None:
    bench = LeafBench(Waits)
    show(bench, seconds=2.5, site_map=drawn_map(pose=(0.0, 0.0, 0.7)), height_m=1.2)
    state = bench.board[STATE]
    assert bench.clock.now() == 2.5
    values = (state, bench.board[CLASS_MAP], bench.board[SITE_MAP], bench.board[FRAME])
    assert {value.captured_s for value in values} == {2.5}
    assert (state.attitude.yaw_rad, state.height_m) == (0.7, 1.2)
    assert state.gimbal_pitch_rad == pytest.approx(math.radians(-30.0))
    assert (bench.board[CLASS_MAP].ids == CARPET).all()
