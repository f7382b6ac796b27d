"""A workbench for one leaf: a board to write on, a clock to advance, proposals to look at."""

from __future__ import annotations

from uav_bt.testing.world import BenchWorld
from uav_bt.tree import Leaf, MissionTree, Status


class LeafBench(BenchWorld):
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
        self.leaf = leaf(None, **attributes)
        super().__init__(MissionTree(self.leaf, name="Bench"))

    def tick(self, advance_s: float = 0.0) -> Status:
        """Forget the last tick's proposals, tick the leaf once and return its answer.

        Args:
            advance_s: how much time passes before.

        Raises:
            NodeFailedError: the leaf raised.
        """
        self.clock.advance(advance_s)
        self._prepare()
        return self.tree.tick()

    @property
    def feedback(self) -> str:
        """What the status line would show."""
        message: str = self.leaf.feedback_message
        return message
