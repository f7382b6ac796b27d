"""Nodes that check whether a variable was written since their last check."""

from __future__ import annotations

from typing import ClassVar

from uav_bt.tree.flow import After, Follow, Known, as_child
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.node import Node
from uav_bt.tree.nodes.base import DecoratorNode
from uav_bt.tree.port import Port
from uav_bt.tree.status import FAILURE, RUNNING, SKIPPED, SUCCESS, Status


def _check_entry(text: object) -> None:
    if not isinstance(text, str) or not text.replace(".", "_").replace("-", "_").isidentifier():
        raise ValueError(f"expected a variable such as {{x}}, got '{text}'")


ENTRY = Port("entry", object, doc="the variable, as {name}", check=_check_entry)


class _Watch:
    """Remembers the state of a variable or board key at the last check."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._seen: object = None

    def updated(self) -> bool:
        """Return whether it was written since the last check."""
        now = self._look()
        if now is None:
            return False
        before, self._seen = self._seen, now
        return before != now

    def _look(self) -> object:
        reference = self._node.reference(ENTRY)
        key = str(self._node.port(ENTRY)) if reference is None else reference.key
        on_board = reference is not None and reference.on_board
        board_key = key if on_board else self._node.variables.board_key(key)
        if board_key is not None:
            held = self._node.mission.board.snapshot().get(board_key)
            # The board counts no writes; a new one is another object or has a later capture time.
            return None if held is None else (id(held[0]), held[1])
        entry = self._node.variables.entry(key)
        return None if entry is None else entry.writes


class WasEntryUpdated(Leaf):
    """Succeeds when the variable was written since this node last looked."""

    answers = (SUCCESS, FAILURE)
    ports = (ENTRY,)

    def __init__(self, name: str | None = None, /, **given: object) -> None:
        super().__init__(name, **given)
        self._watch = _Watch(self)

    def update(self) -> Status:
        """Check the variable."""
        return SUCCESS if self._watch.updated() else FAILURE


class _UnlessUpdated(DecoratorNode):
    ports = (ENTRY,)
    _otherwise: ClassVar[Status]

    variables_after = as_child

    _busy = False  # the child is running and is ticked without a check

    def __init__(self, name: str | None, child: Node, /, **given: object) -> None:
        super().__init__(name, child, **given)
        self._watch = _Watch(self)

    def update(self) -> Status:
        """Tick the child."""
        if not self._busy and not self._watch.updated():
            return self._otherwise
        status = self.child.execute_tick()
        self._busy = status is RUNNING
        return status

    def _halt(self) -> None:
        # As in the engine, the halt is not passed on to the child.
        self._busy = False


class SkipUnlessUpdated(_UnlessUpdated):
    """Ticks its child when the variable was written since the last time, else skips."""

    _otherwise = SKIPPED

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Follow the child, which may be skipped."""
        after = as_child(self, follow, known)
        return After(after.success, after.failure, known)


class WaitValueUpdate(_UnlessUpdated):
    """Ticks its child when the variable was written since the last time, else waits."""

    _otherwise = RUNNING
