"""Nodes with children: the bases, the subtree, and those that tick their children in order."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import ClassVar

from uav_bt.errors import InputError
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.port import INTEGER, MAX_INTEGER, REAL, Port, parse_reference, port_text
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Status
from uav_bt.tree.variables import After, Follow, Known, Variables, as_child, in_order


class ControlNode(Node):
    """A node with children, ticked in some order."""

    kind = NodeKind.CONTROL
    min_children = 1
    max_children: ClassVar[int | None] = None

    def _restart(self) -> None:
        """Stop the children, and forget how far the node was."""
        for child in self.children:
            child.reset()

    def _halt(self) -> None:
        self._restart()
        self.set_status(IDLE)


class DecoratorNode(Node):
    """A node with one child."""

    kind = NodeKind.DECORATOR
    min_children = 1
    max_children = 1

    def __init__(self, name: str | None, child: Node, /, **given: object) -> None:
        super().__init__(name, (child,), **given)
        self.child = child

    def execute_tick(self) -> Status:
        """Tick once; a child that finished is reset, so that it can start again."""
        status = super().execute_tick()
        child = self.child
        if child.node_status is SUCCESS or child.node_status is FAILURE:
            child.set_status(IDLE)
        return status


def entry_value(text: str) -> int | float | str:
    """Return the value of a SubTree's entry as engine 4.10 does: a number or a text."""
    if re.fullmatch(INTEGER, text) and -MAX_INTEGER <= int(text) < MAX_INTEGER:
        return int(text)
    if re.fullmatch(REAL, text) and math.isfinite(float(text)):
        return float(text)
    return text


class SubTree(DecoratorNode):
    """Another tree of the file, with separate variables.

    Args:
        name: the instance's name.
        child: the root of the other tree.
        entries: the inner tree's variables by name: `{outer}` shares the outer tree's variable,
            `{@key}` is a key of the mission board, anything else is the variable's first value: a
            number, or a text.
        autoremap: all variables that are not private (`_x`) are the outer tree's.
        tree_id: the other tree's id in its file; default: the instance's name.
    """

    node_id = "SubTree"
    kind = NodeKind.SUBTREE

    AUTOREMAP: ClassVar = Port(
        "autoremap", bool, default=False, doc="share all variables that are not private (_x)"
    )

    def __init__(
        self,
        name: str | None,
        child: Node,
        /,
        entries: Mapping[str, str] | None = None,
        *,
        autoremap: bool = False,
        tree_id: str = "",
        **conditions: object,
    ) -> None:
        super().__init__(name, child, **conditions)
        self.tree_id = tree_id or self.name
        self.autoremap = autoremap
        self._take_entries(dict(entries or {}))

    @property
    def attributes(self) -> dict[str, str]:
        """The entries as a tree file has them, for those who write one."""
        return {**self._entries, **({"_autoremap": "true"} if self.autoremap else {})}

    def _take_entries(self, entries: dict[str, str]) -> None:
        self._entries = entries
        self.shared: dict[str, str] = {}  # names outside, by those inside
        self.board_keys: dict[str, str] = {}
        self.constants: dict[str, int | float | str] = {}
        for inner, text in entries.items():
            reference = parse_reference(text, inner)
            if reference is None:
                self.constants[inner] = entry_value(text)
            else:
                outside = self.board_keys if reference.on_board else self.shared
                outside[inner] = reference.key

    def rebind(self, given: Mapping[str, object]) -> None:
        """Replace entries by name, before the setup."""
        try:
            self._take_entries(
                {**self._entries, **{name: port_text(value) for name, value in given.items()}}
            )
        except ValueError as error:
            raise InputError(f"SubTree '{self.name}': {error}") from error
        self.place(self.path, self.variables)

    variables_after = as_child

    def open_scope(self, outer: Variables) -> Variables:
        """Return the variables of the tree inside; `outer` are those that the node stands in."""
        scope = (self.shared, self.board_keys, self.constants)
        return Variables(outer, *scope, autoremap=self.autoremap)

    def update(self) -> Status:
        """Tick the child."""
        if self.node_status is IDLE:
            self.set_status(RUNNING)
        return self.child.execute_tick()


