"""Sequences and fallbacks: children ticked in order until one decides."""

from __future__ import annotations

from typing import ClassVar

from uav_bt.tree.flow import After, Follow, Known, in_order
from uav_bt.tree.nodes.base import ControlNode
from uav_bt.tree.port import Port
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Status


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
