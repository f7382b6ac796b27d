"""The tree bench: a tree file with mocked leaves, ticked by hand."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.worlds.trees import document, tree_file
from uav_bt.board import ELAPSED, HEIGHT, STATE
from uav_bt.errors import NodeFailedError, TreeError
from uav_bt.testing import load_tree, parse_tree
from uav_bt.tree import Leaf, NodeRegistry, Port, Status
from uav_bt.types import GimbalTo, Hover


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


REGISTRY = NodeRegistry([Climb, Late])


def test_a_file_with_a_real_and_a_mocked_leaf(tmp_path: Path) -> None:
    """Ticks have the distance of `tick_s`; after each, its proposal is available."""
    path = tree_file(tmp_path, '<Sequence><Late/><Climb to_m="9"/></Sequence>')
    bench = load_tree(path, REGISTRY, mocks={"Late": "(RS)"}, overrides={"Climb": {"to_m": "1.5"}})
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
    bench = parse_tree(document('<Climb to_m="9"/>'), REGISTRY, tick_s=1.0)
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
    bench = parse_tree(text, REGISTRY, mocks={"Late": "S", "Climb": "R"})
    with pytest.raises(AssertionError) as failure:
        bench.tick_until(Status.FAILURE, max_ticks=3)
    message = str(failure.value)
    assert message.startswith(
        "expected FAILURE within 3 ticks, the last answers were RRR; running: Sequence > Climb\n"
    )
    assert "    3     0.20  ran        Main/Sequence/Climb" in message


def test_wrong_use_is_explained() -> None:
    with pytest.raises(TreeError, match=r"mock of 'Clim': .*did you mean 'Climb'"):
        parse_tree(document("<Climb/>"), REGISTRY, mocks={"Clim": "S"})
