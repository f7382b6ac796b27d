"""Decorators that change or repeat what their child answers."""

from __future__ import annotations

from uav_bt.tree.nodes.base import DecoratorNode
from uav_bt.tree.port import Port
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Status


class Inverter(DecoratorNode):
    """Turns SUCCESS into FAILURE and the other way round."""

    def update(self) -> Status:
        """Tick the child."""
        self.set_status(RUNNING)
        status = self.child.execute_tick()
        if status is SUCCESS:
            return FAILURE
        if status is FAILURE:
            return SUCCESS
        return status


class ForceSuccess(DecoratorNode):
    """Answers SUCCESS when its child finishes, however it finishes."""

    def update(self) -> Status:
        """Tick the child."""
        self.set_status(RUNNING)
        status = self.child.execute_tick()
        return SUCCESS if status is FAILURE else status


class ForceFailure(DecoratorNode):
    """Answers FAILURE when its child finishes, however it finishes."""

    def update(self) -> Status:
        """Tick the child."""
        self.set_status(RUNNING)
        status = self.child.execute_tick()
        return FAILURE if status is SUCCESS else status


class KeepRunningUntilFailure(DecoratorNode):
    """Starts its child again and again until it fails."""

    def update(self) -> Status:
        """Tick the child."""
        self.set_status(RUNNING)
        status = self.child.execute_tick()
        return FAILURE if status is FAILURE else RUNNING


class Repeat(DecoratorNode):
    """Repeats its child until it has succeeded so many times, or failed once."""

    NUM_CYCLES = Port("num_cycles", int, doc="how many times; -1: without end")
    ports = (NUM_CYCLES,)

    _done = 0

    def update(self) -> Status:
        """Tick the child."""
        cycles = self.port(self.NUM_CYCLES)
        again = self._done < cycles or cycles == -1
        self.set_status(RUNNING)
        child = self.child
        while again:
            was_idle = child.node_status is IDLE
            status = child.execute_tick()
            if status is RUNNING:
                return RUNNING
            child.reset()
            if status is SKIPPED:
                return SKIPPED
            if status is FAILURE:
                self._done = 0
                return FAILURE
            self._done += 1
            again = self._done < cycles or cycles == -1
            if was_idle and again:
                return RUNNING
        self._done = 0
        return SUCCESS

    def _halt(self) -> None:
        self._done = 0
        super()._halt()


class RetryUntilSuccessful(DecoratorNode):
    """Tries its child again until it succeeds, or has failed so many times."""

    NUM_ATTEMPTS = Port("num_attempts", int, doc="how many times; -1: without end")
    ports = (NUM_ATTEMPTS,)

    _tried = 0

    def update(self) -> Status:
        """Tick the child."""
        attempts = self.port(self.NUM_ATTEMPTS)
        again = self._tried < attempts or attempts == -1
        self.set_status(RUNNING)
        child = self.child
        while again:
            was_idle = child.node_status is IDLE
            status = child.execute_tick()
            if status is RUNNING:
                return RUNNING
            child.reset()
            if status is SKIPPED:
                return SKIPPED
            if status is SUCCESS:
                self._tried = 0
                return SUCCESS
            self._tried += 1
            # The child may have changed the variable that the port refers to.
            attempts = self.port(self.NUM_ATTEMPTS)
            again = self._tried < attempts or attempts == -1
            if was_idle and again:
                return RUNNING
        self._tried = 0
        return FAILURE

    def _halt(self) -> None:
        self._tried = 0
        super()._halt()


class RunOnce(DecoratorNode):
    """Runs its child to the end once in the whole mission."""

    THEN_SKIP = Port(
        "then_skip", bool, default=True, doc="afterwards: skip, instead of the same answer again"
    )
    ports = (THEN_SKIP,)

    _answer: Status | None = None

    def update(self) -> Status:
        """Tick the child."""
        if self._answer is not None:
            return SKIPPED if self.port(self.THEN_SKIP) else self._answer
        self.set_status(RUNNING)
        status = self.child.execute_tick()
        if status is SUCCESS or status is FAILURE:
            self._answer = status
        return status
