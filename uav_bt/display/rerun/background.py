"""A follower of a flight that draws in a thread of its own, so that the tick never waits for it."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from uav_bt.board.blackboard import Blackboard
from uav_bt.clock import ManualClock
from uav_bt.mission.runner import TickListener, TickRecord
from uav_bt.tree import Status

_LOG = logging.getLogger(__name__)
_WAITING_TICKS: Final = 32  # their frames are in memory: 22 MB at 640x360

Statuses = Callable[[], Mapping[str, Status]]


@dataclass(frozen=True, kw_only=True)
class _Moment:
    record: TickRecord
    board: dict[str, tuple[Any, float]]  # value and capture time by key
    statuses: Mapping[str, Status]


class BackgroundFollower:
    """Hands ticks to a follower in another thread; what it has no time for is left out.

    A view must not bring a drone down: a follower that raises gets no more ticks.

    Args:
        make: makes the follower from a board and statuses that stand still during a tick.
        board: of the mission.
        statuses: returns the nodes' statuses by path.
        waiting_ticks: how many may wait.
    """

    def __init__(
        self,
        make: Callable[[Blackboard, Statuses], TickListener],
        board: Blackboard,
        statuses: Statuses,
        *,
        waiting_ticks: int = _WAITING_TICKS,
    ) -> None:
        self.left_out = 0  # ticks
        self.failure: Exception | None = None
        self._board = board
        self._statuses = statuses
        self._clock = ManualClock()
        self._mirror = Blackboard(self._clock, board.keys.values())
        self._standing: Mapping[str, Status] = {}
        self._follower = make(self._mirror, lambda: self._standing)
        self._waiting: queue.Queue[_Moment | None] = queue.Queue(waiting_ticks)
        self._thread = threading.Thread(target=self._follow, name="view", daemon=True)
        self._thread.start()

    def on_tick(self, record: TickRecord) -> None:
        """Hand a tick on."""
        if self.failure is not None:
            return
        moment = _Moment(
            record=record, board=self._board.snapshot(), statuses=dict(self._statuses())
        )
        try:
            self._waiting.put_nowait(moment)
        except queue.Full:
            self.left_out += 1

    def close(self) -> None:
        """Return when all that waits has been followed; safe to call twice."""
        if self._thread.is_alive():
            self._waiting.put(None)
            self._thread.join()
        if self.left_out:
            _LOG.warning("the view left out %d ticks: this machine is too busy", self.left_out)
            self.left_out = 0

    def _follow(self) -> None:
        while (moment := self._waiting.get()) is not None:
            if self.failure is None:
                self._tell(moment)

    def _tell(self, moment: _Moment) -> None:
        try:
            self._reflect(moment)
            self._follower.on_tick(moment.record)
        except Exception as error:  # noqa: BLE001 - whatever it is, the flight goes on
            self.failure = error
            _LOG.warning("the view ended: %s: %s", type(error).__name__, error)

    def _reflect(self, moment: _Moment) -> None:
        self._clock.sleep_until(moment.record.time_s)
        self._standing = moment.statuses
        for name, key in self._board.keys.items():
            if name not in self._mirror.keys:
                self._mirror.declare(key)
            if name in moment.board:
                value, captured_s = moment.board[name]
                self._mirror.write(key, value, captured_s)
            else:
                self._mirror.forget(key)