class _Deciding(ControlNode):
    """Ticks its children one after another until one decides."""

    _decides: ClassVar[Status]  # the answer of a child that is the answer of all
    _otherwise: ClassVar[Status]  # the answer when no child has decided

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Follow each child after those before it have not decided."""
        return in_order(self.children, follow, known, falls_back=self._decides is SUCCESS)


class _Ordered(_Deciding):
    """Ticks its children one after another, going on with the one that it had reached."""

    _yields: ClassVar[bool] = False  # a tick ends after each child that answered at once
    _restarts: ClassVar[bool] = True  # a decision or a halt resets the position
    _spared: ClassVar[int] = 0  # how many children at the end are not ticked

    _index = 0
    _skipped = 0

    def update(self) -> Status:
        """Tick the children from the one that was reached."""
        children = self.children
        count = len(children) - self._spared
        if self.node_status is IDLE:
            self._skipped = 0
        self.set_status(RUNNING)
        while self._index < count:
            child = children[self._index]
            was_idle = child.node_status is IDLE
            status = child.execute_tick()
            if status is RUNNING:
                return RUNNING
            if status is self._decides:
                for other in children[0 if self._restarts else self._index :]:
                    other.reset()
                if self._restarts:
                    self._index = 0
                return status
            self._index += 1
            if status is SKIPPED:
                self._skipped += 1
            elif self._yields and was_idle and self._index < count:
                return RUNNING
        all_skipped = self._skipped == count
        self._restart()
        self._index = self._skipped = 0
        return SKIPPED if all_skipped else self._otherwise

    def _halt(self) -> None:
        if self._restarts:
            self._index = self._skipped = 0
        super()._halt()


class Sequence(_Ordered):
    """Ticks its children one after another; fails with the first that fails, then starts over."""

    _decides = FAILURE
    _otherwise = SUCCESS


class AsyncSequence(Sequence):
    """A Sequence that answers RUNNING after each child that succeeded at once."""

    _yields = True


class SequenceWithMemory(Sequence):
    """A Sequence that goes on, after a failure or a halt, with the child it had reached."""

    _yields = True
    _restarts = False


class Fallback(_Ordered):
    """Ticks its children one after another until one succeeds."""

    _decides = SUCCESS
    _otherwise = FAILURE


class AsyncFallback(Fallback):
    """A Fallback that answers RUNNING after each child that failed at once."""

    _yields = True


class TryCatch(_Ordered):
    """Ticks all children but the last as a Sequence; when one fails, the last cleans up."""

    CATCH_ON_HALT = Port(
        "catch_on_halt", bool, default=False, doc="clean up also when halted (one tick of it)"
    )
    ports = (CATCH_ON_HALT,)
    min_children = 2

    _decides = FAILURE
    _otherwise = SUCCESS
    _spared = 1

    _catching = False

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Follow all but the last in order; the last may also run after a halt."""
        *tried, last = self.children
        after = in_order(tried, follow, known, falls_back=False)
        follow(last, known)
        return after

    def update(self) -> Status:
        """Tick the children that are tried, or the last one."""
        self._catching &= self.node_status is not IDLE
        if not self._catching:
            status = super().update()
            if status is not FAILURE:
                return status
            self._catching = True
        if self.children[-1].execute_tick() is RUNNING:
            return RUNNING
        self._restart()
        return FAILURE

    def _restart(self) -> None:
        self._catching = False
        super()._restart()

    def _halt(self) -> None:
        if self.node_status is not IDLE and not self._catching and self.port(self.CATCH_ON_HALT):
            *tried, last = self.children
            for child in tried:
                child.reset()
            if last.execute_tick() is RUNNING:
                last.reset()
        super()._halt()


class _Reactive(_Deciding):
    """Ticks all its children again at every tick."""

    ticks_again = True

    def update(self) -> Status:
        """Tick the children from the first."""
        children = self.children
        all_skipped = True
        self.set_status(RUNNING)
        for child in children:
            status = child.execute_tick()
            if status is SKIPPED:
                child.reset()
                continue
            all_skipped = False
            if status is RUNNING:
                for other in children:
                    if other is not child:
                        other.reset()
                return RUNNING
            if status is self._decides:
                self._restart()
                return status
        self._restart()
        return SKIPPED if all_skipped else self._otherwise


class ReactiveSequence(_Reactive):
    """Begins at its first child in every tick; a running child halts the others."""

    _decides = FAILURE
    _otherwise = SUCCESS


class ReactiveFallback(_Reactive):
    """Begins at its first child in every tick; the first that runs or succeeds halts the others."""

    _decides = SUCCESS
    _otherwise = FAILURE
