"""Fallbacks: one child has to succeed."""

from __future__ import annotations

from typing import ClassVar

from uav_bt.tree.nodes.base import ControlNode
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Status

__all__ = ["AsyncFallback", "Fallback", "ReactiveFallback"]


class Fallback(ControlNode):
    """Ticks its children one after another until one succeeds."""

    _yields: ClassVar[bool] = False  # a tick ends after each child that failed at once

    _index = 0
    _skipped = 0

    def update(self) -> Status:
        """Tick the children."""
        children = self.children
        count = len(children)
        if self.node_status is IDLE:
            self._skipped = 0
        self.set_status(RUNNING)
        while self._index < count:
            child = children[self._index]
            was_idle = child.node_status is IDLE
            status = child.execute_tick()
            if status is RUNNING:
                return RUNNING
            if status is SUCCESS:
                self._reset_children()
                self._index = 0
                return SUCCESS
            self._index += 1
            if status is SKIPPED:
                self._skipped += 1
            elif self._yields and was_idle and self._index < count:
                return RUNNING
        all_skipped = self._skipped == count
        self._reset_children()
        self._index = 0
        self._skipped = 0
        return SKIPPED if all_skipped else FAILURE

    def _halt(self) -> None:
        self._index = 0
        self._skipped = 0
        super()._halt()


class AsyncFallback(Fallback):
    """A Fallback that answers RUNNING after each child that failed at once."""

    _yields = True


class ReactiveFallback(ControlNode):
    """Asks all children again at every tick; the first that runs or succeeds halts the others."""

    def update(self) -> Status:
        """Tick the children."""
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
            if status is SUCCESS:
                self._reset_children()
                return SUCCESS
        self._reset_children()
        return SKIPPED if all_skipped else FAILURE
