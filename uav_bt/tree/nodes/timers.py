"""Nodes that wait. They read the mission's clock at every tick."""

from __future__ import annotations

from uav_bt.tree.flow import After, Follow, Known, as_child, both
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.nodes.base import DecoratorNode
from uav_bt.tree.port import Port
from uav_bt.tree.status import FAILURE, RUNNING, SUCCESS, Status

# Times are sums of tick durations, so their last digits carry rounding errors.
_EPSILON_S = 1e-9


class Timeout(DecoratorNode):
    """Halts its child and fails when the child still runs after the given time."""

    MSEC = Port("msec", int, doc="milliseconds; 0: no limit", least=0)
    ports = (MSEC,)

    _deadline_s: float | None = None  # None: not started
    _expired = False

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Follow the child, which may be halted in its first tick."""
        after = as_child(self, follow, known)
        return After(after.success, both(after.failure, known), after.skipped)

    def update(self) -> Status:
        """Tick the child."""
        limit_msec = self.port(self.MSEC)
        now_s = self.clock.now()
        if self._deadline_s is None:
            self._deadline_s = now_s + limit_msec / 1000 if limit_msec > 0 else float("inf")
            self._expired = False
            self.set_status(RUNNING)
        if not self._expired and now_s >= self._deadline_s - _EPSILON_S:
            # As in the engine, the timer expires once; a child not running then is left alone.
            self._expired = True
            if self.child.node_status is RUNNING:
                self.child.reset()
                self._deadline_s = None
                return FAILURE
        status = self.child.execute_tick()
        if status is SUCCESS or status is FAILURE:
            self._deadline_s = None
        return status

    def _halt(self) -> None:
        self._deadline_s = None
        super()._halt()


class Delay(DecoratorNode):
    """Waits the given time before it ticks its child."""

    DELAY_MSEC = Port("delay_msec", int, doc="milliseconds", least=0)
    ports = (DELAY_MSEC,)

    variables_after = as_child

    _start_at_s: float | None = None  # None: not waiting

    def update(self) -> Status:
        """Tick the child."""
        delay_msec = self.port(self.DELAY_MSEC)
        now_s = self.clock.now()
        if self._start_at_s is None:
            self._start_at_s = now_s + delay_msec / 1000
            self.set_status(RUNNING)
        if now_s < self._start_at_s - _EPSILON_S:
            return RUNNING
        status = self.child.execute_tick()
        if status is SUCCESS or status is FAILURE:
            self._start_at_s = None
        return status

    def _halt(self) -> None:
        self._start_at_s = None
        super()._halt()


class Sleep(Leaf):
    """Runs for the given time, then succeeds."""

    answers = (SUCCESS, RUNNING)
    MSEC = Port("msec", int, doc="milliseconds", least=0)
    ports = (MSEC,)

    _end_s = 0.0

    def initialise(self) -> None:
        """Store the end time."""
        self._end_s = self.clock.now() + self.port(self.MSEC) / 1000

    def update(self) -> Status:
        """Succeed when the time has passed."""
        return RUNNING if self.clock.now() < self._end_s - _EPSILON_S else SUCCESS
